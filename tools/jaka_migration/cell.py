"""The command migrate_cell: what a cell has of the maker's driver, and its launch files changed to this one."""
import argparse
import difflib
import io
import os
import re
import sys
import textwrap
from typing import Dict, List, NamedTuple, Optional, Tuple

from jaka_migration.cell_files import LAUNCH, IsLink, NotDone, read, replace, single, walk
from jaka_migration.findings import SUBJECTS, CellFinding, in_source, interfaces_seen
from jaka_migration.launch_changes import Wanted, examine
from jaka_migration.launch_file import UnreadableLaunchFile
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model

_ADDRESS = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?\Z|[0-9A-Fa-f:]{2,39}(%[A-Za-z0-9_-]{1,15})?\Z")
_LONGEST = 100
"""Characters of a line of a file that are shown."""
_EPILOG = """\
exit codes:
  0  every file was read; with --write, what was to be changed is changed
  1  a file could not be read, changed or written, or the answer was no
  2  wrong usage

Without --write nothing is changed. Links are not followed. Of each launch file that is changed the bytes as they were
are kept beside it as FILE.before.
"""


class _Change(NamedTuple):
    path: str
    before: bytes
    after: bytes


class _Cell:
    """The result of reading the files below a folder.

    Attributes:
        places: For each subject the lines in which it was found.
        changes: The launch files that are to be changed.
        problems: What could not be read or changed, each with its file.
        notes: What was passed over, each with its file.
        interfaces: For each interface the source files that read tool_position in its type.
        drivers: How many drivers the launch files start.
    """

    def __init__(self, root: str, wanted: Optional[Wanted]) -> None:
        self._root = root
        self._wanted = wanted
        self._takes_ip = 0
        self.places: Dict[str, List[str]] = {}
        self.changes: List[_Change] = []
        self.problems: List[str] = []
        self.notes: List[str] = []
        self.interfaces: Dict[str, List[str]] = {}
        self.drivers = 0
        self.count = 0

    def read_all(self, name: str) -> None:
        """Read one file of the folder, or with "" all of them."""
        files = [single(name)] if name else walk(self._root, lambda path, why: self.notes.append(_at(path, why)))
        for one in files:
            try:
                data = read(self._root, one.path)
            except IsLink as error:
                self.notes.append(_at(one.path, str(error)))
                continue
            except NotDone as error:
                self.problems.append(_at(one.path, str(error)))
                continue
            self.count += 1
            if one.what == LAUNCH:
                self._launch_file(one.path, data)
            else:
                found = list(in_source(data, one.kind))
                self._found(one.path, found)
                for interface in interfaces_seen(data, found):
                    self.interfaces.setdefault(interface, []).append(one.path)
        if self._takes_ip > 1:
            self.problems.append("--ip would give one address to %d drivers: name one file at a time" % self._takes_ip)
            self.changes.clear()

    def _launch_file(self, path: str, data: bytes) -> None:
        try:
            result = examine(data, self._wanted)
        except UnreadableLaunchFile as error:
            self.problems.append(_at(path, "%s: not looked at" % error))
            return
        self._found(path, result.findings)
        self.drivers += result.drivers
        self._takes_ip += result.takes_ip
        self.problems += [_at(path, "%s: not changed" % reason) for reason in result.against]
        if result.text != data:
            self.changes.append(_Change(path, data, result.text))

    def _found(self, path: str, findings: List[CellFinding]) -> None:
        for one in findings:
            self.places.setdefault(one.subject, []).append("%s:%d: %s" % (shown(path), one.line, _line(one.text)))

    def write(self) -> None:
        """Write every change; those that cannot be written become problems."""
        for change in self.changes:
            try:
                replace(self._root, change.path, change.before, change.after)
                print("written: %s, as it was: %s.before" % ((shown(change.path),) * 2))
            except NotDone as error:
                self.problems.append(_at(change.path, str(error)))


