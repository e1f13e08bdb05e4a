#!/usr/bin/python3
"""A cell's node for the maker's driver: moves to a part, creeps towards it, switches an output.

argv: three numbers for the orientation of linear_move, as the maker's driver of the cell takes them.
"""
import sys

import rospy

from jaka_msgs.srv import GetIO, Move, ServoMove, ServoMoveEnable, SetIO

GRIPPER = 3


def call(name, kind, *values):
    rospy.wait_for_service("/jaka_driver/" + name, 60.0)
    response = rospy.ServiceProxy("/jaka_driver/" + name, kind)(*values)
    if response.ret != 1:
        raise SystemExit("%s: %s" % (name, response.message))


def servo(name, target):
    for _ in range(3):
        call(name, ServoMove, target, [])
        rospy.sleep(0.1)


rospy.init_node("move_part")
orientation = [float(word) for word in sys.argv[1:4]]
call("joint_move", Move, [0.0, 1.5, -1.5, 1.5, 1.5, 0.0], False, [], 1.0, 4.0, 0.0, 0.0, 0, 0)
call("linear_move", Move, [414.0, 87.0, 345.0] + orientation, False, [], 100.0, 400.0, 0.0, 0.0, 0, 0)
call("servo_move_enable", ServoMoveEnable, True)
servo("servo_j", [0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
call("servo_move_enable", ServoMoveEnable, False)
call("servo_move_enable", ServoMoveEnable, True)
servo("servo_p", [1.0, 0.0, -2.0, 0.0, 0.0, 0.0])
call("servo_move_enable", ServoMoveEnable, False)
call("set_io", SetIO, "digital", 0, GRIPPER, 1)
read = rospy.ServiceProxy("/jaka_driver/get_io", GetIO)("digital", 1, 0, GRIPPER)
print("output %d reads %g" % (GRIPPER, read.value))
