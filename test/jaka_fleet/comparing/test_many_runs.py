"""Many runs, in one of whose cells a joint drifts from one run on: tables, page, JUnit, sweeps, links, a browser."""
import html.parser
import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
from many_sessions import drift, run_of
from pyarrow import parquet
from synthetic_session import write_log

from jaka_bag.cli.main import load_command, main, parser_of
from jaka_fleet.comparing import page as comparing_page

CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
RUNS, FIRST = 200, 120
"""The runs of the cell whose third joint drifts, and the number from which on it does, counted from 1."""
VOID = {"meta", "br", "hr", "img", "input", "link"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Write a folder of the drifting cell and of a second one."""
    folder = tmp_path_factory.mktemp("logs")
    for name in ("press_1", "press_2"):
        (folder / name).mkdir()
    for number in range(1, RUNS + 1):
        change = drift(2, 4e-5 * (number - FIRST + 1)) if number >= FIRST else None
        write_log(folder / "press_1" / ("run_%03d.mcap" % number), run_of(number, change))
    for number in range(1, 13):
        write_log(folder / "press_2" / ("run_%03d.bag" % number), run_of(500 + number))
    return folder


@pytest.fixture(scope="module")
def results(short_golden, logs, tmp_path_factory):
    """Return the results of comparing them."""
    folder = tmp_path_factory.mktemp("results")
    code = main(["compare", str(short_golden), "--against", str(logs), "--results", str(folder / "tables"), "-q",
                 "--jobs", "1", "--html", str(folder / "page.html"), "--junit", str(folder / "junit.xml"),
                 "--report", str(folder / "report.json")])
    assert code == 1
    return folder


def rows_of(results, name):
    table = parquet.read_table(str(results / "tables" / name))
    place = table.schema.get_field_index("start")
    return table.set_column(place, "start", table.column("start").cast("int64")).to_pylist()


def test_it_names_the_joint_and_the_run(results):
    found = json.loads((results / "report.json").read_text())
    drifting = [trend for trend in found["trends"] if trend["drifts"]]
    assert [(trend["cell"], trend["name"]) for trend in drifting] == [("press_1", "joint_3")]
    assert abs(drifting[0]["since_run"] - FIRST) <= 5
    # 0.04 mrad a run reach 2 mrad after 50 runs
    assert drifting[0]["beyond_since_run"] == pytest.approx(FIRST + 50, abs=2)
    assert {(trend["cell"], trend["name"]) for trend in found["trends"]} == {
        (cell, name) for cell in ("press_1", "press_2") for name in [
            *["joint_%d" % number for number in range(1, 7)], "cycle time"]}
    text = (results / "page.html").read_text(encoding="utf-8")
    assert re.search(r"press_1: joint_3 drifts</h3><p>since run 1(1[5-9]|2[0-5]) of 200", text)


def test_the_tables_hold_each_run_and_the_margin_of_each_check(results):
    runs, checks = rows_of(results, "runs.parquet"), rows_of(results, "checks.parquet")
    assert len(runs) == RUNS + 12 and [run["start"] for run in runs] == sorted(run["start"] for run in runs)
    assert sum(run["checks"] for run in runs) == len(checks)
    assert {run["cell"] for run in runs} == {"press_1", "press_2"} and len({run["run"] for run in runs}) == len(runs)
    for run in runs:
        assert (run["verdict"] == "different") == (run["margin"] > 1.0)
        assert 0.5 < run["cycle_s"] < 2.0
    for check in checks:
        assert (check["margin"] is None) == (check["outcome"] == "not compared")
        if check["margin"] is not None:
            assert (check["margin"] > 1.0) == (check["outcome"] == "different")
    third = [check["margin"] for check in checks if check["field"] == "joint_3" and check["cell"] == "press_1"]
    assert third[FIRST + 30] == pytest.approx(32 * 4e-5 / 0.002, rel=0.1) and max(third[:FIRST - 2]) < 0.05


def test_junit_has_a_case_for_each_run(results):
    suite = ElementTree.fromstring((results / "junit.xml").read_bytes()).find("testsuite")
    assert len(suite.findall("testcase")) == int(suite.get("tests")) == RUNS + 12
    failed = suite.findall("testcase[failure]")
    assert len(failed) == int(suite.get("failures")) > 20
    assert all("joint_3" in case.find("failure").text for case in failed)
    assert "press_1: joint_3 drifts since run" in suite.find("system-out").text


class Outline(html.parser.HTMLParser):
    """The tags of a page in balance, and the targets of its links."""

    def __init__(self, text):
        super().__init__()
        self.open, self.names, self.links, self.tags = [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.names.append(value)
            elif name in ("href", "src", "xlink:href", "action", "data"):
                self.links.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag


def test_the_page_is_whole_needs_nothing_and_leads_to_the_reports_of_the_worst_runs(results):
    text = (results / "page.html").read_text(encoding="utf-8")
    outline = Outline(text)
    assert len(set(outline.names)) == len(outline.names)
    assert not {"script", "img", "iframe", "link"} & set(outline.tags)
    assert not re.search(r"https?:|@import|url\(", text)
    reports = [link for link in outline.links if not link.startswith("#")]
    assert all(link[1:] in outline.names for link in outline.links if link.startswith("#"))
    assert len(reports) == 10 and "run_200" in reports[0]
    for link in reports:
        assert "joint_3" in (results / link).read_text(encoding="utf-8")
    assert {"drifts", "runs", "margins", "trends", "worst", "checks", "tolerances"} <= set(outline.names)
    assert text.count("<svg") >= 8 and "nan" not in "".join(re.findall(r' d="[^"]*"', text)).lower()


def test_what_a_page_leaves_out_is_said(short_golden, logs, tmp_path, monkeypatch):
    monkeypatch.setattr(comparing_page, "_MOST_ROWS", 1)
    monkeypatch.setattr(comparing_page, "_MOST_BARS", 5)
    page = tmp_path / "page.html"
    assert main(["compare", str(short_golden), "--against", str(logs / "press_2"), "-q", "--jobs", "1", "--results",
                 str(tmp_path / "tables"), "--html", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "7 more earlier runs are in the tables." in text
    assert re.search(r"\d+ more amounts are in the tables\.", text)


def test_a_browser_draws_the_page_without_complaint(results, tmp_path):
    assert CHROMIUM, "chromium is missing; tools/dev setup installs it"
    picture = tmp_path / "page.png"
    done = subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--enable-logging=stderr",
         "--user-data-dir=%s" % (tmp_path / "profile"), "--window-size=1100,2600", "--screenshot=%s" % picture,
         (results / "page.html").as_uri()],
        capture_output=True, timeout=240, check=True, env=dict(os.environ, HOME=str(tmp_path)))
    assert b"CONSOLE" not in done.stderr, done.stderr
    assert picture.stat().st_size > 40000


def sweep(short_golden, logs, results, *words):
    return main(["compare", str(short_golden), "--against", str(logs), "--results", str(results / "tables"), *words])


def test_a_sweep_judges_again_without_the_logs(short_golden, logs, results, tmp_path, capsys, monkeypatch):
    wide, tight = tmp_path / "wide.yaml", tmp_path / "tight.yaml"
    wide.write_text("joints: {position_rad: 0.004}\n")
    tight.write_text("joints: {per_joint: {joint_3: 0.001}}\n")
    away = logs.rename(logs.with_name("away"))
    try:
        assert sweep(short_golden, logs, results, "--sweep", str(wide), "--sweep", str(tight), "--json") == 1
        rows = json.loads(capsys.readouterr().out)["sweeps"]
        assert rows[0]["different"] == 0 and rows[0]["same"] == RUNS + 12 and len(rows[0]["changed"]) > 20
        # 0.04 mrad a run reach 1 mrad after 25 runs
        assert rows[1]["different"] == pytest.approx(RUNS - FIRST + 1 - 25, abs=2)
        page = tmp_path / "wide.html"
        assert sweep(short_golden, logs, results, "--sweep", str(wide), "--html", str(page)) == 0
        assert "212 runs, none is different" in page.read_text(encoding="utf-8")
        assert "212 same, 0 different" in capsys.readouterr().out
    finally:
        away.rename(logs)


@pytest.mark.parametrize("text, words", [
    ("timing: {jitter_ms: 50}", "timing.jitter_ms decide what is measured"),
    ("joints: 3", "expected names with values")])
def test_a_sweep_that_needs_the_logs_is_refused(short_golden, logs, results, tmp_path, capsys, text, words):
    (tmp_path / "limits.yaml").write_text(text)
    assert sweep(short_golden, logs, results, "--sweep", str(tmp_path / "limits.yaml")) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("words, said", [
    (["--against", "{logs}", "--strict"], "are for one log"), (["--against", "{logs}", "--audit"], "are for one log"),
    (["--against", "{logs}", "{golden}", "-f"], "one log is needed"), (["--sweep", "x.yaml"], "--against"),
    (["--against", "{logs}/nothing"], "no data set and no folder"),
    (["--against", "{logs}", "--sweep", "x.yaml", "--tolerances", "y.yaml"], "cannot read y.yaml"),
    (["--against", "{empty}"], "no log"), (["--against", "{logs}", "--jobs", "2", "--dask", "tcp://x:1"], "--jobs")])
def test_what_does_not_go_together_is_a_usage_error(short_golden, logs, tmp_path, capsys, words, said):
    (tmp_path / "empty").mkdir()
    filled = [word.format(logs=logs, golden=short_golden, empty=tmp_path / "empty") for word in words]
    assert main(["compare", str(short_golden), *filled, "--results", str(tmp_path / "results")]) == 2
    assert said in capsys.readouterr().err


def test_results_lie_in_the_data_set_and_a_second_call_reads_no_log_again(short_golden, logs, tmp_path, capsys):
    against = tmp_path / "logs"
    shutil.copytree(str(logs / "press_2"), str(against))
    words = ["compare", str(short_golden), "--against", str(against), "--jobs", "1"]
    assert main([*words, "--cell", "press_9"]) == 0
    assert "press_9" in Path(next((against / "compare").glob("golden-*/report.html"))).read_text(encoding="utf-8")
    tables = sorted((against / "compare").rglob("*.parquet"))
    assert [path.name for path in tables] == ["checks.parquet", "runs.parquet"]
    before = [path.read_bytes() for path in tables]
    for path in against.glob("*.bag"):
        state = path.stat()
        path.write_bytes(b"\0" * state.st_size)  # a second reading notices
        os.utime(str(path), ns=(state.st_mtime_ns, state.st_mtime_ns))
    assert main([*words, "--cell", "press_9"]) == 0
    assert [path.read_bytes() for path in tables] == before
    assert "12 runs: 12 same" in capsys.readouterr().out


def test_the_commands_and_the_question_of_the_page_are_understood(results, root):
    duckdb = pytest.importorskip("duckdb")
    text = (root / "docs" / "fleet_regression.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    lines = [shlex.split(line) for block in blocks for line in block.splitlines()]
    assert {line[1] for line in lines} == {"compare", "replay"}
    for line in lines:
        parser_of(line[1], load_command(line[1]), 98).parse_intermixed_args(line[2:])
    question, = re.findall(r"```sql\n(.*?)```", text, re.DOTALL)
    question = re.sub(r"'compare/[^']*'", "'%s'" % (results / "tables" / "checks.parquet"), question)
    first = duckdb.sql(question).fetchall()[0]
    assert first[:2] == ("press_1", "joint_3") and first[3] > 1.5


def test_the_logs_of_a_data_set_are_compared_where_they_are(short_golden, logs, tmp_path, capsys):
    dataset = tmp_path / "fleet"
    some = tmp_path / "some"
    some.mkdir()
    for number in (1, 2, 190):
        shutil.copy(str(logs / "press_1" / ("run_%03d.mcap" % number)), str(some))
    (some / "cut.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    assert main(["dataset", "add", str(some), "--to", str(dataset), "--cell", "press_7", "--jobs", "1", "-q"]) == 1
    assert main(["compare", str(short_golden), "--against", str(dataset), "--jobs", "1", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    verdicts = {os.path.basename(run["path"]): (run["cell"], run["verdict"]) for run in found["runs"]}
    assert verdicts == {"run_001.mcap": ("press_7", "same"), "run_002.mcap": ("press_7", "same"),
                        "run_190.mcap": ("press_7", "different"), "cut.mcap": ("press_7", "not compared")}
    assert len(list((dataset / "compare").glob("golden-*/runs.parquet"))) == 1
    # adding and asking go on beside the results
    assert main(["dataset", "add", str(some), "--to", str(dataset), "--cell", "press_7", "--jobs", "1", "-q"]) == 0
