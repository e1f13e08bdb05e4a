"""The causes that events of a scenario come after, as they are seen: in a log and in a running graph alike."""
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from ..scenario import BANKS, CauseKind, EventCause

_LEAVES_RAD = 0.002
"""Distance, rad, from its place of rest at which an arm has begun to move: above noise, and soon reached."""
_RESTS_RAD = 0.0002
"""Largest change, rad, of a joint at rest: noise."""
_REST_S = 0.05
"""An arm rests when no joint moves by ``_RESTS_RAD`` for so long. Between two calls that wait for the ends of their
motions it does: the driver answers when it has seen rest, 0.1 s or more in all."""
READS = "get_"
"""The begin of the names of services that only read, which nodes call again and again to wait for something."""

TerminalKey = Tuple[CauseKind, str, int]
"""OUTPUT or INPUT, bank and index of a digital terminal."""


class Sighting(NamedTuple):
    """A cause that has been seen.

    Attributes:
        cause: The cause, with its number.
        at: Time, s on the clock of whoever watches.
    """

    cause: EventCause
    at: float


def terminals_in(message: Mapping[str, Mapping[str, Sequence[bool]]]) -> Dict[TerminalKey, int]:
    """Return the levels, 0 or 1, of the digital terminals in a message of ``~io_states`` as data."""
    levels: Dict[TerminalKey, int] = {}
    for bank in BANKS:
        for kind, name in ((CauseKind.OUTPUT, "digital_outputs"), (CauseKind.INPUT, "digital_inputs")):
            for index, level in enumerate(message.get(bank, {}).get(name, ())):
                levels[kind, bank, index] = int(level)
    return levels


class _Motion:
    """The detector of an arm's motions."""

    def __init__(self) -> None:
        self._rest: Optional[Sequence[float]] = None
        self._still_at = 0.0
        self._anchor: Sequence[float] = ()
        self._anchored_at = 0.0
        self.is_moving = False

    def moved(self, position: Sequence[float], at: float) -> Optional[float]:
        """Take the joints, rad; return when a motion began that these show to have begun, else None."""
        if self._rest is None:
            self._rest, self._still_at = position, at
        if self.is_moving:
            if _apart(position, self._anchor) > _RESTS_RAD:
                self._anchor, self._anchored_at = position, at
            elif at - self._anchored_at >= _REST_S:
                self.is_moving = False
                self._rest, self._still_at = position, at
            return None
        away = _apart(position, self._rest)
        if away <= _RESTS_RAD:
            self._still_at = at
        if away <= _LEAVES_RAD:
            return None
        self.is_moving = True
        self._anchor, self._anchored_at = position, at
        return self._still_at


def _apart(one: Sequence[float], other: Sequence[float]) -> float:
    return max((abs(a - b) for a, b in zip(one, other)), default=0.0)


class Sightings:
    """The causes seen at one arm: each method takes a message, and returns those that it shows.

    Args:
        arm: Namespace.
        levels: Levels of the terminals before the first message; None where they are not known.

    Attributes:
        levels: Levels of the digital terminals now; None before the first message.
    """

    def __init__(self, arm: str, levels: Optional[Dict[TerminalKey, int]] = None) -> None:
        self._arm = arm
        self._counts: Dict[Tuple[CauseKind, Tuple[object, ...]], int] = {}
        self._motion = _Motion()
        self.levels = levels

    @property
    def is_moving(self) -> bool:
        """True while the arm moves."""
        return self._motion.is_moving

    def terminals(self, levels: Dict[TerminalKey, int], at: float) -> List[Sighting]:
        """Take the levels of all terminals."""
        before = levels if self.levels is None else self.levels
        self.levels = levels
        return [self._seen(kind, (bank, index, level), at) for (kind, bank, index), level in levels.items()
                if before.get((kind, bank, index), level) != level]

    def answered(self, service: str, at: float) -> List[Sighting]:
        """Take the answer of a service, by its name below the driver's node."""
        return [self._seen(CauseKind.ANSWER, (service,), at)]

    def joints(self, position: Sequence[float], at: float) -> List[Sighting]:
        """Take joint positions, rad."""
        began = self._motion.moved(position, at)
        return [] if began is None else [self._seen(CauseKind.MOTION, (), began)]

    def _seen(self, kind: CauseKind, what: Tuple[object, ...], at: float) -> Sighting:
        number = self._counts.get((kind, what), 0)
        self._counts[kind, what] = number + 1
        return Sighting(EventCause(kind, self._arm, what, number), at)


class Polls:
    """The filter of repeated reads: a node that waits asks the same again and again, how often differs each time."""

    def __init__(self) -> None:
        self._answers: Dict[str, Dict[Tuple[str, bytes], bytes]] = {}

    def is_repeated(self, service: str, request: bytes, response: bytes) -> bool:
        """Return whether a call only read, and answered as the same call did since the last one that did more."""
        node, _, name = service.rpartition("/")
        answers = self._answers.setdefault(node, {})
        if not name.startswith(READS):
            answers.clear()
            return False
        before = answers.get((name, request))
        answers[name, request] = response
        return before == response
