"""Thirty bad motions and the texts with which they are refused: place, reason, and what is kept or valid."""
import math
import re

import pytest

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import to_the_end
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.motion_guard import line_walk
from jaka_ros_driver.client.core.motion_guard.motion_check import MotionCheck, StartPlace
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    compose,
    matrix_from_rotation_vector,
    pose_from_transform,
    rpy_from_matrix,
    transform,
    transform_from_pose,
)
from jaka_ros_driver.trajectory.build import BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
AT_Q6_LIMIT = HOME[:5] + (6.1,)
NEAR_WRIST = HOME[:4] + (0.2, 0.0)
STRETCHED = (0.0, 1.2, -0.25, 0.6, 1.57, 0.0)
TABLE = {"keep_out": [{"name": "table", "centre": [0.4, 0.0, 0.1], "size": [0.5, 1.0, 0.2]}]}
FLOOR = {"floor": -0.01}
CELL = {"keep_in": [{"name": "cell", "centre": [0.0, 0.0, 0.5], "size": [1.1, 1.1, 1.1]}]}
POST = {"cylinders": [{"name": "post", "foot": [0.2, 0.35, 0.0], "height": 1.0, "radius": 0.05}]}
GRIPPER = {"tool": [{"name": "the gripper", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.15], "radius": 0.04}],
           "floor": -0.01}


def check_of(model, workspace=None, **settings):
    return MotionCheck(load_model(model), ClientSettings("", workspace=workspace_of(workspace or {}), **settings),
                       Actions())


def shifted(model, joints, x=0.0, y=0.0, z=0.0, rx=0.0, ry=0.0, rz=0.0):
    """Return the tool's pose at these joints, moved by m and turned by rad about the base's axes."""
    pose = pose_from_transform(forward(load_model(model), joints))
    turned = compose(transform(matrix_from_rotation_vector((rx, ry, rz)), (0.0,) * 3), transform_from_pose(pose))
    return c.Pose(tuple(p + d for p, d in zip(pose.position, (x, y, z))), rpy_from_matrix(turned))


def line(start=HOME, **shift):
    return lambda model: (start, c.LinearMove(shifted(model, start, **shift), 0.2, 1.0))


def arc(via, target):
    return lambda model: (HOME, c.ArcMove(shifted(model, HOME, **via), shifted(model, HOME, **target), 0.2, 1.0))


def joints(*target):
    return lambda model: (HOME, c.JointMove(target, 1.0, 4.0))


def one_joint(number, target):
    return joints(*HOME[:number - 1], target, *HOME[number:])


SHARE = r"after \d+ % of the way "
MM = r"after \d+ mm of \d+ mm "
KEPT = "; at least 10 mm are kept"
SELF = r"(the \w+|the wrist \(link \d\)) is \d+ mm from the (base|shoulder|upper arm|forearm)" + KEPT
"""The pair that an arm meets first when it folds; which one it is depends on radii, which are estimates."""
REACH = "its target cannot be reached: out of reach: shoulder to wrist would be "
BAD = [  # model, motion, workspace, text behind "refused: "
    ("zu7", joints(1.781, -0.866, -2.694, 0.38, 0.163, -3.141), None,
     SHARE + "the flange is 9 mm from the base" + KEPT),
    ("zu7", joints(2.02, 0.65, 0.83, -0.81, 0.81, 2.21), None, SHARE + SELF),
    ("zu7", joints(0.66, -0.78, -2.75, 2.41, -1.12, 2.75), None, SHARE + SELF),
    ("zu5", joints(0.1, -0.2, 2.88, 2.49, 1.55, -1.33), None, SHARE + SELF),
    ("minicobo", joints(0.9, -1.98, -2.12, -0.33, -0.79, -0.51), None,
     SHARE + SELF),
    ("pro16", joints(-1.87, 1.22, -2.92, -1.47, -2.71, -2.32), None,
     SHARE + SELF),
    ("zu7", one_joint(3, -3.05), None, SHARE + SELF),
    ("zu7", one_joint(3, 3.05), None, SHARE + SELF),
    ("zu7", joints(0.0, 0.2, -1.2, 1.57, 1.57, 0.0), TABLE, SHARE + "the flange is .* from the keep-out box 'table'"),
    ("zu7", joints(0.0, 0.2, -1.2, 1.57, 1.57, 0.0), FLOOR, SHARE + "the flange is .* from the floor"),
    ("zu7", joints(0.0, 0.2, -1.2, 1.57, 1.57, 0.0), CELL, SHARE + ".* from the wall of the keep-in box 'cell'"),
    ("zu7", joints(0.0, 0.2, -1.2, 1.57, 1.57, 0.0), GRIPPER, SHARE + "the gripper is .* from the floor"),
    ("zu7", one_joint(1, 1.6), POST, SHARE + ".* from the cylinder 'post'"),
    ("zu7", line(x=2.0), None, REACH + "2.33146 m, the stretched arm has 0.6635 m"),
    ("zu7", line(z=0.9), None, REACH + "1.29604 m"),
    ("zu7", line(y=-0.9, x=-0.4), None, REACH),
    ("zu7", line(STRETCHED, ry=1.0), None, REACH),
    ("zu7", line(x=-0.3, z=-0.5), None, MM + SELF),
    ("zu7", line(x=-0.35, z=-0.6), None, MM + SELF),
    ("zu7", line(z=-0.35), TABLE, MM + "the flange is .* from the keep-out box 'table'" + KEPT),
    ("zu7", line(z=-0.35), GRIPPER, MM + "the gripper is .* from the floor" + KEPT),
    ("zu7", line(x=-0.9, y=-0.23), None, MM + "it cannot go on: out of reach: the wrist point is .* from the axis of "
     "joint 1 and cannot come nearer"),
    ("zu7", line(x=-0.8, y=-0.2), None, MM + "it cannot go on: singular: joint 6 cannot turn as fast as a tenth of the "
     "speed needs"),
    ("zu7", line(x=0.2, rx=1.5), None, MM + "it cannot go on: singular: joint 3 "),
    ("zu7", line(NEAR_WRIST, rx=-0.5), None, r"after \d+ % of its turn it cannot go on: singular: joint 4 "),
    ("zu7", line(NEAR_WRIST, y=0.3), None, MM + "it cannot go on: another branch: the elbow and the wrist would have "
     "to flip"),
    ("zu7", line(z=0.1, ry=-3.0), None, MM + "it cannot go on: joint 4 would pass its limit; valid: -1.48353 to "
     "4.62512 rad"),
    ("zu7", line(AT_Q6_LIMIT, rz=-0.5), None, r"after \d+ % of its turn it cannot go on: joint 6 would pass"),
    ("zu7", arc({"x": 0.3, "y": 0.2}, {"y": 0.4}), None, MM + "it cannot go on: out of reach: shoulder to wrist"),
    ("zu7", arc({"x": 0.1}, {"x": 0.2}), None, "no circle leads through its start, via and target"),
]


