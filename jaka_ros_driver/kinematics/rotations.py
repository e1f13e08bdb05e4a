"""Orientations and rigid transforms as plain tuples; every name states its convention.

matrix              rotation matrix, row-major, 9 floats; columns are the axes of the rotated frame
rpy                 rotations about the fixed axes x, then y, then z: R = Rz(rz) Ry(ry) Rx(rx), rad
rotation vector     unit axis times angle, rad, angle in [0, pi]
Transform           12 floats: the matrix, then the translation in m; ``base_T_tool`` maps tool to base
"""
import math
from typing import Sequence, Tuple

from jaka_ros_driver.commands import Pose

Vector3 = Tuple[float, float, float]
Matrix = Tuple[float, float, float, float, float, float, float, float, float]
Transform = Tuple[float, float, float, float, float, float, float, float, float, float, float, float]

IDENTITY: Transform = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)

_GIMBAL_COSINE = 1e-12
"""Bound of cos(ry) below which rx and rz turn about the same axis, so that only their sum or difference is defined."""


def wrap_angle(angle: float) -> float:
    """Return the same direction in (-pi, pi], rad."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def matrix_from_rpy(rpy: Sequence[float]) -> Matrix:
    """Return the rotation matrix Rz(rz) Ry(ry) Rx(rx) of rpy, rad, shape (3,)."""
    rx, ry, rz = rpy
    cx, sx = math.cos(rx), math.sin(rx)
    cy, sy = math.cos(ry), math.sin(ry)
    cz, sz = math.cos(rz), math.sin(rz)
    return (cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx,
            sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx,
            -sy, cy * sx, cy * cx)


def rpy_from_matrix(matrix: Sequence[float]) -> Vector3:
    """Return the rpy of a rotation matrix (or of a Transform), rad, ry in [-pi/2, pi/2].

    In gimbal lock (ry = +-pi/2) rx is 0. Near it the rotation is still exact to rounding, because rz is computed from
    the matrix after rx was undone.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix[:9]
    cos_ry = math.hypot(r00, r10)
    rx = math.atan2(r21, r22) if cos_ry > _GIMBAL_COSINE else 0.0
    cx, sx = math.cos(rx), math.sin(rx)
    return rx, math.atan2(-r20, cos_ry), math.atan2(sx * r02 - cx * r01, cx * r11 - sx * r12)


def matrix_from_rotation_vector(rotation_vector: Sequence[float]) -> Matrix:
    """Return the rotation matrix of a rotation vector, rad, shape (3,), any length."""
    x, y, z = rotation_vector
    angle = math.sqrt(x * x + y * y + z * z)
    if angle > 1e-8:
        s = math.sin(angle) / angle
        half = math.sin(0.5 * angle) / angle
        v = 2.0 * half * half
    else:
        s, v = 1.0, 0.5
    vxy, vxz, vyz = v * x * y, v * x * z, v * y * z
    xx, yy, zz = v * x * x, v * y * y, v * z * z
    return (1.0 - yy - zz, vxy - s * z, vxz + s * y,
            vxy + s * z, 1.0 - xx - zz, vyz - s * x,
            vxz - s * y, vyz + s * x, 1.0 - xx - yy)


def rotation_vector_from_matrix(matrix: Sequence[float]) -> Vector3:
    """Return the rotation vector of a rotation matrix (or of a Transform), rad, angle in [0, pi].

    It is computed by the unit quaternion, so that angles near 0 and near pi lose no digits. At exactly pi both signs of
    the axis are right; which one is returned is not defined.
    """
    w, x, y, z = _quaternion_from_matrix(matrix)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sin_half = math.sqrt(x * x + y * y + z * z)
    if sin_half < 1e-150:
        return 0.0, 0.0, 0.0
    scale = 2.0 * math.atan2(sin_half, w) / sin_half
    return x * scale, y * scale, z * scale


