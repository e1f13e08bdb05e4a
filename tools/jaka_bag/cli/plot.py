"""``jaka_bag plot``: the command line that draws a log."""
import argparse
from pathlib import Path
from typing import List, Sequence, Tuple

from ..containers.interface import LogReader
from ..containers.registry import open_log
from ..errors import BagError, DefinitionError, UsageError
from ..messages.selection import Selection, require_match
from ..operations.columns import ColumnReader
from ..operations.plot import Sketch, check_format, draw, fields_to_draw
from .options import Report, add_report, add_selection, add_source, output_of, selection_of, span_of

EPILOG = """\
Without --field it draws what it knows: sensor_msgs/JointState as joints, geometry_msgs/TwistStamped (and PoseStamped
called tool_position, mm) as TCP position, rotation vector and path, jaka_msgs/RobotMsg as states.

examples:
  jaka_bag plot run.mcap run.svg
  jaka_bag plot run.bag accident.png -s 8:32 --duration 10s
  jaka_bag plot run.bag seq.svg --field /jaka_driver/joint_position:header.seq
"""


def _field(text: str) -> Tuple[str, str]:
    topic, separator, name = text.partition(":")
    if not (topic and separator and name):
        raise argparse.ArgumentTypeError("%r is not TOPIC:FIELD" % text)
    return topic, name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag plot`` to a parser."""
    add_source(parser, ".svg or .png; default: SRC as .svg")
    parser.add_argument("--field", type=_field, action="append", default=[], metavar="TOPIC:FIELD",
                        help="draw this field, as /arm:pose.x; may be repeated")
    add_selection(parser)
    add_report(parser)


def _sketch(reader: LogReader, selection: Selection, topics: Sequence[str], args: argparse.Namespace,
            left_out: List[str]) -> Sketch:
    """Return the sketch of the topics; leave out, with a line, a topic whose messages cannot be decoded."""
    fields = None if args.field else fields_to_draw(reader.connections)

    def take(sketch: Sketch, some: Sequence[str]) -> None:
        for topic, columns in ColumnReader(reader, selection._replace(topics=tuple(some), patterns=())).pieces(fields):
            sketch.add(topic, columns)

    together = Sketch(args.field)
    try:
        if topics:
            take(together, topics)
        return together
    except DefinitionError:  # one by one, to see which it is
        sketch = Sketch(args.field)
        for topic in topics:
            try:
                take(sketch, [topic])
            except DefinitionError as error:
                sketch.forget(topic)
                left_out.append("%s is left out: %s" % (topic, error))
        return sketch


def run(args: argparse.Namespace) -> int:
    """Draw the plots as the options say; return the exit code."""
    report = Report(args)
    selection, span = selection_of(args), span_of(args)
    if args.field:
        selection = selection._replace(topics=tuple(topic for topic, _ in args.field), patterns=())
    target = output_of(args) or str(Path(args.source).with_suffix(".svg"))
    check_format(target)
    with open_log(args.source) as reader:
        index = reader.index
        if index.start_time is None:
            raise BagError("%s has no messages to draw" % args.source)
        left_out = list(index.left_out)
        report.tell("note", require_match(selection, index.connections, args.source))
        chosen = {c.topic for c, wanted, count in zip(index.connections, selection.wanted(index.connections),
                                                      index.counts) if wanted and count}
        topics = sorted(chosen if args.field else chosen.intersection(fields_to_draw(index.connections)))
        sketch = _sketch(reader, span.apply(selection, index.start_time, index.end_time), topics, args, left_out)
        left_out += sketch.notes
        report.tell("note", left_out)
        if not sketch.message_count and len(topics) == len(chosen):
            raise UsageError("%s: no message is selected that can be drawn" % args.source)
        panels, paths = sketch.panels()
    count = draw(panels, target, Path(args.source).name, paths, args.force)
    return report.only("%s: %d diagrams" % (target, count), {"target": target, "diagrams": count},
                       is_partial=bool(left_out))
