"""The conditions under which the calls of a log mean the same again: what differs forbids a replay.

The same bytes move an arm elsewhere on another model, with another tool, or by another interface. Logs and drivers tell
that on ``/diagnostics``; beside it, the same joints must put the tool at the same pose.
"""
import math
import re
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_bag.compare.runs.run import Run
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.driver_interface import DIAGNOSTICS_TYPE, INPUT_TOPICS
from jaka_bag.messages.batch import Array
from jaka_bag.messages.selection import Selection
from jaka_bag.messages.values import ValueReaders
from jaka_bag.paths import PathLike
from jaka_bag.units import NS_PER_S

from .driver_inputs import Input, SentMessage
from .uncaused_motions import MOVING_SERVICES

TOLD = {"model": ("versions", "model"), "interface": ("versions", "interface"), "tool": ("controller state", "tool"),
        "user-frame": ("controller state", "user frame"), "override": ("controller state", "speed override"),
        "payload": ("controller state", "payload"), "collision-level": ("controller state", "collision level")}
"""The conditions that ``/diagnostics`` tells of: status and key of each."""
KEYS = (*TOLD, "pose", "clock", "motion", "start")
"""All conditions, as ``--anyway`` names them."""
_SAME_NUMBER = {"override": 0.005, "payload": 1e-4}
"""Amounts, by condition, by which its numbers may differ: of the override, and of kg and m."""
_NUMBER = re.compile(r"-?\d[\d.]*(?:e[-+]?\d+)?")
_TOLD_AGAIN_NS = 10 * NS_PER_S
"""Time behind the first call after which a log tells of no further conditions: a driver tells all once a second."""
_SAME_PLACE_M = 0.002
"""Distance, m, of two tools at the same joints that count as the same: noise of an arm at rest, and rounding."""
_SAME_TURN_RAD = 0.005
"""Angle, rad, of two tools at the same joints that count as the same."""
_REACH_M = 2.0
"""Longest arm with a tool, m: by so much, times the joints' difference, the tools may be apart."""
_MILLIMETRES = 10.0
"""Coordinate above which a pose is in mm and degrees, as ``interface:=vendor`` has it: no arm reaches 10 m, and none
has its tool within 10 mm of its base."""
_JOINTS = "/joint_position"
_OF_THE_ARM = ("joint_path_command", "joint_trajectory_action")
"""Beginnings of the input topics that stand in an arm's namespace; the others are a node's there."""
_LONGEST_GAP_S = 10.0
"""Longest silence, s, of a steady topic: a longer one is a clock that was set, or no recording."""
_STEADY_S = 1.0
"""Usual step, s, below which a topic is steady."""
Conditions = Mapping[str, str]


class Difference(NamedTuple):
    """A condition that is another one now.

    Attributes:
        key: One of ``KEYS``.
        text: What it was, and what it is.
    """

    key: str
    text: str


class ToolPlace(NamedTuple):
    """A tool and the joints that put it there.

    Attributes:
        joints: Rad, shape (n,).
        pose: Shape (6,); m and a rotation vector, or mm and rpy in degrees (``interface:=vendor``).
        frames: Names of the frames that it is in.
    """

    joints: Sequence[float]
    pose: Sequence[float]
    frames: Tuple[str, ...]


def conditions_in(statuses: Iterable[Tuple[str, Mapping[str, str]]], node: str) -> Dict[str, str]:
    """Return the conditions that a driver's statuses tell of.

    Args:
        statuses: Name and values of each status of a DiagnosticArray.
        node: Global name of the driver's node.
    """
    values = dict(statuses)
    name = node.lstrip("/")
    found = {key: values.get("%s: %s" % (name, status), {}).get(entry, "") for key, (status, entry) in TOLD.items()}
    return {key: text for key, text in found.items() if text not in ("", "None", "unknown")}


