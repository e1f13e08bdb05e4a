"""Commands about settings that are stored and returned, and do nothing else here, but for zeroing the force sensor.

They are those of tool I/O, RS-485, torque sensor, force control, trajectory recording (docs/controller-protocol.md
sections 5.11, 5.15; docs/sdk-client.md section 8). Where the keys of a reply are not known, the setter's keys are used;
the SDK reads a missing key as zero.
"""
import math
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, plain
from jaka_ros_driver.simulation.controller.replies import BadParameter, CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.controller.status_frame import SIGNAL_VALUE, signal_rows

_MAX_SIGNALS = 8
"""Most signals of the tool's RS-485. No source gives a limit; a client that adds for ever is refused."""
_MAX_TRAJECTORIES = 64
"""Most recorded trajectories. No source gives a limit; a client that adds for ever is refused."""


class _Key(NamedTuple):
    """One stored parameter.

    Attributes:
        name: On the wire.
        default: Its value before it is set. Its type is the type that a request must have; a tuple stands for an array
            of that length.
        low: Smallest number taken.
        high: Largest number taken.
    """

    name: str
    default: Any
    low: Optional[float] = None
    high: Optional[float] = None

    def read(self, arguments: Arguments) -> Any:
        """Return the value in a request; raise as ``Arguments`` does, and Refused where it is out of range."""
        if isinstance(self.default, str):
            return arguments.text(self.name)
        if isinstance(self.default, tuple):
            numbers = list(arguments.vector(self.name, len(self.default)))
            self._check(numbers)
            return numbers
        number = arguments.number(self.name) if isinstance(self.default, float) else arguments.integer(self.name)
        self._check([number])
        return number

    def _check(self, numbers: List[float]) -> None:
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        if not all(low <= number <= high for number in numbers):
            raise CommandRefused()


class _Setting(NamedTuple):
    """A pair of commands around stored values.

    Attributes:
        setter: Name of the command that stores.
        getter: Name of the command that returns; "" for none.
        section: Where both are described.
        keys: The parameters that are stored.
        selector: Key that chooses one of several sets of values, from 0; "" where there is only one.
        places: How many such sets there are at most.
    """

    setter: str
    getter: str
    section: str
    keys: Tuple[_Key, ...]
    selector: str = ""
    places: int = 64


_AXES = 6
_ADMITTANCE_KEYS = (
    _Key("opt", 0, 0, 1), _Key("ftUser", 0.0), _Key("ftReboundFK", 0.0), _Key("ftConstant", 0.0),
    _Key("ftNnormalTrack", 0, 0, 1))
"""Keys of the admittance settings in the order of the SDK's structure; that of the reply's lists is a guess."""
_TOOL_DRIVE_KEYS = (_Key("opt", 0, 0, 1), _Key("rigidity", 0.0, 0.0), _Key("rebound", 0.0, 0.0))
_SETTINGS: Tuple[_Setting, ...] = (
    _Setting("set_tio_vout_param", "get_tio_vout_param", "5.11",
             (_Key("tio_vout_ena", 0, 0, 1), _Key("tio_vout_vol", 0, 0, 1))),
    _Setting("set_tio_pin_mode", "get_tio_pin_mode", "5.11", (_Key("pinMode", 0),), "pinType"),
    _Setting("set_rs485_chn_mode", "get_rs485_chn_mode", "5.11", (_Key("chnMode", 0),), "chnId"),
    _Setting("set_rs485_chn_comm", "get_rs485_chn_comm", "5.11", (
        _Key("slaveId", 1), _Key("baudrate", 115200, 1), _Key("databit", 8, 7, 8), _Key("stopbit", 1, 1, 2),
        _Key("parity", 78, 69, 79)), "chn_id"),
    _Setting("set_motion_limit_warning_range", "get_motion_limit_warning_range", "5.15", (
        _Key("range_level", 1, 1, 5),)),
    _Setting("set_torsenosr_brand", "get_torsenosr_brand", "5.15", (_Key("sensor_brand", 1, 1, 3),)),
    _Setting("set_torque_sensor_mode", "get_torque_sensor_mode", "5.15", (_Key("sensor_mode", 0, 0, 1),)),
    _Setting("set_torque_sensor_comm", "get_torque_sensor_comm", "5.15", (
        _Key("type", 0, 0, 1), _Key("ip_addr", ""), _Key("port", 0, 0, 65535))),
    _Setting("set_compliant_type", "get_compliant_type", "5.15", (
        _Key("sensor_compensation", 0, 0, 1), _Key("compliance_type", 0, 0, 2))),
    _Setting("set_torque_sensor_filter", "get_torque_sensor_filter", "sdk-client.md 8", (
        _Key("torqueSensorFilter", 0.0),)),
    _Setting("set_ft_ctrl_frame", "get_ft_ctrl_frame", "sdk-client.md 8", (_Key("ftFrame", 0, 0, 1),)),
    _Setting("set_traj_config", "get_traj_config", "sdk-client.md 8", (
        _Key("acc", 0.0), _Key("rpy_interval", 0.0), _Key("vel", 0.0), _Key("xyz_interval", 0.0))),
    _Setting("enable_admittance_ctrl", "", "sdk-client.md 8", (_Key("enable_flag", 0, 0, 1),)),
    _Setting("disable_force_control", "", "sdk-client.md 8", ()),
    _Setting("set_vel_compliant_ctrl", "", "sdk-client.md 8", (_Key("compliant_ctrl", (0.0,) * 5),)),
    _Setting("set_compliance_condition", "", "sdk-client.md 8", (_Key("compliant_condition", (0.0,) * 6),)),
    _Setting("send_tio_rs_command", "", "5.11", ()),
    _Setting("set_tool_drive_frame", "get_tool_drive_frame", "sdk-client.md 9", (_Key("toolDragFrame", 0, 0, 1),)),
    _Setting("set_fusion_drive_sensitivity_level", "get_fusion_drive_sensitivity_level", "sdk-client.md 9", (
        _Key("sensitivity_level", 0, 0, 5),)),
    _Setting("set_compliant_speed_limit", "get_compliant_speed_limit", "sdk-client.md 9", (
        _Key("speed_limit", 0.0, 0.0), _Key("angular_speed_limit", 0.0, 0.0))),
    _Setting("set_torque_ref_point", "get_torque_ref_point", "sdk-client.md 9", (_Key("ref_point", 0, 0, 1),)),
    _Setting("set_end_sensor_sensitivity_threshold", "get_end_sensor_sensitivity_threshold", "sdk-client.md 9", (
        _Key("threshold_percent", (0.0,) * 6, 0.0, 1.0),)),
    _Setting("set_admit_ctrl_config", "", "sdk-client.md 8", _ADMITTANCE_KEYS, "axis", _AXES),
    _Setting("set_tool_drive_config", "", "sdk-client.md 9", _TOOL_DRIVE_KEYS, "axis", _AXES),
)


