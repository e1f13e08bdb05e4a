"""The commands of the arm's controller: one frozen dataclass for each, SI units, joint 1 (base) first.

Orientation is always rpy: rotations about the fixed axes x, then y, then z (R = Rz Ry Rx), rad.
"""
import enum
import math
from dataclasses import dataclass
from typing import Optional, Tuple, Union

from jaka_ros_driver.state import Bank, Vector

TURN_LEVER = 0.1
"""The lever, m, by which a linear speed gives the angular speed of a linear move that states none."""
TURN_SPEED_CEILING = math.pi
TURN_ACCELERATION_CEILING = 4.0 * math.pi
"""The angular speed, rad/s, and acceleration, rad/s2, that the maker's SDK sends with every linear move.

Ours are never higher.
"""


class JogFrame(enum.IntEnum):
    """The coordinates in which a jog moves; the numbers of the ROS interface (``coord_mode``).

    BASE of the command ``Jog`` is the controller's world: the active user frame, which is the base while user frame 0
    is active. Of a velocity jog, which the driver makes of joints, it is the true base.
    """

    JOINT = 0
    BASE = 1
    TOOL = 2


@dataclass(frozen=True)
class Pose:
    """A Cartesian pose: position m, shape (3,); rpy rad, shape (3,)."""

    position: Vector
    rpy: Vector


@dataclass(frozen=True)
class JointMove:
    """A motion of the joints to a target: joint_position rad (6,), speed rad/s, acceleration rad/s2.

    tolerance: The distance, m, by which the tool may pass the target on its way to the next queued one; 0: it stops
    there.
    """

    joint_position: Vector
    speed: float
    acceleration: float
    tolerance: float = 0.0


@dataclass(frozen=True)
class LinearMove:
    """A straight line of the active tool in the active user frame.

    The tool turns on the way; the slower of translation and rotation determines the duration.

    Attributes:
        target: The pose at its end.
        speed: Of the tool centre point, m/s.
        acceleration: m/s2.
        tolerance: How far the tool may pass the target on its way to that of the next queued move, m.
        angular_speed: Of the tool's orientation, rad/s; None where it follows from ``speed``, see ``turn_speed``.
        angular_acceleration: rad/s2; None where it follows from ``acceleration``.
    """

    target: Pose
    speed: float
    acceleration: float
    tolerance: float = 0.0005
    angular_speed: Optional[float] = None
    angular_acceleration: Optional[float] = None

    @property
    def turn_speed(self) -> float:
        """The angular speed, rad/s.

        It is always sent: without it a controller turns at its highest speed, however slow the line is.
        """
        if self.angular_speed is not None:
            return self.angular_speed
        return min(self.speed / TURN_LEVER, TURN_SPEED_CEILING)

    @property
    def turn_acceleration(self) -> float:
        """The angular acceleration, rad/s2."""
        if self.angular_acceleration is not None:
            return self.angular_acceleration
        return min(self.acceleration / TURN_LEVER, TURN_ACCELERATION_CEILING)


@dataclass(frozen=True)
class ArcMove:
    """An arc of the active tool from its present pose through ``via`` to ``target``, in the active user frame.

    The tool turns the short way. speed m/s, acceleration m/s2; tolerance as of LinearMove, m.
    """

    via: Pose
    target: Pose
    speed: float
    acceleration: float
    tolerance: float = 0.0


@dataclass(frozen=True)
class Jog:
    """A continuous motion of one axis until it is stopped.

    Attributes:
        frame: Joint, base or tool coordinates.
        axis: 0..5: joint index, or x, y, z, rx, ry, rz.
        velocity: Signed; rad/s for joints and rotations, m/s along x, y, z.
    """

    frame: JogFrame
    axis: int
    velocity: float

    @property
    def is_linear(self) -> bool:
        """True for a motion of the tool along x, y or z; the velocity is m/s then."""
        return self.frame is not JogFrame.JOINT and self.axis < 3


@dataclass(frozen=True)
class JogStop:
    """The command to end the jog of this axis in this frame."""

    frame: JogFrame
    axis: int


