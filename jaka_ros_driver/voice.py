"""Lines on standard error from threads that must not wait for whoever reads them."""
import contextlib
import os
import queue
import sys
import threading
from typing import Optional


class Voice:
    """Says lines in a thread of its own.

    Nobody may read them: a terminal is paused, a pipe is full. What stops an arm, forwards its bytes or records them
    goes on all the same.
    """

    def __init__(self, speaker: str) -> None:
        """``speaker`` stands in front of every line."""
        self._speaker = speaker
        self._lines: queue.SimpleQueue[Optional[str]] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._speak, name="voice", daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        """Returns at once."""
        self._lines.put("%s: %s\n" % (self._speaker, text))

    def close(self, timeout: Optional[float] = None) -> None:
        """Wait until all is said, so many seconds at most."""
        self._lines.put(None)
        self._thread.join(timeout)

    def _speak(self) -> None:
        for line in iter(self._lines.get, None):
            with contextlib.suppress(OSError):
                _write(line)


def _write(line: str) -> None:
    """Past the locks of ``sys.stderr``: a thread that is held up in them would keep the interpreter from ending."""
    try:
        descriptor = sys.stderr.fileno()
    except (OSError, AttributeError):  # no file: replaced, or none
        print(line, end="", file=sys.stderr)
        return
    os.write(descriptor, line.encode("utf-8", "replace"))
