"""Any JSON value in any field: refused by name, or a value that every message of the driver can hold and show."""
import copy
import dataclasses
import enum
import math
import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import CommandRejected, FramingError, ProtocolError, StatusFrameError
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import parse_object
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.protocol.texts import LONGEST_TEXT, printable, shown
from jaka_ros_driver.state import IoBank

LONGEST_MESSAGE = 1000
WIRE_POSE, WIRE_JOINTS = [400.0, -50.0, 350.0, 180.0, 0.0, 90.0], [10.0, 90.0, -90.0, 90.0, 90.0, 0.0]
POSE, JOINTS = c.Pose((0.4, -0.05, 0.35), (math.pi, 0.0, 1.5)), (0.1, 1.5, -1.5, 1.5, 1.5, 0.0)
FRAME = {
    "joint_actual_position": WIRE_JOINTS, "joint_position": WIRE_JOINTS, "actual_position": WIRE_POSE,
    "instVel": [0.5] * 6, "powered_on": 1, "enabled": True, "inpos": True, "emergency_stop": 0, "protective_stop": 0,
    "drag_status": False, "paused": False, "on_soft_limit": 0, "errcode": "0x0", "errmsg": "", "interp_state": 0,
    "monitor_data": [12338, 12593, 36.5, 41.2, 0.86, [[0.4, 48.0, 31.0 + n, 0.0, 0.2] for n in range(6)]],
    "din": [0, 1], "dout": [1, 0], "ain": [0.5], "aout": [1.5], "tio_din": [0] * 8, "tio_dout": [1] * 8,
    "tio_ain": [474.0, 0.0], "rapidrate": 0.5, "current_tool_id": 2, "current_user_id": 1, "curr_tcp_trans_vel": 12.5,
    "motion_line": 3, "err_add_line": 0}


def nested(depth):  # built from the inside: no recursion
    value = []
    for _ in range(depth):
        value = [value]
    return value


EXTREMES = [1e9, 1e10, 1e39, -1e39, 1.7e308, math.inf, -math.inf, 2 ** 31, 2 ** 63, 10 ** 400, -10 ** 400, 10 ** 4200,
            "\ud800", "\x1b[2J\x00\n", "x" * 100000, "1" * 4000, "1" * 100000, "1e999", "nan", "-inf", "0x" + "f" * 100,
            "\u8b66\u544a", nested(900), {"\udfff": "\ud800"}, [10 ** 400] * 6, [1e39] * 200, ["\ud800"] * 6]
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(st.characters(), max_size=20)
    | st.sampled_from(EXTREMES),
    lambda children: st.lists(children, max_size=8) | st.dictionaries(st.text(max_size=3), children, max_size=3),
    max_leaves=12)


def leaves(value):
    """Return every number and text in a state or a result."""
    if isinstance(value, (tuple, list)):
        for item in value:
            yield from leaves(item)
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(key)
            yield from leaves(item)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name))
    elif value is not None and not isinstance(value, (bool, enum.Enum)):
        yield value


def assert_publishable(thing):
    for leaf in leaves(thing):
        if isinstance(leaf, str):
            assert_fit_for_logs(leaf, LONGEST_TEXT)
        elif isinstance(leaf, int):
            assert -2 ** 32 < leaf < 2 ** 32
        else:
            assert math.isfinite(leaf)
            struct.pack("<f", leaf)


def assert_fit_for_logs(text, longest=LONGEST_MESSAGE):
    assert text.isprintable() and len(text) <= longest
    text.encode("utf-8")


