"""The publisher of a record of every service call: request, caller, response and duration."""
import io
import time
from typing import Any, NamedTuple, Optional

import genpy
import rospy

from jaka_msgs import msg as messages
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.jaka_types import warn_absent
from jaka_ros_driver.ros.services.handlers import ServiceOutcome

_QUEUE = 200
"""Messages that wait for a slow subscriber: a burst of calls of many clients; a recorder must not miss one."""


class ReceivedCall(NamedTuple):
    """A call as it arrived: ``stamp``, ROS time; ``received_at``, monotonic time, s."""

    service: str
    srv_type: Any
    request: genpy.Message
    stamp: rospy.Time
    received_at: float


class CallPublisher:
    """The publisher of ``~service_calls``. While nobody subscribes, no message is made.

    A ``jaka_msgs`` from elsewhere (``JAKA_MSGS_EXTERNAL=1``) may lack ``ServiceCall``, as the maker's does; then a
    warning is logged, and nothing is published.
    """

    def __init__(self) -> None:
        self._publisher = None
        if hasattr(messages, "ServiceCall"):
            self._publisher = direct_publisher("~service_calls", messages.ServiceCall, _QUEUE)
        else:
            warn_absent("ServiceCall", "the record of service calls, ~service_calls, is not published; everything else "
                        "is served", messages)

    def answered(self, call: ReceivedCall, response: genpy.Message, outcome: ServiceOutcome) -> None:
        """Publish a call that ended with this response."""
        self._publish(call, response=response, success=outcome.is_success,
                      error="" if outcome.is_success else outcome.message)

    def failed(self, call: ReceivedCall, error: str) -> None:
        """Publish a call that ended with a ROS service error instead of a response."""
        self._publish(call, error=error)

    def _publish(self, call: ReceivedCall, error: str, response: Optional[genpy.Message] = None,
                 success: bool = False) -> None:
        if self._publisher is None or not self._publisher.get_num_connections():
            return
        header = call.request._connection_header
        md5sum = header["md5sum"]
        message = messages.ServiceCall(
            service=call.service, service_type=call.srv_type._type, caller=header["callerid"],
            md5sum=call.srv_type._md5sum if md5sum == rospy.names.SERVICE_ANYTYPE else md5sum,
            request=_serialised(call.request), request_text=str(call.request), success=success, error=error,
            duration=time.monotonic() - call.received_at)
        message.header.stamp = call.stamp
        if response is not None:
            message.response, message.response_text = _serialised(response), str(response)
        self._publisher.publish(message)


def _serialised(message: genpy.Message) -> bytes:
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()
