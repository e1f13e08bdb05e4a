"""Noisy samples to a smooth way: measurement noise must not become acceleration.

The samples are put on an even grid and pass a low-pass filter without delay, whose answer is flat enough to leave
positions, speeds and accelerations of slow motions as they are (it reproduces polynomials up to the fifth degree).
The more noise, the lower its cut-off. Standstill at both ends is cut away, but for a moment in which the way begins
and ends at rest.
"""
import math
from typing import Any, List, NamedTuple, Optional, Tuple

import numpy as np

from jaka_bag.errors import BagError
from jaka_bag.messages.batch import Array

from .limits import ArmLimits
from .recorded import Recording

STEP_S = 0.008
"""Step of the grid, s: the period of the driver's topics."""
REST_S = 0.25
"""Standstill, s, that is kept at each end, in which the path is begun and ended."""
CUTOFFS_HZ = (3.0, 16.0)
"""Lowest and highest cut-off. What people do by hand has less than 10 Hz; what an arm does has sharper corners."""
NOISE_ACCELERATION = 0.3
"""Acceleration that the noise may cause, as a standard deviation, rad/s2."""
LARGEST_DEVIATION = 0.02
"""Distance from a sample, rad, from which on a path is not what the arm did."""
_STILL_SPEED = 3e-3
"""Speed below which an arm stands still, rad/s."""
_STILL_NOISE = 6.0
"""Factor over the noise of speeds below which an arm stands still: of good samples none is beyond."""
_BEYOND_RAD = 0.005
"""Distance beyond a soft limit, rad, at which an arm that was led onto it may be measured."""
_INSIDE_RAD = 1e-3
"""Distance, rad, inside of a limit to which a sample beyond it is moved: the filtered path must not pass it again."""
_CREEP_RAD = 0.002
"""Largest way, rad, of an arm that stands still while a pause is cut out: with more the ends do not meet."""
_SLOPE_S = 0.05
"""Time, s, on each side of a silence over which a speed is taken: some samples of a slow feed."""
_CALMER = 0.85
"""Factor from try to try on the cut-off: corners are kept as far as they can be."""
_CALMEST_HZ = 6.0
"""Lowest cut-off, Hz, that is tried; what people do by hand is below 10 Hz, so less would be another motion."""
_CALM_DEVIATION = 0.5 * LARGEST_DEVIATION
"""Largest distance, rad, of a calmed path from the samples: half of what is accepted in all."""
_TERMS = 6
"""Coefficients of a polynomial: place, speed and acceleration at both ends."""


class SmoothPath:
    """Joints along an even grid of the recorded time, and between its points.

    Attributes:
        step: Step of the grid, s.
        position, velocity, acceleration: At its points, rad, rad/s, rad/s2, (n, 6) each; at rest at both ends.
    """

    def __init__(self, step: float, position: Array, velocity: Array, acceleration: Array) -> None:
        self.step = step
        self.position, self.velocity, self.acceleration = position, velocity, acceleration
        self._coefficients = quintics(np.full(len(position) - 1, step), position, velocity, acceleration)

    @property
    def duration(self) -> float:
        """The recorded duration, s."""
        return self.step * (len(self.position) - 1)

    def at(self, places: Array) -> Tuple[Array, Array, Array]:
        """Return position and its first two derivatives along recorded time, at times of it, s (k,): (k, 6) each."""
        inside = np.clip(np.asarray(places, float), 0.0, self.duration)
        index = np.minimum((inside / self.step).astype(np.int64), len(self.position) - 2)
        return evaluated(self._coefficients[index], inside - index * self.step)


def quintics(durations: Array, position: Array, velocity: Array, acceleration: Array) -> Array:
    """Compute polynomials of degree five between points, over the time from each: (n - 1, 6 terms, joints)."""
    t = durations[:, None]
    p, v, a = position[:-1], velocity[:-1], acceleration[:-1]
    way = position[1:] - p - v * t - 0.5 * a * t * t
    change = velocity[1:] - v - a * t
    turn = acceleration[1:] - a
    return np.stack([p, v, 0.5 * a,
                     (10.0 * way - 4.0 * change * t + 0.5 * turn * t * t) / t ** 3,
                     (-15.0 * way + 7.0 * change * t - turn * t * t) / t ** 4,
                     (6.0 * way - 3.0 * change * t + 0.5 * turn * t * t) / t ** 5], axis=1)


def evaluated(coefficients: Array, times: Array) -> Tuple[Array, Array, Array]:
    """Evaluate polynomials (k, 6, joints) and their first two derivatives, each at its own time, s (k,)."""
    powers = times[:, None] ** np.arange(_TERMS)
    numbers = np.arange(_TERMS, dtype=float)
    first = np.zeros_like(powers)
    first[:, 1:] = powers[:, :-1] * numbers[1:]
    second = np.zeros_like(powers)
    second[:, 2:] = powers[:, :-2] * (numbers[2:] * numbers[1:-1])
    position, velocity, acceleration = (
        np.einsum("kt,ktj->kj", terms, coefficients) for terms in (powers, first, second))
    return position, velocity, acceleration


