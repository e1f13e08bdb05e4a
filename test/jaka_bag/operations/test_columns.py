"""Columns that hold what rosbags decodes, message by message."""
import struct

import numpy as np
import pytest
from log_samples import (
    HEADER,
    JOINTS,
    START_NS,
    STATES,
    TOOL,
    Sample,
    connection,
    in_order,
    joints,
    model,
    state_log,
    text,
    write,
)
from rosbags_oracle import decoded, typestore_of

from jaka_bag.errors import BagError, DefinitionError
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.selection import Selection
from jaka_bag.operations.columns import read_columns

SAMPLES = state_log(2.0)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_state_log_in_columns(tmp_path, suffix):
    columns = read_columns(write(tmp_path / ("log" + suffix), SAMPLES))
    store = typestore_of([JOINTS, TOOL, STATES])
    assert sorted(columns) == sorted({s.connection.topic for s in SAMPLES})
    for topic, taken in columns.items():
        own = [s for s in in_order(SAMPLES) if s.connection.topic == topic]
        assert taken.connection == own[0].connection
        assert taken.log_time.tolist() == taken.publish_time.tolist() == [s.time for s in own]
    tools = [decoded(store, TOOL, s.data) for s in in_order(SAMPLES) if s.connection == TOOL]
    fields = columns[TOOL.topic].fields
    assert fields["twist.linear.x"].tolist() == [m.twist.linear.x for m in tools]
    assert fields["twist.angular.z"].tolist() == [m.twist.angular.z for m in tools]
    assert fields["header.stamp"].tolist() == [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in tools]
    assert set(fields["header.frame_id"].tolist()) == {b"base"}
    joint = [decoded(store, JOINTS, s.data) for s in in_order(SAMPLES) if s.connection == JOINTS]
    fields = columns[JOINTS.topic].fields
    assert fields["position"].shape == (len(joint), 6) and fields["velocity"].shape == (len(joint), 0)
    assert np.array_equal(fields["position"], [m.position for m in joint])
    assert fields["name"][5].tolist() == [b"joint_%d" % i for i in range(1, 7)]
    assert columns[STATES.topic].fields["motion_state"].dtype == np.int16


def test_arrays_of_changing_length_are_one_array_a_message(tmp_path):
    lengths = [6, 6, 3, 6, 0, 2, 6]
    samples = [joints(i, START_NS + i, [float(i)] * n, velocity=[0.5] * n) for i, n in enumerate(lengths)]
    columns = read_columns(write(tmp_path / "log.bag", samples))[JOINTS.topic]
    assert columns.fields["position"].dtype == object
    assert [v.tolist() for v in columns.fields["position"]] == [[float(i)] * n for i, n in enumerate(lengths)]
    assert [len(v) for v in columns.fields["name"]] == lengths


def test_strings_of_changing_length_share_a_column(tmp_path):
    words = ["zu7", "", "a longer word", "zu3"]
    columns = read_columns(write(tmp_path / "log.mcap", [model(START_NS + i, w) for i, w in enumerate(words)]))
    assert columns["/model"].fields["data"].tolist() == [w.encode() for w in words]


def test_arrays_of_messages_are_spread_over_their_fields(tmp_path):
    kind = connection("/path", "a/Path", "Header header\nPoint[] points\nduration wait\n" + HEADER
                      + "=" * 80 + "\nMSG: a/Point\nfloat32 x\nint8[2] flags\ntime at\n")

    def path(points):
        data = struct.pack("<III", 1, 2, 3) + text("m") + struct.pack("<I", len(points))
        for x in points:
            data += struct.pack("<f2bII", x, 1, -1, 7, 8)
        return data + struct.pack("<ii", -2, 5)

    regular = [Sample(kind, START_NS + i, path([i, i + 0.5])) for i in range(5)]
    fields = read_columns(write(tmp_path / "regular.bag", regular))["/path"].fields
    assert fields["points.x"].tolist() == [[i, i + 0.5] for i in range(5)]
    assert fields["points.flags"][0].tolist() == [1, -1, 1, -1]
    assert fields["points.at"][0].tolist() == [7 * 10**9 + 8] * 2
    assert fields["wait"].tolist() == [-2 * 10**9 + 5] * 5
    ragged = regular + [Sample(kind, START_NS + 9, path([])), Sample(kind, START_NS + 10, path([4.0]))]
    fields = read_columns(write(tmp_path / "ragged.bag", ragged))["/path"].fields
    assert [len(v) for v in fields["points.x"]] == [2] * 5 + [0, 1]


def test_columns_are_in_the_order_of_time(tmp_path):
    samples = [joints(i, START_NS + (i * 7919) % 1000, [float(i)] * (i % 3)) for i in range(200)]
    columns = read_columns(write(tmp_path / "log.bag", samples, chunk_size=500))[JOINTS.topic]
    expected = in_order(samples)
    assert columns.log_time.tolist() == [s.time for s in expected]
    store = typestore_of([JOINTS])
    assert [v.tolist() for v in columns.fields["position"]] == [
        decoded(store, JOINTS, s.data).position.tolist() for s in expected]


def test_topics_and_times_are_chosen(tmp_path):
    path = write(tmp_path / "log.bag", SAMPLES)
    assert list(read_columns(path, [TOOL.topic])) == [TOOL.topic]
    assert read_columns(path, []) == {}
    late = read_columns(path, [TOOL.topic], Selection(start_time=START_NS + 10**9))[TOOL.topic]
    assert len(late.log_time) == 125
    with pytest.raises(BagError, match="no topic /nope"):
        read_columns(path, ["/nope"])


@pytest.mark.parametrize("data", [b"", bytes(7), bytes(9), struct.pack("<I", 2**31)])
def test_messages_that_do_not_fit_their_definition_are_named(tmp_path, data):
    kind = connection("/t", "a/B", "int16[] values\nint16 last\n")
    for odd in (kind, STATES):
        path = write(tmp_path / ("%s.bag" % odd.datatype[0]), [Sample(odd, START_NS, data)])
        with pytest.raises(DefinitionError):
            read_columns(path)


def test_types_that_cannot_be_decoded_are_named(tmp_path):
    unknown = Connection("/t", "a/B", "0" * 32, "Other other")
    with pytest.raises(DefinitionError, match="lacks a/Other"):
        read_columns(write(tmp_path / "unknown.bag", [Sample(unknown, START_NS, b"")]))
    cbor = Connection("/t", "a.B", "", "int32 x", encoding="cbor", schema_encoding="ros2msg")
    with pytest.raises(DefinitionError, match="encoded as cbor"):
        read_columns(write(tmp_path / "cdr.mcap", [Sample(cbor, START_NS, bytes(4))]))
    two = [Sample(STATES, START_NS, bytes(8)),
           Sample(Connection(STATES.topic, "std_msgs/String", "1" * 32, "string data"), START_NS, text("x"))]
    with pytest.raises(DefinitionError, match="different types"):
        read_columns(write(tmp_path / "two.bag", two))
