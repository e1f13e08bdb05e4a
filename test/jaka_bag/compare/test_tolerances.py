"""Tolerance files: a missing name keeps its default, an unknown one is refused."""
import re

import pytest
from cell_logs import steady, write_cell
from hypothesis import given, settings
from hypothesis import strategies as st

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.tolerances import (
    FieldTolerance,
    JointTolerance,
    TimingTolerance,
    ToleranceError,
    Tolerances,
    as_yaml,
    load_tolerances,
    parse_tolerances,
)
from jaka_bag.errors import BagError


def test_the_defaults_survive_being_written_and_read():
    assert parse_tolerances(as_yaml(Tolerances())) == Tolerances()


def test_changed_tolerances_survive_being_written_and_read():
    changed = parse_tolerances("""
joints: {position_rad: 0.01, per_joint: {joint_1: 0.5}}
tcp: {position_mm: 2}
calls: {request: ignore}
nan: fail
ignore_topics: ['/camera/.*']
optional_topics: ['/tf']
fields: {/left/force: {wrench.force.z: {absolute: 0.5, wraps: true}}}
""")
    assert parse_tolerances(as_yaml(changed)) == changed
    assert changed.fields["/left/force"]["wrench.force.z"] == FieldTolerance(0.5, 0.0, True)
    assert changed.ignores("/camera/left") and not changed.ignores("/rosout")
    assert changed.is_optional("/tf")


def test_nothing_is_the_defaults():
    assert parse_tolerances("") == load_tolerances(None) == Tolerances()


@pytest.mark.parametrize("text, words", [
    ("joint: {}", "did you mean 'joints'"), ("joints: {position: 1}", "did you mean 'position_rad'"),
    ("joints: {position_rad: fast}", "joints.position_rad: expected a number"),
    ("joints: {position_rad: -1}", "0 or more"), ("joints: {position_rad: .nan}", "expected a number"),
    ("joints: {position_rad: true}", "expected a number"), ("joints: {position_rad: %s}" % ("9" * 400), "a number"),
    ("joints: {position_rad: 2001-99-99}", "cell.yaml"), ("joints: 5", "expected names"),
    ("calls: {request: maybe}", "one of exact, ignore"), ("nan: never", "one of same, fail, ignore"),
    ("ignore_topics: /rosout", "list of regular expressions"), ("ignore_topics: ['(']", "not a regular expression"),
    ("fields: {/a: {x: {absolut: 1}}}", "did you mean 'absolute'"), ("fields: {/a: {x: {wraps: 1}}}", "true or false"),
    ("joints: {per_joint: {joint_1: x}}", "joints.per_joint.joint_1"), ("joints: {}\njoints: {}", "given twice"),
    ("? [1, 2]\n: 3", "a key is no text"), ("? {a: 1}\n: 3", "a key is no text"),
    ("? 0x%s\n: 1" % ("f" * 5000), "thousands of digits"), ("streams: 0x%s" % ("f" * 5000), "thousands of digits"),
    ("- 1", "expected names"), ("a: [", "while parsing"),
])
def test_what_is_not_understood_is_refused_with_the_key(text, words):
    with pytest.raises(ToleranceError, match=words):
        parse_tolerances(text, "cell.yaml")


@pytest.mark.parametrize("value", ["open", "open\0"])
def test_a_rule_for_a_field_of_texts_is_refused(value, tmp_path):
    path = write_cell(tmp_path / "log.mcap", steady("/cell/gripper", 10.0, 3.0, lambda now, number: value))
    with pytest.raises(BagError, match="/cell/gripper has no numeric field data"):
        compare_logs(path, path, parse_tolerances("fields: {/cell/gripper: {data: {absolute: 0.1}}}"))


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(ToleranceError, match="cannot read .*nothing.yaml"):
        load_tolerances(tmp_path / "nothing.yaml")
    (tmp_path / "latin.yaml").write_bytes(b"\xe9\xff")
    with pytest.raises(ToleranceError, match="not UTF-8"):
        load_tolerances(tmp_path / "latin.yaml")


AMOUNTS = st.floats(0.0, allow_infinity=False, allow_nan=False) | st.sampled_from([5e-05, 1e22, 0.1 + 0.2, 5e-324])
NAMES = st.text(max_size=12) | st.sampled_from(["yes", "null", "5", "a: b", "left,2", "it's", "#", "- ", "\x7f\x85",
                                                "\u81c2", "\U0001d6fc"])
PATTERNS = NAMES.map(re.escape) | st.sampled_from([r"(.*/)?it's\.\w+", r"a\d{2}'", " b "])
SHORT = {"max_size": 3}


@given(AMOUNTS, st.dictionaries(NAMES, AMOUNTS, **SHORT), st.lists(PATTERNS, **SHORT), st.lists(PATTERNS, **SHORT),
       st.lists(PATTERNS, **SHORT), st.dictionaries(NAMES, st.dictionaries(
           NAMES, st.builds(FieldTolerance, AMOUNTS, AMOUNTS, st.booleans()), **SHORT), **SHORT),
       st.dictionaries(NAMES, st.dictionaries(
           NAMES, st.dictionaries(AMOUNTS, AMOUNTS, min_size=1, max_size=3).map(lambda steps: tuple(sorted(
               steps.items()))), **SHORT), **SHORT))
@settings(max_examples=60, deadline=None)
def test_whatever_tolerances_hold_survives_being_written_and_read(amount, joints, ignored, optional, left, fields,
                                                                  envelopes):
    changed = Tolerances(
        joints=JointTolerance(amount, 0.0, joints), timing=TimingTolerance(wait_s=amount), ignore_topics=tuple(ignored),
        optional_topics=tuple(optional), ignore_fields=tuple(left), fields=fields, envelopes=envelopes)
    text = as_yaml(changed)
    assert parse_tolerances(text) == changed and text.isascii()
