"""A command that writes the type stubs of the ROS messages in tools/stubs/, from their generated classes:

    . build/devel/setup.bash && build/venv/bin/python3 test/support/pages/message_stubs.py

The stubs of all messages of jaka_msgs are made, those of other packages that the driver and the tools import, and those
of what these contain.
"""
import ast
import importlib
import re
from pathlib import Path
from typing import Any, Dict, Iterator, List, Set, Tuple

import import_graph

STUBS = import_graph.ROOT / "tools" / "stubs"
_TYPES = {"bool": "bool", "string": "str", "time": "genpy.Time", "duration": "genpy.Duration",
          "float32": "float", "float64": "float", "byte": "int", "char": "int",
          **{"%sint%d" % (sign, bits): "int" for sign in ("", "u") for bits in (8, 16, 32, 64)}}
_SERVICE = '''
class {name}:
    _type: ClassVar[str]
    _md5sum: ClassVar[str]
    _request_class: ClassVar[type[{name}Request]]
    _response_class: ClassVar[type[{name}Response]]
'''


def imported_types() -> Iterator[Tuple[str, str]]:
    """Return module and name of each message or service that is imported from ``*.msg`` or ``*.srv``."""
    for path in import_graph.modules().values():
        for node in ast.walk(import_graph.parse(path)):
            module = node.module or "" if isinstance(node, ast.ImportFrom) and not node.level else ""
            if re.fullmatch(r"\w+\.(msg|srv)", module):
                yield from ((module, name.name) for name in node.names)


def of_module(module: str) -> Iterator[Tuple[str, str]]:
    """Return module and name of every generated class in a module of messages or services."""
    for name, kind in vars(importlib.import_module(module)).items():
        if isinstance(kind, type) and hasattr(kind, "_md5sum") and not re.search("(Request|Response)$", name):
            yield module, name


def stubs() -> Dict[Path, str]:
    """Return the text of each stub by its path."""
    waiting = [*imported_types(), *of_module("jaka_msgs.msg"), *of_module("jaka_msgs.srv")]
    texts: Dict[str, Dict[str, str]] = {}
    imports: Dict[str, Set[str]] = {}
    while waiting:
        module, name = waiting.pop()
        kind = getattr(importlib.import_module(module), name)
        if name in texts.setdefault(module, {}):
            continue
        needed = imports.setdefault(module, set())
        if hasattr(kind, "_request_class"):
            texts[module][name] = _SERVICE.format(name=name)
            waiting += [(module, part.__name__) for part in (kind._request_class, kind._response_class)]
        else:
            texts[module][name], used = _message(module, kind)
            needed.update(used)
            waiting += used
    files = {}
    for module, classes in texts.items():
        package = STUBS / module.split(".")[0]
        others = sorted({"genpy", *(used for used, _ in imports[module])} - {module})
        text = "# Made by test/support/pages/message_stubs.py.\n%TYPING%" + "".join(
            ["import %s\n" % other for other in others] + [classes[name] for name in sorted(classes)])
        names = [name for name in ("ClassVar", "Sequence") if name + "[" in text]
        text = text.replace("%TYPING%", "from typing import %s\n\n" % ", ".join(names) if names else "")
        files[package / module.split(".")[1] / "__init__.pyi"] = text
        files[package / "__init__.pyi"] = ""
    return files


def _message(module: str, kind: Any) -> Tuple[str, List[Tuple[str, str]]]:
    """Return the stub of a message class, and the messages that it contains."""
    fields, used = [], []
    for field, ros_type in zip(kind.__slots__, kind._slot_types):
        plain, is_array = re.sub(r"\[.*", "", ros_type), "[" in ros_type
        if plain in _TYPES:
            name = _TYPES[plain]
        else:
            package, short = plain.split("/")
            used.append((package + ".msg", short))
            name = short if package + ".msg" == module else "%s.msg.%s" % (package, short)
        if is_array:
            name = "bytes" if plain in ("uint8", "char") else "Sequence[%s]" % name
        fields.append((field, name))
    lines = ["", "", "class %s(genpy.Message):" % kind.__name__]
    lines += ["    %s: ClassVar[%s]" % (name, type(value).__name__) for name, value in sorted(vars(kind).items())
              if name.isupper() and isinstance(value, (bool, int, float, str))]
    lines += ["    %s: %s = ..." % field for field in fields]
    if len(lines) == 3:
        lines[-1] += " ..."
    return "\n".join(lines[1:]) + "\n", used


def main() -> None:
    """Write them all."""
    for path, text in stubs().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


if __name__ == "__main__":
    main()
