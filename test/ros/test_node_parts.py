"""What the node makes of its parameters, with parts that the test plays; without a ROS master."""
from unittest import mock

import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros import node
from jaka_ros_driver.ros.params import DriverConfig

PARTS = ("ArmClient", "CallPublisher", "Diagnostics", "DriverLock", "FrameTable", "Guard", "IoPublisher", "JogTopics",
         "MasterWatch", "ModelCheck", "MotionEnds", "PathAction", "RecoverAction", "RequestDecoder",
         "RobotStatusPublisher", "SensorPublishers", "ServiceHandlers", "Services", "ServoTopics", "SpeedPublisher",
         "StatePublishers", "TrajectoryInterface", "keep_serving", "rospy")


@pytest.fixture
def parts(monkeypatch):
    """The parts by name; a parameter server that holds nothing."""
    made = {name: mock.MagicMock(name=name) for name in PARTS}
    for name, part in made.items():
        monkeypatch.setattr(node, name, part)
    made["rospy"].get_name.return_value = "/jaka_driver"
    made["rospy"].get_param.return_value = ""
    return made


def driver(**parameters):
    return node.Driver(DriverConfig(**parameters), load_model("zu7"))


@pytest.mark.parametrize("is_guarded", [True, False])
def test_there_is_a_guard_where_one_is_wanted_and_it_is_the_arms(parts, is_guarded):
    made = driver(guard=is_guarded)
    assert parts["Guard"].call_count == is_guarded
    assert parts["ArmClient"].call_args[0][2] is (parts["Guard"].return_value if is_guarded else None)
    made.close()
    assert parts["Guard"].return_value.close.call_count == is_guarded
    assert parts["DriverLock"].return_value.release.call_count == 1


@pytest.mark.parametrize("is_wanted", [True, False])
def test_the_arm_is_enabled_by_itself_where_that_is_wanted(parts, is_wanted):
    driver(auto_enable=is_wanted).start()
    assert parts["ArmClient"].return_value.auto_enable.call_count == is_wanted


@pytest.mark.parametrize("present, is_wanted, is_set", [
    ("", True, True), ("", False, False), ("<robot name='of another program'/>", True, False)])
def test_the_description_is_set_where_there_is_none(parts, present, is_wanted, is_set):
    parts["rospy"].get_param.return_value = present
    driver(publish_description=is_wanted).start()
    assert parts["rospy"].set_param.call_count == is_set


def test_a_description_of_an_earlier_start_is_replaced(parts):
    one = driver()
    one.start()
    parts["rospy"].get_param.return_value = parts["rospy"].set_param.call_args[0][1]
    one.start()
    assert parts["rospy"].set_param.call_count == 2


def test_whether_the_arm_is_real_is_told_when_it_becomes_known_and_when_it_changes(parts):
    one = driver()
    told = []
    parts["rospy"].Publisher.return_value.publish.side_effect = told.append
    for is_simulated in (None, True, True, None, False, False, True):
        parts["ArmClient"].return_value.is_simulated = is_simulated
        one.tell_kind()
    assert told == [True, False, True]
