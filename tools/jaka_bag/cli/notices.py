"""What recorder and player say: lines on standard error that nobody waits for, and an account as JSON.

A full pipe or a paused terminal holds no recording up.
"""
import contextlib
import json
import logging
import os
import queue
import sys
from logging.handlers import QueueHandler, QueueListener
from pathlib import Path
from typing import Any, Dict

from ..errors import BagError


class _StandardError(logging.Handler):
    """Writes past the locks of ``logging`` and ``sys.stderr``.

    The interpreter takes both when it ends: a thread held up in them would keep it from ending.
    """

    def createLock(self) -> None:
        """None."""
        self.lock = None

    def emit(self, record: logging.LogRecord) -> None:
        line = self.format(record) + "\n"
        with contextlib.suppress(OSError):
            try:
                descriptor = sys.stderr.fileno()
            except (OSError, AttributeError):  # no file: replaced, or none
                print(line, end="", file=sys.stderr)
                return
            os.write(descriptor, line.encode("utf-8", "replace"))


class Notices:
    """Says lines in a thread of its own.

    Args:
        program: Stands in front of every line.
    """

    def __init__(self, program: str) -> None:
        lines: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
        handler = _StandardError()
        handler.setFormatter(logging.Formatter(program + ": %(message)s"))
        self._listener = QueueListener(lines, handler)
        self._logger = logging.Logger(program)
        self._logger.addHandler(QueueHandler(lines))
        self._listener.start()

    def say(self, text: str) -> None:
        """Say one line; returns at once."""
        self._logger.info("%s", text)

    def close(self) -> None:
        """Wait until all is said."""
        self._listener.stop()


def write_account(path: str, account: Dict[str, Any]) -> None:
    """Write an account as JSON.

    Raises:
        BagError: It cannot be written.
    """
    try:
        Path(path).write_text(json.dumps(account, indent=1, sort_keys=True) + "\n")
    except OSError as error:
        raise BagError("cannot write the report %s: %s" % (path, error.strerror)) from error
