import math
import os
import struct
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from log_samples import (
    JOINTS,
    POSE,
    START_NS,
    Sample,
    connection,
    header,
    in_order,
    model,
    pose,
    state_log,
    text,
    write,
)

from jaka_bag.cli.main import main
from jaka_bag.errors import BagError, MissingDependency
from jaka_bag.operations.columns import read_columns
from jaka_bag.operations.plot import Sketch, panels_of, plot, thin

SAMPLES = state_log(2.0)


@pytest.fixture
def data(tmp_path):
    return read_columns(write(tmp_path / "log.bag", SAMPLES))


def test_joints_tcp_states_and_path_are_drawn(data):
    panels, paths = panels_of(data)
    assert [(p.title.split("/")[-1], p.unit, len(p.lines)) for p in panels] == [
        ("joint_position  position", "rad", 6), ("tool_position  position", "m", 3),
        ("tool_position  rotation vector", "rad", 3), ("robot_states  motion_state", "", 1),
        ("robot_states  flags (0 low, 1 high)", "", 3)]
    assert list(paths) == ["/jaka_driver/tool_position"]
    assert [name for name, _, _ in panels[0].lines] == ["joint_%d" % i for i in range(1, 7)]
    assert np.array_equal(panels[0].lines[2][2], data["/jaka_driver/joint_position"].fields["position"][:, 2])
    assert dict(panels[3].ticks)[2] == "2 emergency stop"


def test_a_pose_called_tool_position_is_drawn_as_a_twist_of_the_same_pose_is(tmp_path):
    half = 0.25
    samples = [pose(i, START_NS + i * 10**7, [400.0 + i, -100.0, 300.0, 0.0, math.sin(half), 0.0, math.cos(half)])
               for i in range(20)]
    panels, paths = panels_of(read_columns(write(tmp_path / "pose.bag", samples)))
    assert [(p.unit, len(p.lines)) for p in panels] == [("m", 3), ("rad", 3)] and list(paths) == [POSE.topic]
    assert panels[0].lines[0][2][-1] == pytest.approx(0.419)
    assert [line[2][0] for line in panels[1].lines] == pytest.approx([0.0, 2.0 * half, 0.0])
    other = [sample._replace(connection=connection("/goal", POSE.datatype, POSE.definition)) for sample in samples]
    with pytest.raises(BagError, match="--field"):
        panels_of(read_columns(write(tmp_path / "goal.bag", other)))


def test_pictures_are_svg_and_png(data, tmp_path):
    plot(data, tmp_path / "log.svg", "log")
    root = ElementTree.parse(str(tmp_path / "log.svg")).getroot()
    assert root.tag.endswith("svg") and len(list(root.iter())) > 100
    plot(data, tmp_path / "log.png", "log")
    assert (tmp_path / "log.png").read_bytes().startswith(b"\x89PNG")


def test_any_number_can_be_drawn_and_others_are_refused(data):
    topic = "/jaka_driver/joint_position"
    panels, paths = panels_of(data, [(topic, "header.seq"), (topic, "position")])
    assert [len(p.lines) for p in panels] == [1, 6] and not paths
    with pytest.raises(BagError, match="no field nope; there are: header.seq"):
        panels_of(data, [(topic, "nope")])
    with pytest.raises(BagError, match="is no number"):
        panels_of(data, [(topic, "name")])
    with pytest.raises(BagError, match="no message of /nope"):
        panels_of(data, [("/nope", "x")])


def test_nothing_to_draw_is_said(tmp_path):
    with pytest.raises(BagError, match="--field"):
        panels_of(read_columns(write(tmp_path / "m.bag", [model(START_NS, "zu7")])))


def test_thinning_keeps_the_extremes():
    time = np.arange(100000) / 100.0
    values = np.sin(time)
    values[54321] = 9.0
    values[12345] = -9.0
    thin_time, thin_values = thin(time, values, 1000)
    assert len(thin_time) < 1100 and (np.diff(thin_time) > 0).all()
    assert thin_values.max() == 9.0 and thin_values.min() == -9.0
    assert (thin_time[0], thin_time[-1]) == (time[0], time[-1])
    constant = thin(time, np.full(len(time), 5.0), 1000)
    assert len(constant[0]) < 1100
    assert len(thin(time, np.where(time > 500, np.nan, values), 1000)[0]) < 1100


