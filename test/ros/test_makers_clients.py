"""Programs as people wrote them for the maker's driver, against this one: the same order of calls, types and names.

Four patterns of published ROS 1 clients, written anew (``test/data/clients``): a gripper on outputs, a bridge from a
topic to servo_j at 125 Hz, pick and place, the servo demo.
"""
import contextlib
import os
import subprocess
import sys

import pytest
import rospy
from action_bench import Client, goal_of, point
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from waiting import WAIT, eventually

CLIENTS = ROOT / "test" / "data" / "clients"


@contextlib.contextmanager
def arm_of(interface):
    """Run a simulated controller whose arm is at HOME, and the driver with the interface of the maker's; yield it."""
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        with DriverProcess(interface=interface, **on(simulator, guard=False)):
            arm = Arm(simulator)
            arm.wait_until_ready()
            arm.go_home()
            yield arm


def start(name):
    return subprocess.Popen([sys.executable, str(CLIENTS / name)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            text=True, env=dict(os.environ))


def said_by(name):
    said, _ = start(name).communicate(timeout=4 * WAIT)
    return said


def joints(arm):
    """Return the controller's joint positions, degrees."""
    assert eventually(lambda: not arm.simulator.is_moving())
    return arm.simulator.state()["joint_position"]


@pytest.mark.parametrize("interface", ["vendor", "vendor_2025"])
def test_a_gripper_script_opens_and_closes_by_outputs(ros_node, interface):
    with arm_of(interface) as arm:
        assert said_by("gripper_io.py").split() == ["open", "1", "closed", "1"]
        first = 1 if interface == "vendor_2025" else 0
        outputs = arm.simulator.state()["digital_outputs"]
        assert [place for place, value in enumerate(outputs) if value] == [2 + first]


@pytest.mark.parametrize("interface", ["vendor", "vendor_2025"])
def test_the_servo_demo_moves_by_each_increment_that_was_accepted(ros_node, interface):
    with arm_of(interface) as arm:
        before = joints(arm)
        said = said_by("servoj_demo.py")
        assert "enabled 1" in said and "accepted 200" in said, said
        turned = [after - start for after, start in zip(joints(arm), before)]
        assert turned == pytest.approx([11.459, 0, 0, 0, 0, 11.459], abs=0.01)  # 200 times 0.001 rad


def test_a_bridge_from_a_topic_moves_by_its_increments_and_leaves_servo_mode_when_they_end(ros_node):
    with arm_of("vendor") as arm:
        before = joints(arm)
        bridge = start("servo_bridge.py")
        try:
            rospy.wait_for_service("/bridge_enable", WAIT)
            publisher = rospy.Publisher("/joint_increment", Float64MultiArray, queue_size=1)
            assert eventually(lambda: publisher.get_num_connections() > 0)
            answer = rospy.ServiceProxy("/bridge_enable", SetBool)(True)
            assert answer.success, answer.message
            rate = rospy.Rate(60)
            for _ in range(60):
                publisher.publish(Float64MultiArray(data=[0.002, 0.0, 0.0, 0.0, 0.0, -0.0005]))
                rate.sleep()  # the rate of a stream
            line = bridge.stdout.readline()
            assert line.startswith("end "), line
        finally:
            bridge.terminate()
            bridge.communicate(timeout=WAIT)
        accepted, refused = map(int, line.split()[1:])
        turned = [after - start for after, start in zip(joints(arm), before)]
        assert refused == 0 and accepted > 20
        assert turned == pytest.approx([accepted * 0.0573, 0, 0, 0, 0, -accepted * 0.02865], abs=0.05)
        assert arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1, "servo mode is left"


def test_a_goal_whose_second_point_comes_at_once_is_refused_with_joint_and_time(ros_node):
    # a published client sends the present position, and the target 100 ns later
    with arm_of("vendor") as arm:
        client = Client()
        state, result = client.end(client.send(goal_of([point(0.0, HOME), point(1e-7, [0.5, *HOME[1:]])])))
        assert state == "REJECTED" and "joint" in result.error_string, (state, result)
        assert joints(arm) == pytest.approx([0, 85.944, -85.944, 85.944, 85.944, 0], abs=0.01)


def test_pick_and_place_arrives_at_each_pose(ros_node):
    with arm_of("vendor_2025") as arm:
        said = said_by("pick_and_place.py").splitlines()
        steps = [line.split()[:2] for line in said]
        assert steps == [[name, "1"] for name in (
            "home", "above_pick", "pick", "grip", "above_pick", "above_place", "place", "grip", "home")], said
        assert joints(arm) == pytest.approx([0, 85.944, -85.944, 85.944, 85.944, 0], abs=0.01)
