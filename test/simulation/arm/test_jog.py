import math

import pytest
from plant_watch import ZU7, PlantWatch

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import HOME, JogMode, Plant

CONTINUOUS, STEP, ABSOLUTE = JogMode.CONTINUOUS, JogMode.STEP, JogMode.ABSOLUTE
JOINT, BASE, TOOL = JogFrame.JOINT, JogFrame.BASE, JogFrame.TOOL


@pytest.fixture(params=[True, False], ids=["jerk_limited", "trapezoid"])
def watch(request):
    return PlantWatch(jerk_limited=request.param)


def test_a_continuous_joint_jog_runs_until_it_is_stopped(watch):
    assert watch.plant.jog(CONTINUOUS, JOINT, 2, -0.3)
    assert watch.plant.queue.is_jogging
    assert not watch.plant.is_in_position
    watch.step(100)
    assert watch.plant.joint_velocity == pytest.approx((0, 0, -0.3, 0, 0, 0))
    watch.plant.queue.end_jog(JOINT, 2)
    watch.run(1.0)
    assert not watch.plant.queue.is_jogging
    assert watch.plant.joint_position[2] < HOME[2] - 0.1


def test_stopping_another_axis_or_frame_changes_nothing(watch):
    watch.plant.jog(CONTINUOUS, JOINT, 2, -0.3)
    watch.step(100)
    watch.plant.queue.end_jog(JOINT, 1)
    watch.plant.queue.end_jog(BASE, 2)
    watch.step(50)
    assert watch.plant.joint_velocity[2] == pytest.approx(-0.3)
    watch.plant.stop()
    watch.run(1.0)


def test_repeating_a_continuous_jog_goes_on_without_a_dip_and_sets_its_speed(watch):
    watch.plant.jog(CONTINUOUS, JOINT, 0, 0.2)
    watch.step(60)
    for _ in range(5):
        assert watch.plant.jog(CONTINUOUS, JOINT, 0, 0.2)
        watch.step(10)
        assert watch.plant.joint_velocity[0] == pytest.approx(0.2)
    assert watch.plant.jog(CONTINUOUS, JOINT, 0, 0.5)
    watch.step(60)
    assert watch.plant.joint_velocity[0] == pytest.approx(0.5)


def test_repeating_a_cartesian_jog_sets_its_speed(watch):
    watch.plant.jog(CONTINUOUS, BASE, 2, 0.05)
    watch.step(60)
    assert watch.plant.tcp_speed == pytest.approx(0.05, rel=1e-3)
    assert watch.plant.jog(CONTINUOUS, BASE, 2, 0.02)
    watch.step(60)
    assert watch.plant.tcp_speed == pytest.approx(0.02, rel=1e-3)


def test_another_jog_is_dropped_while_one_runs(watch):
    watch.plant.jog(CONTINUOUS, JOINT, 0, 0.2)
    watch.step(60)
    assert not watch.plant.jog(CONTINUOUS, JOINT, 0, -0.2)
    assert not watch.plant.jog(CONTINUOUS, JOINT, 1, 0.2)
    assert not watch.plant.jog(CONTINUOUS, BASE, 0, 0.2)
    assert not watch.plant.jog(STEP, JOINT, 0, 0.2, 0.1)
    watch.step(10)
    assert watch.plant.joint_velocity == pytest.approx((0.2, 0, 0, 0, 0, 0))


def test_a_jog_is_dropped_while_a_move_runs_even_a_bad_one_past_a_limit(watch):
    watch.plant.add_joint_move((0.5, 0, 0, 0, 0, 0), 0.5, relative=True)
    watch.step(5)
    assert not watch.plant.jog(CONTINUOUS, JOINT, 1, 0.2)
    assert not watch.plant.jog(ABSOLUTE, JOINT, 1, 0.2, 9.0)
    watch.run()
    assert watch.plant.joint_position[1] == HOME[1]


