#!/usr/bin/env python3
"""Streams joint targets in servo mode: joint 1 swings out by 0.1 rad and back, 125 targets a second, for 4 s.

Ctrl-C ends the stream, and servo mode with it.

The driver must be running with ``interface`` documented (targets are absolute) and the arm enabled, for instance by
``roslaunch jaka_ros_driver demo.launch``.
"""
import math
import signal
import sys

import rospy
from sensor_msgs.msg import JointState

from jaka_msgs.srv import ServoMove, ServoMoveEnable

DRIVER = "/jaka_driver"
RATE_HZ = 125
SWING = 0.1  # rad
PERIOD_S = 2.0
DURATION_S = 4.0


def main() -> int:
    """Stream; 0 when every target was taken, 1 where one was refused or somebody interrupts."""
    rospy.init_node("stream_servo_targets", disable_signals=True)  # rospy ends at once, and calls no service then
    interrupted = []  # no Event: a second Ctrl-C would wait for its lock
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    for name in ("servo_move_enable", "servo_j"):
        rospy.wait_for_service("%s/%s" % (DRIVER, name), timeout=10.0)
    servo_mode = rospy.ServiceProxy(DRIVER + "/servo_move_enable", ServoMoveEnable)
    # One connection for the whole stream, not a new one for each target.
    servo_j = rospy.ServiceProxy(DRIVER + "/servo_j", ServoMove, persistent=True)

    answer = servo_mode(enable=True)
    if answer.ret != 1:
        print(answer.message)
        return 1
    # A stream begins where the arm is; a target that the arm cannot reach at once is refused.
    start = rospy.wait_for_message(DRIVER + "/joint_position", JointState, timeout=5.0).position
    rate = rospy.Rate(RATE_HZ)
    try:
        for step in range(int(DURATION_S * RATE_HZ) + 1):
            # 1 - cos begins and ends at rest: neither position nor speed jumps.
            angle = 0.5 * SWING * (1.0 - math.cos(2.0 * math.pi * step / (PERIOD_S * RATE_HZ)))
            answer = servo_j(pose=[start[0] + angle] + list(start[1:]))
            if answer.ret != 1:  # the driver has stopped the stream, or did not take this target: message says why
                print("target %d: %s" % (step, answer.message))
                return 1
            if interrupted:
                print("interrupted")
                return 1
            rate.sleep()
    finally:
        print(servo_mode(enable=False).message)
    print("%d targets" % (step + 1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
