"""Lines of the audit log, made from calls, goals and messages; and the names of the node that are recorded.

A defect in here costs a line: it is logged, and never becomes the error of a call.

``NOT_RECORDED`` has the names that are left out, with the reason. What a node offers beside these is a defect:
``test/ros/audit/test_coverage.py`` compares the names that the ROS master knows with both.
"""
import functools
import itertools
import logging
import time
from typing import Any, Callable, Dict, Mapping, Optional, Set, Tuple

import genpy
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus

from jaka_ros_driver import client
from jaka_ros_driver.audit.log import AuditLog
from jaka_ros_driver.audit.streams import Streams
from jaka_ros_driver.ros.audit.callers import caller_of_message, caller_of_request
from jaka_ros_driver.ros.audit.plain import plain

NOT_RECORDED: Dict[str, str] = {
    "~get_io": "reads an input or output",
    "~get_settings": "reads frames, load and collision level",
    "~get_fk": "computes a pose",
    "~get_ik": "computes joint positions",
    "NAME/query_state": "reads where the joints are wanted; NAME is ~trajectory_controller",
    "controller_manager/list_controllers": "reads that the one controller runs; clients ask every second",
    "controller_manager/list_controller_types": "reads the type of the one controller",
    "~get_loggers": "rospy's own: reads the levels of the ROS log",
    "~set_logger_level": "rospy's own: sets a level of the ROS log, which the arm does not depend on",
    "/clock": "rospy's own: the time of a simulation",
}
"""Services, actions and topics that the node takes without a line in the log, each with the reason."""
URGENT = frozenset(("~power", "~enable", "~recover", "~clear_err"))
"""Services whose lines are on the disk at once: they energise the arm, or clear what kept it still."""
STREAMED = frozenset(("~servo_j", "~servo_p", "~jog"))
"""Services that are called again and again for one motion."""


_LOG = logging.getLogger(__name__)


def _without_harm(record: Callable[..., None], *arguments: Any, **named: Any) -> None:
    """Call ``record``, and log what it raises in place of raising it."""
    try:
        record(*arguments, **named)
    except Exception:
        _LOG.exception("the audit log lacks a line")


def _harmless(method: Callable[..., None]) -> Callable[..., None]:
    """Return a method that logs what ``method`` raises in place of raising it."""
    @functools.wraps(method)
    def call(*arguments: Any, **named: Any) -> None:
        _without_harm(method, *arguments, **named)
    return call


class CallEntry:
    """A running call; ``begin`` records it, and one of the other two methods its end."""

    def __init__(self, end: Callable[[bool, str], None] = lambda ok, message: None,
                 begin: Optional[Callable[[], None]] = None) -> None:
        self._end, self._begin = end, begin

    def begin(self) -> None:
        """Record the call itself, unless that was done."""
        begin, self._begin = self._begin, None
        if begin is not None:
            _without_harm(begin)

    def answered(self, ok: bool, message: str) -> None:
        """Record the answer."""
        self.begin()
        _without_harm(self._end, ok, message)

    def failed(self, error: str) -> None:
        """Record that the call ended with a ROS service error in place of an answer."""
        self.answered(False, error)


