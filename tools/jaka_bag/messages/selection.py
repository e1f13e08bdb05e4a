"""The selection of a log's messages: topics, types, times.

``BagError`` is raised where a pattern is no regular expression, ``UsageError`` where nothing of a log can be wanted.
"""
import re
from typing import Collection, List, NamedTuple, Optional, Pattern, Sequence, Tuple

import numpy as np

from ..errors import BagError, UsageError
from ..units import NS_PER_S
from .batch import Array, MessageBatch
from .connection import Connection


class Selection(NamedTuple):
    """A choice of messages; the default is all.

    Attributes:
        topics: Exact names; a message of any of them is wanted.
        patterns: Regular expressions; a topic that one matches in full is wanted.
        exclude: Regular expressions; a topic that one matches in full is not wanted.
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
        """Return whether each connection is wanted, bool."""
        patterns, exclude = compile_patterns(self.patterns), compile_patterns(self.exclude)
        result = []
        for connection in connections:
            by_name = not (self.topics or patterns) or connection.topic in self.topics or any(
                p.fullmatch(connection.topic) for p in patterns)
            result.append(by_name and not any(p.fullmatch(connection.topic) for p in exclude)
                          and (not self.types or connection.datatype in self.types))
        return np.array(result, bool)


def compile_patterns(patterns: Sequence[str]) -> List[Pattern[str]]:
    """Compile regular expressions, to be matched against whole names."""
    try:
        return [re.compile(p) for p in patterns]
    except re.error as error:
        raise BagError("%r is not a regular expression: %s" % (error.pattern, error.msg)) from error


def nearest(wanted: str, names: Collection[str]) -> str:
    """Return the hint after an unknown name: the one among ``names`` that was probably meant."""
    import difflib

    bare = wanted.strip("/")
    by_end = [name for name in names if bare and ("/" + name).endswith("/" + bare)]
    folded = {name.lower().strip("/"): name for name in names}
    near = by_end or [folded[name] for name in difflib.get_close_matches(bare.lower(), folded, 1, 0.6)]
    return ", did you mean %s?" % near[0] if near else ""


def unmatched(selection: Selection, connections: Sequence[Connection]) -> List[str]:
    """Return a line for each name that a selection asks for and the log lacks, with the nearest name."""
    topics = sorted({connection.topic for connection in connections})
    types = sorted({connection.datatype for connection in connections})
    lines = ["no topic %s%s" % (topic, nearest(topic, topics)) for topic in selection.topics if topic not in topics]
    for text, pattern in zip(selection.patterns, compile_patterns(selection.patterns)):
        if not any(pattern.fullmatch(topic) for topic in topics):
            lines.append("no topic whose whole name matches %r%s" % (text, nearest(text.strip("^$.*"), topics)))
    lines += ["no type %s%s" % (name, nearest(name, types)) for name in selection.types if name not in types]
    return lines


def require_match(selection: Selection, connections: Sequence[Connection], path: str) -> Tuple[str, ...]:
    """Return a line for each name that the log lacks, where it has other things that are wanted.

    Raises:
        UsageError: Nothing of the log is wanted: a name is wrong.
    """
    missing = unmatched(selection, connections)
    if not connections or selection.wanted(connections).any():
        return tuple("%s has %s" % (path, line) for line in missing)
    topics = sorted({connection.topic for connection in connections})
    rest = "none of its topics is selected; it has %s%s" % (", ".join(topics[:8]), ", ..." if len(topics) > 8 else "")
    raise UsageError("%s has %s" % (path, "; ".join(missing)) if missing else "%s: %s" % (path, rest))


def seconds_text(ns: int) -> str:
    """Format a time, ns, in s with nine decimals, as ``jaka_bag info`` prints it and options take it."""
    return "%s%d.%09d" % ("-" if ns < 0 else "", abs(ns) // NS_PER_S, abs(ns) % NS_PER_S)


class TimePoint(NamedTuple):
    """A moment as users name it: ns since the epoch, or from a log's start (negative: from its end)."""

    ns: int
    is_absolute: bool

    def resolve(self, start_time: int, end_time: int) -> int:
        """Return the moment, ns, in a log that spans these times."""
        if self.is_absolute:
            return self.ns
        return (end_time if self.ns < 0 else start_time) + self.ns


class TimeSpan(NamedTuple):
    """A part of a log's time as users name it; ``duration`` is ns and counts from ``start``."""

    start: Optional[TimePoint] = None
    end: Optional[TimePoint] = None
    duration: Optional[int] = None

    def apply(self, selection: Selection, start_time: Optional[int], end_time: Optional[int]) -> Selection:
        """Limit a selection to the span, for a log that spans these times, ns (None: it has no message).

        Raises:
            UsageError: The log has nothing in the span, or the span ends before it starts.
        """
        if self == TimeSpan() or start_time is None or end_time is None:
            return selection
        first = None if self.start is None else self.start.resolve(start_time, end_time)
        last = None if self.end is None else self.end.resolve(start_time, end_time)
        if self.duration is not None:
            last = (start_time if first is None else first) + self.duration
        wrong = ("the end of the wanted time is before its start"
                 if first is not None and last is not None and last < first
                 else "the wanted time starts behind the log's end" if first is not None and first > end_time
                 else "the wanted time ends before the log's start" if last is not None and last < start_time else "")
        if wrong:
            raise UsageError("%s: %s to %s is wanted, the log is from %s to %s (%.3f s)" % (
                wrong, "its start" if first is None else seconds_text(first),
                "its end" if last is None else seconds_text(last), seconds_text(start_time), seconds_text(end_time),
                (end_time - start_time) / NS_PER_S))
        return selection._replace(start_time=first, end_time=last)


class MessageFilter:
    """A selection applied to one log.

    Attributes:
        wanted: Mask of the log's connections that are wanted, bool.
    """

    def __init__(self, selection: Selection, connections: Sequence[Connection]) -> None:
        self._selection = selection
        self.wanted = selection.wanted(connections)
        self._all = bool(self.wanted.all())

    def limit_to(self, number: int) -> None:
        """Limit the selection to the messages of one connection."""
        self.wanted &= np.arange(len(self.wanted)) == number
        self._all = bool(self.wanted.all())

    @property
    def takes_all(self) -> bool:
        """True where every message is wanted."""
        return self._all and self._selection.start_time is None and self._selection.end_time is None

    def may_be_in(self, start_time: int, end_time: int, numbers: Collection[int]) -> bool:
        """Return whether a chunk may hold a wanted message.

        Args:
            start_time: Earliest log time in the chunk, ns.
            end_time: Latest log time in the chunk, ns.
            numbers: Numbers of the chunk's connections; empty where they are not known.
        """
        start, end = self._selection.start_time, self._selection.end_time
        return ((start is None or end_time >= start) and (end is None or start_time <= end)
                and (self._all or not numbers or any(self.wanted[n] for n in numbers)))

    def apply(self, batch: MessageBatch) -> MessageBatch:
        """Return the wanted messages of a batch."""
        if self.takes_all:
            return batch
        mask = self.wanted[batch.connection]
        if self._selection.start_time is not None:
            mask &= batch.log_time >= self._selection.start_time
        if self._selection.end_time is not None:
            mask &= batch.log_time <= self._selection.end_time
        return batch if mask.all() else batch.take(mask)
