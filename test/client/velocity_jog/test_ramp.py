"""The ramp of a velocity jog: whatever is asked for, no limit is passed, and it comes to rest in time."""
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaka_ros_driver.client.core.velocity_jog.ramp import (
    FASTEST_JOINT,
    JogRamp,
    JogSpeeds,
    Wish,
    require_possible,
    speed_to_stop_within,
)
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.forward import forward, jacobian
from jaka_ros_driver.kinematics.limits import (
    JOINT_ACCELERATION_CEILING,
    SERVO_PERIOD_S,
    TCP_ACCELERATION_CEILING,
    stream_limits,
)
from jaka_ros_driver.kinematics.rotations import compose, rotation_vector_from_matrix, transform, turn_between

MODEL = load_model("zu7")
HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
SPEEDS = JogSpeeds(1.0, 0.6, 1.0)
TOOL = transform((0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0), (0.05, 0.0, 0.15))
CYCLE = SERVO_PERIOD_S
ROUNDING = 1e-9
LONGEST_BRAKE_S = 0.0801


def joints(*velocity):
    return Wish(JogFrame.JOINT, velocity + (0.0,) * (6 - len(velocity)))


def of_tool(*twist, frame=JogFrame.BASE, tool=TOOL):
    return Wish(frame, twist + (0.0,) * (6 - len(twist)), tool)


class Watched:
    """A ramp whose steps are all checked."""

    def __init__(self, start=HOME, model=MODEL, speeds=SPEEDS):
        self.model, self.ramp = model, JogRamp(start, model, speeds)
        self.path = [start]
        self.velocity = (0.0,) * 6

    def step(self, wish, cycles=1, scale=1.0):
        for _ in range(cycles):
            self.path.append(self.ramp.step(wish, scale))
            velocity = tuple([(b - a) / CYCLE for a, b in zip(self.path[-2], self.path[-1])])
            for joint, (before, after) in enumerate(zip(self.velocity, velocity)):
                assert abs(after) <= min(FASTEST_JOINT, self.model.joint_max_speed[joint]) + ROUNDING
                assert abs(after - before) <= JOINT_ACCELERATION_CEILING * CYCLE + ROUNDING
                low, high = self.model.joint_limits[joint]
                assert low - ROUNDING <= self.path[-1][joint] <= high + ROUNDING
            self.velocity = velocity
        return self

    def brake(self):
        """Brake to rest; return the cycles it took."""
        for count in range(1, 100):
            self.step(None)
            if self.ramp.is_still:
                assert self.path[-1] == self.path[-2]
                return count
        raise AssertionError("it does not come to rest")


VELOCITIES = st.floats(-3.0, 3.0) | st.sampled_from([0.0, 3.0, -3.0])
WISHES = st.builds(lambda frame, values: Wish(frame, tuple(values), TOOL), st.sampled_from(list(JogFrame)),
                   st.lists(VELOCITIES, min_size=6, max_size=6))
PLACES = st.tuples(*[st.floats(low, high) | st.sampled_from([low, high, 0.5 * (low + high)])
                     for low, high in MODEL.joint_limits])


@settings(max_examples=60)
@given(start=PLACES, changes=st.lists(st.tuples(st.none() | WISHES, st.integers(1, 40), st.floats(0.0, 1.0)),
                                      min_size=1, max_size=5))
def test_no_limit_is_passed_whatever_is_asked_for_and_it_rests_in_time(start, changes):
    watched = Watched(start)
    for wish, cycles, scale in changes:
        watched.step(wish, cycles, scale)
    assert watched.brake() * CYCLE <= LONGEST_BRAKE_S


@settings(max_examples=200)
@given(room=st.floats(0.0, 1.0))
def test_braking_in_whole_cycles_ends_within_the_room_and_uses_it(room):
    speed, way, change = speed_to_stop_within(room), 0.0, JOINT_ACCELERATION_CEILING * CYCLE
    while speed > 0.0:
        way += speed * CYCLE
        speed -= change
    assert way == pytest.approx(room, abs=1e-12)


def test_no_room_is_no_speed():
    assert speed_to_stop_within(-0.1) == speed_to_stop_within(0.0) == 0.0


