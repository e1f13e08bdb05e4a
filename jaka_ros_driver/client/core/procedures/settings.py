"""Procedures for settings that are read back: the controller's "accepted" is not yet "set".

Each returns a sentence for the user, which also says what else was changed.
"""
import logging
import math
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple, Type, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.contradictions import require_drives
from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Procedure, Until
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, JakaError, ProtocolError
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.state import RobotState, Vector

_TIMEOUT_S = 2.0
"""Longest time, s, until the feed shows what was set."""
_LENGTH_TOLERANCE, _ANGLE_TOLERANCE, _MASS_TOLERANCE, _ANALOG_TOLERANCE = 1e-5, 1e-5, 1e-4, 0.01
"""Largest differences, m, rad, kg, and V or mA, of what is read back from what was set: rounding on the wire."""
_OUTPUT_SETTLES_S = 0.1
"""Time, s, for which the other outputs are watched where an output had its value before, which may hide a wrong index.
"""
_ZERO_FORCE_N, _ZERO_TORQUE_N_M = 2.0, 0.2
"""Largest reading of a sensor at rest after it was zeroed; it is noisy, and no source gives a figure."""
NOT_VERIFIED = " (not verified: this controller cannot read it back)"


class ReadBackMismatch(JakaError):
    """The error that the controller accepted a setting and holds another value."""


def set_tool_frame(core: ArmCore, command: c.SetToolFrame, activate: bool) -> Procedure:
    """Store a tool frame and, with ``activate``, make it the active one.

    Raises:
        ReadBackMismatch: The controller holds another pose, or the tool did not become active.
        JakaError: As ``Ask``.
    """
    yield Ask(core.audited(command))
    told = yield from _compare(c.Query.TOOL_FRAMES, "tool %d" % command.tool_id,
                               lambda frames: _pose_difference(command.pose, frames[command.tool_id]))
    if not activate:
        return "tool %d set%s" % (command.tool_id, told)
    unseen, switched = yield from _select_tool(core, command.tool_id)
    return "tool %d set and active%s%s" % (command.tool_id, unseen or told, switched)


def set_user_frame(core: ArmCore, command: c.SetUserFrame, activate: bool) -> Procedure:
    """Store a user frame and, with ``activate``, make it the active one; errors as ``set_tool_frame``."""
    yield Ask(core.audited(command))
    told = yield from _compare(c.Query.USER_FRAMES, "user frame %d" % command.user_frame_id,
                               lambda frames: _pose_difference(command.pose, frames[command.user_frame_id]))
    if not activate:
        return "user frame %d set%s" % (command.user_frame_id, told)
    before = core.fresh_state((yield Now())).user_frame_id
    yield Ask(core.audited(c.SelectUserFrame(command.user_frame_id)))
    unseen = yield from _await(core, lambda s: s.user_frame_id, command.user_frame_id, "user frame")
    return "user frame %d set and active%s%s" % (
        command.user_frame_id, unseen or told, _switched("user frame", before, command.user_frame_id))


def set_payload(core: ArmCore, tool_id: int, command: c.SetPayload) -> Procedure:
    """Select the tool and set the load at it; errors as ``set_tool_frame``."""
    core.audited(command)
    unseen, switched = yield from _select_tool(core, tool_id)
    yield Ask(command)
    told = yield from _compare(c.Query.PAYLOAD, "payload", lambda held: _payload_difference(command, held))
    return "payload of tool %d set: %g kg%s%s" % (tool_id, command.mass, told or unseen, switched)


def set_collision_level(core: ArmCore, level: int) -> Procedure:
    """Set the collision sensitivity, 0 off; errors as ``set_tool_frame``."""
    yield Ask(core.audited(c.SetCollisionLevel(level)))
    told = yield from _compare(c.Query.COLLISION_LEVEL, "collision level",
                               lambda held: "" if held == level else "level %d, not %d" % (held, level))
    return ("collision detection off" if level == 0 else "collision level %d" % level) + told


class HeldSettings(NamedTuple):
    """The settings that the controller holds; None for what it does not tell.

    Attributes:
        tool_id: The active tool.
        user_frame_id: The active user frame.
        tools: Tool frames in the flange, by id.
        user_frames: User frames in the base, by id.
        payload: The load at the active tool.
        collision_level: 0 (off) to 5.
    """

    tool_id: Optional[int]
    user_frame_id: Optional[int]
    tools: Optional[Tuple[c.Pose, ...]]
    user_frames: Optional[Tuple[c.Pose, ...]]
    payload: Optional[c.SetPayload]
    collision_level: Optional[int]