def test_a_jog_sent_while_a_stop_slows_down_starts_when_the_arm_stands(watch):
    watch.plant.jog(CONTINUOUS, JOINT, 0, 0.5)
    watch.step(60)
    watch.plant.stop()
    assert watch.plant.jog(CONTINUOUS, JOINT, 0, -0.5)
    watch.step(120)
    assert watch.plant.joint_velocity[0] == pytest.approx(-0.5)


def test_a_jog_after_a_tool_change_in_mid_jog_is_dropped():
    watch = PlantWatch()
    watch.plant.jog(CONTINUOUS, TOOL, 1, 0.02)
    watch.step(30)
    watch.plant.set_tool(Pose((0.0, 0.1, 0.1), (0.5, 0.0, 0.0)))
    assert not watch.plant.jog(CONTINUOUS, TOOL, 0, 0.02)
    watch.step(30)


@pytest.mark.parametrize(
    ("frame", "axis", "step"), [(JOINT, 3, -0.2), (BASE, 1, 0.05), (TOOL, 2, -0.04), (BASE, 5, 0.3)])
def test_a_step_goes_by_its_position_exactly(frame, axis, step, watch):
    before, pose = watch.plant.joint_position, watch.plant.tcp_pose()
    assert watch.plant.jog(STEP, frame, axis, 0.3, step)
    watch.run()
    after = watch.plant.tcp_pose()
    if frame is JOINT:
        assert watch.plant.joint_position == pytest.approx([q + step * (n == axis) for n, q in enumerate(before)])
    elif frame is TOOL:  # at home the tool looks straight down
        assert after.position == pytest.approx((pose.position[0], pose.position[1], pose.position[2] - step), abs=1e-9)
    elif axis < 3:
        assert after.position == pytest.approx([p + step * (n == axis) for n, p in enumerate(pose.position)], abs=1e-9)
    else:
        assert after.position == pytest.approx(pose.position, abs=1e-9)
        assert after.rpy[2] == pytest.approx(pose.rpy[2] + step, abs=1e-9)


def test_absolute_jogs_go_to_the_value(watch):
    assert watch.plant.jog(ABSOLUTE, JOINT, 4, -0.3, 1.0)
    watch.run()
    assert watch.plant.joint_position[4] == pytest.approx(1.0)
    watch.plant.set_user_frame(Pose((0.1, 0.2, 0.0), (0.0, 0.0, 0.7)))
    pose = watch.plant.tcp_pose()
    assert watch.plant.jog(ABSOLUTE, BASE, 1, 0.1, pose.position[1] + 0.03)
    watch.run()
    moved = watch.plant.tcp_pose().position
    assert moved == pytest.approx((pose.position[0], pose.position[1] + 0.03, pose.position[2]), abs=1e-9)
    assert watch.plant.jog(ABSOLUTE, BASE, 5, 0.3, 0.2)
    watch.run()
    assert watch.plant.tcp_pose().rpy[2] == pytest.approx(0.2, abs=1e-9)
    assert watch.plant.tcp_pose().position == pytest.approx(moved, abs=1e-9)


def test_a_jog_to_where_it_stands_is_taken_and_does_nothing(watch):
    assert watch.plant.jog(ABSOLUTE, JOINT, 4, 0.3, HOME[4])
    assert watch.plant.jog(STEP, BASE, 4, 0.3, 0.0)
    assert watch.plant.is_in_position


