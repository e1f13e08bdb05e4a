"""Faults that a data set survives: killed processes, a full disk, changing logs, two writers; no log is lost, doubled
or half in."""
import json
import os
import resource
import shutil
import signal
import subprocess
import sys

import pytest
from command_places import command_of
from fleet_logs import write_plant

from jaka_bag.cli.main import main
from jaka_fleet.dataset import adding
from jaka_fleet.dataset.query import DataSet
from jaka_fleet.dataset.runs import check_version, compact, read_runs
from jaka_fleet.dataset.store import FolderStore, open_store

PATIENCE_S = 150
KILLS_ITSELF = [sys.executable, "-c", """
import os, sys
from jaka_bag.cli.main import main
from jaka_fleet.dataset.store import FolderStore
left, place = [int(sys.argv[1])], FolderStore.place
def dies(store, path, name):
    left[0] -= 1
    if not left[0]:
        os.kill(os.getpid(), int(sys.argv[2]))
    place(store, path, name)
FolderStore.place = dies
sys.exit(main(sys.argv[3:]))
"""]


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant") / "logs"
    write_plant(folder, 2, 3, cycles=1)
    return folder


@pytest.fixture(scope="module")
def undisturbed(logs):
    target = logs.parent / "undisturbed"
    assert add(logs, target) == 0
    return tree(target)


def add(logs, target, *words):
    return main(["dataset", "add", str(logs), "--to", str(target), "--quiet", *(words or ("--jobs", "1"))])


