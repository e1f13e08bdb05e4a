"""Fixtures: a simulated controller for each test, and a check that no test leaves threads or sockets behind."""
import os
import threading

import pytest
from raw_client import RawClient, RawFeed

from jaka_ros_driver.simulation.simulated_controller import SimulatedController


@pytest.fixture(autouse=True)
def nothing_left_behind():
    threads, descriptors = set(threading.enumerate()), set(os.listdir("/proc/self/fd"))
    yield
    left = [thread.name for thread in threading.enumerate() if thread not in threads and thread.is_alive()]
    assert not left, "threads left behind: %s" % left
    left = [target for target in map(_target, set(os.listdir("/proc/self/fd")) - descriptors) if "socket:" in target]
    assert not left, "sockets left behind: %s" % left


def _target(descriptor: str) -> str:
    try:
        return os.readlink("/proc/self/fd/" + descriptor)
    except OSError:
        return ""


@pytest.fixture
def make_arm():
    """Start simulated controllers; they end with the test."""
    arms = []

    def make(**settings):
        arm = SimulatedController(**dict({"start": "enabled", "time_scale": 20.0}, **settings))
        arms.append(arm)
        arm.start()
        return arm

    yield make
    for arm in arms:
        arm.close()


@pytest.fixture
def arm(make_arm):
    """Start an enabled Zu 7, twenty times faster than time."""
    return make_arm()


@pytest.fixture
def client(arm):
    with RawClient(arm.command_port) as link:
        yield link


@pytest.fixture
def feed(arm):
    with RawFeed(arm.status_port) as link:
        yield link
