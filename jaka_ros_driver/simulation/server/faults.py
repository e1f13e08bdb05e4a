"""The script of wire faults: changes of the next messages of a port, repeatable with a seed. No socket, no clock.

A rule changes messages of one port: ``count`` of them (None: all until it is cleared), each with the rule's
probability, drawn from a generator with a seed; on the command port only replies to ``command`` where one is named.
Several rules that apply to one message are applied in the order in which they were added.
"""
import enum
import random
import re
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.units import ms_to_s

_LEN = re.compile(rb'"len": (\d+)')
_LARGEST = 1e6
"""Largest number in a fault: times in ms, counts, offsets; beyond it none means anything."""


class Effect(enum.Enum):
    """The effect on the connection after the data was sent."""

    CLOSE = "close"
    RESET = "reset"
    HALF_OPEN = "half_open"


class Delivery(NamedTuple):
    """Bytes for one connection.

    Attributes:
        data: Bytes; sent together with everything else that is due then.
        at: When, s on the caller's clock.
        effect: What happens to the connection afterwards.
        overtakes: True when it is sent before the delivery that is scheduled just before it; that one follows at the
            same time.
        alone: True when it must not be in one segment with what follows.
    """

    data: bytes
    at: float
    effect: Optional[Effect] = None
    overtakes: bool = False
    alone: bool = False


@dataclass
class FaultRule:
    """One rule of the script; ``KINDS`` has the effect of each kind and its parameters."""

    kind: str
    port: str
    count: Optional[int] = 1
    probability: float = 1.0
    command: Optional[str] = None
    params: Dict[str, Any] = field(default_factory=dict)
    release_at: Optional[float] = None

    def described(self) -> Dict[str, Any]:
        """Return the rule as the operator port shows it."""
        shown: Dict[str, Any] = {"kind": self.kind, "port": self.port, "count": self.count}
        if self.probability < 1.0:
            shown["probability"] = self.probability
        if self.command is not None:
            shown["command"] = self.command
        shown.update(self.params)
        return shown


_Strike = Callable[[FaultRule, random.Random, List[Delivery], float], List[Delivery]]
"""A function that changes one message, now; an earlier rule may have cut it into several deliveries."""


class _Kind(NamedTuple):
    """A kind of rule.

    Attributes:
        defaults: Its parameters.
        strike: Its effect on a message.
        meaning: In words.
        usual_count: How many messages it changes where no count is given.
    """

    defaults: Mapping[str, float]
    strike: _Strike
    meaning: str
    usual_count: int = 1


def _split(rule: FaultRule, _chance: random.Random, messages: List[Delivery], _now: float) -> List[Delivery]:
    size, gap = max(1, int(rule.params["bytes"])), ms_to_s(rule.params["gap_ms"])
    pieces: List[Delivery] = []
    for message in messages:
        starts = range(0, len(message.data), size) or range(1)  # an end of the connection may come without bytes
        pieces += [Delivery(message.data[start:start + size], message.at + n * gap, None, False, True)
                   for n, start in enumerate(starts)]
        pieces[-1] = pieces[-1]._replace(effect=message.effect)
    return pieces


def _hold(rule: FaultRule, messages: List[Delivery], now: float) -> List[Delivery]:
    """Hold the messages until ``hold_ms`` after the first of them."""
    if rule.release_at is None or now >= rule.release_at:
        rule.release_at = now + ms_to_s(rule.params["hold_ms"])
    return [message._replace(at=rule.release_at) for message in messages]


def _reorder(rule: FaultRule, _chance: random.Random, messages: List[Delivery], now: float) -> List[Delivery]:
    if rule.release_at is None or now >= rule.release_at:
        return _hold(rule, messages, now)
    rule.release_at = None
    return [message._replace(overtakes=True) for message in messages]


def _noise(rule: FaultRule, chance: random.Random) -> bytes:
    """Return random bytes that are neither JSON nor a zlib stream nor UTF-8."""
    return bytes(chance.randrange(0x80, 0x100) for _ in range(int(rule.params["bytes"])))


def _each(change: Callable[[FaultRule, random.Random, Delivery], Delivery]) -> _Strike:
    """Return a strike that changes each delivery by itself."""
    return lambda rule, chance, messages, now: [change(rule, chance, message) for message in messages]


def _end_by(effect: Effect) -> _Strike:
    return lambda rule, chance, messages, now: [Delivery(b"", now, effect)]


