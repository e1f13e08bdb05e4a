"""``jaka_bag extract``: the files and facts beside the messages of a log, listed or taken out."""
import argparse

from ..containers.registry import open_log
from ..errors import UsageError
from ..messages.selection import nearest
from ..operations.extras import extract
from .main import human_bytes
from .options import Report, add_output, add_report

EPILOG = """\
Without -o it lists what there is. Metadata are written as NAME.json. A name that would lead out of the folder is
shortened to its last part.

examples:
  jaka_bag extract run.mcap
  jaka_bag extract run.mcap rosparam.yaml -o parameters
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag extract`` to a parser."""
    parser.add_argument("source", metavar="SRC", help=".mcap or .mcap.active (a .bag has no attachments)")
    parser.add_argument("names", nargs="*", metavar="NAME", help="attachments and metadata (default: all)")
    add_output(parser, "folder to write into", False, "FOLDER")
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """List or extract attachments and metadata; return the exit code."""
    report = Report(args)
    with open_log(args.source) as reader:
        index = reader.index
        there = [entry.name for entry in index.attachments] + [entry.name for entry in index.metadata]
        for name in args.names:
            if name not in there:
                raise UsageError("%s has no attachment or metadata %s%s" % (args.source, name, nearest(name, there)))
        if args.output is not None:
            files = extract(reader, args.output, args.names, args.force)
            for path, size in files:
                report.done("%s: %s" % (path, human_bytes(size)))
            report.finish({"source": args.source, "files": [{"path": path, "bytes": size} for path, size in files]})
            return 0
        attachments = [entry for entry in index.attachments if not args.names or entry.name in args.names]
        metadata = {entry.name: reader.read_metadata(entry) for entry in index.metadata
                    if not args.names or entry.name in args.names}
    for entry in attachments:
        report.done("attachment  %s  %s  %s" % (entry.name, entry.media_type, human_bytes(entry.data_size)))
    for name, values in metadata.items():
        report.done("metadata    %s  %s" % (name, ", ".join(sorted(values))))
    if not there:
        report.tell("note", ["%s has no attachments and no metadata" % args.source])
    report.finish({"source": args.source, "metadata": metadata, "attachments": [
        {"name": entry.name, "media_type": entry.media_type, "bytes": entry.data_size} for entry in attachments]})
    return 0
