"""Questions to a data set: those of docs/fleet.md, answers as table, CSV and Parquet, and hidden columns."""
import csv
import json
import os
import shutil
import struct
import subprocess
import sys

import pyarrow.parquet as parquet
import pytest
from fleet_logs import FIRST_HOUR, Run, write_plant, write_run
from log_samples import START_NS, STATES, Sample, state_log, tool, write
from page_commands import blocks

from jaka_bag.cli.main import main
from jaka_bag.errors import BagError, MissingDependency, UsageError
from jaka_fleet.dataset.query import DataSet, view_names
from jaka_fleet.dataset.runs import compact, read_runs
from jaka_fleet.dataset.store import open_store

pytest.importorskip("duckdb")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant")
    write_plant(folder / "logs")
    assert main(["dataset", "add", str(folder / "logs"), "--to", str(folder / "fleet"), "--jobs", "1", "--quiet"]) == 0
    return folder / "fleet"


@pytest.fixture(scope="module")
def questions(root):
    return {block.note.partition(": ")[2]: block.text for block in blocks(root / "docs" / "fleet.md")
            if block.note.startswith("the question: ")}


def ask(fleet, question):
    with DataSet(str(fleet)) as data:
        return [row for batch in data.ask(question)[1] for row in batch.to_pylist()]


def test_the_longest_cycle_is_that_of_the_slow_day(fleet, questions):
    rows = ask(fleet, questions["cycles"])
    assert len(rows) == 12 and {row["cell"] for row in rows} == {"press_1", "press_2", "press_3"}
    longest = max(rows, key=lambda row: row["longest_s"])
    assert (longest["cell"], str(longest["date"])) == ("press_1", "2023-11-15")
    others = [row["longest_s"] for row in rows if row is not longest]
    assert longest["longest_s"] > 1.2 * max(others) and min(others) > 1.0
    runs = {row.run: row for row in read_runs(open_store(str(fleet)))}
    assert runs[longest["run"]].path.endswith("press_1/day_1.mcap")


def test_the_joint_that_wears_is_the_only_one(fleet, questions):
    row, = ask(fleet, questions["joints"])
    assert (row["cell"], row["joint"], row["runs"]) == ("press_2", 3, 4)
    assert row["rad_a_day"] == pytest.approx((row["largest"] - row["smallest"]) / 3, rel=0.2)


def test_emergency_stops_are_counted_once_each(fleet, questions):
    assert ask(fleet, questions["stops"]) == [{"hour": FIRST_HOUR, "cell": "press_3", "stops": 4}]


def test_calls_that_failed_are_told_with_who_called(fleet, questions):
    row, = ask(fleet, questions["calls"])
    assert {**row, "first": None} == {"cell": "press_1", "caller": "/plc", "service": "/jaka_driver/set_io",
                                      "error": "out of range", "calls": 6, "first": None}


def test_lost_messages_are_those_that_the_recorder_knows(fleet, questions):
    row, = ask(fleet, questions["lost"])
    assert (row["cell"], row["topic"], row["lost"]) == ("press_3", "/jaka_driver/joint_position", 30)
    assert row["messages"] > 1000


def test_the_page_has_five_questions_that_the_terminal_answers(fleet, questions, capsys):
    assert sorted(questions) == ["calls", "cycles", "joints", "lost", "stops"]
    for question in questions.values():
        assert main(["dataset", "query", str(fleet), question]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) >= 3 and set(lines[1]) == {"-", " "}
    assert main(["dataset", "query", str(fleet)]) == 0
    assert "jaka_driver_robot_states" in capsys.readouterr().out


def test_the_script_for_pandas_reads_the_files_itself(fleet, root):
    pytest.importorskip("pandas")
    program, = [block.text for block in blocks(root / "docs" / "fleet.md") if block.note == "the script: pandas"]
    out = subprocess.run([sys.executable, "-c", program], cwd=str(fleet.parent), stdout=subprocess.PIPE, check=True,
                         timeout=100).stdout.decode()
    assert out.count("Z-") == 4


