"""The settings of all tests: collected files, those that need ROS only where ROS can be imported; signals.

A plain Python without ROS (another version, another machine) runs the rest. A file needs ROS when it, or a module of
the package that it imports, imports a ROS package. The report at the end lists what was left out.
"""
import gc
import hashlib
import importlib.util
import itertools
import os
import shutil
import signal
import tempfile
from pathlib import Path
from typing import Dict, List

import command_places
import import_graph
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
WAITING = ("test/ros/pages/test_regression", "test/jaka_regression/ros/", "test/probe/test_move.py",
           "test/probe/test_probe.py", "test/ros/start/test_doctor.py", "test/ros/trajectories/test_goals.py",
           "test/client/guard/test_guard.py", "test/client/test_links.py", "test/probe/test_playback.py",
           "test/ros/pages/", "test/packaging/", "test/jaka_fleet/ros/", "test/test_every_command.py")
"""Beginnings of the paths of files that take longest, and wait most of the time for arms that move or for processes."""
LONG = ("test/custody/", "test/ros/", "test/mutation/")
BETWEEN = 4
"""Number of other files after which the next one that waits is begun."""
LONGEST_ID = 200
"""Characters of a parameter that stands whole in the name of its test."""
LEFT_OUT = "jaka/left_out"
"""The name of what is kept between runs, by the state of the sources: the files that need what is missing."""
left_out: List[str] = []

command_places.import_what_is_under_test()  # before the conftest.py of folders below import it

# The same examples in every run and on every Python, for a failure that cannot be had again helps nobody; and no limit
# of time, for a busy machine proves nothing about the code. A derandomized run has no use for a database of earlier
# failures.
settings.register_profile("jaka", derandomize=True, database=None, deadline=None,
                          suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("jaka")


def pytest_configure(config):
    """Set signals, places and session of the test process.

    A shell starts its background jobs with SIGINT ignored, which children inherit; those of the tests are sent it.

    Executables that tests start are those of one place, whose packages they find (``command_places``). Their files at
    run time are in a folder of the tests' own.

    Each worker of a parallel run is a session of its own: Linux shares the processors among sessions first
    (autogroups). In one session with all other workers, and with what else the shell runs, drivers and simulated
    controllers wait for up to 2 s while a browser, which has a session, draws.
    """
    if hasattr(config, "workerinput") and os.getsid(0) != os.getpid():
        os.setsid()
    config.jaka_left_out = known_needs(config) if MISSING else {}
    config.jaka_runtime_folder = os.environ["XDG_RUNTIME_DIR"] = tempfile.mkdtemp(prefix="jaka_test_runtime_")
    command_places.enter()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_unconfigure(config):
    shutil.rmtree(config.jaka_runtime_folder, ignore_errors=True)


def state_of_sources() -> str:
    """Return what changes with any file whose imports count."""
    folders = (import_graph.ROOT / "test", *import_graph.PACKAGES.values())
    files = sorted(path for folder in folders for path in folder.rglob("*.py"))
    known = [(str(path), path.stat().st_mtime_ns) for path in files]
    return hashlib.sha256(repr((sorted(MISSING), known)).encode()).hexdigest()


def known_needs(config) -> Dict[str, bool]:
    """Return what an earlier run of the same sources has found: which file is left out.

    To find it anew takes a third of the time of collecting, in each process of a parallel run.
    """
    config.jaka_state = state_of_sources()
    kept = config.cache.get(LEFT_OUT, {}) if hasattr(config, "cache") else {}
    return kept.get(config.jaka_state, {})


def needs_ros(path: Path) -> bool:
    if path in NEED_ROS:
        return True
    return path.suffix == ".py" and path.name.startswith("test_") and bool(
        MISSING & import_graph.roots_behind(import_graph.parse(path), path.parent))


def pytest_make_parametrize_id(val):
    """Name a long text by its beginning and its length: 5,000 brackets fill the report of a run."""
    if isinstance(val, (str, bytes)) and len(val) > LONGEST_ID:
        return "%s... (%d)" % (ascii(val[:20])[1:-1] if isinstance(val, str) else ascii(val[:20])[2:-1], len(val))
    return None


def pytest_ignore_collect(collection_path, config):
    if not MISSING:
        return None
    name = str(collection_path.relative_to(import_graph.ROOT))
    if name not in config.jaka_left_out:
        config.jaka_left_out[name] = needs_ros(collection_path)
    if config.jaka_left_out[name]:
        left_out.append(name)
        return True
    return None


@pytest.hookimpl(hookwrapper=True)
def pytest_collection(session):
    """Collect without garbage collection: it looks through thousands of tests again and again, a fifth of the time."""
    gc.disable()
    yield
    gc.freeze()  # what was collected stays until the end
    gc.enable()


def pytest_collection_finish(session):
    config = session.config
    if MISSING and not hasattr(config, "workerinput") and hasattr(config, "cache"):
        config.cache.set(LEFT_OUT, {config.jaka_state: config.jaka_left_out})


def pytest_collection_modifyitems(items):
    """Begin with files that take long, for a parallel run is over when its last file is, and spread those that wait.

    Were all workers to wait at the same time, the processors would have nothing to do.
    """
    files = list(dict.fromkeys(item.path for item in items))
    names = {path: path.relative_to(import_graph.ROOT).as_posix() for path in files}
    slow = list(dict.fromkeys(path for begin in WAITING for path in files if names[path].startswith(begin)))
    others = [path for path in files if path not in slow]
    others.sort(key=lambda path: next((i for i, begin in enumerate(LONG) if names[path].startswith(begin)), len(LONG)))
    waiting = iter(slow)
    order = list(itertools.islice(waiting, 2))
    for number, path in enumerate(others):
        order.append(path)
        if number % BETWEEN == 0:
            order += itertools.islice(waiting, 1)
    order += waiting
    places = {path: place for place, path in enumerate(order)}
    items.sort(key=lambda item: places[item.path])


def pytest_terminal_summary(terminalreporter):
    if left_out:
        terminalreporter.section("left out: need ROS, and cannot be imported here: %s" % ", ".join(sorted(MISSING)))
        terminalreporter.line(" ".join(sorted(left_out)))


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the checkout."""
    return import_graph.ROOT
