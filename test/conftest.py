"""The settings of all tests: collected files, those that need ROS only where ROS can be imported; signals.

A plain Python without ROS (another version, another machine) runs the rest. A file needs ROS when it, or a module of
the package that it imports, imports a ROS package. The report at the end lists what was left out.
"""
import importlib.util
import os
import shutil
import signal
import tempfile
from pathlib import Path
from typing import List

import import_graph
import program_places
import pytest
from hypothesis import HealthCheck, settings

ROS_PACKAGES = (
    "actionlib", "actionlib_msgs", "catkin_pkg", "diagnostic_msgs", "diagnostic_updater", "genmsg", "genpy",
    "geometry_msgs", "jaka_msgs", "rosbag", "rosgraph", "rosgraph_msgs", "roslaunch", "roslib", "rosmsg", "rosnode",
    "rosparam", "rospkg", "rosservice", "rostest", "rostopic", "rospy", "sensor_msgs", "std_msgs", "std_srvs",
    "tf2_msgs", "trajectory_msgs")
MISSING = frozenset(name for name in ROS_PACKAGES if importlib.util.find_spec(name) is None)
NEED_ROS = tuple(import_graph.ROOT / "test" / name
                 for name in ("ros", "packaging", "jaka_fleet/ros", "jaka_regression/ros"))
LONG = (
    "test/jaka_regression/ros/", "test/ros/pages/", "test/custody/", "test/packaging/", "test/mutation/", "test/ros/")
left_out: List[str] = []

program_places.import_what_is_under_test()  # before the conftest.py of folders below import it

# The same examples in every run, for a failure that cannot be had again helps nobody; and no limit of time, for a busy
# machine proves nothing about the code. A derandomized run has no use for a database of earlier failures.
settings.register_profile("jaka", derandomize=True, database=None, deadline=None,
                          suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("jaka")


def pytest_configure(config):
    """Set signals, places and session of the test process.

    A shell starts its background jobs with SIGINT ignored, which children inherit; those of the tests are sent it.

    Executables that tests start are those of one place, whose packages they find (``program_places``). Their files at
    run
    time are in a folder of the tests' own.

    Each worker of a parallel run is a session of its own: Linux shares the processors among sessions first
    (autogroups). In one session with all other workers, and with what else the shell runs, drivers and simulated
    controllers wait for up to 2 s while a browser, which has a session, draws.
    """
    if hasattr(config, "workerinput") and os.getsid(0) != os.getpid():
        os.setsid()
    config.jaka_runtime_folder = os.environ["XDG_RUNTIME_DIR"] = tempfile.mkdtemp(prefix="jaka_test_runtime_")
    program_places.enter()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_unconfigure(config):
    shutil.rmtree(config.jaka_runtime_folder, ignore_errors=True)


def pytest_ignore_collect(collection_path, config):
    if not MISSING:
        return None
    if collection_path in NEED_ROS:
        needs = MISSING
    elif collection_path.suffix == ".py" and collection_path.name.startswith("test_"):
        needs = MISSING & import_graph.roots_behind(import_graph.parse(collection_path), collection_path.parent)
    else:
        return None
    if needs:
        left_out.append(str(collection_path.relative_to(import_graph.ROOT)))
    return True if needs else None


def pytest_collection_modifyitems(items):
    """Begin with the folders whose files take longest: a parallel run is over when its last file is."""
    items.sort(key=lambda item: next((i for i, folder in enumerate(LONG) if item.nodeid.startswith(folder)), len(LONG)))


def pytest_terminal_summary(terminalreporter):
    if left_out:
        terminalreporter.section("left out: need ROS, and cannot be imported here: %s" % ", ".join(sorted(MISSING)))
        terminalreporter.line(" ".join(sorted(left_out)))


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the checkout."""
    return import_graph.ROOT
