"""The way from the arm's position onto a trajectory: the path that is audited and followed."""
from dataclasses import replace
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    accepted_limits,
    led_text,
    stream_limits,
)
from jaka_ros_driver.trajectory.audit import audit, audit_changes
from jaka_ros_driver.trajectory.corners import rounded_lines
from jaka_ros_driver.trajectory.path import Approach, Array, JointState, Path, quintic
from jaka_ros_driver.trajectory.points import (
    REST_VELOCITY,
    InvalidTrajectory,
    JointTrajectory,
    TrajectoryOfThePast,
    TrajectoryPoint,
    check_points,
)
from jaka_ros_driver.trajectory.splines import spline, with_brake

_APPROACH_TIMES_S = (0.1, 0.2, 0.4, 0.8, 1.6)
"""Durations, s, of the way onto a path, tried in order: the shortest that the joints can follow is taken."""
_SAME = 1e-9
"""Difference of times, s, positions, rad, and speeds, rad/s, that is rounding of floats."""
_STOP = 1.5
"""Largest deceleration of a joint that ``_with_approach`` brings to rest, as a share of speed by time."""
_WIRE_ROUNDING = 1e-6
"""Excess, rad, over a limit that is allowed, because points come as float32 from some clients."""
MAX_DELAY_S = 60.0
"""Longest wait, s, for a trajectory that starts later; a wrong clock would ask for a longer one."""


class PathStart(NamedTuple):
    """The state in which a path begins: at rest, or in motion on another path that is joined there."""

    state: JointState
    is_at_rest: bool


class BuildOptions(NamedTuple):
    """The trajectories that are taken beside those that fit exactly.

    Attributes:
        start_tolerance: Largest distance, rad, of an arm at rest from the begin of the trajectory.
        late: An arm that rests at the first point of a trajectory that was to start up to this time ago, s, follows the
            whole of it, that much later.
        slows: A path that passes a limit by less than ``rates.LARGEST_OVERSHOOT`` is run through at a lower rate there;
            else it is refused.
    """

    start_tolerance: float
    late: float = 0.0
    slows: bool = False


def build_path(start: PathStart, trajectory: JointTrajectory, elapsed: float, model: ArmModel,
               options: BuildOptions) -> Path:
    """Return a path from ``start`` through the points, within the limits of the model at every moment.

    A joint whose points come nearer to its limits than streams go is led to where they end (``Path.led``).

    Points that were to be reached before now are left out. Where the first point is due now or before, the path leads
    onto the polynomials through the points, and else to the first point.

    Args:
        start: The state of the arm now, or when it joins.
        trajectory: The points.
        elapsed: Time since the trajectory was to start, s; negative where it starts later.
        model: Its limits.
        options: What is taken.

    Raises:
        InvalidTrajectory: The message names point or joint, time, value, and what is valid.
        TrajectoryOfThePast: No point is left.
    """
    check_points(trajectory)
    trajectory = trajectory.holding(start.state.position)
    if elapsed < -MAX_DELAY_S:
        raise InvalidTrajectory("the trajectory is to start in %.3f s; at most %g s are waited for" % (
            -elapsed, MAX_DELAY_S))
    with np.errstate(all="ignore"):
        trajectory, led = _led_inside(trajectory, start, model)
        path = _build(start, trajectory, elapsed, model, options)
    path.led = led
    return path


def _build(start: PathStart, trajectory: JointTrajectory, elapsed: float, model: ArmModel,
           options: BuildOptions) -> Path:
    since = max(elapsed, 0.0)
    begin = elapsed if start.is_at_rest else since
    left = [point for point in trajectory.points if point.time > since + _SAME]
    if not left:
        return _path_of_no_way(start, trajectory, elapsed, options.start_tolerance)
    if trajectory.points[0].time > since + _SAME:
        standing = _with_still(start, trajectory.held)
        first = TrajectoryPoint(since, *standing.state)
        path = Path(*_ended(*_through([first, *left], standing), left[-1]), begin=begin)
        fastest = max([abs(start.state.velocity[joint]) for joint in trajectory.held], default=0.0)
        if fastest > 0.0:
            path = _with_approach(path, start, since, _STOP * fastest / JOINT_ACCELERATION_CEILING, trajectory.held)
        audit(path, model, options.slows)
        change = np.array([path.at(since).velocity]) - np.array([start.state.velocity])
        audit_changes(np.array([since]), change)
        return path
    at_rest = PathStart(JointState(trajectory.points[0].position, (0.0,) * JOINT_COUNT, (0.0,) * JOINT_COUNT), True)
    breaks, coefficients = _ended(*_through(trajectory.points, at_rest), left[-1])
    path = Path(breaks, coefficients, begin=begin)
    if start.is_at_rest:
        late = _late_begin(start, trajectory, path, since, options)
        if late is not None:
            since = late
            path = Path(breaks, coefficients, begin=since)
    return _led_onto(path, start, since, model, options.slows, trajectory.held)


