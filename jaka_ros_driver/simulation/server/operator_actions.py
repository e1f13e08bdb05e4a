"""The actions of the operator port: what a person at the arm can do, and the wire faults, as JSON requests.

One request is ``{"action": NAME, ...}``; the answer ``{"ok": true, ...}`` or ``{"ok": false, "error": TEXT}``. Angles
are deg and lengths mm here, as on the wire of the controller. ``ACTIONS`` is the whole protocol.
"""
import sys
import traceback
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.io_banks import BANK_NAMES
from jaka_ros_driver.simulation.controller.replies import BadParameter, CommandRefused
from jaka_ros_driver.simulation.controller.status_frame import errcode_text
from jaka_ros_driver.simulation.controller.wire_units import QUERY_DECIMALS, joints_to_wire, pose_to_wire
from jaka_ros_driver.simulation.server.event_loop import ControllerServer
from jaka_ros_driver.simulation.server.faults import Effect
from jaka_ros_driver.units import deg_to_rad, m_to_mm, ms_to_s

_Answer = Dict[str, Any]
_FAULT_KEYS = ("kind", "port", "count", "probability", "command")


class Action(NamedTuple):
    """One action of the operator port.

    Attributes:
        act: Carries it out.
        parameters: In words.
        meaning: In words.
    """

    act: Callable[[ControllerServer, Dict[str, Any]], Optional[_Answer]]
    parameters: str
    meaning: str


def handle(server: ControllerServer, request: Dict[str, Any]) -> _Answer:
    """Carry out one request of the operator port. An error is in the answer; nothing is raised."""
    name = request.get("action")
    action = ACTIONS.get(name) if isinstance(name, str) else None
    if action is None:
        return {"ok": False, "error": "unknown action %r; known: %s" % (name, ", ".join(ACTIONS))}
    try:
        answer = action.act(server, {key: value for key, value in request.items() if key != "action"})
    except (InvalidCommand, BadParameter) as error:
        return {"ok": False, "error": str(error)}
    except CommandRefused:
        return {"ok": False, "error": "a parameter has the wrong length or is out of range"}
    except Exception as error:  # a bug of this code must not take the controller down with a running motion
        server.controller.failures += 1
        traceback.print_exc(file=sys.stderr)
        return {"ok": False, "error": "a bug of the simulated controller: %r" % error}
    return {"ok": True, **(answer or {})}


def _joint(arguments: Arguments) -> int:
    joint = arguments.integer("joint")
    if not 1 <= joint <= 6:
        raise InvalidCommand("joint is %d; it must be within 1..6" % joint)
    return joint - 1


def _hit(server: ControllerServer, request: Dict[str, Any]) -> _Answer:
    arguments = Arguments(request)
    joint = _joint(arguments) if arguments.has("joint") else None
    return {"noticed": server.controller.state.hit(arguments.number("force", 150.0), joint)}


def _push(server: ControllerServer, request: Dict[str, Any]) -> _Answer:
    arguments = Arguments(request)
    pushed = server.controller.state.push(
        _joint(arguments), deg_to_rad(arguments.number("velocity")), arguments.number("duration", 1.0))
    return {"pushed": pushed}


def _set_input(server: ControllerServer, request: Dict[str, Any]) -> None:
    arguments = Arguments(request)
    bank, signal = arguments.text("bank", "cabinet"), arguments.text("signal", "digital")
    if bank not in BANK_NAMES or signal not in ("digital", "analog"):
        raise InvalidCommand("bank is one of %s, signal digital or analog" % ", ".join(BANK_NAMES))
    server.controller.state.io.set(signal, False, BANK_NAMES.index(bank), arguments.integer("index"),
                                     arguments.number("value"))


def _load_force_sensor(server: ControllerServer, request: Dict[str, Any]) -> None:
    sensor = server.controller.state.force_sensor
    if sensor is None:
        raise InvalidCommand("there is no force sensor: start with --force-sensor")
    arguments = Arguments(request)
    sensor.load(tuple(arguments.number(axis, 0.0) for axis in ("fx", "fy", "fz", "mx", "my", "mz")))


