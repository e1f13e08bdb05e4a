"""The audit, which refuses whatever a joint cannot do on the whole way, by joint, time, value and limit."""
import numpy as np
import pytest
from plans import HOME, MODEL, REST, START_TOLERANCE, at, build, joints, moving, resting, six, wave

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import stream_limits
from jaka_ros_driver.trajectory.audit import _judge
from jaka_ros_driver.trajectory.build import MAX_DELAY_S, BuildOptions, PathStart, build_path
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory, TrajectoryOfThePast, TrajectoryPoint
from jaka_ros_driver.trajectory.rates import Overshoots

OPTIONS = BuildOptions(START_TOLERANCE)
AT_REST_AT_1 = (at(1.0, (0.3,), REST),)
REFUSED = {
    "a point outside the limits": (
        None, [at(4.0, (0.0, 3.5), REST)],
        r"joint 2 would be at 4\.6\d+ rad after [23]\.\d+ s; valid: -1\.482530 to 4\.624123 rad"),
    "outside at the other side": (
        None, [at(4.0, (0.0, 0.0, -2.0), REST)],
        r"joint 3 would be at -3\.0\d+ rad after [23]\.\d+ s; valid: -3\.053326 to 3\.053326 rad"),
    "overshoot between two points that are inside": (
        resting(0.0, 0.0, 4.4), [at(0.5, (0.0, 0.0, 4.6), (0.0, 0.0, 0.4)), at(1.0, (0.0, 0.0, 4.6), (0.0, 0.0, -0.4)),
                                 at(2.0, (0.0, 0.0, 4.4), REST)],
        r"joint 3 would be at 3\.05\d+ rad after 0\.[5-9]\d+ s; valid: -3\.053326 to 3\.053326 rad"),
    "too fast": (
        None, [at(1.5, (3.5,), REST)], r"joint 1 would run at 3\.\d+ rad/s after 0\.\d+ s; valid: at most 3\.1416"),
    "too fast the other way": (
        None, [at(1.5, (0.0, 0.0, 0.0, 0.0, 0.0, -3.5), REST)],
        r"joint 6 would run at -3\.\d+ rad/s after 0\.\d+ s; valid: at most 3\.1416 rad/s"),
    "too fast between two slow points": (
        None, [at(1.0, (0.5,), (1.0,)), at(1.4, (2.0,), (1.0,)), at(3.0, (2.5,), REST)],
        r"joint 1 would (run at \d\.\d+ rad/s|need \d+\.\d+ rad/s2) after 1\.\d+ s; valid: at most"),
    "too much acceleration": (
        None, [at(0.4, (0.0, 0.0, 0.0, 0.0, 0.5), REST)],
        r"joint 5 would need \d\d\.\d+ rad/s2 after 0\.\d+ s; valid: at most 12\.5664 rad/s2"),
    "an acceleration that a point asks for": (
        None, [at(1.0, (0.3,), REST, (-20.0,)), at(2.0, (0.4,), REST, REST)],
        r"joint 1 would need -\d\d\.\d+ rad/s2 after 0\.\d+ s; valid: at most 12\.5664 rad/s2"),
    "a speed that jumps at a point": (
        None, [at(1.0, (0.3,), (0.3,)), at(2.0, (0.3,)), at(3.0, (0.4,), REST)],
        r"the speed of joint 1 would change by -0\.3000 rad/s at once after 1\.000 s, which no joint can"),
    "a speed that jumps at the last point": (
        None, [at(1.0, (0.3,), REST), at(2.0, (0.3,)), at(3.0, (0.6,), REST)],
        r"the speed of joint 1 would change by 0\.3000 rad/s at once after 2\.000 s, which no joint can"),
    "a speed that jumps at once from rest": (
        None, [at(1.0, (0.5,)), at(2.0, (1.0,), (0.5,)), at(3.0, (1.25,), REST)],
        r"the speed of joint 1 would change by 0\.5000 rad/s at once after 0\.000 s, which no joint can"),
    "a speed that jumps where a moving arm joins": (
        moving((0.0,), (1.0,)), [at(1.0, (-0.5,)), at(2.0, (-1.0,), (-0.5,)), at(3.0, (-1.25,), REST)],
        r"the speed of joint 1 would change by -1\.5000 rad/s at once after 0\.000 s, which no joint can"),
    "numbers too large to count with": (
        None, [at(1.0, (1e38,), REST)], r"joint 1 would be at .* rad after 0\.\d+ s; valid: -6\.282185 to 6\.282185"),
    "velocities too large to count with": (
        None, [at(1.0, (0.1,), (1e38,)), at(2.0, (0.1,), REST)],
        r"joint 1 would be at .* rad after 0\.\d+ s; valid: -6\.282185 to 6\.282185"),
    "points that are too near in time to count with": (
        None, [at(1.0, (0.1,), REST), at(1.0 + 1e-15, (0.2,), REST), at(2.0, (0.2,), REST)],
        r"joint 1 would .* after 1\.000 s; valid: "),
    "a start that is too far from the arm": (
        resting(0.0, 0.0, 0.02), [at(0.0, (0.0,), REST), *AT_REST_AT_1],
        r"the trajectory begins 0\.0200 rad from where joint 3 is \(-1\.5508 rad\); at most 0\.01 rad are allowed"),
    "a start that is too far, already under way": (
        resting(-0.5), [at(0.0, (0.0,), REST), at(10.0, (0.3,), REST)],
        r"the trajectory begins 0\.5000 rad from where joint 1 is \(-0\.5000 rad\); at most 0\.01 rad are allowed"),
    "a single point that is due at once, too far from the arm": (
        resting(0.0, 0.02), [at(0.0, (0.0,), REST)],
        r"the trajectory begins 0\.0200 rad from where joint 2 is \(1\.5908 rad\)"),
}