def test_the_tables_of_a_day_can_be_merged_as_the_page_says(fleet, root, tmp_path, monkeypatch):
    import duckdb
    shutil.copytree(str(fleet), str(tmp_path / "fleet"))
    question = "SELECT cell, run, date, count(*) AS messages FROM robot_states GROUP BY ALL ORDER BY run"
    before = ask(tmp_path / "fleet", question)
    statement, = [block.text for block in blocks(root / "docs" / "fleet.md") if block.note == "the merge"]
    monkeypatch.chdir(tmp_path)
    duckdb.connect().execute(statement)
    folder = tmp_path / "fleet" / "topic=jaka_driver.robot_states" / "date=2023-11-14"
    for path in folder.glob("*.parquet"):
        path.unlink()
    (folder / "merged.new").rename(folder / "merged.parquet")
    assert ask(tmp_path / "fleet", question) == before and len(before) == 12


def test_an_answer_is_a_table_or_a_csv_or_a_parquet_file(fleet, tmp_path, capfd):
    question = "SELECT cell, min(start) AS first, count(*) AS logs FROM runs GROUP BY cell ORDER BY cell"
    assert main(["dataset", "query", str(fleet), question]) == 0
    shown = capfd.readouterr().out.splitlines()
    assert shown[0].split() == ["cell", "first", "logs"] and shown[2].split()[-1] == "4" and len(shown) == 5
    assert shown[2].split()[1].startswith("2023-11-14")
    assert main(["dataset", "query", str(fleet), question, "--csv", "-"]) == 0
    rows = list(csv.reader(capfd.readouterr().out.splitlines()))
    assert rows[0] == ["cell", "first", "logs"] and [row[2] for row in rows[1:]] == ["4", "4", "4"]
    for kind in ("csv", "parquet"):
        path = tmp_path / ("answer." + kind)
        assert main(["dataset", "query", str(fleet), question, "--" + kind, str(path)]) == 0
        assert main(["dataset", "query", str(fleet), question, "--" + kind, str(path)]) == 1
        assert main(["dataset", "query", str(fleet), question, "--" + kind, str(path), "--force"]) == 0
    assert list(csv.reader((tmp_path / "answer.csv").read_text().splitlines())) == rows
    assert parquet.read_table(str(tmp_path / "answer.parquet"))["logs"].to_pylist() == [4, 4, 4]


def test_lists_and_structures_are_json_in_a_csv(fleet, tmp_path):
    path = tmp_path / "runs.csv"
    assert main(["dataset", "query", str(fleet), "SELECT *, INTERVAL 2 DAY AS days FROM runs", "--csv", str(path)]) == 0
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert len(rows) == 12
    for row, asked in zip(rows, ask(fleet, "SELECT * FROM runs")):
        assert [topic["messages"] for topic in json.loads(row["topics"])] == [
            topic["messages"] for topic in asked["topics"]]
        assert row["cell"] == asked["cell"] and "2" in row["days"]


def test_a_long_answer_is_cut_on_the_terminal_alone(fleet, capfd):
    question = "SELECT log_time FROM robot_states ORDER BY log_time"
    assert main(["dataset", "query", str(fleet), question]) == 0
    assert capfd.readouterr().out.splitlines()[-1].startswith("... and more")
    assert main(["dataset", "query", str(fleet), question, "--csv", "-"]) == 0
    assert len(capfd.readouterr().out.splitlines()) > 10000


def test_rows_of_a_log_without_its_row_in_runs_are_not_shown(fleet, tmp_path):
    target = tmp_path / "fleet"
    log = write_run(tmp_path / "a.mcap", Run())
    other = write_run(tmp_path / "b.mcap", Run(seed=5, start_s=100.0))
    for path in (log, other):
        assert main(["dataset", "add", str(path), "--to", str(target), "--jobs", "1", "--quiet"]) == 0
    assert ask(target, "SELECT count(DISTINCT run) AS runs FROM robot_states") == [{"runs": 2}]
    hidden = next(row for row in read_runs(open_store(str(target))) if row.path == str(log))
    os.unlink(str(target / "runs" / (hidden.hash + ".parquet")))
    assert ask(target, "SELECT count(DISTINCT run) AS runs FROM robot_states") == [{"runs": 1}]
    compact(open_store(str(target)))
    assert ask(target, "SELECT count(DISTINCT run) AS runs FROM robot_states") == [{"runs": 1}]


