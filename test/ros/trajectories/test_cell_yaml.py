"""A driver that starts with the yaml of a ros_control cell on the parameter server."""
import contextlib
import math

import pytest
import rospy
from action_bench import CONTROLLER, NAMES, START, Client, goal_of, point
from driver_bench import SimulatorProcess

REST = [0.0] * 6


@pytest.fixture
def cell(ros_node, driven_by):
    rospy.set_param(CONTROLLER, {"allow_partial_joints_goal": True, "joints": NAMES, "gains": {"joint_1": {"p": 100}},
                                 "constraints": {"goal_time": 2.0}})
    try:
        with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, driven_by(simulator) as arm:
            arm.wait_until_ready()
            assert arm.call("joint_move", pose=START, mvvelo=3.0, mvacc=12.0).ret == 1
            yield arm
    finally:
        rospy.delete_param(CONTROLLER)


def test_a_goal_for_some_joints_holds_the_others(cell):
    with contextlib.closing(Client()) as client:
        names = ["joint_5", "joint_1"]
        state, result = client.run(goal_of([point(1.0, [START[4] - 0.2, START[0] + 0.3], REST[:2])], names))
        assert state == "SUCCEEDED", result.error_string
        reached = [math.radians(q) for q in cell.simulator.state()["joint_position"]]
        wanted = list(START)
        wanted[0] += 0.3
        wanted[4] -= 0.2
        assert reached == pytest.approx(wanted, abs=1e-4)
