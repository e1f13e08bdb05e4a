"""The publishers of one topic of joints, told apart by the names of their joints, and arrays by their lengths."""
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from ...messages.batch import Array, are_rows_equal

PartRows = Tuple[Array, Optional[Array]]
"""Values of messages, shape (n, columns), and the rows that count (None: all)."""
_LEAST_SHARE = 0.1
"""Share of a topic's messages below which a publisher is an exception, such as a person's ``rostopic pub``."""
_OF = " (of "


class Publishers(NamedTuple):
    """The publishers of some messages.

    Attributes:
        labels: The names of the joints of each, or their number where they have none.
        number: Which of them each message is from, shape (n,).
    """

    labels: List[str]
    number: Array

    def rows(self, place: int) -> Optional[Array]:
        """Return the messages of one publisher; None where there is no other."""
        return None if len(self.labels) == 1 else np.flatnonzero(self.number == place)


def text_of(raw: bytes) -> str:
    """Return a text of a message; bytes that are no UTF-8 become escapes, so that other bytes are another text."""
    return bytes(raw).decode("utf-8", "backslashreplace")


def label_of(count: int, names: Optional[Array]) -> str:
    """Return the label of a publisher of so many positions."""
    if names is None or len(names) != count or not count:
        return "%d values" % count
    return " ".join(text_of(name) for name in names)


def publishers_of(position: Array, names: Optional[Array], usual: Optional[Tuple[str, int]]) -> Publishers:
    """Return the publishers of messages.

    Args:
        position: Their positions: shape (n, joints), or one array a message.
        names: Their names likewise; None where they were not read: all of the usual length are from one publisher.
        usual: Label and length of that one.
    """
    if position.dtype != object and (names is None or names.dtype != object and are_rows_equal(names)):
        label = label_of(position.shape[1], names[0] if names is not None and len(names) else None)
        return Publishers([usual[0] if names is None and usual is not None and usual[1] == position.shape[1]
                           else label], np.zeros(len(position), np.int64))
    found: Dict[object, int] = {}
    labels: List[str] = []
    number = np.zeros(len(position), np.int64)
    for i, row in enumerate(position):
        key = (len(row), None if names is None else tuple(names[i].tolist()))
        if key not in found:
            label = label_of(len(row), None if names is None else names[i])
            if names is None and usual is not None and usual[1] == len(row):
                label = usual[0]
            if label not in labels:
                labels.append(label)
            found[key] = labels.index(label)
        number[i] = found[key]
    return Publishers(labels, number)


def main_one(counts: Mapping[str, int], lengths: Mapping[str, int]) -> str:
    """Return the publisher, or the length, that a topic's own track is of: the longest that is no exception.

    Which of two has more messages may differ from run to run.
    """
    least = _LEAST_SHARE * sum(counts.values())
    return min(counts, key=lambda one: (counts[one] < least, -lengths[one], one))


def name_of(name: str, label: str) -> str:
    """Return the name of the track of one publisher, or of arrays of one length."""
    return "%s%s%s)" % (name, _OF, label)


def base_of(name: str) -> str:
    """Return the field that a track is of."""
    return name.partition(_OF)[0]


def spread(rows: Array, which: Array, count: int) -> Tuple[Array, Array]:
    """Return rows at their places among all messages, and these places."""
    value = np.full((count, rows.shape[1]), np.nan)
    value[which] = rows
    return value, which


def by_length(column: Array) -> Dict[int, PartRows]:
    """Return the values of a field by the lengths of its arrays; an array without values has none."""
    if column.dtype != object:
        rows = column.reshape(len(column), -1).astype(float)
        return {rows.shape[1]: (rows, None)} if rows.shape[1] else {}
    lengths = np.array([len(row) for row in column], np.int64)
    found: Dict[int, PartRows] = {}
    for length in np.unique(lengths[lengths > 0]).tolist():
        which = np.flatnonzero(lengths == length)
        found[length] = spread(np.stack([column[i] for i in which.tolist()]).astype(float), which, len(column))
    return found


def matrix(column: Array, width: Optional[int]) -> Tuple[Array, Optional[Array], Dict[int, int]]:
    """Return an array field as (n, width), the rows that have this length (None: all), and the number of rows by
    length.

    Where ``width`` is None, it is the length that most rows have.
    """
    if column.dtype != object and width in (None, column.shape[1]):
        return column.astype(float), None, {column.shape[1]: len(column)}
    lengths = np.array([len(row) for row in column], np.int64)
    counts = np.bincount(lengths)
    usual = int(counts.argmax()) if width is None else width
    value = np.full((len(column), usual), np.nan)
    rows = np.flatnonzero(lengths == usual)
    if len(rows):
        value[rows] = np.stack([column[i] for i in rows.tolist()])
    return value, rows, {length: count for length, count in enumerate(counts.tolist()) if count}
