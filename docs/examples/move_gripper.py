#!/usr/bin/env python3
"""A client that moves the gripper of ``~gripper`` (docs/gripper.md) to a position, in the unit of its joint."""
import argparse
import sys

import actionlib
import rospy

from jaka_ros_driver.ros.other_messages import message_type

ACTION = "/jaka_gripper_controller/gripper_cmd"

# That of control_msgs where it is installed (from control_msgs.msg import GripperCommandAction), else the same made by
# the driver.
GripperCommandAction = message_type("control_msgs/GripperCommandAction")


def main() -> int:
    """Send the goal and wait for its end; 0 where it is there or holds a work piece, 1 otherwise, with the reason."""
    parser = argparse.ArgumentParser()
    parser.add_argument("position", type=float, help="position, m or rad")
    words = parser.parse_args()
    rospy.init_node("move_gripper")
    client = actionlib.SimpleActionClient(ACTION, GripperCommandAction)
    if not client.wait_for_server(rospy.Duration(10.0)):
        print("nobody offers %s" % ACTION)
        return 1
    goal = client.action_client.ActionGoal().goal
    goal.command.position = words.position
    state = client.send_goal_and_wait(goal)
    result = client.get_result()
    print("%s at %.3f: %s" % (actionlib.GoalStatus.to_string(state), result.position, client.get_goal_status_text()))
    return 0 if state == actionlib.GoalStatus.SUCCEEDED else 1


if __name__ == "__main__":
    sys.exit(main())
