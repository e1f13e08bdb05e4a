import math
import time

import pytest

from jaka_ros_driver.clearance.workspace import load_workspace, workspace_of_text
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model_file
from jaka_ros_driver.simulation.controller.beginning import Beginning
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.yaml_text import load_yaml, short

HUGE = "0x" + "f" * 5000
BOX = "- {name: %s, centre: [0.7, 0.3, 0.2], size: [0.4, 0.4, 0.6]}\n"
ROWS = "".join("- {a: %g, d: %g, alpha: %r}\n" % row for row in [
    (0, 120.1, math.pi / 2), (360, 0, 0), (303.5, 0, 0), (0, 115, math.pi / 2), (0, 114, -math.pi / 2), (0, 107, 0)])
LIMITS = "joint_limits_deg: [%s]\n" % ", ".join(["[-90, 90]"] * 6)
MODEL = "family: three_parallel_offset_wrist\ndh_standard:\n%s%sjoint_max_speed_deg_s: [%s]\n" % (
    ROWS, LIMITS, ", ".join(["180"] * 6))


def read_model(text, folder):
    (folder / "file.yaml").write_text(text)
    return load_model_file(str(folder / "file.yaml"))


def read_workspace(text, folder):
    (folder / "file.yaml").write_text(text)
    return load_workspace(str(folder / "file.yaml"))


def read_dialect(text, folder):
    (folder / "file.yaml").write_text(text)
    return Dialect.from_file(str(folder / "file.yaml"), "1.7")


def read_beginning(text, folder):
    (folder / "file.yaml").write_text(text)
    return Beginning.from_file(str(folder / "file.yaml"))


def read_text(text, _):
    return workspace_of_text(text)


READERS = [read_model, read_workspace, read_text, read_dialect, read_beginning]


@pytest.mark.parametrize("read, text, key", [
    (read_workspace, "keep_out:\n%sfloor: -0.1\nkeep_out:\n%s" % (BOX % "press", BOX % "rack"), "keep_out"),
    (read_text, "floor: -0.1\nfloor: -9", "floor"),
    (read_text, "tool: [{name: g, start: [0, 0, 0], end: [0, 0, 0.1], radius: 0.04, radius: 0.001}]", "radius"),
    (read_model, MODEL + LIMITS, "joint_limits_deg"), (read_model, MODEL.replace("d: 115", "d: 115, d: 116"), "d"),
    (read_dialect, "frame_delay: 0.1\nframe_delay: 0.2", "frame_delay"),
    (read_beginning, "collision_level: 1\ncollision_level: 2", "collision_level"),
])
def test_a_key_that_is_given_twice_is_refused_and_named(read, text, key, tmp_path):
    with pytest.raises(InvalidCommand, match=r"gives the key '%s' twice, again in line \d" % key) as caught:
        read(text, tmp_path)
    assert "\n" not in str(caught.value) and "no YAML" not in str(caught.value)


def test_the_model_without_the_second_key_is_taken(tmp_path):
    assert read_model(MODEL, tmp_path).joint_limits[0] == pytest.approx((-math.pi / 2, math.pi / 2))


def test_merged_keys_may_be_given_again_and_are_no_second_ones():
    text = ("a: &a {x: 1, y: 2}\nouter: {b: &b {<<: *a, x: 3}}\nc: {<<: *b, y: 4}\nlist: [*a, *a]\n"
            "both: {<<: [*a, {y: 5, z: 6}]}")
    assert load_yaml(text) == {
        "a": {"x": 1, "y": 2}, "outer": {"b": {"x": 3, "y": 2}}, "c": {"x": 3, "y": 4},
        "list": [{"x": 1, "y": 2}] * 2, "both": {"x": 1, "y": 2, "z": 6}}


def test_of_merged_keys_those_win_that_stand_nearer_or_first():
    first, second = "&a {long_key: 1, other: 1}", "&b {<<: *a, long_key: 2}"
    text = "a: %s\nouter: {b: %s}\n" % (first, second)
    assert load_yaml(text + "c: {<<: *b}")["c"] == {"long_key": 2, "other": 1}
    assert load_yaml(text + "c: {<<: [*a, *b, *a]}")["c"] == {"long_key": 1, "other": 1}
    assert load_yaml(text + "c: {<<: [*b, *a], =: 3}")["c"] == {"long_key": 2, "other": 1, "=": 3}
    assert load_yaml("&a {<<: *a, x: 1}") == {"x": 1}


