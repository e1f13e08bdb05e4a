"""Commands as the controller's request objects, and its replies as results or a CommandRejected."""
import math
from typing import Any, Callable, Dict, Mapping, Tuple, Type, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, ProtocolError
from jaka_ros_driver.protocol.framing import JsonObject
from jaka_ros_driver.protocol.status import MAX_JOINT_DEG
from jaka_ros_driver.protocol.texts import printable, shown, text_of
from jaka_ros_driver.state import ProgramState
from jaka_ros_driver.units import (
    all_deg_to_rad,
    all_m_to_mm,
    all_mm_to_m,
    all_rad_to_deg,
    m_to_mm,
    ms_to_s,
    rad_to_deg,
    s_to_ms,
)

Params = Dict[str, Any]
Encoder = Callable[[Any], Params]

_JOG_COORD_MAP = {c.JogFrame.BASE: 0, c.JogFrame.JOINT: 1, c.JogFrame.TOOL: 2}
_JOG_STOP, _JOG_CONTINUOUS = 0, 1
_LINK_LOSS_KEEP, _LINK_LOSS_ABORT = 0, 2
_MAX_NUMBER = 1e9
"""Largest magnitude, deg or mm, accepted in a reply; no quantity of an arm is larger, and a float32 can hold it."""
_MAX_CODE = 1 << 31
"""Number above every ``errorCode``, which has 32 bits with a sign."""
_LONGEST_CODE = 40
"""Most characters of an ``errorCode``: it stands in messages, and Python takes long to read long numbers."""

_TRUTHS = {"0": False, "false": False, "0.0": False, "1": True, "true": True, "1.0": True}
_DRIVES = {**_TRUTHS, "powered_on": True, "powered_off": False, "robot_enabled": True, "robot_disabled": False}
"""Spellings of a drive's state; the texts are those of firmware up to 1.5 (docs/controller-protocol.md section 5.1)."""

ERROR_MEANINGS: Dict[int, str] = {
    1: "unknown command or wrong parameter",
    2: "refused by the controller",
    -1: "not allowed in this state",
    -2: "invalid parameter",
    -4: "inverse kinematics failed",
    -5: "emergency stop pressed",
    -6: "not powered on",
    -7: "not enabled",
    -8: "not in servo mode",
    -9: "must be disabled first",
    -10: "a program is running",
    -12: "motion abnormal",
    -16: "forward kinematics failed",
    -20: "protective stop active",
    -21: "emergency stop active",
    -22: "on a soft limit",
    -40: "linear move failed",
    -41: "joint move failed",
    -42: "circular move failed",
    -55: "user frame not set in time",
    -56: "tool not set in time",
    -60: "I/O not set",
    -61: "I/O operation timed out",
}
"""Meaning of a reply's errorCode, used where the controller sends no text (docs/controller-protocol.md section 4.3)."""


def encode(command: c.Command) -> JsonObject:
    """Return the request object of a command, mm and deg; raise InvalidCommand where a number in it is not finite."""
    name = command_name(command)
    params = _QUERIES[command][1] if isinstance(command, c.Query) else _ENCODERS[type(command)][1](command)
    _require_finite(name, params)
    return {"cmdName": name, **params}


def command_name(command: c.Command) -> str:
    """Return the controller's name of the command (``cmdName``)."""
    if isinstance(command, c.Query):
        return _QUERIES[command][0]
    name = _ENCODERS[type(command)][0]
    return name(command) if callable(name) else name


def decode(command: c.Command, reply: Mapping[str, Any]) -> Any:
    """Return the result of a command that the controller accepted; None where it has none.

    Raises:
        CommandRejected: The controller refused it.
        ProtocolError: The reply lacks the result.
    """
    name = command_name(command)
    raise_if_rejected(name, reply)
    decoder = _QUERIES[command][2] if isinstance(command, c.Query) else _DECODERS.get(type(command))
    if decoder is None:
        return None
    try:
        return decoder(reply)
    except KeyError as error:
        raise ProtocolError("reply to %s has no %s: %s" % (name, error, shown(reply))) from error
    except (TypeError, ValueError, OverflowError) as error:
        raise ProtocolError("reply to %s does not hold its result: %s (%s)" % (
            name, shown(reply), printable(str(error)))) from error


