"""The lists of motions: their parts, the way that is drawn, and what cannot be planned."""
import math

import numpy as np
import pytest

from jaka_panel.plans.motion_list import ARC, JOINT, LINE, plan_list
from jaka_panel.plans.point_plan import WrongPlan
from jaka_panel.teach.rotations import FramePose

LIMITS = [{"lower": -3.0, "upper": 3.0}] * 6
HOME = [0.0] * 6
POINTS = {"a": {"q": [0.4, 0.0, 0.0, 0.0, 0.0, 0.0]}, "b": {"q": [0.0, 0.4, 0.0, 0.0, 0.0, 0.5]},
          "via": {"q": [0.28284271, 0.28284271, 0.0, 0.0, 0.0, 0.0]}, "far": {"q": [4.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}


def forward(joints):
    """Return the pose of an arm whose first three joints are places, m, and whose others are turns."""
    return FramePose(list(joints[:3]), list(joints[3:]))


def inverse(pose, near):
    if max(map(abs, pose.position)) > 0.45:
        raise WrongPlan("out of reach")
    return [*pose.position, *pose.rotation_vector]


def planned(*steps, inverse=inverse, points=POINTS):
    return plan_list(steps, points, HOME, LIMITS, forward, inverse)


def line(point, **more):
    return {"kind": "line", "point": point, "speed": 0.1, **more}


JOINTS = {"kind": "joint", "point": "a", "speed": 0.5}
WAIT = {"kind": "wait", "s": 2.0}
OUTPUT = {"kind": "output", "signal": "digital", "bank": "tool", "index": 1, "value": True}


def test_motions_without_a_pause_are_one_path_and_pauses_divide_it():
    plan = planned(JOINTS, line("b", blend=0.01), line("a"), WAIT, OUTPUT, line("b", blend=0.02), WAIT)
    assert [(len(part.segments), part.wait, part.output is not None, part.step) for part in plan.parts] == [
        (3, 0.0, False, 1), (0, 2.0, False, 4), (0, 0.0, True, 5), (1, 0.0, False, 6), (0, 2.0, False, 7)]
    assert [segment.kind for segment in plan.parts[0].segments] == [JOINT, LINE, LINE]
    assert [segment.blend for segment in plan.parts[0].segments] == [0.0, 0.01, 0.0]
    assert plan.parts[3].segments[0].blend == 0.0 and "step 6: its rounded corner" in plan.warnings[0]
    assert [list(part.begin) for part in plan.parts] == [HOME] + [POINTS["a"]["q"]] * 3 + [POINTS["b"]["q"]]
    assert plan.parts[2].output == {"signal": "digital", "bank": "tool", "index": 1, "value": True}


def test_the_way_that_is_drawn_is_the_line_and_its_time():
    plan = planned(JOINTS, line("b"))
    path = np.array(plan.path)
    assert np.allclose(path[0], HOME) and np.allclose(path[-1], POINTS["b"]["q"])
    assert np.allclose(path[8:, 0] + path[8:, 1], 0.4) and (np.diff(path[8:, 1]) > 0.0).all()
    assert plan.time[8] == pytest.approx(0.8) and plan.time[-1] == pytest.approx(0.8 + 0.4 * math.sqrt(2.0) / 0.1)
    shown = plan.shown("k1")
    assert shown["plan"] == "k1" and shown["end"] == POINTS["b"]["q"] and len(shown["path"]) == len(shown["t"]) == 17


def test_an_arc_goes_through_its_via_on_a_circle():
    plan = planned(JOINTS, {"kind": "arc", "via": "via", "point": "b", "speed": 0.1})
    places = np.array(plan.path)[8:, :3]
    assert np.allclose(np.linalg.norm(places, axis=1), 0.4, atol=1e-6)
    assert np.linalg.norm(places - POINTS["via"]["q"][:3], axis=1).min() < 1e-6
    assert plan.time[-1] - plan.time[8] == pytest.approx(0.4 * math.pi / 2.0 / 0.1, rel=1e-6)
    assert plan.parts[0].segments[1].kind == ARC and plan.parts[0].segments[1].via.position == POINTS["via"]["q"][:3]
    long = planned(JOINTS, {"kind": "arc", "via": "other", "point": "b", "speed": 0.1},
                   points={**POINTS, "other": {"q": [-0.28284271, -0.28284271, 0.0, 0.0, 0.0, 0.0]}})
    assert long.time[-1] - long.time[8] == pytest.approx(0.4 * math.pi * 1.5 / 0.1, rel=1e-6)


def test_another_posture_than_that_of_the_point_is_told():
    def other(pose, near):
        return [*pose.position, *pose.rotation_vector[:2], pose.rotation_vector[2] + 0.1]
    assert "another posture" in planned(line("a"), inverse=other).warnings[0]


def test_a_long_list_is_drawn_with_a_bounded_number_of_points():
    shown = planned(*[line("a"), line("b")] * 100).shown("k")
    assert len(shown["path"]) <= 400 and shown["path"][-1] == POINTS["b"]["q"]


@pytest.mark.parametrize("steps, why", [
    ([line("none")], "step 1: there is no point none"), ([JOINTS, line("far")], "step 2: joint 1 of point far"),
    ([WAIT], "no motion"), ([{"kind": "arc", "via": "a", "point": "a", "speed": 0.1}], "step 1: begin, via and end"),
    ([JOINTS, {"kind": "arc", "via": "mid", "point": "c", "speed": 0.1}], "step 2: begin, via and end"),
    ([line("out")], "step 1: the way there is out of reach")])
def test_what_cannot_be_planned_is_refused_with_its_step(steps, why):
    points = {**POINTS, "out": {"q": [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]}, "mid": {"q": [0.2, 0.0, 0.0, 0.0, 0.0, 0.0]},
              "c": {"q": [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]}}
    with pytest.raises(WrongPlan) as refused:
        planned(*steps, points=points)
    assert why in str(refused.value)
