"""The subscriptions to one driver: the newest of each state, and every event.

rospy calls back in threads of its own, which only put raw messages down here; they are read in the thread that asks
(``state``, ``take_plots``, ``take_news``), as often as pages are sent to, and not for every message.
"""
import logging
import math
import re
import struct
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from roslib import message as roslib_message

from ..record.alarms import AlarmBook, event_of
from ..record.hand_outputs import HandOutputs, Key
from ..record.history import Differences, History
from ..record.moves import MoveBook
from . import raw_messages
from .arms import Driver
from .requests import output_of
from .rotations import vector_from_quaternion, vector_from_rpy

_LOG = logging.getLogger(__name__)

STALE_S = 0.3
"""Age, s, above which joints are shown as stale and nobody jogs by them."""
KEPT_CALLS = 50
"""Newest calls that a page that comes later gets."""
_LONGEST_TEXT = 2000
"""Most characters of a request or answer, which every page gets."""
_WHOLE = re.compile("-?[0-9]{1,9}")
_IO_PERIOD_S = 0.1
"""Least time, s, between two messages of terminals to a page: a person sees no more than 10 Hz."""
_STOPS = ("stop_move", "stop_motion")
_PENDING = 2000
"""Most samples that wait for the pages' loop: 16 s at 125 Hz; then the oldest are dropped, as it is far behind."""
_BANKS = ("cabinet", "tool", "extension", "modbus_slave", "profinet_slave", "ethernet_ip_slave")
_MODES = {2: "auto", 1: "manual"}
_PROGRAM_STATES = {0: "idle", 1: "loading", 2: "paused", 3: "running"}
_MOTION_STATES = {0: "accepted", 1: "completed", 2: "stopped"}
_TRI = {0: False, 1: True}
_DIAGNOSTIC_LEVELS = {Log.WARN: "warning", Log.ERROR: "error", Log.FATAL: "error"}
_RAW = {"robot_states": "robot", "robot_status": "status", "tool_position": "tool", "wrench": "wrench",
        "joint_temperatures": "temperature", "joint_currents": "current"}
_STATUS_NAMES = ("e_stopped", "drives_powered", "motion_possible", "in_motion", "in_error")


class Heard(NamedTuple):
    """A raw message, and when it came, monotonic time, s."""

    at: float
    raw: bytes


class Joints(NamedTuple):
    """A sample of the joints: when it was taken, monotonic time, s; rad; rad/s or None, (6,) each."""

    at: float
    position: Tuple[float, ...]
    velocity: Optional[Sequence[float]]


