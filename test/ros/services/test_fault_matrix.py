"""The services under every condition: the answer to the caller, and that nothing moves that must not.

The table that comes out is written to build/fault_matrix.md.
"""
import math

import pytest
import rospy
from driver_bench import HOME
from waiting import InBackground, eventually

MOVING = ("joint_move", "linear_move", "jog", "servo_move_enable", "servo_j", "servo_p", "drag_mode")
POSE = [300.0, 100.0, 300.0, math.pi, 0.0, 0.0]
CALLS = {
    "get_io": {"signal": "digital", "path": 1, "type": 0, "index": 0},
    "get_fk": {"joint": HOME},
    "get_ik": {"ref_joint": HOME, "cartesian_pose": POSE},
    "set_toolframe": {"pose": [0.0, 0.0, 10.0, 0.0, 0.0, 0.0], "tool_num": 1},
    "set_userframe": {"pose": [0.0] * 6, "user_num": 1},
    "set_payload": {"tool_num": 1, "mass": 0.5},
    "set_collisionlevel": {"is_enable": True, "value": 20},
    "set_io": {"signal": "digital", "type": 0, "index": 1, "value": 1.0},
    "joint_move": {"pose": [0.05] + HOME[1:], "mvvelo": 1.0, "mvacc": 4.0},
    "linear_move": {"pose": POSE, "mvvelo": 200.0, "mvacc": 1000.0},
    "jog": {"mvvelo": 0.1, "coord_mode": 0, "index": 0},
    "servo_j": {"pose": HOME},
    "servo_p": {"pose": [0.3, 0.1, 0.3, math.pi, 0.0, 0.0]},
    "servo_move_enable": {"enable": True},
    "drag_mode": {"data": True},
    "clear_err": {},
    "enable": {"data": True},
    "power": {"data": True},
    "recover": {},
    "stop_move": {},
}


class Condition:
    """A condition of arm or link: how to bring it about, and words that a refusal of motion must have."""

    def __init__(self, establish, words, standing=True, rest=True):
        self.establish = establish
        self.words = words
        self.standing = standing
        self.rest = rest


def no_power(arm):
    assert arm.call("power", data=False).success


def disabled(arm):
    assert arm.call("enable", data=False).success


def under_way(arm):
    arm.pending = InBackground(arm.call, "joint_move", pose=[3.0] + HOME[1:], mvvelo=0.1, mvacc=4.0)
    assert eventually(arm.simulator.is_moving)


def jogging(arm):
    assert arm.call("jog", mvvelo=0.05, coord_mode=0, index=0).ret == 1
    assert eventually(arm.simulator.is_moving)


def servo_mode(arm):
    assert arm.call("servo_move_enable", enable=True).ret == 1


def guided(arm):
    assert arm.call("drag_mode", data=True).success


def pressed(arm):
    arm.simulator.operate("press_emergency_stop")
    assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state == 2)


def protected(arm):
    assert arm.call("set_collisionlevel", is_enable=True, value=10).ret == 1
    under_way(arm)
    arm.simulator.operate("hit")
    assert arm.pending.join().ret == 0
    assert eventually(lambda: arm.listen("robot_states", 1)[0].collision_state == 1)


def command_port_down(arm):
    arm.simulator.operate("refuse", port="command", duration_ms=60000)
    arm.simulator.operate("close", port="command")
    assert eventually(lambda: not arm.call("get_fk", joint=HOME).cartesian_pose)


def feed_unreadable(arm):
    arm.simulator.operate("fault", kind="wrong_len", port="status", count=None)
    assert eventually(lambda: "fresh status" in arm.call("get_io", **CALLS["get_io"]).message)


CONDITIONS = {
    "emergency stop": Condition(pressed, "emergency stop"),
    "protective stop": Condition(protected, "protective stop"),
    "no power": Condition(no_power, "power"),
    "not enabled": Condition(disabled, "enabled"),
    "a move under way": Condition(under_way, "a move owns", rest=False),
    "a jog under way": Condition(jogging, "a jog owns", rest=False),
    "servo mode": Condition(servo_mode, "servo mode owns"),
    "hand guiding": Condition(guided, "hand guiding owns"),
    "command port down": Condition(command_port_down, "no link"),
    "status feed unreadable": Condition(feed_unreadable, "no fresh status"),
}


