"""Moves whose link is lost: they end at once, the arm is stopped once, and nothing resumes.

The driver's core and the simulated controller run in virtual time.
"""
import math

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.errors import InvalidCommand, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME

SLOW_MOVE = c.JointMove((3.0,) + HOME[1:], 0.2, 4.0)
NEVER_BY_ITSELF = {"power_on", "enable_robot", "clear_error"}
RECONNECTS_IN_S = 0.101
"""Time until a lost port is connected again, s: the driver's pause of 0.1 s, and 1 ms to connect."""
BRAKES_IN_S = 0.1
"""Longest time in which the arm brakes from 0.2 rad/s after a stop, s."""
AFTERWARDS_S = 60.0
"""Time over which nothing may resume, s; the slow move takes 15 s."""


def moving(**options):
    """Return an arm in mid move, and the call of the move."""
    arm = SimulatedArm(load_model("zu7"), HOME, **options)
    move = arm.begin("move", SLOW_MOVE, True)
    arm.until(lambda: arm.is_moving)
    return arm, move


@pytest.mark.parametrize("port, stopped_after", [(Port.COMMAND, RECONNECTS_IN_S), (Port.STATUS, 0.0)])
def test_a_link_lost_in_mid_move_ends_the_move_and_stops_the_arm(port, stopped_after):
    arm, move = moving()
    lost_at = arm.now
    arm.cut(port)
    assert arm.ended(move).cause is StopCause.LINK_LOST
    assert move.ended_at == lost_at
    arm.until(lambda: arm.core.is_ready(arm.now))
    arm.run(AFTERWARDS_S)
    stop, = arm.times_of("stop_program")
    assert stop == pytest.approx(lost_at + stopped_after, abs=1e-9)
    assert arm.rest_after(lost_at) <= stop + BRAKES_IN_S
    assert len(arm.times_of("joint_move")) == 1


def test_after_a_reboot_in_mid_move_nothing_resumes():
    arm, move = moving(dialect={"power_delay": 0.1, "enable_delay": 0.1})
    struck_at = arm.now
    arm.restart(0.5)
    assert arm.ended(move).cause is StopCause.LINK_LOST
    assert move.ended_at == struck_at
    arm.until(lambda: arm.core.is_ready(arm.now))
    error = arm.ended(arm.begin("move", SLOW_MOVE, True))
    assert isinstance(error, InvalidCommand) and "no power" in str(error)
    place = arm.joints
    arm.run(AFTERWARDS_S)
    names = [request["cmdName"] for _, request in arm.sent]
    assert names.count("joint_move") == 1 and NEVER_BY_ITSELF.isdisjoint(names)
    assert arm.joints == place and not math.isinf(arm.rest_after(struck_at))