def test_topics_whose_type_has_changed_are_one_table(tmp_path):
    from log_samples import Sample, connection, text
    for number, definition in enumerate(["string a\n", "string a\nint32 b\n"]):
        data = text("x") + (b"" if number == 0 else (9).to_bytes(4, "little"))
        write(tmp_path / ("%d.bag" % number), [Sample(connection("/odd", "test/Odd", definition), START_NS, data)])
    assert main(["dataset", "add", str(tmp_path), "--to", str(tmp_path / "fleet"), "--jobs", "1", "--quiet"]) == 0
    assert ask(tmp_path / "fleet", "SELECT a, b FROM odd ORDER BY b NULLS FIRST") == [
        {"a": "x", "b": None}, {"a": "x", "b": 9}]


PART = "string date\nstring topic\nstring filename\n"


def write_part(path, second=0):
    from log_samples import Sample, connection, text
    data = text("yesterday") + text("weld") + text("a.nc")
    return write(path, [Sample(connection("/part", "shop/Part", PART), START_NS + second * 10**9, data)])


@pytest.mark.parametrize("place", ["fleet", "cell=A/date=1999-01-01/fleet", "b[1]*/fleet"])
def test_no_part_of_the_path_takes_the_place_of_a_column(tmp_path, place):
    log, target = write_part(tmp_path / "a.bag"), tmp_path / place
    target.parent.mkdir(parents=True, exist_ok=True)
    assert main(["dataset", "add", str(log), "--to", str(target), "--cell", "B", "--jobs", "1", "--quiet"]) == 0
    question = "SELECT cell, date_, topic_, filename, CAST(date AS VARCHAR) AS day FROM part WHERE date = '2023-11-14'"
    expected = {"cell": "B", "date_": "yesterday", "topic_": "weld", "filename": "a.nc", "day": "2023-11-14"}
    assert ask(target, question) == [expected]
    assert set(ask(target, "SELECT * FROM part")[0]) == {
        "cell", "run", "log_time", "date_", "topic_", "filename", "date"}
    file, = target.glob("topic=part/*/*.parquet")
    assert parquet.ParquetFile(str(file)).schema_arrow.names[3:] == ["date_", "topic_", "filename"]


def test_a_data_set_whose_columns_have_names_of_folders_is_asked_as_before_and_added_to(tmp_path):
    import pyarrow
    target = tmp_path / "fleet"
    for number in range(2):
        log = write_part(tmp_path / ("%d.bag" % number), number)
        assert main(["dataset", "add", str(log), "--to", str(target), "--jobs", "1", "--quiet"]) == 0
    for path in sorted(target.glob("topic=part/*/*.parquet"))[:1]:  # as earlier versions wrote it
        table = parquet.ParquetFile(str(path)).read()
        assert isinstance(table, pyarrow.Table)
        parquet.write_table(table.rename_columns([name.rstrip("_") for name in table.column_names]), str(path))
    assert ask(target, "SELECT date_, topic_, count(*) AS rows FROM part GROUP BY ALL") == [
        {"date_": "yesterday", "topic_": "weld", "rows": 2}]


def test_a_condition_on_the_date_leaves_the_files_of_other_days_alone(fleet, tmp_path):
    shutil.copytree(str(fleet), str(tmp_path / "fleet"))
    for path in (tmp_path / "fleet" / "topic=jaka_driver.robot_states" / "date=2023-11-15").iterdir():
        path.write_bytes(b"no table")
    row, = ask(tmp_path / "fleet", "SELECT count(*) AS rows FROM robot_states WHERE date < '2023-11-15'")
    assert row["rows"] > 100


