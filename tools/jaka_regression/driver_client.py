"""The live driver, through rospy: any recorded call as its raw bytes, where the arm stands, a move to the start."""
import contextlib
import functools
import io
import threading
import time
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple, TypeVar

import numpy as np
import rospy
from roslib import message as roslib_message

from jaka_bag.compare.runs.run import Call
from jaka_bag.driver_interface import DIAGNOSTICS_TYPE
from jaka_bag.errors import BagError
from jaka_bag.interrupts import Flag
from jaka_bag.operations.tool_poses import rotation_vectors
from jaka_bag.units import mm_to_m

from .attended import ReplayStopped, attended
from .command_player import ServiceReply
from .command_schedule import STREAM_SERVICES
from .preconditions import TOLD, ToolPlace, conditions_in
from .ros_node import become_node

_STOP_S = 5.0
"""A driver answers stop_move in some ms; one that hangs never does."""
_SCALED_FIELDS = {"joint_move": ("mvvelo",), "linear_move": ("mvvelo",), "jog": ("mvvelo", "mvacc")}

T = TypeVar("T")


class RawMessage(rospy.AnyMsg):
    """The bytes of a request or response, whatever their type."""

    def __init__(self, raw: bytes = b"") -> None:
        super().__init__()
        self._buff = raw


class DriverNotThere(BagError):
    """A service or topic of the driver did not appear in time."""


def raw_service(service_type: str, md5sum: str) -> Any:
    """Make a service class that passes bytes through, for ``rospy.ServiceProxy``; the md5 is the recorded caller's."""
    return type("RawService", (), {"_type": service_type, "_md5sum": md5sum, "_request_class": RawMessage,
                                   "_response_class": RawMessage})


def outcome_of(service_type: str, raw: bytes) -> ServiceReply:
    """Parse success and message of a response; one of an unknown type, or without such a field, counts as success."""
    known = roslib_message.get_service_class(service_type)
    if known is None:
        return ServiceReply(True, "")
    response = known._response_class()
    response.deserialize(raw)
    text = str(getattr(response, "message", ""))
    if hasattr(response, "ret"):
        return ServiceReply(response.ret == 1, text)
    if hasattr(response, "success"):
        return ServiceReply(bool(response.success), text)
    return ServiceReply(not text.startswith("error:"), text)


def slowed(call: Call, share: float) -> bytes:
    """Return the request with its speeds at this share of the recorded ones.

    Raises:
        BagError: The type is not known here, or not the recorded one.
    """
    fields = _SCALED_FIELDS.get(call.short_name)
    if fields is None or share == 1.0:
        return call.request
    known = roslib_message.get_service_class(call.service_type)
    if known is None or known._md5sum != call.md5sum:
        raise BagError("%s: the type %s of the log is not known here, so it cannot be slowed down"
                       % (call.words, call.service_type))
    request = known._request_class()
    request.deserialize(call.request)
    for name in fields:
        setattr(request, name, share * getattr(request, name))
    buffer = io.BytesIO()
    request.serialize(buffer)
    return buffer.getvalue()


def _installed(kind: str, name: str) -> Any:
    """Return the class of a type that this code needs itself; ``kind`` is message or service."""
    found = getattr(roslib_message, "get_%s_class" % kind)(name)
    if found is None:
        raise BagError("the %s type %s is not installed" % (kind, name))
    return found