def places(value, path=()):
    """Return every place in a JSON value, as a path of keys and indices."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def with_value_at(fields, path, value):
    changed = copy.deepcopy(fields)
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return changed


def read_frame(fields):
    try:
        state = parse_status(fields, 0.0)
    except StatusFrameError as error:
        assert_fit_for_logs(str(error))
        return
    assert_publishable(state)
    for number in (state.tool_id, state.user_frame_id, state.program_state, state.motion_line):
        struct.pack("<i", number or 0)


FRAME_PLACES = [path for path in places(FRAME) if path]


@pytest.mark.parametrize("value", EXTREMES, ids=lambda value: repr(type(value)))
def test_an_extreme_value_at_any_place_of_a_frame_does_no_harm(value):
    for path in FRAME_PLACES:
        read_frame(with_value_at(FRAME, path, value))


@given(st.sampled_from(FRAME_PLACES), JSON)
@example(("errmsg",), {"a": ["\ud800"]})
def test_any_value_at_any_place_of_a_frame_does_no_harm(path, value):
    read_frame(with_value_at(FRAME, path, value))


IMPOSSIBLE = [
    ("joint_actual_position", [9999.0] + [0.0] * 5), ("joint_actual_position", [0.0] * 5 + [-1081.0]),
    ("joint_position", [0.0] * 5 + [9999.0]), ("actual_position", [2e5, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ("actual_position", [0.0, 0.0, 0.0, 0.0, 0.0, 9999.0]), ("instVel", [9999.0] + [0.0] * 5),
    ("curr_tcp_trans_vel", 1e6), ("rapidrate", -500.0)]


@pytest.mark.parametrize("key, value", IMPOSSIBLE, ids=str)
def test_a_frame_with_a_value_that_no_arm_can_have_is_damaged(key, value):
    parse_status(FRAME, 0.0)
    with pytest.raises(StatusFrameError, match=key):
        parse_status(dict(FRAME, **{key: value}), 0.0)


def test_readings_that_no_sensor_can_have_are_unknown():
    hot = copy.deepcopy(FRAME["monitor_data"])
    hot[2], hot[5][3][2], hot[5][3][0] = 1e6, 1e6, -1e6
    state = parse_status(dict(FRAME, monitor_data=hot, torqsensor=[[], [0, 0, [1e6] * 6, [1.0] * 6, [1.0] * 6]]), 0.0)
    assert state.cabinet_temperature is state.joint_temperature is state.joint_current is state.wrench is None


def test_joints_of_a_reply_that_no_arm_can_have_are_no_result():
    for command, key in ((c.Query.JOINTS, "joint_pos"), (c.InverseKinematics(POSE, JOINTS), "jointPosition")):
        with pytest.raises(ProtocolError):
            codec.decode(command, {"errorCode": "0", key: [9999.0] + [0.0] * 5})


REPLIES = [
    (c.Stop(), {}),
    (c.ForwardKinematics(JOINTS), {"cartPosition": WIRE_POSE}),
    (c.InverseKinematics(POSE, JOINTS), {"jointPosition": WIRE_JOINTS}),
    (c.GetDigitalOutput(IoBank.TOOL, 0), {"value": 1}),
    (c.GetAnalogOutput(IoBank.TOOL, 0), {"value": 4.5}),
    (c.GetDigitalInput(IoBank.TOOL, 0), {"value": 1}), (c.GetAnalogInput(IoBank.TOOL, 0), {"value": 4.5}),
    (c.Query.VERSION, {"version": "1.5.14"}),
    (c.Query.SERVO_MODE, {"in_servomove": True}),
    (c.Query.FEED_PERIOD, {"port10000_delay_ms": "8"}),
    (c.Query.JOINTS, {"joint_pos": WIRE_JOINTS}),
    (c.Query.DRIVES_READY, {"power": "powered_on", "enable": "robot_enabled"}),
    (c.Query.DRIVES_READY, {"power": 1, "enable": True}),
    (c.Query.TOOL_FRAMES, {"tool_offsets": [WIRE_POSE] * 2}),
    (c.Query.USER_FRAMES, {"user_offsets": [WIRE_POSE] * 2}),
    (c.Query.PAYLOAD, {"mass": 1.5, "centroid": [10, 20, 30]}),
    (c.Query.COLLISION_LEVEL, {"sensitivityLevel": 3}),
    (c.Query.COLLISION_LEVEL, {"sensitivityVal": "3"}),
    (c.Query.SIMULATOR_IDENTITY, {"identity": "k3"}),
    (c.Query.LOADED_PROGRAM, {"programName": "weld.jks"}),
    (c.Query.PROGRAM_STATE, {"programState": "idle"}),
    (c.Query.HAND_GUIDING, {"drag_status": 0}),
    (c.Query.HAND_GUIDING, {"status": False}),
]
REPLY_PLACES = [(command, reply, path) for command, fields in REPLIES
                for reply in ({"errorCode": "0", "errorMsg": "", **fields}, {"errorCode": "2", "errorMsg": "no"})
                for path in places(reply) if path]


def test_every_result_is_tried_here():
    assert {command for command, _ in REPLIES if isinstance(command, c.Query)} == set(c.Query)
    assert {type(command) for command, _ in REPLIES} >= set(codec._DECODERS)
    for command, fields in REPLIES:
        codec.decode(command, dict(fields, errorCode="0"))


def read_reply(command, reply):
    try:
        result = codec.decode(command, reply)
    except CommandRejected as error:
        assert_fit_for_logs(str(error))
        assert_publishable((error.code, error.reason))
    except ProtocolError as error:
        assert_fit_for_logs(str(error))
    else:
        assert_publishable(result)
        assert result is None or isinstance(result, (bool, int, float, str, tuple, c.Pose, c.SetPayload))


@pytest.mark.parametrize("value", EXTREMES, ids=lambda value: repr(type(value)))
def test_an_extreme_value_at_any_place_of_a_reply_does_no_harm(value):
    for command, reply, path in REPLY_PLACES:
        read_reply(command, with_value_at(reply, path, value))


@given(st.sampled_from(REPLY_PLACES), JSON)
def test_any_value_at_any_place_of_a_reply_does_no_harm(place, value):
    command, reply, path = place
    read_reply(command, with_value_at(reply, path, value))


@pytest.mark.parametrize("text", ["Infinity", "1e999", "-1e999", "1" * 500, "1" * 50000, "\"\\ud800\"", "[" * 5000],
                         ids=lambda text: text[:12])
def test_extremes_as_the_wire_writes_them(text):
    try:
        fields = parse_object(b'{"value": %s, "errorCode": "0"}' % text.encode("ascii"))
    except FramingError as error:
        assert_fit_for_logs(str(error))
        return
    with pytest.raises(ProtocolError):
        codec.decode(c.GetAnalogOutput(IoBank.TOOL, 0), fields)
    with pytest.raises(StatusFrameError):
        parse_status(dict(FRAME, ain=[fields["value"]]), 0.0)


@pytest.mark.parametrize("said, kept", [
    ("call stop failed", "call stop failed"), ("\u8b66\u544a 3", "\u8b66\u544a 3"), ("a\ud800b", "a?b"),
    ("a\r\nb", "a  b"), ("\x1b[31mred\x07", "?[31mred?"), ("\u3000x", " x"), ("", ""), ("x" * 500, "x" * 500),
    ("x" * 501, "x" * 497 + "...")])
def test_texts_keep_what_can_be_printed(said, kept):
    assert printable(said) == kept
    assert parse_status(dict(FRAME, errmsg=said), 0.0).error_message == kept
    assert codec.decode(c.Query.VERSION, {"errorCode": 0, "version": said}) == kept
    with pytest.raises(CommandRejected) as caught:
        codec.decode(c.Stop(), {"errorCode": "2", "errorMsg": said or "refused by the controller"})
    assert caught.value.reason == (kept or "refused by the controller")


def test_values_are_shown_as_far_as_they_can_be():
    assert shown({"a": "\ud800\n"}) == r"{'a': '\ud800\n'}"
    assert shown(nested(100000)) == "a list that cannot be written"
    assert shown([1] * 1000, 10) == "[1, 1, ..."
