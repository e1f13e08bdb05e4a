"""The scheduling that is asked of the operating system, and what it grants."""
import os
import platform
import re
import subprocess
import sys

import pytest

ASK = """
import os, threading
from jaka_ros_driver.scheduling import ask_for_short_slices
print(ask_for_short_slices())
def show():
    for line in open("/proc/thread-self/sched"):
        if line.startswith("se.slice"):
            print(line.split()[-1], os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0))
thread = threading.Thread(target=show)
thread.start()
thread.join()
os.execvp("sh", ["sh", "-c", "grep se.slice /proc/self/sched"])
"""


def kernel():
    return tuple(map(int, re.findall(r"\d+", platform.release())[:2]))


@pytest.mark.skipif(platform.system() != "Linux" or kernel() < (6, 12) or not os.path.exists("/proc/self/sched"),
                    reason="slices of one's own came with Linux 6.12")
def test_threads_and_programs_started_later_have_short_slices_and_everything_else_as_before():
    said = subprocess.run([sys.executable, "-u", "-c", ASK], stdout=subprocess.PIPE, text=True, check=True).stdout
    lines, niceness = said.split("\n"), os.getpriority(os.PRIO_PROCESS, 0)
    assert lines[:2] == ["True", "100000 %d %d" % (niceness, os.SCHED_OTHER)] and lines[2].split()[-1] == "100000", said
