"""A list of motions: joint motions, lines and arcs through stored points, waits and outputs; planned, drawn, then run.

Points are joints. A line or an arc goes to the pose that the active tool has there, in the active user frame: it ends
where the point was taken, whatever tool that was.
"""
import math
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ..teach.rotations import Array, FramePose, rotation_matrix, rotation_vector
from .point_plan import SHOWN, WrongPlan

JOINT, LINE, ARC = 0, 1, 2
MOST_STEPS = 200
"""Most steps of a list: those of a path that the driver takes (``MAX_SEGMENTS``)."""
_JOINT_ACCELERATION, _ACCELERATION = 2.0, 0.5
"""The accelerations of motions, rad/s2 and m/s2: those of a page's moves."""
_SAMPLES = 8
"""Places of a joint motion that a page draws: between joints the arm moves evenly."""
_SAME_RAD = 0.02
"""Largest difference, rad, of a joint in the same posture: another one differs by much more."""
_LEAST_S = 0.1
"""Shortest motion, s, in the drawing: one without a way must be seen."""
_STRAIGHT_M = 1e-4
"""Share by which an arc's points must be off a line: with less its radius is noise."""

JointAngles = Sequence[float]
Forward = Callable[[JointAngles], FramePose]
Inverse = Callable[[FramePose, JointAngles], JointAngles]


class ListMotion(NamedTuple):
    """A motion of ``~move_path``.

    Attributes:
        kind: JOINT, LINE or ARC.
        joints: Target, rad, (6,).
        pose: FramePose of the active tool there, in the active user frame.
        via: Place of an arc between its ends; None for the others.
        speed: rad/s, or m/s.
        acceleration: rad/s2, or m/s2.
        blend: Distance from the target at which the tool may leave for the next one, m.
    """

    kind: int
    joints: JointAngles
    pose: FramePose
    via: Optional[FramePose]
    speed: float
    acceleration: float
    blend: float


class ListPart(NamedTuple):
    """A part of a list: motions that are one path, or a wait, or an output.

    Attributes:
        begin: Joints at which it begins, rad, (6,).
        pose: FramePose of the active tool there, in the active user frame.
        segments: Motions; empty for a wait and an output.
        wait: s.
        output: Arguments of set_output; None without one.
        step: Number of its first step, from 1 on.
    """

    begin: JointAngles
    pose: FramePose
    segments: Tuple[ListMotion, ...]
    wait: float
    output: Optional[Mapping[str, Any]]
    step: int


class ListPlan(NamedTuple):
    """A list as it will be run.

    Attributes:
        parts: Its parts, in their order.
        path: Joints along the way, rad, (n, 6).
        time: Of each of them, s from the start, as far as speeds tell.
        warnings: Warnings for the user.
    """

    parts: Sequence[ListPart]
    path: Sequence[JointAngles]
    time: Sequence[float]
    warnings: Sequence[str]

    def shown(self, name: str) -> Dict[str, Any]:
        """Return the plan for a page, with at most ``SHOWN`` joint vectors of its path."""
        every = range(0, len(self.path), max(1, math.ceil(len(self.path) / (SHOWN - 1))))
        chosen = sorted({*every, len(self.path) - 1})
        return {"plan": name, "duration": round(self.time[-1], 3), "start": list(self.path[0]),
                "end": list(self.path[-1]), "t": [round(self.time[n], 4) for n in chosen],
                "path": [[round(value, 5) for value in self.path[n]] for n in chosen], "warnings": list(self.warnings)}


class _Planner:
    """The way of a list as far as it is planned."""

    def __init__(self, begin: JointAngles, forward: Forward, inverse: Inverse) -> None:
        self.forward, self.inverse = forward, inverse
        self.pose = forward(begin)
        self.joints: JointAngles = list(begin)
        self.path: List[JointAngles] = [self.joints]
        self.time = [0.0]
        self.parts: List[ListPart] = []
        self.warnings: List[str] = []
        self._segments: List[ListMotion] = []
        self._begin: Tuple[JointAngles, FramePose, int] = (self.joints, self.pose, 1)

    def close(self, number: int) -> None:
        """End the path: what follows begins where the arm rests."""
        if self._segments:
            begin, pose, step = self._begin
            if self._segments[-1].blend > 0.0:
                self.warnings.append("step %d: its rounded corner is left out, because the arm rests there" % (
                    number - 1))
                self._segments[-1] = self._segments[-1]._replace(blend=0.0)
            self.parts.append(ListPart(begin, pose, tuple(self._segments), 0.0, None, step))
        self._segments = []
        self._begin = (self.joints, self.pose, number)

    def pause(self, number: int, wait: float, output: Optional[Mapping[str, Any]]) -> None:
        """Add a wait or an output."""
        self.close(number)
        self.parts.append(ListPart(self.joints, self.pose, (), wait, output, number))
        self._begin = (self.joints, self.pose, number + 1)
        self._add(self.joints, wait)

    def move(self, number: int, kind: int, joints: JointAngles, via: Optional[JointAngles], speed: float,
             blend: float) -> None:
        """Add a motion to joints."""
        pose = self.forward(joints)
        between = None if via is None else self.forward(via)
        if kind == JOINT:
            way = max(abs(a - b) for a, b in zip(self.joints, joints))
            for n in range(1, _SAMPLES + 1):
                self._add([a + (b - a) * n / _SAMPLES for a, b in zip(self.joints, joints)],
                          max(_LEAST_S, way / speed) / _SAMPLES)
        else:
            places, length = _places(self.pose, pose, between, number)
            near = self.joints
            for place in places:
                try:
                    near = self.inverse(place, near)
                except WrongPlan as error:
                    raise WrongPlan("step %d: the way there is out of reach: %s" % (number, error)) from None
                self._add(near, max(_LEAST_S, length / speed) / len(places))
            if max(abs(a - b) for a, b in zip(near, joints)) > _SAME_RAD:
                self.warnings.append("step %d: the arm arrives in another posture than that in which the point was "
                                     "taken" % number)
                joints = near
        self._segments.append(ListMotion(kind, joints, pose, between, speed,
                                      _JOINT_ACCELERATION if kind == JOINT else _ACCELERATION, blend))
        self.joints, self.pose = list(joints), pose

    def _add(self, joints: JointAngles, time: float) -> None:
        self.path.append(list(joints))
        self.time.append(self.time[-1] + time)


