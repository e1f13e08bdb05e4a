"""The command ``jaka_bag``: its subcommands, each a module that is imported when it is called; and ``jaka_foxglove``.

What goes wrong becomes a line and an exit code here.
"""
import importlib
import io
import os
import re
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from ..errors import JakaBagError, UsageError

if TYPE_CHECKING:
    import argparse

EXECUTABLE = "jaka_bag"


_NEGATIVE_TIME = re.compile(r"^-[0-9.]")
"""Words that are values, as ``-2m`` before the end of a log, and no options."""


class Subcommand(NamedTuple):
    """One subcommand.

    Attributes:
        module: Has ``add_arguments(parser)``, ``run(args) -> int`` and, for the end of its help, ``EPILOG``; what the
            functions raise of ``JakaBagError`` is printed. With ``run_files(names) -> int`` a call without options
            starts faster: argparse is not imported.
        summary: One line for ``--help``.
        failed: Exit code where it could not be done.
        needs: The package that has to be installed for it, of those in ``BROUGHT_BY``.
    """

    module: str
    summary: str
    failed: int = 1
    needs: str = ""


class MissingCommand(Exception):
    """The package that brings a subcommand is not installed; the text explains how to get it."""


COMMANDS: Dict[str, Subcommand] = {
    "record": Subcommand("jaka_blackbox.cli.record", "record topics (as rosbag record)"),
    "play": Subcommand("jaka_bag.cli.play", "publish the messages of logs (as rosbag play)"),
    "info": Subcommand("jaka_bag.cli.info", "what is in a log (as rosbag info); --freq: rate, jitter, gaps, drops"),
    "serve": Subcommand("jaka_foxglove.cli.serve", "show logs to Foxglove and Lichtblick: play, pause, seek, speed"),
    "convert": Subcommand("jaka_bag.cli.convert", "between .bag, .mcap and rosbag2 folders, one or many; compress"),
    "filter": Subcommand("jaka_bag.cli.filter", "a part of a log: topics, types, times (as rosbag filter)"),
    "merge": Subcommand("jaka_bag.cli.merge", "several logs into one, in the order of time"),
    "split": Subcommand("jaka_bag.cli.split", "one log into several, by size, duration or count"),
    "recover": Subcommand("jaka_bag.cli.recover",
                          "all that can be read of a cut-off or damaged log (as rosbag reindex)"),
    "cat": Subcommand("jaka_bag.cli.cat", "messages as lines of JSON (as mcap cat)"),
    "du": Subcommand("jaka_bag.cli.du", "bytes of each topic (as mcap du)"),
    "doctor": Subcommand("jaka_bag.cli.doctor", "is a log whole, and if not, why not (as mcap doctor)"),
    "attach": Subcommand("jaka_bag.cli.attach", "add files and facts to an .mcap (as mcap add)"),
    "extract": Subcommand("jaka_bag.cli.extract", "the files and facts in an .mcap (as mcap list, mcap get)"),
    "plot": Subcommand("jaka_bag.cli.plot", "joints, TCP path and states over time as SVG or PNG"),
    "export": Subcommand("jaka_bag.cli.export", "fields of messages as CSV, NPZ or Parquet"),
    "compare": Subcommand("jaka_fleet.cli.compare",
                       "does a log show what a golden one shows? with tolerances, HTML, JUnit", failed=2),
    "report": Subcommand("jaka_blackbox.cli.report", "what happened around an accident, second by second, as a page"),
    "verify": Subcommand("jaka_bag.cli.verify", "was a signed log changed, or a driver's audit log?"),
    "dataset add": Subcommand("jaka_fleet.cli.add", "many logs into a data set of Parquet tables, here or on Dask"),
    "dataset query": Subcommand("jaka_fleet.cli.query", "ask a data set in SQL (DuckDB)"),
    "dataset compact": Subcommand("jaka_fleet.cli.compact", "put a data set's table of logs into one file"),
    "replay": Subcommand("jaka_fleet.cli.replay",
                      "make golden logs happen again, side by side, against a driver, and compare",
                      needs="jaka_regression"),
    "replay-commands": Subcommand("jaka_regression.replay_commands",
                               "make the service calls of a log again, against a live driver", needs="jaka_regression"),
    "replay-wire": Subcommand("jaka_regression.replay_wire",
                           "play a recorded controller's bytes to the driver, and compare", needs="jaka_regression"),
    "replay-motion": Subcommand("jaka_regression.replay_motion",
                             "do again what the arm did in a log, hand guiding included, as a trajectory",
                             needs="jaka_regression"),
    "completion": Subcommand("jaka_bag.cli.completion", "completion for bash or zsh"),
}

