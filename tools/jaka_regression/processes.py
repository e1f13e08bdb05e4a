"""Processes that are started, listened to and ended; what they print is kept in a file.

What waits raises ``ProcessFailed`` where the process has ended, or did not do in time what was waited for.
"""
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence

from jaka_bag.errors import BagError
from jaka_bag.interrupts import put_off

_END_S = 15.0
"""Longest wait, s, for a process that was asked to end: a driver brings the arm to rest first."""
_SHOWN = 1500
"""Most characters of a process's last words in an error."""


class ProcessFailed(BagError):
    """A process ended by itself, or did not do in time what it was started for; the text has its last words."""


class ChildProcess:
    """A Python module run as a process of its own.

    Args:
        name: For messages, and of the file that keeps what it prints.
        arguments: Arguments of the interpreter, as ``-m`` and the module's name.
        folder: Where that file is written.
        environment: Added to this process's own; None takes a variable out.
        on_line: Takes each line that it prints on stdout, in a thread.
        is_service: True if it runs until it is told to end.

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
        """Wait for the next line that the process prints."""
        def line() -> Optional[str]:
            try:
                return self._lines.get(timeout=0.05)
            except queue.Empty:
                return None
        return self._wait_for(line, timeout_s, "says nothing")

    def _wait_for(self, attempt: Callable[[], Optional[str]], timeout_s: float, problem: str) -> str:
        """Call ``attempt`` repeatedly until it returns a value; return that, or raise ProcessFailed."""
        end = time.monotonic() + timeout_s
        while True:
            is_over = self.process.poll() is not None
            found = attempt()
            if found is not None:
                return found
            if is_over or time.monotonic() > end:
                raise self.failure("ended" if is_over else problem)

    def failure(self, problem: str) -> ProcessFailed:
        """Make an error with the problem and the end of the process's output."""
        return ProcessFailed("%s %s: %s" % (self.name, problem, self.last_words()))

    def first_object(self, timeout_s: float) -> Dict[str, Any]:
        """Wait for the next line that the process prints, a JSON object; return that."""
        line = self.first_line(timeout_s)
        try:
            value = json.loads(line)
        except ValueError:
            value = None
        if not isinstance(value, dict):
            raise ProcessFailed("%s printed %r" % (self.name, line))
        return value

    def say(self, line: str) -> None:
        """Write a line to its stdin."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(line.encode("utf-8") + b"\n")
            self.process.stdin.flush()
        except OSError as error:
            raise self.failure("ended") from error

    def wait_for_words(self, words: str, timeout_s: float) -> None:
        """Wait until it has printed some words, on stdout or stderr."""
        def printed() -> Optional[str]:
            if words in self.printed():
                return words
            time.sleep(0.02)
            return None
        self._wait_for(printed, timeout_s, "did not print %r" % words)

    def printed(self) -> str:
        """Return all that the process has printed."""
        try:
            return self.output.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""

    def last_words(self) -> str:
        """Return the end of what the process has printed."""
        return self.printed()[-_SHOWN:].strip() or "it printed nothing"

    def end(self, number: signal.Signals = signal.SIGINT) -> Optional[int]:
        """End the process, with force where it does not obey; return its exit code."""
        if self.process.poll() is None:
            for attempt in (number, signal.SIGTERM, signal.SIGKILL):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self.process.pid, attempt)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(_END_S)
                    break
        self._reader.join(_END_S)
        for pipe in (self.process.stdin, self.process.stdout, self._file):
            if pipe is not None and not pipe.closed:
                with contextlib.suppress(OSError):  # an unread line for a process that has gone
                    pipe.close()
        return self.process.returncode


class ChildProcesses:
    """Several processes, ended in the reverse order of their start."""

    def __init__(self) -> None:
        self._running: List[ChildProcess] = []

    def begin(self, name: str, arguments: Sequence[str], folder: Path,
              environment: Optional[Dict[str, Optional[str]]] = None, **further: Any) -> ChildProcess:
        """Start a process, as ``ChildProcess`` does, and take charge of it; an interrupt waits until that is done."""
        with put_off():
            process = ChildProcess(name, arguments, folder, environment, **further)
            self._running.append(process)
        return process

    def check(self) -> None:
        """See that all that must run still do."""
        for process in self._running:
            if process.is_service and process.process.poll() is not None:
                raise process.failure("ended")

    def __enter__(self) -> "ChildProcesses":
        return self

    def __exit__(self, *error: object) -> None:
        interrupted: Optional[KeyboardInterrupt] = None
        for process in reversed(self._running):
            try:
                process.end(signal.SIGINT if interrupted is None else signal.SIGKILL)
            except KeyboardInterrupt as error:  # impatience ends the rest at once; nothing stays behind
                interrupted = error
                process.end(signal.SIGKILL)
        if interrupted is not None:
            raise interrupted
