"""Man pages and completions of the commands, made from the commands themselves.

argv: the folder in which they are installed, the folder to write into, the version.
"""
import argparse
import importlib
import os
import pathlib
import re
import subprocess
import sys
from typing import Any, NoReturn
from unittest import mock

import shtab

SUMMARIES = {
    "check_moveit_config": "check a MoveIt configuration of a JAKA arm against the driver",
    "jaka_bag": "record, play, convert, inspect and compare state logs of ROS 1",
    "jaka_doctor": "find what a computer lacks for the ROS driver of a JAKA arm",
    "jaka_driver": "ROS driver of one JAKA arm",
    "jaka_foxglove": "show a running ROS 1 system to Foxglove and Lichtblick",
    "jaka_panel": "operator's page in the browser for JAKA arms",
    "jaka_probe": "find out how a JAKA controller differs from its documents",
    "jaka_sim": "simulated controller of a JAKA arm",
    "jaka_sim panel": "send a request to the operator port of a running simulated controller",
    "jaka_sim proxy": "record what passes between a driver and a controller",
    "migrate_cell": "read and change a cell that was written for the maker's driver of JAKA arms",
}
PARSED = {"check_moveit_config": "jaka_migration.moveit_config", "jaka_doctor": "jaka_ros_driver.doctor.command",
          "jaka_driver": "jaka_ros_driver.ros.node",
          "jaka_panel": "jaka_panel.command", "jaka_probe": "jaka_ros_driver.probe.command",
          "jaka_sim": "jaka_ros_driver.simulation.__main__", "migrate_cell": "jaka_migration.cell"}
"""Commands whose parser is asked; jaka_bag has completions of its own."""


class ParserFound(BaseException):
    """A signal that carries a parser out of the command that was about to use it."""


def parser_of(module: str) -> argparse.ArgumentParser:
    """Return the parser that a command makes."""
    def stop(parser: argparse.ArgumentParser, *_: Any) -> NoReturn:
        raise ParserFound(parser)
    imported = importlib.import_module(module)
    with mock.patch.object(argparse.ArgumentParser, "parse_args", stop):
        try:
            imported.main([])
        except ParserFound as found:
            parser: argparse.ArgumentParser = found.args[0]
            return parser
    raise RuntimeError("%s parses no options" % module)


def main() -> None:
    """Write all of them."""
    from jaka_bag.cli.main import COMMANDS, is_installed
    installed, into, version = sys.argv[1:]
    executables = os.path.join(installed, "usr/lib/jaka_ros_driver")
    pages = dict(SUMMARIES)
    pages.update(("jaka_bag " + name, command.summary) for name, command in COMMANDS.items() if is_installed(name))
    folders = {name: pathlib.Path(into, name) for name in ("man", "bash", "zsh")}
    for folder in folders.values():
        folder.mkdir(exist_ok=True)
    for words, summary in pages.items():
        executable, *command = words.split()
        text = subprocess.run(
            ["help2man", "--no-info", "--no-discard-stderr", "--name=" + summary, "--version-string=" + version,
             " ".join([os.path.join(executables, executable), *command])],
            check=True, stdout=subprocess.PIPE).stdout.decode()
        name = words.replace(" ", "-")  # a page of a subcommand is found by it, as git-log; help2man knows none
        text = re.sub(r"^\.TH [^\"]*\"", '.TH %s "' % name.upper(), text, count=1, flags=re.MULTILINE)
        text = text.replace("\n%s \\- " % words, "\n%s \\- " % name, 1)
        (folders["man"] / (name + ".1")).write_text(text, encoding="utf-8")
    for executable, module in PARSED.items():
        for shell, name in (("bash", executable), ("zsh", "_" + executable)):
            text = shtab.complete(parser_of(module), shell)
            (folders[shell] / name).write_text(text, encoding="utf-8")
    for shell, name in (("bash", "jaka_bag"), ("zsh", "_jaka_bag")):
        text = subprocess.run([os.path.join(executables, "jaka_bag"), "completion", shell], check=True,
                              stdout=subprocess.PIPE).stdout
        (folders[shell] / name).write_bytes(text)


if __name__ == "__main__":
    main()
