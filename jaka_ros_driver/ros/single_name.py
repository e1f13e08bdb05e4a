"""The checks of a node's name: a second node of one name refuses to start, a shutdown meant for another is not obeyed.

Where two nodes have the same name, the master keeps the newer one and asks the older one to shut down. Where both are
to drive the same controller, the older one still holds its lock at that time, so that the newer one ends, too, and the
arm is left without a driver.

The master asks at the older one's address. Where that node was killed, its port may be another node's by then, on
another master, too; rospy obeys.
"""
import functools
import logging
import re
from typing import Any, Sequence, Tuple

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
    program by then: one that answers otherwise than a node, or by another name, is not this node. One that does not
    answer at all is taken for it: a process that was stopped (SIGSTOP) goes on later.
    """
    try:
        uri = ask(rosgraph.get_master_uri(), "lookupNode", name, name)
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
        state = "it does not answer"
    raise AlreadyDriven("the node %s runs already (%s at %s); a second one of its name would end it. End it first, or "
                        "give this one another name or namespace" % (name, state, uri))


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
