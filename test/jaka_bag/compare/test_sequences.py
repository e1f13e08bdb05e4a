"""The pairing of like entries: the fewest left alone, and of several the nearest in time."""
import pytest

from jaka_bag.compare.matching import sequences
from jaka_bag.compare.matching.sequences import Entry, pair


def entries(text, start=0.0, step=1.0):
    return [Entry(key, start + step * i) for i, key in enumerate(text)]


def alone(pairs):
    return ([p.golden for p in pairs if p.candidate is None], [p.candidate for p in pairs if p.golden is None])


@pytest.mark.parametrize("golden, candidate, expected", [
    ("abc", "abc", ([], [])), ("abc", "ac", ([1], [])), ("ac", "abc", ([], [1])), ("abc", "abd", ([2], [2])),
    ("", "a", ([], [0])), ("a", "", ([0], [])), ("", "", ([], [])), ("abcabc", "abcbc", ([3], [])),
])
def test_what_is_missing_and_what_is_new(golden, candidate, expected):
    assert alone(pair(entries(golden), entries(candidate), 0.0)) == expected


def test_of_like_entries_the_one_that_time_misses_is_left_alone():
    golden = entries("aaaa")
    candidate = [Entry("a", 0.1), Entry("a", 1.1), Entry("a", 3.1)]
    assert alone(pair(golden, candidate, 0.1)) == ([2], [])


def test_long_sequences_are_paired_by_their_ends(monkeypatch):
    monkeypatch.setattr(sequences, "_EXACT_LIMIT", 100)
    golden = entries("abcdefghij" * 20)
    candidate = golden[:57] + golden[58:]
    assert alone(pair(golden, candidate, 0.0)) == ([57], [])
    candidate = golden[:30] + entries("xy" * 60) + golden[40:]
    assert len(alone(pair(golden, candidate, 0.0))[0]) == 10