def _six_numbers(message: Any) -> Tuple[float, ...]:
    """Return the pose of a message of ``tool_position``, as logs have it (``operations.tool_poses``)."""
    if hasattr(message, "twist"):
        linear, angular = message.twist.linear, message.twist.angular
        return (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
    position, turn = message.pose.position, message.pose.orientation
    vector = rotation_vectors(np.array([[turn.x, turn.y, turn.z, turn.w]]))[0]
    return (*[mm_to_m(value) for value in (position.x, position.y, position.z)], *vector.tolist())


class DriverClient:
    """A ROS node that calls services of live drivers, and leaves signals alone.

    Args:
        name: Name of the node; a number is added.
        cancelled: Set to have what waits raise ``ReplayStopped`` at once.
        speed_share: Moves are asked for at this share of their recorded speeds.
    """

    def __init__(self, name: str, cancelled: Flag, speed_share: float = 1.0) -> None:
        become_node(name, anonymous=True)
        self._cancelled = cancelled
        self._speed_share = speed_share
        self._streams: Dict[str, Any] = {}
        self._changed = threading.Condition()
        self._under_way = 0
        self._is_over = False

    def unless_cancelled(self, work: Callable[[], T]) -> T:
        """Run ``work`` and return its value; raise ``ReplayStopped`` as soon as somebody cancels."""
        return attended(work, lambda: "interrupted" if self._cancelled.is_set() else None)

    def wait_for(self, services: List[str], timeout_s: float) -> None:
        """Wait until all services are offered.

        Raises:
            DriverNotThere: One was not in time.
            ReplayStopped: Cancelled meanwhile.
        """
        end = time.monotonic() + timeout_s
        for service in services:
            try:
                self.unless_cancelled(functools.partial(rospy.wait_for_service, service,
                                                        max(end - time.monotonic(), 0.1)))
            except rospy.ROSException as error:
                raise DriverNotThere("%s is not offered" % service) from error

    @contextlib.contextmanager
    def _call(self) -> Iterator[None]:
        """Guard a call that may move the arm; raise ``ReplayStopped`` if the drivers have been told to stop."""
        with self._changed:
            if self._is_over:
                raise ReplayStopped("interrupted")
            self._under_way += 1
        try:
            yield
        finally:
            with self._changed:
                self._under_way -= 1
                self._changed.notify_all()

    def perform(self, call: Call) -> ServiceReply:
        """Make one recorded call and wait for its answer."""
        try:
            request = RawMessage(slowed(call, self._speed_share))
            with self._call():
                response = self._proxy(call).call(request)
            return outcome_of(call.service_type, response._buff)
        except (rospy.ServiceException, rospy.ROSException, BagError) as error:
            return ServiceReply(False, str(error))

    def _proxy(self, call: Call) -> Any:
        service = raw_service(call.service_type, call.md5sum)
        if call.short_name not in STREAM_SERVICES:
            return rospy.ServiceProxy(call.service, service)
        with self._changed:
            proxy = self._streams.get(call.service + call.md5sum)
            if proxy is None:
                proxy = self._streams[call.service + call.md5sum] = rospy.ServiceProxy(call.service, service,
                                                                                       persistent=True)
            return proxy

    def joint_position(self, topic: str, timeout_s: float) -> Tuple[float, ...]:
        """Wait for the joint positions of an arm, rad.

        Raises:
            DriverNotThere: Nothing is published.
            ReplayStopped: Cancelled meanwhile.
        """
        kind = _installed("message", "sensor_msgs/JointState")
        try:
            message = self.unless_cancelled(lambda: rospy.wait_for_message(topic, kind, timeout_s))
        except rospy.ROSException as error:
            raise DriverNotThere("nothing is published on %s" % topic) from error
        return tuple(message.position)

    def conditions(self, node: str, timeout_s: float) -> Dict[str, str]:
        """Return what a driver's diagnostics tell of the conditions of a call; nothing where none come in time.

        Raises:
            ReplayStopped: Cancelled meanwhile.
        """
        kind = _installed("message", DIAGNOSTICS_TYPE)
        end = time.monotonic() + timeout_s
        found: Dict[str, str] = {}
        while len(found) < len(TOLD) and time.monotonic() < end:
            try:
                message = self.unless_cancelled(lambda: rospy.wait_for_message(
                    "/diagnostics", kind, max(0.1, end - time.monotonic())))
            except rospy.ROSException:
                return found
            found.update(conditions_in([(status.name, {pair.key: pair.value for pair in status.values})
                                        for status in message.status], node))
        return found

    def place(self, joint_topic: str, tool_topic: str, timeout_s: float) -> ToolPlace:
        """Wait for the tool's pose and the joints that put it there.

        Raises:
            DriverNotThere: Nothing is published.
            ReplayStopped: Cancelled meanwhile.
        """
        try:
            message = self.unless_cancelled(lambda: rospy.wait_for_message(tool_topic, rospy.AnyMsg, timeout_s))
        except rospy.ROSException as error:
            raise DriverNotThere("nothing is published on %s" % tool_topic) from error
        pose = _installed("message", message._connection_header["type"])()
        pose.deserialize(message._buff)
        return ToolPlace(self.joint_position(joint_topic, timeout_s), _six_numbers(pose), (pose.header.frame_id,))

    def move_to(self, node: str, joint_position: Sequence[float], speed: float, acceleration: float) -> None:
        """Move a driver's arm to joint positions, rad, with rad/s and rad/s2.

        Raises:
            BagError: The driver refused, or the move was not completed.
            ReplayStopped: Cancelled meanwhile, or the call broke off: the arm may be moving.
        """
        move = _installed("service", "jaka_msgs/Move")
        request = move._request_class(pose=joint_position, mvvelo=speed, mvacc=acceleration)

        def ask() -> Any:
            with self._call():
                return rospy.ServiceProxy(node + "/joint_move", move)(request)

        try:
            response = self.unless_cancelled(ask)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise ReplayStopped("the move to the start failed: %s" % error) from error
        if response.ret != 1:
            raise BagError("the move to the start was refused: %s" % response.message)

    def stop(self, node: str) -> Optional[str]:
        """Stop what a driver moves; None, or why it could not be asked to."""
        end = time.monotonic() + _STOP_S
        stop = rospy.ServiceProxy(node + "/stop_move", _installed("service", "std_srvs/Empty"))
        try:
            attended(stop, lambda: "no answer for %g s" % _STOP_S if time.monotonic() > end else None)
        except (rospy.ServiceException, rospy.ROSException, ReplayStopped) as error:
            return str(error)
        return None

    def stop_all(self, nodes: Sequence[str]) -> List[str]:
        """Stop what drivers move, and let this client make no further call; which could not be asked to, and why.

        A running call may reach its driver after the stop. So all are stopped a second time when it has ended.
        """
        with self._changed:
            self._is_over = True
            again = self._under_way > 0
        problems = self._stop_each(nodes)
        if again and not problems:
            with self._changed:
                self._changed.wait_for(lambda: self._under_way == 0, _STOP_S)
            problems = self._stop_each(nodes)
        return problems

    def _stop_each(self, nodes: Sequence[str]) -> List[str]:
        found = [(node, self.stop(node)) for node in nodes]
        return ["%s could not be stopped: %s" % (node, why) for node, why in found if why is not None]

    def close(self) -> None:
        """Close the connections that are kept open, and end the node."""
        for proxy in self._streams.values():
            proxy.close()
        rospy.signal_shutdown("replay is over")
