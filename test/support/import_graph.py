"""Who imports what, read from the syntax tree: nothing is imported to find out."""
import ast
from functools import lru_cache
from pathlib import Path
from typing import FrozenSet, Iterator

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGE = "jaka_ros_driver"


def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def at_import(tree: ast.Module) -> ast.Module:
    """The module without the bodies of its functions: their imports run when they are called."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    return ast.Module(body=[node for node in tree.body if not isinstance(node, functions)], type_ignores=[])


def imported_names(tree: ast.AST, folder: Path) -> Iterator[str]:
    """Absolute dotted names of all modules, and of what is taken from them, that a file in ``folder`` imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = [node.module] if node.module else []
            if node.level:
                above = (folder / "x").parents[node.level - 1]
                base = list(above.relative_to(ROOT).parts) + base
            yield from (".".join(base + [alias.name]) for alias in node.names)


@lru_cache(maxsize=None)
def outside_imports(module: str) -> FrozenSet[str]:
    """Top-level packages from outside that importing this module of the package brings in, directly or not."""
    path = ROOT.joinpath(*module.split("."))
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if not source.is_file():  # a name inside a module, whose module is looked at besides
        return frozenset()
    return roots_behind(at_import(parse(source)), source.parent)


@lru_cache(maxsize=None)
def behind_support(module: str) -> FrozenSet[str]:
    """As ``outside_imports``, for a module beside this one; empty for any other."""
    source = Path(__file__).with_name(module + ".py")
    return roots_behind(at_import(parse(source)), source.parent) if source.is_file() else frozenset()


def roots_behind(tree: ast.AST, folder: Path) -> FrozenSet[str]:
    found = set()
    for name in imported_names(tree, folder):
        parts = name.split(".")
        if parts[0] != PACKAGE:
            found.add(parts[0])
            found |= behind_support(parts[0])
            continue
        for length in range(2, len(parts) + 1):
            found |= outside_imports(".".join(parts[:length]))
    return frozenset(found)
