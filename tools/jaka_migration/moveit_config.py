"""The command check_moveit_config: reads a MoveIt configuration package and prints what must change for this driver."""
import argparse
import glob
import math
import os
import re
import sys
from typing import Iterator, List, Optional, Tuple

from jaka_migration.bounded_files import Element, Unreadable, read_xml, read_yaml
from jaka_migration.controllers import FILES, MOVEIT_2_FILE, check_controllers, check_unread_forms
from jaka_migration.expectations import Expected, default_controller, models_in
from jaka_migration.joint_limits import check_joint_limits
from jaka_migration.launch_files import check_launch_files
from jaka_migration.package import Package
from jaka_migration.report import ADVICE, FITS, MUST_CHANGE, NOT_READ, ConfigReport
from jaka_migration.semantics import check_semantics, read_semantics
from jaka_migration.urdf_chain import ArmChain, ChainDifference, Urdf, WrongUrdf, urdf_from_xml
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import ArmModel, load_model, load_model_file, model_names
from jaka_ros_driver.kinematics.rotations import rotation_vector_from_matrix

SAME_M, SAME_RAD = 1e-3, 2e-3
"""Largest difference of a URDF and a model that are the same arm: one arm differs from its series by about 1 mm."""
NEAR_M, NEAR_RAD = 5e-3, 1e-2
"""Smallest difference of different arms; the sources of one series differ by up to some mm."""
_NAME = "check_moveit_config"
_FIND = re.compile(r"\$\(find\s+([\w-]+)\s*\)/([^'\"()$]+?\.(?:urdf(?:\.xacro)?|xacro))")
_LONGEST_COMMAND = 10_000
"""Most characters of a command that are searched for names: a regular expression runs over it."""
_DESCRIPTION = """
Reads a MoveIt configuration package and prints what fits the driver, and what must change, with file and line. Nothing
of it is run, and no ROS is needed."""
_EPILOG = """
exit codes: 0 nothing of what was read must change; 1 something must; 2 a file cannot be read (or wrong usage).

The URDF is the one that launch/planning_context.launch names, where its package lies beside this one, else one in the
folder config or urdf. docs/moveit.md of jaka_ros_driver says why each thing must be as it must."""


class NoConfiguration(Exception):
    """A folder that holds no MoveIt configuration, or an arm whose model cannot be known; the reason."""


def main(argv: Optional[List[str]] = None) -> int:
    """Run the check and print its report.

    Returns:
        0 nothing must change, 1 something must, 2 something cannot be read, or wrong usage.
    """
    options = _parser().parse_args(argv)
    try:
        report = check(options.path, options.urdf, options.model, options.dh_file, options.controller,
                       options.frame_prefix)
    except (NoConfiguration, InvalidCommand) as error:
        print("%s: error: %s" % (_NAME, error), file=sys.stderr)
        return 2
    text = report.as_json() if options.json else report.as_text()
    try:
        sys.stdout.buffer.write(text.encode("utf-8", "replace"))
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes once more at its end
        if not isinstance(error, BrokenPipeError):  # as by "| head", whose reader has what it wants
            print("%s: error: the report cannot be written: %s" % (_NAME, error.strerror), file=sys.stderr)
            return 2
    return report.exit_code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=_NAME, description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", metavar="PATH", help="the folder of the package, as jaka_zu7_moveit_config")
    parser.add_argument("--model", metavar="NAME", help="the arm's model, as zu7; by default what the names of the "
                        "package say, and else the model whose chain is nearest to the URDF's")
    parser.add_argument("--dh-file", metavar="FILE", help="a model file of your own, as the driver's ~dh_file")
    parser.add_argument("--urdf", metavar="FILE", help="the arm's URDF; write out a xacro file first: "
                        "rosrun xacro xacro IN > OUT")
    parser.add_argument("--controller", metavar="NAME", help="the driver's ~trajectory_controller; by default "
                        "jaka_MODEL_controller")
    parser.add_argument("--frame-prefix", metavar="TEXT", default="", help="the driver's ~frame_prefix")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    return parser