def recover(arm):
    """Bring back an enabled arm at rest, as an operator would."""
    arm.simulator.operate("release_emergency_stop")
    arm.simulator.operate("clear_faults")
    arm.simulator.operate("refuse", port="command", duration_ms=0)
    assert eventually(lambda: arm.call("get_fk", joint=HOME).cartesian_pose)
    assert eventually(lambda: "error" not in arm.call("get_io", **CALLS["get_io"]).message)
    arm.call("stop_move")
    arm.call("drag_mode", data=False)
    arm.call("clear_err")
    assert eventually(lambda: arm.call("power", data=True).success)
    assert eventually(lambda: arm.call("enable", data=True).success)
    assert eventually(lambda: not arm.simulator.is_moving())


def outcome(arm, service):
    """Return (success, the message to the caller)."""
    try:
        reply = arm.call(service, **CALLS[service])
    except rospy.ServiceException as error:
        return False, str(error)
    if service == "stop_move":
        return True, "stopped"
    if service == "get_io":
        return not math.isnan(reply.value), reply.message
    if service in ("get_fk", "get_ik"):
        return bool(reply.cartesian_pose if service == "get_fk" else reply.joint), reply.message
    return bool(reply.success if service in ("drag_mode", "power", "enable", "recover") else reply.ret), reply.message


@pytest.fixture(scope="module")
def matrix(root):
    rows = {}
    yield rows
    lines = ["# Every service under every condition", "", "| condition | service | | the caller is told |",
             "|---|---|---|---|"]
    for (condition, service), (done, told) in rows.items():
        words = told.split("\n")[0]
        lines.append("| %s | %s | %s | %s |" % (condition, service, "done" if done else "not done", words))
    (root / "build").mkdir(exist_ok=True)
    (root / "build" / "fault_matrix.md").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_service_answers_and_says_why(arm, matrix, name):
    condition = CONDITIONS[name]
    recover(arm)
    arm.go_home()
    assert arm.call("set_payload", **CALLS["set_payload"]).ret == 1  # waits for rest, which a lost link would hide
    condition.establish(arm)
    for service in CALLS:
        before = arm.simulator.state()["joint_position"]
        done, told = matrix[name, service] = outcome(arm, service)
        assert told.strip(), "%s under %s: no word" % (service, name)
        if service in MOVING and not allowed(name, service):
            assert not done and (condition.words in told or "not in servo mode" in told), (service, told)
            if condition.rest:
                after = arm.simulator.state()["joint_position"]
                assert max(abs(a - b) for a, b in zip(before, after)) < 1e-3, service
        if done and service in MOVING + ("clear_err", "enable", "power", "recover", "stop_move"):
            recover(arm)
            condition.establish(arm)
    recover(arm)


def allowed(condition, service):
    """Return the services that a condition does not stand against."""
    return ((condition == "servo mode" and service in ("servo_j", "servo_p", "servo_move_enable"))
            or (condition == "hand guiding" and service == "drag_mode")
            or (condition == "a jog under way" and service == "jog"))


def test_a_lost_reply_is_told_for_every_command_and_nothing_is_sent_twice(arm, matrix):
    wire_names = {"set_toolframe": "set_tool_offsets", "set_userframe": "set_user_offsets",
                  "set_payload": "set_payload", "set_collisionlevel": "set_clsn_sensitivity",
                  "set_io": "set_digital_output", "joint_move": "joint_move", "stop_move": "stop_program",
                  "clear_err": "clear_error", "get_fk": "kine_forward", "get_ik": "kine_inverse"}
    recover(arm)
    for service, wire_name in wire_names.items():
        arm.simulator.operate("fault", kind="drop", port="command", command=wire_name)
        done, told = matrix["reply lost", service] = outcome(arm, service)
        assert not done and ("no reply" in told or "command port" in told), (service, told)
        recover(arm)
