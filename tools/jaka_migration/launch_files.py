"""The check of the launch files: parameters of trajectory execution, the controller manager, who publishes joints."""
import re
from typing import Iterator, List, Optional, Tuple

from jaka_migration.bounded_files import Element, number_of
from jaka_migration.expectations import Expected, models_in
from jaka_migration.launch_links import check_links
from jaka_migration.launch_reading import LaunchFile, read_launch_files
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, ConfigReport

START_TOLERANCE_RAD = 0.01
"""``~trajectory_start_tolerance`` of the driver, unless it is set (docs/parameters.md)."""
SIMPLE_MANAGER = "moveit_simple_controller_manager/MoveItSimpleControllerManager"
_ENOUGH_SCALING = 2.0
"""Scaling of the time that a plan may take, below which a speed override of a half already has it cancelled."""
_ENOUGH_MARGIN_S = 2.0
"""Least margin, s, of MoveIt's monitoring that is not advised against; with less a short pause has a plan cancelled."""
_MOVEIT_SERVER = "../jaka_planner/launch/moveit_server.launch"
_PREFIX = "trajectory_execution/"
_MANAGER_FILE = re.compile(r"/([^/]+?)_(?:moveit_)?controller_manager\.launch(?:\.xml)?$")


def check_launch_files(package: Package, expected: Expected, report: ConfigReport) -> None:
    """Add what the launch files of the package, and the maker's ``moveit_server.launch`` beside it, say."""
    files = read_launch_files(package, package.files("launch", ".launch", ".launch.xml"), report)
    if not files:
        report.add(NOT_READ, "no launch file that can be read: how MoveIt is started is not known", "launch")
        return
    _check_execution(files, report)
    _check_managers(files, report)
    for launch in files:
        _check_nodes(launch, report)
    check_links(package, files, expected, report)
    if package.has(_MOVEIT_SERVER):
        files += read_launch_files(package, [_MOVEIT_SERVER], report)
    for launch in files:
        _check_server(launch, expected, report)


def _parameters(files: List[LaunchFile], name: str) -> Iterator[Tuple[LaunchFile, Element, str]]:
    """Return each setting of a parameter, with its value as far as it is known."""
    for launch in files:
        for element in launch.started():
            if element.tag == "param" and (
                    element.get("name") == name or element.get("name").endswith("/" + name)):
                yield launch, element, launch.resolved(element.get("value"))


# ---- trajectory execution ----

def _check_execution(files: List[LaunchFile], report: ConfigReport) -> None:
    monitored = True
    for launch, element, value in _parameters(files, _PREFIX + "execution_duration_monitoring"):
        monitored = value.lower() not in ("false", "0")
        if not monitored:
            report.add(FITS, "execution_duration_monitoring is off: MoveIt cancels no plan for its time", launch.file,
                       element.line)
    scaling = _numbers(files, "allowed_execution_duration_scaling", report)
    margin = _numbers(files, "allowed_goal_duration_margin", report)
    if monitored:
        factor = min((value for _, _, value in scaling), default=1.2)
        seconds = min((value for _, _, value in margin), default=0.5)
        place = next(((launch.file, element.line) for launch, element, _ in scaling + margin), ("launch", None))
        text = ("execution_duration_monitoring is on, with scaling %g and margin %g s: a plan that takes longer (a "
                "speed override below 1, a pause) is cancelled by MoveIt" % (factor, seconds))
        if factor < _ENOUGH_SCALING:
            report.add(MUST_CHANGE, "%s; set %sexecution_duration_monitoring to false, or the scaling to 5 or more" % (
                       text, _PREFIX), *place)
        elif seconds < _ENOUGH_MARGIN_S:
            report.add(ADVICE, text + "; set the monitoring to false, or the margin to %g or more" % _ENOUGH_MARGIN_S,
                       *place)
        else:
            report.add(ADVICE, text + "; a pause longer than that needs the monitoring to be false", *place)
    for launch, element, tolerance in _numbers(files, "allowed_start_tolerance", report):
        if tolerance == 0.0:
            report.add(ADVICE, "allowed_start_tolerance 0: MoveIt does not look where a plan begins; the driver does "
                       "(%g rad)" % START_TOLERANCE_RAD, launch.file, element.line)
        elif tolerance < 0.0:
            report.add(MUST_CHANGE, "allowed_start_tolerance is %g; it must not be negative" % tolerance, launch.file,
                       element.line)
        elif tolerance > START_TOLERANCE_RAD:
            report.add(ADVICE, "allowed_start_tolerance %g rad does not help: the driver refuses a plan that begins "
                       "more than ~trajectory_start_tolerance (%g) away" % (tolerance, START_TOLERANCE_RAD),
                       launch.file, element.line)
        else:
            report.add(FITS, "allowed_start_tolerance %g rad, at most %g" % (tolerance, START_TOLERANCE_RAD),
                       launch.file, element.line)


def _numbers(files: List[LaunchFile], name: str, report: ConfigReport) -> List[Tuple[LaunchFile, Element, float]]:
    found = []
    for launch, element, text in _parameters(files, _PREFIX + name):
        value = number_of(text)
        if value is None:
            report.add(NOT_READ if "$(" in text else MUST_CHANGE, "%s is %r, %s" % (
                name, text, "which is decided elsewhere" if "$(" in text else "no number"), launch.file, element.line)
        else:
            found.append((launch, element, value))
    return found


# ---- controller managers ----