class Smoothed(NamedTuple):
    """A recording as a smooth path.

    Attributes:
        path: The smooth path.
        log_time: Times at which its grid's points were recorded, s since the log's first message (n,).
        recorded: The measured joints there, rad (n, 6).
        deviation: Largest distance of the path from them, rad.
        noise: Standard deviation of the measurement, rad.
        cutoff: Cut-off of the filter, Hz.
        cut: Standstill that was cut: before, inside, behind, s.
        notes: Notes for the user.
    """

    path: SmoothPath
    log_time: Array
    recorded: Array
    deviation: float
    noise: float
    cutoff: float
    cut: Tuple[float, float, float]
    notes: Tuple[str, ...]


def smooth(recording: Recording, limits: Optional[ArmLimits] = None, longest_pause: Optional[float] = None,
           rest: float = REST_S) -> Smoothed:
    """Smooth the samples of a recording to a path, without the standstill at its ends.

    Args:
        recording: The samples.
        limits: Samples a little beyond the joints' limits are taken as on them.
        longest_pause: Standstills inside are cut to this length, s; None: they stay as long as they were.
        rest: Time for which the path rests at each end, s.

    Raises:
        BagError: The arm stands still, or the samples are no motion that a smooth way could follow.
    """
    count = int(math.floor((recording.time[-1] - recording.time[0]) / STEP_S + 1e-6)) + 1
    grid = recording.time[0] + STEP_S * np.arange(count)
    raw = _on_limits(_resampled(recording, grid), limits)
    noise = _noise_of(recording.position)
    cutoff = _cutoff(noise, recording.interval)
    moving = _moving(raw, noise, cutoff, recording.interval)
    if not moving.any():
        raise BagError("%s: the arm stands still on %s, there is no motion to replay" % (
            recording.path, recording.topic))
    first, last = int(moving.argmax()), count - 1 - int(moving[::-1].argmax())
    notes: List[str] = []
    if first == 0:
        notes.append("the log begins in the middle of a motion: it is begun from rest")
    if last == count - 1:
        notes.append("the log ends in the middle of a motion: it is ended at rest")
    margin = int(math.ceil(rest / STEP_S))
    keep = np.ones(count, bool)
    keep[:max(0, first - margin)] = keep[last + margin + 1:] = False
    inside = 0 if longest_pause is None else _cut_pauses(raw, moving, keep, longest_pause)
    ends = STEP_S * max(0, first - margin), inside * STEP_S, STEP_S * max(0, count - 1 - last - margin)
    missing = max(0, margin - first), max(0, margin - (count - 1 - last))
    recorded = np.pad(raw[keep], (missing, (0, 0)), mode="edge")
    log_time = np.concatenate((grid[0] - STEP_S * np.arange(missing[0], 0, -1), grid[keep],
                               grid[-1] + STEP_S * np.arange(1, missing[1] + 1)))
    cutoff, (position, velocity, acceleration) = _calm(_from_rest(recorded, margin), cutoff, limits)
    velocity[[0, -1]] = acceleration[[0, -1]] = 0.0
    deviation = np.abs(position - recorded)
    worst = int(deviation.max(axis=1).argmax())
    if deviation.max() > LARGEST_DEVIATION:
        raise BagError("%s: %s of %s shakes more than a motion does: at %.3f s a smooth way passes it at %.4f rad; "
                       "at most %g rad are allowed" % (
                           recording.path, recording.names[int(deviation[worst].argmax())], recording.topic,
                           log_time[worst], deviation.max(), LARGEST_DEVIATION))
    return Smoothed(SmoothPath(STEP_S, position, velocity, acceleration), log_time, recorded, float(deviation.max()),
                    noise, cutoff, ends, tuple(notes))


def _resampled(recording: Recording, grid: Array) -> Array:
    """Interpolate the samples to the grid; a short silence is bridged by a cubic, a long one is a standstill."""
    time, position = recording.time, recording.position
    values = np.stack([np.interp(grid, time, position[:, joint]) for joint in range(position.shape[1])], axis=1)
    for at in np.flatnonzero(np.diff(time) > 3.0 * max(recording.interval, STEP_S)).tolist():
        slopes = _slope(time, position, at, -1), _slope(time, position, at + 1, 1)
        inside = (grid > time[at]) & (grid < time[at + 1])
        values[inside] = _bridge(grid[inside], time[at:at + 2], position[at:at + 2], slopes)
    return values


def _slope(time: Array, position: Array, at: int, side: int) -> Array:
    """Estimate the speed on one side of a silence, rad/s (6,), by a straight line through the samples there."""
    near = np.abs(time - time[at]) <= _SLOPE_S
    part = slice(0, at + 1) if side < 0 else slice(at, None)
    times, values = time[part][near[part]], position[part][near[part]]
    if len(times) < 3:
        return np.zeros(position.shape[1])
    centred = times - times.mean()
    slope: Array = centred @ (values - values.mean(axis=0)) / float(centred @ centred)
    return slope


