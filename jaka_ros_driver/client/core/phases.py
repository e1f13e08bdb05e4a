"""The phases of custody and the events that lead from one to another: all transitions stand in one table.

``Custody`` looks up every event here and nowhere else changes its phase. An event that is missing in a phase cannot
happen there: it is a bug of the core, and an AssertionError.
"""
import enum
from typing import Dict, Mapping, NamedTuple


class Phase(enum.Enum):
    """The phases of custody; the value says in words what is true in each."""

    FREE = "nobody moves the arm"
    HELD = "a motion runs"
    SETTLING = "the controller refused the motion: the arm is watched until it is seen at rest"
    STOPPING = "a stop is sent until it is accepted and the arm rests"


class Event(enum.Enum):
    """The events that custody takes into account; the value says in words what has happened."""

    BEGIN = "a motion of this driver takes the arm"
    TAKE_OVER = "a motion that a dead driver left takes the arm"
    NOT_SENT = "its first command could not be sent"
    FINISH = "it is at its target, and the arm is still"
    REFUSED = "the controller refused its command"
    STOP = "something contradicts it, or it is to end"
    STOP_CALL = "a caller of this driver asks for a stop"
    LINK_LOST = "the command port is lost"
    MOVES_ON = "the arm or the motion is seen going on after a refusal or an accepted stop"
    AT_REST = "the arm is seen at rest after a refusal or an accepted stop, and nothing goes on"


class Transition(NamedTuple):
    """The effect of one event in one phase.

    Attributes:
        to: The next phase.
        meaning: What custody does, in words; why nothing, where the event is ignored.
        is_ignored: Nothing is done.
    """

    to: Phase
    meaning: str
    is_ignored: bool = False


def _ignored(phase: Phase, why: str, *events: Event) -> Dict[Event, Transition]:
    return {event: Transition(phase, why, is_ignored=True) for event in events}


TRANSITIONS: Mapping[Phase, Mapping[Event, Transition]] = {
    Phase.FREE: {
        Event.BEGIN: Transition(Phase.HELD, "the guard is notified, then the first command is sent"),
        Event.TAKE_OVER: Transition(Phase.STOPPING, "the stop is the first message on the next connection"),
        **_ignored(Phase.FREE, "there is no motion", Event.FINISH, Event.REFUSED, Event.STOP, Event.LINK_LOST),
    },
    Phase.HELD: {
        Event.NOT_SENT: Transition(Phase.FREE, "nothing has begun; the error is the answer"),
        Event.FINISH: Transition(Phase.FREE, "callers are answered that it is completed"),
        Event.REFUSED: Transition(Phase.SETTLING, "the refusal is the answer; a refused command may move the arm all "
                                  "the same"),
        Event.STOP: Transition(Phase.STOPPING, "a stop is sent"),
        Event.STOP_CALL: Transition(Phase.STOPPING, "a stop is sent"),
        Event.LINK_LOST: Transition(Phase.STOPPING, "callers are answered; the stop is the first message on the next "
                                    "connection"),
    },
    Phase.SETTLING: {
        Event.STOP: Transition(Phase.STOPPING, "a stop is sent"),
        Event.STOP_CALL: Transition(Phase.STOPPING, "a stop is sent"),
        Event.LINK_LOST: Transition(Phase.STOPPING, "the stop is the first message on the next connection"),
        Event.MOVES_ON: Transition(Phase.STOPPING, "a stop is sent: the refusal was not true"),
        Event.AT_REST: Transition(Phase.FREE, "who waits for the arm is admitted"),
        **_ignored(Phase.SETTLING, "the refusal counts", Event.FINISH, Event.REFUSED),
    },
    Phase.STOPPING: {
        Event.STOP_CALL: Transition(Phase.STOPPING, "a stop of the caller's own is sent: its reply is the answer"),
        Event.LINK_LOST: Transition(Phase.STOPPING, "callers are answered; the stop is sent on the next connection, "
                                    "unless one was accepted"),
        Event.MOVES_ON: Transition(Phase.STOPPING, "the accepted stop counts no more, another one is sent"),
        Event.AT_REST: Transition(Phase.FREE, "callers are answered what ended it; who waits for the arm is admitted"),
        **_ignored(Phase.STOPPING, "the first reason counts, and only rest ends a stop", Event.FINISH, Event.REFUSED,
                   Event.STOP),
    },
}
"""Every event that can happen in a phase, with its effect."""


def transition(phase: Phase, event: Event) -> Transition:
    """Return the effect of an event in a phase.

    Raises:
        AssertionError: It cannot happen there.
    """
    row = TRANSITIONS[phase].get(event)
    assert row is not None, "%s, while %s" % (event.value, phase.value)
    return row
