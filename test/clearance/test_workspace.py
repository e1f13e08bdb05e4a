"""Workspaces from mappings and files: read back as they were, and refused with file, key, value and range."""
import math

import pytest
import yaml

from jaka_ros_driver.clearance.workspace import (
    MOST_BYTES,
    MOST_ITEMS,
    NO_ZONES,
    Box,
    load_workspace,
    workspace_of,
    workspace_of_text,
)
from jaka_ros_driver.errors import InvalidCommand

BOX = {"name": "press", "centre": [0.6, 0.0, 0.2], "size": [0.3, 0.4, 0.4]}
EVERYTHING = {
    "keep_out": [dict(BOX, rpy=[0.0, 0.0, 0.5])],
    "keep_in": [dict(BOX, name="cell")],
    "cylinders": [{"name": "post", "foot": [0, -0.7, 0.0], "height": 1, "radius": 0.05}],
    "floor": -0.01,
    "tool": [{"name": "gripper", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.15], "radius": 0.04}],
}


def test_a_workspace_reads_back_as_it_was():
    workspace = workspace_of(EVERYTHING)
    assert workspace_of(workspace.as_mapping()) == workspace
    assert workspace.keep_in == (Box("cell", (0.6, 0.0, 0.2), (0.3, 0.4, 0.4), (0.0, 0.0, 0.0)),)
    assert workspace.tool[0].frame == 6
    assert workspace_of(NO_ZONES.as_mapping()) == NO_ZONES == workspace_of({})


