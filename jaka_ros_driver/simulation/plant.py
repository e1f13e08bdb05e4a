"""The simulated arm: where its joints are over time. No sockets, threads, clock or wire units; SI throughout."""
import enum
from typing import List, Optional, Sequence, Tuple

from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.events import PlantEvent, TargetRejected
from jaka_ros_driver.state import Vector

CYCLE_TIME = 0.008  # s, interpolation cycle: controller protocol 5.6.5
HOME = (0.0, 1.5707963267948966, -1.5707963267948966, 1.5707963267948966, 1.5707963267948966, 0.0)


class JogMode(enum.IntEnum):
    """How a jog ends; the numbers of the wire (controller protocol 5.5; 0, stop, is ``Plant.jog_stop``)."""

    CONTINUOUS = 1
    STEP = 2
    ABSOLUTE = 3


class Starvation(enum.Enum):
    """What the arm does when a servo stream runs dry."""

    HOLD = "hold"
    REPEAT = "repeat"


class ServoFilter(enum.IntEnum):
    """Filters of a servo stream; the numbers of the wire (SDK client 5)."""

    NONE = 0
    JOINT_LOW_PASS = 1
    JOINT_LIMITS = 2
    JOINT_MEAN = 3
    CARTESIAN_LIMITS = 4
    FORESIGHT = 5


