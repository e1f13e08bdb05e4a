"""The fields of frames and replies: types, ranges, units, clock; what the polled port sends; what is compared."""
import json
import math
import random
import socket
import time

import pytest

from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact, ProbeStage
from jaka_ros_driver.probe.fields import FrameFields, different_types, reply_types, type_of
from jaka_ros_driver.probe.look import HeardFeed, HeardPort, kinematics_facts, listen, look
from jaka_ros_driver.probe.page import page
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.dialect.table import Dialect

KNOWN = frozenset(("joints", "inpos", "errmsg"))


def frame_text():
    options = Options(Dialect.default("1.7.2"), Start.ENABLED)
    return Controller(load_model("zu7"), FIRMWARES["1.7.2"], options, (0.1, 1.4, -1.3, 1.5, 1.6, 0.2)).feed_frame.text()


@pytest.mark.parametrize("value, kind", [
    (None, "null"), (True, "true or false"), (3, "whole number"), (3.0, "number"), ("3", "text"), ({}, "object"),
    ([], "list of 0"), ([1.5] * 6, "list of 6: number"), ([0, 0.5], "list of 2: number"),
    ([0, "a"], "list of 2: text or whole number"), ([[1], [1, 2]], "list of 2: list: whole number"),
    ([None, 1, "a", {}, 1.5], "list of 5: varies")])
def test_a_type_is_told_in_words(value, kind):
    assert type_of(value) == kind


def taken(*frames, known=KNOWN, period=0.03):
    fields = FrameFields(known)
    for number, frame in enumerate(frames):
        fields.take(frame, 100.0 + number * period)
    return fields.facts("%d frames" % len(frames))


def test_a_field_has_its_type_and_its_least_and_greatest_number():
    found = taken({"joints": [0, 1.5], "inpos": True, "errmsg": ""}, {"joints": [-2.5, 1], "inpos": 1, "errmsg": "x"},
                  {"joints": [0, 7.25], "inpos": False})["frame_fields"].value
    assert found == {"joints": ["list of 2: number", -2.5, 7.25], "inpos": ["true or false or whole number", 1, 1],
                     "errmsg": ["text", None, None]}


def test_a_number_that_may_name_the_arm_has_no_range():
    frames = [{"cabinet_no": 20231104, "grows": number, "robot_id": number, "joints": [4.0]} for number in (1, 2)]
    found = taken(*frames)["frame_fields"].value
    assert found == {"cabinet_no": ["whole number", None, None], "grows": ["whole number", 1, 2],
                     "robot_id": ["whole number", None, None], "joints": ["list of 1: number", 4.0, 4.0]}


@pytest.mark.parametrize("per_second, unit", [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns"),
                                              (125.0, "cycles of 8 ms")])
@pytest.mark.parametrize("drift", [0.0, 250.0, -4000.0])
def test_a_clock_is_found_with_its_unit_and_its_drift(per_second, unit, drift):
    chance, fields = random.Random(3), FrameFields(KNOWN)
    for number in range(1000):
        at = 0.03 * number
        value = 7e4 + at * per_second * (1.0 + 1e-6 * drift)
        fields.take({"ctrl_time": value if unit == "s" else int(value), "count": number, "back": -number},
                    500.0 + at + chance.expovariate(1000.0))
    found = fields.facts("1000 frames")
    assert found["frame_clock"].value == "ctrl_time, in %s" % unit
    unsure = float(found["clock_drift"].spread.split()[0])
    assert unsure < 100.0 and found["clock_drift"].value == pytest.approx(drift, abs=max(unsure, 30.0))


