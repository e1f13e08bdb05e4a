"""Status frames: their text and their fields."""
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_ros_driver.errors import StatusFrameError
from jaka_ros_driver.protocol import status
from jaka_ros_driver.protocol.framing import FrameStream
from jaka_ros_driver.protocol.status import encode_frame, parse_status
from jaka_ros_driver.state import BusTerminals, FieldBus, IoBank, MotionState

ESSENTIAL = {"joint_actual_position": [10.0, 90.0, -90.0, 90.0, 90.0, 0.0], "powered_on": 1, "enabled": True,
             "inpos": True, "emergency_stop": 0, "protective_stop": 0}
FULL = dict(
    ESSENTIAL, drag_status=False, errcode="0x0", errmsg="",
    monitor_data=[12338, 12593, 36.5, 41.2, 0.86, [[0.4, 48.0, 31.0 + n, 0.0, 0.2] for n in range(6)]],
    actual_position=[-132.40112, 310.77345, 402.00018, 180.0, 0.0, -90.0], din=[0, 1], dout=[1, 0], ain=[0.5],
    aout=[1.5], tio_din=[0] * 8, tio_dout=[1] * 8, tio_ain=[474.0, 0.0], interp_state=0, paused=False, rapidrate=0.5,
    current_tool_id=2, current_user_id=1, on_soft_limit=0, curr_tcp_trans_vel=12.5)

FLAGS = ("powered_on", "enabled", "inpos", "emergency_stop", "protective_stop", "drag_status", "paused",
         "on_soft_limit")


@given(st.dictionaries(st.text(max_size=10), st.text(max_size=300) | st.integers(), max_size=30))
def test_len_is_the_exact_size_of_the_text_and_comes_first(fields):
    frame = encode_frame(fields)
    assert frame.startswith(b'{"len": ')
    assert json.loads(frame)["len"] == len(frame)
    assert {k: v for k, v in json.loads(frame).items() if k != "len"} == {k: v for k, v in fields.items() if k != "len"}


@pytest.mark.parametrize("size", [*range(70, 100), *range(960, 1000), *range(9950, 10000)])
def test_len_is_exact_where_its_own_digits_grow(size):
    frame = encode_frame({"a": "x" * size})
    assert json.loads(frame)["len"] == len(frame)


def test_fields_become_si_units():
    state = parse_status(FULL, 12.0)
    assert state.joint_position == pytest.approx([math.radians(q) for q in FULL["joint_actual_position"]])
    assert state.tcp_position == pytest.approx((-0.13240112, 0.31077345, 0.40200018))
    assert state.tcp_rpy == pytest.approx((math.pi, 0.0, -math.pi / 2))
    assert state.tcp_speed == pytest.approx(0.0125)
    assert (state.tool_id, state.user_frame_id, state.rapid_rate, state.received_at) == (2, 1, 0.5, 12.0)
    assert state.io.digital_outputs[IoBank.TOOL] == (1,) * 8
    assert state.io.analog_inputs[IoBank.CABINET] == (0.5,)
    assert (state.cabinet_temperature, state.joint_temperature) == (36.5, (31.0, 32.0, 33.0, 34.0, 35.0, 36.0))


def test_measured_and_commanded_joints_and_velocities_are_kept_apart_and_become_si_units():
    state = parse_status(dict(FULL, joint_position=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
                              instVel=[-9.0, 18.0, 0.0, 36.0, 0.5, 180.0]), 0.0)
    assert state.joint_position == pytest.approx([math.radians(q) for q in FULL["joint_actual_position"]])
    assert state.joint_position_commanded == pytest.approx([math.radians(q) for q in range(1, 7)])
    assert state.joint_velocity == pytest.approx([math.radians(v) for v in (-9.0, 18.0, 0.0, 36.0, 0.5, 180.0)])


