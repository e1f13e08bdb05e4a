"""The command jaka_bag replay-motion on the running node: a hand's motion is repeated; start pose, cancel, refusals.

The arm is led, recorded and replayed by the commands of docs/state_logs.md, as they stand there.
"""
import os
import signal
import subprocess

import pytest
import yaml
from command_places import command_of
from driver_bench import HOME
from import_graph import ROOT
from page_commands import Shell, blocks, until
from waiting import eventually

from jaka_bag.live.graph import RemoteNode
from jaka_regression.driver_client import DriverNotThere
from jaka_regression.trajectory_client import ACTION_TYPE, action_of, made_action_type
from jaka_ros_driver.ros.other_messages import MD5

PAGE = ROOT / "docs" / "state_logs.md"
PUSHES = [(1, 40.0, 0.7), (4, -30.0, 0.6)]
"""Joint, deg/s, s: one after the other, with a moment of rest between them."""
PATIENCE_S = 200


def program(*words):
    return subprocess.Popen([*command_of("jaka_bag"), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True)


def replay(*words):
    """Replay with ruckig, which is imported many times as fast as toppra."""
    return program("replay-motion", *map(str, words), "--solver", "ruckig")


def ended(process):
    said, errors = process.communicate(timeout=PATIENCE_S)
    return process.returncode, said, errors


def joints_of(arm):
    return list(arm.listen("joint_position", 1)[0].position)


def stand_at(arm, joints):
    assert arm.call("joint_move", pose=joints, mvvelo=1.5, mvacc=6.0).ret == 1


def rests(arm):
    state = arm.simulator.state()
    return not state["is_moving"] and not state["is_servo_active"]


@pytest.fixture(scope="module")
def shell(ros_master, tmp_path_factory):
    folder = tmp_path_factory.mktemp("guided")
    (folder / "build").symlink_to(ROOT / "build")
    one = Shell(folder, dict(os.environ), ". build/devel/setup.bash")
    yield one
    one.close()


@pytest.fixture(scope="module")
def guided(arm, shell):
    """Return a log of an arm that was led by hand, where it stood at the end, and the page's commands that replay
    it."""
    found = {block.note: block.text.strip() for block in blocks(PAGE, "Replay a motion") if block.language == "sh"}
    arm.go_home()
    shell.start("recorder", found["in the background: recorder"])
    until(lambda: (shell.folder / "guided.mcap.active").exists(), lambda: shell.said_by("recorder"))
    arm.listen("joint_position", 60)
    assert shell.run(found[""])[1].count("success: True") == 1
    for joint, speed, seconds in PUSHES:
        assert arm.simulator.operate("push", joint=joint, velocity=speed, duration=seconds)["pushed"]
        assert eventually(arm.simulator.is_moving) and eventually(lambda: not arm.simulator.is_moving())
    assert shell.run(found["led by hand"])[1].count("success: True") == 1
    shell.end("recorder")
    return shell.folder / "guided.mcap", joints_of(arm), found["after the end of: recorder"].splitlines()


def test_what_a_hand_did_is_done_again_and_compares_the_same(arm, shell, guided, tmp_path):
    log, end, (look, again) = guided
    candidate, tolerances = tmp_path / "again.mcap", tmp_path / "tolerances.yaml"
    code, said = shell.run(look)
    assert code == 0 and joints_of(arm) == pytest.approx(end, abs=1e-3), said
    assert (shell.folder / "guided.motion.html").exists()
    arm.go_home()
    recorder = program("record", "--state-log", "-O", str(candidate))
    assert eventually(candidate.with_suffix(".mcap.active").exists)
    arm.listen("joint_position", 60)
    code, said = shell.run(again)
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=PATIENCE_S)
    assert code == 0 and "done: the arm rests at the last point" in said and recorder.returncode == 0, said
    assert joints_of(arm) == pytest.approx(end, abs=2e-3)
    limits = yaml.safe_load((ROOT / "test" / "data" / "busy_host.yaml").read_text(encoding="utf-8"))
    # who moved the arm is another thing: calls, goals and states of the two runs differ
    limits["ignore_topics"] = [r"(?!(.*/)?(joint_position|tool_position|joint_states)$).*"]
    tolerances.write_text(yaml.safe_dump(limits), encoding="utf-8")
    code, said, errors = ended(program("compare", str(log), str(candidate), "--tolerances", str(tolerances)))
    assert code == 0, said + errors


def test_an_arm_that_stands_elsewhere_is_left_there(arm, guided):
    away = [0.3, *HOME[1:]]
    stand_at(arm, away)
    code, _, errors = ended(replay(guided[0]))
    assert code == 1 and "joint_1 stands 0.3" in errors and "--move-to-start" in errors
    assert joints_of(arm) == pytest.approx(away, abs=1e-3)


def test_it_moves_to_the_start_and_ctrl_c_brakes_the_arm_on_its_path(arm, guided):
    stand_at(arm, [0.1, *HOME[1:]])
    process = replay(guided[0], "--move-to-start", "--speed", "0.2")
    for line in process.stdout:
        if "begins" in line:
            break
    assert joints_of(arm) == pytest.approx(HOME, abs=0.02) and eventually(arm.simulator.is_moving)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert rests(arm), "it ends when the arm rests"
    assert process.returncode == 1 and "interrupted" in errors
    assert max(abs(a - b) for a, b in zip(joints_of(arm), guided[1])) > 0.05


def test_a_refusal_of_the_driver_is_told_and_so_is_a_driver_that_is_not_there(arm, guided, ros_master):
    arm.go_home()
    assert arm.call("drag_mode", data=True).success
    try:
        code, _, errors = ended(replay(guided[0]))
    finally:
        assert arm.call("drag_mode", data=False).success
    assert code == 1 and "hand guiding owns" in errors and rests(arm)
    with RemoteNode(ros_master, "/jaka_tests_client") as master:
        assert action_of(master, arm.name) == "/jaka_zu7_controller/follow_joint_trajectory"
        with pytest.raises(DriverNotThere, match="no node /left/jaka_driver takes trajectories"):
            action_of(master, "/left/jaka_driver")


def test_the_types_made_here_are_the_published_ones():
    assert made_action_type()._md5sum == MD5[ACTION_TYPE]
