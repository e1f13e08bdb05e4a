"""A path of six joints over time: polynomials of degree five between breaks."""
import math
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.rates import Rates

TERMS = 6
"""Coefficients of a polynomial, from the constant one on."""
Array = Any
"""A numpy array; numpy's own types are not known for all versions from 1.17 on."""


_REST_PIECE_S = 1e-3
"""Duration, s, of a path that rests: any above zero will do, as a path holds its end."""


class JointState(NamedTuple):
    """The positions, velocities and accelerations of the joints: rad, rad/s, rad/s2, (6,) each."""

    position: Vector
    velocity: Vector
    acceleration: Vector


class Approach(NamedTuple):
    """The polynomial that is added until ``until``: it leads from beside the path onto it.

    Attributes:
        since, until: s.
        coefficients: Over the time from ``since``, (6 terms, 6 joints).
    """

    since: float
    until: float
    coefficients: Array


class Path:
    """The joints over time; before its begin and behind its end the arm rests there.

    Attributes:
        begin, end: s; time is that of the trajectory's points, so ``begin`` is negative where it starts later.
        breaks: Where one polynomial follows the other, s (n + 1,).
        coefficients: Of each, over the time from its break, (n, 6 terms, 6 joints).
        approach: Added at its begin; None for none.
        rates: Where its clock must run slower than time; None: nowhere.
        led: Which joints do not reach their points, because those are too near to a limit, in words; "" for none.
    """

    def __init__(self, breaks: Array, coefficients: Array, begin: Optional[float] = None,
                 approach: Optional[Approach] = None) -> None:
        self.breaks = np.asarray(breaks, dtype=float)
        self.coefficients = np.asarray(coefficients, dtype=float)
        self.begin = float(self.breaks[0]) if begin is None else begin
        self.end = float(self.breaks[-1])
        self.approach = approach
        self.rates: Optional[Rates] = None
        self.led = ""

    @classmethod
    def resting(cls, position: Vector, begin: float = 0.0) -> "Path":
        """Return the path of joints that rest at ``position``, rad (6,), from ``begin``, s, on."""
        piece = np.zeros((1, TERMS, JOINT_COUNT))
        piece[0, 0] = position
        return cls([begin, begin + _REST_PIECE_S], piece)

    def highest_rate(self, time: float) -> float:
        """Return the highest rate of the clock at this time, s; infinite where the path sets none."""
        return math.inf if self.rates is None else self.rates.at(time)

    def at(self, time: float) -> JointState:
        """Return position, velocity and acceleration at this time, s."""
        inside = min(max(time, float(self.breaks[0])), self.end)
        index = min(max(int(np.searchsorted(self.breaks, inside, side="right")) - 1, 0), len(self.coefficients) - 1)
        values = derivatives(inside - float(self.breaks[index])) @ self.coefficients[index]
        if self.approach is not None and inside < self.approach.until:
            values = values + derivatives(inside - self.approach.since) @ self.approach.coefficients
        if inside != time or inside == self.end:
            values[1:] = 0.0
        position, velocity, acceleration = values.tolist()
        return JointState(tuple(position), tuple(velocity), tuple(acceleration))

    def samples(self, times: Array) -> Tuple[Array, Array, Array]:
        """Return positions, velocities and accelerations at many times within the path, s (m,): three arrays (m, 6)."""
        index = np.clip(np.searchsorted(self.breaks, times, side="right") - 1, 0, len(self.coefficients) - 1)
        values = sampled(times - self.breaks[index], self.coefficients[index])
        approach = self.approach
        if approach is not None:
            near = times < approach.until
            added = sampled(times[near] - approach.since, np.broadcast_to(
                approach.coefficients, (int(near.sum()), TERMS, JOINT_COUNT)))
            for value, more in zip(values, added):
                value[near] += more
        return values


def derivatives(u: float) -> Array:
    """Return the powers of u and their first and second derivatives, (3, 6), to multiply with coefficients."""
    u2, u3 = u * u, u * u * u
    return np.array(((1.0, u, u2, u3, u2 * u2, u2 * u3),
                     (0.0, 1.0, 2.0 * u, 3.0 * u2, 4.0 * u3, 5.0 * u2 * u2),
                     (0.0, 0.0, 2.0, 6.0 * u, 12.0 * u2, 20.0 * u3)))


def quintic(duration: Array, start: Tuple[Array, Array, Array], end: Tuple[Array, Array, Array]) -> Array:
    """Return the polynomials with these positions, velocities and accelerations at both ends.

    Args:
        duration: s (n,).
        start: Three arrays (n, 6).
        end: Three arrays (n, 6).

    Returns:
        Coefficients, (n, 6 terms, 6 joints).
    """
    t = np.asarray(duration, dtype=float)[:, None]
    (p, v, a), (q, w, b) = start, end
    way = q - p - v * t - 0.5 * a * t * t
    faster = (w - v - a * t) * t
    more = (b - a) * t * t
    return np.stack((p, v, 0.5 * a, (10.0 * way - 4.0 * faster + 0.5 * more) / t ** 3,
                     (-15.0 * way + 7.0 * faster - more) / t ** 4,
                     (6.0 * way - 3.0 * faster + 0.5 * more) / t ** 5), axis=1)


def cubic(duration: Array, start: Tuple[Array, Array], end: Tuple[Array, Array]) -> Array:
    """Return the polynomials as ``quintic`` does, with positions and velocities at both ends."""
    t = np.asarray(duration, dtype=float)[:, None]
    (p, v), (q, w) = start, end
    way = q - p - v * t
    faster = (w - v) * t
    nothing = np.zeros_like(p)
    return np.stack((p, v, (3.0 * way - faster) / t ** 2, (faster - 2.0 * way) / t ** 3, nothing, nothing), axis=1)


def sampled(u: Array, coefficients: Array) -> Tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations of polynomials, (m, 6) each.

    Args:
        u: The time from the begin of each, s (m,).
        coefficients: Of each, (m, 6 terms, 6 joints).
    """
    u = u[:, None]
    c = [coefficients[:, term, :] for term in range(TERMS)]
    return (((((c[5] * u + c[4]) * u + c[3]) * u + c[2]) * u + c[1]) * u + c[0],
            (((5.0 * c[5] * u + 4.0 * c[4]) * u + 3.0 * c[3]) * u + 2.0 * c[2]) * u + c[1],
            ((20.0 * c[5] * u + 12.0 * c[4]) * u + 6.0 * c[3]) * u + 2.0 * c[2])


def highest_fourths(coefficients: Array, durations: Array) -> Array:
    """Return the highest absolute fourth derivative of quintics, rad/s4 (m, 6), over their durations, s (m,).

    It is linear in time: one end of each has it. Between two places h apart an acceleration lies at most h^2/8 of it
    above those of both.
    """
    c4, c5 = coefficients[:, 4], coefficients[:, 5]
    return np.asarray(24.0 * np.maximum(np.abs(c4), np.abs(c4 + 5.0 * c5 * durations[:, None])))
