"""The thread that sends one servo frame every 8 ms while servo mode is on."""
import logging
import threading
import time
from typing import Callable, Optional, Union

from jaka_ros_driver.client.servo_planner import JointServo, PoseServo
from jaka_ros_driver.client.servo_trace import ServoTrace
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Pose, ServoJoint, ServoPose
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, JakaError
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

PERIOD = 0.008
"""s, the controller's interpolation cycle (controller protocol 5.6.5)."""
_TCP_SPEED_UNKNOWN = 1.0
_MAX_JOINT_DEVIATION = 0.04
"""rad; more than the step of one cycle at 180 deg/s, behind which a controller ignores frames."""
_MAX_LINEAR_DEVIATION = 0.03
"""m, of the tool or of a point beside it."""

Frame = Union[ServoJoint, ServoPose]


class ServoStream:
    """Holds the arm where it is until targets come, follows them, and holds again when they stop.

    After ``servo_timeout`` without a target, and on the first frame that the controller refuses, the stream ends and
    ``on_ended`` is called with the reason. Late cycles are left out, never caught up in a burst.
    """

    def __init__(self, model: ArmModel, settings: ClientSettings, send: Callable[[Frame], bool],
                 measured: Callable[[], Optional[RobotState]], on_ended: Callable[[str], None]) -> None:
        """Prepare; ``start`` begins.

        Args:
            model: Whose speed limits hold.
            settings: Time-out and largest jumps.
            send: Puts a frame on the wire; False when the stream has been ended meanwhile. Raises a JakaError.
            measured: The newest state, None when it is stale.
            on_ended: Called once, in the stream's thread, when the stream ends by itself.
        """
        self._model = model
        self._settings = settings
        self._send = send
        self._measured = measured
        self._on_ended = on_ended
        self._lock = threading.Lock()
        self._servo: Union[JointServo, PoseServo, None] = None
        self._last_target_at = 0.0
        self._trace = ServoTrace()
        self._stop = threading.Event()
        self._failure = ""
        self.late_cycles = 0
        self._thread = threading.Thread(target=self._run, name="servo stream", daemon=True)

    def start(self, state: RobotState) -> None:
        """Begin to hold the arm where ``state`` has it."""
        self._servo = self._joint_servo(state)
        self._last_target_at = time.monotonic()
        self._thread.start()

    def stop(self) -> None:
        """Send no more; does not wait for the thread."""
        self._stop.set()

    def join(self) -> None:
        """Wait until the thread has ended."""
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def set_target(self, command: Frame) -> None:
        """Follow this target from the next cycle on.

        Raises:
            InvalidCommand: It is too far away, or the stream has ended; nothing moves.
        """
        with self._lock:
            if self._stop.is_set():
                raise InvalidCommand("refused: servo mode has ended" + (": " + self._failure if self._failure else ""))
            if isinstance(command, ServoJoint):
                joint_servo = self._servo
                if not isinstance(joint_servo, JointServo):
                    joint_servo = self._joint_servo(self._fresh_state())
                joint_servo.set_target(command.joint_position, command.relative)
                self._follow(joint_servo)
            else:
                pose_servo = self._servo
                if not isinstance(pose_servo, PoseServo):
                    pose_servo = self._pose_servo(self._fresh_state())
                pose_servo.set_target(command.target, command.relative)
                self._follow(pose_servo)
            self._last_target_at = time.monotonic()

    def hold_joints(self) -> None:
        """Hold the arm by its joints from the next cycle on; a stream of poses begins anew with its next target.

        Raises:
            InvalidCommand: Where the arm is, is not known.
        """
        with self._lock:
            if not isinstance(self._servo, JointServo):
                self._follow(self._joint_servo(self._fresh_state()))

    def deviation(self, state: RobotState) -> str:
        """How far the arm is from everything that it was sent lately, in words; "" where it is near something."""
        with self._lock:
            servo = self._servo
            point = None if servo is None else servo.measured_point(state)
            excess = 0.0 if point is None else self._trace.excess(point)
        is_joint = isinstance(servo, JointServo)
        if excess <= (_MAX_JOINT_DEVIATION if is_joint else _MAX_LINEAR_DEVIATION):
            return ""
        return "the arm is %.3f %s from where it was sent" % (excess, "rad" if is_joint else "m")

    def rejected(self, rejection: CommandRejected) -> None:
        """The controller refused a frame: the stream ends."""
        self._failure = self._failure or str(rejection)

    def _run(self) -> None:
        deadline = time.monotonic()
        reason = ""
        while not self._stop.is_set():
            with self._lock:
                servo = self._servo
                assert servo is not None
                frame = servo.next_frame()
                self._trace.sent(servo.point, time.monotonic())
                silent = time.monotonic() - self._last_target_at
            try:
                if not self._send(frame):
                    return
            except JakaError as error:
                self._failure = self._failure or str(error)
            if self._failure:
                reason = "servo stream ended: " + self._failure
                break
            if silent > self._settings.servo_timeout:
                reason = self._failure = "no servo target for %.1f s" % silent
                break
            deadline += PERIOD
            late = time.monotonic() - deadline
            if late > PERIOD:
                self.late_cycles += 1
                deadline += PERIOD * int(late / PERIOD)
            self._stop.wait(max(0.0, deadline - time.monotonic()))
        if reason and not self._stop.is_set():
            self._stop.set()
            _LOG.warning("%s", reason)
            self._on_ended(reason)

    def _follow(self, servo: Union[JointServo, PoseServo]) -> None:
        if servo is not self._servo:
            self._servo, self._trace = servo, ServoTrace()

    def _fresh_state(self) -> RobotState:
        state = self._measured()
        if state is None:
            raise InvalidCommand("refused: no fresh status of the arm")
        return state

    def _joint_servo(self, state: RobotState) -> JointServo:
        start = state.joint_position_commanded or state.joint_position
        return JointServo(start, self._model.joint_max_speed, self._settings.servo_max_joint_jump, PERIOD)

    def _pose_servo(self, state: RobotState) -> PoseServo:
        if state.tcp_position is None or state.tcp_rpy is None:
            raise InvalidCommand("refused: the controller does not report the tool pose")
        return PoseServo(Pose(state.tcp_position, state.tcp_rpy), self._model.tcp_max_speed or _TCP_SPEED_UNKNOWN,
                         self._settings.servo_max_linear_jump, self._settings.servo_max_angular_jump, PERIOD)
