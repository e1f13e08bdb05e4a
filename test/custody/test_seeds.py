"""Scenarios of the custody simulation: seeds that never change, those of this commit, and some that once failed."""
import generator
import kept_scenarios
import pytest
import simulate
import world

CHUNK = 10
DRAWN = simulate.drawn_seeds()


def no_seed_breaks_a_rule(seeds):
    outcomes = [simulate.run_seed(seed) for seed in seeds]
    assert not any(one.broken for one in outcomes), "\n".join([simulate.told(one) for one in outcomes if one.broken])


@pytest.mark.parametrize("first", simulate.ALWAYS[::CHUNK])
def test_no_seed_breaks_a_rule(first):
    no_seed_breaks_a_rule(range(first, first + CHUNK))


@pytest.mark.parametrize("place", range(0, len(DRAWN), CHUNK))
def test_no_seed_of_this_commit_breaks_a_rule(place):
    # They run again with ``tools/dev simulate --seed S``, also under another commit.
    print("seeds from %d on" % DRAWN[place])
    no_seed_breaks_a_rule(DRAWN[place:place + CHUNK])


@pytest.mark.parametrize("name", sorted(kept_scenarios.KEPT))
def test_what_once_failed_in_short(name):
    assert not world.World(kept_scenarios.KEPT[name]).run().broken


def test_seeds_differ():
    assert len({str(generator.generate(seed)) for seed in range(1, 6)}) == 5
    assert not set(simulate.ALWAYS) & set(DRAWN)


def test_a_driver_is_judged_ready_only_after_a_reply_that_is_held_back():
    assert not simulate.run_seed(2018170).broken  # its power_on is answered after 10 s, on a slow feed
