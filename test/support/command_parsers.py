"""The parsers of the executables, taken from the executables themselves: all their commands and options."""
import argparse
import contextlib
import importlib
import io
import re
import sys
from typing import Iterator, List, Optional, Sequence, Tuple

import command_places
from import_graph import outside_imports

from jaka_bag.cli.main import COMMANDS, _with_files_first, load_command, parser_of


class Wrong(Exception):
    """Words that an executable does not understand, or that a reader cannot type as they stand; the reason."""


class _Stopped(BaseException):
    """The sign that the executable has come to its parser."""


def needs_ros(executable: str) -> bool:
    """Return whether an executable imports rospy."""
    return "rospy" in outside_imports(command_places.declared()[executable].split(":")[0])


def commands() -> Iterator[Tuple[str, List[str]]]:
    """Return every executable of the build with each of its subcommands, and with none."""
    for executable in sorted(command_places.declared()):
        yield executable, []
        if executable == "jaka_bag":
            yield from ((executable, name.split()) for name in COMMANDS)
        elif not needs_ros(executable):
            description = parser(executable, []).description or ""
            yield from ((executable, [name]) for name in re.findall(r"'%s (\w+) --help'" % executable, description))


def parser(executable: str, words: Sequence[str], judged: bool = False) -> argparse.ArgumentParser:
    """Return the parser that an executable, or subcommand, makes for these words.

    With ``judged`` the words must be understood, else Wrong is raised; the executable never comes further than that.
    """
    if executable == "jaka_bag" and words:
        name = " ".join(words[:2]) if " ".join(words[:2]) in COMMANDS else words[0]
        if name not in COMMANDS:
            raise Wrong("jaka_bag has no command %s" % name)
        found = parser_of(name, load_command(name), 98)
        rest = list(words[len(name.split()):])
        return _judged(found, lambda: found.parse_intermixed_args(_with_files_first(found, rest))) if judged else found
    module, _, function = command_places.declared()[executable].partition(":")
    return _asked(getattr(importlib.import_module(module), function), [executable, *words], judged)


def _judged(found: argparse.ArgumentParser, parse) -> argparse.ArgumentParser:
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            parse()
    except SystemExit as end:
        if end.code:
            raise Wrong(said.getvalue()) from None
    return found


def _asked(main, argv: List[str], judged: bool) -> argparse.ArgumentParser:
    seen: List[argparse.ArgumentParser] = []
    names = ("parse_args", "parse_known_args", "parse_intermixed_args")
    kept = {name: getattr(argparse.ArgumentParser, name) for name in names}
    before = sys.argv

    def restore():
        for name in names:
            setattr(argparse.ArgumentParser, name, kept[name])

    def stop(name):
        def asked(self, *arguments, **options):
            seen.append(self)
            restore()  # these methods call each other
            if judged:
                _judged(self, lambda: kept[name](self, *arguments, **options))
            raise _Stopped
        return asked

    try:
        sys.argv = argv
        for name in names:
            setattr(argparse.ArgumentParser, name, stop(name))
        main()
    except _Stopped:
        return seen[0]
    finally:
        sys.argv = before
        restore()
    raise Wrong("%s asks no parser" % argv)


def understand(executable: str, words: Sequence[str], is_whole: bool = True) -> None:
    """Raise Wrong where an executable does not understand these words.

    Where they are not a whole command, it must have the subcommand and the options that they name.
    """
    if executable == "jaka_bag" and (not words or words[0] in ("--help", "--version")):
        return
    if not is_whole and executable == "jaka_bag" and len(words) == 1 and _is_family(words[0]):
        return
    if not is_whole:
        known = parser(executable, words)._option_string_actions
        unknown = [word for word in words if re.match("--?[a-z]", word) and word.split("=")[0] not in known
                   and (word[:2] == "--" or word[:2] not in known)]
        if unknown:
            raise Wrong("%s has no %s" % (executable, unknown))
        if executable == "jaka_bag":
            return
    problem = _problem(executable, words)
    if problem and (is_whole or "are required" not in problem):
        raise Wrong("%s: %s" % (" ".join(words), problem))


def _is_family(name: str) -> bool:
    return any(command.startswith(name + " ") for command in COMMANDS)


def _problem(executable: str, words: Sequence[str]) -> Optional[str]:
    try:
        parser(executable, words, judged=True)
    except Wrong as wrong:
        return str(wrong)
    return None
