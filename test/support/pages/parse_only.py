"""A runner that executes Python scripts until they have understood their arguments, and no further.

It reads commands, one JSON list a line: a script's file and the script's arguments. All that the script imports and
prepares is done, in a process of its own that is forked from this one, which has imported what takes long. Where the
script has an argparse parser, that one judges the arguments; else the last block of the script does, with functions
that do nothing in place of its own.

For each command it writes a line, a JSON list of what the script said and its exit code. 0: understood, 1: the script
cannot run, 2: not understood by the parser, 3: the script began its work without asking its parser.
"""
import argparse
import ast
import contextlib
import importlib
import json
import os
import sys
import tempfile
import traceback
import types
from pathlib import Path

SLOW = ("aiohttp", "numpy", "roslaunch", "rosmaster.master", "rospy", "rostopic")
"""Packages of others that many scripts import."""


class Understood(BaseException):
    """The sign that the parser accepts the arguments."""


def _stop_after(parse):
    def parsed(*arguments, **options):
        parse(*arguments, **options)
        raise Understood
    return parsed


def is_start(node: ast.stmt) -> bool:
    """Return whether this is the block ``if __name__ == "__main__"``."""
    return isinstance(node, ast.If) and "__name__" in {part.id for part in ast.walk(node.test)
                                                       if isinstance(part, ast.Name)}


def understand(script: Path) -> int:
    """Run the script as described above; return the exit code."""
    tree = ast.parse(script.read_text(encoding="utf-8"))
    start = ast.Module([node for node in tree.body if is_start(node)], [])
    main = types.ModuleType("__main__")
    main.__file__ = str(script)
    main.__doc__ = ast.get_docstring(tree)
    sys.modules["__main__"] = main
    space = main.__dict__
    tree.body = [node for node in tree.body if not is_start(node)]
    exec(compile(tree, str(script), "exec"), space)
    has_parser = any(isinstance(node, ast.Attribute) and node.attr == "ArgumentParser" for node in ast.walk(tree))
    if has_parser:
        argparse.ArgumentParser.parse_args = _stop_after(argparse.ArgumentParser.parse_args)
    else:
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        for called in {node.func.id for node in ast.walk(start)
                       if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)} & own:
            space[called] = lambda *_, **__: None
    try:
        exec(compile(start, str(script), "exec"), space)
    except Understood:
        return 0
    return 3 if has_parser else 0


def run(words: "list[str]") -> None:
    """Run a script in this process, and end the process with the exit code."""
    sys.argv[:] = words
    sys.path[0] = str(Path(words[0]).resolve().parent)
    try:
        code = understand(Path(words[0]))
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    for name in SLOW:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    for line in sys.stdin:
        with tempfile.TemporaryFile() as output:
            child = os.fork()
            if not child:
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                os.dup2(output.fileno(), 1)
                os.dup2(output.fileno(), 2)
                run(json.loads(line))
            _, status = os.waitpid(child, 0)
            output.seek(0)
            print(json.dumps([output.read().decode(errors="replace"), os.WEXITSTATUS(status)]), flush=True)