def test_the_program(tmp_path, capsys, monkeypatch):
    path = write(tmp_path / "log.bag", SAMPLES)
    assert main(["plot", str(path), "-s", "0.5", "--duration", "1"]) == 0
    assert "log.svg: 6 diagrams" in capsys.readouterr().out
    assert main(["plot", str(path), "-o", str(tmp_path / "log.gif")]) == 1
    assert ".svg, .png" in capsys.readouterr().err
    assert main(["plot", str(path), "-o", str(tmp_path / "f.png"), "--field", "/model:data"]) == 1
    assert main(["plot", str(path), "-t", "/nope"]) == 2
    assert "has no topic /nope" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingDependency, match="matplotlib"):
        plot(read_columns(path), tmp_path / "x.svg", "log")
    assert sorted(os.listdir(str(tmp_path))) == ["log.bag", "log.svg"]


def _turned(sample_names, count=100):
    """Return messages of joints at constant places, whose names come in the orders given, one after the other."""
    places = {"joint_1": 1.0, "joint_2": 2.0, "other": 3.0}
    samples = []
    for i in range(count):
        names = sample_names[i * len(sample_names) // count]
        samples.append(Sample(JOINTS, START_NS + i * 10**7, header(i, START_NS, "") + struct.pack("<I", len(names))
                              + b"".join(map(text, names)) + struct.pack("<I", len(names)) + struct.pack(
                                  "<%dd" % len(names), *[places[name] for name in names]) + struct.pack("<II", 0, 0)))
    return samples


@pytest.mark.parametrize("by_piece", [False, True])
def test_joints_are_drawn_under_their_own_names_whatever_the_order(tmp_path, by_piece):
    samples = _turned([("joint_1", "joint_2"), ("joint_2", "joint_1")])
    sketch = Sketch()
    for i, some in enumerate([samples[:50], samples[50:]] if by_piece else [samples]):
        for topic, columns in read_columns(write(tmp_path / ("%d.bag" % i), some)).items():
            sketch.add(topic, columns)
    lines = sketch.panels()[0][0].lines
    assert {name: set(values.tolist()) for name, _, values in lines} == {"joint_1": {1.0}, "joint_2": {2.0}}
    assert not sketch.notes


@pytest.mark.parametrize("by_piece", [False, True])
def test_no_line_is_led_over_a_gap_and_a_state_lasts_to_it(tmp_path, by_piece):
    parts = [[one for one in SAMPLES if one.time < START_NS + 9 * 10**8],
             [one for one in SAMPLES if one.time > START_NS + 15 * 10**8]]
    sketch = Sketch()
    for i, some in enumerate(parts if by_piece else [parts[0] + parts[1]]):
        for topic, columns in read_columns(write(tmp_path / ("%d.bag" % i), some)).items():
            sketch.add(topic, columns)
    panels = sketch.panels()[0]
    assert len(panels) > 3
    for panel in panels:
        for name, time, values in panel.lines:
            (gap,) = time[np.isnan(values)]
            assert 0.9 < gap < 1.5, name
            if panel.is_steps:
                assert time[time < gap][-1] == pytest.approx(0.9, abs=0.02) and time[time > gap][0] < 1.52


def test_what_comes_now_and_then_is_one_line(tmp_path):
    times = [START_NS + int(at * 1e9) for at in np.cumsum(np.random.default_rng(3).exponential(0.5, 60))]
    samples = [one._replace(time=time) for one, time in zip(
        [one for one in SAMPLES if one.connection == JOINTS], times)]
    ((panel,), _) = panels_of(read_columns(write(tmp_path / "log.bag", samples)))
    assert not any(np.isnan(values).any() for _, _, values in panel.lines)


def test_joints_of_changing_names_are_left_out_with_a_note(tmp_path, capsys):
    log = write(tmp_path / "log.bag", in_order(_turned([("joint_1", "joint_2"), ("joint_1", "other")])
                                               + [s for s in SAMPLES if s.connection != JOINTS]))
    assert main(["plot", str(log), "-o", str(tmp_path / "log.svg")]) == 1
    assert "%s is left out" % JOINTS.topic in "".join(capsys.readouterr())
    panels, _ = panels_of(read_columns(log))
    assert panels and not any(panel.title.startswith(JOINTS.topic) for panel in panels)
