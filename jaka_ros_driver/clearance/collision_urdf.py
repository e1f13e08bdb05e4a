"""The capsules as collision geometry of the generated URDF, so that a planner sees the arm that the guard sees.

URDF has no capsule: each is a cylinder with a ball at either end.
"""
from typing import Dict, List, Sequence
from xml.sax.saxutils import quoteattr

from jaka_ros_driver.clearance.shape import Capsule, arm_shape
from jaka_ros_driver.clearance.solids import Solid, solids_of
from jaka_ros_driver.kinematics.arm_models import ArmModel


def collision_elements(model: ArmModel, tool: Sequence[Capsule] = ()) -> Dict[int, List[str]]:
    """Return the ``<collision>`` elements of each link, 0 the base to 6, for ``urdf_from_model``.

    Args:
        model: The arm.
        tool: Capsules in the flange's frame; link 6 carries them.
    """
    elements: Dict[int, List[str]] = {link: [] for link in range(len(model.dh) + 1)}
    for capsule in arm_shape(model, tool).capsules:
        elements[capsule.frame] += [_element(capsule, solid) for solid in solids_of(model, capsule)]
    return elements


def _element(capsule: Capsule, solid: Solid) -> str:
    shape = '<sphere radius="%r"/>' % capsule.radius
    if solid.length > 0.0:
        shape = '<cylinder radius="%r" length="%r"/>' % (capsule.radius, solid.length)
    return '<collision name=%s><origin xyz="%r %r %r" rpy="%r %r %r"/><geometry>%s</geometry></collision>' % (
        (quoteattr(capsule.name),) + solid.centre + solid.rpy + (shape,))
