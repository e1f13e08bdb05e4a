"""The dead-man of a velocity jog: which messages count, and when it is released. It has no clock.

Silence, a message that cannot be understood, a second publisher: each releases it, and from then on nothing counts
until a message of zero velocity has come. Messages with an old or repeated stamp do not count: they are silence.
"""
from typing import Dict, NamedTuple, Optional

from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.errors import InvalidCommand

FRESH_S = 0.2
"""Longest time, s, for which a message counts, from its stamp and from its arrival."""
ALONE_S = 0.5
"""Time, s, after its last message for which a publisher counts as present, whatever that message asked for."""
AHEAD_S = 0.05
"""Largest lead, s, of a stamp over this computer's clock.

A larger one shows that the clocks of the two computers differ: the message's age is not known.
"""
_NEVER_HELD = "nothing has been held yet"


class JogMessage(NamedTuple):
    """One message of a publisher.

    Attributes:
        source: Names the publisher and its topic.
        stamp_ns: Of its header, ns.
        age: By its stamp, when it arrived, s; negative where the stamp is in the future.
        received_at: When it arrived, monotonic, s.
        wish: The velocity that it asks for; None where it cannot be understood.
        problem: Why it cannot be understood.
    """

    source: str
    stamp_ns: int
    age: float
    received_at: float
    wish: Optional[Wish]
    problem: str = ""


class DeadMan:
    """The dead-man, which decides by each message and by the time.

    Attributes:
        is_held: A message of zero velocity has come, and fresh ones since.
        source: Its publisher; "" where it is not held.
        grip: Counts how often it was taken hold of.
        last_end: Why it was released, in words.
    """

    def __init__(self) -> None:
        self.is_held = False
        self.source = ""
        self.grip = 0
        self.last_end = _NEVER_HELD
        self._wish: Optional[Wish] = None
        self._stamp_ns = 0
        self._counts_until = 0.0
        self._received: Dict[str, float] = {}

    def take(self, message: JogMessage, now: float) -> Wish:
        """Take one message into account; return the velocity that it asks for.

        Raises:
            InvalidCommand: It does not count. Where it cannot be understood, or comes from a second publisher, the
                dead-man
                is released.
        """
        self.wish(now)
        self._received = {source: at for source, at in self._received.items() if now - at <= ALONE_S}
        self._received[message.source] = now
        if len(self._received) > 1:
            self._refuse("several publishers at once: %s" % ", ".join(sorted(self._received)))
        if message.wish is None:
            self._refuse(message.problem)
        self._require_fresh(message, now)
        assert message.wish is not None
        if not self.is_held:
            if not message.wish.is_zero:
                raise InvalidCommand("refused: a message of zero velocity must come first (%s)" % self.last_end)
            self.is_held, self.source = True, message.source
            self.grip += 1
        self._wish, self._stamp_ns = message.wish, message.stamp_ns
        self._counts_until = _counts_until(message)
        return message.wish

    def wish(self, now: float) -> Optional[Wish]:
        """Return the velocity that is asked for at this time; None while nothing is held."""
        if self.is_held and now > self._counts_until:
            self.release("no fresh message for %g s" % FRESH_S)
        return self._wish

    def release(self, why: str) -> None:
        """Release the dead-man; ``why`` is the reason for whoever asks next."""
        if self.is_held:
            self.last_end = why
        self.is_held, self.source, self._wish = False, "", None

    def _refuse(self, why: str) -> None:
        self.release(why)
        raise InvalidCommand("refused: " + why)

    def _require_fresh(self, message: JogMessage, now: float) -> None:
        if not message.stamp_ns:
            raise InvalidCommand("refused: header.stamp is 0; the publisher must stamp each message with the time")
        if message.age < -AHEAD_S:
            raise InvalidCommand("refused: header.stamp is %.3f s in the future; the computers' clocks differ"
                                 % -message.age)
        if now > _counts_until(message):
            raise InvalidCommand("refused: the message is %.3f s old; at most %g s" % (
                max(message.age, 0.0) + now - message.received_at, FRESH_S))
        if self.is_held and message.stamp_ns <= self._stamp_ns:
            raise InvalidCommand("refused: header.stamp is not later than that of the message before")


def _counts_until(message: JogMessage) -> float:
    return message.received_at + FRESH_S - max(message.age, 0.0)
