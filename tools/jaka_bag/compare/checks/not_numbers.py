"""Values that are no numbers: where they are, column by column and by their kind, and the columns beside them."""
from dataclasses import replace
from typing import Callable, Dict, List, Tuple

import numpy as np

from ...messages.batch import Array
from ..runs.run import LongTrack, Track
from ..runs.track_facts import FactsBuilder

_KINDS: Tuple[Callable[[Array], Array], ...] = (np.isnan, np.isposinf, np.isneginf)


class NotNumbers:
    """The times of the values that are no numbers, by column and kind (NaN, infinite, minus infinite).

    Attributes:
        count: Samples with such a value.
        span: Times of the first and the last sample of the track, s.
    """

    def __init__(self) -> None:
        self._times: Dict[Tuple[int, int], List[Array]] = {}
        self.count = 0
        self.span = np.inf, -np.inf

    def note(self, time: Array) -> None:
        """Note the times, s, of all further samples, ascending from call to call."""
        if len(time):
            self.span = min(self.span[0], float(time[0])), float(time[-1])

    def add(self, time: Array, value: Array) -> None:
        """Add samples of which at least one value each is no number; s, ascending from call to call."""
        self.count += len(time)
        for kind, test in enumerate(_KINDS):
            found = test(value)
            for column in np.flatnonzero(found.any(axis=0)).tolist():
                self._times.setdefault((column, kind), []).append(time[found[:, column]])

    def beside(self, others: "NotNumbers", golden_time: Callable[[Array], Array], reach: float) -> Array:
        """Return the golden times, s, of values that have no like one within ``reach`` in the other log.

        Where only one of the logs has samples there is none to be alike.

        Args:
            others: The candidate's.
            golden_time: Returns golden times of the candidate's.
            reach: Time, s.
        """
        wrong = [np.zeros(0)]
        for key in sorted({*self._times, *others._times}):
            ours = np.concatenate([np.zeros(0), *self._times.get(key, ())])
            theirs = golden_time(np.concatenate([np.zeros(0), *others._times.get(key, ())]))
            wrong += [theirs[~_near(theirs, ours, reach)], ours[~_near(ours, theirs, reach)]]
        alone: Array = np.unique(np.concatenate(wrong))
        first, last = golden_time(np.array(others.span)).tolist()
        in_both: Array = alone[(alone >= max(self.span[0], first)) & (alone <= min(self.span[1], last))]
        return in_both

    def all_times(self) -> Array:
        """Return the times of all of them, s."""
        times: Array = np.unique(np.concatenate([np.zeros(0), *(one for some in self._times.values() for one in some)]))
        return times


def _near(times: Array, others: Array, reach: float) -> Array:
    """Return whether one of ``others``, ascending, is within ``reach`` of each time."""
    near: Array = np.searchsorted(others, times - reach) < np.searchsorted(others, times + reach, "right")
    return near


def has_not_numbers(*tracks: LongTrack) -> bool:
    """Return whether one of some tracks has a sample of which not all values are numbers."""
    return any(track.facts.count != track.facts.finite_count for track in tracks)


def columns_of(track: LongTrack) -> List[LongTrack]:
    """Return each column of a track as a track of its own, with the facts of its own numbers."""
    def column_of(number: int) -> Callable[[float, float], Track]:
        def between(begin: float, end: float) -> Track:
            some = track.between(begin, end)
            return replace(some, names=track.names[number:number + 1], value=some.value[:, number:number + 1])
        return between
    return [_as_track(track, track.names[number:number + 1], column_of(number)) for number in range(len(track.names))]


def without_columns(track: LongTrack, some: slice) -> LongTrack:
    """Return a track with some columns 0, so that what is no number in them hides no sample."""
    def between(begin: float, end: float) -> Track:
        part = track.between(begin, end)
        value = part.value.copy()
        value[:, some] = 0.0
        return replace(part, value=value)
    return _as_track(track, track.names, between)


def _as_track(track: LongTrack, names: Tuple[str, ...], between: Callable[[float, float], Track]) -> LongTrack:
    builder = FactsBuilder(False)
    for begin, end in track.windows:
        part = between(begin, end)
        builder.add(part.time, part.value)
    return replace(track, names=names, between=between, facts=builder.facts())
