"""Inverse kinematics without a closed form: Newton refinement, and a search over joint 6 for the A12.

The A12's search (experimental): once q6 is assumed, axis 5 and the meeting point of axes 4 and 5 are known;
that point gives q1 (two ways), axis 4 is perpendicular to axes 2 and 5 (two signs), and what remains is one
equation, |o3 - o1| = a2. Its roots in q6 are bracketed on a grid and refined.
"""
import math
from typing import TYPE_CHECKING, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import ArmModel, DhRow
from jaka_ros_driver.kinematics.closed_forms import Angles, Branches
from jaka_ros_driver.kinematics.forward import forward, jacobian
from jaka_ros_driver.kinematics.rotations import Transform, turn_between, wrap_angle
from jaka_ros_driver.state import Vector

_REFINE_STEPS = 20
"""Most steps of a refinement; it begins near its end, and each step squares the error, so more only delay a failure."""
_REFINED = 1e-11
"""Length of the remaining twist (m and rad together) below which a refinement ends."""
_SETTLE_STEPS = 15
"""Most steps of a search that may begin at a singularity; the caller looks how near they came."""
_SAME_BRANCH = 1e-6
"""Largest difference, rad, in any joint up to which two refined branches count as one."""
_GRID = 720
"""Steps of the search over joint 6."""
_EDGE_GRID = 33
"""Points of the finer search next to an edge of the domain."""
_ROOT_TOLERANCE = 1e-9
"""Largest residual, m, of the equation at a root."""

if TYPE_CHECKING:
    Samples = np.ndarray[Tuple[int], np.dtype[np.float64]]


def refine(model: ArmModel, target: Transform, start: Sequence[float]) -> Optional[Vector]:
    """Refine joint angles near ``start``, rad (6,), until they reach the target with the model's real DH table.

    The result is not wrapped; None where the iteration does not converge.
    """
    angles = np.array(start, dtype=float)
    for _ in range(_REFINE_STEPS):
        twist = _twist(forward(model, tuple(angles)), target)
        if max(map(abs, twist)) < _REFINED:
            return tuple(float(angle) for angle in angles)
        try:
            step = np.linalg.solve(jacobian(model, tuple(angles)), np.array(twist))
        except np.linalg.LinAlgError:
            return None
        angles = angles + step * min(1.0, 0.5 / max(1e-12, float(np.max(np.abs(step)))))
    return None


def settle(model: ArmModel, target: Transform, start: Sequence[float]) -> Vector:
    """Return the joint angles near ``start``, rad (6,), that come nearest to the target, also at singularities.

    The result is not wrapped. It takes at most ``_SETTLE_STEPS`` steps of Levenberg-Marquardt; the caller checks how
    near the result is.
    """
    angles = np.array(start, dtype=float)
    twist = np.array(_twist(forward(model, tuple(angles)), target))
    damping = 1e-6
    for _ in range(_SETTLE_STEPS):
        if float(np.max(np.abs(twist))) < _REFINED:
            break
        jac = jacobian(model, tuple(angles))
        step = np.linalg.solve(jac.T @ jac + damping * np.eye(len(angles)), jac.T @ twist)
        tried = np.array(_twist(forward(model, tuple(angles + step)), target))
        if float(tried @ tried) < float(twist @ twist):
            angles, twist, damping = angles + step, tried, damping * 0.1
        else:
            damping *= 10.0
    return tuple(float(angle) for angle in angles)


def refine_all(model: ArmModel, target: Transform, starts: Sequence[Sequence[float]]) -> List[Vector]:
    """Return the results of ``refine`` for each start, without duplicates."""
    found: List[Vector] = []
    for start in starts:
        angles = refine(model, target, start)
        if angles is not None and not any(_is_same(angles, other) for other in found):
            found.append(tuple(wrap_angle(angle) for angle in angles))
    return found


def _is_same(a: Vector, b: Vector) -> bool:
    return all(abs(wrap_angle(x - y)) < _SAME_BRANCH for x, y in zip(a, b))


def _twist(reached: Transform, target: Transform) -> Tuple[float, ...]:
    """Return the twist from ``reached`` to ``target`` in the base frame: translation, m (3), then rotation, rad (3)."""
    a, b = reached, target
    return (b[9] - a[9], b[10] - a[10], b[11] - a[11]) + turn_between(a, b)


