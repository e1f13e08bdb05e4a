"""The promises of docs/safety.md and docs/panel.md: each has a test, by a name that exists."""
import re

import pytest
from import_graph import ROOT

TABLES = (("safety.md", "| promise |"), ("panel.md", "| promise |"), ("panel.md", "| attack |"))
PROMISES = [line for page, head in TABLES
            for line in (ROOT / "docs" / page).read_text(encoding="utf-8").partition(head)[2].partition(
                "\n\n")[0].splitlines()[2:] if line]
DEFINED = {name for path in (ROOT / "test").rglob("test_*.py")
           for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.MULTILINE)}


def test_the_page_has_its_table():
    assert len(PROMISES) > 10


@pytest.mark.parametrize("promise", PROMISES, ids=lambda line: line.split("|")[1].strip()[:40])
def test_a_promise_has_tests_that_exist(promise):
    named = re.findall(r"`(test_\w+)`", promise)
    assert named, "a promise without a test"
    assert not set(named) - DEFINED
