import math

import pytest
from plant_watch import ZU7, PlantWatch, shift

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, HOME, JogMode, Plant

AWAY = (0.5, 1.2, -1.2, 1.3, 1.4, 0.5)
NAN = float("nan")


@pytest.fixture(params=[True, False], ids=["jerk_limited", "trapezoid"])
def watch(request):
    return PlantWatch(jerk_limited=request.param)


def test_stands_at_home_in_position(watch):
    assert watch.plant.joint_position == HOME
    assert watch.plant.is_in_position
    assert not watch.plant.is_moving
    assert watch.plant.tcp_speed == 0.0
    assert watch.plant.tcp_pose() == watch.plant.forward(HOME)


def test_joint_move_arrives_exactly_and_together(watch):
    assert watch.plant.add_joint_move(AWAY, 1.0, 2.0)
    watch.run()
    assert watch.plant.joint_position == AWAY
    start, end = watch.joints[0], AWAY
    for joints in watch.joints:
        shares = [(q - a) / (b - a) for q, a, b in zip(joints, start, end) if a != b]
        assert max(shares) - min(shares) < 1e-9


def test_joint_move_takes_the_time_its_speed_and_acceleration_allow():
    watch = PlantWatch(jerk_limited=False)
    watch.plant.add_joint_move((1.0, 0, 0, 0, 0, 0), 0.5, 1.0, relative=True)
    watch.run()
    cycles = sum(1 for a, b in zip(watch.joints, watch.joints[1:]) if a != b)
    assert cycles * CYCLE_TIME_S == pytest.approx(1.0 / 0.5 + 0.5 / 1.0, abs=3 * CYCLE_TIME_S)


def test_speed_and_acceleration_beyond_the_model_are_cut_to_it(watch):
    watch.plant.add_joint_move((2.0, 0, 0, 0, 0, 0), 100.0, 1000.0, relative=True)
    watch.run()
    assert watch.fastest == pytest.approx(1.0, abs=1e-6)
    assert watch.hardest == pytest.approx(1.0, abs=0.02)


def test_joint_moves_stay_below_the_tool_speed_limit():
    watch = PlantWatch((0.0, 0.2, 0.0, 0.0, math.pi / 2, 0.0))
    watch.plant.set_tool(Pose((-0.3, -0.3, 0.0), (0.0, 0.0, 0.0)))
    watch.plant.add_joint_move((2.5, 0.5, 0, 0, 0, 0), 3.0, 12.0, relative=True)
    fastest = 0.0
    while not watch.plant.is_in_position:
        watch.step()
        fastest = max(fastest, watch.plant.tcp_speed)
    assert 0.9 * ZU7.tcp_max_speed < fastest <= ZU7.tcp_max_speed


def test_moves_queue_and_relative_ones_start_at_the_end_of_the_queue(watch):
    watch.plant.add_joint_move(AWAY, 1.0, line_id=2)
    watch.plant.add_joint_move((0.1, 0, 0, 0, 0, 0), 1.0, relative=True, line_id=3)
    watch.plant.add_linear_move(shift(z=0.05), 0.1, relative=True, line_id=4)
    assert watch.plant.queue.length == 3
    seen = []
    while not watch.plant.is_in_position:
        watch.step()
        if watch.plant.queue.motion_line not in seen:
            seen.append(watch.plant.queue.motion_line)
    assert seen == [2, 3, 4]
    assert watch.plant.queue.length == 0
    first = watch.plant.forward((AWAY[0] + 0.1, *AWAY[1:]))
    assert watch.plant.tcp_pose().position == pytest.approx(
        (first.position[0], first.position[1], first.position[2] + 0.05), abs=1e-9)


def test_in_position_is_false_from_acceptance_and_for_the_settle_time():
    plant = Plant(ZU7)
    plant.add_joint_move((2e-6, 0, 0, 0, 0, 0), 1.0, relative=True)
    assert not plant.is_in_position
    false_cycles = 0
    while not plant.is_in_position:
        plant.step()
        false_cycles += 1
    assert false_cycles >= 5


def test_end_move_reaches_the_pose_on_a_joint_path(watch):
    target = watch.plant.forward(AWAY)
    assert watch.plant.add_end_move(target, 1.0)
    watch.run()
    assert watch.plant.joint_position == pytest.approx(AWAY, abs=1e-9)


