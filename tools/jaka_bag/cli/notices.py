"""The output of recorder and player: lines on standard error that nobody waits for, and an account as JSON.

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
    """A logging handler that writes past the locks of ``logging`` and ``sys.stderr``.

    The interpreter takes both when it ends: a thread held up in them would keep it from ending.
    """

    def handle(self, record: logging.LogRecord) -> bool:
        """Write the record without taking the handler's lock, which one thread alone does not need."""
        self.emit(record)
        return True

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
    """The printer of notices, in a thread of its own; at the end of its block it waits until all are printed.

    Args:
        command: Stands in front of every line.
        quiet: Print only the lines that are always printed.
    """

    def __init__(self, command: str, quiet: bool) -> None:
        lines: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
        handler = _StandardError()
        handler.setFormatter(logging.Formatter(command + ": %(message)s"))
        self._quiet = quiet
        self._listener = QueueListener(lines, handler)
        self._logger = logging.Logger(command)
        self._logger.addHandler(QueueHandler(lines))
        self._listener.start()

    def __enter__(self) -> "Notices":
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.stop()

    def say(self, line: str) -> None:
        """Print one line unless ``quiet``; return at once."""
        if not self._quiet:
            self.always(line)

    def always(self, line: str) -> None:
        """Print one line even if ``quiet``; return at once."""
        self._logger.info("%s", line)


def write_account(path: str, account: Dict[str, Any]) -> None:
    """Write an account as JSON.

    Raises:
        BagError: It cannot be written.
    """
    try:
        Path(path).write_text(json.dumps(account, indent=1, sort_keys=True) + "\n")
    except OSError as error:
        raise BagError("cannot write the report %s: %s" % (path, error.strerror)) from error
