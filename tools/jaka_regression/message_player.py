"""The publisher of recorded messages to a live driver: each with its stamps moved to now, goals until their result."""
import functools
import threading
import time
from typing import Any, Callable, Dict, List, Sequence, Tuple

import genpy
import rospy
from actionlib_msgs.msg import GoalStatus
from genpy import dynamic
from std_msgs.msg import Header

from jaka_bag.errors import BagError
from jaka_bag.messages.connection import Connection
from jaka_bag.units import NS_PER_S

from .attended import attended
from .command_player import ServiceReply, longest_wait
from .driver_client import DriverNotThere
from .driver_inputs import SentMessage

_QUEUE = 1000
"""Messages that wait for a slow subscriber: a replay must not lose one."""
_POLL_S = 0.02
"""Longest wait, s, before the next look at what has changed: the delay of a stop."""
_STRING_LENGTH_BYTES = 4
_HEADER_BYTES = 12 + _STRING_LENGTH_BYTES


class MessagePlayer:
    """A ROS node's part that sends recorded messages, and awaits the results of goals.

    Args:
        why_end: Returns why not to wait any longer; None to wait.
    """

    def __init__(self, why_end: Callable[[], Any]) -> None:
        self._why_end = why_end
        self._publishers: Dict[Tuple[str, str], Any] = {}
        self._classes: Dict[Tuple[str, str], Any] = {}
        self._results: Dict[Tuple[str, str], ServiceReply] = {}
        self._subscribers: List[Any] = []
        self._stamps: Dict[str, Tuple[Any, Any]] = {}
        self._changed = threading.Condition()

    def advertise(self, messages: Sequence[SentMessage], timeout_s: float) -> None:
        """Wait until each topic has a driver that listens, and listen for the results of goals.

        Raises:
            BagError: A definition in the log is not understood, or does not have the md5 that stands beside it.
            DriverNotThere: Nobody listened in time.
            ReplayStopped: Cancelled meanwhile.
        """
        connections = {(one.connection.topic, one.connection.md5sum): one.connection for one in messages}
        for key, connection in connections.items():
            self._classes[key] = _class_of(connection)
            self._publishers[key] = rospy.Publisher(connection.topic, self._classes[key], queue_size=_QUEUE,
                                                    tcp_nodelay=True)
        for topic in sorted({one.connection.topic for one in messages if one.goal_id and one.duration}):
            action = topic[:-len("goal")]
            self._subscribers.append(rospy.Subscriber(action + "result", rospy.AnyMsg,
                                                      functools.partial(self._take_result, action), tcp_nodelay=True))
        end = time.monotonic() + timeout_s
        waiting = [(topic, publisher.get_num_connections) for (topic, _), publisher in self._publishers.items()]
        waiting += [(one.name, one.get_num_connections) for one in self._subscribers]
        for topic, count in waiting:
            attended(functools.partial(_wait_for_peer, topic, count, end), self._why_end)

    def perform(self, message: SentMessage) -> ServiceReply:
        """Send one message; of a goal that had a result in the log, wait for that."""
        key = (message.connection.topic, message.connection.md5sum)
        made = self._classes[key]()
        made.deserialize(message.data)
        now = rospy.Time.now()
        offset = rospy.Duration.from_sec(now.to_sec() - message.recorded_ns / NS_PER_S)
        self.move_stamps(message.connection.topic, made, offset)
        self._publishers[key].publish(made)
        if not (message.goal_id and message.duration):
            return ServiceReply(True, "")
        wanted = (message.connection.topic[:-len("goal")], message.goal_id)
        end = time.monotonic() + longest_wait(message)
        with self._changed:
            while wanted not in self._results and self._why_end() is None and time.monotonic() < end:
                self._changed.wait(_POLL_S)
            return self._results.get(wanted, ServiceReply(False, "no result came"))

    def move_stamps(self, topic: str, message: Any, offset: Any) -> None:
        """Move every stamp of a message by a duration, or by more: on its topic none goes back that did not before.

        Messages that are late come closer together than in the log, and each would be as old as it was there.
        """
        stamp = message.header.stamp if hasattr(message, "header") else genpy.Time()
        if not stamp.is_zero():
            before, told = self._stamps.get(topic, (stamp, stamp + offset))
            if before <= stamp and stamp + offset < told:
                offset = told - stamp
            self._stamps[topic] = stamp, stamp + offset
        _move_stamps(message, offset)

    def _take_result(self, action: str, message: Any) -> None:
        """Take the beginning of any ActionResult: a header and the goal's status."""
        header, status = Header(), GoalStatus()
        header.deserialize(message._buff)
        status.deserialize(message._buff[_HEADER_BYTES + len(header.frame_id.encode()):])
        with self._changed:
            self._results[action, status.goal_id.id] = ServiceReply(status.status == GoalStatus.SUCCEEDED, status.text)
            self._changed.notify_all()

    def close(self) -> None:
        """Take the topics back."""
        for one in [*self._publishers.values(), *self._subscribers]:
            one.unregister()


def _class_of(connection: Connection) -> Any:
    """Return the class of a log's messages, made from the definition in the log: it need not be installed."""
    try:
        found = dynamic.generate_dynamic(connection.datatype, connection.definition)[connection.datatype]
    except Exception as error:  # whatever genpy raises at a definition that it does not understand
        raise BagError("%s: the definition of %s in the log is not understood: %s" % (
            connection.topic, connection.datatype, error)) from error
    if found._md5sum != connection.md5sum:
        raise BagError("%s: the definition of %s in the log does not have its md5" % (
            connection.topic, connection.datatype))
    return found


def _wait_for_peer(topic: str, count: Callable[[], int], end: float) -> None:
    while not count():
        if time.monotonic() > end:
            raise DriverNotThere("no driver has the topic %s" % topic)
        time.sleep(_POLL_S)


def _move_stamps(message: Any, offset: Any) -> None:
    """Move every stamp that is not 0, at any depth but in arrays: 0 means "now", and durations are no stamps."""
    for name in message.__slots__:
        value = getattr(message, name)
        if isinstance(value, genpy.Time):
            if name == "stamp" and not value.is_zero():
                setattr(message, name, value + offset)
        elif hasattr(value, "__slots__") and hasattr(value, "serialize"):
            _move_stamps(value, offset)
