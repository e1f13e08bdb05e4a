"""Tasks in processes of this computer: of those that are killed, and of those whose parent is."""
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from fleet_tasks import die_once, die_where_told
from import_graph import ROOT
from waiting import wait_until

from jaka_bag.engines.processes import Processes
from jaka_bag.engines.tasks import DONE, FAILED, LogTask, run_tasks

WAITS = """
import sys
sys.path[:0] = [%r, %r]
from fleet_tasks import wait_for_gate
from jaka_bag.engines.processes import Processes
from jaka_bag.engines.tasks import LogTask, run_tasks
from jaka_bag.interrupts import raise_at_first_signal
if __name__ == "__main__":
    raise_at_first_signal()
    try:
        tasks = [LogTask("log_%%d" %% number, sys.argv[2]) for number in range(9)]
        run_tasks(wait_for_gate, tasks, Processes(2, sys.argv[1]), print)
    except KeyboardInterrupt:
        sys.exit(130)
""" % (str(ROOT / "tools"), str(ROOT / "test" / "support" / "logs"))


@pytest.fixture(params=["fork", "spawn"])
def processes(request):
    return Processes(2, request.param)


def outcomes(engine, tasks, function):
    found = []
    run_tasks(function, iter(tasks), engine, found.append)
    assert sorted(result.path for result in found) == sorted(task.path for task in tasks), "each has one result"
    return {result.path: (result.status, result.reason) for result in found}


def test_the_task_of_a_process_that_was_killed_is_done_again(processes, tmp_path):
    found = outcomes(processes, [LogTask("log_%d" % i, str(tmp_path)) for i in range(6)], die_once)
    assert set(found.values()) == {(DONE, "")} and (tmp_path / "died").exists()
    assert len(list(tmp_path.glob("done *"))) == 6


def test_a_task_that_kills_its_process_each_time_takes_no_other_with_it(processes):
    found = outcomes(processes, [LogTask("log_%02d" % i, i in (3, 17)) for i in range(24)], die_where_told)
    failed = {path: reason for path, (status, reason) in found.items() if status == FAILED}
    assert failed == {name: name + ": its process was killed" for name in ("log_03", "log_17")}
    assert sum(status == DONE for status, _ in found.values()) == 22


def test_few_tasks_are_taken_before_their_turn():
    taken, ahead = [], []

    def tasks():
        for number in range(40):
            taken.append(number)
            yield LogTask("log_%d" % number)

    run_tasks(die_where_told, tasks(), Processes(2), lambda result: ahead.append(len(taken) - len(ahead)))
    assert len(ahead) == 40 and max(ahead) <= 2


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_processes_end_with_their_parent(method, number, tmp_path):
    script = tmp_path / "waits.py"  # which each of them reads
    script.write_text(WAITS)
    with subprocess.Popen([sys.executable, str(script), method, str(tmp_path)], start_new_session=True) as parent:
        began = [tmp_path / ("began log_%d" % number) for number in range(2)]
        wait_until(lambda: all(path.exists() and path.read_text() for path in began), "both are at work", 60)
        if number == signal.SIGINT:  # as a terminal sends it
            os.killpg(parent.pid, number)
        else:
            parent.send_signal(number)
    assert parent.returncode == (-number if number == signal.SIGKILL else 130)
    workers = [Path("/proc") / path.read_text() / "cmdline" for path in began]
    wait_until(lambda: not any(worker.exists() for worker in workers), "they have ended", 30)
    assert not (tmp_path / "began log_4").exists()


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_process_is_ended_though_a_signal_comes_as_it_is_started(method, number, tmp_path):
    script = tmp_path / "waits.py"
    script.write_text(WAITS.replace('if __name__ == "__main__":', """
if __name__ == "__main__":
    import os, threading, time
    from multiprocessing.process import BaseProcess
    start = BaseProcess.start

    def started(process):
        start(process)
        os.kill(os.getpid(), %d)
        time.sleep(0.1)
    BaseProcess.start = started
    threading.Thread(target=threading.Event().wait, daemon=True).start()  # that can take the signal, too
""" % number))
    done = subprocess.run([sys.executable, str(script), method, str(tmp_path)], timeout=60, stderr=subprocess.PIPE)
    assert done.returncode == 130 and b"Traceback" not in done.stderr
