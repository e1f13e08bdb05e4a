#!/usr/bin/python3
"""A cell's node that moves the arm in every way: moves, jog, servo stream, trajectory; a gripper between."""
import math
import time

import actionlib
import rospy
from std_srvs.srv import Empty
from trajectory_msgs.msg import JointTrajectoryPoint

from jaka_msgs.srv import GetIO, Move, ServoMove, ServoMoveEnable, SetIO, SetPayload
from jaka_ros_driver.ros.other_messages import message_type

GRIP = 1  # output: close the gripper
GRIPPED = 2  # input: the gripper holds a part
DIGITAL = "digital"
ABOVE = (0.3, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0)
UP = (364.4, 233.1, 373.1, 2.528465, -1.864529, 0.0)
DOWN = (364.4, 233.1, 313.1, 2.528465, -1.864529, 0.0)
BESIDE = (0.0, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0)
WAY = ((0.2, 1.5), (0.4, 3.0), (0.0, 4.5))  # joint 1 from where it is, rad; when, s
GOAL = message_type("control_msgs/FollowJointTrajectoryAction")


def call(name, kind, *values):
    rospy.wait_for_service("/jaka_driver/" + name)
    response = rospy.ServiceProxy("/jaka_driver/" + name, kind)(*values)
    if getattr(response, "ret", 1) != 1:
        raise SystemExit("%s: %s" % (name, response.message))


def joints(pose):
    call("joint_move", Move, pose, False, [], 0.8, 2.0, 0.0, 0.0, 0, 0)


def line(pose):
    call("linear_move", Move, pose, False, [], 100.0, 400.0, 0.0, 0.0, 0, 0)


def grip(on):
    call("set_io", SetIO, DIGITAL, 0, GRIP, on)


def wait_for(level):
    read = rospy.ServiceProxy("/jaka_driver/get_io", GetIO)
    while read("digital", 0, 0, GRIPPED).value != level:
        rospy.sleep(0.05)


def jog(index, speed, seconds):
    call("jog", Move, [], False, [], speed, 0.0, 0.0, 0.0, 1, index)
    rospy.sleep(seconds)
    call("stop_move", Empty)
    rospy.sleep(0.3)


def stream(amplitude, seconds):
    call("servo_move_enable", ServoMoveEnable, True)
    send = rospy.ServiceProxy("/jaka_driver/servo_j", ServoMove, persistent=True)
    begun = time.monotonic()
    count = int(125.0 * seconds)
    for number in range(count + 1):
        send(pose=[BESIDE[0] + amplitude * (1.0 - math.cos(2.0 * math.pi * number / count)), *BESIDE[1:]])
        time.sleep(max(0.0, begun + (number + 1) / 125.0 - time.monotonic()))
    rospy.sleep(0.3)
    call("servo_move_enable", ServoMoveEnable, False)


def follow(way):
    client = actionlib.SimpleActionClient("/jaka_zu7_controller/follow_joint_trajectory", GOAL)
    client.wait_for_server()
    goal = client.action_client.ActionGoal().goal
    goal.trajectory.joint_names = ["joint_%d" % (number + 1) for number in range(6)]
    for angle, seconds in way:
        goal.trajectory.points.append(JointTrajectoryPoint(
            positions=[BESIDE[0] + angle, *BESIDE[1:]], velocities=[0.0] * 6,
            time_from_start=rospy.Duration.from_sec(seconds)))
    client.send_goal_and_wait(goal)


rospy.init_node("pick_and_place")
call("set_payload", SetPayload, 1, 1.5, 0.0, 0.0, 50.0)
joints(ABOVE)
line(DOWN)
grip(1)
wait_for(1)
line(UP)
rospy.sleep(0.5)
joints(BESIDE)
grip(0)
wait_for(0)
jog(4, 40.0, 0.8)
joints(BESIDE)
stream(0.05, 2.0)
follow(WAY)
rospy.sleep(0.3)