def test_a_file_is_the_mapping_in_it(tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_text(yaml.safe_dump(EVERYTHING))
    assert load_workspace(str(path)) == workspace_of(EVERYTHING)
    path.write_text("")
    assert load_workspace(str(path)) == NO_ZONES
    path.write_text(yaml.safe_dump(workspace_of(EVERYTHING).as_mapping()))
    assert load_workspace(str(path)) == workspace_of(EVERYTHING)


@pytest.mark.parametrize("mapping", [
    {}, EVERYTHING, {"floor": 1e-7}, {"keep_in": [dict(BOX, name="Zelle: \u00e4 #1 " * 6)]}])
def test_a_workspace_reads_back_from_its_text_to_the_last_digit(mapping):
    workspace = workspace_of(mapping)
    assert workspace_of_text(workspace.as_yaml()) == workspace
    assert workspace_of_text(yaml.safe_dump(mapping)) == workspace


def test_a_summary_counts_every_kind():
    assert workspace_of(EVERYTHING).summary() == "4 zones and 1 part of a tool"
    assert workspace_of({"floor": 0.0}).summary() == "1 zone and 0 parts of a tool"


@pytest.mark.parametrize("text, reason", [
    ("# nothing", "holds nothing"), ("", "holds nothing"), ("keep_out: [", "the yaml is no YAML"),
    ("[" * 5000, "the yaml is deeper than 60 levels"), ("floor: 2001-99-99", "the yaml is no YAML"),
    ("a\x00b", "the yaml is no YAML"), ("floor: 0 #" + "x" * MOST_BYTES, "more than 100000 bytes"),
    ("floor: 0 #" + "\u00e4" * (MOST_BYTES // 2), "more than 100000 bytes"),
    ("\udcff", "the yaml is no YAML"), ("just words", "must be a mapping"), ("floor: 11", "floor is 11"),
    ("!!python/object:os.system {}", "the yaml is no YAML")])
def test_texts_that_are_no_workspace_are_refused(text, reason):
    with pytest.raises(InvalidCommand, match=reason):
        workspace_of_text(text)


@pytest.mark.parametrize("mapping, words", [
    ([], ["workspace", "mapping"]),
    ({"keepout": []}, ["unknown key 'keepout'", "nearest known is keep_out"]),
    ({"keep_out": {}}, ["keep_out is {}", "list of at most 50"]),
    ({"keep_out": [BOX] * (MOST_ITEMS + 1)}, ["keep_out is a list of 51", "at most 50"]),
    ({"keep_out": [BOX, 3]}, ["keep_out 2 is 3", "mapping"]),
    ({"keep_out": [{"name": "press", "centre": [0, 0, 0]}]}, ["keep_out 1 lacks the key size"]),
    ({"keep_out": [dict(BOX, sise=[1, 1, 1])]}, ["keep_out 1", "'sise'", "nearest known is size"]),
    ({"keep_out": [dict(BOX, centre=[600.0, 0.0, 0.0])]}, ["keep_out 1: centre is 600.0", "from -10 to 10"]),
    ({"keep_out": [dict(BOX, centre=[0.0, 0.0])]}, ["keep_out 1: centre is [0.0, 0.0]", "three numbers"]),
    ({"keep_out": [dict(BOX, size=[0.0, 1.0, 1.0])]}, ["keep_out 1: size is 0.0", "from 0.001 to 20"]),
    ({"keep_out": [dict(BOX, rpy=[0.0, 0.0, 90.0])]}, ["keep_out 1: rpy is 90.0", "from -6.28319 to 6.28319"]),
    ({"keep_in": [dict(BOX, name="")]}, ["keep_in 1: name is ''", "1 to 100 characters"]),
    ({"keep_in": [dict(BOX, name="a\nb")]}, ["keep_in 1: name is 'a\\nb'"]),
    ({"keep_in": [dict(BOX, name=7)]}, ["keep_in 1: name is 7"]),
    ({"cylinders": [dict(EVERYTHING["cylinders"][0], height=math.nan)]}, ["cylinders 1: height is nan"]),
    ({"cylinders": [dict(EVERYTHING["cylinders"][0], radius=True)]}, ["cylinders 1: radius is True"]),
    ({"floor": "0"}, ["floor is '0'", "from -10 to 10"]),
    ({"floor": 10 ** 400}, ["floor is 1000", "from -10 to 10"]),
    ({"tool": [dict(EVERYTHING["tool"][0], end=[0, 0, 150])]}, ["tool 1: end is 150", "from -2 to 2"]),
    ({"keep_out": [BOX] * 50, "keep_in": [BOX] * 34}, ["84 zones and 6 parts", "504 pairs", "at most 500"]),
    ({"keep_out": [BOX] * 40, "tool": EVERYTHING["tool"] * 7}, ["40 zones and 13 parts", "520 pairs", "at most 500"]),
    ({"tool": [dict(EVERYTHING["tool"][0], radius=1.0)]}, ["tool 1: radius is 1.0", "from 0.001 to 0.5"]),
])
def test_wrong_workspaces_are_refused_with_place_value_and_range(mapping, words, tmp_path):
    with pytest.raises(InvalidCommand) as caught:
        workspace_of(mapping)
    for word in words:
        assert word in str(caught.value)
    assert len(str(caught.value)) < 300
    path = tmp_path / "cell.yaml"
    if mapping != {"floor": 10 ** 400}:  # YAML reads digits without end as slowly as Python prints them
        path.write_text(yaml.safe_dump(mapping))
        with pytest.raises(InvalidCommand, match=r"workspace file .*cell\.yaml: "):
            load_workspace(str(path))


@pytest.mark.parametrize("content", [
    b"keep_out: [", b"\xff\xfe\x00", b"!!python/object:os.system {}", b"[" * 5000, b"floor: 0 #" + b"x" * MOST_BYTES,
    b"a: &a [1]\nb: *c", b"? [1, 2]\n: 3", b"just words", b"floor: 2001-99-99", b"floor: " + b"9" * 5000,
    b"floor: 0x" + b"f" * 5000, b"keep_out: &a [*a]"])
def test_files_that_are_no_workspace_are_refused(content, tmp_path):
    path = tmp_path / "cell.yaml"
    path.write_bytes(content)
    with pytest.raises(InvalidCommand, match="workspace file"):
        load_workspace(str(path))


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(InvalidCommand, match="cannot be read"):
            load_workspace(str(path))


def test_an_alias_bomb_stays_small(tmp_path):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += ["a%d: &a%d [%s]" % (n, n, ", ".join(["*a%d" % (n - 1)] * 10)) for n in range(1, 12)]
    path = tmp_path / "cell.yaml"
    path.write_text("\n".join(lines + ["keep_out: *a11"]))
    with pytest.raises(InvalidCommand, match="unknown key 'a0'"):
        load_workspace(str(path))
    nested = "&a0 [x, x]"
    for n in range(1, 50):
        nested = "&a%d [%s, *a%d]" % (n, nested, n - 1)
    path.write_text("keep_out: [%s]" % nested)
    with pytest.raises(InvalidCommand, match="keep_out 1 is") as caught:
        load_workspace(str(path))
    assert len(str(caught.value)) < 2000
