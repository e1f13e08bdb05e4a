"""The tie between promises, rules and planted defects: none of them stands alone."""
import re
from pathlib import Path

import defects
import promises
import pytest
import verdict

TESTS = Path(promises.__file__).resolve().parents[1]
TEXT = promises.PAGE.read_text()


@pytest.mark.parametrize("row", promises.rows(TEXT))
def test_a_promise_has_a_rule_or_says_why_not(row):
    found = [promise for promise in promises.PROMISES if row.startswith(promise.begins)]
    assert len(found) == 1, "no entry, or several, in test/custody/promises.py for: %s" % row
    promise = found[0]
    assert promise.rules or (promise.live and promise.why)
    assert bool(promise.rules) == bool(promise.defects)
    assert bool(promise.live) == bool(promise.why)


def test_no_entry_without_its_promise():
    rows = promises.rows(TEXT)
    assert [one.begins for one in promises.PROMISES if not any(row.startswith(one.begins) for row in rows)] == []


@pytest.mark.parametrize("promise", promises.PROMISES, ids=lambda promise: promise.begins)
def test_the_defects_of_a_promise_are_found_by_its_rules(promise):
    broken = {promises.rule_of(name) for name in promise.defects.split()}
    assert broken <= set(promise.rules.split())
    assert broken or not promise.rules


@pytest.mark.parametrize("promise", [one for one in promises.PROMISES if one.live], ids=lambda one: one.begins)
def test_live_tests_exist(promise):
    known = {name for path in TESTS.rglob("test_*.py") for name in re.findall(r"def (test_\w+)", path.read_text())}
    assert set(promise.live.split()) <= known


def test_every_rule_serves_a_promise_or_says_what_for():
    used = {rule for promise in promises.PROMISES for rule in promise.rules.split()}
    assert used | set(promises.BESIDES) == set(verdict.RULES)
    assert not used & set(promises.BESIDES)


def test_every_rule_has_a_planted_defect():
    assert {defect.rule for defect in defects.DEFECTS} == set(verdict.RULES)


def test_the_page_has_the_table():
    assert promises.written(TEXT) == TEXT, "build/venv/bin/python3 test/custody/promises.py writes it"
