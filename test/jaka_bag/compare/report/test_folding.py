"""Differences that show the same thing on two topics: one line and one card, and still two checks."""
import math

import pytest
from content_logs import TOPICS
from import_graph import ROOT

from jaka_bag.compare.audit.editing import EditableLog, Item, read_log, write_log
from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.report.html import as_html
from jaka_bag.compare.report.text import as_text
from jaka_bag.compare.tolerances import Tolerances

GOLDEN = ROOT / "test" / "data" / "golden"
JOINTS, TOOL = "/jaka_driver/joint_position", "/jaka_driver/tool_position"
LATER_NS = 700_000


def pose_of(value):
    """Return the tool's pose as a transform."""
    vector = [value["twist"]["angular"][axis] for axis in "xyz"]
    angle = math.sqrt(sum(one * one for one in vector))
    share = math.sin(0.5 * angle) / angle if angle else 0.5
    rotation = dict(zip("xyzw", [share * one for one in vector] + [math.cos(0.5 * angle)]))
    return {"transforms": [{"header": {"seq": 0, "stamp": value["header"]["stamp"], "frame_id": "base"},
                            "child_frame_id": "flange", "transform": {
                                "translation": value["twist"]["linear"], "rotation": rotation}}]}


def doubled(source, off, begins=(3.0, 3.0)):
    """Return a log whose joints are on /joint_states, too, and whose tool is on /tf; both off for 0.4 s.

    Args:
        source: A log of one arm.
        off: Amounts: rad of joint 1, m of the tool along x.
        begins: Times from which they are off, s: of the driver's own topics, and of the others.
    """
    tf = next(topic.connection for topic in TOPICS if topic.connection.topic == "/tf")
    log = EditableLog([], {**source.connections, "/tf": tf,
                           "/joint_states": source.connections[JOINTS]._replace(topic="/joint_states")})

    def bent(item, begin):
        value = source.value(item)
        if begin < source.seconds(item) < begin + 0.4:
            if item.topic == JOINTS:
                value["position"][0] += off[0]
            else:
                value["twist"]["linear"]["x"] += off[1]
        return value

    items = []
    for item in source.items:
        if item.topic not in (JOINTS, TOOL):
            items.append(item)
            continue
        items.append(source.with_value(item, bent(item, begins[0])))
        topic, value = ("/joint_states", bent(item, begins[1])) if item.topic == JOINTS else (
            "/tf", pose_of(bent(item, begins[1])))
        items.append(log.with_value(Item(topic, item.time + LATER_NS, b""), value))
    return log.with_items(items)


def compared(tmp_path, golden, candidate):
    paths = [tmp_path / "golden.mcap", tmp_path / "candidate.mcap"]
    for log, path in zip((golden, candidate), paths):
        write_log(log, path)
    return compare_logs(*paths)


def told(comparison):
    return [line.split(": ")[0].split()[1] for line in as_text(comparison).splitlines()
            if line.startswith("DIFFERENT     ")]


@pytest.fixture(scope="module")
def source():
    return read_log(GOLDEN / "joint_moves.mcap")


def test_the_same_on_two_topics_is_one_line_and_one_card(source, tmp_path):
    found = compared(tmp_path, doubled(source, (0.0, 0.0)), doubled(source, (0.05, 0.01)))
    assert len(found.differences) == 4 and len(told(found)) == 2
    text, page = as_text(found), as_html(found, Tolerances())
    assert "   the same: /joint_states joints joint_1" in text
    assert "   the same: /tf fields base > flange.translation[0]" in text
    assert page.count('class="card bad"') == 2 and "<dt>also</dt><dd>/joint_states joints joint_1</dd>" in page
    assert "; 3 further differences" in text and "DIFFERENT: 4 of " in text, "none is lost from the counts"


@pytest.mark.parametrize("begins", [(3.0, 5.0), (5.0, 3.0)])
def test_what_begins_at_another_time_is_told_by_itself(source, tmp_path, begins):
    found = compared(tmp_path, doubled(source, (0.0, 0.0)), doubled(source, (0.05, 0.01), begins))
    assert len(told(found)) == len(found.differences) >= 4


def test_two_arms_are_told_one_by_one(tmp_path):
    source = read_log(GOLDEN / "two_arms.mcap")
    bent = source
    for arm in ("/left", "/right"):
        bent = bent.edited(arm + JOINTS, lambda value, _: value["position"].__setitem__(
            0, value["position"][0] + 0.05), 3.0, 3.4)
    topics = [topic for topic in told(compared(tmp_path, source, bent)) if topic.endswith("joint_position")]
    assert sorted(topics) == ["/left" + JOINTS, "/right" + JOINTS]