def test_joints_get_the_speed_that_is_asked_for_and_rest_again():
    watched = Watched().step(joints(0.4, -0.2), 50)
    assert watched.velocity == pytest.approx((0.4, -0.2, 0, 0, 0, 0))
    assert watched.brake() <= 5


def test_more_than_the_highest_speed_is_slowed_down_along_its_way():
    watched = Watched(speeds=JogSpeeds(0.5, 0.25, 0.5)).step(joints(1.0, 0.5), 50)
    assert watched.velocity == pytest.approx((0.5, 0.25, 0, 0, 0, 0))
    watched = Watched(speeds=JogSpeeds(0.5, 0.25, 0.5)).step(of_tool(0.0, 0.5, 0.0, 0.2), 30)
    twist = jacobian(MODEL, watched.path[-2], TOOL) @ np.array(watched.velocity)
    assert twist == pytest.approx((0.0, 0.25, 0.0, 0.1, 0.0, 0.0), abs=2e-3)


def test_the_speed_override_slows_everything():
    assert Watched().step(joints(0.4), 50, scale=0.5).velocity[0] == pytest.approx(0.2)
    assert Watched().step(joints(0.4), 50, scale=0.0).path[-1] == HOME


def test_a_joint_stops_at_its_limit_and_others_go_on():
    high = stream_limits(MODEL)[2][1]
    watched = Watched(HOME[:2] + (high - 0.05,) + HOME[3:]).step(joints(0.3, 0.0, 1.0), 60)
    assert watched.path[-1][2] == pytest.approx(high) and watched.velocity[0] == pytest.approx(0.3)
    assert watched.velocity[2] == pytest.approx(0.0, abs=1e-9)


def test_an_arm_beyond_a_limit_can_only_come_back():
    start = (MODEL.joint_limits[0][1] + 0.05,) + HOME[1:]
    ramp = JogRamp(start, MODEL, SPEEDS)
    assert [ramp.step(joints(0.5))[0] for _ in range(20)][-1] == start[0]
    assert [ramp.step(joints(-0.5))[0] for _ in range(40)][-1] < MODEL.joint_limits[0][1]


@pytest.mark.parametrize("frame", [JogFrame.BASE, JogFrame.TOOL])
@pytest.mark.parametrize("axis", range(6))
def test_the_tool_moves_and_turns_about_its_centre_as_asked(frame, axis):
    twist = [0.0] * 6
    twist[axis] = 0.1 if axis < 3 else 0.2
    start = compose(forward(MODEL, HOME), TOOL)
    watched = Watched().step(of_tool(*twist, frame=frame), 125)
    watched.brake()
    end = compose(forward(MODEL, watched.path[-1]), TOOL)
    moved = [b - a for a, b in zip(start[9:], end[9:])]
    turned = list(turn_between(start, end))
    if frame is JogFrame.TOOL:  # in the axes of the tool at its start, about which alone it turns
        moved, turned = ([sum(start[3 * row + column] * way[row] for row in range(3)) for column in range(3)]
                         for way in (moved, turned))
    expected = [value * 1.0 for value in twist]
    assert moved + turned == pytest.approx(expected, abs=4e-3)


def test_speed_and_acceleration_of_the_tool_are_bounded():
    watched = Watched().step(of_tool(0.0, 0.6), 30)
    watched.brake()
    places = [compose(forward(MODEL, q), TOOL)[9:] for q in watched.path]
    speeds = [[(b - a) / CYCLE for a, b in zip(p, q)] for p, q in zip(places, places[1:])]
    assert max(math.hypot(*speed) for speed in speeds) <= 0.6 * 1.01
    changes = [math.dist(p, q) / CYCLE for p, q in zip(speeds, speeds[1:])]
    assert max(changes) <= TCP_ACCELERATION_CEILING * 1.05


@pytest.mark.parametrize("singular", [
    (0.0, 1.5, -1.5, 1.5, 0.0, 0.0), (0.0, 1.0, 0.0, 1.0, 1.5, 0.0), (0.0,) * 6], ids=["wrist", "elbow", "both"])
