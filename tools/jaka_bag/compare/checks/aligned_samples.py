"""The candidate's samples at golden times, a window of both logs at a time, beside the golden curve."""
from dataclasses import replace
from typing import Callable, Collection, Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from ...messages.batch import Array
from ...units import ms_to_s
from ..matching.alignment import Alignment
from ..matching.curve_distance import Lateness, box_distances, distances, interpolated, lengths
from ..matching.cut_motions import Allowances, Cut
from ..runs.run import LongTrack, Track, arm_of
from ..tolerances import Envelope, Tolerances
from .reach_checks import Reach

_BEHIND_S = 10.0
"""Span, s, of the golden curve that is kept before the times where samples have been sought."""
_GAP_STEPS = 2.0
"""Number of the usual steps of a slow track, as of a frame beside fast ones, that are a gap of it."""
_AROUND_S = 1.0
"""Span, s, of the candidate's curve, and twice the jitter, that is known around each sample that is judged."""


class Frame(NamedTuple):
    """The context that the checks of one comparison share.

    ``common`` are the golden times, s, between which both logs have messages; ``duration`` is the golden log's, s.
    """

    alignment: Alignment
    tolerances: Tolerances
    arms: List[str]
    cuts: Dict[str, List[Cut]]
    resolution: float
    common: Tuple[float, float]
    duration: float
    on_change: Collection[str] = ()
    time_scale: float = 1.0

    @property
    def jitter_s(self) -> float:
        """The largest error of a stamp, s."""
        return ms_to_s(self.tolerances.timing.jitter_ms)

    def envelope(self, topic: str, name: str) -> Envelope:
        """Return the envelope of a joint, position, orientation or field; empty where it has none."""
        return self.tolerances.envelopes.get(topic, {}).get(name, ())


class Samples(NamedTuple):
    """The candidate's finite samples at golden times, without those where the golden log has none.

    ``jitter`` is the largest error of each stamp, s; ``allowed`` the allowed deviation of each value because of stops.
    ``curve_time`` and ``curve_value`` are all of the candidate's samples from before to behind these, which are at the
    places ``own`` of it; ``sought`` is the golden value at each sample's time, as the candidate's curve should show it.
    """

    time: Array
    value: Array
    jitter: Array
    allowed: Array
    golden_time: Array
    golden_value: Array
    golden_here: Array
    curve_time: Array
    curve_value: Array
    own: Array
    sought: Array

    def columns(self, some: slice) -> "Samples":
        """Return the samples with some of their columns."""
        return self._replace(value=self.value[:, some], allowed=self.allowed[:, some],
                             golden_value=self.golden_value[:, some], golden_here=self.golden_here[:, some],
                             curve_value=self.curve_value[:, some], sought=self.sought[:, some])

    def distances(self, enough: float) -> Array:
        """Return the Euclidean distance of each sample to the golden curve, or of the golden value to the candidate's.

        The larger of both counts: what only one of the curves does is off. Exact where above ``enough``.
        """
        direct = lengths(self.value - self.golden_here)
        off = distances(self.golden_time, self.golden_value, self.time, self.value, direct, self.jitter, enough)
        which = np.flatnonzero(direct > enough)
        if len(which):
            off[which] = np.maximum(off[which], box_distances(self.curve_time, self.curve_value, self.time[which],
                                                              self.sought[which], self.jitter[which]))
        return off


Convert = Callable[[Array, Optional[Array]], Array]
"""Values as they are compared, from those in the log and the last row that was converted (None: there was none)."""


def as_they_are(value: Array, _before: Optional[Array]) -> Array:
    """Return values as they are in the log."""
    return value


class _GoldenCurve:
    """The part of a golden track that samples are compared with; it moves on with them."""

    def __init__(self, track: LongTrack, longest_s: float, convert: Convert, reach: Reach) -> None:
        self._reach = reach
        self._blocks: Iterator[Track] = track.blocks()
        self._lateness = Lateness(track.facts.rhythm if track.facts.finite_count > 2 else 0.0, longest_s)
        self._convert = convert
        self._is_at_end = False
        self._last: Optional[Array] = None
        self.time, self.late = np.zeros(0), np.zeros(0)
        self.value = np.zeros((0, 0))

    def cover(self, until: float) -> None:
        """Extend the curve to two samples beyond a golden time, s, where there are so many."""
        while not self._is_at_end and (len(self.time) < 2 or self.time[-2] <= until):
            block = next(self._blocks, None)
            if block is None:
                self._is_at_end = True
                if len(self.time) == 1:  # a curve has two points
                    self.time, self.late, self.value = (np.repeat(one, 2, axis=0) for one in (
                        self.time, self.late, self.value))
                return
            self._reach.golden.add(block.time)
            block = block.finite()
            if not len(block.time):
                continue
            value = self._convert(block.value, self._last)
            self._last = value[-1].copy()
            late = self._lateness.of(block.time)
            whole = len(self.time) > 0
            self.time = np.concatenate([self.time, block.time])
            self.late = np.concatenate([self.late, late])
            self.value = np.concatenate([self.value, value]) if whole else value

    def finish(self) -> None:
        """Note the times of all samples that were not needed."""
        for block in self._blocks:
            self._reach.golden.add(block.time)

    def drop(self, before: float) -> None:
        """Give up what lies before a golden time, s, but for two samples."""
        first = max(int(np.searchsorted(self.time, before)) - 2, 0)
        self.time, self.late, self.value = self.time[first:], self.late[first:], self.value[first:]