ELSEWHERE = {
    "compress": "'jaka_bag convert run.bag small.bag -c bz2' compresses (-c lz4, or zstd for .mcap)",
    "decompress": "'jaka_bag convert run.bag plain.bag -c none' decompresses",
    "reindex": "'jaka_bag recover run.bag.active' makes a whole log of a cut-off one",
    "check": "'jaka_bag doctor run.bag' tells whether a log is whole, 'jaka_bag compare' what differs from another",
    "fix": "messages are kept as they were recorded; 'jaka_bag recover' is for damaged logs",
    "decrypt": "encrypted bags cannot be read",
    "encrypt": "encrypted bags cannot be written",
    "sort": "'jaka_bag merge run.mcap -o sorted.mcap' writes the messages in the order of time",
    "validate": "'jaka_bag doctor run.mcap' tells whether a log is whole",
    "diff": "'jaka_bag compare golden.mcap run.mcap' tells what differs",
    "echo": "'jaka_bag cat run.bag -t /topic' prints the messages",
    "list": "'jaka_bag info run.mcap' lists topics, attachments and metadata",
    "get": "'jaka_bag extract run.mcap -o folder' writes attachments and metadata",
    "add": "'jaka_bag attach run.mcap notes.txt -o new.mcap' adds an attachment",
    "snapshot": "'jaka_bag record --snapshot 30s' keeps the newest messages in memory",
}
"""Commands of other tools, and what does the same here."""

LIVE_EXECUTABLE = "jaka_foxglove"
LIVE = Subcommand("jaka_foxglove.cli.live", "show the topics of a running ROS 1 system to Foxglove and Lichtblick")

BROUGHT_BY = {"jaka_regression": "the ROS package jaka_ros_driver: build it in a catkin workspace (or with its "
                                 "tools/dev setup), source the setup.bash there, and call jaka_bag in that shell"}
"""Packages besides this one that bring subcommands, and how a user gets them."""


def is_installed(name: str) -> bool:
    """Return whether the package that brings a subcommand is installed."""
    from importlib.util import find_spec
    needed = COMMANDS[name].needs
    return not needed or find_spec(needed) is not None


def load_command(name: str) -> ModuleType:
    """Import the module of a subcommand.

    Raises:
        MissingCommand: The package that brings it is not installed.
    """
    needed = COMMANDS[name].needs
    try:
        return importlib.import_module(COMMANDS[name].module)
    except ModuleNotFoundError as error:
        if not needed or error.name != needed:
            raise
        raise MissingCommand("%s needs the Python package %s, which comes with %s"
                             % (name, needed, BROUGHT_BY[needed])) from None


_CONTROLS = {code: "\\x%02x" % code for code in [*range(32), *range(127, 160)] if chr(code) not in "\n\t"}
_CONTROLS.update({code: "\\u%04x" % code for code in [*range(0x202A, 0x202F), *range(0x2066, 0x206A)]})


def printable(text: object) -> str:
    """Return a text for a terminal, with its control characters escaped: a topic's name may be made up to steer it."""
    return str(text).translate(_CONTROLS)


