"""Small logs of an arm and further topics of its cell, from functions of time."""
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from log_samples import BREAK, HEADER, START_NS, VECTOR, connection

from jaka_bag.containers.registry import create_log
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.value_writer import ValueWriter, time_of

QUATERNION = BREAK + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
JOINTS_TEXT = ("Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + HEADER)
CONNECTIONS: Dict[str, Connection] = {one.topic: one for one in (
    connection("/arm/joint_position", "sensor_msgs/JointState", JOINTS_TEXT),
    connection("/joint_states", "sensor_msgs/JointState", JOINTS_TEXT),
    connection("/tf", "tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n" + BREAK
               + "MSG: geometry_msgs/TransformStamped\nHeader header\nstring child_frame_id\nTransform transform\n"
               + HEADER + BREAK + "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n"
               + VECTOR + QUATERNION),
    connection("/cell/stamped", "cell/Stamped", "Header header\nuint8 data\n" + HEADER),
    connection("/cell/beat", "std_msgs/UInt8", "uint8 data\n"),
    connection("/cell/fire", "std_msgs/Empty", ""),
    connection("/cell/gripper", "std_msgs/String", "string data\n"),
    connection("/cell/values", "cell/Values", "float64[] data\n"),
    connection("/cell/force", "std_msgs/Float64", "float64 data\n"),
    connection("/cell/io", "std_msgs/Bool", "bool data\n"))}


class Said(NamedTuple):
    """One message: its topic, log time in s, and what it says."""

    topic: str
    time: float
    value: Any


def write_cell(path: Path, said: Iterable[Said], chunk_size: int = 1 << 20) -> Path:
    """Write messages as a log with chunks of about so many bytes."""
    some = sorted(said, key=lambda one: one.time)
    used = {one.topic for one in some}
    writers = {topic: ValueWriter(CONNECTIONS[topic]) for topic in used}
    with create_log(path, overwrite=True) as writer:
        writer.chunk_size = chunk_size
        numbers = {topic: writer.add_channel(CONNECTIONS[topic]) for topic in sorted(used)}
        for one in some:
            writer.add_message(numbers[one.topic], START_NS + int(one.time * 1e9), writers[one.topic].write(one.value))
    return path


def _head(stamp: float, number: int, frame: str = "") -> Dict[str, Any]:
    return {"seq": number + 1, "stamp": time_of(START_NS + int(stamp * 1e9) - 500_000), "frame_id": frame}


def smooth(now: float, begin: float, end: float) -> float:
    """Return 0 before ``begin``, 1 after ``end``, and a smooth way between."""
    part = float(np.clip((now - begin) / (end - begin), 0.0, 1.0))
    return part ** 3 * (10.0 - 15.0 * part + 6.0 * part * part)


def joints(until: float, position: Callable[[float], Sequence[float]], topic: str = "/arm/joint_position",
           rate: float = 125.0, names: Sequence[str] = ("joint_1", "joint_2"), late: float = 0.0,
           stamp: Optional[Callable[[float], float]] = None) -> List[Said]:
    """Return an arm's joints at a rate, Hz, ``late`` by so many seconds of the multiples of its period."""
    found = []
    for number in range(int(until * rate)):
        now = number / rate + late
        found.append(Said(topic, now, {"header": _head(now if stamp is None else stamp(now), number),
                                       "name": list(names), "position": [float(one) for one in position(now)],
                                       "velocity": [], "effort": []}))
    return found


def transforms(until: float, frames: Callable[[float], Sequence[str]], rate: float = 60.0, late: float = 0.0,
               amplitude: float = 0.2) -> List[Said]:
    """Return the frames that are there at each time, each at a place of its own that moves by an amplitude, m."""
    found = []
    for number in range(int(until * rate)):
        now = number / rate + late
        found.append(Said("/tf", now, {"transforms": [
            {"header": _head(now, number, "base"), "child_frame_id": child, "transform": {
                "translation": {"x": float(len(child)), "y": amplitude * float(np.sin(2.0 * now)), "z": 0.1},
                "rotation": {"x": 0.0, "y": 0.0, "z": float(np.sin(0.1)), "w": float(np.cos(0.1))}}}
            for child in frames(now)]}))
    return found


def steady(topic: str, rate: float, until: float, data: Callable[[float, int], Any]) -> List[Said]:
    """Return messages at a rate, Hz; ``data`` takes their time and number."""
    return [Said(topic, number / rate, {"data": data(number / rate, number)}) for number in range(int(until * rate))]


def moments(topic: str, some: Sequence[Tuple[float, Any]]) -> List[Said]:
    """Return messages at some times; None says nothing in them."""
    return [Said(topic, time, {} if data is None else {"data": data}) for time, data in some]
