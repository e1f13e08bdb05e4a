"""Cartesian paths as they are run: straightness, rounded corners, arcs, limits along the way, where they break off."""
import dataclasses
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plant_watch import ZU7, PlantWatch, shift

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import rotation_angle_between
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, HOME

BOTH = pytest.mark.parametrize("jerk_limited", [True, False])


def point(tool):
    return tool[9:]


def distance_to_segment(p, a, b):
    ab = [y - x for x, y in zip(a, b)]
    ap = [y - x for x, y in zip(a, p)]
    length = sum(x * x for x in ab)
    share = min(max(sum(x * y for x, y in zip(ap, ab)) / length, 0.0), 1.0) if length else 0.0
    return math.dist(p, [x + share * d for x, d in zip(a, ab)])


def tool_motion(watch):
    """Return highest speed, m/s, and acceleration, m/s2, of the tool centre point."""
    points = [point(tool) for tool in watch.tools()]
    velocities = [[(y - x) / CYCLE_TIME_S for x, y in zip(a, b)] for a, b in zip(points, points[1:])]
    speeds = [math.hypot(*v) for v in velocities]
    accelerations = [math.dist(a, b) / CYCLE_TIME_S for a, b in zip([[0.0] * 3, *velocities], [*velocities, [0.0] * 3])]
    return max(speeds), max(accelerations)


@BOTH
def test_a_line_is_straight_and_ends_exactly(jerk_limited):
    watch = PlantWatch(jerk_limited=jerk_limited)
    watch.plant.add_linear_move(shift(-0.1, 0.25, 0.1, (0.3, -0.2, 0.5)), 0.25, 1.0, relative=True)
    watch.run()
    tools = watch.tools()
    assert [b - a for a, b in zip(point(tools[0]), point(tools[-1]))] == pytest.approx([-0.1, 0.25, 0.1], abs=1e-9)
    assert max(distance_to_segment(point(t), point(tools[0]), point(tools[-1])) for t in tools) < 1e-6
    speed, acceleration = tool_motion(watch)
    assert speed == pytest.approx(0.25, rel=1e-3)
    assert acceleration <= 1.0 * 1.01


def test_the_tool_turns_about_one_axis_along_a_line():
    watch = PlantWatch()
    watch.plant.add_linear_move(shift(0.0, 0.2, 0.0, (0.0, 0.0, 0.8)), 0.25, 1.0, relative=True)
    watch.run()
    tools = watch.tools()
    total = rotation_angle_between(tools[0], tools[-1])
    assert total == pytest.approx(0.8)
    for tool in tools:
        share = math.dist(point(tool), point(tools[0])) / 0.2
        assert rotation_angle_between(tools[0], tool) == pytest.approx(share * total, abs=1e-6)


def test_rotation_speed_and_acceleration_hold_where_they_are_the_slower():
    watch = PlantWatch()
    watch.plant.add_linear_move(shift(0.0, 0.01, 0.0, (0.0, 0.0, 1.0)), 0.25, 1.0, relative=True,
                                rotation_speed=0.4, rotation_acceleration=0.8)
    watch.run()
    tools = watch.tools()
    rates = [rotation_angle_between(a, b) / CYCLE_TIME_S for a, b in zip(tools, tools[1:])]
    assert max(rates) == pytest.approx(0.4, rel=1e-3)
    assert max(abs(b - a) / CYCLE_TIME_S for a, b in zip([0.0, *rates], rates)) <= 0.8 * 1.01


@BOTH
@settings(max_examples=15)
@given(tolerance=st.floats(0.001, 0.05), turn=st.floats(0.3, 3.0), speed=st.floats(0.05, 0.5))
@example(tolerance=0.03125, turn=0.375, speed=0.359375)  # the corner lowers the limits while the arm still speeds up
def test_a_rounded_corner_stays_within_its_tolerance(jerk_limited, tolerance, turn, speed):
    watch = PlantWatch(jerk_limited=jerk_limited)
    watch.plant.add_linear_move(shift(y=0.15), speed, 1.0, relative=True, tolerance=tolerance)
    watch.plant.add_linear_move(shift(x=-0.12 * math.sin(turn), y=0.12 * math.cos(turn)), speed, 1.0, relative=True)
    corner_seen = watch.plant.queue.length
    watch.run()
    assert corner_seen == 2
    points = [point(tool) for tool in watch.tools()]
    start, end = points[0], points[-1]
    corner = (start[0], start[1] + 0.15, start[2])
    beside = max(min(distance_to_segment(p, start, corner), distance_to_segment(p, corner, end)) for p in points)
    assert beside <= tolerance
    speeds = [math.dist(a, b) / CYCLE_TIME_S for a, b in zip(points, points[1:])]
    nearest = min(range(len(points)), key=lambda n: math.dist(points[n], corner))
    assert math.dist(points[nearest], corner) <= tolerance + speeds[min(nearest, len(speeds) - 1)] * CYCLE_TIME_S
    assert speeds[min(nearest, len(speeds) - 1)] > 0.0
    fastest, hardest = tool_motion(watch)
    assert fastest <= speed * 1.005
    assert hardest <= 1.0 * 1.02


