"""Procedures for the zones that the motion guard keeps: read them, and have others kept."""
import logging

from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.procedures.steps import Now, Procedure


def kept(core: ArmCore) -> Procedure:
    """Return the workspace that is kept now."""
    yield Now()
    return core.custody.motion_check.workspace


def keep(core: ArmCore, guard: MotionGuard) -> Procedure:
    """Have the zones and the tool of this guard kept; run it exclusively.

    An arm that is in trouble there may move out, so that is no reason to refuse them.

    Returns:
        What the arm is too near to where it stands, in words; "" for nothing.

    Raises:
        ConnectionLost: Nobody knows where the arm stands; nothing was changed.
    """
    trouble = guard.trouble(core.fresh_state((yield Now())).joint_position)
    core.custody.motion_check.keep(guard)
    core.actions.log(logging.INFO, "the motion guard now keeps %s" % guard.workspace.summary())
    return trouble
