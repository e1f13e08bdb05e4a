"""The points of a trajectory, within the limits of the arm wherever the driver's polynomials between them lead it."""
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from jaka_bag.errors import BagError
from jaka_bag.messages.batch import Array

from .limits import ArmLimits
from .path import Smoothed, evaluated, quintics, smooth
from .recorded import Recording
from .time_law import TICK_S, TimeLaw, find_solver, rest_for, time_law

SPACING_TICKS = 5
"""A point each 20 ms: what a low-pass of 16 Hz leaves is the same between them."""
MOST_POINTS = 100000
"""Largest number of points that the driver takes for one trajectory (docs/trajectories.md)."""
_SHARE = 0.98
"""Share of the limits that is planned with first: the driver's own sampling needs the rest."""
_ROUNDS = 12
"""Most plans, each with less of the limits: after twelve no more than 0.8 of them is left."""
_SAMPLES = 8
"""Samples of each piece at which the limits are looked at."""
_POSITION_SLACK = 1e-6
"""Excess, rad, over a limit that is rounding."""
_NOTABLE = 0.98
"""Share of the recorded speed below which a person is told that the motion is slower."""


class BeyondLimits(BagError):
    """The recorded motion leaves the joints' limits, which no speed can change."""


class MotionPlan(NamedTuple):
    """A trajectory that does again what a log shows.

    Attributes:
        recording: Recording that it was made from.
        smoothed: The smooth path.
        limits: Limits of the arm that is to follow it.
        solver: The package that gave it its times.
        factor: Factor of the recorded speed, as asked for.
        time: Times of the points, s from the start (n,).
        place: Recorded time at the points, s since the path's begin (n,).
        position, velocity, acceleration: rad, rad/s, rad/s2, (n, 6) each; at rest at both ends.
        slowest: Smallest share of the speed asked for that the arm goes at; 1 where nothing was too fast.
        slowest_at: Time at which that was recorded, s since the log's first message.
    """

    recording: Recording
    smoothed: Smoothed
    limits: ArmLimits
    solver: str
    factor: float
    time: Array
    place: Array
    position: Array
    velocity: Array
    acceleration: Array
    slowest: float
    slowest_at: float

    @property
    def duration(self) -> float:
        """The duration of the trajectory, s."""
        return float(self.time[-1])

    @property
    def start(self) -> Tuple[float, ...]:
        """The joints at which the arm must begin, rad (6,)."""
        return tuple(self.position[0].tolist())

    @property
    def notes(self) -> List[str]:
        """The notes that a user should read before the arm moves."""
        notes = list(self.smoothed.notes)
        if self.slowest < _NOTABLE:
            notes.append("the recorded motion is too fast for the arm at %g times its speed: slowed down to %.0f %% of "
                         "that at %.3f s of the log%s, %.2f s in all instead of %.2f s" % (
                             self.factor, 100.0 * self.slowest, self.slowest_at,
                             "" if self.solver == "toppra" else " and everywhere else (with toppra only where needed)",
                             self.duration, self.smoothed.path.duration / self.factor))
        return notes

    def document(self) -> Dict[str, object]:
        """Return the facts of the plan, for JSON."""
        before, inside, behind = self.smoothed.cut
        return {"log": self.recording.path, "topic": self.recording.topic, "model": self.limits.model,
                "solver": self.solver, "speed": self.factor, "points": len(self.time), "duration_s": self.duration,
                "recorded_s": self.smoothed.path.duration, "slowest_share": self.slowest,
                "slowest_at_s": self.slowest_at, "deviation_rad": self.smoothed.deviation,
                "noise_rad": self.smoothed.noise, "cutoff_hz": self.smoothed.cutoff,
                "standstill_cut_s": {"before": round(before, 3), "inside": round(inside, 3),
                                     "behind": round(behind, 3)},
                "start": list(self.start), "end": self.position[-1].tolist(), "notes": self.notes}


