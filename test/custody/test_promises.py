"""The tie between promises, rules and planted defects: none of them stands alone."""
import defects
import promises
import pytest
import verdict

from jaka_ros_driver.probe.statements import STATEMENTS

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


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.id)
def test_what_rests_on_a_controller_names_the_statement_that_a_probe_checks(entry):
    assert set(entry.assumes) <= set(STATEMENTS) and len(set(entry.assumes)) == len(entry.assumes)
    assert not promises.unnamed_assumption(entry), "assumes: [S..], or assumes_also where there is no statement"
    shown = promises.shown(entry)
    assert ("Rests on the controller" in shown) == bool(entry.assumes or entry.assumes_also)
    for number in entry.assumes:
        assert "%s, %s" % (number, STATEMENTS[number].says) in " ".join(shown.split())


def test_each_way_to_stop_is_an_assumption_of_the_whole_stop_and_one_without_a_name_is_noticed():
    stops = {number for number, one in STATEMENTS.items()
             if {"stop_ends_move", "stop_ends_jog", "stop_ends_servo", "jog_stop_ends"} & set(one.facts)}
    entry = next(entry for entry in ALL if entry.id == "whole-stop")
    assert stops and stops <= set(entry.assumes)
    assert promises.unnamed_assumption(entry._replace(assumes=(), assumes_also="")) == "A controller that "
    assert not promises.unnamed_assumption(entry._replace(assumes=(), assumes_also="It knows the command."))


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
