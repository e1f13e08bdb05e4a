"""Checks before anything is powered: words of the command line are taken as they were meant, clients can reach the
node, time runs, each topic has one use.

Where one of them fails, an arm could move that nobody can stop through this node, or whose stamps and topics mislead
those who look at it.
"""
import http.client
import logging
import os
import re
import socket
import sys
import threading
import time
from typing import Any, Callable, Container, Dict, Sequence
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import yaml
from rospy.impl import registration, tcpros_base

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.ros.params import DriverConfig, WrongParameter, table
from jaka_ros_driver.ros.short_calls import NobodyThere, ShortTransport, Unanswered, ask

_LOG = logging.getLogger(__name__)

_CONNECT_TIMEOUT_S = 3.0
"""Longest wait, s, for this node's own answer: at a wrong address often nothing answers at all."""
_PROBE_TIMEOUT_S = 0.5
"""Longest wait, s, for another publisher of a topic, which is likely dead; there may be several."""
_LOOK_S = 0.05
"""Period, s, of the looks whether time runs: the delay of the start behind the first ``/clock``."""
_LOG_PERIOD_S = 10.0
"""Period, s, of the error while time stands still: it must not be missed, nor fill the log."""
_MASTER_LOOK_S, _MASTER_LOG_PERIOD_S = 0.2, 60.0
"""Period, s, of the attempts to reach the master, and of the log: a master may be off for hours."""
_OF_ROS = ("/rosout", "/rosout_agg", "/clock", "/tf", "/tf_static", "/diagnostics", "/diagnostics_agg")


class Unreachable(JakaError):
    """The error that clients cannot reach this node at the address that it gives them."""


# ---- the command line means what it says ----

def refuse_words_that_are_not_taken(words: Sequence[str]) -> None:
    """Refuse words of ROS on the command line of which rospy would not make what they say; call before ``init_node``.

    rospy leaves out ``_ip:=`` that has no value (a variable of the shell that is not set), and takes ``ip:=10.5.5.100``
    for the remapping of a topic: with either, the driver would drive the controller of its default.

    Raises:
        WrongParameter: There are such words; it names them all.
    """
    names = {name for name, _, _ in table()}
    wrong = ["%s is not UTF-8" % ascii(word) for word in words if not _is_utf8(word)]
    wrong = wrong or [problem for problem in (
        _problem_of(word, names) for word in words if ":=" in word and word[0] != "-") if problem]
    if wrong:
        raise WrongParameter("; ".join(wrong))


def _is_utf8(word: str) -> bool:
    try:
        word.encode("utf-8")
    except UnicodeEncodeError:  # bytes of another encoding, of which Python makes halves of surrogate pairs
        return False
    return True


def _problem_of(word: str, names: Container[str]) -> str:
    name, *values = (part.strip() for part in word.split(":="))
    if len(values) != 1:
        return "%s has := more than once" % word
    if not name or not values[0]:
        return "%s has no %s, and would have no effect (an empty text is written \"_NAME:=''\")" % (
            word, "value" if name else "name")
    if name.lstrip("~") in names:
        return "%s would be the remapping of a topic; the parameter is set by _%s:=%s" % (
            word, name.lstrip("~"), values[0])
    if re.match("_[^_]", name):
        try:
            return "" if yaml.safe_load(values[0]) is not None else "%s has no value: null in YAML" % word
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            return "%s is no YAML: %s" % (word, " ".join(str(error).split()))
    return ""


# ---- the master is there ----

def wait_for_master(name: str) -> None:
    """Wait until the ROS master answers; call before ``rospy.init_node``, which sets parameters of the command line.

    It ends with a traceback where there is no master yet, as at the start of a computer. A signal ends the process.

    Args:
        name: The node's own name, for the master.

    Raises:
        WrongParameter: ROS_MASTER_URI is no address of a master.
    """
    uri = rosgraph.get_master_uri()
    if not is_master_uri(uri):
        raise WrongParameter("ROS_MASTER_URI is %.100r, and not like http://HOST:11311" % uri)
    told_at = float("-inf")
    while True:
        try:
            ask(uri, "getPid", "/" + name)
            return
        except NobodyThere as error:
            reason = str(error.__cause__)
        except Unanswered:
            reason = "it does not answer"
        if time.monotonic() - told_at > _MASTER_LOG_PERIOD_S:
            told_at = time.monotonic()
            print("WARNING: %s waits for the ROS master at %s: %s" % (name, uri, reason), file=sys.stderr, flush=True)
        time.sleep(_MASTER_LOOK_S)


def is_master_uri(uri: str) -> bool:
    """Return whether this can be the address of a ROS master."""
    try:
        parts = urlsplit(uri)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        return False


# ---- clients can reach this node ----

def refuse_unreachable_node() -> None:
    """Connect to this node at the address that the master gives to clients; call after ``rospy.init_node``.

    Raises:
        Unreachable: Its host name does not resolve, or nobody or somebody else answers there.
    """
    require_own_answer(rospy.get_node_uri(), rospy.get_name())
    address = tcpros_base.get_tcpros_server_address()
    try:
        socket.create_connection(address, _CONNECT_TIMEOUT_S).close()
    except (OSError, UnicodeError) as error:
        raise Unreachable("clients are told to connect to %s:%d for topics and services, but nothing answers there "
                          "(%s); %s" % (address[0], address[1], error, _settings())) from None


