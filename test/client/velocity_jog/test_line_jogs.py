"""The tool of a velocity jog: on its line, or standing, with the reason; and back where it came from."""
import math
import random

import pytest
from line_jogs import SPEEDS, JogCase, JogMeter, drawn_case, jogged

from jaka_ros_driver.client.core.velocity_jog.line import JogLine, line_along, turned
from jaka_ros_driver.client.core.velocity_jog.line_follower import LineFollower, _towards
from jaka_ros_driver.client.core.velocity_jog.ramp import JogRamp, Wish
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.arm_models import load_model, model_names
from jaka_ros_driver.kinematics.forward import forward, link_transforms
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    TCP_ACCELERATION_CEILING,
    top_joint_speeds,
)
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    compose,
    distance_between,
    invert,
    matrix_from_rotation_vector,
    matrix_from_rpy,
    rotation_angle_between,
    rotation_vector_from_matrix,
    transform,
)

ZU7 = load_model("zu7")
HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
TOOL = transform(matrix_from_rpy((0.3, -0.2, 0.5)), (0.05, 0.0, 0.15))
DRAWN = 5
"""Jogs of each model."""
SIDEWAYS, TURN = 5e-4, 2e-3
"""Largest deviation from the line, m and rad."""
BACK, BACK_TURN = 1e-3, 5e-3


def test_every_model_keeps_its_line_or_stands_and_comes_back_and_goes_where_the_service_goes():
    could = went = 0
    for name in model_names():
        rng = random.Random(name)
        for number in range(DRAWN):
            case = drawn_case(load_model(name), rng)
            told = "%s, jog %d: %s %d" % (name, number, case.space, case.axis)
            verdict = jogged(case)
            assert verdict.sideways <= SIDEWAYS and verdict.turn <= TURN, told
            assert verdict.is_within and not verdict.is_crossed, told
            assert verdict.way >= case.wanted or verdict.obstacle, told
            assert verdict.back is not None and verdict.back[0] <= BACK and verdict.back[1] <= BACK_TURN, told
            if case.service_way() >= case.wanted:
                could, went = could + 1, went + (verdict.way >= case.wanted)
    assert could > 60 and went >= 0.95 * could


def stands(start, twist, frame=JogFrame.BASE, model=ZU7, cycles=1000):
    """Jog until the tool stands; return the ramp and the largest deviation from the line sideways and in turn."""
    ramp = JogRamp(start, model, SPEEDS)
    axis = next(n for n, value in enumerate(twist) if value)
    meter = JogMeter(JogCase(model, start, IDENTITY, IDENTITY, frame.name.lower(), axis, math.copysign(1, twist[axis])))
    for _ in range(cycles):
        meter.take(ramp.step(Wish(frame, twist)))
        if ramp.obstacle:
            break
    return ramp, meter


def test_at_the_edge_of_its_reach_the_tool_stands_and_the_way_back_leads_home():
    ramp, meter = stands(HOME, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0), cycles=625)
    assert ramp.obstacle == "the arm is stretched: jog joint 3" and meter.sideways < 1e-6 and meter.turn < 1e-6
    assert ramp.position[2] < 0.0, "the elbow has flipped"
    place = ramp.position
    assert ramp.step(Wish(JogFrame.BASE, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0))) == place
    along = math.inf
    while along > 0.0:
        along, _, _ = meter.take(ramp.step(Wish(JogFrame.BASE, (-0.1, 0.0, 0.0, 0.0, 0.0, 0.0))))
        assert ramp.obstacle == ""
    assert ramp.position == pytest.approx(HOME, abs=5e-3) and meter.sideways < 1e-6 and not meter.is_crossed


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tool_that_nears_the_edge_of_its_reach_slows_down_without_jerking_on(sign):
    ramp, tools = JogRamp(HOME, ZU7, SPEEDS), []
    while not ramp.obstacle and len(tools) < 1000:
        tools.append(forward(ZU7, ramp.step(Wish(JogFrame.BASE, (0.0, 0.25 * sign, 0.0, 0.0, 0.0, 0.0)))))
    speeds = [distance_between(a, b) / SERVO_PERIOD_S for a, b in zip(tools, tools[1:])]
    slowing = speeds[max(number for number, speed in enumerate(speeds) if speed > 0.249):]
    assert ramp.obstacle and len(slowing) > 50 and sum(max(0.0, b - a) for a, b in zip(slowing, slowing[1:])) < 0.025


