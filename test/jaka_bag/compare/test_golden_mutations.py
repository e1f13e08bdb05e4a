"""Mutations drawn from the golden logs: each is noticed, or allowed by a tolerance that is named."""
import pytest
from golden_mutations import KINDS, NAMES, fate_of

SEED = 7
ROUNDS = 3
"""Mutations of each kind in each golden log; ``test/soak/soak_golden_mutations.py`` makes thousands."""


@pytest.mark.parametrize("name", NAMES)
def test_each_mutation_is_noticed_or_named(name, tmp_path):
    numbers = range(NAMES.index(name), ROUNDS * len(KINDS) * len(NAMES), len(NAMES))
    fates = [fate_of(SEED, number, tmp_path / "mutated.mcap") for number in numbers]
    assert {fate.name for fate in fates} == {name}
    assert not [fate for fate in fates if fate.verdict == "NEITHER"]
    assert sum(fate.verdict == "noticed" for fate in fates) > len(fates) // 2
