"""The report of jaka_probe as a page: whole, with nothing from elsewhere, and every text of a controller escaped."""
import re
from html.parser import HTMLParser

import pytest

from jaka_ros_driver.probe.facts import Fact, ProbeStage
from jaka_ros_driver.probe.page import curve, page
from jaka_ros_driver.probe.report import as_json

EVIL = "</td><script>alert(1)</script><img src=x onerror=alert(1)>'\""
FACTS = {"version": Fact("1.7.2_16", "as it answers"), "error_code": Fact("number", EVIL, EVIL),
         "frame_fields_unknown": Fact([EVIL], EVIL), "unknown_command": Fact("code 1, which names it", EVIL),
         "model": Fact(None, EVIL), "start_delay": Fact(1.5, "seen"), "stop_ends_move": Fact(True, "seen")}


class Structure(HTMLParser):
    """The elements of a page, its texts, and whether each is closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.text = [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in ("meta", "line", "polyline"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text += data


def made(left=(), curves=None):
    return page(as_json(FACTS, [ProbeStage.LOOK, ProbeStage.ASK], False, left, curves or {}), FACTS)


def test_the_page_is_whole_and_runs_and_fetches_nothing():
    text = made([EVIL], {"stop": [(-0.1, 0.0), (0.0, 0.3), (0.1, 0.4)], EVIL: [(0, 0), (1, 1)]})
    found = Structure(text)
    assert not found.open and not {"script", "img", "link", "iframe", "object"} & {tag for tag, _ in found.tags}
    for tag, attributes in found.tags:
        assert not any(name.startswith("on") or name in ("src", "href") for name in attributes), (tag, attributes)
    assert "url(" not in text and "@import" not in text and "default-src 'none'" in text
    assert found.text.count(EVIL) >= 6, "what a controller says is shown as it is"
    assert [tag for tag, _ in found.tags].count("svg") == 2


def test_what_contradicts_a_document_and_what_could_not_be_set_back_come_first():
    text = re.sub(r"<[^>]*>", "|", made(["user frame 10: was zero, is 2.0"]))
    places = [text.index(part) for part in ("Not set back", "user frame 10", "Contradicts the documents",
                                            "`errorCode` is a text", "Otherwise than the simulated",
                                            "start_delay: 1.5, there 0.0", "Not settled",
                                            "Confirms the documents", "`stop_program` ends a running move",
                                            "were not seen")]
    assert places == sorted(places)
    assert "S10, section 4.3 [O]" in text and text.count("Confirms the documents") == 1


@pytest.mark.parametrize("points, is_drawn", [([], False), ([(0, 1)], False), ([(0, 1), (0, 1)], True),
                                              ([(-1, 5.0), (2, 5.0)], True)])
def test_any_points_make_a_drawing_or_none(points, is_drawn):
    assert ("<polyline" in curve(points)) is is_drawn and "nan" not in curve(points)


@pytest.mark.parametrize("points, labels", [
    ([(-0.09, 0.0), (4.56, 2.0)], ["0.00 s", "4.56 s"]), ([(20.0, 0.0), (23.0, 2.5)], ["20.00 s", "23.00 s"]),
    ([(-0.33, 0.0), (0.27, 0.8)], ["0.00 s", "-0.33 s", "0.27 s"])])
def test_the_times_of_a_drawing_lie_in_it_and_apart(points, labels):
    found = re.findall(r'<text x="([^"]+)"[^>]*>([^<]+ s)</text>', curve(points))
    assert [label for _, label in found] == labels
    places = sorted(float(x) for x, _ in found)
    assert 0.0 < places[0] and places[-1] < 640.0 and all(b - a >= 50.0 for a, b in zip(places, places[1:]))