@pytest.mark.parametrize("start, twist, reason", [
    ((0.0, 2.0, -2.0, 1.6, 1.5, 0.0), (0.1, 0.0, 0.0, 0.0, 0.0, 0.0),
     "shoulder singularity, the wrist is above joint 1: jog joint 2"),
    (HOME[:3] + (ZU7.joint_limits[3][1] - 0.1, 1.6, 0.0), (0.0, 0.0, 0.0, 0.0, 0.3, 0.0), "joint 4 is at its limit"),
    (HOME[:3] + (ZU7.joint_limits[3][1] - 0.1, 1.6, 0.0), (0.0, 0.0, 0.0, 0.0, -0.3, 0.0), "joint 4 is at its limit")])
def test_what_the_arm_stands_at_is_said_with_what_leads_on(start, twist, reason):
    said = {stands(start, tuple([sign * value for value in twist]))[0].obstacle for sign in (1.0, -1.0)}
    assert reason in said


def test_the_wrist_is_not_turned_through_its_singularity():
    start = (0.0, 1.6, -1.6, 1.6, 0.3, 0.0)
    axis, on_axis = link_transforms(ZU7, start)[4][2:9:3], IDENTITY[:9] + (0.0, 0.0, -ZU7.dh[5].d)
    ramp = JogRamp(start, ZU7, SPEEDS)
    for _ in range(300):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.0, 0.0, *[-0.3 * value for value in axis]), on_axis))
    assert ramp.obstacle == "wrist singularity: jog joint 5" and 0.0 < ramp.position[4] < 0.02
    assert ramp.position[:4] == pytest.approx(start[:4], abs=1e-4)


def test_nothing_is_said_of_a_tool_that_moves_or_is_asked_to_rest():
    ramp, _ = stands(HOME, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert ramp.obstacle
    ramp.step(Wish(JogFrame.BASE, (0.0,) * 6))
    assert ramp.obstacle == ""
    ramp.step(Wish(JogFrame.BASE, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert ramp.obstacle
    ramp.step(None)
    assert ramp.obstacle == ""
    ramp.step(Wish(JogFrame.JOINT, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0)))
    assert ramp.obstacle == ""


def test_released_anywhere_it_brakes_on_its_line():
    for cycles in range(20, 320, 50):
        start = compose(forward(ZU7, HOME), TOOL)
        ramp = JogRamp(HOME, ZU7, SPEEDS)
        for _ in range(cycles):
            ramp.step(Wish(JogFrame.BASE, (0.25, 0.0, 0.0, 0.0, 0.0, 0.0), TOOL))
        while not ramp.is_still:
            ramp.step(None)
            tool = compose(forward(ZU7, ramp.position), TOOL)
            assert math.hypot(tool[10] - start[10], tool[11] - start[11]) < 1e-6
            assert rotation_angle_between(start, tool) < 1e-6


def test_another_direction_begins_a_line_where_the_tool_has_taken_it_up():
    ramp = JogRamp(HOME, ZU7, SPEEDS)
    for _ in range(40):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.0, -0.2, 0.0, 0.0, 0.0)))
    for _ in range(15):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.2, 0.0, 0.0, 0.0, 0.0)))
    begun = forward(ZU7, ramp.position)
    for _ in range(100):
        tool = forward(ZU7, ramp.step(Wish(JogFrame.BASE, (0.0, 0.2, 0.0, 0.0, 0.0, 0.0))))
        assert math.hypot(tool[9] - begun[9], tool[11] - begun[11]) < 1e-6
        assert rotation_angle_between(begun, tool) < 1e-6
    assert tool[10] - begun[10] == pytest.approx(100 * 0.2 * SERVO_PERIOD_S, rel=1e-3)