def check(path: str, urdf_path: Optional[str] = None, model_name: Optional[str] = None, dh_file: Optional[str] = None,
          controller: Optional[str] = None, frame_prefix: str = "") -> ConfigReport:
    """Return the report about a MoveIt configuration package.

    Args:
        path: The package's folder.
        urdf_path: The arm's URDF; None to look for it.
        model_name: The arm's model; None to guess it.
        dh_file: A model file, instead of ``model_name``.
        controller: ``~trajectory_controller`` of the driver; None for its default.
        frame_prefix: ``~frame_prefix`` of the driver.

    Raises:
        NoConfiguration: The folder is none, or holds no configuration, or no model can be guessed.
        InvalidCommand: The model is unknown, or its file wrong.
    """
    package = Package(path)
    _refuse_what_is_none(package, path)
    report = ConfigReport(package.folder)
    semantics = read_semantics(package, report)
    urdf, urdf_file = _find_urdf(package, urdf_path, report)
    chain = _chain_of(urdf, urdf_file, frame_prefix, report)
    model, whence = _choose_model(package, semantics, urdf_file, urdf, chain, model_name, dh_file)
    report.model = "%s (%s)" % (model.name, whence)
    expected = Expected(model, controller or default_controller(model), frame_prefix)
    check_controllers(package, expected, report)
    check_joint_limits(package, urdf, urdf_file, expected, report)
    if chain is not None:
        _check_chain(chain, urdf_file, expected, report)
    for file, root in semantics:
        check_semantics(file, root, urdf, expected, report)
    if not package.files("config", ".srdf", ".srdf.xacro"):
        report.add(MUST_CHANGE, "no SRDF: MoveIt needs one, from its Setup Assistant", "config")
    check_launch_files(package, expected, report)
    check_unread_forms(package, report)
    return report


def _refuse_what_is_none(package: Package, path: str) -> None:
    if not os.path.isdir(package.folder):
        raise NoConfiguration("%s: %s" % (path, "is no folder" if os.path.exists(path) else "is not there"))
    if not os.access(package.folder, os.R_OK | os.X_OK):
        raise NoConfiguration("%s: may not be read" % path)
    known = (*FILES, MOVEIT_2_FILE)
    if not any(map(package.has, known)) and not package.files("config", ".srdf", ".srdf.xacro"):
        raise NoConfiguration("%s: holds no MoveIt configuration: neither config/*.srdf nor %s" % (
            path, " nor ".join(known)))


# ---- the URDF ----

def _find_urdf(package: Package, given: Optional[str], report: ConfigReport) -> Tuple[Optional[Urdf], str]:
    """Return the URDF and how the report names its file; None where there is none that can be read."""
    for path in [given] if given is not None else _candidates(package):
        file = package.shown(path) if given is None else path
        if path.endswith(".xacro"):
            report.add(NOT_READ, "is a xacro file: nothing is run here; write it out (rosrun xacro xacro IN > OUT), "
                       "and give the result with --urdf", file)
            if given is not None:
                report.is_broken = True
            continue
        try:
            return urdf_from_xml(read_xml(path)), file
        except (Unreadable, WrongUrdf) as error:
            report.broken(str(error), file, error.line)
            return None, file
    report.add(NOT_READ, "no URDF was found in the package or beside it: limits, links and chain are not compared; "
               "give it with --urdf", "")
    return None, ""


def _candidates(package: Package) -> Iterator[str]:
    """Return paths at which the URDF may be: the files that the launch files load, then those of the package."""
    found: List[str] = []
    for file in package.files("launch", ".launch", ".launch.xml"):
        try:
            elements = list(read_xml(package.path(file)).walk())
        except Unreadable:  # it is reported where the launch files are checked
            continue
        for element in elements:
            if element.tag != "param" or "gazebo" in file:
                continue
            text = element.get("textfile") + " " + element.get("command")
            for name, rest in _FIND.findall(text[:_LONGEST_COMMAND]):
                path = package.path(rest) if name == package.name else package.beside(name, rest)
                found.append(os.path.normpath(path))
    for folder in ("config", "urdf"):
        found += sorted(path for path in glob.glob(os.path.join(glob.escape(package.path(folder)), "*.urdf"))
                        if "gazebo" not in os.path.basename(path))
    return iter([path for path in dict.fromkeys(found) if os.path.lexists(path)])


def _chain_of(urdf: Optional[Urdf], file: str, prefix: str, report: ConfigReport) -> Optional[ArmChain]:
    if urdf is None:
        return None
    try:
        return ArmChain(urdf, [prefix + joint for joint in JOINTS])
    except WrongUrdf as error:
        report.add(MUST_CHANGE, "%s; the driver publishes %s" % (error, ", ".join(prefix + joint for joint in JOINTS)),
                   file, error.line)
        return None


# ---- the model ----

