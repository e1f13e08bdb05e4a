"""Logs with topics of many kinds, and defects planted into single fields of them."""
import json
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple, Optional

import numpy as np
from log_samples import BREAK, HEADER, START_NS, VECTOR, connection

from jaka_bag.containers.registry import create_log
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.value_writer import ValueWriter, time_of

QUATERNION = BREAK + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
POINT = BREAK + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
BANK = BREAK + "MSG: jaka_msgs/IOBank\nbool[] digital_inputs\nfloat64[] analog_inputs\n"
GOAL_ID = "/cell_4711_1795766900123-%d-%s"
"""An anonymous node, the number of its goal, and the goal's time."""
Value = Dict[str, Any]


class Topic(NamedTuple):
    """One topic of a log: its messages at a rate, Hz, or at moments, s."""

    connection: Connection
    value: Callable[[float, int], Value]
    rate: float = 0.0
    moments: tuple = ()


def _head(now: float, number: int, frame: str = "") -> Value:
    return {"seq": number + 1, "stamp": time_of(START_NS + int(now * 1e9) - 500_000), "frame_id": frame}


def _wave(now: float, amplitude: float = 1.0) -> float:
    return amplitude * float(np.sin(2.0 * now))


def _vector(*values: float) -> Value:
    return dict(zip("xyz", values))


def _turn(angle: float) -> Value:
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(angle / 2)), "w": float(np.cos(angle / 2))}


def _io(now: float, number: int) -> Value:
    return {"header": _head(now, number), "cabinet": {
        "digital_inputs": [number % 2 == 1, number % 4 > 1, False], "analog_inputs": [2.5 + (number % 3), 0.0]}}


