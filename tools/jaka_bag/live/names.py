"""Names of the ROS graph without rospy: resolving, remapping, anonymous node names, this host's address.

After the ROS wiki pages "Names", "Remapping Arguments" and "ROS/EnvironmentVariables". ``BagError`` is raised where a
name is not legal.
"""
import os
import random
import re
import time
from dataclasses import dataclass, field
from typing import Dict, Iterable, List, Mapping, Tuple

from ..errors import BagError

_LEGAL_NAME = re.compile(r"^[~/A-Za-z][\w/]*$")


def split_remappings(words: Iterable[str]) -> Tuple[List[str], Dict[str, str]]:
    """Separate plain words from ``NAME:=VALUE`` words.

    Returns:
        The plain words in their order, and the values by name.
    """
    plain: List[str] = []
    remappings: Dict[str, str] = {}
    for word in words:
        name, sign, value = word.partition(":=")
        if sign and name and value:
            remappings[name] = value
        else:
            plain.append(word)
    return plain, remappings


def anonymous_name(base: str) -> str:
    """Return a node name that no other node has: base, process number, time and a random number."""
    return "%s_%d_%d_%04x" % (base, os.getpid(), time.time_ns() // 1000000, random.randrange(65536))


@dataclass(frozen=True)
class NodeNames:
    """The names of a node, and its name resolution.

    Attributes:
        node: Global name of the node.
        namespace: Global name of its namespace, ``/`` for the root.
        remappings: Global name to global name.
    """

    node: str
    namespace: str = "/"
    remappings: Mapping[str, str] = field(default_factory=dict)

    def resolve(self, name: str) -> str:
        """Resolve a name to a global one, after remapping."""
        if not _LEGAL_NAME.match(name):
            raise BagError("%r is not a legal ROS name" % name)
        resolved = _globalise(name, self.namespace, self.node)
        return self.remappings.get(resolved, resolved)


def _globalise(name: str, namespace: str, node: str) -> str:
    if name.startswith("~"):
        name = node + "/" + name[1:]
    elif not name.startswith("/"):
        name = namespace + "/" + name
    return "/" + "/".join(part for part in name.split("/") if part)


def node_names(default: str, remappings: Mapping[str, str], environment: Mapping[str, str]) -> NodeNames:
    """Derive a node's names from ``NAME:=VALUE`` words and the environment (``ROS_NAMESPACE``).

    Args:
        default: The node's name unless ``__name:=`` gives one.
        remappings: Words of the command line; those that begin with ``__`` are special, ``_x`` parameters are ignored.
        environment: The process environment.
    """
    namespace = _globalise(remappings.get("__ns", environment.get("ROS_NAMESPACE", "/")), "/", "/")
    base = remappings.get("__name", default)
    if not re.match(r"^[A-Za-z]\w*$", base.lstrip("/")):
        raise BagError("%r is not a legal node name" % base)
    node = _globalise(base.lstrip("/"), namespace, "/")
    topics: Dict[str, str] = {}
    plain = NodeNames(node, namespace)
    for name, value in remappings.items():
        if not name.startswith("_"):
            topics[plain.resolve(name)] = plain.resolve(value)
    return NodeNames(node, namespace, topics)


def host_address(environment: Mapping[str, str]) -> Tuple[str, str]:
    """Return this host's name as other nodes reach it, and the address to listen on.

    Returns:
        Host for URIs (``ROS_HOSTNAME``, else ``ROS_IP``, else this host's name), bind address: the loopback address
        where the host is local, else all interfaces.
    """
    host = environment.get("ROS_HOSTNAME") or environment.get("ROS_IP") or os.uname().nodename
    local = host == "localhost" or host.startswith("127.")
    return host, "127.0.0.1" if local else ""
