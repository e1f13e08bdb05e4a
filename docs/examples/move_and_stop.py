#!/usr/bin/env python3
"""A client that begins to turn joint 1 by 3 rad, and stops the arm after a second, on the way. Ctrl-C stops it, too.

The driver must be running and the arm enabled, for instance by ``roslaunch jaka_ros_driver demo.launch``.
"""
import sys
import threading

import rospy
from std_srvs.srv import Empty

from jaka_msgs.srv import Move

DRIVER = "/jaka_driver"
START = [0.0, 1.5708, -1.5708, 1.5708, 1.5708, 0.0]  # rad, joint 1 (base) first
TARGET = [3.0] + START[1:]


def main() -> int:
    """Move and stop; 1 where the arm cannot move or somebody interrupts, with the reason on the screen."""
    rospy.init_node("move_and_stop", disable_signals=True)  # so that Ctrl-C is raised here
    for name in ("joint_move", "stop_move"):
        rospy.wait_for_service("%s/%s" % (DRIVER, name), timeout=10.0)
    joint_move = rospy.ServiceProxy(DRIVER + "/joint_move", Move)
    stop_move = rospy.ServiceProxy(DRIVER + "/stop_move", Empty)
    try:
        return move_and_stop(joint_move, stop_move)
    except KeyboardInterrupt:  # the arm goes on with a move whose caller has gone
        stop_move()
        print("interrupted")
        return 1


def move_and_stop(joint_move: rospy.ServiceProxy, stop_move: rospy.ServiceProxy) -> int:
    """Move to the start, begin to turn, stop; 1 where the arm cannot move."""
    # The call returns when the motion has ended: ret 1 at the target, ret 0 with the reason in message.
    answer = joint_move(pose=START, mvvelo=1.0, mvacc=3.0)  # rad/s, rad/s2
    print("to the start: %s" % answer.message, flush=True)
    if answer.ret != 1:
        return 1

    # Who wants to do something meanwhile makes the call in a thread of its own.
    answers = []
    moving = threading.Thread(target=lambda: answers.append(joint_move(pose=TARGET, mvvelo=0.3, mvacc=3.0)))
    moving.start()
    rospy.sleep(1.0)
    stop_move()  # served at once, also during a move; raises rospy.ServiceException where it could not be delivered
    moving.join()
    print("to the target: %s" % answers[0].message)
    return 0


if __name__ == "__main__":
    sys.exit(main())
