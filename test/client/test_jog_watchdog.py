"""A jog that nobody keeps going ends on time."""
import threading
import time

import pytest

from jaka_ros_driver.client.jog_watchdog import JogWatchdog
from jaka_ros_driver.commands import Jog, JogFrame

JOG = Jog(JogFrame.JOINT, 0, 0.1)


@pytest.fixture
def watched():
    expired = threading.Event()
    watchdog = JogWatchdog(0.3, lambda jog: expired.set())
    yield watchdog, expired
    watchdog.close()


def test_expires_after_its_time_and_not_before(watched):
    watchdog, expired = watched
    begun = time.monotonic()
    watchdog.begin(JOG)
    assert expired.wait(10.0)
    assert time.monotonic() - begun >= 0.3
    assert watchdog.end() is None


def test_the_same_jog_keeps_it_going_another_does_not(watched):
    watchdog, expired = watched
    watchdog.begin(JOG)
    begun = time.monotonic()
    while time.monotonic() - begun < 0.7 and not expired.is_set():
        kept = watchdog.keep_going(JOG)
        time.sleep(0.01)
    last = time.monotonic()
    if kept:
        assert expired.wait(10.0)
        assert time.monotonic() - last >= 0.25
    assert not watchdog.keep_going(JOG)
    watchdog.begin(JOG)
    assert not watchdog.keep_going(Jog(JogFrame.JOINT, 0, -0.1))


def test_an_ended_jog_does_not_expire(watched):
    watchdog, expired = watched
    watchdog.begin(JOG)
    assert watchdog.end() == JOG
    assert not expired.wait(0.6)