@pytest.mark.parametrize("frame", [JogFrame.BASE, JogFrame.TOOL])
def test_moving_and_turning_at_once_follow_one_line(frame):
    twist = (0.03, -0.05, 0.02, 0.2, 0.1, -0.3)
    ramp, start = JogRamp(HOME, ZU7, SPEEDS), compose(forward(ZU7, HOME), TOOL)
    line, _ = line_along(start, twist, frame)
    for _ in range(60):
        tool = compose(forward(ZU7, ramp.step(Wish(frame, twist, TOOL))), TOOL)
        turn = math.hypot(*rotation_vector_from_matrix(compose(tool, invert(start)))) / math.hypot(*line.direction[3:])
        assert distance_between(tool, line.at(turn)) < 1e-6 and rotation_angle_between(tool, line.at(turn)) < 1e-6
    assert turn > 0.05


def test_a_frame_that_changes_while_the_tool_moves_in_one_direction_changes_nothing():
    start = forward(ZU7, HOME)
    of_tool = turned(invert(start), (0.0, 0.0, -0.1, 0.0, 0.0, 0.0))
    ramp = JogRamp(HOME, ZU7, SPEEDS)
    for count in range(60):
        frame, twist = ((JogFrame.BASE, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0)), (JogFrame.TOOL, of_tool))[count // 15 % 2]
        tool = forward(ZU7, ramp.step(Wish(frame, twist)))
        assert math.hypot(tool[9] - start[9], tool[10] - start[10]) < 1e-6
    assert start[11] - tool[11] > 0.045


def test_another_tool_is_led_only_after_the_first_has_come_to_rest():
    ramp = JogRamp(HOME, ZU7, SPEEDS)
    for _ in range(30):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0)))
    start, cycles = forward(ZU7, HOME), 0
    while not ramp.is_still:
        tool = forward(ZU7, ramp.step(Wish(JogFrame.BASE, (0.0, 0.1, 0.0, 0.0, 0.0, 0.0), TOOL)))
        assert abs(tool[10] - start[10]) < 1e-6
        cycles += 1
    assert 1 < cycles <= 10
    for _ in range(30):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.1, 0.0, 0.0, 0.0, 0.0), TOOL))
    assert forward(ZU7, ramp.position)[10] - tool[10] > 0.02


@pytest.mark.parametrize("wrist", [0.0, 1.5e-4])
def test_an_arm_that_begins_at_a_singularity_or_just_beside_it_moves_where_its_joints_can(wrist):
    start = (0.0, 1.6, -1.6, 1.6, wrist, 0.0)
    ramp = JogRamp(start, ZU7, SPEEDS)
    for _ in range(60):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.0, -0.1, 0.0, 0.0, 0.0)))
    moved = [b - a for a, b in zip(forward(ZU7, start)[9:], forward(ZU7, ramp.position)[9:])]
    assert moved[:2] == pytest.approx((0.0, 0.0), abs=1e-6) and moved[2] < -0.04


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_arm_of_one_measure_goes_nearer_to_a_singularity_that_is_far(sign):
    a12, start = load_model("a12"), (0.0, 1.2, -1.1, 0.8, 0.9, 0.2)
    ramp = JogRamp(start, a12, SPEEDS)
    for _ in range(60):
        ramp.step(Wish(JogFrame.BASE, (0.0, 0.1 * sign, 0.0, 0.0, 0.0, 0.0)))
        assert ramp.obstacle == ""
    moved = [b - a for a, b in zip(forward(a12, start)[9:], forward(a12, ramp.position)[9:])]
    assert moved == pytest.approx((0.0, 0.0477 * sign, 0.0), abs=5e-4)


