"""A roscore of the tests' own, on loopback and a free port, and launch files started against it."""
import contextlib
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Sequence, Set, Tuple

import import_graph
import pytest
import rosgraph
import roslaunch
import rospy
import waiting
from driver_bench import Arm, SimulatorProcess
from ros_graph import core, launched_parent

_KEPT_PARAMETERS: Dict[str, Set[str]] = {}
"""The parameters of a master of this process that are its own, by its URI."""


@pytest.fixture(scope="session")
def ros_master(tmp_path_factory) -> Iterator[str]:
    """Start a master and return its URI; the environment points at it, logs go to a temporary folder."""
    with core(tmp_path_factory.mktemp("ros_home")) as uri:
        _KEPT_PARAMETERS[uri] = set(rosgraph.Master("/tests", uri).getParamNames())
        yield uri
        del _KEPT_PARAMETERS[uri]


@pytest.fixture(scope="module", autouse=True)
def parameters_end_with_their_module() -> Iterator[None]:
    """Delete what a module's drivers and launch files leave on the master: the next driver of that name would take it.

    Which module comes next in a process differs from run to run.
    """
    yield
    for uri, kept in _KEPT_PARAMETERS.items():
        master = rosgraph.Master("/tests", uri)
        for name in set(master.getParamNames()) - kept:
            master.deleteParam(name)


@pytest.fixture(scope="session")
def ros_node(ros_master) -> Iterator[str]:
    """Make the test process a ROS node; return its name."""
    rospy.init_node("jaka_tests", anonymous=True, disable_signals=True)
    yield rospy.get_name()
    rospy.signal_shutdown("tests are over")


@pytest.fixture
def launch(ros_master) -> Iterator[Callable[..., roslaunch.parent.ROSLaunchParent]]:
    """Return a function that starts a launch file of this package: ``launch("demo.launch", "model:=zu7")``.

    All end with the test.
    """
    with contextlib.ExitStack() as running:
        yield lambda name, *arguments: running.enter_context(launched(name, arguments))


@contextlib.contextmanager
def launched(name: str, arguments: Sequence[str] = ()) -> Iterator[roslaunch.parent.ROSLaunchParent]:
    """Run a launch file of this package; also for fixtures of a wider scope, which need ros_master themselves."""
    path = str(Path(import_graph.ROOT, "launch", name))
    files: Sequence[Tuple[str, Sequence[str]]] = [(path, arguments)]
    with launched_parent(files, is_core=False) as parent:
        yield parent


@contextlib.contextmanager
def driven(simulator: SimulatorProcess, *arguments: str) -> Iterator[Arm]:
    """Run the driver node on a simulated controller by its launch file; needs ros_node.

    Without the guard process: on a busy host a driver that gets no time for 0.25 s is as good as a dead one.
    """
    ports = ("command_port:=%d" % simulator.command_port, "status_port:=%d" % simulator.status_port)
    with launched("robot_start_launch.launch", ("sim:=false", "guard:=false") + ports + arguments):
        yield Arm(simulator)


@pytest.fixture(scope="module")
def simulator() -> Iterator[SimulatorProcess]:
    """Start a simulated controller for a module, its drives enabled."""
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as process:
        yield process


@pytest.fixture(scope="module")
def log_file(tmp_path_factory) -> Path:
    """Return where the simulated controller of a module keeps its log."""
    return tmp_path_factory.mktemp("wire") / "wire.mcap"


@pytest.fixture(scope="module")
def arm(ros_node, simulator) -> Iterator[Arm]:
    """Start the driver on it, interface documented."""
    with driven(simulator) as running:
        running.wait_until_ready()
        yield running


@pytest.fixture(scope="session")
def launched_file(ros_master) -> Callable[..., "contextlib.AbstractContextManager[roslaunch.parent.ROSLaunchParent]"]:
    """Return the context ``launched(name, arguments)``, for fixtures of a wider scope than ``launch``."""
    return launched


@pytest.fixture(scope="session")
def free_ports() -> Callable[[int], List[int]]:
    """Return a function that finds so many different ports, for executables that must have them before they start."""
    return waiting.free_ports


@pytest.fixture(scope="session")
def driven_by() -> Callable[..., "contextlib.AbstractContextManager[Arm]"]:
    """Return the context ``driven(simulator, *launch_arguments)``, which gives the arm."""
    return driven
