"""The statements of the protocol page that a probe judges: the page's table, the verdicts, and what arms of others say.

Run as a program, this file writes the table anew.
"""
import re
from pathlib import Path

import pytest

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import DESCRIBED, Fact
from jaka_ros_driver.probe.statements import STATEMENTS, Verdict, arms_behind, table_rows, verdicts
from jaka_ros_driver.simulation.dialect.table import Dialect

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "controller-protocol.md"
WRITE_ANEW = "PYTHONPATH=.:test/support build/venv/bin/python3 test/probe/test_statements.py"
BLOCK = re.compile(r"(<!-- statements -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def probes_of_others():
    found = [report.facts_of(report.read(str(path))) for path in sorted((DOCS / "probes").glob("*.json"))]
    return [(report.firmware_of(facts), facts) for facts in found]


def table():
    rows = [["id", "statement", "section", "tag", "facts", "arms"], ["---"] * 6, *table_rows(probes_of_others())]
    return "".join("| %s |\n" % " | ".join(row) for row in rows)


def test_the_table_of_the_page_is_what_the_code_and_the_probes_of_others_say():
    written = BLOCK.search(PAGE.read_text(encoding="utf-8"))
    assert written and written.group(2) == table(), "run " + WRITE_ANEW


def sections():
    """Return the text of each section of the page, without those below it, by its number."""
    pieces = re.split(r"^#+ (\d+(?:\.\d+)*)\.? .*$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(pieces[1::2], pieces[2::2]))


@pytest.mark.parametrize("number", STATEMENTS)
def test_a_statement_stands_where_it_says_with_its_tag_and_has_facts(number):
    one, text = STATEMENTS[number], sections().get(STATEMENTS[number].section, "")
    tags = re.findall(r"\[([^\]]*)\]", text.replace("\\*", "*"))
    is_observed = one.section == "14" and "it is observed" in text
    assert is_observed or any(re.search(r"(?<!\w)%s(?![\w*?])" % re.escape(one.tag), tag) for tag in tags), one
    assert one.facts and set(one.facts) <= set(DESCRIBED)
    for name in re.findall(r"`(\w+)`", one.says):
        assert name in PAGE.read_text(encoding="utf-8")


def facts_like(version, dialect):
    """Return the facts that a probe finds on a controller of this dialect."""
    by_dimension = {row.dimension: name for name, row in DESCRIBED.items() if row.dimension}
    facts = {name: Fact(getattr(dialect, key), "seen") for key, name in by_dimension.items()}
    return {**facts, "version": Fact(version, "as it answers"), "commands_missing": Fact([], "seen")}


def test_each_statement_that_a_dimension_decides_follows_it_and_one_that_is_not_settled_is_not_seen():
    usual = facts_like("1.5.14_13", Dialect.default("1.5.14"))
    judged = verdicts(usual)
    expected = {"S10": "confirmed", "S14": "confirmed", "S15": "not seen", "S18": "confirmed", "S20": "contradicted",
                "S21": "confirmed", "S22": "confirmed", "S30": "confirmed", "S31": "not seen", "S34": "not seen"}
    assert {number: judged[number].value for number in expected} == expected
    changed = {"S10": ("error_code", "number"), "S14": ("robot_state", "numbers"), "S18": ("stop_ends_jog", False),
               "S22": ("starvation", "repeat"), "S30": ("io_index_base", 1)}
    for number, (name, value) in changed.items():
        assert verdicts({**usual, name: Fact(value, "")})[number] is Verdict.CONTRADICTED, number
        assert verdicts({**usual, name: Fact(None, "why")})[number] is Verdict.NOT_SEEN, number
    newer = verdicts(facts_like("1.7.2_28", Dialect.default("1.7.2")))
    assert [newer[number].value for number in ("S14", "S15", "S30", "S31")] == ["not seen", "confirmed"] * 2
    assert set(verdicts({}).values()) == {Verdict.NOT_SEEN}


@pytest.mark.parametrize("value", [None, "", 0, -1.5, [], [1], {}, {"a": 1}, True, "code 1"])
def test_any_value_in_a_report_from_elsewhere_has_a_verdict(value):
    assert set(verdicts({name: Fact(value, "") for name in DESCRIBED})) == set(STATEMENTS)


def test_arms_are_counted_by_firmware_and_a_statement_that_one_confirms_is_observed():
    confirms = facts_like("1.5.14_13", Dialect.default("1.5.14"))
    against = facts_like("1.7.2_28", Dialect.default("1.7.2").replaced({"starvation": "coast"}))
    probes = [("1.5.14", confirms), ("1.5.14", confirms), ("1.7.2", against), ("", against)]
    arms = arms_behind(probes)["S22"]
    assert arms[Verdict.CONFIRMED] == {"1.5.14": 2} and arms[Verdict.CONTRADICTED] == {"1.7.2": 1, "unknown": 1}
    rows = {row[0]: row for row in table_rows(probes)}
    assert rows["S22"][3] == "[O]"
    assert rows["S22"][5] == "confirmed by 2 of 1.5.14; contradicted by 1 of 1.7.2, 1 of unknown"
    assert {row[0]: row[3] for row in table_rows([])}["S22"] == "[I]"


def test_the_report_has_each_verdict():
    facts = facts_like("1.5.14_13", Dialect.default("1.5.14").replaced({"starvation": "coast"}))
    written = report.as_json(facts, [], True)["statements"]
    assert {number: row["verdict"] for number, row in written.items()} == {
        number: verdict.value for number, verdict in verdicts(facts).items()}
    lines = " ".join(" ".join(report.text(facts)).split())
    assert "S22 contradicted: the arm holds the last target" in lines and "found: coast" in lines
    assert "S10 confirmed: " in lines and re.search(r"not seen: .*S15", lines)


def write():
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(BLOCK.sub(lambda found: found.group(1) + table() + found.group(3), text), encoding="utf-8")


if __name__ == "__main__":
    write()