def test_merges_of_merges_take_no_time_of_their_power():
    lines = ["a0: &a0 {x: 1}"]
    lines += ["a%d: &a%d {<<: [%s]}" % (i, i, ", ".join(["*a%d" % (i - 1)] * 9)) for i in range(1, 12)]
    begun = time.process_time()
    assert load_yaml("\n".join(lines))["a11"] == {"x": 1}
    assert time.process_time() - begun < 5.0


@pytest.mark.parametrize("text", ["? [1, 2]\n: 3", "? &a [*a]\n: 3", "? {a: 1}\n: 3", "a: 2001-99-99",
                                  "&a {*a : 1}", "\x00", "<<: 3", "!!python/object:os.system {}"])
def test_what_is_no_yaml_is_refused(text):
    with pytest.raises(InvalidCommand, match="^is no YAML: "):
        load_yaml(text)


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("text", ["? %s\n: 1" % HUGE, "? [1, 2]\n: 1", "1: 2", "~: 2", "2001-01-01: 2"])
def test_a_key_that_is_no_text_is_refused(read, text, tmp_path):
    with pytest.raises(InvalidCommand) as caught:
        read(text, tmp_path)
    assert len(str(caught.value)) < 1500


@pytest.mark.parametrize("text", [
    MODEL + "? %s\n: 1" % HUGE, MODEL.replace("d: 115", "d: 115, ? %s : 1" % HUGE),
    MODEL.replace("a: 360", "a: " + HUGE),
    MODEL.replace("180]", HUGE + "]"), MODEL.replace("[-90", "[" + HUGE), MODEL.replace("[-90, 90]", HUGE),
    MODEL.replace(LIMITS, "joint_limits_deg: %s\n" % HUGE), MODEL.replace("family: three", "family: %s #" % HUGE),
    MODEL + "name: " + HUGE, MODEL + "note: " + HUGE, MODEL + "sources: " + HUGE, MODEL + "dh_confidence: " + HUGE,
    MODEL + "sources: [%s]" % HUGE])
def test_a_number_of_thousands_of_digits_in_a_model_is_refused(text, tmp_path):
    with pytest.raises(InvalidCommand, match="model file "):
        read_model(text, tmp_path)


@pytest.mark.parametrize("read, text", [
    (read_dialect, "frame_delay: " + HUGE), (read_beginning, "collision_level: " + HUGE),
    (read_beginning, "joints: " + HUGE), (read_beginning, "joints: [%s]" % ", ".join([HUGE] * 6)),
    (read_beginning, "tool: {id: %s}" % HUGE), (read_beginning, "tool: {? %s : 1}" % HUGE),
    (read_beginning, "payload: {mass: %s, centroid: [0, 0, 0]}" % HUGE), (read_beginning, "programs: [%s]" % HUGE),
    (read_beginning, "programs: %s" % HUGE),
    (read_beginning, "terminals: {cabinet: {digital_inputs: {%s : 1}}}" % HUGE),
    (read_beginning, "terminals: {? %s : 1}" % HUGE), (read_beginning, "terminals: {cabinet: {? %s : 1}}" % HUGE),
    (read_beginning, "terminals: {cabinet: {digital_inputs: [%s]}}" % HUGE)])
def test_a_number_of_thousands_of_digits_in_a_file_of_the_simulation_is_refused(read, text, tmp_path):
    with pytest.raises(InvalidCommand, match="file "):
        read(text, tmp_path)


def test_values_are_shown_short():
    assert short("a" * 9) == "'aaaaaaaaa'" and len(short("a" * 9000)) < 40 and short([1.5, 2]) == "[1.5, 2]"
    assert len(short(int(HUGE, 16))) < 60 and len(short([int(HUGE, 16)])) < 60  # Python 3.8 may print them
