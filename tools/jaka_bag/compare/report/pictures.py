"""The pictures of the report: overlays of both runs, differences, time lines, what a failed check looked like."""
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array
from ...operations.thinning import EveryNth, MinMax
from ...units import mm_to_m, s_to_ms
from ..checks.state_checks import state_name, state_runs
from ..matching.alignment import Episode
from ..matching.curve_distance import interpolated
from ..runs.run import Call, LongTrack, Track, arm_of
from ..tolerances import Tolerances
from ..verdict import Aspect, Check, Comparison, ResidualKey
from .svg import Bar, Line, Row, bounded_row, chart, plane, time_line
from .warping import warping

_POINTS = 1100
"""Points of a curve: about one for each pixel of its width."""
_PATH_POINTS = 3000
"""Points of a tool's path, which has no width of pixels: corners stay sharp, and the page small."""
_MARGIN_S = 0.5
"""Time, s, that is read on both sides of what is drawn."""
_OVERLAID = "Golden log and candidate over time, one upon the other."
_AXES = "xyz"
_MOST_FAILED = 5
"""Failed calls whose error a picture's caption has, at most: it is read at a glance."""


class Figure(NamedTuple):
    """A caption and a picture, HTML."""

    caption: str
    picture: str


def _line(style: str, time: Array, value: Array) -> Line:
    good = np.isfinite(value)
    curve = MinMax(_POINTS)
    curve.add(time[good], value[good])
    return Line(style, *curve.points())


def _path(style: str, points: Array, one: int, other: int) -> Line:
    """Return the path in the plane of two axes, without the points where the arm stands."""
    moved = np.abs(np.diff(points, axis=0, prepend=np.inf)).max(axis=1) > mm_to_m(0.2)
    return Line(style, points[moved, one], points[moved, other])


class _Whole(NamedTuple):
    """All of a track, to be drawn: the curve of each column, and the points of the path of the first three."""

    lines: List[Line]
    path: Array


def _dashes(episodes: Sequence[Episode], values: Sequence[float]) -> Line:
    """Return a dash at each motion's value, as long as the motion."""
    points = [point for episode, value in zip(episodes, values)
              for point in ((episode.start, value), (episode.end, value), (episode.end, np.nan))]
    return Line("difference", *np.array(points).T)


