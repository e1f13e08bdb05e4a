"""The maker's packages in a launch file of a cell, and the edits with which it starts this driver instead."""
import re
from dataclasses import dataclass, field
from typing import List, Optional

from jaka_migration.findings import CellFinding, services_in
from jaka_migration.launch_file import Edit, LaunchElement, elements, insertion, with_edits

_FIND = re.compile(r"find\s*\(?\s*['\"]?jaka_driver\b")
_FIND_BYTES = re.compile(rb"\$\(\s*find\s+(jaka_driver)\s*\)")
_DRIVERS_FILE = re.compile(r"\$\(\s*find\s+(jaka_driver|jaka_ros_driver)\s*\)/launch/robot_start_launch\.launch\Z")
_IP_IN_YAML = re.compile(rb"^\s*/?ip\s*:", re.MULTILINE)
_OURS = b"jaka_ros_driver"


@dataclass(frozen=True)
class Wanted:
    """The parameters with which the driver is to be started; ``ip`` is "" where the files have it."""

    interface: str
    model: str
    ip: str = ""


@dataclass
class ExaminedLaunchFile:
    """One launch file as it was read.

    Attributes:
        findings: What it has of the maker's packages.
        text: Its bytes with the edits; the same bytes where there is nothing to change, or something stands against it.
        against: Reasons for which nothing is changed, each with its line.
        drivers: How many drivers it starts.
        takes_ip: How many of them get the address of ``Wanted``.
    """

    findings: List[CellFinding] = field(default_factory=list)
    text: bytes = b""
    against: List[str] = field(default_factory=list)
    drivers: int = 0
    takes_ip: int = 0


def examine(data: bytes, wanted: Optional[Wanted]) -> ExaminedLaunchFile:
    """Return what a launch file has, and its bytes as ``wanted`` (None: as they are).

    Raises:
        UnreadableLaunchFile: It cannot be read as XML.
    """
    result = ExaminedLaunchFile()
    edits: List[Edit] = []
    every = elements(data)
    for one in every:
        _look(data, one, result)
        kind = _kind(one)
        if wanted is not None and _is_hidden_start(one):
            result.against.append("line %d: the maker's driver is started in a way that is changed by hand" % one.line)
        if kind:
            result.drivers += 1
            if wanted is not None:
                _change(data, one, "param" if kind == "node" else "arg", wanted, result, edits)
    result.text = with_edits(data, edits) if not result.against else data
    if edits and not result.against:
        elements(result.text)  # what is written must be XML as before
    return result


def _kind(one: LaunchElement) -> str:
    """Return "node" or "include" for an element that starts the driver, the maker's or this one; "" for any other."""
    if one.tag == "node" and one.get("pkg") in ("jaka_driver", "jaka_ros_driver") and one.get("type") == "jaka_driver":
        return "node"
    return "include" if one.tag == "include" and _DRIVERS_FILE.match(one.get("file")) else ""


def _is_hidden_start(one: LaunchElement) -> bool:
    """Return whether the maker's driver is named where only roslaunch can tell what starts with it."""
    return (not _kind(one) and "robot_start_launch" in one.get("file") and "jaka_driver" in one.get("file")
            or one.tag == "arg" and "jaka_driver" in (one.get("default"), one.get("value")))


def _moves(one: LaunchElement) -> bool:
    """Return whether an element starts the maker's driver under a name or namespace that only this driver goes by."""
    kind = _kind(one)
    if not kind or one.get("pkg") == "jaka_ros_driver" or "jaka_ros_driver" in one.get("file"):
        return False
    for around in [one, *one.ancestors()]:
        if around.get("ns").strip("/"):
            return True
        if around.get("ns"):  # the root: what is around it counts no more
            break
    return kind == "node" and one.get("name") != "jaka_driver"


def _look(data: bytes, one: LaunchElement, result: ExaminedLaunchFile) -> None:
    """Note what one element has of the maker's packages."""
    def found(subject: str) -> None:
        result.findings.append(CellFinding(subject, one.line, data[one.begin:one.head_end]))

    kind = _kind(one)
    if (kind == "node" and one.get("pkg") == "jaka_driver") or _is_hidden_start(one):
        found("start")
    elif one.get("pkg") == "jaka_driver":
        found("other_program")
    if _moves(one):
        found("names")
    for attribute in one.attributes.values():
        if _FIND.search(attribute.value) and not _is_hidden_start(one):
            found("start" if kind == "include" else "other_file")
        for subject in services_in(attribute.value.encode()):
            found(subject)
    if one.tag == "node" and one.get("pkg") == "jaka_planner" or "moveit_server.launch" in one.get("file"):
        found("moveit_server")
    if _is_global_ip(one) or (one.tag == "rosparam" and (
            one.get("param") in ("ip", "/ip") or _IP_IN_YAML.search(data, one.head_end, one.close))
            and not any(around.tag == "node" for around in one.ancestors())):
        found("ip")