def test_base_jog_runs_along_the_axis_of_the_user_frame():
    watch = PlantWatch()
    watch.plant.set_user_frame(Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)))
    start = watch.tools()[0]
    watch.plant.jog(STEP, BASE, 0, 0.1, 0.05)
    watch.run()
    end = watch.tools()[-1]
    assert (end[9] - start[9], end[10] - start[10], end[11] - start[11]) == pytest.approx((0.0, 0.05, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    ("axis", "velocity", "near", "beyond"), [(1, 0.8, 0x010033, 0x010035), (1, -0.8, 0x010034, 0x010036)])
def test_a_joint_jog_stops_on_the_soft_limit_and_says_so(axis, velocity, near, beyond, watch):
    watch.plant.jog(CONTINUOUS, JOINT, axis, velocity)
    watch.run()
    assert watch.codes == [near, beyond]
    assert watch.plant.joint_position[axis] == ZU7.joint_limits[axis][velocity > 0]
    assert watch.plant.on_soft_limit
    assert watch.plant.near_limit == tuple(n == axis for n in range(6))
    with pytest.raises(TargetRejected) as caught:
        watch.plant.jog(CONTINUOUS, JOINT, axis, velocity)
    assert caught.value.event_code == beyond
    assert watch.plant.jog(CONTINUOUS, JOINT, axis, -velocity)
    watch.step(60)
    assert not watch.plant.on_soft_limit


def test_a_cartesian_jog_ends_before_the_singularity_of_the_stretched_arm(watch):
    watch.plant.jog(CONTINUOUS, BASE, 0, 0.1)
    watch.run()
    assert watch.codes == [events.SINGULARITY.code]
    with pytest.raises(TargetRejected):
        watch.plant.jog(STEP, BASE, 0, 0.1, 0.2)
    assert watch.plant.jog(STEP, BASE, 0, 0.1, -0.1)
    watch.run()


def test_a_cartesian_jog_into_a_joint_limit_names_the_joint():
    watch = PlantWatch((0.0, math.pi / 2, -math.pi / 2, math.pi / 2, math.pi / 2, 6.2))
    watch.plant.jog(CONTINUOUS, TOOL, 5, 0.3)
    watch.run()
    assert watch.codes == [0x050033, 0x050035]
    assert watch.plant.on_soft_limit


def test_rapid_rate_scales_a_jog(watch):
    watch.plant.set_rapid_rate(0.5)
    watch.plant.jog(CONTINUOUS, JOINT, 0, 0.4)
    watch.step(60)
    assert watch.plant.joint_velocity[0] == pytest.approx(0.2)


@pytest.mark.parametrize(("arguments", "code"), [
    ((STEP, JOINT, 1, 0.3, 4.0), 0x010035),
    ((ABSOLUTE, JOINT, 2, 0.3, -3.2), 0x020036),
    ((STEP, BASE, 0, 0.3, 1.0), events.SINGULARITY.code),
    ((STEP, BASE, 0, 0.3, 9.0), events.TARGET_UNREACHABLE.code),
    ((STEP, TOOL, 4, 0.3, 90.0), events.TARGET_UNREACHABLE.code),
    ((CONTINUOUS, JOINT, 6, 0.3), events.TARGET_OUTSIDE_LIMITS.code),
    ((CONTINUOUS, JOINT, -1, 0.3), events.TARGET_OUTSIDE_LIMITS.code),
    ((CONTINUOUS, JOINT, 0, 0.0), events.BAD_SPEED.code),
    ((CONTINUOUS, BASE, 0, float("nan")), events.BAD_SPEED.code),
    ((STEP, BASE, 0, 0.1, float("inf")), events.TARGET_OUTSIDE_LIMITS.code),
    ((ABSOLUTE, JOINT, 0, 0.1), events.TARGET_OUTSIDE_LIMITS.code),
])
def test_bad_jogs_are_rejected(arguments, code):
    plant = Plant(ZU7)
    with pytest.raises(TargetRejected) as caught:
        plant.jog(*arguments)
    assert caught.value.event_code == code
    assert plant.is_in_position


def test_a_jog_is_rejected_in_servo_mode_and_while_guided_by_hand():
    plant = Plant(ZU7)
    plant.enter_servo()
    with pytest.raises(TargetRejected) as caught:
        plant.jog(CONTINUOUS, JOINT, 0, 0.1)
    assert caught.value.event_code == events.NOT_ALLOWED_IN_MODE.code
    plant.leave_servo()
    plant.start_hand_guiding()
    with pytest.raises(TargetRejected):
        plant.jog(CONTINUOUS, JOINT, 0, 0.1)