class Plant:
    """Joints over time. Call methods between cycles, then ``step`` once a cycle; nothing blocks, nothing is timed.

    The plant knows no power, no stops that latch and no sockets: its owner gates the commands. A command the owner
    lets through and the plant can't take raises TargetRejected and changes nothing.
    """

    def __init__(self, model: ArmModel, joint_position: Sequence[float] = HOME, *,
                 starvation: Starvation = Starvation.HOLD, settle_time: float = 0.04) -> None:
        """Args:
            model: Geometry, joint limits and speeds.
            joint_position: Where the arm stands at first, rad (6,).
            starvation: What to do when a servo stream runs dry.
            settle_time: For at least so long after a move was accepted is_in_position stays False, s; set it to
                the period of the status feed, so that the first frame after acceptance shows it.
        """
        self.settle_time = settle_time
        self.starvation = starvation
        raise NotImplementedError

    # --- what can be seen -------------------------------------------------------------------------------------------

    @property
    def joint_position(self) -> Vector:
        """Measured joint angles, rad (6,)."""
        raise NotImplementedError

    @property
    def joint_velocity(self) -> Vector:
        """Over the last cycle, rad/s (6,)."""
        raise NotImplementedError

    @property
    def joint_position_commanded(self) -> Vector:
        """Commanded joint angles, rad (6,)."""
        raise NotImplementedError

    def tcp_pose(self) -> Pose:
        """Measured pose of the active tool in the active user frame, m and rpy rad."""
        raise NotImplementedError

    def tcp_pose_commanded(self) -> Pose:
        """Commanded pose of the active tool in the active user frame, m and rpy rad."""
        raise NotImplementedError

    @property
    def tcp_speed(self) -> float:
        """Speed of the tool centre point over the last cycle, m/s."""
        raise NotImplementedError

    @property
    def is_in_position(self) -> bool:
        """True when nothing is queued, running or coasting and settle_time has passed since the last acceptance."""
        raise NotImplementedError

    @property
    def is_moving(self) -> bool:
        """True while any joint moves, for whatever reason."""
        raise NotImplementedError

    @property
    def is_jogging(self) -> bool:
        """True from the acceptance of a jog until it has come to rest."""
        raise NotImplementedError

    @property
    def queue_length(self) -> int:
        """Accepted moves not yet completed, the running one included."""
        raise NotImplementedError

    @property
    def is_paused(self) -> bool:
        """True from ``pause`` until ``resume`` or ``stop``."""
        raise NotImplementedError

    @property
    def is_servo_active(self) -> bool:
        """True in servo (streaming) mode."""
        raise NotImplementedError

    @property
    def is_hand_guided(self) -> bool:
        """True while hand guiding is on."""
        raise NotImplementedError

    @property
    def on_soft_limit(self) -> bool:
        """True while a joint stands on a soft limit."""
        raise NotImplementedError

    @property
    def near_limit(self) -> Tuple[bool, ...]:
        """For each joint, True close to a soft limit (feed field ``drag_near_limit``)."""
        raise NotImplementedError

    @property
    def rapid_rate(self) -> float:
        """Speed override in force, 0 to 1."""
        raise NotImplementedError

    @property
    def motion_line(self) -> int:
        """``executing_line_id`` of the move running or last run; 0 before the first and for a move without one."""
        raise NotImplementedError

    @property
    def add_error_line(self) -> int:
        """``executing_line_id`` of the last move not queued because its target is the end of the queue; 0 for none.

        The next move that is queued clears it: ids restart at 2 in every client (SDK client 1.7).
        """
        raise NotImplementedError

    def take_events(self) -> List[PlantEvent]:
        """The events since the last call, oldest first."""
        raise NotImplementedError

    # --- frames and kinematics --------------------------------------------------------------------------------------

    def set_tool(self, flange_T_tool: Pose) -> None:
        """Make this the active tool. Moves queued before keep the tool they were given for."""
        raise NotImplementedError

    def set_user_frame(self, base_T_user: Pose) -> None:
        """Make this the active user frame. Moves queued before keep the frame they were given in."""
        raise NotImplementedError

    def forward(self, joint_position: Sequence[float]) -> Pose:
        """Pose of the active tool in the active user frame at these joints, rad (6,).

        Raises:
            TargetRejected: Not six finite numbers.
        """
        raise NotImplementedError

    def inverse_nearest(self, pose: Pose, reference: Sequence[float]) -> Vector:
        """Joints within the limits that bring the active tool to the pose in the active user frame, nearest reference.

        Raises:
            TargetRejected: Out of reach, or reachable beyond the joint limits only, or not finite.
        """
        raise NotImplementedError

    # --- queued moves -----------------------------------------------------------------------------------------------
    # Each returns True when the move was queued, False when its target is the end of the queue (add_error_line then
    # holds its line_id), and raises TargetRejected for a target out of reach or outside limits, numbers that are
    # missing, surplus or not finite, speed or acceleration not above 0, and in servo mode, hand guiding or a jog.

    def add_joint_move(self, target: Sequence[float], speed: float, acceleration: Optional[float] = None,
                       relative: bool = False, line_id: Optional[int] = None) -> bool:
        """Queue a synchronised joint motion (controller protocol 5.2).

        Args:
            target: rad (6,); increments on the end of the queue where relative.
            speed: Of the joint with the longest way, rad/s; cut to what every joint can do.
            acceleration: rad/s2; None for the default, cut as speed.
            relative: See target.
            line_id: ``executing_line_id``.
        """
        raise NotImplementedError

    def add_end_move(self, target: Pose, speed: float, acceleration: Optional[float] = None,
                     line_id: Optional[int] = None) -> bool:
        """Queue a joint motion to the tool pose target in the active user frame (controller protocol 5.3); rad/s."""
        raise NotImplementedError

    def add_linear_move(self, target: Pose, speed: float, acceleration: Optional[float] = None, relative: bool = False,
                        tolerance: Optional[float] = None, rotation_speed: Optional[float] = None,
                        rotation_acceleration: Optional[float] = None, line_id: Optional[int] = None) -> bool:
        """Queue a straight line of the active tool (controller protocol 5.4.1).

        Args:
            target: In the active user frame; where relative, position is added along the axes of the user frame and
                the rotation turns about them.
            speed: m/s.
            acceleration: m/s2.
            relative: See target.
            tolerance: The next line may round the corner at target by so much, m; None or 0 for a full stop.
            rotation_speed: rad/s.
            rotation_acceleration: rad/s2.
            line_id: ``executing_line_id``.
        """
        raise NotImplementedError

    def add_arc_move(self, via: Pose, target: Pose, speed: float, acceleration: Optional[float] = None,
                     relative: bool = False, turns: int = 0, circle_mode: int = 0,
                     line_id: Optional[int] = None) -> bool:
        """Queue an arc from the end of the queue through via to target (controller protocol 5.4.2); m/s, m/s2.

        turns (``circle_cnt``): full turns instead of the arc. circle_mode: how orientation follows.
        """
        raise NotImplementedError

    def pause(self) -> None:
        """Slow down along the path to a standstill and hold the queue."""
        raise NotImplementedError

    def resume(self) -> None:
        """Continue after ``pause``."""
        raise NotImplementedError

    def stop(self) -> None:
        """Slow down along the path, forget the queue, end a jog; in servo mode drop the points and stop there."""
        raise NotImplementedError

    def halt_protective(self) -> None:
        """Stop everything at the fastest deceleration: queue, jog, servo mode and hand guiding end."""
        raise NotImplementedError

    def halt_emergency(self) -> None:
        """As ``halt_protective``; drives are cut once the arm stands."""
        raise NotImplementedError

    def set_rapid_rate(self, rate: float) -> None:
        """Speed override of queued moves and jogs, 0 to 1; works in mid-motion.

        Raises:
            TargetRejected: Not within 0 to 1.
        """
        raise NotImplementedError

    # --- jog --------------------------------------------------------------------------------------------------------

    def jog(self, mode: JogMode, frame: JogFrame, axis: int, velocity: float, position: Optional[float] = None) -> bool:
        """Jog one axis (controller protocol 5.5).

        Args:
            mode: Continuous (sign of velocity), step (sign of position), absolute.
            frame: JOINT, BASE (the axes of the active user frame) or TOOL.
            axis: 0..5: joint, or x, y, z, rx, ry, rz.
            velocity: rad/s or m/s.
            position: Step or target, rad or m; step and absolute only.

        Returns:
            False when dropped: another motion runs. Repeating the running continuous jog sets its velocity.

        Raises:
            TargetRejected: Bad numbers, or the jog leads beyond a limit or out of reach at once.
        """
        raise NotImplementedError

    def jog_stop(self, frame: JogFrame, axis: int) -> None:
        """End the jog of this frame and axis smoothly; no effect on any other motion."""
        raise NotImplementedError

    # --- servo mode -------------------------------------------------------------------------------------------------

    def enter_servo(self) -> bool:
        """Enter servo mode; False, and no change, unless the arm stands with an empty queue."""
        raise NotImplementedError

    def leave_servo(self) -> None:
        """Leave servo mode; the arm comes to rest smoothly."""
        raise NotImplementedError

    def servo_joint(self, target: Sequence[float], relative: bool = False, cycles: int = 1) -> bool:
        """Append one joint point, rad (6,), that covers cycles x 8 ms.

        Returns:
            False when ignored: over 180 deg/s on a joint (controller protocol 5.6.5), or the buffer is full.

        Raises:
            TargetRejected: Bad numbers, beyond a soft limit, or not in servo mode.
        """
        raise NotImplementedError

    def servo_pose(self, target: Pose, relative: bool = False, cycles: int = 1) -> bool:
        """Append one Cartesian point in the active user frame; as ``servo_joint``."""
        raise NotImplementedError

    def set_servo_filter(self, kind: ServoFilter, **parameters: float) -> None:
        """Choose the filter of the servo stream; SI values under the wire's names, e.g. ``lpf_cf=0.5``.

        Raises:
            TargetRejected: In servo mode, or parameters that are missing, surplus or out of range.
        """
        raise NotImplementedError

    # --- hand guiding -----------------------------------------------------------------------------------------------

    def start_hand_guiding(self) -> None:
        """Let the arm be pushed by hand.

        Raises:
            TargetRejected: Moving or in servo mode (0x0F0044), or on a soft limit (0x0F0040).
        """
        raise NotImplementedError

    def stop_hand_guiding(self) -> None:
        """Hold again; what moves comes to rest."""
        raise NotImplementedError

    def push_joint(self, joint: int, velocity: float) -> bool:
        """Push joint 0..5 by hand at velocity rad/s until changed, 0 to let go; False, no effect, unless guided."""
        raise NotImplementedError

    # --- time -------------------------------------------------------------------------------------------------------

    def step(self, dt: float = CYCLE_TIME) -> None:
        """Let dt seconds pass: one cycle."""
        raise NotImplementedError
