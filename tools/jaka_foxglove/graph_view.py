"""Parameters and the graph of a ROS master as viewers see them, and what has changed in them; nothing is written."""
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from jaka_bag.live.graph import RemoteNode, master_uri

from .outbox import SocketFrame
from .protocol import Parameter, graph_update, parameter_of, parameters_of

_PERIOD_S = 1.0
"""Period, s, of the looks at the graph: each asks the master for all of it."""

Nodes = Dict[str, List[str]]
_OnChange = Callable[[Dict[str, Parameter], Optional[SocketFrame]], None]
"""A callback for changed parameters by name, and the changes of the graph as a frame, None where there are none."""


class GraphView:
    """A view of the ROS graph and its parameters, which asks the master only while a viewer watches.

    Args:
        node: Global name of the asking node.
    """

    def __init__(self, node: str) -> None:
        self._lock = threading.Lock()
        self._master = RemoteNode(master_uri(), node)
        self._has_parameters = False
        self._has_graph = False
        self._values: Optional[Dict[str, Parameter]] = None
        self._state: Optional[Tuple[Nodes, Nodes, Nodes]] = None
        self._due = 0.0

    def close(self) -> None:
        """Drop the connection."""
        self._master.close()

    def watch(self, parameters: bool, graph: bool) -> bool:
        """Set what ``look`` asks for; return True where that is more than before."""
        is_more = (parameters and not self._has_parameters) or (graph and not self._has_graph)
        self._has_parameters, self._has_graph = parameters, graph
        if is_more:
            self._due = 0.0
        return is_more

    def parameters(self, names: Sequence[str]) -> List[Parameter]:
        """Return parameters by name, all where no name is given; parameters that are not set are left out. Thread-safe.

        Each is returned once, under the first of the names that mean it.

        Raises:
            ConnectionLost: The master does not answer.
            ProtocolError: The master refuses.
        """
        with self._lock:
            tree = self._master.call("getParam", "/")
        if not names:
            return parameters_of("/", tree)
        paths: Dict[Tuple[str, ...], str] = {}
        for name in names:  # /a, /a/ and //a are one
            paths.setdefault(tuple(filter(None, name.split("/"))), name)
        return [parameter_of(name, value) for path, name in paths.items() for value in _below(tree, path)]

    def whole_graph(self) -> Optional[SocketFrame]:
        """Return the graph as it was last seen; None where it was not looked at."""
        state = self._state
        return None if state is None else graph_update(*state)

    def look(self, master: RemoteNode, tell: _OnChange) -> None:
        """Ask for what is watched, if it is time to, and report changes.

        Raises:
            ConnectionLost: The master does not answer.
            ProtocolError: It refuses.
        """
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + _PERIOD_S
        if self._has_parameters:
            tell(self._changed_parameters(master.call("getParam", "/")), None)
        else:
            self._values = None
        if self._has_graph:
            tell({}, self._changed_graph(master.call("getSystemState")))
        else:
            self._state = None

    def _changed_parameters(self, tree: Any) -> Dict[str, Parameter]:
        before, self._values = self._values, {one.name: one for one in parameters_of("/", tree)}
        if before is None:  # what there was when the watching began viewers ask for
            return {}
        changed = {name: one for name, one in self._values.items() if before.get(name) != one}
        changed.update((name, Parameter(name, None)) for name in before if name not in self._values)
        return changed

    def _changed_graph(self, state: Any) -> Optional[SocketFrame]:
        before = self._state or ({}, {}, {})
        published, subscribed, services = ({str(name): sorted(map(str, nodes)) for name, nodes in part}
                                           for part in state)
        self._state = published, subscribed, services
        changed = [{name: nodes for name, nodes in now.items() if then.get(name) != nodes}
                   for now, then in zip(self._state, before)]
        topics = sorted((set(before[0]) | set(before[1])) - set(published) - set(subscribed))
        # a topic that has lost only its publishers, or only its subscribers, is told with none
        changed[0].update((name, []) for name in before[0] if name not in published and name in subscribed)
        changed[1].update((name, []) for name in before[1] if name not in subscribed and name in published)
        gone = sorted(set(before[2]) - set(services))
        if not any(changed) and not topics and not gone:
            return None
        return graph_update(changed[0], changed[1], changed[2], topics, gone)


def _below(tree: Any, path: Sequence[str]) -> List[Any]:
    """Return the value at a path of the parameter server's tree as a list of one; empty where there is none."""
    for part in path:
        if not isinstance(tree, dict) or part not in tree:
            return []
        tree = tree[part]
    return [tree]
