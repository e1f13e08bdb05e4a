"""Sessions of an arm made from a formula: joints, poses, states and calls at 125 Hz, written as a log of any length.

The conditions of a run (late start, lateness of calls and stamps, noise) are its own; the arm's motion is the
program's. Two sessions of one program under different conditions are the same run, twice.
"""
import struct
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_bag.containers.registry import create_log
from jaka_bag.messages.batch import MessageBatch, concatenate
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import definition_md5

SAMPLE_S = 0.008
EPOCH_NS = 1_700_000_000_000_000_000
HEADER_TEXT = "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
TWIST_TEXT = ("Header header\nTwist twist\n" + HEADER_TEXT + "=" * 80
              + "\nMSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n" + "=" * 80
              + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n")
JOINT_TEXT = "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + HEADER_TEXT
STATE_TEXT = "int16 motion_state\nint16 power_state\nint16 servo_state\nint16 collision_state\n"
CALL_TEXT = ("Header header\nstring service\nstring service_type\nstring md5sum\nstring caller\nuint8[] request\n"
             "uint8[] response\nstring request_text\nstring response_text\nfloat64 duration\nbool success\n"
             "string error\n" + HEADER_TEXT)
REST = (0.1, 1.5, -1.5, 1.5, 1.5, 0.2)


class Call(NamedTuple):
    """A call as the log will record it; times in s."""

    start: float
    duration: float
    service: str
    request: str
    success: bool = True
    error: str = ""
    response: str = "ret: 1\nmessage: 'completed'"
    caller: str = "/cell"


class Step(NamedTuple):
    """One step of a program: a joint move to ``target`` (rad), a jog of joint 1 (rad/s), or a pause."""

    pause_s: float
    target: Optional[Tuple[float, ...]] = None
    jog_rad_s: float = 0.0
    jog_s: float = 0.0


class Conditions(NamedTuple):
    """The differences from run to run.

    Attributes:
        seed: Seed of everything random.
        start_s: How much later the program begins after the recording.
        call_late_s: Largest lateness of a call.
        stamp_late_s: Largest lateness of a stamp.
        noise_rad: Standard deviation of a measured joint.
        pace: Durations of motions, relative.
        jog_extra_s: How much longer a jog lasts.
    """

    seed: int = 0
    start_s: float = 1.0
    call_late_s: float = 0.02
    stamp_late_s: float = 0.003
    noise_rad: float = 2e-5
    pace: float = 1.0
    jog_extra_s: float = 0.0


UNDISTURBED = Conditions()


class Session:
    """One run; tests change its arrays to seed a defect.

    Attributes:
        time: When each sample was measured, s, shape (n,).
        stamp: header.stamp, s, shape (n,).
        log_time: When the messages of each topic were recorded, s, by ``tool_position`` and so on, shape (n,).
        joints: rad, shape (n, 6).
        position: m, shape (n, 3).
        rotation_vector: rad, shape (n, 3).
        states: motion, power, servo, collision; shape (n, 4).
        calls: The calls as the log will record them.
        keep: Which samples of each topic are written, bool, shape (n,).
        sequence_step: By how much header.seq of each topic grows from message to message.
        first_sequence: header.seq of the first message.
    """

    def __init__(self, time: np.ndarray, joints: np.ndarray, states: np.ndarray, calls: List[Call],
                 conditions: Conditions) -> None:
        random = np.random.RandomState(conditions.seed + 1)
        self.time = time
        self.joints = joints + random.normal(0.0, conditions.noise_rad, joints.shape)
        self.position, self.rotation_vector = tool_pose(self.joints)
        self.states = states
        self.calls = calls
        late = random.uniform(0.0, conditions.stamp_late_s, len(time))
        apart = 1e-6 * np.arange(len(time))  # frames that come in one burst still have stamps of their own
        self.stamp = np.maximum.accumulate(time + late - apart) + apart
        self.log_time = {name: np.maximum.accumulate(self.stamp + random.uniform(2e-4, 6e-4, len(time)))
                         for name in TOPICS}
        self.keep = {name: np.ones(len(time), bool) for name in TOPICS}
        self.sequence_step = dict.fromkeys(TOPICS, 1)
        self.first_sequence = 1
        self.node = "/jaka_driver"
        self.frame = "base_link"


TOPICS = ("tool_position", "joint_position", "robot_states")


def tool_pose(joints: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return a smooth stand-in for the forward kinematics: m and rotation vector."""
    a, b, c, d, e, f = joints.T
    reach = 0.3 * np.sin(b) + 0.25 * np.sin(b + c)
    position = np.stack([reach * np.cos(a), reach * np.sin(a), 0.2 + 0.3 * np.cos(b) + 0.25 * np.cos(b + c)], axis=1)
    return position, np.stack([0.4 + 0.5 * d, 0.3 - 0.4 * e, 0.6 * a + 0.3 * f], axis=1)


def _profile(distance: float, speed: float, acceleration: float) -> Tuple[float, Callable[[np.ndarray], np.ndarray]]:
    """Return duration and travelled fraction of a trapezoid."""
    ramp = min(speed / acceleration, np.sqrt(distance / acceleration))
    top = acceleration * ramp
    total = distance / top + ramp

    def part(t: np.ndarray) -> np.ndarray:
        t = np.clip(t, 0.0, total)
        way = np.where(t < ramp, 0.5 * acceleration * t * t, top * (t - 0.5 * ramp))
        return np.where(t > total - ramp, distance - 0.5 * acceleration * (total - t) ** 2, way) / distance

    return total, part


def simulate(program: Sequence[Step], conditions: Conditions = UNDISTURBED) -> Session:
    """Run a program."""
    random = np.random.RandomState(conditions.seed)
    pieces: List[Tuple[float, float, Callable[[np.ndarray], np.ndarray]]] = []
    calls: List[Call] = []
    now, nominal, here, ramp = conditions.start_s, conditions.start_s, np.array(REST), 0.1
    for step in program:
        now = max(now, nominal) + step.pause_s
        nominal += step.pause_s
        start = now + random.uniform(0.0, conditions.call_late_s)
        if step.target is not None:
            goal = np.array(step.target)
            distance = float(np.abs(goal - here).max())
            slow = conditions.pace
            duration, part = _profile(distance, 0.8 / slow, 3.0 / slow ** 2)
            pieces.append((start, start + duration,
                           lambda t, p=part, a=here, b=goal, s=start: a + p(t - s)[:, None] * (b - a)))
            calls.append(Call(start, duration + 0.02, "joint_move", "pose: %s" % list(step.target)))
            nominal += _profile(distance, 0.8, 3.0)[0] + 0.2
            here, now = goal, start + duration + 0.05
        elif step.jog_s:
            length = step.jog_s + conditions.jog_extra_s + random.uniform(0.0, conditions.call_late_s)
            axis = np.eye(6)[0] * step.jog_rad_s

            def jogged(t: np.ndarray, a: np.ndarray = here, s: float = start, n: float = length,
                       v: np.ndarray = axis) -> np.ndarray:
                u = np.clip(t - s, 0.0, n)
                way = np.where(u < ramp, 0.5 * u * u / ramp, u - 0.5 * ramp)
                way = np.where(u > n - ramp, n - ramp - 0.5 * (n - u) ** 2 / ramp, way)
                return a + way[:, None] * v
            pieces.append((start, start + length, jogged))
            calls.append(Call(start, 0.004, "jog", "mvvelo: %g\nindex: 0" % step.jog_rad_s))
            here = jogged(np.array([start + length]))[0]
            now, nominal = start + length + 0.05, nominal + step.jog_s + 0.2
        else:
            now = max(now, nominal)
    end = max(now, nominal) + 1.0
    time = np.arange(0.0, end, SAMPLE_S) + 0.0005
    joints = np.empty((len(time), 6))
    states = np.zeros((len(time), 4), np.int16)
    states[:, 1] = 1
    joints[:] = REST
    for begin, stop, shape in pieces:
        first, last = np.searchsorted(time, (begin, stop))
        joints[first:] = shape(time[first:])
        states[first:last, 0] = 3
    return Session(time, joints, states, calls, conditions)


def moves(count: int, pause_s: float = 0.6, seed: int = 7) -> List[Step]:
    """Return a program of joint moves, back and forth."""
    random = np.random.RandomState(seed)
    return [Step(pause_s, tuple(np.round(np.array(REST) + random.uniform(-0.9, 0.9, 6), 3))) for _ in range(count)]


def _string(text: str) -> bytes:
    raw = text.encode()
    return struct.pack("<I", len(raw)) + raw


def log_ns(seconds: np.ndarray) -> np.ndarray:
    return EPOCH_NS + np.round(seconds * 1e9).astype(np.int64)


def headed(stamp: np.ndarray, frame: str, first: int, step: int, body: np.ndarray) -> np.ndarray:
    """Return bytes of messages with a header, shape (n, size); ``body`` is uint8 (n, rest)."""
    head = np.empty(len(stamp), np.dtype([("seq", "<u4"), ("secs", "<u4"), ("nsecs", "<u4"), ("size", "<u4")]))
    stamp_ns = log_ns(stamp)
    head["seq"] = step * np.arange(len(stamp)) + first
    head["secs"], head["nsecs"] = stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000
    head["size"] = len(frame)
    return np.concatenate([head.view(np.uint8).reshape(len(stamp), -1),
                           np.broadcast_to(np.frombuffer(frame.encode(), np.uint8), (len(stamp), len(frame))),
                           body], axis=1)


def as_bytes(values: np.ndarray, kind: str) -> np.ndarray:
    return np.ascontiguousarray(values.astype(kind)).view(np.uint8).reshape(len(values), -1)


def _fixed(raw: bytes, count: int) -> np.ndarray:
    return np.broadcast_to(np.frombuffer(raw, np.uint8), (count, len(raw)))


def _rows(session: Session, name: str) -> np.ndarray:
    keep = session.keep[name]
    count = int(keep.sum())
    if name == "robot_states":
        return as_bytes(session.states[keep], "<i2")
    if name == "tool_position":
        pose = np.hstack([session.position[keep], session.rotation_vector[keep]])
        return headed(session.stamp[keep], session.frame, session.first_sequence, session.sequence_step[name],
                      as_bytes(pose, "<f8"))
    names = struct.pack("<I", 6) + b"".join(_string("joint_%d" % (i + 1)) for i in range(6)) + struct.pack("<I", 6)
    position = as_bytes(session.joints[keep], "<f8")
    body = np.concatenate([_fixed(names, count), position, _fixed(bytes(8), count)], axis=1)
    return headed(session.stamp[keep], "", session.first_sequence, session.sequence_step[name], body)


def _call_bytes(session: Session, call: Call, number: int) -> bytes:
    stamp_ns = int(log_ns(np.array([call.start]))[0])
    raw_request, raw_response = call.request.encode(), call.response.encode()
    return (struct.pack("<III", number, *divmod(stamp_ns, 1_000_000_000)) + _string("")
            + _string(session.node + "/" + call.service) + _string("jaka_msgs/Move") + _string("0" * 32)
            + _string(call.caller) + _string(call.request) + struct.pack("<I", len(raw_response)) + raw_response
            + struct.pack("<I", len(raw_request)) + raw_request + _string(call.response)
            + struct.pack("<d?", call.duration, call.success) + _string(call.error))


_TYPES: Dict[str, Tuple[str, str]] = {
    "tool_position": ("geometry_msgs/TwistStamped", TWIST_TEXT),
    "joint_position": ("sensor_msgs/JointState", JOINT_TEXT),
    "robot_states": ("jaka_msgs/RobotMsg", STATE_TEXT), "service_calls": ("jaka_msgs/ServiceCall", CALL_TEXT)}


def _block(session: Session, name: str, number: int) -> MessageBatch:
    if name == "service_calls":
        payloads = [_call_bytes(session, call, i + 1) for i, call in enumerate(session.calls)]
        length = np.array([len(p) for p in payloads], np.int64)
        data = np.frombuffer(b"".join(payloads), np.uint8)
        log_time = log_ns(np.array([call.start + call.duration + 0.001 for call in session.calls]))
    else:
        rows = _rows(session, name)
        length = np.full(len(rows), rows.shape[1], np.int64)
        data = rows.reshape(-1)
        log_time = log_ns(session.log_time[name][session.keep[name]])
    return MessageBatch(data, np.cumsum(length) - length, length, np.full(len(length), number, np.int32), log_time)


def session_parts(sessions: Sequence[Session]) -> Tuple[List[Connection], MessageBatch]:
    """Return the connections of sessions, one an arm, and their messages in the order of time."""
    connections, blocks = [], []
    for session in sessions:
        for name, (datatype, text) in _TYPES.items():
            if name == "service_calls" and not session.calls:
                continue
            if name in session.keep and not session.keep[name].any():
                continue
            blocks.append(_block(session, name, len(connections)))
            connections.append(Connection("%s/%s" % (session.node, name), datatype, definition_md5(datatype, text),
                                          text, session.node))
    whole = concatenate(blocks)
    return connections, whole.take(np.argsort(whole.log_time, kind="stable"))


def write_log(path: Path, *sessions: Session) -> Path:
    """Write sessions, one an arm, as one log."""
    connections, whole = session_parts(sessions)
    with create_log(path, overwrite=True) as writer:
        ids = np.array([writer.add_channel(connection) for connection in connections])
        for begin in range(0, len(whole), 8000):
            writer.append(writer.encode(whole.take(slice(begin, begin + 8000)), ids))
    return path


BLOCK_S = 300.0


def write_long_log(path: Path, seconds: float, conditions: Conditions = UNDISTURBED,
                   change: Optional[Callable[[Session, float], object]] = None, block_s: float = BLOCK_S) -> Path:
    """Write one arm's log of any length, block by block of ``block_s``: other moves in each, from rest to rest.

    Args:
        path: A .bag or .mcap.
        seconds: Length.
        conditions: Conditions of every block; each has random numbers of its own.
        change: Called with each block's session, whose times count from the block's begin, and that begin, s.
        block_s: s; a whole multiple of the time between two samples.
    """
    ids: Optional[np.ndarray] = None
    with create_log(path, overwrite=True) as writer:
        for number in range(int(np.ceil(seconds / block_s))):
            begin = number * block_s
            length = min(block_s, seconds - begin)
            program = [*moves(max(int((length - 8.0) / 3.2), 1), seed=1000 + number), Step(0.6, REST), Step(length)]
            session = simulate(program, conditions._replace(seed=1000 * conditions.seed + number))
            for keep in session.keep.values():
                keep[session.time > length] = False
            session.calls = [call for call in session.calls if call.start + call.duration < length]
            if change is not None:
                change(session, begin)
            session.first_sequence = 1 + int(round(begin / SAMPLE_S))
            session.stamp = session.stamp + begin
            session.log_time = {name: time + begin for name, time in session.log_time.items()}
            session.calls = [call._replace(start=call.start + begin) for call in session.calls]
            connections, whole = session_parts([session])
            if ids is None:
                ids = np.array([writer.add_channel(connection) for connection in connections])
            for first in range(0, len(whole), 8000):
                writer.append(writer.encode(whole.take(slice(first, first + 8000)), ids))
    return path