@pytest.mark.parametrize("start, points, words", REFUSED.values(), ids=REFUSED)
def test_what_the_arm_cannot_follow_is_refused(start, points, words):
    with pytest.raises(InvalidTrajectory, match=words) as refusal:
        build(points, start)
    assert type(refusal.value) is InvalidTrajectory


def between_samples(duration, side):
    """Return points whose one long piece leaves the range of joint 3 by 0.0166 rad between its last samples."""
    power = np.polynomial.Polynomial
    x = power([0.0, 1.0])
    shape = (1.0 - x) * (63 / 64 - x) * (x + 0.1) * (x - 0.28) ** 2
    low, high = stream_limits(MODEL)[2]
    way = high - 1e-7 - 0.98 * (high - low) / shape(np.linspace(0.0, 1.0, 4001)).max() * shape

    def point(time, share, turned=0.0, is_still=False):
        values = [way.deriv(n)(share) / duration ** n if n else way(share) + turned for n in range(3)]
        position, velocity, acceleration = (side * value * np.eye(6)[2] for value in values)
        position += np.array(HOME) * (1.0, 1.0, 0.0, 1.0, 1.0, 1.0)
        return TrajectoryPoint(time, tuple(position), REST if is_still else tuple(velocity),
                               REST if is_still else tuple(acceleration))
    speed = way.deriv()(0.0) / duration
    return [point(0.0, 0.0, -0.5 * speed, True), point(1.0, 0.0), point(1.0 + duration, 1.0),
            point(5.0 + duration, 1.0, -1.5, True)]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("duration", [10.0, 20.0])
def test_a_long_piece_stays_in_the_range_between_its_samples_too(duration, side):
    points = between_samples(duration, side)
    with pytest.raises(InvalidTrajectory, match=r"joint 3 would be at -?3\.0(6|7)\d+ rad after (10|20)\.\d+ s"):
        build(points, PathStart(JointState(points[0].position, REST, REST), True))


@pytest.mark.parametrize("room, is_taken", [(2e-5, True), (-2e-5, False)])
def test_a_long_piece_may_come_as_near_to_a_limit_as_it_likes(room, is_taken):
    """Put the top of a parabola between two samples, whose bound passes the limit."""
    high = stream_limits(MODEL)[2][1]
    share, duration = 0.5 + 1 / 128, 8.0
    top, rise = high - room, 0.6  # position and speed of a parabola about the top, at both ends
    bend = rise / share ** 2
    position = [(top - bend * (x - share) ** 2, -2.0 * bend * (x - share) / duration) for x in (0.0, 1.0)]

    def point(time, value, speed):
        return TrajectoryPoint(time, HOME[:2] + (value,) + HOME[3:], six(0.0, 0.0, speed))
    points = [point(0.0, position[0][0] - 2.0 * position[0][1], 0.0), point(4.0, *position[0]),
              point(12.0, *position[1]), point(16.0, position[1][0] + 2.0 * position[1][1], 0.0)]
    start = PathStart(JointState(points[0].position, REST, REST), True)
    if is_taken:
        path = build(points, start)
        assert path.samples(np.linspace(4.0, 12.0, 10001))[0][:, 2].max() == pytest.approx(top, abs=1e-6)
    else:
        with pytest.raises(InvalidTrajectory, match=r"joint 3 would be at 3\.0533\d+ rad after 8\.0\d+ s"):
            build(points, start)


