"""Paths ready to be run: geometry, speed and acceleration limits along it, joints at each place.

The parameter of a route grows from 0 to ``length``: rad of the joint with the longest way for joint motion,
metre-equivalents (see ``legs``) for Cartesian motion.
"""
import copy
import itertools
import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Transform, compose
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.frames import ArmFrames, nearest_joints
from jaka_ros_driver.simulation.arm.legs import Corner, Leg, LineLeg, corner_half
from jaka_ros_driver.simulation.arm.path_scan import PathScan, PathStretch, merged
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S, speed_for_way
from jaka_ros_driver.state import Vector

_PIECE_WAY = 0.03  # m; length of a stretch of a leg in the first scan
_PIECE_ANGLE = 0.2  # rad; the same for its rotation
_CORNER_PIECES = 4
"""Stretches of a rounded corner in its first scan, which splits those that need it."""
_LOOK_AHEAD = 1.5  # jerk times; braking for a slower stretch begins so early that it ends before that stretch


class Route:
    """A path with its limits.

    Attributes:
        length: Of the parameter.
        start_joints: rad (6,).
        end_joints: Joints at the end of the whole path, rad (6,).
        break_event: The event to report at ``length`` where the path ends early; None otherwise.
    """

    length: float
    start_joints: Vector
    end_joints: Vector
    break_event: Optional[PlantEvent] = None

    def __init__(self) -> None:
        self._stretches: List[PathStretch] = []
        self._begins: List[float] = []
        self._entry_speeds: List[float] = []
        self._entry_jerk_time = -1.0
        self._index = 0

    def joints_at(self, way: float, reference: Sequence[float]) -> Optional[Vector]:
        """Return the joints at this parameter nearest to the reference, rad (6,).

        None where inverse kinematics has no solution.
        """
        raise NotImplementedError

    def stopping_acceleration(self, way: float, speed: float, jerk_time: float) -> float:
        """Return the strongest deceleration that is allowed at this place.

        It also holds where the arm gets before it can change it.
        """
        ahead = _reaction_way(speed, jerk_time)
        return min((stretch.braking for begin, stretch in zip(self._begins, self._stretches)
                    if begin <= way + ahead and begin + stretch.way >= way), default=math.inf)

    def line_id_at(self, way: float) -> int:
        """Return the ``executing_line_id`` of the move to which this place belongs."""
        raise NotImplementedError

    def moves_left(self, way: float) -> int:
        """Return the number of moves not yet completed at this place."""
        raise NotImplementedError

    def limits(self, way: float, speed: float, jerk_time: float) -> Tuple[float, float]:
        """Return the highest speed and acceleration at this place.

        With them the arm can still slow down for what lies ahead.
        """
        if len(self._stretches) == 1:
            return self._stretches[0].speed, self._stretches[0].acceleration
        if jerk_time != self._entry_jerk_time:
            self._plan_entries(jerk_time)
        while self._index + 1 < len(self._begins) and self._begins[self._index + 1] <= way:
            self._index += 1
        n = self._index
        allowed, acceleration = self._allowed(n, way, jerk_time), self._stretches[n].acceleration
        ahead = way + _reaction_way(speed, jerk_time)
        while n + 1 < len(self._begins) and self._begins[n + 1] <= ahead:
            n += 1
            acceleration = min(acceleration, self._stretches[n].acceleration)
        return min(allowed, self._allowed(n, ahead, jerk_time)), acceleration

    def _allowed(self, n: int, way: float, jerk_time: float) -> float:
        stretch = self._stretches[n]
        if n + 1 == len(self._stretches):
            return stretch.speed
        left = max(0.0, self._begins[n + 1] - way)
        return min(stretch.speed, speed_for_way(left, self._entry_speeds[n + 1], stretch.acceleration, jerk_time))

    def _plan_entries(self, jerk_time: float) -> None:
        """Compute, from the last stretch to the first, how fast each may be entered."""
        entry = 0.0
        speeds: List[float] = []
        for stretch in reversed(self._stretches):
            entry = min(stretch.speed, speed_for_way(stretch.way, entry, stretch.acceleration, jerk_time))
            speeds.append(entry)
        self._entry_speeds = speeds[::-1]
        self._entry_jerk_time = jerk_time

    def _set_stretches(self, stretches: Sequence[PathStretch]) -> None:
        self._stretches = merged(stretches)
        ends = list(itertools.accumulate(stretch.way for stretch in self._stretches))
        self._begins = [0.0, *ends[:-1]]
        self._entry_jerk_time = -1.0
        self._index = 0


