"""CDR made by learnt byte maps, equal to what rosbags makes of each message."""
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_samples import (
    BREAK,
    HEADER,
    JOINTS,
    START_NS,
    STATES,
    Sample,
    connection,
    header,
    joints,
    payload,
    state_log,
    text,
    write,
)

from jaka_bag.containers.registry import open_log
from jaka_bag.errors import DefinitionError
from jaka_bag.messages.batch import MessageBatch
from jaka_bag.messages.cdr import CdrConverter, cdr_batch, learn_map
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import parse_definition
from jaka_bag.messages.layout import layout_of
from jaka_bag.messages.ros2_types import Ros2Type, ros2_name

PRIMITIVES = {"bool": "?", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
              "int64": "q", "uint64": "Q", "float32": "f", "float64": "d"}


@st.composite
def typed_messages(draw):
    """Draw a random message definition and messages of it, of few and of many layouts."""
    fields = draw(st.lists(st.tuples(st.sampled_from(sorted(PRIMITIVES) + ["string", "time", "Inner", "Header"]),
                                     st.sampled_from(["", "[]", "[3]"])), min_size=1, max_size=6))
    fields = [(kind, "" if kind == "Header" else array) for kind, array in fields]
    definition = "\n".join("%s%s f%d" % (kind, array, i) for i, (kind, array) in enumerate(fields))
    definition += HEADER + BREAK + "MSG: a/Inner\nuint8 small\nfloat64[] values\nstring name\n"

    def value(kind):
        if kind == "string":
            return text("x" * draw(st.integers(0, 9)))
        if kind == "Header":
            return header(draw(st.integers(0, 99)), draw(st.integers(0, 2**61)), "f" * draw(st.integers(0, 5)))
        if kind == "Inner":
            values = draw(st.lists(st.floats(width=64), max_size=3))
            return struct.pack("<BI%dd" % len(values), 7, len(values), *values) + value("string")
        size = 8 if kind == "time" else struct.calcsize("<" + PRIMITIVES[kind])
        raw = draw(st.binary(min_size=size, max_size=size))
        return bytes([raw[0] & 1]) if kind == "bool" else raw

    def message():
        raw = b""
        for kind, array in fields:
            count = {"": 1, "[3]": 3}.get(array)
            if count is None:
                count = draw(st.integers(0, 4))
                raw += struct.pack("<I", count)
            raw += b"".join(value(kind) for _ in range(count))
        return raw

    made = [message() for _ in range(draw(st.integers(1, 5)))]
    return connection("/t", "a/B", definition), [made[i % len(made)] for i in range(draw(st.integers(1, 30)))]


@given(typed_messages())
def test_cdr_is_that_of_rosbags(tmp_path_factory, typed):
    kind, data = typed
    path = write(tmp_path_factory.mktemp("cdr") / "log.mcap",
                 [Sample(kind, START_NS + i, raw) for i, raw in enumerate(data)])
    oracle = Ros2Type(kind)
    with open_log(path) as reader:
        converters = {0: CdrConverter(kind)}
        made = [payload(block, i) for block in (cdr_batch(b, converters) for b in map(reader.load, reader.chunks))
                for i in range(len(block))]
    assert made == [oracle.to_cdr(raw) for raw in data]


def test_order_and_times_stay_over_several_connections(tmp_path):
    samples = state_log(1.0)
    path = write(tmp_path / "log.bag", samples)
    with open_log(path) as reader:
        converters = {i: CdrConverter(c) for i, c in enumerate(reader.connections)}
        for block in map(reader.load, reader.chunks):
            made = cdr_batch(block, converters)
            assert made.log_time.tolist() == block.log_time.tolist()
            for i in range(len(block)):
                kind = converters[int(block.connection[i])].kind
                assert payload(made, i) == kind.to_cdr(payload(block, i))


def test_a_map_is_few_stretches():
    sample = joints(3, START_NS, [1.0] * 6)
    layout = layout_of(JOINTS.datatype, parse_definition(JOINTS.datatype, JOINTS.definition), sample.data)
    byte_map = learn_map(layout, Ros2Type(JOINTS))
    assert len(byte_map.stretches) < 12
    rows = np.frombuffer(sample.data, np.uint8)[None]
    assert byte_map.apply(rows)[0].tobytes() == Ros2Type(JOINTS).to_cdr(sample.data)


def test_large_messages_are_converted_too(tmp_path):
    image = connection("/image", "a/Image", "uint32 width\nuint8[] data\n")
    data = struct.pack("<II", 5, 20000) + bytes(range(200)) * 100
    path = write(tmp_path / "log.mcap", [Sample(image, START_NS + i, data) for i in range(12)])
    with open_log(path) as reader:
        converters = {0: CdrConverter(image)}
        blocks = [cdr_batch(reader.load(chunk), converters) for chunk in reader.chunks]
    made = [payload(block, i) for block in blocks for i in range(len(block))]
    assert made == [Ros2Type(image).to_cdr(data)] * 12


def test_messages_that_do_not_fit_their_definition_are_named(tmp_path):
    path = write(tmp_path / "log.mcap", [Sample(STATES, START_NS, bytes(7))])
    with open_log(path) as reader, pytest.raises(DefinitionError, match="jaka_msgs/RobotMsg"):
        cdr_batch(next(map(reader.load, reader.chunks)), {0: CdrConverter(STATES)})
    with pytest.raises(DefinitionError, match="does not fit"):
        Ros2Type(JOINTS).to_cdr(bytes(3))


def test_a_definition_without_ros2_form_is_named():
    with pytest.raises(DefinitionError, match="no ROS 2 form"):
        Ros2Type(Connection("/t", "a/B", "0" * 32, "this is no definition"))


def test_names():
    assert ros2_name("sensor_msgs/JointState") == "sensor_msgs/msg/JointState"
    assert ros2_name("tf/tfMessage") == "tf2_msgs/msg/TFMessage"


@pytest.mark.parametrize("definition", ["uint8 A=1\n", "uint8 open=1\nuint8 half_open=2\nduration d=3\n", ""])
def test_types_without_fields_are_converted(definition):
    kind = connection("/gripper", "test_msgs/Gripper", definition)
    none = np.zeros(12, np.int64)
    batch = MessageBatch(np.zeros(0, np.uint8), none, none, none.astype(np.int32), none)
    converter = CdrConverter(kind)
    made = cdr_batch(batch, {0: converter})
    assert len(made) == 12 and (made.length == made.length[0]).all() and int(made.length[0]) >= 4
    assert "open" not in converter.kind.definition


def test_what_is_kept_of_layouts_does_not_grow_with_the_messages():
    log = Connection("/log", "a/Log", definition="string a\nstring b\n")
    converter = CdrConverter(log)
    for first in range(0, 3000, 250):
        raws = [text("x" * (i % 60)) + text("y" * (i // 60)) for i in range(first, first + 250) for _ in range(9)]
        length = np.array(list(map(len, raws)))
        batch = MessageBatch(np.frombuffer(b"".join(raws), np.uint8), np.cumsum(length) - length, length,
                             np.zeros(len(raws), np.int32), np.arange(len(raws)))
        made = converter.convert(batch, np.arange(len(raws)))
        assert sum(len(which) for which, _ in made) == len(raws)
    assert len(converter._seen) <= 512 and len(converter._maps) <= 512
