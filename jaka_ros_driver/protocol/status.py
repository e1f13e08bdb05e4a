"""Status frames of the feed: the encoder, which writes the exact ``len``, and the decoder to a RobotState."""
import math
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple

from jaka_ros_driver.errors import StatusFrameError
from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.protocol.texts import shown, text_of
from jaka_ros_driver.state import BusTerminals, FieldBus, IoBank, IoState, RobotState, Vector
from jaka_ros_driver.units import all_deg_to_rad, all_mm_to_m, mm_to_m

MAX_JOINT_DEG = 1080.0
"""Largest joint angle accepted, deg: three turns. The joints of these arms have one to either side."""
_MAX_LENGTH_MM = 1e5
"""Largest length accepted, mm; a pose is given in a user frame, which may be at the other end of a hall."""
_MAX_JOINT_SPEED_DEG = 3600.0
"""Largest joint speed accepted, deg/s: ten times the fastest joint of these arms.

The margin is needed because a reported speed may be a difference of noisy positions.
"""
_MAX_SPEED_MM = 1e5
"""Largest speed of the tool accepted, mm/s: far above any arm's, and far below what a damaged number reads as."""
_MAX_RATE = 100.0
"""Largest speed override accepted: it is 1 at most, but no source excludes firmware that counts in per cent."""
_MAX_READING = 1e4
"""Largest sensor reading accepted, deg C, A, N and N m."""
_MAX_NUMBER = 1e9
"""Largest magnitude of any other number; a float32 or int32 can hold it."""
_MAX_EVENT_CODE = 0xFFFFFFFF
"""Largest event code accepted, of either sign: 32 bits."""
_NUMBERS = frozenset((int, float, bool))

_DIGITAL_INPUTS = ((IoBank.CABINET, "din"), (IoBank.TOOL, "tio_din"))
_DIGITAL_OUTPUTS = ((IoBank.CABINET, "dout"), (IoBank.TOOL, "tio_dout"))
_ANALOG_INPUTS = ((IoBank.CABINET, "ain"), (IoBank.TOOL, "tio_ain"))
_ANALOG_OUTPUTS = ((IoBank.CABINET, "aout"),)
_FIELD_BUSES = tuple((bus, tuple(name + kind for kind in ("_din", "_dout", "_ain", "_aout"))) for bus, name in (
    (FieldBus.MODBUS_SLAVE, "mb_slave"), (FieldBus.PROFINET_SLAVE, "pn_dev"), (FieldBus.ETHERNET_IP_SLAVE, "eip_adpt")))
"""The keys of each field bus, in the order of BusTerminals (docs/controller-protocol.md section 6.2)."""
_NO_ARRAYS = [None] * 4
_READINGS = slice(2, 5)
_known_arrays: Dict[str, Tuple[List[Any], Vector]] = {}
"""The newest array of each key, as it was parsed and as a tuple; a cache, which changes no result."""


def encode_frame(fields: Mapping[str, Any]) -> bytes:
    """Return a status frame's text: ``len``, its size in bytes, and the fields (docs/controller-protocol.md section
    3.3).

    Raises:
        FramingError: A number in it is not finite.
    """
    body = encode_object({key: value for key, value in fields.items() if key != "len"})[1:]
    return with_len(b", " + body if body != b"}" else body)


def with_len(rest: bytes) -> bytes:
    """Return the frame whose text behind ``len`` is ``rest``, from the comma to the closing brace; ``len`` counts all
    bytes.
    """
    size = len(rest) + len(b'{"len": ')
    total = size + len(str(size))
    return b'{"len": %d' % (size + len(str(total))) + rest