def _bridge(times: Array, ends: Array, values: Array, slopes: Tuple[Array, Array]) -> Array:
    length = float(ends[1] - ends[0])
    s = ((times - ends[0]) / length)[:, None]
    way = values[1] - values[0]
    bound = 3.0 * np.abs(way) / length  # a steeper cubic would swing out beyond both ends
    start, end = (np.where(slope * way > 0.0, np.clip(slope, -bound, bound), 0.0) for slope in slopes)
    result: Array = (values[0] + way * (3.0 - 2.0 * s) * s * s + length * start * s * (1.0 - s) ** 2
                     - length * end * s * s * (1.0 - s))
    return result


def _on_limits(values: Array, limits: Optional[ArmLimits]) -> Array:
    """Move samples beyond a limit by less than a measurement's error just inside; leave others, for the audit."""
    if limits is None:
        return values
    near = (values >= limits.low - _BEYOND_RAD) & (values <= limits.high + _BEYOND_RAD)
    return np.where(near, np.clip(values, limits.low + _INSIDE_RAD, limits.high - _INSIDE_RAD), values)


def _noise_of(position: Array) -> float:
    """Estimate the standard deviation of the worst joint's noise, rad, from what changes from sample to sample."""
    third = np.abs(np.diff(position, 3, axis=0))
    return float((np.percentile(third, 90.0, axis=0) / (1.645 * math.sqrt(20.0))).max())


def _cutoff(noise: float, interval: float) -> float:
    """Return the highest cut-off, Hz, with which the noise causes no more than ``NOISE_ACCELERATION``."""
    low, high = CUTOFFS_HZ
    high = min(high, 0.25 / interval)
    if noise > 0.0:
        angular = (NOISE_ACCELERATION ** 2 * 5.0 * math.pi / (noise * noise * interval)) ** 0.2
        high = min(high, angular / (2.0 * math.pi))
    return max(high, min(low, 0.25 / interval))


def _moving(raw: Array, noise: float, cutoff: float, interval: float) -> Array:
    """Return where the arm moves, bool (n,)."""
    angular = 2.0 * math.pi * cutoff
    speed_noise = noise * math.sqrt(interval * angular ** 3 / (3.0 * math.pi))
    speed = np.abs(_filtered(raw, cutoff)[1]).max(axis=1)
    moving: Array = speed > max(_STILL_SPEED, _STILL_NOISE * speed_noise)
    return moving


def _cut_pauses(raw: Array, moving: Array, keep: Array, longest: float) -> int:
    """Remove the middle of each long standstill from ``keep``; return how many points that are."""
    kept = int(math.ceil(max(longest, 2.0 * REST_S) / STEP_S))
    edges = np.flatnonzero(np.diff(moving.astype(np.int8)))
    cut = 0
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist()):
        if moving[begin + 1] or end - begin <= kept:
            continue
        first = begin + 1 + kept // 2
        last = end - (kept - kept // 2)
        if last > first and np.abs(raw[last] - raw[first]).max() <= _CREEP_RAD:
            keep[first:last] = False
            cut += last - first
    return cut


def _from_rest(recorded: Array, margin: int) -> Array:
    """Return the samples with ends at rest: the mean of the standstill there, faded over to the samples."""
    result = recorded.copy()
    half = max(2, margin // 2)
    weight = (0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, half)))[:, None]
    begin, end = recorded[:half].mean(axis=0), recorded[-half:].mean(axis=0)
    result[:half] = begin + weight * (recorded[:half] - begin)
    result[-half:] = end + weight[::-1] * (recorded[-half:] - end)
    return result


def _calm(values: Array, cutoff: float, limits: Optional[ArmLimits]) -> Tuple[float, Tuple[Any, Any, Any]]:
    """Filter the values; return the cut-off that was used, and the filtered values with their derivatives.

    The cut-off is lowered where the arm could not follow: mostly samples that came late are the reason, and a path that
    passes them a little beside is better than one that has to be followed slowly.
    """
    result = _filtered(values, cutoff)
    while limits is not None and cutoff > _CALMEST_HZ and (np.abs(result[2]) > limits.acceleration).any():
        calmer = _filtered(values, _CALMER * cutoff)
        if np.abs(calmer[0] - values).max() > _CALM_DEVIATION:
            break
        cutoff, result = _CALMER * cutoff, calmer
    return cutoff, result


def _filtered(values: Array, cutoff: float) -> Tuple[Any, Any, Any]:
    """Filter positions, mirrored at their ends, by a low-pass; return them and their first two derivatives."""
    mirrored = np.concatenate((values, values[::-1]))
    count = len(mirrored)
    frequency = np.fft.rfftfreq(count, STEP_S)[:, None]
    spectrum = np.fft.rfft(mirrored, axis=0) / (1.0 + (frequency / cutoff) ** 6)
    turn = 2j * np.pi * frequency
    position, velocity, acceleration = (
        np.fft.irfft(part, count, axis=0)[:len(values)] for part in (spectrum, spectrum * turn, spectrum * turn ** 2))
    return position, velocity, acceleration