def test_there_are_thirty():
    assert len(BAD) == 30


@pytest.mark.parametrize("model, motion, workspace, text", BAD)
def test_a_bad_motion_is_refused_with_place_and_reason(model, motion, workspace, text):
    start, command = motion(model)
    with pytest.raises(InvalidCommand, match="^refused: " + text):
        to_the_end(check_of(model, workspace).after_move(command, StartPlace(start, ToolFrames(IDENTITY, IDENTITY))))


@pytest.mark.parametrize("model", model_names())
def test_a_short_line_and_a_short_joint_move_of_each_model_are_clear(model):
    check, start = check_of(model), StartPlace((0.3, 1.2, -1.4, 1.4, 1.3, 0.2), ToolFrames(IDENTITY, IDENTITY))
    away = shifted(model, start.joints, x=0.02, z=0.03, rz=0.1)
    end = to_the_end(check.after_move(c.LinearMove(away, 0.2, 1.0), start))
    assert end.joints is not None and max(abs(a - b) for a, b in zip(end.joints, start.joints)) < 0.5
    reached = pose_from_transform(forward(load_model(model), end.joints))
    assert reached.position == pytest.approx(shifted(model, start.joints, x=0.02, z=0.03).position, abs=1e-5)
    back = to_the_end(check.after_move(c.JointMove(start.joints, 1.0, 4.0), end))
    assert back.joints == start.joints


@pytest.mark.parametrize("start", [HOME, HOME[:4] + (0.0, 0.4), (0.0, 1.2, -0.02, 0.6, 1.57, 0.0)])
@pytest.mark.parametrize("away", [0.0, 1e-9, 1e-6, 1e-4])
def test_a_line_of_no_length_is_clear_also_at_a_singularity(start, away):
    end = to_the_end(check_of("zu7").after_move(
        line(start, z=-away)("zu7")[1], StartPlace(start, ToolFrames(IDENTITY, IDENTITY))))
    assert max(abs(a - b) for a, b in zip(end.joints, start)) < 0.02


@pytest.mark.parametrize("base_t_user", [IDENTITY, transform(matrix_from_rotation_vector((0.0, 0.0, 1.2)),
                                                             (0.3, -0.2, 0.1))])
def test_a_line_is_walked_with_tool_and_user_frame(base_t_user):
    tool = transform(matrix_from_rotation_vector((0.2, 0.1, -0.4)), (0.01, -0.02, 0.15))
    frames, model = ToolFrames(base_t_user, tool), load_model("zu7")
    begin = frames.tool_at(model, HOME)
    to = pose_from_transform(begin)
    to = c.Pose((to.position[0] - 0.05, to.position[1] + 0.04, to.position[2]), to.rpy)
    end = to_the_end(check_of("zu7").after_move(c.LinearMove(to, 0.2, 1.0), StartPlace(HOME, frames)))
    assert frames.tool_at(model, end.joints) == pytest.approx(transform_from_pose(to), abs=1e-6)


