"""The pictures of the report: overlays of both runs, differences, time lines, what a failed check looked like."""
from typing import List, NamedTuple, Optional, Tuple

import numpy as np

from ...messages.batch import Array
from ...operations.plot import thin
from ...units import mm_to_m, s_to_ms
from ..curve_distance import interpolated
from ..run import Call, PoseTrack, Track, arm_of
from ..state_checks import state_name, state_runs
from ..tolerances import Tolerances
from ..verdict import Aspect, Check, Comparison, ResidualKey
from .svg import Bar, Line, Row, chart, plane, time_line
from .warping import warping

_POINTS = 1100
_AXES = "xyz"
_MOST_CALLS = 400


class Figure(NamedTuple):
    """A caption and a picture, HTML."""

    caption: str
    picture: str


def _line(style: str, time: Array, value: Array, points: int = _POINTS) -> Line:
    good = np.isfinite(value)
    return Line(style, *thin(time[good], value[good], points))


class Pictures:
    """Draws one comparison; all times on the golden clock, s."""

    def __init__(self, comparison: Comparison, tolerances: Tolerances) -> None:
        self._comparison = comparison
        self._tolerances = tolerances
        self._golden, self._candidate = comparison.golden, comparison.candidate
        self._arms = self._golden.arms
        lag = comparison.alignment.lag
        self.range = (min(0.0, -lag), max(self._golden.duration, self._candidate.duration - lag))

    def _golden_time(self, topic: str, time: Array) -> Array:
        return self._comparison.alignment.golden_time(arm_of(topic, self._arms), time)

    def _overlay(self, title: str, unit: str, ours: Tuple[Array, Array], theirs: Tuple[Array, Array],
                 x_range: Optional[Tuple[float, float]] = None, mark: Optional[float] = None,
                 height: float = 150, least: float = 0.02) -> str:
        return chart(title, "Golden log and candidate over time, one upon the other.",
                     [_line("golden", *ours), _line("candidate", *theirs)], x_range or self.range, unit, height, mark,
                     least=least)

    def _residual(self, key: ResidualKey, x_range: Optional[Tuple[float, float]] = None,
                  mark: Optional[float] = None) -> str:
        """How far off the samples of a check are, as they were judged."""
        residual = self._comparison.residuals.get(key)
        if residual is None:
            return ""
        return chart("How far off", "Distance of both runs, less what jitter and stops allow; the stripe is allowed.",
                     [_line("difference", residual.time, residual.off)], x_range or self.range, residual.unit, 92, mark,
                     (0.0, residual.limit))

    # --- overviews ---------------------------------------------------------------------------------------------------

    def joints(self) -> List[Figure]:
        """Each joint of each topic: overlay and difference."""
        figures = []
        for topic, ours in self._golden.joints.items():
            theirs = self._candidate.joints.get(topic)
            if theirs is None or ours.names != theirs.names or len(ours.time) < 2:
                continue
            time = self._golden_time(topic, theirs.time)
            for column, name in enumerate(ours.names):
                figures.append(Figure("%s of %s" % (name, topic), self._overlay(
                    name, "rad", (ours.time, ours.value[:, column]), (time, theirs.value[:, column]))
                    + self._residual((Aspect.JOINTS, topic, name))))
        return figures

    def _poses(self) -> List[Tuple[PoseTrack, PoseTrack, Array]]:
        both = [(ours, self._candidate.poses[topic]) for topic, ours in self._golden.poses.items()
                if topic in self._candidate.poses and len(ours.time) >= 2]
        return [(ours, theirs, self._golden_time(ours.topic, theirs.time)) for ours, theirs in both]

    def paths(self) -> List[Figure]:
        """The path of each tool centre point in three planes, its coordinates, and how far apart the runs are."""
        figures = []
        worst = {check.topic: check.at for check in self._comparison.worst_first
                 if check.aspect is Aspect.POSITION and check.at is not None}
        for ours, theirs, time in self._poses():
            at = worst.get(ours.topic)
            planes = []
            for one, other in ((0, 1), (0, 2), (1, 2)):
                mark = None
                if at is not None:
                    here = interpolated(time, theirs.position, np.array([at]))[0]
                    mark = (float(here[one]), float(here[other]))
                lines = [self._path(style, track, one, other) for style, track in (("golden", ours),
                                                                                   ("candidate", theirs))]
                planes.append(plane("Path in the plane of %s and %s" % (_AXES[one], _AXES[other]),
                                    "Path of the tool centre point of both runs.", lines,
                                    (_AXES[one] + ", m", _AXES[other] + ", m"), mark))
            figures.append(Figure("Path of %s" % ours.topic, '<div class="planes">%s</div>' % "".join(planes)))
            for axis in range(3):
                figures.append(Figure("%s of %s" % (_AXES[axis], ours.topic), self._overlay(
                    _AXES[axis], "m", (ours.time, ours.position[:, axis]), (time, theirs.position[:, axis]))))
            for key, caption in (((Aspect.POSITION, ours.topic, "position"), "Distance of the two positions"),
                                 ((Aspect.ORIENTATION, ours.topic, "orientation"), "Angle of the two orientations")):
                figures.append(Figure(caption, self._residual(key)))
        return figures

    @staticmethod
    def _path(style: str, track: PoseTrack, one: int, other: int) -> Line:
        step = max(1, len(track.time) // 3000)
        points = track.position[::step]
        moved = np.concatenate([[True], np.abs(np.diff(points, axis=0)).max(axis=1) > mm_to_m(0.2)]) \
            if len(points) else np.zeros(0, bool)
        return Line(style, points[moved, one], points[moved, other])

    def timing(self) -> List[Figure]:
        """Lateness and pace of each motion, and the time warp."""
        figures = []
        alignment, limits = self._comparison.alignment, self._tolerances.timing
        for arm, episodes in alignment.episodes.items():
            alike = [episode for episode in episodes if episode.is_alike]
            if not alike:
                continue
            where = " of %s" % arm if arm else ""
            start = np.array([episode.start for episode in alike for _ in range(3)])
            end = np.array([episode.end for episode in alike for _ in range(3)])
            time = np.where(np.arange(len(start)) % 3 == 0, start, end)
            gap = np.arange(len(start)) % 3 == 2

            def steps(values: List[float], gaps: Array = gap) -> Array:
                return np.where(gaps, np.nan, np.repeat(np.array(values), 3))

            late = steps([s_to_ms(episode.lag - alignment.lag) for episode in alike])
            figures.append(Figure("How late each motion%s begins, beyond the common lag" % where, chart(
                "Lateness", "A dash for each motion.", [Line("difference", time, late)], self.range, "ms", 110,
                band=(-s_to_ms(limits.event_s), s_to_ms(limits.event_s)))))
            pace = steps([np.nan if episode.pace is None else 100.0 * (episode.pace - 1.0) for episode in alike])
            figures.append(Figure("How much longer each motion%s lasts" % where, chart(
                "Pace", "A dash for each motion.", [Line("difference", time, pace)], self.range, "%", 110,
                band=(-limits.pace_percent, limits.pace_percent))))
        for topic, ours in self._golden.joints.items():
            theirs = self._candidate.joints.get(topic)
            if theirs is None or ours.value.shape != ours.value[:, :theirs.value.shape[1]].shape:
                continue
            warp = warping(ours.time, ours.value, theirs.time - alignment.lag, theirs.value)
            if warp is not None:
                figures.append(Figure("Time warp of %s, beyond the common lag (to look at, never a verdict)" % topic,
                                      chart("Time warp", "How much later the candidate passes the same place.",
                                            [Line("warp", warp[0], warp[1])], self.range, "s", 110, least=0.1)))
        return figures

    def time_lines(self, x_range: Optional[Tuple[float, float]] = None, mark: Optional[float] = None) -> List[Figure]:
        """States and calls of both runs."""
        rows: List[Row] = []
        for topic, ours in self._golden.states.items():
            theirs = self._candidate.states.get(topic)
            prefix = topic.rsplit("/", 2)[0].strip("/")
            for column, name in enumerate(ours.names):
                label = "%s %s" % (prefix, name) if prefix else name
                rows.append(Row(label + ", golden", self._state_bars(ours, column, 0.0, self._golden.duration)))
                if theirs is not None and name in theirs.names:
                    rows.append(Row("candidate", self._state_bars(theirs, theirs.names.index(name),
                                                                  self._comparison.alignment.lag,
                                                                  self._candidate.duration)))
        for service in sorted({call.service for call in self._golden.calls + self._candidate.calls}):
            for run, lag, label in ((self._golden, 0.0, service.strip("/").replace("jaka_driver/", "") + ", golden"),
                                    (self._candidate, self._comparison.alignment.lag, "candidate")):
                calls = [call for call in run.calls if call.service == service]
                if x_range is not None:
                    calls = [call for call in calls if call.end - lag >= x_range[0] and call.start - lag <= x_range[1]]
                rows.append(Row(label, [_call_bar(call, lag) for call in calls[:_MOST_CALLS]]))
            if not (rows[-1].bars or rows[-2].bars):
                del rows[-2:]
        if not rows:
            return []
        return [Figure("States and calls", time_line(
            "States and calls", "For each state field and service one row of the golden log and one of the candidate.",
            rows, x_range or self.range, mark))]

    @staticmethod
    def _state_bars(track: Track, column: int, lag: float, until: float) -> List[Bar]:
        name = track.names[column]
        bars = []
        for run in state_runs(track, column, until):
            words = state_name(name, run.value)
            bars.append(Bar(run.start - lag, run.end - lag, "state state%d" % (run.value % 6), words,
                            "%s %s from %.3f s to %.3f s" % (name, words, run.start - lag, run.end - lag)))
        return bars

    # --- one check ---------------------------------------------------------------------------------------------------

    def moment(self, check: Check) -> List[Figure]:
        """What happened around the worst moment of a check; nothing where it has none."""
        if check.at is None:
            return []
        span = (check.at - 1.0, check.at + 1.0)
        if check.aspect is Aspect.JOINTS and check.topic in self._golden.joints:
            return self._joint_moment(check, span)
        if check.aspect in (Aspect.POSITION, Aspect.ORIENTATION):
            return self._pose_moment(check, span)
        if check.aspect in (Aspect.PACE, Aspect.TIMING):
            return self._motion_moment(check)
        if check.aspect is Aspect.FIELDS:
            return self._field_moment(check, span)
        if check.aspect in (Aspect.STATES, Aspect.CALLS, Aspect.DURATIONS, Aspect.RESPONSES, Aspect.GAPS):
            return [figure._replace(caption="States and calls around the moment")
                    for figure in self.time_lines((check.at - 2.0, check.at + 4.0), check.at)]
        return self._stamp_moment(check, span) if check.aspect is Aspect.STAMPS else []

    def _joint_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        ours, theirs = self._golden.joints[check.topic], self._candidate.joints.get(check.topic)
        if theirs is None or check.field not in ours.names or check.field not in theirs.names:
            return []
        column = ours.names.index(check.field)
        time = self._golden_time(check.topic, theirs.time)
        return [Figure("%s, one second to either side" % check.field, self._overlay(
            check.field, "rad", (ours.time, ours.value[:, column]),
            (time, theirs.value[:, theirs.names.index(check.field)]), span, check.at, least=0.005))]

    def _pose_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        figures = []
        for ours, theirs, time in self._poses():
            if ours.topic != check.topic:
                continue
            if check.aspect is Aspect.ORIENTATION:
                return [Figure("Angle of the two orientations, one second to either side",
                               self._residual((check.aspect, check.topic, check.field), span, check.at))]
            at = np.array([check.at])
            off = np.abs(interpolated(time, theirs.position, at) - interpolated(ours.time, ours.position, at))[0]
            axis = int(np.argmax(off))
            figures.append(Figure("%s, the coordinate farthest off, one second to either side" % _AXES[axis],
                                  self._overlay(_AXES[axis], "m", (ours.time, ours.position[:, axis]),
                                                (time, theirs.position[:, axis]), span, check.at, least=0.002)))
        return figures

    def _motion_moment(self, check: Check) -> List[Figure]:
        """The joint that moves most."""
        figures: List[Figure] = []
        for episode in self._comparison.alignment.episodes.get(check.topic, ()):
            if episode.start != check.at:
                continue
            for topic, ours in self._golden.joints.items():
                theirs = self._candidate.joints.get(topic)
                if arm_of(topic, self._arms) != check.topic or theirs is None or figures:
                    continue
                first, last = np.searchsorted(ours.time, (episode.start, episode.end))
                part = ours.value[first:max(int(last), int(first) + 1)]
                column = int(np.argmax(part.max(axis=0) - part.min(axis=0)))
                is_pace = check.aspect is Aspect.PACE
                lag = episode.lag if is_pace else self._comparison.alignment.lag
                figures.append(Figure("%s, at the lag of %s" % (ours.names[column], "this motion" if is_pace
                                                                else "all motions together"),
                                      self._overlay(ours.names[column], "rad", (ours.time, ours.value[:, column]),
                                                    (theirs.time - lag, theirs.value[:, column]),
                                                    (episode.start - 0.5, episode.end + 0.5),
                                                    episode.end if is_pace else episode.start)))
        return figures

    def _field_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        ours = self._golden.fields.get(check.topic, {}).get(check.field)
        theirs = self._candidate.fields.get(check.topic, {}).get(check.field)
        if ours is None or theirs is None or not ours.value.shape[1] or not theirs.value.shape[1]:
            return []
        time = self._golden_time(check.topic, theirs.time)
        return [Figure("%s, one second to either side" % check.field, self._overlay(
            check.field, "", (ours.time, ours.value[:, 0]), (time, theirs.value[:, 0]), span, check.at, least=0.0))]

    def _stamp_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        lines: List[Line] = []
        for run, style, lag in ((self._golden, "golden", 0.0),
                                (self._candidate, "candidate", self._comparison.alignment.lag)):
            stream = run.streams.get(check.topic)
            if stream is not None and stream.stamp is not None:
                lines.append(_line(style, stream.log_time - lag, s_to_ms(1.0) * (stream.log_time - stream.stamp)))
        return [Figure("Log time - header.stamp, one second to either side", chart(
            "Latency", "How old the stamps are when they are recorded.", lines, span, "ms", 130, check.at,
            least=5.0))] if lines else []


def _call_bar(call: Call, lag: float) -> Bar:
    words = "%s, %.3f s, %s" % (call.words, call.duration, "succeeded" if call.success else "failed: " + call.error)
    return Bar(call.start - lag, call.end - lag, "call" if call.success else "call failed", "", "%s at %.3f s"
               % (words, call.start - lag))
