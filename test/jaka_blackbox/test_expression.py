"""Conditions of users: their meaning, which are refused, and that only a condition can be expressed."""
import math

import pytest

from jaka_bag.errors import UsageError
from jaka_blackbox.expression import Expression, NoValue

VALUES = {"/a": {"data": 4.0, "name": "arm's", "on": True, "list": [1.0, -7.0, 3.0], "raw": b"\x01\x05",
                 "header": {"seq": 3}, "none": []},
          "/b/c": {"x": -2}}


@pytest.mark.parametrize("text, holds", [
    ("/a.data > 3", True), ("/a.data > 4", False), ("/a.data >= 4 and /a.data <= 4.0", True), ("3 < /a.data", True),
    ("/a.data == 4e0", True), ("/a.data != 4", False), ("not /a.on", False), ("not not /a.on", True), ("/a.on", True),
    ("/a.on == true", True), ("/a.name == \"arm's\"", True), ("/a.name != 'x'", True), ("/a.list[1] < -6.5", True),
    ("max(abs(/a.list)) > 6.9", True), ("max(/a.list) > 6.9", False), ("min(/a.list, /b/c.x, -8) == -8", True),
    ("/a.header.seq + 2 * /b/c.x == -1", True), ("(/a.header.seq + 2) * /b/c.x == -10", True),
    ("abs(/b/c.x) == 2", True),
    ("-/b/c.x > 1", True), ("/a.data > 9 or /b/c.x < 0", True), ("/a.data > 9 or /a.on and /b/c.x > 0", False),
    ("/a.raw[1] == 5", True), ("/b/c.x - 1 < -2.5", True)])
def test_what_conditions_mean(text, holds):
    assert Expression(text).holds(VALUES) is holds


@pytest.mark.parametrize("text", [
    "/z.data > 3", "/a.missing > 1", "/a.list[9] > 1", "/a.name > 3", "/a.name + 1 > 0", "max(/a.none) > 1",
    "abs(/a.name)", "/a.list > 3", "/a.header > 3"])
def test_what_cannot_be_computed_is_no_trigger(text):
    with pytest.raises(NoValue):
        Expression(text).holds(VALUES)


@pytest.mark.parametrize("text", [
    "", "3 > 2", "/a", "/a > 3", "/a.data >", "/a.data > 3)", "(/a.data > 3", "/a.data > 3 4", "/a.data = 3",
    "/a.data ** 2", "__import__('os').system('true')", "/a.data > 3; import os",
    "/a.data if 1 else 2", "lambda: 1", "exec('/a.x')",
    "abs(/a.data, 1) > 1", "/a.data > {}", "/a.data[-1] > 2", "/a[0] > 2", "max() > /a.data",
    "(" * 60 + "/a.x" + ")" * 60,
    "/a.data > " + "1 + " * 600 + "1"])
def test_everything_else_is_refused_with_a_reason(text):
    with pytest.raises(UsageError, match="trigger"):
        Expression(text)


@pytest.mark.parametrize("text, reason", [
    ("/a.data > 3)", "a ')' is too much"), ("(/a.data > 3", "a ')' is missing"), ("/a.data >", "it ends too early"),
    ("/a.data > 3 4", "'4' stands"), ("/a.name == 'x' 'y'", "\"'y'\" stands"), ("/a.data > > 3", "'>' stands"),
    ("1 < /a.data < 3", "two sides"), ("/a.data > {}", "nothing begins with '{}'"), ("/a > 3", "'/a' names no field"),
    ("-" * 900 + "/a.data > 3", "nested too deeply")])
def test_the_reason_says_where(text, reason):
    with pytest.raises(UsageError) as refused:
        Expression(text)
    assert reason in str(refused.value)


@pytest.mark.parametrize("numbers", [[math.nan, 100.0], [100.0, math.nan], [math.nan, 100.0, math.nan]])
@pytest.mark.parametrize("text, holds", [
    ("max(/j.effort) > 30", True), ("max(abs(/j.effort)) > 30", True), ("min(/j.effort) < 150", True),
    ("min(/j.effort) > 99", True), ("max(/j.effort) < 30", False), ("max(/j.effort, 200) > 150", True)])
def test_a_number_that_is_none_hides_no_other(numbers, text, holds):
    assert Expression(text).holds({"/j": {"effort": numbers}}) is holds


@pytest.mark.parametrize("text, holds", [
    ("max(/j.effort) > 30", False), ("min(/j.effort) < 30", False), ("max(/j.effort[0]) > 1", False),
    ("not min(abs(/j.effort)) > 30", True), ("max(/j.effort) > 30 or /io.data", True),
    ("/io.data or max(/j.effort) > 30", True)])
def test_where_no_number_is_left_the_rest_of_the_condition_counts(text, holds):
    assert Expression(text).holds({"/j": {"effort": [math.nan, math.nan]}, "/io": {"data": True}}) is holds


@pytest.mark.parametrize("text, holds", [("/j.x > 3", False), ("/j.x < 3", False), ("/j.x == /j.x", False),
                                         ("abs(/j.x) >= 0", False), ("/j.x != /j.x", True),
                                         ("/j.x > 3 or /j.y > 3", True)])
def test_a_comparison_with_a_number_that_is_none_is_that_of_ieee_754(text, holds):
    assert Expression(text).holds({"/j": {"x": math.nan, "y": 4.0}}) is holds


def test_a_number_beyond_all_others_is_compared():
    assert Expression("/a.data < 1e400").holds(VALUES)


def test_topics_are_resolved_and_listed_once():
    expression = Expression("x.data > 1 and ~y.data > x.data", lambda name: {"x": "/arm/x", "~y": "/node/y"}[name])
    assert expression.topics == ("/arm/x", "/node/y")
