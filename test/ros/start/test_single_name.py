"""A node's name as rospy resolves it, and whether one of that name is alive already."""
import contextlib
import http.client
import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest
import rosgraph
from driver_bench import DriverProcess, SimulatorProcess, on
from import_graph import ROOT
from waiting import WAIT, eventually

from jaka_ros_driver.ros import single_name
from jaka_ros_driver.ros.driver_lock import AlreadyDriven
from jaka_ros_driver.ros.short_calls import NobodyThere
from jaka_ros_driver.ros.single_name import refuse_second_node, resolved_node_name

NODE = """
import rospy
rospy.init_node("first", disable_signals=True)
print(rospy.get_name(), flush=True)
rospy.loginfo("a line of the log")
print("it is on /rosout", flush=True)
rospy.spin()
"""


class Node:
    def __init__(self, *arguments, **environment):
        self.process = subprocess.Popen([sys.executable, "-c", NODE, *arguments], cwd=str(ROOT), text=True,
                                        stdout=subprocess.PIPE, env=dict(os.environ, **environment))
        self.name = self.process.stdout.readline().strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait(WAIT)
        self.process.stdout.close()


NAMES = [((), {}), (("__name:=other",), {}), (("__ns:=left",), {}), (("__ns:=/left/arm/", "__name:=x"), {}),
         ((), {"ROS_NAMESPACE": "right"}), (("__ns:=left",), {"ROS_NAMESPACE": "right"}), (("a:=b", "_p:=1"), {})]


@pytest.mark.parametrize("arguments, environment", NAMES)
def test_the_name_is_the_one_that_rospy_gives(ros_master, monkeypatch, arguments, environment):
    for key, value in environment.items():
        monkeypatch.setenv(key, value)
    with Node(*arguments, **environment) as node:
        assert resolved_node_name("first", ["program", *arguments]) == node.name


def test_a_living_node_is_refused_a_second_one_and_lives_on(ros_master):
    with Node("__ns:=left") as node:
        with pytest.raises(AlreadyDriven, match=r"/left/first runs already \(pid %d at http" % node.process.pid):
            refuse_second_node("/left/first")
        refuse_second_node("/first")
        refuse_second_node("/left/other")
        time.sleep(0.3)  # what must not come has no other sign
        assert node.process.poll() is None


def test_one_that_was_killed_is_not(ros_master):
    with Node() as node:
        name = node.name
        assert rosgraph.Master("/tests").lookupNode(name)
    assert rosgraph.Master("/tests").lookupNode(name), "the master should not know of its death"
    refuse_second_node(name)


def test_one_that_is_stopped_still_has_its_name(ros_master):
    with Node("__name:=frozen") as node:
        node.process.send_signal(signal.SIGSTOP)
        begin = time.monotonic()
        with pytest.raises(AlreadyDriven, match="it does not answer"):
            refuse_second_node("/frozen")
        assert time.monotonic() - begin < WAIT
        node.process.send_signal(signal.SIGCONT)
        assert eventually(lambda: "pid" in refusal("/frozen"))


def refusal(name):
    try:
        refuse_second_node(name)
    except AlreadyDriven as error:
        return str(error)
    return ""


def test_a_port_that_another_node_has_now_is_no_node_of_this_name(ros_master):
    with Node("__name:=heir") as heir:
        master = rosgraph.Master("/late")
        master.registerService("/late/service", "rosrpc://127.0.0.1:1", master.lookupNode(heir.name))
        try:
            assert master.lookupNode("/late") == master.lookupNode("/heir")
            refuse_second_node("/late")
        finally:
            master.unregisterService("/late/service", "rosrpc://127.0.0.1:1")


def refused(connection):
    connection.sendall(b'{"errorCode": "2", "errorMsg": "cannot parse"}\n')


def fault(connection):
    body = (b"<?xml version='1.0'?><methodResponse><fault><value><struct><member><name>faultCode</name><value><int>1"
            b"</int></value></member><member><name>faultString</name><value><string>no</string></value></member>"
            b"</struct></value></fault></methodResponse>")
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))


def silence(connection):
    """Wait until the caller has given up."""
    connection.settimeout(WAIT)
    while connection.recv(65536):
        pass


