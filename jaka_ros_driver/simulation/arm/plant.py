"""The simulated arm: its joints over time. No sockets, threads, clock or wire units; SI throughout."""
import math
from typing import Callable, Dict, List, Optional, Sequence, Tuple

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import distance_between
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.coasting import Coast
from jaka_ros_driver.simulation.arm.events import PlantEvent, TargetRejected
from jaka_ros_driver.simulation.arm.frames import ArmFrames, checked_transform, finite_six, same_joints
from jaka_ros_driver.simulation.arm.hand_guiding import HandGuiding
from jaka_ros_driver.simulation.arm.jog import JogMode, jog_route
from jaka_ros_driver.simulation.arm.legs import LineLeg, arc_through
from jaka_ros_driver.simulation.arm.limit_watch import NEAR_LIMIT, LimitWatch
from jaka_ros_driver.simulation.arm.motion_queue import MotionQueue
from jaka_ros_driver.simulation.arm.moves import DEFAULT_JOINT_ACCELERATION, positive, same_pose, tool_pace, tool_rate
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S
from jaka_ros_driver.simulation.arm.routes import JointRoute
from jaka_ros_driver.simulation.arm.servo import MAX_WAITING, ServoStream, Starvation
from jaka_ros_driver.simulation.arm.servo_filters import ServoFilter, checked_parameters, make_filter
from jaka_ros_driver.state import Vector

__all__ = ["CYCLE_TIME_S", "HOME", "JogMode", "NEAR_LIMIT", "Plant", "ServoFilter", "Starvation"]

HOME = (0.0, math.pi / 2, -math.pi / 2, math.pi / 2, math.pi / 2, 0.0)
"""The joints at the start, rad (6,), away from the singularities of the main family."""

_STILL: Vector = (0.0,) * 6
_SAME_MOMENT_S = 1e-6
"""Rounding, s, of sums of cycles: far below a cycle (8 ms), far above what floats lose in a day."""


