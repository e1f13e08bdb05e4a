import math

import pytest
from plant_watch import ZU7, PlantWatch, shift

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, HOME, JogMode, Plant, ServoFilter, Starvation


@pytest.fixture()
def watch():
    """Return a plant without check of acceleration: without a filter a stream may be as jerky as its sender made it."""
    result = PlantWatch(checks_acceleration=False)
    assert result.plant.enter_servo()
    return result


def j1(angle):
    return (angle, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_servo_mode_is_entered_only_at_standstill_with_an_empty_queue():
    plant = Plant(ZU7)
    plant.add_joint_move(j1(0.3), 1.0, relative=True)
    assert not plant.enter_servo()
    assert not plant.is_servo_active
    while not plant.is_in_position:
        plant.step()
    plant.jog(JogMode.CONTINUOUS, JogFrame.JOINT, 0, 0.1)
    assert not plant.enter_servo()
    plant.stop()
    while not plant.is_in_position:
        plant.step()
    plant.start_hand_guiding()
    assert not plant.enter_servo()
    plant.stop_hand_guiding()
    assert plant.enter_servo()
    assert plant.enter_servo()
    assert plant.is_servo_active


def test_points_outside_servo_mode_are_rejected():
    plant = Plant(ZU7)
    for add in (lambda: plant.servo_joint(HOME), lambda: plant.servo_pose(plant.tcp_pose())):
        with pytest.raises(TargetRejected) as caught:
            add()
        assert caught.value.event_code == events.NOT_ALLOWED_IN_MODE.code


def test_one_point_a_cycle_is_followed_exactly(watch):
    for n in range(1, 51):
        assert watch.plant.servo_joint((0.01 * n, *HOME[1:]))
        watch.step()
        assert watch.plant.joint_position[0] == pytest.approx(0.01 * n)
    assert not watch.plant.is_in_position
    watch.step(2)
    assert not watch.plant.is_in_position  # a point that is missing for a moment ends no motion
    watch.step(4)
    assert watch.plant.is_in_position
    for _ in range(3):
        assert watch.plant.servo_joint(watch.plant.joint_position)
    assert watch.plant.is_in_position  # points that hold the arm begin none


def test_a_point_of_several_cycles_is_interpolated(watch):
    assert watch.plant.servo_joint(j1(0.04), relative=True, cycles=4)
    assert watch.plant.servo_joint(j1(0.04), relative=True, cycles=2)
    seen = []
    for _ in range(6):
        watch.step()
        seen.append(watch.plant.joint_position[0])
    assert seen == pytest.approx([0.01, 0.02, 0.03, 0.04, 0.06, 0.08])


def test_a_pose_of_several_cycles_runs_straight(watch):
    assert watch.plant.servo_pose(shift(y=0.02, rpy=(0.0, 0.0, 0.1)), relative=True, cycles=5)
    watch.run()
    tools = watch.tools()
    assert [tool[10] - tools[0][10] for tool in tools[:6]] == pytest.approx([0.004 * n for n in range(6)], abs=1e-9)
    assert max(abs(tool[9] - tools[0][9]) for tool in tools) < 1e-9


def test_absolute_poses_are_in_the_user_frame_of_the_active_tool():
    watch = PlantWatch(checks_acceleration=False)
    watch.plant.set_tool(Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0)))
    watch.plant.set_user_frame(Pose((0.0, 0.1, 0.0), (0.0, 0.0, 0.5)))
    watch.plant.enter_servo()
    pose = watch.plant.tcp_pose()
    target = Pose((pose.position[0] + 0.002, *pose.position[1:]), pose.rpy)
    assert watch.plant.servo_pose(target)
    watch.step()
    assert watch.plant.tcp_pose().position == pytest.approx(target.position, abs=1e-9)


@pytest.mark.parametrize(("step", "cycles", "taken"), [
    (math.pi * CYCLE_TIME_S, 1, True), (1.01 * math.pi * CYCLE_TIME_S, 1, False),
    (2.0 * math.pi * CYCLE_TIME_S, 2, True), (2.1 * math.pi * CYCLE_TIME_S, 2, False)])
def test_steps_over_180_degrees_a_second_are_ignored(step, cycles, taken, watch):
    assert watch.plant.servo_joint(j1(step), relative=True, cycles=cycles) is taken
    watch.step(3)
    assert watch.plant.joint_position[0] == pytest.approx(step if taken else 0.0)
    assert watch.plant.is_servo_active


def test_a_far_pose_is_ignored_too(watch):
    assert not watch.plant.servo_pose(shift(y=0.05), relative=True)


