"""The filters of a servo stream (docs/sdk-client.md section 5, ``filter_type`` 0 to 5).

The vendor gives names and parameters, no formulas: these are the simulation's own. All come to rest on the last target.

0  none          the interpolated target itself
1  joint LPF     first-order low-pass, each joint: cut-off ``lpf_cf`` Hz
2  joint NLF     each joint follows the target as fast as ``nlf_max_vr`` rad/s, ``nlf_max_ar`` rad/s2 and
                 ``nlf_max_jr`` rad/s3 allow (the last with ruckig only)
3  joint MMF     mean over the last ``mmf_max_buf`` cycles of position p, velocity v and acceleration a of the target;
                 y grows by mmf_kp (p - y) + mmf_kv v dt + mmf_ka a dt2 a cycle
4  Cartesian NLF as 2, for the tool: ``nlf_max_vp``, ``_ap``, ``_jp`` (m) along each axis of the base and
                 ``nlf_max_vr``, ``_ar``, ``_jr`` (rad) about each
5  foresight     as 3 with mmf_kv 1 and mmf_ka 0: the mean, with the mean speed fed forward
"""
import enum
import math
from collections import deque
from typing import Any, Deque, Dict, List, Sequence, Tuple

from jaka_ros_driver.kinematics.rotations import Transform
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames, rotation_between, turned
from jaka_ros_driver.simulation.arm.profiles import RUCKIG, ruckig_solves
from jaka_ros_driver.state import Vector

MAX_BUFFER = 250
"""Longest buffer of the foresight filters, cycles: 2 s. No source gives a limit; it bounds the delay of a stream."""


class ServoFilter(enum.IntEnum):
    """Filters of a servo stream; the numbers of the wire (docs/sdk-client.md section 5)."""

    NONE = 0
    JOINT_LOW_PASS = 1
    JOINT_LIMITS = 2
    JOINT_MEAN = 3
    CARTESIAN_LIMITS = 4
    FORESIGHT = 5


_LIMITS = ("nlf_max_vr", "nlf_max_ar", "nlf_max_jr")
PARAMETERS: Dict[ServoFilter, Tuple[str, ...]] = {
    ServoFilter.NONE: (),
    ServoFilter.JOINT_LOW_PASS: ("lpf_cf",),
    ServoFilter.JOINT_LIMITS: _LIMITS,
    ServoFilter.JOINT_MEAN: ("mmf_max_buf", "mmf_kp", "mmf_kv", "mmf_ka"),
    ServoFilter.CARTESIAN_LIMITS: _LIMITS + ("nlf_max_vp", "nlf_max_ap", "nlf_max_jp"),
    ServoFilter.FORESIGHT: ("mmf_max_buf", "mmf_kp"),
}
"""Names of the parameters on the wire: docs/controller-protocol.md section 5.6.6, docs/sdk-client.md section 8."""


def checked_parameters(kind: ServoFilter, parameters: Dict[str, float]) -> Dict[str, float]:
    """Return a copy of a filter's parameters; raise TargetRejected where one is missing, surplus or out of range."""
    names = PARAMETERS[kind]
    if set(parameters) != set(names):
        raise TargetRejected(events.BAD_SPEED, "filter %d takes %s" % (kind, ", ".join(names) or "no parameters"))
    for name, value in parameters.items():
        low, high = (0.0, math.inf) if name in ("mmf_kv", "mmf_ka") else (1e-9, math.inf)
        if name == "mmf_kp":
            high = 1.0
        elif name == "mmf_max_buf":
            low, high = 1.0, float(MAX_BUFFER)
        if not (math.isfinite(value) and low <= value <= high):
            raise TargetRejected(events.BAD_SPEED, "%s must be within %g to %g" % (name, low, high))
    return dict(parameters)


class Filter:
    """Filter 0: no filter. The others override ``step``."""

    def __init__(self, joints: Vector) -> None:
        """Set up the filter for an arm that stands at these joints, rad (6,)."""
        self.joints = joints

    def step(self, target: Vector, dt: float) -> Vector:
        """Run one cycle of ``dt`` s towards the interpolated target, rad (6,); return the joints to command, rad."""
        self.joints = target
        return target


class LowPass(Filter):
    """Filter 1: a first-order low-pass for each joint; cutoff in Hz."""

    def __init__(self, joints: Vector, cutoff: float) -> None:
        super().__init__(joints)
        self._cutoff = cutoff

    def step(self, target: Vector, dt: float) -> Vector:
        share = 1.0 - math.exp(-math.tau * self._cutoff * dt)
        self.joints = tuple(y + share * (x - y) for x, y in zip(target, self.joints))
        return self.joints


class JointLimits(Filter):
    """Filter 2: each joint follows the target within limits of speed, acceleration and jerk (rad/s, rad/s2, rad/s3)."""

    def __init__(self, joints: Vector, limits: Tuple[float, float, float]) -> None:
        super().__init__(joints)
        self._tracker = CoordinateTracker(joints, limits)

    def step(self, target: Vector, dt: float) -> Vector:
        self.joints = self._tracker.step(target, dt)
        return self.joints


