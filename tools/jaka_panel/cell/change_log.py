"""The log of who has changed a cell's data: the form and the writer of the driver's audit log.

The folder is locked for one process: who cannot write this log changes nothing.
"""
import time
from typing import Any, Mapping

from jaka_ros_driver.audit.log import AuditLog

_DAYS = 1826.0
"""Days for which changes are kept: five years."""
_BEGIN_S = 2.0
"""Longest wait, s, for the first line on the disk, before a page is told that the log does not write."""
_END_S = 2.0
"""Longest wait, s, at the end for lines that are not on the disk."""
_LOOK_S = 0.02
"""Period, s, of the looks whether the log has begun."""
START, CHANGE, END = "start", "cell", "end"


class ChangeLog:
    """The log beside a cell's file. ``write`` may be called from any thread."""

    def __init__(self, folder: str) -> None:
        """Set up the log; nothing is made before ``start``.

        Args:
            folder: Of this log alone.
        """
        self._log = AuditLog(folder, _DAYS)
        self._is_started = False

    def start(self, fields: Mapping[str, Any]) -> None:
        """Begin the log with a line of what is there; called again, do nothing."""
        if self._is_started:
            return
        self._is_started = True
        self._log.start()
        self._log.write(START, fields, is_urgent=True)

    def trouble(self, wait: float = _BEGIN_S) -> str:
        """Return why lines cannot be written now; empty where they can.

        Args:
            wait: Longest wait for the begin of the log, s.
        """
        until = time.monotonic() + wait
        while True:
            health = self._log.health()
            if health.trouble:
                return health.trouble
            if health.written:
                return ""
            if time.monotonic() >= until:
                return "it has not begun yet"
            time.sleep(_LOOK_S)

    def write(self, fields: Mapping[str, Any]) -> None:
        """Note a change; it is on the disk at once, as far as the disk honours fsync."""
        self._log.write(CHANGE, fields, is_urgent=True)

    def close(self) -> None:
        """End the log in good order."""
        if self._is_started:
            self._log.write(END, {}, is_urgent=True)
            self._log.close(_END_S)
