"""The guard's reading of its driver's messages, and its answers."""
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from jaka_ros_driver.client import driver_pipe
from jaka_ros_driver.client.driver_pipe import (
    ANSWER_PERIOD_S,
    FAREWELL,
    IDLE,
    MOVING,
    SILENCE_TIMEOUT_S,
    STARVED_TIMEOUT_S,
    STOPPING,
    WATCHING,
    DriverPipe,
)
from jaka_ros_driver.client.stopping import DriverCondition


class Ends:
    """A guard's pipe, and the driver's ends of it."""

    def __init__(self, is_moving=False):
        its_words, self.words = os.pipe()
        self.answers, its_answers = os.pipe()
        self._open = {its_words, self.words, self.answers, its_answers}
        self.pipe = DriverPipe(its_words, its_answers, os.getpid(), is_moving)
        os.set_blocking(self.answers, False)

    def say(self, words):
        os.write(self.words, words)

    def answered(self):
        try:
            return os.read(self.answers, 100)
        except BlockingIOError:
            return b""

    def close(self, *ends):
        for end in set(ends or self._open) & self._open:
            os.close(end)
            self._open.discard(end)


@pytest.fixture
def ends():
    made = []

    def make(**options):
        made.append(Ends(**options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def starved(monkeypatch):
    """Simulate a driver that could run, and gets no time."""
    monkeypatch.setattr(driver_pipe, "waits_for_processor", lambda process: process == os.getpid())


@pytest.fixture
def idle_host(monkeypatch):
    """Simulate an idle host: the test itself is the driver here, and may be running."""
    monkeypatch.setattr(driver_pipe, "waits_for_processor", lambda process: False)


def silence_of(pipe):
    began = pipe._received_at  # not from now: this thread may be held up before it waits, and behind a timer
    pipe.wait_for_silence()
    return time.monotonic() - began


def test_a_driver_in_motion_is_silent_after_a_quarter_of_a_second(ends, idle_host):
    one = ends(is_moving=True)
    assert SILENCE_TIMEOUT_S - 0.01 < silence_of(one.pipe) < STARVED_TIMEOUT_S - 0.1
    assert one.pipe.driver() is DriverCondition.SILENT


def test_a_driver_that_gets_no_time_is_waited_for(ends, starved):
    assert silence_of(ends(is_moving=True).pipe) > STARVED_TIMEOUT_S - 0.01


def test_a_driver_that_freezes_while_it_waits_for_its_turn_is_noticed_soon(ends, monkeypatch):
    froze_at = time.monotonic() + 2 * SILENCE_TIMEOUT_S
    monkeypatch.setattr(driver_pipe, "waits_for_processor", lambda process: time.monotonic() < froze_at)
    assert 2 * SILENCE_TIMEOUT_S - 0.01 < silence_of(ends(is_moving=True).pipe) < STARVED_TIMEOUT_S - 0.1


def test_a_guard_that_was_held_up_itself_gives_the_driver_another_quarter_of_a_second(ends, idle_host, monkeypatch):
    # As when the whole computer was suspended: the driver could not send anything either.
    one, wait = ends(is_moving=True), DriverPipe.wait

    def wait_too_long(pipe, timeout):
        monkeypatch.setattr(DriverPipe, "wait", wait)
        time.sleep(1.0)  # so long the guard is held up
        return wait(pipe, 0.0)

    monkeypatch.setattr(DriverPipe, "wait", wait_too_long)
    assert 1.0 + SILENCE_TIMEOUT_S - 0.01 < silence_of(one.pipe)


def test_an_idle_driver_may_be_silent_until_it_leaves(ends, idle_host):
    one = ends()
    threading.Timer(3 * SILENCE_TIMEOUT_S, one.say, [FAREWELL]).start()
    assert silence_of(one.pipe) > 2.9 * SILENCE_TIMEOUT_S
    assert one.pipe.has_left and one.pipe.is_over and one.pipe.driver() is DriverCondition.BACK


@pytest.mark.parametrize("words, is_moving", [(MOVING, True), (IDLE, False), (MOVING + IDLE, False),
                                              (IDLE + MOVING + MOVING, True)])
def test_the_last_word_counts(ends, words, is_moving):
    one = ends()
    one.say(words)
    assert one.pipe.wait(0.0) and one.pipe.is_moving is is_moving
    assert one.pipe.driver() is DriverCondition.BACK


def test_a_closed_pipe_leaves_the_last_word_standing(ends):
    one = ends()
    one.say(MOVING)
    one.pipe.read()
    one.close(one.words)
    one.pipe.wait_for_silence()
    assert one.pipe.is_closed and one.pipe.is_moving and one.pipe.driver() is DriverCondition.DEAD


def test_words_are_answered_ten_times_a_second_at_most(ends):
    one, answers, began = ends(), b"", time.monotonic()
    while len(answers) < 5 and time.monotonic() < began + 20.0:
        one.say(IDLE)
        one.pipe.read()
        answers += one.answered()
        time.sleep(0.005)  # words come far more often than answers
    assert answers == WATCHING * 5 and time.monotonic() - began > 4 * ANSWER_PERIOD_S - 0.01


def test_what_the_guard_does_is_told_unasked(ends):
    one = ends()
    one.pipe.answer(STOPPING)
    assert one.answered() == STOPPING


def test_answers_that_nobody_takes_hold_nothing_up(ends):
    one = ends()
    for _ in range(70000):
        one.pipe.answer(STOPPING)
    one.close(one.answers)
    one.pipe.answer(WATCHING)


# ---- a driver that shuts its guard out ----

@pytest.fixture
def frozen(ends, monkeypatch):
    """Start a process that plays the frozen driver, as the guard's parent; return its pipe's ends."""
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    one = ends()
    one.pipe.driver_process = process.pid
    monkeypatch.setattr(os, "getppid", lambda: process.pid)
    yield one, process
    process.kill()
    process.wait()
    process.stdin.close()


def test_a_frozen_driver_is_killed(frozen):
    (one, process), said = frozen, []
    one.pipe.end_driver(said.append)
    assert process.wait(20.0) == -signal.SIGKILL and "killing the driver, process %d" % process.pid in said[0]


def test_a_driver_that_has_just_spoken_is_not_killed(frozen):
    (one, process), said = frozen, []
    one.say(MOVING)
    one.pipe.end_driver(said.append)
    assert not said and one.pipe.driver() is DriverCondition.BACK
    process.stdin.close()
    assert process.wait(20.0) != -signal.SIGKILL


def test_a_process_that_is_not_the_parent_is_not_killed(frozen, monkeypatch):
    (one, process), said = frozen, []
    monkeypatch.setattr(os, "getppid", lambda: 1)
    one.pipe.end_driver(said.append)
    assert "process %d is not the driver any more" % process.pid in said[0]
    process.stdin.close()
    assert process.wait(20.0) != -signal.SIGKILL


def test_a_driver_that_has_gone_by_itself_is_told(frozen):
    (one, process), said = frozen, []
    process.kill()
    process.wait()
    one.pipe.end_driver(said.append)
    assert "the driver cannot be killed" in said[-1]
