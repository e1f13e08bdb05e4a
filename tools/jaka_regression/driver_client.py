"""The live driver, through rospy: any recorded call as its raw bytes, where the arm stands, a move to the start."""
import io
import threading
import time
from typing import Any, Dict, List, Optional, Sequence, Tuple

import roslib.message as untyped_roslib
import rospy as untyped_rospy

from jaka_bag.compare.run import Call
from jaka_bag.errors import BagError

from .command_player import Reply
from .command_schedule import STREAM_SERVICES

rospy: Any = untyped_rospy
roslib_message: Any = untyped_roslib
_SCALED_FIELDS = {"joint_move": ("mvvelo",), "linear_move": ("mvvelo",), "jog": ("mvvelo", "mvacc")}


class RawMessage(untyped_rospy.AnyMsg):
    """The bytes of a request or response, whatever their type."""

    def __init__(self, raw: bytes = b"") -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._buff = raw


class DriverNotThere(BagError):
    """A service or topic of the driver did not appear in time."""


def raw_service(service_type: str, md5sum: str) -> Any:
    """A service class that passes bytes through, for ``rospy.ServiceProxy``; the md5 is the recorded caller's."""
    return type("RawService", (), {"_type": service_type, "_md5sum": md5sum, "_request_class": RawMessage,
                                   "_response_class": RawMessage})


def outcome_of(service_type: str, raw: bytes) -> Reply:
    """Success and message of a response; a type that is not known, or has no such field, counts as success."""
    known = roslib_message.get_service_class(service_type)
    if known is None:
        return Reply(True, "")
    response = known._response_class()
    response.deserialize(raw)
    text = str(getattr(response, "message", ""))
    if hasattr(response, "ret"):
        return Reply(response.ret == 1, text)
    if hasattr(response, "success"):
        return Reply(bool(response.success), text)
    return Reply(not text.startswith("error:"), text)


def slowed(call: Call, share: float) -> bytes:
    """The request with its speeds at this share of the recorded ones.

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
    """The class of a type that this code needs itself; ``kind`` is message or service."""
    found = getattr(roslib_message, "get_%s_class" % kind)(name)
    if found is None:
        raise BagError("the %s type %s is not installed" % (kind, name))
    return found


class DriverClient:
    """A ROS node that calls services of live drivers, and leaves signals alone.

    Args:
        name: Of the node; a number is added.
        speed_share: Moves are asked for at this share of their recorded speeds.
    """

    def __init__(self, name: str, speed_share: float = 1.0) -> None:
        rospy.init_node(name, anonymous=True, disable_signals=True)
        self._speed_share = speed_share
        self._streams: Dict[str, Any] = {}
        self._lock = threading.Lock()

    def wait_for(self, services: List[str], timeout_s: float) -> None:
        """Wait until all services are offered.

        Raises:
            DriverNotThere: One was not in time.
        """
        end = time.monotonic() + timeout_s
        for service in services:
            try:
                rospy.wait_for_service(service, max(end - time.monotonic(), 0.1))
            except rospy.ROSException as error:
                raise DriverNotThere("%s is not offered" % service) from error

    def perform(self, call: Call) -> Reply:
        """Make one recorded call and wait for its answer."""
        try:
            request = RawMessage(slowed(call, self._speed_share))
            response = self._proxy(call).call(request)
            return outcome_of(call.service_type, response._buff)
        except (rospy.ServiceException, rospy.ROSException, BagError) as error:
            return Reply(False, str(error))

    def _proxy(self, call: Call) -> Any:
        service = raw_service(call.service_type, call.md5sum)
        if call.short_name not in STREAM_SERVICES:
            return rospy.ServiceProxy(call.service, service)
        with self._lock:
            proxy = self._streams.get(call.service + call.md5sum)
            if proxy is None:
                proxy = self._streams[call.service + call.md5sum] = rospy.ServiceProxy(call.service, service,
                                                                                       persistent=True)
            return proxy

    def joint_position(self, topic: str, timeout_s: float) -> Tuple[float, ...]:
        """Where an arm stands, rad.

        Raises:
            DriverNotThere: Nothing is published.
        """
        try:
            message = rospy.wait_for_message(topic, _installed("message", "sensor_msgs/JointState"), timeout_s)
        except rospy.ROSException as error:
            raise DriverNotThere("nothing is published on %s" % topic) from error
        return tuple(message.position)

    def move_to(self, node: str, joint_position: Sequence[float], speed: float, acceleration: float) -> None:
        """Move a driver's arm to joint positions, rad, with rad/s and rad/s2.

        Raises:
            BagError: The driver refused, or the move was not completed.
        """
        move = _installed("service", "jaka_msgs/Move")
        request = move._request_class(pose=joint_position, mvvelo=speed, mvacc=acceleration)
        try:
            response = rospy.ServiceProxy(node + "/joint_move", move)(request)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise BagError("the move to the start failed: %s" % error) from error
        if response.ret != 1:
            raise BagError("the move to the start was refused: %s" % response.message)

    def stop(self, node: str) -> Optional[str]:
        """Stop what a driver moves; None, or why it could not be asked to."""
        try:
            rospy.ServiceProxy(node + "/stop_move", _installed("service", "std_srvs/Empty"))()
        except (rospy.ServiceException, rospy.ROSException) as error:
            return str(error)
        return None

    def close(self) -> None:
        """Close the connections that are kept open, and end the node."""
        for proxy in self._streams.values():
            proxy.close()
        rospy.signal_shutdown("replay is over")
