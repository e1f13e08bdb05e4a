"""The subcommands of ``jaka_bag``; each is a module that is imported when it is called."""
import importlib
from types import ModuleType
from typing import Dict, NamedTuple


class Command(NamedTuple):
    """One subcommand.

    Attributes:
        module: Has ``add_arguments(parser)`` and ``run(args) -> int``; with ``run_files(names) -> int`` a call without
            options starts faster, because argparse is not imported.
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