def _disable(server: ControllerServer, _request: Dict[str, Any]) -> None:
    try:
        server.controller.state.disable()
    except CommandRefused:
        raise InvalidCommand("the arm moves, or a program runs: it is not disabled") from None


def _load_program(server: ControllerServer, request: Dict[str, Any]) -> None:
    server.controller.state.memory.program_name = Arguments(request).text("name")


def _fault(server: ControllerServer, request: Dict[str, Any]) -> _Answer:
    known = {key: request[key] for key in _FAULT_KEYS if key in request}
    params = {key: value for key, value in request.items() if key not in known}
    if "kind" not in known or "port" not in known:
        raise InvalidCommand("fault needs kind and port")
    return {"fault": server.faults.add(**known, **params).described()}


def _clear_faults(server: ControllerServer, _request: Dict[str, Any]) -> None:
    server.faults.clear()
    server.controller.change_fields({}, ())
    server.controller.state.slow_feed(None)


def _ports(request: Dict[str, Any]) -> Tuple[str, ...]:
    port = request.get("port", "all")
    if port != "all" and port not in PORTS:
        raise InvalidCommand("port is %r; it must be all, %s" % (port, ", ".join(PORTS)))
    return PORTS if port == "all" else (str(port),)


def _end(effect: Effect) -> Callable[[ControllerServer, Dict[str, Any]], _Answer]:
    return lambda server, request: {"connections": server.end_connections(_ports(request), effect)}


def _for_a_while(act: Callable[[ControllerServer, Tuple[str, ...], float], None]
                 ) -> Callable[[ControllerServer, Dict[str, Any]], None]:
    return lambda server, request: act(server, _ports(request), ms_to_s(_not_negative(request, "duration_ms", 1000.0)))


def _reboot(server: ControllerServer, request: Dict[str, Any]) -> None:
    server.shut_down(_not_negative(request, "down", 10.0), Arguments(request).flag("silent", False))


def _not_negative(request: Dict[str, Any], key: str, default: float) -> float:
    value = Arguments(request).number(key, default)
    if value < 0.0:
        raise InvalidCommand("%s is %g; it must not be negative" % (key, value))
    return value


def _slow_feed(server: ControllerServer, request: Dict[str, Any]) -> None:
    rate = Arguments(request).number("rate")
    if not 0.0 < rate <= 1000.0:
        raise InvalidCommand("rate is %g Hz; it must be within 0..1000" % rate)
    server.controller.state.slow_feed(1.0 / rate)


def _fields(server: ControllerServer, request: Dict[str, Any]) -> None:
    added, dropped = request.get("add", {}), request.get("drop", [])
    if not isinstance(added, dict) or not isinstance(dropped, list) or not all(isinstance(d, str) for d in dropped):
        raise InvalidCommand("add is an object of fields, drop a list of names")
    server.controller.change_fields(added, tuple(dropped))


def _state(server: ControllerServer, _request: Dict[str, Any]) -> _Answer:
    state = server.controller.state
    code, text = state.alarms.shown()
    return {"state": {
        "simulated_s": round(state.now, 6), "is_powered": state.is_powered, "is_enabled": state.is_enabled,
        "emergency_stop": state.emergency_stop, "protective_stop": state.protective_stop,
        "errcode": errcode_text(code), "errmsg": text,
        "joint_position": joints_to_wire(state.plant.joint_position),
        "joint_velocity": joints_to_wire(state.plant.joint_velocity),
        "tcp_pose": pose_to_wire(state.plant.tcp_pose()),
        "tcp_speed": round(m_to_mm(state.plant.tcp_speed), QUERY_DECIMALS),
        "is_moving": state.plant.is_moving, "is_in_position": state.plant.is_in_position,
        "queue_length": state.plant.queue.length, "is_servo_active": state.plant.is_servo_active,
        "is_hand_guided": state.plant.is_hand_guided, "collision_level": state.memory.collision_level,
        "payload": {"mass": state.memory.payload.mass}, "tool_id": state.memory.tools.active,
        "user_frame_id": state.memory.user_frames.active,
        "digital_outputs": list(state.io.array("dout")), "analog_outputs": list(state.io.array("aout"))}}


