#!/usr/bin/python3
"""A cell's node: picks a part, waits for the gripper's answer, places it."""
import rospy

from jaka_msgs.srv import GetIO, Move, SetIO

GRIP = 1  # output: close the gripper
GRIPPED = 2  # input: the gripper holds a part
ABOVE = (0.3, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0)
UP = (364.4, 233.1, 373.1, 2.528465, -1.864529, 0.0)
DOWN = (364.4, 233.1, 313.1, 2.528465, -1.864529, 0.0)
BESIDE = (0.0, 1.5707963, -1.5707963, 1.5707963, 1.5707963, 0.0)


def call(name, kind, *values):
    rospy.wait_for_service("/jaka_driver/" + name)
    response = rospy.ServiceProxy("/jaka_driver/" + name, kind)(*values)
    if response.ret != 1:
        raise SystemExit("%s: %s" % (name, response.message))


def joints(pose):
    call("joint_move", Move, pose, False, [], 0.8, 2.0, 0.0, 0.0, 0, 0)


def line(pose):
    call("linear_move", Move, pose, False, [], 100.0, 400.0, 0.0, 0.0, 0, 0)


def grip(on):
    call("set_io", SetIO, "digital", 0, GRIP, on)


def wait_for(level):
    read = rospy.ServiceProxy("/jaka_driver/get_io", GetIO)
    while read("digital", 0, 0, GRIPPED).value != level:
        rospy.sleep(0.05)


rospy.init_node("pick_and_place")
joints(ABOVE)
line(DOWN)
grip(1)
wait_for(1)
line(UP)
joints(BESIDE)
grip(0)
wait_for(0)
