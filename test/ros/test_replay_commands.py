"""The command jaka_bag replay-commands against a live driver: start pose, speed limit, refusal, interruption."""
import contextlib
import math
import os
import signal
import subprocess
import time

import pytest
import rosgraph
import rospy
from command_places import command_of
from driver_bench import HOME, evidence_of
from import_graph import ROOT
from waiting import eventually

from jaka_bag.live.graph import RemoteNode

TWO_ARMS = str(ROOT / "test" / "data" / "golden" / "two_arms.mcap")
GOLDEN = str(ROOT / "test" / "data" / "golden" / "joint_moves.mcap")
WAIT = 200
AWAY = [0.3, *HOME[1:]]
START = [0.0, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0]


def command(*arguments):
    return [*command_of("jaka_bag"), "replay-commands", *arguments]


def replay(*arguments):
    return subprocess.run(command(*arguments), capture_output=True, text=True, timeout=WAIT)


def stand_at(arm, joints):
    assert arm.call("joint_move", pose=joints, mvvelo=1.5, mvacc=6.0).ret == 1


def joints_of(arm):
    return list(arm.listen("joint_position", 1)[0].position)


def test_the_arm_must_stand_where_the_log_began(arm):
    stand_at(arm, AWAY)
    with evidence_of(arm) as call_publisher:
        done = replay(GOLDEN)
        assert done.returncode == 1
        assert "joint 1 stands 0.3000 rad from where the log began" in done.stderr
        assert not call_publisher()
    assert joints_of(arm) == pytest.approx(AWAY, abs=1e-3)


def test_it_goes_to_the_start_and_makes_every_call_again(arm):
    stand_at(arm, AWAY)
    with evidence_of(arm) as call_publisher:
        done = replay(GOLDEN, "--go-to-start", "--after-previous")
        assert done.returncode == 0, done.stderr
        assert eventually(lambda: len(call_publisher()) == 5)
        assert "4 calls made" in done.stdout and done.stdout.count("succeeded") == 4
        assert [message.success for message in call_publisher()] == [True] * 5
    assert joints_of(arm) == pytest.approx(START, abs=1e-3)


def test_nothing_moves_where_the_same_joints_put_the_tool_elsewhere(arm):
    stand_at(arm, AWAY)
    assert arm.call("set_toolframe", pose=[0.0, 0.0, 120.0, 0.0, 0.0, 0.0], tool_num=1).ret == 1
    try:
        stand_at(arm, START)
        with evidence_of(arm) as call_publisher:
            done = replay(GOLDEN)
            assert done.returncode == 1 and "the tool is 120.0 mm" in done.stderr and "--anyway pose" in done.stderr
            assert not call_publisher()
            done = replay(GOLDEN, "--anyway", "pose", "--after-previous")
            assert done.returncode == 0, done.stderr
    finally:
        assert arm.call("set_toolframe", pose=[0.0] * 6, tool_num=1).ret == 1


def test_nothing_moves_under_another_condition_than_the_log_tells_of(arm, tmp_path):
    stand_at(arm, START)
    assert arm.call("set_payload", tool_num=1, mass=0.0, xc=0.0, yc=0.0, zc=0.0).ret == 1  # tool 1 is active from here
    log = str(tmp_path / "log.mcap")
    with subprocess.Popen([*command_of("jaka_bag"), "record", "--state-log", "-O", log], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True) as recorder:
        try:
            assert any("recording to" in line for line in recorder.stdout)
            time.sleep(2.5)  # diagnostics come once a second
            stand_at(arm, AWAY)
        finally:
            recorder.send_signal(signal.SIGINT)
            recorder.communicate(timeout=WAIT)
    stand_at(arm, START)
    assert arm.call("set_speed_slider", speed_slider_fraction=0.5).success
    assert arm.call("set_payload", tool_num=1, mass=1.25, xc=0.0, yc=0.0, zc=50.0).ret == 1
    assert arm.call("set_collisionlevel", is_enable=True, value=80).ret == 1
    try:
        time.sleep(1.5)  # what comes next has been asked for since, and published
        with evidence_of(arm) as call_publisher:
            done = replay(log)
            assert done.returncode == 1, done.stdout
            assert "the override was 1.0, and is 0.5" in done.stderr
            assert "the payload was 0 kg at 0, 0, 0 m, and is 1.25 kg at 0, 0, 0.05 m" in done.stderr
            assert "the collision level was 3, and is 4" in done.stderr
            assert "(--anyway override --anyway payload --anyway collision-level)" in done.stderr
            assert not call_publisher()
    finally:
        assert arm.call("set_speed_slider", speed_slider_fraction=1.0).success
        assert arm.call("set_payload", tool_num=1, mass=0.0, xc=0.0, yc=0.0, zc=0.0).ret == 1
        assert arm.call("set_collisionlevel", is_enable=True, value=60).ret == 1
    time.sleep(1.5)  # the same
    done = replay(log)
    assert done.returncode == 0, done.stderr
    assert "not compared" not in done.stdout, "all of it is told"


