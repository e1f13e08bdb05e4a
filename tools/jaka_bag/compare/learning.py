"""Tolerances from runs that are known to be good: tight where the cell repeats itself, wide where it does not."""
import dataclasses
import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..errors import BagError
from ..messages.batch import Array
from ..paths import PathLike
from .comparison import compare_runs
from .runs.loading import load_run
from .tolerances import Envelope, Tolerances
from .verdict import Aspect, Check, Comparison, ResidualKey

FEWEST_RUNS = 3
"""Fewest runs to learn from: of two no spread is known."""
FLOOR = 0.25
"""Least learned limit, as a share of the limit without learning: a few runs do not show all that a host does."""
_SPREADS = 6.0
"""A limit lies this many spreads above the median; and above the largest amount seen, by ``_ABOVE``."""
_ABOVE = 1.5
"""Factor over the largest amount seen; 1 would fail a good run that is as bad as the worst one."""
_NORMAL = 1.4826
"""The standard deviation of a normal distribution, in median absolute deviations."""
_BIN_S = 0.5
"""Shortest stretch, s, with a limit of its own: in a shorter one few samples decide."""
_BINS = 200
"""A long log has this many stretches, a short one has some of ``_BIN_S``."""
_STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Digits of a learned limit: neighbours that are nearly alike become one, and a person can read them."""
_RESOLUTION = 0.05
"""Share of its limit from which on an amount is measured exactly: what is learned are amounts far below the limits."""

_TIMES: Tuple[Tuple[Aspect, str, str, str], ...] = (
    (Aspect.TIMING, "motions", "timing", "event_s"), (Aspect.TIMING, "waits", "timing", "wait_s"),
    (Aspect.CALLS, "timing", "calls", "timing_s"), (Aspect.STATES, "timing", "states", "timing_s"))
"""Aspect and last word of the field of a check, and the tolerance that limits it."""


class Learned(NamedTuple):
    """The tolerances that a cell's runs taught.

    Attributes:
        tolerances: Those that were given, with what was learned.
        wider: What got more than it had: its name, the largest learned limit, the limit without learning.
        left_out: Runs that would be different by the tolerances that the others teach, with the first such check.
    """

    tolerances: Tolerances
    wider: Tuple[Tuple[str, float, float], ...]
    left_out: Tuple[Tuple[str, str], ...]


class _Run(NamedTuple):
    """The amounts of one run: the largest of each stretch by check, and of each time by tolerance."""

    path: str
    off: Dict[ResidualKey, Array]
    times: Dict[Tuple[str, str], float]


def learn(golden: PathLike, good: Sequence[PathLike], tolerances: Tolerances) -> Learned:
    """Learn envelopes for each sample, and limits for the times of events, from good runs.

    Args:
        golden: The golden log.
        good: Logs of runs that do what it shows; at least ``FEWEST_RUNS``.
        tolerances: Limits for what is not learned; a learned limit may be wider or tighter than theirs.

    Raises:
        BagError: A log cannot be read, there are too few, or a run differs in something that has no amount to learn.
    """
    if len(good) < FEWEST_RUNS:
        raise BagError("%d good runs are too few to learn from; give %d or more" % (len(good), FEWEST_RUNS))
    base = dataclasses.replace(tolerances, envelopes={})
    ours = load_run(golden, base)
    width = max(_BIN_S, ours.duration / _BINS)
    runs: List[_Run] = []
    limits: Dict[ResidualKey, float] = {}
    for path in good:
        comparison = compare_runs(ours, load_run(path, base), base, resolution=_RESOLUTION)
        _require_alike(comparison)
        limits.update({key: residual.envelope[0][1] for key, residual in comparison.residuals.items()})
        runs.append(_amounts(comparison, width))
    left_out = [(run.path, found) for number, run in enumerate(runs)
                for found in [_first_outside(run, runs[:number] + runs[number + 1:], limits, base)] if found]
    envelopes: Dict[str, Dict[str, Envelope]] = {}
    wider: List[Tuple[str, float, float]] = []
    for key, steps in _envelopes(runs, limits).items():
        envelopes.setdefault(key[1], {})[key[2]] = _as_envelope(steps, width)
        wider += [(_name(key), float(steps.max()), limits[key])] if steps.max() > limits[key] else []
    times = _times(runs, base)
    wider += [("%s.%s" % name, value, before) for name, value in times.items()
              for before in [getattr(getattr(base, name[0]), name[1])] if value > before]
    return Learned(_with_times(dataclasses.replace(base, envelopes=envelopes), times), tuple(wider), tuple(left_out))


def _name(key: ResidualKey) -> str:
    return "%s %s" % (key[1], key[2])


def _require_alike(comparison: Comparison) -> None:
    for check in comparison.differences:
        if (check.aspect, check.topic, check.field) not in comparison.residuals and _limited_by(check) is None:
            raise BagError("%s is no good run: %s: %s" % (comparison.candidate.path, check.name, check.detail))


def _limited_by(check: Check) -> Optional[Tuple[str, str]]:
    """Return section and name of the tolerance that limits a check of time; None for others."""
    if check.measured is not None and check.unit == "s":
        for aspect, word, section, name in _TIMES:
            if check.aspect is aspect and check.field.split(" ")[-1] == word:
                return section, name
    return None


def _amounts(comparison: Comparison, width: float) -> _Run:
    count = int(comparison.golden.duration / width) + 1
    off: Dict[ResidualKey, Array] = {}
    for key, residual in comparison.residuals.items():
        place = np.minimum((residual.time / width).astype(np.int64), count - 1)
        most = np.zeros(count)
        np.maximum.at(most, np.maximum(place, 0), residual.off)
        off[key] = most
    times: Dict[Tuple[str, str], float] = {}
    for check in comparison.checks:
        name = _limited_by(check)
        if name is not None and check.measured is not None:
            times[name] = max(times.get(name, 0.0), check.measured)
    return _Run(comparison.candidate.path, off, times)


def _limit(amounts: Array, floor: float) -> Array:
    """Return the limit for amounts of several runs, shape (runs, n): shape (n,)."""
    middle = np.median(amounts, axis=0)
    spread = _NORMAL * np.median(np.abs(amounts - middle), axis=0)
    limit: Array = np.maximum(np.maximum(middle + _SPREADS * spread, _ABOVE * amounts.max(axis=0)), floor)
    return limit


def _envelopes(runs: Sequence[_Run], limits: Dict[ResidualKey, float]) -> Dict[ResidualKey, Array]:
    """Return the limit of each stretch by check; each stretch has the widest of itself and its neighbours.

    What happens at the edge of a stretch may happen beyond it in the next run.
    """
    found: Dict[ResidualKey, Array] = {}
    for key, limit in limits.items():
        amounts = [run.off[key] for run in runs if key in run.off]
        if amounts:
            own = np.pad(_limit(np.stack(amounts), FLOOR * limit), 1, mode="edge")
            found[key] = _readable(np.max([own[:-2], own[1:-1], own[2:]], axis=0))
    return found


def _readable(limits: Array) -> Array:
    """Return the limits, each raised to the next one whose digits are easy to read."""
    return np.array([next(step for step in _STEPS if step * 10.0 ** power >= limit * (1.0 - 1e-9))
                     * 10.0 ** power if limit > 0 else 0.0
                     for limit in limits.tolist() for power in [math.floor(math.log10(limit)) if limit > 0 else 0]])


def _as_envelope(limits: Array, width: float) -> Envelope:
    begins = [0, *(np.flatnonzero(np.diff(limits)) + 1).tolist()]
    return tuple((float("%.6g" % (place * width)), float("%.6g" % limits[place])) for place in begins)


def _times(runs: Sequence[_Run], tolerances: Tolerances) -> Dict[Tuple[str, str], float]:
    found: Dict[Tuple[str, str], float] = {}
    for name in sorted({name for run in runs for name in run.times}):
        amounts = np.array([[run.times.get(name, 0.0)] for run in runs])
        floor = FLOOR * getattr(getattr(tolerances, name[0]), name[1])
        found[name] = float(_readable(_limit(amounts, floor))[0])
    return found


def _with_times(tolerances: Tolerances, times: Dict[Tuple[str, str], float]) -> Tolerances:
    sections: Dict[str, Any] = {}
    for (section, name), value in times.items():
        sections[section] = dataclasses.replace(sections.get(section, getattr(tolerances, section)), **{name: value})
    return dataclasses.replace(tolerances, **sections)


def _first_outside(run: _Run, others: Sequence[_Run], limits: Dict[ResidualKey, float],
                   tolerances: Tolerances) -> str:
    """Name what of a run is outside of what the others teach; empty where nothing is."""
    for key, allowed in _envelopes(others, limits).items():
        if key in run.off and (run.off[key] > allowed).any():
            return _name(key)
    for (section, name), allowed_time in _times(others, tolerances).items():
        if run.times.get((section, name), 0.0) > allowed_time:
            return "%s.%s" % (section, name)
    return ""
