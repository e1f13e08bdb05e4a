"""The pairing of like entries of two sequences, in order, by key and then by nearness in time."""
from typing import Hashable, List, NamedTuple, Optional, Sequence

import numpy as np

_EXACT_LIMIT = 400000
"""Above this product of lengths the cheaper pairing is used; either finds every difference."""
_FAR_S = 10.0
"""Delay, s, from which on a pair costs no more: being later then says nothing."""
_REPLACE_COST = 2.0
"""Cost of two unlike entries, against 1 for one that stands alone: twice, so that they never pair."""


class Entry(NamedTuple):
    """One entry: equal keys may be paired; ``time`` in s."""

    key: Hashable
    time: float


class Pair(NamedTuple):
    """Positions in both sequences; None where the entry stands alone."""

    golden: Optional[int]
    candidate: Optional[int]


def pair(golden: Sequence[Entry], candidate: Sequence[Entry], lag: float) -> List[Pair]:
    """Pair entries with equal keys, in order: as few as possible stay alone; of equal choices the nearest in time.

    Args:
        golden: Entries in the order of time.
        candidate: Entries likewise.
        lag: Delay of the candidate's times, s.
    """
    if [entry.key for entry in golden] == [entry.key for entry in candidate]:
        return [Pair(i, i) for i in range(len(golden))]
    if len(golden) * len(candidate) > _EXACT_LIMIT:
        return _pair_ends(golden, candidate, lag)
    return _pair_exactly(golden, candidate, lag, 0)


def _pair_ends(golden: Sequence[Entry], candidate: Sequence[Entry], lag: float) -> List[Pair]:
    """Pair equal beginnings and ends; pair the entries between exactly where they are few enough, else not at all."""
    shorter = min(len(golden), len(candidate))
    head = 0
    while head < shorter and golden[head].key == candidate[head].key:
        head += 1
    tail = 0
    while tail < shorter - head and golden[-1 - tail].key == candidate[-1 - tail].key:
        tail += 1
    middle_g, middle_c = golden[head:len(golden) - tail], candidate[head:len(candidate) - tail]
    result = [Pair(i, i) for i in range(head)]
    if len(middle_g) * len(middle_c) <= _EXACT_LIMIT:
        result += _pair_exactly(middle_g, middle_c, lag, head)
    else:
        result += [Pair(head + i, None) for i in range(len(middle_g))]
        result += [Pair(None, head + i) for i in range(len(middle_c))]
    return result + [Pair(len(golden) - i, len(candidate) - i) for i in range(tail, 0, -1)]


def _pair_exactly(golden: Sequence[Entry], candidate: Sequence[Entry], lag: float, offset: int) -> List[Pair]:
    rows, columns = len(golden), len(candidate)
    names = {key: number for number, key in enumerate({entry.key for entry in list(golden) + list(candidate)})}
    key_g = np.array([names[entry.key] for entry in golden], int)
    key_c = np.array([names[entry.key] for entry in candidate], int)
    late = np.abs(np.array([e.time for e in candidate])[None, :] - np.array([e.time for e in golden])[:, None] - lag)
    match = np.where(key_g[:, None] == key_c[None, :], 0.5 * np.minimum(late / _FAR_S, 1.0), _REPLACE_COST * 2)
    match_rows = match.tolist()
    cost = [[0.0] * (columns + 1) for _ in range(rows + 1)]
    for j in range(columns):
        cost[0][j + 1] = cost[0][j] + 1.0
    for i in range(rows):
        above, here, matches = cost[i], cost[i + 1], match_rows[i]
        here[0] = left = above[0] + 1.0
        for j in range(columns):
            best = above[j] + matches[j]
            if above[j + 1] + 1.0 < best:
                best = above[j + 1] + 1.0
            if left + 1.0 < best:
                best = left + 1.0
            here[j + 1] = left = best
    result: List[Pair] = []
    i, j = rows, columns
    while i or j:
        if i and j and key_g[i - 1] == key_c[j - 1] and cost[i][j] == cost[i - 1][j - 1] + match_rows[i - 1][j - 1]:
            i, j = i - 1, j - 1
            result.append(Pair(offset + i, offset + j))
        elif i and cost[i][j] == cost[i - 1][j] + 1.0:
            i -= 1
            result.append(Pair(offset + i, None))
        else:
            j -= 1
            result.append(Pair(None, offset + j))
    return result[::-1]
