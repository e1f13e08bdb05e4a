"""``jaka_bag split``: the command line that makes several logs of one."""
import argparse

from ..errors import UsageError
from ..operations.split import SplitLimits, split
from .options import Report, add_compression, add_report, add_source, output_of
from .quantities import count, megabytes, positive_ns

EPILOG = """\
examples:
  jaka_bag split run.bag --duration 10m
  jaka_bag split run.mcap part.mcap --size 500M --repeat-latched

The attachments of an MCAP go to the first part, its metadata to each part.

With --force the parts of an earlier split are replaced, and those removed that the new one does not reach.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag split`` to a parser."""
    add_source(parser, "parts are called NAME_0.bag, NAME_1.bag, ...; default: as SRC",
               "NAME.bag|NAME.mcap")
    limits = parser.add_argument_group("where to split (at least one)")
    limits.add_argument("--size", type=megabytes, metavar="MB", help="size of a part (also 500k, 2G)")
    limits.add_argument("--duration", type=positive_ns, metavar="TIME", help="length of a part (2m, 5s, 1:30)")
    limits.add_argument("--count", type=count, metavar="N", help="messages of a part, without those that it repeats")
    parser.add_argument("--repeat-latched", action="store_true",
                        help="begin each further part with the newest message of each latched publisher")
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Split the log as the options say; return the exit code."""
    if not (args.size or args.duration or args.count):
        raise UsageError("give --size, --duration or --count, above 0")
    report = Report(args)
    limits = SplitLimits(args.size or None, args.duration, args.count or None)
    with report.progress(args.source) as progress:
        result = split(args.source, output_of(args) or args.source, limits, args.compression, args.level, args.force,
                       args.repeat_latched, progress)
    parts = [{"target": path, "messages": messages} for path, messages in result.parts]
    for part in parts:
        report.done("%(target)s: %(messages)d messages" % part)
    if not parts:
        report.tell("note", ["%s has no messages: there is no part" % args.source])
    report.tell("note", result.notes)
    report.finish({"source": args.source, "notes": list(result.notes), "parts": parts})
    return int(result.left_out > 0)
