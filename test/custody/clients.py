"""The clients of the driver: each like a program behind the ROS interface that knows only what the driver published."""
import math
import random
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from driver_process import Call, DriverProcess
from virtual_clock import Clock

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.point_stream import StreamPoint
from jaka_ros_driver.client.core.procedures import pausing, power, programs, recovery, settings
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.client.followed_path import followed_path
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory, TrajectoryPoint, TrajectoryTolerances

STOP_BUTTON = 9
"""The caller that asks for nothing but stops, and waits for no answer before the next one."""
MAINTAINER = 8
TRAJECTORY_HANDS = 7
"""The caller that replaces, pauses and slows motions that others have begun."""
QUEUERS = 100
REFUSALS_TO_GIVE_UP = 3
_TURN_BACK_S = 0.4
_REST_FIRST_S = 0.1
_STALL_S = 0.4
_LONGEST_JOG_END_S = 0.8


def _run(make: Callable[[Any], Any], is_exclusive: bool) -> Callable[[Any, Call, float], None]:
    return lambda core, call, now: core.run(call, make(core), now, MotionOwner.SETTING if is_exclusive else None)


def _take_target(core: Any, call: Call, command: Any, now: float) -> None:
    """Hand a servo target to the core and answer at once: as in the driver's shell, the call never waits."""
    error: Optional[JakaError] = None
    try:
        core.set_servo_target(command, now)
    except JakaError as refusal:
        error = refusal
    core.actions.answer(call, None, error)


def _six(axis: int, value: float) -> Tuple[float, ...]:
    return tuple([value if index == axis else 0.0 for index in range(6)])


def _added(a: Sequence[float], b: Sequence[float]) -> Tuple[float, ...]:
    return tuple([p + q for p, q in zip(a, b)])


def _segment(kind: str, by: Sequence[float], joints: Sequence[float], pose: c.Pose, speed: float, radius: float,
             model: ArmModel) -> Any:
    """Return a segment that ends this far beside these joints or this pose, rad and m; never where the arm is."""
    if kind == "joint":
        target = tuple([min(max(value, low), high) for value, (low, high) in zip(_added(joints, by),
                                                                                 model.joint_limits)])
        return c.JointMove(target, 2.0 * speed, 8.0, radius)
    target_pose = c.Pose(_added(pose.position, by[:3]), pose.rpy)
    if kind == "line":
        return c.LinearMove(target_pose, speed, 1.0 + 6.0 * speed, radius)
    return c.ArcMove(c.Pose(_added(pose.position, by[3:]), pose.rpy), target_pose, speed, 1.0 + 6.0 * speed, radius)


def _points(targets: Sequence[Tuple[float, ...]], apart: float, first_at: float,
            form: str) -> Tuple[TrajectoryPoint, ...]:
    """Return points at rest at each target; or without velocities; or with those of a curve through them to rest."""
    points = []
    for index, target in enumerate(targets):
        velocity: Optional[Tuple[float, ...]] = (0.0,) * 6
        if form == "straight":
            velocity = None
        elif form == "flowing" and 0 < index < len(targets) - 1:
            velocity = tuple([(b - a) / (2.0 * apart) for a, b in zip(targets[index - 1], targets[index + 1])])
        points.append(TrajectoryPoint(first_at + apart * index, target, velocity))
    return tuple(points)


