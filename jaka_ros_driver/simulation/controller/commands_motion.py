"""Commands that move the arm: moves, jog, servo, hand guiding (docs/controller-protocol.md sections 5.2 to 5.8)."""
from typing import Callable, Optional, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.simulation.arm.events import PlantEvent, TargetRejected
from jaka_ros_driver.simulation.arm.plant import JogMode, ServoFilter
from jaka_ros_driver.simulation.arm.servo_filters import PARAMETERS
from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, Held, plain, slow_reply
from jaka_ros_driver.simulation.controller.replies import SERVO_ONLY, CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.controller.wire_units import pose_from_wire
from jaka_ros_driver.units import all_deg_to_rad, deg_to_rad, mm_to_m

_JOG_FRAMES = {0: JogFrame.BASE, 1: JogFrame.JOINT, 2: JogFrame.TOOL}
_JOG_STOP = 0
MIN_RATE = 1e-3
"""Lowest speed and acceleration accepted, mm or deg per s or s2; with lower ones a move would take days."""
_RAPID_RATE_DECIMALS = 4


def _move(command: str, queue: Callable[[ControllerState, Arguments], bool]) -> Handler:
    """Return the handler of a queued move; one that is refused latches no error."""
    def handle(state: ControllerState, arguments: Arguments) -> None:
        state.require_motion(command)
        try:
            queue(state, arguments)
        except TargetRejected as error:
            state.move_refused(PlantEvent(error.event_code, error.reason))
            raise
        state.moved()
    return handle


def _rate(arguments: Arguments, key: str) -> float:
    """Return a speed or acceleration; its sign is not checked here."""
    rate = arguments.number(key)
    if abs(rate) < MIN_RATE:
        raise CommandRefused()
    return rate


def _optional_rate(arguments: Arguments, key: str, to_si: Callable[[float], float]) -> Optional[float]:
    return to_si(_rate(arguments, key)) if arguments.has(key) else None


def _line(arguments: Arguments) -> int:
    return arguments.integer("executing_line_id", 0)


def _joint_move(state: ControllerState, arguments: Arguments) -> bool:
    tolerance = mm_to_m(arguments.number("tol", 0.0))
    return state.plant.add_joint_move(
        all_deg_to_rad(arguments.vector("jointPosition", 6)), deg_to_rad(_rate(arguments, "speed")),
        _optional_rate(arguments, "accel", deg_to_rad), arguments.flag("relFlag", False), _line(arguments), tolerance)


def _end_move(state: ControllerState, arguments: Arguments) -> bool:
    return state.plant.add_end_move(
        pose_from_wire(arguments.vector("endPosition", 6)), deg_to_rad(_rate(arguments, "speed")),
        _optional_rate(arguments, "accel", deg_to_rad), _line(arguments))


def _linear_move(state: ControllerState, arguments: Arguments) -> bool:
    return state.plant.add_linear_move(
        pose_from_wire(arguments.vector("cartPosition", 6)), mm_to_m(_rate(arguments, "speed")),
        _optional_rate(arguments, "accel", mm_to_m), arguments.flag("relFlag", False),
        mm_to_m(arguments.number("tol", 0.0)), _optional_rate(arguments, "ori_vel", deg_to_rad),
        _optional_rate(arguments, "ori_acc", deg_to_rad), _line(arguments))


def _arc_move(state: ControllerState, arguments: Arguments) -> bool:
    arguments.number("tol", 0.0)
    return state.plant.add_arc_move(
        pose_from_wire(arguments.vector("pos_mid", 6)), pose_from_wire(arguments.vector("pos_end", 6)),
        mm_to_m(_rate(arguments, "speed")), _optional_rate(arguments, "accel", mm_to_m),
        arguments.flag("relFlag", False), arguments.integer("circle_cnt", 0), arguments.integer("circle_mode", 0),
        _line(arguments))


def _jog(state: ControllerState, arguments: Arguments) -> None:
    mode = arguments.integer("jog_mode")
    coord_map, axis = arguments.integer("coord_map", 1), arguments.integer("jnum", 0)
    if mode == _JOG_STOP:
        state.stop_jog(_JOG_FRAMES.get(coord_map), axis)
        return
    velocity = _rate(arguments, "jogvel")
    position = arguments.number("poscmd") if mode in (JogMode.STEP, JogMode.ABSOLUTE) else None
    if mode not in tuple(JogMode) or coord_map not in _JOG_FRAMES or not 0 <= axis < 6:
        raise CommandRefused()
    frame = _JOG_FRAMES[coord_map]
    to_si = mm_to_m if frame is not JogFrame.JOINT and axis < 3 else deg_to_rad
    state.require_motion("jog")
    if state.plant.jog(JogMode(mode), frame, axis, to_si(velocity), None if position is None else to_si(position)):
        state.jogged(frame, axis)


def _servo_move(state: ControllerState, arguments: Arguments) -> None:
    if not arguments.flag("relFlag"):
        state.plant.leave_servo()
        return
    state.require_drives()
    if not state.plant.is_servo_active:
        state.plant.enter_servo()


def _servo_point(vendor_name: str, append: Callable[[ControllerState, Arguments, bool, int], bool]) -> Handler:
    """Return the handler of a servo point, refused outside servo mode; one over 180 deg/s is ignored."""
    def handle(state: ControllerState, arguments: Arguments) -> None:
        relative, cycles = arguments.flag("relFlag", False), arguments.integer("stepNum", 1)
        if not state.plant.takes_servo_points:
            raise CommandRefused("-1", SERVO_ONLY % vendor_name)
        state.require_drives()
        append(state, arguments, relative, cycles)
    return handle


