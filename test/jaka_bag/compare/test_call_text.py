"""The words for a changed call: its numbers as they were typed, field by field."""
import pytest

from jaka_bag.compare.runs.call_text import as_typed, changed_fields


@pytest.mark.parametrize("printed, typed", [
    ("mvvelo: 0.800000011920929", "mvvelo: 0.8"), ("mass: 0.1", "mass: 0.1"), ("pose: [-100.0, 2]", "pose: [-100, 2]"),
    ("x: 3.4028234663852886e+38", "x: 3.4028235e+38"), ("x: 1e-300", "x: 1e-300"), ("x: 1e+300", "x: 1e+300"),
    ("x: nan", "x: nan"), ("index: 7", "index: 7"), ("x: 0.12345678901234566", "x: 0.12345678901234566")])
def test_a_number_is_told_as_short_as_it_was_typed(printed, typed):
    assert as_typed(printed) == typed


@pytest.mark.parametrize("ours, theirs, changes", [
    ("pose: [1.0, -100.0]\nmvvelo: 0.800000011920929", "pose: [1.0, -95.0]\nmvvelo: 0.5",
     "pose[1] -100 -> -95, mvvelo 0.8 -> 0.5"),
    ("pose: [1.0, 2.0]", "pose: [1.0]", "pose [1, 2] -> [1]"),
    ("signal: cabinet", "signal: tool", "signal cabinet -> tool"),
    ("a: 1", "b: 1", "a 1 -> nothing, b nothing -> 1"), ("a: 1", "a: 1", "bytes that no text shows"),
    ("at: \n  x: 1.0\n  y: 2.0", "at: \n  x: 1.0\n  y: 3.0", "at x: 1 y: 2 -> x: 1 y: 3")])
def test_a_changed_request_is_told_field_by_field(ours, theirs, changes):
    assert changed_fields(ours, theirs) == changes