def test_currents_relays_and_field_buses_are_read_each_from_its_place():
    rows = [[0.1 * n, 48.0, 31.0, 0.0, 0.2] for n in range(6)]
    state = parse_status(dict(
        FULL, monitor_data=[12338, 12593, 36.5, 41.2, 0.86, rows], relay_io=[0, 1], mb_slave_din=[1], mb_slave_dout=[0],
        mb_slave_ain=[7], mb_slave_aout=[8.5], pn_dev_dout=[1, 1], eip_adpt_ain=[3]), 0.0)
    assert state.joint_current == pytest.approx((0.0, 0.1, 0.2, 0.3, 0.4, 0.5))
    assert state.io.relays == (0, 1)
    assert state.io.field_buses == {
        FieldBus.MODBUS_SLAVE: BusTerminals((1,), (0,), (7,), (8.5,)),
        FieldBus.PROFINET_SLAVE: BusTerminals(digital_outputs=(1, 1)),
        FieldBus.ETHERNET_IP_SLAVE: BusTerminals(analog_inputs=(3,))}


CONTACT, RAW, SILENT = [1.0, -2.0, 3.5, 0.1, 0.2, -0.3], [2.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0] * 6
SETUP = [0, ["192.168.2.100", 8080], [0.449, [0.0, 0.0, 20.0]]]


@pytest.mark.parametrize("told, wrench, error", [
    ([0, 0, CONTACT, RAW], tuple(CONTACT), 0), ([0, 0, CONTACT, RAW, SILENT], tuple(CONTACT), 0),
    ([0, 0, SILENT, RAW], tuple(SILENT), 0), ([0, 0, SILENT, SILENT], None, 0),
    ([1, 0, SILENT, SILENT, SILENT], None, 0), ([0, 17, CONTACT, RAW], None, 17)])
def test_a_sensor_is_there_where_any_reading_is_not_zero_and_its_error_silences_it(told, wrench, error):
    state = parse_status(dict(FULL, torqsensor=[SETUP, told]), 0.0)
    assert (state.wrench, state.sensor_error) == (wrench, error)


@pytest.mark.parametrize("sensor", [
    None, 5, "x", [], [SETUP], [SETUP, 7], [SETUP, [0, 0, CONTACT]], [SETUP, [0, 0, CONTACT[:5], RAW]],
    [SETUP, [0, 0, ["x"] * 6, RAW]], [SETUP, [0, 0, [float("nan")] * 6, RAW]], [SETUP, [0, 0, RAW, [1e300] * 6]]],
    ids=repr)
def test_a_sensor_of_unknown_shape_is_none(sensor):
    assert parse_status(dict(FULL, torqsensor=sensor), 0.0).wrench is None


@pytest.mark.parametrize("key", ["relay_io", "mb_slave_din", "eip_adpt_aout"])
@pytest.mark.parametrize("value", [None, 5, "x", {}, ["x"], [None], [float("inf")], [[1]]], ids=repr)
def test_what_no_real_controller_has_confirmed_costs_no_frame(key, value):
    io = parse_status(dict(FULL, **{key: value}), 0.0).io
    assert io.relays == () and all(not any(bus) for bus in io.field_buses.values())


@pytest.mark.parametrize("key, field", [
    ("powered_on", "is_powered"), ("enabled", "is_enabled"), ("inpos", "is_in_position"),
    ("emergency_stop", "emergency_stop"), ("protective_stop", "protective_stop"), ("drag_status", "is_hand_guided"),
    ("paused", "is_paused"), ("on_soft_limit", "on_soft_limit")])
def test_each_flag_is_read_from_its_own_field(key, field):
    for value in (True, False):
        fields = dict(dict.fromkeys(FLAGS, not value), **{key: value})
        assert getattr(parse_status(dict(FULL, **fields), 0.0), field) is value


def test_what_the_controller_does_not_send_is_unknown():
    state = parse_status(ESSENTIAL, 0.0)
    assert state.tcp_position is None and state.tool_id is None and state.joint_temperature is None
    assert state.io.digital_inputs == {}


@pytest.mark.parametrize("key", sorted(ESSENTIAL))
def test_without_an_essential_field_there_is_no_state(key):
    with pytest.raises(StatusFrameError, match=key):
        parse_status({k: v for k, v in FULL.items() if k != key}, 0.0)


WRONG = [None, "x", [], {}, [1, 2], "NaN", float("nan"), float("inf"), 1e300,
         pytest.param(10 ** 400, id="10**400")]