def shown(text: str) -> str:
    """Return a text of a file, or its name, in which nothing can act on a terminal."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(char if char.isprintable() or char == "\t" else char.encode("unicode_escape").decode()
                   for char in text)


def _line(data: bytes) -> str:
    text = " ".join(shown(data[:4 * _LONGEST].decode("utf-8", "backslashreplace").replace("\n", " ")).split())
    return text.replace("\\r ", "").rstrip("\\r") if len(text) <= _LONGEST else text[:_LONGEST - 3] + "..."


def _at(path: str, why: str) -> str:
    return "%s: %s" % (shown(path), shown(why))


def _diff(change: _Change) -> str:
    def lines(data: bytes) -> List[str]:
        return [shown(line[:-1] if line.endswith("\r") else line)
                for line in data.decode("utf-8", "backslashreplace").split("\n")]
    name = shown(change.path)
    return "\n".join(difflib.unified_diff(lines(change.before), lines(change.after), name, name + " (changed)",
                                          lineterm=""))


def _report(cell: _Cell) -> None:
    """Print what was found, subject by subject."""
    print("%d launch files and source files read, %d drivers started by them" % (cell.count, cell.drivers))
    for key, subject in SUBJECTS.items():
        if key in cell.places:
            print("\n" + subject.title)
            for label, text in (("there: ", subject.means), ("here:  ", subject.todo)):
                print(textwrap.fill(text, 110, initial_indent="  " + label, subsequent_indent=9 * " ",
                                    break_long_words=False, break_on_hyphens=False))
            print("\n".join("    " + place for place in cell.places[key]))
    if cell.interfaces:
        print("\nWhich interface: tool_position stands in one file with the type of")
        for interface, paths in sorted(cell.interfaces.items()):
            print("    %s: %s" % (interface, ", ".join(map(shown, paths))))
    elif cell.places:
        print("\nWhich interface: where `rostopic type /jaka_driver/tool_position` shows PoseStamped with the maker's "
              "driver, vendor_2025; else vendor")
    if cell.notes:
        print("\nPassed over:\n" + "\n".join("    " + note for note in cell.notes))


def _is_agreed() -> bool:
    try:
        return sys.stdin.isatty() and input("Write this? [y/N] ").strip().lower() in ("y", "yes")
    except EOFError:
        return False


def _options(argv: Optional[List[str]]) -> Tuple[argparse.Namespace, Optional[Wanted]]:
    parser = argparse.ArgumentParser(
        prog="migrate_cell", formatter_class=argparse.RawDescriptionHelpFormatter, epilog=_EPILOG,
        description="Reads the launch files and code of a cell that was written for the maker's driver, shows what "
                    "of them\nmeans something else here, and changes the launch files (docs/migration.md).")
    parser.add_argument("path", metavar="PATH", help="folder of the cell, such as its package; or one file")
    parser.add_argument("--interface", choices=("vendor", "vendor_2025"),
                        help="whose behaviour the cell expects: the maker's driver of 2024, or of 2025")
    parser.add_argument("--model", metavar="ARM", help="the arm: zu3, zu5, zu7, zu12 and others (docs/parameters.md)")
    parser.add_argument("--ip", metavar="ADDRESS", default="",
                        help="the controller, for launch files in which it does not stand")
    parser.add_argument("--write", action="store_true", help="change the launch files, after a question")
    parser.add_argument("--yes", action="store_true", help="with --write: do not ask")
    options = parser.parse_args(argv)
    if options.write and not (options.interface and options.model):
        parser.error("--write needs --interface and --model: without them the driver's defaults would stand, and "
                     "motions would mean something else")
    if options.yes and not options.write:
        parser.error("--yes is for --write")
    if options.ip and not _ADDRESS.match(options.ip):
        parser.error("argument --ip: %s is no IP address or host name" % shown(options.ip))
    if not options.model:
        return options, None
    try:
        model = load_model(options.model).name
    except InvalidCommand as error:
        parser.error("argument --model: %s" % error)
    return options, Wanted(options.interface, model, options.ip) if options.interface else None


def _run(options: argparse.Namespace, wanted: Optional[Wanted]) -> int:
    place = os.path.realpath(options.path)
    if not os.path.exists(place):
        print("migrate_cell: error: %s is not there" % shown(options.path), file=sys.stderr)
        return 2
    name = "" if os.path.isdir(place) else os.path.basename(place)
    cell = _Cell(os.path.dirname(place) if name else place, wanted)
    cell.read_all(name)
    _report(cell)
    for change in cell.changes:
        print("\n" + _diff(change))
    is_refused = False
    if options.write and cell.changes:
        print(flush=True)
        if options.yes or _is_agreed():
            cell.write()
        else:
            is_refused = True
            print("nothing written" + ("" if sys.stdin.isatty() else ": nobody can be asked here; --yes is needed"))
    elif options.write:
        print("\nnothing to change")
    elif cell.drivers:
        print("\nNothing was changed. " + ("With --write it is." if cell.changes else (
            "--write --interface INTERFACE --model ARM changes the launch files." if wanted is None else
            "There is nothing to change.")))
    sys.stdout.flush()
    for problem in cell.problems:
        print("migrate_cell: %s" % problem, file=sys.stderr)
    return 1 if cell.problems or is_refused else 0


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    options, wanted = _options(argv)
    try:
        return _run(options, wanted)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


if __name__ == "__main__":
    sys.exit(main())
