"""One task a log: failures that stop nothing, packages that are missing, files left behind."""
import functools
import sys

import pytest
from fleet_tasks import describe

from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.tasks import DONE, FAILED, BoundFunction, LogResult, LogTask, Serial, Tally, run_tasks
from jaka_bag.errors import MissingDependency

TASKS = [LogTask("log_%d" % number, settings)
         for number, settings in enumerate([1, "foreseen", None, "system", "bug", (2, 3)])]


def results(engine, tasks=TASKS, function=describe):
    found = []
    run_tasks(function, iter(tasks), engine, found.append)
    return sorted(result._replace(seconds=0.0) for result in found)


def test_a_result_tells_what_became_of_a_task():
    ours = results(Serial())
    assert [result.status for result in ours] == [DONE, FAILED, DONE, FAILED, FAILED, DONE]
    assert ours[1].reason == "log_1: it is broken" and ours[3].reason == "log_3: No such file or directory"
    assert ours[4].reason.startswith("ZeroDivisionError: a bug (") and "fleet_tasks.py:" in ours[4].reason
    assert ours[5].value == {"settings": (2, 3)}


def test_a_worker_of_another_version_is_refused():
    result = BoundFunction(describe, "0.0.1")(LogTask("log"))
    assert result.status == FAILED and "0.0.1" in result.reason


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingDependency, match="--dask needs the Python package distributed"):
        results(Dask("tcp://127.0.0.1:1"))


def test_a_tally_counts_what_is_left():
    tally = functools.reduce(lambda tally, result: tally.add(result) or tally, [
        LogResult("a", size=5, messages=2), LogResult("b", FAILED, "why")], Tally(4))
    assert tally.left == 2 and tally.failed == [LogResult("b", FAILED, "why")]
    assert (tally.size, tally.messages) == (5, 2)
