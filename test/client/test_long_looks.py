"""The longest looks of the motion guard, on sockets: neither a stop nor the reading of the feed waits for one."""
import math
import time

import pytest
from waiting import InBackground, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.workspace import MOST_PAIRS, workspace_of
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import MotionInterrupted
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.trajectory.points import MAX_POINTS, JointTrajectory, TrajectoryPoint, TrajectoryTolerances

STOP_S = 0.5
"""Longest time of the processor, s, from the call of a stop until it is on the wire; a busy host's clock shows more.

A look takes seconds. Beside five other workers the other threads of this process have had up to 0.28 s meanwhile.
"""
ROUND = (-HOME[0] - 6.0,) + HOME[1:]
"""Once around the base: what stands around it evenly stays as near as it is."""
LARGEST = workspace_of({
    "cylinders": [{"name": "ring %d" % n, "foot": [0.0, 0.0, -1.0], "height": 4.0, "radius": 0.3 + 0.01 * n}
                  for n in range(MOST_PAIRS // 26)],
    "tool": [{"name": "rod %d" % n, "start": [0.0, 0.0, 0.0], "end": [0.0, 0.02 * n, 1.9], "radius": 0.02}
             for n in range(20)]})
"""A workspace of as many pairs as are taken, in most of which the arm stands: it may move along, no deeper."""


LOOKS = (MotionOwner.LOOK, MotionOwner.AUDIT)


def move(arm, is_begun):
    is_begun.append(True)
    arm.move(c.JointMove(ROUND, 0.5, 2.0))


def path(arm, is_begun):
    is_begun.append(True)
    arm.begin_path([c.JointMove(ROUND, 0.5, 2.0), c.JointMove(HOME, 0.5, 2.0)], lambda: False, lambda: None).result()


def trajectory(arm, is_begun):
    points = tuple([TrajectoryPoint(0.008 * (k + 1), tuple(
        [q + (math.sin(6e-4 * k) if joint == 0 else 0.0) for joint, q in enumerate(HOME)])) for k in range(MAX_POINTS)])
    is_begun.append(True)
    arm.follow(JointTrajectory(points), TrajectoryTolerances((None,) * 6, (None,) * 6, None)).result()


@pytest.mark.parametrize("begin", [move, path, trajectory])
def test_a_stop_beside_the_longest_look_is_on_the_wire_at_once_and_the_feed_is_read(bench, begin):
    one = bench()
    arm = one.connect(workspace=LARGEST, silence_timeout=10.0, reply_timeout=10.0, stale_after=8.0)  # of a busy host
    reads, begun = [], []
    arm.add_listener(lambda state, is_new: reads.append(time.thread_time()))
    looked = InBackground(begin, arm, begun)
    assert eventually(lambda: begun and (begin is trajectory or arm.motion_owner in LOOKS))
    count = len(reads)
    assert eventually(lambda: len(reads) > count + 30)
    assert not looked.is_over, "the look has ended too soon to show anything"
    assert max(b - a for a, b in zip(reads[count:], reads[count + 1:])) < STOP_S
    asked = time.process_time()
    stop = InBackground(arm.stop)
    assert eventually(lambda: one.requests("stop_program"))
    assert time.process_time() - asked < STOP_S
    error = looked.failure()
    assert isinstance(error, MotionInterrupted) and "it was asked for before the stop" in str(error), error
    stop.join()
    assert not one.times_of("joint_move") and not one.times_of("servo_j")
