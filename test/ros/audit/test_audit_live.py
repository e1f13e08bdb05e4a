"""The audit log of a real driver on a simulated controller: it records who did what, however the driver dies."""
import os
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from audit_reading import lines_of, those_of, whole
from driver_bench import HOME, LiveDriver, begin, listen
from jog_pad import Pad
from jog_pad import begin as begin_jog
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import WAIT, eventually

from jaka_bag.cli import main as command
from jaka_msgs.msg import RecoverAction, RecoverGoal

NAME = "audited"
JOINTS = ["joint_%d" % number for number in range(1, 7)]


def is_here(line):
    """Return whether a line is of this test's node, from this machine."""
    return line["node"] == rospy.get_name() and line["host"].startswith("127.0.0.1:") and int(line["host"][10:]) > 0


@pytest.fixture(scope="module")
def told(ros_node, tmp_path_factory):
    """Run a driver's life with one act of each kind; SIGKILL in the middle of a motion; a second life, ended in
    order."""
    folder = tmp_path_factory.mktemp("audit")
    with LiveDriver(tmp_path_factory.mktemp("wire"), name=NAME, guard=False, audit_dir=str(folder),
                    industrial_names=True) as live:
        arm = live.arm
        arm.wait_until_ready()
        went_home(arm)
        assert arm.call("joint_move", pose=[9.0] * 6, mvvelo=1.0, mvacc=1.0).ret == 0
        assert arm.call("set_payload", tool_num=0, mass=1.5, xc=0.0, yc=0.0, zc=40.0).ret == 1
        jogged(live)
        sent_by_topic(live)
        with_a_goal(live)
        went_home(arm)
        servoed(live)
        begin(live, "move")
        arm.call("stop_move")
        arm.call("get_fk", joint=HOME)
        begin(live, "move")
        live.simulator.operate("press_emergency_stop")
        assert eventually(lambda: those_of(folder, "driver") and any(
            "emergency stop" in line["text"] for line in those_of(folder, "driver")), WAIT)
        live.simulator.operate("release_emergency_stop")
        assert eventually(lambda: arm.call("recover").success, WAIT)
        for name in ("~jog_joints", "~servo_j", "jaka_zu7_controller/command"):
            assert eventually(lambda name=name: len(those_of(folder, "stream", what=name, state="begins")) == len(
                those_of(folder, "stream", what=name, state="has ended")) > 0)
        begin(live, "jog")
        assert eventually(lambda: those_of(folder, "motion")[-1]["state"] == "begins")
        assert eventually(lambda: custody_files(live.simulator.command_port)), "custody is noted on disk"
        live.send(signal.SIGKILL)
        live.kill_driver()
        killed = SimpleNamespace(lines=lines_of(folder), account=whole(folder))
        live.start()
        live.arm.wait_until_ready()
        assert live.end_driver()[0] == 0
    return SimpleNamespace(folder=folder, killed=killed)


def custody_files(port):
    folders = [os.environ["TMPDIR"], "/run/user/%d" % os.getuid(), os.environ.get("XDG_RUNTIME_DIR", "/nowhere")]
    return [path for folder in folders for path in Path(folder).glob("jaka_ros_driver*/custody.*_%d.json" % port)]


def went_home(arm):
    """Move home; again where a busy host stands against it."""
    assert eventually(lambda: arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1, WAIT)


def jogged(live):
    with Pad(live.arm.name, "jog_joints") as pad:
        begin_jog(live.arm, pad)
        time.sleep(0.6)  # some thirty messages
    assert eventually(lambda: not live.simulator.is_moving(), WAIT)


def sent_by_topic(live):
    topic = "/jaka_zu7_controller/command"
    publisher = rospy.Publisher(topic, JointTrajectory, queue_size=1)
    assert eventually(publisher.get_num_connections, WAIT)

    def moves():
        publisher.publish(joint_names=JOINTS, points=[JointTrajectoryPoint(
            positions=[0.5] + HOME[1:], time_from_start=rospy.Duration(20.0))])
        return eventually(live.simulator.is_moving, 2.0)
    assert eventually(moves, WAIT)
    publisher.publish(JointTrajectory())
    assert eventually(lambda: not live.simulator.is_moving(), WAIT)
    publisher.unregister()


