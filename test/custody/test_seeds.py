"""Scenarios of the custody simulation: so many seeds, those that once failed, and such shortened to a few events."""
import generator
import kept_scenarios
import pytest
import simulate
import world

CHUNKS, CHUNK = 30, 10


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_no_seed_breaks_a_rule(chunk):
    first = 1 + chunk * CHUNK
    outcomes = [simulate.run_seed(seed) for seed in range(first, first + CHUNK)]
    broken = ["seed %d: %s\n    %s" % (one.seed, one.broken, simulate.rerun_command(one.seed))
              for one in outcomes if one.broken]
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize("name", sorted(kept_scenarios.KEPT))
def test_what_once_failed_in_short(name):
    assert not world.World(kept_scenarios.KEPT[name]).run().broken


def test_seeds_differ():
    assert len({str(generator.generate(seed)) for seed in range(1, 6)}) == 5