def test_a_turned_wish_keeps_its_axis_and_its_centre():
    line = JogLine(transform(matrix_from_rpy((0.1, 0.2, 0.3)), (0.4, 0.5, 0.6)), (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
                   JogFrame.BASE)
    assert line.at(0.7)[9:] == (0.4, 0.5, 0.6)
    assert rotation_vector_from_matrix(compose(line.at(0.7), invert(line.at(0.0)))) == pytest.approx((0.0, 0.0, 0.7))


def test_the_rate_of_a_twist_on_a_line_and_of_one_that_leads_elsewhere():
    line, rate = line_along(IDENTITY, (0.0, 0.3, 0.0, 0.0, 0.0, 1.0), JogFrame.TOOL)
    assert line.speed_of([-0.5 * value for value in (0.0, 0.3, 0.0, 0.0, 0.0, 1.0)]) == pytest.approx(-0.5 * rate)
    assert math.isnan(line.speed_of((0.0, 0.3, 0.001, 0.0, 0.0, 1.0)))


@pytest.mark.parametrize("since, then", [(JogFrame.BASE, JogFrame.TOOL), (JogFrame.TOOL, JogFrame.BASE)])
def test_a_tool_that_is_asked_for_the_same_motion_along_other_axes_goes_on_as_it_goes(since, then):
    follower, along = LineFollower(HOME, TOOL, ZU7, top_joint_speeds(ZU7), 200), (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)

    def tool():
        return compose(forward(ZU7, follower.now.joint_position), TOOL)

    places = []
    for frame, cycles in ((since, 100), (then, 60)):
        for _ in range(cycles):
            follower.step(along if frame is JogFrame.BASE else turned(invert(tool()), along), frame)
            places.append(tool()[9:])
    steps = [tuple([b - a for a, b in zip(*pair)]) for pair in zip(places[70:], places[71:])]
    assert all(x == pytest.approx(0.1 * SERVO_PERIOD_S, rel=0.02) and math.hypot(y, z) < 1e-5 for x, y, z in steps)


def test_a_twist_changes_within_the_accelerations_of_place_and_turn_each_by_its_own():
    most, turn = TCP_ACCELERATION_CEILING * SERVO_PERIOD_S, JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
    both = (most, 0.0, 0.0, 0.0, turn, 0.0)
    assert _towards((0.0,) * 6, both) == both
    assert _towards((0.0,) * 6, tuple([2.0 * value for value in both])) == pytest.approx(both)
    assert _towards((0.0,) * 6, (0.0, 0.0, 0.0, 0.0, 0.0, 4.0 * turn)) == pytest.approx((0.0,) * 5 + (turn,))


def test_the_first_step_from_rest_is_one_of_the_acceleration_of_a_cycle():
    follower = LineFollower(HOME, TOOL, ZU7, top_joint_speeds(ZU7), 200)
    begin = compose(forward(ZU7, HOME), TOOL)
    follower.step((0.25, 0.0, 0.0, 0.0, 0.0, 0.0), JogFrame.BASE)
    way = distance_between(begin, compose(forward(ZU7, follower.now.joint_position), TOOL))
    assert 0.0 < way <= 1.01 * TCP_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_turns_at_its_highest_speed_either_way(sign):
    follower = LineFollower(HOME, IDENTITY, ZU7, (2.0,) * 6, 200)
    for _ in range(100):
        follower.step((0.0, 0.0, 0.0, 0.0, 0.0, 3.0 * sign), JogFrame.TOOL)
    assert 1.9 < sign * follower.now.joint_velocity[5] <= 2.0


@pytest.mark.parametrize("frame", [JogFrame.BASE, JogFrame.TOOL])
@pytest.mark.parametrize("twist", [
    (0.1, -0.2, 0.3, 0.7, 0.4, -0.5), (0.0, 0.2, 0.0, 0.0, 0.0, 0.9), (0.3, 0.1, -0.2, 2e-5, -3e-5, 1e-5),
    (0.0, 0.0, 0.0, 0.3, -0.6, 0.2), (0.2, 0.0, 0.1, 0.0, 0.0, 0.0)])
def test_the_tool_is_where_many_small_steps_of_the_twist_lead(frame, twist):
    line, speed = line_along(TOOL, twist, frame)
    steps = 4000
    small = transform(matrix_from_rotation_vector([value / steps for value in twist[3:]]),
                      [value / steps for value in twist[:3]])
    place = TOOL
    for _ in range(steps):
        place = compose(place, small) if frame is JogFrame.TOOL else transform(
            compose(transform(small[:9], (0.0, 0.0, 0.0)), place)[:9], [a + b for a, b in zip(place[9:], small[9:])])
    assert line.at(speed) == pytest.approx(place, abs=1e-4)
