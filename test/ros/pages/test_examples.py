"""The scripts of docs/examples, each as a reader would start it."""
import math
import os
import re
import signal
import subprocess
import sys

import import_graph
import log_samples
import pytest
from driver_bench import HOME
from waiting import eventually

EXAMPLES = import_graph.ROOT / "docs" / "examples"
TESTED = {"move_and_stop.py", "stream_servo_targets.py", "follow_trajectory.py", "read_log_into_numpy.py",
          "simulator_in_a_test.py", "move_gripper.py"}
"""The last is run with its page by test_width_gripper_live.py."""
PATIENCE_S = 90.0


def started(folder, *words):
    """Start python3 with these words; it finds the packages where the tests find them."""
    path = os.pathsep.join([str(import_graph.ROOT)] + [entry for entry in sys.path if entry])
    return subprocess.Popen([sys.executable, *words], cwd=str(folder), env=dict(os.environ, PYTHONPATH=path), text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def run(folder, *words):
    """Run python3 with these words; return its exit code and output."""
    process = started(folder, *words)
    said = process.communicate(timeout=PATIENCE_S)[0]
    return process.returncode, said


def test_every_example_is_tested_and_in_the_index():
    assert {path.name for path in EXAMPLES.iterdir() if path.suffix == ".py"} == TESTED
    index = (import_graph.ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    assert all("examples/" + name in index for name in TESTED)


def test_a_client_that_moves_and_stops(arm, tmp_path):
    arm.go_home()
    code, said = run(tmp_path, str(EXAMPLES / "move_and_stop.py"))
    assert code == 0, said
    assert "to the start: completed" in said and "to the target: stopped by request" in said
    assert not arm.simulator.is_moving()
    assert 0.0 < arm.simulator.state()["joint_position"][0] < 90.0


@pytest.mark.parametrize("part", ["to the start", "to the target"])
def test_a_client_that_moves_and_gets_ctrl_c_stops_the_arm(arm, tmp_path, part):
    arm.go_home()
    away = [-1.0 if part == "to the start" else 0.0, *HOME[1:]]
    assert arm.call("joint_move", pose=away, mvvelo=3.0, mvacc=12.0).ret == 1
    process = started(tmp_path, str(EXAMPLES / "move_and_stop.py"))
    if part == "to the target":
        assert process.stdout.readline().startswith("to the start: completed")
    assert eventually(arm.simulator.is_moving)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=PATIENCE_S)[0]
    assert process.returncode == 1 and "interrupted" in said, said
    assert eventually(lambda: not arm.simulator.is_moving())
    assert -60.0 < arm.simulator.state()["joint_position"][0] < 90.0


def test_a_client_that_streams_servo_targets(arm, tmp_path):
    arm.go_home()
    code, said = run(tmp_path, str(EXAMPLES / "stream_servo_targets.py"))
    assert code == 0 and "501 targets" in said and "servo mode left" in said, said
    assert arm.simulator.state()["joint_position"][0] == pytest.approx(HOME[0], abs=0.1)


def test_a_client_that_streams_and_gets_ctrl_c_leaves_servo_mode(arm, tmp_path):
    arm.go_home()
    process = started(tmp_path, str(EXAMPLES / "stream_servo_targets.py"))
    assert eventually(arm.simulator.is_moving)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=PATIENCE_S)[0]
    assert process.returncode == 1 and said.startswith("interrupted\n") and "servo mode left" in said, said
    assert eventually(lambda: not arm.simulator.is_moving())
    assert arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1


def test_a_client_that_sends_a_trajectory(arm, tmp_path):
    arm.go_home()
    code, said = run(tmp_path, str(EXAMPLES / "follow_trajectory.py"))
    assert code == 0 and "SUCCEEDED: the arm rests at the last point" in said, said
    assert arm.simulator.state()["joint_position"] == pytest.approx([math.degrees(q) for q in HOME], abs=0.1)


IN_THE_SENDING = """
import os, runpy, signal, sys
import actionlib
send = actionlib.SimpleActionClient.send_goal
def sent(*words):
    send(*words)
    os.kill(os.getpid(), signal.SIGINT)
actionlib.SimpleActionClient.send_goal = sent
runpy.run_path(sys.argv[1], run_name="__main__")
"""


@pytest.mark.parametrize("words", [(), ("-c", IN_THE_SENDING)], ids=["in motion", "as the goal is sent"])
def test_a_client_that_cancels_its_trajectory_with_ctrl_c(arm, tmp_path, words):
    arm.go_home()
    process = started(tmp_path, *words, str(EXAMPLES / "follow_trajectory.py"))
    if not words:
        assert eventually(arm.simulator.is_moving)
        process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=PATIENCE_S)[0]
    assert process.returncode == 1 and "PREEMPTED: cancelled by its client" in said, said
    assert not arm.simulator.is_moving()
    assert eventually(lambda: arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1)


def test_a_program_that_reads_a_log(tmp_path):
    pytest.importorskip("jaka_bag")
    log = log_samples.write(tmp_path / "run.mcap", log_samples.state_log(seconds=2.0))
    code, said = run(tmp_path, str(EXAMPLES / "read_log_into_numpy.py"), str(log))
    assert code == 0 and said.startswith("250 samples in 1.992 s"), said
    assert len(re.findall(r"^joint [1-6]: ", said, re.MULTILINE)) == 6


def test_a_test_of_somebody_elses(tmp_path):
    code, said = run(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path),
                     str(EXAMPLES / "simulator_in_a_test.py"))
    assert code == 0 and "2 passed" in said, said
