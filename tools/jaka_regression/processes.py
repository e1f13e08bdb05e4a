"""Programs that are started, listened to and ended; what they print is kept in a file."""
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Callable, Dict, List, Optional, Sequence, Type

from jaka_bag.errors import BagError

_END_S = 15.0
_SHOWN = 1500


class ProgramFailed(BagError):
    """A program ended by itself, or did not do in time what it was started for; the text has its last words."""


class Program:
    """A Python module run as a program of its own.

    Args:
        name: For messages, and of the file that keeps what it prints.
        arguments: Of the interpreter, as ``-m`` and the module's name.
        folder: Where that file is written.
        environment: Added to this process's own; None takes a variable out.
        on_line: Takes each line that it prints on stdout, in a thread.
        is_service: It runs until it is told to end.

    Attributes:
        process: The running process.
        output: The file with stdout and stderr.
    """

    def __init__(self, name: str, arguments: Sequence[str], folder: Path,
                 environment: Optional[Dict[str, Optional[str]]] = None,
                 on_line: Optional[Callable[[str], None]] = None, is_service: bool = True) -> None:
        self.name = name
        self.is_service = is_service
        self.output = folder / (name + ".log")
        self._on_line = on_line
        self._lines: queue.Queue[str] = queue.Queue()
        self._file = open(str(self.output), "wb")
        # children find the same modules as this interpreter does, however it was told
        paths = os.pathsep.join(path for path in sys.path if path)
        changed = {**os.environ, **(environment or {}), "PYTHONPATH": paths, "PYTHONUNBUFFERED": "1"}
        self.process = subprocess.Popen(
            [sys.executable, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._file,
            env={name: value for name, value in changed.items() if value is not None},
            start_new_session=True)
        self._reader = threading.Thread(target=self._read, name=name + " output", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for raw in self.process.stdout:
            os.write(self._file.fileno(), raw)
            line = raw.decode("utf-8", "replace").rstrip("\n")
            self._lines.put(line)
            if self._on_line is not None:
                self._on_line(line)

    def first_line(self, timeout_s: float) -> str:
        """The next line that it prints.

        Raises:
            ProgramFailed: It ended, or printed none in time.
        """
        end = time.monotonic() + timeout_s
        while True:
            try:
                return self._lines.get(timeout=0.05)
            except queue.Empty:
                if self.process.poll() is not None and self._lines.empty():
                    raise ProgramFailed("%s ended: %s" % (self.name, self.last_words())) from None
                if time.monotonic() > end:
                    raise ProgramFailed("%s says nothing: %s" % (self.name, self.last_words())) from None

    def first_object(self, timeout_s: float) -> Dict[str, Any]:
        """The next line that it prints, a JSON object.

        Raises:
            ProgramFailed: It ended, printed none in time, or something else.
        """
        line = self.first_line(timeout_s)
        try:
            value = json.loads(line)
        except ValueError:
            value = None
        if not isinstance(value, dict):
            raise ProgramFailed("%s printed %r" % (self.name, line))
        return value

    def say(self, line: str) -> None:
        """Write a line to its stdin.

        Raises:
            ProgramFailed: It does not listen any more.
        """
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(line.encode("utf-8") + b"\n")
            self.process.stdin.flush()
        except OSError as error:
            raise ProgramFailed("%s ended: %s" % (self.name, self.last_words())) from error

    def wait_for_words(self, words: str, timeout_s: float) -> None:
        """Wait until it has printed some words, on stdout or stderr.

        Raises:
            ProgramFailed: It ended, or did not print them in time.
        """
        end = time.monotonic() + timeout_s
        while words not in self.printed():
            if self.process.poll() is not None:
                raise ProgramFailed("%s ended: %s" % (self.name, self.last_words()))
            if time.monotonic() > end:
                raise ProgramFailed("%s did not print %r: %s" % (self.name, words, self.last_words()))
            time.sleep(0.02)

    def wait(self, timeout_s: float) -> int:
        """Wait for its end; its exit code.

        Raises:
            ProgramFailed: It did not end in time.
        """
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise ProgramFailed("%s did not end: %s" % (self.name, self.last_words())) from None

    def printed(self) -> str:
        """All that it has printed."""
        try:
            return self.output.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""

    def last_words(self) -> str:
        """The end of what it has printed."""
        return self.printed()[-_SHOWN:].strip() or "it printed nothing"

    def end(self, number: signal.Signals = signal.SIGINT) -> Optional[int]:
        """End it, with force where it does not obey; its exit code."""
        if self.process.poll() is None:
            for attempt in (number, signal.SIGTERM, signal.SIGKILL):
                try:
                    os.killpg(self.process.pid, attempt)
                except ProcessLookupError:
                    break
                try:
                    self.process.wait(_END_S)
                    break
                except subprocess.TimeoutExpired:
                    continue
        self._reader.join(_END_S)
        for pipe in (self.process.stdin, self.process.stdout, self._file):
            if pipe is not None and not pipe.closed:
                try:
                    pipe.close()
                except OSError:  # an unread line for a program that has gone
                    pass
        return self.process.returncode


class Programs:
    """Several programs, ended in the reverse order of their start."""

    def __init__(self) -> None:
        self._running: List[Program] = []

    def add(self, program: Program) -> Program:
        """Take charge of a program."""
        self._running.append(program)
        return program

    def check(self) -> None:
        """See that all that must run still do.

        Raises:
            ProgramFailed: One has ended.
        """
        for program in self._running:
            if program.is_service and program.process.poll() is not None:
                raise ProgramFailed("%s ended: %s" % (program.name, program.last_words()))

    def __enter__(self) -> "Programs":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], value: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        interrupted: Optional[KeyboardInterrupt] = None
        for program in reversed(self._running):
            try:
                program.end(signal.SIGINT if interrupted is None else signal.SIGKILL)
            except KeyboardInterrupt as error:  # impatience ends the rest at once; nothing stays behind
                interrupted = error
                program.end(signal.SIGKILL)
        if interrupted is not None:
            raise interrupted
