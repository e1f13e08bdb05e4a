"""The node's use of its parameters, with parts that the test plays; without a ROS master."""
import io
import threading
import time
from unittest import mock

import pytest

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.limits import SERVO_PERIOD_S
from jaka_ros_driver.ros import node
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.trajectories.controller_params import controller_params

PARTS = ("ArmClient", "CallPublisher", "ControllerManager", "Diagnostics", "DriverLock", "ERRANDS", "FrameReader",
         "Guard", "IoPublisher", "JogSubscribers", "MasterWatch", "ModelCheck", "MotionEnds", "PathAction",
         "RecoverAction", "RequestDecoder", "RobotStatusPublisher", "SensorPublishers", "ServiceHandlers", "Services",
         "ServoTopics", "SpeedPublisher", "StatePublishers", "StateQuery", "TrajectoryInterface", "WorkspaceMarkers",
         "audit_log_of", "direct_publisher", "keep_serving", "refuse_topics_used_twice", "rospy")


@pytest.fixture
def parts(monkeypatch):
    """Return the parts by name, with a parameter server that holds nothing."""
    made = {name: mock.MagicMock(name=name) for name in PARTS}
    for name, part in made.items():
        monkeypatch.setattr(node, name, part)
    made["rospy"].get_name.return_value = "/jaka_driver"
    made["rospy"].get_param.return_value = ""
    return made


def driver(**parameters):
    config = DriverConfig(**parameters)
    return node.DriverNode(config, load_model("zu7"), controller_params(config, None))


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


@pytest.mark.parametrize("mode, is_said", [("stop", False), ("warn", True), ("off", True)])
def test_a_motion_guard_that_refuses_nothing_is_said_at_the_start(parts, caplog, mode, is_said):
    driver(guard_motion=mode).start()
    assert ("~guard_motion is %s: a motion that would hit the arm itself or a zone is not refused" % mode
            in caplog.text) is is_said


@pytest.mark.parametrize("present, is_wanted, is_set", [
    ("", True, True), ("", False, False), ("<robot name='of another arm'/>", True, False)])
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


@pytest.mark.parametrize("is_whole", [True, False])
def test_an_audit_log_that_could_not_be_written_to_its_end_is_said(parts, caplog, is_whole):
    parts["audit_log_of"].return_value.close.return_value = is_whole
    made = driver()
    made.start()
    made.close()
    assert parts["audit_log_of"].return_value.close.call_count == 1
    assert ("could not be written to its end" in caplog.text) is not is_whole


def test_whether_the_arm_is_real_is_told_when_it_becomes_known_and_when_it_changes(parts):
    one = driver()
    told = []
    parts["direct_publisher"].return_value.publish.side_effect = told.append
    for is_simulated in (None, True, True, None, False, False, True):
        parts["ArmClient"].return_value.is_simulated = is_simulated
        one.publish_kind()
    assert [one.data for one in told] == [True, False, True]


# ---- the process ----

class Rospy:
    """The part of rospy that the life of a node uses, and a record of its calls."""

    def __init__(self):
        self.is_down = self.is_asked_to_end = False
        self.reasons, self.fatal = [], []
        self.core = mock.Mock(is_shutdown_requested=lambda: self.is_asked_to_end)

    def is_shutdown(self):
        return self.is_down

    def signal_shutdown(self, reason):
        self.reasons.append(reason)
        self.is_down = True

    def get_param(self, name, default=None):
        return {} if name == "~" else default

    def get_name(self):
        return "/jaka_driver"

    def on_shutdown(self, call):
        pass

    def logfatal(self, *arguments):
        self.fatal.append(arguments[0] % arguments[1:])


@pytest.fixture
def life(monkeypatch):
    """Return a life whose driver has started; ``life.made`` is its driver, ``life.rospy`` the record of its calls."""
    played, started = Rospy(), threading.Event()
    made = mock.Mock(has_failed=False)
    made.start.side_effect = started.set
    for name, part in (("rospy", played), ("DriverNode", mock.Mock(return_value=made)), ("wait_for_time", mock.Mock()),
                       ("refuse_unreachable_node", mock.Mock()), ("refuse_taken_topics", mock.Mock())):
        monkeypatch.setattr(node, name, part)
    one = node._Life(lambda timeout: True)
    one.made, one.rospy, one.started = made, played, started
    yield one
    one._ending.set()
    if one._thread.is_alive():
        one._thread.join(20.0)


def test_a_node_runs_until_it_is_told_to_end_and_ends_with_0(life):
    assert not life.is_running
    life.start()
    assert life.started.wait(20.0) and life.is_running
    assert life.end("signal 15") and life.exit_code == 0
    assert life.made.close.call_count == 1 and life.rospy.reasons == ["signal 15"]