def with_a_goal(live):
    client = actionlib.SimpleActionClient(live.arm.name + "/recover", RecoverAction)
    assert client.wait_for_server(rospy.Duration(WAIT))
    client.send_goal_and_wait(RecoverGoal(), rospy.Duration(WAIT))


def servoed(live):
    assert eventually(lambda: live.arm.call("servo_move_enable", enable=True).ret == 1, WAIT)
    first = live.arm.listen("joint_position", 1)[0].position
    for _ in range(30):
        live.arm.call("servo_j", pose=list(first))
    live.arm.call("servo_move_enable", enable=False)


def test_the_log_is_whole_over_a_death_and_a_second_life(told, capsys):
    account = whole(told.folder)
    assert account.lines > told.killed.account.lines > 20
    lines = lines_of(told.folder)
    assert [line["n"] for line in lines] == list(range(1, len(lines) + 1))
    assert lines[:len(told.killed.lines)] == told.killed.lines
    starts = [index for index, line in enumerate(lines) if line["kind"] == "start"]
    assert len(starts) == 2 and [line["kind"] for line in lines].count("end") == 1 and lines[-1]["kind"] == "end"
    assert command.main(["verify", str(told.folder)]) == 0
    assert "whole; last hash %s" % account.last_hash in capsys.readouterr().out


def test_the_start_tells_what_runs(told):
    start = those_of(told.folder, "start")[0]
    assert start["node"] == "/" + NAME and start["model"] == "zu7" and start["version"] not in ("", "unknown")
    assert start["parameters"]["audit_dir"] == str(told.folder) and start["parameters"]["auto_enable"] is True
    assert start["n"] == 1 and start["process"] > 0
    assert "service ~joint_move" in those_of(told.folder, "recorded")[0]["names"]
    assert any("asked for by ~auto_enable" in line["text"] for line in those_of(told.folder, "driver"))


def test_a_call_has_its_caller_its_arguments_and_its_answer(told):
    call = those_of(told.folder, "call", what="~joint_move")[0]
    assert is_here(call) and call["arguments"]["mvvelo"] == 3.0 and len(call["arguments"]["pose"]) == 6
    answer, = those_of(told.folder, "answer", call=call["call"], what="~joint_move")[:1]
    assert is_here(answer) and answer["ok"] and "completed" in answer["message"] and answer["seconds"] > 0.0


def test_a_failed_call_stands_there_with_the_reason(told):
    failed = [line for line in those_of(told.folder, "answer", what="~joint_move") if not line["ok"]]
    assert failed and is_here(failed[0]) and "joint 1 of zu7" in failed[0]["message"]


@pytest.mark.parametrize("name", ["~set_payload", "~stop_move", "~recover", "~servo_move_enable"])
def test_each_call_that_was_made_stands_there(told, name):
    calls, answers = those_of(told.folder, "call", what=name), those_of(told.folder, "answer", what=name)
    assert calls and len(calls) == len(answers) and all(map(is_here, calls + answers))
    assert any(answer["ok"] for answer in answers)


def test_what_only_reads_is_left_out(told):
    assert not [line for line in lines_of(told.folder) if line.get("what") == "~get_fk"]


def test_a_jog_by_topic_is_one_act_of_its_node(told):
    begins = [line for line in those_of(told.folder, "stream", what="~jog_joints", state="begins")
              if line["arguments"]["velocity"][1]]
    ends = those_of(told.folder, "stream", what="~jog_joints", state="has ended")
    assert begins and begins[0]["node"] == "/pad" and begins[0]["host"].startswith("127.0.0.1:")
    assert ends and sum(end["messages"] for end in ends) > 5
    assert len(those_of(told.folder, "stream", what="~jog_joints")) < 60, "not a line for each message"
    assert those_of(told.folder, "motion", motion="a velocity jog", state="begins")


def test_a_trajectory_by_topic_and_its_end_stand_there(told):
    name = "jaka_zu7_controller/command"
    begun = those_of(told.folder, "stream", what=name, state="begins")
    assert all(map(is_here, begun)) and any(len(line["arguments"]["points"]) == 1 for line in begun)
    assert any(line["arguments"]["points"] == [] for line in begun), "the one that ends it"


