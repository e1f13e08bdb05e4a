"""The dimensions of the simulated controller, which show on the wire with each value; files and seeds make dialects."""
import json
import random

import pytest
from dialect_probes import CONTEXT, PROBES, Wire
from good_requests import GOOD
from raw_client import RawFeed

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Start
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES, Range
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect
from jaka_ros_driver.simulation.simulated_controller import SimulatedController


def test_every_dimension_has_a_probe():
    assert list(PROBES) == list(DIMENSIONS)


@pytest.mark.parametrize("name", DIMENSIONS)
def test_each_value_of_a_dimension_shows_on_the_wire(name):
    usual = Dialect.default("1.5.14").replaced(CONTEXT.get(name, {}))
    seen = [PROBES[name](usual.replaced({name: value})) for value in DIMENSIONS[name].samples()]
    assert len(seen) >= 2
    assert PROBES[name](usual.replaced({name: DIMENSIONS[name].samples()[0]})) == seen[0], "it differs by itself"
    for number, one in enumerate(seen):
        assert one not in seen[:number], "%r and an earlier value look alike" % (DIMENSIONS[name].samples()[number],)


def test_only_moves_with_a_tolerance_on_one_line_at_one_speed_are_run_through():
    stops, blends = (PROBES["joint_blend"](Dialect.default("1.5.14").replaced({"joint_blend": value}))
                     for value in (False, True))
    assert blends[0] < stops[0] - 0.3 and blends[1:] == stops[1:]


@pytest.mark.parametrize("at", [0.02, 0.4, 0.9, 1.2])
def test_a_move_that_comes_while_the_first_runs_is_joined_where_it_comes_in_time(at):
    wire = Wire(Dialect.default("1.5.14").replaced({"joint_blend": True}))
    path = [wire.joint()]
    for target, wait in ((10.0, at), (20.0, 3.0)):
        wire.ask("joint_move", jointPosition=[target, 90, -90, 90, 90, 0], speed=20.0, accel=40.0, tol=1.0)
        for _ in range(round(wait / CYCLE_TIME_S)):
            wire.step()
            path.append(wire.joint())
    steps = [b - a for a, b in zip(path, path[1:])]
    assert path[-1] == pytest.approx(20.0, abs=1e-3) and min(steps) > -1e-9 and max(steps) < 20.0 * 0.008 + 1e-3
    assert max(abs(b - a) for a, b in zip(steps, steps[1:])) < 1.1 * 40.0 * 0.008 ** 2 + 2e-4


def test_the_feed_is_sent_no_faster_than_the_dialect_allows():
    slow = Dialect.default("1.5.14").replaced({"shortest_feed_period": 0.1})
    with SimulatedController(dialect=slow) as arm, RawFeed(arm.status_port) as feed:
        feed.frame()
        began = arm.state()["simulated_s"]
        for _ in range(5):
            feed.frame()
        assert arm.state()["simulated_s"] - began > 0.38


def test_defaults_are_values_of_their_dimensions_and_firmwares_are_the_same_everywhere():
    assert tuple(name for name in FIRMWARES if FIRMWARES[name].name == name) == FIRMWARE_NAMES
    for firmware in FIRMWARES:
        usual = Dialect.default(firmware)
        assert Dialect.default("1.5.14").replaced(usual.as_dict()) == usual
    for name, dimension in DIMENSIONS.items():
        assert len(dimension.defaults) in (1, len(FIRMWARE_NAMES)) and dimension.meaning and dimension.evidence, name


def test_a_seed_draws_every_dimension():
    drawn = [Dialect.from_seed(seed, "1.7") for seed in range(400)]
    for name, dimension in DIMENSIONS.items():
        values = {getattr(one, name) for one in drawn}
        missing = [value for value in dimension.samples()[::2 if isinstance(dimension, Range) else 1]
                   if value not in values and (value == () or not isinstance(value, tuple))]
        assert not missing and dimension.default("1.7.2") in values and len(values) >= 2, name
        for value in values:
            assert dimension.checked(value) == value


def test_a_seed_draws_the_same_everywhere():
    # A seed that failed must name the same controller elsewhere and later; a new dimension may come beside it.
    drawn = Dialect.from_seed(7, "1.7").as_dict()
    assert {name: drawn[name] for name in SEED_7} == SEED_7
    assert Dialect.from_seed(7, "1.7") == Dialect.from_seed(7, "1.7.2") != Dialect.from_seed(8, "1.7")


@pytest.mark.parametrize("text", [
    "{inpos: never, start_delay: 3, io_index_base: 1, stop_ends_jog: false, missing_frame_fields: [paused]}",
    '{"inpos": "never", "start_delay": 3.0, "io_index_base": 1, "stop_ends_jog": false, '
    '"missing_frame_fields": ["paused"]}'])
def test_a_file_changes_what_it_names(tmp_path, text):
    (tmp_path / "one").write_text(text)
    read = Dialect.from_file(str(tmp_path / "one"), "1.7")
    assert read == Dialect.default("1.7").replaced({
        "inpos": "never", "start_delay": 3.0, "io_index_base": 1, "stop_ends_jog": False,
        "missing_frame_fields": ["paused"]})
    (tmp_path / "whole").write_text(json.dumps(Dialect.from_seed(5, "1.7").as_dict()))
    assert Dialect.from_file(str(tmp_path / "whole"), "1.5.14") == Dialect.from_seed(5, "1.7")


