"""Bytes and text of the protocol; the layouts are those that foxglove-sdk 0.30 was seen to send and to take."""
import json
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_bag.errors import ProtocolError
from jaka_bag.messages.connection import Connection
from jaka_foxglove import protocol

SEEN_STATE = b"\x05\x00M\x00\x00\x00\x00\x00\x00\x00\x00\x00\xc0?\x01\x03\x00\x00\x00abc"
"""Bytes from foxglove-sdk: playing, at 77 ns, speed 1.5, after a seek, in answer to the request abc."""
TAKEN_CONTROL = bytes([3, 0]) + struct.pack("<fBQI", 1.5, 1, 10**18 + 5, 3) + b"abc"
"""Bytes that foxglove-sdk reads as: play, speed 1.5, seek to 10**18 + 5 ns, request abc."""


def test_what_is_sent_has_the_layout_of_the_specification():
    assert protocol.message_data(7, 1 << 40, b"xyz") == b"\x01" + struct.pack("<IQ", 7, 1 << 40) + b"xyz"
    assert protocol.time_data(5) == b"\x02" + struct.pack("<Q", 5)
    assert protocol.call_response(1, 2, "ros1", b"r") == b"\x03" + struct.pack("<III", 1, 2, 4) + b"ros1r"
    assert protocol.playback_state(protocol.PLAYING, 77, 1.5, True, "abc") == SEEN_STATE
    info = json.loads(protocol.server_info("n", ["time"], "s", (), {}, (1_500_000_000, 2_000_000_001)))
    assert info == {"op": "serverInfo", "name": "n", "capabilities": ["time"], "sessionId": "s",
                    "dataStartTime": {"sec": 1, "nsec": 500_000_000}, "dataEndTime": {"sec": 2, "nsec": 1}}


def test_what_viewers_send_is_understood():
    assert protocol.parse_binary(TAKEN_CONTROL) == protocol.PlaybackControl(True, 1.5, 10**18 + 5, "abc")
    assert protocol.parse_binary(b"\x02" + struct.pack("<III", 1, 2, 4) + b"ros1pay") == protocol.ServiceCall(
        1, 2, "ros1", b"pay")
    cases = {
        '{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}': protocol.Subscribe(((0, 3),)),
        '{"op":"unsubscribe","subscriptionIds":[0,1]}': protocol.Unsubscribe((0, 1)),
        '{"op":"getParameters","parameterNames":["/a"],"id":"x"}': protocol.GetParameters(("/a",), "x"),
        '{"op":"setParameters","parameters":[{"name":"/a","value":1}]}': protocol.SetParameters(("/a",), None),
        '{"op":"subscribeParameterUpdates","parameterNames":[]}': protocol.WatchParameters((), True),
        '{"op":"unsubscribeConnectionGraph"}': protocol.WatchGraph(False),
    }
    for text, request in cases.items():
        assert protocol.parse_text(text) == request
    for text in ('{"op":"advertise","channels":[]}', '{"op":"fetchAsset","uri":"package://x","requestId":1}'):
        assert isinstance(protocol.parse_text(text), protocol.Refused)


WRONG_TEXTS = [
    "", "nonsense", "[]", "null", "{}", '{"op":1}', '{"op":["subscribe"]}', '{"op":"zzz"}', '{"op":"subscribe"}',
    '{"op":"subscribe","subscriptions":7}', '{"op":"subscribe","subscriptions":[7]}',
    '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}',
    '{"op":"subscribe","subscriptions":[{"id":true,"channelId":1}]}',
    '{"op":"subscribe","subscriptions":[{"id":1,"channelId":4294967296}]}',
    '{"op":"subscribe","subscriptions":[{"id":1,"channelId":%s}]}' % ("9" * 400000),
    '{"op":"unsubscribe","subscriptionIds":["1"]}', '{"op":"getParameters","parameterNames":[1]}',
    '{"op":"getParameters","parameterNames":["%s"]}' % ("a" * 1001),
    '{"op":"getParameters","parameterNames":[],"id":1}',
    '{"op":"setParameters","parameters":[{"value":1}]}', "[" * 100000]