class Clients:
    """The makers of a scenario's calls.

    Attributes:
        calls: All calls made.
        are_gone: No client asks for anything any more.
    """

    def __init__(self, clock: Clock, driver: DriverProcess, model: ArmModel) -> None:
        self._clock, self._driver, self._model = clock, driver, model
        self._busy: Dict[int, Call] = {}
        self._jogger = 0
        self._streams = 0
        self.calls: List[Call] = []
        self.are_gone = False

    def has_lost_driver(self) -> None:
        """Forget the open calls: the driver's process has died, and each waiting client loses its connection."""
        self._busy = {}
        self._jogger += 1
        self._streams += 1

    def has_driver(self, driver: DriverProcess) -> None:
        """Turn to a driver that has been started in place of the last one."""
        self._driver = driver

    # ---- one call ----

    def ask(self, kind: str, command: Any, give: Callable[[Any, Call, float], None], caller: int = STOP_BUTTON,
            waits: bool = False, on_answer: Optional[Callable[[Call], None]] = None) -> None:
        """Make a call, unless this caller still waits for an answer."""
        before = self._busy.get(caller)
        if self.are_gone or (caller != STOP_BUTTON and before is not None and not before.is_answered):
            return
        call = Call(kind, command, give, waits, on_answer)
        self._busy[caller] = call
        self.calls.append(call)
        self._driver.call(call)

    def stop(self, caller: int = STOP_BUTTON, on_answer: Optional[Callable[[Call], None]] = None) -> None:
        """Call stop, whatever other answers are still outstanding."""
        self.ask("stop", None, lambda core, call, now: core.stop(call, now), STOP_BUTTON, on_answer=on_answer)

    def auto_enable(self) -> None:
        """Power and enable the arm once, as a driver with ``auto_enable`` does at its start."""
        self.ask("auto_enable", None, lambda core, call, now: core.run(
            None, power.auto_enable(core, core.disturbances - core.link_losses), now))

    def joint_move(self, caller: int, delta: Sequence[float], speed: float, acceleration: float, wait: bool) -> None:
        """Move by ``delta`` from the last published joints, clamped to the joint limits."""
        joints = _added(self._joints(), delta)
        target = tuple([min(max(value, low), high) for value, (low, high) in zip(joints, self._model.joint_limits)])
        command = c.JointMove(target, speed, acceleration)
        self.ask("move", command, lambda core, call, now: core.move(call, command, wait, now), caller, wait)

    def linear_move(self, caller: int, shift: Sequence[float], turn: Sequence[float], speed: float,
                    acceleration: float, wait: bool) -> None:
        """Move by ``shift`` and ``turn`` from the last published tool pose."""
        pose = self._pose()
        if pose is not None:
            target = c.Pose(_added(pose.position, shift), _added(pose.rpy, turn))
            command = c.LinearMove(target, speed, acceleration)
            self.ask("move", command, lambda core, call, now: core.move(call, command, wait, now), caller, wait)

    def trajectory(self, caller: int, ways: Sequence[Sequence[float]], apart: float, first_at: float, form: str,
                   delay: float, build_time: float, lead: float, then: str, then_after: float) -> None:
        """Send points around the last published joints as the shell does: start, audit, goal."""
        joints = self._joints()
        targets = [tuple([min(max(value, low), high) for value, (low, high) in zip(
            _added(joints, way), self._model.joint_limits)]) for way in ways]
        if first_at == 0.0:
            targets[0] = tuple(joints)
        points = _points(targets, apart, first_at, form)

        def started(call: Call) -> None:
            if call.result is not None:
                self._clock.after(build_time, lambda: self._follow(caller, points, -delay, call, then, then_after))
                if then == "stop before":
                    self._clock.after(0.5 * build_time, self.stop)

        def give(core: Any, call: Call, now: float) -> None:
            call.stops = core.stops
            core.trajectory_start(call, lead, call.stops, now)
        self.ask("trajectory_start", None, give, caller, on_answer=started)

    def _follow(self, caller: int, points: Tuple[TrajectoryPoint, ...], elapsed: float, asked: Call, then: str,
                then_after: float) -> None:
        start = asked.result
        try:
            core = self._driver.core
            path = followed_path(start, JointTrajectory(points), 0.0 if start.running is not None else elapsed,
                                 self._model, core, core.stops)
        except InvalidTrajectory:
            return
        command = c.JointMove(path.at(path.end).position, 1.0, 1.0)
        tolerances = TrajectoryTolerances((None,) * 6, (0.01,) * 6, 1.0)

        def give(core: Any, call: Call, now: float) -> None:
            call.path, call.start, call.asked = path, start, asked
            core.follow(call, path, start, tolerances, asked.stops, now)
        self.ask("trajectory", command, give, caller, waits=True)
        goal = self._busy.get(caller)
        if then and goal is not None and goal.command is command:
            self._clock.after(then_after, lambda: self._then(goal, then))

    def _then(self, goal: Call, then: str) -> None:
        if self.are_gone:
            return
        caller = TRAJECTORY_HANDS
        if then == "cancel":
            self._driver.whenever_awake(lambda now: goal.is_given and self._driver.core.cancel_trajectory(goal, now)
                                        and None)
        elif then == "replace":
            self.trajectory(caller, ((0.1, -0.1, 0.05, 0.0, 0.1, 0.2),), 1.0, 1.0, "rest", 0.0, 0.002, 0.016, "", 0.0)
        elif then == "pause":
            self.procedure(caller, "pause", None)
            self._clock.after(1.0, lambda: self.procedure(caller, "resume", None))
        elif then == "speed":
            self.procedure(caller, "speed", 0.3)
            self._clock.after(1.5, lambda: self.procedure(caller, "speed", 1.0))

    def path(self, caller: int, segments: Sequence[Tuple[str, Sequence[float]]], radius: float, speed: float, then: str,
             then_after: float) -> None:
        """Send segments around the last published pose."""
        joints, pose = self._joints(), self._pose()
        if pose is None:
            return
        commands = [_segment(kind, by, joints, pose, speed, radius if n + 1 < len(segments) else 0.0, self._model)
                    for n, (kind, by) in enumerate(segments)]

        def give(core: Any, call: Call, now: float) -> None:
            core.move_path(call, commands, lambda: call.is_cancelled, lambda: None, now)
        self.ask("path", commands, give, caller, waits=True)
        goal = self._busy.get(caller)
        if then and goal is not None and goal.command is commands:
            self._clock.after(then_after, lambda: self._then_with_path(goal, then))

    def _then_with_path(self, goal: Call, then: str) -> None:
        if self.are_gone:
            return
        if then == "cancel":
            goal.is_cancelled = True
            self._driver.whenever_awake(lambda now: goal.is_given and self._driver.core.cancel_path(goal, now) and None)
        elif then == "stop":
            self.stop()
        else:
            self._then(goal, then)

    def program(self, caller: int, steps: Sequence[Tuple[str, float]]) -> None:
        """Play, pause, resume and stop a program, one step after the other, as long as each succeeds."""
        def next_step(call: Optional[Call], left: Sequence[Tuple[str, float]]) -> None:
            if not left or (call is not None and call.error is not None):
                return
            (step, after), rest = left[0], left[1:]
            self._clock.after(after, lambda: self._program_step(caller, step, lambda done: next_step(done, rest)))
        next_step(None, steps)

    def _program_step(self, caller: int, step: str, on_answer: Callable[[Call], None]) -> None:
        if step == "stop":
            self.stop(on_answer=on_answer)
        elif step == "play":
            self.ask("program", step, lambda core, call, now: core.play(call, None, now), caller, on_answer=on_answer)
        elif step == "resume":
            self.ask("program", step, lambda core, call, now: core.resume_program(call, None, now), caller,
                     on_answer=on_answer)
        else:
            make = programs.pause if step == "pause" else lambda core: programs.load(core, "weld.ngc")
            self.ask("run", ("program", step), _run(make, step == "load"), caller, on_answer=on_answer)

    def servo_mode(self, caller: int, active: bool, on_answer: Optional[Callable[[Call], None]] = None) -> None:
        """Enter or leave servo mode."""
        self.ask("servo_mode", active, lambda core, call, now: core.servo_mode(call, active, now), caller,
                 on_answer=on_answer)

    def procedure(self, caller: int, name: str, value: Any,
                  on_answer: Optional[Callable[[Call], None]] = None) -> None:
        """Call a procedure that takes several requests."""
        frame = c.Pose((0.01, 0.0, 0.05), (0.0, 0.0, 0.3))
        make, is_exclusive = {
            "power": (lambda core: power.set_power(core, value), False),
            "enable": (lambda core: power.set_enabled(core, value), False),
            "recover": (lambda core: recovery.recover(core), False),
            "clear_error": (lambda core: power.clear_error(core), False),
            "hand_guiding": (lambda core: settings.set_hand_guiding(core, value), True),
            "tool_frame": (lambda core: settings.set_tool_frame(
                core, c.SetToolFrame(value, frame, "tool"), True), True),
            "user_frame": (lambda core: settings.set_user_frame(
                core, c.SetUserFrame(value, frame, "user"), True), True),
            "payload": (lambda core: settings.set_payload(core, 0, c.SetPayload(value, (0.0, 0.0, 0.02))), True),
            "pause": (lambda core: pausing.pause(core), False),
            "resume": (lambda core: pausing.resume(core), False),
            "speed": (lambda core: pausing.set_speed(core, value), False),
            "query": (lambda core: core.ask(c.Query.VERSION), False)}[name]
        self.ask("run", (name, value), _run(make, is_exclusive), caller, on_answer=on_answer)

    # ---- many calls ----

    def maintenance(self, every: float, recovers: bool = False) -> None:
        """Make the arm ready whenever it cannot move: by clear_error, power and enable; or by recover."""
        def next_step(call: Optional[Call], steps: List[Tuple[str, Any]]) -> None:
            if steps and (call is None or call.error is None):
                name, value = steps[0]
                self.procedure(MAINTAINER, name, value, lambda answered: next_step(answered, steps[1:]))

        def look() -> None:
            state = self._state()
            if state is not None and not (state.is_enabled and not state.protective_stop and not state.has_fault):
                next_step(None, [("recover", None)] if recovers else [
                    ("clear_error", None), ("power", True), ("enable", True)])
            if not self.are_gone:
                self._clock.after(every, look)
        look()

    def queue(self, caller: int, joint: int, ways: Sequence[float], speed: float, first_waits: bool,
              apart: float) -> None:
        """Send several moves of one joint, from several callers, one after the other."""
        start = self._joints()

        def move(index: int) -> None:
            target = _added(start, _six(joint, ways[index]))
            command, waits = c.JointMove(target, speed, 4.0 + 4.0 * speed), first_waits and index == 0
            self.ask("move", command, lambda core, call, now: core.move(call, command, waits, now),
                     QUEUERS + 10 * caller + index, waits)
        for index in range(len(ways)):
            self._clock.after(apart * index, lambda index=index: move(index))

    def jogging(self, caller: int, frame: int, axis: int, velocity: float, rate: float, duration: float,
                then_back: bool) -> None:
        """Repeat a jog call for a while, then perhaps the other way, then stop calling."""
        self._jogger += 1
        jogger, until = self._jogger, self._clock.now + duration

        def again(command: c.Jog, last: float, goes_back: bool) -> None:
            if self.are_gone or jogger != self._jogger:
                return  # a later jog has taken its place
            self.ask("jog", command, lambda core, call, now: core.jog(call, command, now), caller)
            if self._clock.now + 1.0 / rate < last:
                self._clock.after(1.0 / rate, lambda: again(command, last, goes_back))
            elif goes_back:
                back = c.Jog(command.frame, command.axis, -command.velocity)
                self._clock.after(1.0 / rate, lambda: again(back, last + 0.5 * duration, False))
        again(c.Jog(c.JogFrame(frame), axis, velocity), until, then_back)

    def velocity_jog(self, caller: int, frame: int, axis: int, speed: float, rate: float, duration: float, end: str,
                     says_rest: bool) -> None:
        """Publish rest for a moment, then motion for a while, then one of several ends."""
        began, source = self._clock.now, "/pad_%d" % caller
        stamps = [began]

        def again() -> None:
            now = self._clock.now
            over = now - began - _REST_FIRST_S - duration
            if self.are_gone or over > _LONGEST_JOG_END_S:
                return
            said: Optional[float] = 0.0 if says_rest and now - began < _REST_FIRST_S else speed
            delay = 0.0
            if over > 0.0:
                if end == "silence":
                    return
                if end == "nonsense" and over < 0.1:
                    said = None
                elif end == "stalled" and over < _STALL_S:
                    delay = _STALL_S - over
                elif end == "second":
                    self._jog_message("/other", now, said, frame, axis)
                elif end == "rest":
                    said = 0.0
            if over <= 0.0 or end != "frozen":
                stamps[0] = now
            self._clock.after(delay, lambda stamp=stamps[0], said=said: self._jog_message(
                source, stamp, said, frame, axis))
            self._clock.after(1.0 / rate, again)
        again()

    def _jog_message(self, source: str, stamp: float, speed: Optional[float], frame: int, axis: int) -> None:
        wish = None if speed is None else Wish(c.JogFrame(frame), _six(axis, speed))

        def give(core: Any, call: Call, now: float) -> None:
            error: Optional[JakaError] = None
            try:
                core.jog_velocity(JogMessage(source, int(1e9 * stamp), now - stamp, now, wish, "nonsense"), now)
            except JakaError as refusal:
                error = refusal
            core.actions.answer(call, None, error)
        if not self.are_gone:
            self._driver.call(Call("jog_message", (source, stamp, speed), give))

    def point_stream(self, caller: int, rate: float, ahead: float, jitter: float, duration: float, speed: float,
                     axis: int, turns: bool, chance: int) -> None:
        """Publish single points along one joint, each so many periods ahead, whatever becomes of them."""
        random_of, began, joints = random.Random(chance), self._clock.now, self._joints()
        low, high = self._model.joint_limits[axis]

        def point(number: int) -> None:
            way = speed * (number + ahead) / rate
            if turns:
                way = 0.2 * math.copysign(1.0, speed) * (1.0 - math.cos(way / 0.2))
            position = _added(joints, _six(axis, way))
            position = position[:axis] + (min(max(position[axis], low), high),) + position[axis + 1:]
            late = random_of.uniform(0.0, jitter) / rate
            self._clock.after(late, lambda: self._point(StreamPoint(position, self._clock.now + ahead / rate)))
            if not self.are_gone and self._clock.now - began < duration:
                self._clock.after(1.0 / rate, lambda: point(number + 1))
        point(1)

    def _point(self, point: StreamPoint) -> None:
        if not self.are_gone:
            self._driver.call(Call("point", point, lambda core, call, now: core.follow_point(
                call, point, core.stops, now)))

    def servo_stream(self, caller: int, is_pose: bool, relative: bool, rate: float, duration: float, speed: float,
                     form: str, axis: int, on_end: Callable[[], None] = lambda: None) -> None:
        """Send targets at a steady rate along one axis, from the last published place."""
        self._streams += 1
        stream, began, step = self._streams, self._clock.now, speed / rate
        joints, pose = self._joints(), self._pose()
        if pose is None and is_pose:
            return
        refused = [0]
        way = [0.0]

        def noted(call: Call) -> None:
            refused[0] = refused[0] + 1 if call.error is not None else 0

        def again(count: int) -> None:
            passed = self._clock.now - began
            if (self.are_gone or stream != self._streams or passed > duration
                    or refused[0] >= REFUSALS_TO_GIVE_UP):
                on_end()
                return
            by = self._next_step(form, step, passed, count)
            way[0] += by
            self._target(self._servo_command(is_pose, relative, axis, by if relative else way[0], joints, pose), noted)
            self._clock.after(1.0 / rate, lambda: again(count + 1))
        again(0)

    @staticmethod
    def _next_step(form: str, step: float, passed: float, count: int) -> float:
        if form == "hold":
            return 0.0
        if form == "jump":
            return step * (1.0 if count % 2 == 0 else -1.0)
        return -step if form == "turn back" and int(passed / _TURN_BACK_S) % 2 else step

    @staticmethod
    def _servo_command(is_pose: bool, relative: bool, axis: int, value: float, joints: Sequence[float],
                       pose: Optional[c.Pose]) -> Any:
        if not is_pose:
            return c.ServoJoint(_six(axis, value) if relative else _added(joints, _six(axis, value)), relative)
        by = _six(axis, 0.2 * value)
        start = c.Pose((0.0,) * 3, (0.0,) * 3) if relative or pose is None else pose
        return c.ServoPose(c.Pose(_added(start.position, by[:3]), _added(start.rpy, by[3:])), relative)

    def servo_burst(self, caller: int, count: int, within: float, step: float, axis: int, relative: bool) -> None:
        """Send many targets at once, as a client does that has woken up late."""
        joints = self._joints()
        for index in range(count):
            value = step if relative else step * (index + 1)
            command = self._servo_command(False, relative, axis, value, joints, None)
            self._clock.after(within * index / count, lambda command=command: self._target(command, None))

    def servo_session(self, caller: int, burst: bool, leaves: bool, pause: float, **stream: Any) -> None:
        """Enter servo mode, stream for a while, and leave it or not."""
        def entered(call: Call) -> None:
            if call.error is None:
                self._clock.after(pause, streams)

        def streams() -> None:
            if burst:
                self.servo_burst(caller, 40, 0.02, 0.1, stream["axis"], False)
            self.servo_stream(caller, on_end=ended, **stream)

        def ended() -> None:
            if leaves:
                self.servo_mode(caller, False)
        self.servo_mode(caller, True, entered)

    def _target(self, command: Any, on_answer: Optional[Callable[[Call], None]]) -> None:
        self.ask("servo_target", command, lambda core, call, now: _take_target(core, call, command, now),
                 on_answer=on_answer)

    # ---- the published state ----

    def _state(self) -> Optional[RobotState]:
        return self._driver.shown

    def _joints(self) -> Tuple[float, ...]:
        state = self._state()
        return HOME if state is None else state.joint_position

    def _pose(self) -> Optional[c.Pose]:
        state = self._state()
        if state is None or state.tcp_position is None or state.tcp_rpy is None:
            return None
        return c.Pose(state.tcp_position, state.tcp_rpy)