@pytest.mark.parametrize("add", [
    lambda plant: plant.add_joint_move(HOME, 1.0, line_id=9),
    lambda plant: plant.add_joint_move((0.0,) * 6, 1.0, relative=True, line_id=9),
    lambda plant: plant.add_end_move(plant.tcp_pose(), 1.0, line_id=9),
    lambda plant: plant.add_linear_move(plant.tcp_pose(), 0.1, line_id=9),
    lambda plant: plant.add_linear_move(shift(), 0.1, relative=True, line_id=9),
    lambda plant: plant.add_arc_move(shift(), shift(), 0.1, relative=True, line_id=9),
])
def test_a_move_to_where_the_queue_ends_is_not_queued_and_says_so(add):
    plant = Plant(ZU7)
    assert not add(plant)
    assert plant.add_error_line == 9
    assert plant.queue.motion_line == 0
    assert plant.is_in_position
    plant.add_joint_move(AWAY, 1.0, line_id=10)
    assert plant.add_error_line == 0
    assert not plant.add_joint_move(AWAY, 1.0, line_id=11)
    assert plant.add_error_line == 11


def far_away():
    return Pose((2.0, 0.0, 0.0), (math.pi, 0.0, 0.0))


@pytest.mark.parametrize(("add", "event"), [
    (lambda plant: plant.add_joint_move((0.0,) * 5, 1.0), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_joint_move((NAN, 0, 0, 0, 0, 0), 1.0), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_joint_move((7.0, 0, 0, 0, 0, 0), 1.0), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_joint_move((0.0, -4.0, 0, 0, 0, 0), 1.0, relative=True), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_joint_move(AWAY, 0.0), events.BAD_SPEED),
    (lambda plant: plant.add_joint_move(AWAY, -1.0), events.BAD_SPEED),
    (lambda plant: plant.add_joint_move(AWAY, NAN), events.BAD_SPEED),
    (lambda plant: plant.add_joint_move(AWAY, math.inf), events.BAD_SPEED),
    (lambda plant: plant.add_joint_move(AWAY, 1.0, 0.0), events.BAD_SPEED),
    (lambda plant: plant.add_end_move(far_away(), 1.0), events.TARGET_UNREACHABLE),
    (lambda plant: plant.add_linear_move(far_away(), 0.1), events.TARGET_UNREACHABLE),
    (lambda plant: plant.add_linear_move(Pose((NAN, 0, 0), (0, 0, 0)), 0.1), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_linear_move(shift(x=NAN), 0.1, relative=True), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_linear_move(shift(z=0.1), 0.0, relative=True), events.BAD_SPEED),
    (lambda plant: plant.add_linear_move(shift(z=0.1), 0.1, rotation_speed=-1.0, relative=True), events.BAD_SPEED),
    (lambda plant: plant.add_linear_move(shift(z=0.1), 0.1, tolerance=NAN, relative=True),
     events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_arc_move(shift(x=0.1), shift(x=0.2), 0.1, relative=True), events.TARGET_UNREACHABLE),
    (lambda plant: plant.add_arc_move(shift(x=0.1), shift(y=0.1), 0.1, relative=True, turns=-1),
     events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.add_arc_move(shift(x=0.1), shift(y=0.1), 0.1, relative=True, circle_mode=7),
     events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.forward((0.0,) * 7), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.inverse_nearest(far_away(), HOME), events.TARGET_UNREACHABLE),
    (lambda plant: plant.set_tool(Pose((NAN, 0, 0), (0, 0, 0))), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.set_user_frame(Pose((0, 0, 0), (0, math.inf, 0))), events.TARGET_OUTSIDE_LIMITS),
    (lambda plant: plant.set_rapid_rate(1.1), events.BAD_SPEED),
    (lambda plant: plant.set_rapid_rate(NAN), events.BAD_SPEED),
])
def test_bad_numbers_are_rejected_with_their_event_and_nothing_latches(add, event):
    plant = Plant(ZU7)
    with pytest.raises(TargetRejected) as caught:
        add(plant)
    assert caught.value.event_code == event.code
    assert caught.value.reason
    assert plant.is_in_position
    assert plant.queue.length == 0
    assert plant.take_events() == []
    assert plant.add_joint_move(AWAY, 1.0)


