"""``jaka_bag export``: the command line that writes fields as tables."""
import argparse

from ..containers.registry import open_log
from ..errors import BagError
from ..messages.selection import Selection
from ..operations.export import export
from .options import Report, add_report, add_source

EPILOG = """\
CSV and Parquet: one file a topic, STEM_topic.csv where there are several. Times are s with nine digits in CSV, ns
elsewhere; arrays are spread over columns name[0], name[1], ... in CSV, byte arrays are hexadecimal.
NPZ: one file, arrays topic/field; arrays of changing length as topic/field and topic/field.lengths.

examples:
  jaka_bag export run.bag -o run.csv
  jaka_bag export run.mcap -o joints.parquet -t /jaka_driver/joint_position
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag export``."""
    add_source(parser, ".csv, .npz or .parquet")
    parser.add_argument("-t", "--topics", nargs="+", default=[], metavar="TOPIC", help="these topics (default: all)")
    parser.add_argument("-e", "--regex", action="append", default=[], metavar="REGEX",
                        help="topics whose whole name matches; may be repeated")
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Export; the exit code."""
    report = Report(args)
    with open_log(args.source) as reader:
        missing = set(args.topics) - {connection.topic for connection in reader.connections}
        if missing:
            raise BagError("%s has no topic %s" % (args.source, ", ".join(sorted(missing))))
        result = export(reader, args.output, Selection(tuple(args.topics), tuple(args.regex)), args.force)
    tables = [{"target": path, "topic": topic, "messages": messages} for topic, (path, messages) in result.items()]
    for table in tables:
        report.done("%(target)s: %(messages)d messages of %(topic)s" % table)
    report.finish({"source": args.source, "tables": tables})
    return 0
