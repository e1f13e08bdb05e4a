"""The person at the terminal: questions whose answers were not typed ahead."""
import os
import select
import sys
import termios
from typing import Callable

_TURN_S = 0.05
"""Longest wait, s, before the caller's next look at the arm while a person thinks."""
_LONGEST = 4096
"""Most bytes of an answer: what is pasted by mistake counts as a wrong one."""


class Person:
    """Whoever sits at the terminal that is this process's standard input; nobody, where that is none."""

    def __init__(self, name: str) -> None:
        """Take the command's name, which stands before each question."""
        self._name = name
        self.is_there = sys.stdin is not None and sys.stdin.isatty()

    def ask(self, question: str, meanwhile: Callable[[], None] = lambda: None) -> str:
        """Ask, and return the answer without its end of line; "" where nobody is there.

        Args:
            question: One line.
            meanwhile: Called every 0.05 s while the answer is waited for; it must not block.
        """
        if not self.is_there:
            return ""
        descriptor = sys.stdin.fileno()
        termios.tcflush(descriptor, termios.TCIFLUSH)
        print("%s: %s" % (self._name, question), end="", flush=True)
        while not select.select([descriptor], [], [], _TURN_S)[0]:
            meanwhile()
        return os.read(descriptor, _LONGEST).decode("utf-8", "replace").strip()
