"""``jaka_bag doctor``: is a log whole, and if not, why not."""
import argparse
from typing import Any, Dict, List

from ..operations.diagnosis import DAMAGED, LIMITED, ODD, diagnose
from .main import for_each_file
from .options import Report, add_report

EPILOG = """\
Reads all of the file: records, checksums, index against content, attachments; definitions, their md5, and whether the
first messages of each topic are what they say. An error means that something is lost or cannot be trusted, a warning
that some software will stumble over the log. Of a rosbag2 folder all files are read, and compared with metadata.yaml.

examples:
  jaka_bag doctor run.bag
  jaka_bag doctor logs/*.mcap --json

Exit code: 0 whole (warnings or not), 1 damaged, or not read whole because of a limit, 2 usage.
"""
_VERDICTS = {DAMAGED: "damaged: jaka_bag recover keeps the %d messages that can be read",
             LIMITED: "not read whole: a limit, not damage; %d messages were read",
             ODD: "whole, with warnings: %d messages", "whole": "whole: %d messages"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag doctor`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE", help=".bag, .mcap, .mcap.active, .db3 or a rosbag2 folder")
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Print a diagnosis of each log; return the exit code."""
    report = Report(args)
    documents: List[Dict[str, Any]] = []

    def show(path: str) -> None:
        with report.progress(path) as progress:
            diagnosis = diagnose(path, progress)
        documents.append(diagnosis.document())
        for finding in diagnosis.findings:
            report.done("%s: %s: %s" % (path, finding.level, finding.text))
        is_lost = diagnosis.verdict == DAMAGED and not diagnosis.messages
        report.done("%s: %s" % (path, "damaged: no message can be read" if is_lost
                                else _VERDICTS[diagnosis.verdict] % diagnosis.messages))

    code = for_each_file(args.files, show)
    report.finish({"files": documents})
    return max(code, int(any(document["verdict"] in (DAMAGED, LIMITED) for document in documents)))
