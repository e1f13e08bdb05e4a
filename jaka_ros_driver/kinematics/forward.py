"""Forward kinematics, Jacobian, and the distance of a joint position from singularities."""
import math
from typing import NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_ros_driver.kinematics.arm_models import SPHERICAL_WRIST, THREE_PARALLEL, ArmModel
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform, compose


def forward(model: ArmModel, joint_position: Sequence[float]) -> Transform:
    """Return ``base_T_flange`` at these joint angles, rad, shape (6,). Joint limits are not checked."""
    return link_transforms(model, joint_position)[-1]


def link_transforms(model: ArmModel, joint_position: Sequence[float]) -> Tuple[Transform, ...]:
    """Return seven Transforms in the base frame: the base itself, then DH frames 1..6; the last is the flange."""
    xx, xy, xz = 1.0, 0.0, 0.0
    yx, yy, yz = 0.0, 1.0, 0.0
    zx, zy, zz = 0.0, 0.0, 1.0
    px = py = pz = 0.0
    frames = [IDENTITY]
    for angle, (a, d, ca, sa, offset) in zip(joint_position, model.link_terms):
        c = math.cos(angle + offset)
        s = math.sin(angle + offset)
        ux, uy, uz = c * yx - s * xx, c * yy - s * xy, c * yz - s * xz
        xx, xy, xz = c * xx + s * yx, c * xy + s * yy, c * xz + s * yz
        px, py, pz = px + d * zx + a * xx, py + d * zy + a * xy, pz + d * zz + a * xz
        yx, yy, yz = ca * ux + sa * zx, ca * uy + sa * zy, ca * uz + sa * zz
        zx, zy, zz = ca * zx - sa * ux, ca * zy - sa * uy, ca * zz - sa * uz
        frames.append((xx, yx, zx, xy, yy, zy, xz, yz, zz, px, py, pz))
    return tuple(frames)


def jacobian(model: ArmModel, joint_position: Sequence[float], flange_t_tool: Optional[Transform] = None
             ) -> "np.ndarray[Tuple[int, int], np.dtype[np.float64]]":
    """Return the geometric Jacobian in the base frame, shape (6, 6).

    Column n is the effect of 1 rad/s of joint n+1: rows 0..2 the velocity of the tool point, m/s; rows 3..5 the angular
    velocity, rad/s. Without ``flange_t_tool`` the tool point is the flange.
    """
    frames = link_transforms(model, joint_position)
    return jacobian_of_links(frames, frames[-1] if flange_t_tool is None else compose(frames[-1], flange_t_tool))


def jacobian_of_links(frames: Sequence[Transform], tip: Transform
                      ) -> "np.ndarray[Tuple[int, int], np.dtype[np.float64]]":
    """Return ``jacobian`` of the tool point ``tip`` (base frame) by the result of ``link_transforms``."""
    columns = []
    for frame in frames[:-1]:
        zx, zy, zz = frame[2], frame[5], frame[8]
        rx, ry, rz = tip[9] - frame[9], tip[10] - frame[10], tip[11] - frame[11]
        columns.append((zy * rz - zz * ry, zz * rx - zx * rz, zx * ry - zy * rx, zx, zy, zz))
    return np.array(columns).T


class SingularityMeasures(NamedTuple):
    """The distances of a joint position from each singularity; 0 is singular.

    Attributes:
        wrist: |sin q5|: axes 4 and 6 line up (J6 with J2..J4 in the main family). Dimensionless, 0..1.
        elbow: |sin q3| (of the angle between upper arm and forearm): arm straight or folded. Dimensionless, 0..1.
        shoulder: Distance of the wrist point from where axis 1 can no longer move it along the arm's plane, m.
    """

    wrist: float
    elbow: float
    shoulder: float


def singularity_measures(model: ArmModel, joint_position: Sequence[float]) -> SingularityMeasures:
    """Return the arm's distances from its singularities at these joint angles, rad, shape (6,).

    In the main family and MiniCobo the Jacobian's determinant is the product of the three measures and two link
    lengths. The A12's has no such factors: there, ``wrist`` is |det J| / (a2 * d4 * (a2 + d4)), and the other two are
    infinite.
    """
    frames = link_transforms(model, joint_position)
    return SingularityMeasures(*map(abs, signed_measures(model, joint_position, frames)))


def signed_measures(model: ArmModel, joint_position: Sequence[float], frames: Sequence[Transform]
                    ) -> SingularityMeasures:
    """Return the singularity measures with the sign that tells the branches on both sides of each apart.

    frames: The result of ``link_transforms`` at these joint angles, rad, shape (6,).
    """
    rows = model.dh
    if model.family not in (THREE_PARALLEL, SPHERICAL_WRIST):
        upper, fore = abs(rows[1].a), abs(rows[3].d)
        det = float(np.linalg.det(jacobian_of_links(frames, frames[-1])))
        return SingularityMeasures(det / (upper * fore * (upper + fore)), math.inf, math.inf)
    elbow = joint_position[2] + rows[2].theta_offset
    wrist_point, in_plane = frames[5], frames[1]
    return SingularityMeasures(
        wrist=math.sin(joint_position[4] + rows[4].theta_offset),
        elbow=math.cos(elbow) if model.family == SPHERICAL_WRIST else math.sin(elbow),
        shoulder=wrist_point[9] * in_plane[0] + wrist_point[10] * in_plane[3])
