"""The way from the arm's position onto a trajectory, and the audit of all of it before anything is sent."""
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, JOINT_SPEED_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.trajectory.corners import rounded_lines
from jaka_ros_driver.trajectory.path import TERMS, Approach, Array, JointState, Path, quintic
from jaka_ros_driver.trajectory.points import (
    REST_VELOCITY,
    InvalidTrajectory,
    JointTrajectory,
    TrajectoryOfThePast,
    TrajectoryPoint,
    check_points,
)
from jaka_ros_driver.trajectory.splines import spline, with_brake

SPEED_SLACK = 1.02
"""Share of the speed limit that a path may use: polynomials through points of the highest speed overshoot it a little.
"""
ACCELERATION_SLACK = 1.02
_POSITION_SLACK = 1e-6
_APPROACH_TIMES_S = (0.1, 0.2, 0.4, 0.8, 1.6)
_SAME = 1e-9
_SAMPLE_PERIOD_S = 0.5 * SERVO_PERIOD_S
_PIECE_SAMPLES = (4, 64)
_SAMPLES_AT_ONCE = 20_000
_REST_PIECE_S = 1e-3
MAX_DELAY_S = 60.0
"""Longest wait, s, for a trajectory that starts later; a wrong clock would ask for a longer one."""


class PathStart(NamedTuple):
    """The state in which a path begins: at rest, or in motion on another path that is joined there."""

    state: JointState
    is_at_rest: bool


def build_path(start: PathStart, trajectory: JointTrajectory, elapsed: float, model: ArmModel,
               start_tolerance: float) -> Path:
    """Return a path from ``start`` through the points, within the limits of the model at every moment.

    Points that were to be reached before now are left out. Where the first point is due now or before, the path leads
    onto the polynomials through the points, and else to the first point.

    Args:
        start: The state of the arm now, or when it joins.
        trajectory: The points.
        elapsed: Time since the trajectory was to start, s; negative where it starts later.
        model: Its limits.
        start_tolerance: Largest distance, rad, of an arm at rest from the begin of the trajectory.

    Raises:
        InvalidTrajectory: The message names point or joint, time, value, and what is valid.
        TrajectoryOfThePast: No point is left.
    """
    check_points(trajectory)
    if elapsed < -MAX_DELAY_S:
        raise InvalidTrajectory("the trajectory is to start in %.3f s; at most %g s are waited for" % (
            -elapsed, MAX_DELAY_S))
    with np.errstate(all="ignore"):
        return _build(start, trajectory, elapsed, model, start_tolerance)


def _build(start: PathStart, trajectory: JointTrajectory, elapsed: float, model: ArmModel,
           start_tolerance: float) -> Path:
    since = max(elapsed, 0.0)
    begin = elapsed if start.is_at_rest else since
    left = [point for point in trajectory.points if point.time > since + _SAME]
    if not left:
        return _path_of_no_way(start, trajectory, elapsed, start_tolerance)
    if trajectory.points[0].time > since + _SAME:
        first = TrajectoryPoint(since, *start.state)
        breaks, coefficients = _through([first, *left], start)
        path = Path(*_ended(breaks, coefficients, left[-1]), begin=begin)
        audit(path, model)
        change = np.array([path.at(since).velocity]) - np.array([start.state.velocity])
        _refuse_changes(np.array([since]), change)
        return path
    at_rest = PathStart(JointState(trajectory.points[0].position, (0.0,) * JOINT_COUNT, (0.0,) * JOINT_COUNT), True)
    breaks, coefficients = _ended(*_through(trajectory.points, at_rest), left[-1])
    return _led_onto(Path(breaks, coefficients, begin=begin), start, since, model, start_tolerance)


def audit(path: Path, model: ArmModel) -> None:
    """Check that every joint keeps its limits of position, speed and acceleration on the whole path.

    Raises:
        InvalidTrajectory: It does not; the message names the joint, the time, the value and the limit.
    """
    counts = np.clip(np.ceil(np.diff(path.breaks) / _SAMPLE_PERIOD_S).astype(int), *_PIECE_SAMPLES)
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        until = int(np.searchsorted(ends, ends[first] + _SAMPLES_AT_ONCE))  # the next piece at least
        pieces = np.repeat(np.arange(first, until), counts[first:until])
        share = np.concatenate([np.arange(n) / n for n in counts[first:until]])
        _audit_at(path, model, path.breaks[pieces] + share * np.diff(path.breaks)[pieces])
        first = until
    _audit_at(path, model, np.array([path.end]))
    if path.approach is not None:
        _audit_at(path, model, np.linspace(path.approach.since, min(path.approach.until, path.end), 256)[:-1])
    _audit_changes(path)


# ---- inside ----

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


