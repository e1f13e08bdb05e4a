"""A log in windows of time: its chunks are decoded when a window needs them.

What was decoded last is kept in memory, what was decoded before it in a temporary file.
"""
import contextlib
import pickle
import tempfile
from collections import OrderedDict
from typing import IO, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from ...messages.batch import Array
from .run import Arrivals, TimeWindow, Track, joined

_CELL_S = 16.0
"""Time step, s, of the record of which parts of a log hold samples."""
_WINDOW_ROWS = 120000
"""Rows of a window: some MB of samples, and few enough windows that their edges cost nothing."""
_KEPT_BYTES = 64 << 20
"""Bytes of decoded parts kept in memory; what is beyond goes to a file."""

TrackKey = Tuple[str, str]
"""Topic, and the field where it is a further one."""


class Rows(NamedTuple):
    """Messages of one topic out of one part of a log, in the order of recording.

    Attributes:
        arrivals: Their times, s.
        time: header.stamp where there is one, else log time, s; what tracks go by.
        values: Values by field (empty: the topic's own): shape (n, columns), and the rows that count (None: all).
    """

    arrivals: Arrivals
    time: Array
    values: Dict[str, Tuple[Array, Optional[Array]]]

    @property
    def size(self) -> int:
        """The memory that the values take, bytes."""
        return 24 * len(self.time) + sum(value.nbytes for value, _ in self.values.values())


class _Store:
    """Decoded parts in a temporary file without a name; reading them costs a tenth of decoding them again."""

    def __init__(self) -> None:
        self._file: Optional[IO[bytes]] = None
        self._places: Dict[int, int] = {}
        self._is_usable = True

    def put(self, number: int, rows: Dict[str, Rows]) -> None:
        """Write a part, unless it is there; on a full disk nothing is written any more."""
        if number in self._places or not self._is_usable:
            return
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="jaka_bag.")
            place = self._file.seek(0, 2)
            pickle.dump(rows, self._file, protocol=5)
            self._file.flush()
            self._places[number] = place
        except OSError:
            self.close()
            self._is_usable = False

    def get(self, number: int) -> Optional[Dict[str, Rows]]:
        """Return a part; None where it is not stored."""
        if self._file is None or number not in self._places:
            return None
        self._file.seek(self._places[number])
        rows: Dict[str, Rows] = pickle.load(self._file)
        return rows

    def close(self) -> None:
        """Remove the file and forget what was in it."""
        self._places.clear()
        if self._file is not None:
            with contextlib.suppress(OSError):  # what could not be written still cannot
                self._file.close()
            self._file = None