def held(core: ArmCore) -> Procedure:
    """Ask the controller for its settings; return HeldSettings. Nothing is changed; raise as ``Ask`` does."""
    answers: List[Any] = []
    for query in (c.Query.TOOL_FRAMES, c.Query.USER_FRAMES, c.Query.PAYLOAD, c.Query.COLLISION_LEVEL):
        try:
            answers.append((yield Ask(query)))
        except (CommandRejected, ProtocolError):
            answers.append(None)
    state = core.fresh_state((yield Now()))  # after the answers: what became active meanwhile counts
    return HeldSettings(state.tool_id, state.user_frame_id, *answers)


def set_hand_guiding(core: ArmCore, active: bool) -> Procedure:
    """Switch hand guiding; end when the arm reports it.

    Raises:
        InvalidCommand: The arm cannot be guided now.
        ReadBackMismatch: The controller accepted and the arm did not follow.
        JakaError: As ``Ask``.
    """
    core.note_disturbance("a call of drag_mode")
    if active:
        state = core.fresh_state((yield Now()))
        if state.is_hand_guided:
            return "hand guiding on"
        require_drives(state)
    yield Ask(c.SetHandGuiding(active))
    core.hand_guiding_was_set(active)
    told = yield from _await(core, lambda s: s.is_hand_guided, active, "hand guiding", c.Query.HAND_GUIDING)
    return "hand guiding %s%s" % ("on" if active else "off", told)


def set_digital_output(core: ArmCore, command: c.SetDigitalOutput) -> Procedure:
    """Switch an output and check that it is switched, and no other in its place; raise as ``set_tool_frame`` does."""
    told = yield from _set_output(core, command, c.GetDigitalOutput, 0.0)
    return "digital output %d of %s is %d%s" % (command.index, command.bank.name.lower(), command.value, told)


def set_analog_output(core: ArmCore, command: c.SetAnalogOutput) -> Procedure:
    """Set an output and check that it is set, and no other in its place; raise as ``set_tool_frame`` does."""
    told = yield from _set_output(core, command, c.GetAnalogOutput, _ANALOG_TOLERANCE)
    return "analog output %d of %s is %g%s" % (command.index, command.bank.name.lower(), command.value, told)


def zero_force_sensor(core: ArmCore) -> Procedure:
    """Zero the force sensor and check that it reads about zero.

    Raises:
        InvalidCommand: The status feed shows no sensor, or the sensor reports an error.
        ReadBackMismatch: The controller accepted and the sensor still reads more.
        JakaError: As ``Ask``.
    """
    state = core.fresh_state((yield Now()))
    if state.wrench is None:
        raise InvalidCommand("the force sensor reports error %d" % state.sensor_error if state.sensor_error
                             else "the status feed shows no force sensor")
    yield Ask(c.ZeroForceSensor())
    yield from _await_feed(core, _reads_zero, lambda s: "the sensor reads %s" % (
        "nothing" if s.wrench is None else "%.3g %.3g %.3g N, %.3g %.3g %.3g N m" % s.wrench))
    return "the force sensor reads zero"


def _reads_zero(state: RobotState) -> bool:
    return (state.wrench is not None and math.hypot(*state.wrench[:3]) <= _ZERO_FORCE_N
            and math.hypot(*state.wrench[3:]) <= _ZERO_TORQUE_N_M)


def _select_tool(core: ArmCore, tool_id: int) -> Procedure:
    """Make a tool the active one; return two texts: whether that was not verified, and which one was active before."""
    before = core.fresh_state((yield Now())).tool_id
    yield Ask(core.audited(c.SelectTool(tool_id)))
    unseen = yield from _await(core, lambda s: s.tool_id, tool_id, "tool")
    return unseen, _switched("tool", before, tool_id)


def _switched(what: str, before: Optional[int], now: int) -> str:
    """Return in words that another tool or user frame is active than before; "" where it is the same.

    before: The active one before; None where the controller does not report it.
    """
    if before is None:
        return "; the active %s should now be %d" % (what, now)
    return "" if before == now else "; the active %s is now %d, and was %d" % (what, now, before)


def _compare(query: c.Query, what: str, difference: Callable[[Any], str]) -> Procedure:
    try:
        text = difference((yield Ask(query)))
    except (CommandRejected, ProtocolError, IndexError):
        return NOT_VERIFIED
    if text:
        raise ReadBackMismatch("%s: the controller accepted it but holds %s" % (what, text))
    return ""


