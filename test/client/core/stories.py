"""A core whose controller, feed and time are played by the test, event by event."""
import json
import math

from jaka_ros_driver.client.core.actions import Answer, Close, Log, NotifyGuard, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.invariants import check_invariants
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.protocol.status import encode_frame

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
PERIOD = 0.008
WHOLE_STOP = ["servo_move", "stop_program"] + ["jog"] * 6
"""Command names of a stop where no jog's axis is known; the jogs are ended by ``jog`` of mode 0."""


class Story:
    """One arm and its driver's core. Time goes on with ``run``; frames come every 8 ms and show ``joints``, ``fields``.

    Attributes:
        answers: The answers by the call's token: (time, result, error).
        sent: (time, request) of all that was sent.
        told: Notifications of the guard; tells: the same, with the moving parts.
        replies: The controller's replies: command name to errorCode, or None for no reply.
        extra: Further fields of its replies, by command name.
    """

    def __init__(self, ready=True, **settings):
        self.now = 100.0
        self.joints = list(HOME)
        self.tcp = [400.0, 100.0, 300.0, 180.0, 0.0, 0.0]
        self.fields = {}
        self.feed = True
        self.answers = {}
        self.sent = []
        self.told = []
        self.tells = []
        self.shown = []
        self.log = []
        self.asked_to_connect = []
        self.replies = {}
        self.extra = {}
        self.servo_mode = False
        self.core = ArmCore(ClientSettings("10.0.0.1", **settings), load_model("zu7"))
        self._stream = ObjectStream()
        self._depth = 0
        self._begin()
        self.perform()
        if ready:
            self.connect()
            self.run(0.2)
            assert self.core.is_ready(self.now)

    def _begin(self):
        self.core.start(self.now)

    def connect(self):
        for port in (Port.COMMAND, Port.STATUS):
            self.core.opened(port, self.now)
            self.perform()

    def perform(self):
        """Perform what the core asks for; a reply comes at once, within the action that sends its request."""
        self._depth += 1
        self._perform_all()
        self._depth -= 1
        if self._depth == 0:
            check_invariants(self.core, bool(self.told) and self.told[-1], self.now)

    def _perform_all(self):
        for action in self.core.take_actions():
            if isinstance(action, Answer):
                assert action.call not in self.answers, "answered twice"
                self.answers[action.call] = (self.now, action.result, action.error)
            elif isinstance(action, Send):
                self._take(action.data)
            elif isinstance(action, NotifyGuard):
                self.told.append(action.is_moving)
                self.tells.append(action)
            elif isinstance(action, PublishState):
                self.shown.append(action)
            elif isinstance(action, Log):
                self.log.append(action.text)
            else:
                assert isinstance(action, (Open, Close))
                self.asked_to_connect.append((self.now, action))

    def _take(self, data):
        requests = list(self._stream.feed(data))
        self.sent += [(self.now, request) for request in requests]
        for request in requests:
            name = request["cmdName"]
            code = self.replies.get(name, "0")
            if name == "servo_move" and code == "0":
                self.servo_mode = bool(request["relFlag"])
            if code is not None:
                self.reply(name, code)

    def reply(self, name, code="0"):
        is_on = bool(self.fields.get("powered_on", True)), bool(self.fields.get("enabled", True))
        extra = {"get_joint_pos": {"joint_pos": [math.degrees(q) for q in self.joints]},
                 "get_robot_state": {"power": int(is_on[0]), "enable": is_on[1]}, "get_version": {"version": "1"},
                 "get_port10000_delay_ms": {"port10000_delay_ms": 8},
                 "is_in_servomove": {"in_servomove": self.servo_mode}, **self.extra}.get(name, {})
        text = json.dumps({"cmdName": name, "errorCode": code, "errorMsg": "", **extra})
        self.core.received(Port.COMMAND, text.encode(), self.now)
        self.perform()

    def frame(self, **fields):
        self.core.received(Port.STATUS, encode_frame({
            "joint_actual_position": [math.degrees(q) for q in self.joints], "actual_position": self.tcp,
            "powered_on": 1, "enabled": True, "inpos": True, "emergency_stop": 0, "protective_stop": 0,
            "errcode": "0x0", **self.fields, **fields}), self.now)
        self.perform()

    def run(self, seconds, move=None, speed=0.5, **fields):
        """Let time pass; ``move``: where joint 1 goes meanwhile, rad, at this speed."""
        for _ in range(int(round(seconds / PERIOD))):
            self.now += PERIOD
            if move is not None:
                away = move - self.joints[0]
                self.joints[0] += math.copysign(min(abs(away), speed * PERIOD), away)
            if self.feed:
                self.frame(**fields)
            self.core.tick(self.now)
            self.core.prepare()
            self.perform()
        return self

    def names(self):
        return [request["cmdName"] for _, request in self.sent]

    def count(self, name):
        return self.names().count(name)

    def error(self, call):
        """Return the call's answer: "pending", None for success, or its error."""
        return self.answers[call][2] if call in self.answers else "pending"

    def cause(self, call):
        error = self.error(call)
        return getattr(error, "cause", error)
