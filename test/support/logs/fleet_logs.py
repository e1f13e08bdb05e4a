"""Logs of the cells of a plant: cycles of moves with all that a fleet's questions are about, in any number.

Each log has the driver's own topics: joints, tool, states, service calls, the trajectory controller's state with its
following error, diagnostics with the versions; its metadata name the cell and the messages that the recorder lost.
"""
import copy
import json
import struct
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from accident_samples import DIAGNOSTICS, diagnostics
from synthetic_session import (
    HEADER_TEXT,
    REST,
    Call,
    Conditions,
    Session,
    Step,
    as_bytes,
    headed,
    log_ns,
    session_parts,
    simulate,
)

from jaka_bag.containers.registry import create_log
from jaka_bag.messages.batch import MessageBatch, concatenate
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import definition_md5

DAY_S = 86400.0
FIRST_DAY = "2023-11-14"
"""The day of ``synthetic_session.EPOCH_NS``; its time of day is 22:13:20."""
FIRST_HOUR = 22
_POINT = ("=" * 80 + "\nMSG: trajectory_msgs/JointTrajectoryPoint\nfloat64[] positions\nfloat64[] velocities\n"
          "float64[] accelerations\nfloat64[] effort\nduration time_from_start\n")
_STATE_TEXT = ("Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
               "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n"
               + HEADER_TEXT + _POINT)
_STATE_TYPE = "control_msgs/JointTrajectoryControllerState"
CONTROLLER = Connection("/jaka_zu7_controller/state", _STATE_TYPE, definition_md5(_STATE_TYPE, _STATE_TEXT),
                        _STATE_TEXT, "/jaka_driver", False)
_LAG_S = 0.004
"""The delay of a healthy joint; a worn one is later."""
_MOVES = (tuple(np.round(np.array(REST) + (0.5, -0.4, 0.3, 0.2, -0.3, 0.6), 3)),
          tuple(np.round(np.array(REST) + (-0.4, 0.2, -0.3, 0.4, 0.2, -0.5), 3)))


class Run(NamedTuple):
    """One log to be made.

    Attributes:
        cell: The cell's name; empty: the log has none.
        start_s: Begin, s after the epoch of the synthetic sessions.
        cycles: Rounds of moves; the first move is the same in each.
        pace: Durations of the motions, relative.
        seconds: Length; None for that of the cycles.
        wear: By joint (from 1): how many times as late as a healthy one it is.
        stops: When the emergency stop is pressed, s from the begin; each time for 1.5 s.
        failed: (caller, error) of calls that fail, one after the other.
        undelivered: Messages of the joints' topic that the recorder knows to be lost.
        firmware: The controller's firmware.
        seed: Seed of everything random.
    """

    cell: str = "press_1"
    start_s: float = 0.0
    cycles: int = 2
    pace: float = 1.0
    seconds: Optional[float] = None
    wear: Dict[int, float] = {}
    stops: Sequence[float] = ()
    failed: Sequence[Tuple[str, str]] = ()
    undelivered: int = 0
    firmware: str = "1.7.2"
    seed: int = 1


def session_of(run: Run) -> Session:
    """Return the arm's part of a run, its times from 0."""
    program: List[Step] = []
    for _ in range(run.cycles):
        program += [Step(0.3, _MOVES[0]), Step(0.3, _MOVES[1]), Step(0.3, REST)]
    session = simulate(program, Conditions(seed=run.seed, start_s=0.3, pace=run.pace))
    for at in run.stops:
        first, last = np.searchsorted(session.time, (at, at + 1.5))
        session.states[first:last, 0] = 2
    for number, (caller, error) in enumerate(run.failed):
        session.calls.append(Call(0.5 + 0.2 * number, 0.01, "set_io", "index: 1", False, error, "ret: 0", caller))
    if run.seconds is not None:
        for keep in session.keep.values():
            keep[session.time > run.seconds] = False
        session.calls = [call for call in session.calls if call.start + call.duration < run.seconds]
    return session


def _rows(payloads: Sequence[bytes], times: np.ndarray, number: int) -> MessageBatch:
    length = np.array([len(payload) for payload in payloads], np.int64)
    return MessageBatch(np.frombuffer(b"".join(payloads), np.uint8), np.cumsum(length) - length, length,
                        np.full(len(length), number, np.int32), times)


def _fixed(raw: bytes, count: int) -> np.ndarray:
    return np.broadcast_to(np.frombuffer(raw, np.uint8), (count, len(raw)))


