"""``jaka_bag split``: the command line that makes several logs of one."""
import argparse
from pathlib import Path

from ..operations.split import Limits, split
from .options import Report, add_compression, add_report, positive_ns, usage_error
from .quantities import count, megabytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag split``."""
    parser.add_argument("source", metavar="SRC", help=".bag or .mcap")
    parser.add_argument("-o", "--output", metavar="NAME.bag|NAME.mcap",
                        help="parts are called NAME_0.bag, NAME_1.bag, ...; default: as SRC")
    limits = parser.add_argument_group("where to split (at least one)")
    limits.add_argument("--size", type=megabytes, metavar="MB", help="size of a part (also 500k, 2G)")
    limits.add_argument("--duration", type=positive_ns, metavar="S", help="length of a part, s")
    limits.add_argument("--count", type=count, metavar="N", help="messages of a part")
    parser.add_argument("--repeat-latched", action="store_true",
                        help="begin each further part with the newest message of each latched publisher")
    parser.add_argument("--force", action="store_true", help="overwrite parts")
    add_compression(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Split; the exit code.

    Raises:
        BagError: The source cannot be read, or a part cannot be written.
    """
    if not (args.size or args.duration or args.count):
        return usage_error("give --size, --duration or --count, above 0")
    report = Report(args)
    source = Path(args.source)
    with report.progress(source.stat().st_size if source.is_file() else 0, source.name) as progress:
        result = split(source, args.output or source, Limits(args.size or None, args.duration, args.count or None),
                       args.compression, args.level, args.force, args.repeat_latched, progress)
    for path, messages in result.parts:
        report.done("%s: %d messages" % (path, messages), {"target": path, "messages": messages})
    for note in result.notes:
        report.note(note)
    report.finish({"source": str(source), "notes": list(result.notes),
                   "parts": [{"target": path, "messages": messages} for path, messages in result.parts]})
    return 0
