"""The check of what launch files name: files, other launch files with their arguments, other arms, the maker's driver.

What roslaunch refuses is told as it does (``roslaunch/xmlloader.py`` and ``loader.py`` of ROS Noetic).
"""
import os
import re
from typing import Dict, List, Optional, Set, Tuple

from jaka_migration.bounded_files import Element
from jaka_migration.controllers import FILES
from jaka_migration.expectations import Expected, models_in
from jaka_migration.launch_reading import LaunchFile
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, MUST_CHANGE, ConfigReport
from jaka_ros_driver.kinematics.arm_models import model_names

_FIND = re.compile(r"\$\(find\s+([\w-]+)\s*\)/([^'\"()$\s]+(?: [^'\"()$\s]+)*)")
_USED = re.compile(r"\$\(arg\s+([^\s()]+)\s*\)")
_MAKERS = re.compile(r"\$\(find\s+jaka_(?:driver|planner)\s*\)/launch/")


def check_links(package: Package, files: List[LaunchFile], expected: Expected, report: ConfigReport) -> None:
    """Add what the launch files of a package name and cannot have, and what of another arm they name."""
    needed = {launch.file: (launch, _needed(launch)) for launch in files}
    listed = [file for file in FILES if package.has(file)]
    loaded = [_named(launch, element) for launch in files for element in launch.started() if element.tag == "rosparam"]
    if listed and not any((package.name, file) in loaded for file in listed):
        report.add(ADVICE, "no launch file of the package loads it: it must be loaded into move_group's namespace, "
                   "else MoveIt finds no controller", listed[0])
    for launch in files:
        for element in launch.started():
            if element.tag == "include":
                _check_include(package, launch, element, needed, report)
            _check_file(package, launch, element, report)
            _check_arm(launch, element, expected, report)
            if _starts_makers_driver(launch, element):
                report.add(MUST_CHANGE, "starts the maker's driver or MoveIt server: this driver replaces both, and "
                           "the controller serves one client; take it out (migrate_cell shows more)", launch.file,
                           element.line)


def _named(launch: LaunchFile, element: Element) -> Optional[Tuple[str, str]]:
    """Return package and path of the file that an element loads, as far as it is known."""
    for key in ("file", "textfile"):
        found = _FIND.fullmatch(launch.resolved(element.get(key)))
        if found:
            return found.group(1), found.group(2)
    return None


def _check_file(package: Package, launch: LaunchFile, element: Element, report: ConfigReport) -> None:
    named = _named(launch, element)
    if named is None or element.tag not in ("include", "rosparam", "param") or element.get("command") in (
            "dump", "delete"):
        return
    name, rest = named
    path = package.path(rest) if name == package.name else package.beside(name, rest)
    is_known = name == package.name or os.path.isdir(package.beside(name))
    if is_known and not os.path.lexists(path):
        report.add(ADVICE if launch.is_demo or launch.is_for_gazebo else MUST_CHANGE, "names %s, which is not there: "
                   "roslaunch ends with an error" % package.shown(path), launch.file, element.line)


def _check_include(package: Package, launch: LaunchFile, element: Element,
                   needed: Dict[str, Tuple[LaunchFile, List[str]]], report: ConfigReport) -> None:
    """Add what an include gives, or does not give, to a file of the package; ``needed`` has these with their needs."""
    for child in element.children:
        if child.tag not in ("arg", "env"):
            report.add(ADVICE, "<%s> within <include>: roslaunch leaves it out; write <arg>" % child.tag, launch.file,
                       child.line)
    named = _named(launch, element)
    if (named is None or named[0] != package.name or named[1] not in needed
            or element.get("pass_all_args").lower() in ("true", "1")):
        return
    inner, needs = needed[named[1]]
    passed = [arg.get("name") for arg in element.all("arg")]
    unused = [name for name in passed if name not in inner.declared]
    if unused:
        report.add(MUST_CHANGE, "gives %s the argument %s, which it does not have: roslaunch ends with an error" % (
            inner.file, ", ".join(unused)), launch.file, element.line)
    lacking = [name for name in needs if name not in passed]
    if lacking:
        report.add(MUST_CHANGE, "does not give %s the argument %s, which it needs: roslaunch ends with an error" % (
            inner.file, ", ".join(lacking)), launch.file, element.line)


def _needed(launch: LaunchFile) -> List[str]:
    """Return the arguments that a file uses where it is always read, without a value of its own."""
    used: Set[str] = set()
    for element in launch.started():
        for value in element.attributes.values():
            used |= set(_USED.findall(value))
    return sorted(name for name in used if name not in launch.arguments)


def _check_arm(launch: LaunchFile, element: Element, expected: Expected, report: ConfigReport) -> None:
    for key in ("default", "value", "textfile", "command"):
        for _, rest in _FIND.findall(element.get(key)):
            others = [name for name in models_in(os.path.basename(rest)) if name in model_names()]
            if rest.endswith((".urdf", ".xacro")) and others and expected.model.name not in others:
                report.add(ADVICE if launch.is_for_gazebo else MUST_CHANGE,
                           "names the description of another arm, %s" % rest, launch.file, element.line)


def _starts_makers_driver(launch: LaunchFile, element: Element) -> bool:
    return (element.tag == "include" and _MAKERS.match(launch.resolved(element.get("file"))) is not None
            or element.tag == "node" and element.get("pkg") == "jaka_driver")