def test_moves_are_rejected_in_servo_mode_hand_guiding_and_jog():
    plant = Plant(ZU7)
    plant.enter_servo()
    with pytest.raises(TargetRejected) as caught:
        plant.add_joint_move(AWAY, 1.0)
    assert caught.value.event_code == events.NOT_ALLOWED_IN_MODE.code
    plant.leave_servo()
    plant.start_hand_guiding()
    with pytest.raises(TargetRejected):
        plant.add_linear_move(shift(z=0.1), 0.1, relative=True)
    plant.stop_hand_guiding()
    plant.jog(JogMode.CONTINUOUS, JogFrame.JOINT, 0, 0.1)
    with pytest.raises(TargetRejected) as caught:
        plant.add_joint_move(AWAY, 1.0)
    assert caught.value.event_code == events.JOINT_MOVE_NOT_ADDED.code


def test_the_queue_is_bounded():
    plant = Plant(ZU7)
    with pytest.raises(TargetRejected) as caught:
        for n in range(1000):
            plant.add_joint_move((0.1 if n % 2 else -0.1, 0, 0, 0, 0, 0), 1.0, relative=True)
    assert caught.value.event_code == events.JOINT_MOVE_NOT_ADDED.code
    assert plant.queue.length == 500


def test_tool_and_user_frame_apply_to_poses_and_targets():
    watch = PlantWatch()
    plant = watch.plant
    flange = plant.tcp_pose()
    plant.set_tool(Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0)))
    plant.set_user_frame(Pose((0.1, 0.0, 0.0), (0.0, 0.0, math.pi / 2)))
    assert plant.tcp_pose().position == pytest.approx(
        (flange.position[1], -(flange.position[0] - 0.1), flange.position[2] - 0.1))
    before = plant.tcp_pose().position
    plant.add_linear_move(shift(x=0.05), 0.1, relative=True)
    watch.run()
    assert plant.tcp_pose().position == pytest.approx((before[0] + 0.05, before[1], before[2]), abs=1e-9)
    joints = plant.joint_position
    assert plant.inverse_nearest(plant.tcp_pose(), joints) == pytest.approx(joints, abs=1e-9)


def test_relative_rotation_turns_about_the_axes_of_the_user_frame():
    watch = PlantWatch()
    before = watch.plant.tcp_pose()
    watch.plant.add_linear_move(shift(rpy=(0.0, 0.0, 0.2)), 0.1, relative=True)
    watch.run()
    after = watch.plant.tcp_pose()
    assert after.position == pytest.approx(before.position, abs=1e-9)
    assert after.rpy[2] == pytest.approx(before.rpy[2] + 0.2, abs=1e-9)


def test_stop_slows_down_on_the_path_and_forgets_the_queue(watch):
    watch.plant.add_joint_move(AWAY, 1.0, 2.0, line_id=5)
    watch.plant.add_joint_move(HOME, 1.0, 2.0, line_id=6)
    watch.step(40)
    watch.plant.stop()
    assert watch.plant.queue.length == 0
    assert not watch.plant.is_in_position
    watch.run(1.0)
    assert watch.plant.queue.motion_line == 5
    share = (watch.plant.joint_position[0] - HOME[0]) / (AWAY[0] - HOME[0])
    assert 0.0 < share < 1.0
    assert watch.plant.joint_position == pytest.approx([a + share * (b - a) for a, b in zip(HOME, AWAY)], abs=1e-9)


def test_a_move_sent_right_after_stop_runs_from_where_the_arm_comes_to_rest(watch):
    watch.plant.add_joint_move(AWAY, 1.0, 2.0)
    watch.step(40)
    watch.plant.stop()
    watch.plant.add_joint_move((0.1, 0, 0, 0, 0, 0), 1.0, relative=True, line_id=8)
    assert watch.plant.queue.length == 1
    watch.run()
    assert watch.plant.queue.motion_line == 8
    rest = watch.plant.joint_position
    line = [(q - a) / (b - a) for q, a, b in zip(rest, HOME, AWAY)]
    assert max(line[1:]) - min(line[1:]) < 1e-9
    assert rest[0] - 0.1 == pytest.approx(HOME[0] + line[1] * (AWAY[0] - HOME[0]), abs=1e-9)


