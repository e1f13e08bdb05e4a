"""Tables and rows of ``runs`` made of logs: their content, what is skipped, and what is kept of damaged ones."""
import hashlib
import io
import json
import os
import shutil
import sys
import threading

import pyarrow.parquet as parquet
import pytest
from accident_samples import STATES
from fleet_logs import FIRST_DAY, Run, write_plant, write_run
from log_samples import POSE, START_NS, Sample, joints, pose, state_log, states, tool, write

from jaka_bag.cli.main import main
from jaka_bag.engines.tasks import DONE, LogTask
from jaka_bag.errors import MissingDependency, UsageError
from jaka_bag.operations.export import export
from jaka_fleet.dataset.adding import AddSettings, add_log, cell_of, find_logs
from jaka_fleet.dataset.runs import RECOVERED, UNREADABLE, WHOLE, compact, find_status, read_runs
from jaka_fleet.dataset.store import FolderStore, open_store

CELL, DAY = "/jaka_driver/robot_states", "date=" + FIRST_DAY


def add(*words):
    return main(["dataset", "add", *map(str, words), "--jobs", "1"])


def rows(folder):
    return read_runs(open_store(str(folder)))


def tables(folder, row):
    """Return topic and path of each table of a run."""
    found = {}
    for path in sorted(folder.glob("topic=*/*/*-%s.parquet" % row.run)):
        found[parquet.ParquetFile(str(path)).schema_arrow.metadata[b"jaka_bag.topic"].decode()] = str(path)
    return found


def tree(folder):
    """Return name and content of each file that is no working file."""
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob("*")) if path.is_file() and path.name != ".lock"}


