#!/usr/bin/env python3
"""A client that sends one joint trajectory: joint 1 to two points and back. Ctrl-C cancels it, on its path.

The driver must be running and the arm enabled, for instance by ``roslaunch jaka_ros_driver demo.launch``.
"""
import signal
import sys

import actionlib
import rospy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from jaka_ros_driver.ros.other_messages import message_type

CONTROLLER = "/jaka_zu7_controller"  # jaka_MODEL_controller
WAY = [(0.2, 1.5), (0.4, 3.0), (0.0, 4.5)]  # joint 1 from where it is, rad; when, s from the start

# That of control_msgs where it is installed (from control_msgs.msg import FollowJointTrajectoryAction), else the same
# made by the driver.
FollowJointTrajectoryAction = message_type("control_msgs/FollowJointTrajectoryAction")


def main() -> int:
    """Send the goal and wait for its end; 0 at the last point, 1 otherwise, with the reason on the screen."""
    rospy.init_node("follow_trajectory", disable_signals=True)  # Ctrl-C is this node's own
    client = actionlib.SimpleActionClient(CONTROLLER + "/follow_joint_trajectory", FollowJointTrajectoryAction)
    if not client.wait_for_server(rospy.Duration(10.0)):
        print("nobody offers %s/follow_joint_trajectory" % CONTROLLER)
        return 1
    start = rospy.wait_for_message("/joint_states", JointState, timeout=5.0)

    goal = client.action_client.ActionGoal().goal
    goal.trajectory.joint_names = list(start.name)
    for angle, seconds in WAY:
        goal.trajectory.points.append(JointTrajectoryPoint(
            positions=[start.position[0] + angle, *start.position[1:]], velocities=[0.0] * 6,
            time_from_start=rospy.Duration.from_sec(seconds)))
    goal.trajectory.header.stamp = rospy.Time()  # zero: begin at once
    # No exception, which could come between the goal and the wait for its end; no Event: a second Ctrl-C would wait for
    # its lock.
    interrupted = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    client.send_goal(goal)
    print("sent %d points" % len(WAY), flush=True)
    while not client.wait_for_result(rospy.Duration(0.1)):
        if interrupted:
            client.cancel_goal()
            client.wait_for_result(rospy.Duration(5.0))  # PREEMPTED comes when the arm rests
            break
    print("%s: %s" % (actionlib.GoalStatus.to_string(client.get_state()), client.get_goal_status_text()))
    return 0 if client.get_state() == actionlib.GoalStatus.SUCCEEDED else 1


if __name__ == "__main__":
    sys.exit(main())
