"""The runs of each cell in the order of time: amounts from run to run, their trends, and what drifts since when."""
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Aspect
from jaka_bag.messages.batch import Array

from .outcome import DIFFERENT, NOT_COMPARED, SAME, UNKNOWN, RunOutcome
from .trend import ChangePoint, Slope, find_change, theil_sen

CYCLE = "cycle time"
_LEAST_OF_LIMIT = 0.05
"""A change by less than this share of the limit is no drift."""
_LEAST_OF_PACE = 0.2
"""The same for the cycle time: waits for people and machines make it vary more than joints do."""
GROUPS: Dict[str, Tuple[Aspect, ...]] = {
    "topics": (Aspect.TYPES, Aspect.COUNTS, Aspect.RATES, Aspect.JITTER, Aspect.GAPS, Aspect.LOST, Aspect.STAMPS),
    "timing": (Aspect.ALIGNMENT, Aspect.TIMING, Aspect.PACE, Aspect.LATENESS),
    "tool": (Aspect.POSITION, Aspect.ORIENTATION),
    "fields": (Aspect.FIELDS, Aspect.CONTENTS), "states": (Aspect.STATES,),
    "calls": (Aspect.CALLS, Aspect.RESPONSES, Aspect.DURATIONS)}
"""Checks that are drawn as one line, besides the joints."""


class Series(NamedTuple):
    """One amount of one cell from run to run.

    Attributes:
        cell: The cell.
        name: The joint, or ``CYCLE``.
        topic: Topic that it is from; empty for the cycle time.
        unit: rad or s.
        number: Numbers of the runs that have it, from 0, shape (n,).
        value: Largest difference of the joint from the golden log, or cycle time, shape (n,).
        limit: Largest amount allowed; for the cycle time the amount that its change is measured by.
        slope: Trend over all runs, for each run; None for less than four.
        change: The run from which on it drifts or has jumped.
    """

    cell: str
    name: str
    topic: str
    unit: str
    number: Array
    value: Array
    limit: float
    slope: Optional[Slope]
    change: Optional[ChangePoint]

    @property
    def is_joint(self) -> bool:
        """True for an amount that a limit is for."""
        return self.name != CYCLE

    @property
    def first_changed(self) -> Optional[int]:
        """Number of the first run that drifted, from 0."""
        return None if self.change is None else int(self.number[self.change.first])

    @property
    def first_beyond(self) -> Optional[int]:
        """Number of the first run behind the change that is beyond the limit, from 0."""
        if self.change is None or not self.is_joint:
            return None
        beyond = np.flatnonzero(self.value[self.change.first:] > self.limit)
        return int(self.number[self.change.first + beyond[0]]) if len(beyond) else None

    @property
    def rise(self) -> Optional[Slope]:
        """Slope since the change, for each run; None for a jump."""
        if self.change is None or not self.change.is_gradual:
            return None
        first = max(self.change.first - 1, 0)
        return theil_sen(self.number[first:], self.value[first:])

    @property
    def runs_left(self) -> Optional[Tuple[float, float]]:
        """The number of runs until the limit is reached if the slope lasts: from its fast and from its slow end."""
        rise = self.rise
        if rise is None or self.change is None or not self.is_joint or not rise.low > 0:
            return None
        left = self.limit - (self.change.before + self.change.size)
        return (left / rise.high, left / rise.low) if left > 0 else None


class Cell(NamedTuple):
    """The runs of one cell.

    Attributes:
        name: The cell.
        runs: Runs with a known time, in its order.
        series: The joints in their order, then the cycle time.
        joints: Margin by joint, shape (runs,); NaN where there is none.
        groups: Margin by group of checks, likewise.
    """

    name: str
    runs: List[RunOutcome]
    series: List[Series]
    joints: Dict[str, Array]
    groups: Dict[str, Array]


