"""Interface vendor, row by row of docs/interface.md section 5; rows that hold in both are tested in both."""
import math

import pytest
import rosservice as rosservice_library
from driver_bench import HOME, listen
from waiting import InBackground, eventually

from jaka_ros_driver.kinematics.rotations import (
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rotation_angle_between,
)

FAST = {"mvvelo": 3.0, "mvacc": 12.0}
FAILED = [9999.0] * 6


@pytest.fixture(scope="module", params=["vendor", "documented"])
def interface(request):
    return request.param


@pytest.fixture(scope="module")
def driver(ros_node, simulator, driven_by, interface):
    with driven_by(simulator, "interface:=" + interface) as running:
        running.wait_until_ready()
        yield running


@pytest.fixture
def is_vendor(interface):
    return interface == "vendor"


@pytest.fixture
def servoing(driver):
    driver.go_home()
    assert driver.call("servo_move_enable", enable=True).ret == 1
    yield driver
    assert driver.call("servo_move_enable", enable=False).ret == 1


def joint_deg(driver, joint):
    return driver.simulator.state()["joint_position"][joint - 1]


def test_servo_j_is_an_increment_or_a_target(servoing, is_vendor):
    for _ in range(2):
        assert servoing.call("servo_j", pose=[0.01, 0, 0, 0, 0, 0] if is_vendor else [0.02] + HOME[1:]).ret == 1
    assert eventually(lambda: abs(joint_deg(servoing, 1) - math.degrees(0.02)) < 1e-3)
    refused = servoing.call("servo_j", pose=HOME if is_vendor else [0.01, 0, 0, 0, 0, 0])
    assert refused.ret == 0 and ("increment" if is_vendor else "rad away") in refused.message


def test_servo_p_is_an_increment_in_mm_or_a_target_in_m(servoing, is_vendor):
    x, y, z, *rpy = servoing.simulator.state()["tcp_pose"]
    if is_vendor:
        target = [3.0, 0.0, -2.0, 0.0, 0.0, 0.0]
    else:
        target = [(x + 3.0) / 1000, y / 1000, (z - 2.0) / 1000] + [math.radians(angle) for angle in rpy]
    assert servoing.call("servo_p", pose=target).ret == 1
    assert eventually(lambda: servoing.simulator.state()["tcp_pose"][:3] == pytest.approx([x + 3, y, z - 2], abs=0.01))


def test_jog_speed_is_mvvelo_else_mvacc(driver):
    driver.go_home()
    for fields in ({"mvacc": 0.2}, {"mvvelo": 0.2, "mvacc": 0.1}):
        assert driver.call("jog", index=0, **fields).ret == 1
        assert eventually(lambda: driver.simulator.state()["joint_velocity"][0] == pytest.approx(
            math.degrees(0.2), abs=0.1))
        driver.call("stop_move")
        assert eventually(lambda: not driver.simulator.is_moving())


def test_tool_position_is_mm_and_degrees_or_m_and_a_rotation_vector(driver, is_vendor):
    driver.go_home()
    x, y, z, *rpy = driver.simulator.state()["tcp_pose"]
    twist = driver.listen("tool_position", 1)[0].twist
    linear, angular = twist.linear, (twist.angular.x, twist.angular.y, twist.angular.z)
    scale = 1.0 if is_vendor else 0.001
    assert (linear.x, linear.y, linear.z) == pytest.approx((x * scale, y * scale, z * scale), abs=1e-3 * scale)
    if is_vendor:
        assert angular == pytest.approx(rpy, abs=1e-3)
    else:
        truth = matrix_from_rpy([math.radians(angle) for angle in rpy])
        assert rotation_angle_between(matrix_from_rotation_vector(angular), truth) < 1e-4


def test_linear_move_ends_at_the_rotation_or_at_its_inverse(driver, is_vendor):
    driver.go_home()
    x, y, z, *rpy = driver.simulator.state()["tcp_pose"]
    vector = (2.2, -2.1, 0.1)
    sent = [-v for v in vector] if is_vendor else vector
    answer = driver.call("linear_move", pose=[x, y, z, *sent], mvvelo=500.0, mvacc=4000.0)
    assert answer.ret == 1, answer.message
    reached = [math.radians(angle) for angle in driver.simulator.state()["tcp_pose"][3:]]
    assert rotation_angle_between(matrix_from_rpy(reached), matrix_from_rotation_vector(vector)) < 1e-3


