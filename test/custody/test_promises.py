"""The tie between promises, rules and planted defects: none of them stands alone."""
import defects
import promises
import pytest
import verdict

ALL = promises.PROMISES + promises.BEHAVIOUR


@pytest.mark.parametrize("promise", promises.PROMISES, ids=lambda promise: promise.id)
def test_what_is_promised_has_its_rule_and_a_planted_defect_that_it_finds(promise):
    assert not promises.faults_of(promise)
    assert bool(promise.live) == bool(promise.why) and set(promise.live) <= set(promise.tests)


@pytest.mark.parametrize("entry", promises.BEHAVIOUR, ids=lambda entry: entry.id)
def test_what_is_not_promised_says_why_no_rule_can_judge_it(entry):
    assert entry.why and entry.tests and not entry.rules and not entry.defects


@pytest.mark.parametrize("change, fault", [
    ({"rules": ()}, "no rule of the simulation"),
    ({"defects": ()}, "no planted defect"),
    ({"rules": ("no such",)}, "no rule no such"),
    ({"defects": ("NoSuch",)}, "no planted defect NoSuch"),
    ({"defects": ("JogsOn",)}, "JogsOn is found by rule c, which is not among its rules"),
])
def test_a_promise_without_its_rule_or_its_defect_is_noticed(change, fault):
    good = promises.PROMISES[0]
    assert fault in promises.faults_of(good._replace(**change)) and not promises.faults_of(good)


def test_the_first_screen_promises_ten_things_and_nothing_that_has_no_rule():
    promised = {promise.id for promise in promises.PROMISES}
    assert len(promises.IN_SHORT) == 10
    assert all(ids and set(ids) <= promised for _, ids in promises.IN_SHORT)


def test_each_entry_has_its_own_name():
    assert len({entry.id for entry in ALL}) == len({entry.title for entry in ALL}) == len(ALL) > 30


def test_every_rule_serves_a_promise_or_says_what_for():
    used = {rule for promise in promises.PROMISES for rule in promise.rules}
    assert used | set(promises.BESIDES) == set(verdict.RULES)
    assert not used & set(promises.BESIDES)


def test_every_rule_has_a_planted_defect():
    assert {defect.rule for defect in defects.DEFECTS} == set(verdict.RULES)


def test_the_page_says_what_the_data_says():
    text = promises.PAGE.read_text(encoding="utf-8")
    assert promises.written(text) == text, "build/venv/bin/python3 test/custody/promises.py writes it"
