"""Calls made again by threads, against a stand-in that answers when the test wants it."""
import threading
import time

import pytest
from waiting import eventually

from jaka_bag.compare.runs.run import Call
from jaka_regression.command_player import CommandPlayer, ReplayStopped, ServiceReply
from jaka_regression.command_schedule import plan


def call(start, duration, service, success=True):
    return Call("", start, duration, "/jaka_driver/" + service, "jaka_msgs/Move", "0" * 32, b"", b"", success, "", "",
                "")


class Driver:
    """A server of calls; ``move`` ends when ``stop_move`` comes, ``late`` while ``move`` is running."""

    def __init__(self, refuse=()):
        self.log = []
        self.refuse = refuse
        self.moving, self.stopped = threading.Event(), threading.Event()

    def perform(self, one):
        name = one.short_name
        self.log.append((name, "begin"))
        if name == "late":
            assert self.moving.wait(20)
        if name == "move":
            self.moving.set()
            assert self.stopped.wait(20)
        if name == "stop_move":
            self.stopped.set()
        self.log.append((name, "end"))
        return ServiceReply(name not in self.refuse, "no")


def ignore(entry, at, reply):
    """Do nothing with a call."""


def test_calls_that_overlapped_overlap_again():
    driver = Driver()
    CommandPlayer(plan([call(0.0, 1.0, "move"), call(0.05, 0.01, "stop_move"), call(1.1, 0.1, "last")]),
                  driver.perform, ignore).run()
    assert driver.log[:2] == [("move", "begin"), ("stop_move", "begin")]
    assert driver.log[-2:] == [("last", "begin"), ("last", "end")]


def test_the_first_refusal_that_the_log_does_not_have_ends_the_replay():
    driver = Driver(refuse=("a", "b"))
    calls = [call(0.0, 0.01, "a", success=False), call(0.02, 0.01, "b"), call(0.04, 0.01, "c")]
    with pytest.raises(ReplayStopped, match=r"b\(\) was refused, unlike in the log: no"):
        CommandPlayer(plan(calls), driver.perform, ignore).run()
    assert ("c", "begin") not in driver.log


def test_a_refusal_of_an_overlapped_call_ends_the_replay_too():
    driver = Driver(refuse=("move",))
    calls = [call(0.0, 1.0, "move"), call(0.01, 0.01, "stop_move"), call(30.0, 0.01, "never")]
    with pytest.raises(ReplayStopped, match=r"move\(\) was refused"):
        CommandPlayer(plan(calls), driver.perform, ignore).run()


def test_it_can_be_interrupted_while_it_waits():
    cancelled = threading.Event()
    player = CommandPlayer(plan([call(3600.0, 0.01, "late")]), Driver().perform, ignore, cancelled=cancelled)
    threading.Timer(0.05, cancelled.set).start()
    with pytest.raises(ReplayStopped, match="interrupted"):
        player.run()


@pytest.mark.parametrize("why", ["interrupted", r"late\(\) was refused"])
def test_it_ends_at_once_while_a_call_is_not_answered_and_makes_no_other(why):
    driver, cancelled = Driver(refuse=("late",)), threading.Event()
    calls = [call(0.0, 1.0, "late"), call(0.05, 2.0, "move"), call(2.1, 0.1, "next")]
    if why == "interrupted":
        calls.pop(0)
        threading.Timer(0.2, cancelled.set).start()
    with pytest.raises(ReplayStopped, match=why):
        CommandPlayer(plan(calls), driver.perform, ignore, cancelled=cancelled).run()
    assert ("move", "begin") in driver.log and ("move", "end") not in driver.log
    driver.stopped.set()
    assert eventually(lambda: ("move", "end") in driver.log) and ("next", "begin") not in driver.log


def test_every_start_and_end_is_told():
    told = []
    CommandPlayer(plan([call(0.0, 0.01, "a"), call(0.05, 0.01, "b")]), Driver().perform,
                  lambda entry, at, reply: told.append((entry.number, None if reply is None else reply.success))).run()
    assert told == [(0, None), (0, True), (1, None), (1, True)]


def test_a_plan_that_begins_later_waits():
    begin = time.monotonic() + 0.2
    times = []
    CommandPlayer(plan([call(0.0, 0.01, "a")]), Driver().perform, lambda entry, at, reply: times.append(at)).run(begin)
    assert times[0] >= begin
