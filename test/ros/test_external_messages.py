"""The driver on the maker's own jaka_msgs (JAKA_MSGS_EXTERNAL=1): no ServiceCall, no ClearErr, no action Recover."""
import contextlib
import os
from pathlib import Path

import pytest
import roslib.packages
import rospy
import rosservice
import std_msgs
from driver_bench import Arm, DriverProcess, SimulatorProcess, on
from genpy.generate_initpy import write_modules
from genpy.generator import MsgGenerator, SrvGenerator
from import_graph import ROOT

from jaka_msgs.srv import ClearError, ServoMove

NAME = "external_driver"


@pytest.fixture
def external_messages(tmp_path):
    """Make a folder with the Python modules of the maker's jaka_msgs."""
    source = ROOT / "test" / "packaging" / "other_jaka_msgs"
    search = {"jaka_msgs": [str(source / "msg")],
              "std_msgs": [str(Path(roslib.packages.get_pkg_dir(std_msgs.__name__), "msg"))]}
    package = tmp_path / "jaka_msgs"
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        files = sorted(str(path) for path in (source / kind).iterdir())
        assert generator.generate_messages("jaka_msgs", files, str(package / kind), search) == 0
        write_modules(str(package / kind))
    (package / "__init__.py").touch()
    return tmp_path


def test_everything_is_served_but_the_record_of_calls_and_the_action(ros_node, external_messages):
    path = os.pathsep.join((str(external_messages), os.environ["PYTHONPATH"]))
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator:
        driver = DriverProcess(NAME, environment={"PYTHONPATH": path}, interface="vendor",
                               **on(simulator, guard=False))
        with driver:
            arm = Arm(simulator, "/" + NAME)
            arm.wait_until_ready()
            arm.go_home()
            assert arm.listen("robot_states", 1)[0].power_state == 1
            assert arm.call("servo_move_enable", enable=True).ret == 1
            with contextlib.closing(rospy.ServiceProxy("/%s/servo_j" % NAME, ServoMove)) as makers_client:
                assert makers_client(pose=[0.0] * 6, speed=[1.0]).ret == 1
            arm.call("stop_move")
            assert arm.call("recover").success, "the service does without the message type"
            assert rosservice.get_service_type("/%s/clear_err" % NAME) == "jaka_msgs/ClearError"
            refused = rospy.ServiceProxy("/%s/clear_err" % NAME, ClearError)(enable=False)
            assert refused.ret == 0 and "enable is false" in refused.message
            assert rospy.ServiceProxy("/%s/clear_err" % NAME, ClearError)(enable=True).ret == 1
            assert arm.call("clear_err").ret == 1, "a client of ClearErr is served, too"
            topics = [topic for topic, _ in rospy.get_published_topics("/" + NAME)]
            code, said = driver.end()
    assert "/%s/robot_states" % NAME in topics and "/%s/service_calls" % NAME not in topics
    assert "/%s/io_states" % NAME not in topics and "no IOStates" in said
    assert not [topic for topic in topics if "/recover/" in topic]
    assert code == 0
    as_told = "no ClearErr: ~clear_err is served as jaka_msgs/ClearError"
    assert len([line for line in said.splitlines() if as_told in line and "WARN" in line]) == 1
    assert len([line for line in said.splitlines() if "no action Recover" in line and "WARN" in line]) == 1
    warnings = [line for line in said.splitlines() if "ServiceCall" in line]
    assert len(warnings) == 1 and "WARN" in warnings[0] and str(external_messages) in warnings[0], said