def conditions_of_log(path: PathLike, node: str, until_ns: int) -> Dict[str, str]:
    """Return the conditions that a log tells of: the last ones up to a time, ns; else the first ones behind it.

    Raises:
        BagError: It cannot be read.
    """
    found: Dict[str, str] = {}
    readers = ValueReaders()
    with open_log(path) as log:
        for message in messages_of(log, Selection(types=(DIAGNOSTICS_TYPE,))):
            statuses = readers[message.connection].read(message.data)["status"]
            told = conditions_in([(status["name"], {pair["key"]: pair["value"] for pair in status["values"]})
                                  for status in statuses], node)
            if message.log_time <= until_ns:
                found.update(told)
            else:
                found = {**told, **found}
            behind = message.log_time - until_ns
            if behind > 0 and len(found) == len(TOLD) or found and behind > _TOLD_AGAIN_NS:
                break
    return found


def numbers_in(text: str) -> List[float]:
    """Return the numbers of a condition: of ``1.2 kg at 0, 0, 0.05 m`` mass and centre."""
    return [float(number) for number in _NUMBER.findall(text)]


def differences(before: Conditions, now: Conditions) -> List[Difference]:
    """Compare conditions that both tell of."""
    return [Difference(key, "the %s was %s, and is %s" % (key.replace("-", " "), before[key], now[key]))
            for key in TOLD if key in before and key in now and not _is_same(key, before[key], now[key])]


def untold(before: Conditions, now: Conditions, has_pose: bool = True) -> List[str]:
    """Return the conditions that cannot be compared, in words; the tool's pose too where the log lacks it."""
    return [key.replace("-", " ") for key in TOLD if key not in before or key not in now] + (
        [] if has_pose else ["tool pose"])


def pose_difference(before: ToolPlace, now: ToolPlace) -> List[Difference]:
    """Compare where the same joints put the tool: another model, tool, frame or interface puts it elsewhere."""
    unknown = [frame for frame in now.frames if before.frames and frame not in before.frames]
    if unknown:
        return [Difference("pose", "the tool's pose is in the frame %s, and was in %s" % (
            unknown[0], ", ".join(before.frames)))]
    if _is_in_millimetres(now.pose) is not _is_in_millimetres(before.pose):
        units = ("mm and degrees", "m and rad")
        return [Difference("interface", "the tool's pose is in %s, and was in %s" % (
            units if _is_in_millimetres(now.pose) else units[::-1]))]
    (place, turn), (old_place, old_turn) = _in_metres(now.pose), _in_metres(before.pose)
    joints = float(np.max(np.abs(np.subtract(before.joints, now.joints))))
    distance = float(np.linalg.norm(place - old_place))
    angle = math.acos(min(1.0, max(-1.0, (float(np.trace(turn.T @ old_turn)) - 1.0) / 2.0)))
    if distance <= _SAME_PLACE_M + _REACH_M * joints and angle <= _SAME_TURN_RAD + len(before.joints) * joints:
        return []
    return [Difference("pose", "where the log began, the tool is %.1f mm and %.1f deg from where it was at the same "
                       "joints: another model, tool, frame or interface" % (1e3 * distance, math.degrees(angle)))]


def unchecked_starts(run: Run, inputs: Sequence[Input]) -> List[Difference]:
    """Return the arms that are to move though the log does not tell where they stood: nothing of them is checked.

    Args:
        run: The log.
        inputs: The calls and messages that are made again.
    """
    nodes = {topic[:-len(_JOINTS)] for topic, track in run.joints.items()
             if topic.endswith(_JOINTS) and track.facts.finite_count}
    arms = {node.rpartition("/")[0] for node in nodes}
    missing = {call.topic.rpartition("/")[0] for call in inputs if not isinstance(call, SentMessage)
               and call.short_name in (*MOVING_SERVICES, "drag_mode")} - nodes
    missing |= {arm or "/" for arm in {_arm_of_input(one.service) for one in inputs if isinstance(one, SentMessage)
                                       and not one.service.endswith("/cancel")} - arms}
    return [Difference("start", "the log does not tell where %s stood: it has no %s of it with numbers, and whether "
                       "the arm stands there now cannot be seen" % (name, _JOINTS[1:])) for name in sorted(missing)]


