"""The driver's core and the simulated controller in virtual time, without sockets, threads or faults between them."""
import math

import numpy as np

from jaka_ros_driver.client.core.actions import Answer, Port, Send
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.controller.status_frame import all_field_names
from jaka_ros_driver.trajectory.build import build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryTolerances

FIELDS = frozenset((
    "joint_actual_position", "joint_position", "actual_position", "powered_on", "enabled", "inpos", "emergency_stop",
    "protective_stop", "errcode", "rapidrate", "on_soft_limit", "paused", "drag_status"))
START_TOLERANCE = 0.01
_MOST_TICKS = 100
_PHASE_S = 0.003
"""The controller's cycle and the driver's are not of one clock."""


class SimulatedArm:
    """An enabled arm at rest, and its driver.

    Attributes:
        joints: Where the simulated arm is, rad (6,).
        frames: (time, joints rad) of each servo frame on the wire.
        answers: By token: (result, error).
    """

    def __init__(self, model, joints):
        self._model = model
        self.now = 100.0
        self.frames, self.answers = [], {}
        self._held, self._stream = [], ObjectStream()
        self.controller = Controller(model, FIRMWARES["1.5.14"], Options(start=Start.ENABLED), tuple(joints))
        state = self.controller.state
        for name in set(all_field_names(state.firmware)) - FIELDS:
            state.memory.field_switches[name] = False  # a short frame takes a tenth of the time
        state.client_connected()
        self._next_cycle = self.now + _PHASE_S
        self.core = ArmCore(ClientSettings("10.5.5.100"), model)
        self.core.start(self.now)
        self._perform()
        for port in Port:
            self.core.opened(port, self.now)
            self._perform()
        self.run(0.3)
        assert self.core.is_ready(self.now)

    @property
    def joints(self):
        return self.controller.state.plant.joint_position

    def run(self, seconds):
        until = self.now + seconds
        while self._next_cycle < until:
            self.cycle()

    def cycle(self):
        """The driver's ticks until the controller's next cycle, that cycle, and its status frame."""
        for _ in range(_MOST_TICKS):
            due = self.core.next_deadline()
            if due >= self._next_cycle:
                break
            self.now = max(due, self.now)
            self._tick()
        else:
            raise AssertionError("the core asks for ticks without end")
        self.now = self._next_cycle
        self._next_cycle += CYCLE_TIME_S
        self.controller.step(CYCLE_TIME_S)
        while self._held and self._held[0].is_due():
            self._reply(self._held.pop(0).due_reply())
        self.core.received(Port.STATUS, self.controller.feed_frame.text(), self.now)
        self._perform()
        self._tick()

    def follow(self, points):
        """As the shell does it; returns the error of the answer, None for none, when the arm is free again."""
        self.core.trajectory_start("start", 0.016, 0, self.now)
        self._perform()
        start, error = self.answers.pop("start")
        assert error is None, error
        path = build_path(start.begin, JointTrajectory(tuple(points)), 0.0, self._model, START_TOLERANCE)
        self.core.follow("goal", path, start, TrajectoryTolerances((0.02,) * 6, (0.001,) * 6, 0.5), 0, self.now)
        self._perform()
        until = self.now + path.end + 3.0
        while "goal" not in self.answers:
            assert self.now < until, "no answer"
            self.cycle()
        self.run(0.2)
        assert self.core.is_free
        return self.answers.pop("goal")[1]

    def _tick(self):
        self.core.tick(self.now)
        self._perform()

    def _perform(self):
        for action in self.core.take_actions():
            if isinstance(action, Answer):
                assert action.call not in self.answers, "answered twice"
                self.answers[action.call] = action.result, action.error
            elif isinstance(action, Send):
                for request in self._stream.feed(action.data):
                    self._execute(request)

    def _execute(self, request):
        if request["cmdName"] == "servo_j":
            self.frames.append((self.now, tuple(map(math.radians, request["jointPosition"]))))
        result = self.controller.execute(request)
        if self._held or not result.is_due():
            self._held.append(result)
        else:
            self._reply(result.reply)

    def _reply(self, reply):
        self.core.received(Port.COMMAND, reply, self.now)
        self._perform()


def moving_frames(frames):
    """Times and joints of the frames from the last one before anything moves to the first one that is the last place.

    Args:
        frames: As ``SimulatedArm.frames``.

    Returns:
        s (n,), rad (n, 6).
    """
    times, joints = np.array([time for time, _ in frames]), np.array([joints for _, joints in frames])
    moved = np.flatnonzero(np.abs(np.diff(joints, axis=0)).max(axis=1) > 0.0)
    inside = slice(moved.min(), moved.max() + 2)
    return times[inside], joints[inside]