# ---- inside ----

def _led_inside(trajectory: JointTrajectory, start: PathStart, model: ArmModel) -> Tuple[JointTrajectory, str]:
    """Return the trajectory with the way of each joint narrowed to ``stream_limits``, and in words where that is.

    The whole way of such a joint is narrowed alike, so that it becomes slower everywhere and no corner comes into it. A
    trajectory that passes the limits themselves is left as it is, for the audit.
    """
    positions = np.array([point.position for point in trajectory.points])
    lowest, highest = positions.min(axis=0), positions.max(axis=0)
    low, high = np.array(stream_limits(model, start.state.position)).T
    is_inside = (lowest >= low) & (highest <= high)
    if is_inside.all():
        return trajectory, ""
    least, most = np.array(accepted_limits(model, start.state.position)).T
    if (lowest < least - _WIRE_ROUNDING).any() or (highest > most + _WIRE_ROUNDING).any():
        return trajectory, ""
    new_lowest, new_highest = np.clip(lowest, low, high), np.clip(highest, low, high)
    shares = np.where(is_inside, 1.0, (new_highest - new_lowest) / np.maximum(highest - lowest, _SAME))
    moved = np.where(is_inside, positions, new_lowest + shares * (positions - lowest))

    def slower(values: Optional[Sequence[float]]) -> Optional[Tuple[float, ...]]:
        return None if values is None else tuple((np.array(values) * shares).tolist())

    points = tuple([TrajectoryPoint(point.time, tuple(position), slower(point.velocity), slower(point.acceleration))
                    for point, position in zip(trajectory.points, moved.tolist())])
    is_upper = highest > high
    return replace(trajectory, points=points), led_text(np.where(is_upper, highest, lowest).tolist(),
                                                        np.where(is_upper, new_highest, new_lowest).tolist())


def _through(points: Sequence[TrajectoryPoint], start: PathStart) -> Tuple[Array, Array]:
    """Return the polynomials through these points, of which the first may be the arm's own state."""
    if all(point.velocity is None for point in points[1:]):
        return rounded_lines(points, start.state.velocity)
    return spline(points)


def _ended(breaks: Array, coefficients: Array, last: TrajectoryPoint) -> Tuple[Array, Array]:
    """Return the path with a braking segment appended where the last point has a velocity."""
    if last.velocity is None or max(map(abs, last.velocity)) <= REST_VELOCITY:
        return breaks, coefficients
    return with_brake(breaks, coefficients, last.velocity, JOINT_ACCELERATION_CEILING)


def _with_still(start: PathStart, joints: Sequence[int]) -> PathStart:
    """Return the start with these joints at rest."""
    position, *rates = start.state
    return start._replace(state=JointState(position, *[tuple([
        0.0 if joint in joints else rate for joint, rate in enumerate(each)]) for each in rates]))


def _path_of_no_way(start: PathStart, trajectory: JointTrajectory, elapsed: float, start_tolerance: float) -> Path:
    """Return the path of a plan whose only point is due at its start: the arm is there already, and stays."""
    last = trajectory.points[-1]
    if elapsed > last.time or not start.is_at_rest:
        raise TrajectoryOfThePast("every point lies in the past: the last one was due %.3f s ago" % (
            elapsed - last.time))
    _check_start(start.state.position, last.position, start_tolerance)
    path = Path.resting(start.state.position, last.time)
    path.begin = elapsed
    return path


