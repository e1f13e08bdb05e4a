"""The Chinese pages beside the English ones: the same headings, code and links, so that they do not part; the terms."""
import os
import re
from collections import Counter

import pytest
from import_graph import ROOT

ZH = ROOT / "docs" / "zh"
PAGES = {"README.md": (ROOT / "README.md", "## How it hangs together"),
         "operation.md": (ROOT / "docs" / "operation.md", ""), "safety.md": (ROOT / "docs" / "safety.md", "## Custody")}
"""Each page with its English one, and the heading there at which the Chinese one ends; "" for its end."""
OTHER_TERMS = {"关节移动": "关节运动", "直线移动": "直线运动", "碰撞等级": "碰撞灵敏度", "全部运动的速度": "速度倍率",
               "非实时": "数据已过期"}
"""Terms that a user of a pendant and of the panel does not expect, each with the one that is used."""


def english(name):
    page, end = PAGES[name]
    text = page.read_text(encoding="utf-8")
    assert not end or "\n%s\n" % end in text
    return text.partition("\n%s\n" % end)[0] if end else text


def chinese(name):
    return (ZH / name).read_text(encoding="utf-8")


def code(text):
    return re.findall(r"^```\w*\n.*?^```$", text, re.DOTALL | re.MULTILINE)


def without_code(text):
    return re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)


def headings(text):
    return [len(marks) for marks in re.findall(r"^(#+) ", without_code(text), re.MULTILINE)]


def points(text):
    """Return the numbers of its lists and how many bullets and rows of tables there are."""
    return re.findall(r"^\d+\.(?= )", without_code(text), re.MULTILINE), len(re.findall(r"^- ", text, re.MULTILINE))


def anchors(text):
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
            for heading in re.findall(r"^#+ (.+)$", without_code(text), re.MULTILINE)]


def links(text, page):
    """Return where the links of a page lead, with how often; a Chinese page and heading count as the English ones."""
    own = {str(ZH / name): name for name in PAGES}
    found = Counter()
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(text)):
        path, _, anchor = target.partition("#")
        goal = os.path.normpath(str(page.parent / path)) if path else str(page)
        if goal in own:
            name = own[goal]
            goal, here = str(PAGES[name][0]), anchors(chinese(name))
            anchor = anchors(english(name))[here.index(anchor)] if anchor in here else anchor
        found[goal, anchor] += 1
    return found


def differences(name, ours, theirs):
    """Return in words how a Chinese page differs from its English one."""
    return [what for what, one, other in (
        ("headings", headings(ours), headings(theirs)), ("code", code(ours), code(theirs)),
        ("lists", points(ours), points(theirs)),
        ("links", links(ours, ZH / name), links(theirs, PAGES[name][0]))) if one != other]


@pytest.mark.parametrize("name", PAGES)
def test_a_chinese_page_has_the_headings_code_lists_and_links_of_the_english_one(name):
    assert len(code(english(name))) + len(headings(english(name))) > 2
    assert not differences(name, chinese(name), english(name))


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("what, change", [
    ("headings", lambda text: text + "\n## More\n"), ("code", lambda text: text + "\n```sh\nls\n```\n"),
    ("links", lambda text: text + "\n[more](audit.md)\n"), ("lists", lambda text: text + "\n- more\n")])
def test_an_english_page_that_has_grown_is_noticed(name, what, change):
    assert differences(name, chinese(name), change(english(name))) == [what]


def test_every_chinese_page_has_its_english_one_and_each_links_to_the_other():
    assert {path.name for path in ZH.iterdir()} == set(PAGES)
    for name, (page, _) in PAGES.items():
        assert "[%s](%s)" % (2 * (os.path.relpath(str(ZH / name), str(page.parent)),)) in english(name)
        assert "](%s)" % os.path.relpath(str(page), str(ZH)) in chinese(name)


@pytest.mark.parametrize("name", PAGES)
def test_the_terms_are_those_of_the_panel(name):
    text = chinese(name)
    assert not {term: better for term, better in OTHER_TERMS.items() if term in text}
    assert all("故障" in text[max(0, found.start() - 4):found.end() + 4] for found in re.finditer("复位", text))