class Recorder:
    """The writer of the audit lines. Every method returns at once, and raises nothing.

    Attributes:
        names: The recorded (``service``, ``action`` or ``topic``, name), with ``~`` for the node's own names.
    """

    def __init__(self, log: Optional[AuditLog]) -> None:
        """Set up the recorder; without a ``log`` nothing is recorded."""
        self.log = log
        self.names: Set[Tuple[str, str]] = set()
        self._numbers = itertools.count(1)
        self._streams = Streams(self._write)
        if log is not None:
            log.add_task(self._streams.end_quiet)

    @_harmless
    def close_streams(self) -> None:
        """Write the end of every open stream."""
        self._streams.end_quiet(0.0)

    @_harmless
    def event(self, kind: str, is_urgent: bool = False, **fields: Any) -> None:
        """Write a line about the driver itself."""
        self._write(kind, fields, is_urgent)

    # ---- services ----

    def offers_service(self, name: str) -> None:
        """Record calls of this service from now on, unless it is among those that are not."""
        if name not in NOT_RECORDED:
            self.names.add(("service", name))

    def call(self, name: str, request: genpy.Message) -> CallEntry:
        """Begin the record of a call."""
        entry = self.prepared_call(name, request)
        entry.begin()
        return entry

    def prepared_call(self, name: str, request: genpy.Message) -> CallEntry:
        """Return the record of a call, not yet begun: that of a stop is, once it is sent, for nothing delays a stop."""
        if self.log is None or ("service", name) not in self.names:
            return CallEntry()
        if name in STREAMED:
            return CallEntry(lambda ok, message: self._streamed(name, request, "" if ok else message or "?"))
        number, began_at = next(self._numbers), time.monotonic()
        about: Dict[str, Any] = {"what": name, "call": number}

        def begin() -> None:
            about.update(caller_of_request(request)._asdict())
            self._write("call", {**about, "arguments": plain(request)}, name in URGENT)

        def end(ok: bool, message: str) -> None:
            self._write("answer", {**about, "ok": ok, "message": plain(message),
                                   "seconds": round(time.monotonic() - began_at, 6)}, name in URGENT)
        return CallEntry(end, begin)

    def _streamed(self, name: str, request: genpy.Message, refusal: str) -> None:
        """Record a call of a stream; a jog in another direction is another stream."""
        caller = caller_of_request(request)
        key = (name, *caller, str(request) if name == "~jog" else "")
        self._streams.note(key, lambda: {"what": name, **caller._asdict(), "arguments": plain(request)}, refusal)

    # ---- topics ----

    def takes_topic(self, name: str) -> None:
        """Mark the messages of this topic as recorded."""
        self.names.add(("topic", name))

    @_harmless
    def message(self, name: str, message: genpy.Message, refusal: str = "", state: str = "") -> None:
        """Record a message of a topic by which the arm is moved, as one of a stream of its publisher.

        state: Separates messages of one publisher that are streams of their own, as one that stops.
        """
        if self.log is None:
            return
        header = getattr(message, "_connection_header", None) or {}
        self._streams.note((name, header.get("callerid", ""), state), lambda: {
            "what": name, **caller_of_message(message, name)._asdict(), "arguments": plain(message)}, refusal)

    # ---- actions ----

    def offers_action(self, name: str) -> None:
        """Mark the goals and cancels of this action as recorded."""
        self.names.add(("action", name))

    @_harmless
    def goal(self, name: str, message: Any) -> None:
        """Record a goal that has come, before it is handled."""
        self._of_action("goal", name, message, "/goal", {
            "goal": plain(message.goal_id.id), "arguments": plain(message.goal)})

    @_harmless
    def cancel(self, name: str, message: GoalID) -> None:
        """Record that a goal is to be cancelled, or with an empty id all goals."""
        self._of_action("cancel", name, message, "/cancel", {"goal": plain(message.id)})

    @_harmless
    def result(self, name: str, status: GoalStatus, result: genpy.Message) -> None:
        """Record the end of a goal."""
        if self.log is None:
            return
        self._write("result", {
            "what": name, "goal": plain(status.goal_id.id), "ok": status.status == status.SUCCEEDED,
            "status": _STATUS.get(status.status, str(status.status)), "message": plain(status.text),
            "result": plain(result)})

    def _of_action(self, kind: str, name: str, message: genpy.Message, topic: str, fields: Mapping[str, Any]) -> None:
        if self.log is not None:
            caller = caller_of_message(message, rospy.resolve_name(name) + topic)
            self._write(kind, {"what": name, **caller._asdict(), **fields}, name in URGENT)

    # ---- inside ----

    def _write(self, kind: str, fields: Mapping[str, Any], is_urgent: bool = False) -> None:
        if self.log is not None:
            self.log.write(kind, fields, is_urgent)


_STATUS = {2: "preempted", 3: "succeeded", 4: "aborted", 5: "rejected", 8: "recalled", 9: "lost"}
"""The states of actionlib_msgs/GoalStatus in which a goal has ended."""


class ClientEvents(logging.Handler):
    """The recorder of the client's log: stops with their cause, links, watchdogs, the guard, a defect."""

    def __init__(self, recorder: Recorder) -> None:
        super().__init__(logging.INFO)
        self._recorder = recorder

    def begin(self) -> None:
        """Begin to record."""
        logging.getLogger(client.__name__).addHandler(self)

    def end(self) -> None:
        """Stop recording."""
        logging.getLogger(client.__name__).removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Record one of its texts."""
        try:
            text = record.getMessage()
            if record.exc_info and record.exc_info[1] is not None:
                text += ": %r" % record.exc_info[1]
        except Exception as error:  # the text does not fit its arguments; that must not become the client's error
            text = "%r (%r)" % (record.msg, error)
        self._recorder.event("driver", level=record.levelname, text=plain(text))
