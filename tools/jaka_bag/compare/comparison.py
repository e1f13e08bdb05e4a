"""Compares two logs: all checks in their order."""
import dataclasses
from typing import Dict, List, Optional, TypeVar

from ..errors import BagError
from ..paths import PathLike
from ..pipeline import in_order
from .alignment import align, arms_of
from .call_checks import call_checks
from .cut_motions import Cut, cut_motions, fit_ends
from .loading import load_run
from .motion_checks import coverage_check, motion_checks, timing_checks
from .run import Run
from .state_checks import state_checks
from .stream_checks import common_time, stream_checks, type_checks
from .tolerances import Tolerances
from .verdict import Comparison

Value = TypeVar("Value")


class CannotCompare(BagError):
    """The logs have nothing that could be compared, or one of them cannot be read."""


def _scaled(tolerances: Tolerances, time_scale: float) -> Tolerances:
    """Latencies of the host are the same at any speed: in the log's time they grow with it."""
    if time_scale == 1.0:
        return tolerances
    timing, states, calls = tolerances.timing, tolerances.states, tolerances.calls
    return dataclasses.replace(
        tolerances,
        timing=dataclasses.replace(timing, event_s=timing.event_s * time_scale, cut_ms=timing.cut_ms * time_scale,
                                   jitter_ms=timing.jitter_ms * time_scale,
                                   pace_floor_ms=timing.pace_floor_ms * time_scale),
        states=dataclasses.replace(states, brief_s=states.brief_s * time_scale,
                                   timing_s=states.timing_s * time_scale),
        calls=dataclasses.replace(calls, duration_s=calls.duration_s * time_scale,
                                  timing_s=calls.timing_s * time_scale))


def compare_runs(golden: Run, candidate: Run, tolerances: Optional[Tolerances] = None,
                 time_scale: float = 1.0) -> Comparison:
    """Compare two logs that were read.

    Args:
        golden: What ought to happen.
        candidate: What happened; read with the same ``time_scale``.
        tolerances: How far it may be off; None for the defaults.
        time_scale: The candidate ran this many times faster.

    Raises:
        CannotCompare: The logs have no topic in common.
    """
    limits = _scaled(tolerances or Tolerances(), time_scale)
    checks = type_checks(golden, candidate, limits)
    comparable = [topic for topic, stream in golden.streams.items()
                  if topic in candidate.streams and candidate.streams[topic].types == stream.types]
    if not comparable:
        raise CannotCompare("%s and %s have no topic of the same type in common" % (golden.path, candidate.path))
    ours, theirs = _only(golden, comparable), _only(candidate, comparable)
    arms = arms_of(ours, theirs)
    cuts: Dict[str, List[Cut]] = {name: cut_motions(ours, name, arm) for name, arm in arms.items()}
    alignment = align(ours, theirs, arms, {name: fit_ends(found) for name, found in cuts.items()},
                      max(limits.joints.position_rad, 1e-4))
    call_topics = {call.topic for call in golden.calls + candidate.calls}
    checks += stream_checks(ours, theirs, alignment, limits,
                            [topic for topic in sorted(comparable) if topic not in call_topics], time_scale)
    checks.append(coverage_check(ours, theirs, bool(arms), alignment, limits))
    checks += timing_checks(alignment, cuts, limits)
    motion, residuals = motion_checks(ours, theirs, alignment, cuts, limits)
    checks += motion
    checks += state_checks(ours, theirs, alignment, limits)
    checks += call_checks(ours, theirs, alignment, limits, common_time(ours, theirs, alignment))
    return Comparison(golden, candidate, alignment, tuple(checks), residuals, time_scale)


def _only(run: Run, topics: List[str]) -> Run:
    """The part of a run that these topics make."""
    return dataclasses.replace(run, streams=_pick(run.streams, topics), joints=_pick(run.joints, topics),
                               poses=_pick(run.poses, topics), states=_pick(run.states, topics),
                               fields=_pick(run.fields, topics),
                               calls=tuple(call for call in run.calls if call.topic in topics))


def _pick(part: Dict[str, Value], topics: List[str]) -> Dict[str, Value]:
    return {topic: value for topic, value in part.items() if topic in topics}


def compare_logs(golden: PathLike, candidate: PathLike, tolerances: Optional[Tolerances] = None,
                 time_scale: float = 1.0) -> Comparison:
    """Read two logs and compare them; see ``compare_runs``.

    Raises:
        CannotCompare: A log cannot be read, or they have no topic in common.
    """
    limits = tolerances or Tolerances()
    try:
        runs = list(in_order(lambda log: load_run(log[0], limits, log[1]), ((golden, 1.0), (candidate, time_scale))))
    except CannotCompare:
        raise
    except BagError as error:
        raise CannotCompare(str(error)) from error
    return compare_runs(runs[0], runs[1], limits, time_scale)
