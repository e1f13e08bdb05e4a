"""The check of the joints' limits: ``joint_limits.yaml`` and the URDF against what the driver accepts.

The file's values are taken as MoveIt 1 takes them (``robot_model_loader.cpp``): ``max_velocity`` and
``max_acceleration`` unless their switch is false, ``min_position`` and ``max_position`` each for itself in place of the
URDF's bound, without any switch.
"""
from typing import Dict, List, Optional, Set, Tuple

from jaka_migration.bounded_files import Unreadable, YamlNode, read_yaml
from jaka_migration.expectations import LIMIT_SLACK_RAD, SLACK, Expected, degrees
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, ConfigReport
from jaka_migration.urdf_chain import Urdf

FILE = "config/joint_limits.yaml"


def check_joint_limits(package: Package, urdf: Optional[Urdf], urdf_file: str, expected: Expected,
                       report: ConfigReport) -> None:
    """Add what the file, and the URDF under it, say about limits to the report."""
    table = _table(package, report)
    slowed, ranged = (set(), {}) if table is None else _check_table(table, urdf, expected, report)
    if urdf is not None:
        _check_urdf(urdf, urdf_file, slowed, ranged, expected, report)


def _table(package: Package, report: ConfigReport) -> Optional[YamlNode]:
    if not package.has(FILE):
        report.add(NOT_READ, "is not there: MoveIt plans with the URDF's speeds then, and with accelerations of its "
                   "own", FILE)
        return None
    try:
        root = read_yaml(package.path(FILE))
    except Unreadable as error:
        report.broken(str(error), FILE, error.line)
        return None
    table = root.get("joint_limits") if root is not None else None
    if table is None or not table.is_mapping:
        report.add(MUST_CHANGE, "has no joint_limits: MoveIt reads nothing of it", FILE, root.line if root else None)
        return None
    return table


def _check_table(table: YamlNode, urdf: Optional[Urdf], expected: Expected,
                 report: ConfigReport) -> Tuple[Set[str], Dict[str, bool]]:
    """Check all joints; return those whose speed the file decides, and for those whose range it does, if it fits."""
    for name, line in table.keys():
        meant = expected.unlike(name)
        if meant is not None:
            report.add(MUST_CHANGE, "%s is no joint of the driver: MoveIt leaves these limits out; write %s" % (
                name, meant), FILE, line)
    slowed: Set[str] = set()
    ranged: Dict[str, bool] = {}
    unlimited: List[str] = []
    fitting: Dict[str, List[str]] = {"max_velocity": [], "max_acceleration": []}
    first_line = table.line
    for index, name in enumerate(expected.joints):
        entry = table.get(name)
        if entry is None:
            unlimited.append(name)
            continue
        if _decides(entry, "has_velocity_limits", "max_velocity"):
            slowed.add(name)
            if _check_rate(entry, "max_velocity", "rad/s", name, expected.top_speed(index), report):
                fitting["max_velocity"].append(name)
        if entry.get("max_position") is not None or entry.get("min_position") is not None:
            joint = None if urdf is None else urdf.joints.get(name)
            ranged[name] = _check_range(entry, name, index, None if joint is None else joint.limits, expected, report)
        if _decides(entry, "has_acceleration_limits", "max_acceleration"):
            if _check_rate(entry, "max_acceleration", "rad/s2", name, expected.top_acceleration, report):
                fitting["max_acceleration"].append(name)
        else:
            unlimited.append(name)
            first_line = min(first_line, entry.line) if len(unlimited) > 1 else entry.line
    for key, names in fitting.items():
        if names:
            report.add(FITS, "%s of %s: not above what the driver accepts" % (key, ", ".join(names)), FILE, table.line)
    if unlimited:
        report.add(ADVICE, "no acceleration limit for %s: MoveIt takes one of its own then; set "
                   "has_acceleration_limits: true and max_acceleration, at most %.4g rad/s2, to begin with 1" % (
                       ", ".join(unlimited), expected.top_acceleration), FILE, first_line)
    return slowed, ranged


def _decides(entry: YamlNode, switch: str, key: str) -> bool:
    """Return whether a limit is there and not switched off; a switch that is no boolean does not switch it off."""
    node = entry.get(switch)
    return entry.get(key) is not None and (node is None or node.truth is not False)