@pytest.mark.parametrize("ends", [lambda life: setattr(life.rospy, "is_down", True),
                                  lambda life: setattr(life.rospy, "is_asked_to_end", True),
                                  lambda life: setattr(life.made, "has_failed", True)],
                         ids=["the ROS graph was left", "rosnode kill", "a defect of the core"])
def test_what_ends_a_node(life, ends):
    life.start()
    assert life.started.wait(20.0) and life.is_running
    ends(life)
    assert not life.is_running


def test_a_driver_whose_core_has_failed_ends_with_1(life):
    life.start()
    assert life.started.wait(20.0)
    life.made.has_failed = True
    assert life.end("a defect") and life.exit_code == 1


@pytest.mark.parametrize("error, code", [
    (InvalidCommand("unknown arm model"), 2), (OSError("no such file"), 5), (KeyError("a defect"), 1)])
def test_a_driver_that_cannot_start_ends_with_the_code_of_its_cause(life, monkeypatch, error, code):
    monkeypatch.setattr(node, "DriverNode", mock.Mock(side_effect=error))
    life.start()
    life._thread.join(20.0)
    assert not life.is_running and life.exit_code == code
    assert bool(life.rospy.fatal) is not isinstance(error, KeyError)


def test_a_master_that_does_not_answer_holds_the_end_up_for_a_limited_time(life, monkeypatch):
    monkeypatch.setattr(node, "_END_TIMEOUT_S", 0.2)
    life.start()
    assert life.started.wait(20.0)
    hangs = threading.Event()
    monkeypatch.setattr(life.rospy, "signal_shutdown", lambda reason: hangs.wait(20.0))
    began = time.monotonic()
    assert not life.end("signal 15") and time.monotonic() - began < 10.0
    hangs.set()
    assert life.made.close.call_count == 1, "the arm is stopped first"


def test_the_end_waits_for_another_thread_that_leaves_the_graph(life, monkeypatch):
    life.start()
    assert life.started.wait(20.0)
    monkeypatch.setattr(life.rospy, "signal_shutdown", lambda reason: threading.Timer(
        0.3, lambda: setattr(life.rospy, "is_down", True)).start())
    assert life.end("signal 15")


@pytest.mark.parametrize("arguments, code, told", [
    (["--urdf", "zu7"], 0, "<robot"), (["--urdf", "zu7", "--frame-prefix", "left_"], 0, 'name="left_'),
    (["--urdf", "zu8"], 2, "unknown arm model"), (["--urdf", "zu7", "--dh-file", "/nowhere.yaml"], 2, "/nowhere.yaml"),
    (["--urdf", "zu7", "--dh-file", "none"], 0, "<robot")])
def test_the_urdf_of_a_model_is_printed_or_why_not(capsys, arguments, code, told):
    assert node.main(arguments) == code
    printed = capsys.readouterr()
    assert told in (printed.err if code else printed.out) and not (printed.out if code else printed.err)


@pytest.fixture
def intervals(monkeypatch):
    """Let the node come as far as to find another one that runs; return the switch intervals that it sets, s."""
    found = []
    monkeypatch.setattr(node, "ask_for_short_slices", lambda: None)
    monkeypatch.setattr(node.sys, "setswitchinterval", found.append)
    monkeypatch.setattr(node.signal, "signal", lambda *arguments: None)
    monkeypatch.setattr(node, "wait_for_master", lambda name: None)
    monkeypatch.setattr(node, "refuse_second_node", mock.Mock(side_effect=InvalidCommand("another one runs")))
    return found


@pytest.mark.parametrize("is_text", [True, False])
def test_a_log_in_a_file_is_complete_while_the_driver_runs(intervals, monkeypatch, is_text):
    # Standard output is a text file, or whatever else a program that embeds this one has put there.
    stdout = io.TextIOWrapper(io.BytesIO()) if is_text else io.StringIO()
    monkeypatch.setattr(node.sys, "stdout", stdout)
    assert node.main([]) == 2
    assert not is_text or stdout.line_buffering


def test_no_thread_keeps_the_others_waiting_for_a_tenth_of_a_servo_cycle(intervals):
    assert node.main([]) == 2
    assert len(intervals) == 1 and intervals[0] < 0.1 * SERVO_PERIOD_S


@pytest.mark.parametrize("priority, is_asked", [(0, False), (20, True)])
def test_real_time_priority_is_taken_where_it_is_wanted_and_is_no_condition(monkeypatch, priority, is_asked):
    asked = mock.Mock(side_effect=PermissionError(1, "Operation not permitted"))
    monkeypatch.setattr(node, "set_real_time", asked)
    node._set_scheduler(priority)
    assert [call[0] for call in asked.call_args_list] == [(priority,)] * is_asked