def error_line(error: Exception) -> str:
    """Return an error as one line without control characters."""
    if isinstance(error, OSError) and not isinstance(error, JakaBagError):
        text = "%s%s" % ("%s: " % error.filename if error.filename else "", error.strerror or error)
    else:
        text = str(error)
    return printable(" ".join(text.split()))


def for_each_file(files: Iterable[str], work: Callable[[str], object]) -> int:
    """Do the same for each of several files; an error of one is printed and does not keep the others from their turn.

    Returns:
        The exit code: 0, 1 where one failed, 2 where what was asked for is not in one.
    """
    code = 0
    for path in files:
        try:
            work(path)
        except BrokenPipeError:
            raise
        except (JakaBagError, OSError) as error:
            sys.stdout.flush()
            print("%s: error: %s" % (EXECUTABLE, error_line(error)), file=sys.stderr)
            code = max(code, 2 if isinstance(error, UsageError) else 1)
    return code


def human_bytes(count: float) -> str:
    """Format a number of bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if abs(count) < 1000 or unit == "GB":
            break
        count /= 1000.0
    return "%.*f %s" % (unit != "B", count, unit)


def _help() -> str:
    lines = ["usage: %s COMMAND [OPTIONS]" % EXECUTABLE, "",
             "State logs of ROS 1, .bag and .mcap alike: the format of an input is seen from its content,",
             "that of an output from its name. An input is never changed, an output appears only when whole.", "",
             "commands:"]
    lines += ["  %-16s%s" % (name, command.summary) for name, command in COMMANDS.items()]
    lines += ["", "'%s COMMAND --help' tells the options, '%s --version' the version." % (EXECUTABLE, EXECUTABLE),
              "Exit code: 0 done, 1 failed or partial, 2 usage."]
    return "\n".join(lines)


def command_of(words: List[str]) -> Tuple[str, List[str]]:
    """Split words into the name of a command, of one word or two, and the words after it."""
    count = 2 if " ".join(words[:2]) in COMMANDS else 1
    return " ".join(words[:count]), words[count:]


def _instead(name: str) -> str:
    """Return the hint after an unknown command: where that function is, or which command was probably meant."""
    family = [command for command in COMMANDS if command.startswith(name + " ")]
    if family:
        return ": it is one of %s" % ", ".join(family)
    if name in ELSEWHERE:
        return ": " + ELSEWHERE[name]
    import difflib
    near = difflib.get_close_matches(name, COMMANDS, 1)
    return ", did you mean %r?" % near[0] if near else ""


def _columns() -> int:
    """Return the width of help texts as argparse computes it, but without the modules that it imports for that."""
    try:
        return max(os.get_terminal_size(sys.stdout.fileno()).columns - 2, 40)
    except (OSError, ValueError):
        return 98


def parser_of(name: str, module: ModuleType, width: int) -> "argparse.ArgumentParser":
    """Return the parser of a subcommand whose module is given, with help texts of ``width`` columns."""
    return _parser("%s %s" % (EXECUTABLE, name), COMMANDS[name].summary, module, width)


def _parser(executable: str, summary: str, module: ModuleType, width: int) -> "argparse.ArgumentParser":
    import argparse

    parser = argparse.ArgumentParser(
        executable, description=summary, epilog=getattr(module, "EPILOG", None),
        formatter_class=lambda prog: argparse.RawDescriptionHelpFormatter(prog, width=width))
    module.add_arguments(parser)
    parser._negative_number_matcher = _NEGATIVE_TIME
    return parser


def _run(module: ModuleType, executable: str, summary: str, arguments: List[str]) -> int:
    run_files = getattr(module, "run_files", None)
    if run_files is not None and arguments and not any(word.startswith("-") for word in arguments):
        return int(run_files(arguments))
    _end_at_first_signal()
    parser = _parser(executable, summary, module, _columns())
    return int(module.run(parser.parse_intermixed_args(_with_files_first(parser, arguments))))


def _with_files_first(parser: "argparse.ArgumentParser", words: List[str]) -> List[str]:
    """Return the words with the files moved before lists of topics or types, which would take them in."""
    lists = {word for action in parser._actions if action.nargs == "+" and action.metavar != "FILE"
             for word in action.option_strings}
    files: List[str] = []
    rest: List[str] = []
    is_list = False
    for word in words:
        if word == "--":
            return files + rest + words[len(files) + len(rest):]
        if word.startswith("-") and not _NEGATIVE_TIME.match(word):
            is_list = word in lists
        (files if is_list and _is_log(word) else rest).append(word)
    return files + rest


def _is_log(word: str) -> bool:
    """Return whether a word names a log rather than a topic or a type."""
    return word.endswith((".bag", ".mcap", ".active")) or (
        os.path.isfile(word) or os.path.isfile(os.path.join(word, "metadata.yaml")))


def _end_at_first_signal() -> None:
    """Handle SIGTERM like Ctrl-C, so that no half file stays; only where nobody else has set a handler."""
    import signal

    from ..interrupts import raise_at_first_signal

    try:
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            raise_at_first_signal()
    except ValueError:  # not in the main thread: whoever runs us there decides
        pass


def main(argv: Optional[List[str]] = None) -> int:
    """Run one subcommand; return the exit code: 0 done, 1 failed or partial, 2 usage.

    That of ``compare`` is 1 for different, and 2 for everything that goes wrong.
    """
    arguments = sys.argv[1:] if argv is None else list(argv)
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_help(), file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    name, rest = command_of(arguments)
    if name in ("-V", "--version", "version"):
        from .. import __version__
        print("%s %s" % (EXECUTABLE, __version__))
        return 0
    if name not in COMMANDS:
        print("%s: error: no command %r%s (see %s --help)" % (
            EXECUTABLE, name, _instead(name), EXECUTABLE), file=sys.stderr)
        return 2
    command = COMMANDS[name]
    return _guarded(EXECUTABLE, "%s %s" % (EXECUTABLE, name), command.failed, lambda: _run(
        load_command(name), "%s %s" % (EXECUTABLE, name), command.summary, rest))


def live(argv: Optional[List[str]] = None) -> int:
    """Run the command ``jaka_foxglove``; return the exit code: 0 done, 1 failed, 2 usage."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    return _guarded(LIVE_EXECUTABLE, LIVE_EXECUTABLE, LIVE.failed, lambda: _run(
        importlib.import_module(LIVE.module), LIVE_EXECUTABLE, LIVE.summary, arguments))