def parse_status(fields: Mapping[str, Any], received_at: float) -> RobotState:
    """Decode a status frame.

    A controller can be configured to leave fields out (docs/controller-protocol.md section 6.1). A missing field is
    None in the state, except those without which the arm's condition is unknown.

    Args:
        fields: The frame as parsed JSON; deg and mm.
        received_at: Host monotonic time of the frame's last byte, s.

    Raises:
        StatusFrameError: An essential field is missing (joint_actual_position, powered_on, enabled, inpos,
            emergency_stop, protective_stop), or a field has the wrong type, too few numbers or an impossible value.
    """
    positions = _position_part.of(fields)
    speed = _number(fields, "curr_tcp_trans_vel", _MAX_SPEED_MM)
    cabinet_temperature, joint_temperature, joint_current = _monitored(fields.get("monitor_data"))
    return RobotState(
        received_at=received_at,
        tcp_speed=None if speed is None else mm_to_m(speed),
        error_code=_event_code(fields.get("errcode", "0x0")),
        error_message=text_of(fields.get("errmsg", "")),
        cabinet_temperature=cabinet_temperature,
        joint_temperature=joint_temperature,
        joint_current=joint_current,
        **positions,
        **_sensor_part.of(fields),
        **_steady_part.of(fields),
        **_io_part.of(fields))


class _KnownPart:
    """Fields of a state that seldom change, or not while the arm rests: where their keys have the values of the
    previous frame, it is not decoded again.

    A cache, which changes no result: values that are equal, as 1 and true are, decode to the same.
    """

    def __init__(self, keys: Sequence[str], decode: Callable[[Mapping[str, Any]], Dict[str, Any]]) -> None:
        """Set up the cache.

        Args:
            keys: All keys of a frame that ``decode`` reads.
            decode: Returns the fields of the state; it takes null for a missing key.
        """
        self._keys = keys
        self._decode = decode
        self._known: Tuple[List[Any], Dict[str, Any]] = [], {}

    def of(self, fields: Mapping[str, Any]) -> Dict[str, Any]:
        """Return the fields of the state."""
        values = list(map(fields.get, self._keys))
        known, decoded = self._known
        if values != known:
            decoded = self._decode(fields)
            self._known = [list(value) if isinstance(value, list) else value for value in values], decoded
        return decoded


def _positions(fields: Mapping[str, Any]) -> Dict[str, Any]:
    joints = _numbers(fields, "joint_actual_position", 6, MAX_JOINT_DEG)
    if joints is None:
        raise StatusFrameError("status frame without joint_actual_position")
    commanded = _numbers(fields, "joint_position", 6, MAX_JOINT_DEG)
    pose = _numbers(fields, "actual_position", 6, _MAX_LENGTH_MM)
    if pose is not None and max(map(abs, pose[3:])) > MAX_JOINT_DEG:
        raise _fail("actual_position", pose, "angles within %g deg" % MAX_JOINT_DEG)
    velocity = _numbers(fields, "instVel", 6, _MAX_JOINT_SPEED_DEG)
    return {
        "joint_position": all_deg_to_rad(joints),
        "tcp_position": None if pose is None else all_mm_to_m(pose[:3]),
        "tcp_rpy": None if pose is None else all_deg_to_rad(pose[3:]),
        "joint_position_commanded": None if commanded is None else all_deg_to_rad(commanded),
        "joint_velocity": None if velocity is None else all_deg_to_rad(velocity)}


def _steady(fields: Mapping[str, Any]) -> Dict[str, Any]:
    return {
        "is_powered": _essential_flag(fields, "powered_on"),
        "is_enabled": _essential_flag(fields, "enabled"),
        "is_in_position": _essential_flag(fields, "inpos"),
        "emergency_stop": _essential_flag(fields, "emergency_stop"),
        "protective_stop": _essential_flag(fields, "protective_stop"),
        "is_hand_guided": _flag(fields, "drag_status"),
        "is_paused": _flag(fields, "paused"),
        "on_soft_limit": _flag(fields, "on_soft_limit"),
        "program_state": _integer(fields, "interp_state"),
        "rapid_rate": _number(fields, "rapidrate", _MAX_RATE),
        "tool_id": _integer(fields, "current_tool_id"),
        "user_frame_id": _integer(fields, "current_user_id"),
        "motion_line": _integer(fields, "motion_line"),
        "add_error_line": _integer(fields, "err_add_line")}


