"""Options that several subcommands share, and the output of their results."""
import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, Dict, Iterable, Optional, TextIO, Union

from ..errors import UsageError
from ..messages.selection import Selection, TimeSpan
from .main import printable
from .quantities import positive_ns, time_point

_PROGRESS_S = 0.1
"""Least time, s, between two drawings of the bar: more often nobody sees, and a terminal takes time."""
_WIDTH = 24
"""Characters of the bar: with name, share and speed the line fits into 80 columns."""
TIME_HELP = "2m, 5s, 1:30 after the log's start; -2m: before its end; absolute from 1e8 s on, and as 'info' prints it"


def add_source(parser: argparse.ArgumentParser, output: str, metavar: str = "DST",
               source: str = ".bag, .mcap, .mcap.active, .db3 or a rosbag2 folder") -> None:
    """Add one input, its output (second, or with -o) and ``--force``; the texts are their help."""
    parser.add_argument("source", metavar="SRC", help=source)
    parser.add_argument("target", metavar=metavar, nargs="?", help="the output, the same as -o")
    add_output(parser, output, False, metavar)


def add_output(parser: argparse.ArgumentParser, output: str, is_required: bool = True, metavar: str = "DST") -> None:
    """Add an output and ``--force``; ``output`` is its help."""
    parser.add_argument("-o", "--output", metavar=metavar, required=is_required, help=output)
    parser.add_argument("-f", "--force", action="store_true", help="overwrite the output")


def output_of(args: argparse.Namespace) -> Optional[str]:
    """Return the output given to a command of ``add_source``; None where there is none.

    Raises:
        UsageError: There are two.
    """
    if args.target is not None and args.output is not None:
        raise UsageError("two outputs: %s and -o %s" % (args.target, args.output))
    output: Optional[str] = args.target if args.output is None else args.output
    return output


def required_output_of(args: argparse.Namespace) -> str:
    """Return the output given to a command of ``add_source``.

    Raises:
        UsageError: There is none, or there are two.
    """
    output = output_of(args)
    if output is None:
        raise UsageError("an output is needed: SRC DST, or SRC -o DST")
    return output


def add_topics(parser: argparse._ActionsContainer) -> None:
    """Add the options that choose topics."""
    parser.add_argument("-t", "--topics", nargs="+", default=[], metavar="TOPIC", help="these topics")
    parser.add_argument("-e", "--regex", action="append", default=[], metavar="REGEX",
                        help="topics whose whole name matches; may be repeated")
    parser.add_argument("-x", "--exclude", action="append", default=[], metavar="REGEX",
                        help="not the topics whose whole name matches; may be repeated")


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose messages."""
    group = parser.add_argument_group("which messages (default: all)")
    add_topics(group)
    group.add_argument("--types", nargs="+", default=[], metavar="TYPE", help="these message types (package/Type)")
    add_span(group)


def add_span(group: argparse._ActionsContainer) -> None:
    """Add the options that choose a time span."""
    group.add_argument("-s", "--start", type=time_point, metavar="TIME", help="from TIME on: " + TIME_HELP)
    group.add_argument("--until", "--end", dest="end", type=time_point, metavar="TIME",
                       help="up to TIME, given likewise")
    group.add_argument("--duration", type=positive_ns, metavar="TIME",
                       help="so long from --start on (2m, 5s, 1:30; not with --until)")


def selection_of(args: argparse.Namespace) -> Selection:
    """Return the topics and types that the options choose."""
    return Selection(tuple(args.topics), tuple(args.regex), tuple(args.exclude), tuple(args.types))


def span_of(args: argparse.Namespace) -> TimeSpan:
    """Return the time span that the options choose.

    Raises:
        UsageError: The options give two ends.
    """
    if args.end is not None and args.duration is not None:
        raise UsageError("--until and --duration do not go together")
    return TimeSpan(args.start, args.end, args.duration)


def add_compression(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose the compression of the output."""
    group = parser.add_argument_group("compression")
    group.add_argument("-c", "--compression", choices=("none", "lz4", "zstd", "bz2"),
                       help="none, lz4, zstd (.mcap), bz2 (.bag); default zstd for .mcap, none for .bag")
    group.add_argument("--lz4", dest="compression", action="store_const", const="lz4", help="the same as -c lz4")
    group.add_argument("-j", "--bz2", dest="compression", action="store_const", const="bz2", help="the same as -c bz2")
    group.add_argument("--level", type=int, metavar="N", help="the codec's own level; default: its fast one")