KINDS: Dict[str, _Kind] = {
    "split": _Kind({"bytes": 64, "gap_ms": 2}, _split, "in pieces of `bytes`, `gap_ms` apart"),
    "merge": _Kind({"hold_ms": 50}, lambda rule, chance, messages, now: _hold(rule, messages, now),
                   "`count` messages held for `hold_ms` and written as one", 2),
    "delay": _Kind({"delay_ms": 200}, _each(lambda rule, _, message: message._replace(
        at=message.at + ms_to_s(rule.params["delay_ms"]))), "later by `delay_ms`; what follows waits too"),
    "drop": _Kind({}, lambda rule, chance, messages, now: [], "never sent"),
    "duplicate": _Kind({}, lambda rule, chance, messages, now: messages + messages, "sent twice"),
    "reorder": _Kind({"hold_ms": 200}, _reorder,
                     "held until the next message has gone out, `hold_ms` at most; `count` 2 swaps one pair", 2),
    "garbage": _Kind({"bytes": 16}, _each(lambda rule, chance, message: message._replace(
        data=_noise(rule, chance) + message.data)), "`bytes` random bytes go in front of it"),
    "noise": _Kind({"bytes": 16}, _each(lambda rule, chance, message: message._replace(
        data=_noise(rule, chance))), "`bytes` random bytes go in its place"),
    "wrong_len": _Kind({"offset": 7}, lambda rule, chance, messages, now: messages,
                       "`len` of a status frame is wrong by `offset`"),
    "cut": _Kind({"bytes": 10}, _each(lambda rule, _, message: message._replace(
        data=message.data[:int(rule.params["bytes"])], effect=Effect.CLOSE)),
                 "ends after `bytes`, and the connection is closed"),
    "close": _Kind({}, _end_by(Effect.CLOSE), "the connection is closed in its place"),
    "reset": _Kind({}, _end_by(Effect.RESET), "the connection is reset (RST) in its place"),
    "half_open": _Kind({}, _end_by(Effect.HALF_OPEN),
                       "from here on the connection stays open, and nothing is read or sent"),
}
"""Every kind of rule: its parameters with their defaults, and its effect on a message."""


class FaultScript:
    """The rules in force, and the random generator that they share."""

    def __init__(self, seed: int = 0) -> None:
        self._chance = random.Random(seed)
        self._rules: List[FaultRule] = []

    def add(self, /, kind: str, port: str, count: Optional[int] = 0, probability: float = 1.0,
            command: Optional[str] = None, **params: float) -> FaultRule:
        """Add a rule.

        Args:
            kind: One of ``KINDS``.
            port: "command", "status" or "poll".
            count: How many messages it changes; None until it is cleared, 0 for the usual count of its kind.
            probability: Of changing a message, 0 to 1.
            command: The command whose replies it changes; None for all.
            params: The parameters of the kind.

        Raises:
            InvalidCommand: Unknown kind, port or parameter, or a value out of range.
        """
        if not isinstance(kind, str) or kind not in KINDS:
            raise InvalidCommand("unknown fault %r; known: %s" % (kind, ", ".join(KINDS)))
        if port not in PORTS:
            raise InvalidCommand("unknown port %r; known: %s" % (port, ", ".join(PORTS)))
        if count is not None and (type(count) is not int or count < 0):
            raise InvalidCommand("count is %r; it must be a whole number above 0, or null" % (count,))
        if not isinstance(probability, (int, float)) or not 0.0 <= probability <= 1.0:
            raise InvalidCommand("probability is %r; it must be within 0..1" % (probability,))
        if command is not None and (port != "command" or not isinstance(command, str)):
            raise InvalidCommand("command names a command, and holds for the command port only")
        defaults = KINDS[kind].defaults
        for name, value in params.items():
            if name not in defaults:
                raise InvalidCommand("fault %s takes no %s; it takes: %s"
                                     % (kind, name, ", ".join(defaults) or "nothing"))
            low = -_LARGEST if name == "offset" else 0.0
            if not isinstance(value, (int, float)) or not low <= value <= _LARGEST:
                raise InvalidCommand("%s is %.100r; it must be a number within %g..%g" % (name, value, low, _LARGEST))
        count = KINDS[kind].usual_count if count == 0 else count
        rule = FaultRule(kind, port, count, float(probability), command, {**defaults, **params})
        self._rules.append(rule)
        return rule

    def clear(self) -> None:
        self._rules.clear()

    def active(self) -> Tuple[FaultRule, ...]:
        """Return the rules that can still apply, oldest first."""
        return tuple(self._rules)

    def deliveries(self, port: str, data: bytes, command: Optional[str], now: float) -> List[Delivery]:
        """Apply the rules to one message; return the deliveries to send.

        Args:
            port: "command", "status" or "poll".
            data: The message.
            command: The command that it answers; None for a status frame.
            now: s on the caller's clock.
        """
        messages = [Delivery(data, now)]
        for rule in list(self._rules):
            if rule.kind != "wrong_len" and self._strikes(rule, port, command):
                messages = KINDS[rule.kind].strike(rule, self._chance, messages, now)
        return messages

    def frame_text(self, port: str, text: bytes) -> bytes:
        """Return the text of a status frame, with ``len`` falsified where a rule requires it.

        This precedes any compression.
        """
        for rule in list(self._rules):
            if rule.kind == "wrong_len" and self._strikes(rule, port, None):
                offset = int(rule.params["offset"])
                length = _LEN.search(text)
                if length:
                    text = b"%s%d%s" % (text[:length.start(1)], int(length.group(1)) + offset, text[length.end(1):])
        return text

    def _strikes(self, rule: FaultRule, port: str, command: Optional[str]) -> bool:
        if rule.port != port or (rule.command is not None and rule.command != command):
            return False
        if rule.probability < 1.0 and self._chance.random() >= rule.probability:
            return False
        if rule.count is not None:
            rule.count -= 1
            if rule.count == 0:
                self._rules.remove(rule)
        return True
