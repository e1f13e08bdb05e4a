"""Work for engines: functions that workers import by name; each task's settings choose what it does."""
import os
import signal
import time
from pathlib import Path

from jaka_bag.engines.tasks import LogResult, LogTask
from jaka_bag.errors import BagError
from jaka_fleet.dataset.adding import add_log


def describe(task: LogTask) -> LogResult:
    """Fail as the settings demand, else describe the task."""
    if task.settings == "foreseen":
        raise BagError("%s: it is\nbroken" % task.path)
    if task.settings == "system":
        raise FileNotFoundError(2, "No such file or directory", task.path)
    if task.settings == "bug":
        raise ZeroDivisionError("a bug")
    return LogResult(task.path, size=len(task.path), messages=1, value={"settings": task.settings})


def die_once(task: LogTask) -> LogResult:
    """Kill this process if no marker is found, after making it; else leave a file in the folder."""
    folder = Path(task.settings)
    try:
        os.close(os.open(str(folder / "died"), os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        (folder / ("done %s" % task.path)).touch()
        return LogResult(task.path)
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("alive")


def die_where_told(task: LogTask) -> LogResult:
    """Kill this process where the settings demand it."""
    if task.settings:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.01)
    return LogResult(task.path)


def wait_for_gate(task: LogTask) -> LogResult:
    """Leave a file with this process's id at the begin, and wait until the gate stands in the folder."""
    folder = Path(task.settings)
    (folder / ("began %s" % task.path)).write_text(str(os.getpid()))
    end = time.monotonic() + 100.0
    while not (folder / "gate").exists():
        if time.monotonic() > end:
            raise AssertionError("the gate never came")
        time.sleep(0.01)
    return LogResult(task.path)


def measured_add(task: LogTask) -> LogResult:
    """Add a log; ``value`` is the worker's process id, its resident set, byte, and the CPU time that it took, s."""
    begin = time.process_time()
    result = add_log(task)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return result._replace(value=(os.getpid(), pages * os.sysconf("SC_PAGE_SIZE"), time.process_time() - begin))
