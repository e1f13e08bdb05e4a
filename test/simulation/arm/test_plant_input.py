"""Any numbers as input: taken or rejected, never another error, and the arm can still be moved home."""
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plant_watch import PlantWatch

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import HOME, JogMode, ServoFilter

ANY = st.one_of(st.floats(), st.sampled_from([0.0, -0.0, 1e-300, 1e-12, 0.1, -0.1, 1.0, 1e3, 1e12, 1e300, math.pi]))
SIX = st.tuples(*[ANY] * 6)
MANY = settings(max_examples=60)


def pose(values):
    return Pose(tuple(values[:3]), tuple(values[3:]))


def attempt(watch, action, *arguments, **options):
    try:
        action(*arguments, **options)
    except TargetRejected as rejected:
        assert rejected.reason
        assert watch.plant.queue.length == 0
    watch.step(30)
    watch.plant.stop()
    watch.plant.leave_servo()
    watch.run(3.0)
    watch.plant.add_joint_move(HOME, 3.0, 12.0)
    watch.run()
    assert watch.plant.joint_position == pytest.approx(HOME, abs=1e-6)


@MANY
@given(target=SIX, speed=ANY, acceleration=st.none() | ANY, relative=st.booleans())
def test_joint_moves(target, speed, acceleration, relative):
    watch = PlantWatch()
    attempt(watch, watch.plant.add_joint_move, target, speed, acceleration, relative)


@MANY
@given(target=SIX, speed=ANY, acceleration=st.none() | ANY, relative=st.booleans(), tolerance=ANY,
       rotation_speed=st.none() | ANY, rotation_acceleration=st.none() | ANY)
def test_linear_moves(target, speed, acceleration, relative, tolerance, rotation_speed, rotation_acceleration):
    watch = PlantWatch()
    attempt(watch, watch.plant.add_linear_move, pose(target), speed, acceleration, relative, tolerance, rotation_speed,
            rotation_acceleration)


@MANY
@given(speed=ANY, acceleration=ANY, rotation_speed=ANY, rotation_acceleration=ANY, tolerance=ANY)
def test_any_pace_of_a_good_line(speed, acceleration, rotation_speed, rotation_acceleration, tolerance):
    watch = PlantWatch()
    attempt(watch, watch.plant.add_linear_move, Pose((0.05, 0.05, 0.0), (0.0, 0.0, 0.3)), speed, acceleration, True,
            tolerance, rotation_speed, rotation_acceleration)


@MANY
@given(via=SIX, target=SIX, speed=ANY, relative=st.booleans(), turns=st.integers(-1, 3) | st.just(10**9),
       mode=st.integers(-1, 4))
def test_arc_moves(via, target, speed, relative, turns, mode):
    watch = PlantWatch()
    attempt(watch, watch.plant.add_arc_move, pose(via), pose(target), speed, None, relative, turns, mode)


@MANY
@given(mode=st.sampled_from(JogMode), frame=st.sampled_from(JogFrame), axis=st.integers(-1, 6), velocity=ANY,
       position=st.none() | ANY)
def test_jogs(mode, frame, axis, velocity, position):
    watch = PlantWatch()
    attempt(watch, watch.plant.jog, mode, frame, axis, velocity, position)


@MANY
@given(target=SIX, relative=st.booleans(), cycles=st.integers(-1, 10 ** 6), cartesian=st.booleans())
def test_servo_points(target, relative, cycles, cartesian):
    watch = PlantWatch(checks_acceleration=False)
    watch.plant.enter_servo()
    if cartesian:
        attempt(watch, watch.plant.servo_pose, pose(target), relative, cycles)
    else:
        attempt(watch, watch.plant.servo_joint, target, relative, cycles)


@MANY
@given(kind=st.sampled_from(ServoFilter), values=SIX)
@example(kind=ServoFilter.JOINT_MEAN, values=(1.0, 1.0, 0.0, 2.0, 0.0, 0.0))
def test_filter_parameters(kind, values):
    names = {ServoFilter.NONE: (), ServoFilter.JOINT_LOW_PASS: ("lpf_cf",),
             ServoFilter.JOINT_LIMITS: ("nlf_max_vr", "nlf_max_ar", "nlf_max_jr"),
             ServoFilter.JOINT_MEAN: ("mmf_max_buf", "mmf_kp", "mmf_kv", "mmf_ka"),
             ServoFilter.CARTESIAN_LIMITS: ("nlf_max_vp", "nlf_max_ap", "nlf_max_jp", "nlf_max_vr", "nlf_max_ar",
                                            "nlf_max_jr"),
             ServoFilter.FORESIGHT: ("mmf_max_buf", "mmf_kp")}[kind]
    watch = PlantWatch(checks_acceleration=False)
    try:
        watch.plant.set_servo_filter(kind, **dict(zip(names, values)))
    except TargetRejected:
        return
    watch.plant.enter_servo()
    for _ in range(10):
        if not watch.plant.is_servo_active:  # the filter made the joints too fast, which ends the mode
            break
        watch.plant.servo_joint((0.01, 0.0, 0.0, 0.0, 0.0, 0.0), relative=True)
        watch.step()
        assert all(map(math.isfinite, watch.plant.joint_position))
