"""The points on which a cell may depend on the maker's driver, each with its meaning there and what to do here."""
import re
from typing import Dict, Iterator, List, NamedTuple, Tuple


class Subject(NamedTuple):
    """A point on which a cell may depend: what it means with the maker's driver, and what to do for this one."""

    title: str
    means: str
    todo: str


class CellFinding(NamedTuple):
    """A place in a file: subject, line from 1, the bytes that are there."""

    subject: str
    line: int
    text: bytes


SUBJECTS: Dict[str, Subject] = {
    "start": Subject(
        "the maker's driver is started", "package jaka_driver: without a model, with the global parameter ip.",
        "--write puts jaka_ros_driver, interface, model and ip here. A command line in code or in a script: by hand."),
    "names": Subject(
        "a driver with another name, or in a namespace: its names move",
        "every service and topic is /jaka_driver/..., whatever the node's name and namespace.",
        "They follow both. By hand: name the node jaka_driver, outside of a namespace; or change who uses its names."),
    "other_program": Subject(
        "another executable of the package jaka_driver", "a client or example of the maker's.",
        "It is not in this package: keep the maker's package for it, or leave it out."),
    "other_file": Subject(
        "another file of the package jaka_driver", "a file of the maker's.",
        "It is not in this package: keep the maker's package for it, or copy the file."),
    "sdk": Subject(
        "the maker's SDK in your code", "headers and library of the package jaka_driver, or its Python module jkrc.",
        "They are not in this package. Where nothing logs in, leave the include and the library out. Where something "
        "does (login, login_in), it takes the controller from the driver, which serves one client: use the services."),
    "unnamed": Subject(
        "a client whose service is named elsewhere", "the type is one of the services below; the name is a parameter.",
        "Look up its value in launch file, YAML or default, and read there what of that service differs."),
    "depends": Subject(
        "dependency on jaka_driver", "the package needs the maker's to be built or run.",
        "Name jaka_ros_driver instead, as exec_depend."),
    "moveit_server": Subject(
        "the maker's MoveIt server", "it drives the arm beside or instead of the maker's driver.",
        "Leave it out: the driver offers the same action, and the controller serves one client (docs/moveit.md)."),
    "ip": Subject(
        "the global parameter ip", "the address that the maker's driver goes to; 10.5.5.100 where there is none.",
        "--write sets the driver's own ~ip. The global one is read only where ~ip is not set, and the launch files of "
        "this package do not set it: who else reads it needs it set by the cell."),
    "servo_p": Subject(
        "servo_p", "each target is an increment: mm, and roll pitch yaw in rad.",
        "Nothing with interface vendor or vendor_2025 (documented: absolute, in m). Between servo_j and servo_p the "
        "arm must rest: leave servo mode and enter it again."),
    "servo_j": Subject(
        "servo_j", "each target is an increment, rad.",
        "Nothing with interface vendor or vendor_2025 (documented: absolute)."),
    "linear_move": Subject(
        "linear_move: its orientation", "driver of 2024: ends at the inverse of the rotation vector's rotation; of "
        "2025: roll pitch yaw, rad.", "Nothing with the interface of the driver that the cell was written for."),
    "frames": Subject(
        "set_toolframe, set_userframe", "stored, not made active; the rotation vector arrives inverted "
        "(docs/sdk-client.md, section 7).",
        "Stored only as there, with interface vendor or vendor_2025; but the rotation is the vector's own: where it is "
        "not zero, turn the signs of its three numbers."),
    "tool_position": Subject(
        "tool_position: type and units", "driver of 2024: TwistStamped, mm, roll pitch yaw in degrees; of 2025: "
        "PoseStamped, mm, quaternion.", "Nothing with the interface of the driver that the cell was written for."),
    "clear_err": Subject(
        "clearing errors", "the service does not exist there.",
        "Here /jaka_driver/clear_err does; an arm that was stopped needs power and enable after it."),
    "drag": Subject(
        "hand guiding", "the service is drag_move; in the document drag_mode.", "Nothing: both names are served."),
    "jog": Subject(
        "jog: its speed", "read from mvacc; mvvelo is ignored.",
        "The speed is mvvelo, and mvacc only where mvvelo is 0: set mvvelo to 0, or to the same."),
    "io": Subject(
        "set_io, get_io: the index", "driver of 2024 (SDK 2.1.11): sent as it is; of 2025 (SDK 2.1.14): index + 1, on "
        "every firmware.", "The same with interface vendor and vendor_2025; the first set_io of a session logs which "
        "terminal was seen to change: compare it with the wiring. ~io_index_base sets it (docs/migration.md)."),
}
_SPEAKS_OF_IT = re.compile(rb"jaka_driver|jaka_msgs")
_NAME = rb"[\"'/]%s\b"
_DIFFERING_TYPES = rb"(?:Move|ServoMove|SetIO|GetIO|SetTcpFrame|SetUserFrame)"
_SDK = re.compile(rb"\bJAKAZuRobot\b|\blibjakaAPI\b|\bjakaAPI\b|\bjaka_driver/(?:jkerr|jktypes|conversion)\.h|"
                  rb"\bimport\s+jkrc\b|\bjkrc\.RC\b|\blogin_in\s*\(")