@pytest.mark.parametrize("axis", range(6))
def test_through_singularities_no_joint_is_faster_than_it_may_be(singular, axis):
    twist = [0.0] * 6
    twist[axis] = 0.25 if axis < 3 else 1.0
    for offset in (0.0, 1e-6, 1e-3, 0.02):
        start = tuple([q + offset for q in singular])
        watched = Watched(start).step(of_tool(*twist), 60).step(of_tool(*[-v for v in twist]), 60)
        assert watched.brake() * CYCLE <= LONGEST_BRAKE_S


@pytest.mark.parametrize("wish, told", [
    (joints(3.3), "joint 1 is asked for 3.3 rad/s"), (joints(0.0, -3.3), "joint 2"),
    (joints(float("nan")), "finite"), (joints(math.inf), "finite"), (Wish(JogFrame.JOINT, (0.1,) * 5), "finite"),
    (of_tool(5.0), "the tool is asked for 5 m/s"), (of_tool(0.0, 0.0, 0.0, 4.0), "the tool is asked for 4 rad/s"),
    (of_tool(1e308, 1e308), "the tool is asked for")])
def test_speeds_that_the_arm_does_not_have_are_refused(wish, told):
    with pytest.raises(InvalidCommand, match=told):
        require_possible(wish, MODEL)


def test_speeds_that_it_has_are_taken():
    require_possible(joints(*MODEL.joint_max_speed), MODEL)
    require_possible(of_tool(0.5, 0.0, 0.0, 1.0), MODEL)


def test_a_rotation_of_the_tool_is_none_of_its_centre():
    watched = Watched().step(of_tool(0.0, 0.0, 0.0, 0.0, 0.0, 0.5), 60)
    start, end = (compose(forward(MODEL, q), TOOL) for q in (HOME, watched.path[-1]))
    assert math.dist(start[9:], end[9:]) < 2e-3
    assert math.hypot(*rotation_vector_from_matrix(end)) > 0.2


def twist_of(watched):
    """Return the tool's twist in the last cycle, m/s (3,) and rad/s (3,)."""
    return jacobian(watched.model, watched.path[-2], TOOL) @ np.array(watched.velocity)


@pytest.mark.parametrize("first, size, ceiling", [(0, 0.3, TCP_ACCELERATION_CEILING),
                                                  (3, 0.5, JOINT_ACCELERATION_CEILING)])
def test_another_direction_is_taken_up_on_a_straight_line_as_fast_as_the_tool_may(first, size, ceiling):
    before = [0.0] * first
    watched = Watched().step(of_tool(*before, size), 10)
    for cycle in range(1, 6):
        twist = twist_of(watched.step(of_tool(*before, 0.0, size)))
        gained = cycle * ceiling * CYCLE / math.sqrt(2.0)
        assert twist[first + 1] == pytest.approx(gained, rel=0.1)
        assert twist[first] == pytest.approx(size - gained, abs=0.03)


def test_way_and_turn_are_taken_up_together_where_one_of_them_takes_longer():
    watched, cycles = Watched(), 0.5 / (JOINT_ACCELERATION_CEILING * CYCLE)
    for cycle in range(1, 5):
        twist = twist_of(watched.step(of_tool(0.05, 0.0, 0.0, 0.0, 0.0, 0.5)))
        assert twist[5] == pytest.approx(0.5 * cycle / cycles, rel=0.03)
        assert twist[0] == pytest.approx(0.05 * cycle / cycles, abs=2e-3)


@pytest.mark.parametrize("side", [1, -1])
def test_a_joint_near_its_limit_slows_the_tool_and_does_not_lead_it_astray(side):
    joint = 3
    wish = of_tool(0.0, 0.0, 0.0, 0.0, 0.3)
    speeds = Watched().step(wish, 20).velocity
    wish = wish if side * speeds[joint] > 0.0 else of_tool(0.0, 0.0, 0.0, 0.0, -0.3)
    limits = list(MODEL.joint_limits)
    near, far = HOME[joint] + side * 0.03, HOME[joint] - side * 2.0
    limits[joint] = (min(near, far), max(near, far))
    watched, slowest = Watched(model=dataclasses.replace(MODEL, joint_limits=tuple(limits))), 1.0
    for _ in range(60):
        twist = twist_of(watched.step(wish))
        slowest = min(slowest, abs(twist[4]) if len(watched.path) > 20 else 1.0)
        assert np.abs(np.delete(twist, 4)).max() < 0.03
    assert slowest < 0.05, "it has come to the limit"
