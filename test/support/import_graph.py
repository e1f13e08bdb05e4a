"""The imports between modules, read from the syntax tree: nothing is imported to find out."""
import ast
import re
from functools import lru_cache
from pathlib import Path
from typing import Dict, FrozenSet, Iterator, Set

ROOT = Path(__file__).resolve().parent.parent.parent
LOG_TOOLS = ("jaka_bag", "jaka_blackbox", "jaka_fleet", "jaka_foxglove")
"""The packages of the distribution jaka-bag."""
PACKAGES = {"jaka_ros_driver": ROOT / "jaka_ros_driver",
            **{name: ROOT / "tools" / name for name in (*LOG_TOOLS, "jaka_migration", "jaka_panel", "jaka_regression")}}
"""The packages of this project, each with its folder."""
_MODULE_NAME = re.compile(r"((?:%s)(?:\.\w+)+)(?::\w+)?" % "|".join(PACKAGES))


@lru_cache(maxsize=None)
def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def dotted(path: Path) -> str:
    """Return the module's name of a file, or the package's of a folder or its ``__init__.py``."""
    for name, folder in PACKAGES.items():
        if folder == path or folder in path.parents:
            parts = [part[:-3] if part.endswith(".py") else part for part in path.relative_to(folder).parts]
            return ".".join([name, *(part for part in parts if part != "__init__")])
    raise ValueError("%s is in no package of this project" % path)


def at_import(tree: ast.Module) -> ast.Module:
    """Return the module without the bodies of its functions: their imports run when they are called."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    return ast.Module(body=[node for node in tree.body if not isinstance(node, functions)], type_ignores=[])


def imported_names(tree: ast.AST, folder: Path) -> Iterator[str]:
    """Return absolute dotted names of all modules, and of names taken from them, that a file in ``folder`` imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = [node.module] if node.module else []
            if node.level:
                base.insert(0, dotted((folder / "x").parents[node.level - 1]))
            yield from (".".join(base + [alias.name]) for alias in node.names)


def named_modules(tree: ast.AST) -> Set[str]:
    """Return the modules of this project that a file names in strings, to start them or to import them by name."""
    words = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return {found.group(1) for found in map(_MODULE_NAME.fullmatch, words) if found}


def source_of(module: str) -> Path:
    """Return the file of a module of this project, or the ``__init__.py`` of a package; it need not be there."""
    parts = module.split(".")
    path = PACKAGES[parts[0]].joinpath(*parts[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@lru_cache(maxsize=None)
def modules() -> Dict[str, Path]:
    """Return every module of this project by its name; packages by theirs."""
    return {dotted(path): path for folder in PACKAGES.values() for path in sorted(folder.rglob("*.py"))}


@lru_cache(maxsize=None)
def outside_imports(module: str) -> FrozenSet[str]:
    """Return the outside top-level packages that importing this module of the project brings in, directly or not."""
    source = source_of(module)
    if not source.is_file():  # a name inside a module, whose module is looked at besides
        return frozenset()
    return roots_behind(at_import(parse(source)), source.parent)


@lru_cache(maxsize=None)
def behind_support(module: str) -> FrozenSet[str]:
    """Return the same as ``outside_imports`` for a module beside this one; empty for any other."""
    for folder in (Path(__file__).parent, Path(__file__).with_name("live")):
        source = folder / (module + ".py")
        if source.is_file():
            return roots_behind(at_import(parse(source)), source.parent)
    return frozenset()


def roots_behind(tree: ast.AST, folder: Path) -> FrozenSet[str]:
    found = set()
    for name in imported_names(tree, folder):
        parts = name.split(".")
        if parts[0] not in PACKAGES:
            found.add(parts[0])
            found |= behind_support(parts[0])
            continue
        for length in range(2, len(parts) + 1):
            found |= outside_imports(".".join(parts[:length]))
    return frozenset(found)
