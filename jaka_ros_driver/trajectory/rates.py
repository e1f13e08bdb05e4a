"""The rates at which a path is run through where it asks a little more of a joint than that has: its clock is slowed.

The path itself stays as it is. Over each stretch in which a limit is passed the clock runs at one lower rate, with a
ramp before and behind it; the ramps are made longer until they ask for nothing that a joint does not have.
"""
import math
from bisect import bisect_right
from typing import Any, Callable, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

LARGEST_OVERSHOOT = 1.25
"""Factor over a limit up to which a path is slowed; a plan that asks for more was made with other limits."""
_ROOM = 0.99
"""Share of a limit that a slowed stretch uses: the clock needs the rest to keep to its ramps."""
_RAMPS_S = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Durations of a ramp, s, tried in order: a short one delays least, and a long one asks least of the joints."""
_STEP_S = 0.002
"""Step, s, of the looks at a slowed part: a quarter of a cycle."""
_SAMPLES_AT_ONCE = 20_000
"""Samples in one array: a plan of a day takes some MB, not some GB."""
_SLOPE_S = 1e-6
"""Step, s, of a difference that stands for a derivative."""
_TRIES = 3
"""Attempts with one ramp: what was found may be a little larger between its samples."""

_Array = Any
"""A numpy array, as in ``path``."""


class SlowPart(NamedTuple):
    """A part of a path, from and until s, and the rate of the clock on it, 0 to 1."""

    since: float
    until: float
    rate: float


class Rates:
    """The highest rates of a clock along a path.

    Attributes:
        stretches: Where it is slowed, in the order of time; with their ramps they do not touch.
        ramp: Duration of the ramp before and behind each, s of the path.
        text: What is slowed, in words.
    """

    def __init__(self, stretches: Sequence[SlowPart], ramp: float, text: str) -> None:
        self.stretches, self.ramp, self.text = list(stretches), ramp, text
        self._begins = [stretch.since - ramp for stretch in stretches]
        self._parts = np.array(self.stretches, dtype=float).reshape(-1, 3)

    def at(self, time: float) -> float:
        """Return the highest rate at this time of the path, s; infinite where it is not slowed."""
        index = bisect_right(self._begins, time) - 1
        if index < 0:
            return math.inf
        since, until, rate = self.stretches[index]
        beside = max(since - time, time - until, 0.0) / self.ramp
        return math.inf if beside >= 1.0 else rate + (1.0 - rate) * beside * beside * (3.0 - 2.0 * beside)

    def delay(self) -> float:
        """Return by how much longer the path takes than without, s."""
        return _STEP_S * sum([float((1.0 / self.samples(times)[0] - 1.0).sum()) for times in self.times()])

    def times(self) -> Iterator[_Array]:
        """Yield the times at which the slowed parts, their ramps included, are looked at, s (m,): some at once."""
        held: List[_Array] = []
        count = 0
        for since, until, _ in self.stretches:
            begin = since - self.ramp
            steps = math.ceil((until + self.ramp - begin) / _STEP_S)
            for first in range(0, steps, _SAMPLES_AT_ONCE):
                held.append(begin + _STEP_S * np.arange(first, min(first + _SAMPLES_AT_ONCE, steps)))
                count += len(held[-1])
                if count >= _SAMPLES_AT_ONCE:
                    yield np.concatenate(held)
                    held, count = [], 0
        if held:
            yield np.concatenate(held)

    def samples(self, times: _Array) -> Tuple[_Array, _Array]:
        """Return the rates at many times, s (m,), and their derivatives over the path's time, 1/s: (m,) each."""
        here, next_to = self._lowered(times), self._lowered(times + _SLOPE_S)
        return here, (next_to - here) / _SLOPE_S

    def _lowered(self, times: _Array) -> _Array:
        """Return the rates as ``at`` does, 1 where the path is not slowed, (m,)."""
        index = np.searchsorted(self._parts[:, 0] - self.ramp, times, side="right") - 1
        since, until, rate = self._parts[np.maximum(index, 0)].T
        beside = np.minimum(np.maximum(np.maximum(since - times, times - until), 0.0) / self.ramp, 1.0)
        return rate + (1.0 - rate) * beside * beside * (3.0 - 2.0 * beside)


class Overshoots:
    """The places where a path passes limits by less than ``LARGEST_OVERSHOOT``."""

    def __init__(self) -> None:
        self._stretches: List[SlowPart] = []
        self._worst: Tuple[float, str] = (1.0, "")

    def __bool__(self) -> bool:
        return bool(self._stretches)

    def add(self, since: _Array, until: _Array, rates: _Array, text: str) -> None:
        """Add stretches: begins and ends, s, and the rates that keep the limit, (m,) each; ``text`` tells the worst."""
        rates = rates * _ROOM
        found = [SlowPart(*values) for values in zip(since.tolist(), until.tolist(), rates.tolist())]
        self._stretches += _merged(found, _RAMPS_S[0])  # as all ramps need it: a long plan has millions
        self._worst = min(self._worst, (float(rates.min()), text))

    def rates(self, begin: float, end: float, share: Callable[[Rates], float]) -> Optional[Rates]:
        """Return the rates that keep every limit; None where there are none.

        Args:
            begin: Of the path, s.
            end: Of the path, s.
            share: Returns the largest share of a limit that the path needs where it is slowed to these rates.
        """
        lowest = min([stretch.rate for stretch in self._stretches])
        plans = [(ramp, _merged(self._stretches, ramp)) for ramp in _RAMPS_S]
        for ramp, stretches in [*plans, (_STEP_S, [SlowPart(begin, end, lowest)])]:
            for _ in range(_TRIES):
                found = Rates(stretches, ramp, self._worst[1])
                needed = share(found)
                if needed <= 1.0:
                    return found
                stretches = [stretch._replace(rate=stretch.rate / needed) for stretch in stretches]
        return None


def _merged(stretches: Sequence[SlowPart], ramp: float) -> List[SlowPart]:
    """Return the stretches in order, those as one whose ramps would touch."""
    found: List[SlowPart] = []
    for stretch in sorted(stretches):
        if found and stretch.since - found[-1].until < 2.0 * ramp:
            last = found[-1]
            found[-1] = SlowPart(last.since, max(last.until, stretch.until), min(last.rate, stretch.rate))
        else:
            found.append(stretch)
    return found