def _path_of_no_way(start: PathStart, trajectory: JointTrajectory, elapsed: float, start_tolerance: float) -> Path:
    """Return the path of a plan whose only point is due at its start: the arm is there already, and stays."""
    last = trajectory.points[-1]
    if elapsed > last.time or not start.is_at_rest:
        raise TrajectoryOfThePast("every point lies in the past: the last one was due %.3f s ago" % (
            elapsed - last.time))
    _check_start(start.state.position, last.position, start_tolerance)
    piece = np.zeros((1, TERMS, JOINT_COUNT))
    piece[0, 0] = start.state.position
    return Path([last.time, last.time + _REST_PIECE_S], piece, begin=elapsed)


def _led_onto(path: Path, start: PathStart, since: float, model: ArmModel, start_tolerance: float) -> Path:
    """Return the path with the shortest approach onto it that keeps the limits."""
    on_path = path.at(since)
    if start.is_at_rest:
        _check_start(start.state.position, on_path.position, start_tolerance)
    away = np.array([start.state.position]) - np.array([on_path.position])
    faster = np.array([start.state.velocity]) - np.array([on_path.velocity])
    if max(float(np.abs(away).max()), float(np.abs(faster).max())) <= _SAME:
        audit(path, model)
        return path
    error: InvalidTrajectory = InvalidTrajectory("the trajectory ends too soon to be joined from where the arm is")
    nothing = np.zeros((1, JOINT_COUNT))
    for duration in _APPROACH_TIMES_S:
        if since + duration > path.end:
            break
        approach = quintic(np.array([duration]), (away, faster, nothing), (nothing, nothing, nothing))[0]
        led = Path(path.breaks, path.coefficients, path.begin, Approach(since, since + duration, approach))
        try:
            audit(led, model)
        except InvalidTrajectory as reason:
            error = reason
        else:
            return led
    raise error


def _check_start(measured: Sequence[float], planned: Sequence[float], tolerance: float) -> None:
    away: List[float] = [abs(a - b) for a, b in zip(measured, planned)]
    if max(away) > tolerance:
        joint = away.index(max(away))
        raise InvalidTrajectory("the trajectory begins %.4f rad from where joint %d is (%.4f rad); at most %.4g rad "
                                "are allowed (trajectory_start_tolerance)" % (
                                    away[joint], joint + 1, measured[joint], tolerance))


def _audit_at(path: Path, model: ArmModel, times: Array) -> None:
    times = times[times >= path.begin]  # what lies before is not followed, and an approach means nothing there
    positions, velocities, accelerations = path.samples(times)
    low, high = np.array(model.joint_limits).T
    beyond = np.maximum(low - positions, positions - high) - _POSITION_SLACK
    _refuse_worst(times, beyond, lambda where, joint: "joint %d would be at %.6f rad %%s; valid: %.6f to %.6f rad" % (
        joint + 1, positions[where, joint], low[joint], high[joint]))
    top = np.minimum(np.array(model.joint_max_speed), JOINT_SPEED_CEILING)
    _refuse_worst(times, np.abs(velocities) - top * SPEED_SLACK, lambda where, joint: (
        "joint %d would run at %.4f rad/s %%s; valid: at most %.4f rad/s" % (
            joint + 1, velocities[where, joint], top[joint])))
    _refuse_worst(times, np.abs(accelerations) - JOINT_ACCELERATION_CEILING * ACCELERATION_SLACK, lambda where, joint: (
        "joint %d would need %.4f rad/s2 %%s; valid: at most %.4f rad/s2" % (
            joint + 1, accelerations[where, joint], JOINT_ACCELERATION_CEILING)))


def _audit_changes(path: Path) -> None:
    """Refuse a speed that changes from one polynomial to the next by more than one cycle allows.

    The change to rest at the end of the path counts, too.
    """
    starts, durations = path.coefficients[:, 1], np.diff(path.breaks)
    powers = durations[:, None] ** np.arange(TERMS - 1) * np.arange(1, TERMS)
    ends = np.einsum("nt,ntj->nj", powers, path.coefficients[:, 1:])
    changes = np.concatenate((starts[1:], np.zeros((1, JOINT_COUNT)))) - ends
    if path.end - path.begin <= SERVO_PERIOD_S:
        return
    is_later = path.breaks[1:] > path.begin
    _refuse_changes(path.breaks[1:][is_later], changes[is_later])


def _refuse_changes(times: Array, changes: Array) -> None:
    allowed = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S * ACCELERATION_SLACK
    _refuse_worst(times, np.abs(changes) - allowed, lambda where, joint: (
        "the speed of joint %d would change by %.4f rad/s at once %%s, which no joint can; give velocities for every "
        "point" % (joint + 1, changes[where, joint])))


def _refuse_worst(times: Array, excess: Array, text: "object") -> None:
    breaks_limit = ~(excess <= 0.0)  # also where numbers have become too large
    if breaks_limit.any():
        where = int(np.flatnonzero(breaks_limit.any(axis=1))[0])
        joint = int(np.nan_to_num(excess[where], nan=np.inf).argmax())
        raise InvalidTrajectory(text(where, joint) % ("after %.3f s" % times[where]))  # type: ignore[operator]