def test_without_tolerance_the_arm_stands_at_the_corner():
    watch = PlantWatch()
    watch.plant.add_linear_move(shift(y=0.1), 0.2, 1.0, relative=True)
    watch.plant.add_linear_move(shift(x=-0.1), 0.2, 1.0, relative=True)
    watch.run()
    points = [point(tool) for tool in watch.tools()]
    corner = (points[0][0], points[0][1] + 0.1, points[0][2])
    assert min(math.dist(p, corner) for p in points) < 1e-9


def test_a_line_added_in_mid_motion_is_blended_and_one_added_too_late_is_not():
    passed = {}
    for cycles in (20, 74):
        watch = PlantWatch()
        watch.plant.add_linear_move(shift(y=0.1), 0.2, 1.0, relative=True, tolerance=0.01, line_id=1)
        watch.step(cycles)
        watch.plant.add_linear_move(shift(x=-0.1), 0.2, 1.0, relative=True, line_id=2)
        watch.run()
        assert watch.plant.queue.motion_line == 2
        points = [point(tool) for tool in watch.tools()]
        passed[cycles] = min(math.dist(p, (points[0][0], points[0][1] + 0.1, points[0][2])) for p in points)
    assert passed[20] == pytest.approx(0.01, abs=0.002)
    assert passed[74] < 1e-9


def test_a_long_chain_of_blended_lines_runs_through_and_counts_down():
    watch = PlantWatch()
    for n in range(24):
        watch.plant.add_linear_move(shift(x=-0.01 if n % 2 else 0.0, y=0.0 if n % 2 else 0.01), 0.1, 1.0,
                                    relative=True, tolerance=0.002, line_id=n + 2)
    lengths = [watch.plant.queue.length]
    while not watch.plant.is_in_position:
        watch.step()
        lengths.append(watch.plant.queue.length)
    assert lengths[0] == 24
    assert lengths == sorted(lengths, reverse=True)
    assert watch.plant.queue.motion_line == 25
    points = [point(tool) for tool in watch.tools()]
    assert [b - a for a, b in zip(points[0], points[-1])] == pytest.approx([-0.12, 0.12, 0.0], abs=1e-9)


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_an_arc_runs_through_both_points_on_one_circle(turns):
    watch = PlantWatch()
    watch.plant.add_arc_move(shift(-0.05, 0.05), shift(-0.1, 0.0), 0.1, 1.0, relative=True, turns=turns, line_id=4)
    watch.run()
    points = [point(tool) for tool in watch.tools()]
    centre = (points[0][0] - 0.05, points[0][1], points[0][2])
    assert max(abs(math.dist(p, centre) - 0.05) for p in points) < 1e-6
    assert points[-1] == pytest.approx((points[0][0] - 0.1, points[0][1], points[0][2]), abs=1e-9)
    via = (centre[0], centre[1] + 0.05, centre[2])
    assert min(math.dist(p, via) for p in points) < 0.1 * CYCLE_TIME_S
    way = sum(math.dist(a, b) for a, b in zip(points, points[1:]))
    assert way == pytest.approx(0.05 * (math.pi + 2.0 * math.pi * turns), rel=1e-3)
    assert tool_motion(watch)[1] <= 1.0 * 1.02
    assert watch.plant.queue.motion_line == 4


@pytest.mark.parametrize(("mode", "turned"), [(0, 0.6), (1, 2 * math.pi - 0.6), (3, math.pi)])
def test_circle_mode_chooses_how_the_tool_turns(mode, turned):
    watch = PlantWatch()
    watch.plant.add_arc_move(shift(-0.02, 0.02), shift(-0.04, 0.0, rpy=(0.0, 0.0, 0.6)), 0.05, 1.0, relative=True,
                             circle_mode=mode)
    watch.run()
    tools = watch.tools()
    angle = sum(rotation_angle_between(a, b) for a, b in zip(tools, tools[1:]))
    assert angle == pytest.approx(turned, abs=1e-3)


@pytest.mark.parametrize(("via_turn", "turned"), [(0.3, 0.6), (0.3 - math.pi, 2 * math.pi - 0.6)])
def test_circle_mode_2_turns_by_way_of_the_middle_orientation(via_turn, turned):
    watch = PlantWatch()
    watch.plant.add_arc_move(shift(-0.02, 0.02, rpy=(0.0, 0.0, via_turn)), shift(-0.04, 0.0, rpy=(0.0, 0.0, 0.6)),
                             0.05, 1.0, relative=True, circle_mode=2)
    watch.run()
    tools = watch.tools()
    assert sum(rotation_angle_between(a, b) for a, b in zip(tools, tools[1:])) == pytest.approx(turned, abs=1e-3)