def plan_list(steps: Sequence[Mapping[str, Any]], points: Mapping[str, Mapping[str, Any]], begin: JointAngles,
              limits: Optional[Sequence[Mapping[str, Any]]], forward: Forward, inverse: Inverse) -> ListPlan:
    """Plan a list from where the arm is; raise WrongPlan with the number of the step.

    Args:
        steps: As a cell's data have them, checked.
        points: Points of the arm by name; ``q``, rad, (6,).
        begin: Joints, rad, (6,).
        limits: ``lower``, ``upper``, rad, of each joint, where they are known.
        forward: Returns the active tool's pose, in the active user frame, of joints.
        inverse: Returns joints of such a pose, near to others; raises WrongPlan where there are none.
    """
    planner = _Planner(begin, forward, inverse)
    for number, step in enumerate(steps, 1):
        kind = step["kind"]
        if kind == "wait":
            planner.pause(number, float(step["s"]), None)
        elif kind == "output":
            planner.pause(number, 0.0, {key: step[key] for key in ("signal", "bank", "index", "value")})
        else:
            target = _point(points, step["point"], number, limits)
            via = _point(points, step["via"], number, limits) if kind == "arc" else None
            planner.move(number, {"joint": JOINT, "line": LINE, "arc": ARC}[kind], target, via, float(step["speed"]),
                         float(step.get("blend") or 0.0))
    planner.close(len(steps) + 1)
    if not any(part.segments for part in planner.parts):
        raise WrongPlan("the list has no motion")
    return ListPlan(planner.parts, planner.path, planner.time, planner.warnings)


def _point(points: Mapping[str, Mapping[str, Any]], name: str, number: int,
           limits: Optional[Sequence[Mapping[str, Any]]]) -> JointAngles:
    if name not in points:
        raise WrongPlan("step %d: there is no point %s" % (number, name))
    joints: JointAngles = points[name]["q"]
    for joint, (limit, value) in enumerate(zip(limits or (), joints), 1):
        if not limit["lower"] <= value <= limit["upper"]:
            raise WrongPlan("step %d: joint %d of point %s is %.4f rad; it can go from %.4f to %.4f" % (
                number, joint, name, value, limit["lower"], limit["upper"]))
    return joints


def _places(begin: FramePose, end: FramePose, via: Optional[FramePose], number: int) -> Tuple[List[FramePose], float]:
    """Return poses along a line or an arc, without its begin, and its length, m."""
    shares = [n / _SAMPLES for n in range(1, _SAMPLES + 1)]
    a, b = np.asarray(begin.position), np.asarray(end.position)
    first = rotation_matrix(begin.rotation_vector)
    turn = np.asarray(rotation_vector(first.T @ rotation_matrix(end.rotation_vector)))
    if via is None:
        places, length = [a + share * (b - a) for share in shares], float(np.linalg.norm(b - a))
    else:
        places, length = _arc(a, np.asarray(via.position), b, shares, number)
    return [FramePose(place.tolist(), rotation_vector(first @ rotation_matrix((share * turn).tolist())))
            for share, place in zip(shares, places)], length


def _arc(a: Array, via: Array, b: Array, shares: Sequence[float], number: int) -> Tuple[List[Array], float]:
    u, v = via - a, b - a
    normal = np.cross(u, v)
    square = float(normal @ normal)
    if math.sqrt(square) < _STRAIGHT_M * max(float(np.linalg.norm(u)), float(np.linalg.norm(v)), _STRAIGHT_M):
        raise WrongPlan("step %d: begin, via and end of the arc are on one line, or at one place" % number)
    centre = a + (float(u @ u) * np.cross(v, normal) + float(v @ v) * np.cross(normal, u)) / (2.0 * square)
    x = a - centre
    radius = float(np.linalg.norm(x))
    y = np.cross(normal / math.sqrt(square), x)
    angle = math.atan2(float((b - centre) @ y), float((b - centre) @ x)) % (2.0 * math.pi)
    return [centre + math.cos(share * angle) * x + math.sin(share * angle) * y for share in shares], radius * angle
