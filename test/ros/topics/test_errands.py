"""The thread for what waits for nothing: order, intervals, and a defect that ends no other task. No ROS master."""
import threading
import time

import pytest
from waiting import WAIT, eventually, repeating

from jaka_ros_driver.ros.errands import Errands


@pytest.fixture
def errands():
    return Errands()


def test_what_is_handed_over_is_done_in_order_in_one_thread_and_nobody_waits(errands):
    done, may_go_on = [], threading.Event()
    errands.soon(lambda: may_go_on.wait(WAIT))
    began = time.monotonic()
    for number in range(1000):
        errands.soon(lambda number=number: done.append((number, threading.get_ident())))
    assert not done and not errands.drain(0.01) and time.monotonic() - began < WAIT / 2
    assert errands.waiting >= 1000
    may_go_on.set()
    assert errands.drain(WAIT)
    assert [number for number, _ in done] == list(range(1000))
    assert {ident for _, ident in done} - {threading.get_ident()} and len({ident for _, ident in done}) == 1


def test_one_thread_is_started_however_many_begin(errands):
    before = threading.active_count()
    threads = [threading.Thread(target=errands.soon, args=(lambda: None,)) for _ in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT)
    assert errands.drain(WAIT) and threading.active_count() == before + 1


def test_tasks_are_done_at_their_intervals_also_beside_a_flood(errands):
    often, seldom = [], []
    errands.every(0.02, lambda: often.append(time.monotonic()))
    errands.every(0.1, lambda: seldom.append(time.monotonic()))

    with repeating(lambda: errands.soon(lambda: None), 0.0005):
        assert eventually(lambda: len(seldom) >= 5)
    in_between = [at for at in often if seldom[0] <= at <= seldom[4]]
    assert 10 <= len(in_between) <= 1 + (seldom[4] - seldom[0]) / 0.02, "neither forgotten nor made up for"
    assert seldom[4] - seldom[0] >= 0.3


def test_a_task_that_was_late_does_not_make_up_for_it(errands):
    told = []
    errands.every(0.01, lambda: told.append(time.monotonic()))
    errands.soon(lambda: time.sleep(0.3))
    assert eventually(lambda: told)
    errands.drain(WAIT)
    assert len(told) < 10


def test_a_task_that_is_ended_is_not_under_way_and_not_done_again(errands):
    begun, ended = threading.Event(), []

    def slow():
        begun.set()
        time.sleep(0.1)
        ended.append(True)

    end = errands.every(0.01, slow)
    assert begun.wait(WAIT)
    end()
    count = len(ended)
    assert count >= 1
    time.sleep(0.1)
    assert len(ended) == count
    end()


def test_a_defect_is_told_once_and_ends_no_other_task(errands, caplog):
    told = []

    def defect():
        raise ValueError("a defect")

    end = errands.every(0.01, defect)
    errands.every(0.01, lambda: told.append(True))
    errands.soon(defect)
    assert eventually(lambda: len(told) >= 5)
    assert sum("a defect" in record.getMessage() for record in caplog.records) == 2
    end()
    assert errands.drain(WAIT)
