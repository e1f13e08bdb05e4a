"""Frames by three points and tools by four poses: exact, with noise, and from what says nothing."""
import math

import numpy as np
import pytest

from jaka_panel.teach.rotations import FramePose, compose, invert, rotation_matrix, rotation_vector
from jaka_panel.teach.tool_centre import tool_centre
from jaka_panel.teach.user_frame import CannotTeach, user_frame

RANDOM = np.random.default_rng(7)


def turns(count, largest=math.pi):
    """Return rotation vectors of any direction and of lengths up to ``largest``, rad."""
    axes = RANDOM.normal(size=(count, 3))
    return (axes / np.linalg.norm(axes, axis=1)[:, None] * RANDOM.uniform(0.2, 1.0, (count, 1)) * largest).tolist()


@pytest.mark.parametrize("vector", [[0.0, 0.0, 0.0], [math.pi, 0.0, 0.0], [0.0, -math.pi, 0.0], [1e-9, 0.0, 0.0],
                                    [3.1, 0.3, -0.2], *turns(20)])
def test_rotation_vectors_and_matrices_are_the_same_turn(vector):
    matrix = rotation_matrix(vector)
    assert np.allclose(matrix @ matrix.T, np.eye(3)) and np.isclose(np.linalg.det(matrix), 1.0)
    again = rotation_vector(matrix)
    assert np.allclose(rotation_matrix(again), matrix, atol=1e-9) and np.linalg.norm(again) <= math.pi + 1e-9


def test_a_frame_and_its_inverse_are_no_shift_and_no_turn():
    for vector in turns(10):
        frame = FramePose(RANDOM.normal(size=3).tolist(), vector)
        both = compose(frame, invert(frame))
        assert np.allclose(both.position, 0.0, atol=1e-12) and np.allclose(both.rotation_vector, 0.0, atol=1e-9)


def frame_points(origin, vector, *places):
    turn = rotation_matrix(vector)
    return [(np.array(origin) + turn @ np.array(place)).tolist() for place in places]


def test_a_frame_is_found_from_its_points_whatever_its_place_and_turn():
    for vector in turns(30):
        origin = RANDOM.uniform(-1.0, 1.0, 3)
        points = frame_points(origin, vector, [0, 0, 0], [0.3, 0, 0], [-0.1, 0.25, 0], [0.2, 0.2, 0.0007])
        frame = user_frame(points[:3])
        assert np.allclose(frame.position, origin) and frame.residual is None
        assert np.allclose(rotation_matrix(frame.rotation_vector), rotation_matrix(vector), atol=1e-9)
        assert user_frame(points).residual == pytest.approx(0.0007)
        assert frame.turn == pytest.approx(0.001 / 0.25)


def test_noise_of_a_point_turns_the_frame_no_more_than_is_said():
    points = np.array([[0.4, 0.0, 0.1], [0.7, 0.0, 0.1], [0.4, 0.2, 0.1]])
    exact = rotation_matrix(user_frame(points).rotation_vector)
    said = user_frame(points).turn
    for _ in range(200):
        error = RANDOM.normal(size=3)
        moved = points.copy()
        moved[RANDOM.integers(1, 3)] += 0.001 * error / np.linalg.norm(error)
        turn = np.linalg.norm(rotation_vector(exact.T @ rotation_matrix(user_frame(moved).rotation_vector)))
        assert turn <= 1.01 * said


@pytest.mark.parametrize("points, why", [
    ([[0, 0, 0], [0.01, 0, 0], [0, 0.3, 0]], "the origin and the point on the x axis are 10.0 mm apart"),
    ([[0, 0, 0], [0.3, 0, 0], [0.3, 0.01, 0]], "the point on the x axis and the point in the xy plane"),
    ([[0, 0, 0], [0.3, 0, 0], [0.6, 0.001, 0]], "almost on one line"),
    ([[0, 0, 0], [1, 0, 0], [-1, 0.05, 0]], "2.9 degrees"),
    ([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0.1, 0.1, 0.035]], "point 4 is 35.0 mm"),
    ([[0, 0, 0], [0.3, 0, 0]], "3 to 20 points"), ([[0, 0, 0]] * 3, "0.0 mm apart"),
    ([[0, 0, 0], [1e308, 0, 0], [0, 1e308, 0]], "within 100 m"), ([[0, 0, 0], [math.nan, 0, 0], [0, 1, 0]], "within")])
