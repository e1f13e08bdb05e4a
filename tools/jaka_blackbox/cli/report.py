"""``jaka_bag report``: the events around an accident as one HTML page."""
import argparse
import os
from pathlib import Path

from jaka_bag.cli import quantities
from jaka_bag.cli.quantities import time_point
from jaka_bag.errors import UsageError
from jaka_bag.output_file import check_output, write_text

from ..incident.loading import load_incident
from ..incident.page import incident_page

EPILOG = """\
The page needs no network and no scripts. It shows each second around the trigger: states, service calls with their
callers, changes of diagnostics, joints, speeds, the path of the tool centre point, and what was lost.

The trigger is the one that a file of the black box names; of any other log, the first fault in it, or --at.

examples:
  jaka_bag report blackbox_2026-05-04-10-11-12_emergency_stop.mcap
  jaka_bag report run.bag --at 125.5 --before 10s --after 5s -o stop.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag report`` to a parser."""
    parser.add_argument("source", metavar="FILE", help="log of the driver's topics, .bag or .mcap")
    parser.add_argument("-o", "--output", metavar="PAGE", help="default: FILE with .html at its end")
    parser.add_argument("--force", action="store_true", help="overwrite the page")
    parser.add_argument("--at", type=time_point, metavar="S",
                        help="where to look: S seconds after the log's start; negative: before its end; from 1e8 on: "
                             "since the epoch")
    parser.add_argument("--before", type=quantities.duration, metavar="TIME",
                        help="from so long before (default: as the black box was set, else 60s)")
    parser.add_argument("--after", type=quantities.duration, metavar="TIME",
                        help="until so long after the last trigger (default likewise, else 20s)")


def run(args: argparse.Namespace) -> int:
    """Write the page; 0 when it is written."""
    target = Path(args.output) if args.output else Path(args.source).with_suffix(".html")
    if os.path.realpath(str(target)) == os.path.realpath(args.source):
        raise UsageError("%s is the log itself" % target)
    check_output(target, args.force)
    incident = load_incident(args.source, args.at, args.before, args.after)
    write_text(target, incident_page(incident), args.force)
    first = incident.triggers[0] if incident.triggers else None
    print("%s: %s" % (target, "no trigger" if first is None else "%s, %s" % (first.kind, first.detail)))
    return 0
