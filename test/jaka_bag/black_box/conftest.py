"""A master for each test, as the tests of recorder and player have it."""

import live_samples
import pytest


@pytest.fixture
def graph(tmp_path, monkeypatch):
    """Start a master; the environment points at it."""
    import ros_graph  # a plain Python without ROS runs the tests that need no master
    with ros_graph.Graph(tmp_path) as running:
        for name in ("ROS_MASTER_URI", "ROS_IP"):
            monkeypatch.setenv(name, running.environment[name])
        for name in ("ROS_HOSTNAME", "ROS_NAMESPACE"):
            monkeypatch.delenv(name, raising=False)
        yield running


@pytest.fixture(autouse=True)
def no_thread_stays():
    """Fail a test that leaves a thread behind."""
    with live_samples.no_thread_stays():
        yield
