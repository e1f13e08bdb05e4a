#!/usr/bin/env python3
"""A bridge from a topic to servo_j, as clients of the maker's driver have it: a timer of 125 Hz, a service to enable.

The newest increment of ``joint_increment`` is sent in each turn of the timer; where none has come for 0.1 s, two of
zero are sent and servo mode is left. Prints then the number of increments that were accepted, and of those refused.
"""
import threading

import rospy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, SetBoolResponse

from jaka_msgs.srv import ServoMove, ServoMoveEnable, ServoMoveEnableRequest, ServoMoveRequest


class Bridge:
    def __init__(self):
        self.lock = threading.Lock()
        self.sending = threading.Lock()
        self.is_enabled = False
        self.increment = None
        self.seen_at = rospy.Time(0)
        self.accepted = self.refused = 0
        rospy.wait_for_service("/jaka_driver/servo_move_enable", 60.0)
        rospy.wait_for_service("/jaka_driver/servo_j", 60.0)
        self.enable_client = rospy.ServiceProxy("/jaka_driver/servo_move_enable", ServoMoveEnable)
        self.servo_client = rospy.ServiceProxy("/jaka_driver/servo_j", ServoMove)
        rospy.Subscriber("joint_increment", Float64MultiArray, self.take, queue_size=1)
        rospy.Service("bridge_enable", SetBool, self.enable)
        rospy.Timer(rospy.Duration(1.0 / 125.0), self.turn)

    def take(self, message):
        with self.lock:
            self.increment = [max(-0.001, min(0.001, value)) for value in message.data]
            self.seen_at = rospy.Time.now()

    def enable(self, request):
        response = self.enable_client(ServoMoveEnableRequest(enable=request.data))
        with self.lock:
            self.is_enabled = request.data and response.ret == 1
            self.increment = None
            self.seen_at = rospy.Time.now() + rospy.Duration(1.0)
        return SetBoolResponse(response.ret == 1, response.message)

    def send(self, increment):
        request = ServoMoveRequest()
        request.pose = increment
        request.speed = []
        response = self.servo_client(request)
        if response.ret == 1:
            self.accepted += any(increment)
        else:
            self.refused += 1
            print(response.message, flush=True)

    def turn(self, _):
        with self.lock:
            is_enabled, increment, age = self.is_enabled, self.increment, rospy.Time.now() - self.seen_at
        if not is_enabled or increment is None and age < rospy.Duration(0.1) or not self.sending.acquire(False):
            return
        try:
            if increment is not None and age < rospy.Duration(0.1):
                self.send(increment)
                return
            self.is_enabled = False
            for _ in range(2):
                self.send([0.0] * 6)
            self.enable_client(ServoMoveEnableRequest(enable=False))
            print("end %d %d" % (self.accepted, self.refused), flush=True)
        finally:
            self.sending.release()


rospy.init_node("servo_bridge")
Bridge()
rospy.spin()
