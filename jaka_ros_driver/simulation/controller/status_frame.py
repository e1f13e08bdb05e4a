"""Status frames: every field of the controller's state, in the order of a real controller, with an exact ``len``.

Order, lengths and types: docs/controller-protocol.md sections 6.2 to 6.4. The frame of the polled port is that of the
feed and, behind it, what the maker's SDK needs and this firmware's feed lacks (docs/sdk-client.md section 3). The text
of a field is made anew only when its value changed: most of a frame are I/O arrays that seldom do.
"""
import json
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

from jaka_ros_driver.protocol.status import with_len
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.simulation.controller.replies import UNKNOWN_FIELDS
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.controller.wire_units import FEED_DECIMALS, joints_to_wire, pose_to_wire
from jaka_ros_driver.units import all_m_to_mm, m_to_mm

MAX_POLLED_BYTES = 8990
"""Longest frame, bytes, that the maker's SDK takes from the polled port (docs/sdk-client.md section 1, point 3)."""

_Field = Tuple[str, Callable[[ControllerState], Any]]

_JOINT_TEMPERATURE = 31.0
"""Temperature of each joint, deg C; made up, as of an arm that has stood for a while."""
_JOINTS_AT_REST = tuple((0.4, 48.0, _JOINT_TEMPERATURE, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0) for _ in range(6))
_MONITOR_DATA = (12338, 12593, 36.5, 41.2, 0.86, _JOINTS_AT_REST)
"""The monitoring data: firmware of the safety board as ASCII, cabinet deg C, W, A, joints.

Source: docs/controller-protocol.md section 6.3.
"""
_SENSOR_ADDRESS = ("192.168.2.100", 8080)
_NO_FORCE = (0.0,) * 6
_HOMED = (1,) * 6 + (0,) * 3
_FUNCTION_INPUTS = ((-1, -1),) * 15
_NO_KEYS = (0, 0, 0)
SIGNAL_VALUE = 0
"""The value of every RS-485 signal: no device is simulated."""
_PADDING, _PADDING_HEAD = "vendor_block", ', "vendor_block": []'


def errcode_text(code: int) -> str:
    """Return an event in the feed: lower-case hexadecimal, "0x0" for none (docs/controller-protocol.md section 4.4)."""
    return "0x%x" % code


def _io(key: str) -> _Field:
    return key, lambda state: state.io.array(key)


def _torque_sensor(force_rows: int) -> Callable[[ControllerState], Any]:
    def value(state: ControllerState) -> Any:
        load, sensor = state.memory.sensor_payload, state.force_sensor
        readings = (_NO_FORCE,) * 3 if sensor is None else (sensor.actual, sensor.raw, sensor.actual)
        return ((0, _SENSOR_ADDRESS, (load.mass, all_m_to_mm(load.centroid))), (0, 0) + readings[:force_rows])
    return value


def signal_rows(state: ControllerState) -> List[List[Any]]:
    """Return name, channel, type, address, value and frequency of each signal.

    An entry that is no list makes the SDK crash (docs/sdk-client.md section 9).
    """
    return [[name, signal["chnId"], signal["sigType"], signal["sigAddr"], SIGNAL_VALUE, signal["frequency"]]
            for name, signal in state.memory.signals.items()]


def _task_mode(state: ControllerState) -> int:
    """Return 1 for manual, 2 for automatic, 4 for hand guiding (docs/controller-protocol.md section 6.2)."""
    if state.plant.is_hand_guided:
        return 4
    return 2 if state.program_state else 1


_COMMANDED_JOINTS: _Field = ("joint_position", lambda state: joints_to_wire(
    state.plant.joint_position, FEED_DECIMALS))
_COMMANDED_POSE: _Field = ("position", lambda state: pose_to_wire(state.plant.tcp_pose(), FEED_DECIMALS))
_KEYS: _Field = ("tio_key", lambda state: _NO_KEYS)
_EXTENSION_OFF: Dict[str, Any] = {"status": 0, "setup": (), "num": (0, 0, 0, 0), "pinmap": (), "mode": 0}
_EXTENSION: _Field = ("extio", lambda state: _EXTENSION_OFF)
_LINES: Tuple[_Field, ...] = (
    ("motion_line", lambda state: state.executing_lines()[0]),
    ("err_add_line", lambda state: state.executing_lines()[1]))
_VELOCITY: _Field = ("instVel", lambda state: joints_to_wire(state.plant.joint_velocity, FEED_DECIMALS))
_SIGNALS: _Field = ("tio_rs_signals", signal_rows)
_FIELD_BUS: Tuple[_Field, ...] = (("relay_io", lambda state: state.io.relays), *(_io(key) for key in (
    "mb_slave_din", "mb_slave_dout", "mb_slave_ain", "mb_slave_aout", "pn_dev_din", "pn_dev_dout",
    "pn_dev_ain", "pn_dev_aout", "eip_adpt_din", "eip_adpt_dout", "eip_adpt_ain", "eip_adpt_aout")))