def _choose_model(package: Package, semantics: List[Tuple[str, Element]], urdf_file: str, urdf: Optional[Urdf],
                  chain: Optional[ArmChain], name: Optional[str], dh_file: Optional[str]) -> Tuple[ArmModel, str]:
    if dh_file is not None:
        return load_model_file(dh_file), "from %s" % dh_file
    if name is not None:
        return load_model(name), "given"
    texts = [(package.name, "the folder's name"), *((root.get("name"), file) for file, root in semantics),
             *((text, file) for text, file in _controller_names(package)),
             (os.path.basename(urdf_file), "the URDF's name"), (urdf.name if urdf else "", "the URDF's robot")]
    for text, where in texts:
        for found in models_in(text):
            if found in model_names():
                return load_model(found), "guessed from %s; give --model for another" % where
    nearest = _nearest(chain) if chain is not None else None
    if nearest is not None and nearest[1].distance <= NEAR_M:
        return nearest[0], "guessed from the URDF's chain; give --model for another"
    raise NoConfiguration("%s: no name in it speaks of a model, and no URDF was found that is near to one; give "
                          "--model, one of %s" % (package.folder, ", ".join(model_names())))


def _controller_names(package: Package) -> Iterator[Tuple[str, str]]:
    for file in FILES:
        try:
            root = read_yaml(package.path(file)) if package.has(file) else None
        except Unreadable:  # it is reported where the controllers are checked
            continue
        entries = root.get("controller_list") if root is not None else None
        for item in entries.items() if entries is not None else []:
            name = item.get("name")
            if name is not None and name.text:
                yield name.text, file


def _nearest(chain: ArmChain) -> Tuple[ArmModel, ChainDifference]:
    models = [load_model(name) for name in model_names()]
    pairs = [(model, chain.difference(model)) for model in models]
    return min(pairs, key=lambda pair: pair[1].size)


def _check_chain(chain: ArmChain, file: str, expected: Expected, report: ConfigReport) -> None:
    found, model = chain.difference(expected.model), expected.model
    line = chain.joints[0].line
    text = "the chain from %s to %s differs from model %s by %.2f mm and %.2f deg at most" % (
        found.base, found.flange, model.name, found.distance * 1e3, math.degrees(found.angle))
    if found.distance <= SAME_M and found.angle <= SAME_RAD:
        report.add(FITS, text, file, line)
    elif found.distance <= NEAR_M and found.angle <= NEAR_RAD:
        report.add(ADVICE, "%s%s: compare a pose of the arm with both%s" % (
            text, _moved_frame(chain, found, model), "; of the model: " + model.note if model.note else ""), file, line)
    else:
        report.add(MUST_CHANGE, "%s (joints at %s rad); %s" % (
            text, ", ".join("%g" % angle for angle in found.worst), _explained(chain, found, model)), file, line)
        return
    report.add(ADVICE, "set the driver's ~base_frame to %s and ~flange_frame to %s, so that its frames are those of "
               "the URDF" % tuple(_without(expected.prefix, link) for link in (found.base, found.flange)), file, line)


def _explained(chain: ArmChain, found: ChainDifference, model: ArmModel) -> str:
    """Return what the difference is, and what to do about it."""
    nearest, difference = _nearest(chain)
    if difference.size < 0.5 * found.size:
        return "nearest is model %s, %.2f mm and %.2f deg: use it, if that is the arm, or another URDF" % (
            nearest.name, difference.distance * 1e3, math.degrees(difference.angle))
    moved = _moved_frame(chain, found, model)
    if moved:
        return moved[2:] + ": correct the URDF, or add a link that is the driver's frame"
    return "no other model is nearer: use the URDF of the arm that stands in the cell"


def _moved_frame(chain: ArmChain, found: ChainDifference, model: ArmModel) -> str:
    """Return the fixed offset of one frame that is the whole difference, in words; empty where there is none."""
    for link, offset in zip((found.base, found.flange), chain.fixed_offset(model, found.base, found.flange)):
        if offset is None:
            continue
        shift = [1e3 * part + 0.0 for part in offset[9:]]
        turn = [math.degrees(part) for part in rotation_vector_from_matrix(offset[:9])]
        parts = []
        if max(map(abs, shift)) >= 0.05:
            parts.append("moved by %s mm" % ", ".join(map(_tenths, shift)))
        if max(map(abs, turn)) >= 0.05:
            parts.append("turned by %s deg about x, y, z" % ", ".join(map(_tenths, turn)))
        return "; within 1 mm the same arm with the frame of %s %s" % (link, " and ".join(parts)) if parts else ""
    return ""


def _tenths(number: float) -> str:
    return "%.1f" % (round(number, 1) + 0.0)  # no "-0.0"


def _without(prefix: str, link: str) -> str:
    return link[len(prefix):] if prefix and link.startswith(prefix) else link


if __name__ == "__main__":
    sys.exit(main())
