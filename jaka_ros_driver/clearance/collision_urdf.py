"""The capsules as collision geometry of the generated URDF, so that a planner sees the arm that the guard sees.

URDF has no capsule: each is a cylinder with a ball at either end. Link n of the URDF has its own frame (see
``kinematics/urdf.py``): DH frame n before the shift of its row, so the points are shifted.
"""
import math
from typing import Dict, List, Sequence, Tuple
from xml.sax.saxutils import quoteattr

from jaka_ros_driver.clearance.shape import Capsule, arm_shape
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import Vector3


def collision_elements(model: ArmModel, tool: Sequence[Capsule] = ()) -> Dict[int, List[str]]:
    """Return the ``<collision>`` elements of each link, 0 the base to 6, for ``urdf_from_model``.

    Args:
        model: The arm.
        tool: Capsules in the flange's frame; link 6 carries them.
    """
    elements: Dict[int, List[str]] = {link: [] for link in range(len(model.dh) + 1)}
    for capsule in arm_shape(model, tool).capsules:
        start, end = (_in_link(model, capsule.frame, point) for point in (capsule.start, capsule.end))
        elements[capsule.frame] += _elements(capsule, start, end)
    return elements


def _in_link(model: ArmModel, frame: int, point: Vector3) -> Vector3:
    """Return a point of a DH frame in the frame of the link: Tz(d) Tx(a) Rx(alpha) of it."""
    if frame == 0:
        return point
    x, y, z = point
    a, d, ca, sa, _ = model.link_terms[frame - 1]
    return x + a, ca * y - sa * z, d + sa * y + ca * z


def _elements(capsule: Capsule, start: Vector3, end: Vector3) -> List[str]:
    name, radius = quoteattr(capsule.name), capsule.radius
    ball = '<sphere radius="%r"/>' % radius
    elements = [_element(name, start, (0.0, 0.0), ball)]
    x, y, z = (b - a for a, b in zip(start, end))
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]), 0.5 * (start[2] + end[2]))
        turn = math.atan2(math.hypot(x, y), z), math.atan2(y, x)  # of z into the axis: about y, then about z
        elements += [_element(name, middle, turn, '<cylinder radius="%r" length="%r"/>' % (radius, length)),
                     _element(name, end, (0.0, 0.0), ball)]
    return elements


def _element(name: str, origin: Vector3, pitch_yaw: Tuple[float, float], shape: str) -> str:
    return '<collision name=%s><origin xyz="%r %r %r" rpy="0 %r %r"/><geometry>%s</geometry></collision>' % (
        (name,) + origin + pitch_yaw + (shape,))