def _await(core: ArmCore, read: Callable[[RobotState], Optional[float]], wanted: float, what: str,
           query: Optional[c.Query] = None) -> Procedure:
    """Wait until the feed shows the value; where it does not carry it, ask, or return that it was not verified."""
    if read(core.fresh_state((yield Now()))) is None:
        return (yield from _ask_instead(query, wanted, what)) if query is not None else NOT_VERIFIED
    yield from _await_feed(core, lambda s: read(s) == wanted, lambda s: "%s is %s, not %s (%s)" % (
        what, read(s), wanted, "event 0x%X %s" % (s.error_code, s.error_message)))
    return ""


def _ask_instead(query: c.Command, wanted: float, what: str, tolerance: float = 0.0) -> Procedure:
    try:
        held = yield Ask(query)
    except (CommandRejected, ProtocolError):
        return NOT_VERIFIED
    if abs(float(held) - float(wanted)) > tolerance:
        raise ReadBackMismatch("the controller accepted it but %s is %s" % (what, held))
    return ""


def _await_feed(core: ArmCore, holds: Callable[[RobotState], bool],
                otherwise: Callable[[RobotState], str]) -> Procedure:
    if not (yield from core.seen(holds, _TIMEOUT_S)):
        raise ReadBackMismatch("the controller accepted it but " + otherwise(core.fresh_state((yield Now()))))


def _set_output(core: ArmCore, command: Union[c.SetDigitalOutput, c.SetAnalogOutput],
                query: Type[Union[c.GetDigitalOutput, c.GetAnalogOutput]], tolerance: float) -> Procedure:
    """Set the output and check it in the status feed, or ask where the feed does not carry the output.

    Controllers may count from 0 or from 1: a neighbour that takes the value instead is an error that names both, or,
    with ``takes_io_as_counted``, the output that was meant.
    """
    index, value = command.index, float(command.value)

    def held_by(state: RobotState) -> Vector:
        return state.io.values(command.bank, isinstance(command, c.SetDigitalOutput), True) or ()

    def holds(state: RobotState, place: int) -> bool:
        held = held_by(state)
        return 0 <= place < len(held) and abs(held[place] - value) <= tolerance

    core.audited(command)
    before = core.fresh_state((yield Now()))
    sent = index + core.channel.io_index_base
    meant = (sent, sent - 1) if core.settings.takes_io_as_counted else (index,)
    neighbours = () if core.settings.takes_io_as_counted else (index - 1, index + 1)
    awaited = [place for place in meant if not holds(before, place)]
    wrong = [place for place in neighbours if not holds(before, place)]
    had_it = len(awaited) < len(meant)
    yield Ask(command)
    if min(meant) >= len(held_by(before)):
        return (yield from _ask_instead(query(command.bank, index), value, "the output", tolerance))
    begun = yield Now()

    def first_of(places: Sequence[int], state: RobotState) -> Optional[int]:
        return next((place for place in places if holds(state, place)), None)

    def is_seen(now: float) -> bool:
        state = core.state
        if state is None or state.received_at <= begun:
            return False
        if first_of(awaited, state) is not None:
            return True
        return had_it and (first_of(wrong, state) is not None or now - begun > _OUTPUT_SETTLES_S)

    is_set = yield Until(is_seen, _TIMEOUT_S)
    state = core.fresh_state((yield Now()))
    other = first_of(wrong, state)
    if other is not None and (had_it or not is_set):
        raise ReadBackMismatch("the controller accepted output %d and set output %d instead: it counts otherwise, see "
                               "the parameter ~io_index_base" % (index, other))
    if not is_set:
        raise ReadBackMismatch("the controller accepted it but the output is %s" % " and ".join(
            "%g" % held_by(state)[place] for place in sorted(meant) if 0 <= place < len(held_by(state))))
    _report_output(core, command, sent, held_by(before), held_by(state))
    return ""


def _report_output(core: ArmCore, command: Union[c.SetDigitalOutput, c.SetAnalogOutput], sent: int, before: Vector,
                   after: Vector) -> None:
    """Log, once for each connection, which terminal the status frame shows to have changed with the first output."""
    changed = ["terminal %d from %g to %g" % (place, was, is_now)
               for place, (was, is_now) in enumerate(zip(before, after)) if was != is_now]
    if changed and not core.links.is_output_reported:
        core.links.is_output_reported = True
        core.actions.log(logging.INFO, "the first output that was set: index %d of %s, on the wire %d; in the status "
                         "frame, which is counted from 0, changed %s" % (
                             command.index, command.bank.name.lower(), sent, ", ".join(changed)))


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


