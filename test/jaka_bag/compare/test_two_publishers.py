"""Two publishers of joints on one topic: the joints of each are compared."""
import pytest
from cell_logs import joints, smooth, write_cell

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.runs import windows
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances, parse_tolerances
from jaka_bag.compare.verdict import Aspect, Outcome
from jaka_bag.operations import columns

TOPIC = "/joint_states"
ARM, FINGER, OTHER = ("joint_1", "joint_2"), ("finger",), ("other_1", "other_2")


def move(now):
    return 0.5 * smooth(now, 2, 4) - 0.5 * smooth(now, 6, 8), 0.1


def wrong_move(now):
    return 0.5 * smooth(now, 2, 4) - 0.9 * smooth(now, 6, 8), 0.1 + 0.6 * smooth(now, 6.2, 7)


def grip(now):
    return (0.02 * smooth(now, 5, 5.5),)


def wrong_grip(now):
    return (0.02 * smooth(now, 3, 5.5) + 0.05,)


def both(arm, finger, names, rate=125.0, late=0.003, efforts=False):
    second = joints(10.0, finger, TOPIC, rate, names, late)
    said = joints(10.0, arm, TOPIC) + second
    for one in said if efforts else ():
        one.value["effort"] = [10.0 * position for position in one.value["position"]]
    return said


def compared(tmp_path, golden, candidate, tolerances=None):
    paths = [write_cell(tmp_path / name, some) for name, some in (("golden.mcap", golden), ("new.mcap", candidate))]
    return compare_logs(paths[0], paths[1], tolerances or Tolerances())


@pytest.mark.parametrize("rate", [125.0, 124.8, 50.0, 250.0])
@pytest.mark.parametrize("efforts", [False, True])
def test_an_arm_and_a_gripper_are_both_compared(rate, efforts, tmp_path):
    golden = both(move, grip, FINGER, rate, 0.003, efforts)
    again = compared(tmp_path, golden, both(move, grip, FINGER, rate, 0.001, efforts))
    assert again.same, again.differences
    for arm, finger, field in ((wrong_move, grip, "joint_1"), (move, wrong_grip, "position (of finger)")):
        found = compared(tmp_path, golden, both(arm, finger, FINGER, rate, 0.003, efforts)).differences
        assert field in {check.field for check in found}, found
        assert not [check for check in found if check.field.startswith("joint") and arm is move], found


@pytest.mark.parametrize("first_late, second_late", [(0.003, 0.006), (0.003, 0.001)])
def test_two_arms_of_as_many_joints_are_compared_each_by_its_names(first_late, second_late, tmp_path):
    def still(_now):
        return 1.0, -1.0
    golden = both(move, still, OTHER, 125.0, first_late, True)
    again = compared(tmp_path, golden, both(move, still, OTHER, 125.0, second_late, True))
    assert again.same, again.differences
    found = compared(tmp_path, golden, both(move, lambda now: (1.0 + 0.3 * smooth(now, 6, 8), -1.0), OTHER)).differences
    assert any("other_1" in check.field for check in found), found
    assert compared(tmp_path, golden, both(wrong_move, still, OTHER)).differences


def test_messages_of_two_publishers_whose_numbers_began_elsewhere_are_not_lost(tmp_path):
    golden, again = both(move, grip, FINGER, 50.0), both(move, grip, FINGER, 50.0)
    for one in again:
        one.value["header"]["seq"] += 5000 if one.value["name"] == list(FINGER) else 0
    comparison = compared(tmp_path, golden, again)
    assert comparison.same, comparison.differences
    assert [check.outcome for check in comparison.checks if check.aspect is Aspect.LOST] == [Outcome.NOT_COMPARED]


def test_whichever_publisher_comes_first_an_unchanged_run_is_the_same(tmp_path):
    golden = both(move, grip, FINGER, 125.0, 0.003, True)
    sooner = joints(10.0, grip, TOPIC, 125.0, FINGER) + joints(10.0, move, TOPIC, 125.0, ARM, 0.003)
    for one in sooner:
        one.value["effort"] = [10.0 * position for position in one.value["position"]]
    comparison = compared(tmp_path, golden, sooner)
    assert comparison.same, comparison.differences


def test_an_arm_that_comes_after_the_gripper_has_the_same_tracks(tmp_path, monkeypatch):
    monkeypatch.setattr(columns, "_GROUP_BYTES", 1000)
    golden = both(move, grip, FINGER, 125.0, 0.003, True)
    later = [one for one in golden if one.time >= 1.0 or one.value["name"] == list(FINGER)]
    sooner = [one for one in golden if one.time >= 1.0 or one.value["name"] != list(FINGER)]
    paths = [write_cell(tmp_path / name, some, 8000) for name, some in (("a.mcap", later), ("b.mcap", sooner))]
    runs = [load_run(path) for path in paths]
    assert runs[0].joints[TOPIC].names == runs[1].joints[TOPIC].names == ARM
    assert set(runs[0].fields[TOPIC]) == set(runs[1].fields[TOPIC]) >= {"effort", "position (of finger)"}
    assert [run.joints[TOPIC].facts.count for run in runs] == [1125, 1250]


def test_logs_of_two_publishers_that_are_too_long_to_be_kept_are_compared_alike(tmp_path, monkeypatch):
    monkeypatch.setattr(windows, "_WINDOW_ROWS", 1000)
    monkeypatch.setattr(windows, "_CELL_S", 3.0)
    monkeypatch.setattr(windows, "_KEPT_BYTES", 20000)
    monkeypatch.setattr(windows._Store, "put", lambda store, number, rows: None)
    monkeypatch.setattr(columns, "_GROUP_BYTES", 1000)
    golden = both(move, grip, FINGER)
    said = {"golden": golden, "same": golden, "other": both(move, wrong_grip, FINGER)}
    paths = {name: write_cell(tmp_path / (name + ".mcap"), some, 60000) for name, some in said.items()}
    again = compare_logs(paths["golden"], paths["same"])
    assert again.same, again.differences
    found = compare_logs(paths["golden"], paths["other"]).differences
    assert {check.field for check in found} == {"position (of finger)"}, found


@pytest.mark.parametrize("finger, is_same", [(grip, True), (wrong_grip, False)])
def test_a_rule_for_a_field_is_about_both(finger, is_same, tmp_path):
    rule = parse_tolerances("fields: {/joint_states: {effort: {absolute: 0.05}}}")
    golden = both(move, grip, FINGER, 125.0, 0.003, True)
    found = compared(tmp_path, golden, both(move, finger, FINGER, 125.0, 0.003, True), rule).differences
    assert any(check.field.startswith("effort") for check in found) is not is_same, found


def test_a_publisher_that_only_one_log_has_is_found(tmp_path):
    golden = both(move, grip, FINGER)
    for one, other in ((golden, joints(10.0, move, TOPIC)), (joints(10.0, move, TOPIC), golden)):
        assert any("finger" in check.field for check in compared(tmp_path, one, other).differences)
