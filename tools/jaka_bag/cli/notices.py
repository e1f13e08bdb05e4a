"""Lines on standard error that nobody waits for: a full pipe or a paused terminal holds no recording up."""
import contextlib
import logging
import os
import queue
import sys
from logging.handlers import QueueHandler, QueueListener


class _StandardError(logging.Handler):
    """Writes past the locks of ``sys.stderr``: a thread held up in them would keep the interpreter from ending."""

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
