"""Rules about paths of several segments: sent in order, each once, and reported truly."""
from typing import Any, Dict, Optional, Sequence

from driver_process import Call
from verdict import RuleBroken

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import PathInterrupted
from jaka_ros_driver.units import all_deg_to_rad, all_mm_to_m

PLANNED = {"joint_move": c.JointMove, "moveL": c.LinearMove, "movc": c.ArcMove}
_SAME = 1e-6
_CYCLE = 0.008
_NEAR_TOOL, _NEAR_JOINT = 0.0021, 0.0101
"""Distance to a corner that is passed, m and rad: the driver's own tolerances (0.002 m, 0.01 rad) and rounding."""
_LEVER = 0.1


def sent_for_path(name: str, request: Dict[str, Any], calls: Sequence[Call], last_stop: int,
                  now: float) -> Optional[Call]:
    """Return the path that asks for this motion next; None where none does."""
    for call in calls:
        if call.kind != "path" or call.next_segment >= len(call.command):
            continue
        if _asks(call.command[call.next_segment], name, request):
            if call.number < last_stop:
                raise RuleBroken("b", now, "a segment of %s is sent after a stop" % call.number)
            call.next_segment += 1
            call.was_sent = True
            return call
        if any(_asks(later, name, request) for later in call.command[call.next_segment:]):
            raise RuleBroken("q", now, "segment %d of path %d is left out" % (call.next_segment, call.number))
    return None


def passes(call: Call, plant: Any, unseen: float) -> None:
    """Note which corner of a path the arm has passed.

    ``unseen``: time since the driver saw the arm, s, within which it may have been at the corner for all it knows.
    """
    while call.passed < len(call.command) and _is_near(call.command[call.passed], plant, max(unseen, _CYCLE)):
        call.passed += 1


def told_truly(call: Call, now: float) -> None:
    """Judge the answer of a path against what the arm has done."""
    if call.error is None and call.was_sent and call.passed < len(call.command):
        raise RuleBroken("q", now, "path %d is completed, and the arm has not been at the end of segment %d" % (
            call.number, call.passed))
    if isinstance(call.error, PathInterrupted) and call.error.completed > call.passed:
        raise RuleBroken("q", now, "path %d is reported to have completed %d segments; it was %d" % (
            call.number, call.error.completed, call.passed))


def _asks(command: Any, name: str, request: Dict[str, Any]) -> bool:
    if PLANNED.get(name) is not type(command):
        return False
    if name == "joint_move":
        return _near(command.joint_position, all_deg_to_rad(request["jointPosition"]), _SAME)
    return _near(command.target.position, all_mm_to_m(request["cartPosition" if name == "moveL" else "pos_end"][:3]),
                 _SAME)


def _is_near(command: Any, plant: Any, unseen: float) -> bool:
    step = command.speed * unseen
    if isinstance(command, c.JointMove):
        return _near(command.joint_position, plant.joint_position, _NEAR_JOINT + step + command.tolerance / _LEVER)
    away = sum([(a - b) ** 2 for a, b in zip(plant.tcp_pose().position, command.target.position)]) ** 0.5
    return bool(away <= _NEAR_TOOL + step + command.tolerance)


def _near(a: Sequence[float], b: Sequence[float], tolerance: float) -> bool:
    return max([abs(p - q) for p, q in zip(a, b)]) <= tolerance
