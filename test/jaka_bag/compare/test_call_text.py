"""The words for a changed call: its numbers as they were typed, field by field."""
import re

import pytest
from import_graph import ROOT

from jaka_bag.compare.runs.call_text import as_typed, changed_fields
from jaka_bag.driver_interface import REQUEST_UNITS


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


@pytest.mark.parametrize("service, ours, theirs, changes", [
    ("linear_move", "pose: [0.0, -100.0, 1.0, 3.0, 0.0, 0.0]\nmvvelo: 50.0", "pose: [0.0, -95.0, 1.0, 3.1, 0.0, 0.0]\n"
     "mvvelo: 40.0", "pose[1] -100 -> -95 mm, pose[3] 3 -> 3.1 rad, mvvelo 50 -> 40 mm/s"),
    ("joint_move", "mvacc: 1.0\nindex: 1", "mvacc: 2.0\nindex: 2", "mvacc 1 -> 2 rad/s2, index 1 -> 2"),
    ("joint_move", "pose: [1.0, 2.0]", "pose: [1.0]", "pose [1, 2] -> [1]"),
    ("set_payload", "mass: 1.0", "mass: 1.5", "mass 1 -> 1.5 kg"),
    ("jog", "mvvelo: 1.0", "mvvelo: 2.0", "mvvelo 1 -> 2")])
def test_a_changed_number_has_the_unit_of_its_field(service, ours, theirs, changes):
    assert changed_fields(ours, theirs, service) == changes


DEFINITIONS = {"joint_move": "Move", "linear_move": "Move", "servo_j": "ServoMove", "set_toolframe": "SetTcpFrame",
               "set_userframe": "SetUserFrame", "set_payload": "SetPayload"}


@pytest.mark.parametrize("service", sorted({*DEFINITIONS, *REQUEST_UNITS}))
def test_units_are_those_of_the_definitions(service):
    path = ROOT / "jaka_msgs" / "srv" / (DEFINITIONS[service] + ".srv")
    request = path.read_text(encoding="utf-8").partition("---")[0]
    comments = dict(re.findall(r"^float32(?:\[\])? +(\w+) +# (.*)", request, re.MULTILINE))
    assert set(REQUEST_UNITS[service]) <= set(comments)
    for field, units in REQUEST_UNITS[service].items():
        comment = comments[field]
        _, found, own = comment.partition(service + ": ")
        words = re.findall(r"[\w/]+", own.split(". ")[0] if found else comment)
        assert set(units) <= set(words), (field, comment)