class Mean(Filter):
    """Filters 3 and 5: the mean of the last targets, with speed and acceleration fed forward."""

    def __init__(self, joints: Vector, buffer: int, kp: float, kv: float, ka: float) -> None:
        super().__init__(joints)
        self._targets: Deque[Vector] = deque([joints] * (buffer + 1), maxlen=buffer + 1)
        self._size, self._kp, self._kv, self._ka = buffer, kp, kv, ka
        self._sums = [q * buffer for q in joints]

    def step(self, target: Vector, dt: float) -> Vector:
        targets, size = self._targets, self._size
        before, leaving, last = targets[0], targets[1], targets[-1]
        targets.append(target)
        result: List[float] = []
        for n, (y, x) in enumerate(zip(self.joints, target)):
            self._sums[n] += x - leaving[n]
            # A sum of successive differences depends only on the first and the last value of the window.
            travel = x - leaving[n]
            bend = (x - last[n]) - (leaving[n] - before[n])
            result.append(y + self._kp * (self._sums[n] / size - y) + self._kv * travel / size + self._ka * bend / size)
        self.joints = tuple(result)
        return self.joints


class CartesianLimits(Filter):
    """Filter 4: the tool follows the target within limits along (m) and about (rad) the axes of the base."""

    def __init__(self, joints: Vector, frames: ArmFrames, translation: Tuple[float, float, float],
                 rotation: Tuple[float, float, float]) -> None:
        super().__init__(joints)
        self._frames = frames
        self._pose: Transform = frames.tool_at(joints)
        self._shift = CoordinateTracker(self._pose[9:], translation)
        self._turn = CoordinateTracker((0.0, 0.0, 0.0), rotation)

    def step(self, target: Vector, dt: float) -> Vector:
        goal = self._frames.tool_at(target)
        position = self._shift.step(goal[9:], dt)
        turn = self._turn.step_from_zero(rotation_between(self._pose, goal), dt)
        self._pose = turned(self._pose, turn, position)
        joints = self._frames.nearest_joints(self._pose, self.joints)
        if joints is not None:
            self.joints = joints
        return self.joints


class CoordinateTracker:
    """Several coordinates, each of which follows its target within the same limits of speed, acceleration and jerk."""

    def __init__(self, positions: Sequence[float], limits: Tuple[float, float, float]) -> None:
        """Set up the coordinates at rest.

        limits: speed, acceleration, jerk in the unit of the coordinates per s, s2, s3.
        """
        self._position = list(positions)
        self._velocity = [0.0] * len(self._position)
        self._acceleration = [0.0] * len(self._position)
        self._speed_limit, self._acceleration_limit, jerk = limits
        self._plan: Any = None
        if RUCKIG is not None:
            size = len(self._position)
            self._solver, self._trajectory = RUCKIG.Ruckig(size), RUCKIG.Trajectory(size)
            self._plan = RUCKIG.InputParameter(size)
            self._plan.max_velocity = [self._speed_limit] * size
            self._plan.max_acceleration = [self._acceleration_limit] * size
            self._plan.max_jerk = [jerk] * size
            self._plan.synchronization = RUCKIG.Synchronization.No

    def step_from_zero(self, target: Sequence[float], dt: float) -> Vector:
        """Step towards a target relative to the present coordinates, as ``step`` does; return the change."""
        self._position = [0.0] * len(self._position)
        return self.step(target, dt)

    def step(self, target: Sequence[float], dt: float) -> Vector:
        """Run one cycle of ``dt`` s towards the target; return the coordinates."""
        if self._plan is None or not self._step_jerk_limited(target, dt):
            for n, goal in enumerate(target):
                self._step_trapezoid(n, goal, dt)
        return tuple(self._position)

    def _step_jerk_limited(self, target: Sequence[float], dt: float) -> bool:
        plan = self._plan
        plan.current_position, plan.current_velocity = self._position, self._velocity
        plan.current_acceleration, plan.target_position = self._acceleration, list(target)
        if not ruckig_solves(self._solver, plan, self._trajectory):
            return False
        time = min(dt, self._trajectory.duration)
        position, velocity, acceleration = self._trajectory.at_time(time)
        self._position, self._velocity, self._acceleration = list(position), list(velocity), list(acceleration)
        return True

    def _step_trapezoid(self, n: int, goal: float, dt: float) -> None:
        gap, velocity, limit = goal - self._position[n], self._velocity[n], self._acceleration_limit * dt
        root = limit * limit + 8.0 * self._acceleration_limit * abs(gap)
        stoppable = max(0.0, 0.5 * (math.sqrt(root) - limit))
        wanted = math.copysign(min(self._speed_limit, stoppable, abs(gap) / dt), gap)
        after = min(max(wanted, velocity - limit), velocity + limit)
        self._position[n] += after * dt
        self._velocity[n] = after
        if abs(goal - self._position[n]) < 1e-12 and abs(after) <= limit:
            self._velocity[n] = 0.0


def make_filter(kind: ServoFilter, parameters: Dict[str, float], frames: ArmFrames, joints: Vector) -> Filter:
    """Make the filter, at rest at these joints, rad (6,), with parameters from ``checked_parameters``."""
    p = parameters
    if kind == ServoFilter.JOINT_LOW_PASS:
        return LowPass(joints, p["lpf_cf"])
    if kind == ServoFilter.JOINT_LIMITS:
        return JointLimits(joints, (p["nlf_max_vr"], p["nlf_max_ar"], p["nlf_max_jr"]))
    if kind in (ServoFilter.JOINT_MEAN, ServoFilter.FORESIGHT):
        return Mean(joints, int(p["mmf_max_buf"]), p["mmf_kp"], p.get("mmf_kv", 1.0), p.get("mmf_ka", 0.0))
    if kind == ServoFilter.CARTESIAN_LIMITS:
        return CartesianLimits(joints, frames, (p["nlf_max_vp"], p["nlf_max_ap"], p["nlf_max_jp"]),
                               (p["nlf_max_vr"], p["nlf_max_ar"], p["nlf_max_jr"]))
    return Filter(joints)