def _controller(session: Session, run: Run, shift_s: float, number: int) -> MessageBatch:
    """Return states of the trajectory controller: 25 a second, every fifth sample of the session."""
    kept = np.flatnonzero(session.keep["joint_position"])[::5]
    speed = np.gradient(session.joints, session.time, axis=0)[kept]
    late = _LAG_S * np.array([run.wear.get(joint, 1.0) for joint in range(1, 7)])
    actual = session.joints[kept]
    wanted = actual + speed * late
    count = len(kept)
    names = struct.pack("<I", 6) + b"".join(struct.pack("<I", 7) + b"joint_%d" % joint for joint in range(1, 7))

    def point(values: np.ndarray) -> List[np.ndarray]:
        return [_fixed(struct.pack("<I", 6), count), as_bytes(values, "<f8"), _fixed(bytes(3 * 4 + 8), count)]
    body = np.concatenate([_fixed(names, count), *point(wanted), *point(actual), *point(wanted - actual)], axis=1)
    stamp = session.stamp[kept] + shift_s
    rows = headed(stamp, "", 1, 1, body)
    length = np.full(count, rows.shape[1], np.int64)
    return MessageBatch(rows.reshape(-1), np.cumsum(length) - length, length, np.full(count, number, np.int32),
                        log_ns(stamp + 5e-4))


def _diagnostics(run: Run, end_s: float, shift_s: float, number: int) -> MessageBatch:
    versions = {"driver": "0.2.0", "controller": run.firmware, "model": "zu7", "interface": "documented"}
    times = log_ns(shift_s + np.arange(0.1, end_s, 1.0))
    return _rows([diagnostics({"jaka_driver: versions": 0}, i + 1, versions, int(time))
                  for i, time in enumerate(times.tolist())], times, number)


def write_run(path: Path, run: Run, session: Optional[Session] = None) -> Path:
    """Write a run as a .bag or .mcap; a bag has no place for metadata.

    Args:
        path: The log.
        run: What is in it.
        session: The arm's part where it is made already; None: it is made.
    """
    session = session_of(run) if session is None else session
    kept = np.flatnonzero(session.keep["joint_position"])
    end_s = float(session.time[kept[-1]])
    connections, whole = session_parts([_shifted(session, run.start_s)])
    connections = [*connections, CONTROLLER, DIAGNOSTICS]
    whole = concatenate([whole, _controller(session, run, run.start_s, len(connections) - 2),
                         _diagnostics(run, end_s, run.start_s, len(connections) - 1)])
    whole = whole.take(np.argsort(whole.log_time, kind="stable"))
    with create_log(path, overwrite=True) as writer:
        ids = np.array([writer.add_channel(connection) for connection in connections])
        for begin in range(0, len(whole), 8000):
            writer.append(writer.encode(whole.take(slice(begin, begin + 8000)), ids))
        if writer.capabilities.metadata:
            if run.cell:
                writer.add_metadata("cell", {"cell": run.cell})
            account = {"received": 1, "written": 1, "missing": 0, "undelivered": run.undelivered, "overflowed": 0,
                       "unwritten": 0}
            writer.add_metadata("jaka_bag.drops", {"/jaka_driver/joint_position": json.dumps(account)})
    return path


def _shifted(session: Session, shift_s: float) -> Session:
    """Return the same session so much later."""
    later = copy.copy(session)
    later.stamp = session.stamp + shift_s
    later.log_time = {name: time + shift_s for name, time in session.log_time.items()}
    later.calls = [call._replace(start=call.start + shift_s) for call in session.calls]
    return later


def write_plant(folder: Path, cells: int = 3, days: int = 4, cycles: int = 2) -> List[Path]:
    """Write logs of a small plant, one a cell and day, below ``folder/CELL/``.

    In cell ``press_2`` joint 3 wears from day to day; ``press_1`` is slow on its second day; the emergency stop is
    pressed in ``press_3`` on every day; calls fail in ``press_1``; messages of ``press_3`` get lost.
    """
    paths = []
    for cell in range(1, cells + 1):
        name = "press_%d" % cell
        (folder / name).mkdir(parents=True, exist_ok=True)
        for day in range(days):
            run = Run(
                name, day * DAY_S + 60.0 * cell, cycles, 1.5 if (cell, day) == (1, 1) else 1.0,
                wear={3: 1.0 + 0.8 * day} if cell == 2 else {}, stops=(2.0,) if cell == 3 else (),
                failed=[("/plc", "out of range")] * day if cell == 1 else (), undelivered=5 * day if cell == 3 else 0,
                seed=10 * cell + day)
            paths.append(write_run(folder / name / ("day_%d.mcap" % day), run))
    return paths