@pytest.mark.parametrize("key", ["joint_actual_position", "actual_position", "inpos", "powered_on", "enabled",
                                 "emergency_stop", "protective_stop", "rapidrate", "current_tool_id", "din", "aout",
                                 "errcode", "curr_tcp_trans_vel", "paused", "drag_status"])
@pytest.mark.parametrize("value", WRONG, ids=repr)
def test_a_wrong_value_is_refused_or_harmless_and_never_shown(key, value):
    try:
        state = parse_status(dict(FULL, **{key: value}), 0.0)
    except StatusFrameError:
        return
    numbers = state.joint_position + (state.tcp_position or ()) + (state.tcp_rpy or ()) + (state.rapid_rate or 0.0,)
    assert all(math.isfinite(number) for number in numbers)
    assert key not in ESSENTIAL


@pytest.mark.parametrize("joints", [
    [float("nan")] * 6, [1e9] * 6, [0, 0, 0, 0, 0, -1e9], [1, 2, 3, 4, 5, "6"], [1] * 5])
def test_joints_that_cannot_be_are_refused(joints):
    with pytest.raises(StatusFrameError):
        parse_status(dict(FULL, joint_actual_position=joints), 0.0)


def test_nine_joints_of_old_firmware_are_read_as_six():
    state = parse_status(dict(FULL, joint_actual_position=[1.0] * 6 + [0.0] * 3), 0.0)
    assert len(state.joint_position) == 6


@pytest.mark.parametrize("text, code, is_fault", [
    ("0x0", 0, False), ("0", 0, False), (0, 0, False), ("0x10f0005", 0x10F0005, False), ("0x10FFFFF", 0x10FFFFF, False),
    ("0xf0034", 0xF0034, True), ("0x309082", 0x309082, True), ("0x1100000", 0x1100000, True)])
def test_info_events_are_not_faults(text, code, is_fault):
    state = parse_status(dict(FULL, errcode=text), 0.0)
    assert (state.error_code, state.has_fault) == (code, is_fault)


@pytest.mark.parametrize("fields, expected", [
    ({}, MotionState.STOPPED),
    ({"inpos": False}, MotionState.RUNNING),
    ({"interp_state": 3}, MotionState.RUNNING),
    ({"drag_status": True}, MotionState.RUNNING),
    ({"paused": True}, MotionState.PAUSED),
    ({"interp_state": 2, "inpos": False}, MotionState.PAUSED),
    ({"protective_stop": 1}, MotionState.ERROR),
    ({"errcode": "0xf0017", "inpos": False}, MotionState.ERROR),
    ({"errcode": "0x10f0005"}, MotionState.STOPPED),
    ({"emergency_stop": 1, "protective_stop": 1, "errcode": "0x309082"}, MotionState.EMERGENCY_STOP)])
def test_motion_state_names_the_worst_condition(fields, expected):
    assert parse_status(dict(FULL, **fields), 0.0).motion_state is expected


@pytest.mark.parametrize("value, expected", [(True, True), (1, True), ("1", True), ("True", True), (False, False),
                                             (0, False), ("0", False), ("false", False)])
def test_flags_come_in_several_writings(value, expected):
    assert parse_status(dict(FULL, enabled=value), 0.0).is_enabled is expected


def test_a_frame_captured_from_a_real_controller_is_understood(root):
    # Client and simulator share this codec and would agree on a shared mistake; a real arm would not.
    text = (root / "test" / "data" / "frames" / "zu5s_1.5.14.json").read_bytes()
    fields, = FrameStream().feed(text)
    assert fields["len"] == len(text) == 3208
    assert encode_frame(fields) == text
    state = parse_status(fields, 1.0)
    assert state.joint_position[0] == pytest.approx(math.radians(-263.40236))
    assert state.tcp_position == pytest.approx((-0.04997239, -0.61224783, 0.40447777))
    assert (state.is_powered, state.is_enabled, state.is_in_position) == (False, False, True)
    assert (state.tool_id, state.user_frame_id, state.motion_state) == (0, 1, MotionState.STOPPED)
    assert state.joint_temperature == (28.0, 28.0, 27.0, 28.0, 28.0, 28.0)
    assert len(state.io.digital_inputs[IoBank.CABINET]) == 135
    assert state.joint_velocity is None and state.motion_line is None
    assert state.joint_current == (0.0,) * 6 and state.wrench is None and state.io.field_buses == {}


