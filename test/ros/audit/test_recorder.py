"""The lines of calls, goals and messages: bounded, with their caller, and never at the cost of a call."""
import contextlib
import json
import logging
import math
from types import SimpleNamespace

import pytest
import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import TriggerRequest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from jaka_msgs.srv import MoveRequest
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.audit import callers, plain, recorder, setting_up
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services.handlers import ServiceHandlers, ServiceOutcome
from jaka_ros_driver.ros.services.table import SERVICES, Services

HEADER = {"callerid": "/cell", "md5sum": "*", callers.PEER: callers.Caller("/cell", "10.0.0.4:50000")}


class Log:
    def __init__(self):
        self.lines, self.tasks = [], []

    def write(self, kind, fields, is_urgent=False):
        self.lines.append(SimpleNamespace(kind=kind, is_urgent=is_urgent, **json.loads(json.dumps(
            fields, allow_nan=False))))

    def add_task(self, task):
        self.tasks.append(task)


@pytest.fixture
def log():
    return Log()


@pytest.fixture
def one(log):
    made = recorder.Recorder(log)
    for spec in SERVICES:
        made.offers_service("~" + spec.name)
    return made


def request(kind=TriggerRequest, **fields):
    made = kind(**fields)
    made._connection_header = HEADER
    return made


def test_a_call_is_a_line_with_its_caller_and_another_with_its_answer(log, one):
    entry = one.call("~power", request())
    assert [(line.kind, line.node, line.host, line.is_urgent) for line in log.lines] == [
        ("call", "/cell", "10.0.0.4:50000", True)]
    entry.answered(False, "no power")
    assert (log.lines[1].kind, log.lines[1].call, log.lines[1].ok, log.lines[1].message) == (
        "answer", log.lines[0].call, False, "no power")
    one.call("~set_io", request()).failed("internal error")
    assert not log.lines[3].ok and log.lines[3].call != log.lines[0].call and not log.lines[3].is_urgent


def test_what_is_not_recorded_makes_no_line(log, one):
    one.call("~get_fk", request()).answered(True, "")
    assert not log.lines and ("service", "~get_fk") not in one.names


def test_a_jog_in_another_direction_is_an_act_of_its_own(log, one):
    for index, speed in ((0, 0.1), (0, 0.1), (1, 0.1), (0, -0.1)):
        one.call("~jog", request(MoveRequest, index=index, mvvelo=speed)).answered(True, "jogging")
    assert [line.state for line in log.lines] == ["begins"] * 3


def test_messages_of_another_publisher_are_a_stream_of_its_own(log, one):
    for publisher in ("/cell", "/pad", "/cell", "/pad"):
        message = JointState()
        message._connection_header = dict(HEADER, callerid=publisher)
        one.message("~jog_joints", message)
    assert [(line.state, line.node) for line in log.lines] == [("begins", "/cell"), ("begins", "/pad")]
    one.close_streams()  # at the end of the driver, in the middle of both
    assert [(line.state, line.node, line.messages) for line in log.lines[2:]] == [
        ("has ended", "/cell", 2), ("has ended", "/pad", 2)]


@pytest.mark.parametrize("status, ok, word", [(3, True, "succeeded"), (4, False, "aborted"), (77, False, "77")])
def test_the_end_of_a_goal_is_a_line_with_its_status_and_result(log, one, status, ok, word):
    told = SimpleNamespace(goal_id=SimpleNamespace(id="a goal"), status=status, SUCCEEDED=3, text="it is over")
    one.result("~recover", told, {"done": 1})
    line, = log.lines
    assert (line.kind, line.what, line.goal, line.ok, line.status, line.message, line.result) == (
        "result", "~recover", "a goal", ok, word, "it is over", {"done": 1})


def test_without_a_log_everything_is_served(one):
    none = recorder.Recorder(None)
    none.offers_service("~power")
    none.call("~power", request()).answered(True, "")
    none.event("start")
    none.result("~recover", None, None)
    none.message("~jog_twist", JointState())


def test_a_defect_of_the_recorder_is_not_that_of_a_stop(log, one, monkeypatch, caplog):
    monkeypatch.setattr(recorder, "plain", lambda value: 1 // 0)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1.0))
    served = []
    handlers = SimpleNamespace()
    services = Services(RequestDecoder(load_model("zu7")), handlers, SimpleNamespace(
        answered=lambda *_: None, failed=lambda *_: None), one)
    stop, = [spec for spec in SERVICES if spec.name == "stop_move"]
    handle = services._handler(stop._replace(perform=lambda _, when_sent: when_sent() and served.append(1)
                                             or ServiceOutcome("stopped")))
    handle(request())
    assert served == [1] and [line.getMessage() for line in caplog.records] == ["the audit log lacks a line"] * 2
    caplog.clear()
    one.goal("~recover", SimpleNamespace())
    one.event("motion")
    assert any("lacks a line" in line.getMessage() for line in caplog.records)


@pytest.mark.parametrize("name", ["stop_move", "program/stop"])
@pytest.mark.parametrize("is_sent", [True, False])
def test_a_stop_is_sent_before_its_call_is_recorded(log, one, monkeypatch, name, is_sent):
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1.0))
    seen = []

    def stop(when_sent):
        seen.append([line.kind for line in log.lines])
        if not is_sent:
            raise ConnectionLost("the driver is shut down")
        when_sent()
        seen.append([line.kind for line in log.lines])

    arm = SimpleNamespace(stop=stop, motion_owner=None, run=lambda _: "no program runs")
    services = Services(RequestDecoder(load_model("zu7")), ServiceHandlers(arm, DriverConfig(), None, None, None),
                        SimpleNamespace(answered=lambda *_: None, failed=lambda *_: None), one)
    handle = services._handler(next(spec for spec in SERVICES if spec.name == name))
    with contextlib.suppress(rospy.ServiceException):  # std_srvs/Empty has no field for a failure
        handle(request())
    assert seen == [[], ["call"]][:1 + is_sent]
    assert [(line.kind, line.what, line.node) for line in log.lines] == [
        ("call", "~" + name, "/cell"), ("answer", "~" + name, "/cell")] and log.lines[1].ok == is_sent


