"""Exported fields of twenty .mcap files by the library mcap, compared with what the decoders of others make of them."""
import csv
import dataclasses
import json
import math
import re
import struct

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from jaka_bag.cli.main import main

ros2 = pytest.importorskip("mcap_ros2_support_fast.decoder")
small_mcap = pytest.importorskip("small_mcap")

_LINE = "=" * 80
MSG = """\
# a comment
int32 STATE_ON=1
string NAME="a # b"
bool on
byte raw
char letter
int8 a
uint8 b
int16 c
uint16 d
int32 e
uint32 f
int64 g
uint64 h
float32 i
float64 j
string text
float64[3] fixed
uint8[] blob
int64[] wide
string[] names
geometry_msgs/Point at
geometry_msgs/Point[2] two
builtin_interfaces/Time stamp
builtin_interfaces/Duration span
""" + _LINE + "\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat32 z\n" + _LINE + """
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
""" + _LINE + "\nMSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n"
IDL = _LINE + """
IDL: pkg/msg/State
#include "pkg/msg/Part.idl"
module pkg { module msg {
  typedef double double__3[3];
  module State_Constants { const int32 ON = 1; };
  struct State { boolean on; uint8 small; int64 wide; uint64 most; float half; double full; string text;
    double__3 fixed; sequence<int32> list; pkg::msg::Part part; };
}; };
""" + _LINE + "\nIDL: pkg/msg/Part\nmodule pkg { module msg { struct Part { int16 x; string name; }; }; };\n"
SCHEMA = {"type": "object", "title": "S", "required": ["count", "on", "wide"], "properties": {
    "count": {"type": "integer"}, "wide": {"type": "integer"}, "on": {"type": "boolean"}, "text": {"type": "string"},
    "speed": {"type": "number"}, "maybe": {"type": ["integer", "null"]},
    "values": {"type": "array", "items": {"type": "number"}},
    "at": {"type": "object", "properties": {"x": {"type": "number"}, "name": {"type": "string"}}}}}
PROTO = """
file { name: "a.proto" package: "t" syntax: "proto3"
  message_type { name: "Point"
    field { name: "x" number: 1 label: LABEL_OPTIONAL type: TYPE_FLOAT }
    field { name: "y" number: 2 label: LABEL_OPTIONAL type: TYPE_SINT64 } }
  message_type { name: "State" %s
    field { name: "at" number: 20 label: LABEL_OPTIONAL type: TYPE_MESSAGE type_name: ".t.Point" }
    field { name: "kind" number: 21 label: LABEL_OPTIONAL type: TYPE_ENUM type_name: ".t.Kind" }
    field { name: "list" number: 22 label: LABEL_REPEATED type: TYPE_DOUBLE } }
  enum_type { name: "Kind" value { name: "A" number: 0 } value { name: "B" number: 5 } } }"""
_SCALARS = (("i32", "INT32"), ("i64", "INT64"), ("u32", "UINT32"), ("u64", "UINT64"), ("s32", "SINT32"),
            ("f64", "FIXED64"), ("sf32", "SFIXED32"), ("flag", "BOOL"), ("text", "STRING"), ("half", "FLOAT"),
            ("full", "DOUBLE"))
START = 1700000000 * 10**9


def leaves(value, name=""):
    """Return the scalars in a decoded message by their paths; times are ns."""
    if hasattr(value, "sec") and hasattr(value, "nanosec"):
        return {name: value.sec * 10**9 + value.nanosec}
    if isinstance(value, dict):
        parts = value.items()
    elif hasattr(value, "DESCRIPTOR"):
        parts = [(field.name, getattr(value, field.name)) for field in value.DESCRIPTOR.fields]
    elif isinstance(value, (bytes, bytearray)) or isinstance(value, memoryview) and value.format == "B":
        return {name: bytes(value)}
    elif isinstance(value, (list, tuple, np.ndarray)) or hasattr(value, "typecode") or (
            hasattr(value, "__len__") and not isinstance(value, str)):
        return {path: one for i, each in enumerate(value) for path, one in leaves(each, "%s[%d]" % (name, i)).items()}
    elif dataclasses.is_dataclass(value) and "__slots__" not in vars(type(value)):
        parts = [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)
                 if field.default is dataclasses.MISSING]  # others are constants
    else:
        names = getattr(type(value), "__slots__", None) or getattr(value, "__dict__", None)
        if not names or isinstance(value, (str, int, float)):
            return {name: value.item() if isinstance(value, np.generic) else value}
        parts = [(each, getattr(value, each)) for each in names if not each.startswith("_")]
    return {path: one for part, each in parts for path, one in leaves(each, (name and name + ".") + part).items()}


