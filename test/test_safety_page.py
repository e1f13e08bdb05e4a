"""The promises of docs/safety.yaml and docs/panel.md, each with a test by a name that exists; the page's beginning."""
import re

import pytest
import yaml
from import_graph import ROOT

SAFETY = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
DATA = yaml.safe_load((ROOT / "docs" / "safety.yaml").read_text(encoding="utf-8"))
ENTRIES = DATA["promises"] + DATA["behaviour"]
ONE_SCREEN = 70
"""Lines of the page before its first section of prose."""
DEFINED = {name for path in (ROOT / "test").rglob("test_*.py")
           for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)}


def promises_of_the_panel(text):
    """Return the entries of its lists of promises and of attacks, each a list item that begins with bold text."""
    lists = [text.partition("\n## %s\n" % heading)[2].partition("\n## ")[0]
             for heading in ("What it promises", "Who may")]
    return [item for one in lists for item in re.findall(r"^- \*\*.*(?:\n  .*)*", one, re.MULTILINE)]


PANEL = promises_of_the_panel((ROOT / "docs" / "panel.md").read_text(encoding="utf-8"))


def missing_tests(names):
    """Return what is wrong with the tests of a promise: none at all, or names that nothing defines."""
    return ["no test"] if not names else sorted(set(names) - DEFINED)


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["id"])
def test_a_promise_has_tests_that_exist(entry):
    assert not missing_tests(entry["tests"] + entry.get("judged_live", {}).get("tests", []))


@pytest.mark.parametrize("item", PANEL, ids=lambda item: item[4:44])
def test_a_promise_of_the_panel_has_tests_that_exist(item):
    assert not missing_tests(re.findall(r"`(test_\w+)`", item))


def test_every_promise_is_found():
    assert len(ENTRIES) >= 38 and len(PANEL) >= 18


@pytest.mark.parametrize("names, wrong", [([], ["no test"]), (["test_that_nobody_wrote"], ["test_that_nobody_wrote"])])
def test_a_promise_without_its_test_is_noticed(names, wrong):
    assert missing_tests(names) == wrong


def test_the_first_screen_says_what_is_promised_what_is_not_and_what_to_do():
    headings = [(SAFETY.count("\n", 0, match.start()), match.group(1))
                for match in re.finditer(r"^## (.+)$", SAFETY, re.MULTILINE)]
    assert [heading for _, heading in headings[:4]] == [
        "What the driver promises", "What is not covered", "What to do", "Custody"]
    assert headings[3][0] <= ONE_SCREEN
    to_do = SAFETY.partition("\n## What to do\n")[2].partition("\n## ")[0]
    assert re.findall(r"^\*\*(.+)\*\*$", to_do, re.MULTILINE) == [
        "Before first use", "At an alarm", "After an accident"]
