"""The audit of a path: position, speed and acceleration of every joint, at every moment, before anything is sent."""
from typing import Callable, Optional

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    JointRanges,
    stream_limits,
    top_joint_speeds,
)
from jaka_ros_driver.trajectory.path import TERMS, Array, Path, highest_fourths, sampled
from jaka_ros_driver.trajectory.points import InvalidTrajectory
from jaka_ros_driver.trajectory.rates import LARGEST_OVERSHOOT, Overshoots, Rates

SPEED_SLACK = 1.02
"""Share of the speed limit that a path may use: polynomials through points of the highest speed overshoot it a little.
"""
ACCELERATION_SLACK = 1.02
"""Share of the highest acceleration that a path may use: as of the speed, for polynomials between points."""
_POSITION_SLACK = 1e-6
"""Excess, rad, over a joint limit that counts as rounding: points come as float32 from some clients."""
_SAMPLE_PERIOD_S = 0.5 * SERVO_PERIOD_S
"""Step, s, of the samples: half a cycle, so that the middle of each cycle is seen, too."""
_PIECE_SAMPLES = (4, 64)
"""Fewest and most samples of a polynomial: short ones bend within a cycle, long ones are bounded between samples."""
_SAMPLES_AT_ONCE = 20_000
"""Samples in one array: a plan of a day takes some MB, not some GB."""


def audit(path: Path, model: ArmModel, slows: bool = False) -> None:
    """Check that every joint keeps its limits of position, speed and acceleration on the whole path.

    Positions are those of ``stream_limits``, for an arm that stands where the path begins.

    slows: Give the path lower rates where it passes a limit by less than ``LARGEST_OVERSHOOT``.

    Raises:
        InvalidTrajectory: It does not; the message names the joint, the time, the value and the limit.
    """
    found = Overshoots() if slows else None
    ranges = stream_limits(model, path.at(path.begin).position)
    counts = np.clip(np.ceil(np.diff(path.breaks) / _SAMPLE_PERIOD_S).astype(int), *_PIECE_SAMPLES)
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        until = int(np.searchsorted(ends, ends[first] + _SAMPLES_AT_ONCE))  # the next piece at least
        pieces = np.repeat(np.arange(first, until), counts[first:until])
        share = np.concatenate([np.arange(n) / n for n in counts[first:until]])
        _audit_at(path, model, ranges, path.breaks[pieces] + share * np.diff(path.breaks)[pieces], found)
        is_long = np.diff(path.breaks)[pieces] > _PIECE_SAMPLES[1] * _SAMPLE_PERIOD_S
        _audit_between(path, ranges, pieces[is_long], share[is_long])
        first = until
    _audit_at(path, model, ranges, np.array([path.end]), found)
    if path.approach is not None:
        _audit_at(path, model, ranges, np.linspace(path.approach.since, min(path.approach.until, path.end), 256)[:-1],
                  found)
    _audit_changes(path, found)
    if found:
        path.rates = found.rates(path.begin, path.end, lambda rates: _share_at(path, model, rates))
        if path.rates is None:
            audit(path, model)


def audit_changes(times: Array, changes: Array, found: Optional[Overshoots] = None) -> None:
    """Refuse changes of the speeds at once, rad/s (m, 6), at these times, s (m,), that no joint can make in one cycle.

    found: Where small ones are noted instead; None: all are refused.

    Raises:
        InvalidTrajectory: A change is too large.
    """
    allowed = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
    _judge(times, np.abs(changes) / allowed, ACCELERATION_SLACK, lambda where, joint: (
        "the speed of joint %d would change by %.4f rad/s at once %%s, which no joint can; give velocities for every "
        "point" % (joint + 1, changes[where, joint])), found)


# ---- inside ----

def _audit_at(path: Path, model: ArmModel, ranges: JointRanges, times: Array, found: Optional[Overshoots]) -> None:
    times = times[times >= path.begin]  # what lies before is not followed, and an approach means nothing there
    positions, velocities, accelerations = path.samples(times)
    _judge_positions(times, positions, ranges)
    top = np.array(top_joint_speeds(model))
    _judge(times, np.abs(velocities) / top, SPEED_SLACK, lambda where, joint: (
        "joint %d would run at %.4f rad/s %%s; valid: at most %.4f rad/s" % (
            joint + 1, velocities[where, joint], top[joint])), found)
    _judge(times, np.abs(accelerations) / JOINT_ACCELERATION_CEILING, ACCELERATION_SLACK, lambda where, joint: (
        "joint %d would need %.4f rad/s2 %%s; valid: at most %.4f rad/s2" % (
            joint + 1, accelerations[where, joint], JOINT_ACCELERATION_CEILING)), found, 0.5)


