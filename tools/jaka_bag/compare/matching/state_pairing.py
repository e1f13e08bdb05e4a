"""The pairing of two sequences of states of which brief ones may be missing.

Each run of the golden log is paired with one of the candidate's, joined with the run before it that has the same value,
or left alone; so is each run of the candidate. A run left alone is excused once, by itself: it is brief, and no alarm
that the golden log does not have.
"""
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

_BAND = 40
"""Number of runs by which two sequences may be out of step, beyond the difference of their lengths."""
_EXCUSED_COST = 0.01
"""Cost of a run left alone that is excused: above 0, so that pairing it is preferred."""
_ALONE_COST = 1.0
"""Cost of another run left alone, the unit of all: above that of the latest pair, 0.9."""
_LATE_COST = 0.4
"""Cost of a pair that comes too late, beside that of its delay: below a run that is missed."""
_FAR_S = 10.0
"""Delay, s, from which on a pair costs no more: being later then says nothing."""
_NO_VALUE = None


class StateRun(NamedTuple):
    """A state that lasted from ``start`` to ``end``, s."""

    value: int
    start: float
    end: float

    @property
    def length(self) -> float:
        return self.end - self.start


class StatePairs(NamedTuple):
    """The outcome of a pairing; positions in the two sequences.

    Attributes:
        pairs: (golden, candidate) runs that are the same state.
        missing: Golden runs without a partner and without an excuse.
        new: The candidate's runs without a partner and without an excuse.
    """

    pairs: List[Tuple[int, int]]
    missing: List[int]
    new: List[int]


_Place = Tuple[int, Optional[int]]
"""Position in the candidate's sequence and the value of the last pair."""
_Step = Tuple[float, Optional[_Place], str]


def pair_states(golden: Sequence[StateRun], candidate: Sequence[StateRun], lag: float,
                may_miss: Sequence[bool], may_be_new: Sequence[bool], in_time_s: float = math.inf) -> StatePairs:
    """Pair two sequences of states in order: as few as possible stay alone; of equal choices the nearest in time.

    Args:
        golden: Runs in the order of time, each with another value than the one before.
        candidate: Runs likewise.
        lag: Delay of the candidate's times, s.
        may_miss: Whether the candidate may lack each golden run.
        may_be_new: Whether the golden log may lack each of the candidate's.
        in_time_s: Runs whose begins are farther apart are only paired where one of them has no excuse.
    """
    band = _BAND + abs(len(golden) - len(candidate))
    rows: List[Dict[_Place, _Step]] = [{(0, _NO_VALUE): (0.0, None, "")}]
    _advance_candidate(rows[0], candidate, may_be_new, band)
    for i, run in enumerate(golden):
        here = _advance_golden(rows[-1], run, candidate, lag, may_miss[i], (i - band, i + band), in_time_s)
        _advance_candidate(here, candidate, may_be_new, i + 1 + band)
        rows.append(here)
    return _traced(rows, len(candidate), may_miss, may_be_new)


def _offer(row: Dict[_Place, _Step], place: _Place, cost: float, before: _Place, how: str) -> None:
    known = row.get(place)
    if known is None or cost < known[0]:
        row[place] = (cost, before, how)


def _advance_golden(above: Dict[_Place, _Step], run: StateRun, candidate: Sequence[StateRun], lag: float,
                    may_miss: bool, band: Tuple[int, int], in_time_s: float) -> Dict[_Place, _Step]:
    """Return the places after one more golden run: paired, joined with the last pair, or alone."""
    here: Dict[_Place, _Step] = {}
    for place, (cost, _, _) in above.items():
        j, value = place
        if j >= band[0]:
            _offer(here, place, cost + (0.0 if run.value == value else _EXCUSED_COST if may_miss else _ALONE_COST),
                   place, "joined golden" if run.value == value else "golden")
        if j < len(candidate) and j <= band[1] and candidate[j].value == run.value:
            late = abs(candidate[j].start - lag - run.start)
            _offer(here, (j + 1, run.value), cost + 0.5 * min(late / _FAR_S, 1.0) + (
                _LATE_COST if late > in_time_s else 0.0), place, "pair")
    return here


def _advance_candidate(row: Dict[_Place, _Step], candidate: Sequence[StateRun], may_be_new: Sequence[bool],
                       last: int) -> None:
    """Add to a row the places after further runs of the candidate that are joined or alone."""
    waiting: List[List[_Place]] = [[] for _ in range(len(candidate) + 1)]
    for place in row:
        waiting[place[0]].append(place)
    for j in range(min(len(candidate), max(last, 0) + 1)):
        for place in waiting[j]:
            value = place[1]
            cost = row[place][0]
            joins = candidate[j].value == value
            if (j + 1, value) not in row:
                waiting[j + 1].append((j + 1, value))
            _offer(row, (j + 1, value), cost + (0.0 if joins else _EXCUSED_COST if may_be_new[j] else _ALONE_COST),
                   place, "joined candidate" if joins else "candidate")


def _traced(rows: List[Dict[_Place, _Step]], count: int, may_miss: Sequence[bool],
            may_be_new: Sequence[bool]) -> StatePairs:
    ends = {place: step for place, step in rows[-1].items() if place[0] == count}
    place = min(ends, key=lambda one: ends[one][0])
    result = StatePairs([], [], [])
    i = len(rows) - 1
    while True:
        _, before, how = rows[i][place]
        if before is None:
            break
        if how == "pair":
            result.pairs.append((i - 1, place[0] - 1))
        elif how == "golden" and not may_miss[i - 1]:
            result.missing.append(i - 1)
        elif how == "candidate" and not may_be_new[place[0] - 1]:
            result.new.append(place[0] - 1)
        if how in ("pair", "golden", "joined golden"):
            i -= 1
        place = before
    for found in result:
        found.reverse()
    return result


def are_in_step(golden: Sequence[StateRun], candidate: Sequence[StateRun], lag: float, most_s: float) -> bool:
    """Return whether both sequences have the same values, each state begun within ``most_s`` of the other's."""
    return [run.value for run in golden] == [run.value for run in candidate] and max(
        (abs(theirs.start - lag - ours.start) for ours, theirs in zip(golden[1:], candidate[1:])),
        default=-math.inf) <= most_s