def columns(value):
    """Return the scalars by the names of columns, where places in arrays stand at the end: ``two.x[0]``."""
    return {re.sub(r"\[\d+\]", "", name) + "".join(re.findall(r"\[\d+\]", name)): one
            for name, one in leaves(value).items()}


def cdr_of_msg(n):
    out = bytearray(b"\0\1\0\0")

    def put(code, *values):
        for one in values:
            size = struct.calcsize("<" + code)
            out.extend(bytes(-(len(out) - 4) % size))
            out.extend(struct.pack("<" + code, one))

    def text(one):
        raw = one.encode() + b"\0"
        put("I", len(raw))
        out.extend(raw)
    put("?", n % 2)
    put("B", 200 + n, 100 + n)
    put("b", -n)
    put("B", 255 - n)
    put("h", -32768 + n)
    put("H", 65535 - n)
    put("i", -2**31 + n)
    put("I", 2**32 - 1 - n)
    put("q", -2**63 + n)
    put("Q", 2**64 - 1 - n)
    put("f", 0.1 + n)
    put("d", [math.pi, -0.0, 1e-320, math.inf][n % 4])
    text("zü %d" % n)
    put("d", 1.5, n, -2)
    put("I", 2)
    put("B", 7, n)
    put("I", 2)
    put("q", 2**62 + n, -1)
    put("I", 2)
    text("a,\"b\"")
    text("")
    for _ in range(3):
        put("d", 1.25 * n, -1)
        put("f", 3.5)
    put("i", 1700000000 + n)
    put("I", 999999999 - n)
    put("i", n)
    put("I", 5)
    return bytes(out)


def ros2msg():
    schema = type("Schema", (), {"id": 1, "name": "pkg/msg/State", "encoding": "ros2msg", "data": MSG.encode()})
    decode = ros2.DecoderFactory().decoder_for("cdr", schema)
    payloads = [cdr_of_msg(n) for n in range(8)]
    return "pkg/msg/State", "ros2msg", MSG.encode(), "cdr", payloads, [columns(decode(each)) for each in payloads]


def ros2idl():
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_idl(re.sub("=+\nIDL: .*\n|#include.*\n", "", IDL)))
    state, part = store.types["pkg/msg/State"], store.types["pkg/msg/Part"]
    payloads = [bytes(store.serialize_cdr(state(
        bool(n % 2), n, -2**63 + n, 2**64 - 1 - n, 0.5, math.pi, "ü%d" % n, np.array([1.0, 2, n]),
        np.array([n, -n], np.int32), part(-n, "p")), "pkg/msg/State")) for n in range(8)]
    values = [columns(store.deserialize_cdr(each, "pkg/msg/State")) for each in payloads]
    return "pkg/msg/State", "ros2idl", IDL.encode(), "cdr", payloads, values


def of_json():
    payloads = [json.dumps({
        "count": n, "wide": 2**53 + 1 + n, "on": n % 2 == 0, "text": "zü,%d" % n, "speed": 0.1 * n,
        "maybe": None if n % 2 else n, "values": [0.5, n], "at": {"x": -n, "name": "q"}}).encode() for n in range(8)]
    return "S", "jsonschema", json.dumps(SCHEMA).encode(), "json", payloads, [columns(json.loads(p)) for p in payloads]