@pytest.mark.parametrize(("add", "code"), [
    (lambda plant: plant.servo_joint((0.0,) * 5), events.TARGET_OUTSIDE_LIMITS.code),
    (lambda plant: plant.servo_joint((float("nan"), 0, 0, 0, 0, 0)), events.TARGET_OUTSIDE_LIMITS.code),
    (lambda plant: plant.servo_joint(HOME, cycles=0), events.TARGET_OUTSIDE_LIMITS.code),
    (lambda plant: plant.servo_joint((0.0, -2.0, 0, 0, 0, 0)), 0x010032),
    (lambda plant: plant.servo_pose(Pose((2.0, 0, 0), (0, 0, 0))), events.INVERSE_KINEMATICS_FAILED.code),
    (lambda plant: plant.servo_pose(Pose((2.0, 0, float("inf")), (0, 0, 0))), events.TARGET_OUTSIDE_LIMITS.code),
])
def test_bad_points_are_rejected_and_the_stream_goes_on(add, code, watch):
    with pytest.raises(TargetRejected) as caught:
        add(watch.plant)
    assert caught.value.event_code == code
    assert watch.plant.servo_joint(j1(0.01), relative=True)
    watch.step()
    assert watch.plant.joint_position[0] == pytest.approx(0.01)


def test_waiting_points_are_bounded(watch):
    taken = [watch.plant.servo_joint(j1(0.001), relative=True) for _ in range(60)]
    assert taken == [True] * 50 + [False] * 10
    watch.run()
    assert watch.plant.joint_position[0] == pytest.approx(0.05)


def test_a_starved_stream_holds_the_last_target(watch):
    for _ in range(10):
        watch.plant.servo_joint(j1(0.01), relative=True)
        watch.step()
    watch.step(50)
    assert watch.plant.joint_position[0] == pytest.approx(0.1)
    assert watch.plant.is_servo_active
    assert watch.codes == []


def test_a_starved_stream_can_repeat_the_last_increment_until_the_limit():
    watch = PlantWatch(checks_acceleration=False, starvation=Starvation.REPEAT)
    watch.plant.enter_servo()
    watch.step(5)
    assert watch.plant.joint_position == HOME
    for _ in range(10):
        watch.plant.servo_joint((0.0, 0.01, 0.0, 0.0, 0.0, 0.0), relative=True)
        watch.step()
    watch.step(90)
    assert watch.plant.joint_position[1] == pytest.approx(HOME[1] + 1.0)
    assert watch.plant.servo_joint((0.0, -0.02, 0.0, 0.0, 0.0, 0.0), relative=True)
    watch.step()
    assert watch.plant.joint_position[1] == pytest.approx(HOME[1] + 0.98)
    assert watch.plant.servo_joint((0.0, 0.02, 0.0, 0.0, 0.0, 0.0), relative=True)
    watch.step(300)
    assert watch.plant.joint_position[1] == ZU7.joint_limits[1][1]
    assert watch.codes == [0x010033, 0x010031]
    assert watch.plant.on_soft_limit


def test_leaving_servo_mode_comes_to_rest_smoothly():
    watch = PlantWatch()
    watch.plant.set_servo_filter(ServoFilter.JOINT_LIMITS, nlf_max_vr=2.0, nlf_max_ar=8.0, nlf_max_jr=200.0)
    watch.plant.enter_servo()
    for _ in range(60):
        watch.plant.servo_joint(j1(0.01), relative=True)
        watch.step()
    assert watch.plant.joint_velocity[0] > 1.0
    watch.plant.leave_servo()
    assert not watch.plant.is_servo_active
    assert not watch.plant.is_in_position
    assert not watch.plant.enter_servo()
    assert watch.plant.add_joint_move(HOME, 1.0)
    watch.run()
    assert watch.plant.joint_position == HOME


def test_stop_in_servo_mode_drops_the_points_and_stays_in_the_mode(watch):
    for _ in range(40):
        watch.plant.servo_joint(j1(0.02), relative=True)
    watch.step(5)
    watch.plant.stop()
    watch.run(1.0)
    assert watch.plant.is_servo_active
    assert 0.1 < watch.plant.joint_position[0] < 0.4
    resting = watch.plant.joint_position[0]
    assert watch.plant.servo_joint(j1(0.01), relative=True)
    watch.step()
    assert watch.plant.joint_position[0] == pytest.approx(resting + 0.01)


def test_a_stream_faster_than_the_arm_trips_the_overspeed():
    watch = PlantWatch(model=load_model("zu20"), checks_acceleration=False)
    watch.plant.enter_servo()
    assert watch.plant.servo_joint(j1(math.pi * CYCLE_TIME_S * 0.9), relative=True)
    watch.step(2)
    assert watch.codes == [0x000030]
    assert not watch.plant.is_servo_active
    assert watch.plant.joint_position == HOME


def test_the_filter_can_not_be_changed_in_servo_mode(watch):
    with pytest.raises(TargetRejected) as caught:
        watch.plant.set_servo_filter(ServoFilter.NONE)
    assert caught.value.event_code == events.NOT_ALLOWED_IN_MODE.code
