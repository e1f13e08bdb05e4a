"""The way ahead that the motion guard looks at while the controller moves the arm."""
import pytest

from jaka_ros_driver.client.core.motion_guard.feed_watch import FeedWatch
from jaka_ros_driver.kinematics.limits import JOINT_SPEED_CEILING
from jaka_ros_driver.state import RobotState

HOME = (0.0, 1.57, -1.57, 1.57, 1.57, 0.0)


def ways_of(joint_6, period=0.008):
    """Return the ways that are looked at while joint 6 is seen at these places, rad."""
    ways = []
    watch = FeedWatch(lambda way: ways.append(way) or "")
    for number, place in enumerate(joint_6):
        watch.trouble(RobotState(HOME[:5] + (place,), True, True, True, False, False, received_at=number * period))
    return ways


@pytest.mark.parametrize("speed", [0.0, 0.3, -2.0])
def test_it_looks_as_far_as_the_arm_comes_before_a_stop_brakes_it(speed):
    here, ahead = ways_of([0.008 * number * speed for number in range(8)])[-1]
    assert (ahead[5] - here[5]) * speed >= 0.1 * speed * speed and ahead[:5] == HOME[:5]


@pytest.mark.parametrize("jump", [2.5, -300.0])
def test_joints_that_jump_do_not_have_the_way_of_seconds_looked_at(jump):
    (here, ahead), = ways_of([0.0, jump])
    assert here[5] == jump and 0.1 < abs(ahead[5] - here[5]) <= 0.5 * JOINT_SPEED_CEILING