def tree(folder):
    """Return name and content of each file that a reader sees."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and not path.relative_to(folder).parts[0].startswith(".")}


def staged(folder):
    return os.listdir(str(folder / ".staging")) if (folder / ".staging").exists() else []


def start(words, **options):
    return subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options)


def begin_add(logs, target, *words, **options):
    return start([*command_of("jaka_bag"), "dataset", "add", logs, "--to", target, *words], **options)


@pytest.mark.parametrize("place", [2, 12, 15])  # the first is _jaka_bag.json, then six tables and a row for each log
def test_a_killed_run_leaves_no_log_half_in_and_the_next_one_ends_it(tmp_path, logs, undisturbed, place):
    target = tmp_path / "fleet"
    killed = start([*KILLS_ITSELF, place, 9, "dataset", "add", logs, "--to", target, "--jobs", "1"])
    killed.communicate(timeout=PATIENCE_S)
    assert killed.returncode == -signal.SIGKILL
    whole = (place - 2) // 7
    assert len(read_runs(open_store(str(target)))) == whole
    with DataSet(str(target)) as data:
        if whole:
            batches = data.ask("SELECT count(DISTINCT run) FROM jaka_driver_robot_states")[1]
            assert next(batches).to_pylist() == [{"count(DISTINCT run)": whole}]
    assert staged(target)
    assert add(logs, target) == 0
    assert tree(target) == undisturbed and not staged(target)


def test_what_a_killed_run_published_is_removed_though_its_log_never_comes_again(tmp_path, logs):
    target, one = tmp_path / "fleet", tmp_path / "one"
    one.mkdir()
    shutil.copy(str(logs / "press_1" / "day_0.mcap"), str(one))
    killed = start([*KILLS_ITSELF, 5, 9, "dataset", "add", one, "--to", target, "--jobs", "1"])
    killed.communicate(timeout=PATIENCE_S)
    assert len(tree(target)) == 1 + 3
    assert main(["dataset", "compact", str(target), "--quiet"]) == 0
    assert sorted(tree(target)) == ["_jaka_bag.json", "runs/compacted.parquet"]


def test_what_another_program_has_published_whole_meanwhile_is_not_taken_back(tmp_path, logs, undisturbed):
    target, other = tmp_path / "fleet", tmp_path / "other"
    killed = start([*KILLS_ITSELF, 5, 9, "dataset", "add", logs, "--to", target, "--jobs", "1"])
    killed.communicate(timeout=PATIENCE_S)
    left, = staged(target)
    shutil.move(str(target / ".staging" / left), str(other))
    assert add(logs, target) == 0
    shutil.move(str(other), str(target / ".staging" / left))
    assert add(logs, target) == 0
    assert tree(target) == undisturbed and not staged(target)


def test_a_full_disk_fails_the_logs_that_do_not_fit_and_later_they_are_added(tmp_path, logs, undisturbed):
    target = tmp_path / "fleet"

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (30000, 30000))

    full = begin_add(logs, target, "--jobs", "1", "--json", preexec_fn=limit)
    out, err = full.communicate(timeout=PATIENCE_S)
    document = json.loads(out)
    assert full.returncode == 1 and len(document["failed"]) == 6 and not document["added"], err
    assert all("File too large" in one["reason"] for one in document["failed"]) and b"Traceback" not in err
    assert sorted(tree(target)) == ["_jaka_bag.json"] and not staged(target)
    assert add(logs, target) == 0 and tree(target) == undisturbed


def test_a_log_that_is_written_to_while_it_is_read_fails_and_is_added_later(tmp_path, logs, monkeypatch, capsys):
    target, log = tmp_path / "fleet", tmp_path / "run.mcap"
    shutil.copy(str(logs / "press_1" / "day_0.mcap"), str(log))
    real = adding.read_facts

    def written_to(reader):
        with log.open("ab") as file:
            file.write(b"more")
        return real(reader)

    monkeypatch.setattr(adding, "read_facts", written_to)
    assert add(log, target) == 1 and "changed while it was read" in capsys.readouterr().err
    assert sorted(tree(target)) == ["_jaka_bag.json"] and not staged(target)

    def replaced(reader):
        os.replace(str(shutil.copy(str(logs / "press_2" / "day_0.mcap"), str(tmp_path / "new"))), str(log))
        return real(reader)

    monkeypatch.setattr(adding, "read_facts", replaced)
    assert add(log, target) == 1 and sorted(tree(target)) == ["_jaka_bag.json"]
    monkeypatch.setattr(adding, "read_facts", real)
    assert add(log, target) == 0 and read_runs(open_store(str(target)))[0].cell == "press_2"


def test_two_writers_and_one_who_compacts_do_not_disturb_each_other(tmp_path, logs, undisturbed):
    target = tmp_path / "fleet"
    first = logs / "press_1" / "day_0.mcap"
    assert add(first, target) == 0
    programs = [begin_add(logs, target, "--jobs", "1") for _ in range(2)]
    while any(program.poll() is None for program in programs):
        compact(open_store(str(target)))
    for program in programs:
        out, err = program.communicate(timeout=PATIENCE_S)
        assert program.returncode == 0, err
    compact(open_store(str(target)))
    found = tree(target)
    del found["runs/compacted.parquet"]
    assert found == {name: data for name, data in undisturbed.items() if not name.startswith("runs/")}
    rows = read_runs(open_store(str(target)))
    assert rows == read_runs(open_store(str(logs.parent / "undisturbed"))) and len(rows) == 6


@pytest.mark.parametrize("is_compacted", [False, True])
def test_one_log_that_is_added_twice_at_once_for_two_cells_is_in_once(tmp_path, logs, monkeypatch, capsys,
                                                                      is_compacted):
    target, log = tmp_path / "fleet", logs / "press_1" / "day_0.mcap"
    real = adding.write_row

    def another_is_faster(row, path):
        monkeypatch.setattr(adding, "write_row", real)
        assert add(log, target, "--jobs", "1", "--cell", "right") == 0
        if is_compacted:
            compact(open_store(str(target)))
        real(row, path)

    monkeypatch.setattr(adding, "write_row", another_is_faster)
    capsys.readouterr()
    assert main(["dataset", "add", str(log), "--to", str(target), "--jobs", "1", "--cell", "left", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert not document["added"] and [one["reason"] for one in document["skipped"]] == ["it is in the data set"]
    row, = read_runs(open_store(str(target)))
    assert row.cell == "right" and not staged(target) and not any("left-" in name for name in tree(target))
    assert len(tree(target)) == 8


def test_what_a_killed_run_published_of_a_log_is_gone_where_another_adds_it_meanwhile(tmp_path, logs, monkeypatch):
    target, log = tmp_path / "fleet", logs / "press_1" / "day_0.mcap"
    real = adding.write_row

    def another_is_killed(row, path):
        killed = start([*KILLS_ITSELF, 4, 9, "dataset", "add", log, "--to", target, "--jobs", "1", "--cell", "left"])
        killed.communicate(timeout=PATIENCE_S)
        assert killed.returncode == -signal.SIGKILL and any("left-" in name for name in tree(target))
        real(row, path)

    monkeypatch.setattr(adding, "write_row", another_is_killed)
    assert add(log, target, "--jobs", "1", "--cell", "right") == 0
    assert len(tree(target)) == 8 and not any("left-" in name for name in tree(target)) and not staged(target)


def test_two_programs_that_make_a_data_set_at_once_both_have_it(tmp_path, monkeypatch):
    store, real = open_store(str(tmp_path / "fleet")), FolderStore.names

    def another_is_faster(self, folder):
        monkeypatch.setattr(FolderStore, "names", real)
        check_version(open_store(store.location), is_to_be_made=True)
        return real(self, folder)

    monkeypatch.setattr(FolderStore, "names", another_is_faster)
    check_version(store, is_to_be_made=True)
    check_version(store)


@pytest.mark.parametrize("cell", ["p" * 300, "\u673a" * 300, "/".join("ab" * 200)])
def test_a_cell_of_any_length_is_added(tmp_path, logs, cell):
    target = tmp_path / "fleet"
    assert add(logs / "press_1" / "day_0.mcap", target, "--jobs", "1", "--cell", cell) == 0
    assert len(tree(target)) == 8 and read_runs(open_store(str(target)))[0].cell == cell


def test_a_name_that_no_file_can_have_does_not_keep_others_from_being_removed(tmp_path, logs, undisturbed):
    target = tmp_path / "fleet"
    killed = start([*KILLS_ITSELF, 5, 9, "dataset", "add", logs, "--to", target, "--jobs", "1"])
    killed.communicate(timeout=PATIENCE_S)
    left, = staged(target)
    plan = target / ".staging" / left / "plan.json"
    plan.write_text(json.dumps(["%s.parquet" % ("p" * 300), *json.loads(plan.read_text())]))
    assert add(logs, target) == 0
    assert tree(target) == undisturbed and not staged(target)


def test_ctrl_c_leaves_no_log_half_in_and_says_what_is_left(tmp_path, logs, undisturbed):
    target = tmp_path / "fleet"
    ended = start([*KILLS_ITSELF, 12, int(signal.SIGINT), "dataset", "add", logs, "--to", target, "--jobs", "1"])
    out, err = ended.communicate(timeout=PATIENCE_S)
    assert ended.returncode == 1 and b"Traceback" not in err, err
    assert b"note: 5 of 6 logs are left: call it again" in err and b"note: 3 files of a run" in err, err
    assert err.strip().endswith(b"interrupted, no half file is left"), err
    assert len(read_runs(open_store(str(target)))) == 1
    assert add(logs, target) == 0 and tree(target) == undisturbed and not staged(target)