def of_protobuf():
    pb = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import descriptor_pool, message_factory, text_format
    if not hasattr(message_factory, "GetMessageClass"):
        pytest.skip("this protobuf has another API")
    files = pb.FileDescriptorSet()
    text_format.Parse(PROTO % "".join('field { name: "%s" number: %d label: LABEL_OPTIONAL type: TYPE_%s } ' % (
        name, number, kind) for number, (name, kind) in enumerate(_SCALARS, 1)), files)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(files.file[0])
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("t.State"))
    made = [kind(i32=-n, i64=-2**63 + n, u32=2**32 - 1 - n, u64=2**63 - 1 - n, s32=-5, f64=n, sf32=-n, flag=bool(n % 2),
                 text="zü%d" % n, half=0.1, full=math.pi * n, kind=5 * (n % 2), list=[1.5, n],
                 at={"x": 0.3, "y": -2**53 + n}) for n in range(8)]
    payloads = [one.SerializeToString() for one in made]
    return "t.State", "protobuf", files.SerializeToString(), "protobuf", payloads, [
        columns(kind.FromString(each)) for each in payloads]


KINDS = {"ros2msg": (ros2msg,), "ros2idl": (ros2idl,), "json": (of_json,), "protobuf": (of_protobuf,),
         "all": (ros2msg, ros2idl, of_json, of_protobuf)}
FORMS = {"none": {"compression": CompressionType.NONE}, "lz4": {"compression": CompressionType.LZ4},
         "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 200}, "unchunked": {"use_chunking": False}}


def is_same(cell, value):
    """Return whether a cell of a CSV is a value."""
    if value is None:
        return cell in ("", "nan")
    if isinstance(value, bool):
        return cell in (("True", "1", "true") if value else ("False", "0", "false")) or cell == "%.1f" % value
    if isinstance(value, bytes):
        return cell == value.hex()
    if isinstance(value, int):
        return cell == str(value) or ("." in cell and "e" not in cell and float(cell) == value and abs(value) <= 2**53)
    if isinstance(value, float):
        return float(cell) == value or np.float32(cell) == np.float32(value) == value
    return cell == value


def seconds(value):
    return "%d.%09d" % divmod(value, 10**9)


@pytest.mark.parametrize("form", list(FORMS))
@pytest.mark.parametrize("kind", list(KINDS))
def test_every_field(tmp_path, kind, form):
    path = tmp_path / "log.mcap"
    expected = {}
    with open(str(path), "wb") as file:
        writer = Writer(file, **FORMS[form])
        writer.start(profile="", library="foreign")
        for number, make in enumerate(KINDS[kind]):
            name, schema_encoding, schema, encoding, payloads, values = make()
            topic = "/t%d" % number
            channel = writer.register_channel(topic, encoding, writer.register_schema(name, schema_encoding, schema))
            expected[topic] = values
            for i, payload in enumerate(payloads):
                writer.add_message(channel, START + i, payload, START + i, i)
        writer.finish()
    assert main(["export", str(path), "-o", str(tmp_path / "o.csv"), "-q"]) == 0
    assert main(["export", str(path), "-o", str(tmp_path / "o.npz"), "-q"]) == 0
    assert main(["export", str(path), "-o", str(tmp_path / "o.parquet"), "-q"]) == 0
    with np.load(str(tmp_path / "o.npz"), allow_pickle=False) as npz:
        arrays = {name: npz[name] for name in npz.files}
    for topic, values in expected.items():
        table = tmp_path / ("o.csv" if len(expected) == 1 else "o_%s.csv" % topic[1:])
        with open(str(table), newline="", encoding="utf-8") as text:
            rows = list(csv.DictReader(text))
        assert len(rows) == len(values)
        wrong = []
        for row, message in zip(rows, values):
            for name, value in message.items():
                if name in ("stamp", "span"):
                    value = seconds(value)
                if name not in row or not is_same(row[name], value):
                    wrong.append((name, row.get(name), value))
        assert not wrong
        seen = set()
        stored = pytest.importorskip("pyarrow.parquet").read_table(str(table.with_suffix(".parquet")))
        for name, value in values[0].items():
            key = topic[1:] + "/" + name
            if key in arrays and isinstance(value, (int, float)):
                given = [math.nan if message[name] is None else message[name] for message in values]
                np.testing.assert_array_equal(arrays[key], np.array(given, arrays[key].dtype), name)
                column = stored[name].combine_chunks().to_numpy(zero_copy_only=False)
                np.testing.assert_array_equal(column.astype(arrays[key].dtype), arrays[key], name)
                seen.add(name)
        assert seen >= {name for name, value in values[0].items() if type(value) in (int, float) and "[" not in name}
