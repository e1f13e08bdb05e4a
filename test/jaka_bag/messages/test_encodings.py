"""Logs of other encodings, and rosbag2 folders, in every command that reads fields: the values are those of the log."""
import base64
import csv
import json
import math
import struct
import sys

import numpy as np
import pytest
from hostile_logs import doubling
from log_samples import BREAK, JOINTS, START_NS, STATES, TOOL, in_order, read, state_log, write
from rosbags import rosbag2

from jaka_bag.cli.main import main
from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.errors import BagError, DefinitionError
from jaka_bag.live.log_source import LogSource
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.encodings import as_ros1
from jaka_bag.messages.values import ValueReader
from jaka_bag.operations.columns import read_columns

SAMPLES = state_log(2.0)
SCHEMA = {
    "type": "object", "required": ["count", "on", "time", "blob"], "definitions": {
        "point": {"type": "object", "properties": {"x": {"type": "number"}, "y": {"type": "number"}}}},
    "properties": {
        "count": {"type": "integer"}, "speed": {"type": "number"}, "on": {"type": "boolean"},
        "name": {"type": "string"},
        "time": {"type": "object", "required": ["sec"], "properties": {"sec": {"type": "integer"}}},
        "values": {"type": "array", "items": {"type": "number"}}, "at": {"$ref": "#/definitions/point"},
        "path": {"type": "array", "items": {"$ref": "#/definitions/point"}}, "some": {"type": ["integer", "null"]},
        "blob": {"type": "string", "contentEncoding": "base64"}, "any": {}, "self": {"$ref": "#"}}}


@pytest.fixture(name="bag")
def a_bag(tmp_path):
    return write(tmp_path / "log.bag", SAMPLES)


def as_folder(bag, folder, storage):
    """Return the messages of a bag as a rosbag2 folder of a storage, made by this package or by rosbags."""
    assert main(["convert", str(bag), "-o", str(folder), "--profile", "ros2", "-q"]) == 0
    if storage == "mcap":
        return folder
    if not hasattr(rosbag2, "StoragePlugin"):
        pytest.skip("this rosbags writes no sqlite3 of these types")
    other = folder.with_name(folder.name + "_sqlite3")
    with rosbag2.Reader(folder) as reader, rosbag2.Writer(
            other, version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer:
        connections = {c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, rihs01=c.digest,
                                                   offered_qos_profiles=c.ext.offered_qos_profiles)
                       for c in reader.connections}
        for c, time, raw in reader.messages():
            writer.write(connections[c.id], time, raw)
    return other


def columns_without_seq(path):
    found = {}
    for topic, columns in read_columns(path).items():
        found[topic] = (columns.connection.datatype, columns.connection.md5sum, columns.log_time.tolist(), {
            name: np.asarray(values).tolist() for name, values in columns.fields.items() if name != "header.seq"})
    return found


def lone_mcap(folder):
    return next(folder.glob("*.mcap"))


def test_the_fields_of_cdr_are_those_of_the_bag_that_it_was_made_of(tmp_path, bag):
    folder = as_folder(bag, tmp_path / "folder", "mcap")
    expected = columns_without_seq(bag)
    assert set(expected) == {JOINTS.topic, TOOL.topic, STATES.topic, "/model"}
    assert columns_without_seq(lone_mcap(folder)) == expected
    assert columns_without_seq(folder) == expected
    assert columns_without_seq(as_folder(bag, tmp_path / "again", "sqlite3")) == expected


@pytest.mark.parametrize("kind", ["lone", "mcap", "sqlite3"])
def test_every_reading_command_takes_logs_of_ros_2(tmp_path, bag, capsys, kind):
    folder = as_folder(bag, tmp_path / "folder", kind.replace("lone", "mcap"))
    log = str(lone_mcap(folder) if kind == "lone" else folder)
    assert main(["cat", log, "-t", STATES.topic, "-l", "1"]) == 0
    assert json.loads(capsys.readouterr().out)["message"]["power_state"] == 1
    assert main(["export", log, "-o", str(tmp_path / "t.csv"), "-q"]) == 0
    table = next(path for path in tmp_path.glob("*.csv") if "robot_states" in path.name)
    with table.open() as file:
        rows = list(csv.DictReader(file))
    expected = [s for s in SAMPLES if s.connection is STATES]
    assert [int(row["motion_state"]) for row in rows] == [struct.unpack("<4h", s.data)[0] for s in expected]
    assert main(["plot", log, "-o", str(tmp_path / "plot.svg"), "-q"]) == 0
    assert main(["compare", log, log]) == 0
    capsys.readouterr()
    made = str(tmp_path / "made.bag")
    for words in (["convert", log, "-o", made], ["filter", log, made, "-t", STATES.topic, "--force"],
                  ["merge", log, "-o", made, "--force"] if kind != "lone" else ["convert", log, "-o", made, "--force"]):
        assert main([*words, "-q"]) == 0, words
        found = [s for s in read(made) if s.connection.topic == STATES.topic]
        assert [(s.time, s.data, s.connection.md5sum) for s in found] == [
            (s.time, s.data, STATES.md5sum) for s in in_order(expected)], words
    source = LogSource([log])
    try:
        assert {c.encoding for c in source.connections} == {"ros1"}
        assert {c.topic for c in source.connections} == {JOINTS.topic, TOOL.topic, STATES.topic, "/model"}
    finally:
        source.close()


