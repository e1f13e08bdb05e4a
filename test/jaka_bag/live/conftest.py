"""A master for each test, so that no test sees another's nodes."""

import live_samples
import pytest


def running_graph(tmp_path, monkeypatch, is_mortal):
    import ros_graph  # a plain Python without ROS runs the tests that need no master
    with ros_graph.Graph(tmp_path, is_mortal) as running:
        for name in ("ROS_MASTER_URI", "ROS_IP"):
            monkeypatch.setenv(name, running.environment[name])
        for name in ("ROS_HOSTNAME", "ROS_NAMESPACE"):
            monkeypatch.delenv(name, raising=False)
        yield running


@pytest.fixture
def graph(tmp_path, monkeypatch):
    """Start a master; the environment points at it."""
    yield from running_graph(tmp_path, monkeypatch, False)


@pytest.fixture
def mortal_graph(tmp_path, monkeypatch):
    """Start a master that can be stopped and started again; the environment points at it."""
    yield from running_graph(tmp_path, monkeypatch, True)


@pytest.fixture(autouse=True)
def no_thread_stays():
    """Fail a test that leaves a thread behind."""
    with live_samples.no_thread_stays():
        yield