PARTS = status._position_part, status._sensor_part, status._steady_part, status._io_part


def afresh(fields):
    """Decode a frame as the first one of a process."""
    known = dict(status._known_arrays)
    for part in PARTS:
        part._known = [], {}
    status._known_arrays.clear()
    try:
        return parse_status(fields, 1.0)
    finally:
        status._known_arrays.update(known)


ANYTHING = {
    **dict.fromkeys(FLAGS, (0, 1, True, False, "1", "false")),
    **dict.fromkeys(("interp_state", "rapidrate", "current_tool_id", "current_user_id", "motion_line", "err_add_line"),
                    (0, 1, 2, 7.0, True)),
    **dict.fromkeys(("din", "dout", "ain", "aout", "tio_din", "tio_dout", "tio_ain", "relay_io", "mb_slave_din",
                     "mb_slave_aout", "pn_dev_dout", "eip_adpt_ain"), ([], [0, 1], [0, 0], [1.5] * 8)),
    "torqsensor": ([SETUP, [0, 0, CONTACT, RAW]], [SETUP, [0, 17, CONTACT, RAW]], [SETUP, 7], 5),
    **dict.fromkeys(("joint_actual_position", "joint_position", "actual_position", "instVel"),
                    ([0.0] * 6, [1.0] * 6, [0, 0, 0, 0, 0, 1e-9], [1.0] * 9, [1e38] * 6, [1.0] * 5, "x")),
    "errcode": ("0x0", "0x2F0006", 5), "errmsg": ("", "x")}


@given(st.lists(st.sampled_from(sorted(ANYTHING)).flatmap(lambda key: st.tuples(st.just(key), st.sampled_from(
    (*ANYTHING[key], None)))), max_size=30))
def test_what_the_frames_before_have_brought_changes_nothing(changes):
    def outcome(decode, fields):
        try:
            return decode(fields)
        except StatusFrameError as error:
            return str(error)
    frames, fields = [], dict(FULL)
    for key, value in changes:
        fields = {name: one for name, one in fields.items() if name != key}
        if value is not None:
            fields[key] = value
        frames.append(fields)
    in_turn = [outcome(lambda fields: parse_status(fields, 1.0), fields) for fields in frames]
    assert in_turn == [outcome(afresh, fields) for fields in frames]


def test_a_list_that_is_changed_in_place_is_decoded_again():
    fields = dict(FULL, din=[0, 1], relay_io=[0])
    assert parse_status(fields, 0.0).io.digital_inputs[IoBank.CABINET] == (0, 1)
    fields["din"][0] = fields["relay_io"][0] = 1
    io = parse_status(fields, 0.0).io
    assert io.digital_inputs[IoBank.CABINET] == (1, 1) and io.relays == (1,)
    fields["joint_actual_position"] = joints = [10.0] * 6
    rests = parse_status(fields, 0.0).joint_position
    assert parse_status(fields, 1.0).joint_position is rests, "an arm at rest is not decoded again"
    joints[5] = 180.0
    assert parse_status(fields, 2.0).joint_position == (*rests[:5], pytest.approx(math.pi))


def test_a_sensor_whose_readings_are_those_of_the_frame_before_is_not_decoded_again(monkeypatch):
    fields = dict(FULL, torqsensor=[SETUP, [0, 0, CONTACT, RAW]])
    assert parse_status(fields, 0.0).wrench == tuple(CONTACT)
    monkeypatch.setattr(status, "_wrench", None)
    assert parse_status(fields, 0.0).wrench == tuple(CONTACT)


def test_every_key_of_a_part_is_one_that_it_reads():
    class Noted(dict):
        def get(self, key, default=None):
            read.add(key)
            return super().get(key, default)
    for part in PARTS:
        read = set()
        part._decode(Noted(FULL))
        assert read == set(part._keys) and len(set(part._keys)) == len(part._keys)
