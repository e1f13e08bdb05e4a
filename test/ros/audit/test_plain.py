"""ROS messages as plain values of an audit line: bounded in depth and length, and whole within the bounds."""
import math

import pytest

from jaka_ros_driver.ros.audit.plain import plain


class Message:
    """A message of one field."""

    __slots__ = ("inner",)

    def __init__(self, inner):
        self.inner = inner


def nested(depth, wrap):
    value = 7
    for _ in range(depth):
        value = wrap(value)
    return value


@pytest.mark.parametrize("wrap, open_one", [
    (Message, lambda value: value["inner"]), (lambda value: {"inner": value}, lambda value: value["inner"]),
    (lambda value: [value], lambda value: value[0])], ids=["messages", "dicts", "arrays"])
def test_what_is_nested_is_whole_to_the_eighth_level_and_cut_below(wrap, open_one):
    for depth in (1, 7, 8):
        value = plain(nested(depth, wrap))
        for _ in range(depth):
            value = open_one(value)
        assert value == 7
    value = plain(nested(9, wrap))
    for _ in range(8):
        value = open_one(value)
    assert value == "..."


def test_what_is_long_is_cut_and_its_length_told():
    assert plain("x" * 500) == "x" * 500 and plain("x" * 501) == "x" * 500 + "... (501 characters)"
    assert plain(list(range(32))) == list(range(32)) and plain(list(range(33)))[32:] == ["... (33 entries)"]
    assert plain(b"\x01\xff") == "01ff (2 bytes)" and plain(bytes(33)) == "00" * 32 + "... (33 bytes)"


def test_numbers_that_json_lacks_are_texts():
    assert plain([1.5, math.inf, math.nan, True, None]) == [1.5, "inf", "nan", True, None]