def test_points_that_make_no_frame_are_refused_with_the_reason(points, why):
    with pytest.raises(CannotTeach) as refused:
        user_frame(points)
    assert why in str(refused.value)


def tool_poses(tip, place, vectors, noise=0.0):
    """Return positions of a flange whose tool touches a place, with an error of each, m."""
    return [(np.array(place) - rotation_matrix(vector) @ np.array(tip) + noise * RANDOM.normal(size=3)).tolist()
            for vector in vectors]


DOWN = [math.pi, 0.0, 0.0]


def tilted(angle):
    """Return four orientations: down, and tilted by an angle, rad, about three axes between x and y."""
    return [rotation_vector(rotation_matrix([angle * math.cos(way), angle * math.sin(way), 0.0])
                            @ rotation_matrix(DOWN))
            for way in (0.0, 2.1, 4.2)] + [DOWN]


def test_a_tip_is_found_from_four_poses_and_more():
    for count in (4, 5, 20):
        for _ in range(20):
            tip, place = RANDOM.uniform(-0.3, 0.3, 3), RANDOM.uniform(-1.0, 1.0, 3)
            vectors = turns(count)
            tool = tool_centre(tool_poses(tip, place, vectors), vectors)
            assert np.allclose(tool.position, tip, atol=1e-9) and np.allclose(tool.place, place, atol=1e-9)
            assert tool.residual < 1e-9 and tool.uncertainty < 1e-9


def test_noise_shows_as_residual_and_the_tip_errs_as_much_as_is_said():
    tip, errors, said = np.array([0.02, -0.01, 0.15]), [], []
    for _ in range(300):
        vectors = tilted(math.radians(30.0))
        tool = tool_centre(tool_poses(tip, [0.5, 0.1, 0.0], vectors, 0.0005), vectors)
        errors.append(np.linalg.norm(np.array(tool.position) - tip))
        said.append(tool.uncertainty)
        assert 0.0 < tool.residual < 0.004
    assert math.sqrt(np.mean(np.square(said))) == pytest.approx(math.sqrt(np.mean(np.square(errors))), rel=0.15)


def test_a_pose_at_another_place_is_named():
    vectors = [*tilted(0.5), *tilted(0.9)[:3]]
    positions = tool_poses([0.0, 0.0, 0.2], [0.5, 0.0, 0.0], vectors)
    positions[5][0] += 0.01
    tool = tool_centre(positions, vectors)
    assert tool.worst == 6 and 0.004 < tool.residual < 0.01


def about_z(angles):
    return [[0.0, 0.0, angle] for angle in angles]


@pytest.mark.parametrize("vectors, why", [
    (about_z([0.0, 0.5, 1.0, 1.5]), "turned about one axis alone"), (tilted(math.radians(6.0)), "too alike"),
    ([*tilted(0.5)[:3], tilted(0.5)[0]], "poses 1 and 4 have almost the same orientation: 0.0 degrees"),
    (tilted(0.5)[:3], "4 to 20 poses"), (turns(21), "4 to 20 poses"),
    ([[1e308] * 3, *tilted(0.5)[:3]], "six numbers"), ([[math.nan] * 3, *tilted(0.5)[:3]], "six numbers")])
def test_poses_that_show_no_tip_are_refused_with_the_reason(vectors, why):
    positions = [[0.4, 0.1, 0.3 + 0.001 * n] for n in range(len(vectors))]
    with pytest.raises(CannotTeach) as refused:
        tool_centre(positions, vectors)
    assert why in str(refused.value)


def test_poses_far_apart_are_no_tip():
    with pytest.raises(CannotTeach) as refused:
        tool_centre([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], tilted(0.5))
    assert "did not touch one place" in str(refused.value)
