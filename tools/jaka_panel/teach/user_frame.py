"""A user frame by three points: the origin, a point on the x axis, a point in the xy plane; further ones check it."""
import math
from typing import List, NamedTuple, Optional, Sequence

import numpy as np

from .rotations import rotation_vector

NEAREST_M = 0.02
"""Least distance between two of the points, and of the third one from the x axis, m."""
LEAST_ANGLE_RAD = math.radians(10.0)
"""Least angle at the origin between the x axis and the third point."""
MOST_POINTS = 20
"""Most points: a person takes them one by one."""
MOST_M = 100.0
"""Largest coordinate, m, of a point: no hall is larger, and most values in mm are noticed."""
FARTHEST_M = 0.01
"""Largest distance of a further point from the plane, m."""
_NAMES = ("the origin", "the point on the x axis", "the point in the xy plane")
_ERROR_M = 0.001
"""Error, m, with which a person takes a point, for the angle that the frame may be off by."""


class CannotTeach(ValueError):
    """The refusal of points or poses from which nothing can be computed; the text says why."""


class TaughtFrame(NamedTuple):
    """A frame in the base.

    Attributes:
        position: Origin, m, (3,).
        rotation_vector: Orientation, rad, (3,).
        residual: Largest distance of a further point from the xy plane, m; None without one: three always fit.
        turn: Turn of the frame by an error of 1 mm in one of its points, at worst, rad.
    """

    position: List[float]
    rotation_vector: List[float]
    residual: Optional[float]
    turn: float


def user_frame(points: Sequence[Sequence[float]]) -> TaughtFrame:
    """Return the frame of points in the base.

    The first three make the frame; further ones say how well the plane was met.

    Args:
        points: Origin, on the x axis, in the xy plane on the side of positive y, then any others of the plane, m,
            (3 to 20, 3).

    Raises:
        CannotTeach: There are too few, they are too near to each other or to one line, or one is far from the plane.
    """
    p = np.asarray(points, dtype=float)
    if p.ndim != 2 or p.shape[1] != 3 or not 3 <= len(p) <= MOST_POINTS or not (np.abs(p) <= MOST_M).all():
        raise CannotTeach("3 to %d points of x, y, z are needed, each within %g m" % (MOST_POINTS, MOST_M))
    for one, other in ((0, 1), (0, 2), (1, 2)):
        distance = float(np.linalg.norm(p[other] - p[one]))
        if distance < NEAREST_M:
            raise CannotTeach("%s and %s are %.1f mm apart; at least %g mm are needed" % (
                _NAMES[one], _NAMES[other], 1000.0 * distance, 1000.0 * NEAREST_M))
    along, aside = p[1] - p[0], p[2] - p[0]
    normal = np.cross(along, aside)
    length = float(np.linalg.norm(along))
    offset = float(np.linalg.norm(normal)) / length
    angle = math.asin(min(1.0, offset / float(np.linalg.norm(aside))))
    if offset < NEAREST_M or angle < LEAST_ANGLE_RAD:
        raise CannotTeach("the three points are almost on one line: the third is %.1f mm from the x axis, at %.1f "
                          "degrees; at least %g mm and %g degrees are needed" % (
                              1000.0 * offset, math.degrees(angle), 1000.0 * NEAREST_M, math.degrees(LEAST_ANGLE_RAD)))
    x, z = along / length, normal / np.linalg.norm(normal)
    residual = None
    if len(p) > 3:
        heights = np.abs((p[3:] - p[0]) @ z)
        residual = float(heights.max())
        if residual > FARTHEST_M:
            raise CannotTeach("point %d is %.1f mm from the plane of the first three; a point was taken at another "
                              "place" % (int(np.argmax(heights)) + 4, 1000.0 * residual))
    return TaughtFrame(p[0].tolist(), rotation_vector(np.column_stack((x, np.cross(z, x), z))), residual,
                       _ERROR_M / min(length, offset))

