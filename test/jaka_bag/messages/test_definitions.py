import pytest
from log_samples import JOINTS, STATES, TOOL

from jaka_bag.errors import DefinitionError
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.definitions import (
    Constant,
    Field,
    definition_md5,
    parse_definition,
    parse_type,
)

TWICE = "C one\n" + "=" * 80 + "\nMSG: a/C\nint32 a\nint32 b\n" + "=" * 80 + "\nMSG: a/C\n%s\n"


@pytest.mark.parametrize("connection, md5", [  # as roscpp and rospy compute them
    (TOOL, "98d34b0043a2093cf9d9345ab6eef12e"),
    (JOINTS, "3066dcd76a6cfaef579bd0f34173e9fd"),
    (Connection("/s", "std_msgs/String", definition="string data"), "992ce8a1687cec8c8bd883ec73ca41d1"),
    (Connection("/e", "std_msgs/Empty"), "d41d8cd98f00b204e9800998ecf8427e"),
    (STATES, "cb4726a69178af69dc31d5013f095556"),
])
def test_md5_is_that_of_ros(connection, md5):
    assert definition_md5(connection.datatype, connection.definition) == md5


def test_constants_stand_before_fields_in_the_md5_and_strings_keep_their_hash_signs():
    parsed = parse_type("a/B", "int32 x  # a comment\nstring S = it # is \nuint8 N=3 # three\nbyte[4] raw\nB2[] more")
    assert parsed.constants == (Constant("string", "S", "it # is"), Constant("uint8", "N", "3"))
    assert parsed.fields == (Field("int32", "x", None), Field("byte", "raw", 4), Field("a/B2", "more", -1))


def test_a_type_may_be_given_twice_where_both_say_the_same():
    types = parse_definition("a/B", TWICE % "int32 a  # again\nint32 b")
    assert [field.name for field in types["a/C"].fields] == ["a", "b"]
    header = "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    assert parse_definition("a/B", "Header h\n" + header + header).keys() == {"a/B", "std_msgs/Header"}


def test_a_header_without_package_is_that_of_std_msgs():
    assert parse_type("a/B", "Header header").fields[0].type == "std_msgs/Header"


@pytest.mark.parametrize("text", ["int32", "int32 a b", "int32[x] a", "Other o", "Loop l" + "\n" + "=" * 80 + "\n"
                                  "MSG: a/Loop\nLoop again", "int32 x\n" + "=" * 80 + "\nwhat is this\n",
                                  "int32[\u00b2] a", "int32[\u0663] a", "int32[%s] a" % ("9" * 5000), "int32[-1] a",
                                  "int32 x\nfloat64 x", TWICE % "int32 b\nint32 a"])
def test_a_definition_that_is_not_understood_is_refused(text):
    with pytest.raises(DefinitionError):
        parse_definition("a/B", text)