class Plant:
    """The arm's joints over time. Call its methods between cycles and ``step`` once a cycle; no method blocks.

    It knows nothing of power, latched stops and sockets: its owner decides which commands reach it. A command that the
    arm cannot carry out raises TargetRejected and changes nothing.

    Attributes:
        queue: The accepted moves and the jog; pauses, resumes and ends them along their paths.
        joint_position: Measured joint angles, rad (6,); the commanded ones, too, because the drives are ideal.
        joint_velocity: Mean over the last cycle, rad/s (6,).
        servo_leave_delay: How long servo mode lasts after it was left, s; the arm takes no more points then.
        max_waiting: Largest number of servo points behind the one for the next cycle.
        drops_points: False where the points that wait run out before a stop, or leaving servo mode, takes effect.
        acceleration_share: Acceleration of moves, as a share of what they ask for, within the model's limits.
        rapid_rate: Speed override in force, 0 to 1.
        settle_time: How long is_in_position stays False at least after a move was accepted, s. With the period of the
            status feed, the first frame after the acceptance shows it.
        add_error_line: ``executing_line_id`` of the last move not queued because its target is the end of the queue; 0
            for none. The next move that is queued clears it: ids restart at 2 in every client (docs/sdk-client.md
            section 1, point 7).
    """

    def __init__(self, model: ArmModel, joint_position: Sequence[float] = HOME, *,
                 starvation: Starvation = Starvation.HOLD) -> None:
        """Set up an arm at rest at these joints, rad (6,).

        starvation: Reaction to a servo stream without more points.
        """
        self.settle_time = 0.04
        self._starvation = starvation
        self._frames = ArmFrames(model)
        self.joint_position: Vector = finite_six("joint_position", joint_position)
        self._before = self.joint_position
        self._dt = CYCLE_TIME_S
        self.joint_velocity = _STILL
        self.queue = MotionQueue(self._frames)
        self.servo_leave_delay = 0.0
        self.max_waiting = MAX_WAITING
        self.drops_points = True
        self._after_points: Optional[Callable[[], None]] = None
        self._servo: Optional[ServoStream] = None
        self._leaves_servo_in: Optional[float] = None
        self._guiding: Optional[HandGuiding] = None
        self._coast: Optional[Coast] = None
        self._filter_kind = ServoFilter.NONE
        self._filter_parameters: Dict[str, float] = {}
        self.acceleration_share = 1.0
        self.rapid_rate = 1.0
        self._unsettled = 0.0
        self.add_error_line = 0
        self._events: List[PlantEvent] = []
        self._watch = LimitWatch(self._frames, self.joint_position)
        self._pose: Optional[Pose] = None

    # --- what can be seen -------------------------------------------------------------------------------------------

    def tcp_pose(self) -> Pose:
        """Return the measured pose of the active tool in the active user frame, m and rpy rad."""
        if self._pose is None:
            self._pose = self._frames.pose_at(self.joint_position)
        return self._pose

    @property
    def tcp_speed(self) -> float:
        """The speed of the tool centre point over the last cycle, m/s."""
        if self.joint_velocity is _STILL:
            return 0.0
        before, now = self._frames.tool_at(self._before), self._frames.tool_at(self.joint_position)
        return distance_between(before, now) / self._dt

    @property
    def is_in_position(self) -> bool:
        """True when nothing is queued, running or coasting and settle_time has passed since the last acceptance."""
        if not self.is_settled or self._coast is not None or not self.queue.is_empty:
            return False
        if self._guiding is None and self.joint_velocity is not _STILL:
            return False
        return self._servo is None or self._servo.is_idle

    @property
    def is_moving(self) -> bool:
        """True while any joint moves, for whatever reason."""
        return self.joint_velocity is not _STILL

    @property
    def is_servo_active(self) -> bool:
        """True in servo (streaming) mode."""
        return self._servo is not None

    @property
    def takes_servo_points(self) -> bool:
        """True in servo mode until ``leave_servo``."""
        return self._servo is not None and self._leaves_servo_in is None and self._after_points is None

    @property
    def is_settled(self) -> bool:
        """True when ``settle_time`` has passed since the last acceptance."""
        return self._unsettled <= 0.0

    @property
    def is_hand_guided(self) -> bool:
        return self._guiding is not None

    @property
    def on_soft_limit(self) -> bool:
        return self._frames.joint_on_limit(self.joint_position) is not None

    @property
    def near_limit(self) -> Tuple[bool, ...]:
        """True for each joint that is close to a soft limit (feed field ``drag_near_limit``)."""
        near = [joint for joint, _ in self._watch.near(self.joint_position)]
        return tuple(joint in near for joint in range(6))

    def take_events(self) -> List[PlantEvent]:
        """Return the events since the last call, oldest first."""
        taken, self._events = self._events, []
        return taken

    # --- frames and kinematics --------------------------------------------------------------------------------------

    def set_tool(self, flange_t_tool: Pose) -> None:
        """Make this the active tool. Moves that are queued already keep the tool with which they were added."""
        self._frames.set_tool(checked_transform(flange_t_tool))
        self._pose = None

    def set_user_frame(self, base_t_user: Pose) -> None:
        """Make this the active user frame. Moves that are queued already keep theirs."""
        self._frames.set_user_frame(checked_transform(base_t_user))
        self._pose = None

    def forward(self, joint_position: Sequence[float]) -> Pose:
        """Return the pose of the active tool in the active user frame at these joints, rad (6,); raise as
        ``finite_six``.
        """
        return self._frames.pose_at(finite_six("joint_position", joint_position))

    def inverse_nearest(self, pose: Pose, reference: Sequence[float]) -> Vector:
        """Return the joints for a pose in the active user frame, as ``ArmFrames.reachable_joints`` does."""
        return self._frames.reachable_joints(self._frames.in_base(pose), finite_six("reference", reference))

    # --- queued moves -----------------------------------------------------------------------------------------------
    # Each returns True when the move was queued, False when its target is where the queue ends (add_error_line then
    # holds its line_id), and raises TargetRejected for a target out of reach or outside limits, numbers that are
    # missing, surplus or not finite, speed or acceleration not above 0, and in servo mode, hand guiding or a jog.
    # line_id is the ``executing_line_id`` of the wire.

    def add_joint_move(self, target: Sequence[float], speed: float, acceleration: Optional[float] = None,
                       relative: bool = False, line_id: int = 0, tolerance: float = 0.0) -> bool:
        """Queue a synchronised joint motion (docs/controller-protocol.md section 5.2).

        target, rad (6,): increments on the end of the queue where relative. speed, rad/s, and acceleration, rad/s2: of
        the joint with the longest way, cut to what every joint can do. tolerance, m: above 0 the target may be passed
        on the way to the next move's, see ``MotionQueue.blends_joint_moves``.
        """
        self._check_planned_mode()
        start = self._queue_end()
        values = finite_six("target", target)
        end = tuple(a + b for a, b in zip(start, values)) if relative else values
        return self._queue_joint_motion(start, end, speed, acceleration, line_id, tolerance > 0.0)

    def add_end_move(self, target: Pose, speed: float, acceleration: Optional[float] = None, line_id: int = 0) -> bool:
        """Queue a joint motion to a pose in the user frame (docs/controller-protocol.md section 5.3); speed rad/s."""
        self._check_planned_mode()
        start = self._queue_end()
        end = self._frames.reachable_joints(self._frames.in_base(target), start)
        return self._queue_joint_motion(start, end, speed, acceleration, line_id)

    def add_linear_move(self, target: Pose, speed: float, acceleration: Optional[float] = None, relative: bool = False,
                        tolerance: float = 0.0, rotation_speed: Optional[float] = None,
                        rotation_acceleration: Optional[float] = None, line_id: int = 0) -> bool:
        """Queue a straight line of the tool (docs/controller-protocol.md section 5.4.1): m/s, m/s2, rad/s, rad/s2.

        target, in the active user frame: where relative, added along the axes of that frame and turned about them.
        tolerance, m: how far the rounded corner to the next line may leave the lines; 0 for a full stop.
        """
        self._check_planned_mode()
        pace = tool_pace(self._frames.model, speed, acceleration, rotation_speed, rotation_acceleration,
                         self.acceleration_share)
        if not 0.0 <= tolerance < math.inf:
            raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "tolerance must be finite and not below 0")
        joints = self._queue_end()
        start = self._frames.tool_at(joints)
        end = self._frames.displaced(start, target) if relative else self._frames.in_base(target)
        self._frames.reachable_joints(end, joints)
        if same_pose(start, end):
            return self._already_there(line_id)
        self.queue.add_leg(LineLeg(start, end, pace, line_id, tolerance), joints)
        return self._accepted()

    def add_arc_move(self, via: Pose, target: Pose, speed: float, acceleration: Optional[float] = None,
                     relative: bool = False, turns: int = 0, circle_mode: int = 0, line_id: int = 0) -> bool:
        """Queue an arc from the queue's end by via to target (docs/controller-protocol.md section 5.4.2): m/s, m/s2.

        turns (``circle_cnt``): full circles before the arc. circle_mode: how the tool turns, see ``legs.arc_through``.
        """
        self._check_planned_mode()
        pace = tool_pace(self._frames.model, speed, acceleration, None, None, self.acceleration_share)
        joints = self._queue_end()
        start = self._frames.tool_at(joints)
        through = self._frames.displaced(start, via) if relative else self._frames.in_base(via)
        end = self._frames.displaced(start, target) if relative else self._frames.in_base(target)
        self._frames.reachable_joints(through, joints)
        if same_pose(start, end) and same_pose(start, through):
            return self._already_there(line_id)
        arc = arc_through(start, through, end, turns, circle_mode, pace, line_id)
        self._frames.reachable_joints(arc.end, joints)
        self.queue.add_leg(arc, joints)
        return self._accepted()

    def stop(self, jog: bool = True, stream: bool = True) -> None:
        """Slow down along the path, empty the queue and end a jog; in servo mode drop the points and stop.

        ``jog``, ``stream``: False where a jog, and a servo stream, are not ended.
        """
        if jog or not self.queue.is_jogging:
            self.queue.stop()
        if stream and self._after_points is None:
            self._when_points_are_out(self._end_stream)

    def _end_stream(self) -> None:
        if self._servo is not None:
            self._come_to_rest()
            self._servo = self._new_stream()

    def _when_points_are_out(self, act: Callable[[], None]) -> None:
        """Act at once, or where waiting points are not dropped, when the last of them has run."""
        if self.drops_points or self._servo is None or not self._servo.has_points:
            act()
        else:
            self._after_points = act

    def halt_protective(self) -> None:
        """Stop everything: queue and jog slow down along their path, servo mode and hand guiding end."""
        self.queue.stop()
        self._leave_servo_now()
        self.stop_hand_guiding()

    def halt_emergency(self) -> None:
        """Stop everything with the highest deceleration of the joints; the path is left."""
        self._come_to_rest()
        self.queue.clear()
        self._servo = self._guiding = self._leaves_servo_in = self._after_points = None

    def set_rapid_rate(self, rate: float) -> None:
        """Set the speed override, 0 to 1, also during a motion; raise TargetRejected for other values."""
        if not 0.0 <= rate <= 1.0:
            raise TargetRejected(events.BAD_SPEED, "rapid rate must be within 0 to 1")
        self.rapid_rate = rate

    # --- jog --------------------------------------------------------------------------------------------------------

    def jog(self, mode: JogMode, frame: JogFrame, axis: int, velocity: float, position: Optional[float] = None) -> bool:
        """Jog one axis (docs/controller-protocol.md section 5.5).

        Args:
            mode: Continuous (sign of velocity), step (sign of position), absolute.
            frame: JOINT, BASE (the axes of the active user frame) or TOOL.
            axis: 0..5: joint, or x, y, z, rx, ry, rz.
            velocity: rad/s or m/s.
            position: Step or target, rad or m; step and absolute only.

        Returns False where it is ignored because another motion runs; raises as ``jog_route``. A continuous jog that
        runs already gets the new velocity.
        """
        self._check_planned_mode()
        key = (frame, axis, velocity > 0.0)
        running_start = self.queue.running_jog_start(key) if mode == JogMode.CONTINUOUS else None
        if running_start is not None:
            again = jog_route(self._frames, running_start, mode, frame, axis, velocity, position)
            return again is not None and self.queue.change_jog(again)
        if not self.queue.takes_jog:
            return False
        route = jog_route(self._frames, self._queue_end(), mode, frame, axis, velocity, position)
        if route is not None:
            self.queue.start_jog(key, route)
            self._unsettled = self.settle_time
        return True

    # --- servo mode -------------------------------------------------------------------------------------------------

    def enter_servo(self) -> bool:
        """Enter servo mode; return False, and change nothing, where the arm moves or the queue is not empty."""
        if self._guiding is not None or self._coast is not None or not self.queue.is_empty:
            return False
        if self._servo is None:
            self._servo = self._new_stream()
        return True

    def leave_servo(self) -> None:
        """Leave servo mode after ``servo_leave_delay``; the arm comes to rest smoothly from now on."""
        if self._leaves_servo_in is None:
            self._when_points_are_out(self._begin_to_leave)

    def _begin_to_leave(self) -> None:
        if self.servo_leave_delay <= 0.0:
            self._leave_servo_now()
        elif self._servo is not None:
            self._come_to_rest()
            self._servo, self._leaves_servo_in = self._new_stream(), self.servo_leave_delay

    def _leave_servo_now(self) -> None:
        self._after_points = None
        if self._servo is not None:
            self._come_to_rest()
            self._servo = self._leaves_servo_in = None

    def servo_joint(self, target: Sequence[float], relative: bool = False, cycles: int = 1) -> bool:
        """Append a joint point, rad (6,), to be reached in ``cycles`` times 8 ms.

        It returns False when the point is ignored: over 180 deg/s (docs/controller-protocol.md section 5.6.5), or the
        buffer is full. Raises TargetRejected for bad numbers, beyond a soft limit and outside servo mode.
        """
        return self._streaming().add_joints(tuple(target), relative, cycles)

    def servo_pose(self, target: Pose, relative: bool = False, cycles: int = 1) -> bool:
        """Append one Cartesian point in the active user frame, as ``servo_joint`` does for joints."""
        return self._streaming().add_pose(target, relative, cycles)

    def set_servo_filter(self, kind: ServoFilter, **parameters: float) -> None:
        """Choose the servo stream's filter; parameters have their names on the wire, SI units (``lpf_cf=0.5``).

        Raises TargetRejected in servo mode, and where parameters are missing, surplus or out of range.
        """
        if self._servo is not None:
            raise TargetRejected(events.NOT_ALLOWED_IN_MODE, "the filter can't be changed in servo mode")
        self._filter_parameters = checked_parameters(kind, parameters)
        self._filter_kind = kind

    # --- hand guiding -----------------------------------------------------------------------------------------------

    def start_hand_guiding(self) -> None:
        """Let the arm be pushed; raise as ``check_hand_guiding`` does."""
        if self._guiding is None:
            self.check_hand_guiding()
            self._guiding = HandGuiding(self._frames.model, self.joint_position)

    def check_hand_guiding(self) -> None:
        """Raise TargetRejected where hand guiding cannot begin: in motion, in servo mode and on a soft limit."""
        if self._servo is not None or self._coast is not None or not self.queue.is_empty:
            raise TargetRejected(events.HAND_GUIDING_REFUSED_MOVING, "the arm moves or is in servo mode")
        if self.on_soft_limit:
            raise TargetRejected(events.HAND_GUIDING_ON_SOFT_LIMIT, "a joint is on its soft limit")

    def stop_hand_guiding(self) -> None:
        """End hand guiding; joints that move come to rest."""
        if self._guiding is not None:
            self._come_to_rest()
            self._guiding = None

    def push_joint(self, joint: int, velocity: float) -> bool:
        """Push joint 0..5 at a velocity, rad/s, until the next call.

        Without hand guiding it returns False and has no effect.
        """
        if self._guiding is None:
            return False
        self._guiding.push(joint, velocity)
        return True

    # --- time -------------------------------------------------------------------------------------------------------

    def step(self, dt: float = CYCLE_TIME_S) -> None:
        """Run one cycle of ``dt`` s."""
        self._unsettled -= dt
        if self._leaves_servo_in is not None:
            self._leaves_servo_in -= dt
            if self._leaves_servo_in < _SAME_MOMENT_S:
                self._leave_servo_now()
        if self._after_points is not None and self._servo is not None and not self._servo.has_points:
            act, self._after_points = self._after_points, None
            act()
        joints = self._next_joints(dt)
        if joints is None or joints == self.joint_position:
            if self.joint_velocity is not _STILL:
                self.joint_velocity, self._before, self._pose = _STILL, self.joint_position, None
            return
        self._before, self.joint_position, self._dt, self._pose = self.joint_position, joints, dt, None
        self.joint_velocity = tuple([(b - a) / dt for a, b in zip(self._before, joints)])
        if self._servo is not None or self._guiding is not None or self.queue.is_jogging:
            self._events += self._watch.look(self.joint_position)

    def _next_joints(self, dt: float) -> Optional[Vector]:
        """Return the joints after this cycle; None where nothing drives them."""
        if self._coast is not None:
            joints = self._coast.step(dt)
            if self._coast.is_done:
                self._coast = None
            return joints
        if self._guiding is not None:
            return self._guided(self._guiding, dt)
        if self._servo is not None:
            return self._streamed(self._servo, dt)
        queued, happened = self.queue.step(dt, self.rapid_rate)
        self._events += happened
        if self.queue.fault is not None:
            self._come_to_rest()
            self.queue.clear()
            return self._next_joints(dt) if self._coast is not None else None
        return queued

    def _guided(self, guiding: HandGuiding, dt: float) -> Vector:
        joints = guiding.step(dt)
        if guiding.hit_limit is not None:
            self._events += [events.on_soft_limit(*guiding.hit_limit), events.HAND_GUIDING_HIT_SOFT_LIMIT]
            self._come_to_rest(joints, guiding.velocity)
            self._guiding = None
        return joints

    def _streamed(self, stream: ServoStream, dt: float) -> Vector:
        self._events += stream.step(dt)
        for joint, (before, after, limit) in enumerate(
                zip(self.joint_position, stream.joints, self._frames.model.joint_max_speed)):
            if abs(after - before) > limit * dt * 1.001:
                self._events.append(events.overspeed(joint))
                return self._servo_failed(dt)
        if stream.has_failed:
            self._events.append(events.SERVO_STARVED)
            return self._servo_failed(dt)
        return stream.joints

    def _servo_failed(self, dt: float) -> Vector:
        self._leave_servo_now()
        return self.joint_position if self._coast is None else self._coast.step(dt)

    def _come_to_rest(self, joints: Optional[Vector] = None, velocity: Optional[Vector] = None) -> None:
        """Let the joints slow down from their present positions and speeds, unless they do so already."""
        if self._coast is None:
            coast = Coast(self._frames.model, joints or self.joint_position, velocity or self.joint_velocity)
            self._coast = None if coast.is_done else coast

    def _queue_end(self) -> Vector:
        standing_at = self.joint_position if self._coast is None else self._coast.end_joints
        return self.queue.end_joints(standing_at)

    def _new_stream(self) -> ServoStream:
        joints = self._queue_end()
        servo_filter = make_filter(self._filter_kind, self._filter_parameters, self._frames, joints)
        return ServoStream(self._frames, joints, servo_filter, self._starvation, self.max_waiting)

    def _streaming(self) -> ServoStream:
        if self._servo is None or not self.takes_servo_points:
            raise TargetRejected(events.NOT_ALLOWED_IN_MODE, "not in servo mode")
        return self._servo

    def _check_planned_mode(self) -> None:
        if self._servo is not None or self._guiding is not None:
            raise TargetRejected(events.NOT_ALLOWED_IN_MODE, "not in servo mode or hand guiding")

    def _queue_joint_motion(self, start: Vector, end: Vector, speed: float, acceleration: Optional[float],
                            line_id: int, may_pass_end: bool = False) -> bool:
        top = positive("speed", speed, 0.0)
        strongest = self.acceleration_share * positive("acceleration", acceleration, DEFAULT_JOINT_ACCELERATION)
        outside = self._frames.joint_outside(end)
        if outside is not None:
            raise TargetRejected(events.TARGET_OUTSIDE_LIMITS, "joint %d beyond its %s limit" % (
                outside[0] + 1, "upper" if outside[1] else "lower"))
        if same_joints(start, end):
            return self._already_there(line_id)
        tool_top = self._frames.model.tcp_max_speed
        if tool_top is not None:
            top = min(top, tool_top / max(tool_rate(self._frames, start, end), 1e-9))
        self.queue.add_joint_route(JointRoute(self._frames.model, start, end, top, strongest, line_id,
                                                  may_pass_end))
        return self._accepted()

    def _accepted(self) -> bool:
        self._unsettled = self.settle_time
        self.add_error_line = 0
        return True

    def _already_there(self, line_id: int) -> bool:
        self.add_error_line = line_id
        return False