@pytest.mark.parametrize("text", WRONG_TEXTS, ids=lambda text: text[:50])
def test_text_that_is_none_of_it_is_refused(text):
    with pytest.raises(ProtocolError):
        protocol.parse_text(text)


@pytest.mark.parametrize("data", [
    b"", b"\x00", b"\x09zz", b"\x03\x07", TAKEN_CONTROL[:-1], TAKEN_CONTROL + b"x",
    b"\x03\x02" + TAKEN_CONTROL[2:], TAKEN_CONTROL[:-3] + b"\xff\xff\xff", b"\x02" + struct.pack("<III", 1, 2, 999),
    b"\x02" + struct.pack("<III", 1, 2, 4) + b"\xff\xff\xff\xff"])
def test_bytes_that_are_none_of_it_are_refused(data):
    with pytest.raises(ProtocolError):
        protocol.parse_binary(data)


@given(st.one_of(st.binary(max_size=60), st.binary(max_size=60).map(lambda rest: b"\x02" + rest),
                 st.binary(max_size=60).map(lambda rest: b"\x03" + rest)))
def test_any_bytes_are_understood_or_refused(data):
    try:
        protocol.parse_binary(data)
    except ProtocolError:
        pass


JSON = st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
                    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
                    max_leaves=8)
OPS = ["subscribe", "unsubscribe", "getParameters", "setParameters", "subscribeParameterUpdates"]
KEYS = ["subscriptions", "subscriptionIds", "parameterNames", "parameters", "id"]


@given(st.sampled_from(OPS), st.dictionaries(st.sampled_from(KEYS), JSON))
def test_any_fields_are_understood_or_refused(op, fields):
    try:
        protocol.parse_text(json.dumps({"op": op, **fields}))
    except ProtocolError:
        pass


def test_schemas_are_text_or_base64():
    ros = Connection("/a", "std_msgs/String", "", "string data # \u00b0\n")
    assert protocol.channel_of(1, ros) == protocol.Channel(
        1, "/a", "ros1", "std_msgs/String", ros.definition, "ros1msg")
    raw = bytes([0xde, 0xad, 0xbe, 0xef])
    binary = Connection("/b", "my.Type", "", raw.decode("utf-8", "surrogateescape"), encoding="protobuf",
                        schema_encoding="protobuf")
    assert protocol.channel_of(2, binary).schema == "3q2+7w=="
    broken = ros._replace(definition=b"string s # \xff\n".decode("utf-8", "surrogateescape"))
    assert protocol.channel_of(3, broken).schema == "string s # \ufffd\n"
    nothing = Connection("/c", "", encoding="json", schema_encoding="")
    assert "schemaEncoding" not in json.loads(protocol.advertise([protocol.channel_of(4, nothing)]))["channels"][0]


def test_parameters_are_what_json_can_hold():
    class Binary:
        data = b"\x00\xff"
    tree = {"a": {"b": 1, "c": 2.0, "empty": {}}, "list": [1.0, 2.5], "mixed": [1, "x", {"y": float("nan")}],
            "nan": float("inf"), "raw": Binary()}
    found = json.loads(protocol.parameter_values(protocol.parameters_of("/", tree), "q"))
    assert found["id"] == "q" and found["parameters"] == [
        {"name": "/a/b", "value": 1}, {"name": "/a/c", "value": 2.0, "type": "float64"},
        {"name": "/a/empty", "value": {}},
        {"name": "/list", "value": [1.0, 2.5], "type": "float64_array"},
        {"name": "/mixed", "value": [1, "x", {"y": "nan"}]}, {"name": "/nan", "value": "inf"},
        {"name": "/raw", "value": "AP8=", "type": "byte_array"}]
    assert json.loads(protocol.parameter_values([protocol.Parameter("/gone", None)], None)) == {
        "op": "parameterValues", "parameters": [{"name": "/gone"}]}
