"""The driver's core and the simulated controller in virtual time, without sockets, threads or chance between them.

Requests arrive at once. Replies do, too, unless a test delays them; links break and are refused as a test asks for.
Moments are exact: the core is ticked at its own deadlines, and the controller's cycle is 8 ms.
"""
import math

import numpy as np
from virtual_clock import Clock

from jaka_ros_driver.client.core.actions import Answer, Close, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.executor import Controller, ReplyLine
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.controller.status_frame import all_field_names
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryTolerances

FIELDS = frozenset((
    "joint_actual_position", "joint_position", "actual_position", "powered_on", "enabled", "inpos", "emergency_stop",
    "protective_stop", "errcode", "errmsg", "rapidrate", "on_soft_limit", "paused", "drag_status"))
START_TOLERANCE = 0.01
_MOST_TICKS = 100
_PHASE_S = 0.003
"""The offset between the controller's cycle and the driver's, which have different clocks."""
_CONNECTS_IN_S = 0.001
_PATIENCE_S = 60.0


class Call:
    """One call to the core, and how it ended.

    Attributes:
        is_over: It was answered.
        result, error: The answer.
        ended_at: When it was answered, s.
    """

    def __init__(self):
        self.is_over = False
        self.result = self.error = self.ended_at = None


class SimulatedArm:
    """An arm at rest, and its driver.

    Attributes:
        joints: Where the simulated arm is, rad (6,).
        sent: (time, request) of each request on the wire.
        frames: (time, joints rad) of each servo frame on the wire.
        answers: By token, of calls that are no ``Call``: (result, error).
        shown: States for the publishers.
        refused_until: By port: until then the controller refuses connections, s.
        reply_delay: How late each reply comes, s.
        held_until: Until then the driver stands still: it reads nothing, and sends nothing, s.
        places: The arm's joints, rad (6,), at the end of each cycle of the controller.
        closed_for: Why the driver closed its links.
        longest_unowned: The longest time in which the arm moved without custody, s.
    """

    def __init__(self, model, joints, is_ready=True, start=Start.ENABLED, identity="", dialect=None,
                 firmware="1.5.14", has_force_sensor=False, has_all_fields=False, **settings):
        """Make an arm and let the driver connect.

        Args:
            model: The arm model.
            joints: Where the arm is, rad (6,).
            is_ready: The driver must be ready after 0.3 s.
            start: The state of the drives.
            identity: The identity that the controller reports.
            dialect: What the controller does otherwise than its firmware's default, by dimension.
            firmware: The controller's.
            has_force_sensor: There is a sensor at the flange.
            has_all_fields: Frames have all fields, and cost ten times the time of others.
            settings: Settings of the client.
        """
        self._model = model
        self._clock = Clock(100.0)
        self.sent, self.frames, self.answers, self.shown = [], [], {}, []
        self.refused_until = dict.fromkeys(Port, 0.0)
        self.reply_delay = self.longest_unowned = self.held_until = 0.0
        self.places, self.closed_for, self._unread = [], [], b""
        self._joins_until, self._joined = 0.0, b""
        self._links = dict.fromkeys(Port, False)
        self._tries = dict.fromkeys(Port, 0)
        self._motions = [(self.now, False)]
        self._unowned_since = None
        self._new_connection()
        options = Options(Dialect.default(firmware).replaced(dialect or {}), start, identity=identity,
                          has_force_sensor=has_force_sensor)
        self.controller = Controller(model, FIRMWARES[firmware], options, tuple(joints))
        self._has_all_fields = has_all_fields
        self._shorten_frames()
        self._is_off = False
        self._next_cycle = self.now + _PHASE_S
        self.core = ArmCore(ClientSettings("10.5.5.100", **settings), model)
        self.core.start(self.now)
        self._perform()
        self.run(0.3)
        assert not is_ready or self.core.is_ready(self.now)

    def _shorten_frames(self):
        state = self.controller.state
        for name in set() if self._has_all_fields else set(all_field_names(state.firmware)) - FIELDS:
            state.memory.field_switches[name] = False

    @property
    def now(self):
        return self._clock.now

    @property
    def joints(self):
        return self.controller.state.plant.joint_position

    @property
    def is_moving(self):
        return self.controller.state.plant.is_moving

    # ---- calls ----

    def begin(self, method, *args, **more):
        """Call a method of the core; return the call at once."""
        call = Call()
        getattr(self.core, method)(call, *args, self.now, **more)
        self._perform()
        return call

    def ended(self, call, timeout=_PATIENCE_S):
        """Let time pass until a call has ended; return its error, None for success."""
        self.until(lambda: call.is_over, timeout)
        return call.error

    def does(self, procedure, exclusive=None):
        """Carry out a procedure, made of the core; return its result, or raise its error."""
        call = self.begin("run", procedure(self.core), exclusive=exclusive)
        error = self.ended(call)
        if error is not None:
            raise error
        return call.result

    def act(self, function):
        """Call a function of the core that answers no call."""
        function(self.now)
        self._perform()

    @property
    def state(self):
        """The newest state that the driver has; raises ConnectionLost where it is stale."""
        return self.core.fresh_state(self.now)

    def target(self, command):
        """Give the core a servo target; raise what it raises."""
        try:
            self.core.set_servo_target(command, self.now)
        finally:
            self._perform()

    def follow(self, points, slows=False):
        """Follow points as the shell does; return the error of the answer, None for none, when the arm is free
        again."""
        self.core.trajectory_start("start", 0.016, 0, self.now)
        self._perform()
        start, error = self.answers.pop("start")
        assert error is None, error
        path = build_path(start.begin, JointTrajectory(tuple(points)), 0.0, self._model,
                          BuildOptions(START_TOLERANCE, slows=slows))
        self.core.follow("goal", path, start, TrajectoryTolerances((0.02,) * 6, (0.001,) * 6, 0.5), 0, self.now)
        self._perform()
        self.until(lambda: "goal" in self.answers, path.end + 3.0)
        self.run(0.2)
        assert self.core.is_free
        return self.answers.pop("goal")[1]

    # ---- faults ----

    def show(self, drop=(), **fields):
        """Put these fields into every frame from now on, whatever is true, and leave others out; without any, end
        that."""
        self.controller.change_fields(fields, drop)

    def cut(self, port, refused_for=0.0):
        """End the connection of a port, and refuse others for so long."""
        self.refused_until[port] = self.now + refused_for
        assert self._links[port]
        self._lose(port)
        self.core.closed(port, "connection closed by the controller", self.now)
        self._perform()

    def restart(self, down):
        """Switch the cabinet off for so long; its drives are off afterwards."""
        for port in Port:
            self.cut(port, down)
        self._is_off = True
        self._clock.after(down, self._boot)

    def _boot(self):
        self.controller.restart()
        self._shorten_frames()
        self._is_off = False

    def join_replies(self, seconds):
        """Hold the replies of the next time back, and deliver them in one piece."""
        self._joins_until = self.now + seconds
        self._clock.at(self._joins_until, self._deliver_joined)

    def execute(self, request):
        """Carry a request out; a subclass may do otherwise."""
        return self.controller.execute(request)

    # ---- evidence ----

    def times_of(self, name):
        return [at for at, request in self.sent if request["cmdName"] == name]

    def rest_after(self, moment):
        """Return from when on, after this moment, the arm rests until now; infinite while it moves."""
        at, moves = self._motions[-1]
        return math.inf if moves else max(at, moment)

    # ---- time ----

    def run(self, seconds):
        """Let time pass."""
        until = self.now + seconds
        while self._next(until):
            pass
        self._clock.now = until

    def until(self, condition, timeout=_PATIENCE_S):
        """Let time pass until the condition holds; return its value."""
        end = self.now + timeout
        while True:
            value = condition()
            if value:
                return value
            assert self._next(end), "waited %g s in vain" % timeout

    def _next(self, until):
        """Do what is due next, if it is due before that moment."""
        tick = max(self.core.next_deadline(), self.now, self.held_until)
        cycle, event = self._next_cycle, self._clock.next_due()
        if min(tick, cycle, event) > until:
            return False
        if event <= min(tick, cycle):
            self._clock.now = event
            self._clock.do_next()
        elif tick < cycle:
            self._ticks = self._ticks + 1 if tick == self.now else 0
            assert self._ticks < _MOST_TICKS, "the core asks for ticks without end"
            self._clock.now = tick
            self._tick()
        else:
            self._clock.now = cycle
            self._next_cycle += CYCLE_TIME_S
            self._cycle()
        return True

    def _cycle(self):
        if not self._is_off:
            self.controller.step(CYCLE_TIME_S)
            self._send_due()
        if self._motions[-1][1] != self.is_moving:
            self._motions.append((self.now, self.is_moving))
        self.places.append(self.joints)
        if self._links[Port.STATUS]:
            self._unread += self.controller.feed_frame.text()
        if self.now >= self.held_until:
            self._read_feed()
            self._tick()
        if self.is_moving and self.core.is_free:
            self._unowned_since = self.now if self._unowned_since is None else self._unowned_since
            self.longest_unowned = max(self.longest_unowned, self.now - self._unowned_since)
        else:
            self._unowned_since = None

    def _read_feed(self):
        unread, self._unread = self._unread, b""
        if unread and self._links[Port.STATUS]:
            self.core.received(Port.STATUS, unread, self.now)
            self._perform()

    def _tick(self):
        self.core.tick(self.now)
        self._perform()

    # ---- the wire ----

    _ticks = 0

    def _new_connection(self):
        self._replies, self._stream = ReplyLine(), ObjectStream()

    def _lose(self, port):
        was_up, self._links[port] = self._links[port], False
        self._tries[port] += 1
        if port is Port.STATUS:
            self._unread = b""
        if was_up and port is Port.COMMAND:
            self._joined = b""
            self._new_connection()
            self.controller.state.client_lost()

    def _connected(self, port, number):
        if number != self._tries[port]:
            return
        if self.now < self.refused_until[port]:
            self.core.failed(port, "connection refused", self.now)
        else:
            self._links[port] = True
            if port is Port.COMMAND:
                self.controller.state.client_connected()
            self.core.opened(port, self.now)
        self._perform()

    def _perform(self):
        for action in self.core.take_actions():
            if isinstance(action, Answer):
                self._answer(action)
            elif isinstance(action, Send):
                assert self._links[Port.COMMAND], "bytes for a port that is closed"
                for request in self._stream.feed(action.data):
                    self._take(request)
            elif isinstance(action, Open):
                number = self._tries[action.port]
                self._clock.after(_CONNECTS_IN_S, lambda port=action.port, number=number: self._connected(port, number))
            elif isinstance(action, Close):
                self.closed_for.append(action.reason)
                self._lose(action.port)
            elif isinstance(action, PublishState):
                self.shown.append(action.state)

    def _answer(self, action):
        call = action.call
        if call is None:
            return
        if not isinstance(call, Call):
            assert call not in self.answers, "answered twice"
            self.answers[call] = action.result, action.error
            return
        assert not call.is_over, "answered twice"
        call.is_over, call.result, call.error, call.ended_at = True, action.result, action.error, self.now

    def _take(self, request):
        self.sent.append((self.now, request))
        if request["cmdName"] == "servo_j":
            self.frames.append((self.now, tuple(map(math.radians, request["jointPosition"]))))
        self._replies.add(self.execute(request))
        self._send_due()

    def _send_due(self):
        for result in self._replies.take_due():
            connection, reply = self._stream, result.due_reply()
            if self.reply_delay:
                self._clock.after(self.reply_delay, lambda connection=connection, reply=reply: self._reply(
                    connection, reply))
            else:
                self._reply(connection, reply)

    def _reply(self, connection, reply):
        if connection is not self._stream:
            return  # that connection is over
        if self.now < self._joins_until:
            self._joined += reply
            return
        self.core.received(Port.COMMAND, reply, self.now)
        self._perform()

    def _deliver_joined(self):
        reply, self._joined = self._joined, b""
        if reply:
            self.core.received(Port.COMMAND, reply, self.now)
            self._perform()


def moving_frames(frames):
    """Return times and joints of the frames from the last one before anything moves to the first one that is the last
    place.

    Args:
        frames: As ``SimulatedArm.frames``.

    Returns:
        s (n,), rad (n, 6).
    """
    times, joints = np.array([time for time, _ in frames]), np.array([joints for _, joints in frames])
    moved = np.flatnonzero(np.abs(np.diff(joints, axis=0)).max(axis=1) > 0.0)
    inside = slice(moved.min(), moved.max() + 2)
    return times[inside], joints[inside]