class AlignedSamples:
    """An iterator over the windows of a candidate's track, as samples at golden times."""

    def __init__(self, ours: LongTrack, theirs: LongTrack, frame: Frame, convert: Convert = as_they_are) -> None:
        self._theirs, self._frame, self._convert = theirs, frame, convert
        self._gap_s = max(frame.tolerances.streams.gap_s, _GAP_STEPS * ours.facts.rhythm)
        self._arm = arm_of(ours.topic, frame.arms)
        self._facts = ours.facts
        self.reach = Reach()
        self._golden = _GoldenCurve(ours, self._gap_s, convert, self.reach)
        rhythm = theirs.facts.rhythm if theirs.facts.finite_count > 2 else 0.0
        self._lateness = Lateness(rhythm, self._gap_s)
        self._last: Optional[Array] = None
        self._held: Optional[Tuple[Array, Array, Array]] = None
        self._given = 0
        self._around_s = _AROUND_S + 2.0 * frame.jitter_s
        self._allowances = Allowances(frame.cuts.get(self._arm, []), ours, ms_to_s(frame.tolerances.timing.cut_ms),
                                      lambda value: convert(value, None))
        self._beyond_s = frame.tolerances.timing.event_s if ours.facts.finite_count == 1 else 0.0
        self.can_be_compared = ours.facts.finite_count > 0 and theirs.facts.finite_count > 0

    def finish(self) -> None:
        """Read what is left of the golden track, for ``reach``."""
        self._golden.finish()

    def samples(self, block: Track, good: Array) -> Optional[Samples]:
        """Return further samples after the candidate's next window, all but the last ones; None where there are none.

        ``good`` tells of each sample whether all of its values are numbers.
        """
        at = self._frame.alignment.golden_time(self._arm, block.time)
        self.reach.candidate.add(at)
        if not good.all():
            at, block = at[good], replace(block, time=block.time[good], value=block.value[good])
        if not len(block.time) or not self.can_be_compared:
            return None
        value = self._convert(block.value, self._last)
        self._last = value[-1].copy()
        jitter = self._frame.jitter_s + self._lateness.of(block.time)
        if self._held is not None:
            at, value, jitter = (np.concatenate(both) for both in zip(self._held, (at, value, jitter)))
        self._held = at, value, jitter
        return self._up_to(float(at[-1]) - self._around_s)

    def rest(self) -> Optional[Samples]:
        """Return the last samples, after all windows; None where there are none."""
        return None if self._held is None else self._up_to(np.inf)

    def _up_to(self, until: float) -> Optional[Samples]:
        """Return the samples up to a golden time, s, that were not given yet; keep what lies around the next ones."""
        assert self._held is not None
        time, curve, late = self._held
        own = np.arange(self._given, int(np.searchsorted(time, until, "right")))
        if not len(own):
            return None
        found = self._found(time, curve, late, own)
        kept = int(np.searchsorted(time, time[own[-1]] - self._around_s))
        self._held = time[kept:], curve[kept:], late[kept:]
        self._given = int(own[-1]) + 1 - kept
        return found

    def _found(self, time: Array, curve: Array, late: Array, own: Array) -> Optional[Samples]:
        at = time[own]
        inside = (at >= self._facts.first - self._beyond_s) & (at <= self._facts.last + self._beyond_s)
        if not inside.any():
            return None
        golden = self._golden
        golden.cover(float(at[np.flatnonzero(inside)[-1]]))
        for i in np.flatnonzero(np.diff(golden.time) > self._gap_s).tolist():
            inside &= (at < golden.time[i] + self._frame.jitter_s) | (at > golden.time[i + 1] - self._frame.jitter_s)
        if not inside.any():
            return None
        if not inside.all():
            own, at = own[inside], at[inside]
        value, jitter = curve.take(own, axis=0), late[own] + np.interp(at, golden.time, golden.late)
        golden.cover(float(at[-1] + jitter.max()))
        here = interpolated(golden.time, golden.value, at)
        found = Samples(at, value, jitter, self._allowances.at(at, value.shape[1]), golden.time, golden.value, here,
                        time, curve, own, here)
        golden.drop(float(at[-1] - jitter.max()) - _BEHIND_S)
        return found
