"""``jaka_bag report``: its page's account of an accident, and that a browser draws it."""
import html.parser
import math
import os
import re
import shutil
import subprocess

import pytest
from accident_samples import CALLS, DIAGNOSTICS, STATES, call, diagnostics, states
from log_samples import JOINTS, START_NS, TOOL, Sample, joints, tool, write

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import create_log
from jaka_bag.messages.selection import TimePoint
from jaka_blackbox.incident.loading import load_incident
from jaka_blackbox.incident.page import incident_page
from jaka_blackbox.incident.seconds import events_of, seconds_of

CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
STOP_S = 6.3
"""Time from the log's start to the emergency stop, s; the arm moves from 4 s on."""


def accident(error="out of reach", caller="/cell"):
    """Return messages of ten seconds: rest, a call, a motion, an emergency stop, a failed call; a silence of the
    poses."""
    samples = []
    for number in range(1250):
        at = number * 0.008
        moving = max(0.0, min(at, STOP_S) - 4.0)
        time = START_NS + int(at * 1e9)
        samples.append(joints(number, time, [0.4 * moving, 1.5, -1.5, 1.5, 1.5, 0.0]))
        place = [0.5 * math.cos(0.4 * moving), 0.5 * math.sin(0.4 * moving), 0.3]
        if not 8.0 < at < 8.6:
            samples.append(tool(number, time + 10, [*place, 0.0, 0.0, 0.0]))
        samples.append(Sample(STATES, time + 20, states(2 if at > STOP_S else 3 if at >= 4.0 else 0, 1, 0, 0)))
    for at, success, text in ((3.9, True, ""), (7.2, False, error)):
        time = START_NS + int(at * 1e9)
        samples.append(Sample(CALLS, time + 250_000_000, call(
            "/jaka_driver/joint_move", success, text, caller, time_ns=time)))
    for second in range(10):
        time = START_NS + second * 10**9 + 5_000_000
        samples.append(Sample(DIAGNOSTICS, time, diagnostics(
            {"jaka_driver: emergency stop": 2 if second >= 7 else 0, "jaka_driver: guard": 1}, second, time_ns=time)))
    return sorted(samples, key=lambda sample: sample.time)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Write a log as a black box does."""
    path = tmp_path_factory.mktemp("log") / "blackbox.mcap"
    with create_log(path) as writer:
        writer.add_metadata("jaka_bag.trigger", {
            "number": "1", "kind": "emergency_stop", "detail": "motion_state is 2, emergency stop",
            "topic": STATES.topic, "time_ns": str(START_NS + int((STOP_S + 0.004) * 1e9))})
        writer.add_metadata("jaka_bag.accident", {"host": "cell-7", "clock": "not synchronised", "before_s": "60"})
        writer.add_metadata("jaka_bag.drops", {"/jaka_driver/tool_position": '{"missing": 74}', STATES.topic: '{}'})
        writer.add_attachment("robot_description.urdf", b"<robot/>", "application/xml")
        channels = {}
        for sample in accident():
            if sample.connection not in channels:
                channels[sample.connection] = writer.add_channel(sample.connection)
            writer.add_message(channels[sample.connection], sample.time, sample.data)
    return path


def test_joints_keep_their_names_whatever_the_order_of_a_message(tmp_path):
    turned = []
    for number, sample in enumerate(accident()):
        if sample.connection == JOINTS and number % 2:
            names = ["joint_%d" % joint for joint in (6, 5, 4, 3, 2, 1)]
            sample = joints(number, sample.time, [0.0, 1.5, 1.5, -1.5, 1.5, 0.25], names)
        turned.append(sample)
    (motion,) = load_incident(write(tmp_path / "log.mcap", turned)).joints.values()
    assert motion.names == tuple("joint_%d" % joint for joint in range(1, 7))
    assert (motion.value[:, 1:] == [1.5, -1.5, 1.5, 1.5, 0.0]).all()


def test_each_second_tells_what_happened_in_it(log):
    incident = load_incident(log)
    seconds = {second.start: second for second in seconds_of(incident)}
    at_stop = " ".join(event.words for event in seconds[0].events)
    assert "TRIGGER emergency_stop" in at_stop and "motion_state: running -> emergency stop" in at_stop
    before = seconds[-3].events
    assert any("joint_move called by /cell" in event.words and event.sort == "call" for event in before)
    assert [event.sort for event in seconds[1].events if "FAILED" in event.words] == ["failed"] or [
        event.sort for event in seconds[0].events if "FAILED" in event.words] == ["failed"]
    assert seconds[-1].joint[0] == "joint_1" and seconds[-1].joint[1] == pytest.approx(0.4, rel=0.1)
    assert seconds[-1].tool == pytest.approx(0.2, rel=0.1)
    assert [event.sort for event in seconds[-7].events] == ["diagnostics"]  # the guard's warning is first seen there
    assert seconds[-6].is_quiet and seconds[-6].end == -3
    assert any(event.sort == "silence" and "tool_position" in event.words for event in events_of(incident))
    assert incident.facts["host"] == "cell-7" and incident.counts["/jaka_driver/joint_position"] == 1250


def shown(samples, tmp_path):
    """Return the incident of a log, looked at where the arm was stopped."""
    tmp_path.mkdir(exist_ok=True)
    return load_incident(write(tmp_path / "log.mcap", samples), TimePoint(int(STOP_S * 1e9), False), 6.0, 20.0)


def test_a_driver_that_dies_is_a_silence_to_the_end_and_no_state_and_no_line_goes_on(tmp_path):
    last = START_NS + int(7.0 * 1e9)
    incident = shown([one for one in accident() if one.time <= last or one.connection == CALLS], tmp_path)
    until = incident.span[1]
    ended = {one.topic: one for one in incident.silences if one.end == until}
    assert set(ended) == {JOINTS.topic, TOOL.topic, STATES.topic}
    assert all(one.start == pytest.approx(7.0 - STOP_S, abs=0.02) for one in ended.values())
    words = [event.words for event in events_of(incident) if event.sort == "silence"]
    assert sum("nor until the end of what is shown" in one for one in words) == 3
    bars = re.findall(r"motion_state emergency stop from (\S+) s to (\S+) s", incident_page(incident))
    assert [(float(a), float(b)) for a, b in bars] == [
        (pytest.approx(0.0, abs=0.02), pytest.approx(7.0 - STOP_S, abs=0.02))]


def test_a_status_that_is_not_reported_any_more_does_not_go_on(tmp_path):
    samples = [one for one in accident() if one.connection != DIAGNOSTICS or one.time < START_NS + 5 * 10**9]
    incident = shown(samples, tmp_path)
    assert incident.ended == {name: pytest.approx(4.005 - STOP_S, abs=1e-6)
                              for name in ("jaka_driver: emergency stop", "jaka_driver: guard")}
    words = [event.words for event in events_of(incident)]
    assert "jaka_driver: guard: not reported any more" in words
    widths = [float(width) for width in re.findall(
        r"guard: WARN, level 1</title><rect x=\"\S+\" y=\"\d+\" width=\"(\S+)\"", incident_page(incident))]
    whole = [float(width) for width in re.findall(
        r"guard: WARN, level 1</title><rect x=\"\S+\" y=\"\d+\" width=\"(\S+)\"", incident_page(
            shown(accident(), tmp_path / "whole")))]
    assert len(widths) == len(whole) == 1 and widths[0] < 0.5 * whole[0]
    assert not load_incident(tmp_path / "whole" / "log.mcap").ended


def test_a_state_of_the_last_message_is_shown(tmp_path):
    last = max(one.time for one in accident() if one.connection == STATES and one.time <= START_NS + STOP_S * 1e9)
    samples = [one for one in accident() if one.connection != STATES or one.time < last]
    text = incident_page(shown([*samples, Sample(STATES, last, states(4, 1, 0, 0))], tmp_path))
    assert "motion_state error from" in text


def test_no_line_is_led_over_a_silence_or_a_value_that_is_no_number(log, tmp_path):
    def pieces(incident):
        return re.search(r"Speed of /jaka_driver/tool_position.*?<path class=\"candidate\" d=\"([^\"]*)", incident_page(
            incident), re.DOTALL).group(1).count("M")

    assert pieces(load_incident(log)) == 2
    assert pieces(shown([one for one in accident() if one.time < START_NS + 8 * 10**9], tmp_path)) == 1


def test_a_tool_that_moves_is_no_rest_and_a_second_without_samples_is_said_to_have_none(tmp_path):
    incident = shown([one for one in accident() if one.connection in (TOOL, CALLS)
                      and not 8.0 < (one.time - START_NS) / 1e9], tmp_path)
    seconds = {second.start: second for second in seconds_of(incident)}
    assert not seconds[-2].is_quiet and seconds[-2].tool == pytest.approx(0.2, rel=0.1)
    assert "nothing happened" in incident_page(incident)
    calls = shown([one for one in accident() if one.connection == CALLS], tmp_path / "calls")
    assert "no joints, no tool point recorded" in incident_page(calls)
    assert "nothing happened" not in incident_page(calls)


def test_a_joint_without_a_number_hides_no_other_and_the_fastest_of_a_quiet_time_counts(tmp_path):
    samples = [joints(number, START_NS + number * 8_000_000, [
        0.5 * max(0.0, number * 0.008 - 6.0), math.nan, 0.0, 0.0, 0.0, 0.001 * max(0.0, number * 0.008 - 3.0)])
        for number in range(1250)]
    seconds = {second.start: second for second in seconds_of(shown(samples, tmp_path))}
    assert seconds[1].joint == ("joint_1", pytest.approx(0.5, rel=0.1))
    first = min(seconds)
    assert seconds[first].is_quiet and seconds[first].joint == ("joint_6", pytest.approx(0.001, rel=0.1))


def test_what_is_left_out_is_said(tmp_path):
    samples = accident()
    for number in range(2100):
        time = START_NS + 5 * 10**9 + number * 1000
        samples.append(Sample(CALLS, time, call("/jaka_driver/get_io", True, "", "/cell", time_ns=time)))
    for number in range(900):
        samples.append(Sample(STATES, START_NS + 9 * 10**9 + number * 1000, states(number % 2, 1, 0, 0)))
    text = incident_page(shown(sorted(samples, key=lambda one: one.time), tmp_path))
    assert "102 more rows are left out." in text
    assert "get_io (first 400 of 2100)" in text and "motion_state (first 400 of 9" in text


def test_values_that_cannot_be_shown_are_named(tmp_path):
    other = JOINTS._replace(definition="float64[] position\n", md5sum="0" * 32)
    samples = [*accident(), Sample(other, START_NS + 10**10, b"\0\0\0\0"), Sample(CALLS, START_NS + 10**10, b"\1")]
    incident = shown(samples, tmp_path)
    assert incident.gaps == ["%s has 2 definitions: its values are not shown" % JOINTS.topic,
                             "%s: 1 messages are not what its definition says, and are not shown" % CALLS.topic]
    assert all(one in incident_page(incident) for one in incident.gaps)


class Outline(html.parser.HTMLParser):
    """The tags of a page in balance, names used once, and links that lead somewhere."""

    def __init__(self, text):
        super().__init__()
        self.open, self.names, self.links, self.tags = [], [], [], set()
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.names += [value for name, value in attrs if name == "id"]
        self.links += [value for name, value in attrs if name in ("href", "src")]
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.add(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag


def test_the_page_is_whole_and_needs_nothing(log):
    text = incident_page(load_incident(log))
    outline = Outline(text)
    assert len(set(outline.names)) == len(outline.names)
    assert outline.links and all(link[1:] in outline.names for link in outline.links)
    assert not {"script", "img", "iframe", "link"} & outline.tags
    assert not re.search(r"https?:|@import|url\(", text)
    assert "nan" not in "".join(re.findall(r' d="[^"]*"', text)).lower()
    for words in ("74 missing by header.seq", "robot_description.urdf", "not synchronised", "out of reach", "/cell"):
        assert words in text, words


def test_what_logs_say_cannot_break_the_page(tmp_path):
    evil = "</td><script>alert('x')</script>&\x00"
    path = write(tmp_path / "a<b>&.mcap", accident(evil, evil))
    text = incident_page(load_incident(path))
    Outline(text)
    assert "<script" not in text


def test_without_a_black_box_the_first_fault_or_a_moment_is_looked_at(tmp_path, capsys):
    path = write(tmp_path / "run.bag", accident())
    assert main(["report", str(path)]) == 0
    assert "emergency_stop, motion_state is 2" in capsys.readouterr().out
    assert main(["report", str(path)]) == 1 and "exists" in capsys.readouterr().err
    page = tmp_path / "part.html"
    assert main(["report", str(path), "--at", "2", "--before", "1s", "--after", "1s", "-o", str(page)]) == 0
    assert "from -1.0 s to +1.0 s" in page.read_text(encoding="utf-8")
    rest = write(tmp_path / "rest.bag", [sample for sample in accident() if sample.connection is JOINTS])
    assert main(["report", str(rest)]) == 2
    assert "say with --at" in capsys.readouterr().err


def test_a_browser_draws_the_page_without_complaint(log, tmp_path):
    assert CHROMIUM, "chromium is missing; tools/dev setup installs it"
    page = tmp_path / "report.html"
    page.write_text(incident_page(load_incident(log)), encoding="utf-8")
    picture = tmp_path / "report.png"
    done = subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--enable-logging=stderr",
         "--user-data-dir=%s" % (tmp_path / "profile"), "--window-size=1100,2600", "--screenshot=%s" % picture,
         page.as_uri()], capture_output=True, timeout=240, check=True, env=dict(os.environ, HOME=str(tmp_path)))
    assert b"CONSOLE" not in done.stderr, done.stderr
    assert picture.stat().st_size > 40000
