"""The motions of a log that no call and no message in it began: a replay of those cannot repeat them."""
from typing import Callable, List, Mapping, NamedTuple, Optional, Sequence

from jaka_bag.compare.runs.run import Call, Run, TimeWindow, arm_of

from .driver_inputs import Input, SentMessage

MOVING_SERVICES = ("joint_move", "linear_move", "jog", "servo_j", "servo_p", "drag_move", "resume", "play")
"""Services that begin a motion, or let one go on."""
_QUEUEING_SERVICES = ("joint_move", "linear_move")
_EARLY_S = 0.1
"""Longest time, s, by which a motion is seen before its call: speeds are taken over samples to either side."""
_REACTION_S = 1.2
"""Longest time, s, from a call's end to the motion that it began: the driver stops an arm that begins 1 s late."""
_BETWEEN_QUEUED_S = 1.0
"""Longest rest, s, between two moves that the controller queued."""


class UncausedMotion(NamedTuple):
    """A motion that no call began.

    Attributes:
        arm: Namespace of the arm.
        start: Its begin, s since the log's.
        end: Its end, s since the log's.
        is_guided: Hand guiding was switched on by a call.
    """

    arm: str
    start: float
    end: float
    is_guided: bool


def uncaused_motions(run: Run, inputs: Sequence[Input], moments: Mapping[str, Sequence[float]]) -> List[UncausedMotion]:
    """Return the motions that neither a call, a message nor another known cause began, arm by arm.

    A move that waited in the controller's queue, a motion within the time of a call or of a program that a call began,
    and one behind a resumption count as begun by their call.

    Args:
        run: The log.
        inputs: The calls and messages that are made again, by time.
        moments: By arm: times, s since the log's begin, at which something else made the arm move, as a scenario's
            events do.
    """
    found: List[UncausedMotion] = []
    for arm in run.arms:
        motions = next((track.facts.motions for topic, track in sorted(run.joints.items())
                        if arm_of(topic, run.arms) == arm and topic.endswith("/joint_position")), ())
        calls = [call for call in inputs if arm_of(call.service, run.arms) == arm]
        found += _uncaused(arm, motions, calls, moments.get(arm, ()))
    return found


def _uncaused(arm: str, motions: Sequence[TimeWindow], inputs: Sequence[Input],
              moments: Sequence[float]) -> List[UncausedMotion]:
    calls = [one for one in inputs if isinstance(one, Call)]
    guided = _spans(calls, lambda call: call.short_name == "drag_mode" and any(call.request),
                    lambda call: call.short_name == "drag_mode" and not any(call.request))
    playing = _spans(calls, lambda call: call.service.endswith(("program/play", "program/resume")),
                     lambda call: call.short_name in ("stop", "stop_move"))
    moving = [one for one in inputs if one.short_name in MOVING_SERVICES or isinstance(one, SentMessage)]
    found: List[UncausedMotion] = []
    rests_since, begun = -float("inf"), 0
    for start, end in motions:
        latest = start + _EARLY_S
        queued = sum(call.success and call.short_name in _QUEUEING_SERVICES and call.start <= latest for call in moving)
        is_begun = (any(call.start <= latest and start <= call.end + _REACTION_S for call in moving)
                    or any(moment <= latest and start <= moment + _REACTION_S for moment in moments)
                    or _is_in(playing, start)
                    or queued > begun and start - rests_since <= _BETWEEN_QUEUED_S)
        is_guided = _is_in(guided, start)
        if is_guided or not is_begun:
            found.append(UncausedMotion(arm, start, end, is_guided))
        else:
            begun += 1
        rests_since = end
    return found


def _spans(calls: Sequence[Call], begins: Callable[[Call], bool], ends: Callable[[Call], bool]) -> List[TimeWindow]:
    """Return the spans from a successful call that begins something to the next one that ends it, or for ever."""
    found: List[TimeWindow] = []
    since: Optional[float] = None
    for call in calls:
        if since is None and call.success and begins(call):
            since = call.start
        elif since is not None and ends(call):
            found.append((since, call.end))
            since = None
    return found if since is None else [*found, (since, float("inf"))]


def _is_in(spans: Sequence[TimeWindow], moment: float) -> bool:
    return any(begin <= moment <= end for begin, end in spans)


def in_words(found: Sequence[UncausedMotion]) -> str:
    """Return at least one such motion, in words."""
    first = found[0]
    by = "a hand guided it" if first.is_guided else (
        "the pendant or a hand did, or the goals, trajectories or targets of it were not recorded (record --state-log)")
    return "no call and no message in the log began %s: %s at %.3f s; %s" % (
        "the only motion" if len(found) == 1 else "%d motions" % len(found),
        "%s moved" % (first.arm or "the arm"), first.start, by)
