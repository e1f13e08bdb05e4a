"""The node's private parameters: read once, checked, one frozen DriverConfig.

``docs/parameters.md`` is this module's output: ``build/venv/bin/python3 -m jaka_ros_driver.ros.params``.
"""
import dataclasses
import difflib
import ipaddress
import re
import textwrap
from dataclasses import dataclass
from typing import Any, Callable, Iterable, List, Mapping, NamedTuple, Optional, Tuple

from jaka_ros_driver.clearance.workspace import NO_ZONES, load_workspace
from jaka_ros_driver.client.core.motion_guard.motion_check import OFF, STOP, WARN
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import ArmModel, load_model, load_model_file, model_names
from jaka_ros_driver.protocol.ports import PORT_NUMBERS
from jaka_ros_driver.ros.controller_profile import ControllerProfile, profile_from
from jaka_ros_driver.ros.gripper import KEYS, Gripper, gripper_from
from jaka_ros_driver.units import ms_to_s, s_to_ms

DOCUMENTED, VENDOR, VENDOR_2025 = "documented", "vendor", "vendor_2025"
TF_ALL, TF_TOOL, TF_NONE = "all", "tool", "none"
AUDIT_DIR_AUTO = "auto"
_LONGEST_CELL = 120
"""Characters of a cell of the page's table; what is longer stands below it."""

_CLIENT = ClientSettings("")
_HOST_LABEL = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)\Z")
_FRAME = re.compile(r"[A-Za-z][A-Za-z0-9_/]*\Z")
_TOPIC = re.compile(r"[A-Za-z~/][A-Za-z0-9_/]*\Z")
_IDENTITY = re.compile(r"[!-~]{0,256}\Z")
_PREFIX = re.compile(r"([A-Za-z][A-Za-z0-9_/]*)?\Z")


class WrongParameter(JakaError, ValueError):
    """The error that a private parameter is unknown, or has a wrong type or value.

    The driver does not start with it.
    """


class NodeParameter(NamedTuple):
    """The description and the check of a private parameter.

    ``check`` returns a value in the type that the driver uses, and raises ValueError, of which InvalidCommand is one,
    where it is not valid.
    """

    kind: str
    unit: str
    valid: str
    doc: str
    check: Callable[[Any], Any]


def _parameter(default: Any, kind: str, unit: str, valid: str, doc: str, check: Callable[[Any], Any]) -> Any:
    return dataclasses.field(default=default, metadata={"parameter": NodeParameter(kind, unit, valid, doc, check)})


def _valid(is_valid: Callable[[Any], bool]) -> Callable[[Any], Any]:
    def check(value: Any) -> Any:
        if not is_valid(value):
            raise ValueError
        return value
    return check


def _number(default: float, low: float, high: float, unit: str, doc: str) -> Any:
    check = _valid(lambda value: type(value) in (int, float) and low <= value <= high)
    return _parameter(default, "number", unit, "%g to %g" % (low, high), doc, lambda value: float(check(value)))


def _integer(default: int, low: int, high: int, doc: str) -> Any:
    return _parameter(default, "whole number", "", "%d to %d" % (low, high), doc,
                      _valid(lambda value: type(value) is int and low <= value <= high))


def _flag(default: Optional[bool], doc: str) -> Any:
    return _parameter(default, "bool", "", "true or false", doc, _valid(lambda value: type(value) is bool))


def _choice(default: str, choices: Tuple[str, ...], doc: str) -> Any:
    return _parameter(default, "text", "", ", ".join(choices), doc, _valid(lambda value: value in choices))


def _text(default: str, pattern: "re.Pattern[str]", valid: str, doc: str) -> Any:
    return _parameter(default, "text", "", valid, doc,
                      _valid(lambda value: type(value) is str and bool(pattern.match(value))))


def _host(value: Any) -> str:
    if type(value) is not str or len(value) > 253:
        raise ValueError
    if re.match(r"[0-9.]+\Z", value):
        return str(ipaddress.IPv4Address(value))
    if ":" in value:
        address, percent, interface = value.partition("%")
        known = ipaddress.IPv6Address(address)
        if percent and not _HOST_LABEL.match(interface):
            raise ValueError
        return str(known.ipv4_mapped or known) + percent + interface
    if not all(_HOST_LABEL.match(label) for label in value.split(".")):
        raise ValueError
    return value


