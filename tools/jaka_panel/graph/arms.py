"""The drivers that run on this ROS graph, and what each of them offers."""
import logging
from typing import Any, Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Tuple

import rosgraph

from .registration import register_again_at_a_new_master

_LOG = logging.getLogger(__name__)
_MARK, _MARK_TYPE = "/robot_states", "jaka_msgs/RobotMsg"
"""The topic by which a driver is known."""
_STATE_TYPE = "control_msgs/JointTrajectoryControllerState"
_GOAL = "/follow_joint_trajectory/goal"
_DESCRIPTION = "robot_description"
_JOG_DEFAULTS = {"joint": ("jog_max_joint_speed", 0.5), "linear": ("jog_max_linear_speed", 0.25),
                 "angular": ("jog_max_angular_speed", 0.5)}
"""The driver's own, docs/parameters.md."""


class Driver(NamedTuple):
    """A driver as the ROS master knows it.

    Attributes:
        node: Its name, which is the id of its arm.
        topics: Topics that it publishes, with their types.
        services: Services that it offers.
        action: Name of its trajectory action, without ``/goal``; None where it has none.
        parameters: Its private parameters.
        description: URDF in its namespace or one above it; empty where there is none.
        simulator_port: The simulated controller's operator port on this computer; 0 where none is known.
    """

    node: str
    topics: Tuple[Tuple[str, str], ...]
    services: FrozenSet[str]
    action: Optional[str]
    parameters: Mapping[str, Any]
    description: str
    simulator_port: int

    @property
    def namespace(self) -> str:
        """The node's namespace, with a slash at its end."""
        return self.node.rpartition("/")[0] + "/"

    def parameter(self, name: str, default: Any) -> Any:
        """Return a private parameter; the default where it is not set or of another type."""
        value = self.parameters.get(name, default)
        return value if isinstance(value, type(default)) or (
            isinstance(default, float) and type(value) is int) else default

    @property
    def interface(self) -> str:
        """``documented``, ``vendor`` or ``vendor_2025``."""
        return str(self.parameter("interface", "documented"))

    @property
    def prefix(self) -> str:
        """The prefix of the names of frames and joints."""
        return str(self.parameter("frame_prefix", ""))

    @property
    def jog_limits(self) -> Dict[str, float]:
        """Highest speeds of its velocity jog: ``joint`` rad/s, ``linear`` m/s, ``angular`` rad/s."""
        return {key: float(self.parameter(name, default)) for key, (name, default) in _JOG_DEFAULTS.items()}

    def topic_of_type(self, kind: str) -> Optional[str]:
        """Return a topic of this type that the driver publishes."""
        return next((name for name, its_kind in self.topics if its_kind == kind), None)

    @property
    def state_topic(self) -> Optional[str]:
        """The topic on which the driver publishes the desired joints."""
        return self.topic_of_type(_STATE_TYPE)

    def publishes(self, name: str) -> bool:
        """Return whether the driver publishes this private topic."""
        return any(topic == "%s/%s" % (self.node, name) for topic, _ in self.topics)

    def offers(self, name: str) -> bool:
        """Return whether the driver offers this private service."""
        return "%s/%s" % (self.node, name) in self.services


class ArmFinder:
    """A search for drivers, by the ROS master."""

    def __init__(self, caller: str) -> None:
        self._master = rosgraph.Master(caller)

    def find(self) -> Optional[Dict[str, Driver]]:
        """Return all drivers by the names of their nodes; None while the master does not answer."""
        try:
            register_again_at_a_new_master(self._master)
            publishers, subscribers, services = self._master.getSystemState()
            types = dict(self._master.getTopicTypes())
            nodes = sorted({topic[:-len(_MARK)] for topic, names in publishers
                            if topic.endswith(_MARK) and types.get(topic) == _MARK_TYPE and names})
            return {node: self._driver(node, publishers, subscribers, services, types) for node in nodes}
        except (rosgraph.MasterException, OSError) as error:
            _LOG.debug("the ROS master does not answer: %s", error)
            return None

    def _driver(self, node: str, publishers: List[Any], subscribers: List[Any], services: List[Any],
                types: Mapping[str, str]) -> Driver:
        topics = tuple(sorted((topic, types.get(topic, "*")) for topic, names in publishers if node in names))
        goals = sorted(topic for topic, names in subscribers if topic.endswith(_GOAL) and node in names)
        parameters = self._parameter(node)
        port = self._parameter(node.rpartition("/")[0] + "/jaka_sim/panel_port")
        return Driver(node, topics, frozenset(name for name, names in services if node in names),
                      goals[0][:-len("/goal")] if goals else None,
                      parameters if isinstance(parameters, dict) else {}, self._description(node),
                      port if type(port) is int and 0 < port < 65536 else 0)

    def _description(self, node: str) -> str:
        words = [word for word in node.split("/")[:-1] if word]
        for count in range(len(words), -1, -1):
            text = self._parameter("/" + "/".join([*words[:count], _DESCRIPTION]))
            if isinstance(text, str) and text.strip():
                return text
        return ""

    def _parameter(self, name: str) -> Any:
        try:
            return self._master.getParam(name)
        except rosgraph.MasterError:
            return None  # not set
