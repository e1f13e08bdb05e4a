"""Two arms in two namespaces; a second driver on one controller."""
import contextlib

import pytest
import rosgraph
import rospy
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, listen, on
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from waiting import eventually

SHARED = {"/diagnostics", "/rosout", "/tf", "/tf_static"}


@pytest.fixture(scope="module")
def two(ros_node, launched_file, free_ports):
    ports = free_ports(4)
    arguments = ["%s_%s_port:=%d" % (side, kind, ports.pop()) for side in ("left", "right")
                 for kind in ("command", "status")]
    with launched_file("two_arms.launch", arguments + ["sim_args:=--start enabled"]):
        yield Arm(None, "/left/jaka_driver"), Arm(None, "/right/jaka_driver")


def ready(arm):
    arm.wait_until_seen()
    assert eventually(lambda: arm.listen("robot_states", 1)[0].power_state == 1)


def test_both_move_at_full_rate_and_independently(two):
    for arm in two:
        ready(arm)
    left, right = two
    for arm, angle in ((left, 0.3), (right, -0.3)):
        assert arm.call("joint_move", pose=[angle] + HOME[1:], mvvelo=3.0, mvacc=12.0).ret == 1
        assert arm.listen("joint_position", 1)[0].position[0] == pytest.approx(angle, abs=1e-4)
    assert left.listen("joint_position", 1)[0].position[0] == pytest.approx(0.3, abs=1e-4)

    def at_full_rate(arm):
        times = [at for at, _ in listen(arm.name + "/joint_position", 126)]
        return 125.0 / (times[-1] - times[0]) == pytest.approx(125.0, rel=0.05)
    assert all(eventually(lambda arm=arm: at_full_rate(arm)) for arm in two)


def test_every_name_is_in_its_namespace_but_the_shared_topics(two):
    for arm in two:
        arm.wait_until_seen()
    published, _, services = rosgraph.Master("/jaka_tests").getSystemState()
    names = {name for name, nodes in published + services
             if any(node.endswith(("jaka_driver", "jaka_sim")) for node in nodes)}
    assert names and {name for name in names if not name.startswith(("/left/", "/right/"))} <= SHARED
    assert {"/left/joint_states", "/right/joint_states"} <= names
    assert "left_tool0" in rospy.get_param("/left/robot_description")


def test_frames_and_joints_are_told_apart(two):
    for arm in two:
        arm.wait_until_seen()
    frames = {t.child_frame_id for _, message in listen("/tf", 100, topic_type=TFMessage) for t in message.transforms}
    assert {"left_tool0", "right_tool0", "left_tool", "right_tool"} <= frames
    assert listen("/left/joint_states", 1, topic_type=JointState)[0][1].name[0] == "left_joint_1"
    assert two[1].listen("tool_position", 1)[0].header.frame_id == "right_base_link"


def test_a_second_driver_on_the_same_controller_refuses_and_the_first_goes_on(ros_node):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("older", **on(simulator, guard=False)):
        first = Arm(simulator, "/older")
        first.wait_until_seen()
        with DriverProcess("newer", **on(simulator, guard=False)) as second:
            code, said = second.wait()
        assert code == 3 and "already driven by node /older (pid " in said
        assert simulator.operate("wire")
        assert first.call("get_fk", joint=HOME).cartesian_pose
