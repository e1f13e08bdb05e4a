"""The conditions of a log that must hold before its calls are made again; each with a difference planted."""
import numpy as np
import pytest
from synthetic_session import moves, simulate, write_log

from jaka_bag.compare.runs.loading import load_run
from jaka_regression.preconditions import (
    TOLD,
    ToolPlace,
    clock_trouble,
    conditions_in,
    differences,
    pose_difference,
    untold,
)

TOLD_NOW = {"model": "zu7", "interface": "documented", "tool": "1", "user-frame": "0", "override": "1.0",
            "payload": "1.25 kg at 0, -0.01, 0.05 m", "collision-level": "4"}
JOINTS = (0.0, 1.57, -1.57, 1.57, 1.57, 0.0)
POSE = (0.4, 0.1, 0.3, 3.0, 0.5, 0.2)
PLACE = ToolPlace(JOINTS, POSE, ("base_link",))


def statuses(node, **changes):
    told = {**TOLD_NOW, **changes}
    values = {}
    for key, (status, entry) in TOLD.items():
        values.setdefault("%s: %s" % (node, status), {})[entry] = told[key.replace("-", "_")
                                                                       if key.replace("-", "_") in told else key]
    return values.items()


def test_a_drivers_own_statuses_tell_its_conditions():
    both = [*statuses("left/jaka_driver", model="zu12"), *statuses("jaka_driver")]
    assert conditions_in(both, "/jaka_driver") == TOLD_NOW
    assert conditions_in(both, "/left/jaka_driver")["model"] == "zu12"
    assert conditions_in(both, "/right/jaka_driver") == {}
    unknown = conditions_in(statuses("jaka_driver", override="None", payload="unknown"), "/jaka_driver")
    assert "override" not in unknown and "payload" not in unknown


@pytest.mark.parametrize("key, other", [("model", "zu12"), ("interface", "vendor"), ("tool", "0"),
                                        ("user-frame", "2"), ("override", "0.5"), ("collision-level", "3"),
                                        ("payload", "1.3 kg at 0, -0.01, 0.05 m"),
                                        ("payload", "1.25 kg at 0, 0.01, 0.05 m")])
def test_each_condition_that_is_another_one_now_is_a_difference(key, other):
    found = differences(TOLD_NOW, dict(TOLD_NOW, **{key: other}))
    assert [difference.key for difference in found] == [key]
    assert TOLD_NOW[key] in found[0].text and other in found[0].text


def test_what_only_one_of_them_tells_is_named_as_not_compared():
    assert differences(TOLD_NOW, {"model": "zu7"}) == []
    assert untold(TOLD_NOW, {"model": "zu7", "override": "1"}) == [
        "interface", "tool", "user frame", "payload", "collision level"]
    assert differences(TOLD_NOW, dict(TOLD_NOW, override="1", payload="1.25005 kg at 0, -0.01, 0.05 m")) == []


@pytest.mark.parametrize("pose, frames, key", [
    (POSE, ("base_link",), ""),
    ((0.4, 0.1, 0.3015, 3.0, 0.5, 0.2), ("base_link",), ""),
    ((0.4, 0.1, 0.305, 3.0, 0.5, 0.2), ("base_link",), "pose"),
    ((0.4, 0.1, 0.42, 3.0, 0.5, 0.2), ("base_link",), "pose"),
    ((0.4, 0.1, 0.3, 3.02, 0.5, 0.2), ("base_link",), "pose"),
    ((400.0, 100.0, 300.0, 170.0, 30.0, 12.0), ("base_link",), "interface"),
    (POSE, ("user_frame_2",), "pose"),
], ids=["the same", "noise", "5 mm", "a gripper", "turned", "mm", "a user frame"])
def test_the_same_joints_must_put_the_tool_at_the_same_pose(pose, frames, key):
    found = pose_difference(PLACE, ToolPlace(JOINTS, pose, frames))
    assert [difference.key for difference in found] == ([key] if key else [])


def test_joints_that_differ_a_little_explain_a_tool_that_does():
    moved = ToolPlace((0.005, *JOINTS[1:]), (0.4, 0.102, 0.3, 3.0, 0.5, 0.21), ("base_link",))
    assert pose_difference(PLACE, moved) == []


def test_poses_in_mm_and_degrees_are_compared_as_such():
    before = ToolPlace(JOINTS, (400.0, 100.0, 300.0, 179.9, 0.0, 90.0), ("base_link",))
    assert pose_difference(before, before._replace(pose=(400.5, 100.0, 300.0, -179.95, 0.0, 90.0))) == []
    assert pose_difference(before, before._replace(pose=(400.0, 100.0, 300.0, 179.9, 0.0, 91.0)))[0].key == "pose"


def shifted(folder, seconds, since=2.0, topics=None):
    """Return a log whose clock was set by so many s after 2 s."""
    session = simulate(moves(3))
    after = session.time > since
    for name in session.log_time if topics is None else topics:
        session.log_time[name] = session.log_time[name] + seconds * after
    session.stamp = session.stamp + seconds * after
    session.calls = [call._replace(start=call.start + seconds * (call.start > since)) for call in session.calls]
    return load_run(write_log(folder / "log.mcap", session))


@pytest.mark.parametrize("seconds, words", [(-1.0, "goes back"), (-1.9, "goes back"), (-100.0, "goes back"),
                                            (3600.0, "is silent for 3600"), (20.0, "is silent for 20")])
def test_a_clock_that_was_set_is_found(tmp_path, seconds, words):
    found = clock_trouble(shifted(tmp_path, seconds))
    assert [difference.key for difference in found] == ["clock"] and words in found[0].text


@pytest.mark.parametrize("seconds", [0.0, 0.5])
def test_a_short_silence_is_no_clock_that_was_set(tmp_path, seconds):
    assert clock_trouble(shifted(tmp_path, seconds)) == []


@pytest.mark.parametrize("first", [1, 500])
def test_a_driver_that_was_started_again_is_no_clock_that_was_set(tmp_path, first):
    sessions = [simulate(moves(2)), simulate(moves(2))]
    sessions[0].first_sequence = first
    later = float(sessions[0].time[-1]) + 1.0
    sessions[1].stamp = sessions[1].stamp + later
    sessions[1].log_time = {name: times + later for name, times in sessions[1].log_time.items()}
    sessions[1].calls = [call._replace(start=call.start + later) for call in sessions[1].calls]
    run = load_run(write_log(tmp_path / "log.mcap", *sessions))
    joints = run.streams["/jaka_driver/joint_position"]
    numbers = np.concatenate([joints.between(*window).sequence for window in run.windows])
    assert (np.diff(numbers) < 0).any() and clock_trouble(run) == []
