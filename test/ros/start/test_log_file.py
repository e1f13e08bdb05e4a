"""Nodes that cannot write rospy's log file: what they have to say is on the screen all the same, as plain lines."""
import contextlib
import os
import re
import signal

import pytest
from command_places import command_of
from driver_bench import SimulatorProcess, on
from ros_graph import Graph, Process


@pytest.fixture(params=["home that is not there", "folder that takes no file", "file in the way", "full disk",
                        "log file is a folder"])
def no_log(request, tmp_path):
    """Return the environment and the words of a node that can write no log file; root can write almost everywhere."""
    if request.param == "home that is not there":
        return {"ROS_LOG_DIR": "/proc/nobody/.ros/log"}, []
    if request.param == "folder that takes no file":
        return {"ROS_LOG_DIR": "/proc/self"}, []
    if request.param == "file in the way":
        (tmp_path / "log").write_text("")
        return {"ROS_LOG_DIR": str(tmp_path / "log")}, []
    if request.param == "log file is a folder":
        return {"ROS_LOG_DIR": str(tmp_path)}, ["__log:=%s" % tmp_path]
    return {"ROS_LOG_DIR": str(tmp_path)}, ["__log:=/dev/full"]


@pytest.fixture
def driver(ros_node, no_log, tmp_path):
    """Return a function that starts a driver with these parameters and without a log file; it ends with the test."""
    environment, words = no_log
    with contextlib.ExitStack() as running:
        def start(variables=(), **parameters):
            given = ["_%s:=%s" % item for item in parameters.items()]
            process = Process([*command_of("jaka_driver"), "__name:=unlogged", *words, *given],
                              dict(os.environ, **environment, **dict(variables)), tmp_path)
            running.callback(process.stop, signal.SIGKILL)
            return process
        yield start


def plain(text):
    """Assert that a node's output has no traceback, and that what is missing is said once."""
    assert "Traceback" not in text and "Logging error" not in text, text
    assert len(re.findall("there is no log file|log file .*is not written|create log directory", text)) == 1, text


def test_a_driver_names_its_simulated_arm(driver):
    with contextlib.closing(SimulatorProcess()) as simulator:
        process = driver(**on(simulator, guard=False))
        process.wait_for_line("SIMULATED ARM: ")
        assert process.stop() == 0
    plain(process.output)


def test_a_driver_says_that_it_cannot_connect(driver, free_ports):
    command_port, status_port = free_ports(2)
    process = driver(ip="127.0.0.1", command_port=command_port, status_port=status_port, guard=False)
    process.wait_for_line("cannot connect to 127.0.0.1:")
    assert process.stop() == 0
    plain(process.output)


def test_a_driver_says_why_it_does_not_start(driver):
    process = driver(model="foo")
    assert process.wait()
    assert "FATAL" in process.output and "unlogged cannot start: parameter ~model is 'foo'" in process.output
    plain(process.output)


def test_a_driver_without_a_master_says_that_it_waits(driver, free_ports):
    process = driver({"ROS_MASTER_URI": "http://127.0.0.1:%d" % free_ports(1)[0]})
    process.wait_for_line("WARNING: jaka_driver waits for the ROS master at http://127.0.0.1:\\d+: .*refused")
    process.stop(signal.SIGKILL)
    assert "Traceback" not in process.output, process.output


def test_the_panel_serves_its_page(tmp_path, no_log):
    environment, words = no_log
    with Graph(tmp_path) as graph:
        graph.environment.update(environment)
        panel = graph.start(*command_of("jaka_panel"), *words)
        panel.wait_for_line("jaka_panel: open http")
        assert panel.stop() == 0
        plain(panel.output)
