"""A log as messages whose fields can be changed, and that can be written again."""
from typing import Any, Callable, Dict, List, NamedTuple, Optional

from ...containers.registry import create_log, open_log
from ...containers.time_order import messages_of
from ...messages.connection import Connection
from ...messages.value_writer import ValueWriter, exact_time, in_ns, time_of
from ...messages.values import ValueReader
from ...paths import PathLike
from ...units import NS_PER_S

Value = Dict[str, Any]


class Item(NamedTuple):
    """One message: its topic, log time in ns, and bytes."""

    topic: str
    time: int
    raw: bytes


class EditableLog:
    """The messages of a log of small size, in the order of time.

    Attributes:
        items: The messages.
        connections: The first connection of each topic.
    """

    def __init__(self, items: List[Item], connections: Dict[str, Connection]) -> None:
        self.items = items
        self.connections = connections
        self._codecs: Dict[str, Any] = {}

    def with_items(self, items: List[Item]) -> "EditableLog":
        """Return a log of other messages on the same topics, in the order of time."""
        result = EditableLog(sorted(items, key=lambda item: item.time), self.connections)
        result._codecs = self._codecs
        return result

    @property
    def start(self) -> int:
        """The log time of the first message, ns."""
        return self.items[0].time

    @property
    def duration(self) -> float:
        """Time from the first to the last message, s."""
        return (self.items[-1].time - self.items[0].time) / NS_PER_S

    def first_topic_of(self, datatype: str) -> Optional[str]:
        """Return the first topic of a type by name; None where there is none."""
        return min((topic for topic, one in self.connections.items() if one.datatype == datatype), default=None)

    def seconds(self, item: Item) -> float:
        """Return the time of a message since the log's begin, s."""
        return (item.time - self.start) / NS_PER_S

    def value(self, item: Item) -> Value:
        """Return the fields of a message."""
        reader: ValueReader = self._codec(item.topic)[0]
        return reader.read(item.raw)

    def with_value(self, item: Item, value: Value) -> Item:
        """Return a message with other fields."""
        writer: ValueWriter = self._codec(item.topic)[1]
        return item._replace(raw=writer.write(value))

    def _codec(self, topic: str) -> Any:
        if topic not in self._codecs:
            connection = self.connections[topic]
            self._codecs[topic] = (ValueReader(connection, exact_time, "surrogateescape"), ValueWriter(connection))
        return self._codecs[topic]

    def edited(self, topic: Optional[str], change: Callable[[Value, float], None], begin: float = -1.0,
               end: float = 1e12) -> "EditableLog":
        """Return the log with the messages of a topic (None: of all) changed between two times, s."""
        items = []
        for item in self.items:
            now = self.seconds(item)
            if (topic is None or item.topic == topic) and begin <= now < end:
                value = self.value(item)
                change(value, now)
                item = self.with_value(item, value)
            items.append(item)
        return self.with_items(items)

    def numbered(self) -> "EditableLog":
        """Return the log with header.seq counted anew on each topic, as if nothing had been lost on the way."""
        counts: Dict[str, int] = {}

        def count(item: Item) -> Item:
            value = self.value(item)
            if "seq" not in value.get("header", {}):
                return item
            counts[item.topic] = counts.get(item.topic, 0) + 1
            value["header"]["seq"] = counts[item.topic]
            return self.with_value(item, value)
        return self.with_items([count(item) for item in self.items])

    def retimed(self, shift: Callable[[float], float]) -> "EditableLog":
        """Return the log with each log time and header.stamp moved by the seconds that ``shift`` returns for it."""
        def move(item: Item) -> Item:
            value = self.value(item)
            by = int(shift(self.seconds(item)) * NS_PER_S)
            if "stamp" in value.get("header", {}):
                stamp = in_ns(value["header"]["stamp"])
                value["header"]["stamp"] = time_of(stamp + int(shift((stamp - self.start) / NS_PER_S) * NS_PER_S))
                item = self.with_value(item, value)
            return item._replace(time=item.time + by)
        return self.with_items([move(item) for item in self.items])


def read_log(path: PathLike) -> EditableLog:
    """Read a log.

    Raises:
        BagError: It cannot be read.
    """
    with open_log(path) as reader:
        connections: Dict[str, Connection] = {}
        for connection in reader.connections:
            connections.setdefault(connection.topic, connection)
        items = [Item(message.connection.topic, message.log_time, message.data) for message in messages_of(reader)]
    return EditableLog(items, connections)


def write_log(log: EditableLog, path: PathLike) -> None:
    """Write a log; topics without messages are left out."""
    with create_log(path, overwrite=True) as writer:
        present = {item.topic for item in log.items}
        numbers = {topic: writer.add_channel(connection) for topic, connection in log.connections.items()
                   if topic in present}
        for item in log.items:
            writer.add_message(numbers[item.topic], item.time, item.raw)
