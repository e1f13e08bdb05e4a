#!/usr/bin/env python3
"""Pick and place, as clients of the maker's driver of 2025 do it: joint_move home, then linear_move to poses.

Fields that are not needed stay as they are; a linear motion is waited for by the position that tool_position shows.
Prints after each motion its name and 1 where it was accepted and seen to arrive.
"""
import math

import rospy
from geometry_msgs.msg import PoseStamped

from jaka_msgs.srv import Move, MoveRequest, SetIO, SetIORequest

HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
seen = {}


def feedback(message):
    position = message.pose.position
    scale = 1000.0 if abs(position.z) < 2.0 else 1.0
    seen["tcp_mm"] = [position.x * scale, position.y * scale, position.z * scale]


def move(client, name, pose, speed, acceleration, coord_mode):
    request = MoveRequest()
    request.pose = pose
    request.has_ref = False
    request.mvvelo = speed
    request.mvacc = acceleration
    request.coord_mode = coord_mode
    response = client(request)
    end = rospy.get_time() + 15.0
    while coord_mode and math.dist(seen["tcp_mm"], pose[:3]) > 15.0 and rospy.get_time() < end:
        rospy.sleep(0.05)
    is_there = not coord_mode or math.dist(seen["tcp_mm"], pose[:3]) <= 15.0
    print(name, int(response.ret == 1 and is_there), response.message, flush=True)


def grip(value):
    client = rospy.ServiceProxy("/jaka_driver/set_io", SetIO)
    print("grip", client(SetIORequest(signal="digital", type=0, index=1, value=value)).ret, flush=True)


rospy.init_node("pick_and_place", anonymous=True)
rospy.Subscriber("/jaka_driver/tool_position", PoseStamped, feedback)
for service in ("linear_move", "joint_move"):
    rospy.wait_for_service("/jaka_driver/" + service, timeout=60)
linear = rospy.ServiceProxy("/jaka_driver/linear_move", Move)
joint = rospy.ServiceProxy("/jaka_driver/joint_move", Move)
while "tcp_mm" not in seen and not rospy.is_shutdown():
    rospy.sleep(0.1)
move(joint, "home", HOME, 1.0, 4.0, 0)
x, y, z = seen["tcp_mm"]
turned = [math.pi, 0.0, 0.0]
for name, pose in (("above_pick", [x, y, z - 50.0]), ("pick", [x, y, z - 110.0])):
    move(linear, name, pose + turned, 150.0, 400.0, 1)
grip(1)
for name, pose in (("above_pick", [x, y, z - 50.0]), ("above_place", [x, y + 120.0, z - 50.0]),
                   ("place", [x, y + 120.0, z - 110.0])):
    move(linear, name, pose + turned, 150.0, 400.0, 1)
grip(0)
move(joint, "home", HOME, 1.0, 4.0, 0)