def plan_motion(recording: Recording, limits: ArmLimits, factor: float = 1.0, longest_pause: Optional[float] = None,
                solver: Optional[str] = None) -> MotionPlan:
    """Plan a trajectory that repeats a recording, at a factor of its speed, and slower where the arm could not follow.

    Args:
        recording: The joints.
        limits: Limits of the arm.
        factor: Factor of the recorded speed, above 0.
        longest_pause: Standstills inside are cut to this length, s; None: kept.
        solver: ``toppra`` or ``ruckig``; None for the first that is installed.

    Raises:
        MissingDependency: Neither is installed.
        BeyondLimits: A joint was recorded outside of its limits.
        BagError: There is no motion, or none that an arm could do.
    """
    found = find_solver(solver)
    smoothed = smooth(recording, limits, longest_pause, rest_for(factor))
    _check_positions(recording, smoothed, limits)
    share = _SHARE
    for _ in range(_ROUNDS):
        asked = limits._replace(speed=share * limits.speed, acceleration=share * limits.acceleration)
        plan = _sampled(recording, smoothed, limits, found, factor, time_law(smoothed.path, asked, factor, found))
        excess = _excess(plan)
        if excess <= 1.0:
            return plan
        share *= min(0.98, 1.0 / excess)  # what changes between the points of the solver's grid needs some room
    raise BagError("%s: no speed is found at which the arm keeps its limits on this path" % recording.path)


def _check_positions(recording: Recording, smoothed: Smoothed, limits: ArmLimits) -> None:
    position = smoothed.path.position
    beyond = np.maximum(limits.low - position, position - limits.high)
    if beyond.max() > _POSITION_SLACK:
        at, joint = np.unravel_index(int(beyond.argmax()), beyond.shape)
        raise BeyondLimits("%s: %s was at %.4f rad, %.3f s after the log's start; the %s can go from %.4f to %.4f rad: "
                           "was it recorded with another arm?" % (
                               recording.path, recording.names[joint], position[at, joint],
                               smoothed.log_time[at], limits.model, limits.low[joint], limits.high[joint]))


def _sampled(recording: Recording, smoothed: Smoothed, limits: ArmLimits, solver: str, factor: float,
             law: TimeLaw) -> MotionPlan:
    which = np.arange(0, len(law.place), SPACING_TICKS)
    if which[-1] != len(law.place) - 1:
        which = np.append(which, len(law.place) - 1)
    if len(which) > MOST_POINTS:
        raise BagError("%s: the motion takes %.0f s; at most %.0f s can be replayed at once. Choose a part with "
                       "--start and --end" % (
                           recording.path, TICK_S * len(law.place), TICK_S * SPACING_TICKS * MOST_POINTS))
    place, rate, change = law.place[which], law.rate[which][:, None], law.change[which][:, None]
    position, first, second = smoothed.path.at(place)
    velocity, acceleration = first * rate, second * rate * rate + first * change
    velocity[[0, -1]] = acceleration[[0, -1]] = 0.0
    slowest, slowest_at = _slowest(law, smoothed, factor)
    return MotionPlan(recording, smoothed, limits, solver, factor, TICK_S * which, place, position, velocity,
                      acceleration, slowest, slowest_at)


def _slowest(law: TimeLaw, smoothed: Smoothed, factor: float) -> Tuple[float, float]:
    """Return the smallest share of the speed asked for, beside the rest at both ends; and when that was recorded, s."""
    rest, total = rest_for(factor), smoothed.path.duration
    inside = np.flatnonzero((law.place >= rest) & (law.place <= total - rest))
    if not len(inside):
        return 1.0, float(smoothed.log_time[0])
    at = int(inside[law.rate[inside].argmin()])
    index = min(int(round(law.place[at] / smoothed.path.step)), len(smoothed.log_time) - 1)
    return min(1.0, float(law.rate[at]) / factor), float(smoothed.log_time[index])


def _excess(plan: MotionPlan) -> float:
    """Return by which factor speed or acceleration exceed the limits anywhere; 1 and less is within them.

    Between the points the driver goes along polynomials of degree five (docs/trajectories.md).
    """
    coefficients = quintics(np.diff(plan.time), plan.position, plan.velocity, plan.acceleration)
    pieces = np.repeat(np.arange(len(coefficients)), _SAMPLES)
    share = np.tile(np.arange(_SAMPLES) / _SAMPLES, len(coefficients))
    _, velocity, acceleration = evaluated(coefficients[pieces], share * np.diff(plan.time)[pieces])
    return max(float((np.abs(velocity) / plan.limits.speed).max()),
               float(np.sqrt((np.abs(acceleration) / plan.limits.acceleration).max())))
