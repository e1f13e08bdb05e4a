"""The capsules of an arm as cylinders with a ball at either end, in the frames of its URDF's links.

Link n of the URDF has its own frame (see ``kinematics/urdf.py``): DH frame n before the shift of its row, so the points
are shifted.
"""
import math
from typing import List, NamedTuple

from jaka_ros_driver.clearance.shape import Capsule
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Vector3


class Solid(NamedTuple):
    """A ball, or a cylinder.

    Attributes:
        centre: In the frame of the link, m.
        rpy: The turn of z into the axis of a cylinder, rad.
        length: Of a cylinder, m; 0 of a ball.
    """

    centre: Vector3
    rpy: Vector3
    length: float


def solids_of(model: ArmModel, capsule: Capsule) -> List[Solid]:
    """Return the solids of a capsule in the frame of link ``capsule.frame``, 0 the base to 6."""
    return solids_between(_in_link(model, capsule.frame, capsule.start), _in_link(model, capsule.frame, capsule.end))


def solids_between(start: Vector3, end: Vector3) -> List[Solid]:
    """Return the solids of a capsule between two points, m: a ball, and where they differ, a cylinder and a ball."""
    solids = [Solid(start, (0.0, 0.0, 0.0), 0.0)]
    x, y, z = (b - a for a, b in zip(start, end))
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2]))
        solids += [Solid(middle, (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)), length),
                   Solid(end, (0.0, 0.0, 0.0), 0.0)]
    return solids


def _in_link(model: ArmModel, frame: int, point: Vector3) -> Vector3:
    """Return a point of a DH frame in the frame of the link: Tz(d) Tx(a) Rx(alpha) of it."""
    if frame == 0:
        return point
    x, y, z = point
    a, d, ca, sa, _ = model.link_terms[frame - 1]
    return x + a, ca * y - sa * z, d + sa * y + ca * z
