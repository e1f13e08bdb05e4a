"""A runner that executes a Python script until it has understood its arguments, and no further.

Its arguments are the script's file and the script's arguments. All that the script imports and prepares is done. Where
it has an argparse parser, that one judges the arguments; else the last block of the script does, with functions that do
nothing in place of its own. Exit code 0: understood, 2: not by the parser, 3: the script began its work without asking
its parser.
"""
import argparse
import ast
import sys
import types
from pathlib import Path


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


if __name__ == "__main__":
    sys.argv.pop(0)
    sys.path[0] = str(Path(sys.argv[0]).resolve().parent)
    sys.exit(understand(Path(sys.argv[0])))
