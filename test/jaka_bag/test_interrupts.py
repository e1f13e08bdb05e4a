"""A flag that a signal handler may set."""
import subprocess
import sys
import threading
import time

import pytest
from everywhere import hangs

from jaka_bag.interrupts import Flag


@pytest.mark.parametrize("act", [lambda flag: flag.set(), lambda flag: flag.wait(0.01), lambda flag: flag.is_set()],
                         ids=["set", "wait", "is_set"])
def test_a_flag_may_be_set_at_any_line_of_its_own(act):
    flags = []

    def begin():
        flag = Flag()
        assert not flag.is_set() and not flag.wait(0.0)
        flags.append(flag)
        return lambda: act(flag), flag.set

    assert hangs(begin) == []
    assert all(flag.is_set() and flag.wait(0.0) for flag in flags[:-1]) and len(flags) > 2


def test_a_flag_wakes_all_that_wait_and_stays():
    flag, woken = Flag(), []
    waiting = [threading.Thread(target=lambda: woken.append(flag.wait(10.0))) for _ in range(3)]
    for thread in waiting:
        thread.start()
    flag.set()
    begin = time.monotonic()
    for thread in waiting:
        thread.join()
    assert woken == [True] * 3 and time.monotonic() - begin < 5.0 and flag.wait(10.0)


def test_a_signal_ends_a_wait_at_once():
    code = ("import signal, threading, os, time\n"
            "from jaka_bag.interrupts import Flag\n"
            "flag = Flag()\n"
            "signal.signal(signal.SIGTERM, lambda number, frame: flag.set())\n"
            "threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()\n"
            "begin = time.monotonic()\n"
            "assert flag.wait(30.0) and time.monotonic() - begin < 10.0\n")
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