def test_a_goal_has_its_client_and_its_result(told):
    goal, = those_of(told.folder, "goal", what="~recover")
    result, = those_of(told.folder, "result", what="~recover", goal=goal["goal"])
    assert is_here(goal) and result["ok"] and result["status"] == "succeeded" and "ready" in result["message"]


def test_a_stream_by_service_is_one_act(told):
    stream = those_of(told.folder, "stream", what="~servo_j")
    assert stream[0]["state"] == "begins" and is_here(stream[0]) and stream[0]["ok"]
    assert len(stream) < 10 and sum(line.get("messages", 0) for line in stream) == 30


def test_a_stop_by_the_driver_itself_has_its_cause(told):
    assert any(line["text"].startswith("stopping the arm: emergency stop") and line["level"] == "WARNING"
               for line in those_of(told.folder, "driver"))


def test_each_motion_begins_and_ends(told):
    states = [line["state"] for line in those_of(told.folder, "motion")]
    assert states.count("begins") - states.count("has ended") == 1, "the one in which it was killed"


def test_what_the_dead_driver_left_stands_in_the_log_of_the_next_one(told):
    later = lines_of(told.folder)[len(told.killed.lines):]
    assert any("a jog" in line.get("text", "") for line in later), later


def test_two_arms_have_their_own_logs(ros_node, tmp_path):
    folder = tmp_path / "audit"
    with LiveDriver(tmp_path, name="one", guard=False, audit_dir=str(folder)) as one, \
            LiveDriver(tmp_path, name="two", guard=False, audit_dir=str(folder)) as two:
        for live in (one, two):
            live.arm.wait_until_seen()
            live.arm.call("set_collisionlevel", is_enable=True, value=50)
            live.end_driver()
        logs = {"127.0.0.1_%d" % live.simulator.command_port: live.arm.name for live in (one, two)}
    assert {path.name for path in folder.iterdir()} == set(logs)
    for log, name in logs.items():
        assert whole(folder / log).lines > 3
        assert {line["node"] for line in those_of(folder / log, "start")} == {name}


def test_a_log_that_is_switched_off_is_said_at_the_start(ros_node, tmp_path):
    with LiveDriver(tmp_path, name="off", guard=False, audit_dir="") as live:
        live.arm.wait_until_seen()
        assert live.arm.call("set_collisionlevel", is_enable=True, value=50).ret == 1
        _, said = live.end_driver()
    assert "the audit log is switched off by ~audit_dir" in said


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")
def test_a_full_disk_costs_a_warning_and_the_chain_goes_on_when_there_is_room(ros_node, tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "jaka-test", str(disk)]).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        ballast = disk / "ballast"
        with LiveDriver(tmp_path, name="full", guard=False, audit_dir=str(disk / "audit")) as live:
            live.arm.wait_until_ready()
            assert eventually(lambda: those_of(disk, "start"))
            with open(str(ballast), "wb", buffering=0) as file:
                try:
                    while True:
                        file.write(b"x" * 512)
                except OSError:
                    pass
            for value in (25, 50, 75, 100) * 20:
                assert live.arm.call("set_collisionlevel", is_enable=True, value=value).ret == 1
            live.arm.call("stop_move")

            def condition():
                message = listen("/diagnostics", 1)[0][1]
                return next((status for status in message.status if status.name.endswith("audit log")), None)
            assert eventually(lambda: condition() is not None and "No space left" in condition().message, WAIT)
            ballast.unlink()
            assert eventually(lambda: those_of(disk, "call", what="~stop_move"), WAIT)
            _, said = live.end_driver()
        assert said.count("cannot be written: [Errno 28] No space left") <= 2 * 1, said  # rosout and standard error
        assert len(those_of(disk, "answer", what="~set_collisionlevel")) == 80 and whole(disk).lines > 160
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_a_driver_that_is_killed_again_and_again_leaves_one_chain(ros_node, tmp_path):
    # Each next start goes on with the chain.
    folder = tmp_path / "audit"
    with LiveDriver(tmp_path, name="dying", guard=False, audit_dir=str(folder)) as live:
        for death in range(3):
            live.arm.wait_until_seen()
            for value in (25, 50) * (5 + death):
                live.arm.call("set_collisionlevel", is_enable=True, value=value)
            live.send(signal.SIGKILL)
            live.kill_driver()
            whole(folder)
            live.start()
        live.arm.wait_until_seen()
    assert len(those_of(folder, "start")) == 4
