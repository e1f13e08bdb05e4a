"""The code blocks of a documentation page, and a shell that runs them as a reader would."""
import os
import re
import signal
import subprocess
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Tuple

from waiting import wait_until

PATIENCE_S = 280.0


class Block(NamedTuple):
    """One code block: the HTML comment above it ("" for none), its language, its text."""

    note: str
    language: str
    text: str


def blocks(page: Path, section: str = "") -> List[Block]:
    """Return all blocks of a page, or those below one of its headings."""
    text = page.read_text(encoding="utf-8")
    if section:
        text = text.split("\n## %s\n" % section)[1].partition("\n## ")[0]
    return [Block(*found) for found in re.findall(r"(?:<!-- (.*?) -->\n)?```(\w+)\n(.*?)```", text, re.DOTALL)]


class Shell:
    """A bash session, always in the same folder and with the same environment.

    Args:
        folder: Where the commands run.
        environment: Their environment.
        prelude: Runs before each of them, and must succeed.
    """

    def __init__(self, folder: Path, environment: Dict[str, str], prelude: str = "true") -> None:
        self.folder = folder
        self.environment = {name: value for name, value in environment.items() if name != "PYTEST_ADDOPTS"}
        self.prelude = prelude
        self._running: Dict[str, subprocess.Popen[str]] = {}

    def _start(self, text: str, **options) -> "subprocess.Popen[str]":
        return subprocess.Popen(["bash", "-c", "%s && %s" % (self.prelude, text)], cwd=str(self.folder), text=True,
                                env=self.environment, start_new_session=True, stdin=subprocess.DEVNULL, **options)

    def run(self, text: str) -> Tuple[int, str]:
        """Run a command; return its exit code and output."""
        process = self._start(text, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        said = process.communicate(timeout=PATIENCE_S)[0]
        return process.returncode, said

    def start(self, name: str, line: str) -> None:
        """Start a command in the background."""
        with open(str(self.folder / (name + ".txt")), "w") as output:
            self._running[name] = self._start("exec " + line, stdout=output, stderr=subprocess.STDOUT)

    def said_by(self, name: str) -> str:
        return (self.folder / (name + ".txt")).read_text(errors="replace")

    def end(self, name: str) -> None:
        """Interrupt a background command, like Ctrl-C."""
        process = self._running.pop(name)
        os.killpg(process.pid, signal.SIGINT)
        process.wait(PATIENCE_S)

    def close(self) -> None:
        for name in list(self._running):
            self.end(name)


def until(condition: Callable[[], bool], what: Callable[[], str]) -> None:
    """Wait until the condition holds; fail with the text of ``what`` where it does not."""
    wait_until(condition, what, PATIENCE_S)
