"""Single keys from a terminal, and the terminal as it was afterwards."""
import os
import select
import sys
import termios
import tty
from typing import Any, List, Optional


class Keyboard:
    """Keys pressed on a terminal, without Enter and without echo, while entered as a context.

    Does nothing where the input is no terminal, or belongs to another job.

    Args:
        descriptor: The terminal; None for standard input.
    """

    def __init__(self, descriptor: Optional[int] = None) -> None:
        self._descriptor = descriptor
        self._before: Optional[List[Any]] = None

    def __enter__(self) -> "Keyboard":
        try:
            descriptor = sys.stdin.fileno() if self._descriptor is None else self._descriptor
            is_ours = os.isatty(descriptor) and os.tcgetpgrp(descriptor) == os.getpgrp()
        except (OSError, ValueError, AttributeError):
            is_ours = False
        if is_ours:
            self._descriptor = descriptor
            self._before = termios.tcgetattr(descriptor)
            tty.setcbreak(descriptor, termios.TCSANOW)
        return self

    def __exit__(self, *error: object) -> None:
        if self._before is not None and self._descriptor is not None:
            termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
            self._before = None

    @property
    def is_active(self) -> bool:
        """True where keys can be read."""
        return self._before is not None

    def wait(self, timeout_s: float) -> str:
        """Wait at most ``timeout_s`` for keys; return those that were pressed."""
        if self._before is None or self._descriptor is None:
            select.select([], [], [], timeout_s)
            return ""
        if not select.select([self._descriptor], [], [], timeout_s)[0]:
            return ""
        keys = os.read(self._descriptor, 64)
        if not keys:  # hung up: nobody presses keys any more
            self._before = None
        return keys.decode("ascii", "ignore")