def test_a_log_becomes_tables_with_the_columns_of_export(tmp_path):
    log = write_run(tmp_path / "run.mcap", Run())
    assert add(log, "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    written = tables(tmp_path / "fleet", row)
    assert sorted(written) == sorted(topic.topic for topic in row.topics) and len(written) == 6
    name = "topic=jaka_driver.robot_states/%s/press_1-%s.parquet" % (DAY, row.run)
    assert (tmp_path / "fleet" / name).is_file()
    from jaka_bag.containers.registry import open_log
    with open_log(log) as reader:
        exported = export(reader, tmp_path / "run.parquet").tables
    for topic, (path, count) in exported.items():
        ours, theirs = parquet.ParquetFile(written[topic]), parquet.read_table(path)
        table = ours.read()
        assert table.column_names[:2] == ["cell", "run"] and table.drop(["cell", "run"]).equals(theirs)
        assert set(table["cell"].to_pylist()) == {"press_1"} and set(table["run"].to_pylist()) == {row.run}
        times = table["log_time"].cast("int64").to_pylist()
        assert times == sorted(times) and len(times) == count
        facts = ours.schema_arrow.metadata
        assert facts[b"jaka_bag.schema_version"] == b"1" and facts[b"jaka_bag.topic"] == topic.encode()
        group = ours.metadata.row_group(0)
        assert all(group.column(i).is_stats_set for i in range(3))


def test_a_row_tells_of_its_log(tmp_path):
    log = write_run(tmp_path / "run.mcap", Run("lathe 7", stops=(1.0,), undelivered=4))
    assert add(log, "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    assert row.hash == hashlib.sha256(log.read_bytes()).hexdigest() and row.run.endswith(row.hash[:12])
    assert (row.cell, row.status, row.reason, row.path) == ("lathe 7", WHOLE, "", str(log))
    assert (row.arm_model, row.controller_firmware, row.driver_version) == ("zu7", "1.7.2", "0.2.0")
    assert START_NS <= row.start < START_NS + 10**9 and 5.0 < row.duration < 60.0 and row.size == log.stat().st_size
    counts = {topic.topic: topic for topic in row.topics}
    assert row.messages == sum(topic.messages for topic in row.topics) and row.lost == 4
    assert counts["/jaka_driver/joint_position"].lost == 4 and counts["/jaka_driver/tool_position"].lost == 0
    assert counts["/jaka_driver/robot_states"].lost is None
    assert counts["/jaka_driver/joint_position"].type == "sensor_msgs/JointState"


def test_numbers_that_are_skipped_are_lost_messages_whoever_published(tmp_path):
    samples = [tool(seq, START_NS + seq * 10**7, [0.0] * 6) for seq in (1, 2, 5, 6, 1, 2)]
    other = joints(0, 0, [0.0] * 6).connection._replace(callerid="/other")
    samples += [joints(seq, START_NS + seq * 10**7, [0.0] * 6) for seq in (1, 2, 3)]
    samples += [Sample(other, START_NS + seq * 10**7, joints(seq, 0, [0.0] * 6).data) for seq in (10, 20)]
    assert add(write(tmp_path / "run.bag", samples), "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    assert {topic.topic: topic.lost for topic in row.topics} == {
        "/jaka_driver/tool_position": 2, "/jaka_driver/joint_position": 9}


def test_triggers_of_a_black_box_are_in_the_row(tmp_path):
    write(tmp_path / "run.mcap", state_log(0.2))
    facts = tmp_path / "with.mcap"
    from jaka_bag.operations.extras import attach
    attach(tmp_path / "run.mcap", facts, [], [
        ("jaka_bag.trigger", {"time_ns": str(START_NS + 5), "kind": "error", "detail": "motion_state 4"}),
        ("jaka_bag.accident", {"model": "zu5", "driver_version": "0.3", "controller_version": "1.5"})])
    assert add(facts, "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    assert [tuple(trigger) for trigger in row.triggers] == [(START_NS + 5, "error", "motion_state 4")]
    assert (row.arm_model, row.controller_firmware, row.driver_version) == ("zu5", "1.5", "0.3")


@pytest.mark.parametrize("name, values", [
    ("jaka_bag.trigger", {"time_ns": "\u00b2", "kind": "error"}),
    ("jaka_bag.trigger", {"time_ns": "9" * 25, "kind": "error"}), ("jaka_bag.trigger", {"time_ns": "9" * 5000}),
    ("jaka_bag.drops", {"/jaka_driver/tool_position": '{"overflowed": %d, "unwritten": -5}' % 10**25})])
def test_a_record_with_a_number_that_cannot_be_meant_leaves_the_log_whole(tmp_path, name, values):
    from jaka_bag.operations.extras import attach
    write(tmp_path / "run.mcap", state_log(0.2))
    attach(tmp_path / "run.mcap", tmp_path / "with.mcap", [], [(name, values)])
    assert add(tmp_path / "with.mcap", "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    assert row.status == WHOLE and row.lost == 0 and [trigger.at for trigger in row.triggers] in ([], [0])


def test_a_log_that_is_in_is_left_alone_under_any_name_and_as_a_copy(tmp_path, capsys):
    folder = tmp_path / "logs"
    write_plant(folder, 2, 2)
    shutil.copy(str(folder / "press_1" / "day_0.mcap"), str(folder / "copy.mcap"))
    assert add(folder, "--to", tmp_path / "fleet", "--json") == 0
    first = json.loads(capsys.readouterr().out)
    assert len(first["added"]) == 4 and len(first["skipped"]) == 1 and not first["failed"]
    before = tree(tmp_path / "fleet")
    (folder / "press_1").rename(folder / "press_9")
    assert add(folder, "--to", tmp_path / "fleet") == 0
    assert "0 logs added" in capsys.readouterr().out and tree(tmp_path / "fleet") == before
    compact(open_store(str(tmp_path / "fleet")))
    assert add(folder, "--to", tmp_path / "fleet") == 0 and len(rows(tmp_path / "fleet")) == 4
    assert os.listdir(str(tmp_path / "fleet" / "runs")) == ["compacted.parquet"]


@pytest.mark.parametrize("settings, path, told, cell", [
    (AddSettings("", cell="a"), "logs/b/x.bag", "c", "a"), (AddSettings("", cell_pattern=r"logs/(\w+)/"),
                                                            "logs/b/x.bag", "c", "b"),
    (AddSettings("", cell_pattern="[0-9]+"), "logs/12/x.bag", "c", "12"),
    (AddSettings("", cell_pattern="[0-9]+"), "logs/x.bag", "c", "c"), (AddSettings(""), "x.bag", "", "unnamed")])
def test_the_cell_is_what_is_said_else_of_the_path_else_of_the_log(settings, path, told, cell):
    assert cell_of(settings, path, told) == cell


def test_a_damaged_log_is_recovered_and_an_unreadable_one_is_listed(tmp_path, capsys):
    folder = tmp_path / "logs"
    folder.mkdir()
    write(folder / "a.bag", state_log(1.0))
    whole = (folder / "a.bag").read_bytes()
    (folder / "cut.bag").write_bytes(whole[:len(whole) // 2])
    (folder / "empty.mcap").write_bytes(b"")
    (folder / "old.bag").write_bytes(b"#ROSBAG V1.1\n" + bytes(100))
    (folder / "text.mcap").write_text("hello")
    assert add(folder, "--to", tmp_path / "fleet") == 1
    told = capsys.readouterr()
    assert "2 logs added" in told.out and "3 unreadable, 0 failed" in told.out
    found = {os.path.basename(row.path): row for row in rows(tmp_path / "fleet")}
    assert {name: row.status for name, row in found.items()} == {
        "a.bag": WHOLE, "cut.bag": RECOVERED, "empty.mcap": UNREADABLE, "old.bag": UNREADABLE,
        "text.mcap": UNREADABLE}
    assert 0 < found["cut.bag"].messages < found["a.bag"].messages and found["cut.bag"].reason
    assert "version 1.1" in found["old.bag"].reason and "empty" in found["empty.mcap"].reason
    for name in ("cut.bag", "old.bag", "text.mcap"):
        assert name in told.err
    assert add(folder, "--to", tmp_path / "fleet") == 0
    assert add(folder, "--to", tmp_path / "fleet", "--again") == 1 and len(rows(tmp_path / "fleet")) == 5


def test_a_topic_that_cannot_be_decoded_is_left_out_and_said(tmp_path):
    samples = [states(START_NS + i, 0, 1, 0, 0) for i in range(5)]
    samples += [pose(1, START_NS, [0.0] * 7), tool(2, START_NS + 1, [0.0] * 6)]  # two types on one topic
    assert POSE.topic == "/jaka_driver/tool_position"
    assert add(write(tmp_path / "run.bag", samples), "--to", tmp_path / "fleet") == 1
    row, = rows(tmp_path / "fleet")
    assert row.status == WHOLE and "/jaka_driver/tool_position is left out" in row.reason
    assert list(tables(tmp_path / "fleet", row)) == [STATES.topic]


def test_a_recording_under_way_is_left_for_later(tmp_path, capsys):
    from jaka_bag.containers.registry import create_log
    folder = tmp_path / "logs"
    folder.mkdir()
    with create_log(folder / "run.mcap", suffix=".active") as writer:
        sample = tool(1, START_NS, [0.0] * 6)
        writer.add_message(writer.add_channel(sample.connection), sample.time, sample.data)
        writer.flush()
        assert add(folder, "--to", tmp_path / "fleet", "--json") == 0
        assert json.loads(capsys.readouterr().out)["skipped"][0]["reason"] == "it is being written"
    assert add(folder, "--to", tmp_path / "fleet") == 0 and len(rows(tmp_path / "fleet")) == 1


def test_a_log_without_messages_has_a_row_and_no_table(tmp_path):
    assert add(write(tmp_path / "run.bag", []), "--to", tmp_path / "fleet") == 0
    row, = rows(tmp_path / "fleet")
    assert (row.status, row.messages, row.start, row.topics) == (WHOLE, 0, None, ())


def test_a_field_that_is_called_like_a_column_of_the_data_set_keeps_its_values(tmp_path):
    from log_samples import connection, text
    odd = connection("/odd", "test/Odd", "string cell\nint32 run\n")
    samples = [Sample(odd, START_NS, text("mine") + (7).to_bytes(4, "little"))]
    assert add(write(tmp_path / "run.bag", samples), "--to", tmp_path / "fleet", "--cell", "theirs") == 0
    row, = rows(tmp_path / "fleet")
    table = parquet.ParquetFile(tables(tmp_path / "fleet", row)["/odd"]).read()
    assert table["cell"][0].as_py() == "theirs" and table["cell_"][0].as_py() == "mine"
    assert table["run_"][0].as_py() == 7


def test_urls_of_fsspec_hold_the_same_tables(tmp_path):
    folder = tmp_path / "logs"
    write_plant(folder, 1, 2)
    assert add(folder, "--to", tmp_path / "fleet") == 0
    ours = tree(tmp_path / "fleet")
    assert add(folder, "--to", "file://%s" % (tmp_path / "url")) == 0
    assert tree(tmp_path / "url") == ours
    import fsspec
    memory = fsspec.filesystem("memory")
    memory.rm("/", recursive=True)
    for _ in range(2):
        assert add(folder, "--to", "memory://plant/fleet") == 0
    stored = {path[len("/plant/fleet/"):]: hashlib.sha256(memory.cat_file(path)).hexdigest()
              for path in memory.find("/plant/fleet")}
    assert stored == ours
    store = open_store("memory://plant/fleet")
    assert compact(store) == 2 and find_status(store, rows(tmp_path / "fleet")[0].hash) == WHOLE


def test_the_threads_of_pyarrow_get_no_python_file(tmp_path, monkeypatch):
    # A thread that released a file's object while the process ended aborted the process.
    write_plant(tmp_path / "logs", 1, 2)
    assert add(tmp_path / "logs", "--to", tmp_path / "fleet") == 0
    readers = set()

    class Watched(io.FileIO):
        def readinto(self, buffer):
            readers.add(threading.current_thread())
            return super().readinto(buffer)

        def readall(self):
            readers.add(threading.current_thread())
            return super().readall()

        def read(self, size=-1):
            readers.add(threading.current_thread())
            return super().read(size)

    monkeypatch.setattr(FolderStore, "open", lambda store, name: Watched(store.address(name)))
    for _ in range(2):
        store = open_store(str(tmp_path / "fleet"))
        assert all(find_status(store, row.hash) == WHOLE for row in read_runs(store)) and not find_status(store, "x")
        assert compact(store) == 2
    assert readers == {threading.current_thread()}


def test_a_row_that_is_compacted_while_it_is_looked_for_is_found(tmp_path, monkeypatch):
    write_plant(tmp_path / "logs", 1, 1)
    assert add(tmp_path / "logs", "--to", tmp_path / "fleet") == 0
    store = open_store(str(tmp_path / "fleet"))
    row, = read_runs(store)
    real = FolderStore.open

    def compacted_first(store, name):
        monkeypatch.setattr(FolderStore, "open", real)
        compact(open_store(store.location))
        return real(store, name)

    monkeypatch.setattr(FolderStore, "open", compacted_first)
    assert find_status(store, row.hash) == WHOLE


@pytest.mark.parametrize("url", [False, True])
def test_the_compacted_rows_are_read_once_for_each_log(tmp_path, monkeypatch, url):
    write_plant(tmp_path / "logs", 1, 2)
    target = ("file://%s" if url else "%s") % (tmp_path / "fleet")
    first, second = find_logs([str(tmp_path / "logs")])
    assert add(first, "--to", target) == 0 and compact(open_store(target)) == 1
    opened, kind = [], type(open_store(target))
    real = kind.open
    monkeypatch.setattr(kind, "open", lambda store, name: opened.append(name) or real(store, name))
    assert add_log(LogTask(second, AddSettings(target))).status == DONE
    assert opened.count("runs/compacted.parquet") == 1 and len(opened) == 2


@pytest.mark.parametrize("content, said", [
    ({"other.txt": "mine"}, "no data set of jaka_bag, and not empty"),
    ({"_jaka_bag.json": '{"schema_version": 2}'}, "tables of version 2"), ({"_jaka_bag.json": "{"}, "damaged")])
def test_another_folder_or_another_version_is_not_touched(tmp_path, capsys, content, said):
    target = tmp_path / "fleet"
    target.mkdir()
    for name, text in content.items():
        (target / name).write_text(text)
    before = tree(target)
    assert add(write(tmp_path / "run.bag", state_log(0.1)), "--to", target) == 1
    assert said in capsys.readouterr().err and tree(target) == before


@pytest.mark.parametrize("words", [["none.bag"], ["empty"], ["run.bag", "--cell", "a", "--cell-from", "b"],
                                   ["run.bag", "--cell-from", "("], ["run.bag", "--dask", "tcp://x:1"]])
def test_what_cannot_be_meant_is_a_usage_error(tmp_path, words, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    write(tmp_path / "run.bag", state_log(0.1))
    assert add(*words, "--to", "fleet") == 2  # --jobs goes with no cluster elsewhere
    assert not (tmp_path / "fleet").exists() and "Traceback" not in capsys.readouterr().err


def test_without_pyarrow_it_says_so(tmp_path, monkeypatch, capsys):
    log = write(tmp_path / "run.bag", state_log(0.1))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert add(log, "--to", tmp_path / "fleet") == 1
    assert "needs the Python package pyarrow" in capsys.readouterr().err
    with pytest.raises(MissingDependency):
        add_log(LogTask(str(log), AddSettings(str(tmp_path / "fleet"))))


def test_a_folder_that_cannot_be_read_is_named_and_not_left_out(tmp_path, monkeypatch):
    (tmp_path / "logs" / "locked").mkdir(parents=True)
    (tmp_path / "logs" / "a.mcap").touch()
    scan = os.scandir

    def scandir(path):  # root reads every folder
        if str(path).endswith("locked"):
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)
    monkeypatch.setattr(os, "scandir", scandir)
    with pytest.raises(UsageError, match="locked cannot be read"):
        find_logs([str(tmp_path / "logs")])
