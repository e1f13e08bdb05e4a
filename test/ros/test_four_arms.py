"""Four arms in four namespaces: no absolute name, each at its rate, and a cut of one is nothing to the others."""
import contextlib

import pytest
import rosgraph
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, collecting, on
from sensor_msgs.msg import JointState
from waiting import eventually

NAMESPACES = ("arm_1", "arm_2", "arm_3", "arm_4")
SHARED = {"/diagnostics", "/rosout", "/tf", "/tf_static"}


@pytest.fixture(scope="module")
def arms(ros_node):
    with contextlib.ExitStack() as running:
        found = []
        for name in NAMESPACES:
            simulator = running.enter_context(contextlib.closing(SimulatorProcess("--start", "enabled")))
            running.enter_context(DriverProcess(
                "jaka_driver", {"ROS_NAMESPACE": "/" + name}, frame_prefix=name + "_", **on(simulator)))
            found.append(Arm(simulator, "/%s/jaka_driver" % name))
        for arm in found:
            arm.wait_until_ready()
        yield found


def test_no_name_is_absolute_but_the_shared_topics(arms):
    published, subscribed, services = rosgraph.Master("/jaka_tests").getSystemState()
    for namespace in NAMESPACES:
        own = "/%s/" % namespace
        node = own + "jaka_driver"
        names = {name for name, nodes in published + subscribed + services if node in nodes}
        assert len(names) > 25
        assert {name for name in names if not name.startswith(own)} <= SHARED
    params = rosgraph.Master("/jaka_tests").getParamNames()
    assert all("/%s/robot_description" % namespace in params for namespace in NAMESPACES)


def test_each_publishes_at_its_rate(arms):
    with contextlib.ExitStack() as listening:
        received = [listening.enter_context(collecting(arm.name + "/joint_position", JointState)) for arm in arms]

        def at_full_rate(messages):
            """Return whether the last second by the stamps is full: the listener here has four arms to receive."""
            stamps = [message.header.stamp.to_sec() for _, message in messages[-126:]]
            return len(stamps) == 126 and 125.0 / (stamps[-1] - stamps[0]) == pytest.approx(125.0, rel=0.05)
        assert all(eventually(lambda messages=messages: at_full_rate(messages)) for messages in received)


def test_the_cut_of_one_is_nothing_to_the_others(arms):
    cut, *others = arms
    with contextlib.ExitStack() as listening:
        received = [listening.enter_context(collecting(arm.name + "/joint_position", JointState)) for arm in arms]
        cut.simulator.operate("refuse", duration_ms=2000)
        cut.simulator.operate("close")
        assert eventually(lambda: not cut.call("get_fk", joint=HOME).cartesian_pose)
        counts = [len(messages) for messages in received]
        assert all(arm.call("get_fk", joint=HOME).cartesian_pose for arm in others)
        assert eventually(lambda: all(len(messages) > count + 125 for messages, count in
                                      zip(received[1:], counts[1:])))
        for arm in others:  # on a busy computer four drivers and their listener may hold each other's feeds up
            answers = []
            assert eventually(lambda arm=arm, answers=answers: answers.append(arm.call(
                "joint_move", pose=[0.1] + HOME[1:], mvvelo=3.0, mvacc=12.0)) or answers[-1].ret == 1), answers
        assert eventually(lambda: len(received[0]) > counts[0] + 125), "the cut one does not come back"
    assert all(arm.simulator.state()["joint_position"][0] == pytest.approx(5.7296, abs=0.01) for arm in others)
    assert cut.simulator.state()["joint_position"][0] == pytest.approx(0.0, abs=0.01)