class LogWindows:
    """The samples of a log by windows of time.

    Args:
        decode: Returns the rows of a part by topic; called with its number.
        spans: Earliest and latest log time of each part, s.
        kept_bytes: Rows up to this size are kept for the next window.
    """

    def __init__(self, decode: Callable[[int], Dict[str, Rows]], spans: Sequence[TimeWindow],
                 kept_bytes: Optional[int] = None) -> None:
        self._decode = decode
        self._spans = np.array(spans, float).reshape(-1, 2)
        self._most_bytes = _KEPT_BYTES if kept_bytes is None else kept_bytes
        self._kept: OrderedDict[int, Dict[str, Rows]] = OrderedDict()
        self._kept_bytes = 0
        self._store = _Store()
        self._cells: Dict[str, Dict[int, Set[int]]] = {}
        self._counts: Dict[int, int] = {}
        self.is_all_kept = True

    @property
    def part_count(self) -> int:
        """The number of the log's parts."""
        return len(self._spans)

    def forget(self) -> None:
        """Start anew: nothing is kept, nothing is known of where samples lie."""
        self._kept.clear()
        self._kept_bytes = 0
        self._store.close()
        self._cells.clear()
        self._counts.clear()
        self.is_all_kept = True

    def part(self, number: int) -> Dict[str, Rows]:
        """Return the rows of one part, by topic."""
        if number in self._kept:
            self._kept.move_to_end(number)
            return self._kept[number]
        stored = self._store.get(number)
        rows = self._decode(number) if stored is None else stored
        self._kept[number] = rows
        self._kept_bytes += sum(topic.size for topic in rows.values())
        while self._kept_bytes > self._most_bytes and len(self._kept) > 1:
            oldest, left = self._kept.popitem(last=False)
            self._store.put(oldest, left)
            self._kept_bytes -= sum(topic.size for topic in left.values())
            self.is_all_kept = False
        return rows

    def note(self, number: int, rows: Dict[str, Rows]) -> None:
        """Remember where the samples of a part lie."""
        for topic, some in rows.items():
            cells = np.floor(some.time / _CELL_S).astype(np.int64)
            begins = np.flatnonzero(np.concatenate([[True], cells[1:] != cells[:-1]])) if len(cells) else cells
            known = self._cells.setdefault(topic, {})
            for cell, count in zip(cells[begins].tolist(), np.diff(begins, append=len(cells)).tolist()):
                known.setdefault(cell, set()).add(number)
                self._counts[cell] = self._counts.get(cell, 0) + count

    def windows(self) -> Tuple[TimeWindow, ...]:
        """Return windows that cover all time, each of a bounded number of messages; the outer ones are open."""
        edges = [-np.inf]
        rows = 0
        for cell in sorted(self._counts):
            if rows and rows + self._counts[cell] > _WINDOW_ROWS:
                edges.append(cell * _CELL_S)
                rows = 0
            rows += self._counts[cell]
        return tuple(zip(edges, edges[1:] + [np.inf]))

    def _rows(self, numbers: Sequence[int], topic: str) -> Iterator[Rows]:
        for number in numbers:
            rows = self.part(number).get(topic)
            if rows is not None:
                yield rows

    def arrivals(self, topic: str, begin: float, end: float) -> Arrivals:
        """Return the messages of a topic recorded in a window, in the order of recording."""
        first, last = self._spans[:, 0], self._spans[:, 1]
        numbers = np.flatnonzero((first < end) & (last >= begin)).tolist()
        found: List[Arrivals] = []
        for rows in self._rows(numbers, topic):
            found.append(rows.arrivals.some(slice(*np.searchsorted(rows.arrivals.log_time, (begin, end)).tolist())))
        if not found:
            return Arrivals(np.zeros(0))
        whole = joined(found)
        if (whole.log_time[1:] < whole.log_time[:-1]).any():
            whole = whole.some(np.argsort(whole.log_time, kind="stable"))
        return whole

    def samples(self, key: TrackKey, begin: float, end: float) -> Tuple[Array, Array]:
        """Return times, s, ascending, and values of a track in a window; see ``without_repeats``."""
        topic, field = key
        cells = self._cells.get(topic, {})
        low, high = np.floor(begin / _CELL_S), np.floor(end / _CELL_S)
        wanted = (range(int(low), int(high) + 1) if np.isfinite(low) and np.isfinite(high) and high - low < len(cells)
                  else [cell for cell in cells if low <= cell <= high])
        numbers = sorted({number for cell in wanted for number in cells.get(cell, ())})
        times: List[Array] = []
        values: List[Array] = []
        is_stamped = False
        for rows in self._rows(numbers, topic):
            is_stamped = rows.arrivals.stamp is not None
            time, value = samples_of(rows, field)
            if not len(time):
                continue
            part = slice(*np.searchsorted(time, (begin, end)).tolist())
            times.append(time[part])
            values.append(value[part])
        if len(times) == 1:
            return times[0], values[0]
        if not times:
            return np.zeros(0), np.zeros((0, 0))
        time_all, value_all = np.concatenate(times), np.concatenate(values)
        if is_stamped:
            return without_repeats(time_all, value_all)
        if (time_all[1:] < time_all[:-1]).any():
            order = np.argsort(time_all, kind="stable")
            time_all, value_all = time_all[order], value_all[order]
        return time_all, value_all

    def reader(self, key: TrackKey, names: Tuple[str, ...], frames: Tuple[str, ...]) -> Callable[[float, float], Track]:
        """Return a function that reads a window of a track."""
        def between(begin: float, end: float) -> Track:
            time, value = self.samples(key, begin, end)
            return Track(key[0], names, time, value if len(time) else value.reshape(0, len(names)), frames)
        return between


def samples_of(rows: Rows, field: str) -> Tuple[Array, Array]:
    """Return times, s, ascending, and values of one track of some rows; without rows that hold no sample."""
    if field not in rows.values:  # of a publisher, a frame or a length of arrays that this part does not have
        return np.zeros(0), np.zeros((0, 0))
    value, which = rows.values[field]
    time = rows.time
    if which is not None:
        time, value = time[which], value[which]
    return without_repeats(time, value) if rows.arrivals.stamp is not None else (time, value)


def without_repeats(time: Array, value: Array) -> Tuple[Array, Array]:
    """Return rows by time, without those that repeat both stamp and value of the one before: the same sample again."""
    if len(time) < 2:
        return time, value
    if (time[1:] < time[:-1]).any():
        order = np.argsort(time, kind="stable")
        time, value = time[order], value[order]
    repeated = time[1:] == time[:-1]
    if repeated.any():
        keep = np.concatenate([[True], ~((value[1:] == value[:-1]).all(axis=1) & repeated)])
        time, value = time[keep], value[keep]
    return time, value