@contextlib.contextmanager
def recorded(arm, path):
    """Record what the driver publishes; end when all of it is in the file."""
    recorder = subprocess.Popen([*command_of("jaka_bag"), "record", "--state-log", "-O", str(path)],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        assert eventually(path.with_suffix(".mcap.active").exists)
        arm.listen("joint_position", 60)
        yield
        arm.listen("joint_position", 60)
    finally:
        recorder.send_signal(signal.SIGINT)
        recorder.communicate(timeout=WAIT)


def stream(arm, service, poses):
    """Call servo_j or servo_p for each pose, every 32 ms."""
    rate = rospy.Rate(1.0 / 0.032)
    for pose in poses:
        assert arm.call(service, pose=pose).ret == 1
        rate.sleep()  # the rate of a stream


def test_a_stream_of_servo_calls_gives_the_same_motion_again(arm, tmp_path):
    golden, candidate = tmp_path / "golden.mcap", tmp_path / "candidate.mcap"
    stand_at(arm, START)
    pose = arm.simulator.state()["tcp_pose"]
    x, y, z, rpy = *(value / 1000.0 for value in pose[:3]), [math.radians(angle) for angle in pose[3:]]
    swing = [4.0 * part * (1.0 - part) for part in (number / 40 for number in range(41))]
    with recorded(arm, golden):
        assert arm.call("servo_move_enable", enable=True).ret == 1
        stream(arm, "servo_j", [[START[0] + 0.1 * share, *START[1:]] for share in swing])
        assert arm.call("servo_move_enable", enable=False).ret == 1  # both kinds in one stream are refused
        assert arm.call("servo_move_enable", enable=True).ret == 1
        stream(arm, "servo_p", [[x, y, z + 0.03 * share, *rpy] for share in swing])
        assert arm.call("servo_move_enable", enable=False).ret == 1
    stand_at(arm, START)
    with recorded(arm, candidate):
        done = replay(str(golden))
    assert done.returncode == 0 and "86 calls made" in done.stdout, done.stdout + done.stderr
    compared = subprocess.run([
        *command_of("jaka_bag"), "compare", str(golden), str(candidate), "--tolerances",
        str(ROOT / "test" / "data" / "busy_host.yaml")], capture_output=True, text=True, timeout=WAIT)
    assert compared.returncode == 0, compared.stdout + compared.stderr


def test_the_speed_limit_slows_every_move(arm):
    stand_at(arm, START)
    with evidence_of(arm) as call_publisher:
        done = replay(GOLDEN, "--speed-limit", "80", "--after-previous")
        assert done.returncode == 0, done.stderr
        assert eventually(lambda: len(call_publisher()) == 4)
        speeds = [float(message.request_text.split("mvvelo: ")[1].split()[0]) for message in call_publisher()]
    assert speeds == pytest.approx([0.48, 0.48, 0.72, 0.48])


def test_it_ends_at_the_first_refusal_that_the_log_does_not_have(arm):
    stand_at(arm, START)
    assert arm.call("enable", data=False).success
    try:
        with evidence_of(arm) as call_publisher:
            done = replay(GOLDEN)
            assert done.returncode == 1
            assert "was refused, unlike in the log" in done.stderr
            assert eventually(lambda: [message.service.rsplit("/")[-1] for message in call_publisher()]
                              == ["joint_move", "stop_move"])
    finally:
        assert arm.call("enable", data=True).success


@contextlib.contextmanager
def begun(*arguments):
    with subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def interrupted(process, seconds=10.0):
    """Send Ctrl-C to a process; return its output. It must end soon."""
    process.send_signal(signal.SIGINT)
    errors = process.communicate(timeout=seconds)[1].decode()
    assert process.returncode == 1 and "interrupted" in errors, errors
    return errors


def names_of(calls):
    return sorted(call.service.rsplit("/")[-1] for call in calls)


@pytest.mark.parametrize("stands, arguments",
                         [(START, ["--speed-limit", "10", "--after-previous"]), (AWAY, ["--go-to-start"])],
                         ids=["a call", "the way to the start"])
def test_ctrl_c_stops_the_arm_in_the_middle_of_a_move(arm, stands, arguments):
    stand_at(arm, stands)
    with evidence_of(arm) as call_publisher, begun(GOLDEN, *arguments) as process:
        assert eventually(arm.simulator.is_moving)
        interrupted(process)
        assert eventually(lambda: not arm.simulator.is_moving())
        # the second stop is for a move that would reach the driver after the first
        assert eventually(lambda: names_of(call_publisher()) == ["joint_move", "stop_move", "stop_move"])
        assert [call.success for call in call_publisher()] == [call.service.endswith("stop_move")
                                                               for call in call_publisher()]


def test_ctrl_c_ends_the_wait_for_a_driver(ros_master):
    with begun(TWO_ARMS, "--wait", "120") as process:
        assert eventually(lambda: "/jaka_bag_replay" in str(rosgraph.Master("/jaka_tests").getSystemState()))
        time.sleep(0.5)  # until it waits; sooner it ends as well, with other words
        interrupted(process)


def test_a_driver_that_answers_nothing_does_not_hold_up_the_end(arm):
    stand_at(arm, START)
    with RemoteNode(rosgraph.get_master_uri(), "/jaka_tests") as master:
        uri = master.call("lookupNode", arm.name)
    with RemoteNode(uri, "/jaka_tests") as driver:
        frozen = driver.call("getPid")
    with begun(GOLDEN, "--speed-limit", "10", "--after-previous") as process:
        assert eventually(arm.simulator.is_moving)
        os.kill(frozen, signal.SIGSTOP)
        try:
            errors = interrupted(process, 20.0)
        finally:
            os.kill(frozen, signal.SIGCONT)
    assert "%s could not be stopped: no answer for 5 s" % arm.name in errors
    assert eventually(lambda: arm.call("stop_move") is not None) and eventually(lambda: not arm.simulator.is_moving())
