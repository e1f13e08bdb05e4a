"""The driver's checks before it powers anything, and its end where the master does not answer."""
import contextlib
import os
import signal
import socket
import subprocess
import threading
import time
from types import SimpleNamespace
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rospy
from driver_bench import ArmOfAnotherMaster, DriverProcess, SimulatorProcess, on
from ros_graph import Roscore
from std_msgs.msg import Bool
from waiting import WAIT, StallWatch, eventually

from jaka_ros_driver.ros import start_checks
from jaka_ros_driver.ros.exit_codes import CONFIGURATION, UNREACHABLE, exit_code_of
from jaka_ros_driver.ros.params import WrongParameter
from jaka_ros_driver.ros.services.table import SERVICES
from jaka_ros_driver.ros.start_checks import refuse_words_that_are_not_taken, wait_for_time

ENDS_WITHIN_S = 12.0
"""Time limit, s: the driver's own, 5 s, on a busy host; a driver that waits for the master never ends."""


@pytest.fixture
def roscore(ros_master, free_ports, tmp_path):
    core = Roscore(free_ports(1)[0], tmp_path)
    core.start()
    yield core
    core.kill()


@pytest.fixture(scope="module")
def resting():
    """Return a simulated controller without drive power: no driver that is refused may change that."""
    with contextlib.closing(SimulatorProcess()) as simulator:
        yield simulator


def refusal(simulator, environment=None, expected=CONFIGURATION, **parameters):
    """Return the words of a driver that does not start, and ends with the exit code ``expected``."""
    with DriverProcess("refused", environment, **on(simulator), **parameters) as driver:
        code, said = driver.wait()
    assert code == expected and "Traceback" not in said, said
    rospy.delete_param("/refused")  # the master keeps what this one was given
    return said


def test_a_driver_that_is_started_before_the_master_waits_and_then_starts(roscore):
    roscore.kill()
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("early", {"ROS_MASTER_URI": roscore.uri}, **on(simulator, guard=False)) as driver:
        lines = iter(driver.process.stdout)
        assert "waits for the ROS master at %s" % roscore.uri in next(lines)
        roscore.start()
        assert any("driving a JAKA" in line for line in lines)


@pytest.mark.parametrize("uri", ["master", "http://master", "http://master:no"])
def test_an_address_that_no_master_can_have_is_refused_in_one_line(ros_node, uri):
    with DriverProcess("lost", {"ROS_MASTER_URI": uri}) as driver:
        code, said = driver.wait()
    assert code == CONFIGURATION and said.count("\n") == 1 and "ROS_MASTER_URI is %r" % uri in said


def untouched(simulator):
    state = simulator.state()
    return not state["is_powered"] and not state["is_enabled"]


@pytest.mark.parametrize("name, value", [("ROS_HOSTNAME", "nobody.invalid"), ("ROS_IP", "192.0.2.7")])
def test_a_node_that_no_client_can_reach_refuses_to_start_and_powers_nothing(ros_node, resting, name, value):
    said = refusal(resting, {name: value}, UNREACHABLE)
    assert "/refused cannot start: clients are told to reach this node at http://%s:" % value in said
    assert "the address comes from %s=%s" % (name, value) in said
    assert untouched(resting)


@pytest.mark.parametrize("name, value, words", [
    ("joint_states_topic", "/rosout", "ROS itself uses it"), ("joint_states_topic", "/tf", "ROS itself uses it"),
    ("joint_states_topic", "~tool_position", "/refused/tool_position"),
    ("joint_states_topic", "~joint_position", "/refused/joint_position"),
    ("joint_states_topic", "~servo_j_command", "/refused/servo_j_command"),
    ("joint_states_topic", "~jog_joints", "/refused/jog_joints"),
    ("joint_states_topic", "jaka_zu7_controller/state", "/jaka_zu7_controller/state"),
    ("joint_states_topic", "/of_a_camera", "it has the type std_msgs/Bool already"),
    ("trajectory_controller", "of_a_cell", "it has the type std_msgs/Bool already")])