@pytest.mark.parametrize("text, words", [
    ("inposs: late", "'inposs' is no dimension"),
    ("inpos: soon", "inpos is 'soon'; it must be one of exact, early, late, never"),
    ("stop_ends_jog: 1", "stop_ends_jog is 1; it must be one of false, true"),
    ("io_index_base: true", "io_index_base is True; it must be one of 0, 1"),
    ("unready_code: 2", "unready_code is 2; it must be one of 2, sdk"),
    ("start_delay: 20.5", "start_delay is 20.5; it must be 0 to 20 s"),
    ("start_delay: -1", "start_delay is -1; it must be 0 to 20 s"),
    ("start_delay: .nan", "start_delay is nan; it must be 0 to 20 s"),
    ("start_delay: true", "start_delay is True"),
    ("start_delay: '3'", "start_delay is '3'"),
    ("frame_bytes: 100.5", "frame_bytes is 100.5; it must be 0 to 15000 bytes"),
    ("missing_frame_fields: [inpos]", "missing_frame_fields is .'inpos'.; it must be any of drag_status"),
    ("missing_commands: wait_complete", "missing_commands is 'wait_complete'; it must be any of"),
    ("[1, 2]", "it must hold names and values"), ("", "it must hold names and values"), ("{", "dialect file"),
    ("[" * 20000, "dialect file")])
def test_what_is_wrong_in_a_file_is_named(tmp_path, text, words):
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(InvalidCommand, match="dialect file .*wrong.yaml: .*" if words == "dialect file" else words):
        Dialect.from_file(str(path), "1.7")


@pytest.mark.parametrize("content", [None, b"\xff\xfe\x00"])
def test_a_file_that_cannot_be_read_is_named(tmp_path, content):
    path = tmp_path / "none.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InvalidCommand, match="none.yaml"):
        Dialect.from_file(str(path), "1.7")


def test_an_unknown_firmware_has_no_dialect():
    for make in (Dialect.default, lambda name: Dialect.from_seed(1, name)):
        with pytest.raises(InvalidCommand, match="one of 1.5.14, 1.7.1, 1.7.2, 1.7"):
            make("2.0")


@pytest.mark.parametrize("firmware", FIRMWARE_NAMES)
def test_no_dialect_breaks_the_controller(firmware):
    # Every good request in some order, in each of many dialects: nothing fails, jumps or is left unanswered.
    for seed in range(15):
        chance, dialect = random.Random(seed), Dialect.from_seed(seed, firmware)
        wire = Wire(dialect, chance.choice(list(Start)), firmware)
        asked, answered = 0, 0
        for command in chance.choices(sorted(GOOD), k=120):
            wire.send(command, **GOOD[command][0])
            asked += 1
            before = wire.controller.state.plant.joint_position
            answered += len(wire.replies_within(chance.choice([0.008, 0.04, 0.4])))
            after = wire.controller.state.plant.joint_position
            assert max(abs(a - b) for a, b in zip(before, after)) < 2.0, "seed %d: %s" % (seed, command)
            frame = wire.controller.feed_frame.text()
            assert json.loads(frame)["len"] == len(frame) and len(frame) <= 15000
            assert len(wire.controller.polled_frame.text()) <= 8990
        wire.send("stop_program")
        wire.send("resume_program")
        answered += len(wire.replies_within(60.0))
        assert answered == asked + 2 and not wire.controller.failures, "seed %d" % seed


def test_options_are_stronger_than_the_dialect():
    drawn = Dialect.from_seed(3, "1.5.14")
    arm = SimulatedController(dialect=drawn, power_delay=60.0, enable_delay=0.5, starvation="coast",
                              single_client="refuse", io_index_base=1)
    with arm:
        assert arm.dialect.replaced({"power_delay": drawn.power_delay, "enable_delay": drawn.enable_delay}) == (
            drawn.replaced({"starvation": "coast", "second_client": "refused", "io_index_base": 1}))
        assert (arm.dialect.power_delay, arm.dialect.enable_delay) == (60.0, 0.5)
        assert arm.server.controller.state.dialect == arm.dialect


SEED_7 = {
    "power_delay": 8.0, "power_reply": "held", "power_reply_delay": 6.203, "enable_delay": 4.0, "enable_reply": "early",
    "enable_reply_delay": 8.288, "frame_delay": 0.04, "frame_reply": "early", "frame_reply_delay": 0.0, "drag_delay":
    2.0, "drag_reply": "held", "drag_reply_delay": 7.653, "behind_slow_reply": "blocks", "start_delay": 18.595, "inpos":
    "never", "stop_ends_jog": True, "stop_ends_servo": False, "stop_ends_program": True, "jog_stop_ends": "its axis",
    "pause_pauses_moves": False, "servo_leave_delay": 0.1, "starvation": "hold", "refused_move_event": True,
    "disabled_note": "brief", "second_client": "replaces", "link_loss_notice": 2.719, "missing_commands": [],
    "error_code": "text", "unready_code": "2", "robot_state": "texts", "sensitivity_key": "both", "user_frame_key":
    "userffset", "io_index_base": 0, "unknown_reply_fields": True, "feed_period": 0.036, "shortest_feed_period": 0.001,
    "feed_period_persists": True, "frame_bytes": 0, "unknown_frame_fields": True, "missing_frame_fields":
    ["monitor_data"]}