def _place(arguments: Arguments, setting: _Setting) -> int:
    place = arguments.integer(setting.selector) if setting.selector else 0
    if not 0 <= place < setting.places:
        raise CommandRefused()
    return place


def _setter(setting: _Setting) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> None:
        place = _place(arguments, setting)
        state.memory.settings[setting.setter, place] = {key.name: key.read(arguments) for key in setting.keys}
    return handle


def _getter(setting: _Setting) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> Reply:
        place = _place(arguments, setting)
        stored = state.memory.settings.get((setting.setter, place), {})
        reply: Dict[str, Any] = {setting.selector: place} if setting.selector else {}
        reply.update((key.name, stored.get(key.name, key.default)) for key in setting.keys)
        return reply
    return handle


def _rows() -> List[CommandSpec]:
    rows = []
    for setting in _SETTINGS:
        rows.append(CommandSpec(setting.setter, setting.section, _setter(setting)))
        if setting.getter:
            rows.append(CommandSpec(setting.getter, setting.section, _getter(setting)))
    return rows


_SOFT_LIMIT_KEYS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def _set_soft_limit(state: ControllerState, arguments: Arguments) -> None:
    limits = arguments.raw("torqueSensorSoftLimit")
    if not isinstance(limits, dict):
        raise BadParameter("torqueSensorSoftLimit is no object")
    numbers = Arguments(limits)
    state.memory.settings["set_torque_sensor_soft_limit", 0] = {key: numbers.number(key) for key in _SOFT_LIMIT_KEYS}


def _soft_limit(state: ControllerState) -> Reply:
    zeros = dict.fromkeys(_SOFT_LIMIT_KEYS, 0.0)
    return {"torqueSensorSoftLimit": state.memory.settings.get(("set_torque_sensor_soft_limit", 0), zeros)}


def _axes(state: ControllerState, setter: str, keys: Tuple[_Key, ...]) -> List[List[Any]]:
    """Return the values that were set for the six axes, each in the order of ``keys``."""
    stored = [state.memory.settings.get((setter, axis), {}) for axis in range(_AXES)]
    return [[values.get(key.name, key.default) for key in keys] for values in stored]


def _admittance(state: ControllerState) -> Reply:
    return {"admitConfig": _axes(state, "set_admit_ctrl_config", _ADMITTANCE_KEYS)}


def _tool_drive(state: ControllerState) -> Reply:
    """Return the keys of the request, each with the values of the six axes.

    The reply's own keys are not known.
    """
    columns = zip(*_axes(state, "set_tool_drive_config", _TOOL_DRIVE_KEYS))
    return {"axis": list(range(_AXES)), **{key.name: list(column) for key, column in zip(_TOOL_DRIVE_KEYS, columns)}}


def _sensor_data(state: ControllerState, arguments: Arguments) -> Reply:
    """Return readings 1 to 3 of the feed, zeros without a sensor; the keys of the reply are not known."""
    kind = arguments.integer("type")
    if not 1 <= kind <= 3:
        raise CommandRefused()
    sensor = state.force_sensor
    reading = (0.0,) * 6 if sensor is None else sensor.raw if kind == 2 else sensor.actual
    return {"type": kind, "torque_sensor_data": list(reading)}


