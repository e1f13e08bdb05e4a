"""Options that several subcommands share, and how they say what they did."""
import argparse
import json
import sys
from decimal import Decimal, InvalidOperation
from typing import Any, Dict, List, Optional

from ..messages.selection import Selection, TimePoint, TimeSpan
from ..units import NS_PER_S
from .progress import Progress

_ABSOLUTE_FROM = 100000000
"""Seconds from here on are taken as seconds since the epoch (1973), below as offsets."""


def time_point(text: str) -> TimePoint:
    """A moment from ``12.5``, ``-3`` (before the end) or ``1700000000.5`` (since the epoch), s.

    Raises:
        argparse.ArgumentTypeError: It is none.
    """
    ns = _nanoseconds(text)
    return TimePoint(ns, ns >= _ABSOLUTE_FROM * NS_PER_S)


def _nanoseconds(text: str) -> int:
    try:
        value = Decimal(text)
        if not value.is_finite() or abs(value) > 1 << 33:
            raise InvalidOperation
    except InvalidOperation:
        raise argparse.ArgumentTypeError("%r is not a time in seconds" % text) from None
    return int((value * NS_PER_S).to_integral_value())


def positive_ns(text: str) -> int:
    """A duration in s, given as ns.

    Raises:
        argparse.ArgumentTypeError: It is none.
    """
    ns = _nanoseconds(text)
    if ns <= 0:
        raise argparse.ArgumentTypeError("%r is not a time in seconds above 0" % text)
    return ns


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Declare the options that choose messages."""
    group = parser.add_argument_group("which messages (default: all)")
    group.add_argument("-t", "--topics", nargs="+", default=[], metavar="TOPIC", help="these topics")
    group.add_argument("-e", "--regex", action="append", default=[], metavar="REGEX",
                       help="topics whose whole name matches; may be repeated")
    group.add_argument("-x", "--exclude", action="append", default=[], metavar="REGEX",
                       help="not the topics whose whole name matches; may be repeated")
    group.add_argument("--types", nargs="+", default=[], metavar="TYPE", help="these message types (package/Type)")
    group.add_argument("-s", "--start", type=time_point, metavar="S",
                       help="from S seconds after the log's start; negative: before its end; from 1e8 on: since the "
                            "epoch")
    group.add_argument("-u", "--end", type=time_point, metavar="S", help="until then, given likewise")
    group.add_argument("-d", "--duration", type=positive_ns, metavar="S", help="S seconds from --start (not with -u)")


def selection_of(args: argparse.Namespace) -> Selection:
    """The topics and types that the options choose."""
    return Selection(tuple(args.topics), tuple(args.regex), tuple(args.exclude), tuple(args.types))


def span_of(args: argparse.Namespace) -> TimeSpan:
    """The time that the options choose."""
    return TimeSpan(args.start, args.end, args.duration)


def usage_error(text: str) -> int:
    """Say what is wrong with the options; the exit code."""
    print("jaka_bag: error: %s" % text, file=sys.stderr)
    return 2


def add_compression(parser: argparse.ArgumentParser) -> None:
    """Declare the options that choose the compression of the output."""
    group = parser.add_argument_group("compression")
    group.add_argument("-c", "--compression", choices=("none", "lz4", "zstd", "bz2"),
                       help="none, lz4, zstd (.mcap), bz2 (.bag); default zstd for .mcap, none for .bag")
    group.add_argument("--level", type=int, metavar="N", help="the codec's own level; default: its fast one")


def add_report(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say how much is said."""
    group = parser.add_argument_group("what is said")
    group.add_argument("-q", "--quiet", action="store_true", help="no progress bar and no summary")
    group.add_argument("--json", action="store_true", help="the summary as JSON on stdout")


class Report:
    """Says what was done: lines for people, or one JSON document."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._json: bool = args.json
        self._quiet: bool = args.quiet
        self._documents: List[Dict[str, Any]] = []

    def progress(self, total: int, name: str) -> Progress:
        """A progress bar over ``total`` bytes; silent without a terminal."""
        return Progress(total, name, None if self._quiet or not sys.stderr.isatty() else sys.stderr)

    def done(self, line: str, document: Dict[str, Any]) -> None:
        """One result: the line for people, the same as data."""
        self._documents.append(document)
        if not self._json and not self._quiet:
            print(line)

    def note(self, text: str) -> None:
        """Something that the user should know of a result that is whole."""
        print("jaka_bag: note: %s" % text, file=sys.stderr)

    def lost(self, text: str) -> None:
        """Something that could not be kept."""
        print("jaka_bag: lost: %s" % text, file=sys.stderr)

    def failed(self, text: str) -> None:
        """Something that went wrong while the rest goes on."""
        print("jaka_bag: error: %s" % text, file=sys.stderr)

    def finish(self, document: Optional[Dict[str, Any]] = None) -> None:
        """Print the JSON document: the given one, or the one result."""
        if self._json:
            print(json.dumps(document if document is not None else self._documents[0], indent=1))


def human_bytes(count: float) -> str:
    """A number of bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if abs(count) < 1000 or unit == "GB":
            return "%.0f %s" % (count, unit) if unit == "B" else "%.1f %s" % (count, unit)
        count /= 1000.0
    return ""