TOPICS: List[Topic] = [
    Topic(connection("/cell/wrench", "geometry_msgs/WrenchStamped",
                     "Header header\nWrench wrench\n" + HEADER + BREAK
                     + "MSG: geometry_msgs/Wrench\nVector3 force\nVector3 torque\n" + VECTOR),
          lambda now, n: {"header": _head(now, n, "tool"), "wrench": {
              "force": _vector(1.0, _wave(now, 5.0), 0.2 * _wave(now)),
              "torque": _vector(0.1, 0.3 * _wave(now), 0.0)}}, 100.0),
    Topic(connection("/cell/level", "std_msgs/Float32", "float32 data\n"), lambda now, n: {"data": 1.0}, 20.0),
    Topic(connection("/cell/mode", "cell/Mode", "uint8 mode\nint32 order\nbool busy\nstring text\n"
                                                "duration since\nuint8[4] key\nint16[] slots\ntime stamp\n"),
          lambda now, n: {"mode": int(now) % 3, "order": 40 + int(now) // 2, "busy": int(now) % 2 == 1,
                          "text": "step %d" % int(now), "since": (int(now), 0), "key": bytes((1, 2, 3, 4)),
                          "slots": [int(now), 7], "stamp": _head(now, n)["stamp"]}, 50.0),
    Topic(connection("/joint_states", "sensor_msgs/JointState",
                     "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
                     + HEADER),
          lambda now, n: {"header": _head(now, n), "name": ["a", "b"], "position": [_wave(now), 0.5],
                          "velocity": [2.0 * float(np.cos(2.0 * now)), 0.0], "effort": [3.0, _wave(now, 2.0)]}, 125.0),
    Topic(connection("/tf", "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n" + BREAK
                     + "MSG: geometry_msgs/TransformStamped\nHeader header\nstring child_frame_id\n"
                       "Transform transform\n" + HEADER + BREAK
                     + "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n" + VECTOR
                     + QUATERNION),
          lambda now, n: {"transforms": [
              {"header": _head(now, n, "base"), "child_frame_id": child, "transform": {
                  "translation": _vector(0.3 + part, _wave(now, 0.2), 0.1), "rotation": _turn(_wave(now))}}
              for part, child in enumerate(("tool", "camera")[:1 + n % 2])]}, 60.0),
    Topic(connection("/cell/pose", "geometry_msgs/PoseStamped",
                     "Header header\nPose pose\n" + HEADER + BREAK
                     + "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n" + POINT + QUATERNION),
          lambda now, n: {"header": _head(now, n, "base"), "pose": {
              "position": _vector(0.4, _wave(now, 0.1), 0.2), "orientation": _turn(3.0 + _wave(now, 0.5))}}, 30.0),
    Topic(connection("/arm/status", "actionlib_msgs/GoalStatusArray",
                     "Header header\nGoalStatus[] status_list\n" + HEADER + BREAK
                     + "MSG: actionlib_msgs/GoalStatus\nGoalID goal_id\nuint8 status\nstring text\n" + BREAK
                     + "MSG: actionlib_msgs/GoalID\ntime stamp\nstring id\n"),
          lambda now, n: {"header": _head(now, n), "status_list": [
              {"goal_id": {"stamp": _head(now, n)["stamp"], "id": GOAL_ID % (1 + int(now) // 3, "1795766913.24")},
               "status": 1 + int(now) % 3, "text": "step %d" % int(now)}]}, 20.0),
    Topic(connection("/cell/image", "cell/Image", "uint32 width\nuint8[] data\n"),
          lambda now, n: {"width": 4, "data": bytes(range(int(now) % 3, 16 + int(now) % 3))}, 5.0),
    Topic(connection("/jaka_driver/io_states", "jaka_msgs/IOStates", "Header header\nIOBank cabinet\n" + HEADER + BANK),
          _io, moments=tuple(np.cumsum([0.3, 0.21, 0.8, 0.35, 0.6, 0.22, 1.3, 0.4, 0.9, 0.31, 0.7, 0.5]).tolist())),
    Topic(connection("/cell/order", "std_msgs/String", "string data\n"),
          lambda now, n: {"data": "order %d" % n}, moments=(0.5, 1.1, 1.15, 3.0, 3.9, 5.2)),
    Topic(connection("/arm/command", "std_msgs/Float64", "float64 data\n"), lambda now, n: {"data": 5.0 + n},
          moments=(1.3, 4.0, 6.1)),
    Topic(connection("/cell/ten", "std_msgs/Float64", "float64 data\n"), lambda now, n: {"data": 0.1 * n},
          moments=tuple(0.4 + 0.7 * n for n in range(10))),
]
JSON = Connection("/cell/json", "cell/Json", "", "", encoding="json", schema_encoding="jsonschema")
SECONDS = 8.0


class Entry(NamedTuple):
    """One message: its topic, log time in s, and what it says."""

    topic: str
    time: float
    value: Value


def _later(value: Any, late_s: float) -> Any:
    """Return a value with all stamps later by so many seconds."""
    if isinstance(value, list):
        return [_later(one, late_s) for one in value]
    if not isinstance(value, dict):
        return value
    return {name: time_of(inner[0] * 10**9 + inner[1] + int(late_s * 1e9)) if name == "stamp" else _later(inner, late_s)
            for name, inner in value.items()}


def entries(seed: int = 0, late_s: float = 0.0) -> List[Entry]:
    """Return all messages in the order of time; another seed gives other delays of up to 2 ms."""
    random = np.random.RandomState(seed)
    found: List[Entry] = []
    for topic in TOPICS:
        times = list(topic.moments) or (np.arange(int(SECONDS * topic.rate)) / topic.rate).tolist()
        delays = random.uniform(0.0, 0.002, len(times)).tolist()
        found += [Entry(topic.connection.topic, now + late_s + delay, _later(topic.value(now, number), late_s))
                  for number, (now, delay) in enumerate(zip(times, delays))]
    found += [Entry(JSON.topic, 0.5 + late_s + number, {"step": number}) for number in range(7)]
    return sorted(found, key=lambda entry: entry.time)


def write_entries(path: Path, some: List[Entry], chunk_size: int = 1 << 20) -> Path:
    """Write messages as a log with chunks of about so many bytes."""
    connections = {topic.connection.topic: topic.connection for topic in TOPICS}
    connections[JSON.topic] = JSON
    writers = {name: ValueWriter(one) for name, one in connections.items() if name != JSON.topic}
    with create_log(path, overwrite=True) as writer:
        writer.chunk_size = chunk_size
        numbers = {name: writer.add_channel(one) for name, one in connections.items()
                   if any(entry.topic == name for entry in some)}
        for entry in some:
            raw = writers[entry.topic].write(entry.value) if entry.topic in writers else json.dumps(
                entry.value).encode()
            writer.add_message(numbers[entry.topic], START_NS + int(entry.time * 1e9), raw)
    return path


def fields_of(value: Any, prefix: str = "") -> List[str]:
    """Return the dotted names of the fields that have no fields of their own; arrays of messages by their first."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return fields_of(value[0], prefix)
    if not isinstance(value, dict):
        return [prefix]
    return [name for part, inner in value.items()
            for name in fields_of(inner, "%s.%s" % (prefix, part) if prefix else part)]


def with_field(value: Any, name: str, change: Callable[[Any], Any]) -> Any:
    """Return a copy of a value with one of its fields changed, in every element of arrays of messages."""
    if isinstance(value, list):
        return [with_field(one, name, change) for one in value]
    first, _, rest = name.partition(".")
    return {part: (with_field(inner, rest, change) if rest else change(inner)) if part == first else inner
            for part, inner in value.items()}


def changed(some: List[Entry], topic: str, name: str, change: Callable[[Any], Any],
            wanted: Optional[Callable[[Entry], bool]] = None) -> List[Entry]:
    """Return messages with one field of one topic changed."""
    return [entry._replace(value=with_field(entry.value, name, change))
            if entry.topic == topic and (wanted is None or wanted(entry)) else entry for entry in some]