def test_a_latched_topic_stays_latched_on_the_way_from_ros_2(tmp_path, bag):
    folder = as_folder(bag, tmp_path / "folder", "mcap")
    for log in (folder, lone_mcap(folder)):
        assert main(["convert", str(log), "-o", str(tmp_path / "made.bag"), "--force", "-q"]) == 0
        with open_log(tmp_path / "made.bag") as reader:
            assert {c.topic for c in reader.connections if c.latching} == {"/model"}


def json_log(path, messages, schema=SCHEMA):
    with McapWriter(path, profile="") as writer:
        channel = writer.add_channel(Connection("/j", "Some.Thing", definition=json.dumps(schema), encoding="json",
                                                schema_encoding="jsonschema"))
        for number, message in enumerate(messages):
            writer.add_message(channel, START_NS + number, json.dumps(message).encode())
    return path


def test_json_with_a_schema_becomes_columns(tmp_path):
    first = {"count": 3, "speed": 1.5, "on": True, "name": "zu7", "time": {"sec": 9}, "values": [1, 2.5],
             "at": {"x": 1, "y": 2}, "path": [{"x": 5, "y": 6}], "some": 7, "blob": base64.b64encode(b"ab").decode(),
             "any": {"k": [1]}, "self": {"count": 1}}
    second = {"count": -4, "on": False, "time": {"sec": 1}, "blob": "", "some": None}
    path = json_log(tmp_path / "j.mcap", [first, second])
    fields = read_columns(path)["/j"].fields
    assert fields["count"].tolist() == [3, -4] and fields["on"].tolist() == [True, False]
    assert fields["speed"][0] == 1.5 and math.isnan(fields["speed"][1])
    assert fields["some"][0] == 7 and math.isnan(fields["some"][1])
    assert fields["time.sec"].tolist() == [9, 1] and list(fields["name"]) == [b"zu7", b""]
    assert [list(values) for values in fields["values"]] == [[1, 2.5], []]
    assert fields["at.x"][0] == 1 and math.isnan(fields["at.x"][1])
    assert [list(values) for values in fields["path.y"]] == [[6], []]
    assert json.loads(fields["any"][0]) == {"k": [1]} and json.loads(fields["self"][0]) == {"count": 1}
    assert main(["export", str(path), "-o", str(tmp_path / "out.npz"), "-q"]) == 0
    assert main(["compare", str(path), str(path)]) == 0


def test_json_types_and_fields_whose_names_meet_keep_their_own_values():
    number = {"type": "number"}
    schema = {"type": "object", "properties": {
        "tool": {"type": "object", "properties": {"force": {"type": "object", "properties": {
            "limit": number, "actual": number}}}},
        "tool_force": {"type": "object", "properties": {"actual": number, "limit": number}},
        "a_b": number, "a.b": number, "a_b_2": number, "a-b": number}}
    value = {"tool": {"force": {"limit": 150.0, "actual": 3.0}}, "tool_force": {"actual": 7.0, "limit": 80.0},
             "a_b": 1.0, "a.b": 2.0, "a_b_2": 3.0, "a-b": 4.0}
    read_back = ValueReader(Connection("/j", "Cell", definition=json.dumps(schema), encoding="json",
                                       schema_encoding="jsonschema")).read(json.dumps(value).encode())
    assert read_back["tool"] == value["tool"] and read_back["tool_force"] == value["tool_force"]
    assert [part for name, part in read_back.items() if not name.startswith("tool")] == [1.0, 2.0, 3.0, 4.0]


