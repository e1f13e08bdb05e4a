"""Text, JSON, JUnit and the page, of a good and of a bad run."""
import dataclasses
import html.parser
import json
import os
import re
import shutil
import subprocess
from xml.etree import ElementTree

import pytest
from seeded_defects import DEFECTS
from synthetic_session import Conditions, simulate, write_log

from jaka_bag.compare.comparison import compare_logs
from jaka_bag.compare.report.html import as_html
from jaka_bag.compare.report.junit import as_junit
from jaka_bag.compare.report.text import as_data, as_text
from jaka_bag.compare.tolerances import Tolerances

CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
VOID = {"meta", "br", "hr", "img", "input", "link"}


@pytest.fixture(scope="module")
def good(golden, program, tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "candidate.mcap"
    return compare_logs(golden, write_log(path, simulate(program, Conditions(seed=21, start_s=2.0))))


@pytest.fixture(scope="module")
def bad(golden, program, tmp_path_factory):
    session = simulate(program, Conditions(seed=22, start_s=2.0, jog_extra_s=1.0, pace=1.03))
    for name in ("1 mm offset", "a lost service reply", "a missed state"):
        DEFECTS[name].seed(session)
    session.joints[900:903, 3] += 0.05
    return compare_logs(golden, write_log(tmp_path_factory.mktemp("bad") / "candidate.mcap", session))


def test_text_of_a_good_run_is_four_lines(good):
    lines = as_text(good).splitlines()
    assert len(lines) == 4 and lines[-2].startswith("same: ")
    assert lines[-1].startswith("59 checks; 4 of 4 topics, 33 of 35 fields; not compared: /jaka_driver/service_calls c")
    assert len(as_text(good, verbose=True).splitlines()) > 30


def test_text_of_a_bad_run_names_the_worst_first_and_what_it_begins_with(bad):
    text = as_text(bad)
    assert "DIFFERENT     /jaka_driver/robot_states states motion_state: running for" in text.splitlines()[2]
    assert "/jaka_driver/joint_move calls: joint_move(" in text
    assert "it begins with: %s: " % bad.beginning.name in text
    assert text.splitlines()[-2].startswith("DIFFERENT: ")
    severities = [check.severity for check in bad.worst_first]
    assert severities == sorted(severities, reverse=True)
    assert bad.first_divergence.at == min(check.at for check in bad.differences if check.at is not None)


def test_json_holds_every_check_and_no_infinity(bad):
    data = json.loads(json.dumps(as_data(bad), allow_nan=False))
    assert data["same"] is False and len(data["checks"]) == len(bad.checks)
    assert {check["outcome"] for check in data["checks"]} <= {"same", "different", "not compared"}
    assert data["alignment"]["lag_s"] == pytest.approx(1.0, abs=0.6)


def test_the_page_says_which_of_the_two_is_ahead(good):
    page = as_html(good, Tolerances())
    assert "the candidate is %.3f s behind, found by" % good.alignment.lag in page
    turned = dataclasses.replace(good, alignment=dataclasses.replace(good.alignment, lag=-0.508))
    assert "the candidate is 0.508 s ahead, found by" in as_html(turned, Tolerances())


def articles(page):
    return re.findall("<article.*?</article>", page, re.DOTALL)


def test_the_page_shows_first_what_the_others_follow_from(bad):
    names = [re.search("<h3>(.*?)</h3>", one).group(1) for one in articles(as_html(bad, Tolerances()))]
    assert names[0] == html.escape(bad.beginning.name)
    worst = [html.escape(check.name) for check, _ in bad.folded]
    assert names[0] != worst[0] and names[1:] == [name for name in worst if name != names[0]]


def test_the_picture_of_a_moment_leaves_out_the_states_that_are_the_same_throughout(bad):
    card = next(one for one in articles(as_html(bad, Tolerances())) if "States and calls" in one)
    assert "the same throughout: power_state on, servo_state off, collision_state off" in card
    rows = re.findall('class="row"[^>]*>(.*?)</text>', card)
    assert "motion_state, golden" in rows and "power_state, golden" not in rows


def test_a_call_that_failed_is_told_with_its_error_beside_the_picture(bad):
    broken = [call._replace(success=False, error="out of <reach>") for call in bad.candidate.calls]
    page = as_html(dataclasses.replace(bad, candidate=dataclasses.replace(bad.candidate, calls=tuple(broken))),
                   Tolerances())
    assert "s of the candidate failed: out of &lt;reach&gt;" in "".join(articles(page))
    assert "failed: out of" not in "".join(articles(as_html(bad, Tolerances())))


def test_a_log_whose_activity_ends_early_is_told(bad, good):
    assert "ends early" not in as_html(good, Tolerances())
    short = dataclasses.replace(bad.candidate, calls=bad.candidate.calls[:1], joints={
        topic: dataclasses.replace(track, facts=dataclasses.replace(track.facts, motions=track.facts.motions[:1]))
        for topic, track in bad.candidate.joints.items()})
    found = re.search("after ([0-9.]+) s nothing is called or moves in the candidate; in the golden log until (.*) s<",
                      as_html(dataclasses.replace(bad, candidate=short), Tolerances()))
    assert float(found.group(1)) + 2.0 < float(found.group(2)) <= bad.golden.duration


def test_junit_has_a_case_for_each_check(bad, good):
    for comparison in (good, bad):
        root = ElementTree.fromstring(as_junit(comparison).encode())
        suite = root.find("testsuite")
        assert len(suite.findall("testcase")) == int(suite.get("tests")) == len(comparison.checks)
        assert len(suite.findall("testcase/failure")) == int(suite.get("failures")) == len(comparison.differences)


class Outline(html.parser.HTMLParser):
    """The tags of a page in balance, names used once, and the targets of its links."""

    def __init__(self, text):
        super().__init__()
        self.open, self.names, self.links, self.tags, self.pictures = [], [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append(tag)
        self.names += [attributes["id"]] if "id" in attributes else []
        self.links += [value for name, value in attrs if name in ("href", "src", "xlink:href", "action", "data")]
        if tag == "svg":
            self.pictures.append(attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag


@pytest.mark.parametrize("name", ["good", "bad"])
def test_the_page_is_whole_needs_nothing_and_tells_screen_readers_what_is_drawn(name, request):
    comparison = request.getfixturevalue(name)
    text = as_html(comparison, Tolerances())
    outline = Outline(text)
    assert len(set(outline.names)) == len(outline.names)
    assert all(link.startswith("#") and link[1:] in outline.names for link in outline.links)
    assert not {"script", "img", "iframe", "link"} & set(outline.tags)
    assert not re.search(r"https?:|@import|url\(", text)
    assert len(outline.pictures) > 10
    assert all(picture["role"] == "img" and picture["aria-labelledby"] for picture in outline.pictures)
    assert text.count("<h1>") == 1 and 'lang="en"' in text
    assert text.count('class="card bad"') == len(comparison.differences)
    assert "nan" not in "".join(re.findall(r' d="[^"]*"', text)).lower()


def test_what_logs_say_cannot_break_the_page(golden, program, tmp_path):
    session = simulate(program, Conditions(seed=23))
    session.calls[0] = session.calls[0]._replace(success=False, error="<script>alert('x')</script>&\x00\ufffe")
    comparison = compare_logs(golden, write_log(tmp_path / "a<b>&.mcap", session))
    Outline(as_html(comparison, Tolerances()))
    assert "<script>" not in as_html(comparison, Tolerances())
    ElementTree.fromstring(as_junit(comparison).encode())


def browse(page, folder, *arguments):
    return subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars",
         "--user-data-dir=%s" % (folder / "profile"), *arguments, page.as_uri()],
        capture_output=True, timeout=240, check=True, env=dict(os.environ, HOME=str(folder)))


@pytest.mark.parametrize("name", ["good", "bad"])
def test_a_browser_draws_the_page_without_complaint(name, request, tmp_path):
    assert CHROMIUM, "chromium is missing; tools/dev setup installs it"
    comparison = request.getfixturevalue(name)
    page = tmp_path / "report.html"
    page.write_text(as_html(comparison, Tolerances()), encoding="utf-8")
    done = browse(page, tmp_path, "--enable-logging=stderr", "--dump-dom")
    words = done.stderr.decode("utf-8", "replace")
    assert "CONSOLE" not in words, words
    dom = done.stdout.decode("utf-8")
    assert dom.count("<svg") == as_html(comparison, Tolerances()).count("<svg")
    picture = tmp_path / "report.png"
    browse(page, tmp_path, "--window-size=1100,1400", "--screenshot=%s" % picture)
    assert picture.stat().st_size > 40000