def raise_if_rejected(name: str, reply: Mapping[str, Any]) -> None:
    """Raise CommandRejected unless a reply's ``errorCode`` is 0, as number or text; ProtocolError without one."""
    if "errorCode" not in reply:
        raise ProtocolError("reply to %s has no errorCode: %s" % (name, shown(reply)))
    code = _error_code(text_of(reply["errorCode"]))
    if code != 0:
        text = text_of(reply.get("errorMsg") or "") or ERROR_MEANINGS.get(code if isinstance(code, int) else 0, "")
        raise CommandRejected(name, code, text or "no reason given")


def _error_code(text: str) -> Union[int, str]:
    if len(text) <= _LONGEST_CODE:
        try:
            code = int(text, 0)
        except ValueError:
            return text
        if -_MAX_CODE <= code < _MAX_CODE:
            return code
    return printable(text, _LONGEST_CODE)


def _require_finite(name: str, value: Any) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            _require_finite("%s %s" % (name, key), item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            _require_finite(name, item)
    elif isinstance(value, float) and not math.isfinite(value):
        raise InvalidCommand("%s: %s is not a finite number" % (name, value))


def _pose(pose: c.Pose) -> Tuple[float, ...]:
    return all_m_to_mm(pose.position) + all_rad_to_deg(pose.rpy)


def _pose_from_wire(values: Any) -> c.Pose:
    numbers = _finite(values, 6)
    return c.Pose(all_mm_to_m(numbers[:3]), all_deg_to_rad(numbers[3:]))


def _joints(values: Any) -> Tuple[float, ...]:
    joints = _finite(values, 6)
    if max(map(abs, joints)) > MAX_JOINT_DEG:
        raise ValueError("expected joints within %g deg" % MAX_JOINT_DEG)
    return all_deg_to_rad(joints)


def _finite(values: Any, count: int) -> Tuple[float, ...]:
    """Return the first ``count`` numbers of an array; some firmware writes numbers as text."""
    if not isinstance(values, list) or len(values) < count:
        raise ValueError("expected %d numbers" % count)
    return tuple(_number(value) for value in values[:count])


def _number(value: Any) -> float:
    number = float(value)
    if not -_MAX_NUMBER <= number <= _MAX_NUMBER:
        raise ValueError("expected finite numbers within %g" % _MAX_NUMBER)
    return number


def _user_frame(command: c.SetUserFrame) -> Params:
    """Return the parameters with both spellings of the offset's key.

    Which of them a firmware reads is not known, and unknown keys are ignored (docs/controller-protocol.md section 5.7).
    """
    pose = _pose(command.pose)
    return {"userffset": pose, "useroffset": pose, "id": command.user_frame_id, "name": command.name}


def _joint_move(move: c.JointMove) -> Params:
    """Return the parameters, with ``tol`` only for a move that has a tolerance.

    No client but the maker's SDK sends it (docs/controller-protocol.md section 5.2, docs/sdk-client.md section 8).
    """
    params = {"relFlag": 0, "jointPosition": all_rad_to_deg(move.joint_position), "speed": rad_to_deg(move.speed),
              "accel": rad_to_deg(move.acceleration)}
    if move.tolerance > 0.0:
        params["tol"] = m_to_mm(move.tolerance)
    return params


def _terminal(command: Any) -> Params:
    return {"type": int(command.bank), "index": command.index}


_ENCODERS: Dict[Type[Any], Tuple[Union[str, Callable[[Any], str]], Encoder]] = {
    c.JointMove: ("joint_move", _joint_move),
    c.LinearMove: ("moveL", lambda m: {
        "relFlag": 0, "cartPosition": _pose(m.target), "speed": m_to_mm(m.speed), "accel": m_to_mm(m.acceleration),
        "ori_vel": rad_to_deg(m.turn_speed), "ori_acc": rad_to_deg(m.turn_acceleration), "tol": m_to_mm(m.tolerance)}),
    c.ArcMove: ("movc", lambda m: {
        "relFlag": 0, "pos_mid": _pose(m.via), "pos_end": _pose(m.target), "speed": m_to_mm(m.speed),
        "accel": m_to_mm(m.acceleration), "tol": m_to_mm(m.tolerance), "circle_cnt": 0, "circle_mode": 0}),
    c.Jog: ("jog", lambda j: {
        "jog_mode": _JOG_CONTINUOUS, "coord_map": _JOG_COORD_MAP[j.frame], "jnum": j.axis,
        "jogvel": m_to_mm(j.velocity) if j.is_linear else rad_to_deg(j.velocity)}),
    c.JogStop: ("jog", lambda j: {
        "jog_mode": _JOG_STOP, "coord_map": _JOG_COORD_MAP[j.frame], "jnum": j.axis}),
    c.Stop: ("stop_program", lambda _: {}),
    c.PauseMotion: ("pause_program", lambda _: {}),
    c.ResumeMotion: ("resume_program", lambda _: {}),
    c.LoadProgram: ("load_program", lambda p: {"programName": p.name}),
    c.PlayProgram: ("play_program", lambda _: {}),
    c.SetServoMode: ("servo_move", lambda s: {"relFlag": int(s.active)}),
    c.ServoJoint: ("servo_j", lambda s: {
        "relFlag": int(s.relative), "jointPosition": all_rad_to_deg(s.joint_position), "stepNum": s.cycles}),
    c.ServoPose: ("servo_p", lambda s: {
        "relFlag": int(s.relative), "catPosition": _pose(s.target), "stepNum": s.cycles}),
    c.SetPower: (lambda p: "power_on" if p.on else "power_off", lambda _: {}),
    c.SetEnabled: (lambda e: "enable_robot" if e.on else "disable_robot", lambda _: {}),
    c.ClearError: ("clear_error", lambda _: {}),
    c.SetToolFrame: ("set_tool_offsets", lambda t: {
        "tooloffset": _pose(t.pose), "id": t.tool_id, "name": t.name}),
    c.SelectTool: ("set_tool_id", lambda t: {"tool_id": t.tool_id}),
    c.SetUserFrame: ("set_user_offsets", _user_frame),
    c.SelectUserFrame: ("set_user_id", lambda u: {"user_frame_id": u.user_frame_id}),
    c.SetPayload: ("set_payload", lambda p: {"mass": p.mass, "centroid": all_m_to_mm(p.centroid)}),
    c.SetHandGuiding: ("torque_control_enable", lambda h: {"enable_flag": int(h.active)}),
    c.SetCollisionLevel: ("set_clsn_sensitivity", lambda s: {"sensitivityVal": s.level}),
    c.SetDigitalOutput: ("set_digital_output", lambda o: dict(_terminal(o), value=int(o.value))),
    c.SetAnalogOutput: ("set_analog_output", lambda o: dict(_terminal(o), value=o.value)),
    c.SetRapidRate: ("rapid_rate", lambda r: {"rate_value": r.rate}),
    c.SetFeedPeriod: ("set_port10000_delay_ms", lambda f: {"port10000_delay_ms": int(round(s_to_ms(f.period)))}),
    c.SetLinkLoss: ("set_network_exception_handle", lambda x: {
        "motType": _LINK_LOSS_ABORT if x.seconds > 0.0 else _LINK_LOSS_KEEP, "timeLimit": s_to_ms(float(x.seconds))}),
    c.ForwardKinematics: ("kine_forward", lambda k: {"jointPosition": all_rad_to_deg(k.joint_position)}),
    c.InverseKinematics: ("kine_inverse", lambda k: {
        "jointPosition": all_rad_to_deg(k.reference), "cartPosition": _pose(k.target)}),
    c.GetDigitalOutput: ("get_digital_output", _terminal),
    c.GetAnalogOutput: ("get_analog_output", _terminal),
    c.GetDigitalInput: ("get_digital_input", _terminal),
    c.GetAnalogInput: ("get_analog_input", _terminal),
    c.ZeroForceSensor: ("zero_end_sensor", lambda _: {}),
}


def _payload(reply: Mapping[str, Any]) -> c.SetPayload:
    return c.SetPayload(_number(reply["mass"]), all_mm_to_m(_finite(reply["centroid"], 3)))


def _collision_level(reply: Mapping[str, Any]) -> int:
    """Read the level; its key depends on the firmware (docs/controller-protocol.md section 5.9)."""
    level = _number(reply["sensitivityLevel"] if "sensitivityLevel" in reply else reply["sensitivityVal"])
    if level not in range(6):
        raise ValueError("expected 0 to 5")
    return int(level)


def _truth(value: Any, truths: Mapping[str, bool] = _TRUTHS) -> bool:
    """Read a boolean; how it is written depends on the firmware (docs/controller-protocol.md section 5.1)."""
    if isinstance(value, (str, int, float)) and str(value).lower() in truths:
        return truths[str(value).lower()]
    raise ValueError("expected true or false")


def _text(value: Any) -> str:
    if isinstance(value, (str, int, float)):
        return text_of(value)
    raise ValueError("expected a text")


def _frames(values: Any) -> Tuple[c.Pose, ...]:
    if not isinstance(values, list):
        raise ValueError("expected an array of poses")
    return tuple(map(_pose_from_wire, values))


def _hand_guiding(reply: Mapping[str, Any]) -> bool:
    """Read the reply's ``drag_status``, the key of the status feed, or ``status``: no source shows this reply."""
    return _truth(reply["drag_status"] if "drag_status" in reply else reply["status"])


_DECODERS: Dict[Type[Any], Callable[[Mapping[str, Any]], Any]] = {
    c.ForwardKinematics: lambda r: _pose_from_wire(r["cartPosition"]),
    c.InverseKinematics: lambda r: _joints(r["jointPosition"]),
    c.GetDigitalOutput: lambda r: _truth(r["value"]),
    c.GetAnalogOutput: lambda r: _number(r["value"]),
    c.GetDigitalInput: lambda r: _truth(r["value"]),
    c.GetAnalogInput: lambda r: _number(r["value"]),
}

_QUERIES: Dict[c.Query, Tuple[str, Params, Callable[[Mapping[str, Any]], Any]]] = {
    c.Query.VERSION: ("get_version", {}, lambda r: _text(r["version"])),
    c.Query.SERVO_MODE: ("is_in_servomove", {}, lambda r: _truth(r["in_servomove"])),
    c.Query.FEED_PERIOD: ("get_port10000_delay_ms", {}, lambda r: ms_to_s(_number(r["port10000_delay_ms"]))),
    c.Query.JOINTS: ("get_joint_pos", {}, lambda r: _joints(r["joint_pos"])),
    c.Query.DRIVES_READY: ("get_robot_state", {}, lambda r: (
        _truth(r["power"], _DRIVES) and _truth(r["enable"], _DRIVES))),
    c.Query.TOOL_FRAMES: ("get_tool_offsets", {}, lambda r: _frames(r["tool_offsets"])),
    c.Query.USER_FRAMES: ("get_user_offsets", {}, lambda r: _frames(r["user_offsets"])),
    c.Query.PAYLOAD: ("get_payload", {}, _payload),
    c.Query.COLLISION_LEVEL: ("get_clsn_sensitivity", {}, _collision_level),
    c.Query.SIMULATOR_IDENTITY: ("get_simulator_identity", {}, lambda r: _text(r["identity"])),
    c.Query.LOADED_PROGRAM: ("get_loaded_program", {}, lambda r: _text(r["programName"])),
    c.Query.PROGRAM_STATE: ("get_program_state", {}, lambda r: ProgramState[_text(r["programState"]).upper()]),
    c.Query.HAND_GUIDING: ("drag_status", {}, _hand_guiding),
}

