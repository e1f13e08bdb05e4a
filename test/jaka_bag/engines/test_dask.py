"""Files handed to a Dask cluster: a real scheduler and two real workers."""
import json
import os
import shutil

import pytest
from dask_cluster import DaskCluster
from log_samples import in_order, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.engines.conversion import convert_task, task_of
from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.tasks import run_tasks
from jaka_bag.errors import BagError
from jaka_bag.operations.convert import Job

SAMPLES = state_log(1.0)


@pytest.fixture
def cluster(tmp_path):
    """Return the address of a scheduler with two workers."""
    with DaskCluster(tmp_path) as cluster:
        yield cluster.address


def test_a_folder_is_converted_by_the_workers_of_a_cluster(tmp_path, cluster, capsys):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i in range(6):
        write(folder / ("%d.bag" % i), SAMPLES[:100 + i])
    shutil.copy(str(folder / "0.bag"), str(folder / "cut.bag"))
    with (folder / "cut.bag").open("r+b") as stream:
        stream.truncate(5000)
    assert main(["convert", str(folder), "-o", str(tmp_path / "out"), "--dask", cluster, "--json"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["failed"] == 1 and "cut.bag" in err
    for i in range(6):
        assert read(tmp_path / "out" / ("%d.mcap" % i)) == in_order(SAMPLES[:100 + i])
    assert len(os.listdir(str(tmp_path / "out"))) == 6


def test_a_cluster_that_is_not_there_is_named(monkeypatch):
    import distributed
    real = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, timeout, **options: real(address, timeout=1, **options))
    with pytest.raises(BagError, match="cannot reach the Dask scheduler tcp://127.0.0.1:1"):
        run_tasks(convert_task, [task_of(Job("a.bag", "a.mcap"))], Dask("tcp://127.0.0.1:1"), print)
