"""``jaka_bag export``: the command line that writes fields as tables."""
import argparse

from ..containers.registry import open_log
from ..errors import BagError
from ..messages.selection import Selection, require_match
from ..operations.export import export
from .options import Report, add_report, add_source, add_topics, required_output_of

EPILOG = """\
CSV and Parquet: one file a topic, STEM_topic.csv where there are several. Times are s with nine digits in CSV, ns
elsewhere; arrays are spread over columns name[0], name[1], ... in CSV, byte arrays are hexadecimal.
NPZ: one file, arrays topic/field; arrays of changing length as topic/field and topic/field.lengths.

examples:
  jaka_bag export run.bag run.csv
  jaka_bag export run.mcap joints.parquet -t /jaka_driver/joint_position
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag export`` to a parser."""
    add_source(parser, ".csv, .npz or .parquet")
    add_topics(parser.add_argument_group("which messages (default: all)"))
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Export the topics of the log; return the exit code."""
    report = Report(args)
    output = required_output_of(args)
    with open_log(args.source) as reader:
        if not reader.message_count:
            raise BagError("%s has no messages to export" % args.source)
        selection = Selection(tuple(args.topics), tuple(args.regex), tuple(args.exclude))
        report.tell("note", (*require_match(selection, reader.connections, args.source), *reader.index.left_out))
        result = export(reader, output, selection, args.force)
    tables = [{"target": path, "topic": topic, "messages": messages}
              for topic, (path, messages) in result.tables.items()]
    for table in tables:
        report.done("%(target)s: %(messages)d messages of %(topic)s" % table)
    report.tell("note", result.notes)
    report.tell("error", ("%s is left out: %s" % failure for failure in result.failed.items()))
    report.finish({"source": args.source, "tables": tables, "notes": list(result.notes), "failed": result.failed})
    return 1 if result.failed or reader.index.left_out else 0
