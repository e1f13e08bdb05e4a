"""``jaka_bag du``: the bytes of each topic of a log."""
import argparse
from typing import Any, Dict, List

from ..containers.registry import open_log
from ..operations.usage import usage_of
from .main import for_each_file, human_bytes
from .options import Report, add_report

EPILOG = """\
"in file" is what the topic's messages take of the chunks, compressed, with their indexes; "payload" is the messages
alone, uncompressed. The largest comes first.

examples:
  jaka_bag du run.bag
  jaka_bag du run.mcap --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag du`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE", help=".bag, .mcap, .mcap.active, .db3 or a rosbag2 folder")
    add_report(parser)


def _document(path: str, report: Report) -> Dict[str, Any]:
    with open_log(path) as reader, report.progress(path) as progress:
        rows = usage_of(reader, progress)
        size = reader.index.size
        attachments = sum(entry.size for entry in reader.index.attachments)
    return {"path": path, "size": size, "topics": [row.document() for row in rows], "attachment_bytes": attachments,
            "other_bytes": size - attachments - sum(row.stored for row in rows)}


def _lines(document: Dict[str, Any]) -> List[str]:
    total = max(document["size"], 1)
    rows = [(human_bytes(t["stored_bytes"]), "%.1f %%" % (100.0 * t["stored_bytes"] / total),
             human_bytes(t["payload_bytes"]), str(t["messages"]), t["topic"]) for t in document["topics"]]
    for name, key in (("attachments", "attachment_bytes"), ("index and the rest", "other_bytes")):
        if document[key]:
            rows.append((human_bytes(document[key]), "%.1f %%" % (100.0 * document[key] / total), "", "",
                         "(%s)" % name))
    rows.append((human_bytes(document["size"]), "", "", "", document["path"]))
    return ["%12s %8s %12s %10s  %s" % row
            for row in [("in file", "", "payload", "messages", "topic"), *rows]]


def run(args: argparse.Namespace) -> int:
    """Print what each topic takes; return the exit code."""
    report = Report(args)
    documents: List[Dict[str, Any]] = []

    def show(path: str) -> None:
        documents.append(_document(path, report))
        report.done("\n".join(_lines(documents[-1])))

    code = for_each_file(args.files, show)
    report.finish({"files": documents})
    return code