@dataclass(frozen=True)
class Stop:
    """The command to stop a running program and every running or queued motion."""


@dataclass(frozen=True)
class PauseMotion:
    """The command to hold a running program and the planned moves, which stay queued."""


@dataclass(frozen=True)
class ResumeMotion:
    """The command to continue what is paused."""


@dataclass(frozen=True)
class LoadProgram:
    """The command to load a program that is stored in the controller, to be played next."""

    name: str


@dataclass(frozen=True)
class PlayProgram:
    """The command to begin the loaded program."""


@dataclass(frozen=True)
class SetServoMode:
    """The command to enter or leave servo (streaming) mode."""

    active: bool


@dataclass(frozen=True)
class ServoJoint:
    """One joint target of a servo stream, rad (6,), valid for ``cycles`` x 8 ms."""

    joint_position: Vector
    relative: bool = False
    cycles: int = 1


@dataclass(frozen=True)
class ServoPose:
    """One Cartesian target of a servo stream, in the active user frame, valid for ``cycles`` x 8 ms."""

    target: Pose
    relative: bool = False
    cycles: int = 1


@dataclass(frozen=True)
class SetPower:
    """The command to switch the power of the drives on or off."""

    on: bool


@dataclass(frozen=True)
class SetEnabled:
    """The command to release the brakes and hold torque, or to engage the brakes."""

    on: bool


@dataclass(frozen=True)
class ClearError:
    """The command to clear alarms and recover from a protective stop."""


@dataclass(frozen=True)
class SetToolFrame:
    """The command to store the pose of a tool in the flange frame under tool_id."""

    tool_id: int
    pose: Pose
    name: str


@dataclass(frozen=True)
class SelectTool:
    """The command to make a stored tool the active one; 0 is the bare flange."""

    tool_id: int


@dataclass(frozen=True)
class SetUserFrame:
    """The command to store the pose of a user frame in the base frame under user_frame_id."""

    user_frame_id: int
    pose: Pose
    name: str


@dataclass(frozen=True)
class SelectUserFrame:
    """The command to make a stored user frame the active one; 0 is the base."""

    user_frame_id: int


@dataclass(frozen=True)
class SetPayload:
    """The load at the active tool: mass kg, centre of mass m (3,)."""

    mass: float
    centroid: Vector


@dataclass(frozen=True)
class SetHandGuiding:
    """The command to switch hand guiding on or off."""

    active: bool


@dataclass(frozen=True)
class SetCollisionLevel:
    """The collision sensitivity: 0 off, 1 most sensitive (25 N) to 5 (125 N)."""

    level: int


@dataclass(frozen=True)
class SetDigitalOutput:
    """The command to switch one digital output; index counts from 0."""

    bank: Bank
    index: int
    value: bool


@dataclass(frozen=True)
class SetAnalogOutput:
    """The command to set one analog output, V or mA, in a field bus a register; index counts from 0."""

    bank: Bank
    index: int
    value: float


@dataclass(frozen=True)
class ZeroForceSensor:
    """The command to zero the force sensor at the flange: its present reading becomes no load."""


@dataclass(frozen=True)
class SetRapidRate:
    """The speed override, 0 to 1."""

    rate: float


@dataclass(frozen=True)
class SetFeedPeriod:
    """The period of the status feed, s."""

    period: float


@dataclass(frozen=True)
class ForwardKinematics:
    """The question for the tool pose at these joints, rad (6,). Result: Pose."""

    joint_position: Vector


@dataclass(frozen=True)
class InverseKinematics:
    """The question for joints that reach the pose, nearest to the reference. Result: Vector (6,), rad."""

    target: Pose
    reference: Vector


@dataclass(frozen=True)
class SetLinkLoss:
    """The command to let the controller stop the arm ``seconds`` after the command link broke; 0 lets it go on."""

    seconds: float


