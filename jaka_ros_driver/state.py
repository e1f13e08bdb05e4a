"""The immutable state of the arm at one moment, in SI units, as decoded from a status frame."""
import enum
from dataclasses import dataclass, field
from typing import Dict, NamedTuple, Optional, Sequence, Tuple, Union

Vector = Tuple[float, ...]


class MotionState(enum.IntEnum):
    """The motion state, numbered as the ROS interface numbers it (docs/interface.md section 3, RobotMsg)."""

    STOPPED = 0
    PAUSED = 1
    EMERGENCY_STOP = 2
    RUNNING = 3
    ERROR = 4


class ProgramState(enum.IntEnum):
    """The state of the loaded program in the status feed.

    It is ``interp_state`` (docs/controller-protocol.md section 6.2).
    """

    IDLE = 0
    LOADING = 1
    PAUSED = 2
    RUNNING = 3


PROGRAM_UNDER_WAY = (ProgramState.LOADING, ProgramState.RUNNING)
"""The states in which a program moves the arm, or may at any moment."""
STILL_RAD = 1e-4
"""Largest change, rad, of a joint of an arm that is taken to rest."""
FRESH_S = 1.0
"""Largest age, s, of the newest state by which an arm is taken to rest."""


class IoBank(enum.IntEnum):
    """The place of an input or output, by the controller's own numbers (docs/controller-protocol.md section 5.11)."""

    CABINET = 0
    TOOL = 1
    EXTENSION = 2


class FieldBus(enum.IntEnum):
    """A field bus on which the controller has terminals, numbered as IoBank (docs/controller-protocol.md section 5.11).

    ``set_io`` and ``get_io`` take none of them; a gripper may be on the Modbus.
    """

    MODBUS_SLAVE = 4
    PROFINET_SLAVE = 5
    ETHERNET_IP_SLAVE = 6


Bank = Union[IoBank, FieldBus]


class BusTerminals(NamedTuple):
    """The terminals on one field bus, index 0 first; registers stand for analog values.

    Attributes:
        digital_inputs: 0 or 1 each.
        digital_outputs: As digital_inputs.
        analog_inputs: Register values.
        analog_outputs: As analog_inputs.
    """

    digital_inputs: Vector = ()
    digital_outputs: Vector = ()
    analog_inputs: Vector = ()
    analog_outputs: Vector = ()


@dataclass(frozen=True)
class IoState:
    """Inputs and outputs by bank; a bank that the controller does not report is absent.

    Attributes:
        digital_inputs: Per bank, 0 or 1 each, index 0 first.
        digital_outputs: As digital_inputs.
        analog_inputs: Per bank, V or mA as the terminal is configured.
        analog_outputs: As analog_inputs.
        relays: 0 or 1 each; empty where the controller does not report them.
        field_buses: Per field bus that the controller reports.
    """

    digital_inputs: Dict[IoBank, Vector] = field(default_factory=dict)
    digital_outputs: Dict[IoBank, Vector] = field(default_factory=dict)
    analog_inputs: Dict[IoBank, Vector] = field(default_factory=dict)
    analog_outputs: Dict[IoBank, Vector] = field(default_factory=dict)
    relays: Vector = ()
    field_buses: Dict[FieldBus, BusTerminals] = field(default_factory=dict)

    def values(self, bank: Bank, is_digital: bool, is_output: bool) -> Optional[Vector]:
        """Return a bank's values, index 0 first; None where the controller does not report the bank."""
        name = ("digital_" if is_digital else "analog_") + ("outputs" if is_output else "inputs")
        found: Optional[Vector] = getattr(self, name).get(bank) if isinstance(bank, IoBank) else getattr(
            self.field_buses.get(bank), name, None)
        return found


