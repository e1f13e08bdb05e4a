"""Paths through points without velocities: straight lines from one to the next, rounded where the speed changes.

A line that turned at a point within one cycle would need more acceleration than a joint has. Around each point the
speed is changed with the joint's highest acceleration instead, half of it before the point and half behind, so that the
arm passes beside it, by the change of speed squared, divided by eight times the acceleration. It begins on the first
point and ends on the last one.
"""
from typing import Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.path import TERMS, Array
from jaka_ros_driver.trajectory.points import InvalidTrajectory, TrajectoryPoint

_GROWTH = 1.1
"""Factor from try to try: a blend is at most so much longer than needed."""
_SAME_TIME_S = 1e-9
"""Time, s, below which two breaks are one: rounding of floats."""


def rounded_lines(points: Sequence[TrajectoryPoint], start_velocity: Vector) -> Tuple[Array, Array]:
    """Return the breaks and coefficients of a ``Path`` through two or more points, begun with ``start_velocity``, rad/s
    (6,).

    Raises:
        InvalidTrajectory: The points are too near to each other in time for the changes of speed that they ask for.
    """
    times = np.array([point.time for point in points])
    positions = np.array([point.position for point in points])
    start = np.asarray(start_velocity, dtype=float)
    durations = np.diff(times)
    velocities = np.diff(positions, axis=0) / durations[:, None]
    first, last = _end_blends(positions, durations, start)
    anchors, anchor_times = positions[:-1].copy(), times[:-1].copy()
    if len(durations) == 1:
        velocities[0] = (positions[1] - positions[0] - 0.5 * first * start) / (durations[0] - 0.5 * (first + last))
        anchors[0] = positions[0] + 0.5 * first * (start + velocities[0])
        anchor_times[0] = times[0] + first
    else:
        velocities[0] = (positions[1] - positions[0] - 0.5 * first * start) / (durations[0] - 0.5 * first)
        velocities[-1] = (positions[-1] - positions[-2]) / (durations[-1] - 0.5 * last)
        anchors[0], anchor_times[0] = positions[1], times[1]
    before = np.concatenate((start[None], velocities))
    after = np.concatenate((velocities, np.zeros((1, JOINT_COUNT))))
    changes = after - before
    blends = _blend_times(changes)
    blends[0], blends[-1] = first, last
    left, right = 0.5 * blends, 0.5 * blends
    left[0], right[0], left[-1], right[-1] = 0.0, first, last, 0.0
    _check_room(right[:-1] + left[1:], durations)

    def on_line(index: Array, at: Array) -> Array:
        return anchors[index] + velocities[index] * (at - anchor_times[index])[:, None]

    count = len(durations)
    lines = np.zeros((count, TERMS, JOINT_COUNT))
    line_starts = times[:-1] + right[:-1]
    lines[:, 0], lines[:, 1] = on_line(np.arange(count), line_starts), velocities
    turns = np.zeros((count + 1, TERMS, JOINT_COUNT))
    turn_starts = times - left
    turns[0, 0], turns[1:, 0] = positions[0], on_line(np.arange(count), turn_starts[1:])
    turns[:, 1], turns[:, 2] = before, 0.5 * changes / np.maximum(blends, _SAME_TIME_S)[:, None]
    starts = np.empty(2 * count + 1)
    starts[0::2], starts[1::2] = turn_starts, line_starts
    coefficients = np.empty((2 * count + 1, TERMS, JOINT_COUNT))
    coefficients[0::2], coefficients[1::2] = turns, lines
    lasts = np.diff(np.append(starts, times[-1])) > _SAME_TIME_S
    return np.append(starts[lasts], times[-1]), coefficients[lasts]


def _end_blends(positions: Array, durations: Array, start: Array) -> Tuple[float, float]:
    """Return the blend times, s, of the first and of the last point, on which the speeds of their lines depend."""
    if len(durations) == 1:
        both = _shortest_blend(durations[0], lambda b: (positions[1] - positions[0] - 0.5 * b * start) / (
            durations[0] - b), (start, np.zeros(JOINT_COUNT)), 1)
        return both, both
    return (_shortest_blend(durations[0], lambda b: (positions[1] - positions[0] - 0.5 * b * start) / (
                durations[0] - 0.5 * b), (start,), 1),
            _shortest_blend(durations[-1], lambda b: (positions[-1] - positions[-2]) / (durations[-1] - 0.5 * b),
                            (np.zeros(JOINT_COUNT),), len(durations)))


def _shortest_blend(room: float, velocity_with: "object", others: Tuple[Array, ...], number: int) -> float:
    """Return the shortest time, s, in which the speed of the line can be reached from, or reduced to, the others."""
    blend = 0.0
    while blend < room:
        velocity = velocity_with(blend)  # type: ignore[operator]
        change = max(float(np.abs(velocity - other).max()) for other in others)
        if change <= JOINT_ACCELERATION_CEILING * max(blend, SERVO_PERIOD_S):
            return blend
        blend = max(SERVO_PERIOD_S, blend * _GROWTH)
    raise InvalidTrajectory("within the %.4g s behind point %d the joints cannot take up, or give up, the speed that "
                            "it asks for; give velocities, or more time" % (room, number))


def _blend_times(changes: Array) -> Array:
    largest = np.abs(changes).max(axis=1)
    times = largest / JOINT_ACCELERATION_CEILING
    return np.where(times <= SERVO_PERIOD_S, 0.0, times)


def _check_room(needed: Array, durations: Array) -> None:
    short = np.flatnonzero(needed > durations + _SAME_TIME_S)
    if short.size:
        index = int(short[0])
        raise InvalidTrajectory("between points %d and %d the speed changes faster than the joints can: %.4g s would "
                                "be needed, %.4g s are there; give velocities, or more time" % (
                                    index + 1, index + 2, needed[index], durations[index]))