@pytest.mark.parametrize("elapsed, words", [
    (2.5, r"every point lies in the past: the last one was due 1\.500 s ago"),
    (1.001, r"every point lies in the past: the last one was due 0\.001 s ago")])
def test_points_that_all_lie_in_the_past_are_refused(elapsed, words):
    with pytest.raises(TrajectoryOfThePast, match=words):
        build(AT_REST_AT_1, elapsed=elapsed)


def test_a_moving_arm_cannot_take_a_single_point_that_is_due_now():
    with pytest.raises(TrajectoryOfThePast):
        build([at(0.0, (0.0,), REST)], moving((0.0,), (0.3,)))


def test_a_start_that_is_too_far_in_the_future_is_refused():
    with pytest.raises(InvalidTrajectory, match=r"the trajectory is to start in 60\.100 s; at most 60 s are waited"):
        build(AT_REST_AT_1, elapsed=-MAX_DELAY_S - 0.1)
    assert build(AT_REST_AT_1, elapsed=-MAX_DELAY_S).begin == -MAX_DELAY_S


def test_malformed_points_are_refused_before_anything_is_counted_with_them():
    for position in (six(float("nan")), six(float("inf")), (0.0,) * 5):
        with pytest.raises(InvalidTrajectory, match="point 1"):
            build([TrajectoryPoint(1.0, position, REST)])


def test_a_last_point_that_moves_is_braked_behind_within_the_limits():
    points = [at(1.0, (0.3,), (0.6,))]
    with pytest.raises(InvalidTrajectory, match="the last point has a velocity"):
        build(points)
    path = build(points, may_end_moving=True)
    assert path.at(1.0).velocity[0] == pytest.approx(0.6) and path.at(path.end).velocity == REST
    edge = MODEL.joint_limits[0][1]
    with pytest.raises(InvalidTrajectory, match=r"joint 1 would be at 6\.28\d+ rad after 1\.\d+ s"):
        build([at(1.0, (edge - 0.001,), (0.6,))], resting(edge - 0.3), may_end_moving=True)


def test_the_limits_are_those_of_the_model():
    slow = load_model("zu18")
    points = JointTrajectory((at(1.5, (2.3,), REST),))
    build_path(resting(), points, 0.0, MODEL, OPTIONS)
    with pytest.raises(InvalidTrajectory, match=r"joint 1 would run at 2\.\d+ rad/s .*valid: at most 2\.0944 rad/s"):
        build_path(resting(), points, 0.0, slow, OPTIONS)


def test_no_joint_may_run_faster_than_the_ceiling_of_all_models():
    fast = load_model("zu3")
    assert fast.joint_max_speed[5] > 3.8
    with pytest.raises(InvalidTrajectory, match=r"joint 6 would run at 3\.2\d+ rad/s .*valid: at most 3\.1416 rad/s"):
        build_path(resting(), JointTrajectory((at(1.5, (0.0, 0.0, 0.0, 0.0, 0.0, 3.5), REST),)), 0.0, fast, OPTIONS)


def test_points_where_streams_end_are_taken_as_they_are():
    low, high = np.array(stream_limits(MODEL)).T
    for edge in (low, high):
        near = np.clip(edge, *(np.array(HOME) + [[-1.0], [1.0]])) - np.array(HOME)
        assert build([at(3.0, tuple(near), REST)]).led == ""
    ways = (0.0, high[1] - HOME[1])
    path = build([at(3.0, ways, REST)])
    assert path.at(path.end).position == pytest.approx(joints(*ways)) and path.led == ""


@pytest.mark.parametrize("has_acceleration", [False, True])
def test_a_violation_in_one_of_very_many_pieces_is_found(has_acceleration):
    points = wave(0.008, has_acceleration, duration=120.0, size=0.5)
    build(points)
    number = 11_111
    point = points[number]
    points[number] = TrajectoryPoint(point.time, (point.position[0] + 0.05, *point.position[1:]), point.velocity,
                                     point.acceleration)
    with pytest.raises(InvalidTrajectory, match=r"joint 1 would .* after 88\.8\d+ s"):
        build(points)


@pytest.mark.parametrize("place, stretch", [(0, (0.0, 1.0)), (1, (0.0, 2.0)), (2, (1.0, 2.0))])
def test_an_overshoot_is_slowed_from_the_sample_before_it_to_the_one_after_it(place, stretch):
    found, shares = Overshoots(), np.full((3, 6), 0.5)
    shares[place, 2] = 1.1
    _judge(np.arange(3.0), shares, 1.02, lambda where, joint: "joint %d %%s" % joint, found)
    (since, until, rate), = found._stretches
    assert (since, until) == stretch and rate == pytest.approx(1.0 / 1.1, rel=0.02)
