"""The schedule of replayed service calls: at the recorded time, never before what a call followed has ended."""
from typing import List, NamedTuple, Optional, Sequence, Tuple

from .driver_inputs import Input, SentMessage

_SETTLE_S = 0.1
"""The pause between the end of a call and the next one is kept up to this length, even when the first takes longer."""
STREAM_SERVICES = ("servo_j", "servo_p")


class Planned(NamedTuple):
    """One call of the plan.

    Attributes:
        call: Call or message as recorded.
        number: Position in the plan.
        offset: Time at which it was made, s since the plan's beginning.
        after: The calls whose ends it follows, and how long after each end it comes at least, s.
        during: The calls that were running, and the time after the start of each at which it comes, s.
        is_overlapped: True if another call is made while this one is running.
    """

    call: Input
    number: int
    offset: float
    after: Tuple[Tuple[int, float], ...]
    during: Tuple[Tuple[int, float], ...]
    is_overlapped: bool


def plan(calls: Sequence[Input], stretch: float = 1.0, start: float = 0.0) -> List[Planned]:
    """Plan a log's calls and messages.

    Args:
        calls: Calls and messages by time of arrival.
        stretch: Times are so many times longer than recorded.
        start: Log time that the plan begins at, s.
    """
    result: List[Planned] = []
    open_calls: List[int] = []
    for number, call in enumerate(calls):
        # what ended before an earlier call began has ended by then: calls are made in their order
        ended = [k for k in open_calls if calls[k].end <= call.start]
        open_calls = [k for k in open_calls if calls[k].end > call.start]
        after = tuple((k, stretch * _pause(calls[k], call)) for k in ended)
        during = tuple((k, stretch * (call.start - calls[k].start)) for k in open_calls)
        later = calls[number + 1].start if number + 1 < len(calls) else float("inf")
        result.append(Planned(call, number, stretch * (call.start - start), after, during, later < call.end))
        open_calls.append(number)
    return result


def _pause(before: Input, call: Input) -> float:
    """Return the shortest pause between the end of a call and another one, s; a stream that is late catches up."""
    if before.short_name in STREAM_SERVICES and call.short_name in STREAM_SERVICES:
        return 0.0
    if isinstance(before, SentMessage) and isinstance(call, SentMessage) and not before.duration:
        return 0.0
    return min(call.start - before.end, _SETTLE_S)


def due(planned: Planned, started: Sequence[Optional[float]], ended: Sequence[Optional[float]], begin: float,
        after_previous: bool) -> Optional[float]:
    """Return when a call is to be made, s on the clock of the other times; None while what it follows has not ended.

    Args:
        planned: The call.
        started: Times at which each call of the plan was made; None: not yet.
        ended: Times at which each was answered; None: not yet.
        begin: Time at which the plan began.
        after_previous: True to make it as soon as what it follows has ended, whatever its recorded time.
    """
    moment = begin if after_previous else begin + planned.offset
    for other, gap in planned.after:
        end = ended[other]
        if end is None:
            return None
        moment = max(moment, end if after_previous else end + gap)
    for other, offset in planned.during:
        start = started[other]
        if start is None:
            return None
        moment = max(moment, start + offset)
    return moment


def as_text(planned: Sequence[Planned]) -> str:
    """Format the plan as a table, a call a line."""
    lines = ["%9s  %9s  %-9s %s" % ("at s", "lasted s", "outcome", "call")]
    for entry in planned:
        call = entry.call
        lines.append("%9.3f  %9.3f  %-9s %s(%s)" % (entry.offset, call.duration,
                                                   "succeeded" if call.success else "failed", call.service,
                                                   " ".join(call.request_text.split())))
    return "\n".join(lines)
