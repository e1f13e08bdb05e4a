"""The start of the commands that serve a controller's ports: priority, signals, the first line of output."""
import argparse
import json
import os
import signal
import sys
from typing import Any, Callable, Mapping, Optional

from jaka_ros_driver.scheduling import ask_for_short_slices, set_real_time

_SWITCH_INTERVAL_S = 0.0005
"""The longest time, s, that a Python thread keeps the others waiting: the default, 5 ms, is most of a cycle of 8 ms."""
_PRIORITY = 10
"""Real-time priority, 1 to 99: above all normal processes, below the kernel's own threads (50)."""
_NICENESS = -10
"""Niceness, -20 to 19: before all that runs at 0; real time is asked for by an option."""
_HIGHEST_PORT = 65535


def raise_priority(realtime: bool) -> None:
    """Raise the priority of this process, so that it keeps the controller's times on a busy host.

    realtime: real-time priority (SCHED_FIFO) instead of a niceness of -10; only then a refusal is printed.
    """
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    ask_for_short_slices()
    try:
        if realtime:
            set_real_time(_PRIORITY)
        else:
            os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    except OSError as error:
        if realtime:
            print("jaka_sim: warning: no real-time priority: %s" % error, file=sys.stderr)


def port_number(lowest: int) -> Callable[[str], int]:
    """Return the type of an option that takes a TCP port; ``lowest`` is 0 where a free one may be asked for."""
    def number(text: str) -> int:
        value = int(text)
        if not lowest <= value <= _HIGHEST_PORT:
            raise argparse.ArgumentTypeError("must be from %d to %d" % (lowest, _HIGHEST_PORT))
        return value
    return number


def stop_on_signals(stop: Callable[[], None]) -> None:
    """Call ``stop``, in the main thread, on SIGINT and SIGTERM."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop())


def print_ports(numbers: Mapping[str, Optional[int]], **facts: Any) -> None:
    """Print the command's first line, JSON: the facts, then ``NAME_port`` for each port."""
    print(json.dumps({**facts, **{"%s_port" % port: number for port, number in numbers.items()}}), flush=True)