def clock_trouble(run: Run) -> List[Difference]:
    """Return where the log's clock was set, or nothing was recorded, so that its calls have no times to be made at.

    Publishers number their messages: numbers that go back while others of the same publisher have been seen tell of a
    clock that was set back; neighbours that lie far apart, of one that was set forward, or of a silence.
    """
    for topic in sorted(run.streams):
        if topic.rsplit("/", 1)[-1] not in ("joint_position", "service_calls"):
            continue
        found = [run.streams[topic].between(begin, end) for begin, end in run.windows]
        parts = [part for part in found if part.sequence is not None and len(part.log_time)]
        if not parts:
            continue
        number = np.concatenate([part.sequence for part in parts if part.sequence is not None])
        time = np.concatenate([part.log_time for part in parts])
        at = _set_back(number)
        if at is not None:
            return [Difference("clock", "%.3f s after its begin the log goes back: its clock was set, and %s does not "
                               "tell in which order things happened" % (time[at], topic))]
        steps = np.diff(time)
        if len(steps) and np.median(steps) < _STEADY_S:
            for gap in np.flatnonzero((steps > _LONGEST_GAP_S) & (np.diff(number) == 1))[:1].tolist():
                return [Difference("clock", "%.3f s after its begin the log is silent for %.1f s: its clock was set "
                                   "forward, or nothing was recorded" % (time[gap], steps[gap]))]
    return []


def log_begins_ns(run: Run) -> int:
    """Return the time up to which the conditions before the first call are told, ns since the epoch."""
    return run.start_ns + int(min([call.start for call in run.calls], default=0.0) * NS_PER_S)


def _arm_of_input(topic: str) -> str:
    """Return the namespace of the arm that an input topic belongs to."""
    name = max([name for name in INPUT_TOPICS if topic.endswith("/" + name)], key=len, default="")
    place = topic[:-len(name) - 1]
    return place if name.startswith(_OF_THE_ARM) else place.rpartition("/")[0]


def _is_same(key: str, before: str, now: str) -> bool:
    if key not in _SAME_NUMBER or not numbers_in(before):
        return before == now
    ours, theirs = numbers_in(before), numbers_in(now)
    return len(ours) == len(theirs) and all(abs(a - b) <= _SAME_NUMBER[key] for a, b in zip(ours, theirs))


def _is_in_millimetres(pose: Sequence[float]) -> bool:
    return max([abs(value) for value in pose[:3]]) > _MILLIMETRES


def _in_metres(pose: Sequence[float]) -> Tuple[Array, Array]:
    """Return position, m, and rotation matrix of a pose of either interface."""
    position, angular = np.array(pose[:3], float), np.array(pose[3:], float)
    if _is_in_millimetres(pose):
        roll, pitch, yaw = np.radians(angular)
        return position / 1e3, _turn([0.0, 0.0, yaw]) @ _turn([0.0, pitch, 0.0]) @ _turn([roll, 0.0, 0.0])
    return position, _turn(angular.tolist())


def _turn(vector: Sequence[float]) -> Array:
    """Return the matrix of a rotation vector, rad."""
    x, y, z = vector
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-12:
        angle = 1.0  # the terms below are then right to the first order
    turn: Array = (np.eye(3) + math.sin(angle) / angle * cross
                   + (1.0 - math.cos(angle)) / angle ** 2 * (cross @ cross))
    return turn


def _set_back(number: Array) -> Optional[int]:
    """Return where numbers, by log time, go back though they belong together; None where a publisher began anew."""
    falls = np.flatnonzero(np.diff(number) < 0).tolist()
    for fall in falls:
        seen = number[:fall + 1]
        end = next((later for later in falls if later > fall), len(number) - 1)
        first, last = number[fall + 1], number[end]
        if first not in seen and (first - 1 in seen or last + 1 == seen.min()):
            return int(fall)
    return None
