"""The rounded corners at joint moves, which the motion guard looks at beside the sharp ones."""
import math
import re

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import to_the_end
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.client.core.motion_guard.joint_corner import JointWay, joint_corners
from jaka_ros_driver.client.core.motion_guard.line_walk import LineWalk, walk
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward
from jaka_ros_driver.kinematics.rotations import IDENTITY, pose_from_transform
from jaka_ros_driver.simulation.arm.plant import HOME

MODEL = load_model("zu7")
AROUND = (0.6,) + HOME[1:]
BELOW = (0.6, HOME[1], HOME[2] - 0.5) + HOME[3:]
PIN = workspace_of({"keep_out": [{"name": "pin", "centre": [0.312, 0.278, 0.312], "size": [0.03, 0.03, 0.03]}]})
"""A box within the corner of a joint move to AROUND and one from there to BELOW."""


def joint_corner(radius):
    return [c.JointMove(AROUND, 1.0, 4.0, radius), c.JointMove(BELOW, 1.0, 4.0, 0.0)]


@pytest.mark.parametrize("radius, is_refused", [(0.0, False), (0.02, False), (0.05, True), (0.1, True)])
def test_the_rounded_corner_of_joint_moves_is_looked_at_in_a_path_and_in_the_queue(radius, is_refused):
    arm = SimulatedArm(MODEL, HOME, has_all_fields=True, workspace=PIN)
    error = arm.ended(arm.begin("move_path", joint_corner(radius), lambda: False, lambda: None))
    if is_refused:
        assert re.match(r"segment 1: refused: on the rounded corner where it begins, after \d+ % of it the flange "
                        r".*keep-out box 'pin'", str(error)), error
        assert not arm.times_of("joint_move")
    else:
        assert error is None
    arm = SimulatedArm(MODEL, HOME, has_all_fields=True, workspace=PIN)
    first, second = joint_corner(radius)
    assert arm.begin("move", first, False).error is None
    queued = arm.begin("move", second, False)
    assert (queued.error is not None) is is_refused, queued.error
    assert not is_refused or "refused: on the rounded corner where it begins, " in str(queued.error)
    arm.until(lambda: arm.core.is_free)
    assert arm.ended(arm.begin("move", second, True)) is None, "behind a stop at the corner it is sharp"


@pytest.mark.parametrize("kinds", ["joint joint", "joint line", "line joint"])
@pytest.mark.parametrize("radius", [0.0, 0.01, 0.03, 1.0])
def test_the_corners_beside_joint_moves_touch_both_ways_and_pass_within_the_tolerance(kinds, radius):
    frames, at = ToolFrames(IDENTITY, IDENTITY), pose_from_transform(forward(MODEL, AROUND))
    line = c.LinearMove(c.Pose(tuple([a + b for a, b in zip(at.position, (0.0, 0.0, -0.2))]), at.rpy), 0.2, 1.0, radius)
    away = walk(MODEL, frames, AROUND, line)
    to_the_end(away.looks())
    back = walk(MODEL, frames, away.end, c.LinearMove(at, 0.2, 1.0, radius))
    to_the_end(back.looks())
    before, after = {
        "joint joint": (JointWay(HOME, AROUND, 0.6, radius), JointWay(AROUND, BELOW, 0.5, 0.0)),
        "joint line": (JointWay(HOME, AROUND, 0.63, radius), away),
        "line joint": (back, JointWay(back.end, HOME, 0.6, 0.0))}[kinds]
    corners = joint_corners(MODEL, IDENTITY, before, after)
    assert bool(corners) is (radius > 0.0)
    tip = forward(MODEL, AROUND)[9:]
    nearest = [min(math.dist(forward(MODEL, joints)[9:], tip) for joints in corner) for corner in corners]
    assert nearest == sorted(nearest) and (not nearest or nearest[-1] <= radius + 2e-3)
    assert all(b - a <= 0.02 + 1e-3 for a, b in zip([0.0, *nearest], nearest))
    for corner in corners:
        steps = [[b - a for a, b in zip(p, q)] for p, q in zip(corner, corner[1:])]
        assert max(abs(b - a) for p, q in zip(steps, steps[1:]) for a, b in zip(p, q)) <= 8e-3 * 1.01
    if kinds == "joint joint" and radius == 1.0:
        assert corners[-1][0] == pytest.approx(before.at(1.0 - 0.25 / 0.6)) and corners[-1][-1] == pytest.approx(
            after.at(0.5)), "half of the shorter"
    if kinds == "joint line" and radius == 1.0:
        assert math.dist(forward(MODEL, corners[-1][-1])[9:], tip) == pytest.approx(0.2 * 0.5 * 0.63, abs=1e-3)


def walked(model, start, way):
    """Return the walk along a line of the flange from these joints, rad (6,), by this way, m (3,), at its end."""
    at = pose_from_transform(forward(model, start))
    target = c.Pose(tuple([a + b for a, b in zip(at.position, way)]), at.rpy)
    line = walk(model, ToolFrames(IDENTITY, IDENTITY), start, c.LinearMove(target, 0.2, 1.0))
    to_the_end(line.looks())
    return line


def test_a_place_on_a_line_is_told_by_its_share_of_the_whole_up_to_the_last_step():
    line = walked(MODEL, HOME, (0.0, 0.0, -0.2))
    last = len(line.shares) - 1
    assert line.shares[-1] == 1.0 and last > 3
    for step in range(last):
        assert line.share_at(step, 0.0) == line.shares[step] and line.share_at(step, 1.0) == line.shares[step + 1]
        assert line.shares[step] < line.share_at(step, 0.5) < line.shares[step + 1]
    assert line.share_at(last, 0.5) == 1.0


def test_the_straight_lines_of_a_corner_are_near_to_it_and_no_more_than_that_needs():
    corners = list(joint_corners(MODEL, IDENTITY, JointWay(HOME, AROUND, 0.6, 0.05), JointWay(AROUND, BELOW, 0.5, 0.0)))
    assert corners
    for places in corners:
        bends = [max([abs(a - 2.0 * b + c) for a, b, c in zip(*three)])
                 for three in zip(places, places[1:], places[2:])]
        assert max(bends) <= 8e-3, "an eighth is the distance from the line to the corner, 1e-3 rad"
        assert len(places) == 3 or max(bends) >= 3e-3


def test_of_an_arm_whose_branches_have_other_measures_no_part_is_said_to_flip():
    line = walked(load_model("a12"), (1.9679, 1.4838, 1.172, 2.033, 1.3144, 1.4487), (-0.088, 0.289, 0.277))
    assert line.early_end.reason.startswith("singular: joint ")


def test_a_way_of_no_length_has_a_begin_and_an_end():
    way = LineWalk(MODEL, ToolFrames(IDENTITY, IDENTITY), HOME, lambda share: forward(MODEL, HOME), 0.0, 0.0, 0.0)
    to_the_end(way.looks())
    assert way.shares == [0.0, 1.0] and way.early_end is None
    assert way.joints[0] == HOME and way.end == pytest.approx(HOME, abs=1e-9)