class _JointSixSearch:
    """The A12's remaining equation in q6, for one target and one choice of the two signs."""

    def __init__(self, dh: Sequence[DhRow], target: Transform) -> None:
        _, row2, row3, row4, row5, row6 = dh
        self._target = target
        self._upper, self._offset, self._d4, self._d5 = row2.a, row2.d + row3.d, row4.d, row5.d
        zx, zy, zz, px, py, pz = target[2], target[5], target[8], target[9], target[10], target[11]
        self._wrist = px - row6.d * zx, py - row6.d * zy, pz - row6.d * zz - dh[0].d

    def residuals(self, q6: "Samples") -> "np.ndarray[Tuple[int, int], np.dtype[np.float64]]":
        """Return |o3 - o1| - a2, m, for the four sign choices, shape (4, n).

        It is NaN where joint 1 cannot reach the point.
        """
        xx, yx, _, xy, yy, _, xz, yz, _ = self._target[:9]
        c6, s6 = np.cos(q6), np.sin(q6)
        z4x, z4y, z4z = s6 * xx + c6 * yx, s6 * xy + c6 * yy, s6 * xz + c6 * yz
        wx, wy, wz = self._wrist
        x, y, z = wx - self._d5 * z4x, wy - self._d5 * z4y, wz - self._d5 * z4z
        squared = x * x + y * y
        with np.errstate(invalid="ignore", divide="ignore"):
            along = np.sqrt(squared - self._offset ** 2)
            rows = []
            for shoulder in (1.0, -1.0):
                # unit vector of the arm's plane: (x, y) = along * (c1, s1) + offset * (s1, -c1)
                c1 = (shoulder * along * x - self._offset * y) / squared
                s1 = (shoulder * along * y + self._offset * x) / squared
                z4_along = c1 * z4x + s1 * z4y
                length = np.hypot(z4_along, z4z)
                for wrist in (1.0, -1.0):
                    scale = wrist * self._d4 / length
                    rows.append(np.hypot(shoulder * along + scale * z4z, z - scale * z4_along) - self._upper)
        return np.array(rows)

    def residual(self, q6: float, choice: int) -> float:
        """Return one of ``residuals`` as a float; NaN where joint 1 cannot reach the point."""
        state = self._state(q6, choice)
        return math.nan if state is None else math.hypot(state[2], state[3]) - self._upper

    def _state(self, q6: float, choice: int) -> Optional[Tuple[float, ...]]:
        """Return c1, s1; o3 and z3, each along and above the shoulder; z4 (3,).

        The result is None where joint 1 cannot reach the point.
        """
        shoulder, wrist = (1.0, 1.0, -1.0, -1.0)[choice], (1.0, -1.0, 1.0, -1.0)[choice]
        xx, yx, _, xy, yy, _, xz, yz, _ = self._target[:9]
        c6, s6 = math.cos(q6), math.sin(q6)
        z4x, z4y, z4z = s6 * xx + c6 * yx, s6 * xy + c6 * yy, s6 * xz + c6 * yz
        wx, wy, wz = self._wrist
        x, y, z = wx - self._d5 * z4x, wy - self._d5 * z4y, wz - self._d5 * z4z
        squared = x * x + y * y
        if squared < self._offset ** 2 or squared == 0.0:
            return None
        along = shoulder * math.sqrt(squared - self._offset ** 2)
        c1, s1 = (along * x - self._offset * y) / squared, (along * y + self._offset * x) / squared
        z4_along = c1 * z4x + s1 * z4y
        length = math.hypot(z4_along, z4z)
        if length == 0.0:
            return None
        z3_along, z3_up = -wrist * z4z / length, wrist * z4_along / length
        return c1, s1, along - self._d4 * z3_along, z - self._d4 * z3_up, z3_along, z3_up, z4x, z4y, z4z

    def angles(self, q6: float, choice: int) -> Optional[Angles]:
        """Return all joint angles of the solution at a root."""
        state = self._state(q6, choice)
        if state is None:
            return None
        c1, s1, along, up, z3_along, z3_up, z4x, z4y, z4z = state
        q2 = math.atan2(up, along)
        q23 = math.atan2(z3_along, -z3_up)
        c23, s23 = math.cos(q23), math.sin(q23)
        x3x, x3y, x3z = c1 * c23, s1 * c23, s23
        q4 = math.atan2(-(z4x * x3x + z4y * x3y + z4z * x3z), z4x * s1 - z4y * c1)
        z3x, z3y, z3z = c1 * z3_along, s1 * z3_along, z3_up
        x4x, x4y, x4z = z4y * z3z - z4z * z3y, z4z * z3x - z4x * z3z, z4x * z3y - z4y * z3x
        xx, yx, _, xy, yy, _, xz, yz, _ = self._target[:9]
        c6, s6 = math.cos(q6), math.sin(q6)
        x5x, x5y, x5z = c6 * xx - s6 * yx, c6 * xy - s6 * yy, c6 * xz - s6 * yz
        q5 = math.atan2(-(x5x * z3x + x5y * z3y + x5z * z3z), x5x * x4x + x5y * x4y + x5z * x4z)
        return math.atan2(s1, c1), q2, q23 - q2, q4, q5, q6


