"""Faults of a fleet's engines that take too long for the suite: a scheduler that is killed and started again, Ctrl-C
over a cluster, golden logs replayed while a worker is killed.

    tools/dev test test/soak/soak_fleet.py
"""
import json
import os
import shutil
import signal
import subprocess
import threading
from pathlib import Path

import pytest
from command_places import command_of
from dask_cluster import DaskCluster
from fleet_logs import write_plant
from fleet_tasks import die_once, wait_for_gate
from import_graph import ROOT
from waiting import wait_until

from jaka_bag.cli.main import main
from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.tasks import DONE, LogTask, Tally, run_tasks
from jaka_bag.errors import BagError
from jaka_fleet.dataset.runs import read_runs
from jaka_fleet.dataset.store import open_store

GOLDEN = ROOT / "test" / "data" / "golden"
PATIENCE_S = 300.0


def tasks_of(folder, count):
    return [LogTask("log_%d" % i, str(folder)) for i in range(count)]


@pytest.mark.parametrize("repeat", range(5))
def test_a_task_whose_worker_is_killed_is_done_by_another(tmp_path, repeat):
    found = []
    with DaskCluster(tmp_path) as cluster:
        run_tasks(die_once, tasks_of(tmp_path, 6), Dask(cluster.address), found.append)
        wait_until(lambda: sum(process.poll() is not None for process in cluster.workers) == 1, "one worker is dead")
    assert sorted(result.path for result in found) == ["log_%d" % i for i in range(6)]
    assert {result.status for result in found} == {DONE}


@pytest.mark.parametrize("repeat", range(5))
def test_a_scheduler_that_is_started_again_gets_what_is_left_and_one_that_stays_away_is_an_error(tmp_path, repeat):
    with DaskCluster(tmp_path, workers=1) as cluster:
        tasks = tasks_of(tmp_path, 4)
        found, tally = [], Tally(4)

        def restart(result):
            found.append(result)
            if len(found) == 1:
                (tmp_path / "gate").unlink()
                wait_until(lambda: (tmp_path / "began log_1").exists(), "the second task runs")
                cluster.kill_scheduler()
                cluster.start_scheduler()
                cluster.add_worker()
                (tmp_path / "gate").touch()

        def end(result):
            tally.add(result)
            cluster.kill_scheduler()

        (tmp_path / "gate").touch()
        run_tasks(wait_for_gate, tasks, Dask(cluster.address), restart)
        assert sorted(result.path for result in found) == [task.path for task in tasks]
        assert {result.status for result in found} == {DONE}
        with pytest.raises(BagError, match="cannot reach the Dask scheduler"):
            run_tasks(wait_for_gate, tasks, Dask(cluster.address, return_s=0.5), end)
        assert tally.counts[DONE] >= 1 and tally.left == 4 - tally.counts[DONE]


@pytest.mark.parametrize("repeat", range(3))
def test_a_scheduler_that_is_killed_when_results_wait_to_be_fetched_has_them_made_again(tmp_path, repeat):
    with DaskCluster(tmp_path, workers=1) as cluster:
        tasks, found = tasks_of(tmp_path, 6), []

        def restart(result):
            found.append(result.path)
            if len(found) == 1:
                wait_until(lambda: len(list(tmp_path.glob("began *"))) == 6, "all have ended, or do so now")
                cluster.kill_scheduler()
                cluster.start_scheduler()
                cluster.add_worker()

        (tmp_path / "gate").touch()
        run_tasks(wait_for_gate, tasks, Dask(cluster.address), restart)
    assert sorted(found) == [task.path for task in tasks]


@pytest.mark.parametrize("after", [1, 3, 8])
def test_ctrl_c_ends_a_cluster_of_this_computer_in_order(tmp_path, after):
    source, target = tmp_path / "logs", tmp_path / "fleet"
    write_plant(source, 4, 6, cycles=1)
    program = subprocess.Popen(
        [*command_of("jaka_bag"), "dataset", "add", str(source), "--to", str(target), "--jobs", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    wait_until(lambda: len(list((target / "runs").glob("*.parquet"))) >= after, "logs are in", PATIENCE_S)
    os.killpg(program.pid, signal.SIGINT)  # as a terminal does: to the workers, too
    out, err = program.communicate(timeout=PATIENCE_S)
    assert b"Traceback" not in err, err
    if program.returncode:  # else it had ended already
        assert b"of 24 logs are left" in err and err.strip().endswith(b"interrupted, no half file is left"), err
    with pytest.raises(ProcessLookupError):
        wait_until(lambda: os.killpg(program.pid, 0) is not None, "its processes have ended")
    assert not list((target / ".staging").glob("*"))
    assert main(["dataset", "add", str(source), "--to", str(target), "--jobs", "1", "--quiet"]) == 0
    assert len(read_runs(open_store(str(target)))) == 24


def stages():
    """Return process numbers of stages, each with that of the process that started it."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError):
            continue
        if b"jaka_fleet.replay.stage_process" in words:
            found[int(entry.name)] = parent
    return found


def test_all_golden_logs_are_replayed_although_a_worker_is_killed(tmp_path, capsys):
    names = sorted(path.stem for path in GOLDEN.glob("*.mcap"))
    orphans = {}
    with DaskCluster(tmp_path) as cluster:
        def kill():
            first = cluster.workers[0].pid
            wait_until(lambda: first in stages().values(), "a stage is up", PATIENCE_S)
            orphans.update({stage: parent for stage, parent in stages().items() if parent == first})
            cluster.workers[0].kill()
            cluster.add_worker()

        killer = threading.Thread(target=kill)
        killer.start()
        code = main(["replay", str(GOLDEN), "--dask", cluster.address, "--json", "--time-scale", "2",
                     "--tolerances", str(ROOT / "test" / "data" / "busy_host.yaml"), "-o", str(tmp_path / "reports")])
        killer.join()
    found = {one["folder"]: one["verdict"] for one in json.loads(capsys.readouterr().out)["replays"]}
    assert sorted(found) == names and set(found.values()) == {"same"} and code == 0, found
    assert orphans
    wait_until(lambda: not set(orphans) & set(stages()), "the killed worker's stage has ended", PATIENCE_S)
    shutil.rmtree(str(tmp_path / "reports"))
