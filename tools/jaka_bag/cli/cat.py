"""``jaka_bag cat``: messages as lines of JSON."""
import argparse
import json
import sys
from typing import Any, Dict, Iterator, List, Optional, Tuple

from ..containers.registry import open_log
from ..containers.time_order import messages_of
from ..errors import DefinitionError, UsageError
from ..messages.connection import Connection
from ..messages.decoding import Decoder, pick
from ..messages.selection import Selection, TimeSpan, require_match
from .main import for_each_file
from .options import add_selection, selection_of, span_of
from .quantities import count

EPILOG = """\
A line for each message, in the order of time:
{"topic", "type", "log_time_ns", "publish_time_ns", "sequence", "message"}.
Times in messages are {"secs", "nsecs"}, arrays of bytes base64; what is no number is "NaN", "Infinity", "-Infinity".

--field keeps these fields only, as header.stamp, position[0], or TOPIC:FIELD for one topic alone.

examples:
  jaka_bag cat run.mcap -t /jaka_driver/robot_states
  jaka_bag cat run.bag --field /jaka_driver/joint_position:position -s 1:30 --duration 5s | head
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag cat`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE",
                        help=".bag, .mcap, .mcap.active, .db3 or rosbag2 folders, one after the other")
    parser.add_argument("--field", action="append", default=[], metavar="[TOPIC:]FIELD",
                        help="only this field, as position[0]; may be repeated")
    parser.add_argument("-l", "--limit", type=count, default=0, metavar="N",
                        help="N messages of each topic (0: no limit)")
    add_selection(parser)


class _Lines:
    """The formatter of one log's messages as lines.

    Args:
        fields: (topic or None for all, path) to keep; none keeps whole messages.
        limit: Messages of each topic; 0 for all.
    """

    def __init__(self, fields: List[Tuple[Optional[str], str]], limit: int) -> None:
        self._fields = fields
        self._limit = limit
        self._decoders: Dict[Connection, Decoder] = {}
        self._counts: Dict[str, int] = {}
        self._wanted: Dict[str, List[str]] = {}
        self.found: Dict[str, bool] = {path: False for _, path in fields}
        self.failed: Dict[Connection, str] = {}
        self.left_out: List[str] = []

    def _decoder(self, connection: Connection) -> Decoder:
        if connection not in self._decoders:
            self._decoders[connection] = Decoder(connection)
            self._wanted[connection.topic] = [path for topic, path in self._fields
                                              if topic in (None, connection.topic)]
        return self._decoders[connection]

    def of(self, path: str, selection: Selection, span: TimeSpan) -> Iterator[Dict[str, Any]]:
        """Yield the lines of a log, as data."""
        with open_log(path) as reader:
            self.left_out += reader.index.left_out
            for line in require_match(selection, reader.connections, path):
                print("jaka_bag: note: %s" % line, file=sys.stderr)
            chosen = span.apply(selection, reader.index.start_time, reader.index.end_time)
            for message in messages_of(reader, chosen):
                connection = message.connection
                if connection in self.failed and connection not in self._decoders:
                    continue
                seen = self._counts.get(connection.topic, 0)
                if self._limit and seen >= self._limit:
                    continue
                self._counts[connection.topic] = seen + 1
                try:
                    content = self._decoder(connection).decode(message.data)
                except DefinitionError as error:
                    self.failed.setdefault(connection, str(error))
                    continue
                if self._fields:
                    content = self._part(content, self._wanted[connection.topic])
                    if not content:
                        continue
                yield {"topic": connection.topic, "type": connection.datatype, "log_time_ns": message.log_time,
                       "publish_time_ns": message.publish_time, "sequence": message.sequence, "message": content}

    def _part(self, content: Any, paths: List[str]) -> Dict[str, Any]:
        part = {}
        for path in paths:
            try:
                part[path] = pick(content, path)
                self.found[path] = True
            except KeyError:
                pass  # another topic may have it
        return part


def _field(text: str) -> Tuple[Optional[str], str]:
    topic, separator, name = text.rpartition(":")
    return topic if separator else None, name


def run(args: argparse.Namespace) -> int:
    """Print the messages; return the exit code."""
    fields = [_field(text) for text in args.field]
    selection = selection_of(args)
    topics = [topic for topic, _ in fields if topic is not None]
    if fields and len(topics) == len(fields) and selection == Selection():
        selection = Selection(tuple(topics))
    lines = _Lines(fields, args.limit)

    def show(path: str) -> None:
        printed = False
        lines.failed.clear()
        lines.left_out.clear()
        for line in lines.of(path, selection, span_of(args)):
            sys.stdout.write(json.dumps(line) + "\n")
            printed = True
        if lines.failed or lines.left_out:
            raise DefinitionError("%s: left out: %s" % (path, "; ".join([*lines.failed.values(), *lines.left_out])))
        missing = [name for name, is_there in lines.found.items() if not is_there]
        if fields and missing:
            raise UsageError("%s: no selected message has a field %s" % (path, ", ".join(missing)))
        if not printed and selection != Selection():
            raise UsageError("%s: no message is selected: the selected topics have none in the selected time" % path)

    return for_each_file(args.files, show)
