#!/usr/bin/env python3
"""The servo demo of the maker's driver, as a program of its own: servo mode on, 200 increments one after the other.

Servo mode is not left at the end. Prints the number of increments that were accepted, and the first refusal.
"""
import rospy

from jaka_msgs.srv import ServoMove, ServoMoveEnable, ServoMoveEnableRequest, ServoMoveRequest

rospy.init_node("client_test")
enable = rospy.ServiceProxy("/jaka_driver/servo_move_enable", ServoMoveEnable)
servo_j = rospy.ServiceProxy("/jaka_driver/servo_j", ServoMove)
servo_j.wait_for_service(60.0)
print("enabled", enable(ServoMoveEnableRequest(enable=True)).ret)
rospy.sleep(1.0)
request = ServoMoveRequest(pose=[0.001, 0.0, 0.0, 0.0, 0.0, 0.001])
responses = [servo_j(request) for _ in range(200)]
refusals = [response.message for response in responses if response.ret != 1]
print("accepted %d" % (len(responses) - len(refusals)))
print("\n".join(refusals[:1]))