class JointRoute(Route):
    """A straight line in joint space, of one move or several: all joints begin and end together."""

    def __init__(self, model: ArmModel, start: Vector, end: Vector, speed: float, acceleration: float,
                 line_id: int = 0, may_pass_end: bool = False) -> None:
        """Set up the route of one move.

        speed, rad/s, and acceleration, rad/s2: of the joint with the longest way, at most what all joints can do.
        may_pass_end: ``joined`` may lengthen it.
        """
        super().__init__()
        self.start_joints, self.end_joints, self._may_pass_end = start, end, may_pass_end
        ways = [b - a for a, b in zip(start, end)]
        self.length = max(abs(way) for way in ways)
        self._rates = tuple(way / self.length for way in ways)
        top, strongest = math.inf, math.inf
        limits = zip(model.joint_max_speed, model.joint_max_acceleration)
        for rate, (joint_speed, joint_acceleration) in zip(self._rates, limits):
            if rate:
                top = min(top, joint_speed / abs(rate))
                strongest = min(strongest, joint_acceleration / abs(rate))
        self._set_stretches([PathStretch(self.length, min(speed, top), min(acceleration, strongest), strongest)])
        self._moves: Tuple[Tuple[float, int], ...] = ((self.length, line_id),)  # where each ends, and its line id

    def joined(self, following: "JointRoute", way: float) -> Optional["JointRoute"]:
        """Return this route and the following one as one, without a stop between them, while the arm is at ``way``.

        None where this one must end at rest, or the following one leads elsewhere or has other limits.
        """
        (mine,), (others,) = self._stretches, following._stretches
        is_alike = all(math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9) for a, b in zip(
            (*self._rates, *mine[1:]), (*following._rates, *others[1:])))
        if not self._may_pass_end or not is_alike:
            return None
        route = copy.copy(self)
        route.length, route.end_joints = self.length + following.length, following.end_joints
        route._may_pass_end = following._may_pass_end
        route._moves = (*(move for move in self._moves if move[0] > way),
                        *((self.length + end, line_id) for end, line_id in following._moves))
        route._set_stretches([mine._replace(way=route.length)])
        return route

    def joints_at(self, way: float, reference: Sequence[float]) -> Optional[Vector]:
        if way >= self.length:
            return self.end_joints
        return tuple([a + way * rate for a, rate in zip(self.start_joints, self._rates)])

    def line_id_at(self, way: float) -> int:
        return next((line_id for end, line_id in self._moves if way < end), self._moves[-1][1])

    def moves_left(self, way: float) -> int:
        return max(1, sum(way < end for end, _ in self._moves))


class _Piece(NamedTuple):
    """A leg on a route: the parameter of its start, and the rounded corner there."""

    begin: float
    leg: Leg
    corner: Optional[Corner]