def _fail(key: str, value: Any, expected: str) -> StatusFrameError:
    return StatusFrameError("status frame: %s is %s, expected %s" % (key, shown(value, 60), expected))


def _is_number_within(value: Any, limit: float) -> bool:
    return type(value) in _NUMBERS and abs(value) <= limit


def _are_numbers(values: List[Any], limit: float = _MAX_NUMBER) -> bool:
    """Return whether all are numbers whose root sum square is within the limit; fast: 2 us for a hundred."""
    try:
        return math.hypot(*values) <= limit
    except (TypeError, OverflowError):
        return False


def _numbers(fields: Mapping[str, Any], key: str, count: int, limit: float) -> Optional[List[float]]:
    """Return the first ``count`` numbers of a field; older firmware has 9 joints (docs/controller-protocol.md section
    4.2).
    """
    values = fields.get(key)
    if values is None:
        return None
    if not isinstance(values, list) or len(values) < count:
        raise _fail(key, values, "%d numbers" % count)
    values = values[:count]
    if not (_NUMBERS.issuperset(map(type, values)) and all(-limit <= value <= limit for value in values)):
        raise _fail(key, values, "finite numbers within %g" % limit)
    return values


def _number(fields: Mapping[str, Any], key: str, limit: float = _MAX_NUMBER) -> Optional[float]:
    value = fields.get(key)
    if value is None:
        return None
    if not _is_number_within(value, limit):
        raise _fail(key, value, "a finite number within %g" % limit)
    return float(value)


def _integer(fields: Mapping[str, Any], key: str) -> Optional[int]:
    value = _number(fields, key)
    return None if value is None else int(value)


def _flag(fields: Mapping[str, Any], key: str) -> Optional[bool]:
    """Decode a boolean, which comes as true/false, 0/1 or their text, depending on the firmware."""
    value = fields.get(key)
    if value is None:
        return None
    if value in (0, 1):
        return bool(value)
    if isinstance(value, str) and value.lower() in ("0", "1", "true", "false"):
        return value.lower() in ("1", "true")
    raise _fail(key, value, "true or false")


def _essential_flag(fields: Mapping[str, Any], key: str) -> bool:
    value = _flag(fields, key)
    if value is None:
        raise StatusFrameError("status frame without %s" % key)
    return value


def _event_code(value: Any) -> int:
    """Decode an event code; ``"0x0"``, ``"0"`` and 0 all stand for none (docs/controller-protocol.md section 4.4)."""
    try:
        code = value if type(value) is int else int(value, 0)
    except (TypeError, ValueError):
        raise _fail("errcode", value, "a hexadecimal number as text") from None
    if not -_MAX_EVENT_CODE <= code <= _MAX_EVENT_CODE:
        raise _fail("errcode", value, "a number of 32 bits")
    return int(code)


def _bank_values(fields: Mapping[str, Any], banks: Tuple[Tuple[IoBank, str], ...]) -> Dict[IoBank, Vector]:
    found: Dict[IoBank, Vector] = {}
    for bank, key in banks:
        values = fields.get(key)
        if values is None:
            continue
        numbers = _array(key, values)
        if numbers is None:
            raise _fail(key, values, "an array of numbers, together within %g" % _MAX_NUMBER)
        found[bank] = numbers
    return found


def _io(fields: Mapping[str, Any]) -> Dict[str, Any]:
    return {"io": IoState(
        digital_inputs=_bank_values(fields, _DIGITAL_INPUTS),
        digital_outputs=_bank_values(fields, _DIGITAL_OUTPUTS),
        analog_inputs=_bank_values(fields, _ANALOG_INPUTS),
        analog_outputs=_bank_values(fields, _ANALOG_OUTPUTS),
        relays=_array("relay_io", fields.get("relay_io")) or (),
        field_buses=_field_buses(fields))}