def _audit_between(path: Path, ranges: JointRanges, pieces: Array, shares: Array) -> None:
    """Refuse a joint that passes its limits between two samples of a long piece.

    Between two places a joint lies beyond both by at most h^2/8 times its highest acceleration there; that, in turn,
    is at most h^2/8 times the highest fourth derivative above those of both places. Where a limit is nearer than that,
    a place in the middle is looked at, until it is not.

    Args:
        path: The path; what lies before the end of an approach has samples of its own.
        ranges: Lowest and highest position of each joint, rad.
        pieces: The polynomial of each sample, (m,).
        shares: The places of the samples on it, 0 to 1, (m,).
    """
    low, high = np.array(ranges).T
    durations = np.diff(path.breaks)
    since = path.begin if path.approach is None else path.approach.until
    ends = (shares + 1.0 / _PIECE_SAMPLES[1]) * durations[pieces]
    begins = np.maximum(shares * durations[pieces], since - path.breaks[pieces])
    is_followed = begins < ends
    pieces, begins, ends = pieces[is_followed], begins[is_followed], ends[is_followed]
    while len(pieces):
        coefficients = path.coefficients[pieces]
        fourth = highest_fourths(coefficients, durations[pieces])
        (first, _, at_first), (last, _, at_last) = sampled(begins, coefficients), sampled(ends, coefficients)
        room = np.minimum(np.minimum(first, last) - low, high - np.maximum(first, last))
        factor = (ends - begins)[:, None] ** 2 / 8.0
        beyond = factor * (np.maximum(np.abs(at_first), np.abs(at_last)) + factor * fourth)
        is_near = (beyond > np.maximum(room, 0.0) + _POSITION_SLACK).any(axis=1)
        pieces, begins, ends = pieces[is_near], begins[is_near], ends[is_near]
        middles = 0.5 * (begins + ends)
        _judge_positions(path.breaks[pieces] + middles, sampled(middles, path.coefficients[pieces])[0], ranges)
        pieces, begins, ends = np.tile(pieces, 2), np.append(begins, middles), np.append(middles, ends)


def _judge_positions(times: Array, positions: Array, ranges: JointRanges) -> None:
    low, high = np.array(ranges).T
    beyond = np.maximum(low - positions, positions - high) / _POSITION_SLACK
    _judge(times, beyond, 1.0, lambda where, joint: "joint %d would be at %.6f rad %%s; valid: %.6f to %.6f rad" % (
        joint + 1, positions[where, joint], low[joint], high[joint]), None)


def _audit_changes(path: Path, found: Optional[Overshoots]) -> None:
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
    audit_changes(path.breaks[1:][is_later], changes[is_later], found)


def _judge(times: Array, shares: Array, slack: float, text: Callable[[int, int], str], found: Optional[Overshoots],
           power: float = 1.0) -> None:
    """Refuse what is larger than a limit, or add it to what is found, where that is small enough.

    Args:
        times: Of the samples, s (m,).
        shares: The values, as shares of the limits (m, 6).
        slack: Largest share that counts as within the limit.
        text: Returns the words for a sample and a joint.
        found: Where overshoots are noted; None: they are refused.
        power: The rate that keeps a limit is the inverse of its share to this power.
    """
    largest = slack if found is None else LARGEST_OVERSHOOT
    breaks_limit = ~(shares <= largest)  # also where numbers have become too large
    if breaks_limit.any():
        where = int(np.flatnonzero(breaks_limit.any(axis=1))[0])
        joint = int(np.nan_to_num(shares[where], nan=np.inf).argmax())
        raise InvalidTrajectory(text(where, joint) % ("after %.3f s" % times[where]))
    worst = shares.max(axis=1, initial=0.0)
    passed = np.flatnonzero(worst > slack)
    if found is not None and len(passed):
        where = int(worst.argmax())
        found.add(times[np.maximum(passed - 1, 0)], times[np.minimum(passed + 1, len(times) - 1)],
                  worst[passed] ** -power, text(where, int(shares[where].argmax())) % ("after %.3f s" % times[where]))


def _share_at(path: Path, model: ArmModel, rates: Rates) -> float:
    """Return the largest share of its limits of speed and acceleration that the path needs where it is slowed.

    What the audit lets a path need beside its slowed parts is let pass on their ramps, too.
    """
    return max([_share_of(path, model, rates, times[(times >= max(path.begin, float(path.breaks[0])))
                                                    & (times <= path.end)]) for times in rates.times()], default=0.0)


def _share_of(path: Path, model: ArmModel, rates: Rates, times: Array) -> float:
    """Return what ``_share_at`` does, of some of the times of the rates, s (m,)."""
    _, velocities, accelerations = path.samples(times)
    rate, slope = (values[:, None] for values in rates.samples(times))
    speeds = np.abs(velocities) / np.array(top_joint_speeds(model))
    needed = np.abs(accelerations) / JOINT_ACCELERATION_CEILING
    slowed = np.abs(accelerations * rate ** 2 + velocities * rate * slope) / JOINT_ACCELERATION_CEILING
    return float(max((speeds * rate / np.clip(speeds, 1.0, SPEED_SLACK)).max(initial=0.0),
                     (slowed / np.clip(needed, 1.0, ACCELERATION_SLACK)).max(initial=0.0)))