def test_the_clients_own_words_stand_there(log, one):
    client_log = logging.getLogger("jaka_ros_driver.client.arm_client")
    level, parent = client_log.level, logging.getLogger("jaka_ros_driver")
    before = parent.level
    parent.setLevel(logging.INFO)
    events = recorder.ClientEvents(one)
    events.begin()
    try:
        client_log.warning("stopping the arm: %s", "protective stop")
        client_log.critical("the driver's core has failed", exc_info=ZeroDivisionError("x"))
        client_log.debug("not this")
        events.handle(logging.makeLogRecord({"msg": "%d and too many", "args": (1, 2), "levelname": "INFO"}))
        logging.getLogger("jaka_ros_driver.ros.node").warning("nor this")
    finally:
        events.end()
        parent.setLevel(before)
    client_log.warning("nothing after its end")
    assert [line.text for line in log.lines][:2] == ["stopping the arm: protective stop",
                                                     "the driver's core has failed: ZeroDivisionError('x')"]
    assert [line.level for line in log.lines] == ["WARNING", "CRITICAL", "INFO"] and level == client_log.level


@pytest.mark.parametrize("value, expected", [
    (math.nan, "nan"), (-math.inf, "-inf"), (1.5, 1.5), (None, None), (True, True), ("x" * 600, "x" * 500 + "... (600 "
     "characters)"), (b"\x00\xff", "00ff (2 bytes)"), (rospy.Time(3, 5), 3.000000005), ((1, 2), [1, 2]),
    (range(100), [*range(32), "... (100 entries)"]), ({"a": {"b": [math.nan]}}, {"a": {"b": ["nan"]}})])
def test_values_are_those_of_json_and_bounded(value, expected):
    assert plain.plain(value) == expected
    json.dumps(plain.plain(value), allow_nan=False)


def test_a_message_of_any_size_becomes_a_small_value():
    points = [JointTrajectoryPoint(positions=[0.1] * 1000)] * 10000
    value = plain.plain(JointTrajectory(joint_names=["joint"] * 500, points=points))
    assert value["points"][-1] == "... (10000 entries)" and len(json.dumps(value)) < 40000
    deep = []
    for _ in range(1000):
        deep = [deep]
    kept = "..."
    for _ in range(8):
        kept = [kept]
    assert plain.plain(deep) == kept


def test_an_address_is_that_of_the_connection_whatever_its_header_says():
    header = {"callerid": "/cell", callers.PEER: "10.9.9.9:1"}
    request = SimpleNamespace(_connection_header=header)
    assert callers.caller_of_request(request) == ("/cell", "")
    callers.note_peer(header, SimpleNamespace(getpeername=lambda: ("10.0.0.7", 4242)))
    assert callers.caller_of_request(request) == ("/cell", "10.0.0.7:4242")
    callers.note_peer(header, SimpleNamespace(getpeername=lambda: ("fe80::1", 4242, 0, 0)))
    assert callers.caller_of_request(request) == ("/cell", "[fe80::1]:4242")
    for gone in (None, SimpleNamespace(getpeername=lambda: "")):
        callers.note_peer(header, gone)
        assert callers.caller_of_request(request) == ("/cell", "")


def test_the_address_of_a_publisher_is_that_of_the_connection_by_which_its_message_came(monkeypatch):
    def connection(host, header):
        return SimpleNamespace(header=header, socket=SimpleNamespace(getpeername=lambda: (host, 4242)))

    subscription = SimpleNamespace(connections=[connection("10.0.0.%d" % number, dict(HEADER)) for number in range(3)])
    manager = SimpleNamespace(get_subscriber_impl=lambda _: subscription)
    monkeypatch.setattr(callers, "get_topic_manager", lambda: manager)
    message = JointState()
    message._connection_header = subscription.connections[1].header
    assert callers.caller_of_message(message, "~jog_joints") == ("/cell", "10.0.0.1:4242")
    message._connection_header = dict(HEADER)
    assert callers.caller_of_message(message, "~jog_joints") == ("/cell", "")


def test_a_name_that_would_steer_a_terminal_is_made_printable():
    message = request()
    message._connection_header = {"callerid": "/a\x1b[2J" + "b" * 1000}
    for host in ("", "10.0.0.7:4242"):
        caller = callers.caller_of_request(message)
        assert caller.node.startswith("/a?[2J") and len(caller.node) <= 200 and caller.host == host
        callers.note_peer(message._connection_header, SimpleNamespace(getpeername=lambda: ("10.0.0.7", 4242)))


def test_each_controller_has_its_folder(monkeypatch):
    monkeypatch.setenv("ROS_HOME", "/ros/home")
    assert setting_up.folder_of(DriverConfig(ip="10.5.5.100")) == "/ros/home/jaka_audit/10.5.5.100_10001"
    monkeypatch.delenv("ROS_HOME")
    monkeypatch.setenv("HOME", "/srv/cell")
    assert setting_up.folder_of(DriverConfig(ip="10.5.5.100")) == "/srv/cell/.ros/jaka_audit/10.5.5.100_10001"
    assert setting_up.folder_of(DriverConfig(ip="arm.lan", audit_dir="~/logs")) == "/srv/cell/logs/arm.lan_10001"
    assert setting_up.audit_log_of(DriverConfig(audit_dir="")) is None