def add_report(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose the output on the terminal."""
    group = parser.add_argument_group("what is said")
    group.add_argument("-q", "--quiet", action="store_true", help="no progress bar and no summary")
    group.add_argument("--json", action="store_true", help="the summary as JSON on stdout")


class Progress:
    """A progress bar; silent for a stream of None.

    Args:
        total: Bytes to be worked on.
        name: Name of the file or task.
        stream: Stream to draw on.
    """

    def __init__(self, total: int, name: str, stream: Optional[TextIO]) -> None:
        self._total = max(total, 1)
        self._name = name[-32:]
        self._stream = stream
        self._begin = self._drawn = time.monotonic()
        self._bytes = self._messages = 0
        self._line = 0

    def __call__(self, size: int, messages: int) -> None:
        """Add bytes and messages that are done."""
        if self._stream is None:
            return
        self._bytes += size
        self._messages += messages
        now = time.monotonic()
        if now - self._drawn >= _PROGRESS_S:
            self._drawn = now
            self._draw(max(now - self._begin, 1e-6))

    def _draw(self, elapsed_s: float) -> None:
        assert self._stream is not None
        share = min(self._bytes / self._total, 1.0)
        left_s = int(elapsed_s * (1 - share) / max(share, 1e-6))
        line = "%s [%-*s] %3.0f %%  %.1f MB/s  %.0f msg/s  %d:%02d left" % (
            self._name, _WIDTH, "#" * int(share * _WIDTH), share * 100, self._bytes / elapsed_s / 1e6,
            self._messages / elapsed_s, left_s // 60, left_s % 60)
        self._stream.write("\r" + line.ljust(self._line))
        self._stream.flush()
        self._line = len(line)

    def close(self) -> None:
        """Remove the bar."""
        if self._stream is not None and self._line:
            self._stream.write("\r" + " " * self._line + "\r")
            self._stream.flush()
            self._line = 0

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class Report:
    """The output of results: lines for people, or one JSON document."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._json: bool = args.json
        self._quiet: bool = args.quiet

    def progress(self, *sources: Union[str, Path]) -> Progress:
        """Return a progress bar over the bytes of some files; silent without a terminal."""
        total = sum(path.stat().st_size for source in map(Path, sources)
                    for path in (source.rglob("*") if source.is_dir() else [source]) if path.is_file())
        return self.progress_over(total, Path(sources[0]).name)

    def progress_over(self, total: int, name: str) -> Progress:
        """Return a progress bar over ``total`` bytes; silent without a terminal."""
        return Progress(total, name, None if self._quiet or not sys.stderr.isatty() else sys.stderr)

    def done(self, line: str) -> None:
        """Print one result, for people."""
        if not self._json and not self._quiet:
            print(printable(line))

    def tell(self, kind: str, texts: Iterable[str]) -> None:
        """Print lines about results: ``note`` on a whole one, ``lost`` on what is not kept, ``error`` on a failure."""
        for text in texts:
            print("jaka_bag: %s: %s" % (kind, printable(text)), file=sys.stderr)

    def finish(self, document: Dict[str, Any]) -> None:
        """Print all results as one JSON document."""
        if self._json:
            print(json.dumps(document, indent=1))

    def only(self, line: str, document: Dict[str, Any], notes: Iterable[str] = (), is_partial: bool = False) -> int:
        """Print the only result, with notes on it; return the exit code, which is 1 where it lacks a topic."""
        self.done(line)
        self.tell("note", notes)
        self.finish(document)
        return int(is_partial)
