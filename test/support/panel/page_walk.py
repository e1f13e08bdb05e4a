"""A walk over the whole page, with checks for each place of it: what sticks out, targets for fingers, axe.

Rows of tabs and drawers are taken from the page itself: a tab that is added is walked without being named anywhere.
"""
import json
from typing import NamedTuple

from import_graph import ROOT

AXE = ROOT / "build" / "js" / "node_modules" / "axe-core" / "axe.min.js"
TABS = """[...document.querySelectorAll('[role=tab]')].filter((one) => one.checkVisibility()).map((one) => one.id)"""
_DRAWERS = """(async (isOpen) => {
    for (const one of document.querySelectorAll('button[aria-expanded][aria-controls]')) {
        if (one.checkVisibility() && one.getAttribute('aria-expanded') !== String(isOpen)) one.click();
    }
})(%s)"""
_TAB = """(async (id) => {
    document.getElementById(id)?.click();
    for (const one of document.querySelectorAll('details')) one.open = true;
    for (let frame = 0; frame < 3; frame += 1) await new Promise(requestAnimationFrame);
    return [...document.querySelectorAll('button[aria-expanded][aria-controls]')].some(
        (one) => one.checkVisibility() && one.getAttribute('aria-expanded') === 'true');
})(%s)"""
_WORDS = """const words = (one) => `${one.tagName.toLowerCase()}${one.id ? '#' + one.id : ''}.${one.className} "${
        (one.textContent || one.value || '').trim().slice(0, 40)}"`;"""
_STICKING_OUT = """(() => {
    %s
    const found = [];
    const { scrollWidth, scrollHeight } = document.documentElement;
    if (scrollWidth > innerWidth) found.push(`the page is ${scrollWidth} px wide`);
    const isFixed = innerWidth >= 1000 && innerHeight >= 640;  // as in layout.css
    if (isFixed && scrollHeight > innerHeight) found.push(`the page is ${scrollHeight} px high`);
    const seen = (one) => one.checkVisibility() && !one.closest('.unseen, .uplot, svg, .mark-lane');
    for (const one of document.querySelectorAll('body *')) {
        const { display, overflowX, overflowY, textOverflow } = getComputedStyle(one);
        if (!seen(one) || display === 'inline') continue;
        if (one.scrollWidth > one.clientWidth + 1 && textOverflow !== 'ellipsis') {
            found.push(`${one.scrollWidth} px in ${one.clientWidth} px of width: ${words(one)}`);
        }
        if (isFixed && one.matches('.part, .top, #doing, #seeing, .tab-panel, .plots, button') && overflowY !== 'auto'
            && one.scrollHeight > one.clientHeight + 2) {
            found.push(`${one.scrollHeight} px in ${one.clientHeight} px of height: ${words(one)}`);
        }
        const box = one.getBoundingClientRect();
        if (box.width && (box.left < -1 || box.right > innerWidth + 1) && overflowX !== 'hidden') {
            found.push(`from ${box.left} to ${box.right} px: ${words(one)}`);
        }
    }
    const parts = [...document.querySelectorAll('.top, .part')].filter(seen).map(
        (one) => [one, one.getBoundingClientRect()]);
    for (const [one, box] of parts) {
        if (isFixed && box.bottom > innerHeight + 1) found.push(`down to ${box.bottom} px: ${words(one)}`);
        for (const [other, place] of isFixed ? parts : []) {
            if (one !== other && box.top < place.bottom - 1 && place.top < box.bottom - 1 && box.left < place.right - 1
                && place.left < box.right - 1) found.push(`${words(one)} covers ${words(other)}`);
        }
    }
    return found;
})()""" % _WORDS
_SMALL = """(() => {
    %s
    return [...document.querySelectorAll('button, select, input, summary, [role=tab], [role=switch]')].filter((one) => {
        const { width, height } = one.getBoundingClientRect();
        return one.checkVisibility() && (width < %s || height < %s);
    }).map((one) => `${one.getBoundingClientRect().width} x ${one.getBoundingClientRect().height} px: ${words(one)}`);
})()"""
_OLD_IS_NOT_GREY = """[...document.styleSheets].forEach((sheet) => [...sheet.cssRules].forEach((rule, number) => {
    if (rule.selectorText?.includes('body.stale .part.status')) sheet.deleteRule(number);
})); true"""
"""While axe looks, which takes a second, the page shows the past, and dims it on purpose."""
_SERIOUS = """(async (tab) => {
    const part = document.getElementById(tab)?.closest('.part') ?? document;
    const { violations } = await axe.run(part, { resultTypes: ['violations'] });
    return violations.filter(({ impact }) => ['serious', 'critical'].includes(impact)).map(({ id, nodes }) => (
        `${id}: ${nodes.map(({ html }) => html.slice(0, 200)).slice(0, 3).join(' ')}`));
})(%s)"""


class Place(NamedTuple):
    """A tab by its id, empty where a view has none, and whether a drawer is open."""

    tab: str
    is_open: bool

    def __str__(self):
        return "%s, drawer %s" % (self.tab or "no tabs", "open" if self.is_open else "closed")


def walk(page):
    """Yield each Place of the page when it is shown: each tab, with the drawers closed and open; all details are
    unfolded. A view without tabs is one place."""
    walked = set()
    for is_open in (False, True):
        for tab in page.evaluate(TABS) or [""]:
            page.evaluate(_DRAWERS % json.dumps(is_open))
            place = Place(tab, page.evaluate(_TAB % json.dumps(tab)))  # a tab of a drawer opens it
            if place not in walked:
                walked.add(place)
                yield place


def sticking_out(page):
    """Return what is cut, covered, wider than its place, or needs scrolling of the page, in words."""
    return page.evaluate(_STICKING_OUT)


def small_targets(page, least):
    """Return the controls that are seen and smaller than ``least`` px in a direction, in words."""
    return page.evaluate(_SMALL % (_WORDS, least - 0.1, least - 0.1))


def serious_findings(page, place=None):
    """Return the findings of axe that are serious or critical, in words; of a place in the part that has its tab."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8") + "; true")
        page.evaluate(_OLD_IS_NOT_GREY)
    return page.evaluate(_SERIOUS % json.dumps(place.tab if place else ""))
