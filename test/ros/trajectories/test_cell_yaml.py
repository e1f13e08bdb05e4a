"""A driver that starts with the yaml of a ros_control cell on the parameter server."""
import contextlib
import math

import pytest
import rospy
from action_bench import CONTROLLER, NAMES, START, Client, goal_of, point, trajectory
from driver_bench import SimulatorProcess
from trajectory_msgs.msg import JointTrajectory
from waiting import eventually

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


def test_a_message_for_some_joints_stops_the_others_on_their_way(cell):
    publisher = rospy.Publisher(CONTROLLER + "/command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    with contextlib.closing(Client()) as client:
        running = client.send(goal_of([point(4.0, [q + 0.8 for q in START], REST)]))
        assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 1.5)
        publisher.publish(trajectory([point(4.0, [START[4]], REST[:1])], ["joint_5"]))
        assert client.end(running)[0] == "PREEMPTED"
        taken_over = client.feedback[-1].desired.positions[0]
        assert eventually(lambda: not cell.simulator.state()["is_servo_active"])
    reached = [math.radians(q) for q in cell.simulator.state()["joint_position"]]
    assert reached[4] == pytest.approx(START[4], abs=1e-4)
    assert taken_over < reached[0] < START[0] + 0.8, "it goes on a little, and does not come back"


def test_a_goal_for_some_joints_in_the_future_leaves_the_running_one_until_then(cell):
    def way():
        return [math.radians(q) - start for q, start in zip(cell.simulator.state()["joint_position"], START)]

    with contextlib.closing(Client()) as client:
        running = client.send(goal_of([point(1.0, [q + 0.2 for q in START], REST)]))
        assert eventually(lambda: client.feedback)
        some = goal_of([point(1.0, [START[4] - 0.1], REST[:1])], ["joint_5"])
        some.trajectory.header.stamp = rospy.Time.now() + rospy.Duration(2.0)
        waiting = client.send(some)
        assert client.end(running)[0] == "PREEMPTED"
        assert way() != pytest.approx([0.2] * 6, abs=1e-3), "its client is told at once, as ros_controllers tells it"
        assert eventually(lambda: way() == pytest.approx([0.2] * 6, abs=1e-4)), "the arm goes its way to the end"
        assert client.end(waiting)[0] == "SUCCEEDED"
    assert way() == pytest.approx([0.2] * 4 + [-0.1, 0.2], abs=1e-4)
