"""Interface vendor_2025 where it differs from vendor (docs/controller-protocol.md section 9.1), and logs of it."""
import math
import signal
import subprocess

import pytest
from command_places import command_of
from driver_bench import HOME
from geometry_msgs.msg import PoseStamped
from waiting import eventually

from jaka_bag.cli.main import main
from jaka_bag.compare.runs.loading import load_run
from jaka_regression.scenario import scenario_of
from jaka_ros_driver.kinematics.rotations import matrix_from_rotation_vector, matrix_from_rpy, rotation_angle_between

TOPIC = "/jaka_driver/tool_position"
RECORD = [*command_of("jaka_bag"), "record"]


@pytest.fixture(scope="module")
def driver(ros_node, simulator, driven_by):
    with driven_by(simulator, "interface:=vendor_2025") as running:
        running.wait_until_ready()
        yield running


def pose_of(driver):
    """Return the controller's pose: m (3,), rotation matrix."""
    x, y, z, *rpy = driver.simulator.state()["tcp_pose"]
    return (x / 1000.0, y / 1000.0, z / 1000.0), matrix_from_rpy([math.radians(angle) for angle in rpy])


def test_tool_position_is_a_pose_in_mm_with_a_unit_quaternion(driver):
    driver.go_home()
    position, turn = pose_of(driver)
    assert eventually(lambda: abs(driver.listen("tool_position", 1)[0].pose.position.x - 1000.0 * position[0]) < 1e-3)
    message = driver.listen("tool_position", 1)[0]
    assert isinstance(message, PoseStamped) and message.header.frame_id == "base_link"
    p, q = message.pose.position, message.pose.orientation
    assert (p.x, p.y, p.z) == pytest.approx([1000.0 * value for value in position], abs=1e-3)
    angle = 2.0 * math.acos(q.w)
    axis = [value / math.sin(0.5 * angle) for value in (q.x, q.y, q.z)]
    assert rotation_angle_between(matrix_from_rotation_vector([angle * value for value in axis]), turn) < 1e-4


def test_linear_move_takes_rpy(driver):
    driver.go_home()
    x, y, z, *_ = driver.simulator.state()["tcp_pose"]
    rpy = (3.0, 0.1, -1.4)
    answer = driver.call("linear_move", pose=[x, y, z, *rpy], mvvelo=500.0, mvacc=4000.0)
    assert answer.ret == 1, answer.message
    assert rotation_angle_between(pose_of(driver)[1], matrix_from_rpy(rpy)) < 1e-3


def test_the_rest_is_as_in_the_year_before(driver):
    driver.go_home()
    assert eventually(lambda: driver.listen("robot_states", 1)[0].servo_state == 1), "enabled"
    assert driver.call("get_io", signal="digital", path=0, type=0, index=999).value == -999999.0
    assert driver.call("set_toolframe", pose=[0.0, 0.0, 50.0, 0.0, 0.0, 0.0], tool_num=4).ret == 1
    assert driver.simulator.state()["tool_id"] == 0
    assert driver.call("servo_move_enable", enable=True).ret == 1
    assert driver.call("servo_j", pose=[0.01, 0, 0, 0, 0, 0]).ret == 1
    assert eventually(lambda: abs(driver.simulator.state()["joint_position"][0] - math.degrees(0.01)) < 1e-3)
    assert driver.call("servo_move_enable", enable=False).ret == 1


def test_a_state_log_of_it_is_recorded_compared_drawn_and_exported(driver, tmp_path):
    log = tmp_path / "run.mcap"
    driver.go_home()
    recorder = subprocess.Popen([*RECORD, "--state-log", "-O", str(log)], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True)
    assert any("recording to" in line for line in recorder.stdout)
    assert driver.call("joint_move", pose=[0.3] + HOME[1:], mvvelo=0.5, mvacc=4.0).ret == 1
    driver.listen("tool_position", 125)
    recorder.send_signal(signal.SIGINT)
    said, _ = recorder.communicate(timeout=120)
    assert recorder.returncode == 0, said
    position, turn = pose_of(driver)
    run = load_run(log)
    last = list(run.poses[TOPIC].blocks())[-1].value[-1]
    assert last[:3] == pytest.approx(position, abs=1e-4)
    assert rotation_angle_between(matrix_from_rotation_vector(last[3:].tolist()), turn) < 1e-3
    assert dict(scenario_of(log).arms[0].parameters)["interface"] == "vendor_2025", "a replay gives it to its driver"
    assert main(["compare", str(log), str(log)]) == 0
    assert main(["plot", str(log), "-o", str(tmp_path / "run.svg"), "-t", TOPIC]) == 0
    assert main(["export", str(log), "-t", TOPIC, "-o", str(tmp_path / "poses.csv")]) == 0
    assert "pose.orientation.w" in next(tmp_path.glob("poses*.csv")).read_text().splitlines()[0]
