"""The checks of the ROS graph: the master, the way to it and back, ROS time, the node's name."""
import logging
import os
import socket
import threading
import time
from typing import Any, Dict, Tuple
from urllib.parse import urlsplit

import rosgraph
from rosgraph.xmlrpc import XmlRpcHandler, XmlRpcNode

from jaka_ros_driver.client.core.procedures.session import is_loopback
from jaka_ros_driver.doctor.findings import Examination, Observation, fault, good, skipped, warning
from jaka_ros_driver.doctor.subject import ExaminedSystem
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.ros.driver_lock import AlreadyDriven
from jaka_ros_driver.ros.short_calls import NobodyThere, Unanswered, ask
from jaka_ros_driver.ros.single_name import refuse_second_node
from jaka_ros_driver.ros.start_checks import is_master_uri, require_own_answer

_CONNECT_S = 3.0
"""Longest wait, s, for a node's port, and for an answer: nothing answers at a wrong address."""
_BACK_S = 4.0
"""Longest wait, s, for the master's call; a longer one only makes the report of a blocked way late."""
_NAME = "/jaka_doctor_%d" % os.getpid()
_ADDRESS_REMEDY = ("set ROS_IP to the address of this computer that the others reach, the same in every shell "
                   "and service (ip -brief address lists them)")