def require_own_answer(uri: str, name: str) -> None:
    """Raise Unreachable unless this process answers at an XML-RPC address that is given to others as this node's."""
    parts = urlsplit(uri)
    host, port = parts.hostname or "", parts.port or 0
    try:
        socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise Unreachable("clients are told to reach this node at %s, but %r has no address (%s); %s"
                          % (uri, host, error, _settings())) from None
    try:
        with ServerProxy(uri, transport=ShortTransport(_CONNECT_TIMEOUT_S)) as proxy:
            answer: Any = proxy.getPid(name)
    except (OSError, NobodyThere, XmlRpcError, http.client.HTTPException, ExpatError, ValueError) as error:
        raise Unreachable("clients are told to reach this node at %s, but it does not answer there (%s); %s"
                          % (uri, error.__cause__ or error, _settings())) from None
    if not isinstance(answer, (list, tuple)) or list(answer[::2]) != [1, os.getpid()]:
        raise Unreachable("clients are told to reach this node at %s, but another process answers there; %s"
                          % (uri, _settings()))


def _settings() -> str:
    """Return a text that names the setting which the address comes from."""
    for name in ("ROS_HOSTNAME", "ROS_IP"):
        if os.environ.get(name):
            return "the address comes from %s=%s" % (name, os.environ[name])
    return "the address is this computer's name; set ROS_IP or ROS_HOSTNAME"


# ---- time runs ----

def wait_for_time(ending: threading.Event, now: Callable[[], rospy.Time] = rospy.Time.now) -> None:
    """Wait while the ROS time is zero: ``/use_sim_time`` is set, and nobody publishes ``/clock``.

    Args:
        ending: Ends the wait.
        now: The ROS time.
    """
    told_at = float("-inf")
    while now().is_zero() and not ending.is_set():
        if time.monotonic() - told_at > _LOG_PERIOD_S:
            told_at = time.monotonic()
            _LOG.error("/use_sim_time is true and no /clock has come: the time stands at 0. The arm is neither powered "
                       "nor moved, and no service is offered, until time runs")
        ending.wait(_LOOK_S)


# ---- each topic is for one thing ----

def refuse_taken_topics(config: DriverConfig) -> None:
    """Refuse a parameter that names a topic which is used for something else; call before anything is published.

    Raises:
        WrongParameter: The message names parameter and topic.
    """
    controller = config.trajectory_controller_name
    known = _known_types()
    for parameter, name, kind in (
            ("joint_states_topic", config.joint_states_topic, "sensor_msgs/JointState"),
            ("trajectory_controller", controller + "/command", "trajectory_msgs/JointTrajectory"),
            ("trajectory_controller", controller + "/state", "control_msgs/JointTrajectoryControllerState")):
        topic = rospy.resolve_name(name)
        why = ("ROS itself uses it" if topic in _OF_ROS
               else "it has the type %s already" % known[topic] if known.get(topic, "*") not in ("*", kind) else "")
        if why:
            raise WrongParameter("parameter ~%s: the topic %s cannot be used for %s: %s"
                                 % (parameter, topic, kind, why))


def _known_types() -> Dict[str, str]:
    """Return the topics that the master knows, with their types."""
    try:
        return dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
    except (OSError, rosgraph.MasterException):
        return {}


def refuse_topics_used_twice() -> None:
    """Refuse to go on where this node uses one topic for two things; call when all are registered, before it moves.

    A parameter or a remapping can cause that: joint states that are published on ``~servo_j_command`` would be servo
    targets.

    Raises:
        WrongParameter: The message names the topics.
    """
    topics = registration.get_topic_manager()
    uses: Dict[str, int] = {}
    for implementations in (topics.pubs, topics.subs):
        for name, implementation in list(implementations.items()):
            uses[name] = uses.get(name, 0) + implementation.ref_count
    twice = sorted(name for name, count in uses.items() if count > 1)
    if twice:
        raise WrongParameter("the node would use %s for two things at once; look at ~joint_states_topic, "
                             "~trajectory_controller and the remappings" % ", ".join(twice))


# ---- a name that another process serves is left to it ----

def server_of(service: str) -> str:
    """Return the address at which another process serves this service, "" where nobody listens there.

    A master that does not answer counts as a server: what it knows must not be overwritten.
    """
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupService(service)
    except rosgraph.MasterError:
        return ""
    except (OSError, rosgraph.MasterException) as error:
        return "nobody knows whom (%s)" % error
    try:
        parts = urlsplit(uri)
        socket.create_connection((parts.hostname or "", parts.port or 0), _PROBE_TIMEOUT_S).close()
    except ConnectionRefusedError:
        return ""  # what a process that was killed has left with the master
    except (OSError, ValueError):  # an address that is none, too
        pass
    return uri
