"""Seeded defects, each found by the right check; an unchanged run never differs."""
import pytest
from seeded_defects import DEFECTS, defective
from synthetic_session import Conditions, simulate, write_log

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.verdict import Aspect

FOLLOWS = {  # what else a defect shows in, rightly
    "two joints swapped": {Aspect.JOINTS, Aspect.TIMING},
    "old samples stamped as new": {Aspect.JOINTS, Aspect.POSITION, Aspect.ORIENTATION, Aspect.TIMING, Aspect.PACE,
                                   Aspect.LATENESS},
    "RPY for rotation vector": {Aspect.LATENESS},
    "state topic in bursts of 0.1 s": {Aspect.LATENESS},
    "stale stamps": {Aspect.STAMPS, Aspect.STATES, Aspect.CALLS},
    "jog not stopped at 3 s": {Aspect.STATES, Aspect.JOINTS, Aspect.POSITION, Aspect.ORIENTATION, Aspect.TIMING,
                               Aspect.CALLS},
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_is_found_by_the_right_check_and_blamed_on_no_other(name, golden, program, tmp_path):
    defect = DEFECTS[name]
    candidate = write_log(tmp_path / "candidate.mcap", defective(program, defect))
    found = compare_logs(golden, candidate).differences
    assert any(check.aspect is defect.found_by and defect.field in check.field for check in found), found
    assert {check.aspect for check in found} <= FOLLOWS.get(name, set()) | {defect.found_by}, found


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("conditions", [
    Conditions(start_s=2.2, call_late_s=0.03), Conditions(start_s=0.3, call_late_s=0.15, stamp_late_s=0.02),
    Conditions(start_s=5.0, call_late_s=0.05, stamp_late_s=0.03, noise_rad=8e-5)])
def test_an_unchanged_run_is_the_same_however_late_it_is(seed, conditions, golden, program, tmp_path):
    candidate = write_log(tmp_path / "candidate.bag", simulate(program, conditions._replace(seed=seed + 100)))
    comparison = compare_logs(golden, candidate)
    assert comparison.same, comparison.differences
