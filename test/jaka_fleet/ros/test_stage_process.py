"""The executable that is one stage of a replay, as a worker starts it."""
import json
import os
import signal
from pathlib import Path

import pytest
from import_graph import ROOT
from waiting import wait_until

from jaka_fleet.replay.stage_process import STAGE
from jaka_regression.processes import ChildProcess


@pytest.fixture
def withheld():
    """Give children of this thread a SIGINT that is blocked and ignored, as from workers of both kinds."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, handler)
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def children(number):
    words = Path("/proc/%d/task/%d/children" % (number, number)).read_text(encoding="ascii").split()
    return [int(word) for word in words]


def is_running(number):
    try:
        return "\nState:\tZ" not in Path("/proc/%d/status" % number).read_text(encoding="utf-8")
    except OSError:
        return False


def test_a_stage_ends_with_its_worker_also_where_that_withholds_interrupts(tmp_path, withheld):
    folder = tmp_path / "run"
    folder.mkdir()
    job = {"golden": str(ROOT / "test" / "data" / "golden" / "boot.mcap"), "folder": str(folder), "time_scale": 1.0,
           "tolerances": None, "driver": None}
    job_file = tmp_path / "job.json"
    job_file.write_text(json.dumps(job), encoding="utf-8")
    stage = ChildProcess("stage", [*STAGE, str(job_file)], tmp_path)
    try:
        wait_until(lambda: (folder / "driver0.log").exists() and len(children(stage.process.pid)) >= 4,
                   "master, simulated controller, recorder and driver have begun")
        processes = children(stage.process.pid)
        stage.process.stdin.close()
        assert stage.process.wait(30.0) == 1
        wait_until(lambda: not any(map(is_running, processes)), "its processes have ended")
        assert not os.path.exists(str(tmp_path / "result.json"))
    finally:
        stage.end()
