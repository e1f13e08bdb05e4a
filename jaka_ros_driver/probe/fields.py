"""The fields of frames and replies: their types, the ranges of their numbers, and which of them is a clock."""
import re
from typing import Any, Dict, FrozenSet, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple

from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.identity import is_naming

_WHOLE, _NUMBER = "whole number", "number"
_WORDS: Dict[type, str] = {type(None): "null", bool: "true or false", int: _WHOLE, float: _NUMBER, str: "text",
                           dict: "object"}
_MOST_TYPES = 3
"""Most types that a field is said to have; one with more varies."""
_LENGTH = re.compile(r" of \d+\b")
_RATES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "cycles of 8 ms": 125.0, "cycles of 4 ms": 250.0,
          "cycles of 2 ms": 500.0}
"""Units in which a clock may count, and how often in a second."""
_SAME_RATE = 0.02
_LEAST_SAMPLES, _LEAST_SPAN_S, _MOST_SAMPLES = 10, 1.0, 10000
"""Changes of a number, and the time, s, over which they must lie, for it to be taken for a clock; and changes that are
kept, those of 80 s at 125 Hz: more tell no more of its rate."""
_LARGEST_MISFIT_S = 0.1
"""Largest mean distance, s, of a clock from a steady one: frames come late, but no later."""


def type_of(value: Any) -> str:
    """Return the type of a value of JSON in words; of a list also its length, and the type of what is in it."""
    if not isinstance(value, list):
        return _WORDS[type(value)]
    inner = {_LENGTH.sub("", type_of(one)) for one in value}
    return ": ".join(["list of %d" % len(value), *([_joined(inner)] if inner else [])])


def _joined(types: Iterable[str]) -> str:
    """Return several types as one: a number may be whole, a list of several lengths has none."""
    found = set(types)
    if len(found) > 1 and sum(" of " in one for one in found) > 1:
        found = {_LENGTH.sub("", one) for one in found}
    if _NUMBER in found:
        found.discard(_WHOLE)
    return " or ".join(sorted(found)) if len(found) <= _MOST_TYPES else "varies"


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from _numbers(one)
    elif type(value) in (int, float):
        yield value


class FrameFields:
    """The types and ranges of the fields of frames that came.

    Args:
        known: Fields that sources name. Of others a number that never changes is left out: it may be a serial number.
    """

    def __init__(self, known: FrozenSet[str]) -> None:
        self._known = known
        self._newest: Dict[str, Any] = {}
        self._types: Dict[str, List[str]] = {}
        self._ranges: Dict[str, Tuple[float, float]] = {}
        self._growing: Dict[str, List[Tuple[float, float]]] = {}

    def take(self, frame: Mapping[str, Any], now: float) -> None:
        """Take a frame that came at this moment, monotonic s."""
        for name, value in frame.items():
            is_new = name not in self._newest
            if is_new or value != self._newest[name] or type(value) is not type(self._newest[name]):
                self._newest[name] = value
                self._note(name, value)
            if type(value) in (int, float):
                self._grow(name, value, now, is_new)

    def _note(self, name: str, value: Any) -> None:
        types, told = self._types.setdefault(name, []), type_of(value)
        if told not in types and len(types) <= _MOST_TYPES:
            types.append(told)
        numbers = [*_numbers(value), *self._ranges.get(name, ())]
        if numbers:
            self._ranges[name] = min(numbers), max(numbers)

    def _grow(self, name: str, value: float, now: float, is_new: bool) -> None:
        """Keep the values of a number that grows for as long as it does."""
        if is_new:
            self._growing[name] = [(now, value)]
        samples = self._growing.get(name)
        if samples is None or value == samples[-1][1] or len(samples) == _MOST_SAMPLES:
            return
        if value < samples[-1][1]:
            del self._growing[name]
        else:
            samples.append((now, value))

    def facts(self, how: str) -> Facts:
        """Return the facts about fields and clock; ``how`` says how many frames came."""
        rows = {name: [_joined(types), *self._shown_range(name)] for name, types in sorted(self._types.items())}
        return {"frame_fields": Fact(rows, how), **self._clock(how)}

    def _shown_range(self, name: str) -> List[Optional[float]]:
        low, high = self._ranges.get(name, (None, None))
        is_hidden = is_naming(name) or (name not in self._known and low == high)
        return [None, None] if is_hidden else [low, high]

    def _clock(self, how: str) -> Facts:
        found = {name: told for name, told in (
            (name, _clock_of(samples)) for name, samples in self._growing.items()) if told is not None}
        if not found:
            return {"frame_clock": Fact("none", "no number in %s grows as time does" % how),
                    "clock_drift": Fact(None, "frames have no clock")}
        name = min(found, key=lambda one: found[one][2])
        unit, drift, unsure = found[name]
        return {"frame_clock": Fact("%s, in %s" % (name, unit), how),
                "clock_drift": Fact(round(drift, 1), "field %s beside this computer's clock" % name,
                                    "%.0f either way" % unsure)}


