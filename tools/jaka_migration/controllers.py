"""The check of the files that name MoveIt's controllers: name, action, type and joints."""
from typing import List, NamedTuple, Optional

from jaka_migration.bounded_files import Unreadable, YamlNode, read_yaml
from jaka_migration.expectations import ACTION, Expected, common_prefix
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, ConfigReport

FILES = ("config/controllers.yaml", "config/ros_controllers.yaml", "config/simple_moveit_controllers.yaml")
MOVEIT_2_FILE = "config/moveit_controllers.yaml"
FAKE_FILE = "config/fake_controllers.yaml"
_ROS_CONTROL = ("hardware_interface", "generic_hw_control_loop", "moveit_sim_hw_interface", "joint_state_controller")
"""Keys for ros_control, which the driver does not use."""


class ListedController(NamedTuple):
    """An entry of a list of controllers.

    Attributes:
        name: Its name.
        entry: Its other values.
        line: Where it begins, from 1.
    """

    name: str
    entry: YamlNode
    line: int

    @property
    def joints(self) -> List[str]:
        """The names of its joints."""
        joints = self.entry.get("joints")
        return [item.text or "" for item in joints.items()] if joints is not None else []


def check_controllers(package: Package, expected: Expected, report: ConfigReport) -> None:
    """Add what the controllers' files say to the report."""
    listed = 0
    for file in FILES:
        if not package.has(file):
            continue
        try:
            root = read_yaml(package.path(file))
        except Unreadable as error:
            report.broken(str(error), file, error.line)
            listed += 1  # it may have the list, so that none is missed elsewhere
            continue
        listed += _check_list(root, file, expected, report)
        _point_out_ros_control(root, file, expected, report)
    listed += _check_moveit_2(package, expected, report)
    if package.has(FAKE_FILE):
        report.add(ADVICE, "is for fake execution only: nothing of it reaches the arm", FAKE_FILE)
    if not listed:
        report.add(MUST_CHANGE, "no controller_list in %s: MoveIt finds no controller; docs/moveit.md has a minimal "
                   "file" % " or ".join(FILES), "config")


def _check_list(root: Optional[YamlNode], file: str, expected: Expected, report: ConfigReport) -> int:
    entries = root.get("controller_list") if root is not None else None
    if entries is None:
        return 0
    controllers = []
    for item in entries.items():
        name = item.get("name")
        if name is None or not name.text:
            report.add(MUST_CHANGE, "a controller without name", file, item.line)
            continue
        controllers.append(ListedController(name.text, item, name.line))
    _check_entries(controllers, file, entries.line, expected, report)
    return 1


def _check_moveit_2(package: Package, expected: Expected, report: ConfigReport) -> int:
    if not package.has(MOVEIT_2_FILE):
        return 0
    try:
        root = read_yaml(package.path(MOVEIT_2_FILE))
    except Unreadable as error:
        report.broken(str(error), MOVEIT_2_FILE, error.line)
        return 1
    manager = root.get("moveit_simple_controller_manager") if root is not None else None
    names = manager.get("controller_names") if manager is not None else None
    if manager is None or names is None:
        return 0
    report.add(MUST_CHANGE, "is in the form of MoveIt 2 (controller_names); this driver is for ROS 1, whose MoveIt "
               "reads controller_list", MOVEIT_2_FILE, names.line)
    controllers = []
    for item in names.items():
        entry = manager.get(item.text or "")
        if entry is not None:
            controllers.append(ListedController(item.text or "", entry, entry.line))
    _check_entries(controllers, MOVEIT_2_FILE, names.line, expected, report)
    return 1


def _check_entries(controllers: List[ListedController], file: str, line: int, expected: Expected,
                   report: ConfigReport) -> None:
    arms = [one for one in controllers if one.name.strip("/") == expected.controller.strip("/") or any(
        joint in expected.joints or expected.unlike(joint) for joint in one.joints)
        or common_prefix(one.joints) is not None]
    for one in controllers:
        if one not in arms:
            report.add(ADVICE, "controller %s has no joint of the arm: not checked" % one.name, file, one.line)
    if not arms:
        report.add(MUST_CHANGE, "no controller has the arm's joints, %s" % ", ".join(expected.joints), file, line)
    if len(arms) > 1:
        report.add(MUST_CHANGE, "%d controllers have joints of the arm (%s): leave one, %s" % (
            len(arms), ", ".join(one.name for one in arms), expected.controller), file, arms[1].line)
    for one in arms:
        _check_name(one, file, expected, report)
        _check_values(one, file, report)
        _check_joints(one, file, expected, report)


