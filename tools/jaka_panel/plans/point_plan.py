"""A plan from points of joints, as a page has them."""
import math
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

SHOWN = 400
"""Places of a path that a page draws: enough for a smooth curve."""
MOST_POINTS = 2000
"""Most points of a plan: a page's message has room for them."""
_JOINTS = 6
_LONGEST_S = 3600.0
"""Longest plan of points, s: an hour; a time beyond it is in other units."""


class WrongPlan(ValueError):
    """The error of points that make no plan; the text says why."""


class Plan(NamedTuple):
    """A trajectory of six joints.

    Attributes:
        time: Times of the points, s from the start, (n,).
        position: Joints at the points, rad, (n, 6).
        velocity: Their velocities, rad/s, (n, 6), or empty rows where only positions were given.
        acceleration: Their accelerations, rad/s2, likewise.
        warnings: Warnings for the user.
        begins_here: The first point is where the arm must be; else it is led there in the first point's time.
    """

    time: Sequence[float]
    position: Sequence[Sequence[float]]
    velocity: Sequence[Sequence[float]]
    acceleration: Sequence[Sequence[float]]
    warnings: Sequence[str]
    begins_here: bool

    def shown(self, name: str) -> Dict[str, Any]:
        """Return the plan for a page, with at most ``SHOWN`` joint vectors of its path."""
        places = self._places()
        return {"plan": name, "duration": round(self.time[-1], 3), "start": list(self.position[0]),
                "end": list(self.position[-1]), "t": [round(at, 4) for at, _ in places],
                "path": [[round(value, 5) for value in joints] for _, joints in places],
                "warnings": list(self.warnings)}

    def _places(self) -> List[Tuple[float, Sequence[float]]]:
        first, last = self.time[0], self.time[-1]
        if len(self.time) == 1:
            return [(last, self.position[0])]
        places, n = [], 0
        count = min(SHOWN, max(2, len(self.time) * 10))
        for step in range(count):
            at = first + (last - first) * step / (count - 1)
            while n < len(self.time) - 2 and self.time[n + 1] < at:
                n += 1
            places.append((at, self._between(n, at)))
        return places

    def _between(self, n: int, at: float) -> Sequence[float]:
        """Interpolate the joints between point n and the next: a line, or a cubic where there are velocities."""
        span = self.time[n + 1] - self.time[n]
        u = min(1.0, max(0.0, (at - self.time[n]) / span))
        a, b = self.position[n], self.position[n + 1]
        if not self.velocity[n] or not self.velocity[n + 1]:
            return [p + u * (q - p) for p, q in zip(a, b)]
        h00, h10 = (1 + 2 * u) * (1 - u) ** 2, u * (1 - u) ** 2
        h01, h11 = u * u * (3 - 2 * u), u * u * (u - 1)
        return [h00 * p + h10 * span * v + h01 * q + h11 * span * w
                for p, v, q, w in zip(a, self.velocity[n], b, self.velocity[n + 1])]


def plan_of_points(points: Any, limits: Optional[Sequence[Mapping[str, Any]]]) -> Plan:
    """Return the plan of points ``{"t": s, "q": [6], "v": [6]}``, v in all but the ends or in none; raise WrongPlan.

    Args:
        points: Points that a page has sent.
        limits: ``lower``, ``upper``, rad, of each joint, where they are known. The driver audits the whole way again.
    """
    if not isinstance(points, list) or not 1 <= len(points) <= MOST_POINTS:
        raise WrongPlan("points must be 1 to %d" % MOST_POINTS)
    time: List[float] = []
    position: List[List[float]] = []
    velocity: List[List[float]] = []
    for n, point in enumerate(points):
        if not isinstance(point, dict):
            raise WrongPlan("point %d is no object" % (n + 1))
        at = _numbers([point.get("t")], 1, "t of point %d" % (n + 1))[0]
        if (time and at <= time[-1]) or not 0.0 <= at <= _LONGEST_S:
            raise WrongPlan("t of point %d is %g s; times rise, from 0 to %g s" % (n + 1, at, _LONGEST_S))
        time.append(at)
        position.append(_numbers(point.get("q"), _JOINTS, "q of point %d" % (n + 1)))
        velocity.append([] if point.get("v") is None else _numbers(point["v"], _JOINTS, "v of point %d" % (n + 1)))
        for number, (limit, value) in enumerate(zip(limits or (), position[-1]), 1):
            if not limit["lower"] <= value <= limit["upper"]:
                raise WrongPlan("joint %d of point %d is %.4f rad; it can go from %.4f to %.4f" % (
                    number, n + 1, value, limit["lower"], limit["upper"]))
    if any(velocity) and not all(velocity):
        raise WrongPlan("either every point has v or none")
    if time[-1] == 0.0:
        raise WrongPlan("the last point needs a time above 0")
    warnings = [] if any(velocity) or len(points) < 3 else [
        "the points have no speeds: the arm goes along straight lines with rounded corners"]
    return Plan(time, position, velocity, [[] for _ in time], warnings, time[0] == 0.0)


def _numbers(values: Any, count: int, name: str) -> List[float]:
    if not isinstance(values, list) or len(values) != count or not all(
            type(value) in (int, float) and math.isfinite(value) for value in values):
        raise WrongPlan("%s must be %s" % (name, "a number" if count == 1 else "%d numbers" % count))
    return [float(value) for value in values]
