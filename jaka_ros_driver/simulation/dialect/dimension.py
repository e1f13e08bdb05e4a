"""One dimension of the controllers that could be real: its values, their meaning, the evidence, the defaults."""
import abc
import hashlib
from dataclasses import dataclass
from typing import Any, Sequence, Tuple

from jaka_ros_driver.errors import InvalidCommand

FIRMWARE_NAMES = ("1.5.14", "1.7.1", "1.7.2")
"""The generations that are simulated; defaults stand in this order."""
_AT_DEFAULT, _AT_EDGE = 0.4, 0.7
"""Shares of the draws up to which they take the default, and then an end: edges break more than middles."""
_MAX_LIST = 64
"""Most names of a list in a dialect's file: more than any dimension has."""


class Dice:
    """Numbers from 0 to below 1 that a text determines, on every machine and version of Python.

    Not ``random``: nothing in the pure core can ask for chance, and what ``random`` draws differs between versions.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._rolls = 0

    def roll(self) -> float:
        """Return the next number."""
        self._rolls += 1
        digest = hashlib.sha256(("%s %d" % (self._text, self._rolls)).encode()).digest()
        return int.from_bytes(digest[:6], "big") / 2.0 ** 48


@dataclass(frozen=True)
class Dimension(abc.ABC):
    """One point that is open.

    Attributes:
        meaning: What is true of a controller, by the value.
        evidence: What supports which value: tags as in docs/controller-protocol.md section 0.1, and sections there.
        defaults: The value for each of ``FIRMWARE_NAMES``; one for all of them.
    """

    meaning: str
    evidence: str
    defaults: Tuple[Any, ...]

    def default(self, firmware: str) -> Any:
        """Return the value of a firmware, one of ``FIRMWARE_NAMES``."""
        return self.defaults[FIRMWARE_NAMES.index(firmware) if len(self.defaults) > 1 else 0]

    @abc.abstractmethod
    def described(self) -> str:
        """Return the values, in words."""

    @abc.abstractmethod
    def checked(self, value: Any) -> Any:
        """Return the value as a field holds it; raise ValueError where it is none of this dimension."""

    @abc.abstractmethod
    def draw(self, dice: Dice, firmware: str) -> Any:
        """Return one of the values, by the dice."""

    @abc.abstractmethod
    def samples(self) -> Sequence[Any]:
        """Return values that show the whole dimension: all of them, or the ends and the middle of a range."""


@dataclass(frozen=True)
class Choice(Dimension):
    """One of some words, or yes and no."""

    values: Tuple[Any, ...] = (False, True)

    def described(self) -> str:
        return ", ".join(_shown(value) for value in self.values)

    def checked(self, value: Any) -> Any:
        for known in self.values:
            if type(value) is type(known) and value == known:
                return known
        raise ValueError

    def draw(self, dice: Dice, firmware: str) -> Any:
        return self.values[int(dice.roll() * len(self.values))]

    def samples(self) -> Sequence[Any]:
        return self.values


@dataclass(frozen=True)
class Range(Dimension):
    """A number between two ends, which belong to it; whole where both ends are."""

    low: float = 0.0
    high: float = 1.0
    unit: str = "s"

    @property
    def is_whole(self) -> bool:
        """True where only whole numbers belong to it."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    def described(self) -> str:
        return "%g to %g %s" % (self.low, self.high, self.unit)

    def checked(self, value: Any) -> Any:
        if type(value) not in ((int,) if self.is_whole else (int, float)) or not self.low <= value <= self.high:
            raise ValueError
        return value if self.is_whole else float(value)

    def draw(self, dice: Dice, firmware: str) -> Any:
        """Return often the default or an end, because edges break more than middles; else any, to the millisecond."""
        kind, share = dice.roll(), dice.roll()
        if kind < _AT_DEFAULT:
            return self.default(firmware)
        if kind < _AT_EDGE:
            return self.low if share < 0.5 else self.high
        drawn = self.low + share * (self.high - self.low)
        return int(drawn) if self.is_whole else round(drawn, 3)

    def samples(self) -> Sequence[Any]:
        middle = (self.low + self.high) / 2
        return self.low, int(middle) if self.is_whole else middle, self.high


@dataclass(frozen=True)
class Subset(Dimension):
    """Any of some names, or none of them."""

    names: Tuple[str, ...] = ()

    def described(self) -> str:
        return "any of " + ", ".join(_shown(name) for name in self.names)

    def checked(self, value: Any) -> Any:
        if not isinstance(value, (list, tuple)) or len(value) > _MAX_LIST or any(
                type(name) is not str or name not in self.names for name in value):
            raise ValueError
        return tuple(name for name in self.names if name in value)

    def draw(self, dice: Dice, firmware: str) -> Any:
        """Return each name with one chance in six."""
        return tuple([name for name in self.names if dice.roll() < 1.0 / 6.0])

    def samples(self) -> Sequence[Any]:
        return [(), *((name,) for name in self.names)]


def firmware_name(name: str) -> str:
    """Return the one of ``FIRMWARE_NAMES`` that ``--firmware`` means; raise InvalidCommand for anything else."""
    full = "1.7.2" if name == "1.7" else name
    if full not in FIRMWARE_NAMES:
        raise InvalidCommand("firmware is %r; it must be one of %s, 1.7" % (name, ", ".join(FIRMWARE_NAMES)))
    return full


def _shown(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
