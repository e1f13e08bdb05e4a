"""The caller of a service or publisher of a message: the name that the node gave, and the address of its connection.

ROS 1 knows no authentication: a node can call itself as it likes. The address is that of the TCP connection.
"""
import contextlib
from typing import Any, Dict, NamedTuple

import genpy
import rospy
from rospy.topics import get_topic_manager

from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.protocol.texts import printable

PEER = "jaka_driver_peer"
"""Entry of a service connection's header in which this driver records the ``Caller``."""
_LONGEST = 200
"""Most characters of what a caller says of itself: nobody makes a line of the log as long as he likes."""


class Caller(NamedTuple):
    """A node by its name, and where it is, as ``address:port``; "" for what is not known."""

    node: str
    host: str


def note_peer(header: Dict[str, Any], sock: Any) -> None:
    """Record whose a service connection is in its header, over whatever the client has written there."""
    header[PEER] = Caller(_text(header.get("callerid", "")), address_of(sock))


def caller_of_request(request: genpy.Message) -> Caller:
    """Return who sent a service request, as ``note_peer`` has recorded it; the node alone where it has not."""
    header = _header(request)
    caller = header.get(PEER)
    return caller if isinstance(caller, Caller) else Caller(_text(header.get("callerid", "")), "")


def caller_of_message(message: genpy.Message, topic: str) -> Caller:
    """Return who published a message; ``topic`` as it was subscribed to."""
    header = _header(message)
    host = ""
    with contextlib.suppress(Exception):  # rospy's own structures; they may change while they are looked through
        subscription = get_topic_manager().get_subscriber_impl(rospy.resolve_name(topic))
        for connection in subscription.connections:
            if connection.header is header:
                host = address_of(connection.socket)
    return Caller(_text(header.get("callerid", "")), host)


def address_of(sock: Any) -> str:
    """Return the address of a connection's peer, as text; "" where it is gone already."""
    with contextlib.suppress(OSError, AttributeError, TypeError, ValueError):
        return endpoint(*sock.getpeername()[:2])
    return ""


def _header(message: genpy.Message) -> Dict[str, Any]:
    return getattr(message, "_connection_header", None) or {}


def _text(value: Any) -> str:
    return str(printable(str(value)))[:_LONGEST]
