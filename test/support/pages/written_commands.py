"""The command lines that the pages, the heads of files and the hints of tests ask a reader to type."""
import ast
import re
import shlex
from pathlib import Path
from typing import Iterator, List, NamedTuple

from import_graph import ROOT

PAGES = (*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md")
FOLDERS = tuple(ROOT / name for name in ("docs", "jaka_ros_driver", "test", "tools"))
_PROGRAM = (r"(?:rosrun|roslaunch|rosservice|rostopic|rostest|rosmsg|rossrv|rosparam|rosnode|rospack|catkin_lint|"
            r"tools/dev|\.ci/run|build/venv/bin/python3|python3?|pip3?|pre-commit|openssl|"
            r"jaka_(?:bag|driver|foxglove|panel|rostest|sim))")
_COMMAND = re.compile(r"(?:[A-Z_]+=\S* )*%s(?= |$)" % _PROGRAM)
_HINT = re.compile(r"(?:[A-Z_]+=\S* )*(?:build/venv/bin/)?\bpython3? (?:-m jaka[\w.]+|[\w./]+\.py|%s)(?: > \S+)?")
_HEAD = re.compile(r'(?:\s|#[^\n]*\n)*([rR]?""".*?""")', re.DOTALL)
"""The docstring of a file. To parse each file for it takes each process of a parallel run a second."""
PLANTED = ("test_command_starts.py", "test_written_commands.py")
"""Tests with commands that are wrong on purpose."""
STUBS = re.compile(r"jaka_\w+ -{3,}|jaka_\w+: ")
"""Pictures, and lines that a command prints."""


class Written(NamedTuple):
    """One command line.

    Attributes:
        where: File, and the number of its line or a name for its place.
        text: The command on one line and without remarks.
        is_whole: It is to be typed as it stands; else prose names a command with some of its words.
    """

    where: str
    text: str
    is_whole: bool


def _place(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def lines_of(text: str) -> List[str]:
    """Return the lines of a shell block; those that end in a backslash go on."""
    return [line for line in re.sub(r"\s*\\\n\s*", " ", text).splitlines() if line.strip()]


def of_page(name: str, text: str) -> Iterator[Written]:
    """Return the commands of a page: blocks of commands, and running text in marks that begins with an executable."""
    for block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        for line in lines_of(block[1]) if block[0] in ("", "sh", "bash", "console") else []:
            if block[0] or (_COMMAND.match(line) and not STUBS.match(line)):
                yield Written(name, line.strip(), True)
    for code in re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)):
        code = " ".join(code.split())
        if _COMMAND.match(code) and not STUBS.match(code) and (" " in code or code == ".ci/run"):
            yield Written(name, code, re.match(r"(?:[A-Z_]+=\S* )*[\w./]*python3? ", code) is not None)


def of_head(name: str, text: str) -> Iterator[Written]:
    """Return the commands of a file's docstring: indented lines, where a remark follows after two spaces, and marked
    code."""
    for line in text.splitlines():
        found = re.match(r" {4}(\S+(?: \S+)*)", line)
        if found and _COMMAND.match(found.group(1)) and " " in found.group(1):
            yield Written(name, found.group(1), True)
    for code in re.findall(r"``([^`]+)``", text):
        code = " ".join(code.split())
        if _COMMAND.match(code) and " " in code:
            yield Written(name, code, False)


def of_hints(name: str, tree: ast.AST) -> Iterator[Written]:
    """Return the commands that texts in the code of a test ask to run."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
            for found in _HINT.findall(node.value):
                yield Written(name + ", hint", found, True)


def everything() -> List[Written]:
    """Return all commands, each once for each file."""
    found: List[Written] = []
    for page in PAGES:
        found += of_page(_place(page), page.read_text(encoding="utf-8"))
    for folder in FOLDERS:
        for path in sorted(folder.rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            head = _HEAD.match(text)
            found += of_head(_place(path), ast.literal_eval(head.group(1)) if head else "")
            if path.name.startswith("test_") and path.name not in PLANTED and _HINT.search(text):
                found += of_hints(_place(path), ast.parse(text))
    return list(dict.fromkeys(found))


def concrete(text: str) -> List[str]:
    """Return a usage as commands: without what stands in brackets, and with it; words in capitals become values."""
    if not re.search(r" \[(?:[A-Z]|--)", text):
        return [_filled(text)]
    least = text
    while re.search(r"\[[^\[\]]*\]", least):
        least = re.sub(r" ?\[[^\[\]]*\]", "", least)
    return [_filled(least), _filled(re.sub(r"[\[\]]|\.\.\.", "", text))]


VALUES = {"ACTION": "hit", "COMMAND": "info", "FOLDER": "/tmp/none", "N": "1", "NAME": "joint_moves",
          "TARGET": "frames", "WAY": "pointerup"}
NUMBERS = (
    "CUTS", "DIALECTS", "EDGES", "MINUTES", "PRIORITY", "RECONNECTS", "REPEATS", "ROUNDS", "SECONDS", "SEED",
    "TRIGGERS")


def _filled(text: str) -> str:
    words = [VALUES.get(word, "1" if word in NUMBERS else word) for word in text.split(" ")]
    return " ".join(word for word in words if word)


def parts(text: str) -> List[List[str]]:
    """Return the commands of a line of the shell as words, without redirections; assignments stay in front."""
    lexer = shlex.shlex(text, posix=True, punctuation_chars="|&;<>")
    lexer.whitespace_split = True
    commands: List[List[str]] = [[]]
    is_target = False
    for word in lexer:
        if set(word) <= set("|&;"):
            commands.append([])
        elif set(word) <= set("<>"):
            is_target = True
        elif is_target:
            is_target = False
        else:
            commands[-1].append(word)
    return [words for words in commands if words]
