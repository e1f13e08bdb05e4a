"""The command jaka_doctor: its options, the table of its checks, and its report."""
import argparse
import json
import sys
import textwrap
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence

import yaml

from jaka_ros_driver import __version__
from jaka_ros_driver.doctor import bundle, computer, configuration, controller
from jaka_ros_driver.doctor.findings import Examination, Level, Observation, fault
from jaka_ros_driver.doctor.subject import ExaminedSystem

WELL, FAULTY, USAGE = range(3)
"""Exit codes: no fault was found; at least one was; the words are wrong."""
_NAME = "jaka_doctor"
_DESCRIPTION = """
Say what this computer, its ROS graph and a controller lack for a driver, and what to do about it. Each line says
what was looked at and what was found. Where that is not well, its meaning and the remedy follow. It can be run
before the driver and beside it. Nothing is sent to a controller that moves, sets or powers anything. The status
port is listened to; the command port is asked some of the questions that the driver asks at its start. It is left
alone unless the arm is seen at rest and no driver of this computer has the controller: a controller may end one
client's connection for the next one.
"""
_EPILOG = """exit codes: 0 no fault, 1 at least one fault, 2 wrong words

examples:
  jaka_doctor
  jaka_doctor ip:=10.5.5.100 model:=zu7
  jaka_doctor ip:=10.5.5.100 --bundle report.tar.gz
"""


class ReportLine(NamedTuple):
    """One line of the report."""

    name: str
    finding: Observation


def checks() -> Iterator[Examination]:
    """Return all checks in their order; without ROS, one row says so for those that need it."""
    yield from computer.CHECKS
    try:
        from jaka_ros_driver.doctor import graph
    except ImportError as error:
        missing = fault("ROS cannot be imported (%s)" % error, "no node can run in this shell",
                        "source setup.bash of the build, or of /opt/ros/noetic")
        yield Examination("ROS", lambda subject: missing)
    else:
        yield from graph.CHECKS
    yield from configuration.CHECKS
    yield from controller.CHECKS


def examined(check: Examination, subject: ExaminedSystem) -> ReportLine:
    """Return the row of one check; a check that fails itself costs nothing but its own row."""
    try:
        return ReportLine(check.name, check.look(subject))
    except Exception as error:
        return ReportLine(check.name, fault(
            "%s: %s" % (type(error).__name__, error), "this check failed, and says nothing", "send the bundle"))


def _given(text: str) -> str:
    if not text.strip():  # a variable of the shell that is not set must not be taken for no option
        raise argparse.ArgumentTypeError("it is empty")
    return text


def main(argv: Optional[List[str]] = None) -> int:
    """Make all checks and print them.

    Returns:
        An exit code: 0 no fault, 1 at least one, 2 wrong words.
    """
    parser = argparse.ArgumentParser(prog=_NAME, description=_DESCRIPTION, epilog=_EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", metavar="NAME:=VALUE", nargs="*",
                        help="a private parameter as the driver would get it (docs/parameters.md): ip:=10.5.5.100, "
                             "model:=zu7. Parameters that are not given are those of --node, if it has any")
    parser.add_argument("--node", metavar="NAME", default="/jaka_driver",
                        help="the driver's node, with its namespace; default: /jaka_driver")
    parser.add_argument("--black-box", metavar="FOLDER", type=_given,
                        help="folder of the black box; default: the disk of the log folder is measured")
    parser.add_argument("--status-only", action="store_true", help="do not connect to the command port at all")
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    parser.add_argument("--bundle", metavar="FILE", type=_given,
                        help="write a new .tar.gz with what to send with a bug report: the report, the parameters, the "
                             "newest log of the driver, without passwords, tokens and keys")
    options = parser.parse_args(argv)
    try:
        given = _parameters(options.words)
    except ValueError as error:
        parser.error(str(error))
    subject = _subject(options, given)
    rows = [_shown(examined(check, subject), options.json) for check in checks()]
    levels = [row.finding.level for row in rows]
    if options.json:
        print(as_json(rows))
    else:
        print("%d checks: %d well, %d skipped, %d warnings, %d faults" % (len(rows), *map(levels.count, (
            Level.OK, Level.SKIPPED, Level.WARNING, Level.FAULT))))
    if options.bundle:
        try:
            names = bundle.write(options.bundle, subject, as_text(rows), as_json(rows))
        except OSError as error:
            print("%s: error: %s: %s" % (_NAME, options.bundle, error.strerror or error), file=sys.stderr)
            return FAULTY
        print("%s holds %s. Look whether you may send it: it has names of your computers and the state of your arm."
              % (options.bundle, ", ".join(names)), file=sys.stderr)
    return FAULTY if Level.FAULT in levels else WELL


def as_text(rows: Sequence[ReportLine]) -> str:
    """Return the report as lines for people."""
    return "".join(map(_lines, rows))


def as_json(rows: Sequence[ReportLine]) -> str:
    """Return the report as JSON: each check with its level, what was found, meaning and remedy."""
    return json.dumps({
        "version": __version__, "faults": sum(row.finding.level is Level.FAULT for row in rows),
        "checks": [{"check": row.name, **row.finding._asdict(), "level": row.finding.level.value} for row in rows]},
        indent=1)


def _shown(row: ReportLine, is_quiet: bool) -> ReportLine:
    if not is_quiet:
        print(_lines(row), end="", flush=True)
    return row


def _lines(row: ReportLine) -> str:
    finding = row.finding
    text = "%-8s %s: %s\n" % (finding.level.value, row.name, finding.found)
    if finding.level in (Level.WARNING, Level.FAULT):
        text += textwrap.indent("meaning: %s\nremedy: %s\n" % (finding.meaning, finding.remedy), " " * 9)
    return text


def _subject(options: argparse.Namespace, given: Dict[str, Any]) -> ExaminedSystem:
    node = "/" + options.node.strip("/")
    kept: Dict[str, Any] = {}
    try:
        from jaka_ros_driver.doctor.graph import parameters_of
        kept = parameters_of(node)
    except ImportError:
        pass
    source = " and ".join(filter(None, [
        "parameters of %s" % node if kept else "", "the words given" if given else ""])) or "the driver's defaults"
    return ExaminedSystem({**kept, **given}, source, node, options.black_box or "", options.status_only)


def _parameters(words: Sequence[str]) -> Dict[str, Any]:
    """Return the parameters that words of the form NAME:=VALUE set; raise ValueError for another form."""
    values = {}
    for word in words:
        name, sign, text = word.partition(":=")
        if not sign or not name.strip("_"):
            raise ValueError("%s is not of the form NAME:=VALUE" % ascii(word))
        try:
            value = yaml.safe_load(text) if text else ""
        except (yaml.YAMLError, ValueError, RecursionError):
            value = text
        values[name.lstrip("_")] = text if name.lstrip("_") == "ip" else value
    return values


if __name__ == "__main__":
    sys.exit(main())
