"""The checks of a node's name: a second node of one name refuses to start, a shutdown meant for another is not obeyed.

Where two nodes have the same name, the master keeps the newer one and asks the older one to shut down. Where both are
to drive the same controller, the older one still holds its lock at that time, so that the newer one ends, too, and the
arm is left without a driver.

The master asks at the older one's address. Where that node was killed, its port may be another node's by then, on
another master, too; rospy obeys.

A master also keeps the name of each node of rospy that has ended in good order, with its old address: rospy asks for a
parameter with the lines of its log, and does not take that question back.
"""
import functools
import logging
import re
from typing import Any, Iterator, Sequence, Tuple

import rosgraph
import rosgraph.names
import rospy
from rospy.impl import masterslave

from jaka_ros_driver.protocol.texts import printable
from jaka_ros_driver.ros.driver_lock import AlreadyDriven
from jaka_ros_driver.ros.short_calls import NobodyThere, Unanswered, ask

_LOG = logging.getLogger(__name__)

_MASTERS_REASON = re.compile(r"\[(/[^\]]*)\] Reason: ")
"""The beginning of a master's reason for a shutdown: the name of the node that it means (rosmaster.master_api)."""


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

    Without a master, or where the node is dead, it does nothing. What listens at a dead node's address may be another
    process by then: one that answers otherwise than a node, or by another name, is not this node. One that does not
    answer at all is taken for it where the address of its services is as silent: a process that was stopped (SIGSTOP)
    goes on later.
    """
    master = rosgraph.get_master_uri()
    try:
        uri = ask(master, "lookupNode", name, name)
    except (NobodyThere, Unanswered):
        return
    if not isinstance(uri, str) or not uri:
        return
    try:
        pid = ask(uri, "getPid", name)  # the one question that roscpp and rospy both answer
        if not isinstance(pid, int) or ask(uri, "getName", name) not in (name, None):
            return
        state = "pid %d" % pid
    except NobodyThere:
        return
    except Unanswered:
        if not _is_silent_as_a_whole(master, name):
            return
        state = "it does not answer"
    raise AlreadyDriven("the node %s runs already (%s at %s); a second one of its name would end it. End it first, or "
                        "give this one another name or namespace" % (name, state, uri))


def _is_silent_as_a_whole(master: str, name: str) -> bool:
    """Return whether something listens and says nothing where the master sends callers of this node's services.

    Every living node has services, those of its log at least; it ends a call that is none of ROS's.
    """
    try:
        for uri in _service_uris(master, name):
            try:
                ask(uri.replace("rosrpc:", "http:", 1), "getPid", name)
            except NobodyThere as error:
                if not isinstance(error.__cause__, ConnectionRefusedError):
                    return True  # the queue of connections of a stopped process is full; or nobody knows
    except (NobodyThere, Unanswered):
        return True
    return False


def _service_uris(master: str, name: str) -> Iterator[str]:
    """Yield each address of services that the master has of a node; mostly there is one."""
    seen = set()
    state = ask(master, "getSystemState", name)
    for service, providers in state[2] if isinstance(state, list) and len(state) == 3 else ():
        uri = ask(master, "lookupService", name, service) if name in providers else None
        if isinstance(uri, str) and uri not in seen:
            seen.add(uri)
            yield uri


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