@pytest.mark.parametrize("value", [
    lambda n: n, lambda n: 5, lambda n: 3.0 * math.sin(0.01 * n), lambda n: 0.03 * n % 10.0,
    lambda n: 10.0 * (0.03 * n // 10.0), lambda n: "%.2f" % (0.03 * n)])
def test_what_is_no_clock_is_none(value):
    found = taken(*({"field": value(number)} for number in range(1000)))
    assert found["frame_clock"].value == "none" and found["clock_drift"].value is None


def heard(change=lambda frame: None):
    feed = HeardFeed(None)
    frame = json.loads(frame_text())
    change(frame)
    feed.states = [parse_status(frame, 100.0 + number) for number in range(3)]
    return feed


def scaled(angle, length):
    def change(frame):
        frame["joint_actual_position"] = [angle(one) for one in frame["joint_actual_position"]]
        pose = frame["actual_position"]
        frame["actual_position"] = [*(length * one for one in pose[:3]), *(angle(one) for one in pose[3:])]
    return change


@pytest.mark.parametrize("angle, length, units", [
    (float, 1.0, "deg and mm"), (math.radians, 1.0, "rad and mm"), (float, 0.001, "deg and m"),
    (math.radians, 0.001, "rad and m")])
def test_units_are_those_in_which_a_model_fits(angle, length, units):
    found = kinematics_facts(heard(scaled(angle, length)), None, None)
    assert found["units"].value == units
    assert ("zu7" in found["model"].value) == (units == "deg and mm")


@pytest.mark.parametrize("change", [lambda frame: frame.update(current_tool_id=3), scaled(float, 1.5)])
def test_units_are_open_where_no_model_fits_or_the_tool_is_not_known(change):
    found = kinematics_facts(heard(change), None, None)["units"]
    assert found.value is None and found.how


@pytest.mark.parametrize("sent, told", [
    (b"", "nothing"), (frame_text() * 2, "frames"), (b"\x78\x01\x00\xff" * 10, "bytes that are no frames")])
def test_what_the_polled_port_sends_is_told(sent, told):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        port = HeardPort(KeptConnection(ConnectionLog(""), "poll", ours))
        theirs.sendall(sent)
        theirs.shutdown(socket.SHUT_WR)
        listen([port], time.monotonic() + 5.0)
    found = port.fact(1.0)
    assert found.value == told and "%d bytes" % len(sent) in found.how and "closed" in found.how


def test_the_polled_port_is_listened_to_and_sent_nothing():
    with socket.create_server(("127.0.0.1", 0)) as polled, socket.create_server(("127.0.0.1", 0)) as status:
        facts = {}
        log = ConnectionLog("127.0.0.1")
        look(log, facts, status.getsockname()[1], polled.getsockname()[1], 1.0)
        connection, _ = polled.accept()
        with connection:
            connection.settimeout(5.0)
            assert connection.recv(100) == b"", "it sends nothing and closes"
        log.close()
    assert facts["polled_port"].value == "open" and facts["polled_port_sends"].value == "nothing"
    assert "0.5 s" in facts["polled_port_sends"].how


ONE = {"joints": ["list of 6: number", -1.0, 2.0], "inpos": ["true or false", None, None], "old": ["text", None, None]}
OTHER = {"joints": ["list of 7: number", -9.0, 2.0], "inpos": ["true or false", None, None],
         "new": ["whole number", 1, 4]}


def test_types_are_compared_and_ranges_are_not():
    assert different_types("frame_fields", ONE, ONE) == []
    moved = {**ONE, "joints": ["list of 6: whole number", 5, 6]}
    assert different_types("frame_fields", ONE, moved) == [], "a controller may print 5.0 as 5"
    assert different_types("frame_fields", ONE, OTHER) == [
        "joints: list of 6: number and list of 7: number", "new: none and number", "old: text and none"]
    replies = reply_types({"get_version": {"version": "1.7", "errorCode": "0"}})
    newer = reply_types({"get_version": {"version": "1.7", "errorCode": 0}})
    assert different_types("reply_types", replies, newer) == ["errorCode of get_version: text and number"]
    lines = report.difference({"frame_fields": Fact(ONE, "")}, {"frame_fields": Fact(OTHER, "")})
    assert len(lines) == 3 and "old: text and none" in lines[2]
    assert report.difference({"frame_fields": Fact(ONE, "")}, {"frame_fields": Fact(ONE, "later")}) == []


def test_page_and_json_have_the_tables_and_the_text_their_size():
    facts = {"frame_fields": Fact(ONE, "50 frames"), "reply_types": Fact({"get_version": {"<b>": "text"}}, "1 of 18")}
    content = report.as_json(facts, [ProbeStage.LOOK], True)
    assert report.facts_of(json.loads(json.dumps(content))) == facts
    text = page(content, facts)
    assert "<td>joints</td><td>list of 6: number</td>" in text and ">-1<" in text and "&lt;b&gt;" in text
    assert any("3, in probe.html and probe.json" in line for line in report.text(facts))


@pytest.mark.parametrize("name, value", [
    ("frame_fields", 3), ("frame_fields", {"a": "number"}), ("frame_fields", {"a": [1, 2, 3]}),
    ("frame_fields", {"a": ["number", "1", 2]}), ("reply_types", {"a": 3}), ("reply_types", {"a": {"b": 3}})])
def test_a_table_of_another_kind_is_refused_with_its_name(name, value):
    content = {"facts": {name: {"value": value, "how": "x"}}}
    with pytest.raises(report.ReportError, match=name):
        report.facts_of(content)