def _field_buses(fields: Mapping[str, Any]) -> Dict[FieldBus, BusTerminals]:
    """Return the terminals of each field bus in the frame.

    An unknown shape reads as no terminals instead of an error: no real controller has confirmed these fields, and the
    arm is driven without them.
    """
    found: Dict[FieldBus, BusTerminals] = {}
    for bus, keys in _FIELD_BUSES:
        arrays = [fields.get(key) for key in keys]
        if arrays != _NO_ARRAYS:
            found[bus] = BusTerminals(*[_array(key, values) or () for key, values in zip(keys, arrays)])
    return found


def _array(key: str, values: Any) -> Optional[Vector]:
    """Return the numbers of an array as a tuple; None where the value is anything else.

    Terminals seldom change, and a frame has up to 1700 of them: an array that equals the previous one of its key is not
    checked again, and the same tuple is returned, which also makes later comparisons cheap.
    """
    known = _known_arrays.get(key)
    if known is not None and known[0] == values:
        return known[1]
    if not isinstance(values, list) or not _are_numbers(values):
        return None
    numbers = tuple(values)
    _known_arrays[key] = (list(values), numbers)
    return numbers


def _monitored(monitor: Any) -> Tuple[Optional[float], Optional[Vector], Optional[Vector]]:
    """Decode ``monitor_data``: cabinet and joint temperatures, deg C, and joint currents, A.

    See docs/controller-protocol.md section 6.3. The values are only displayed and warned of, so an unknown shape reads
    as unknown values instead of an error.
    """
    if not isinstance(monitor, list) or len(monitor) < 6:
        return None, None, None
    cabinet = float(monitor[2]) if _is_number_within(monitor[2], _MAX_READING) else None
    try:
        rows = monitor[5][:6]
        temperatures, currents = [row[2] for row in rows], [row[0] for row in rows]
    except (TypeError, IndexError, KeyError):
        return cabinet, None, None
    return (cabinet, _floats(temperatures), _floats(currents)) if len(rows) == 6 else (cabinet, None, None)


def _floats(values: List[Any]) -> Optional[Vector]:
    return tuple(map(float, values)) if _are_numbers(values, _MAX_READING) else None


def _wrench(sensor: Any) -> Tuple[Optional[Vector], int]:
    """Decode ``torqsensor``: the contact wrench, N and N m, and the sensor's error (docs/controller-protocol.md section
    6.4).

    A controller without a sensor sends the field, too, with each reading 0; a sensor's raw reading never is. An unknown
    shape reads as no sensor.
    """
    told = sensor[1] if isinstance(sensor, list) and len(sensor) > 1 else None
    if not isinstance(told, list) or len(told) < 4:
        return None, 0
    readings = told[_READINGS]
    for reading in readings:
        if not isinstance(reading, list) or len(reading) != 6 or not _are_numbers(reading, _MAX_READING):
            return None, 0
    error = int(told[1]) if _is_number_within(told[1], _MAX_NUMBER) else 0
    if error or not any(map(any, readings)):
        return None, error
    return tuple(map(float, readings[0])), 0


_steady_part = _KnownPart((
    "powered_on", "enabled", "inpos", "emergency_stop", "protective_stop", "drag_status", "paused", "on_soft_limit",
    "interp_state", "rapidrate", "current_tool_id", "current_user_id", "motion_line", "err_add_line"), _steady)
_position_part = _KnownPart(("joint_actual_position", "joint_position", "actual_position", "instVel"), _positions)
_sensor_part = _KnownPart(("torqsensor",), lambda fields: dict(zip(
    ("wrench", "sensor_error"), _wrench(fields.get("torqsensor")))))
_io_part = _KnownPart([key for banks in (_DIGITAL_INPUTS, _DIGITAL_OUTPUTS, _ANALOG_INPUTS, _ANALOG_OUTPUTS)
                       for _, key in banks] + ["relay_io"] + [key for _, keys in _FIELD_BUSES for key in keys], _io)