def _clock_of(samples: Sequence[Tuple[float, float]]) -> Optional[Tuple[str, float, float]]:
    """Return unit, drift and its uncertainty, ppm, of a number that grew; None where it is no clock.

    samples: Monotonic s, and the number.
    """
    if len(samples) < _LEAST_SAMPLES or samples[-1][0] - samples[0][0] < _LEAST_SPAN_S:
        return None
    (begun, first), count = samples[0], len(samples)
    points = [(at - begun, float(value - first)) for at, value in samples]
    middle, height = sum(at for at, _ in points) / count, sum(value for _, value in points) / count
    square = sum((at - middle) ** 2 for at, _ in points)
    rate = sum((at - middle) * (value - height) for at, value in points) / square
    for unit, nominal in _RATES.items():
        if abs(rate / nominal - 1.0) <= _SAME_RATE:
            misfit = sum(((value - height) / rate - (at - middle)) ** 2 for at, value in points) / count
            if misfit > _LARGEST_MISFIT_S ** 2:
                return None
            return unit, 1e6 * (rate / nominal - 1.0), 2e6 * (misfit / square) ** 0.5
    return None


def reply_types(replies: Mapping[str, Mapping[str, Any]]) -> Dict[str, Dict[str, str]]:
    """Return the type of each key of replies, by the command's name and the key's."""
    return {name: {key: type_of(value) for key, value in sorted(reply.items())} for name, reply in replies.items()}


def different_types(name: str, one: Mapping[str, Any], other: Mapping[str, Any]) -> List[str]:
    """Return a line for each field whose type two probes do not share, or that one of them lacks.

    A number that happens to be whole is a number. Ranges are those of the arm's own motion, and are not compared.

    Args:
        name: "frame_fields" or "reply_types".
        one: The value of that fact.
        other: That of the other probe.
    """
    rows, others = _flat(name, one), _flat(name, other)
    return ["%s: %s and %s" % (key, rows.get(key, "none"), others.get(key, "none"))
            for key in sorted({*rows, *others}) if rows.get(key) != others.get(key)]


def _flat(name: str, value: Mapping[str, Any]) -> Dict[str, str]:
    rows = {key: row[0] for key, row in value.items()} if name == "frame_fields" else {
        "%s of %s" % (key, command): kind for command, keys in value.items() for key, kind in keys.items()}
    return {key: kind.replace(_WHOLE, _NUMBER) for key, kind in rows.items()}


def is_table(name: str, value: Any) -> bool:
    """Return whether a value from elsewhere is one that a fact of this name, "frame_fields" or "reply_types", has."""
    if not isinstance(value, dict):
        return False
    if name == "reply_types":
        return all(isinstance(keys, dict) and all(isinstance(kind, str) for kind in keys.values())
                   for keys in value.values())
    return all(isinstance(row, list) and len(row) == 3 and isinstance(row[0], str)
               and all(one is None or type(one) in (int, float) for one in row[1:]) for row in value.values())


TABLES = ("frame_fields", "reply_types")
"""Names of the facts whose value is a table."""
