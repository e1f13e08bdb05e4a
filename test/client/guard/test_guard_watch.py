"""Driver and guard watch each other: a guard that dies or hangs is replaced, and never holds the driver's loop up."""
import os
import signal
import subprocess
import threading
import time

import pytest
from arm_bench import processes_with
from waiting import WAIT, eventually

from jaka_ros_driver.client import guard_post
from jaka_ros_driver.client.guard import BEAT_PERIOD_S, Guard
from jaka_ros_driver.client.guard_post import ANSWER_TIMEOUT_S, GuardPost

COMMAND_PORT, STATUS_PORT = 9, 10
"""Nobody listens there; a guard whose driver moves nothing never connects."""


@pytest.fixture
def guard():
    made = Guard("127.0.0.1", COMMAND_PORT, STATUS_PORT)
    yield made
    made.notify(False)
    made.close()
    assert eventually(lambda: not guards())


class Beats:
    """The driver's loop on a clock of its own; the guard process takes real time meanwhile."""

    def __init__(self, guard):
        self._guard = guard
        self.now = time.monotonic()

    def go_on(self, duration):
        for _ in range(round(duration / BEAT_PERIOD_S)):
            self.now += 1.001 * BEAT_PERIOD_S
            self._guard.beat(self.now)

    def until(self, condition):
        """Send beats as time goes by until the condition holds."""
        deadline = time.monotonic() + WAIT
        while not condition() and time.monotonic() < deadline:
            self.go_on(BEAT_PERIOD_S)
            time.sleep(BEAT_PERIOD_S)  # the driver's rhythm
        assert condition()


def guards():
    return processes_with("jaka_ros_driver.client.guard", "--port\0%d\0" % COMMAND_PORT, "--driver\0%d\0" % os.getpid())


def freeze(pid):
    """Stop a process, and wait until each of its threads has stopped."""
    os.kill(pid, signal.SIGSTOP)
    assert eventually(lambda: all(state_of(pid, thread) == "T" for thread in os.listdir("/proc/%d/task" % pid)))


def state_of(pid, thread):
    with open("/proc/%d/task/%s/stat" % (pid, thread)) as file:
        return file.read().rpartition(")")[2].split()[0]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_guard_that_dies_or_freezes_in_motion_is_replaced_and_its_successor_stops_the_arm(driver, how):
    one, process = driver("jog")
    pid = process.watched()
    os.kill(pid, how)
    struck_at = time.monotonic()
    assert eventually(lambda: pid not in process.guards() and process.guards())
    assert time.monotonic() - struck_at < ANSWER_TIMEOUT_S + 10.0
    assert process.watched() != pid
    health = process.health()
    assert health["replacements"] == 1
    assert ("has ended" if how == signal.SIGKILL else "does not answer") in health["last_trouble"]
    assert one.is_moving(), "a healthy driver's motion is none of the successor's business"
    process.send(signal.SIGSTOP)
    assert eventually(lambda: not one.is_moving())
    assert "ERROR" in process.kill()


def test_a_driver_that_dies_before_its_next_word_has_told_the_successor_already(guard):
    # The notifications wait in the pipe for a process that is only being started.
    guard.notify(True)
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    first, = guards()
    os.kill(first, signal.SIGKILL)
    beats.until(lambda: guard.health().replacements == 1)
    successor = eventually(lambda: set(guards()) - {first}).pop()
    with open("/proc/%d/cmdline" % successor) as file:
        assert "--moving" in file.read()


def test_a_driver_that_was_held_up_does_not_blame_its_guard(guard):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    pid, = guards()
    freeze(pid)
    beats.go_on(0.1)
    beats.now += 30.0  # the driver itself was frozen
    beats.go_on(0.8 * ANSWER_TIMEOUT_S)
    assert guard.health().replacements == 0
    beats.go_on(0.4 * ANSWER_TIMEOUT_S)
    assert guard.health().replacements == 1
    assert eventually(lambda: pid not in guards())


def test_a_guard_that_got_no_processor_time_is_waited_for(guard, monkeypatch):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    pid, = guards()
    freeze(pid)
    monkeypatch.setattr(guard_post, "waits_for_processor", lambda process: process == pid)
    beats.go_on(4.0)
    assert guard.health().replacements == 0
    beats.go_on(2.0)
    assert guard.health().replacements == 1


def test_the_loop_and_the_services_never_wait_while_a_guard_is_replaced(guard, monkeypatch):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    release, real = threading.Event(), GuardPost.launch

    def launch_slowly(post, command):
        release.wait(WAIT)
        real(post, command)

    monkeypatch.setattr(GuardPost, "launch", launch_slowly)
    os.kill(guards()[0], signal.SIGKILL)
    beats.until(lambda: guard.health().replacements == 1)
    began = time.monotonic()
    beats.go_on(1.0)
    for number in range(100):
        guard.notify(number % 2 == 0)
    assert time.monotonic() - began < WAIT / 2
    assert not guard.health().is_alive
    release.set()
    beats.until(lambda: guard.health().is_alive)
    assert guard.health().replacements == 1


def test_a_guard_that_cannot_be_started_is_told_and_tried_again(guard, monkeypatch):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    real = subprocess.Popen

    def fail(*_args, **_options):
        raise OSError("no more processes")

    monkeypatch.setattr(subprocess, "Popen", fail)
    os.kill(guards()[0], signal.SIGKILL)
    beats.until(lambda: guard.health().replacements == 3)
    assert not guard.health().is_alive and guard.health().last_trouble
    guard.notify(True)
    monkeypatch.setattr(subprocess, "Popen", real)
    beats.until(lambda: guard.health().is_alive)
    assert len(guards()) == 1


@pytest.mark.parametrize("where, failing, error", [
    (os, "pipe", OSError("too many open files")), (threading, "Thread", RuntimeError("can't start new thread"))])
def test_nothing_that_the_system_refuses_reaches_the_loop(guard, monkeypatch, where, failing, error):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)

    def fail(*_args, **_options):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(where, failing, fail)
        os.kill(guards()[0], signal.SIGKILL)
        beats.until(lambda: "cannot be started" in guard.health().last_trouble)
    beats.go_on(10.0)
    beats.until(lambda: guard.health().is_alive)


def test_beats_that_come_early_cost_nothing(guard):
    said = []
    guard._post.send = said.append
    now = time.monotonic() + 1.0
    for step in range(100):
        guard.beat(now + step * 0.001)
    assert len(said) == 5


def test_a_driver_whose_threads_tell_and_beat_at_once_keeps_its_guard(guard):
    beats = Beats(guard)
    beats.until(lambda: guard.health().is_alive)
    threads = [threading.Thread(target=lambda: [guard.notify(number % 2 == 0) for number in range(2000)])
               for _ in range(4)]
    for thread in threads:
        thread.start()
    beats.until(lambda: not any(thread.is_alive() for thread in threads))
    beats.until(lambda: guard.health().is_alive)
    assert guard.health().replacements == 0


def test_closing_twice_and_words_afterwards_do_no_harm(guard):
    guard.close()
    guard.close()
    guard.notify(False)
    guard.beat(time.monotonic() + 1.0)
    assert not guards()
