"""Values that ``cat`` and ``export`` make of twenty .mcap files, with those of rosbags' own deserializer.

Five types, each described by ros2msg and by ros2idl, each in both byte orders; the file is written by the library mcap.
"""
import base64
import csv
import dataclasses
import json
import random

import numpy as np
import pytest
from mcap.writer import Writer

from jaka_bag.cli.main import main

typesys = pytest.importorskip("rosbags.typesys")
if not hasattr(typesys.Stores, "EMPTY"):
    pytest.skip("this rosbags registers no types of its own", allow_module_level=True)
KNOWS_OCTET = "octet" not in str(typesys.get_types_from_idl("module p { module msg { struct O { octet o; }; }; };"))
"""False for the last rosbags for Python 3.8: it parses one, and does not know what it is."""
START = 1700000000 * 10**9
MESSAGES = 12
_LINE = "=" * 80
_WIDTHS = [("int8", 8), ("uint8", 8), ("int16", 16), ("uint16", 16), ("int32", 32), ("uint32", 32), ("int64", 64),
           ("uint64", 64)]
_POINT = "float32 x\nint64 n\nstring name\n"
_POINT_IDL = "struct Point { float x; int64 n; string name; };"
_TIME = ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n",
         "module builtin_interfaces { module msg { struct Time { int32 sec; uint32 nanosec; }; }; };")
_HEADER = ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n",
           "module std_msgs { module msg { struct Header { builtin_interfaces::msg::Time stamp; string frame_id; };"
           " }; };")


def number(dice, bits, signed):
    """Draw an integer, often one at the end of its range."""
    low, high = (-2**(bits - 1), 2**(bits - 1) - 1) if signed else (0, 2**bits - 1)
    return dice.choice((low, high, 0, dice.randint(low, high)))


def half(dice):
    """Draw a number that float32 has exactly."""
    return dice.randint(-2**20, 2**20) / 8


def text(dice):
    return "".join(dice.choice("aß日\"\\ ,\n𝄞") for _ in range(dice.randrange(7)))


def ints(dice, name, bits, count):
    return np.array([number(dice, bits, name[0] == "i") for _ in range(count)], name)


def scalars(store, dice):
    return store.types["pkg/msg/T"](
        dice.random() < 0.5, *(number(dice, bits, name[0] == "i") for name, bits in _WIDTHS), half(dice), dice.random(),
        dice.randrange(128))  # rosbags takes a byte for one with a sign


def texts(store, dice):
    return store.types["pkg/msg/T"](
        number(dice, 8, False), text(dice), [text(dice) for _ in range(dice.randrange(4))], number(dice, 8, False),
        [text(dice), text(dice)], dice.random())


def arrays(store, dice):
    values = []
    for name, bits in _WIDTHS:
        values += [ints(dice, name, bits, dice.randrange(4)), ints(dice, name, bits, 3)]
    return store.types["pkg/msg/T"](
        *values, np.array([dice.random() < 0.5 for _ in range(dice.randrange(4))], bool),
        np.array([half(dice) for _ in range(dice.randrange(4))], np.float32), number(dice, 8, False),
        np.array([dice.random() for _ in range(3)]))


def nested(store, dice):
    point = store.types["pkg/msg/Point"]

    def one():
        return point(half(dice), number(dice, 64, True), text(dice))
    return store.types["pkg/msg/T"](number(dice, 8, False), one(), [one() for _ in range(dice.randrange(4))],
                                    number(dice, 8, False), [one(), one()], dice.random())


def stamped(store, dice):
    time = store.types[_TIME[0]]

    def one():
        return time(dice.randrange(2**31), dice.randrange(10**9))
    return store.types["pkg/msg/T"](store.types[_HEADER[0]](one(), text(dice)), one(),
                                    [one() for _ in range(dice.randrange(3))], number(dice, 64, True))


def idl(struct, before=""):
    return "module pkg { module msg { %s struct T { %s }; }; };" % (before, struct)


TYPES = {
    "scalars": (scalars, "bool on\n%sfloat32 h\nfloat64 f\nbyte raw\n" % "".join(
        "%s %s_v\n" % (name, name) for name, _ in _WIDTHS),
        idl("boolean on; %s float h; double f; octet raw;" % " ".join(
            "%s %s_v;" % (name, name) for name, _ in _WIDTHS)),
        ()),
    "texts": (texts, "uint8 a\nstring s\nstring[] many\nuint8 b\nstring[2] two\nfloat64 f\n",
              idl("uint8 a; string s; sequence<string> many; uint8 b; two_t two; double f;",
                  "typedef string two_t[2];"), ()),
    "arrays": (arrays, "%sbool[] flags\nfloat32[] h\nuint8 a\nfloat64[3] f\n" % "".join(
        "%s[] %s_s\n%s[3] %s_3\n" % ((name,) * 4) for name, _ in _WIDTHS),
        idl("%s sequence<boolean> flags; sequence<float> h; uint8 a; double_3 f;" % " ".join(
            "sequence<%s> %s_s; %s_t %s_3;" % ((name,) * 4) for name, _ in _WIDTHS),
            "typedef double double_3[3]; " + " ".join("typedef %s %s_t[3];" % (name, name) for name, _ in _WIDTHS)),
        ()),
    "nested": (nested, "uint8 a\npkg/Point at\npkg/Point[] some\nuint8 b\npkg/Point[2] two\nfloat64 f\n",
               idl("uint8 a; pkg::msg::Point at; sequence<pkg::msg::Point> some; uint8 b; two_t two; double f;",
                   "typedef pkg::msg::Point two_t[2];"),
               (("pkg/msg/Point", _POINT, "module pkg { module msg { %s }; };" % _POINT_IDL),)),
    "stamped": (stamped, "std_msgs/Header header\nbuiltin_interfaces/Time at\n"
                "builtin_interfaces/Time[] some\nint64 n\n",
                idl("std_msgs::msg::Header header; builtin_interfaces::msg::Time at; "
                    "sequence<builtin_interfaces::msg::Time> some; int64 n;"), (_HEADER, _TIME))}