def _feed_fields(modern: bool) -> Tuple[_Field, ...]:
    """Return the fields of docs/controller-protocol.md section 6.2.

    Its rows without a number are of the modern firmware only.
    """
    def only(*fields: _Field) -> Tuple[_Field, ...]:
        return fields if modern else ()

    return (
        ("drag_status", lambda state: state.plant.is_hand_guided),
        ("errcode", lambda state: errcode_text(state.alarms.shown()[0])),
        ("errmsg", lambda state: state.alarms.shown()[1]),
        ("monitor_data", lambda state: _MONITOR_DATA),
        ("torqsensor", _torque_sensor(3 if modern else 2)),
        ("joint_actual_position", lambda state: joints_to_wire(state.plant.joint_position, FEED_DECIMALS)),
        *only(_COMMANDED_JOINTS),
        ("actual_position", lambda state: pose_to_wire(state.plant.tcp_pose(), FEED_DECIMALS)),
        *only(_COMMANDED_POSE),
        _io("din"), _io("dout"), _io("ain"), _io("aout"), _io("tio_din"), _io("tio_dout"), _io("tio_ain"),
        *only(_KEYS),
        ("task_state", lambda state: state.task_state),
        ("homed", lambda state: _HOMED),
        ("task_mode", _task_mode),
        ("interp_state", lambda state: int(state.program_state)),
        ("enabled", lambda state: state.is_enabled),
        ("paused", lambda state: state.is_paused),
        ("rapidrate", lambda state: float(state.plant.rapid_rate)),
        ("current_tool_id", lambda state: state.memory.tools.active),
        ("current_user_id", lambda state: state.memory.user_frames.active),
        ("on_soft_limit", lambda state: int(state.plant.on_soft_limit)),
        ("emergency_stop", lambda state: int(state.emergency_stop)),
        ("drag_near_limit", lambda state: [int(near) for near in state.plant.near_limit]),
        ("funcdi", lambda state: _FUNCTION_INPUTS),
        ("powered_on", lambda state: int(state.is_powered)),
        ("inpos", lambda state: state.in_position),
        ("motion_mode", lambda state: 1),
        ("curr_tcp_trans_vel", lambda state: round(m_to_mm(state.plant.tcp_speed), FEED_DECIMALS)),
        ("protective_stop", lambda state: int(state.protective_stop)),
        ("point_key", lambda state: 0),
        ("netState", lambda state: 1),
        *only(*_LINES, _VELOCITY, *_FIELD_BUS, _SIGNALS, _EXTENSION),
    )


_FEED = {modern: _feed_fields(modern) for modern in (False, True)}
_SDK_NEEDS: Tuple[_Field, ...] = (
    _COMMANDED_JOINTS, _COMMANDED_POSE, _KEYS, *_LINES, _VELOCITY, _SIGNALS, *_FIELD_BUS)
_POLLED_INSTEAD: Dict[str, Callable[[ControllerState], Any]] = {
    "torqsensor": _torque_sensor(3),
    "extio": lambda state: None,
}
"""Fields whose unexpected shape makes the SDK crash.

It accepts null (docs/sdk-client.md section 1, point 8).
"""


def all_field_names(firmware: Firmware) -> Tuple[str, ...]:
    """Return the names of all fields that can be switched on and off: all but ``len``."""
    names = [name for name, _ in _FEED[firmware.is_modern] + _SDK_NEEDS]
    return tuple(dict.fromkeys(names))


class StatusFrame:
    """The builder of the frames of one controller.

    Attributes:
        dropped: Fields left out, as a wire fault.
        added: Fields put behind the others, as a wire fault.
    """

    def __init__(self, state: ControllerState, polled: bool = False) -> None:
        """Set up the frames of ``state``.

        polled: Those of the polled port.
        """
        self._state = state
        fields = _FEED[state.firmware.is_modern]
        if polled:
            fields = tuple((name, _POLLED_INSTEAD.get(name, value)) for name, value in fields)
            present = frozenset(name for name, _ in fields)
            fields += tuple(field for field in _SDK_NEEDS if field[0] not in present)
        self._fields = fields
        self._texts: Dict[str, Tuple[Any, str]] = {}
        self._max_bytes: Optional[int] = MAX_POLLED_BYTES if polled else None
        self.dropped: Tuple[str, ...] = ()
        self.added: Mapping[str, Any] = {}

    def fields(self) -> Dict[str, Any]:
        """Return the fields without ``len``, in order."""
        switches = self._state.memory.field_switches
        dialect = self._state.dialect
        values = {name: value(self._state) for name, value in self._fields
                  if switches.get(name, True) and name not in self.dropped and name not in dialect.missing_frame_fields}
        if dialect.unknown_frame_fields:
            values.update(UNKNOWN_FIELDS)
        values.update(self.added)
        return values

    def text(self) -> bytes:
        """Return the whole frame.

        From a polled frame, fields are dropped at its end until the SDK can take its length.
        """
        parts = [self._part(name, value) for name, value in self.fields().items()]
        frame = self._frame(parts)
        if self._max_bytes is None and len(frame) < self._state.dialect.frame_bytes:
            count = (self._state.dialect.frame_bytes - len(frame) - len(_PADDING_HEAD) - 1) // 3
            frame = self._frame([*parts, self._part(_PADDING, (0,) * count)])
        while self._max_bytes is not None and len(frame) > self._max_bytes:
            parts.pop()
            frame = self._frame(parts)
        return frame

    @staticmethod
    def _frame(parts: List[str]) -> bytes:
        return with_len(("".join(", " + part for part in parts) + "}").encode("ascii"))

    def _part(self, name: str, value: Any) -> str:
        known = self._texts.get(name)
        if known is not None and (known[0] is value or (type(value) is type(known[0]) and known[0] == value)):
            return known[1]
        text = "%s: %s" % (json.dumps(name), json.dumps(value))
        self._texts[name] = (value, text)
        return text
