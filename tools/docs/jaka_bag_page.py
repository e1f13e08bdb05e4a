"""The page ``docs/jaka_bag.md``, made from the parsers:

    build/venv/bin/python3 tools/docs/jaka_bag_page.py > docs/jaka_bag.md

The test of the page tells when it has to be written anew.
"""
import argparse
import sys
from typing import List

from peers import COMMANDS as PEER_COMMANDS
from peers import OPTIONS, WITHOUT, Peers

from jaka_bag.cli.main import COMMANDS, EXECUTABLE, load_command, parser_of

_HEAD = """\
# jaka_bag: commands and options

A reference for whoever knows what to do and looks for the option: what each command and option is called here, and what
`rosbag`, `mcap` and `ros2 bag` call the same. [state_logs.md](state_logs.md) says what the commands are for and what
stands behind them; `{executable} COMMAND --help` has examples of each. With a log of yours:

```sh
{executable} info --freq run.bag
{executable} convert run.bag -o again.mcap
{executable} compare run.bag again.mcap
```

This page is made from the commands themselves; after a change write it anew, in a shell that knows the build:
`build/venv/bin/python3 tools/docs/jaka_bag_page.py > docs/jaka_bag.md`.

## What holds for all

- **Times** are `5`, `5s`, `500ms`, `2m`, `1h`, `1:30` or `1:02:03`, everywhere. A moment counts from the log's start,
  with a minus from its end (`-s -10s`). Absolute are numbers from 1e8 on (s since the epoch), numbers with nine
  decimals as `info` prints them (`42.000000000`, for logs of simulated time), and those behind an `@`.
- **A letter means the same everywhere**, and what it means in `rosbag` where that has it: `-s` start, `-u` duration,
  `-d` delay, `-e` regular expressions, `-x` exclude, `-t` topics, `-o` output, `-k` key or keep alive, `-f` force.
- **Outputs** are named behind the input or with `-o`, appear only when whole, and overwrite nothing without `--force`.
- **Nothing by mistake**: a topic, type or time that the log does not have ends with exit code 2, the nearest name or
  the log's true range.
- **Exit code**: 0 done, 1 failed, partial or different, 2 usage. An error of one file among several does not keep the
  others from their turn.
- Every command that reads takes `.bag`, `.mcap` and `.mcap.active`, a recording that is still being written.

## Commands

| jaka_bag | what it does | rosbag | mcap | ros2 bag |
|---|---|---|---|---|
"""


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def _code(words: str) -> str:
    return ", ".join("`%s`" % word.strip() for word in words.split(",")) if words else ""


def _row(name: str, summary: str, peers: Peers) -> str:
    return "| %s | %s | %s |" % (name, _cell(summary), " | ".join(_code(words) for words in peers))


def _name_of(action: argparse.Action) -> str:
    """Return the longest of an option's names."""
    return max(action.option_strings, key=len)


def shown_options(parser: argparse.ArgumentParser) -> List[argparse.Action]:
    """Return the options that a command's help names, without ``--help``."""
    return [action for action in parser._actions
            if action.option_strings and action.help != argparse.SUPPRESS and "--help" not in action.option_strings]


def _option_row(action: argparse.Action, peers: Peers) -> str:
    value = ""
    if action.nargs != 0:
        value = " " + (action.metavar if isinstance(action.metavar, str) else action.metavar[0] if action.metavar
                       else "{%s}" % ",".join(map(str, action.choices)) if action.choices
                       else (action.dest or "").upper())
    return _row("`%s%s`" % (", ".join(action.option_strings), value.replace("|", "\\|")), action.help or "", peers)


def _section(name: str) -> List[str]:
    parser = parser_of(name, load_command(name), 98)
    positional = " ".join(action.metavar if isinstance(action.metavar, str) else action.dest
                          for action in parser._actions if not action.option_strings)
    lines = ["", "## %s" % name, "", "`%s`: %s." % (" ".join(filter(None, [EXECUTABLE, name, positional])),
                                                  _cell(COMMANDS[name].summary)), ""]
    options = shown_options(parser)
    if options:
        lines += ["| option | what it does | rosbag | mcap | ros2 bag |", "|---|---|---|---|---|"]
        lines += [_option_row(action, OPTIONS.get(name, {}).get(_name_of(action), Peers())) for action in options]
    else:
        lines.append("It has no options.")
    return lines


def page() -> str:
    """Return the text of the page.

    Raises:
        MissingCommand: The package that brings a command is not installed.
    """
    lines = [_HEAD.format(executable=EXECUTABLE).rstrip("\n")]
    lines += [_row("[%s](#%s)" % (name, name.replace(" ", "-")), command.summary, PEER_COMMANDS.get(name, Peers()))
              for name, command in COMMANDS.items()]
    lines += ["", "Options of `rosbag` without a counterpart:", "", "| rosbag | here |", "|---|---|"]
    lines += ["| `%s` | %s |" % (option, reason) for option, reason in WITHOUT.items()]
    for name in COMMANDS:
        lines += _section(name)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    argparse.ArgumentParser(description="Print docs/jaka_bag.md, made from the parsers.").parse_args()
    sys.stdout.write(page())
