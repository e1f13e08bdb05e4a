"""Every field of every topic is compared: a defect in any of them is found, and an unchanged run is the same."""
import json

import pytest
from content_logs import TOPICS, Entry, changed, entries, fields_of, write_entries

from jaka_bag.cli.main import main
from jaka_bag.compare.checks.content_checks import repeats_more_or_less
from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.report.text import as_data
from jaka_bag.compare.runs import windows
from jaka_bag.compare.tolerances import parse_tolerances
from jaka_bag.operations import columns

ALL = [(topic.connection.topic, name) for topic in TOPICS for name in fields_of(topic.value(1.0, 1))
       if not name.endswith("header.seq")]


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    return write_entries(tmp_path_factory.mktemp("contents") / "golden.mcap", entries())


def compared(golden, tmp_path, some, tolerances=""):
    return compare_logs(golden, write_entries(tmp_path / "candidate.mcap", some), parse_tolerances(tolerances))


def other(value):
    """Return a clearly other value of the same type."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value + 2.0
    if isinstance(value, str):
        return value + "x"
    if isinstance(value, bytes):
        return bytes([value[0] ^ 1]) + value[1:]
    if isinstance(value, tuple):
        return value[0] + 1, value[1]
    return [other(value[0])] + value[1:]


@pytest.mark.parametrize("seed, late_s", [(0, 0.0), (1, 0.0), (2, 0.3)])
def test_an_unchanged_run_is_the_same(seed, late_s, golden, tmp_path):
    comparison = compared(golden, tmp_path, entries(seed, late_s))
    assert comparison.same, comparison.differences


@pytest.mark.parametrize("topic, name", ALL)
def test_another_value_of_any_field_is_found(topic, name, golden, tmp_path):
    found = compared(golden, tmp_path, changed(entries(1), topic, name, other)).differences
    assert found and (topic == "/joint_states" or {check.topic for check in found} == {topic}), found


@pytest.mark.parametrize("again, is_same", [
    (lambda one: one.replace("4711_1795766900123", "815_1795766999456").replace("6913.24", "6999.5"), True),
    (lambda one: one.replace("-1-", "-2-"), False), (lambda one: one.replace("cell", "planner"), False)])
def test_the_goal_of_another_run_is_the_same_by_its_node_and_number(again, is_same, golden, tmp_path):
    some = changed(entries(1), "/arm/status", "status_list.goal_id.id", again)
    assert compared(golden, tmp_path, some).same is is_same


def test_what_was_asked_of_a_driver_by_a_message_is_told_before_what_follows(golden, tmp_path):
    some = changed(entries(1), "/cell/level", "data", other)
    assert compared(golden, tmp_path, some).beginning.topic == "/cell/level"
    some = changed(some, "/arm/command", "data", other, lambda entry: entry.time > 3.0)
    assert compared(golden, tmp_path, some).beginning.topic == "/arm/command"


@pytest.mark.parametrize("end, is_same", [(2.02, True), (2.2, False)])
def test_a_goal_may_be_seen_pending_for_a_moment(end, is_same, golden, tmp_path):
    some = changed(entries(1), "/arm/status", "status_list.status", lambda status: 0,
                   lambda entry: 1.99 <= entry.time < end)
    assert compared(golden, tmp_path, some).same is is_same


@pytest.mark.parametrize("topic, name", [one for one in ALL if "stamp" not in one[1]])
def test_another_value_for_half_a_second_is_found(topic, name, golden, tmp_path):
    some = changed(entries(1), topic, name, other, lambda entry: 3.7 <= entry.time < 4.3)
    assert compared(golden, tmp_path, some).differences


def value_at(topic, name, now, number):
    """Return one field of the message that a topic would have at a time, as text."""
    value = topic.value(now, number)
    for part in name.split("."):
        value = [one[part] for one in value] if isinstance(value, list) else value[part]
    return repr(value)


VARYING = [(topic.connection.topic, name) for topic in TOPICS for name in fields_of(topic.value(1.0, 1))
           if topic.rate and "header" not in name
           and len({value_at(topic, name, 0.37 * number, number) for number in range(20)}) > 4]


@pytest.mark.parametrize("topic, name", VARYING)
def test_values_of_a_second_ago_are_found(topic, name, golden, tmp_path):
    past = []

    def old(value):
        past.append(value)
        return past[max(len(past) - 1 - int(next(t.rate for t in TOPICS if t.connection.topic == topic)), 0)]
    assert compared(golden, tmp_path, changed(entries(1), topic, name, old)).differences


@pytest.mark.parametrize("topic, name", [
    ("/cell/wrench", "wrench.force.x"), ("/cell/wrench", "wrench.force.y"), ("/cell/wrench", "wrench.torque.y"),
    ("/cell/level", "data"), ("/joint_states", "velocity"), ("/joint_states", "effort")])
@pytest.mark.parametrize("factor", [57.0, -1.0, 1000.0])
def test_another_unit_or_sign_is_found(topic, name, factor, golden, tmp_path):
    def scale(value):
        return [factor * one for one in value] if isinstance(value, list) else factor * value
    assert {check.topic for check in compared(golden, tmp_path, changed(entries(1), topic, name, scale)).differences
            } == {topic}


def test_messages_that_only_one_of_the_logs_stamps_are_found(golden, tmp_path):
    bare = changed(entries(1), "/cell/wrench", "header.stamp", lambda stamp: (0, 0))
    path = write_entries(tmp_path / "bare.mcap", bare)
    for one, other_log in ((golden, path), (path, golden)):
        found = compare_logs(one, other_log).differences
        assert ("/cell/wrench", "header.stamp") in {(check.topic, check.field) for check in found}


@pytest.mark.parametrize("has_disk", [True, False])
def test_logs_too_long_to_be_kept_are_compared_alike(has_disk, tmp_path, monkeypatch):
    some = changed(entries(1), "/cell/pose", "header.frame_id", other, lambda entry: entry.time > 4.0)
    some = changed(some, "/tf", "transforms.transform.translation.x", other, lambda entry: entry.time > 6.0)
    paths = [write_entries(tmp_path / name, one, 8000) for name, one in (
        ("golden.mcap", entries()), ("same.mcap", entries(1)), ("other.mcap", some))]

    def outcomes():
        """Return all outcomes, without what rounding leaves."""
        return [json.loads(json.dumps(as_data(compare_logs(paths[0], path))),
                           parse_float=lambda text: round(float(text), 8)) for path in paths[1:]]

    whole = outcomes()
    # without a disk each window reads the log anew: few of them are enough
    monkeypatch.setattr(windows, "_WINDOW_ROWS", 700 if has_disk else 4000)
    monkeypatch.setattr(windows, "_CELL_S", 1.0 if has_disk else 3.0)
    monkeypatch.setattr(windows, "_KEPT_BYTES", 20000)
    if not has_disk:
        monkeypatch.setattr(windows._Store, "put", lambda store, number, rows: None)
    monkeypatch.setattr(columns, "_GROUP_BYTES", 1000)
    assert outcomes() == whole
    assert whole[0]["same"] and not whole[1]["same"]


def test_a_json_message_of_other_bytes_is_found(golden, tmp_path):
    some = [entry._replace(value={"step": 9}) if entry.topic == "/cell/json" and entry.value["step"] == 3 else entry
            for entry in entries(1)]
    assert {check.topic for check in compared(golden, tmp_path, some).differences} == {"/cell/json"}


@pytest.mark.parametrize("topic", ["/jaka_driver/io_states", "/cell/order", "/cell/ten", "/cell/json"])
def test_of_a_topic_on_change_a_message_more_or_less_or_in_another_place_is_found(topic, golden, tmp_path):
    some = entries(1)
    places = [i for i, entry in enumerate(some) if entry.topic == topic]
    lacking = some[:places[4]] + some[places[4] + 1:]
    double = sorted(some + [some[places[3]]._replace(time=some[places[3]].time + 0.001)], key=lambda one: one.time)
    swapped = list(some)
    for i, j in ((places[2], places[3]), (places[3], places[2])):
        swapped[i] = Entry(topic, some[i].time, some[j].value)
    for wrong in (lacking, double, swapped):
        assert topic in {check.topic for check in compared(golden, tmp_path, wrong).differences}


def test_topics_on_change_have_no_rate(golden, tmp_path):
    checks = compared(golden, tmp_path, entries(1)).checks
    assert not [check for check in checks if check.topic == "/jaka_driver/io_states"
                and check.aspect.value in ("rates", "jitter", "gaps")]


@pytest.mark.parametrize("length", [6.6, 6.61, 6.79, 10.83, 14.0, 4.2])
def test_repeats_of_a_longer_log_are_allowed_wherever_its_period_begins(length):
    # Seen: 32 repeats in 6.6 s, 54 in another log that is longer by two thirds.
    def repeats(seconds, phase):
        return int((seconds - phase) / 0.2)

    for begin in range(20):
        ours = repeats(6.6, begin / 100.0)
        slack = 1 + repeats_more_or_less(ours, abs(length - 6.6) / 6.6)  # a steady topic may differ by one
        for other_begin in range(20):
            theirs = repeats(length, other_begin / 100.0)
            assert abs(theirs - ours) <= slack
            assert slack <= abs(round((length - 6.6) / 0.2)) + 4, "more than the ends of both logs"


def test_coverage_names_what_is_not_compared(golden, tmp_path, capsys):
    path = write_entries(tmp_path / "candidate.mcap", entries(1))
    assert main(["compare", str(golden), str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("13 of 13 topics, 64 of 64 fields")
    assert main(["compare", str(golden), str(path), "--strict"]) == 0
    left_out = tmp_path / "left_out.yaml"
    left_out.write_text("ignore_topics: ['/cell/level']\nignore_fields: ['/cell/mode text']\n")
    assert main(["compare", str(golden), str(path), "--tolerances", str(left_out), "--strict"]) == 1
    output = capsys.readouterr()
    assert "not compared: /cell/level (ignore_topics), /cell/mode text (ignore_fields)" in output.out
    assert "--strict: " in output.err
    left_out.write_text("ignore_fields: ['/cell/mode text']\n")
    assert main(["compare", str(golden), str(path), "--tolerances", str(left_out), "--strict"]) == 0


def test_a_field_that_is_left_out_may_be_other(golden, tmp_path):
    some = changed(entries(1), "/cell/mode", "text", other)
    assert compared(golden, tmp_path, some).differences
    assert compared(golden, tmp_path, some, "ignore_fields: ['/cell/mode text']").same
