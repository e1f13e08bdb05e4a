"""Every tab, drawer and view of the page, walked: nothing sticks out, fingers reach it, everybody can read it."""
import functools
import json

import pytest
from page_walk import AXE, serious_findings, small_targets, sticking_out, walk
from panel_contents import fill
from waiting import eventually

FINGER_PX = 48
VIEWS = [("desk", 512, 384, "en-GB"), ("desk", 1024, 768, "en-GB"), ("desk", 1024, 768, "zh-CN"),
         ("desk", 1440, 900, "zh-CN"), ("desk", 1920, 1080, "en-GB"), ("desk", 3840, 2160, "en-GB"),
         ("tablet", 1024, 768, "en-GB"), ("tablet", 1024, 768, "zh-CN"), ("wall", 1024, 768, "zh-CN"),
         ("wall", 1920, 1080, "en-GB")]
"""View, width, height, language; 512 x 384 is 1024 px at 200 % zoom."""
TASKS = 8
EVENTS = 3
ALWAYS_SEEN = {"desk": ("#line", "#status", "#view", "#joints", "#drawer-bar"), "wall": ("#line", "#view", "#wall")}
PLACES_OF_PARTS = """%s.map((name) => document.querySelector(name).getBoundingClientRect())
    .map(({x, y, width, height, right, bottom}) => ({x, y, width, height, right, bottom}))"""


def open_filled(panel, open_page, view, **options):
    """Open a page with something in each of its lists, and with questions and results where a person gets them."""
    fill(panel)
    page = open_page(panel.url.replace("/#", "/?view=%s#" % view), control=view != "wall", **options)
    if view != "wall":
        ask_and_teach(page)
    return page


def ask_and_teach(page):
    """Take the poses of a frame and a tool, and have the page ask before it writes a payload."""
    page.evaluate("document.querySelectorAll('#teach-frame [data-point]').forEach((one) => one.click())")
    for _ in range(4):
        page.evaluate("document.querySelector('#teach-tool [data-t=\"teach.take\"]').click()")
    for card in ("frame", "tool"):
        page.until("document.querySelector('#teach-%s .said').textContent !== ''" % card)
    page.evaluate("document.querySelector('#tab-setup').click()")
    payload = "#panel-setup .card:has(> h3[data-t='setup.payload']) "
    mass = payload + ".field:has(label[data-t='setup.mass']) input"
    page.until("document.querySelector(%s).value === '1.50'" % json.dumps(mass))
    page.type(mass, "1.2")
    asks = "document.querySelector(%s).checkVisibility()" % json.dumps(payload + "[data-t='setup.write']")

    def is_asked():
        page.evaluate("document.querySelector(%s).click()" % json.dumps(payload + "[data-t='setup.apply']"))
        return eventually(lambda: page.evaluate(asks), 3.0)
    assert eventually(is_asked), "a busy host shows what is old, and nothing is offered then"


def found_at_all_places(page, check):
    """Return what a check finds, by the name of the place; all tabs must have been walked."""
    found = {str(place): check(page, place) for place in walk(page)}
    count = 1 if page.evaluate("document.documentElement.dataset.view") == "wall" else 2 * TASKS + EVENTS
    assert len(found) >= count, list(found)
    return {place: what for place, what in found.items() if what}


@pytest.mark.parametrize("view, width, height, language", VIEWS)
def test_nothing_sticks_out_anywhere_and_stop_is_always_there(panel, open_page, view, width, height, language):
    page = open_filled(panel, open_page, view, width=width, height=height, language=language)

    def wrong(page, place):
        sizes = dict(zip(names, page.evaluate(PLACES_OF_PARTS % json.dumps(names))))
        covered = [] if width < 1000 else ["%s at %s" % (name, box) for name, box in sizes.items() if not (
            box["height"] > 20 and box["y"] >= 0 and box["bottom"] <= height)]
        stop = sizes["#stop"]
        assert stop["x"] >= 0 and stop["y"] >= 0 and stop["right"] <= width and stop["bottom"] <= height
        assert stop["width"] >= 120 and stop["height"] >= FINGER_PX
        small = small_targets(page, FINGER_PX) if view == "tablet" else []
        return sticking_out(page) + covered + small
    names = ("#stop",) + ALWAYS_SEEN["wall" if view == "wall" else "desk"]
    found = found_at_all_places(page, wrong)
    assert not found, json.dumps(found, indent=1, ensure_ascii=False)


@pytest.mark.skipif(not AXE.exists(), reason="tools/dev setup installs axe-core, with npm")
@pytest.mark.parametrize("view, language, dark", [("desk", "en-GB", False), ("tablet", "zh-CN", True),
                                                  ("wall", "en-GB", True), ("wall", "zh-CN", False)])
def test_a_screen_reader_finds_names_and_eyes_find_contrast_everywhere(panel, open_page, view, language, dark):
    page = open_filled(panel, open_page, view, width=1440, height=900, language=language, dark=dark)
    assert page.evaluate("document.documentElement.lang") == {"en-GB": "en", "zh-CN": "zh-CN"}[language]
    tabs = set()

    def once_a_tab(page, place):
        """Look at the whole page at first, then at the part of each tab."""
        if place.tab in tabs:
            return []
        tabs.add(place.tab)
        return serious_findings(page, place if len(tabs) > 1 else None)
    found = found_at_all_places(page, once_a_tab)
    assert not found, json.dumps(found, indent=1, ensure_ascii=False)


PLANTED = {
    "too wide": (sticking_out, "one.textContent = 'wide'; one.style.width = '3000px';"),
    "too high": (sticking_out, "one.textContent = 'high'; one.style.height = '3000px';"),
    "too small": (functools.partial(small_targets, least=FINGER_PX),
                  "const button = document.createElement('button'); button.textContent = 'a button';"
                  "Object.assign(button.style, { height: '29px', minHeight: '0' }); one.append(button);"),
    "no contrast": (serious_findings, "one.textContent = 'pale'; one.style.color = '#999999';"),
    "no name": (serious_findings, "one.append(document.createElement('button'));")}
PLANT = """import('/web/js/ui/tabs.js').then(({ makeTabs }) => {
    const root = document.createElement('div');
    document.querySelector('.do').append(root);
    const one = document.createElement('div');
    makeTabs(root, ['sound', 'planted'], 'tabs.do').panels.planted.append(one);
    for (const button of root.querySelectorAll('[role=tab]')) button.textContent = 'another tab';
    %s
    return true;
})"""


@pytest.mark.parametrize("defect", PLANTED)
def test_a_defect_in_a_tab_that_nobody_has_named_is_found(panel, open_page, defect):
    check, plant = PLANTED[defect]
    if check is serious_findings and not AXE.exists():
        pytest.skip("tools/dev setup installs axe-core, with npm")
    page = open_page(panel.url.replace("/#", "/?view=tablet#"))
    page.evaluate(PLANT % plant)
    found = {place.tab: check(page) for place in walk(page) if not place.is_open and place.tab in (
        "tab-sound", "tab-planted")}
    assert found["tab-planted"] and not found["tab-sound"], found
