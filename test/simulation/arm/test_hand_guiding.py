import pytest
from plant_watch import ZU7, PlantWatch

from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.hand_guiding import MAX_SPEED
from jaka_ros_driver.simulation.arm.plant import HOME


@pytest.fixture()
def watch():
    result = PlantWatch()
    result.plant.start_hand_guiding()
    return result


def test_a_push_moves_the_joint_until_let_go(watch):
    assert watch.plant.is_hand_guided
    assert watch.plant.push_joint(0, 0.5)
    watch.step(60)
    assert watch.plant.joint_velocity == pytest.approx((0.5, 0, 0, 0, 0, 0))
    assert watch.plant.push_joint(0, 0.0)
    watch.step(40)
    assert not watch.plant.is_moving
    assert watch.plant.is_hand_guided


def test_several_joints_follow_at_once_and_none_too_fast(watch):
    watch.plant.push_joint(0, 50.0)
    watch.plant.push_joint(5, -50.0)
    watch.step(100)
    assert watch.plant.joint_velocity[0] == pytest.approx(MAX_SPEED)
    assert watch.plant.joint_velocity[5] == pytest.approx(-MAX_SPEED)


def test_a_push_the_other_way_turns_round_smoothly(watch):
    watch.plant.push_joint(3, 1.0)
    watch.step(60)
    watch.plant.push_joint(3, -1.0)
    watch.step(120)
    assert watch.plant.joint_velocity[3] == pytest.approx(-1.0)


@pytest.mark.parametrize(("velocity", "near", "hit"), [(1.0, 0x020033, 0x020031), (-1.0, 0x020034, 0x020032)])
def test_at_a_soft_limit_guiding_ends(velocity, near, hit, watch):
    watch.plant.push_joint(2, velocity)
    watch.step(900)
    assert watch.codes == [near, hit, events.HAND_GUIDING_HIT_SOFT_LIMIT.code]
    assert not watch.plant.is_hand_guided
    assert watch.plant.joint_position[2] == ZU7.joint_limits[2][velocity > 0]
    with pytest.raises(TargetRejected) as caught:
        watch.plant.start_hand_guiding()
    assert caught.value.event_code == events.HAND_GUIDING_ON_SOFT_LIMIT.code


def test_switching_it_off_comes_to_rest(watch):
    watch.plant.push_joint(1, 1.0)
    watch.step(60)
    watch.plant.stop_hand_guiding()
    assert not watch.plant.is_hand_guided
    watch.run(1.0)
    assert not watch.plant.is_moving
    assert watch.plant.joint_position[1] > HOME[1]


def test_it_is_refused_while_the_arm_moves_or_streams():
    watch = PlantWatch()
    watch.plant.add_joint_move((0.2, 0, 0, 0, 0, 0), 1.0, relative=True)
    with pytest.raises(TargetRejected) as caught:
        watch.plant.start_hand_guiding()
    assert caught.value.event_code == events.HAND_GUIDING_REFUSED_MOVING.code
    watch.run()
    watch.plant.enter_servo()
    with pytest.raises(TargetRejected):
        watch.plant.start_hand_guiding()


def test_without_guiding_a_push_does_nothing():
    watch = PlantWatch()
    assert not watch.plant.push_joint(0, 1.0)
    watch.step(10)
    assert watch.plant.joint_position == HOME


def test_starting_twice_keeps_the_push(watch):
    watch.plant.push_joint(0, 0.5)
    watch.plant.start_hand_guiding()
    watch.step(60)
    assert watch.plant.joint_velocity[0] == pytest.approx(0.5)
