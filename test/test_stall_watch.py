"""The watch that keeps a host's stalls out of the times that tests compare."""
import signal
import subprocess
import sys
import time
from pathlib import Path

MEASURING = """
import sys, time
sys.path.insert(0, sys.argv[1])
from waiting import StallWatch
with StallWatch() as host:
    began = time.monotonic()
    print(flush=True)
    while time.monotonic() - began < float(sys.argv[2]):
        time.sleep(0.01)
    print(time.monotonic() - began, host.between(began))
"""


def measured(seconds, signals):
    """Return what passed and what the watch counted, s, of a process that is sent the signals while it measures."""
    with subprocess.Popen([sys.executable, "-c", MEASURING, str(Path(__file__).parent / "support" / "live"),
                           str(seconds)], stdout=subprocess.PIPE, text=True) as program:
        program.stdout.readline()
        for number in signals:
            program.send_signal(number)
            time.sleep(0.8)
        passed, counted = map(float, program.stdout.readline().split())
    return passed, counted


def test_a_stall_is_not_counted():
    passed, counted = measured(0.1, [signal.SIGSTOP, signal.SIGCONT])
    assert passed > 0.8 and 0.0 <= counted < passed - 0.6


def test_what_the_product_takes_is_counted():
    passed, counted = measured(2.0, [])
    assert passed > 2.0 and counted > 0.5, "loose: the host may stall here, too"
