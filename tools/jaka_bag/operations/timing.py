"""How regularly messages came: rate, jitter, gaps, missing ones; from the times in the index alone.

``BagFormatError`` is raised where a chunk or its index is damaged.
"""
from typing import Any, Dict, List, Tuple

import numpy as np

from ..containers.contract import LogReader
from ..containers.registry import open_log
from ..errors import DefinitionError
from ..messages.batch import Array
from ..messages.selection import Selection
from ..paths import PathLike
from ..pipeline import in_order
from ..units import NS_PER_S
from .columns import ColumnReader

_GAP = 1.5
"""An interval above this many median intervals is a gap."""
_REGULAR = 0.5
"""A topic is periodic where the middle 80 % of its intervals spread over less than this part of the median."""


def log_times(reader: LogReader) -> Dict[int, Array]:
    """Log times of each connection, by number, ns, ascending."""
    parts: Dict[int, List[Array]] = {}
    for connection, log_time in in_order(reader.load_times, reader.chunks):
        order = np.argsort(connection, kind="stable")
        numbers, begins = np.unique(connection[order], return_index=True)
        for number, times in zip(numbers.tolist(), np.split(log_time[order], begins[1:])):
            parts.setdefault(number, []).append(times)
    return {number: np.sort(np.concatenate(times), kind="stable") for number, times in parts.items()}


def timing_of(times: Array) -> Dict[str, Any]:
    """The regularity of ascending log times, ns; intervals in s.

    ``missing`` is how many more messages the gaps would hold; None where the messages come irregularly.
    """
    if len(times) < 2:
        return {"messages": len(times), "text": "too few messages for a rate"}
    interval = np.diff(times) / NS_PER_S
    low, median, high, p99 = np.percentile(interval, [10, 50, 90, 99])
    worst = int(interval.argmax())
    span = float(times[-1] - times[0]) / NS_PER_S
    rate = (len(times) - 1) / span if span > 0 else None
    jitter_p50, jitter_p99 = np.percentile(np.abs(interval - median), [50, 99])
    is_periodic = median > 0 and high - low < _REGULAR * median
    gaps = interval[interval > _GAP * median] if is_periodic else interval[:0]
    missing = int(np.round(gaps / median - 1).sum()) if is_periodic else 0
    result = {
        "messages": len(times), "rate": rate, "median_interval": float(median), "p99_interval": float(p99),
        "jitter_p50": float(jitter_p50), "jitter_p99": float(jitter_p99),
        "largest_gap": float(interval[worst]), "largest_gap_at_ns": int(times[worst]),
        "gaps": len(gaps) if is_periodic else None, "missing": missing if is_periodic else None}
    text = "%s, interval %.3f ms, jitter p50 %.3f p99 %.3f ms, largest gap %.3f ms" % (
        "no rate" if rate is None else "%.2f Hz" % rate, median * 1e3, jitter_p50 * 1e3, jitter_p99 * 1e3,
        interval[worst] * 1e3)
    if is_periodic:
        text += ", %d gaps (~%d missing)" % (len(gaps), missing) if len(gaps) else ", no gaps"
    return dict(result, text=text)


def add_timing(path: PathLike, document: Dict[str, Any]) -> None:
    """Put ``freq`` into each topic of an info document."""
    with open_log(path) as reader:
        by_connection = log_times(reader)
        by_topic: Dict[str, List[Array]] = {}
        for number, times in by_connection.items():
            by_topic.setdefault(reader.connections[number].topic, []).append(times)
    for topic in document["topics"]:
        streams = by_topic.get(topic["topic"], [np.zeros(0, np.int64)])
        topic["freq"] = timing_of(streams[0] if len(streams) == 1 else np.sort(np.concatenate(streams)))


def _sequence_gaps(reader: LogReader, topic: str) -> Tuple[int, int]:
    """Numbers missing in ``header.seq`` and places where they are missing, over all publishers of a topic."""
    missing = places = 0
    for number, connection in enumerate(reader.connections):
        if connection.topic != topic or not reader.index.counts[number]:
            continue
        columns = ColumnReader(reader, Selection(topics=(topic,)), only_connection=number).read()
        sequence = columns[topic].fields["header.seq"].astype(np.int64)
        steps = np.diff(sequence)
        skipped = steps[steps > 1] - 1  # a smaller number is a publisher's new start
        missing += int(skipped.sum())
        places += len(skipped)
    return missing, places


def add_sequence_gaps(path: PathLike, document: Dict[str, Any]) -> None:
    """Put ``seq`` into each topic of an info document whose type begins with a header."""
    with open_log(path) as reader:
        for topic in document["topics"]:
            try:
                missing, places = _sequence_gaps(reader, topic["topic"])
            except (KeyError, DefinitionError):
                continue
            topic["seq"] = {"missing": missing, "gaps": places, "text": "header.seq: %s" % (
                "%d missing at %d places" % (missing, places) if missing else "none missing")}
