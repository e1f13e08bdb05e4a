import os
import signal
import subprocess
import sys
import time

import pytest
from import_graph import ROOT

from jaka_regression.host_watch import HostWatch, Pause

WATCHING = """
import sys, time
from jaka_regression.host_watch import HostWatch
with HostWatch() as host:
    began = time.time_ns()
    while not any(pause.lasted_s > 0.4 for pause in host.pauses):
        print("watching", flush=True)
        time.sleep(0.1)
    print("seen", flush=True)
    sys.stdin.readline()
print(max(pause.lasted_s for pause in host.pauses))
print(host.words(began))
print(repr(host.words(time.time_ns())))
"""


def test_a_process_that_was_not_let_run_is_told():
    process = subprocess.Popen([sys.executable, "-c", WATCHING], cwd=str(ROOT), stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, universal_newlines=True)
    try:
        for line in iter(process.stdout.readline, "seen\n"):  # again where it had not begun to watch
            assert line == "watching\n"
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(0.5)  # so long it is not let run
            os.kill(process.pid, signal.SIGCONT)
        lasted, words, later = process.communicate("\n", timeout=30)[0].splitlines()
    finally:
        process.kill()
        process.wait()
    assert 0.4 < float(lasted)
    assert words.startswith("this computer let processes wait for up to ") and "replay again" in words
    assert later == "''", "a pause before the log began is none of its differences"


def test_the_longest_pause_of_the_log_is_told_in_the_logs_own_time():
    host = HostWatch()
    host.pauses = [Pause(1_000_000_000, 9.0), Pause(3_000_000_000, 0.2), Pause(4_000_000_000, 0.7)]
    assert "up to 0.70 s, at 2.0 s of the candidate" in host.words(2_000_000_000)
    assert "at 20.0 s of the candidate" in host.words(2_000_000_000, time_scale=10.0)
    assert host.words(4_000_000_000) == ""


def test_nothing_is_told_where_nothing_waited():
    with HostWatch() as host:
        pass
    assert host.words(0) == ""


def test_it_ends_with_its_block():
    with pytest.raises(ZeroDivisionError), HostWatch() as host:
        raise ZeroDivisionError
    assert host._threads and not any(thread.is_alive() for thread in host._threads)
