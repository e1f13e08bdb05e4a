import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics import rotations

ANGLE = st.floats(-2.0 * math.pi, 2.0 * math.pi)
TINY = st.sampled_from([0.0, 1e-160, 1e-17, 1e-9, 1e-8, 1e-5])
RPY = st.tuples(ANGLE, ANGLE, ANGLE)
POSITION = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
AXIS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(v[0], math.hypot(v[1], v[2])) > 1e-3)


def close(a, b, tolerance=1e-12):
    return np.allclose(a, b, rtol=0.0, atol=tolerance)


def about(axis, angle):
    """Return the rotation matrix about one base axis, written out independently of the module."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array({"x": [[1, 0, 0], [0, c, -s], [0, s, c]],
                     "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
                     "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis])


@given(RPY)
def test_rpy_turns_about_fixed_x_then_y_then_z(rpy):
    rx, ry, rz = rpy
    assert close(rotations.matrix_from_rpy(rpy), (about("z", rz) @ about("y", ry) @ about("x", rx)).ravel())


@given(st.tuples(ANGLE, st.one_of(ANGLE, TINY.map(lambda e: math.pi / 2 - e), TINY.map(lambda e: e - math.pi / 2)),
                 ANGLE))
@example((0.3, math.pi / 2, -1.2))
@example((0.3, -math.pi / 2, -1.2))
def test_rpy_reproduces_its_matrix_also_in_gimbal_lock(rpy):
    matrix = rotations.matrix_from_rpy(rpy)
    rx, ry, rz = rotations.rpy_from_matrix(matrix)
    assert -math.pi / 2 <= ry <= math.pi / 2
    assert close(rotations.matrix_from_rpy((rx, ry, rz)), matrix)


def test_rpy_in_gimbal_lock_has_rx_zero():
    assert rotations.rpy_from_matrix(rotations.matrix_from_rpy((0.4, math.pi / 2, 0.1)))[0] == 0.0


@given(AXIS, st.one_of(st.floats(0.0, math.pi), TINY, TINY.map(lambda e: math.pi - e)))
def test_rotation_vector_survives_the_matrix_from_zero_to_pi(axis, angle):
    unit = np.array(axis) / np.linalg.norm(axis)
    vector = tuple(unit * angle)
    matrix = rotations.matrix_from_rotation_vector(vector)
    assert close(np.array(matrix).reshape(3, 3) @ unit, unit)
    back = rotations.rotation_vector_from_matrix(matrix)
    if angle > math.pi - 1e-6 and np.dot(back, vector) < 0.0:
        back = tuple(-component for component in back)  # either sign is right at pi
        assert close(back, vector, 2e-6)
    else:
        assert close(back, vector, 1e-9)


@given(AXIS, st.sampled_from([1e-12, 1e-9, 1e-6, 1e-3, 1.0, 3.0, math.pi - 1e-9]))
def test_rotation_vector_keeps_its_relative_accuracy(axis, angle):
    vector = tuple(np.array(axis) / np.linalg.norm(axis) * angle)
    back = rotations.rotation_vector_from_matrix(rotations.matrix_from_rotation_vector(vector))
    assert math.isclose(np.linalg.norm(back), angle, rel_tol=1e-6)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("angle", [math.pi, math.pi - 1e-9, 2.9, -2.9, 1e-9])
def test_rotation_vector_about_each_axis(axis, angle):
    vector = np.array(rotations.rotation_vector_from_matrix(about(axis, angle).ravel()))
    expected = np.zeros(3)
    expected["xyz".index(axis)] = angle
    assert close(vector, expected, 1e-12) or (angle == math.pi and close(vector, -expected, 1e-12))


def test_identity_is_the_zero_vector():
    assert rotations.rotation_vector_from_matrix(rotations.IDENTITY) == (0.0, 0.0, 0.0)
    assert rotations.matrix_from_rotation_vector((0.0, 0.0, 0.0)) == rotations.IDENTITY[:9]


@given(RPY)
def test_rpy_and_rotation_vector_name_one_rotation(rpy):
    matrix = rotations.matrix_from_rpy(rpy)
    vector = rotations.rotation_vector_from_rpy(rpy)
    assert close(rotations.matrix_from_rotation_vector(vector), matrix)
    assert close(rotations.matrix_from_rpy(rotations.rpy_from_rotation_vector(vector)), matrix)


def test_a_known_pair_of_rotation_vector_and_rpy():
    # exp([0.1 0.2 0.3]x) worked out by power series
    x, y, z = 0.1, 0.2, 0.3
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    series, term = np.eye(3), np.eye(3)
    for n in range(1, 20):
        term = term @ skew / n
        series = series + term
    assert close(rotations.matrix_from_rotation_vector((x, y, z)), series.ravel())
    assert close(np.degrees(rotations.rpy_from_rotation_vector((x, y, z))), (7.439, 10.401, 17.938), 5e-4)


@given(RPY, RPY, POSITION, POSITION, POSITION)
def test_compose_applies_the_right_one_first(rpy_a, rpy_b, at_a, at_b, point):
    a = rotations.transform(rotations.matrix_from_rpy(rpy_a), at_a)
    b = rotations.transform(rotations.matrix_from_rpy(rpy_b), at_b)
    apply = lambda t, p: np.array(t[:9]).reshape(3, 3) @ p + t[9:]  # noqa: E731
    assert close(apply(rotations.compose(a, b), point), apply(a, apply(b, point)), 1e-11)


@given(RPY, POSITION)
def test_invert_undoes(rpy, position):
    a = rotations.transform(rotations.matrix_from_rpy(rpy), position)
    assert close(rotations.compose(a, rotations.invert(a)), rotations.IDENTITY)
    assert close(rotations.compose(rotations.invert(a), a), rotations.IDENTITY)


@given(RPY, POSITION)
def test_pose_and_transform_are_the_same_place(rpy, position):
    transform = rotations.transform_from_pose(Pose(position, rpy))
    assert transform[9:] == position
    back = rotations.pose_from_transform(transform)
    assert back.position == position
    assert close(rotations.transform_from_pose(back), transform)


@given(RPY, AXIS, st.one_of(st.floats(0.0, math.pi), TINY, TINY.map(lambda e: math.pi - e)))
def test_angle_between_is_the_angle_turned(rpy, axis, angle):
    a = rotations.transform(rotations.matrix_from_rpy(rpy), (1.0, 2.0, 3.0))
    turn = rotations.matrix_from_rotation_vector(tuple(np.array(axis) / np.linalg.norm(axis) * angle))
    b = rotations.compose(a, rotations.transform(turn, (0.0, 0.0, 0.0)))
    assert math.isclose(rotations.rotation_angle_between(a, b), angle, abs_tol=1e-12)
    assert rotations.distance_between(a, b) == 0.0


@given(st.floats(-1e4, 1e4))
@example(math.pi)
@example(-math.pi)
@example(3.0 * math.pi)
def test_wrapped_angle_is_the_same_direction_in_the_half_open_circle(angle):
    wrapped = rotations.wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-10)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-10)


@pytest.mark.parametrize("angle, wrapped", [
    (0.5, 0.5), (math.pi, math.pi), (-math.pi, math.pi), (0.5 + math.tau, 0.5), (0.5 - math.tau, 0.5),
    (3.0 + 5.0 * math.tau, 3.0), (-3.0 - 5.0 * math.tau, -3.0), (3.0 * math.pi, math.pi), (3.5, 3.5 - math.tau)])
def test_an_angle_is_wrapped_to_more_than_minus_half_a_turn_and_up_to_half_a_turn(angle, wrapped):
    assert rotations.wrap_angle(angle) == pytest.approx(wrapped, abs=1e-12)
