"""The agreement of jaka_bag with the driver in what it repeats, because it stands without the driver."""
from jaka_bag.driver_interface import MotionState
from jaka_ros_driver import state


def test_motion_states_have_the_drivers_numbers():
    assert {entry.name: entry.value for entry in MotionState} \
        == {entry.name: entry.value for entry in state.MotionState}
