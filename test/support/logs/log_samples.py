"""Small logs for the tests of bags: connections, messages of known content, and bags with every irregularity."""
import random
import struct
from pathlib import Path
from typing import List, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.containers.bag import records as bag_format
from jaka_bag.containers.registry import create_log, open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import definition_md5

BREAK = "\n" + "=" * 80 + "\n"
HEADER = BREAK + "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
VECTOR = BREAK + "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
TWIST = BREAK + "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n"
START_NS = 1_700_000_000_000_000_000


def connection(topic: str, datatype: str, definition: str, callerid: Optional[str] = "/node",
               latching: Optional[bool] = None) -> Connection:
    return Connection(topic, datatype, definition_md5(datatype, definition), definition, callerid, latching)


JOINTS = connection("/jaka_driver/joint_position", "sensor_msgs/JointState",
                    "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + HEADER,
                    "/jaka_driver", False)
TOOL = connection("/jaka_driver/tool_position", "geometry_msgs/TwistStamped",
                  "Header header\nTwist twist\n" + HEADER + TWIST + VECTOR, "/jaka_driver", False)
POSE = connection("/jaka_driver/tool_position", "geometry_msgs/PoseStamped",
                  "Header header\nPose pose\n" + HEADER + BREAK
                  + "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n" + BREAK
                  + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" + BREAK
                  + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
                  "/jaka_driver", False)
STATES = connection("/jaka_driver/robot_states", "jaka_msgs/RobotMsg",
                    "int16 motion_state\nint16 power_state\nint16 servo_state\nint16 collision_state\n",
                    "/jaka_driver", False)
MODEL = connection("/model", "std_msgs/String", "string data\n", "/launch", True)


class Sample(NamedTuple):
    """One message of a test log; ``time`` is ns."""

    connection: Connection
    time: int
    data: bytes


def text(value: str) -> bytes:
    raw = value.encode()
    return struct.pack("<I", len(raw)) + raw


def header(seq: int, time: int, frame: str = "base") -> bytes:
    return struct.pack("<III", seq, time // 10**9, time % 10**9) + text(frame)


def joints(seq: int, time: int, position: Sequence[float], names: Optional[Sequence[str]] = None,
           velocity: Sequence[float] = ()) -> Sample:
    names = ["joint_%d" % (i + 1) for i in range(len(position))] if names is None else names
    data = header(seq, time, "") + struct.pack("<I", len(names)) + b"".join(map(text, names))
    for values in (position, velocity, ()):
        data += struct.pack("<I%dd" % len(values), len(values), *values)
    return Sample(JOINTS, time, data)


def tool(seq: int, time: int, values: Sequence[float]) -> Sample:
    return Sample(TOOL, time, header(seq, time) + struct.pack("<6d", *values))


def pose(seq: int, time: int, values: Sequence[float]) -> Sample:
    return Sample(POSE, time, header(seq, time) + struct.pack("<7d", *values))


def states(time: int, *values: int) -> Sample:
    return Sample(STATES, time, struct.pack("<4h", *values))


def model(time: int, value: str) -> Sample:
    return Sample(MODEL, time, text(value))


def state_log(seconds: float = 1.0, rate: int = 125, seed: int = 1) -> List[Sample]:
    """Return what the driver publishes, with a latched text in front."""
    dice = random.Random(seed)
    result = [model(START_NS, "zu7")]
    for i in range(int(seconds * rate)):
        time = START_NS + i * 10**9 // rate + dice.randrange(100000)
        result.append(tool(i, time, [dice.uniform(-1, 1) for _ in range(6)]))
        result.append(joints(i, time + 20, [dice.uniform(-3, 3) for _ in range(6)]))
        result.append(states(time + 40, 3 if i % 50 > 10 else 0, 1, 0, 0))
    return result


def write(path: Path, samples: Sequence[Sample], compression: Optional[str] = None, chunk_size: int = 4096) -> Path:
    """Write samples in their order."""
    with create_log(path, compression) as writer:
        writer.chunk_size = chunk_size
        numbers = {}
        for sample in samples:
            if sample.connection not in numbers:
                numbers[sample.connection] = writer.add_channel(sample.connection)
        for sample in samples:
            writer.add_message(numbers[sample.connection], sample.time, sample.data)
    return path


def read(path: Path) -> List[Sample]:
    """Return the messages of a log in the order of time."""
    with open_log(path) as reader:
        return [Sample(m.connection, m.log_time, m.data) for m in messages_of(reader)]


def in_order(samples: Sequence[Sample]) -> List[Sample]:
    return sorted(samples, key=lambda sample: sample.time)


def bag_record(fields: Sequence[Tuple[str, bytes]], data: bytes) -> bytes:
    return bag_format.pack_record(fields, data)


def message_record(number: int, time: int, data: bytes, order: Sequence[int] = (0, 1, 2),
                   extra: Sequence[Tuple[str, bytes]] = ()) -> bytes:
    """Return a message record of a bag, its header's fields in any order and with further ones."""
    fields = [("conn", struct.pack("<I", number)), ("op", b"\x02"), ("time", bag_format.pack_time(time))]
    return bag_record([fields[i] for i in order] + list(extra), data)


class RawBag:
    """A bag put together record by record, so that it can be irregular."""

    def __init__(self) -> None:
        self.body = bytearray()
        self.infos: List[bag_format.ChunkInfo] = []
        self.tail = b""
        self.connections = 0
        self.begin = len(bag_format.MAGIC) + len(bag_format.file_header(0, 0, 0))

    def add_chunk(self, content: bytes, index: Sequence[Tuple[int, Sequence[Tuple[int, int]]]],
                  start: int, end: int) -> None:
        """Add a chunk; ``index`` is (connection, [(time, offset)])."""
        position = self.begin + len(self.body)
        self.body += bag_format.chunk_head("none", len(content), len(content)) + content
        for number, entries in index:
            self.body += bag_format.index_record(number, len(entries), b"".join(
                bag_format.pack_time(time) + struct.pack("<I", offset) for time, offset in entries))
        self.infos.append(bag_format.ChunkInfo(position, start, end, {n: len(entries) for n, entries in index}))

    def add_connection(self, number: int, value: Connection) -> None:
        self.tail += bag_format.connection_record(number, value)
        self.connections += 1

    def content(self) -> bytes:
        return (bag_format.MAGIC + bag_format.file_header(self.begin + len(self.body), self.connections,
                                                          len(self.infos))
                + bytes(self.body) + self.tail + b"".join(map(bag_format.chunk_info_record, self.infos)))


def payload(batch, i):
    """Return the bytes of message ``i`` of a batch."""
    return batch.data[batch.start[i]:batch.start[i] + batch.length[i]].tobytes()