_PORT = "port: command, status, poll or all (default)"
_FOR_A_WHILE = _PORT + "; duration_ms wall time (1000)"

ACTIONS: Dict[str, Action] = {
    "press_emergency_stop": Action(lambda server, request: server.controller.state.press_emergency_stop(), "",
                                   "press the emergency stop button"),
    "release_emergency_stop": Action(lambda server, request: server.controller.state.release_emergency_stop(), "",
                                     "release it; clear_error, power_on, enable_robot remain to be done"),
    "hit": Action(_hit, "force N (150), joint 1..6 (none)",
                  "hit the arm; it stops when the force reaches 25 N times the collision level; answers noticed"),
    "disable": Action(_disable, "", "disable the drives at the pendant; they keep power"),
    "load_program": Action(_load_program, "name", "load a program at the pendant"),
    "end_program": Action(lambda server, request: server.controller.state.stop(), "",
                          "end the program and every motion at the pendant"),
    "push": Action(_push, "joint 1..6, velocity deg/s, duration simulated s (1)",
                   "push a joint by hand; moves only while hand guiding is on; answers pushed"),
    "set_input": Action(_set_input, "index, value, bank (cabinet), signal digital or analog (digital)",
                        "set an input terminal"),
    "load_force_sensor": Action(_load_force_sensor, "fx, fy, fz N (0), mx, my, mz N m (0)",
                                "load the sensor at the flange from now on; needs --force-sensor"),
    "fault": Action(_fault, "kind, port, count (usually 1; null until cleared), probability (1), command (any), "
                            "and what the kind takes", "add a rule to the script of wire faults"),
    "clear_faults": Action(_clear_faults, "", "drop every rule, changed fields and a slow feed"),
    "close": Action(_end(Effect.CLOSE), _PORT, "close the connections"),
    "reset": Action(_end(Effect.RESET), _PORT, "reset the connections (RST)"),
    "half_open": Action(_end(Effect.HALF_OPEN), _PORT, "leave the connections open, and read and send nothing more"),
    "stall": Action(_for_a_while(ControllerServer.stall), _FOR_A_WHILE, "neither read nor send for a while"),
    "refuse": Action(_for_a_while(ControllerServer.refuse), _FOR_A_WHILE, "refuse new connections for a while"),
    "reboot": Action(_reboot, "down wall s (10), silent 0 or 1 (0)",
                     "turn the cabinet off for a while; silent: without closing connections, as in a power failure"),
    "boot": Action(lambda server, request: server.boot(), "",
                   "turn the cabinet on again, after shutdown or in the middle of a reboot"),
    "slow_feed": Action(_slow_feed, "rate Hz of simulated time",
                        "send the status feed at this rate, whatever the client asked for"),
    "fields": Action(_fields, "drop: names, add: object", "leave fields out of every frame and put others in"),
    "state": Action(_state, "", "what is true of the arm: joints, speeds, stops, outputs"),
    "events": Action(lambda server, request: {"events": [
        {"simulated_s": round(at, 6), "code": errcode_text(event.code), "text": event.text}
        for at, event in server.controller.state.alarms.past]}, "",
                     "the last events, also those that errcode does not show"),
    "wire": Action(lambda server, request: {"wire": server.described()}, "",
                   "connections, rules in force, lateness of the cycle"),
    "help": Action(lambda server, request: {"actions": {
        name: [action.parameters, action.meaning] for name, action in ACTIONS.items()}}, "", "this table"),
}
"""Every action: its parameters with defaults, and its effect."""
