"""Kinematics of the active tool in the active user frame, on top of the kinematics of the flange."""
import math
from typing import List, Optional, Sequence, Tuple

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import PoseOutsideLimits, UnreachablePose
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.inverse import inverse, inverse_all
from jaka_ros_driver.kinematics.numeric_inverse import refine
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    Transform,
    Vector3,
    compose,
    invert,
    matrix_from_rotation_vector,
    matrix_from_rpy,
    pose_from_transform,
    rotation_vector_from_matrix,
    transform,
    transform_from_pose,
)
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.state import Vector

LIMIT_TOLERANCE = 1e-5
"""Distance, rad, from a soft limit within which a joint counts as being on it."""

SAME_ANGLE = 1e-6
"""Difference, rad, from the arm's future position below which a target counts as the same place."""

_FOLLOWED = 0.3  # rad; an iterative solution that is no farther than this from the reference counts as the same branch


def finite_six(what: str, values: Sequence[float]) -> Vector:
    """Return the values as a tuple; raise TargetRejected unless they are six finite numbers."""
    if len(values) != 6 or not all(math.isfinite(v) for v in values):
        raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "%s must be six finite numbers" % what)
    return tuple(values)


def checked_transform(pose: Pose) -> Transform:
    """Return the pose as a Transform; raise TargetRejected unless it has six finite numbers."""
    finite_six("pose", tuple(pose.position) + tuple(pose.rpy))
    return transform_from_pose(pose)


class ArmFrames:
    """Model, active tool and active user frame.

    Attributes:
        model: The arm.
        flange_t_tool: Active tool in the flange frame.
        base_t_user: Active user frame in the base frame.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        self.flange_t_tool: Transform = IDENTITY
        self.tool_t_flange: Transform = IDENTITY
        self.base_t_user: Transform = IDENTITY
        self.user_t_base: Transform = IDENTITY

    def set_tool(self, flange_t_tool: Transform) -> None:
        self.flange_t_tool, self.tool_t_flange = flange_t_tool, invert(flange_t_tool)

    def set_user_frame(self, base_t_user: Transform) -> None:
        self.base_t_user, self.user_t_base = base_t_user, invert(base_t_user)

    def tool_at(self, joint_position: Sequence[float]) -> Transform:
        """Return ``base_t_tool`` at these joints."""
        return compose(forward(self.model, joint_position), self.flange_t_tool)

    def pose_at(self, joint_position: Sequence[float]) -> Pose:
        """Return the pose of the active tool in the active user frame at these joints."""
        return pose_from_transform(compose(self.user_t_base, self.tool_at(joint_position)))

    def in_base(self, pose: Pose) -> Transform:
        """Return ``base_t_tool`` of a pose in the active user frame; raise as ``checked_transform`` does."""
        return compose(self.base_t_user, checked_transform(pose))

    def displaced(self, base_t_tool: Transform, increment: Pose) -> Transform:
        """Return the pose, moved along and turned about the axes of the active user frame; raise as ``in_base`` does.

        docs/controller-protocol.md section 5.4.1: increments add along the axes in which the pose is reported.
        """
        finite_six("increment", tuple(increment.position) + tuple(increment.rpy))
        turn = compose(self.base_t_user, transform(matrix_from_rpy(increment.rpy), (0.0, 0.0, 0.0)))
        turned = compose(compose(turn, self.user_t_base), base_t_tool)
        x, y, z = base_t_tool[9:]
        dx, dy, dz = rotated(self.base_t_user, increment.position)
        return transform(turned[:9], (x + dx, y + dy, z + dz))

    def nearest_joints(self, base_t_tool: Transform, reference: Sequence[float]) -> Optional[Vector]:
        """Return the joints for a tool pose, rad (6,), nearest to the reference; None where it is out of reach.

        Limits are not checked.
        """
        return nearest_joints(self.model, compose(base_t_tool, self.tool_t_flange), reference)

    def reachable_joints(self, base_t_tool: Transform, reference: Sequence[float]) -> Vector:
        """Return the joints within their limits, rad (6,), nearest to the reference, that bring the active tool there.

        Raises:
            TargetRejected: It is out of reach (0x0F0017), or a joint would leave its limits (0x0F0011).
        """
        try:
            return inverse(self.model, compose(base_t_tool, self.tool_t_flange), reference)
        except PoseOutsideLimits as error:
            raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, str(error)) from error
        except UnreachablePose as error:
            raise TargetRejected(events.TARGET_UNREACHABLE, str(error)) from error

    def joints_outside(self, joint_position: Sequence[float], margin: float) -> List[Tuple[int, bool]]:
        """Return the joints more than ``margin``, rad, outside their limits, each with True where that is the upper
        one.
        """
        return [(joint, value > high + margin)
                for joint, (value, (low, high)) in enumerate(zip(joint_position, self.model.joint_limits))
                if not low - margin <= value <= high + margin]

    def joint_outside(self, joint_position: Sequence[float], margin: float = 1e-9) -> Optional[Tuple[int, bool]]:
        """Return the first of ``joints_outside``; None if there is none."""
        return next(iter(self.joints_outside(joint_position, margin)), None)

    def joint_on_limit(self, joint_position: Sequence[float]) -> Optional[Tuple[int, bool]]:
        """Return the first joint on a soft limit, and True where that is the upper one; None if there is none."""
        return self.joint_outside(joint_position, -LIMIT_TOLERANCE)


def rotated(frame: Transform, vector: Sequence[float]) -> Vector3:
    """Return a direction of the frame in the axes of its parent."""
    x, y, z = vector
    return (frame[0] * x + frame[1] * y + frame[2] * z, frame[3] * x + frame[4] * y + frame[5] * z,
            frame[6] * x + frame[7] * y + frame[8] * z)


def turned(start: Transform, rotation_vector: Sequence[float], position: Sequence[float]) -> Transform:
    """Return a Transform at position with the rotation of start, turned about the parent's axes by rotation_vector."""
    turn = transform(matrix_from_rotation_vector(rotation_vector), (0.0, 0.0, 0.0))
    return transform(compose(turn, start)[:9], position)