def _guarded(executable: str, command: str, failed: int, run: Callable[[], int]) -> int:
    """Return the exit code of ``run``; print an error that it raises, and return 2 for usage, else ``failed``."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # names in logs may hold bytes that are not UTF-8: print them escaped rather than fail
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = run()
        sys.stdout.flush()  # here, where a reader that has gone is noticed and handled
        return code
    except SystemExit as end:  # argparse: help or usage
        return end.code if isinstance(end.code, int) else 2
    except MissingCommand as error:
        print("%s: error: %s" % (executable, error), file=sys.stderr)
        return 2
    except UsageError as error:
        print("%s: error: %s" % (command, error_line(error)), file=sys.stderr)
        return 2
    except JakaBagError as error:
        print("%s: error: %s" % (executable, error_line(error)), file=sys.stderr)
    except MemoryError:
        print("%s: error: there is not enough memory for this" % executable, file=sys.stderr)
    except BrokenPipeError:  # the reader of our output has gone: nobody is left to be told
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        print("%s: error: %s" % (executable, error_line(error)), file=sys.stderr)
    except KeyboardInterrupt:
        from ..output_file import abort_all

        abort_all()
        print("%s: interrupted, no half file is left" % executable, file=sys.stderr)
    except Exception:
        if failed == 1:
            raise  # ends with a traceback and exit code 1, which means failed
        import traceback
        traceback.print_exc()
    return failed