def test_near_a_singularity_a_line_is_slower_than_asked_for():
    watch = PlantWatch((0.0, 0.9, -1.0, 1.0, 0.35, 0.0))
    watch.plant.add_linear_move(shift(rpy=(0.0, 0.0, 0.3)), 0.5, 4.0, relative=True, rotation_speed=3.0)
    watch.run()
    assert watch.codes == []
    assert 0.5 < watch.fastest <= 1.0


def test_into_the_stretched_arm_a_line_stops_before_the_singularity():
    watch = PlantWatch()
    stretched = watch.plant.forward((0.0, 0.6, -0.01, math.pi / 2 - 0.59, math.pi / 2, 0.0))
    watch.plant.add_linear_move(stretched, 0.25, 1.0, line_id=2)
    watch.plant.add_joint_move((0.1,) * 6, 1.0, relative=True, line_id=3)
    watch.run()
    assert watch.codes == [events.SINGULARITY_PROTECTIVE_STOP.code]
    assert watch.plant.queue.length == 0
    assert watch.plant.queue.motion_line == 2
    assert 0.01 < abs(watch.plant.joint_position[2]) < 0.3


def test_an_arc_through_a_joint_limit_stops_on_it_and_says_that_it_failed():
    limits = ((-0.2, 0.05), *ZU7.joint_limits[1:])
    watch = PlantWatch((-0.1, *HOME[1:]), model=dataclasses.replace(ZU7, joint_limits=limits))
    watch.plant.add_arc_move(shift(-0.024, 0.0061), shift(-0.042, 0.023), 0.05, 1.0, relative=True, turns=1)
    watch.run()
    assert watch.codes == [events.LINEAR_MOVE_FAILED.code]
    assert watch.plant.joint_position[0] == pytest.approx(0.05, abs=1e-5)
    assert watch.plant.on_soft_limit


def test_a_line_whose_beginning_is_not_free_is_rejected():
    watch = PlantWatch((0.0, math.pi / 2, 0.0, math.pi / 2, math.pi / 2, 0.0))
    with pytest.raises(TargetRejected) as caught:
        watch.plant.add_linear_move(shift(z=-0.1), 0.25, relative=True)
    assert caught.value.event_code == events.SINGULARITY_PROTECTIVE_STOP.code
    assert watch.plant.is_in_position


@pytest.mark.parametrize("name", ["zu3", "zu12", "zu20", "minicobo", "a12"])
def test_lines_are_straight_on_other_arms(name):
    home = (0.2, 0.4, 0.8, 0.6, 0.9, 0.1) if name == "minicobo" else (0.2, 1.2, -1.3, 1.4, 1.2, 0.1)
    watch = PlantWatch(home, model=load_model(name))
    watch.plant.add_linear_move(shift(0.02, 0.05, 0.03, (0.1, 0.1, 0.1)), 0.2, 1.0, relative=True)
    watch.run()
    assert watch.codes == []
    tools = watch.tools()
    assert max(distance_to_segment(point(t), point(tools[0]), point(tools[-1])) for t in tools) < 1e-6
    assert [b - a for a, b in zip(point(tools[0]), point(tools[-1]))] == pytest.approx([0.02, 0.05, 0.03], abs=1e-8)


def test_a_line_given_for_another_tool_is_not_blended_into_the_one_before():
    watch = PlantWatch()
    watch.plant.add_linear_move(shift(y=0.1), 0.2, 1.0, relative=True, tolerance=0.02)
    watch.step(10)
    watch.plant.set_tool(Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0)))
    watch.plant.add_linear_move(shift(x=-0.1), 0.2, 1.0, relative=True)
    watch.run()
    points = [point(tool) for tool in watch.tools()]
    corner = (points[0][0], points[0][1] + 0.1, points[0][2])
    assert min(math.dist(p, corner) for p in points) < 1e-9
    assert points[-1] == pytest.approx((corner[0] - 0.1, corner[1], corner[2]), abs=1e-9)


def test_at_a_singularity_the_place_itself_can_still_be_named():
    watch = PlantWatch((0.0, 0.9, -1.0, 1.0, 0.0, 0.4))
    assert not watch.plant.add_end_move(watch.plant.tcp_pose(), 1.0, line_id=2)
    assert not watch.plant.add_linear_move(watch.plant.tcp_pose(), 0.1, line_id=3)
    assert watch.plant.add_error_line == 3
