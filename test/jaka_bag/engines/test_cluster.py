"""Real clusters: the same results and bytes as in one process, though workers are killed in the middle of the work.

Slower tests, such as a scheduler that is started again and Ctrl-C, are in ``test/soak/soak_fleet.py``.
"""
import threading

import pytest
from dask_cluster import DaskCluster
from fleet_logs import write_plant
from fleet_tasks import describe
from many_sessions import drift, run_of
from synthetic_session import write_log
from waiting import wait_until

from jaka_bag.cli.main import main
from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.processes import Processes
from jaka_bag.engines.tasks import LogTask, Serial, run_tasks
from jaka_bag.errors import BagError

TASKS = [LogTask("log_%d" % number, settings)
         for number, settings in enumerate([1, "foreseen", None, "system", "bug", (2, 3)])]


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    with DaskCluster(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


@pytest.fixture
def cluster(one):
    """Return a cluster in which two workers at least are alive."""
    alive = sum(process.poll() is None for process in one.workers)
    for _ in range(2 - alive):
        one.add_worker()
    one.wait_for_workers(2)
    return one


def results(engine, tasks=TASKS, function=describe):
    found = []
    run_tasks(function, iter(tasks), engine, found.append)
    return sorted(result._replace(seconds=0.0) for result in found)


def without_a_worker(cluster, is_time, work):
    """Return the result of ``work`` while one worker is killed as soon as ``is_time``."""
    victim = next(process for process in cluster.workers if process.poll() is None)

    def kill():
        wait_until(is_time, "the work is under way", 150)
        victim.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    result = work()
    killer.join()
    victim.wait(60)
    return result


def tree(folder):
    """Return name and content of each file that a reader sees."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and not path.relative_to(folder).parts[0].startswith(".")}


def test_every_engine_gives_the_same(cluster):
    ours = results(Serial())
    assert results(Processes(2)) == ours
    assert results(Dask(cluster.address)) == ours


def test_more_tasks_than_a_cluster_holds_at_a_time_each_have_one_result(cluster, monkeypatch):
    monkeypatch.setattr("jaka_bag.engines.dask_engine._IN_FLIGHT", 5)
    tasks = [LogTask("log_%04d" % i) for i in range(40)]
    assert [result.path for result in results(Dask(cluster.address), tasks)] == [task.path for task in tasks]


def test_a_data_set_has_the_same_bytes_though_a_worker_is_killed(tmp_path, cluster):
    write_plant(tmp_path / "logs", 2, 3, cycles=1)

    def add(target, *words):
        return main(["dataset", "add", str(tmp_path / "logs"), "--to", str(target), "--quiet", *words])

    target, staging = tmp_path / "fleet", tmp_path / "fleet" / ".staging"
    assert without_a_worker(cluster, staging.exists, lambda: add(
        target, "--dask", cluster.address)) == 0
    assert add(tmp_path / "serial", "--jobs", "1") == 0
    assert tree(target) == tree(tmp_path / "serial") and not any(staging.iterdir())


def test_a_comparison_has_the_same_bytes_though_a_worker_is_killed(tmp_path, cluster):
    logs = tmp_path / "logs"
    logs.mkdir()
    for number in range(20):
        write_log(logs / ("run_%02d.mcap" % number), run_of(number, drift(4, 0.01) if number % 9 == 5 else None))
    (logs / "cut.mcap").write_bytes((logs / "run_00.mcap").read_bytes()[:5000])

    def compare(target, *words):
        return main(["compare", str(logs / "run_00.mcap"), "--against", str(logs), "--results", str(target), "-q",
                     *words])

    target = tmp_path / "results"
    journal = target / "journal.jsonl"
    assert without_a_worker(cluster, lambda: (target / "runs.parquet").exists() or (
        journal.exists() and journal.read_bytes().count(b"\n") >= 3), lambda: compare(
            target, "--dask", cluster.address)) == 1
    assert compare(tmp_path / "serial", "--jobs", "1") == 1
    for name in ("runs.parquet", "checks.parquet"):
        assert (target / name).read_bytes() == (tmp_path / "serial" / name).read_bytes()


def test_a_cluster_that_has_lost_its_workers_is_an_error(cluster):
    for process in cluster.workers:
        process.kill()
    with pytest.raises(BagError, match="has no workers"):
        results(Dask(cluster.address, return_s=0.0))
