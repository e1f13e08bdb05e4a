"""The invariants of the core: what holds of its own fields after every event, whatever came before.

The tests check them after each event of the custody simulation and of every story (``test/custody``,
``test/client/core``); the driver itself does not. Nothing is changed here.
"""
from typing import Iterator

from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.phases import Phase
from jaka_ros_driver.client.core.requests.admission import ArmRequest
from jaka_ros_driver.errors import JakaError

_NEVER = float("inf")
_ROUNDING_S = 1e-6
"""Time, s, by which something may be due still: moments are compared as sums and as differences, which are rounded."""


def check_invariants(core: ArmCore, is_moving_told: bool, now: float, has_ticked: bool = False) -> None:
    """Check all invariants after an event.

    Args:
        core: The core, when all actions that it asked for have been performed.
        is_moving_told: The newest notification to the guard.
        now: The time of the event, s.
        has_ticked: The event ended in a tick: then nothing that was due is left.

    Raises:
        AssertionError: One does not hold; its text says which.
    """
    for broken in _broken(core, is_moving_told, now):
        raise AssertionError(broken)
    if has_ticked:
        for broken in _broken_after_tick(core, now):
            raise AssertionError(broken)


def _broken(core: ArmCore, is_moving_told: bool, now: float) -> Iterator[str]:
    custody, channel, links, admission = core.custody, core.channel, core.links, core._admission
    if custody.is_free is not (custody.motion is None):
        yield "custody is %s, and its motion is %r" % ("free" if custody.is_free else "held", custody.motion)
    if is_moving_told is custody.is_free:
        yield "custody is %s, and the guard was notified that the arm %s" % (
            "free" if custody.is_free else "held", "moves" if is_moving_told else "rests")
    yield from _broken_in_phase(custody, now)
    has_link = channel.is_open
    if channel.is_open and channel.introduction is not None:
        yield "a link is trusted whose controller is still being asked who it is"
    if links.is_ready and not has_link:
        yield "the driver is ready on a link that is not confirmed"
    if len(channel._exchange) and not channel.is_open and channel.introduction is None:
        yield "replies are waited for on a link that is not open"
    waiting = [one.call for one in admission._waiting if one.call is not None]
    if len({id(call) for call in waiting}) < len(waiting):
        yield "a call waits twice"
    if any(getattr(call, "is_answered", False) for call in waiting):
        yield "a call that was answered waits still"
    if admission._waiting and core.next_deadline() == _NEVER:
        yield "calls wait, and nothing is due"
    if admission.busy_with is not None and not any(not running.has_ended for running in core._running):
        yield "a change is running, and nothing carries it out"
    if admission.stops_under_way < 0 or (admission.stops_under_way and not len(channel._exchange)):
        yield "%d stops of a free arm are running, and no reply is outstanding" % admission.stops_under_way
    if core.next_deadline() != core.next_deadline():
        yield "the next deadline is no number"


def _broken_in_phase(custody: Custody, now: float) -> Iterator[str]:
    """Yield what does not hold of the fields that belong to one phase."""
    phase, accepted_at = custody._phase, custody._accepted_at
    has_link = custody.channel.is_open
    if phase in (Phase.FREE, Phase.HELD, Phase.SETTLING) and custody._retry_at != _NEVER:
        yield "a stop is due again, and nothing is being stopped"
    if phase in (Phase.HELD, Phase.SETTLING):
        if custody._outcome is not None or accepted_at is not None or custody._outstanding:
            yield "nothing is being stopped, and an outcome, a reply or an accepted stop is known"
        if custody._is_answered is not (phase is Phase.SETTLING):
            yield "the callers of a %s" % (
                "running motion were answered with its end" if phase is Phase.HELD
                else "motion that was refused wait still")
    if phase is Phase.STOPPING:
        if accepted_at is None and has_link and not custody._outstanding and custody._retry_at == _NEVER:
            yield "a stop is owed, the link is up, no reply is outstanding, and no retry is due"
        if accepted_at is not None and not custody._held_since <= accepted_at <= now:
            yield "a stop was accepted %.3f s after the motion began, %.3f s ago" % (
                accepted_at - custody._held_since, now - accepted_at)
        if accepted_at is not None and not (custody._is_answered or custody._is_guess or custody._waits_for_rest):
            yield "the stop is accepted, and the callers of the motion wait still"
    if custody.is_ending and not custody._is_answered and custody.deadline == _NEVER:
        yield "the callers of a motion that is being ended may never get an answer"
    if custody._outstanding < 0 or (custody._outstanding and custody.motion is not None and not has_link):
        yield "%d replies to stops are outstanding, and the link is %s" % (
            custody._outstanding, "up" if has_link else "down")


def _could_begin(core: ArmCore, request: ArmRequest, now: float) -> bool:
    try:
        return core._admission.is_free_at_rest(request.owner, now)
    except JakaError:
        return True  # it is due an answer


def _broken_after_tick(core: ArmCore, now: float) -> Iterator[str]:
    """Yield what is due still after a tick: the shell would ask for ticks without end."""
    custody = core.custody
    for name, due in (("custody", custody.deadline), ("a link", core.links.deadline),
                      ("a call that waits", core._admission.deadline),
                      ("a procedure", min([one.deadline for one in core._running], default=_NEVER))):
        if due <= now - _ROUNDING_S:
            yield "after a tick %s is due still, since %.4f s" % (name, now - due)
    for request in core._admission._waiting:
        if _could_begin(core, request, now):
            yield "%s waits, and it is known whether it may begin" % request.owner.value
    if any(running.has_ended for running in core._running):
        yield "a procedure that has ended is kept"