def _number(entry: YamlNode, key: str, name: str, report: ConfigReport) -> Optional[float]:
    node = entry.get(key)
    value = node.number if node is not None else None
    if node is not None and value is None:
        report.add(MUST_CHANGE, "%s: %s is %r, no finite number" % (name, key, node.text), FILE, node.line)
    return value


def _line(entry: YamlNode, key: str) -> int:
    return (entry.get(key) or entry).line


def _check_rate(entry: YamlNode, key: str, unit: str, name: str, top: float, report: ConfigReport) -> bool:
    """Add a speed or an acceleration that is wrong; return whether it is right."""
    value = _number(entry, key, name, report)
    if value is not None and value <= 0.0:
        report.add(MUST_CHANGE, "%s: %s is %g; it must be above 0" % (name, key, value), FILE, _line(entry, key))
    elif value is not None and value > top * SLACK:
        report.add(MUST_CHANGE, "%s: %s is %g %s; the driver refuses plans above %.4g %s (%s deg)" % (
            name, key, value, unit, top, unit, degrees(top)), FILE, _line(entry, key))
    return value is not None and 0.0 < value <= top * SLACK


def _check_range(entry: YamlNode, name: str, index: int, under: Optional[Tuple[float, float]], expected: Expected,
                 report: ConfigReport) -> bool:
    """Add a range that is wrong, with the URDF's bound (``under``) for one that is not here; return if it is right."""
    low, high = expected.model.joint_limits[index] if under is None else under
    lower = _number(entry, "min_position", name, report)
    upper = _number(entry, "max_position", name, report)
    return _judge_range(name, low if lower is None else lower, high if upper is None else upper, index, FILE,
                        _line(entry, "max_position" if upper is not None else "min_position"), expected, report)


def _judge_range(name: str, lower: float, upper: float, index: int, file: str, line: int, expected: Expected,
                 report: ConfigReport) -> bool:
    """Add a range that is empty or wider than the model's; return whether it fits."""
    low, high = expected.model.joint_limits[index]
    excess = expected.position_excess(index, lower, upper)
    text = "%s: range %g to %g rad; the model %s has %.4f to %.4f" % (
        name, lower, upper, expected.model.name, low, high)
    if lower >= upper:
        report.add(MUST_CHANGE, "%s: range %g to %g rad is empty" % (name, lower, upper), file, line)
    elif excess > LIMIT_SLACK_RAD:
        report.add(MUST_CHANGE, text + ": the driver refuses plans beyond", file, line)
    elif excess > 1e-6:
        report.add(ADVICE, text + ": a plan into the last %.4f rad is refused" % excess, file, line)
    else:
        return True
    return False


def _check_urdf(urdf: Urdf, file: str, slowed: Set[str], ranged: Dict[str, bool], expected: Expected,
                report: ConfigReport) -> None:
    fitting: List[str] = []
    for index, name in enumerate(expected.joints):
        joint = urdf.joints.get(name)
        if joint is None or joint.type not in ("revolute", "continuous"):
            continue
        fits = True
        if joint.type == "continuous":
            low, high = expected.model.joint_limits[index]
            report.add(MUST_CHANGE, "%s is continuous: MoveIt plans it without limits, and the driver refuses what is "
                       "beyond %.4f to %.4f rad; make it revolute" % (name, low, high), file, joint.line)
            fits = False
        elif name in ranged:
            fits = ranged[name]
        else:
            lower, upper = joint.limits or (0.0, 0.0)
            fits = _judge_range(name, lower, upper, index, file, joint.line, expected, report)
        top = expected.top_speed(index)
        if name not in slowed and joint.velocity is not None and joint.velocity > top * SLACK:
            report.add(MUST_CHANGE, "%s: velocity is %g rad/s; the driver refuses plans above %.4g rad/s: lower it "
                       "here, or set max_velocity in %s" % (name, joint.velocity, top, FILE), file, joint.line)
            fits = False
        if fits:
            fitting.append(name)
    if fitting:
        report.add(FITS, "limits of %s are within those of model %s" % (", ".join(fitting), expected.model.name), file)