def _servo_joint(state: ControllerState, arguments: Arguments, relative: bool, cycles: int) -> bool:
    return state.plant.servo_joint(all_deg_to_rad(arguments.vector("jointPosition", 6)), relative, cycles)


def _servo_pose(state: ControllerState, arguments: Arguments, relative: bool, cycles: int) -> bool:
    return state.plant.servo_pose(pose_from_wire(arguments.vector("catPosition", 6)), relative, cycles)


def _filter_parameter(arguments: Arguments, key: str) -> float:
    """Return one parameter of a servo filter in SI units.

    On the wire ``nlf_max_?r`` are in deg, ``nlf_max_?p`` in mm.
    """
    rate = _rate(arguments, key)
    if not key.startswith("nlf"):
        return rate
    return deg_to_rad(rate) if key.endswith("r") else mm_to_m(rate)


def _set_servo_filter(state: ControllerState, arguments: Arguments) -> None:
    number = arguments.integer("filter_type")
    if number not in tuple(ServoFilter):
        raise CommandRefused()
    kind = ServoFilter(number)
    parameters = {key: _filter_parameter(arguments, key) for key in PARAMETERS[kind]}
    if state.plant.is_servo_active:
        raise CommandRefused("-1", "set_servo_move_filter command can not be excuted in servo move mode")
    state.plant.set_servo_filter(kind, **parameters)


def _hand_guiding(state: ControllerState, arguments: Arguments) -> Optional[Held]:
    active, dialect = arguments.flag("enable_flag"), state.dialect
    done_at = state.now + dialect.drag_delay
    state.command_hand_guiding(active)
    return slow_reply(state, dialect.drag_reply, dialect.drag_reply_delay, lambda: state.now >= done_at,
                      lambda: state.plant.is_hand_guided is not active)


def _motion_planner(state: ControllerState, arguments: Arguments) -> None:
    """Set the profile of later moves and jogs.

    0 is the trapezoid; -1 (off) and 1 are the S-curve, where ruckig is installed.
    """
    kind = arguments.integer("type")
    if kind not in (-1, 0, 1):
        raise CommandRefused()
    state.memory.settings["set_motion_planner", 0] = {"type": kind}
    state.plant.queue.jerk_limited = kind != 0


def _motion_state(state: ControllerState) -> Reply:
    plant = state.plant
    motion_line, add_error_line = state.executing_lines()
    return {"inpos": state.in_position, "paused": state.is_paused, "queue": plant.queue.length,
            "active_queue": min(1, plant.queue.length), "motion_line": motion_line, "err_add_line": add_error_line,
            "queue_full": False, "isOnLimit": plant.on_soft_limit, "isInEstop": state.emergency_stop,
            "isInCollision": state.protective_stop}


def _torque_feedforward(state: ControllerState, arguments: Arguments) -> None:
    """Store the torque feedforward, without effect: the simulated arm has no dynamics."""
    state.memory.settings["torque_feedforward", 0] = {
        "grvCurrent": list(arguments.vector("grvCurrent", 6)), "includeGrvFlag": arguments.integer("includeGrvFlag", 0)}


MOTION_COMMANDS: Tuple[CommandSpec, ...] = (
    CommandSpec("joint_move", "5.2", _move("joint_move", _joint_move)),
    CommandSpec("end_move", "5.3", _move("end_move", _end_move)),
    CommandSpec("moveL", "5.4.1", _move("moveL", _linear_move)),
    CommandSpec("movc", "5.4.2", _move("movc", _arc_move)),
    CommandSpec("set_motion_planner", "5.4.3", _motion_planner),
    CommandSpec("stop_program", "5.4.4", plain(ControllerState.stop_program)),
    CommandSpec("pause_program", "5.4.5", plain(ControllerState.pause_program)),
    CommandSpec("resume_program", "5.4.5", plain(ControllerState.resume)),
    CommandSpec("wait_complete", "5.4.6", lambda state, arguments: Held(
        lambda: state.plant.is_in_position, blocks=True)),
    CommandSpec("get_motion_state", "5.4.7", plain(_motion_state)),
    CommandSpec("jog", "5.5", _jog),
    CommandSpec("servo_move", "5.6.1", _servo_move),
    CommandSpec("is_in_servomove", "5.6.2", plain(lambda state: {"in_servomove": state.plant.is_servo_active})),
    CommandSpec("servo_j", "5.6.3", _servo_point("servoj", _servo_joint)),
    CommandSpec("servo_p", "5.6.4", _servo_point("servop", _servo_pose)),
    CommandSpec("set_servo_move_filter", "5.6.6", _set_servo_filter),
    CommandSpec("torque_control_enable", "5.8", _hand_guiding),
    CommandSpec("torque_feedforward", "5.8", _torque_feedforward),
    CommandSpec("drag_status", "5.8", plain(lambda state: {"drag_status": state.plant.is_hand_guided})),
    CommandSpec("get_drag_status", "5.8", plain(lambda state: {"status": state.plant.is_hand_guided})),
    CommandSpec("rapid_rate", "5.10", lambda state, arguments: state.plant.set_rapid_rate(
        round(arguments.number("rate_value"), _RAPID_RATE_DECIMALS))),
    CommandSpec("get_rapid_rate", "5.10", plain(lambda state: {"value": state.plant.rapid_rate})),
    CommandSpec("is_on_limit", "sdk-client.md 9", plain(lambda state: {"on_limit": int(state.plant.on_soft_limit)})),
)
