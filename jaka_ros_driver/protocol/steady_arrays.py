"""A parser of status frames that parses long arrays of numbers anew only when their text has changed.

Most of a frame are terminals, which seldom change.
"""
import contextlib
import re

from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import JsonObject, parse_object

_ARRAY = re.compile(rb'"\w+": \[[-+.\deE, ]*\], ')
_LEAST_BYTES = 256
"""Shortest run of arrays, bytes, that is kept: a short one is parsed in no more time than it takes to find it."""
_STAND_IN = rb'"\u0000": 0, '


class SteadyArrays:
    """The run of arrays that the last frames have in common. It is a cache, which changes the fields' order only."""

    def __init__(self) -> None:
        self._run = b""
        self._fields: JsonObject = {}
        self._before = b""

    def parse(self, text: bytes) -> JsonObject:
        """Parse one JSON object; raise FramingError as ``parse_object`` does."""
        begin, run, _ = text.partition(self._run) if self._run else (b"", b"", b"")
        if run and _STAND_IN[:8] not in text:
            with contextlib.suppress(FramingError):
                fields = parse_object(begin + _STAND_IN + text[len(begin) + len(run):])
                # Not where the run stands in another object, in a name, or beside a second field of the same name.
                if fields.pop("\0", None) == 0 and fields.keys().isdisjoint(self._fields):
                    fields.update(self._fields)
                    return fields
        fields = parse_object(text)
        self._choose_run(text)
        return fields

    def _choose_run(self, text: bytes) -> None:
        """Choose the longest run of arrays that the last frame which was parsed as a whole has, too."""
        run = longest = slice(0, 0)
        for match in _ARRAY.finditer(text):
            if match.group() in self._before:
                run = slice(run.start if match.start() == run.stop else match.start(), match.end())
                longest = max(longest, run, key=lambda one: one.stop - one.start)
        self._run = text[longest] if longest.stop - longest.start >= _LEAST_BYTES else b""
        self._fields = parse_object(b"{%s}" % self._run[:-2])
        self._before = text