def test_a_topic_that_is_used_for_something_else_is_refused(ros_node, resting, name, value, words):
    others = [rospy.Publisher(topic, Bool, queue_size=1) for topic in ("/of_a_camera", "/of_a_cell/command")]
    said = refusal(resting, **{name: value})
    assert "cannot start: " in said and words in said and "~" + name in said, said
    assert untouched(resting)
    for other in others:
        other.unregister()


def test_a_remapping_that_makes_two_topics_one_is_refused(ros_node, resting):
    said = refusal(resting, remappings=["joint_states:=/refused/jog_joints"])
    assert "would use /refused/jog_joints for two things at once" in said
    assert untouched(resting)


@pytest.mark.parametrize("word, problem", [
    ("_ip:=", "_ip:= has no value"), ("_ip:=''", "parameter ~ip is ''"),
    ("ip:=10.5.5.100", "ip:=10.5.5.100 would be the remapping of a topic; the parameter is set by _ip:=10.5.5.100")])
def test_a_word_that_would_leave_the_driver_with_its_default_is_refused(ros_node, resting, word, problem):
    # the default is the address on which a simulated controller, or a tunnel to a real one, may listen
    given = on(resting)
    del given["ip"]
    with DriverProcess("refused", None, remappings=[word], **given) as driver:
        code, said = driver.wait()
    assert code == CONFIGURATION and "Traceback" not in said and "cannot start: " in said and problem in said, said
    assert untouched(resting)
    with contextlib.suppress(KeyError):
        rospy.delete_param("/refused")


@pytest.mark.parametrize("word, problem", [
    ("_ip:= ", "_ip:=  has no value"), ("_model:=", "_model:= has no value"),
    ("_ip:=~", "_ip:=~ has no value: null in YAML"), ("~ip:=10.5.5.100", "the parameter is set by _ip:=10.5.5.100"),
    ("_ip:=10.5.5.100:=1", "has := more than once"), ("_ip:=[10.5", "is no YAML"), ("_ip:=2001-99-99", "is no YAML"),
    ("__ns:=", "__ns:= has no value"), ("joint_states:=", "joint_states:= has no value")])
def test_so_is_any_other_word_without_the_effect_that_it_seems_to_have(word, problem):
    with pytest.raises(WrongParameter) as caught:
        refuse_words_that_are_not_taken([word])
    assert problem in str(caught.value) and exit_code_of(caught.value) == CONFIGURATION


@pytest.mark.parametrize("words", [["__name:=x", "__log:=/tmp/x.log", "joint_states:=/a/b", "_ip:=10.5.5.100"],
                                   ["--dh-file=a:=b", "-x:="],
                                   ["_frame_prefix:=''", "_publish_tf:=none", "_blocking:=no"]])
def test_words_that_mean_what_they_say_are_taken(words):
    refuse_words_that_are_not_taken(words)


def test_without_time_nothing_is_powered_or_offered_until_it_runs(roscore):
    roscore.run("rosparam", "set", "/use_sim_time", "true")
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)) as driver:
        said = next(line for line in driver.process.stdout if "ERROR" in line)
        assert "/use_sim_time is true and no /clock has come" in said
        assert untouched(simulator) and "/jaka_driver/stop_move" not in roscore.registered()[2]
        clock = subprocess.Popen(["rostopic", "pub", "-r", "50", "/clock", "rosgraph_msgs/Clock", "clock: {secs: 5}"],
                                 env=roscore.environment, stdout=subprocess.DEVNULL)
        try:
            assert eventually(lambda: {"/jaka_driver/" + spec.name for spec in SERVICES} <= roscore.registered()[2])
            assert eventually(lambda: simulator.state()["is_enabled"])
            printed = roscore.run("rostopic", "echo", "-n1", "/jaka_driver/joint_position/header/stamp/secs")
            assert printed.split()[0] in ("4", "5"), "the time of arrival, some ms ago"
        finally:
            clock.terminate()
            clock.wait(WAIT)


def test_a_driver_that_waits_for_time_ends_when_it_is_told_to(roscore):
    roscore.run("rosparam", "set", "/use_sim_time", "true")
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)) as driver:
        next(line for line in driver.process.stdout if "no /clock has come" in line)
        code, _ = driver.end()
    assert code == 0