def test_without_frames_a_line_is_not_looked_at_and_what_follows_is_looked_at_where_it_ends():
    check = check_of("zu7")
    after = to_the_end(check.after_move(line(x=2.0)("zu7")[1], StartPlace(HOME, None)))
    assert after.joints is None
    with pytest.raises(InvalidCommand, match="refused: the flange "):
        to_the_end(check.after_move(c.JointMove((1.781, -0.866, -2.694, 0.38, 0.163, -3.141), 1.0, 4.0), after))
    to_the_end(check.after_move(c.JointMove(HOME, 1.0, 4.0), after))


def path_to(target, starts_in=0.0):
    start = PathStart(JointState(HOME, (0.0,) * 6, (0.0,) * 6), True)
    points = (TrajectoryPoint(0.0, HOME, (0.0,) * 6), TrajectoryPoint(4.0, target, (0.0,) * 6))
    return build_path(start, JointTrajectory(points), -starts_in, load_model("zu7"), BuildOptions(0.01))


@pytest.mark.parametrize("starts_in", [0.0, 0.9])
def test_a_trajectory_is_looked_at_as_a_whole_also_one_that_starts_later(starts_in):
    check = check_of("zu7")
    assert check.trajectory_trouble(path_to((0.8,) + HOME[1:], starts_in)) == ""
    trouble = check.trajectory_trouble(path_to((1.781, -0.866, -2.694, 0.38, 0.163, -3.141), starts_in))
    assert re.match(r"after [23]\.\d+ s the flange is \d+ mm from the base; at least 10 mm are kept", trouble), trouble
    assert check_of("zu7", guard_motion="off").trajectory_trouble(
        path_to((1.781, -0.866, -2.694, 0.38, 0.163, -3.141))) == ""


@pytest.mark.parametrize("model", ["zu7", "zu20", "a12", "minicobo"])
@pytest.mark.parametrize("via", [(-10.0, 1e-4, 0.0), (0.0, 1e-4, 9.5)])
def test_an_arc_that_goes_round_by_metres_is_followed_only_as_far_as_the_arm_reaches(model, via):
    target = shifted(model, HOME, y=0.001)
    by = c.Pose(tuple(p + d for p, d in zip(target.position, via)), target.rpy)
    start, steps = StartPlace(HOME, ToolFrames(IDENTITY, IDENTITY)), 0
    looks = check_of(model).after_move(c.ArcMove(by, target, 0.2, 1.0), start)
    with pytest.raises(InvalidCommand, match=r"refused: after \d+ mm of (3|2)\d{4} mm it cannot go on: "):
        while True:
            next(looks)
            steps += 1
    assert 20 < steps < 500


def test_a_way_of_more_places_than_are_looked_for_is_refused_where_they_end(monkeypatch):
    monkeypatch.setattr(line_walk, "_MOST_PLACES", 5)
    command, start = line(z=-0.2)("zu7")[1], StartPlace(HOME, ToolFrames(IDENTITY, IDENTITY))
    with pytest.raises(InvalidCommand, match=r"after 50 mm of 200 mm it cannot go on: .*no more than 5 places"):
        to_the_end(check_of("zu7").after_move(command, start))


@pytest.mark.parametrize("between", [None, "line", "joints"])
def test_a_move_to_where_the_one_before_it_ends_does_not_hide_its_rounded_corner(between):
    # a controller need not take it into its queue, and rounds the corner beside it (docs/simulated_motion.md)
    peg = {"keep_out": [{"name": "peg", "centre": [0.417, 0.245, 0.3075], "size": [0.03, 0.03, 0.1]}]}
    check, corner = check_of("zu7", peg), shifted("zu7", HOME, y=0.2)
    place = to_the_end(check.after_move(c.LinearMove(corner, 0.2, 1.0, 0.05),
                                        StartPlace(HOME, ToolFrames(IDENTITY, IDENTITY))))
    if between:
        place = to_the_end(check.after_move(c.LinearMove(corner, 0.2, 1.0) if between == "line"
                                            else c.JointMove(place.joints, 0.2, 1.0), place))
    down = c.LinearMove(shifted("zu7", HOME, y=0.2, z=-0.2), 0.2, 1.0)
    with pytest.raises(InvalidCommand, match="refused: on the rounded corner where it begins, "):
        to_the_end(check.after_move(down, place))


def test_a_trajectory_of_a_day_is_looked_at_in_pieces():
    end = (0.5,) + HOME[1:]
    points = tuple([TrajectoryPoint(3600.0 * (k + 1), (0.5 * (k % 2),) + HOME[1:]) for k in range(23)]
                   + [TrajectoryPoint(86400.0, end)])
    path = build_path(PathStart(JointState(HOME, (0.0,) * 6, (0.0,) * 6), True), JointTrajectory(points), 0.0,
                      load_model("zu7"), BuildOptions(0.01))
    samples, taken = path.samples, []
    path.samples = lambda times: taken.append(len(times)) or samples(times)
    assert check_of("zu7", TABLE).trajectory_trouble(path) == ""
    assert sum(taken) > 2e6 and max(taken) < 5000
