"""The engine over Dask against a pretended one: a scheduler that is lost at any moment, a large fleet, Ctrl-C."""
import types
from concurrent.futures import CancelledError

import pytest
from fleet_tasks import describe

from jaka_bag.engines import dask_engine
from jaka_bag.engines.dask_engine import Dask
from jaka_bag.engines.tasks import DONE, FAILED, LogResult, LogTask, run_tasks
from jaka_bag.errors import BagError

ADDRESS = "tcp://nowhere:1"


class KilledWorker(Exception):
    """The error of a task of which three workers died."""


class Future:
    """A task that has ended, or was lost with its scheduler."""

    def __init__(self, scheduler, key, work):
        self.key, self._scheduler, self._work, self.status = key, scheduler, work, "finished"

    def add_done_callback(self, call):
        self._scheduler.give(self, call)

    def cancelled(self):
        return self.status == "cancelled"

    def result(self, timeout):
        assert timeout > 0
        self._scheduler.fetched += 1
        problem = self._scheduler.problems.pop(self._scheduler.fetched, None)
        if problem is not None:
            problem(self)
        return self._work()


class Scheduler:
    """The series of schedulers that come one after the other.

    Attributes:
        problems: By the number of the result that is fetched, from 1: the problem that occurs then.
        lost: Keys of tasks that are lost as soon as they are there.
        batches: How many tasks came together.
    """

    def __init__(self):
        self.problems, self.batches, self.fetched, self.clients, self.cancelled = {}, [], 0, 0, []
        self.is_there, self.lost_clients = True, ()

    def give(self, future, call):
        if self.clients in self.lost_clients:
            future.status = "cancelled"
        call(future)

    def client(self, address, timeout, set_as_default):
        if not self.is_there:
            raise OSError("no scheduler")
        self.clients += 1
        return Client(self)


class Client:
    """A connection to the scheduler that is there now."""

    def __init__(self, scheduler):
        self._scheduler, self.status = scheduler, "running"

    def map(self, function, tasks, key, pure):
        assert self.status == "running" and len(key) == len(set(key)) == len(tasks) and not pure
        self._scheduler.batches.append(len(tasks))
        return [Future(self._scheduler, name, lambda task=task: function(task)) for name, task in zip(key, tasks)]

    def cancel(self, futures, force):
        self._scheduler.cancelled += futures

    def scheduler_info(self):
        return {"workers": {}}

    def close(self):
        self.status = "closed"


@pytest.fixture
def scheduler(monkeypatch):
    scheduler = Scheduler()
    monkeypatch.setattr(dask_engine.importlib, "import_module", lambda name: types.SimpleNamespace(
        Client=scheduler.client, CancelledError=CancelledError, TimeoutError=TimeoutError))
    monkeypatch.setattr(dask_engine, "_LOOK_S", 0.01)
    return scheduler


def results(count, on_result=lambda result: None, **options):
    """Return results by path; each task must have one."""
    found = []

    def take(result):
        found.append(result)
        on_result(result)

    run_tasks(describe, [LogTask("log_%04d" % i) for i in range(count)], Dask(ADDRESS, **options), take)
    assert len({result.path for result in found}) == len(found) == count
    return {result.path: result for result in found}


def raises(error):
    def problem(future):
        raise error
    return problem


@pytest.mark.parametrize("error", [CancelledError("lost"), ConnectionRefusedError("gone")])
def test_a_scheduler_that_is_lost_while_a_result_is_fetched_gives_the_task_to_the_next_one(scheduler, error):
    scheduler.problems[2] = raises(error)
    assert {result.status for result in results(4).values()} == {DONE} and scheduler.clients == 2


def test_tasks_that_are_lost_with_their_schedulers_go_to_the_next_one(scheduler):
    scheduler.lost_clients = (1, 2)
    assert len(results(40)) == 40 and scheduler.clients == 3


def test_schedulers_that_are_lost_again_and_again_are_an_error(scheduler):
    scheduler.lost_clients = range(100)
    with pytest.raises(BagError, match="lost 6 times"):
        results(3)


def test_a_scheduler_that_stays_away_is_an_error_and_what_was_done_stays(scheduler):
    scheduler.problems[3] = raises(OSError("gone"))
    done = []

    def goes(result):
        done.append(result)
        scheduler.is_there = False

    with pytest.raises(BagError, match="cannot reach the Dask scheduler"):
        results(4, goes, return_s=0.0)
    assert len(done) == 3  # what it had sent already counts


def test_a_connection_that_gave_up_while_a_result_was_taken_is_made_again(scheduler, monkeypatch):
    monkeypatch.setattr(dask_engine, "_IN_FLIGHT", 2)
    made = []
    real = scheduler.client
    monkeypatch.setattr(scheduler, "client", lambda *words, **options: made.append(real(*words, **options)) or made[-1])
    monkeypatch.setattr(dask_engine.importlib, "import_module", lambda name: types.SimpleNamespace(
        Client=scheduler.client, CancelledError=CancelledError, TimeoutError=TimeoutError))
    assert len(results(6, lambda result: made[0].close())) == 6 and len(made) == 2


def test_a_result_that_takes_long_to_come_is_waited_for(scheduler):
    scheduler.problems.update({number: raises(TimeoutError()) for number in (1, 2, 3)})
    assert {result.status for result in results(3).values()} == {DONE} and scheduler.clients == 1


def test_a_task_that_killed_three_workers_has_failed(scheduler):
    def killed(future):
        future.status = "error"
        raise KilledWorker("log-1 marked as failed")

    scheduler.problems[2] = killed
    statuses = [result.status for result in results(3).values()]
    assert sorted(statuses) == [DONE, DONE, FAILED]


def test_many_tasks_go_in_a_few_messages_and_never_all_at_once(scheduler):
    results(2500)
    assert max(scheduler.batches) == 32 and len(scheduler.batches) < 90
    waiting, most = [], []

    def count(future, call):
        waiting.append(call)
        most.append(len(waiting))
        call(future)

    scheduler.give = count
    results(2500, lambda result: waiting.pop())
    assert 900 < max(most) <= 1024


def test_ctrl_c_takes_back_what_waits(scheduler):
    def interrupted(result: LogResult):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        results(10, interrupted)
    assert len(scheduler.cancelled) == 9