"""Types by name: how a message is drawn, ros2msg, ros2idl, and the same of the types in it."""


def schema_of(kind, is_idl):
    """Return a type's definition as rosbag2 writes it, and the same with rosbags' parser of it."""
    _, msg, own_idl, parts = TYPES[kind]
    if is_idl:
        schema = "".join("%s\nIDL: %s\n%s\n" % (_LINE, name, body)
                         for name, body in [("pkg/msg/T", own_idl), *((part[0], part[2]) for part in parts)])
        types = {}
        for body in (own_idl, *(part[2] for part in parts)):
            types.update(typesys.get_types_from_idl(body))
        if "octet" not in own_idl or KNOWS_OCTET:
            return schema, types
        return schema, schema_of(kind, False)[1]
    schema = msg + "".join("%s\nMSG: %s\n%s" % (_LINE, name.replace("/msg/", "/"), body) for name, body, _ in parts)
    return schema, typesys.get_types_from_msg(schema, "pkg/msg/T")


def plain(value):
    """Return a deserialized message as JSON has it."""
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if not field.name.startswith("__")]
        if names == ["sec", "nanosec"]:
            return time_as_told(value)
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray):
        return base64.b64encode(value.tobytes()).decode() if value.dtype == np.uint8 else value.tolist()
    return [plain(each) for each in value] if isinstance(value, list) else value


def time_as_told(time):
    return {"secs": time.sec, "nsecs": time.nanosec}


def told(value):
    """Return what ``cat`` prints without what ROS 2 has no field for."""
    if isinstance(value, dict):
        return {name: told(each) for name, each in value.items() if name != "seq"}
    return [told(each) for each in value] if isinstance(value, list) else value


@pytest.mark.parametrize("is_little", [True, False], ids=["little", "big"])
@pytest.mark.parametrize("is_idl", [False, True], ids=["ros2msg", "ros2idl"])
@pytest.mark.parametrize("kind", sorted(TYPES))
def test_values_are_those_of_rosbags(tmp_path, capsys, kind, is_idl, is_little):
    schema, types = schema_of(kind, is_idl)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(types)
    dice = random.Random("%s %s %s" % (kind, is_idl, is_little))
    raws = [bytes(store.serialize_cdr(TYPES[kind][0](store, dice), "pkg/msg/T", little_endian=is_little))
            for _ in range(MESSAGES)]
    path = tmp_path / "log.mcap"
    with open(str(path), "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="foreign")
        number_of = writer.register_schema("pkg/msg/T", "ros2idl" if is_idl else "ros2msg", schema.encode())
        channel = writer.register_channel("/t", "cdr", number_of)
        for i, raw in enumerate(raws):
            writer.add_message(channel, START + i, raw, START + i, i)
        writer.finish()
    wanted = [plain(store.deserialize_cdr(raw, "pkg/msg/T")) for raw in raws]
    assert main(["cat", str(path)]) == 0
    assert [told(json.loads(line)["message"]) for line in capsys.readouterr().out.splitlines()] == wanted
    assert main(["export", str(path), "-o", str(tmp_path / "o.csv"), "-q"]) == 0
    with open(str(tmp_path / "o.csv"), newline="", encoding="utf-8") as rows:
        table = list(csv.DictReader(rows))
    for name, first in wanted[0].items():
        if isinstance(first, (int, float)) and not isinstance(first, bool):
            assert [float(row[name]) for row in table] == [float(value[name]) for value in wanted], name
        elif isinstance(first, str):
            texts_of = [bytes.fromhex(row[name]) if name.startswith("uint8_") else row[name] for row in table]
            assert texts_of == [base64.b64decode(value[name]) if name.startswith("uint8_") else value[name]
                                for value in wanted], name


@pytest.mark.parametrize("encoding, schema", [
    ("ros2msg", "wstring wide\n"), ("ros2idl", "module pkg { module msg { struct T { wstring wide; }; }; };")])
def test_wide_strings_cost_their_topic_alone(tmp_path, capsys, encoding, schema):
    """Leave the topic out: rosbags reads none, and vendors of DDS write their characters in two ways."""
    path = tmp_path / "log.mcap"
    with open(str(path), "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="foreign")
        for topic, kind, language, text_of, raw in (
                ("/wide", "pkg/msg/T", encoding, schema, b"\1\0\0\0a\0\0\0"),
                ("/n", "pkg/msg/N", "ros2msg", "int32 n\n", b"\5\0\0\0")):
            channel = writer.register_channel(topic, "cdr", writer.register_schema(kind, language, text_of.encode()))
            writer.add_message(channel, START, b"\0\1\0\0" + raw, START)
        writer.finish()
    assert main(["cat", str(path)]) == 1
    told_of = capsys.readouterr()
    assert [json.loads(line)["message"] for line in told_of.out.splitlines()] == [{"n": 5}]
    assert "left out: /wide (pkg/msg/T): pkg/msg/T has no ROS 1 form" in told_of.err