def test_the_wait_for_time_is_over_with_the_first_time_that_is_not_zero():
    times = [rospy.Time(1), rospy.Time(0), rospy.Time(0)]
    wait_for_time(threading.Event(), times.pop)
    assert times == []


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_with_a_frozen_master_the_arm_is_stopped_at_once_and_the_driver_ends(roscore, how):
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)) as driver:
        arm = ArmOfAnotherMaster(simulator, "/jaka_driver", roscore.uri)
        assert eventually(lambda: arm.call("jog", mvvelo=0.2, coord_mode=0, index=0).ret == 1)
        assert eventually(simulator.is_moving)
        with roscore.frozen(), StallWatch() as host:
            told_at = time.monotonic()
            driver.process.send_signal(how)
            assert eventually(lambda: not simulator.is_moving())
            assert host.between(told_at) < 2.0, "the jog's own watchdog would stop it after 3 s"
            code, said = driver.wait()
            assert host.between(told_at) < ENDS_WITHIN_S
    assert code == 0 and "Traceback" not in said, said


def test_a_driver_in_the_middle_of_its_start_ends_where_the_master_is_frozen(roscore):
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("jaka_driver", roscore.environment, **on(simulator, guard=False)) as driver:
        assert eventually(lambda: roscore.registered()[0])
        with roscore.frozen():
            driver.process.send_signal(signal.SIGTERM)
            told_at = time.monotonic()
            driver.wait()
            assert time.monotonic() - told_at < ENDS_WITHIN_S


# ---- without a master ----

@pytest.fixture
def at_the_address(monkeypatch):
    """Return ``serve(answer)``: it answers at the address that the master gives to clients; its TCP port is open."""
    with contextlib.ExitStack() as made:
        listener = made.enter_context(contextlib.closing(socket.create_server(("127.0.0.1", 0))))
        monkeypatch.setattr(rospy, "get_name", lambda: "/jaka_driver")
        address = listener.getsockname()
        monkeypatch.setattr(start_checks.tcpros_base, "get_tcpros_server_address", lambda: address)

        def serve(answer):
            server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
            server.register_function(lambda name: answer, "getPid")
            thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
            thread.start()
            made.callback(thread.join, WAIT)
            made.callback(server.shutdown)
            made.callback(server.server_close)
            monkeypatch.setattr(rospy, "get_node_uri", lambda: "http://127.0.0.1:%d/" % server.server_address[1])
            return listener

        yield serve


def test_a_node_that_answers_at_its_own_address_is_reachable(at_the_address):
    at_the_address([1, "", os.getpid()])
    start_checks.refuse_unreachable_node()


@pytest.mark.parametrize("answer", [[1, "", 1], [0, "", os.getpid()], "no", {}, [1]])
def test_another_process_at_its_address_is_told_from_it(at_the_address, answer):
    at_the_address(answer)
    with pytest.raises(start_checks.Unreachable, match="another process answers there"):
        start_checks.refuse_unreachable_node()


def test_a_port_of_topics_that_nobody_reaches_is_told(at_the_address):
    at_the_address([1, "", os.getpid()]).close()
    with pytest.raises(start_checks.Unreachable, match="nothing answers there"):
        start_checks.refuse_unreachable_node()


@pytest.mark.parametrize("pubs, subs, wrong", [
    ({"/joint_states": 1, "/n/io": 1}, {"/n/jog_joints": 1}, None),
    ({"/joint_states": 2, "/n/io": 1}, {"/n/jog_joints": 1}, "would use /joint_states for two"),
    ({"/n/jog_joints": 1, "/n/io": 1}, {"/n/jog_joints": 1, "/n/jog_tool": 2}, "/n/jog_joints, /n/jog_tool for two")])
def test_exactly_the_topics_that_have_two_uses_are_refused(monkeypatch, pubs, subs, wrong):
    topics = SimpleNamespace(**{key: {name: SimpleNamespace(ref_count=count) for name, count in uses.items()}
                                for key, uses in (("pubs", pubs), ("subs", subs))})
    monkeypatch.setattr(start_checks.registration, "get_topic_manager", lambda: topics)
    with contextlib.nullcontext() if wrong is None else pytest.raises(WrongParameter, match=wrong):
        start_checks.refuse_topics_used_twice()
