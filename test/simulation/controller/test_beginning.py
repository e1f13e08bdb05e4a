"""The state that a simulated controller begins with, as a file tells it."""
import contextlib
import json
import math
import textwrap

import pytest
from import_graph import ROOT

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.controller.beginning import Beginning
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

JOINTS = [0.1, 1.2, -1.3, 1.4, 1.5, 0.6]
TOOL = {"id": 3, "offset": [0.0, 0.01, 0.12, 0.1, -0.2, 0.3]}
USER = {"id": 2, "offset": [0.3, 0.2, 0.1, 0.0, 0.0, 1.0]}


def state_of(values):
    with contextlib.closing(SimulatedController(beginning=Beginning(values))) as made:
        return made.server.controller.state


def test_everything_that_is_told_holds_from_the_first_moment():
    state = state_of({
        "joints": JOINTS, "tool": TOOL, "user_frame": USER, "payload": {"mass": 1.5, "centroid": [0.0, 0.0, 0.04]},
        "collision_level": 4, "speed_override": 0.3,
        "terminals": {"cabinet": {"digital_inputs": {2: 1}, "digital_outputs": {5: True}, "analog_outputs": {1: 2.5}},
                      "tool": {"digital_outputs": {"0": 1}}}})
    assert state.plant.joint_position == pytest.approx(JOINTS)
    assert (state.memory.tools.active, state.memory.user_frames.active) == (3, 2)
    assert state.memory.tools.frames[3] == Pose((0.0, 0.01, 0.12), (0.1, -0.2, 0.3))
    assert (state.memory.payload.mass, state.memory.payload.centroid) == (1.5, (0.0, 0.0, 0.04))
    assert (state.memory.collision_level, state.plant.rapid_rate) == (4, 0.3)
    assert state.io.get("digital", False, 0, 2) == 1 and state.io.get("digital", True, 0, 5) == 1
    assert state.io.get("analog", True, 0, 1) == 2.5 and state.io.get("digital", True, 1, 0) == 1
    assert state.io.get("digital", False, 0, 3) == 0


def test_the_pose_of_the_tool_is_that_of_the_frames_told():
    bare, with_tool = state_of({"joints": JOINTS}), state_of({"joints": JOINTS, "tool": TOOL})
    apart = math.dist(bare.plant.tcp_pose().position, with_tool.plant.tcp_pose().position)
    assert apart == pytest.approx(math.hypot(0.01, 0.12))
    in_user = state_of({"joints": JOINTS, "user_frame": USER})
    assert math.dist(bare.plant.tcp_pose().position, in_user.plant.tcp_pose().position) > 0.1


def test_programs_that_are_told_are_stored_beside_the_usual_ones():
    assert set(state_of({"programs": ["pick"]}).memory.programs) == {*state_of({}).memory.programs, "pick"}


def test_what_is_not_told_is_as_after_a_start():
    one = state_of({})
    with contextlib.closing(SimulatedController()) as made:
        other = made.server.controller.state
    assert one.plant.joint_position == other.plant.joint_position
    assert (one.memory, one.plant.rapid_rate) == (other.memory, other.plant.rapid_rate)


@pytest.mark.parametrize("values, words", [
    ([], "must hold keys and values"),
    ({"joint": JOINTS}, "'joint' is not known"),
    ({"joints": [0.0] * 5}, "6 numbers"),
    ({"joints": [float("nan")] * 6}, "joints is nan"),
    ({"joints": ["0"] * 6}, "joints is '0'"),
    ({"joints": [0.0, 99.0, 0.0, 0.0, 0.0, 0.0]}, "joint 2 is 99 rad"),
    ({"tool": {"id": 16}}, "tool.id is 16"),
    ({"tool": {"offset": [0.0] * 6}}, "tool.id is None"),
    ({"tool": {"id": 0, "offset": [1.0] * 6}}, "id 0 is fixed"),
    ({"tool": {"id": 1, "offset": [0, 0, 0, 180, 0, 0]}}, "its angles are rad"),
    ({"payload": {"mass": -1}}, "payload.mass"),
    ({"programs": "pick"}, "a list of names"), ({"programs": [1]}, "a list of names"),
    ({"collision_level": 6}, "collision_level is 6"),
    ({"speed_override": 50}, "speed_override is 50"),
    ({"terminals": {"cabinets": {}}}, "'cabinets' is not known"),
    ({"terminals": {"cabinet": {"inputs": {}}}}, "'inputs'"),
    ({"terminals": {"cabinet": {"digital_inputs": [1]}}}, "values by index"),
    ({"terminals": {"cabinet": {"digital_inputs": {math.inf: 1}}}}, "the index must be a whole number"),
    ({"terminals": {"cabinet": {"digital_inputs": {math.nan: 1}}}}, "the index must be a whole number"),
    ({"terminals": {"cabinet": {"analog_outputs": {1: 10 ** 400}}}}, "it must be"),
    ({"terminals": {"cabinet": {"digital_inputs": {"x": 1}}}}, "whole number"),
    ({"terminals": {"cabinet": {"digital_inputs": {100000: 1}}}}, "no digital input 100000"),
    ({"terminals": {"cabinet": {"analog_outputs": {0: 1e8}}}}, "is beyond")])
def test_what_makes_no_sense_is_refused_with_its_key(values, words):
    with pytest.raises(InvalidCommand, match=words):
        state_of(values)


def test_a_file_is_yaml_or_json_and_its_errors_have_its_name(tmp_path):
    path = tmp_path / "begin.json"
    path.write_text(json.dumps({"joints": JOINTS}))
    assert Beginning.from_file(str(path)).joint_position == pytest.approx(JOINTS)
    path.write_text("joints: [1, 2")
    with pytest.raises(InvalidCommand, match="begin.json"):
        Beginning.from_file(str(path))
    path.write_text("joints: 3")
    with pytest.raises(InvalidCommand, match="begin.json.*6 numbers"):
        Beginning.from_file(str(path))
    with pytest.raises(InvalidCommand, match="nowhere.yaml"):
        Beginning.from_file(str(tmp_path / "nowhere.yaml"))


def test_the_example_of_the_page_is_understood(tmp_path):
    page = (ROOT / "docs" / "simulation.md").read_text(encoding="utf-8")
    text = page.split("`--begin-with FILE`")[1].split("```yaml\n")[1].split("```")[0]
    path = tmp_path / "begin.yaml"
    path.write_text(textwrap.dedent(text))
    with contextlib.closing(SimulatedController(beginning=Beginning.from_file(str(path)))) as made:
        assert made.server.controller.state.memory.tools.active == 3