def test_protobuf_types_whose_names_meet_keep_their_own_values():
    pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    file = pb2.FileDescriptorProto(name="x.proto", package="p", syntax="proto3")
    for name, fields in (("F1", [("limit", 1, ""), ("actual", 1, "")]), ("F2", [("actual", 1, ""), ("limit", 1, "")]),
                         ("Tool", [("force", 11, ".p.F1")]),
                         ("Root", [("tool", 11, ".p.Tool"), ("tool_force", 11, ".p.F2")])):
        message = file.message_type.add(name=name)
        for number, (field, kind, type_name) in enumerate(fields):
            message.field.add(name=field, number=number + 1, type=kind, label=1, type_name=type_name or None)
    pairs = [b"\x09" + struct.pack("<d", first) + b"\x11" + struct.pack("<d", second)
             for first, second in ((150.0, 3.0), (7.0, 80.0))]
    inner = b"\x0a%c" % len(pairs[0]) + pairs[0]
    raw = b"\x0a%c" % len(inner) + inner + b"\x12%c" % len(pairs[1]) + pairs[1]
    descriptors = pb2.FileDescriptorSet(file=[file]).SerializeToString().decode("utf-8", "surrogateescape")
    assert ValueReader(Connection("/p", "p.Root", definition=descriptors, encoding="protobuf",
                                  schema_encoding="protobuf")).read(raw) == {
        "tool": {"force": {"limit": 150.0, "actual": 3.0}}, "tool_force": {"actual": 7.0, "limit": 80.0}}


@pytest.mark.parametrize("message", [{"count": "x"}, {"count": 2 ** 70, "on": True}, {"count": 1, "on": 5}, [1], 7,
                                     {"count": 1, "on": True, "values": 3}, {"some": 2 ** 60 + 1},
                                     {"count": 1.5, "on": True}])
def test_json_that_does_not_fit_its_schema_is_an_error(tmp_path, message):
    path = json_log(tmp_path / "j.mcap", [message])
    with pytest.raises(DefinitionError, match="does not fit its JSON Schema"):
        read_columns(path)


@pytest.mark.parametrize("schema", [[], 7, {}, {"type": "string"}, {"properties": 5}, {"$ref": "#/no"}])
def test_a_schema_that_describes_no_object_is_an_error(tmp_path, schema):
    with pytest.raises(DefinitionError, match="describes no object"):
        read_columns(json_log(tmp_path / "j.mcap", [{}], schema))


def test_types_of_strangers_that_double_are_refused(tmp_path):
    kind = doubling()
    text = kind.definition.replace("MSG: test_msgs/", "MSG: test_msgs/msg/").replace("uint8 A=1", "uint8 a")
    with pytest.raises(BagError):
        as_ros1(kind._replace(datatype="test_msgs/msg/T0", definition=text, encoding="cdr", schema_encoding="ros2msg"))
    schema = {"type": "object", "properties": {name: {"$ref": "#/definitions/d0"} for name in "ab"}, "definitions": {
        "d%d" % i: {"type": "object", "properties": {name: {"$ref": "#/definitions/d%d" % (i + 1)} for name in "ab"}}
        for i in range(40)}}
    with pytest.raises(DefinitionError, match="more than 5000 fields"):
        as_ros1(Connection("/j", "J", definition=json.dumps(schema), encoding="json", schema_encoding="jsonschema"))


def test_one_topic_that_is_not_understood_costs_that_topic(tmp_path, capsys):
    path = tmp_path / "mixed.mcap"
    with McapWriter(path, profile="") as writer:
        good = writer.add_channel(STATES)
        bad = writer.add_channel(Connection("/bad", "x/msg/Bad", definition="x/Lacks a\n" + BREAK, encoding="cdr",
                                            schema_encoding="ros2msg"))
        writer.add_message(good, START_NS, bytes(8))
        writer.add_message(bad, START_NS, bytes(8))
    assert main(["export", str(path), "-o", str(tmp_path / "out.csv")]) == 1
    assert "/bad" in capsys.readouterr().err and len(list(tmp_path.glob("*.csv"))) == 1