def _late_begin(start: PathStart, trajectory: JointTrajectory, path: Path, since: float,
                options: BuildOptions) -> Optional[float]:
    """Return the time of the first point for an arm that rests there, and that of ``since`` has left behind.

    None: the arm is near enough to the place of ``since``. An arm that cut the way to that place would leave the path.

    Raises:
        InvalidTrajectory: The arm is at neither place.
        TrajectoryOfThePast: It is at the first point, which has been due for too long.
    """
    first = trajectory.points[0]
    at = start.state.position
    if _farthest(at, path.at(since).position)[0] <= options.start_tolerance:
        return None
    _check_start(at, first.position, options.start_tolerance)
    if since - first.time > options.late:
        raise TrajectoryOfThePast(
            "the trajectory was to begin %.3f s ago (header.stamp), and the arm is still at its first point; at most "
            "%.3g s late is taken (late_stamp)" % (since - first.time, options.late))
    return first.time


def _led_onto(path: Path, start: PathStart, since: float, model: ArmModel, slows: bool, held: Sequence[int]) -> Path:
    """Return the path with the shortest approach onto it that keeps the limits; where none does, one that is slowed."""
    try:
        return _audited_approach(path, start, since, model, False, held)
    except InvalidTrajectory:
        if not slows:
            raise
    return _audited_approach(path, start, since, model, True, held)


def _audited_approach(path: Path, start: PathStart, since: float, model: ArmModel, slows: bool,
                      held: Sequence[int]) -> Path:
    on_path = path.at(since)
    away = np.array([start.state.position]) - np.array([on_path.position])
    faster = np.array([start.state.velocity]) - np.array([on_path.velocity])
    if max(float(np.abs(away).max()), float(np.abs(faster).max())) <= _SAME:
        audit(path, model, slows)
        return path
    error: Optional[InvalidTrajectory] = None
    for duration in _APPROACH_TIMES_S:
        try:
            led = _with_approach(path, start, since, duration, held)
            audit(led, model, slows)
        except _EndsTooSoon as reason:
            raise error or reason from None
        except InvalidTrajectory as reason:
            error = reason
        else:
            return led
    assert error is not None
    raise error


class _EndsTooSoon(InvalidTrajectory):
    """The error that a trajectory ends before the arm could be on it."""


def _with_approach(path: Path, start: PathStart, since: float, duration: float, held: Sequence[int]) -> Path:
    """Return the path with what leads from the start at ``since`` onto it within ``duration``, s.

    Joints of ``held`` come to rest in that time and stay there: one that was held where it is while it moves would pass
    that place, and come back.

    Raises:
        InvalidTrajectory: The path ends before.
    """
    if since + duration > path.end:
        raise _EndsTooSoon("the trajectory ends too soon to be joined from where the arm is")
    coefficients, on_path = path.coefficients.copy(), path.at(since)
    away = np.array([start.state.position]) - np.array([on_path.position])
    faster = np.array([start.state.velocity]) - np.array([on_path.velocity])
    for joint in held:
        faster[0, joint] = start.state.velocity[joint]
        away[0, joint] = -0.5 * duration * faster[0, joint]
        coefficients[:, :, joint] = 0.0
        coefficients[:, 0, joint] = start.state.position[joint] - away[0, joint]
    nothing = np.zeros((1, JOINT_COUNT))
    approach = quintic(np.array([duration]), (away, faster, nothing), (nothing, nothing, nothing))[0]
    return Path(path.breaks, coefficients, path.begin, Approach(since, since + duration, approach))


def _check_start(measured: Sequence[float], planned: Sequence[float], tolerance: float) -> None:
    away, joint = _farthest(measured, planned)
    if away > tolerance:
        raise InvalidTrajectory("the trajectory begins %.4f rad from where joint %d is (%.4f rad); at most %.4g rad "
                                "are allowed (trajectory_start_tolerance)" % (
                                    away, joint + 1, measured[joint], tolerance))


def _farthest(measured: Sequence[float], planned: Sequence[float]) -> Tuple[float, int]:
    """Return the largest distance of a joint, rad, and the joint's index."""
    away: List[float] = [abs(a - b) for a, b in zip(measured, planned)]
    return max(away), away.index(max(away))