@dataclass(frozen=True)
class RobotState:
    """One sample of the arm, as the controller measured it.

    A field that is None was not in the frame: which ones a controller sends is configurable there.

    Attributes:
        joint_position: Measured joint angles, rad, joint 1 (base) first, shape (6,).
        is_powered: True while the drives are energised.
        is_enabled: True while brakes are off and the joint drives hold torque.
        is_in_position: True when no commanded motion is pending.
        emergency_stop: True while the emergency stop is latched.
        protective_stop: True while a protective stop (collision, singularity) stands.
        received_at: Host monotonic time of the frame's last byte, s.
        tcp_position: Tool centre point in the active user frame, m, shape (3,).
        tcp_rpy: Orientation, rotations about the fixed axes x, then y, then z
            (R = Rz Ry Rx), rad, shape (3,).
        joint_position_commanded: Commanded joint angles, rad, shape (6,).
        joint_velocity: As the controller reports it, rad/s, shape (6,).
        tcp_speed: Speed of the tool centre point, m/s.
        is_hand_guided: True while hand guiding is on.
        is_paused: True while a program or motion is paused.
        on_soft_limit: True while a joint stands at a soft limit.
        program_state: See ``ProgramState``; a number that it lacks is kept.
        rapid_rate: Speed override, 0 to 1.
        tool_id: Active tool, 0 is the bare flange.
        user_frame_id: Active user frame, 0 is the base.
        error_code: Entry of the controller's event list, 0 for none. Not every one is a fault.
        error_message: The controller's text beside it.
        motion_line: ``executing_line_id`` of the motion last executed.
        add_error_line: ``executing_line_id`` of a motion refused because the arm was there already.
        io: Inputs and outputs.
        cabinet_temperature: deg C.
        joint_temperature: deg C, shape (6,).
        joint_current: A, shape (6,).
        wrench: Contact force, N, and torque, N m, at the flange as its sensor measures them, shape (6,); None without a
            sensor, and while the sensor reports an error.
        sensor_error: The sensor's error code, 0 for none.
    """

    joint_position: Vector
    is_powered: bool
    is_enabled: bool
    is_in_position: bool
    emergency_stop: bool
    protective_stop: bool
    received_at: float = 0.0
    tcp_position: Optional[Vector] = None
    tcp_rpy: Optional[Vector] = None
    joint_position_commanded: Optional[Vector] = None
    joint_velocity: Optional[Vector] = None
    tcp_speed: Optional[float] = None
    is_hand_guided: Optional[bool] = None
    is_paused: Optional[bool] = None
    on_soft_limit: Optional[bool] = None
    program_state: Optional[int] = None
    rapid_rate: Optional[float] = None
    tool_id: Optional[int] = None
    user_frame_id: Optional[int] = None
    error_code: int = 0
    error_message: str = ""
    motion_line: Optional[int] = None
    add_error_line: Optional[int] = None
    io: IoState = field(default_factory=IoState)
    cabinet_temperature: Optional[float] = None
    joint_temperature: Optional[Vector] = None
    joint_current: Optional[Vector] = None
    wrench: Optional[Vector] = None
    sensor_error: int = 0

    @property
    def has_fault(self) -> bool:
        """True while the event code stands for a fault: entries 0x10F0000..0x10FFFFF are notes, not faults.

        Source: docs/controller-protocol.md section 4.4.
        """
        return self.error_code != 0 and not 0x10F0000 <= self.error_code <= 0x10FFFFF

    @property
    def has_warning(self) -> bool:
        """True while the event code only warns that a joint is about to hit a soft limit, and the arm moves on.

        Source: docs/controller-protocol.md section 4.4, entries 0x0n0033 and 0x0n0034 of joint n + 1.
        """
        return self.error_code & 0xFFFF in (0x33, 0x34) and 0 <= self.error_code >> 16 <= 5

    @property
    def motion_state(self) -> MotionState:
        """The motion state of the ROS interface; where several conditions hold, the worst one."""
        if self.emergency_stop:
            return MotionState.EMERGENCY_STOP
        if self.protective_stop or self.has_fault:
            return MotionState.ERROR
        if self.is_paused or self.program_state == ProgramState.PAUSED:
            return MotionState.PAUSED
        if not self.is_in_position or self.is_hand_guided or self.program_state in PROGRAM_UNDER_WAY:
            return MotionState.RUNNING
        return MotionState.STOPPED

    def shown_motion_state(self, is_stream_moving: Optional[bool]) -> MotionState:
        """Return the motion state of an arm whose stream of this driver tells running from stopped.

        is_stream_moving: Whether that stream moves the arm; None where there is none.
        """
        state = self.motion_state
        if is_stream_moving is None or state not in (MotionState.RUNNING, MotionState.STOPPED):
            return state
        return MotionState.RUNNING if is_stream_moving else MotionState.STOPPED


def are_still(states: Sequence[RobotState]) -> bool:
    """Return whether two states or more show an arm at rest."""
    return len(states) > 1 and all(abs(a - b) <= STILL_RAD for state in states
                                   for a, b in zip(state.joint_position, states[0].joint_position))


def unrest(states: Sequence[RobotState], now: Optional[float] = None) -> str:
    """Return why the command port is left alone after these newest states; "" where it may be connected.

    A controller may end its first client's connection for a second one: whoever moves the arm would lose it.

    now: Host monotonic time, s; states that are ``FRESH_S`` old say nothing of an arm that may move since. None where
        their age does not matter.
    """
    if len(states) < 2:
        return "the status port does not show whether the arm moves"
    if not are_still(states):
        return "the arm moves"
    if any(state.program_state in PROGRAM_UNDER_WAY for state in states):
        return "a program of the controller runs"
    if now is not None and now - states[-1].received_at > FRESH_S:
        return "no frame came for %.0f s" % FRESH_S
    return ""