def _descriptors():
    """Return the file descriptors of a message, in an order in which a file comes before one that it needs."""
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import text_format
    files = descriptor_pb2.FileDescriptorSet()
    text_format.Parse("""
        file { name: "b.proto" package: "t" syntax: "proto3" dependency: "a.proto"
          message_type { name: "State"
            field { name: "count" number: 1 label: LABEL_OPTIONAL type: TYPE_INT64 }
            field { name: "speed" number: 2 label: LABEL_OPTIONAL type: TYPE_DOUBLE }
            field { name: "name" number: 3 label: LABEL_OPTIONAL type: TYPE_STRING }
            field { name: "blob" number: 4 label: LABEL_OPTIONAL type: TYPE_BYTES }
            field { name: "at" number: 5 label: LABEL_OPTIONAL type: TYPE_MESSAGE type_name: ".t.Point" }
            field { name: "path" number: 6 label: LABEL_REPEATED type: TYPE_MESSAGE type_name: ".t.Point" }
            field { name: "child" number: 7 label: LABEL_OPTIONAL type: TYPE_MESSAGE type_name: ".t.State" }
            field { name: "maybe" number: 8 label: LABEL_OPTIONAL type: TYPE_INT32 oneof_index: 0
                    proto3_optional: true }
            oneof_decl { name: "_maybe" } } }
        file { name: "a.proto" package: "t" syntax: "proto3"
          message_type { name: "Point"
            field { name: "x" number: 1 label: LABEL_OPTIONAL type: TYPE_FLOAT }
            field { name: "on" number: 2 label: LABEL_OPTIONAL type: TYPE_BOOL } } }""", files)
    return files.SerializeToString()


def _protobuf_log(path, payloads, descriptors):
    with McapWriter(path, profile="") as writer:
        channel = writer.add_channel(Connection(
            "/p", "t.State", definition=descriptors.decode("utf-8", "surrogateescape"), encoding="protobuf",
            schema_encoding="protobuf"))
        for number, payload in enumerate(payloads):
            writer.add_message(channel, START_NS + number, payload)
    return path


def test_protobuf_becomes_columns(tmp_path, capsys):
    point = b"\x0d" + struct.pack("<f", 2.5) + b"\x10\x01"
    first = (b"\x08\x07\x11" + struct.pack("<d", 1.5) + b"\x1a\x03zu7\x22\x02ab\x2a\x07" + point
             + b"\x32\x07" + point + b"\x32\x00\x3a\x02\x08\x09\x40\x05")
    path = _protobuf_log(tmp_path / "p.mcap", [first, b""], _descriptors())
    fields = read_columns(path)["/p"].fields
    assert fields["count"].tolist() == [7, 0] and fields["speed"].tolist() == [1.5, 0]
    assert list(fields["name"]) == [b"zu7", b""] and [bytes(b) for b in fields["blob"]] == [b"ab", b""]
    assert fields["at.x"][0] == 2.5 and math.isnan(fields["at.x"][1]) and math.isnan(fields["at.on"][1])
    assert [list(values) for values in fields["path.on"]] == [[True, False], []]
    assert json.loads(fields["child"][0])["count"] == 9
    assert fields["maybe"][0] == 5 and math.isnan(fields["maybe"][1])
    assert main(["cat", str(path), "-l", "1"]) == 0
    assert json.loads(capsys.readouterr().out)["message"]["name"] == "zu7"
    assert main(["compare", str(path), str(path)]) == 0


def test_a_missing_library_costs_the_topics_that_need_it(tmp_path, capsys, monkeypatch):
    path = tmp_path / "mixed.mcap"
    with McapWriter(path, profile="") as writer:
        writer.add_message(writer.add_channel(STATES), START_NS, bytes(8))
        writer.add_message(writer.add_channel(Connection("/p", "t.S", encoding="protobuf", schema_encoding="protobuf")),
                           START_NS, b"")
    monkeypatch.setitem(sys.modules, "google.protobuf.descriptor_pool", None)
    assert main(["export", str(path), "-o", str(tmp_path / "out.csv")]) == 1
    assert "need the Python package protobuf" in capsys.readouterr().err and len(list(tmp_path.glob("*.csv"))) == 1


@pytest.mark.parametrize("cut", [0, 5, 40])
def test_descriptors_that_cannot_be_read_are_an_error(tmp_path, cut):
    with pytest.raises(DefinitionError, match="descriptors of t.State cannot be read"):
        read_columns(_protobuf_log(tmp_path / "p.mcap", [b""], _descriptors()[:cut]))
    with pytest.raises(DefinitionError, match="cannot be read"):
        read_columns(_protobuf_log(tmp_path / "q.mcap", [b"\xff"], _descriptors()))