def _names(state: ControllerState, what: str) -> Dict[str, Any]:
    return state.memory.settings.setdefault((what, 0), {})


def _add_signal(state: ControllerState, arguments: Arguments) -> None:
    signals, name = state.memory.signals, arguments.text("tio_signal_name")
    values = {key: arguments.integer(arguments.first_of("tio_signal_" + key, "_" + key, key))
              for key in ("chnId", "sigType", "sigAddr")}
    values["frequency"] = arguments.integer("frequency", 1)
    if name not in signals and len(signals) >= _MAX_SIGNALS:
        raise CommandRefused()
    signals[name] = values


def _delete_signal(state: ControllerState, arguments: Arguments) -> None:
    if state.memory.signals.pop(arguments.text("tio_signal_name"), None) is None:
        raise CommandRefused()


def _signal_list(state: ControllerState) -> Reply:
    """Return an object under the name of each signal, and their number (docs/controller-protocol.md section 5.11)."""
    return {**{name: dict(values, value=SIGNAL_VALUE) for name, values in state.memory.signals.items()},
            "num": len(state.memory.signals)}


def _sample_mode(state: ControllerState, arguments: Arguments) -> None:
    mode, name = arguments.flag("mode"), arguments.text("filename")
    files = _names(state, "trajectories")
    if mode and name not in files:
        if len(files) >= _MAX_TRAJECTORIES:
            raise CommandRefused()
        files[name] = True
    state.memory.settings["set_traj_sample_mode", 0] = {"mode": int(mode)}


def _rename_trajectory(state: ControllerState, arguments: Arguments) -> None:
    files, source, target = _names(state, "trajectories"), arguments.text("src"), arguments.text("dest")
    files.pop(source, None)
    if target not in files and len(files) >= _MAX_TRAJECTORIES:
        raise CommandRefused()
    files[target] = True


def _remove_trajectory(state: ControllerState, arguments: Arguments) -> None:
    if _names(state, "trajectories").pop(arguments.text("fileName"), None) is None:
        raise CommandRefused()


def _generate_trajectory(_state: ControllerState, arguments: Arguments) -> None:
    """Check the name and do nothing: a recorded trajectory has a name here, and no content."""
    arguments.text("fileName")


def _identify_payload(state: ControllerState, arguments: Arguments) -> None:
    """Accept the identification, which ends at once: the simulated sensor measures no load."""
    arguments.vector("jointPosition", 6)
    state.require_motion("start_torq_sensor_payload_identify")


SETTING_COMMANDS: Tuple[CommandSpec, ...] = (
    *_rows(),
    CommandSpec("set_torque_sensor_soft_limit", "sdk-client.md 8", _set_soft_limit),
    CommandSpec("get_torque_sensor_soft_limit", "sdk-client.md 8", plain(_soft_limit)),
    CommandSpec("get_admit_ctrl_config", "sdk-client.md 9", plain(_admittance)),
    CommandSpec("get_tool_drive_config", "sdk-client.md 9", plain(_tool_drive)),
    CommandSpec("get_tool_drive_stat", "sdk-client.md 9", plain(lambda state: {"tool_drive_stat": 0})),
    CommandSpec("get_torque_sensor_data", "sdk-client.md 9", _sensor_data),
    CommandSpec("zero_end_sensor", "5.15", plain(ControllerState.zero_force_sensor)),
    CommandSpec("add_tio_rs_signal", "5.11", _add_signal),
    CommandSpec("del_tio_rs_signal", "5.11", _delete_signal),
    CommandSpec("get_rs485_signal_list", "5.11", plain(_signal_list)),
    CommandSpec("get_tio_signals", "5.11", plain(lambda state: {"signals": signal_rows(state)})),
    CommandSpec("set_traj_sample_mode", "sdk-client.md 8", _sample_mode),
    CommandSpec("get_traj_sample_status", "sdk-client.md 8", plain(
        lambda state: {"sampleStatus": state.memory.settings.get(("set_traj_sample_mode", 0), {}).get("mode", 0)})),
    CommandSpec("get_exist_traj_file_name", "sdk-client.md 9", plain(
        lambda state: {"trajTrackFileName": list(_names(state, "trajectories"))})),
    CommandSpec("rename_traj_file_name", "sdk-client.md 8", _rename_trajectory),
    CommandSpec("remove_traj_file", "sdk-client.md 9", _remove_trajectory),
    CommandSpec("generate_traj_exe_file", "sdk-client.md 8", _generate_trajectory),
    CommandSpec("start_torq_sensor_payload_identify", "sdk-client.md 8", _identify_payload),
    CommandSpec("get_torq_sensor_identify_staus", "sdk-client.md 8", plain(lambda state: {"identify_status": 0})),
    CommandSpec("get_torq_sensor_payload_identify_result", "sdk-client.md 8", plain(
        lambda state: {"mass": 0.0, "centroid": [0.0, 0.0, 0.0]})),
)
