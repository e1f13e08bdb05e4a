"""The numbers of messages that publishers report as sent to us: ``getBusInfo`` and ``getBusStats`` of the slave API.

The two client libraries answer differently (ROS wiki "ROS/Slave_API"; rospy ``topics.py``, roscpp ``publication.cpp``):
rospy gives ``[topic, bytes, [[id, bytes, messages, connected], ...]]``, within (code, message, value);
roscpp gives ``[topic, [[id, bytes, payload bytes, messages, 0], ...]]``, without it in older releases.
"""
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, Dict, Iterable, Tuple

from ..errors import ConnectionLost, ProtocolError
from .graph import RemoteNode

_ASK_TIMEOUT_S = 1.0
"""Longest wait, s, for one publisher's counts: one that hangs must not hold up the end of a recording."""


def sent_messages(subscriber: str, bus_info: Any, bus_stats: Any) -> Dict[str, int]:
    """Count messages sent to ``subscriber``, by topic, over its current connections.

    Args:
        subscriber: Global name of the subscribing node.
        bus_info: Value of ``getBusInfo``.
        bus_stats: Whole reply to ``getBusStats``.

    Raises:
        ProtocolError: The reply has another shape than those of rospy and roscpp.
    """
    sent: Dict[str, int] = {}
    try:
        topics = {int(entry[0]): str(entry[4]) for entry in bus_info
                  if len(entry) >= 5 and entry[1] == subscriber and entry[2] == "o"}  # by the connection's number
        has_status = len(bus_stats) == 3 and isinstance(bus_stats[0], int)
        for entry in (bus_stats[2] if has_status else bus_stats)[0]:
            is_roscpp = isinstance(entry[1], (list, tuple))
            for connection in entry[1] if is_roscpp else entry[2]:
                topic = topics.get(int(connection[0]))
                if topic is not None:
                    sent[topic] = sent.get(topic, 0) + int(connection[3 if is_roscpp else 2])
    except (TypeError, ValueError, LookupError, ArithmeticError) as error:
        raise ProtocolError("bus statistics are not understood: %s" % error) from error
    return sent


def ask_publisher(uri: str, subscriber: str) -> Dict[str, int]:
    """Ask one publishing node for the number of messages that it sent us, by topic.

    Raises:
        ConnectionLost: The node does not answer.
        ProtocolError: Its answer is not understood.
    """
    with RemoteNode(uri, subscriber, _ASK_TIMEOUT_S) as node:
        return sent_messages(subscriber, node.call("getBusInfo"), node.raw_call("getBusStats"))


def ask_publishers(uris: Iterable[str], subscriber: str, timeout_s: float) -> Dict[Tuple[str, str], int]:
    """Return messages sent to us by (publisher's URI, topic), without publishers that do not answer in time."""
    pool = ThreadPoolExecutor(16, "bus-stats")
    asked = {pool.submit(ask_publisher, uri, subscriber): uri for uri in uris}
    done, _ = wait(asked, timeout_s)
    pool.shutdown(wait=False)
    result: Dict[Tuple[str, str], int] = {}
    for future in done:
        try:
            for topic, count in future.result().items():
                result[asked[future], topic] = count
        except (ConnectionLost, ProtocolError):
            pass  # a publisher that has gone, or another client library: no number
    return result