class Pictures:
    """The pictures of one comparison; all times on the golden clock, s."""

    def __init__(self, comparison: Comparison, tolerances: Tolerances) -> None:
        self._comparison = comparison
        self._tolerances = tolerances
        self._golden, self._candidate = comparison.golden, comparison.candidate
        self._arms = self._golden.arms
        self._lag = comparison.alignment.lag
        self.range = (min(0.0, -self._lag), max(self._golden.duration, self._candidate.duration - self._lag))

        self._wholes: Dict[Tuple[str, str], _Whole] = {}

    def _golden_time(self, track: Track) -> Array:
        return self._comparison.alignment.golden_time(arm_of(track.topic, self._arms), track.time)

    def _whole(self, style: str, track: LongTrack) -> _Whole:
        """Return the curves of a track on the golden clock; read the track only once."""
        key = style, track.topic
        if key not in self._wholes:
            curves = [MinMax(_POINTS) for _ in track.names]
            path = EveryNth(_PATH_POINTS)
            for block in track.blocks():
                time = block.time if style == "golden" else self._golden_time(block)
                for curve, values in zip(curves, block.value.T):
                    good = np.isfinite(values)
                    curve.add(time[good], values[good])
                path.add(block.value[:, :3])
            self._wholes[key] = _Whole([Line(style, *curve.points()) for curve in curves], path.rows())
        return self._wholes[key]

    def _overview(self, title: str, unit: str, ours: LongTrack, theirs: LongTrack, column: int) -> str:
        """Draw the whole of one column of both runs, with the candidate aligned."""
        return chart(title, _OVERLAID, [self._whole("golden", ours).lines[column],
                                        self._whole("candidate", theirs).lines[column]], self.range, unit, least=0.02)

    def _close_up(self, title: str, unit: str, ours: LongTrack, theirs: LongTrack, column: int,
                  x_range: Tuple[float, float], mark: Optional[float], least: float,
                  lag: Optional[float] = None) -> str:
        """Draw one column of both runs between two times, s, with the candidate aligned, or at one lag, s."""
        here, there = ours.around(*x_range), self._around(theirs, *x_range, lag)
        time = self._golden_time(there) if lag is None else there.time - lag
        lines = [_line("golden", here.time, here.value[:, column]), _line("candidate", time, there.value[:, column])]
        return chart(title, _OVERLAID, lines, x_range, unit, mark=mark, least=least)

    def _around(self, theirs: LongTrack, begin: float, end: float, lag: Optional[float] = None) -> Track:
        """Return the candidate's samples between two golden times, s."""
        if lag is not None:
            return theirs.around(begin + lag, end + lag)
        arm = arm_of(theirs.topic, self._arms)
        low, high = (self._comparison.alignment.candidate_time(arm, time) for time in (begin, end))
        return theirs.around(low, max(high, low))

    def _residual(self, key: ResidualKey, x_range: Optional[Tuple[float, float]] = None,
                  mark: Optional[float] = None) -> str:
        """Draw the deviations of a check's samples, as they were judged."""
        residual = self._comparison.residuals.get(key)
        if residual is None:
            return ""
        line = Line("difference", residual.time, residual.off) if x_range is None \
            else _line("difference", residual.near_time, residual.near_off)
        return chart("How far off", "Distance of both runs, less what jitter and stops allow; the stripe is allowed.",
                     [line], x_range or self.range, residual.unit, 92, mark, envelope=residual.envelope)

    # --- overviews ---------------------------------------------------------------------------------------------------

    def joints(self) -> List[Figure]:
        """Draw each joint of each topic: overlay and difference."""
        figures = []
        for topic, ours in self._golden.joints.items():
            theirs = self._candidate.joints.get(topic)
            if theirs is None or ours.names != theirs.names or ours.facts.count < 2:
                continue
            for column, name in enumerate(ours.names):
                picture = self._overview(name, "rad", ours, theirs, column)
                figures.append(Figure("%s of %s" % (name, topic),
                                      picture + self._residual((Aspect.JOINTS, topic, name))))
        return figures

    def paths(self) -> List[Figure]:
        """Draw the path of each tool centre point in three planes, its coordinates, and the distance of the runs."""
        figures = []
        worst = {check.topic: check.at for check in self._comparison.worst_first
                 if check.aspect is Aspect.POSITION and check.at is not None}
        for topic, ours in self._golden.poses.items():
            theirs = self._candidate.poses.get(topic)
            if theirs is None or ours.facts.count < 2:
                continue
            here = self._value_at(theirs, worst[topic]) if topic in worst else None
            paths = [(style, self._whole(style, pose).path)
                     for style, pose in (("golden", ours), ("candidate", theirs))]
            planes = [plane("Path in the plane of %s and %s" % (_AXES[one], _AXES[other]),
                            "Path of the tool centre point of both runs.",
                            [_path(style, points, one, other) for style, points in paths],
                            (_AXES[one] + ", m", _AXES[other] + ", m"),
                            None if here is None else (float(here[one]), float(here[other])))
                      for one, other in ((0, 1), (0, 2), (1, 2))]
            figures.append(Figure("Path of %s" % topic, '<div class="planes">%s</div>' % "".join(planes)))
            figures += [Figure("%s of %s" % (name, topic), self._overview(name, "m", ours, theirs, axis))
                        for axis, name in enumerate(_AXES)]
            figures += [
                Figure("Distance of the two positions", self._residual((Aspect.POSITION, topic, "position"))),
                Figure("Angle of the two orientations", self._residual((Aspect.ORIENTATION, topic, "orientation")))]
        return figures

    def timing(self) -> List[Figure]:
        """Draw lateness and pace of each motion, and the time warp."""
        figures = []
        limits = self._tolerances.timing
        for arm, episodes in self._comparison.alignment.episodes.items():
            alike = [episode for episode in episodes if episode.is_alike]
            if not alike:
                continue
            where = " of %s" % arm if arm else ""
            late = _dashes(alike, [s_to_ms(episode.lag - self._lag) for episode in alike])
            figures.append(Figure("How late each motion%s begins, beyond the common lag" % where, chart(
                "Lateness", "A dash for each motion.", [late], self.range, "ms", 110,
                band=(-s_to_ms(limits.event_s), s_to_ms(limits.event_s)))))
            pace = _dashes(alike, [np.nan if episode.pace is None else 100.0 * (episode.pace - 1.0)
                                   for episode in alike])
            figures.append(Figure("How much longer each motion%s lasts" % where, chart(
                "Pace", "A dash for each motion.", [pace], self.range, "%", 110,
                band=(-limits.pace_percent, limits.pace_percent))))
        for topic, ours in self._golden.joints.items():
            theirs = self._candidate.joints.get(topic)
            if theirs is None or len(ours.names) != len(theirs.names):
                continue
            warp = warping(ours, theirs, self._lag)
            if warp is not None:
                figures.append(Figure("Time warp of %s, beyond the common lag (to look at, never a verdict)" % topic,
                                      chart("Time warp", "How much later the candidate passes the same place.",
                                            [Line("warp", *warp)], self.range, "s", 110, least=0.1)))
        return figures

    def time_lines(self, x_range: Optional[Tuple[float, float]] = None, mark: Optional[float] = None) -> List[Figure]:
        """Draw states and calls of both runs; between two times, s, without the states that are the same throughout."""
        rows: List[Row] = []
        steady: List[str] = []
        for topic, ours in self._golden.states.items():
            theirs = self._candidate.states.get(topic)
            prefix = topic.rsplit("/", 2)[0].strip("/")
            for column, name in enumerate(ours.names):
                label = "%s %s" % (prefix, name) if prefix else name
                pair = [_state_bars(ours, column, 0.0, self._golden.duration)]
                if theirs is not None and name in theirs.names:
                    pair.append(_state_bars(theirs, theirs.names.index(name), self._lag, self._candidate.duration))
                values = {bar.text for bars in pair for bar in bars if x_range is not None
                          and bar.end >= x_range[0] and bar.start <= x_range[1]}
                if len(pair) == 2 and len(values) == 1:
                    steady.append("%s %s" % (label, values.pop()))
                else:
                    rows += [Row(words, bars) for words, bars in zip((label + ", golden", "candidate"), pair)]
        failed: List[str] = []
        for service in sorted({call.service for call in self._golden.calls + self._candidate.calls}):
            for run, lag, label in ((self._golden, 0.0, service.strip("/").replace("jaka_driver/", "") + ", golden"),
                                    (self._candidate, self._lag, "candidate")):
                calls = [call for call in run.calls if call.service == service]
                if x_range is not None:
                    calls = [call for call in calls if call.end - lag >= x_range[0] and call.start - lag <= x_range[1]]
                    whose = "golden log" if run is self._golden else "candidate"
                    failed += ["%s at %.2f s of the %s failed: %s" % (
                        call.short_name, call.start - lag, whose, call.error) for call in calls if not call.success]
                rows.append(bounded_row(label, [_call_bar(call, lag) for call in calls]))
            if not (rows[-1].bars or rows[-2].bars):
                del rows[-2:]
        if not rows:
            return []
        more = (["the same throughout: " + ", ".join(steady)] if steady else []) + failed[:_MOST_FAILED]
        return [Figure("; ".join(["States and calls", *more]), time_line(
            "States and calls", "For each state field and service one row of the golden log and one of the candidate.",
            rows, x_range or self.range, mark))]

    def _value_at(self, theirs: LongTrack, at: float) -> Array:
        """Return the candidate's values at a golden time, s."""
        near = self._around(theirs, at, at)
        value: Array = interpolated(self._golden_time(near), near.value, np.array([at]))[0]
        return value

    # --- one check ---------------------------------------------------------------------------------------------------

    def moment(self, check: Check) -> List[Figure]:
        """Draw what happened around the worst moment of a check; nothing where it has none."""
        if check.at is None:
            return []
        span = (check.at - 1.0, check.at + 1.0)
        if check.aspect is Aspect.JOINTS and check.topic in self._golden.joints:
            return self._joint_moment(check, span)
        if check.aspect is Aspect.ORIENTATION:
            return [Figure("Angle of the two orientations, one second to either side",
                           self._residual((check.aspect, check.topic, check.field), span, check.at))]
        if check.aspect is Aspect.POSITION:
            return self._position_moment(check, check.at, span)
        if check.aspect in (Aspect.PACE, Aspect.TIMING):
            return self._motion_moment(check)
        if check.aspect is Aspect.FIELDS:
            return self._field_moment(check, span)
        if check.aspect in (Aspect.STATES, Aspect.CALLS, Aspect.DURATIONS, Aspect.RESPONSES, Aspect.GAPS):
            return self.time_lines((check.at - 2.0, check.at + 4.0), check.at)
        return self._stamp_moment(check, span) if check.aspect is Aspect.STAMPS else []

    def _joint_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        ours, theirs = self._golden.joints[check.topic], self._candidate.joints.get(check.topic)
        if theirs is None or check.field not in ours.names:
            return []
        return [Figure("%s, one second to either side" % check.field, self._close_up(
            check.field, "rad", ours, theirs, ours.names.index(check.field), span, check.at, 0.005))]

    def _position_moment(self, check: Check, at: float, span: Tuple[float, float]) -> List[Figure]:
        ours, theirs = self._golden.poses.get(check.topic), self._candidate.poses.get(check.topic)
        if ours is None or theirs is None or ours.facts.count < 2:
            return []
        near = ours.around(at, at)
        here, there = interpolated(near.time, near.value, np.array([at]))[0], self._value_at(theirs, at)
        axis = int(np.argmax(np.abs(there - here)[:3]))
        return [Figure("%s, the coordinate farthest off, one second to either side" % _AXES[axis],
                       self._close_up(_AXES[axis], "m", ours, theirs, axis, span, at, 0.002))]

    def _motion_moment(self, check: Check) -> List[Figure]:
        """Draw the joint that moves most."""
        episodes = self._comparison.alignment.episodes.get(check.topic, ())
        episode = next((episode for episode in episodes if episode.start == check.at), None)
        topic = next((topic for topic in self._golden.joints
                      if topic in self._candidate.joints and arm_of(topic, self._arms) == check.topic), None)
        if episode is None or topic is None:
            return []
        ours = self._golden.joints[topic]
        part = ours.around(episode.start, episode.end).value
        column = int(np.argmax(part.max(axis=0) - part.min(axis=0)))
        lag, whose, mark = (episode.lag, "this motion", episode.end) if check.aspect is Aspect.PACE \
            else (self._lag, "all motions together", episode.start)
        return [Figure("%s, at the lag of %s" % (ours.names[column], whose), self._close_up(
            ours.names[column], "rad", ours, self._candidate.joints[topic], column,
            (episode.start - 0.5, episode.end + 0.5), mark, 0.02, lag))]

    def _field_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        ours = self._golden.fields.get(check.topic, {}).get(check.field)
        theirs = self._candidate.fields.get(check.topic, {}).get(check.field)
        if ours is None or theirs is None or not ours.names or not theirs.names:
            return []
        return [Figure("%s, one second to either side" % check.field,
                       self._close_up(check.field, "", ours, theirs, 0, span, check.at, 0.0))]

    def _stamp_moment(self, check: Check, span: Tuple[float, float]) -> List[Figure]:
        lines: List[Line] = []
        for run, style, lag in ((self._golden, "golden", 0.0), (self._candidate, "candidate", self._lag)):
            stream = run.streams.get(check.topic)
            if stream is not None and stream.is_stamped:
                time, stamp, _ = stream.between(span[0] + lag - _MARGIN_S, span[1] + lag + _MARGIN_S)
                if stamp is not None:
                    lines.append(_line(style, time - lag, s_to_ms(1.0) * (time - stamp)))
        return [Figure("Log time - header.stamp, one second to either side", chart(
            "Latency", "How old the stamps are when they are recorded.", lines, span, "ms", 130, check.at,
            least=5.0))] if lines else []


def _state_bars(track: Track, column: int, lag: float, until: float) -> List[Bar]:
    name = track.names[column]
    bars = []
    for run in state_runs(track, column, until):
        words = state_name(name, run.value)
        bars.append(Bar(run.start - lag, run.end - lag, "state state%d" % (run.value % 6), words,
                        "%s %s from %.3f s to %.3f s" % (name, words, run.start - lag, run.end - lag)))
    return bars


def _call_bar(call: Call, lag: float) -> Bar:
    words = "%s, %.3f s, %s" % (call.words, call.duration, "succeeded" if call.success else "failed: " + call.error)
    return Bar(call.start - lag, call.end - lag, "call" if call.success else "call failed", "", "%s at %.3f s"
               % (words, call.start - lag))
