"""The comparison of two logs: all checks in their order."""
import dataclasses
import heapq
from typing import Any, Dict, Iterator, List, Optional, Tuple

from ..errors import BagError
from ..paths import PathLike
from .checks.aligned_samples import Frame
from .checks.call_checks import call_checks
from .checks.content_checks import Counts, content_checks, messages_more_or_less
from .checks.motion_checks import RESOLUTION, motion_watches
from .checks.state_checks import state_checks
from .checks.stream_checks import common_time, stream_checks, stream_watches, type_checks
from .checks.timing_checks import coverage_check, timing_checks
from .coverage import coverage_of
from .matching.alignment import Aligner, arms_of
from .matching.course import Course
from .matching.cut_motions import Cut, cut_motions, fit_ends
from .runs.loading import load_run
from .runs.run import Run, TimeWindow
from .tolerances import Tolerances
from .unmatched import unmatched_names
from .verdict import Comparison, Residual, ResidualKey


class CannotCompare(BagError):
    """The logs have nothing that could be compared, or one of them cannot be read."""


def scaled(tolerances: Tolerances, time_scale: float) -> Tolerances:
    """Return the tolerances for a candidate that ran faster than real time.

    Latencies of the host are the same at any speed, so that they grow with it in the log's time.
    """
    def grown(section: Any, *names: str) -> Any:
        return dataclasses.replace(section, **{name: time_scale * getattr(section, name) for name in names})

    return dataclasses.replace(
        tolerances, timing=grown(tolerances.timing, "event_s", "cut_ms", "jitter_ms", "stale_ms", "wait_s",
                                         "pace_floor_ms"),
        states=grown(tolerances.states, "brief_s", "timing_s"),
        calls=grown(tolerances.calls, "duration_s", "timing_s"),
        streams=dataclasses.replace(tolerances.streams, gap_length_s=max(time_scale, 1.0)
                                    * tolerances.streams.gap_length_s))


def compare_runs(golden: Run, candidate: Run, tolerances: Optional[Tolerances] = None,
                 time_scale: float = 1.0, resolution: float = RESOLUTION) -> Comparison:
    """Compare two logs that were read.

    Args:
        golden: The golden log.
        candidate: The candidate; read with the same ``time_scale``.
        tolerances: Limits for deviations; None for the defaults.
        time_scale: The candidate ran this many times faster.
        resolution: Share of a limit below which a sample's deviation is not resolved. A finer one takes longer
            and changes no outcome.

    Raises:
        CannotCompare: The logs have no topic in common.
    """
    limits = scaled(tolerances or Tolerances(), time_scale)
    checks = type_checks(golden, candidate, limits)
    comparable = [topic for topic, stream in golden.streams.items()
                  if topic in candidate.streams and candidate.streams[topic].types == stream.types]
    if not comparable:
        raise CannotCompare("%s and %s have no topic of the same type in common" % (golden.path, candidate.path))
    ours, theirs = _only(golden, comparable), _only(candidate, comparable)
    arms = arms_of(ours, theirs)
    cuts: Dict[str, List[Cut]] = {name: cut_motions(ours, name, arm) for name, arm in arms.items()}
    course = Course(limits)
    aligner = Aligner(ours, theirs, arms, {name: fit_ends(found) for name, found in cuts.items()}, course.good_fit)
    alignment = aligner.alignment
    call_topics = {call.topic for call in golden.calls + candidate.calls}
    topics = [topic for topic in sorted(comparable) if topic not in call_topics]
    streams = stream_watches(ours, theirs, alignment, limits, topics, time_scale)
    slack = {topic: messages_more_or_less(ours.streams[topic], golden.duration, limits.streams.gap_s)
             for topic in topics}
    on_change = {topic: count for topic, count in slack.items() if count is not None}
    own = frozenset((*ours.joints, *ours.poses, *ours.states))
    common = common_time(ours, theirs, alignment)
    motion, watches = motion_watches(ours, theirs, Frame(alignment, limits, ours.arms, cuts, resolution, common,
                                                         golden.duration, on_change, time_scale))
    for is_candidate, (begin, end) in _in_step(golden.windows, candidate.windows, alignment.lag):
        for stream in streams[is_candidate].values():
            stream.take(begin, end)
        if is_candidate:
            aligner.fit_until(end)
            for watch in watches:
                watch.take(begin, end)
    residuals: Dict[ResidualKey, Residual] = {}
    checks += stream_checks(*streams, alignment, limits, time_scale, on_change, own)
    checks.append(coverage_check(ours, theirs, bool(arms), alignment, limits, on_change))
    checks += timing_checks(alignment, cuts, limits)
    checks += motion
    for watch in watches:
        checks += watch.checks(residuals)
    checks += state_checks(ours, theirs, alignment, limits, course)
    counts = {} if time_scale != 1.0 else {topic: Counts(watch.count, streams[1][topic].count, *common)
                                           for topic, watch in streams[0].items()}
    checks += content_checks(ours, theirs, alignment, limits, on_change, own, course, counts)
    checks += call_checks(ours, theirs, alignment, limits, common, course.outer_call)
    return Comparison(golden, candidate, alignment, tuple(checks), residuals, time_scale, course,
                      coverage_of(golden, candidate, limits, comparable, on_change, time_scale),
                      unmatched_names(golden, limits))


def _in_step(golden: Tuple[TimeWindow, ...], candidate: Tuple[TimeWindow, ...],
             lag: float) -> Iterator[Tuple[bool, TimeWindow]]:
    """Merge the windows of both logs by time, so that the same time of both is read soon after each other.

    Each comes with whether it is the candidate's.
    """
    ordered = heapq.merge(((window[0], False, window) for window in golden),
                          ((window[0] - lag, True, window) for window in candidate))
    for _, is_candidate, window in ordered:
        yield is_candidate, window


def _only(run: Run, topics: List[str]) -> Run:
    """Return the part of a run in these topics."""
    parts: Dict[str, Any] = {name: {topic: value for topic, value in getattr(run, name).items() if topic in topics}
                             for name in ("streams", "joints", "poses", "states", "fields", "contents")}
    return dataclasses.replace(run, **parts, calls=tuple(call for call in run.calls if call.topic in topics))


def compare_logs(golden: PathLike, candidate: PathLike, tolerances: Optional[Tolerances] = None,
                 time_scale: float = 1.0) -> Comparison:
    """Read two logs and compare them; see ``compare_runs``.

    Raises:
        CannotCompare: A log cannot be read, or they have no topic in common.
    """
    limits = tolerances or Tolerances()
    try:
        # one after the other: threads that decode small arrays wait for each other most of the time
        ours, theirs = load_run(golden, limits), load_run(candidate, limits, time_scale)
    except BagError as error:
        raise CannotCompare(str(error)) from error
    return compare_runs(ours, theirs, limits, time_scale)
