#!/usr/bin/env python3
"""A gripper on two outputs of the cabinet, as clients of the maker's driver work it: set_io, then get_io.

Prints one line for each step: the step, then 1 where the call was accepted and the output reads as it was set.
"""
import rospy

from jaka_msgs.srv import GetIO, GetIORequest, SetIO, SetIORequest

OPEN, CLOSE = 1, 2


def write_output(index, value):
    rospy.wait_for_service("jaka_driver/set_io", 60.0)
    client = rospy.ServiceProxy("jaka_driver/set_io", SetIO)
    request = SetIORequest()
    request.signal = "digital"
    request.type = 0
    request.index = index
    request.value = value
    return client(request).ret


def read_output(index):
    client = rospy.ServiceProxy("jaka_driver/get_io", GetIO)
    request = GetIORequest()
    request.signal = "digital"
    request.type = 0
    request.path = 1
    request.index = index
    return client(request).value


def step(name, outputs):
    accepted = [write_output(index, value) for index, value in outputs]
    end = rospy.get_time() + 5.0
    while [read_output(index) for index, _ in outputs] != [value for _, value in outputs] and rospy.get_time() < end:
        rospy.sleep(0.05)
    is_as_set = [read_output(index) for index, _ in outputs] == [value for _, value in outputs]
    print(name, int(accepted == [1, 1] and is_as_set), flush=True)


rospy.init_node("gripper_io")
step("open", [(CLOSE, False), (OPEN, True)])
step("closed", [(OPEN, False), (CLOSE, True)])
