"""The program ``jaka_bag``: its subcommands, each a module that is imported when it is called.

What goes wrong becomes a line and an exit code here.
"""
import importlib
import io
import os
import sys
from types import ModuleType
from typing import Dict, List, NamedTuple, Optional

from ..errors import JakaBagError, UsageError

PROGRAM = "jaka_bag"


class Command(NamedTuple):
    """One subcommand.

    Attributes:
        module: Has ``add_arguments(parser)``, ``run(args) -> int`` and, for the end of its help, ``EPILOG``; what the
            functions raise of ``JakaBagError`` is printed. With ``run_files(names) -> int`` a call without options
            starts faster: argparse is not imported.
        summary: One line for ``--help``.
    """

    module: str
    summary: str


class MissingCommand(Exception):
    """The package that brings a subcommand is not installed; the text says how to get it."""


COMMANDS: Dict[str, Command] = {
    "record": Command("jaka_bag.cli.record", "record topics (as rosbag record)"),
    "play": Command("jaka_bag.cli.play", "publish the messages of logs (as rosbag play)"),
    "info": Command("jaka_bag.cli.info", "what is in a log (as rosbag info); --freq: rate, jitter, gaps, drops"),
    "convert": Command("jaka_bag.cli.convert", "between .bag, .mcap and rosbag2 folders, one or many; compress"),
    "filter": Command("jaka_bag.cli.filter", "a part of a log: topics, types, times (as rosbag filter)"),
    "merge": Command("jaka_bag.cli.merge", "several logs into one, in the order of time"),
    "split": Command("jaka_bag.cli.split", "one log into several, by size, duration or count"),
    "recover": Command("jaka_bag.cli.recover", "all that can be read of a cut-off or damaged log (as rosbag reindex)"),
    "plot": Command("jaka_bag.cli.plot", "joints, TCP path and states over time as SVG or PNG"),
    "export": Command("jaka_bag.cli.export", "fields of messages as CSV, NPZ or Parquet"),
    "compare": Command("jaka_bag.cli.compare", "does a log show what a golden one shows? with tolerances, HTML, JUnit"),
    "replay-commands": Command("jaka_regression.replay_commands",
                               "make the service calls of a log again, against a live driver"),
    "replay-wire": Command("jaka_regression.replay_wire",
                           "play a recorded controller's bytes to the driver, and compare"),
    "replay-motion": Command("jaka_regression.replay_motion",
                             "do again what the arm did in a log, hand guiding included, as a trajectory"),
    "completion": Command("jaka_bag.cli.completion", "completion for bash or zsh"),
}

BROUGHT_BY = {"jaka_regression": "the ROS package jaka_ros_driver: build it in a catkin workspace (or with its "
                                 "tools/dev setup), source the setup.bash there, and call jaka_bag in that shell"}
"""Packages besides this one that bring subcommands, and how a user gets them."""


def is_installed(name: str) -> bool:
    """Whether the package that brings a subcommand is there."""
    from importlib.util import find_spec
    return find_spec(COMMANDS[name].module.split(".")[0]) is not None


def load_command(name: str) -> ModuleType:
    """The module of a subcommand.

    Raises:
        MissingCommand: The package that brings it is not installed.
    """
    module = COMMANDS[name].module
    package = module.split(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise MissingCommand("%s needs the Python package %s, which comes with %s"
                             % (name, package, BROUGHT_BY[package])) from None


def human_bytes(count: float) -> str:
    """A number of bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if abs(count) < 1000 or unit == "GB":
            break
        count /= 1000.0
    return "%.*f %s" % (unit != "B", count, unit)


def _help() -> str:
    lines = ["usage: %s COMMAND [OPTIONS]" % PROGRAM, "",
             "State logs of ROS 1, .bag and .mcap alike: the format of an input is seen from its content,",
             "that of an output from its name. An input is never changed, an output appears only when whole.", "",
             "commands:"]
    lines += ["  %-16s%s" % (name, command.summary) for name, command in COMMANDS.items()]
    lines += ["", "'%s COMMAND --help' tells the options. Exit code: 0 done, 1 failed or partial, 2 usage." % PROGRAM]
    return "\n".join(lines)


def _columns() -> int:
    """Width of help texts: the terminal's, as argparse takes it, but without the modules that it imports for that."""
    try:
        return max(os.get_terminal_size(sys.stdout.fileno()).columns - 2, 40)
    except (OSError, ValueError):
        return 98


def _run(name: str, arguments: List[str]) -> int:
    module = load_command(name)
    run_files = getattr(module, "run_files", None)
    if run_files is not None and arguments and not any(word.startswith("-") for word in arguments):
        return int(run_files(arguments))
    import argparse

    _end_at_sigterm()
    width = _columns()
    parser = argparse.ArgumentParser(
        "%s %s" % (PROGRAM, name), description=COMMANDS[name].summary, epilog=getattr(module, "EPILOG", None),
        formatter_class=lambda prog: argparse.RawDescriptionHelpFormatter(prog, width=width))
    module.add_arguments(parser)
    return int(module.run(parser.parse_intermixed_args(arguments)))


def _end_at_sigterm() -> None:
    """SIGTERM as Ctrl-C, so that no half file stays; only where nobody else has decided about it."""
    import signal

    try:
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, signal.default_int_handler)
    except ValueError:  # not in the main thread: whoever runs us there decides
        pass


def main(argv: Optional[List[str]] = None) -> int:
    """Run one subcommand; the result is the exit code: 0 done, 1 failed or partial, 2 usage."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(_help(), file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    name = arguments[0]
    if name not in COMMANDS:
        import difflib
        near = difflib.get_close_matches(name, COMMANDS, 1)
        print("%s: error: no command %r%s (see %s --help)"
              % (PROGRAM, name, ", did you mean %r?" % near[0] if near else "", PROGRAM), file=sys.stderr)
        return 2
    if isinstance(sys.stdout, io.TextIOWrapper):
        # names in logs may hold bytes that are not UTF-8: print them escaped rather than fail
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _run(name, arguments[1:])
        sys.stdout.flush()  # here, where a reader that has gone is noticed and handled
        return code
    except SystemExit as end:  # argparse: help or usage
        return end.code if isinstance(end.code, int) else 2
    except MissingCommand as error:
        print("%s: error: %s" % (PROGRAM, error), file=sys.stderr)
        return 2
    except UsageError as error:
        print("%s %s: error: %s" % (PROGRAM, name, " ".join(str(error).split())), file=sys.stderr)
        return 2
    except JakaBagError as error:
        print("%s: error: %s" % (PROGRAM, " ".join(str(error).split())), file=sys.stderr)
    except BrokenPipeError:  # the reader of our output has gone: nobody is left to be told
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        where = "%s: " % error.filename if error.filename else ""
        print("%s: error: %s%s" % (PROGRAM, where, error.strerror or error), file=sys.stderr)
    except KeyboardInterrupt:
        print("%s: interrupted, no half file is left" % PROGRAM, file=sys.stderr)
    return 1
