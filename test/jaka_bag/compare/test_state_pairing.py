"""The pairing of states: each run is paired, joined with its neighbour or alone, and excused at most once."""
import pytest

from jaka_bag.compare.matching.state_pairing import StateRun, pair_states


def runs(text, lag=0.0):
    """Return runs of 1 s, one a letter; lower case: of 50 ms."""
    result, now = [], lag
    for letter in text:
        length = 1.0 if letter.isupper() else 0.05
        result.append(StateRun(ord(letter.upper()), now, now + length))
        now += length
    return result


def paired(golden, candidate, lag=0.0):
    ours, theirs = runs(golden), runs(candidate, lag)
    found = pair_states(ours, theirs, lag, [run.length < 0.1 for run in ours], [run.length < 0.1 for run in theirs])
    return ("".join(golden[i] for i in found.missing), "".join(candidate[j] for j in found.new))


@pytest.mark.parametrize("golden, candidate, missing, new", [
    ("", "", "", ""), ("A", "A", "", ""), ("ABA", "ABA", "", ""),
    ("AbA", "A", "", ""), ("A", "AbA", "", ""), ("AbAbAbA", "A", "", ""), ("ABcB", "AcAB", "", ""),
    ("ABA", "A", "B", ""), ("A", "ABA", "", "B"), ("A", "B", "A", "B"), ("AbAbA", "CbCbC", "AAA", "CCC"),
    ("AbA", "AbC", "", "C"), ("AbAbA", "ABA", "", ""), ("AbABA", "AB", "A", ""), ("AB" * 60, "AB" * 59, "A", ""),
])
def test_what_is_missing_and_what_is_new(golden, candidate, missing, new):
    found = paired(golden, candidate, 3.0)
    assert sorted(found[0]) == sorted(missing) and sorted(found[1]) == sorted(new)


def test_of_equal_choices_the_nearest_in_time_are_paired():
    golden = [StateRun(1, 0.0, 1.0), StateRun(2, 1.0, 1.05), StateRun(1, 1.05, 2.0), StateRun(2, 2.0, 2.05)]
    candidate = [StateRun(1, 0.0, 2.0), StateRun(2, 2.0, 2.05)]
    found = pair_states(golden, candidate, 0.0, [False, True, False, True], [False, True])
    assert found.pairs == [(0, 0), (3, 1)] and not found.missing and not found.new


def test_a_sequence_that_is_much_shorter_is_still_paired():
    found = pair_states(runs("Ab" * 100 + "A"), runs("A"), 0.0, [False, True] * 100 + [False], [False])
    assert not found.missing and not found.new