class ArmFeed:
    """The topics of one driver.

    Attributes:
        driver: The driver as the master knows it.
        alarms: Alarms and notes.
        history: Curves of the joints, while somebody watches.
        moves: Motions, while somebody watches.
        hand_outputs: Outputs that pages have set; changed in the thread that takes the news.
        simulated: True, False, or None while it is not known.
        joints_heard_at: Reception of the newest sample of the joints, monotonic time, s; -1e9 before the first.
        stops: Number of calls that stopped the arm, by whomever.
    """

    def __init__(self, driver: Driver) -> None:
        """Subscribe to what comes seldom; ``follow`` adds what comes 125 times a second."""
        self.driver = driver
        self.alarms = AlarmBook()
        self.history = History()
        self.moves = MoveBook()
        self.hand_outputs = HandOutputs()
        self.simulated: Optional[bool] = None
        self.joints_heard_at = -1e9
        self.stops = 0
        self._heard: Dict[str, Heard] = {}
        self._samples: Deque[Heard] = deque(maxlen=_PENDING)
        self._errors: Deque[Heard] = deque(maxlen=_PENDING)
        self._events: Deque[Callable[[], List[Dict[str, Any]]]] = deque(maxlen=_PENDING)
        self._calls: Deque[Dict[str, Any]] = deque(maxlen=KEPT_CALLS)
        self._call_count = 0
        self._joints: Optional[Joints] = None
        self._differences = Differences()
        self._condition: Dict[str, Any] = {}
        self._said: Dict[str, Dict[str, Any]] = {}
        self._diagnostics_at = -1e9
        self._io: Optional[Any] = None
        self._io_at = 0.0
        self._told_io_at = -1e9
        self._clock_offset = 0.0
        self._watched: Dict[str, Any] = {}
        self._seldom: Dict[str, Any] = {
            "/diagnostics": rospy.Subscriber("/diagnostics", DiagnosticArray, self._take_diagnostics, queue_size=20),
            "/rosout_agg": rospy.Subscriber("/rosout_agg", Log, self._take_log, queue_size=200)}
        self.follow(driver, False)

    @property
    def zones(self) -> Optional[float]:
        """The time at which other zones came, monotonic, s; None before the first."""
        heard = self._heard.get("zones")
        return None if heard is None else round(heard.at, 3)

    # ---- subscriptions ----

    def follow(self, driver: Driver, is_watched: bool) -> None:
        """Subscribe to the driver as the master knows it now; ``is_watched``: to the 125 Hz topics as well.

        A driver that starts offers its topics one after the other: each is subscribed to when it is there.
        """
        self.driver = driver
        for name, take in (("simulated", self._take_simulated), ("io_states", self._take_io),
                           ("service_calls", self._take_call), ("program/state", self._take_program),
                           ("motion_state", self._take_motion)):
            topic = "%s/%s" % (driver.node, name)
            kind = next((kind for published, kind in driver.topics if published == topic), None)
            known = roslib_message.get_message_class(kind) if kind is not None and topic not in self._seldom else None
            if known is not None:
                self._seldom[topic] = rospy.Subscriber(topic, known, take, queue_size=200)
        self._add_raw(self._seldom, "speed_scaling_factor", "speed")
        self._add_raw(self._seldom, "workspace_markers", "zones")
        if is_watched:
            self._watch()
        elif self._watched:
            self._let_go(self._watched)

    def _watch(self) -> None:
        for topic, take in ((self.driver.node + "/joint_position", self._take_joints),
                            (self.driver.state_topic, self._take_errors)):
            if topic is not None and topic not in self._watched:
                self._watched[topic] = rospy.Subscriber(topic, rospy.AnyMsg, take, tcp_nodelay=True)
        for name, key in _RAW.items():
            self._add_raw(self._watched, name, key)

    def close(self) -> None:
        """Let go of all topics."""
        self._let_go(self._watched)
        self._let_go(self._seldom)

    @staticmethod
    def _let_go(subscribers: Dict[str, Any]) -> None:
        for subscriber in subscribers.values():
            subscriber.unregister()
        subscribers.clear()

    def _add_raw(self, subscribers: Dict[str, Any], name: str, key: str) -> None:
        """Keep the newest message of a private topic under a key."""
        topic = "%s/%s" % (self.driver.node, name)
        if topic not in subscribers and self.driver.publishes(name):
            def take(message: Any) -> None:
                self._heard[key] = Heard(time.monotonic(), message._buff)
            subscribers[topic] = rospy.Subscriber(topic, rospy.AnyMsg, take, queue_size=1, tcp_nodelay=True)

    def _take_joints(self, message: Any) -> None:
        self.joints_heard_at = time.monotonic()
        self._samples.append(Heard(self.joints_heard_at, message._buff))

    def _take_errors(self, message: Any) -> None:
        self._errors.append(Heard(time.monotonic(), message._buff))

    # ---- what changes all the time: called by one thread ----

    def read(self, now: float) -> Dict[str, Any]:
        """Take what has come since the last time into the curves; the new part of them, as JSON has it.

        Returns:
            ``s``, ``q``, ``dq``, ``e`` as the message ``plot`` has them; empty lists where nothing has come.
        """
        self._clock_offset = rospy.get_rostime().to_sec() - now
        errors = self._new_errors()
        rows: List[Tuple[float, Sequence[float], Optional[Sequence[float]], Optional[Sequence[float]]]] = []
        while self._samples:
            heard = self._samples.popleft()
            try:
                stamp_ns, position, velocity = raw_messages.joint_state(heard.raw)
            except (struct.error, IndexError):
                continue
            at = self._moment(stamp_ns, heard.at)
            if position is None or (self._joints is not None and at <= self._joints.at):
                continue  # the driver repeats the newest sample of a slow feed
            speeds = velocity or self._differences.of(at, position)
            self._joints = Joints(at, position, speeds)
            error = errors.popleft()[1] if errors and errors[0][0] <= at else None
            while errors and errors[0][0] <= at:
                error = errors.popleft()[1]
            rows.append((at, position, speeds, error))
            self.history.add(at, (position, speeds, error))
            self._note_moves(self.moves.sample(at, speeds))
        self._note_moves(self.moves.look(now))
        return {"s": [round(row[0], 4) for row in rows],
                **{name: [[None if row[n] is None else round(row[n][joint], 6) for row in rows]  # type: ignore[index]
                          for joint in range(raw_messages.JOINTS)] for n, name in ((1, "q"), (2, "dq"), (3, "e"))}}

    def _note_moves(self, moves: List[Dict[str, Any]]) -> None:
        if moves:
            self._events.append(lambda: [{"t": "move", "move": move} for move in moves])

    def _new_errors(self) -> Deque[Tuple[float, Tuple[float, ...]]]:
        errors: Deque[Tuple[float, Tuple[float, ...]]] = deque()
        while self._errors:
            heard = self._errors.popleft()
            self._heard["want"] = heard
            try:
                stamp_ns, _, error = raw_messages.controller_state(heard.raw)
            except (struct.error, IndexError):
                continue
            if error is not None:
                errors.append((self._moment(stamp_ns, heard.at), error))
        return errors

    def _moment(self, stamp_ns: int, heard_at: float) -> float:
        """Return the time of a sample's stamp, monotonic time, s; not later than its reception."""
        return min(heard_at, stamp_ns * 1e-9 - self._clock_offset)

    @property
    def joints(self) -> Optional[Joints]:
        """The newest sample that was read."""
        return self._joints

    def is_alive(self, now: float) -> bool:
        """Return whether a message of the driver was received within 5 s."""
        return now - self._diagnostics_at < 5.0 or (self._joints is not None and now - self._joints.at < 5.0)

    def tool(self, now: float) -> Optional[Dict[str, Any]]:
        """Return the active tool's pose: ``p`` m, ``r`` rotation vector, ``frame``, ``age`` s."""
        return self._of("tool", now, self._read_tool)

    def state(self, now: float) -> Dict[str, Any]:
        """Return the newest of everything, as the message ``state`` has it."""
        joints = self._joints
        age = None if joints is None else max(0.0, now - joints.at)
        return {
            "age": None if age is None else round(age, 4), "fresh": age is not None and age <= STALE_S,
            "q": None if joints is None else _rounded(joints.position),
            "dq": None if joints is None or joints.velocity is None else _rounded(joints.velocity),
            "tool": self.tool(now), "robot": self._of("robot", now, _read_robot),
            "status": self._of("status", now, self._read_status), **self._condition_now(now),
            "speed": self._value("speed", raw_messages.number),
            "want": self._of("want", now, self._read_want), "wrench": self._of("wrench", now, self._read_wrench),
            "temperature": self._list("temperature"), "current": self._list("current")}

    def _of(self, name: str, now: float, read: Callable[[Heard], Optional[Dict[str, Any]]]) -> Optional[Dict[str, Any]]:
        heard = self._heard.get(name)
        if heard is None:
            return None
        try:
            shown = read(heard)
        except (struct.error, IndexError):
            return None
        if shown is not None:
            shown["age"] = round(max(0.0, now - shown.pop("at", heard.at)), 4)
        return shown

    def _value(self, name: str, read: Callable[[bytes], Any]) -> Any:
        heard = self._heard.get(name)
        try:
            return None if heard is None else read(heard.raw)
        except (struct.error, IndexError):
            return None

    def _list(self, name: str) -> Optional[List[float]]:
        values = self._value(name, raw_messages.number_array)
        return None if values is None else [round(value, 3) for value in values]

    def _read_tool(self, heard: Heard) -> Dict[str, Any]:
        interface = self.driver.interface
        if interface == "vendor_2025":
            head, values = raw_messages.pose(heard.raw)
            place, turn = [0.001 * value for value in values[:3]], vector_from_quaternion(*values[3:])
        else:
            head, values = raw_messages.six_numbers(heard.raw)
            place, turn = list(values[:3]), list(values[3:])
            if interface == "vendor":
                place, turn = [0.001 * value for value in place], vector_from_rpy([0.017453292519943295 * value
                                                                                   for value in turn])
        pose = {"p": _rounded(place), "r": _rounded(turn)}
        base = self.driver.prefix + str(self.driver.parameter("base_frame", "base_link"))
        return {**pose, "frame": head.frame_id, "base": pose if head.frame_id == base else None,
                "at": self._moment(head.stamp_ns, heard.at)}

    def _read_status(self, heard: Heard) -> Dict[str, Any]:
        stamp_ns, values = raw_messages.robot_status(heard.raw)
        flags = {name: _TRI.get(value) for name, value in zip(_STATUS_NAMES, values[1:6])}
        return {"mode": _MODES.get(values[0]), **flags, "error_code": values[6], "at": self._moment(stamp_ns, heard.at)}

    def _read_want(self, heard: Heard) -> Optional[Dict[str, Any]]:
        stamp_ns, desired, error = raw_messages.controller_state(heard.raw)
        if desired is None or error is None:
            return None
        return {"q": _rounded(desired), "e": _rounded(error), "at": self._moment(stamp_ns, heard.at)}

    def _read_wrench(self, heard: Heard) -> Dict[str, Any]:
        head, values = raw_messages.six_numbers(heard.raw)
        return {"f": _rounded(values[:3]), "t": _rounded(values[3:]), "at": self._moment(head.stamp_ns, heard.at)}

    def _condition_now(self, now: float) -> Dict[str, Any]:
        """Return what /diagnostics say of the arm; nothing while they are silent."""
        names = ("owner", "enabled", "hand_guided", "tool_id", "user_id", "held_by")
        known = self._condition if now - self._diagnostics_at < 3.0 else {}
        return {("hand_guiding" if name == "hand_guided" else name): known.get(name) for name in names}

    # ---- what changes rarely ----

    def snapshot(self, now: float) -> List[Dict[str, Any]]:
        """Return the messages for a page that begins to watch, besides ``state``."""
        calls = {"t": "calls", "calls": list(self._calls)}
        alarms = {"t": "alarms", "alarms": self.alarms.all()}
        moves = {"t": "moves", "moves": self.moves.all()}
        io = [] if self._io is None else [self._io_message(now)]
        return [*self._said.values(), *io, alarms, calls, moves, self._by_hand()]

    def take_news(self, now: float) -> List[Dict[str, Any]]:
        """Return the messages of what has changed since the last call, oldest first."""
        news: List[Dict[str, Any]] = []
        while self._events:
            event = self._events.popleft()
            try:
                news += event()
            except Exception:  # one message that cannot be read must not end the telling of all others
                _LOG.exception("a message of %s", self.driver.node)
        if self._io is not None and self._io_at > self._told_io_at and now - self._told_io_at >= _IO_PERIOD_S:
            self._told_io_at = now
            news.append(self._io_message(now))
            if self.hand_outputs.look(news[-1]["banks"], self._io_at):
                news.append(self._by_hand())
        news += self._status_event()
        return news

    def note(self, level: str, text: str) -> None:
        """Put what this panel did among the alarms."""
        self._events.append(lambda: self._alarm_news(self.alarms.note(time.time(), level, text, "panel")))

    def set_by_hand(self, key: Key, value: Any, by: str) -> None:
        """Mark an output that a page has set and read back."""
        self.hand_outputs.set(key, value, by, time.monotonic(), time.time())
        self._events.append(lambda: [self._by_hand()])

    def _by_hand(self) -> Dict[str, Any]:
        return {"t": "by_hand", "outputs": self.hand_outputs.all()}

    def _status_event(self) -> List[Dict[str, Any]]:
        """Record the controller's event from ``~robot_status``, which comes earlier than /diagnostics."""
        heard = self._heard.get("status")
        if heard is None or time.monotonic() - heard.at > STALE_S:
            return []
        try:
            _, values = raw_messages.robot_status(heard.raw)
        except (struct.error, IndexError):
            return []
        number, text = self._condition.get("event", (0, ""))
        if values[6] == 0:
            return []  # notes and warnings are in /diagnostics alone
        same = number & 0xFFFFFFFF == values[6] & 0xFFFFFFFF
        return self._alarm_news(self.alarms.event(time.time(), values[6], text if same else "", True))

    @staticmethod
    def _alarm_news(alarms: List[Dict[str, Any]]) -> List[Dict[str, Any]]:
        return [{"t": "alarm", "alarm": dict(alarm)} for alarm in alarms]

    def _io_message(self, now: float) -> Dict[str, Any]:
        io = self._io
        assert io is not None
        banks = {}
        for name in _BANKS:
            bank = getattr(io, name)
            banks[name] = {"di": list(map(bool, bank.digital_inputs)), "do": list(map(bool, bank.digital_outputs)),
                           "ai": _rounded(bank.analog_inputs), "ao": _rounded(bank.analog_outputs)}
        return {"t": "io", "age": round(max(0.0, now - self._io_at), 3), "banks": banks,
                "relays": list(map(bool, io.relays))}

    # ---- rospy's threads ----

    def _take_simulated(self, message: Any) -> None:
        self.simulated = bool(message.data)

    def _take_io(self, message: Any) -> None:
        self._io, self._io_at = message, time.monotonic()

    def _take_call(self, message: Any) -> None:
        self._events.append(lambda: self._call_news(message))

    def _call_news(self, message: Any) -> List[Dict[str, Any]]:
        self._call_count += 1
        self.stops += message.service.rpartition("/")[2] in _STOPS
        call = {"n": self._call_count, "wall": round(message.header.stamp.to_sec(), 3), "service": message.service,
                "name": message.service[len(self.driver.node) + 1:] if message.service.startswith(
                    self.driver.node + "/") else message.service,
                "type": message.service_type, "caller": message.caller,
                "request": message.request_text[:_LONGEST_TEXT], "answer": message.response_text[:_LONGEST_TEXT],
                "took": round(message.duration, 5), "ok": bool(message.success), "error": message.error[:_LONGEST_TEXT]}
        self._calls.append(call)
        news: List[Dict[str, Any]] = [{"t": "call", "call": call}]
        if call["name"] == "set_io" and message.success:
            key = output_of(message.request_text)
            if self.hand_outputs.called(key, message.caller == rospy.get_name(), time.monotonic()):
                news.append(self._by_hand())
        return news

    def _take_program(self, message: Any) -> None:
        self._events.append(lambda: self._changed("program", {
            "state": _PROGRAM_STATES.get(message.state, "unknown"), "program": message.program,
            "reason": message.reason}))

    def _take_motion(self, message: Any) -> None:
        self._events.append(lambda: [{"t": "motion", "id": message.id, "reason": message.reason,
                                      "state": _MOTION_STATES.get(message.state, "stopped")}])

    def _take_log(self, message: Any) -> None:
        level = _DIAGNOSTIC_LEVELS.get(message.level)
        if level is not None and message.name == self.driver.node:
            wall = message.header.stamp.to_sec()
            self._events.append(lambda: self._alarm_news(self.alarms.note(wall, level, message.msg, "driver")))

    def _take_diagnostics(self, message: Any) -> None:
        start = self.driver.node.lstrip("/") + ": "
        mine = [status for status in message.status if status.name.startswith(start)]
        if mine:
            self._diagnostics_at = time.monotonic()
            self._events.append(lambda: self._diagnostics_news(mine, len(start)))

    def _diagnostics_news(self, statuses: List[Any], start: int) -> List[Dict[str, Any]]:
        shown = [{"name": status.name[start:], "level": _level(status.level), "message": status.message,
                  "values": [[value.key, value.value] for value in status.values]} for status in statuses]
        values = {status["name"]: dict(status["values"]) for status in shown}
        news: List[Dict[str, Any]] = []
        state = values.get("controller state", {})
        if state:
            event = event_of(state.get("event", ""))
            self._condition = {
                "owner": state.get("motion owner"), "enabled": _true(state.get("enabled")),
                "hand_guided": _true(state.get("hand guiding")), "tool_id": _whole(state.get("tool")),
                "user_id": _whole(state.get("user frame")), "event": event,
                "held_by": next((status["message"][len("held by "):] for status in shown
                                 if status["name"] == "velocity jog" and status["message"].startswith("held by ")), "")}
            owner = self._condition["owner"]
            self._note_moves(self.moves.name("" if owner in (None, "nobody") else owner))
            is_alarm = any(status["name"] == "controller state" and status["level"] == 2 for status in shown)
            news += self._alarm_news(self.alarms.event(time.time(), event[0], event[1], is_alarm))
        return news + self._changed("diag", {"status": shown})

    def _changed(self, name: str, content: Dict[str, Any]) -> List[Dict[str, Any]]:
        before = self._said.get(name, {})
        if all(before.get(key) == value for key, value in content.items()) and before:
            return []
        self._said[name] = {"t": name, "wall": round(time.time(), 3), **content}
        return [self._said[name]]


def _read_robot(heard: Heard) -> Dict[str, Any]:
    return dict(zip(("motion", "power", "servo", "collision"), raw_messages.robot_states(heard.raw)))


def _rounded(values: Sequence[float]) -> List[Optional[float]]:
    """Round values for JSON, which knows neither NaN nor infinity: they become None."""
    return [round(value, 6) if math.isfinite(value) else None for value in values]


def _level(level: Any) -> int:
    return level[0] if isinstance(level, bytes) else int(level)


def _true(text: Optional[str]) -> Optional[bool]:
    return None if text is None else text == "True"


def _whole(text: Optional[str]) -> Optional[int]:
    return int(text) if text is not None and _WHOLE.fullmatch(text) else None
