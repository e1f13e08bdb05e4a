"""Logging in a thread of its own, so that no caller waits for the reader of its log.

A reader may stand still: a terminal is paused, a pipe is full, a ROS master does not answer. Code that stops an arm,
forwards its bytes or records them must go on all the same. The queue between caller and writer is bounded; what does
not fit into it is dropped.
"""
import contextlib
import copy
import logging
import logging.handlers
import os
import queue
import sys
from typing import Optional

QUEUE_LIMIT = 1000
"""Most records that wait for the handler; beyond it they are dropped, as no thread of the driver may wait for a log."""


class Background(logging.handlers.QueueHandler):
    """A log handler that passes records to another handler, which runs in a thread of its own."""

    def __init__(self, handler: logging.Handler) -> None:
        """Start the writing thread.

        Args:
            handler: Receives every record of its level or above.
        """
        self._records: queue.Queue[logging.LogRecord] = queue.Queue(QUEUE_LIMIT)
        super().__init__(self._records)
        self.setLevel(handler.level)
        self._listener = _Listener(self._records, handler)
        self._listener.start()

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        """Return a copy of the record with its final text."""
        return final(record)

    def enqueue(self, record: logging.LogRecord) -> None:
        """Put the record in the queue, or drop it where the queue is full."""
        with contextlib.suppress(queue.Full):
            self._records.put_nowait(record)

    def handleError(self, record: logging.LogRecord) -> None:
        """Stay silent: the inherited method writes to standard error, which may be full."""

    def drain(self, timeout: Optional[float] = None) -> bool:
        """Wait at most ``timeout`` s until the other handler has received every record; return False where some are
        left.
        """
        with self._records.all_tasks_done:
            return self._records.all_tasks_done.wait_for(lambda: not self._records.unfinished_tasks, timeout)

    def end(self, timeout: Optional[float] = None) -> bool:
        """Drain the queue and end the thread; return False where a record was not written. Call it when nothing logs
        any more.

        A thread that is stuck in its handler is left to the end of the process, which does not wait for it.
        """
        is_drained = self.drain(timeout)
        if is_drained:
            self._listener.stop()
        return is_drained and not self._listener.has_lost


class _Listener(logging.handlers.QueueListener):
    """The thread of a ``Background``; unlike the inherited one, it survives an error of its handler.

    Attributes:
        has_lost: True once a record could not be written.
    """

    has_lost = False

    def handle(self, record: logging.LogRecord) -> None:
        """Pass the record on; retry a text that the handler cannot write once in ASCII."""
        handler, = self.handlers
        try:
            handler.handle(record)
        except Exception:  # a terminal that knows only ASCII, one that is gone, a defect of the handler
            record.msg = ascii(record.msg)[1:-1]
            record.exc_info = record.exc_text = record.stack_info = None
            try:
                handler.handle(record)
            except Exception:
                self.has_lost = True


def final(record: logging.LogRecord) -> logging.LogRecord:
    """Return a copy of the record with its final text, because its arguments may change before it is written.

    Half a surrogate pair is replaced: it would spoil the buffer of rosout's publisher for all texts after it.
    """
    record = copy.copy(record)
    try:
        text = record.getMessage()
    except Exception as error:  # the message does not fit its arguments; that must not become the caller's error
        text = "%s (%r with %.200r)" % (error, record.msg, record.args)
    record.msg, record.args = _as_utf8(text), None
    if record.exc_info:
        record.exc_text = _as_utf8(logging.Formatter().formatException(record.exc_info))
    return record


class StandardErrorLog:
    """A command's lines on standard error, written in a thread of their own."""

    def __init__(self, name: str) -> None:
        """Put ``name`` in front of every line."""
        self._background = Background(_StandardError())
        self._logger = logging.Logger(name)
        self._logger.addHandler(self._background)

    def write(self, text: str) -> None:
        """Queue a line for writing; return at once."""
        self._logger.warning("%s: %s", self._logger.name, text)

    def close(self, timeout: Optional[float] = None) -> bool:
        """Wait at most ``timeout`` s until all lines are written; return False where some are not."""
        return self._background.end(timeout)


class _StandardError(logging.Handler):
    """A handler that writes past the locks of ``logging`` and ``sys.stderr``.

    The interpreter takes both when it ends: a thread that holds them in a full pipe would keep it from ending.
    """

    def handle(self, record: logging.LogRecord) -> bool:
        """Write the record without taking the handler's lock, which one thread alone does not need."""
        self.emit(record)
        return True

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line; a reader that is gone is no error."""
        line = self.format(record) + "\n"
        try:
            descriptor = sys.stderr.fileno()
        except (OSError, AttributeError):  # replaced by an object that is no file, or None
            print(line, end="", file=sys.stderr)
            return
        with contextlib.suppress(OSError):
            os.write(descriptor, line.encode("utf-8", "replace"))


def _as_utf8(text: str) -> str:
    return text.encode("utf-8", "replace").decode("utf-8")