def _model(value: Any) -> str:
    if type(value) is not str:
        raise ValueError
    return load_model(value).name


def _model_file(value: Any) -> str:
    if type(value) is not str:
        raise ValueError
    if value:
        load_model_file(value)
    return value


def _workspace(value: Any) -> str:
    if type(value) is not str:
        raise ValueError
    if value:
        load_workspace(value)
    return value


def _audit_dir(value: Any) -> str:
    if type(value) is not str or "\0" in value or not (value in ("", AUDIT_DIR_AUTO) or value.startswith(("/", "~/"))):
        raise ValueError
    return value


def _ip_address(value: Any) -> str:
    if type(value) is not str:
        raise ValueError
    return str(ipaddress.ip_address(value))


def _controller_manager(value: Any) -> str:
    text = str(value).lower() if type(value) in (bool, str) else ""
    if text not in ("auto", "true", "false"):
        raise ValueError
    return text


def _io_index_base(value: Any) -> Optional[int]:
    bases = {"auto": None, "0": 0, "1": 1}
    if type(value) not in (str, int) or str(value) not in bases:
        raise ValueError
    return bases[str(value)]


@dataclass(frozen=True)
class DriverConfig:
    """Everything that a user can set; the fields are the private parameters, documented in docs/parameters.md."""

    ip: str = _parameter(
        "127.0.0.1", "text", "", "host name or IP address", "Address of the controller. Where it is not set and "
        "~simulator is not either, the parameter `ip` of the node's namespace, or of the nearest one above it that has "
        "one, is taken instead, as the maker's driver does; the log says so.", _host)
    command_port: int = _integer(PORT_NUMBERS["command"], 1, 65535, "Its request and reply port.")
    status_port: int = _integer(PORT_NUMBERS["status"], 1, 65535, "Its status feed.")
    model: str = _parameter("zu7", "text", "", "one of " + ", ".join(model_names()),
                            "Model of the arm; every command is checked against its limits.", _model)
    dh_file: str = _parameter("", "text", "", "empty, or path of a model file",
                              "A model file of your own (calibrated arm), instead of `model`.", _model_file)
    interface: str = _choice(DOCUMENTED, (DOCUMENTED, VENDOR, VENDOR_2025),
                             "Follow docs/interface.md, or the maker's own ROS driver where the two differ: that of "
                             "2024, or its newest of 2025.")
    blocking: bool = _flag(True, "linear_move and joint_move answer when the motion has ended; false: on acceptance.")
    activate_frames: Optional[bool] = _flag(None, "set_toolframe and set_userframe also make the frame the active one. "
                                                  "Default: true; false with interface vendor and vendor_2025.")
    auto_enable: bool = _flag(True, "Power and enable the arm once, when it is first seen without a fault.")
    first_start_only: bool = _flag(False, "auto_enable acts only at the first start since the computer was started. "
                                          "The launch files set it with respawn, so that a restart powers no arm.")
    guard: bool = _flag(True, "A guard process stops the arm when the driver dies or hangs.")
    link_loss_stop: float = _number(
        _CLIENT.link_loss_stop, 0.0, 10.0, "s", "The controller is asked to stop the arm this time after it has "
        "lost this driver during a motion; 0: it is not asked.")
    io_index_base: Optional[int] = _parameter(
        None, "text or number", "", "auto, 0, 1", "Index with which the controller counts its first input and output. "
        "Default: auto, 1 for controllers from version 1.7 on, else 0; which is right is not known for certain. With "
        "interface vendor auto is 0 and with vendor_2025 it is 1, on every controller, as the maker's drivers send it; "
        "then the terminal that is seen to change counts as the one that was meant, and with 1 get_io asks the "
        "controller with the same index.",
        _io_index_base)
    controller_profile: Optional[ControllerProfile] = _parameter(
        None, "text", "", "empty, or path of a probe.json", "A report of jaka_probe on this controller "
        "(first_contact.md). It sets io_index_base where that is auto and the interface is documented, and how late "
        "the arm may begin a motion; diagnostics tell what it has settled and what stays assumed. Default: none. The "
        "launch files have an argument of this name; its value none is no report.", profile_from)
    simulator: str = _text("", _IDENTITY, "empty, or the identity of a simulated controller",
                           "With it, the driver uses no controller but the simulated one of this identity; set by the "
                           "launch files.")
    publish_rate: float = _number(1.0 / _CLIENT.feed_period, 1.0, 500.0, "Hz",
                                  "Rate of the state topics: samples of a slower feed are repeated, of a faster one "
                                  "left out. The controller is asked for 125 Hz at least.")
    stale_after: float = _number(_CLIENT.stale_after, 0.02, 10.0, "s",
                                 "A state that is older is neither published nor used.")
    joint_states_topic: str = _text("joint_states", _TOPIC, "a ROS name",
                                    "Topic for robot_state_publisher and similar nodes. Its velocity is the "
                                    "controller's where it reports one, else a filtered difference.")
    publish_tf: str = _choice(TF_ALL, (TF_ALL, TF_TOOL, TF_NONE),
                              "Transforms that are published. all: base to flange, flange to active tool, base to "
                              "user frame; tool: the same without the flange, which robot_state_publisher gives; "
                              "none.")
    publish_description: bool = _flag(True, "Set robot_description to a URDF made from the model, where there is none.")
    base_frame: str = _text("base_link", _FRAME, "a frame name", "Frame of the arm's base.")
    flange_frame: str = _text("tool0", _FRAME, "a frame name", "Frame of the flange.")
    tool_frame: str = _text("tool", _FRAME, "a frame name", "Frame of the active tool.")
    frame_prefix: str = _text("", _PREFIX, "empty, or the start of a frame name",
                              "In front of every frame and of the joints of joint_states; for several arms.")
    connect_timeout: float = _number(_CLIENT.connect_timeout, 0.05, 30.0, "s", "Longest wait for a connection.")
    reply_timeout: float = _number(_CLIENT.reply_timeout, 0.05, 30.0, "s",
                                   "Longest wait for a reply of the controller; then the link is made again.")
    silence_timeout: float = _number(_CLIENT.silence_timeout, 0.1, 30.0, "s",
                                     "The status feed counts as lost after this time without a byte.")
    motion_timeout: float = _number(_CLIENT.motion_timeout, 0.1, 86400.0, "s", "A motion that takes longer is stopped.")
    power_timeout: float = _number(_CLIENT.power_timeout, 0.1, 300.0, "s", "Longest wait for the drives' power.")
    enable_timeout: float = _number(_CLIENT.enable_timeout, 0.1, 300.0, "s", "Longest wait for the brakes.")
    jog_timeout: float = _number(_CLIENT.jog_timeout, 0.05, _CLIENT.jog_timeout, "s",
                                 "A jog stops this time after the last jog call.")
    servo_timeout: float = _number(_CLIENT.servo_timeout, 0.05, 3600.0, "s",
                                   "Servo mode is left this time after the last servo target.")
    servo_ahead: float = _number(_CLIENT.servo_ahead, 0.008, 2.0, "s",
                                 "A servo target is refused unless the arm can reach it within this time, so that "
                                 "the motion ends soon after its client.")
    servo_max_joint_jump: float = _number(_CLIENT.servo_max_joint_jump, 0.0001, 6.3, "rad",
                                          "Largest distance of a servo target from the frame sent last, each joint.")
    servo_max_linear_jump: float = _number(_CLIENT.servo_max_linear_jump, 0.0001, 2.0, "m",
                                           "The same for the position of a Cartesian target.")
    servo_max_angular_jump: float = _number(_CLIENT.servo_max_angular_jump, 0.0001, 3.2, "rad",
                                            "The same for its orientation.")
    jog_max_joint_speed: float = _number(_CLIENT.jog_max_joint_speed, 0.001, 1.0, "rad/s",
                                         "Highest speed of a joint by jog_joints; more is slowed down to it.")
    jog_max_linear_speed: float = _number(
        _CLIENT.jog_max_linear_speed, 0.001, 0.6, "m/s", "Highest speed of the tool by jog_twist; more is slowed down "
        "to it. The default is the reduced speed of ISO 10218-1; nothing guarantees it.")
    jog_max_angular_speed: float = _number(_CLIENT.jog_max_angular_speed, 0.001, 1.0, "rad/s",
                                           "The same for its turning.")
    stream_ahead: int = _integer(
        _CLIENT.stream_ahead, 0, 4, "Cycles of 8 ms by which the frames of trajectories and velocity jogs are sent "
        "ahead. A driver that is late by no more leaves no gap in the stream. A pause, a cancel or a jog's message is "
        "followed that much later; a controller that keeps fewer frames ignores the others (trajectories.md).")
    trajectory_controller: str = _text(
        "", _PREFIX, "empty, or a ROS name", "Namespace of the trajectory action, `NAME/follow_joint_trajectory`, and "
        "of the topics `NAME/command` and `NAME/state`. Empty: jaka_MODEL_controller, as in the maker's packages for "
        "MoveIt.")
    industrial_names: bool = _flag(False, "Trajectories are taken under the names of ROS-Industrial, too. They are "
                                          "joint_trajectory_action, joint_path_command, feedback_states and "
                                          "stop_motion.")
    controller_manager: str = _parameter(
        "auto", "text", "", "auto, true, false", "Offer the names of ros_control's controller_manager beside the "
        "trajectory controller. Software such as rqt_joint_trajectory_controller finds it there. Not where one of the "
        "names is served already. auto: 10 s after the start, so that a real controller_manager of the cell is there "
        "first; false where one is started later.", _controller_manager)
    trajectory_start_tolerance: float = _number(
        _CLIENT.trajectory_start_tolerance, 0.0001, 1.0, "rad",
        "A trajectory is refused where the arm is farther from its first point.")
    late_stamp: float = _number(
        _CLIENT.late_stamp, 0.0, 10.0, "s", "A trajectory whose stamp is up to this old is followed as a whole, that "
        "much later. This is for an arm that is still at its first point; older ones are refused there.")
    trajectory_overshoot: str = _choice(
        _CLIENT.trajectory_overshoot, ("scale", "refuse"), "A trajectory that passes a limit of speed or acceleration "
        "by less than 25 %. It is slowed there, on the same way, or refused.")
    trajectory_path_tolerance: float = _number(
        0.0, 0.0, 1.0, "rad", "An arm that leaves its trajectory by more is stopped; 0: by more than 0.04 rad. A goal "
        "may name others.")
    trajectory_goal_tolerance: float = _number(
        0.01, 0.0, 1.0, "rad", "So near to the last point a trajectory must end; 0: anywhere. A goal may name others.")
    trajectory_goal_time: float = _number(
        1.0, 0.0, 60.0, "s", "So long after a trajectory's time the arm must rest there. A goal may name another.")
    gripper: Optional[Gripper] = _parameter(
        None, "keys with values", "", ", ".join(KEYS), "A gripper on outputs of two states or an analog one, with an "
        "action for MoveIt (gripper.md). Default: none, and no action.", gripper_from)
    guard_motion: str = _choice(
        _CLIENT.guard_motion, (STOP, WARN, OFF),
        "What is done with a motion that would hit the arm itself or a zone, or cannot be followed. stop: it is "
        "refused before it begins, and braked while it lasts. warn: it is logged, and sent. off: nobody looks. It is "
        "no safety function (motion_guard.md).")
    workspace: str = _parameter(
        "", "text", "", "empty, or path of a YAML file", "Zones around the arm that it is kept out of or within, and "
        "the shape of its tool (motion_guard.md). Empty: none.", _workspace)
    realtime_priority: int = _integer(
        0, 0, 99, "SCHED_FIFO priority of the driver's threads; needs the right to it (limit rtprio). Servo frames "
        "then keep their interval beside other load. 0 leaves the scheduler as it is.")
    audit_dir: str = _parameter(
        AUDIT_DIR_AUTO, "text", "", "auto, empty, or an absolute path", "Folder of the audit logs, which has a folder "
        "for each controller (audit.md). auto: jaka_audit in ROS_HOME, else in ~/.ros. Empty: no audit log.",
        _audit_dir)
    audit_days: float = _number(1826.0, 0.0, 36500.0, "days", "Files of the audit log whose last line is older are "
                                "deleted, after a line that says so; 0: never.")
    metrics_port: int = _integer(
        0, 0, 65535, "Port of a page for Prometheus, `http://ADDRESS:PORT/metrics` (operation.md). It needs Python's "
        "prometheus_client, and nothing can be set through it. 0: none.")
    metrics_address: str = _parameter(
        "127.0.0.1", "text", "", "an IP address", "Address of this computer at which that page listens. The default "
        "serves this computer alone, 0.0.0.0 or :: whoever reaches it.", _ip_address)

    @property
    def is_vendor(self) -> bool:
        """True where the interface is that of the maker's own driver, of 2024 or 2025."""
        return self.interface != DOCUMENTED

    @property
    def is_vendor_2025(self) -> bool:
        """True where the interface is that of the maker's driver of 2025."""
        return self.interface == VENDOR_2025

    @property
    def sent_index_base(self) -> Optional[int]:
        """The index on the wire of the first terminal; None where the controller's version tells.

        A parameter that sets it goes before the maker's drivers, and these before a profile of the controller.

        SDK 2.1.11, of the maker's driver of 2024, sends its caller's index; 2.1.14, of that of 2025, the index plus 1
        (docs/controller-protocol.md section 5.11).
        """
        if self.io_index_base is not None:
            return self.io_index_base
        if self.is_vendor:
            return int(self.is_vendor_2025)
        return None if self.controller_profile is None else self.controller_profile.io_index_base

    @property
    def is_io_base_set(self) -> bool:
        """True where a parameter or the interface has set the index of the first terminal."""
        return self.io_index_base is not None or self.is_vendor

    @property
    def asks_for_terminals(self) -> bool:
        """True where get_io asks the controller, as SDK 2.1.14 does, and does not look into the status frame."""
        return self.is_vendor and self.sent_index_base == 1

    @property
    def activates_frames(self) -> bool:
        """True where a frame that is set also becomes the active one."""
        return not self.is_vendor if self.activate_frames is None else self.activate_frames

    @property
    def trajectory_controller_name(self) -> str:
        """The namespace of the trajectory action."""
        return self.trajectory_controller or "jaka_%s_controller" % re.sub(r"[^A-Za-z0-9_]", "_", self.arm_model().name)

    def client_settings(self) -> ClientSettings:
        """Return the settings of the client."""
        settings = ClientSettings(
            host=self.ip,
            feed_period=min(_CLIENT.feed_period, ms_to_s(max(1.0, round(s_to_ms(1.0 / self.publish_rate))))),
            **{f.name: getattr(self, f.name) for f in dataclasses.fields(ClientSettings)
               if hasattr(self, f.name)})
        seen = self.controller_profile
        return dataclasses.replace(
            settings, start_delay=(seen.start_delay if seen else None) or 0.0,
            io_index_base=self.sent_index_base, takes_io_as_counted=self.is_vendor,
            workspace=load_workspace(self.workspace) if self.workspace else NO_ZONES)

    def arm_model(self) -> ArmModel:
        """Return the arm, from ``dh_file`` or by its name; raise InvalidCommand where the file is wrong by now."""
        return load_model_file(self.dh_file) if self.dh_file else load_model(self.model)