class Query(enum.Enum):
    """A question without arguments; the value describes the type of its result."""

    VERSION = "str"
    SERVO_MODE = "bool, True in servo mode"
    FEED_PERIOD = "float, s"
    JOINTS = "tuple of 6 joint positions, rad"
    DRIVES_READY = "bool, True while the arm is powered and enabled"
    TOOL_FRAMES = "tuple of Pose, by tool id"
    USER_FRAMES = "tuple of Pose, by user frame id"
    PAYLOAD = "SetPayload"
    COLLISION_LEVEL = "int, 0..5"
    SIMULATOR_IDENTITY = "str, what the simulated controller was named; only that one knows the question"
    HAND_GUIDING = "bool, True while hand guiding is on"
    LOADED_PROGRAM = "str, the name of the loaded program"
    PROGRAM_STATE = "ProgramState, of the loaded program; no source tells how loading is named"


@dataclass(frozen=True)
class GetDigitalOutput:
    """The question for the value of one digital output. Result: bool."""

    bank: Bank
    index: int


@dataclass(frozen=True)
class GetAnalogOutput:
    """The question for the value of one analog output. Result: float."""

    bank: Bank
    index: int


@dataclass(frozen=True)
class GetDigitalInput:
    """The question for the value of one digital input. Result: bool."""

    bank: Bank
    index: int


@dataclass(frozen=True)
class GetAnalogInput:
    """The question for the value of one analog input. Result: float."""

    bank: Bank
    index: int


TERMINAL_COMMANDS = (SetDigitalOutput, SetAnalogOutput, GetDigitalOutput, GetAnalogOutput, GetDigitalInput,
                     GetAnalogInput)
"""The commands that name one input or output by its index."""

MoveCommand = Union[JointMove, LinearMove]
PathCommand = Union[JointMove, LinearMove, ArcMove]
"""One segment of a path."""

Command = Union[
    JointMove, LinearMove, ArcMove, Jog, JogStop, Stop, PauseMotion, ResumeMotion, LoadProgram, PlayProgram,
    SetServoMode, ServoJoint, ServoPose,
    SetPower, SetEnabled, ClearError, SetToolFrame, SelectTool, SetUserFrame, SelectUserFrame, SetPayload,
    SetHandGuiding, SetCollisionLevel, SetDigitalOutput, SetAnalogOutput, SetRapidRate, SetFeedPeriod, SetLinkLoss,
    ForwardKinematics, InverseKinematics, Query, GetDigitalOutput, GetAnalogOutput, GetDigitalInput,
    GetAnalogInput, ZeroForceSensor]

JOINTS: Tuple[str, ...] = tuple("joint_%d" % n for n in range(1, 7))

STOP_REPLY = 1
"""Index in ``whole_stop`` of ``stop_program``, whose reply is the stop's; the others may be refused when nothing runs.
"""
SERVO_END_REPLY = 0
"""Index in ``whole_stop`` of the command that leaves servo mode."""

_ALL_AXES = tuple(JogStop(JogFrame.JOINT, axis) for axis in range(6))
"""The requests of the maker's SDK to stop all axes, whatever the jog's frame (docs/sdk-client.md section 5).

No single request for it is known.
"""
_ALL_FRAMES = tuple(JogStop(frame, axis) for frame in JogFrame for axis in range(6))
"""The requests to stop every axis in every frame, for an arm that moves on after a stop.

A user of the protocol reports that the frame must be the jog's own (docs/controller-protocol.md section 5.5).
"""


def whole_stop(jog: Optional[JogStop], is_repeated: bool = False) -> Tuple[Command, ...]:
    """Return the commands of a stop, in the order in which they are sent.

    Servo mode is left first, because ``stop_program`` alone has no effect in it. Whether ``stop_program`` ends a jog is
    not known of real controllers, so jogs are stopped, too; behind it, so that it does not wait for them.

    Args:
        jog: The command that ends the running jog; None where it is not known which jog runs.
        is_repeated: The arm moves on after a stop: every jog in every frame is stopped, also where one is known.
    """
    jogs = _ALL_FRAMES if is_repeated else _ALL_AXES if jog is None else (jog,)
    return (SetServoMode(False), Stop(), *jogs)