def _quaternion_from_matrix(matrix: Sequence[float]) -> Tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z), from the largest of the four squares (Shepperd's method)."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix[:9]
    trace = r00 + r11 + r22
    if trace >= r00 and trace >= r11 and trace >= r22:
        root = math.sqrt(1.0 + trace)
        f = 0.5 / root
        return 0.5 * root, (r21 - r12) * f, (r02 - r20) * f, (r10 - r01) * f
    if r00 >= r11 and r00 >= r22:
        root = math.sqrt(1.0 + r00 - r11 - r22)
        f = 0.5 / root
        return (r21 - r12) * f, 0.5 * root, (r01 + r10) * f, (r02 + r20) * f
    if r11 >= r22:
        root = math.sqrt(1.0 + r11 - r00 - r22)
        f = 0.5 / root
        return (r02 - r20) * f, (r01 + r10) * f, 0.5 * root, (r12 + r21) * f
    root = math.sqrt(1.0 + r22 - r00 - r11)
    f = 0.5 / root
    return (r10 - r01) * f, (r02 + r20) * f, (r12 + r21) * f, 0.5 * root


def rotation_vector_from_rpy(rpy: Sequence[float]) -> Vector3:
    """Return the rotation vector of the same rotation as rpy, rad."""
    return rotation_vector_from_matrix(matrix_from_rpy(rpy))


def rpy_from_rotation_vector(rotation_vector: Sequence[float]) -> Vector3:
    """Return the rpy of the same rotation as the rotation vector, rad."""
    return rpy_from_matrix(matrix_from_rotation_vector(rotation_vector))


def rotation_angle_between(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the angle of the rotation from a to b, rad, in [0, pi]; matrices or Transforms."""
    a00, a01, a02, a10, a11, a12, a20, a21, a22 = a[:9]
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = b[:9]
    x = (a02 * b01 + a12 * b11 + a22 * b21) - (a01 * b02 + a11 * b12 + a21 * b22)
    y = (a00 * b02 + a10 * b12 + a20 * b22) - (a02 * b00 + a12 * b10 + a22 * b20)
    z = (a01 * b00 + a11 * b10 + a21 * b20) - (a00 * b01 + a10 * b11 + a20 * b21)
    trace = (a00 * b00 + a10 * b10 + a20 * b20 + a01 * b01 + a11 * b11 + a21 * b21
             + a02 * b02 + a12 * b12 + a22 * b22)
    return math.atan2(math.sqrt(x * x + y * y + z * z), trace - 1.0)


def turn_between(a: Transform, b: Transform) -> Vector3:
    """Return the rotation vector, in the common frame, that turns a into b, rad."""
    return rotation_vector_from_matrix(compose(b, invert(a)))


def distance_between(a: Transform, b: Transform) -> float:
    """Return the distance of the two origins, m."""
    x, y, z = a[9] - b[9], a[10] - b[10], a[11] - b[11]
    return math.sqrt(x * x + y * y + z * z)


def transform(matrix: Matrix, translation: Sequence[float]) -> Transform:
    """Return the Transform of a rotation matrix and a translation, m, shape (3,)."""
    x, y, z = translation
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix
    return r00, r01, r02, r10, r11, r12, r20, r21, r22, x, y, z


def compose(a: Transform, b: Transform) -> Transform:
    """Return the product: ``compose(base_T_flange, flange_T_tool)`` is ``base_T_tool``."""
    a00, a01, a02, a10, a11, a12, a20, a21, a22, ax, ay, az = a
    b00, b01, b02, b10, b11, b12, b20, b21, b22, bx, by, bz = b
    return (a00 * b00 + a01 * b10 + a02 * b20, a00 * b01 + a01 * b11 + a02 * b21, a00 * b02 + a01 * b12 + a02 * b22,
            a10 * b00 + a11 * b10 + a12 * b20, a10 * b01 + a11 * b11 + a12 * b21, a10 * b02 + a11 * b12 + a12 * b22,
            a20 * b00 + a21 * b10 + a22 * b20, a20 * b01 + a21 * b11 + a22 * b21, a20 * b02 + a21 * b12 + a22 * b22,
            a00 * bx + a01 * by + a02 * bz + ax, a10 * bx + a11 * by + a12 * bz + ay,
            a20 * bx + a21 * by + a22 * bz + az)


def invert(a: Transform) -> Transform:
    """Return the inverse: that of ``base_T_tool`` is ``tool_T_base``."""
    a00, a01, a02, a10, a11, a12, a20, a21, a22, x, y, z = a
    return (a00, a10, a20, a01, a11, a21, a02, a12, a22,
            -(a00 * x + a10 * y + a20 * z), -(a01 * x + a11 * y + a21 * z), -(a02 * x + a12 * y + a22 * z))


def transform_from_pose(pose: Pose) -> Transform:
    """Return the Transform of a commands.Pose (m, rpy rad)."""
    return transform(matrix_from_rpy(pose.rpy), pose.position)


def pose_from_transform(base_t_tool: Transform) -> Pose:
    """Return the commands.Pose (m, rpy rad) of a Transform."""
    return Pose(position=base_t_tool[9:], rpy=rpy_from_matrix(base_t_tool))