class RunHistory(NamedTuple):
    """All runs.

    Attributes:
        runs: Runs in the order of time.
        cells: Cells by name.
        drifts: Series that drift or have jumped, the largest share of its limit first.
    """

    runs: List[RunOutcome]
    cells: List[Cell]
    drifts: List[Series]

    def count(self, verdict: str) -> int:
        """Count the runs of a verdict."""
        return sum(run.verdict == verdict for run in self.runs)

    def runs_of(self, cell: str) -> List[RunOutcome]:
        """Return the runs of a cell."""
        return next(one.runs for one in self.cells if one.name == cell)

    @property
    def headline(self) -> str:
        """The number of runs of each verdict, as a headline."""
        counts = [(verdict, self.count(verdict)) for verdict in (SAME, DIFFERENT, UNKNOWN, NOT_COMPARED)]
        return "%d runs: %s" % (len(self.runs), ", ".join(
            "%d %s" % (number, verdict) for verdict, number in counts if number or verdict in (SAME, DIFFERENT)))


def _series(cell: str, name: str, topic: str, unit: str, values: Sequence[Optional[float]], limit: float,
            least: float) -> Series:
    number = np.array([i for i, value in enumerate(values) if value is not None and math.isfinite(value)], np.int64)
    value = np.array([values[i] for i in number], float)
    change = find_change(value, least)
    if change is not None and name != CYCLE and change.size < 0:
        change = None  # nearer to the golden log than before
    return Series(cell, name, topic, unit, number, value, limit, theil_sen(number.astype(float), value), change)


def _joint_names(several: bool, topic: str, field: str) -> str:
    return "%s of %s" % (field, topic) if several else field


def _cell(name: str, runs: List[RunOutcome], tolerances: Tolerances) -> Cell:
    joints: Dict[Tuple[str, str], List[Optional[float]]] = {}
    limits: Dict[Tuple[str, str], float] = {}
    margins: Dict[Tuple[str, str], Array] = {}
    groups = {group: np.full(len(runs), np.nan) for group in GROUPS}
    group_of = {aspect.value: group for group, aspects in GROUPS.items() for aspect in aspects}
    for number, run in enumerate(runs):
        for check in run.checks:
            if check.margin is None:
                continue
            group = group_of.get(check.aspect)
            if group is not None:
                groups[group][number] = np.fmax(groups[group][number], check.margin)
            elif check.worst is not None:
                key = check.topic, check.field
                joints.setdefault(key, [None] * len(runs))[number] = check.worst
                limits[key] = tolerances.joints.per_joint.get(check.field, tolerances.joints.position_rad)
                margins.setdefault(key, np.full(len(runs), np.nan))[number] = check.margin
    several = len({topic for topic, _ in joints}) > 1
    series = [_series(name, _joint_names(several, *key), key[0], "rad", values, limits[key],
                      _LEAST_OF_LIMIT * limits[key]) for key, values in joints.items()]
    cycles = [run.cycle for run in runs]
    known = [cycle for cycle in cycles if cycle is not None]
    if known:
        limit = 0.01 * tolerances.timing.pace_percent * float(np.median(known))
        series.append(_series(name, CYCLE, "", "s", cycles, limit, _LEAST_OF_PACE * limit))
    return Cell(name, runs, series, {_joint_names(several, *key): values for key, values in margins.items()},
                {group: values for group, values in groups.items() if np.isfinite(values).any()})


def history_of(outcomes: Sequence[RunOutcome], tolerances: Tolerances) -> RunHistory:
    """Sort the runs into histories of their cells; ``tolerances`` are those that they were judged by."""
    runs = sorted(outcomes, key=lambda outcome: outcome.place)
    # a log that tells no time, because it cannot be read, has no place among the others
    cells = [_cell(name, [run for run in runs if run.cell == name and run.start_ns], tolerances)
             for name in sorted({run.cell for run in runs})]
    drifts = [series for cell in cells for series in cell.series if series.change is not None]

    def strength(series: Series) -> float:
        assert series.change is not None
        return abs(series.change.size) / max(series.limit, 1e-12)

    return RunHistory(runs, cells, sorted(drifts, key=strength, reverse=True))
