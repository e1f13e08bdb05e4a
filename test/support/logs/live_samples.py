"""Messages whose content is their number, and the content of a log; without ROS."""
import contextlib
import struct
import threading
from pathlib import Path
from typing import Dict, List, Tuple

from waiting import wait_until

from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.live.publisher import frame_of
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import definition_md5

SEPARATOR = "=" * 80 + "\n"
TWIST_STAMPED = (
    "std_msgs/Header header\ngeometry_msgs/Twist twist\n"
    + SEPARATOR + "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    + SEPARATOR + "MSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
    + SEPARATOR + "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n")
STRING = "string data\n"


def twist_connection(topic: str) -> Connection:
    return Connection(topic, "geometry_msgs/TwistStamped",
                      definition_md5("geometry_msgs/TwistStamped", TWIST_STAMPED), TWIST_STAMPED)


def string_connection(topic: str) -> Connection:
    return Connection(topic, "std_msgs/String", definition_md5("std_msgs/String", STRING), STRING)


def twist_frame(sequence: int, stamp_ns: int = 0) -> bytes:
    """Return a TwistStamped whose content is its number."""
    head = struct.pack("<III", sequence, *divmod(stamp_ns, 1000000000)) + struct.pack("<I", 5) + b"world"
    return frame_of(head + struct.pack("<6d", *[float(sequence)] * 6))


def string_frame(text: str) -> bytes:
    raw = text.encode()
    return frame_of(struct.pack("<I", len(raw)) + raw)


def content(path: Path) -> Dict[str, List[bytes]]:
    """Return the messages of a log by topic, in the order of time."""
    result: Dict[str, List[bytes]] = {}
    with open_log(path) as reader:
        for message in messages_of(reader):
            result.setdefault(message.connection.topic, []).append(message.data)
    return result


def times(path: Path) -> List[Tuple[str, int]]:
    """Return topic and log time, ns, of all messages of a log, in the order of time."""
    with open_log(path) as reader:
        return [(message.connection.topic, message.log_time) for message in messages_of(reader)]


@contextlib.contextmanager
def no_thread_stays():
    """Fail where the block leaves a thread behind."""
    before = set(threading.enumerate())
    yield
    wait_until(lambda: all(t.daemon for t in set(threading.enumerate()) - before), "threads end", 10.0)
