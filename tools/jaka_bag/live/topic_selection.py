"""The selection of topics for a recording."""
from dataclasses import dataclass
from typing import Callable, Optional, Pattern, Tuple

from ..messages.connection import Connection
from .names import NodeNames

_DRIVER_TOPICS = (
    "tool_position", "joint_position", "robot_states", "service_calls", "io_states", "motion_state", "program/state",
    "speed_scaling_factor", "robot_status", "joint_currents", "joint_temperatures", "simulated", "jog_joints",
    "jog_twist", "servo_j_command", "servo_p_command", "move_path/goal", "move_path/cancel", "recover/goal",
    "recover/cancel", "workspace_markers")
_NAMESPACE_TOPICS = ("joint_states", "tf", "tf_static", "diagnostics")
_GLOBAL_TOPICS = ("/tf", "/tf_static", "/diagnostics")


@dataclass(frozen=True)
class TopicSelection:
    """The topics wanted.

    Attributes:
        names: Global names, wanted whether or not anybody publishes them yet.
        everything: Every topic that is published.
        patterns: Published topics whose whole name one of these matches.
        exclude: Topics whose whole name this matches are never wanted.
        node: Global name of a node: every topic that it subscribes to.
        interface_of: Global name of a node: every topic that it publishes or subscribes to, its log left out.
    """

    names: Tuple[str, ...] = ()
    everything: bool = False
    patterns: Tuple[Pattern[str], ...] = ()
    exclude: Optional[Pattern[str]] = None
    node: Optional[str] = None
    interface_of: Optional[str] = None

    def is_excluded(self, topic: str) -> bool:
        """Return whether a topic is never wanted."""
        return self.exclude is not None and self.exclude.fullmatch(topic) is not None

    def wants(self, topic: str) -> bool:
        """Return whether a topic is wanted by its name."""
        if self.is_excluded(topic):
            return False
        return self.everything or topic in self.names or any(p.fullmatch(topic) for p in self.patterns)


def state_log_selection(names: NodeNames, exclude: Optional[Pattern[str]] = None) -> TopicSelection:
    """Return the selection of one driver's whole interface: what it publishes, and what others send to it.

    The topics that are named are there from the first message on; those with names that depend on the driver's
    parameters, as its trajectory controller's, from the moment at which they are found.

    Args:
        names: Names of the node that records; the driver is ``jaka_driver`` in its namespace.
        exclude: Topics whose whole name this matches are left out.
    """
    return TopicSelection(state_log_topics(names), exclude=exclude, interface_of=names.resolve("jaka_driver"))


def state_log_topics(names: NodeNames) -> Tuple[str, ...]:
    """Return the topics of one driver that have fixed names, and those that belong to it in its namespace.

    ``tf``, ``tf_static`` and ``diagnostics`` are published under global names by most nodes: those are among the topics
    too, and ``is_of_namespace`` decides whose messages on them belong to the log.
    """
    topics = [names.resolve("jaka_driver/" + name) for name in _DRIVER_TOPICS]
    topics.extend(names.resolve(name) for name in _NAMESPACE_TOPICS)
    topics.extend(name for name in _GLOBAL_TOPICS if name not in topics)
    return tuple(topics)


def is_of_namespace(namespace: str) -> Callable[[Connection], bool]:
    """Return a test whether a stream comes from a node of the namespace, or lies on a topic of it."""
    prefix = namespace.rstrip("/") + "/"

    def accept(connection: Connection) -> bool:
        return connection.topic.startswith(prefix) or (connection.callerid or "").startswith(prefix)
    return accept