def _is_global_ip(one: LaunchElement) -> bool:
    return one.tag == "param" and one.get("name") in ("ip", "/ip") and not any(
        around.tag == "node" for around in one.ancestors())


def _change(data: bytes, one: LaunchElement, child: str, wanted: Wanted, result: ExaminedLaunchFile,
            edits: List[Edit]) -> None:
    """Add the edits of one element that starts the driver, or what stands against them."""
    here = "line %d: " % one.line
    if child == "param" and one.get("args"):
        result.against.append(here + "the node has args=\"%s\", which this driver does not take" % one.get("args"))
    if _moves(one):
        result.against.append(here + "the maker's driver serves /jaka_driver/... whatever its name and namespace, this "
                              "one moves its names with them")
    if one.get("pkg") == "jaka_driver":
        edits.append(Edit(one.attributes["pkg"].begin, one.attributes["pkg"].end, _OURS))
    for attribute in one.attributes.values():
        for found in _FIND_BYTES.finditer(data, attribute.begin, attribute.end):
            edits.append(Edit(found.start(1), found.end(1), _OURS))
    kind = b' type="str"' if child == "param" else b""
    lines = []
    for name, value in (("interface", wanted.interface), ("model", wanted.model)):
        there = [has for has in one.children if has.tag == child and has.get("name") == name]
        if not there:
            lines.append(b'<%s name="%s"%s value="%s"/>' % (child.encode(), name.encode(), kind, value.encode()))
        for has in there:
            if _is_conditional(has):  # without it the driver's default stands: motions mean another thing
                result.against.append("line %d: %s is set under a condition" % (has.line, name))
            elif has.get("value") != value:
                result.against.append("line %d: %s is %r already, and %r is asked for" % (
                    has.line, name, has.get("value"), value))
    address = _address(data, one, child, wanted, result)
    if address:
        lines.append(b'<%s name="ip"%s value=%s/>' % (child.encode(), kind, address))
    if lines:
        edits.append(insertion(data, one, lines))


def _address(data: bytes, one: LaunchElement, child: str, wanted: Wanted, result: ExaminedLaunchFile) -> bytes:
    """Return the address to be set, with its quotes; empty where none need be set."""
    own = [has for has in one.children if has.tag == child and has.get("name") == "ip"]
    passed = _passed_ip(one)
    for has in own + ([] if own or wanted.ip else passed):
        if _is_conditional(has):  # without it the driver would be a simulated arm
            result.against.append("line %d: ip is set under a condition" % has.line)
            return b""
    for has in own:
        if wanted.ip and has.get("value") != wanted.ip and "$(" not in has.get("value"):
            result.against.append("line %d: ip is %r already, and %r is asked for" % (
                has.line, has.get("value"), wanted.ip))
    if own:
        return b""
    if wanted.ip:
        result.takes_ip += 1
        return b'"%s"' % wanted.ip.encode()
    if passed:
        return b""
    near = _global_ip(one)
    if near is None:
        result.against.append("line %d: no address of the arm in reach of it: give it with --ip ADDRESS (the maker's "
                              "driver takes 10.5.5.100 without one, this one a simulated arm)" % one.line)
        return b""
    value = near.attributes["value"]
    return data[value.begin - 1:value.end + 1]


def _is_conditional(one: LaunchElement) -> bool:
    return "if" in one.attributes or "unless" in one.attributes


def _passed_ip(one: LaunchElement) -> List[LaunchElement]:
    """Return the arguments ``ip`` before an include, in its scope, that it passes on with ``pass_all_args``."""
    if one.tag != "include" or one.get("pass_all_args").lower() != "true":
        return []
    return [has for around in one.ancestors() for has in around.children
            if has.tag == "arg" and has.get("name") == "ip" and has.begin < one.begin]


def _global_ip(one: LaunchElement) -> Optional[LaunchElement]:
    """Return the one parameter ``ip`` that the maker's driver reads there; None where it is not plain which."""
    for around in one.ancestors():
        near = [sibling for sibling in around.children if _is_global_ip(sibling)]
        if near:
            plain = len(near) == 1 and "value" in near[0].attributes and not (
                _is_conditional(near[0]) or near[0].get("ns"))
            return near[0] if plain else None
    return None
