"""The line of a velocity jog: where the tool is wanted after some way in the asked direction."""
import math
from typing import NamedTuple, Sequence, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.rotations import Transform, compose, matrix_from_rotation_vector, transform
from jaka_ros_driver.state import Vector

_LEVER = 0.3
"""Distance, m, from the tool's centre of the point whose way a turn of the tool counts as."""
_PARALLEL = 1e-6
"""Largest part of a twist across a line, of its size, up to which it is along the line."""


class JogLine(NamedTuple):
    """A straight way of the tool, a turn about its centre, or both, by one number: the way.

    Along the axes of the base the centre goes straight and the tool turns about a fixed axis. Along the tool's own
    axes, which turn with it, both together are a screw.

    Attributes:
        base_t_start: The tool at way 0.
        direction: Twist for each unit of way: m (3,) and rad (3,), along the axes of ``frame``.
        frame: BASE or TOOL.
    """

    base_t_start: Transform
    direction: Vector
    frame: JogFrame

    def at(self, way: float) -> Transform:
        """Return ``base_t_tool`` after this way."""
        start = self.base_t_start
        shift, turn = _scaled(self.direction[:3], way), _scaled(self.direction[3:], way)
        if self.frame is JogFrame.BASE:
            x, y, z = shift
            place = (start[9] + x, start[10] + y, start[11] + z)
            if not any(turn):
                return start[:9] + place
            return transform(compose(transform(matrix_from_rotation_vector(turn), place), start)[:9], place)
        if any(turn):
            shift = _screwed(turn, shift)
        return compose(start, transform(matrix_from_rotation_vector(turn), shift))

    def speed_of(self, twist: Sequence[float]) -> float:
        """Return the rate of the way, 1/s, of a twist along this line, in its axes; NaN where it leads elsewhere."""
        speed = sum([a * b for a, b in zip(twist, self.direction)]) / sum([a * a for a in self.direction])
        across = max([abs(a - speed * b) for a, b in zip(twist, self.direction)])
        return speed if across <= _PARALLEL * max(map(abs, twist)) else math.nan


def line_along(base_t_tool: Transform, twist: Sequence[float], frame: JogFrame) -> Tuple[JogLine, float]:
    """Return the line from here in the direction of a twist other than zero, and the rate, 1/s, that the twist has."""
    size = math.hypot(*twist[:3], *_scaled(twist[3:], _LEVER))
    return JogLine(base_t_tool, tuple([value / size for value in twist]), frame), size


def turned(a: Transform, v: Sequence[float]) -> Vector:
    """Return a twist, (6,), along the axes of a frame as one along those of its parent."""
    return tuple([a[row] * v[n] + a[row + 1] * v[n + 1] + a[row + 2] * v[n + 2] for n in (0, 3) for row in (0, 3, 6)])


def _scaled(v: Sequence[float], factor: float) -> Vector:
    return tuple([factor * value for value in v])


def _screwed(turn: Vector, shift: Vector) -> Vector:
    """Return where the centre gets, m, that moves by ``shift`` along its own axes while these turn by ``turn``, rad."""
    angle = math.hypot(*turn)
    if angle < 1e-4:
        once, twice = 0.5, 1.0 / 6.0
    else:
        once, twice = (1.0 - math.cos(angle)) / angle ** 2, (angle - math.sin(angle)) / angle ** 3
    across = _cross(turn, shift)
    return tuple([s + once * a + twice * b for s, a, b in zip(shift, across, _cross(turn, across))])


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
