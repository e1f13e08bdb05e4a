"""The audit of golden logs: what is planted is found, and what the tolerances let through is named."""
from html import escape

import pytest
from content_logs import TOPICS
from import_graph import ROOT

from jaka_bag.cli.main import main
from jaka_bag.compare.audit.auditing import DEFECTS, REASONS, audit
from jaka_bag.compare.audit.editing import read_log, write_log
from jaka_bag.compare.tolerances import parse_tolerances
from jaka_bag.errors import DefinitionError
from jaka_bag.messages.value_writer import ValueWriter, exact_time
from jaka_bag.messages.values import ValueReader

GOLDEN = ROOT / "test" / "data" / "golden"


PAGE = ROOT / "docs" / "regression_testing.md"


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*.mcap")), ids=lambda path: path.stem)
def test_at_most_two_defects_of_a_golden_log_are_missed_and_their_reasons_are_known(path):
    findings = audit(path)
    missed = {finding.defect for finding in findings if finding.is_missed}
    assert len(missed) <= 2 and missed <= set(REASONS), missed
    assert len(findings) == len(DEFECTS) >= 60
    planted = sum(finding.is_planted for finding in findings)
    assert planted >= (35 if path.stem in ("boot", "io_sequence") else 60)
    row = "| `%s` | %d | %s |" % (path.stem, planted, "; ".join(
        name for name in DEFECTS if name in missed) or "none")
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    for line in (row, *("| %s | %s |" % (name, REASONS[name]) for name in missed)):
        assert line in lines, "docs/regression_testing.md lacks the line " + line


def test_the_table_is_in_the_page_too(capsys, tmp_path):
    page, golden = tmp_path / "audit.html", str(GOLDEN / "stop_in_mid_move.mcap")
    assert main(["compare", "--audit", golden, "--html", str(page)]) == 1
    lines = capsys.readouterr().out.splitlines()
    text = page.read_text(encoding="utf-8")
    assert text.count("<tr>") == len(DEFECTS) + 1 and escape(lines[-1]) in text
    for line in lines[:-1]:
        name, _, fate = line.partition("  ")
        assert escape(name) in text and escape(fate.strip()) in text
    assert text.index("MISSED") < text.index("found by"), "what would be missed comes first"
    assert main(["compare", "--audit", golden, "--html", str(page)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["compare", "--audit", golden, "--html", golden]) == 2


@pytest.mark.parametrize("mode, option", [
    *[(["--audit"], option) for option in (["--junit", "x"], ["--report", "x"], ["--json"], ["--strict"], ["-v"],
                                           ["--time-scale", "2"])],
    *[(["--learn", "."], option) for option in (["--html", "x"], ["--junit", "x"], ["--json"], ["-f"], ["--audit"])]])
def test_an_option_that_has_no_effect_beside_an_audit_or_learning_is_refused(mode, option, capsys, tmp_path,
                                                                              monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["compare", str(GOLDEN / "boot.mcap"), *mode, *option]) == 2
    assert ("does not take" in capsys.readouterr().err) is (option != ["--audit"])
    assert not (tmp_path / "x").exists()


def test_wider_tolerances_miss_more(capsys, tmp_path):
    wide = tmp_path / "wide.yaml"
    wide.write_text("tcp: {position_mm: 5}\ntiming: {stale_ms: 200}\nstreams: {latency_ms: 500}\n")
    assert main(["compare", "--audit", str(GOLDEN / "joint_moves.mcap"), "--tolerances", str(wide)]) == 1
    lines = capsys.readouterr().out.splitlines()
    missed = {line.partition("  ")[0] for line in lines if "MISSED" in line}
    assert {"tool: x off by 1 mm", "tool: 96 ms stale", "stamps: 50 ms old"} <= missed
    assert "tool: mm for m" not in missed
    assert lines[-1].startswith("%d of 66 defects would be missed: tool: x off by 1 mm, " % len(missed))


def test_a_log_without_misses_ends_with_0_and_a_candidate_is_too_much(capsys):
    path = str(GOLDEN / "boot.mcap")
    assert main(["compare", "--audit", "-q", path]) == 0
    assert capsys.readouterr().out.startswith("0 of 39 defects would be missed; ")
    assert main(["compare", "--audit", path, path]) == 2


def test_the_audit_takes_the_tolerances_that_it_is_given():
    ignoring = parse_tolerances("ignore_topics: ['.*/tool_position']")
    findings = audit(GOLDEN / "boot.mcap", ignoring)
    assert {finding.defect for finding in findings if finding.is_missed} >= {"tool: mm for m", "tool: other frame"}


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.connection.topic)
def test_a_message_is_written_as_it_was_read(topic):
    raw = ValueWriter(topic.connection).write(topic.value(1.5, 3))
    value = ValueReader(topic.connection, exact_time, "surrogateescape").read(raw)
    assert ValueWriter(topic.connection).write(value) == raw


def test_a_value_that_does_not_fit_is_refused():
    level = next(topic for topic in TOPICS if topic.connection.topic == "/cell/level")
    for value in ({}, {"data": "x"}, {"data": None}):
        with pytest.raises(DefinitionError, match="does not fit its field"):
            ValueWriter(level.connection).write(value)


def test_a_log_without_tool_poses_is_audited_by_what_it_has(tmp_path):
    log = read_log(GOLDEN / "boot.mcap")
    path = tmp_path / "golden.mcap"
    write_log(log.with_items([item for item in log.items if not item.topic.endswith("/tool_position")]), path)
    findings = {finding.defect: finding for finding in audit(path)}
    assert not findings["stamps: two swapped"].is_planted and not findings["tool: mm for m"].is_planted
    assert findings["joints: degrees for radians"].found_by
