"""The end of a driver as a supervisor sees it: its exit code, the end of the launch, a restart that powers nothing."""
import contextlib
import os
import re
import signal
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
from driver_bench import HOME, ArmOfAnotherMaster, DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from ros_graph import Graph
from waiting import eventually

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.ros.exit_codes import COMPUTER, CONFIGURATION, MEANINGS, RIVAL, exit_code_of

START = str(ROOT / "launch" / "robot_start_launch.launch")


def test_each_code_has_its_meaning_and_remedy():
    assert sorted(MEANINGS) == list(range(6)) and all(all(entry) for entry in MEANINGS.values())
    assert exit_code_of(OSError("no socket")) == COMPUTER
    assert exit_code_of(InvalidCommand("model file")) == CONFIGURATION


def test_a_rival_has_a_code_of_its_own(ros_node):
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("first", **on(simulator, guard=False)) as first:
        next(line for line in first.process.stdout if "driving a JAKA" in line)
        with DriverProcess("second", **on(simulator, guard=False)) as second:
            code, said = second.wait()
        assert code == RIVAL and "already driven by node /first" in said
        with DriverProcess("first", **on(simulator, guard=False)) as same:
            code, said = same.wait()
        assert code == RIVAL and "the node /first runs already" in said


@pytest.fixture
def graph(ros_node, tmp_path):  # which calls services as a node
    with Graph(tmp_path) as graph:
        graph.environment.update(XDG_RUNTIME_DIR=str(tmp_path))
        yield graph


@pytest.fixture
def simulator():
    with contextlib.closing(SimulatorProcess()) as simulator:
        yield simulator


def launch(graph, simulator, *arguments):
    return graph.start("roslaunch", START, "sim:=false", "command_port:=%d" % simulator.command_port,
                       "status_port:=%d" % simulator.status_port, *arguments)


def process_of(graph, node="/jaka_driver"):
    """Return the process id of a node of this graph, None while there is none."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        with ServerProxy(graph.master().lookupNode(node)) as proxy:
            return proxy.getPid("/test")[2]
    return None


def test_a_driver_that_cannot_start_ends_the_launch(graph, simulator):
    launched = launch(graph, simulator, "model:=foo")
    launched.wait()
    assert "parameter ~model is 'foo'" in launched.output
    assert re.search(r"REQUIRED process \[jaka_driver-\d+\] has died!\n.*exit code 2", launched.output), launched.output


def test_a_driver_that_is_killed_ends_the_launch_and_the_arm_is_at_rest(graph, simulator):
    launched = launch(graph, simulator)
    assert eventually(lambda: simulator.state()["is_enabled"]), launched.output
    arm = ArmOfAnotherMaster(simulator, "/jaka_driver", graph.uri)
    assert eventually(lambda: arm.call("jog", mvvelo=0.2, coord_mode=0, index=0).ret == 1)
    assert eventually(simulator.is_moving)
    os.kill(process_of(graph), signal.SIGKILL)
    launched.wait()
    assert "REQUIRED process" in launched.output and "exit code -9" in launched.output
    assert eventually(lambda: not simulator.is_moving())


def test_with_respawn_a_killed_driver_comes_again_and_powers_nothing(graph, simulator):
    launched = launch(graph, simulator, "respawn:=true", "guard:=false")
    assert eventually(lambda: simulator.state()["is_enabled"]), launched.output
    first = process_of(graph)
    simulator.operate("reboot", down=1.0)
    assert eventually(lambda: not simulator.state()["is_powered"])
    os.kill(first, signal.SIGKILL)
    launched.wait_for_line("auto_enable: the driver was started again")
    assert eventually(lambda: process_of(graph) not in (None, first))
    arm = ArmOfAnotherMaster(simulator, "/jaka_driver", graph.uri)
    assert eventually(lambda: arm.call("get_fk", joint=HOME).cartesian_pose), "the driver has its link"
    assert not simulator.state()["is_powered"]
    assert eventually(lambda: arm.call("power", data=True).success), "a person may power it"
    launched.stop()


def test_a_black_box_without_a_folder_says_so_once_and_the_driver_goes_on(graph, simulator):
    launched = launch(graph, simulator, "black_box:=/proc/nobody", "auto_enable:=false")
    launched.wait_for_line(r"jaka_black_box-\d+\] process has died .*exit code 2")
    arm = ArmOfAnotherMaster(simulator, "/jaka_driver", graph.uri)
    assert eventually(lambda: arm.call("get_fk", joint=HOME).cartesian_pose)
    assert launched.output.count("cannot make the folder /proc/nobody") == 1 and "Traceback" not in launched.output
    launched.stop()


def test_a_black_box_that_crashes_is_started_again_and_ends_with_the_launch(graph, simulator, tmp_path):
    launched = launch(graph, simulator, "black_box:=%s" % (tmp_path / "box"), "auto_enable:=false")
    first = eventually(lambda: process_of(graph, "/jaka_black_box"))
    os.kill(first, signal.SIGKILL)
    assert eventually(lambda: process_of(graph, "/jaka_black_box") not in (None, first)), launched.output
    second = process_of(graph, "/jaka_black_box")
    launched.stop()
    assert eventually(lambda: not os.path.exists("/proc/%d" % second))