def test_columns_that_a_type_of_ros_2_got_later_are_there(tmp_path):
    # its channels have no MD5 sum that tells one definition from another
    from mcap.writer import Writer
    for number, fields in enumerate((["fx"], ["fx", "fz"])):
        with (tmp_path / ("%d.mcap" % number)).open("wb") as file:
            writer = Writer(file)
            writer.start("ros2", "test")
            schema = writer.register_schema("shop/msg/Force", "ros2msg", "".join(
                "float64 %s\n" % name for name in fields).encode())
            channel = writer.register_channel("/force", "cdr", schema)
            values = struct.pack("<%dd" % len(fields), *range(number, number + len(fields)))
            at = START_NS + number * 10**9
            writer.add_message(channel, at, b"\0\1\0\0" + values, at)
            writer.finish()
    assert main(["dataset", "add", str(tmp_path), "--to", str(tmp_path / "fleet"), "--jobs", "1", "--quiet"]) == 0
    assert ask(tmp_path / "fleet", "SELECT fx, fz FROM force ORDER BY fx") == [
        {"fx": 0.0, "fz": None}, {"fx": 1.0, "fz": 2.0}]


def test_a_data_set_in_memory_is_asked_through_fsspec(tmp_path):
    log = write(tmp_path / "a.bag", [tool(1, START_NS, [1.0] * 6)])
    assert main(["dataset", "add", str(log), "--to", "memory://asked", "--jobs", "1", "--quiet"]) == 0
    assert ask("memory://asked", 'SELECT "twist.linear.x" AS x FROM tool_position') == [{"x": 1.0}]


def test_views_are_named_after_topics():
    assert view_names(["/a/state", "/b/state", "/b/pose", "/runs", "/b_pose"]) == {
        "a_state": "/a/state", "b_state": "/b/state", "b_pose": "/b/pose", "b_pose_2": "/b_pose", "runs_": "/runs",
        "pose": "/b/pose"}
    assert view_names(["/A/state", "/a/state", "state", "/state"]) == {
        "A_state": "/A/state", "a_state_2": "/a/state", "state": "/state", "state_2": "state"}


def test_a_renamed_view_is_told_once_to_whoever_asks_for_it(tmp_path, capsys):
    samples = [Sample(STATES._replace(topic=topic), START_NS, bytes(8)) for topic in ("/a/b", "/a_b", "/c")]
    words = ["dataset", "add", str(write(tmp_path / "a.bag", samples)), "--to", str(tmp_path / "set"), "--cell", "a"]
    assert main(words) == 0
    told = "note: /a_b is named a_b_2: a_b is another topic's name"
    asked = (([], 1), (["SELECT * FROM a_b"], 1), (["SELECT * FROM a_b_2"], 1), (["SELECT * FROM c"], 0))
    for question, count in asked:
        capsys.readouterr()
        assert main(["dataset", "query", str(tmp_path / "set"), *question]) == 0
        assert capsys.readouterr().err.count(told) == count


@pytest.mark.parametrize("question, said", [
    ("SELECT nothing FROM runs", "nothing"), ("SELEC 1", "syntax error"),
    ("SELECT * FROM joints", "the tables are runs, ")])
def test_a_question_that_cannot_be_answered_is_a_usage_error(fleet, question, said, capsys):
    assert main(["dataset", "query", str(fleet), question]) == 2
    assert said in capsys.readouterr().err
    with pytest.raises(UsageError):
        ask(fleet, question)


def test_what_is_no_data_set_is_said(tmp_path, capsys):
    assert main(["dataset", "query", str(tmp_path), "SELECT 1"]) == 1
    assert "is no data set of jaka_bag" in capsys.readouterr().err
    path = write(tmp_path / "a.bag", state_log(0.1))
    with pytest.raises(BagError, match="is a file"):
        DataSet(str(path))


def test_without_duckdb_it_says_so(fleet, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "duckdb", None)
    assert main(["dataset", "query", str(fleet), "SELECT 1"]) == 1
    assert "dataset query needs the Python package duckdb" in capsys.readouterr().err
    with pytest.raises(MissingDependency):
        DataSet(str(fleet))