def variables(subject: ExaminedSystem) -> Observation:
    """Check the environment's ROS_MASTER_URI, ROS_IP and ROS_HOSTNAME."""
    uri, ip, name = (os.environ.get(key, "") for key in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOSTNAME"))
    found = ", ".join("%s=%s" % (key, value or "(not set)") for key, value in (
        ("ROS_MASTER_URI", uri), ("ROS_IP", ip), ("ROS_HOSTNAME", name)))
    if not is_master_uri(uri):
        return fault(found, "no node finds the master", "export ROS_MASTER_URI=http://MASTER:11311")
    if ip and name:
        return warning(found, "ROS_HOSTNAME counts, ROS_IP has no effect", "unset one of the two")
    return good(found, "nodes of this shell use them")


def own_address(subject: ExaminedSystem) -> Observation:
    """Check, as the driver does before it powers anything, that a node here answers at its own address."""
    node, _ = _served()
    try:
        require_own_answer(node.uri, _NAME)
    except JakaError as error:
        return fault(str(error), "the driver does not start (exit code 4): nobody could stop the arm through it",
                     _ADDRESS_REMEDY)
    finally:
        _end(node)
    uri = node.uri.rstrip("/")
    is_elsewhere = not _is_here_only(urlsplit(rosgraph.get_master_uri()).hostname or "")
    if is_elsewhere and _is_here_only(urlsplit(uri).hostname or ""):
        return fault("%s is an address of this computer alone, and the master is on another one" % uri,
                     "nodes of other computers connect to themselves, and nobody there can stop the arm",
                     _ADDRESS_REMEDY)
    return good("a node of this computer answers at %s" % uri, "clients here can reach the driver")


def _is_here_only(host: str) -> bool:
    """Return whether a name has addresses of loopback only, as Debian's own name of a computer often has."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return all(is_loopback(str(entry[4][0])) for entry in found)


def master(subject: ExaminedSystem) -> Observation:
    """Check that the ROS master answers, and tell a refusal from silence."""
    uri = rosgraph.get_master_uri()
    parts = urlsplit(uri)
    remedy = "start roscore there, or correct ROS_MASTER_URI"
    try:
        socket.create_connection((parts.hostname or "", parts.port or 0), _CONNECT_S).close()
        answer = ask(uri, "getPid", _NAME)
    except ConnectionRefusedError:
        return fault("%s: connection refused" % uri, "that computer is there, and no master runs at this port", remedy)
    except socket.timeout:
        return fault("%s: no answer in %.0f s" % (uri, _CONNECT_S), "what is sent there gets lost without a word",
                     "check the cable, and a firewall there: sudo ufw status, nft list ruleset")
    except (Unanswered, NobodyThere):
        return fault("%s: connected, and no answer" % uri, "the master hangs", "restart roscore")
    except (OSError, UnicodeError, ValueError) as error:
        return fault("%s: %s" % (uri, error), "there is no way to that computer, or no such name",
                     "correct ROS_MASTER_URI, or the network of this computer")
    if answer is None:
        return fault("%s: another process answers" % uri, "no node finds the master", remedy)
    return good("%s answers" % uri, "nodes can register")


def way_back(subject: ExaminedSystem) -> Observation:
    """Check that the master reaches a node here: it calls nodes back at the address that they register."""
    uri = rosgraph.get_master_uri()
    node, handler = _served()
    topic = _NAME + "/way_back"
    try:
        if not isinstance(ask(uri, "registerSubscriber", _NAME, topic, "std_msgs/Empty", node.uri), list):
            return skipped("the master at %s answers nothing" % uri, "see ROS master")
        ask(uri, "registerPublisher", _NAME, topic, "std_msgs/Empty", node.uri)
        has_come = handler.called.wait(_BACK_S)
        for method in ("unregisterSubscriber", "unregisterPublisher"):  # otherwise the master calls back once more
            ask(uri, method, _NAME, topic, node.uri)
    except (Unanswered, NobodyThere):
        return skipped("the master at %s answers nothing" % uri, "see ROS master")
    finally:
        _end(node)
    if not has_come:
        return fault("the master did not reach %s in %.0f s" % (node.uri, _BACK_S),
                     "nodes there learn nothing of this one, and cannot stop the arm through it",
                     _ADDRESS_REMEDY + "; then look for a firewall on this computer")
    return good("the master reaches a node here at %s" % node.uri.rstrip("/"), "nodes can talk both ways")


def ros_time(subject: ExaminedSystem) -> Observation:
    """Check that time runs: with /use_sim_time somebody must publish /clock."""
    uri = rosgraph.get_master_uri()
    try:
        is_simulated = ask(uri, "getParam", _NAME, "/use_sim_time")
        state = ask(uri, "getSystemState", _NAME)
    except (Unanswered, NobodyThere):
        return skipped("the master at %s answers nothing" % uri, "see ROS master")
    publishers = dict(state[0]).get("/clock", []) if isinstance(state, list) and state else []
    if not is_simulated:
        return good("/use_sim_time is not set", "time is that of the computer")
    if not publishers:
        return fault("/use_sim_time is true, and nobody publishes /clock",
                     "time stands at 0: the driver waits, and offers no service",
                     "rosparam set /use_sim_time false, or start what publishes /clock")
    if subject.has_controller and not is_loopback(subject.config.ip):
        return warning("/use_sim_time is true, /clock comes from %s" % ", ".join(publishers),
                       "a real arm's states get simulated times", "rosparam set /use_sim_time false")
    return good("/use_sim_time is true, /clock comes from %s" % ", ".join(publishers), "time is simulated")


def node_name(subject: ExaminedSystem) -> Observation:
    """Check whether a node of the driver's name runs already."""
    try:
        ask(rosgraph.get_master_uri(), "getPid", _NAME)
        refuse_second_node(subject.node)
    except (Unanswered, NobodyThere):
        return skipped("the master at %s answers nothing" % rosgraph.get_master_uri(), "see ROS master")
    except AlreadyDriven as error:
        return good(str(error), "this is the driver that runs, or a second one cannot start (exit code 3)")
    return good("no node %s runs" % subject.node, "the name is free")


def parameters_of(node: str) -> Dict[str, Any]:
    """Return the private parameters of a node as the master has them; none where it does not answer."""
    try:
        values = ask(rosgraph.get_master_uri(), "getParam", _NAME, node)
    except (Unanswered, NobodyThere, ValueError):
        return {}
    return values if isinstance(values, dict) else {}


class _Handler(XmlRpcHandler):
    """The XML-RPC interface of a node, as far as a master calls it."""

    def __init__(self) -> None:
        self.called = threading.Event()

    def getPid(self, caller_id: str) -> Tuple[int, str, int]:  # the names of ROS's slave API
        return 1, "", os.getpid()

    def publisherUpdate(self, caller_id: str, topic: str, publishers: Any) -> Tuple[int, str, int]:
        self.called.set()
        return 1, "", 0


def _served() -> Tuple[Any, _Handler]:
    """Return a server that listens and gives away an address as every rospy node does, and its handler."""
    logging.getLogger("xmlrpc").addHandler(logging.NullHandler())
    handler = _Handler()
    node = XmlRpcNode(0, handler)
    node.start()
    deadline = time.monotonic() + _CONNECT_S
    while node.uri is None and time.monotonic() < deadline:
        time.sleep(0.01)
    return node, handler


def _end(node: Any) -> None:
    node.is_shutdown = True
    if node.server is not None:
        node.server.shutdown()
        node.server.server_close()


CHECKS = (
    Examination("ROS variables", variables),
    Examination("own address", own_address),
    Examination("ROS master", master),
    Examination("way back", way_back),
    Examination("ROS time", ros_time),
    Examination("node name", node_name),
)