def _check_name(one: ListedController, file: str, expected: Expected, report: ConfigReport) -> None:
    if one.name.strip("/") == expected.controller.strip("/"):
        report.add(FITS, "controller %s: the driver's name for its action" % one.name, file, one.line)
    else:
        report.add(MUST_CHANGE, "controller %s: the driver's action is below %s; change the name here, or set the "
                   "driver's ~trajectory_controller to %s" % (one.name, expected.controller, one.name), file, one.line)


def _check_values(one: ListedController, file: str, report: ConfigReport) -> None:
    action, kind, default = (one.entry.get(key) for key in ("action_ns", "type", "default"))
    if action is None or action.text != ACTION:
        report.add(MUST_CHANGE, "controller %s: action_ns is %s; it must be %s" % (
            one.name, "not there" if action is None else repr(action.text), ACTION), file, (action or one.entry).line)
    else:
        report.add(FITS, "action_ns: %s" % ACTION, file, action.line)
    if kind is None or kind.text != "FollowJointTrajectory":
        report.add(MUST_CHANGE, "controller %s: type is %s; it must be FollowJointTrajectory" % (
            one.name, "not there" if kind is None else repr(kind.text)), file, (kind or one.entry).line)
    else:
        report.add(FITS, "type: FollowJointTrajectory", file, kind.line)
    if default is None or default.truth is not True:
        report.add(ADVICE, "controller %s: set default: true, so that MoveIt takes it without being asked" % one.name,
                   file, (default or one.entry).line)


def _check_joints(one: ListedController, file: str, expected: Expected, report: ConfigReport) -> None:
    node = one.entry.get("joints")
    line, joints = (node or one.entry).line, one.joints
    wanted = list(expected.joints)
    if joints == wanted:
        report.add(FITS, "joints: %s, in the driver's order" % ", ".join(joints), file, line)
        return
    if sorted(joints) == sorted(wanted):
        report.add(ADVICE, "joints are in the order %s; the driver sorts a trajectory by names, so that it moves the "
                   "right ones, but people read lists: write %s" % (", ".join(joints), ", ".join(wanted)), file, line)
        return
    prefix = common_prefix(joints)
    if prefix is not None:
        report.add(MUST_CHANGE, "joints are %s: set the driver's ~frame_prefix to %r (and check again with "
                   "--frame-prefix %s), or write %s" % (", ".join(joints), prefix, prefix or "''", ", ".join(wanted)),
                   file, line)
        return
    wrong = [joint for joint in joints if joint not in wanted]
    lacking = [joint for joint in wanted if joint not in joints]
    twice = sorted({joint for joint in joints if joints.count(joint) > 1})
    parts = [what + " " + ", ".join(names) for what, names in (
        ("not the driver's:", wrong), ("missing:", lacking), ("twice:", twice)) if names]
    report.add(MUST_CHANGE, "joints of controller %s: %s; the driver refuses such a goal; write %s" % (
        one.name, "; ".join(parts), ", ".join(wanted)), file, line)


def _point_out_ros_control(root: Optional[YamlNode], file: str, expected: Expected, report: ConfigReport) -> None:
    keys = [(name, line) for name, line in (root.keys() if root is not None else []) if name in _ROS_CONTROL]
    if keys:
        report.add(ADVICE, "%s: for ros_control, which the driver does not use; they may stay or go" % ", ".join(
            name for name, _ in keys), file, keys[0][1])
    own = root.get(expected.controller.strip("/")) if root is not None else None
    constraints = own.get("constraints") if own is not None else None
    if constraints is not None:
        report.add(ADVICE, "constraints of %s: loaded into move_group's namespace they do nothing; loaded into the "
                   "driver's, they are the tolerances of goals that name none (docs/trajectories.md)" % (
                       expected.controller), file, constraints.line)


def check_unread_forms(package: Package, report: ConfigReport) -> None:
    """Add the files that are there in a form that this check does not read."""
    for file in package.files("launch", ".py"):
        report.add(NOT_READ, "is Python code, of ROS 2; nothing is run here", file)
