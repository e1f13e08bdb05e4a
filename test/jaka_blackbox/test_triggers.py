"""The triggers of the black box in messages: states when they are entered, failed calls, diagnostics, conditions."""
import json
import struct

import pytest
from accident_samples import CALLS, DIAGNOSTICS, STATES, call, diagnostics, states
from log_samples import JOINTS, joints

from jaka_bag.messages.connection import Connection
from jaka_bag.messages.values import ValueReader
from jaka_blackbox.expression import Expression
from jaka_blackbox.triggers import TriggerWatch


@pytest.fixture
def notices():
    return []


@pytest.fixture
def watch(notices):
    return TriggerWatch([], notices.append)


def kinds(triggers):
    return [trigger.kind for trigger in triggers]


def test_a_state_triggers_when_it_is_entered(watch):
    seen = [kinds(watch.look(STATES, states(*values))) for values in (
        (0, 1, 0, 0), (3, 1, 0, 0), (4, 1, 0, 0), (4, 1, 0, 0), (4, 1, 0, 1), (2, 0, 0, 1), (0, 1, 0, 0), (2, 0, 0, 0))]
    assert seen == [[], [], ["error"], [], ["collision"], ["emergency_stop"], [], ["emergency_stop"]]


def test_a_state_that_stands_in_the_first_message_triggers(watch):
    (trigger,) = watch.look(STATES, states(2, 0, 0, 0))
    assert trigger.kind == "emergency_stop" and trigger.topic == STATES.topic and "motion_state is 2" in trigger.detail


def test_failed_calls_trigger_each_time_and_name_the_caller(watch):
    assert not watch.look(CALLS, call("/jaka_driver/joint_move", True))
    for _ in range(2):
        (trigger,) = watch.look(CALLS, call("/jaka_driver/joint_move", False, "out of reach", "/cell"))
        assert trigger.kind == "failed_call"
        assert trigger.detail == "/jaka_driver/joint_move called by /cell failed: out of reach"


def test_diagnostics_trigger_when_a_status_becomes_an_error(watch):
    seen = [kinds(watch.look(DIAGNOSTICS, diagnostics({"a": first, "b": second}))) for first, second in (
        (0, 0), (1, 0), (2, 0), (2, 2), (2, 2), (3, 0), (2, 0))]
    assert seen == [[], [], ["diagnostics"], ["diagnostics"], [], [], ["diagnostics"]]
    assert watch.diagnostics["b"]["level"] == "OK"


def test_conditions_trigger_when_they_become_true_and_look_at_several_topics(notices):
    watch = TriggerWatch([Expression("max(abs(%s.position)) > 2 and %s.power_state" % (JOINTS.topic, STATES.topic))],
                         notices.append)
    assert not watch.look(JOINTS, joints(1, 1, [0.0, -2.5]).data)
    (trigger,) = watch.look(STATES, states(0, 1, 0, 0))
    assert trigger.kind == "expression" and "abs" in trigger.detail
    assert not watch.look(JOINTS, joints(2, 2, [0.0, -2.6]).data)
    assert not watch.look(JOINTS, joints(3, 3, [0.0, 0.0]).data)
    assert kinds(watch.look(JOINTS, joints(4, 4, [0.0, 2.1]).data)) == ["expression"]
    assert not notices


def test_a_condition_on_a_field_that_is_not_there_is_said_once(notices):
    watch = TriggerWatch([Expression("%s.speed > 2" % JOINTS.topic)], notices.append)
    for _ in range(3):
        assert not watch.look(JOINTS, joints(1, 1, [3.0]).data)
    (line,) = notices
    assert "no field speed" in line and "position" in line


def test_damaged_messages_are_said_once_and_hurt_nothing(watch, notices):
    for _ in range(3):
        assert not watch.look(STATES, b"\x01")
    assert len(notices) == 1
    odd = Connection("/jaka_driver/robot_states", "jaka_msgs/RobotMsg", "0" * 32, "nonsense")
    assert not watch.look(odd, b"")
    assert len(notices) == 2


@pytest.mark.parametrize("definition, raw", [
    ("string[] status\n", struct.pack("<II", 1, 2) + b"ab"),
    ("S[] status\n" + "=" * 80 + "\nMSG: diagnostic_msgs/S\nint32 level\n", struct.pack("<Ii", 1, 2)),
    ("int32 status\n", struct.pack("<i", 2)),
])
def test_a_definition_of_the_publishers_own_is_said_once_and_ends_no_watch(watch, notices, definition, raw):
    own = Connection(DIAGNOSTICS.topic, DIAGNOSTICS.datatype, "*", definition, "/odd")
    for _ in range(3):
        assert not watch.look(own, raw)
    (line,) = notices
    assert "%s is not watched for triggers" % DIAGNOSTICS.topic in line
    assert kinds(watch.look(DIAGNOSTICS, diagnostics({"a": 2}))) == ["diagnostics"]


def test_diagnostics_of_odd_types_are_kept_as_text(watch):
    own = Connection(DIAGNOSTICS.topic, DIAGNOSTICS.datatype, "*", "S[] status\n" + "=" * 80
                     + "\nMSG: diagnostic_msgs/S\nuint8 level\nint32 name\n"
                     "uint8[] message\ntime hardware_id\nP[] values\n" + "=" * 80
                     + "\nMSG: diagnostic_msgs/P\nint32 key\nuint8[] value\n", "/odd")
    raw = struct.pack("<IBiIBIIIiIB", 1, 2, 7, 1, 65, 0, 0, 1, 3, 1, 66)
    assert kinds(watch.look(own, raw)) == ["diagnostics"]
    (name, status), = watch.diagnostics.items()
    assert name == "7" and json.loads(json.dumps(status)) == status and status["values"].keys() == {"3"}


@pytest.mark.parametrize("connection", [STATES, CALLS])
def test_states_and_calls_of_odd_types_end_no_watch(watch, connection):
    fields = "".join("string[] %s\n" % name for name in ("motion_state", "collision_state", "success"))
    own = connection._replace(md5sum="*", definition=fields)
    raw = (struct.pack("<II", 1, 2) + b"ab") * 2 + struct.pack("<I", 0)
    for _ in range(2):
        watch.look(own, raw)
    assert kinds(watch.look(STATES, states(2, 0, 0, 0))) == ["emergency_stop"]
    assert kinds(watch.look(CALLS, call("/jaka_driver/joint_move", False))) == ["failed_call"]


def test_values_of_every_kind_are_read():
    kinds_of = ("bool a\nint8 b\nuint64 c\nfloat32 d\nstring e\ntime f\nduration g\nuint8[] h\nint16[2] i\nstring[] j\n"
                "Inner k\nInner[] l\n" + "=" * 80 + "\nMSG: pkg/Inner\nfloat64 x\n")
    raw = (struct.pack("<?bQf", True, -3, 1 << 63, 0.5) + struct.pack("<I", 2) + b"hi"
           + struct.pack("<IIii", 1, 5, -1, 0)
           + struct.pack("<I", 3) + b"abc" + struct.pack("<hh", -1, 7) + struct.pack("<II", 1, 1) + b"z"
           + struct.pack("<d", 2.5) + struct.pack("<Id", 1, -1.0))
    values = ValueReader(Connection("/t", "pkg/Outer", "", kinds_of)).read(raw)
    assert values == {"a": True, "b": -3, "c": 1 << 63, "d": 0.5, "e": "hi", "f": pytest.approx(1.000000005), "g": -1.0,
                      "h": b"abc", "i": [-1, 7], "j": ["z"], "k": {"x": 2.5}, "l": [{"x": -1.0}]}
