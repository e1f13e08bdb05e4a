"""Settings that are read back: the controller's "accepted" is not yet "set". Each returns a sentence for the user."""
import logging
import math
from typing import Any, Callable, Sequence

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.errors import CommandRejected, JakaError, ProtocolError
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import IoBank, RobotState

_LOG = logging.getLogger(__name__)

_TIMEOUT = 2.0
_LENGTH_TOLERANCE = 1e-5
_ANGLE_TOLERANCE = 1e-5
_MASS_TOLERANCE = 1e-4
_ANALOG_TOLERANCE = 0.01
NOT_VERIFIED = " (not verified: this controller cannot read it back)"


class ReadBackMismatch(JakaError):
    """The controller accepted a setting and holds another value."""


def set_tool_frame(arm: ArmClient, command: c.SetToolFrame, activate: bool) -> str:
    """Store a tool frame and, with ``activate``, make it the active one.

    Raises:
        ReadBackMismatch: The controller holds another pose, or the tool did not become active.
        JakaError: As ``ArmClient.execute``.
    """
    arm.execute(command)
    told = _compare(arm, c.Query.TOOL_FRAMES, "tool %d" % command.tool_id,
                    lambda frames: _pose_difference(command.pose, frames[command.tool_id]))
    if activate:
        select_tool(arm, command.tool_id)
    return "tool %d %s%s" % (command.tool_id, "set and active" if activate else "set", told)


def select_tool(arm: ArmClient, tool_id: int) -> None:
    """Make a stored tool the active one; errors as ``set_tool_frame``."""
    arm.execute(c.SelectTool(tool_id))
    _await(arm, lambda s: s.tool_id in (tool_id, None), lambda s: "tool %s is active, not %d" % (s.tool_id, tool_id))


def set_user_frame(arm: ArmClient, command: c.SetUserFrame, activate: bool) -> str:
    """Store a user frame and, with ``activate``, make it the active one; errors as ``set_tool_frame``."""
    arm.execute(command)
    told = _compare(arm, c.Query.USER_FRAMES, "user frame %d" % command.user_frame_id,
                    lambda frames: _pose_difference(command.pose, frames[command.user_frame_id]))
    if activate:
        arm.execute(c.SelectUserFrame(command.user_frame_id))
        _await(arm, lambda s: s.user_frame_id in (command.user_frame_id, None),
               lambda s: "user frame %s is active, not %d" % (s.user_frame_id, command.user_frame_id))
    return "user frame %d %s%s" % (command.user_frame_id, "set and active" if activate else "set", told)


def set_payload(arm: ArmClient, tool_id: int, command: c.SetPayload) -> str:
    """Select the tool and set the load at it; errors as ``set_tool_frame``."""
    select_tool(arm, tool_id)
    arm.execute(command)
    told = _compare(arm, c.Query.PAYLOAD, "payload", lambda held: _payload_difference(command, held))
    return "payload of tool %d set: %g kg%s" % (tool_id, command.mass, told)


def set_collision_level(arm: ArmClient, level: int) -> str:
    """Set the collision sensitivity, 0 off; errors as ``set_tool_frame``."""
    arm.execute(c.SetCollisionLevel(level))
    told = _compare(arm, c.Query.COLLISION_LEVEL, "collision level",
                    lambda held: "" if held == level else "level %d, not %d" % (held, level))
    return ("collision detection off" if level == 0 else "collision level %d" % level) + told


def set_hand_guiding(arm: ArmClient, active: bool) -> str:
    """Switch hand guiding; returns when the arm reports it.

    Raises:
        InvalidCommand: Something moves the arm, or it cannot be guided now.
        ReadBackMismatch: The controller accepted and the arm did not follow.
        JakaError: As ``ArmClient.execute``.
    """
    if active:
        if arm.fresh_state().is_hand_guided:
            return "hand guiding on"
        arm.require_free()
    arm.execute(c.SetHandGuiding(active))
    _await(arm, lambda s: s.is_hand_guided in (active, None),
           lambda s: "hand guiding is %s (event 0x%X %s)" % ("on" if s.is_hand_guided else "off", s.error_code,
                                                            s.error_message))
    return "hand guiding " + ("on" if active else "off")


def set_digital_output(arm: ArmClient, command: c.SetDigitalOutput) -> str:
    """Switch an output and see it switched; errors as ``set_tool_frame``."""
    arm.execute(command)
    told = _await_output(arm, lambda s: s.io.digital_outputs, command.bank, command.index, float(command.value), 0.0,
                         c.GetDigitalOutput(command.bank, command.index))
    return "digital output %d of %s is %d%s" % (command.index, command.bank.name.lower(), command.value, told)


def set_analog_output(arm: ArmClient, command: c.SetAnalogOutput) -> str:
    """Set an output and see it set; errors as ``set_tool_frame``."""
    arm.execute(command)
    told = _await_output(arm, lambda s: s.io.analog_outputs, command.bank, command.index, command.value,
                         _ANALOG_TOLERANCE, c.GetAnalogOutput(command.bank, command.index))
    return "analog output %d of %s is %g%s" % (command.index, command.bank.name.lower(), command.value, told)


def _compare(arm: ArmClient, query: c.Query, what: str, difference: Callable[[Any], str]) -> str:
    try:
        held = arm.execute(query)
        text = difference(held)
    except (CommandRejected, ProtocolError, IndexError) as error:
        _LOG.info("%s: %s", what, error)
        return NOT_VERIFIED
    if text:
        raise ReadBackMismatch("%s: the controller accepted it but holds %s" % (what, text))
    return ""


def _await(arm: ArmClient, holds: Callable[[RobotState], bool], otherwise: Callable[[RobotState], str]) -> None:
    if arm.status.wait_for(holds, _TIMEOUT) is None:
        raise ReadBackMismatch("the controller accepted it but " + otherwise(arm.fresh_state()))


def _await_output(arm: ArmClient, bank_of: Callable[[RobotState], Any], bank: IoBank, index: int, value: float,
                  tolerance: float, query: c.Command) -> str:
    """Look at the status feed, or ask where the feed does not carry the output."""
    values: Sequence[float] = bank_of(arm.fresh_state()).get(bank, ())
    if index < len(values):
        def is_set(state: RobotState) -> bool:
            return abs(float(bank_of(state)[bank][index]) - value) <= tolerance
        _await(arm, is_set, lambda s: "the output is %g" % bank_of(s)[bank][index])
        return ""
    try:
        held = float(arm.execute(query))
    except (CommandRejected, ProtocolError) as error:
        _LOG.info("%s", error)
        return NOT_VERIFIED
    if abs(held - value) > tolerance:
        raise ReadBackMismatch("the controller accepted it but the output is %g" % held)
    return ""


def _pose_difference(wanted: c.Pose, held: c.Pose) -> str:
    away = math.sqrt(sum((a - b) ** 2 for a, b in zip(wanted.position, held.position)))
    turn = rotation_angle_between(matrix_from_rpy(wanted.rpy), matrix_from_rpy(held.rpy))
    if away <= _LENGTH_TOLERANCE and turn <= _ANGLE_TOLERANCE:
        return ""
    return "a pose %.6f m and %.6f rad away" % (away, turn)


def _payload_difference(wanted: c.SetPayload, held: c.SetPayload) -> str:
    if abs(wanted.mass - held.mass) <= _MASS_TOLERANCE and all(
            abs(a - b) <= _LENGTH_TOLERANCE for a, b in zip(wanted.centroid, held.centroid)):
        return ""
    return "%g kg at %s m" % (held.mass, tuple(held.centroid))
