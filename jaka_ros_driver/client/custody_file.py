"""Custody on disk: a small file that exists while a driver moves the arm, for a guard or driver that starts later.

It is removed when custody ends. A file whose driver is dead shows that the arm may have been left moving. It is a note,
not a lock: where it cannot be written, the driver logs that once and goes on.
"""
import contextlib
import json
import logging
import os
import threading
import time
from typing import List, NamedTuple, Optional, Union

from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.process_state import start_of
from jaka_ros_driver.client.runtime_file import RuntimeFile
from jaka_ros_driver.commands import JogFrame, JogStop

_LOG = logging.getLogger(__name__)

_FLUSH_TIMEOUT_S = 0.5
"""Longest wait, s, at the end: a disk that hangs does not keep the driver from ending."""


class Found(NamedTuple):
    """The content of a custody file.

    Attributes:
        left: The motion.
        is_alive: True where the process that has it in custody runs.
    """

    left: LeftMotion
    is_alive: bool


class CustodyFile:
    """The custody file of one controller, whichever of its host names is used."""

    def __init__(self, host: str, command_port: int, folders: Optional[List[str]] = None) -> None:
        """Resolve the controller's name.

        Args:
            host: The controller's address.
            command_port: Its command port.
            folders: Folders for the file; None for the runtime folders.
        """
        self._file = RuntimeFile("custody", host, command_port, folders)

    def write(self, left: LeftMotion) -> None:
        """Replace the file; raise OSError where no folder takes it."""
        jog = left.jog_stop
        self._file.write(json.dumps({
            "controller": self._file.controller, "moves": left.name, "since": left.since, "process": left.process,
            "process_start": start_of(left.process),
            "jog": None if jog is None else {"frame": jog.frame.name, "axis": jog.axis}}))

    def remove(self) -> None:
        """Remove the file where there is one; raise OSError where that is not possible."""
        self._file.remove()

    def remove_of(self, process: int) -> None:
        """Remove the file if this process wrote it. Raise nothing: at worst the next driver sends a needless stop."""
        found = self.read()
        if found is not None and found.left.process == process:
            with contextlib.suppress(OSError):
                self.remove()

    def read(self) -> Optional[Found]:
        """Return the content of the newest copy; None where there is none that can be read."""
        copies = [found for found in self._file.read(_found) if found is not None]
        return max(copies, key=lambda found: found.left.since) if copies else None


class CustodyKeeper:
    """The thread that writes the custody file whenever custody changes: the arm's loop waits for no disk."""

    def __init__(self, file: CustodyFile) -> None:
        self._file = file
        self._news = threading.Condition()
        self._wanted: Optional[LeftMotion] = None
        self._is_due = False
        self._is_closing = False
        self._has_trouble = False
        self._thread = threading.Thread(target=self._run, name="custody file", daemon=True)

    def start(self) -> None:
        """Start the writing thread."""
        self._thread.start()

    def note(self, tell: NotifyGuard) -> None:
        """Record that custody has begun or ended; never wait for the disk."""
        with self._news:
            self._wanted = LeftMotion(tell.name, tell.jog_stop, time.time(), os.getpid()) if tell.is_moving else None
            self._is_due = True
            self._news.notify()

    def close(self) -> None:
        """Write the pending change, if the disk takes it within 0.5 s, and end."""
        with self._news:
            self._is_closing = True
            self._news.notify()
        if self._thread.is_alive():
            self._thread.join(_FLUSH_TIMEOUT_S)

    def _run(self) -> None:
        for wanted in iter(self._next, self):
            assert not isinstance(wanted, CustodyKeeper)
            try:
                if wanted is None:
                    self._file.remove()
                else:
                    self._file.write(wanted)
                self._has_trouble = False
            except OSError as error:
                if not self._has_trouble:
                    self._has_trouble = True
                    _LOG.warning("what this driver moves cannot be noted on disk, for a driver that would have to "
                                 "stop it after this one's death: %s", error)

    def _next(self) -> "Union[CustodyKeeper, Optional[LeftMotion]]":
        """Wait for the newest custody that was not written yet, and return it; return the keeper itself at the end."""
        with self._news:
            self._news.wait_for(lambda: self._is_due or self._is_closing)
            if not self._is_due:
                return self
            self._is_due = False
            return self._wanted


def _found(text: str) -> Found:
    fields = json.loads(text)
    jog, process = fields["jog"], int(fields["process"])
    start = fields["process_start"]
    stop = None if jog is None else JogStop(JogFrame[jog["frame"]], range(6)[jog["axis"]])
    left = LeftMotion(str(fields["moves"]), stop, float(fields["since"]), process)
    return Found(left, bool(start) and start_of(process) == start)