class CartesianRoute(Route):
    """Lines and arcs of one tool; corners between lines are rounded within their tolerance."""

    def __init__(self, frames: ArmFrames, leg: Leg, start_joints: Vector) -> None:
        """Begin the route with one leg, of the tool that is active now and for the whole route."""
        super().__init__()
        self._frames, self._tool_t_flange = frames, frames.tool_t_flange
        self.start_joints = start_joints
        self._pieces: List[_Piece] = [_Piece(0.0, leg, None)]
        self._piece_index = 0
        scan = self._scan(leg, start_joints)
        self._take_end(scan)
        self._set_stretches(scan.stretches)

    def append(self, leg: Leg, way: float, speed: float, jerk_time: float) -> bool:
        """Add a leg after a rounded corner while the arm is at ``way`` with ``speed``.

        It returns False where that is not possible.
        """
        last = self._pieces[-1].leg
        if self._tool_t_flange != self._frames.tool_t_flange:
            return False
        half = corner_half(last, leg)
        entry = self.length - half
        if half <= 0.0 or way > entry or self.break_event is not None:
            return False
        if not isinstance(last, LineLeg) or not isinstance(leg, LineLeg):
            return False
        corner = Corner(last, leg, half)
        entry_joints = self._joints_of(corner.at(-half), self.end_joints)
        if entry_joints is None:
            return False
        limits = PathStretch(2.0 * half, corner.max_speed, 0.5 * min(last.max_acceleration, leg.max_acceleration),
                             min(last.max_braking, leg.max_braking))
        rounding = PathScan(self._frames, self._joints_of, lambda s: corner.at(s - half), entry_joints, limits,
                            half * (last.way / last.length + leg.way / leg.length),
                            half * (last.angle / last.length + leg.angle / leg.length), _CORNER_PIECES)
        scan = self._scan(leg, self.end_joints)
        if rounding.broken or (scan.broken and scan.broken.way <= half):
            return False
        bend = PathStretch(2.0 * half, min(s.speed for s in rounding.stretches),
                           min(s.acceleration for s in rounding.stretches), min(s.braking for s in rounding.stretches))
        braking = min(bend.acceleration, self.limits(way, speed, jerk_time)[1])
        if speed > 1.001 * speed_for_way(entry - way, bend.speed, braking, jerk_time):
            return False
        self._forget_before(way)
        behind = _cut(self._stretches, entry, 0.0)
        self._pieces.append(_Piece(self.length, leg, corner))
        self._take_end(scan)
        self._set_stretches(behind + [bend] + _cut(scan.stretches, math.inf, half))
        return True

    def _forget_before(self, way: float) -> None:
        """Drop legs that are completed, so that memory stays bounded over an endless chain of lines."""
        passed = self._piece_at(way) - 1
        if passed > 0:
            del self._pieces[:passed]
            self._piece_index = 0
            rest = _cut(self._stretches, math.inf, way)
            self._stretches = [rest[0]._replace(way=way), *rest]

    def _scan(self, leg: Leg, start_joints: Vector) -> PathScan:
        pieces = max(2, math.ceil(leg.way / _PIECE_WAY), math.ceil(leg.angle / _PIECE_ANGLE))
        limits = PathStretch(leg.length, leg.max_speed, leg.max_acceleration, leg.max_braking)
        return PathScan(self._frames, self._joints_of, leg.at, start_joints, limits, leg.way, leg.angle, pieces)

    def _take_end(self, scan: PathScan) -> None:
        last = self._pieces[-1]
        self.end_joints = scan.joints
        self.length = last.begin + last.leg.length
        if scan.broken is not None:
            self.length = last.begin + scan.broken.way
            self.break_event = scan.broken.cause

    def _joints_of(self, base_t_tool: Transform, reference: Sequence[float]) -> Optional[Vector]:
        return nearest_joints(self._frames.model, compose(base_t_tool, self._tool_t_flange), reference)

    def tool_at(self, way: float) -> Transform:
        """Return ``base_t_tool`` at this parameter."""
        n = self._piece_at(way)
        begin, leg, corner = self._pieces[n]
        if corner is not None and way - begin < corner.half:
            return corner.at(way - begin)
        if n + 1 < len(self._pieces):
            next_begin, _, next_corner = self._pieces[n + 1]
            if next_corner is not None and next_begin - way < next_corner.half:
                return next_corner.at(way - next_begin)
        return leg.at(way - begin)

    def _piece_at(self, way: float) -> int:
        n = self._piece_index
        while n + 1 < len(self._pieces) and self._pieces[n + 1].begin <= way:
            n += 1
        self._piece_index = n
        return n

    def joints_at(self, way: float, reference: Sequence[float]) -> Optional[Vector]:
        return self._joints_of(self.tool_at(way), reference)

    def line_id_at(self, way: float) -> int:
        return self._pieces[self._piece_at(way)].leg.line_id

    def moves_left(self, way: float) -> int:
        return len(self._pieces) - self._piece_at(way)


def _reaction_way(speed: float, jerk_time: float) -> float:
    return speed * (_LOOK_AHEAD * jerk_time + CYCLE_TIME_S)


def _cut(stretches: Sequence[PathStretch], end: float, begin: float) -> List[PathStretch]:
    """Return the stretches between the parameters ``begin`` and ``end``."""
    result: List[PathStretch] = []
    at = 0.0
    for stretch in stretches:
        low, high = max(at, begin), min(at + stretch.way, end)
        if high > low:
            result.append(stretch._replace(way=high - low))
        at += stretch.way
    return result