def _check_managers(files: List[LaunchFile], report: ConfigReport) -> None:
    chosen = _chosen(files)
    count = 0
    for launch, element, plugin in _parameters(files, "moveit_controller_manager"):
        count += 1
        found = _MANAGER_FILE.search(launch.file)
        is_chosen = not chosen or found is None or found.group(1) in chosen
        if plugin == SIMPLE_MANAGER:
            report.add(FITS, "moveit_controller_manager: %s" % plugin, launch.file, element.line)
        elif "$(" in plugin:
            report.add(NOT_READ, "moveit_controller_manager is %r, which is decided elsewhere" % plugin, launch.file,
                       element.line)
        elif is_chosen:
            report.add(MUST_CHANGE, "moveit_controller_manager is %s; the driver's action needs %s" % (
                plugin, SIMPLE_MANAGER), launch.file, element.line)
        else:
            report.add(ADVICE, "moveit_controller_manager %s: does not lead to the driver; do not choose it" % plugin,
                       launch.file, element.line)
    if not count:
        report.add(MUST_CHANGE, "no launch file sets moveit_controller_manager; set it to %s" % SIMPLE_MANAGER,
                   "launch")
    for launch in files:
        for arg in launch.root.all("arg"):
            if arg.get("name") == "fake_execution" and not launch.is_off(arg) and launch.resolved(
                    arg.get("default")).lower() in ("true", "1"):
                report.add(MUST_CHANGE, "fake_execution is true by default: no plan would reach the arm", launch.file,
                           arg.line)


def _chosen(files: List[LaunchFile]) -> List[str]:
    """Return the names of controller managers that are chosen by default, as ``simple`` or ``jaka_zu7``.

    Demos are left out: those of MoveIt's Setup Assistant choose fake controllers, or Gazebo's.
    """
    names = []
    for launch in files:
        if launch.is_demo:
            continue
        for element in launch.started():
            if (element.tag == "arg" and element.get("name") == "moveit_controller_manager"
                    and not _MANAGER_FILE.search(launch.file)):
                names.append(launch.resolved(element.attributes.get("value", element.get("default"))))
    return [name for name in names if "$(" not in name and "/" not in name]


# ---- nodes ----

def _check_nodes(launch: LaunchFile, report: ConfigReport) -> None:
    if launch.is_for_gazebo:
        report.add(ADVICE, "is for Gazebo: not to be started with the driver", launch.file)
        return
    is_for_the_arm = any(
        arg.get("name") == "fake_execution" and launch.resolved(arg.get("value")).lower() in ("false", "0")
        for include in launch.started() if include.tag == "include" for arg in include.all("arg"))
    started = set(map(id, launch.started()))
    for node in launch.root.walk():
        if node.tag != "node":
            continue
        is_off = id(node) not in started
        kind = node.get("type") or node.get("pkg")
        if node.get("pkg").startswith("joint_state_publisher"):
            _check_publisher(node, launch, is_off, is_for_the_arm, report)
        elif node.get("pkg") == "controller_manager":
            report.add(ADVICE, "starts %s of controller_manager: leave this file out, the driver needs none" % kind,
                       launch.file, node.line)
        elif node.get("pkg") == "robot_state_publisher" and not is_off:
            report.add(ADVICE, "starts robot_state_publisher: start the driver with publish_tf:=tool (or none) and "
                       "~publish_description false, so that one node publishes each link", launch.file, node.line)


def _check_publisher(node: Element, launch: LaunchFile, is_off: bool, is_for_the_arm: bool,
                     report: ConfigReport) -> None:
    sources = " ".join(element.text or element.get("value") for element in node.children
                       if (element.get("param") or element.get("name")).endswith("source_list"))
    repeats = re.search(r"(?<![\w/])/?joint_states", sources) is not None
    condition = "".join(" (%s %s)" % (key, node.get(key)) for key in ("if", "unless") if key in node.attributes)
    if is_off:
        report.add(ADVICE, "starts joint_state_publisher%s, by default not: never beside the driver" % condition,
                   launch.file, node.line)
    elif repeats or is_for_the_arm:
        report.add(MUST_CHANGE, "starts joint_state_publisher%s: it publishes on /joint_states beside the driver%s; "
                   "take it out, or do not start this file with the driver" % (
                       condition, ", and repeats what it receives there" if repeats else ""), launch.file, node.line)
    else:
        report.add(ADVICE, "starts joint_state_publisher%s: for a demo without arm; never beside the driver" % (
                   condition), launch.file, node.line)


def _check_server(launch: LaunchFile, expected: Expected, report: ConfigReport) -> None:
    servers = [node for node in launch.root.walk() if node.tag == "node" and node.get("type") == "moveit_server"]
    for node in servers:
        named = _model_of(launch)
        told = ""
        if named is not None:
            models = models_in("jaka_" + named)
            is_same = models[:1] == [expected.model.name]
            told = "; its model is %s%s" % (named, "" if is_same else ", not %s" % expected.model.name)
        is_inside = not launch.file.startswith("..")
        report.add(MUST_CHANGE if is_inside else ADVICE, "starts the maker's moveit_server, which the driver replaces: "
                   "both must not run, as MoveIt would find two servers of one action%s" % told, launch.file, node.line)


def _model_of(launch: LaunchFile) -> Optional[str]:
    for element in launch.started():
        if element.tag == "param" and element.get("name") == "model":
            value = launch.resolved(element.get("value"))
            return None if "$(" in value else value
    return None