def two_parallel(dh: Sequence[DhRow], base_t_flange: Transform) -> Branches:
    """Return every branch of the A12's family that the search finds. Arguments as in ``closed_forms``."""
    search = _JointSixSearch(dh, base_t_flange)
    found: List[Angles] = []
    for choice, low, high in _brackets(search):
        root = _root(search, choice, low, high)
        angles = search.angles(root, choice)
        if angles is not None and abs(search.residual(root, choice)) < _ROOT_TOLERANCE:
            if not any(_is_same(angles, other) for other in found):
                found.append(angles)
    return Branches(found, True, "" if found else "out of reach: no angle of joint 6 lets the arm close")


def _brackets(search: _JointSixSearch) -> Iterator[Tuple[int, float, float]]:
    """Return an interval (sign choice, low, high) around each root that the grid shows; a root may be in two of them.

    Near an edge of the domain the residual behaves like a square root. There a second grid is used, whose points are
    equidistant in the square root of the distance to the edge, in which the residual is smooth.
    """
    grid = np.linspace(-math.pi, math.pi, _GRID + 1)
    for choice, row in enumerate(search.residuals(grid)):
        for low, high in _scan(search, choice, grid, row):
            yield choice, low, high
        valid = np.isfinite(row)
        for n in np.flatnonzero(valid[:-1] != valid[1:]):
            inside, outside = (n, n + 1) if valid[n] else (n + 1, n)
            edge = _edge_of_domain(search, choice, float(grid[inside]), float(grid[outside]))
            fine = edge + (inside - outside) * np.linspace(0.0, math.sqrt(2.0 * (grid[1] - grid[0])), _EDGE_GRID) ** 2
            for low, high in _scan(search, choice, fine, search.residuals(fine)[choice]):
                yield choice, low, high


def _scan(search: _JointSixSearch, choice: int, points: "Samples", values: "Samples") -> Iterator[Tuple[float, float]]:
    """Return the intervals between neighbouring points with a change of sign, or with a minimum that may hide two
    roots.
    """
    with np.errstate(invalid="ignore"):
        valid = np.isfinite(values)
        changes = valid[:-1] & valid[1:] & (np.signbit(values[:-1]) != np.signbit(values[1:]))
        size = np.abs(values)
        slope = np.maximum(np.abs(values[:-2] - values[1:-1]), np.abs(values[2:] - values[1:-1]))
        dips = ((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (size[1:-1] < 4.0 * slope)
                & ~changes[:-1] & ~changes[1:])
    for n in np.flatnonzero(changes):
        yield float(points[n]), float(points[n + 1])
    for n in np.flatnonzero(dips):
        low, high = float(points[n]), float(points[n + 2])
        bottom = _lowest(search, choice, low, high)
        yield low, bottom
        yield bottom, high


def _edge_of_domain(search: _JointSixSearch, choice: int, inside: float, outside: float) -> float:
    """Find the last q6, from ``inside`` towards ``outside``, at which joint 1 still reaches the point."""
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        if math.isnan(search.residual(middle, choice)):
            outside = middle
        else:
            inside = middle
    return inside


def _lowest(search: _JointSixSearch, choice: int, low: float, high: float) -> float:
    """Find the q6 in low..high with the smallest |residual|, or one where its sign has changed (golden section)."""
    shrink = 0.5 * (math.sqrt(5.0) - 1.0)
    negative = search.residual(low, choice) < 0.0
    left, right = high - shrink * (high - low), low + shrink * (high - low)
    at_left, at_right = search.residual(left, choice), search.residual(right, choice)
    for _ in range(60):
        if (at_left < 0.0) != negative:
            return left
        if (at_right < 0.0) != negative:
            return right
        if abs(at_left) < abs(at_right):
            high, right, at_right = right, left, at_left
            left = high - shrink * (high - low)
            at_left = search.residual(left, choice)
        else:
            low, left, at_left = left, right, at_right
            right = low + shrink * (high - low)
            at_right = search.residual(right, choice)
    return left


def _root(search: _JointSixSearch, choice: int, low: float, high: float) -> float:
    """Find the root between low and high (regula falsi, Illinois variant).

    Without a change of sign it is the better of both.
    """
    at_low, at_high = search.residual(low, choice), search.residual(high, choice)
    if at_low == 0.0 or (at_low < 0.0) == (at_high < 0.0):
        return low if abs(at_low) < abs(at_high) else high
    for _ in range(100):
        if at_high == 0.0:
            return high
        middle = (low * at_high - high * at_low) / (at_high - at_low)
        at_middle = search.residual(middle, choice)
        if abs(at_middle) < 1e-15:
            return middle
        if (at_middle < 0.0) == (at_high < 0.0):
            at_low *= 0.5
        else:
            low, at_low = high, at_high
        if abs(high - middle) < 1e-15:
            return middle
        high, at_high = middle, at_middle
    return high