_PATTERNS = (
    ("start", rb"\b(?:roslaunch|rosrun)\s+(?:-\S+\s+)*jaka_driver\b|['\"]jaka_driver['\"]\s*,\s*['\"](?:jaka_driver|"
              rb"robot_start_launch\.launch)['\"]"),
    ("depends", rb"<\w*depend\b[^>]*>\s*jaka_driver\s*<|^\s*jaka_driver\s*$|COMPONENTS\b[^)]*\bjaka_driver\b"),
    ("moveit_server", rb"\bmoveit_server(?:\.launch)?\b"),
    ("unnamed", rb"\bServiceProxy\(\s*[\w.\[\]]+\s*,\s*(?:[\w.]+\.)?" + _DIFFERING_TYPES + rb"\s*[,)]|"
                rb"\bserviceClient\s*<\s*jaka_msgs::" + _DIFFERING_TYPES + rb"\s*>\s*\(\s*[A-Za-z_]"),
    ("servo_p", _NAME % rb"servo_p"), ("servo_j", _NAME % rb"servo_j"),
    ("linear_move", _NAME % rb"linear_move"), ("frames", _NAME % rb"set_(?:tool|user)frame"),
    ("tool_position", _NAME % rb"tool_position"),
    ("clear_err", rb"\bClearErr(?:or)?\b|" + _NAME % rb"clear_err(?:or)?"), ("drag", _NAME % rb"drag_mo(?:d|v)e"),
    ("jog", _NAME % rb"jog"), ("io", _NAME % rb"[sg]et_io"),
)
_IN_SOURCES: Tuple[Tuple[str, "re.Pattern[bytes]"], ...] = tuple(
    (subject, re.compile(pattern)) for subject, pattern in _PATTERNS)
_SERVICES = tuple((subject, pattern) for subject, pattern in _IN_SOURCES if subject in (
    "servo_p", "servo_j", "linear_move", "frames", "tool_position", "clear_err", "drag", "jog", "io"))
_GLOBAL_IP = re.compile(rb"(?:\b[gs]et_?[pP]aram(?:Cached)?\s*\(|\bparam(?:<[^<>]*>)?\s*\(|\brosparam\s+[gs]et)"
                        rb"\s*[\"']?/?ip\b")
_COMMENTS = {".py": (b"#",), ".sh": (b"#",), ".yaml": (b"#",), ".cpp": (b"//", b"*", b"/*")}
_TYPES = (("vendor_2025", re.compile(rb"\bPoseStamped\b")), ("vendor", re.compile(rb"\bTwistStamped\b")))


def in_source(data: bytes, kind: str) -> Iterator[CellFinding]:
    """Yield what a source file, script or manifest has of the maker's driver.

    kind: Ending of its name, which tells how comments begin: ".py", ".sh", ".yaml", ".cpp", or another.
    """
    speaks_of_it = _SPEAKS_OF_IT.search(data) is not None
    comments = _COMMENTS.get(kind, ())
    for number, line in enumerate(data.split(b"\n"), 1):
        if comments and line.lstrip().startswith(comments):
            continue
        if speaks_of_it:
            for subject, pattern in _IN_SOURCES:
                if pattern.search(line):
                    yield CellFinding(subject, number, line)
        if _SDK.search(line):
            yield CellFinding("sdk", number, line)
        if _GLOBAL_IP.search(line):
            yield CellFinding("ip", number, line)


def services_in(text: bytes) -> List[str]:
    """Return the subjects of the driver's services and topics that a value in a launch file names."""
    return [subject for subject, pattern in _SERVICES if pattern.search(b"/" + text)] if b"jaka_driver/" in text else []


def interfaces_seen(data: bytes, findings: List[CellFinding]) -> List[str]:
    """Return the interfaces whose type of tool_position a source file names, where it reads that topic."""
    if not any(one.subject == "tool_position" for one in findings):
        return []
    return [interface for interface, pattern in _TYPES if pattern.search(data)]