def test_pause_holds_on_the_path_and_resume_goes_on(watch):
    watch.plant.add_linear_move(shift(y=0.2), 0.2, 1.0, relative=True, line_id=3)
    watch.step(60)
    watch.plant.queue.pause()
    watch.step(100)
    assert watch.plant.queue.is_paused
    assert not watch.plant.is_moving
    assert not watch.plant.is_in_position
    assert watch.plant.queue.length == 1
    watch.plant.queue.resume()
    watch.run()
    start, end = watch.tools()[0], watch.tools()[-1]
    assert (end[9] - start[9], end[10] - start[10], end[11] - start[11]) == pytest.approx((0.0, 0.2, 0.0), abs=1e-9)
    assert not watch.plant.queue.is_paused


def test_pause_without_a_move_does_not_hold_the_next_one():
    watch = PlantWatch()
    watch.plant.queue.pause()
    assert not watch.plant.queue.is_paused
    watch.plant.add_joint_move(AWAY, 1.0)
    watch.run()
    assert watch.plant.joint_position == AWAY


def test_resume_while_still_slowing_down_goes_on_from_the_standstill(watch):
    watch.plant.add_joint_move((1.0, 0, 0, 0, 0, 0), 2.0, 1.0, relative=True)
    watch.step(80)
    watch.plant.queue.pause()
    watch.step(3)
    watch.plant.queue.resume()
    slowest = watch.plant.joint_velocity[0]
    for _ in range(40):
        watch.step()
        slowest = min(slowest, watch.plant.joint_velocity[0])
    assert slowest < 0.03
    watch.run()
    assert watch.plant.joint_position[0] == HOME[0] + 1.0


def test_stop_ends_a_pause(watch):
    watch.plant.add_joint_move(AWAY, 1.0)
    watch.step(20)
    watch.plant.queue.pause()
    watch.plant.stop()
    assert not watch.plant.queue.is_paused
    watch.run(1.0)
    watch.plant.add_joint_move(HOME, 1.0)
    watch.run()
    assert watch.plant.joint_position == HOME


def test_rapid_rate_changes_speed_in_mid_motion(watch):
    watch.plant.add_joint_move((1.5, 0, 0, 0, 0, 0), 1.0, 4.0, relative=True)
    watch.step(60)
    assert watch.plant.joint_velocity[0] == pytest.approx(1.0)
    watch.plant.set_rapid_rate(0.2)
    assert watch.plant.rapid_rate == 0.2
    watch.step(80)
    assert watch.plant.joint_velocity[0] == pytest.approx(0.2)
    watch.plant.set_rapid_rate(0.0)
    watch.step(60)
    assert not watch.plant.is_moving
    assert not watch.plant.is_in_position
    watch.plant.set_rapid_rate(1.0)
    watch.run()
    assert watch.plant.joint_position[0] == HOME[0] + 1.5


@pytest.mark.parametrize("halt", ["halt_protective", "halt_emergency"])
def test_halts_end_everything_within_the_joint_limits(halt, watch):
    watch.plant.add_linear_move(shift(y=0.2), 0.5, 4.0, relative=True)
    watch.plant.add_joint_move(HOME, 1.0)
    watch.step(40)
    assert watch.plant.is_moving
    getattr(watch.plant, halt)()
    assert watch.plant.queue.length == 0
    watch.run(1.0)
    assert not watch.plant.is_moving
    watch.plant.start_hand_guiding()
    getattr(watch.plant, halt)()
    assert not watch.plant.is_hand_guided
    watch.plant.enter_servo()
    getattr(watch.plant, halt)()
    assert not watch.plant.is_servo_active


def test_emergency_halts_sooner_than_a_stop_on_the_path():
    ways = {}
    for halt in ("stop", "halt_emergency"):
        watch = PlantWatch()
        watch.plant.add_linear_move(shift(y=0.2), 0.5, 4.0, relative=True)
        watch.step(40)
        begin = len(watch.joints)
        getattr(watch.plant, halt)()
        watch.run(1.0)
        ways[halt] = len(watch.joints) - begin
    assert ways["halt_emergency"] <= ways["stop"]


def test_in_the_other_planner_no_jerk_limit_holds():
    watch = PlantWatch()
    watch.plant.queue.jerk_limited = False
    watch.plant.add_joint_move((1.0, 0, 0, 0, 0, 0), 1.0, 2.0, relative=True)
    watch.step(1)
    assert watch.plant.joint_velocity[0] == pytest.approx(0.5 * 2.0 * CYCLE_TIME_S)
