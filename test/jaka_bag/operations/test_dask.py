"""Files handed to a Dask cluster: a real scheduler and two real workers."""
import json
import os
import shutil
import subprocess
import sys

import pytest
from log_samples import in_order, read, state_log, write

from jaka_bag.cli.main import main
from jaka_bag.errors import BagError
from jaka_bag.operations.convert import Job
from jaka_bag.operations.many import convert_on_dask

SAMPLES = state_log(1.0)
DEADLINE_S = 120


@pytest.fixture
def cluster(tmp_path, root):
    """Address of a scheduler with two workers on free ports."""
    environment = dict(os.environ, PYTHONPATH=str(root / "tools"), DASK_DISTRIBUTED__WORKER__DAEMON="False")
    address_file = tmp_path / "scheduler.json"

    def start(*words):
        return subprocess.Popen([sys.executable, "-m", "distributed.cli." + words[0], *words[1:]], env=environment,
                                cwd=str(tmp_path), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file",
                       str(address_file))]
    processes += [start("dask_worker", "--scheduler-file", str(address_file), "--host", "127.0.0.1", "--nthreads", "1",
                        "--no-dashboard", "--no-nanny", "--death-timeout", str(DEADLINE_S)) for _ in range(2)]
    try:
        from distributed import Client
        with Client(scheduler_file=str(address_file), timeout=DEADLINE_S) as client:
            client.wait_for_workers(2, timeout=DEADLINE_S)
            address = client.scheduler.address
        yield address
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait(DEADLINE_S)


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
        convert_on_dask([Job("a.bag", "a.mcap")], "tcp://127.0.0.1:1", print)
