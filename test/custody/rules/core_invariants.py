"""The invariants of the core: what must hold of its own fields after every event. Nothing is changed here."""
from typing import Any, Iterator

_NEVER = float("inf")


def broken_invariant(core: Any, is_moving_told: bool, now: float) -> str:
    """Return the first invariant that does not hold, in words; "" where all hold.

    Args:
        core: The core, when all actions that it asked for have been performed.
        is_moving_told: The newest notification to the guard.
        now: s.
    """
    for text in _broken(core, is_moving_told, now):
        return text
    return ""


def _broken(core: Any, is_moving_told: bool, now: float) -> Iterator[str]:
    custody, channel, links, admission = core.custody, core.channel, core.links, core._admission
    if custody.is_free is not (custody.motion is None):
        yield "custody is %s, and its motion is %r" % ("free" if custody.is_free else "held", custody.motion)
    if is_moving_told is custody.is_free:
        yield "custody is %s, and the guard was notified that the arm %s" % (
            "free" if custody.is_free else "held", "moves" if is_moving_told else "rests")
    has_link = channel.is_open
    if custody.must_stop and has_link and not custody._outstanding and custody._retry_at == _NEVER:
        yield "a stop is owed, the link is up, no reply is outstanding, and no retry is due"
    if custody.is_ending and not custody._is_answered and custody.deadline == _NEVER:
        yield "the callers of a motion that is being ended may never get an answer"
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
    if admission.is_setting and not any(not running.has_ended for running in core._running):
        yield "a change is under way, and nothing carries it out"
    if admission.stops_under_way < 0 or (admission.stops_under_way and not len(channel._exchange)):
        yield "%d stops of a free arm are under way, and no reply is outstanding" % admission.stops_under_way
    if core.next_deadline() != core.next_deadline():
        yield "the next deadline is no number"