def table() -> List[Tuple[str, Any, NodeParameter]]:
    """Return name, default and description of every parameter."""
    return [(f.name, f.default, f.metadata["parameter"]) for f in dataclasses.fields(DriverConfig)]


def config_from(values: Mapping[str, Any]) -> DriverConfig:
    """Return the configuration from private parameters; those that are not set have their defaults.

    Raises:
        WrongParameter: It names unknown parameters with the nearest known, wrong values with what is valid.
    """
    known = {name: parameter for name, _, parameter in table()}
    wrong: List[str] = []
    checked = {}
    for name, value in sorted(values.items()):
        if name not in known:
            wrong.append("unknown parameter ~%s; did you mean ~%s?" % (name, _nearest(name, known)))
            continue
        try:
            checked[name] = known[name].check(value)
        except ValueError as error:
            wrong.append(_refusal(name, value, known[name], str(error)))
    config = DriverConfig(**checked)
    if config.command_port == config.status_port:
        wrong.append("parameters ~command_port and ~status_port are both %d; they must differ" % config.command_port)
    if wrong:
        raise WrongParameter("; ".join(wrong))
    return config


def with_common_ip(values: Mapping[str, Any], name: str, common: Any) -> Tuple[Mapping[str, Any], str]:
    """Return the private parameters with the address that the maker's driver would take, and what the log must say.

    Args:
        values: The private parameters that are set.
        name: Full name of the parameter ``ip`` that the maker's driver would read; "" where there is none.
        common: Its value.

    Raises:
        WrongParameter: It would be taken and is no address: it may belong to something else.
    """
    if not name:
        return values, ""
    own = values.get("ip", "127.0.0.1")
    if "ip" in values or values.get("simulator"):
        return values, "" if common == own else "%s is %.100r, and is not used: ~ip is %.100r" % (name, common, own)
    try:
        address = _host(common)
    except ValueError:
        raise WrongParameter(
            "~ip is not set, and %s is %.100r; valid: host name or IP address. Where it belongs to something else, "
            "set ~ip of this node" % (name, common)) from None
    return {**values, "ip": address}, "~ip is not set: the controller is the one that %s names, %s" % (name, address)


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return the known name that has most words in common with this one; among several the most similar."""
    words = set(name.lower().split("_"))
    return max(known, key=lambda k: (len(words & set(k.split("_"))), difflib.SequenceMatcher(None, name, k).ratio()))


def _refusal(name: str, value: Any, parameter: NodeParameter, why: str) -> str:
    unit = " " + parameter.unit if parameter.unit else ""
    text = "parameter ~%s is %r; valid: %s, %s%s" % (name, value, parameter.kind, parameter.valid, unit)
    return text + (" (%s)" % why if why else "")


def markdown() -> str:
    """Return the documentation of all parameters: the content of docs/parameters.md."""
    lines = ["# Private parameters of the driver", "",
             "What can be set when the driver starts. Parameters are read once; with a wrong value or an unknown",
             "name the driver does not start, and says which values are valid. An argument of the launch file sets the",
             "parameter of its name (`roslaunch --ros-args jaka_ros_driver robot_start_launch.launch` lists them); in",
             "a launch file of your own it is a line of the node:", "", "```xml",
             '<param name="model" value="zu12"/>', "```", "",
             "Before the first start think about `ip`, `model`, `dh_file` and `auto_enable`",
             "([operation.md](operation.md#start-at-boot)). At the driver itself `_model:=zu12` sets a parameter. It",
             "does not start with `_model:=` without a value, nor with `model:=zu12`: rospy would take the default",
             "for them. roslaunch leaves out `ip:=` without a value before a launch file can see it: then the arm is a",
             "simulated one.", "",
             "This page is made from the code with",
             "`build/venv/bin/python3 -m jaka_ros_driver.ros.params > docs/parameters.md`.", "",
             "| parameter | type | unit | default | valid | meaning |", "|---|---|---|---|---|---|"]
    notes = []
    for name, default, parameter in table():
        meaning, rest = _first_sentences(parameter.doc)
        valid = parameter.valid
        if len(valid) > _LONGEST_CELL:
            valid, rest = "see below", " ".join(filter(None, [rest, "Valid: %s." % valid]))
        lines.append("| `~%s` | %s | %s | %s | %s | %s |" % (
            name, parameter.kind, parameter.unit, _shown(default), valid, meaning))
        if rest:
            notes.append(textwrap.fill("- `~%s`: %s" % (name, rest), 118, subsequent_indent="  ",
                                       break_long_words=False, break_on_hyphens=False))
    return "\n".join([*lines, "", "More on some of them:", "", *notes]) + "\n"


def _first_sentences(text: str) -> Tuple[str, str]:
    """Split a text into the sentences that fit into a cell of a table and the rest, which may be empty."""
    if len(text) <= _LONGEST_CELL:
        return text, ""
    end = text.rindex(". ", 0, _LONGEST_CELL) + 1
    return text[:end], text[end + 1:]


def _shown(default: Any) -> str:
    if default is None:
        return "see below"
    if isinstance(default, bool):
        return "`true`" if default else "`false`"
    return "`%g`" % default if isinstance(default, float) else "`%s`" % (default if default != "" else '""')


if __name__ == "__main__":
    print(markdown(), end="")
