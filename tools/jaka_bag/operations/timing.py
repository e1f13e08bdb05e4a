"""The regularity of messages: rate, jitter, gaps, missing ones; from the times of the records.

``BagFormatError`` is raised where a chunk is damaged.
"""
from typing import Any, Dict, Iterator, List, Tuple

import numpy as np

from ..containers.index import ChunkRef
from ..containers.interface import LogReader
from ..containers.registry import open_log
from ..errors import DefinitionError
from ..messages.batch import Array, distinct
from ..messages.selection import Selection
from ..paths import PathLike
from ..pipeline import WORKERS, in_order
from ..units import NS_PER_S
from .columns import ColumnReader, chunk_groups
from .quantiles import Quantiles

_GAP = 1.5
"""An interval above this many median intervals is a gap."""
_REGULAR = 0.5
"""A topic is periodic where the middle 80 % of its intervals spread over less than this part of the median."""


def log_times(reader: LogReader) -> Iterator[Tuple[str, Array]]:
    """Log times of each topic, ns, ascending, piece by piece."""
    groups = chunk_groups(reader.chunks)
    ends = [max(chunk.end_time for chunk in group) for group in groups]
    if any(end > group[0].start_time for end, group in zip(ends, groups[1:])):
        groups = [reader.chunks]  # chunks overlap in time: all at once
    topics = [connection.topic for connection in reader.connections]

    def times_of(chunk: ChunkRef) -> Tuple[Array, Array]:
        batch = reader.load(chunk)
        return batch.connection, batch.log_time

    for group in groups:
        parts: Dict[str, List[Array]] = {}
        for connection, log_time in in_order(times_of, group, WORKERS if len(group) > 1 else 1):
            for number in distinct(connection).tolist():
                parts.setdefault(topics[number], []).append(log_time[connection == number])
        for topic, times in parts.items():
            yield topic, np.sort(np.concatenate(times), kind="stable")


class Timing:
    """The regularity of one topic's messages."""

    def __init__(self) -> None:
        self._count = 0
        self._first = self._last = 0
        self._interval = Quantiles()
        self._worst, self._worst_at = -1.0, 0

    def add(self, times: Array) -> None:
        """Add further log times, ns, ascending, at least one."""
        if self._count:
            times = np.append(np.int64(self._last), times)
        else:
            self._first = int(times[0])
            self._count = 1
        interval = np.diff(times) / NS_PER_S
        self._count += len(interval)
        self._interval.add(interval)
        self._last = int(times[-1])
        if len(interval) and interval.max() > self._worst:
            worst = int(interval.argmax())
            self._worst, self._worst_at = float(interval[worst]), int(times[worst])

    def document(self) -> Dict[str, Any]:
        """Return the regularity as JSON data; intervals in s.

        ``missing`` is the number of further messages that the gaps would hold; None where the messages come
        irregularly.
        """
        if self._count < 2:
            return {"messages": self._count, "text": "too few messages for a rate"}
        low, median, high, p99 = self._interval.percentiles([10, 50, 90, 99])
        span = float(self._last - self._first) / NS_PER_S
        rate = (self._count - 1) / span if span > 0 else None
        jitter_p50, jitter_p99 = self._interval.distances(median).percentiles([50, 99])
        is_periodic = median > 0 and high - low < _REGULAR * median
        gaps, counts = self._interval.above(_GAP * median) if is_periodic else (np.zeros(0), np.zeros(0))
        gap_count = int(counts.sum())
        missing = int((np.round(gaps / median - 1) * counts).sum()) if is_periodic else 0
        result = {
            "messages": self._count, "rate": rate, "median_interval": median, "p99_interval": p99,
            "jitter_p50": jitter_p50, "jitter_p99": jitter_p99,
            "largest_gap": self._worst, "largest_gap_at_ns": self._worst_at,
            "gaps": gap_count if is_periodic else None, "missing": missing if is_periodic else None}
        text = "%s, interval %.3f ms, jitter p50 %.3f p99 %.3f ms, largest gap %.3f ms" % (
            "no rate" if rate is None else "%.2f Hz" % rate, median * 1e3, jitter_p50 * 1e3, jitter_p99 * 1e3,
            self._worst * 1e3)
        if is_periodic:
            text += ", %d gaps (~%d missing)" % (gap_count, missing) if gap_count else ", no gaps"
        return dict(result, text=text)


def add_timing(path: PathLike, document: Dict[str, Any]) -> None:
    """Put ``freq`` into each topic of an info document that the log has as it is read here; add the reader's notes."""
    by_topic: Dict[str, Timing] = {}
    with open_log(path) as reader:
        known = {connection.topic for connection in reader.connections}
        for name, times in log_times(reader):
            by_topic.setdefault(name, Timing()).add(times)
        document["notes"] += [note for note in reader.index.notes if note not in document["notes"]]
    for topic in document["topics"]:
        if topic["topic"] in known:
            topic["freq"] = by_topic.get(topic["topic"], Timing()).document()


def sequence_gaps(reader: LogReader, topic: str) -> Tuple[int, int]:
    """Count numbers missing in ``header.seq`` and places where they are missing, over all publishers of a topic.

    Raises:
        KeyError: The topic's messages have no such field.
        DefinitionError: The messages are not understood.
    """
    missing = places = 0
    for number, connection in enumerate(reader.connections):
        if connection.topic != topic or not reader.index.counts[number]:
            continue
        columns = ColumnReader(reader, Selection(topics=(topic,)), only_connection=number)
        last = np.zeros(0, np.int64)
        for _, some in columns.pieces({topic: ("header.seq",)}):
            sequence = np.concatenate([last, some.fields["header.seq"].astype(np.int64)])
            steps = np.diff(sequence)
            skipped = steps[steps > 1] - 1  # a smaller number is a publisher's new start
            missing += int(skipped.sum())
            places += len(skipped)
            last = sequence[-1:]
    return missing, places


def add_sequence_gaps(path: PathLike, document: Dict[str, Any]) -> None:
    """Put ``seq`` into each topic of an info document whose type begins with a header."""
    with open_log(path) as reader:
        for topic in document["topics"]:
            try:
                missing, places = sequence_gaps(reader, topic["topic"])
            except (KeyError, DefinitionError):
                continue
            topic["seq"] = {"missing": missing, "gaps": places, "text": "header.seq: %s" % (
                "%d missing at %d places" % (missing, places) if missing else "none missing")}
