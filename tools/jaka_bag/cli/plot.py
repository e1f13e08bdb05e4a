"""``jaka_bag plot``: the command line that draws a log."""
import argparse
from pathlib import Path
from typing import Tuple

from ..containers.registry import read_index
from ..errors import BagError, DefinitionError
from ..operations.columns import read_columns
from ..operations.plot import plot
from .options import Report, add_report, add_selection, add_source, selection_of, span_of

EPILOG = """\
Without --field it draws what it knows: sensor_msgs/JointState as joints, geometry_msgs/TwistStamped (and PoseStamped
called tool_position, mm) as TCP position, rotation vector and path, jaka_msgs/RobotMsg as states.

examples:
  jaka_bag plot run.mcap -o run.svg
  jaka_bag plot run.bag -o accident.png -s 512 -d 10
  jaka_bag plot run.bag -o seq.svg --field /jaka_driver/joint_position:header.seq
"""


def _field(text: str) -> Tuple[str, str]:
    topic, separator, name = text.partition(":")
    if not (topic and separator and name):
        raise argparse.ArgumentTypeError("%r is not TOPIC:FIELD" % text)
    return topic, name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag plot``."""
    add_source(parser, ".svg or .png; default: SRC as .svg", False)
    parser.add_argument("--field", type=_field, action="append", default=[], metavar="TOPIC:FIELD",
                        help="draw this field, as /arm:pose.x; may be repeated")
    add_selection(parser)
    add_report(parser)


def run(args: argparse.Namespace) -> int:
    """Draw; the exit code."""
    report = Report(args)
    selection, span = selection_of(args), span_of(args)
    index = read_index(args.source)
    if args.field:
        selection = selection._replace(topics=tuple(topic for topic, _ in args.field))
    data = {}
    for topic in sorted({c.topic for c, wanted in zip(index.connections, selection.wanted(index.connections))
                         if wanted}):
        one = span.apply(selection._replace(topics=(topic,), patterns=()), index.start_time, index.end_time)
        try:
            data.update(read_columns(args.source, selection=one))
        except DefinitionError as error:
            report.tell("note", ["%s is left out: %s" % (topic, error)])
    if not data:
        raise BagError("%s holds no message to draw" % args.source)
    target = args.output or str(Path(args.source).with_suffix(".svg"))
    count = plot(data, target, Path(args.source).name, args.field, args.force)
    return report.only("%s: %d diagrams" % (target, count), {"target": target, "diagrams": count})
