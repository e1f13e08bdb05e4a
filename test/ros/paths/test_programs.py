"""Programs of the controller's own on the running node, from every state; requests are in the log."""
import contextlib

import pytest
import rospy
from driver_bench import HOME, SimulatorProcess
from waiting import InBackground, eventually
from wire_verdict import WireVerdict

from jaka_msgs.msg import ProgramState

IDLE, PAUSED, RUNNING = ProgramState.IDLE, ProgramState.PAUSED, ProgramState.RUNNING


@pytest.fixture(scope="module")
def cell(ros_node, driven_by, log_file):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", str(log_file))) as simulator:
        with driven_by(simulator) as arm:
            arm.wait_until_ready()
            yield arm


@pytest.fixture
def arm(cell):
    """Return an arm with a program loaded, none running, ready."""
    cell.simulator.operate("release_emergency_stop")
    assert eventually(lambda: cell.call("recover").success)
    assert cell.call("program/stop").success
    assert cell.call("program/load", name="weld.jks").success
    return cell


def last(arm):
    """Return the newest message of ~program/state."""
    return arm.listen("program/state", 1)[0]


def test_a_program_from_load_to_stop_and_the_topic_that_tells_of_it(arm):
    loaded = arm.call("program/load", name="paint.jks")
    assert loaded.success and loaded.message == "program paint.jks loaded"
    for service, state, said in (("play", RUNNING, "the program runs"), ("pause", PAUSED, "the program is paused"),
                                 ("resume", RUNNING, "the program goes on"), ("stop", IDLE, "no program runs")):
        answer = arm.call("program/" + service)
        assert answer.success and said in answer.message, answer
        assert eventually(lambda state=state: last(arm).state == state), service
    assert eventually(lambda: last(arm).reason == "stopped by request") and last(arm).program == "paint.jks"


# In each state of the program: which services succeed.
FROM_EVERY_STATE = {
    "idle": ((), {"program/load", "program/play", "program/stop"}),
    "running": (("play",), {"program/pause", "program/stop"}),
    "paused": (("play", "pause"), {"program/resume", "program/stop"}),
}


@pytest.mark.parametrize("state", list(FROM_EVERY_STATE))
def test_each_service_from_every_state(arm, state):
    calls, good = FROM_EVERY_STATE[state]
    for service in ("program/load", "program/play", "program/pause", "program/resume", "program/stop"):
        assert arm.call("program/stop").success
        for call in calls:
            answer = arm.call("program/" + call)
            assert answer.success, answer.message
        answer = arm.call(service, **({"name": "weld.jks"} if service == "program/load" else {}))
        assert answer.success is (service in good), (state, service, answer.message)
        assert answer.message


def test_it_owns_the_motion_and_stop_move_ends_it(arm, log_file):
    since = rospy.get_time()
    assert arm.call("program/play").success
    begun = WireVerdict(log_file).times_of("play_program")[-1]
    for service, fields in (("joint_move", {"pose": HOME, "mvvelo": 1.0, "mvacc": 1.0}),
                            ("servo_move_enable", {"enable": True}), ("jog", {"mvvelo": 0.1, "index": 0})):
        answer = arm.call(service, **fields)
        assert answer.ret == 0 and "a program owns the arm's motion" in answer.message, answer
    assert "a program owns" in arm.call("pause").message, "~pause is for moves, paths and trajectories"
    arm.call("stop_move")
    assert eventually(lambda: last(arm).state == IDLE and "stopped by request" in last(arm).reason)
    sent = WireVerdict(log_file)
    assert not sent.times_of("joint_move", begun) + sent.times_of("servo_move", begun, relFlag=1) + sent.times_of(
        "jog", begun, jog_mode=1)
    assert arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1
    assert rospy.get_time() > since


def test_an_emergency_stop_ends_it_and_nothing_goes_on_by_itself(arm, log_file):
    assert arm.call("program/play").success
    arm.simulator.operate("press_emergency_stop")
    assert eventually(lambda: last(arm).state == IDLE and "emergency stop" in last(arm).reason)
    refused = arm.call("program/resume")
    assert not refused.success and "emergency stop" in refused.message
    arm.simulator.operate("release_emergency_stop")
    assert eventually(lambda: arm.call("recover").success)
    assert last(arm).state == IDLE
    sent = WireVerdict(log_file)
    assert sent.times_of("resume_program", sent.times_of("play_program")[-1]) == []


@pytest.mark.parametrize("name", ["", "../etc/passwd", "a/b.jks", "x" * 101])
def test_a_name_that_is_none_of_a_program_is_refused(arm, name):
    answer = arm.call("program/load", name=name)
    assert not answer.success and "the name of a program file" in answer.message


def test_a_program_is_not_played_while_something_else_moves_the_arm(arm):
    move = InBackground(arm.call, "joint_move", pose=[1.0] + HOME[1:], mvvelo=0.2, mvacc=1.0)
    assert eventually(arm.simulator.is_moving)
    for service in ("play", "pause", "resume"):
        answer = arm.call("program/" + service)
        assert not answer.success and "a move owns the arm's motion" in answer.message, (service, answer)
    arm.call("stop_move")
    assert move.join().ret == 0