def test_servo_state_is_enabled_or_servo_mode(driver, is_vendor):
    def servo_state():
        return driver.listen("robot_states", 1)[0].servo_state
    assert eventually(lambda: servo_state() == (1 if is_vendor else 0))
    assert driver.call("servo_move_enable", enable=True).ret == 1
    assert eventually(lambda: servo_state() == 1)
    assert driver.call("servo_move_enable", enable=False).ret == 1
    assert driver.call("enable", data=False).success
    assert eventually(lambda: servo_state() == 0)
    assert driver.call("enable", data=True).success
    assert eventually(lambda: servo_state() == (1 if is_vendor else 0))


def test_frames_are_stored_and_activated_or_not(driver, is_vendor):
    assert driver.call("set_toolframe", pose=[0.0, 0.0, 50.0, 0.0, 0.0, 0.0], tool_num=4).ret == 1
    assert driver.call("set_userframe", pose=[5.0, 0.0, 0.0, 0.0, 0.0, 0.0], user_num=5).ret == 1
    state = driver.simulator.state()
    assert (state["tool_id"], state["user_frame_id"]) == ((0, 0) if is_vendor else (4, 5))
    assert driver.call("set_payload", tool_num=4, mass=1.0).ret == 1
    assert driver.simulator.state()["tool_id"] == 4, "set_payload selects its tool in both"
    assert driver.call("set_payload", tool_num=0, mass=0.0).ret == 1
    assert driver.call("set_userframe", pose=[0.0] * 6, user_num=5).ret == 1


@pytest.mark.parametrize("name", ["drag_mode", "drag_move"])
def test_hand_guiding_has_both_names(driver, name):
    assert rosservice_library.get_service_type("%s/%s" % (driver.name, name)) == "std_srvs/SetBool"
    assert driver.call(name, data=True).success and driver.simulator.state()["is_hand_guided"]
    assert driver.call(name, data=False).success and not driver.simulator.state()["is_hand_guided"]


def test_get_io_failure(driver, is_vendor):
    answer = driver.call("get_io", signal="digital", path=0, type=0, index=999)
    assert answer.value == -999999.0 if is_vendor else math.isnan(answer.value)
    assert answer.message.startswith("error:")


def test_kinematics_failure(driver, is_vendor):
    expected = FAILED if is_vendor else []
    assert list(driver.call("get_fk", joint=[0.0]).cartesian_pose) == expected
    unreachable = driver.call("get_ik", ref_joint=HOME, cartesian_pose=[5000.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert list(unreachable.joint) == expected and unreachable.message


def test_a_failure_is_a_reply_with_ret_0(driver):
    answer = driver.call("joint_move", pose=[9.0] * 6, **FAST)
    assert answer.ret == 0 and "joint 1" in answer.message


def test_collision_detection_is_switched_off(driver):
    assert driver.call("set_collisionlevel", is_enable=True, value=20).ret == 1
    assert driver.simulator.state()["collision_level"] == 1
    assert driver.call("set_collisionlevel", is_enable=False, value=20).ret == 1
    assert driver.simulator.state()["collision_level"] == 0


def test_a_short_pose_is_refused(driver):
    assert "pose has 2 values" in driver.call("linear_move", pose=[1.0, 2.0], **FAST).message


def test_stop_is_served_during_a_blocking_move(driver):
    driver.go_home()
    call = InBackground(driver.call, "joint_move", pose=[2.0] + HOME[1:], mvvelo=0.05, mvacc=1.0)
    assert eventually(driver.simulator.is_moving)
    driver.call("stop_move")
    assert "stopped by request" in call.join().message


def test_topics_come_at_125_hz(driver):
    def at_full_rate():
        times = [at for at, _ in listen(driver.name + "/tool_position", 126)]
        return 125.0 / (times[-1] - times[0]) == pytest.approx(125.0, rel=0.05)
    assert eventually(at_full_rate)


def test_the_jog_ends_by_itself_after_3_s(driver):
    driver.go_home()
    assert driver.call("jog", mvvelo=0.05, index=0).ret == 1
    assert eventually(driver.simulator.is_moving)
    assert eventually(lambda: not driver.simulator.is_moving())
    moved = math.radians(joint_deg(driver, 1))
    assert moved == pytest.approx(0.05 * 3.0, abs=0.05 * 0.6)