@pytest.mark.parametrize("answer", [refused, fault, lambda connection: None, silence])
def test_a_port_that_another_program_has_now_is_no_node_of_this_name(ros_master, answer):
    """Test with what a simulated controller's ports and roslaunch answer, and with a process that hangs up."""
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))

        def serve():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = listener.accept()
                    with connection:
                        connection.recv(65536)
                        answer(connection)
        server = threading.Thread(target=serve)
        server.start()
        stack.callback(server.join, WAIT)
        stack.callback(listener.shutdown, socket.SHUT_RDWR)
        master = rosgraph.Master("/gone")
        address = "http://127.0.0.1:%d/" % listener.getsockname()[1]
        master.registerService("/gone/service", "rosrpc://127.0.0.1:1", address)
        stack.callback(master.unregisterService, "/gone/service", "rosrpc://127.0.0.1:1")
        assert master.lookupNode("/gone") == address
        refuse_second_node("/gone")


def test_a_node_that_ended_in_good_order_keeps_no_name_where_a_silent_program_has_its_port(ros_master):
    """Test with what the master really keeps of a node of rospy that has logged a line."""
    with contextlib.ExitStack() as stack:
        node = stack.enter_context(Node("__name:=ended"))
        master = rosgraph.Master("/tests")
        address = master.lookupNode("/ended")
        next(line for line in node.process.stdout if "it is on /rosout" in line)
        node.process.send_signal(signal.SIGINT)
        node.process.wait(WAIT)
        assert master.lookupNode("/ended") == address, "the master should still have its address"
        stack.enter_context(socket.create_server(("127.0.0.1", int(address.rstrip("/").rpartition(":")[2]))))
        refuse_second_node("/ended")


def test_the_driver_outlives_the_shutdown_of_a_node_that_had_its_port_before(ros_master):
    with contextlib.closing(SimulatorProcess()) as simulator, DriverProcess("survivor", **on(simulator)) as driver:
        next(line for line in driver.process.stdout if "auto_enable: the arm is powered" in line)
        with known_at("/killed", rosgraph.Master("/tests").lookupNode("/survivor")):
            next(line for line in driver.process.stdout if "a shutdown of [/killed]" in line and "not obeyed" in line)
        assert driver.process.poll() is None
        with known_at("/survivor"):
            code, said = driver.wait()
            assert code == 0, said


@contextlib.contextmanager
def known_at(name, *addresses):
    """Register a node at addresses and then at an unused one: the master asks each earlier one to shut down."""
    master = rosgraph.Master(name)
    for address in (*addresses, "http://127.0.0.1:9/"):
        master.registerService("/of_nobody", "rosrpc://127.0.0.1:1", address)
    try:
        yield
    finally:
        master.unregisterService("/of_nobody", "rosrpc://127.0.0.1:1")


@pytest.mark.parametrize("uri", ["http://127.0.0.1:9", "http://no.such.host.invalid:11311", "nonsense", ""])
def test_without_a_master_nothing_is_refused(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    refuse_second_node("/first")


@pytest.mark.parametrize("known_as, is_refused", [("/first", True), ("/another", False), (None, True), (7, False)])
def test_a_port_that_another_node_has_taken_over_is_no_second_node(monkeypatch, known_as, is_refused):
    # A node of roscpp gives no name.
    answers = {"lookupNode": "http://127.0.0.1:9/", "getName": known_as, "getPid": 1234}
    monkeypatch.setattr(single_name, "ask", lambda uri, method, *arguments: answers[method])
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    if is_refused:
        with pytest.raises(AlreadyDriven, match="/first"):
            refuse_second_node("/first")
    else:
        refuse_second_node("/first")


def test_where_nobody_listens_any_more_at_its_address_a_node_has_ended(monkeypatch):
    def ask(uri, method, *arguments):
        if method == "lookupNode":
            return "http://127.0.0.1:9/"
        raise NobodyThere
    monkeypatch.setattr(single_name, "ask", ask)
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:9")
    refuse_second_node("/first")


def test_a_stopped_node_holds_a_start_up_for_a_few_seconds_at_most(monkeypatch):
    # what each question would wait for is added up; nothing is waited for
    waits = []

    def time_out(connection):
        waits.append(connection.timeout)
        raise socket.timeout("timed out")

    monkeypatch.setattr(http.client.HTTPConnection, "getresponse", time_out)
    with socket.create_server(("127.0.0.1", 0)) as stopped:  # it takes connections and says nothing
        uri = "http://127.0.0.1:%d/" % stopped.getsockname()[1]
        ask = single_name.ask
        answers = {"lookupNode": uri, "getSystemState": [[], [], [["/first/get_loggers", ["/first"]]]],
                   "lookupService": uri.replace("http", "rosrpc")}
        monkeypatch.setattr(single_name, "ask", lambda to, method, *arguments: (
            answers[method] if method in answers else ask(to, method, *arguments)))
        with pytest.raises(AlreadyDriven, match="it does not answer"):
            refuse_second_node("/first")
    assert len(waits) == 2 and 1.0 <= sum(waits) <= 3.0
