"""The check of the SRDF: the links, joints, groups and virtual joint that it names, against the URDF."""
from typing import Dict, List, Optional, Sequence, Set, Tuple

from jaka_migration.bounded_files import Element, Unreadable, read_xml
from jaka_migration.expectations import Expected
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, ConfigReport
from jaka_migration.urdf_chain import Urdf


def read_semantics(package: Package, report: ConfigReport) -> List[Tuple[str, Element]]:
    """Return the SRDF files of the package with their root elements; add those that cannot be read to the report."""
    found = []
    for file in package.files("config", ".srdf"):
        try:
            root = read_xml(package.path(file))
            if root.tag != "robot":
                raise Unreadable("is no SRDF: its root element is %s, not robot" % root.tag, root.line)
            found.append((file, root))
        except Unreadable as error:
            report.broken(str(error), file, error.line)
    for file in package.files("config", ".srdf.xacro"):
        report.add(NOT_READ, "is a xacro file: nothing is run here; write it out with xacro first", file)
    return found


def check_semantics(file: str, root: Element, urdf: Optional[Urdf], expected: Expected, report: ConfigReport) -> None:
    """Add what one SRDF says to the report; without a URDF its names are held against the driver's only."""
    if urdf is not None and root.get("name") != urdf.name:
        report.add(ADVICE, "robot %r, but the URDF's is %r: MoveIt warns of it" % (root.get("name"), urdf.name),
                   file, root.line)
    groups = {group.get("name"): group for group in root.all("group")}
    if not groups:
        report.add(MUST_CHANGE, "has no group: MoveIt plans for a group", file, root.line)
    arms = []
    for name, group in groups.items():
        joints = _joints_of(group, groups, urdf, set())
        if set(expected.joints) <= joints:
            arms.append(name)
            report.add(FITS, "group %s has the arm's six joints" % name, file, group.line)
        _point_out_unlike(group, file, expected, report)
    if groups and not arms:
        line = next(iter(groups.values())).line
        if urdf is None and any(group.first("chain") or group.first("link") for group in groups.values()):
            report.add(NOT_READ, "a group by chain or link: without the URDF its joints are not known", file, line)
        else:
            report.add(MUST_CHANGE, "no group has the driver's joints, %s" % ", ".join(expected.joints), file, line)
    if urdf is not None:
        _check_names(file, root, urdf, report)
        _check_virtual_joints(file, root, urdf, report)


def _joints_of(group: Element, groups: Dict[str, Element], urdf: Optional[Urdf], seen: Set[str]) -> Set[str]:
    """Return the joints of a group: those it names, those of its chains and links, and of the groups in it."""
    seen.add(group.get("name"))
    joints = {child.get("name") for child in group.all("joint")}
    for chain in group.all("chain") if urdf is not None else []:
        assert urdf is not None
        before = {joint.name for joint in urdf.joints_before(chain.get("base_link"))}
        joints |= {joint.name for joint in urdf.joints_before(chain.get("tip_link"))} - before
    for link in group.all("link") if urdf is not None else []:
        assert urdf is not None
        if link.get("name") in urdf.parents:
            joints.add(urdf.parents[link.get("name")].name)
    for inner in group.all("group"):
        name = inner.get("name")
        if name in groups and name not in seen:
            joints |= _joints_of(groups[name], groups, urdf, seen)
    return joints


def _point_out_unlike(group: Element, file: str, expected: Expected, report: ConfigReport) -> None:
    for child in group.all("joint"):
        meant = expected.unlike(child.get("name"))
        if meant is not None:
            report.add(MUST_CHANGE, "group %s: %s is no joint of the driver; it is %s there" % (
                group.get("name"), child.get("name"), meant), file, child.line)


def _check_names(file: str, root: Element, urdf: Urdf, report: ConfigReport) -> None:
    virtual = {joint.get("name") for joint in root.all("virtual_joint")}
    links: List[Tuple[str, int]] = []
    joints: List[Tuple[str, int]] = []
    for element in root.walk():
        if element.tag == "disable_collisions":
            links += [(element.get(key), element.line) for key in ("link1", "link2")]
        elif element.tag == "chain":
            links += [(element.get(key), element.line) for key in ("base_link", "tip_link")]
        elif element.tag == "end_effector":
            links.append((element.get("parent_link"), element.line))
        elif element.tag == "link":
            links.append((element.get("name"), element.line))
        elif element.tag in ("joint", "passive_joint"):
            joints.append((element.get("name"), element.line))
    is_right = _point_out_unknown("link", links, set(urdf.links), file, report)
    is_right = _point_out_unknown("joint", joints, set(urdf.joints) | virtual, file, report) and is_right
    if is_right:
        report.add(FITS, "every link and joint that it names is in the URDF", file)


def _point_out_unknown(kind: str, named: Sequence[Tuple[str, int]], known: Set[str], file: str,
                       report: ConfigReport) -> bool:
    unknown = [(name, line) for name, line in named if name not in known]
    if not unknown:
        return True
    names = sorted({name or "''" for name, _ in unknown})
    shown = ", ".join(names[:10]) + (" and %d more" % (len(names) - 10) if len(names) > 10 else "")
    report.add(MUST_CHANGE, "names %s %s, which the URDF does not have; it has %s" % (
        kind, shown, ", ".join(sorted(known)[:20])), file, unknown[0][1])
    return False


def _check_virtual_joints(file: str, root: Element, urdf: Urdf, report: ConfigReport) -> None:
    tops = sorted(link for link in urdf.links if link not in urdf.parents)
    joints = root.all("virtual_joint")
    for joint in joints:
        if joint.get("child_link") not in tops:
            report.add(MUST_CHANGE, "virtual joint %s: child_link is %s; it must be the URDF's root, %s" % (
                joint.get("name"), joint.get("child_link") or "not there", ", ".join(tops)), file, joint.line)
        elif joint.get("type") != "fixed":
            report.add(MUST_CHANGE, "virtual joint %s is %s: an arm that is bolted down needs fixed, else MoveIt waits "
                       "for its place in tf" % (joint.get("name"), joint.get("type") or "of no type"), file, joint.line)
        else:
            report.add(FITS, "virtual joint %s: %s fixed to %s" % (
                joint.get("name"), joint.get("child_link"), joint.get("parent_frame")), file, joint.line)
    if not joints:
        report.add(FITS, "no virtual joint: MoveIt plans in the frame of the URDF's root, %s" % ", ".join(tops), file)
