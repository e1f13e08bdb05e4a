"""Publishes a record of every service call: request, caller, response and duration."""
import io
import time
from typing import Any, NamedTuple

import rospy

from jaka_msgs.msg import ServiceCall
from jaka_ros_driver.ros.services.service_handlers import Outcome

_QUEUE = 200


class Call(NamedTuple):
    """A call as it arrived: ``stamp``, ROS time; ``received_at``, monotonic time, s."""

    service: str
    srv_type: Any
    request: Any
    stamp: rospy.Time
    received_at: float


class CallPublisher:
    """Publishes ``~service_calls``. While nobody subscribes, no message is made."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~service_calls", ServiceCall, queue_size=_QUEUE, tcp_nodelay=True)

    def answered(self, call: Call, response: Any, outcome: Outcome) -> None:
        """Publish a call that got this response."""
        if self._publisher.get_num_connections():
            message = _message(call)
            message.response = _serialised(response)
            message.response_text = str(response)
            message.success = outcome.is_success
            message.error = "" if outcome.is_success else outcome.message
            self._publisher.publish(message)

    def failed(self, call: Call, error: str) -> None:
        """Publish a call that got a ROS service error instead of a response."""
        if self._publisher.get_num_connections():
            message = _message(call)
            message.error = error
            self._publisher.publish(message)


def _message(call: Call) -> ServiceCall:
    header = call.request._connection_header
    md5sum = header["md5sum"]
    message = ServiceCall()
    message.header.stamp = call.stamp
    message.service = call.service
    message.service_type = call.srv_type._type
    message.md5sum = call.srv_type._md5sum if md5sum == rospy.names.SERVICE_ANYTYPE else md5sum
    message.caller = header["callerid"]
    message.request = _serialised(call.request)
    message.request_text = str(call.request)
    message.duration = time.monotonic() - call.received_at
    return message


def _serialised(message: Any) -> bytes:
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()