def rotation_between(start: Transform, end: Transform) -> Vector3:
    """Return the shortest rotation vector, rad, about the axes of the base, from start's orientation to end's."""
    return rotation_vector_from_matrix(compose(end, invert(start)))


def nearest_joints(model: ArmModel, base_t_flange: Transform, reference: Sequence[float]) -> Optional[Vector]:
    """Return the joints for a flange pose, rad (6,), nearest to the reference; None where it is out of reach.

    Limits are not checked.
    """
    if not model.has_closed_form:
        followed = refine(model, base_t_flange, reference)
        if followed is not None and all(abs(a - b) < _FOLLOWED for a, b in zip(followed, reference)):
            return followed
    best: Optional[Vector] = None
    best_cost = math.inf
    remainder, turn = math.remainder, math.tau
    r1, r2, r3, r4, r5, r6 = reference
    for q1, q2, q3, q4, q5, q6 in inverse_all(model, base_t_flange, reference):
        d1, d2, d3 = remainder(q1 - r1, turn), remainder(q2 - r2, turn), remainder(q3 - r3, turn)
        d4, d5, d6 = remainder(q4 - r4, turn), remainder(q5 - r5, turn), remainder(q6 - r6, turn)
        cost = d1 * d1 + d2 * d2 + d3 * d3 + d4 * d4 + d5 * d5 + d6 * d6
        if cost < best_cost:
            best, best_cost = (r1 + d1, r2 + d2, r3 + d3, r4 + d4, r5 + d5, r6 + d6), cost
    return best


def same_joints(a: Vector, b: Vector) -> bool:
    """Return whether two joint positions, rad (6,), differ by less than ``SAME_ANGLE`` in every joint."""
    return all(abs(x - y) < SAME_ANGLE for x, y in zip(a, b))
