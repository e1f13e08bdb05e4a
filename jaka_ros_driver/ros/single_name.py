"""The checks of a node's name: a second node of one name refuses to start, a shutdown meant for another is not obeyed.

Where two nodes have the same name, the master keeps the newer one and asks the older one to shut down. Where both are
to drive the same controller, the older one still holds its lock at that time, so that the newer one ends, too, and the
arm is left without a driver.

The master asks at the older one's address. Where that node was killed, its port may be another node's by then, on
another master, too; rospy obeys.
"""
import functools
import http.client
import logging
import re
from typing import Any, Sequence, Tuple
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError
from xmlrpc.client import ServerProxy, Transport

import rosgraph
import rosgraph.names
import rospy
from rospy.impl import masterslave

from jaka_ros_driver.protocol.texts import printable
from jaka_ros_driver.ros.driver_lock import AlreadyDriven

_LOG = logging.getLogger(__name__)

_TIMEOUT_S = 1.0
_MASTERS_REASON = re.compile(r"\[(/[^\]]*)\] Reason: ")
"""The beginning of a master's reason for a shutdown: the name of the node that it means (rosmaster.master_api)."""
_NOT_ANSWERED = (OSError, XmlRpcError, http.client.HTTPException, ExpatError, ValueError, TypeError)


def resolved_node_name(default: str, argv: Sequence[str]) -> str:
    """Return the global name that ``rospy.init_node(default)`` will give this process.

    Args:
        default: The node's own name.
        argv: The command line, with what roslaunch adds to it: ``__name:=`` and ``__ns:=``; the environment's
            ``ROS_NAMESPACE`` counts where there is no ``__ns:=``.
    """
    name = rosgraph.names.load_mappings(argv).get("__name", default)
    resolved: str = rosgraph.names.resolve_name(name, rosgraph.names.get_ros_namespace(argv=argv) + "unnamed")
    return resolved


def refuse_second_node(name: str) -> None:
    """Raise AlreadyDriven where a node of this resolved name lives. Call it before ``rospy.init_node``.

    Without a master, or where the node is dead, it does nothing.
    """
    try:
        uri = _ask(rosgraph.get_master_uri(), "lookupNode", name, name)
        if not isinstance(uri, str) or not uri:
            return
        known_as = _ask(uri, "getName", name)
        if isinstance(known_as, str) and known_as != name:
            return  # the node of this name has died, and another node has its port now
        pid = _ask(uri, "getPid", name)
    except _NobodyThere:
        return
    raise AlreadyDriven(
        "the node %s runs already (%s at %s); a second one of its name would end it. End it first, or give this one "
        "another name or namespace" % (name, "pid %d" % pid if isinstance(pid, int) else "it does not answer", uri))


def refuse_shutdown_of_others() -> None:
    """Have this process refuse each shutdown that a master means for a node of another name; call before init_node."""
    obey = masterslave.ROSHandler.shutdown

    @functools.wraps(obey)
    def shutdown(self: Any, caller_id: Any, msg: Any = "") -> Tuple[int, str, int]:
        meant = _MASTERS_REASON.match(msg) if isinstance(msg, str) else None
        if meant is None or meant.group(1) == rospy.get_name():
            answer: Tuple[int, str, int] = obey(self, caller_id, msg)
            return answer
        _LOG.warning("a shutdown of %s was not obeyed: that node had the port of this one before", printable(msg))
        return 0, "this is %s" % rospy.get_name(), 0

    masterslave.ROSHandler.shutdown = shutdown  # type: ignore[method-assign]


def _ask(uri: str, method: str, *arguments: str) -> Any:
    """Return a master's or node's answer; None for an error or no answer. Raise _NobodyThere where nothing listens."""
    try:
        with ServerProxy(uri, transport=_ShortTransport()) as proxy:
            code, _, value = getattr(proxy, method)(*arguments)
        return value if code == 1 else None
    except _NOT_ANSWERED:
        return None


class _NobodyThere(Exception):
    """The error that nothing listens at the address."""


class _ShortTransport(Transport):
    """A transport with a time limit; the standard one waits for ever for a process that was stopped (SIGSTOP)."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _TIMEOUT_S
        if connection.sock is None:
            try:
                connection.connect()
            except OSError as error:
                raise _NobodyThere from error
        return connection
