"""Which messages of a log are wanted: topics, types, times.

``BagError`` is raised where a pattern is no regular expression.
"""
import re
from typing import Collection, List, NamedTuple, Optional, Pattern, Sequence

import numpy as np

from ..errors import BagError
from .batch import Array, MessageBatch
from .connection import Connection


class Selection(NamedTuple):
    """Which messages are wanted; the default is all.

    Attributes:
        topics: Exact names; a message of any of them is wanted.
        patterns: Regular expressions; a topic that one matches in full is wanted.
        exclude: A topic that one of these regular expressions matches in full is not.
        types: ``package/Type``.
        start_time: Earliest log time, ns; None from the first.
        end_time: Latest log time, ns; None to the last.
    """

    topics: Sequence[str] = ()
    patterns: Sequence[str] = ()
    exclude: Sequence[str] = ()
    types: Sequence[str] = ()
    start_time: Optional[int] = None
    end_time: Optional[int] = None

    def wanted(self, connections: Sequence[Connection]) -> Array:
        """Whether each connection is wanted, bool."""
        patterns, exclude = compile_patterns(self.patterns), compile_patterns(self.exclude)
        result = []
        for connection in connections:
            by_name = not (self.topics or patterns) or connection.topic in self.topics or any(
                p.fullmatch(connection.topic) for p in patterns)
            result.append(by_name and not any(p.fullmatch(connection.topic) for p in exclude)
                          and (not self.types or connection.datatype in self.types))
        return np.array(result, bool)


def compile_patterns(patterns: Sequence[str]) -> List[Pattern[str]]:
    """Regular expressions, to be matched against whole names."""
    try:
        return [re.compile(p) for p in patterns]
    except re.error as error:
        raise BagError("%r is not a regular expression: %s" % (error.pattern, error.msg)) from error


class TimePoint(NamedTuple):
    """A moment as users name it: ns since the epoch, or from a log's start (negative: from its end)."""

    ns: int
    is_absolute: bool

    def resolve(self, start_time: int, end_time: int) -> int:
        """The moment in a log that spans these times, ns."""
        if self.is_absolute:
            return self.ns
        return (end_time if self.ns < 0 else start_time) + self.ns


class TimeSpan(NamedTuple):
    """A part of a log's time as users name it; ``duration`` is ns and counts from ``start``."""

    start: Optional[TimePoint] = None
    end: Optional[TimePoint] = None
    duration: Optional[int] = None

    def apply(self, selection: Selection, start_time: Optional[int], end_time: Optional[int]) -> Selection:
        """The selection limited to the span, for a log that spans these times, ns (None: it has no message)."""
        if self == TimeSpan() or start_time is None or end_time is None:
            return selection
        first = None if self.start is None else self.start.resolve(start_time, end_time)
        last = None if self.end is None else self.end.resolve(start_time, end_time)
        if self.duration is not None:
            last = (start_time if first is None else first) + self.duration
        return selection._replace(start_time=first, end_time=last)


class MessageFilter:
    """A selection applied to one log.

    Attributes:
        wanted: Whether each of the log's connections is wanted, bool.
    """

    def __init__(self, selection: Selection, connections: Sequence[Connection]) -> None:
        self._selection = selection
        self.wanted = selection.wanted(connections)
        self._all = bool(self.wanted.all())

    def limit_to(self, number: int) -> None:
        """Want the messages of no other connection than this."""
        self.wanted &= np.arange(len(self.wanted)) == number
        self._all = bool(self.wanted.all())

    @property
    def takes_all(self) -> bool:
        """True where every message is wanted."""
        return self._all and self._selection.start_time is None and self._selection.end_time is None

    def may_be_in(self, start_time: int, end_time: int, numbers: Collection[int]) -> bool:
        """Whether a chunk may hold a wanted message.

        Args:
            start_time: Earliest log time in it, ns.
            end_time: Latest log time in it, ns.
            numbers: Its connections; empty where they are not known.
        """
        start, end = self._selection.start_time, self._selection.end_time
        return ((start is None or end_time >= start) and (end is None or start_time <= end)
                and (self._all or not numbers or any(self.wanted[n] for n in numbers)))

    def apply(self, batch: MessageBatch) -> MessageBatch:
        """The wanted messages of a batch."""
        if self.takes_all:
            return batch
        mask = self.wanted[batch.connection]
        if self._selection.start_time is not None:
            mask &= batch.log_time >= self._selection.start_time
        if self._selection.end_time is not None:
            mask &= batch.log_time <= self._selection.end_time
        return batch if mask.all() else batch.take(mask)
