"""The limits audit that every command passes before anything is sent.

Each command class has a checker; a command without one is refused, so that none is sent unchecked. Where a value may
come from a float32 (the ROS interface), its bound is widened by ``FLOAT32_SLACK``.
"""
import enum
import math
import numbers
from typing import Any, Callable, Dict, Optional, Sequence, Tuple, Type, TypeVar, Union, cast

from jaka_ros_driver import commands
from jaka_ros_driver.commands import JogFrame, Pose
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.state import FieldBus, IoBank, RobotState, Vector

FLOAT32_SLACK = 2e-7
"""Relative excess that a bound such as 265 deg, converted to rad and float32, may have."""
POSITION_LIMIT = 10.0
"""Largest coordinate, m, of a target or a frame: the longest arm reaches 2 m, and its cell's frames are not farther."""
ANGLE_LIMIT = 4.0 * math.pi
"""Largest angle, rad, of an orientation, and of joints in a query: two turns, more than any joint has."""
MASSES = (0.0, 100.0)
"""Smallest and largest mass, kg: three times the payload of the strongest arm of the series."""
CENTROID_LIMIT = 2.0
"""Largest coordinate, m, of a load's centre of mass: it is not farther from the flange than the arm is long."""
ANALOG_LIMIT = 1000.0
"""Largest analog value, V or mA: a hundred times the range of the terminals, because a module may use other units."""
REGISTERS = (0, 65535)
"""Smallest and largest value of a field bus's register, which has 16 bits."""
TOLERANCES = (0.0, 1.0)
"""Smallest and largest radius, m, of a rounded corner; a larger one is a mistake."""
IO_INDICES = (0, 1023)
"""First and last index of a terminal; no bank of a controller has more."""
LONGEST_PROGRAM_NAME = 100
"""Most characters of a controller program's name: no source gives a figure; a longer text is a mistake."""
SERVO_CYCLES = (1, 1000)
"""Fewest and most servo cycles of 8 ms for one target; the upper bound is 8 s."""
JOINT_SPEED_CEILING = math.pi
"""Highest joint speed, 180 deg/s, for all models (docs/controller-protocol.md sections 5.2, 5.6.5)."""
JOINT_ACCELERATION_CEILING = 4.0 * math.pi
"""Highest joint acceleration, 720 deg/s2, the maker's advice (docs/controller-protocol.md section 5.2)."""
TCP_ACCELERATION_CEILING = 8.0
"""Highest tool acceleration, 8000 mm/s2, the maker's advice (docs/controller-protocol.md section 5.4.1)."""
UNKNOWN_TCP_SPEED_CEILING = 1.5
"""Highest tool speed, m/s, for models without tcp_max_speed: the lowest that any full-size arm has (Zu3)."""
SLOWEST = 5e-4
"""Lowest speed of a move or a jog, rad/s, and m/s of the tool.

A slower arm cannot be told from one at rest within the second in which a motion must be seen to begin (MOVEMENT and
START_WINDOW_S of client/core), and the effect of a stop would stay invisible for seconds. The maker names no bound.
"""
WEAKEST = 5e-3
"""Lowest acceleration, rad/s2, and m/s2 of the tool: it reaches ``SLOWEST`` in 0.1 s, for the same reason."""
SERVO_PERIOD_S = 0.008
"""One servo cycle, s (docs/controller-protocol.md section 5.6.5)."""
STREAM_INSET = 1e-3
"""Distance, rad, from a joint's limits that streams keep.

A controller ends a stream with a fault on its soft limit (events 0x0n0031 and 32, docs/controller-protocol.md section
4.4); the simulated one does so within 1e-5 rad of it, of real ones the distance is not known. A ``JointMove`` may end
on the limit itself: the controller plans it.
"""
TOOL_IDS = (1, 11)
USER_FRAME_IDS = (1, 10)
"""First and last id that can be set (docs/interface.md section 2); 0, flange and base, can only be selected."""
FEED_PERIODS_S = (0.001, 10.0)
"""Shortest and longest period of the feed, s; the wire carries whole ms (docs/controller-protocol.md section 6.1)."""
LINK_LOSS_TIMES_S = (0.0, 10.0)
"""Shortest and longest delay, s; a later stop of an arm that has lost its client would protect nobody."""

_LED = 2e-6
"""Distance, rad, above which a target that is led elsewhere is worth a word; targets come as float32."""
JointRanges = Tuple[Tuple[float, float], ...]
"""Lowest and highest position of each joint, rad."""
C = TypeVar("C")
Checker = Callable[[C, ArmModel, Optional[RobotState]], None]
FieldCheck = Callable[[str, object], object]


def check(command: commands.Command, model: ArmModel, state: Optional[RobotState] = None) -> None:
    """Refuse a command that is malformed or outside the arm's limits.

    ``JointMove.speed`` is one number for all joints, and the controller limits each joint to its own maximum. So the
    bound is the speed of the model's fastest joint, at most ``JOINT_SPEED_CEILING``. The bound of a joint jog is that
    joint's maximum; of a jog that rotates the tool, for which no source gives a limit, the fastest joint's. Cartesian
    targets are checked for their form and speed only: whether they can be reached depends on the controller's active
    tool and user frame.

    Args:
        command: Any command of ``commands``.
        model: The arm that is to carry it out.
        state: The newest state where it is fresh, otherwise None. With it, commands that move the arm are refused while
            the drives are not enabled, and relative servo targets are checked against the joint limits.

    Raises:
        InvalidCommand: The message names the field, its value and the valid range.
    """
    checker = _CHECKERS.get(type(command))
    if checker is None:
        raise InvalidCommand("%s is no command that the arm knows" % type(command).__name__)
    checker(command, model, state)


def stream_limits(model: ArmModel, standing: Optional[Sequence[float]] = None) -> JointRanges:
    """Return the range of each joint in which streams stay: its limits, ``STREAM_INSET`` narrower at both ends.

    standing: The joints of the arm now, rad (6,). One that stands beyond has a range that reaches as far as there: it
        is not pushed back, and is not refused the way out.
    """
    ranges = []
    for low, high in model.joint_limits:
        inset = min(STREAM_INSET, 0.25 * (high - low))
        ranges.append((low + inset, high - inset))
    return tuple(ranges) if standing is None else _reaching(ranges, standing)


def accepted_limits(model: ArmModel, standing: Optional[Sequence[float]]) -> JointRanges:
    """Return the range of each joint in which a stream's targets are taken: its limits, reaching to ``standing``, too.

    Targets outside ``stream_limits`` are then led into them (``led_inside``).
    """
    return model.joint_limits if standing is None else _reaching(model.joint_limits, standing)


def are_inside(joints: Sequence[float], ranges: JointRanges) -> bool:
    """Return whether every joint, rad (6,), is within its range; a joint that is no number is not."""
    for value, (low, high) in zip(joints, ranges):
        if not low <= value <= high:
            return False
    return True


def led_inside(target: Vector, ranges: JointRanges) -> Tuple[Vector, str]:
    """Return the target, rad (6,), moved into the ranges, and in words which joint was led to where; "" for none."""
    led = tuple([min(max(value, low), high) for value, (low, high) in zip(target, ranges)])
    return led, led_text(target, led)


def led_text(target: Sequence[float], led: Sequence[float]) -> str:
    """Return in words which joints of a target, rad (6,), were led to another place; "" where rounding did it."""
    return ", ".join("joint %d is led to %.6f rad, not to %.6f rad: streams stay %g rad inside the limits"
                     % (joint, to, wanted, STREAM_INSET)
                     for joint, (wanted, to) in enumerate(zip(target, led), 1) if abs(wanted - to) > _LED)


def _reaching(ranges: Sequence[Tuple[float, float]], standing: Sequence[float]) -> JointRanges:
    return tuple([(min(low, at), max(high, at)) for at, (low, high) in zip(standing, ranges)])


def top_joint_speeds(model: ArmModel) -> Tuple[float, ...]:
    """Return the highest speed of each joint, rad/s (6,): the model's, at most ``JOINT_SPEED_CEILING``."""
    return tuple([min(speed, JOINT_SPEED_CEILING) for speed in model.joint_max_speed])


def stoppable_speed(distance: float, acceleration: float, period: float) -> float:
    """Return the highest speed from which a stop takes no more than this distance, this cycle's way included.

    It is exact for a brake in whole cycles, whose ways shrink by acceleration * period ** 2 from one to the next; the
    parabola of a brake without cycles lets a stop pass its end by up to an eighth of that.

    Args:
        distance: rad or m, 0 or more.
        acceleration: With which it brakes, rad/s2 or m/s2.
        period: Of a cycle, s.
    """
    change = acceleration * period
    ways = distance / (change * period)
    cycles = int(0.5 * (math.sqrt(1.0 + 8.0 * ways) - 1.0))
    return change * (0.5 * cycles + ways / (cycles + 1))


def braked_steps(changes: float) -> float:
    """Return the way of a brake in whole cycles behind a step, in such steps.

    changes: Length of the step, in those by which a cycle shortens it.
    """
    cycles = int(changes)
    return cycles - 0.5 * cycles * (cycles + 1) / changes if cycles else 0.0


def joint_speed_limit(model: ArmModel) -> float:
    """Return the highest ``JointMove.speed``, rad/s."""
    return min(max(model.joint_max_speed), JOINT_SPEED_CEILING)


def tcp_speed_limit(model: ArmModel) -> float:
    """Return the highest ``LinearMove.speed``, m/s."""
    return UNKNOWN_TCP_SPEED_CEILING if model.tcp_max_speed is None else model.tcp_max_speed


def jog_speed_limit(command: commands.Jog, model: ArmModel) -> float:
    """Return the highest speed of a jog of this axis: m/s along x, y and z, else rad/s."""
    if command.frame is JogFrame.JOINT:
        return min(model.joint_max_speed[command.axis], JOINT_SPEED_CEILING)
    return tcp_speed_limit(model) if command.is_linear else joint_speed_limit(model)


def _is_finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:  # an int that is too large for a float
        return False


def _finite(name: str, value: object, unit: str) -> float:
    if not _is_finite(value):
        raise InvalidCommand("%s is %.60r; it must be a finite number%s"
                             % (name, value, " in " + unit if unit else ""))
    return cast(float, value)  # any real number is compared and written as a float is


def _number(name: str, value: object, low: float, high: float, unit: str) -> None:
    number = _finite(name, value, unit)
    if low <= number <= high:
        return
    if not low - FLOAT32_SLACK * abs(low) <= number <= high + FLOAT32_SLACK * abs(high):
        raise InvalidCommand("%s is %.9g%s; valid: %.9g to %.9g%s"
                             % (name, number, _unit(unit), low, high, _unit(unit)))


def _unit(unit: str) -> str:
    return " " + unit if unit else ""


def _integer(name: str, value: object, low: int, high: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise InvalidCommand("%s is %.60r; valid: a whole number, %d to %d" % (name, value, low, high))


def _flag(name: str, value: object) -> None:
    if not isinstance(value, bool):
        raise InvalidCommand("%s is %r; valid: True or False" % (name, value))


def _text(name: str, value: object) -> str:
    if not isinstance(value, str):
        raise InvalidCommand("%s is %r; it must be text" % (name, value))
    return value


def _program_name(name: str, value: object) -> None:
    """Raise unless this names a file of the controller's own folder: no path, and nothing unprintable."""
    text = _text(name, value)
    if not 0 < len(text) <= LONGEST_PROGRAM_NAME or not text.isprintable() or text.strip() != text \
            or "/" in text or "\\" in text or text.startswith("."):
        raise InvalidCommand("%s is %.60r; valid: the name of a program file, 1 to %d printable characters, without "
                             "folder" % (name, text, LONGEST_PROGRAM_NAME))


def _member(name: str, value: object, kind: Type[enum.IntEnum]) -> None:
    if not isinstance(value, kind):
        raise InvalidCommand("%s is %r; valid: %s" % (name, value, ", ".join("%s (%d)" % (k.name, k) for k in kind)))


def _vector(name: str, values: object, length: int, bound: float, unit: str) -> None:
    """Raise unless these are ``length`` finite numbers, each between -bound and bound."""
    if not isinstance(values, (tuple, list)) or len(values) != length:
        raise InvalidCommand("%s is %.200r; it must be %d numbers in %s" % (name, values, length, unit))
    for n, value in enumerate(values):
        if not (isinstance(value, float) and -bound <= value <= bound and math.isfinite(value)):
            _number("%s[%d]" % (name, n), value, -bound, bound, unit)


def _pose(name: str, pose: object) -> None:
    if not isinstance(pose, Pose):
        raise InvalidCommand("%s is %r; it must be a Pose" % (name, pose))
    _vector(name + ".position", pose.position, 3, POSITION_LIMIT, "m")
    _vector(name + ".rpy", pose.rpy, 3, ANGLE_LIMIT, "rad")


def _joint_target(name: str, values: Sequence[float], model: ArmModel, standing: Optional[Vector] = None) -> None:
    if are_inside(values, model.joint_limits):  # every servo target passes here, so that nothing is made for it
        return
    for n, (value, (low, high)) in enumerate(zip(values, accepted_limits(model, standing))):
        _number("%s[%d] (joint %d of %s)" % (name, n, n + 1, model.name), value, low, high, "rad")


def _enabled(command: str, state: Optional[RobotState]) -> None:
    if state is not None and not state.is_enabled:
        raise InvalidCommand("%s while the drives are not enabled" % command)


def _joint_move(command: commands.JointMove, model: ArmModel, state: Optional[RobotState]) -> None:
    _vector("joint_position", command.joint_position, JOINT_COUNT, math.inf, "rad")
    _joint_target("joint_position", command.joint_position, model)
    _number("speed", command.speed, SLOWEST, joint_speed_limit(model), "rad/s")
    _number("acceleration", command.acceleration, WEAKEST, JOINT_ACCELERATION_CEILING, "rad/s2")
    _number("tolerance", command.tolerance, *TOLERANCES, "m")
    _enabled("joint move", state)


def _linear_move(command: commands.LinearMove, model: ArmModel, state: Optional[RobotState]) -> None:
    _pose("target", command.target)
    _number("speed", command.speed, SLOWEST, tcp_speed_limit(model), "m/s")
    _number("acceleration", command.acceleration, WEAKEST, TCP_ACCELERATION_CEILING, "m/s2")
    _number("tolerance", command.tolerance, *TOLERANCES, "m")
    if command.angular_speed is not None:
        _number("angular_speed", command.angular_speed, SLOWEST, joint_speed_limit(model), "rad/s")
    if command.angular_acceleration is not None:
        _number("angular_acceleration", command.angular_acceleration, WEAKEST, JOINT_ACCELERATION_CEILING, "rad/s2")
    _enabled("linear move", state)


def _arc_move(command: commands.ArcMove, model: ArmModel, state: Optional[RobotState]) -> None:
    _pose("via", command.via)
    _pose("target", command.target)
    _number("speed", command.speed, SLOWEST, tcp_speed_limit(model), "m/s")
    _number("acceleration", command.acceleration, WEAKEST, TCP_ACCELERATION_CEILING, "m/s2")
    _number("tolerance", command.tolerance, *TOLERANCES, "m")
    _enabled("arc move", state)


def _jog(command: commands.Jog, model: ArmModel, state: Optional[RobotState]) -> None:
    _jog_axis(command, model, state)
    limit, unit = jog_speed_limit(command, model), "m/s" if command.is_linear else "rad/s"
    _number("velocity", command.velocity, -limit, limit, unit)
    if abs(command.velocity) < SLOWEST * (1.0 - FLOAT32_SLACK):
        raise InvalidCommand("velocity is %.9g %s; valid: %.9g to %.9g %s, in either direction"
                             % (command.velocity, unit, SLOWEST, limit, unit))
    _enabled("jog", state)


def _servo_joint(command: commands.ServoJoint, model: ArmModel, state: Optional[RobotState]) -> None:
    _vector("joint_position", command.joint_position, JOINT_COUNT, math.inf, "rad")
    _flag("relative", command.relative)
    _integer("cycles", command.cycles, *SERVO_CYCLES)
    standing = None if state is None else state.joint_position
    if command.relative:
        reach = JOINT_SPEED_CEILING * SERVO_PERIOD_S * command.cycles
        for n, increment in enumerate(command.joint_position):
            _number("joint_position[%d] (increment over %d cycles)" % (n, command.cycles), increment,
                    -reach, reach, "rad")
        if state is not None:
            _joint_target("joint_position", [at + by for at, by in zip(state.joint_position, command.joint_position)],
                          model, standing)
    else:
        _joint_target("joint_position", command.joint_position, model, standing)
    _enabled("servo target", state)


def _servo_pose(command: commands.ServoPose, model: ArmModel, state: Optional[RobotState]) -> None:
    _pose("target", command.target)
    _flag("relative", command.relative)
    _integer("cycles", command.cycles, *SERVO_CYCLES)
    _enabled("servo target", state)


def _jog_axis(command: Union[commands.Jog, commands.JogStop], model: ArmModel, state: Optional[RobotState]) -> None:
    _member("frame", command.frame, JogFrame)
    _integer("axis", command.axis, 0, 5)


def _fields(**checks: FieldCheck) -> Checker[object]:
    """Return a checker of a command whose fields do not depend on model and state: each has its own function."""
    def check_all(command: object, model: ArmModel, state: Optional[RobotState]) -> None:
        for name, check_one in checks.items():
            check_one(name, getattr(command, name))
    return check_all


def _whole(low: int, high: int) -> FieldCheck:
    return lambda name, value: _integer(name, value, low, high)


def _within(bounds: Tuple[float, float], unit: str) -> FieldCheck:
    return lambda name, value: _number(name, value, bounds[0], bounds[1], unit)


def _numbers(length: int, bound: float, unit: str) -> FieldCheck:
    return lambda name, values: _vector(name, values, length, bound, unit)


def _bank(name: str, value: object) -> None:
    if not isinstance(value, FieldBus):
        _member(name, value, IoBank)


def _analog_output(command: commands.SetAnalogOutput, model: ArmModel, state: Optional[RobotState]) -> None:
    _bank("bank", command.bank)
    _integer("index", command.index, *IO_INDICES)
    if isinstance(command.bank, FieldBus):
        _number("value", command.value, *REGISTERS, "in a register")
    else:
        _number("value", command.value, -ANALOG_LIMIT, ANALOG_LIMIT, "V or mA")


_CHECKERS: Dict[type, Checker[Any]] = {
    commands.JointMove: _joint_move,
    commands.LinearMove: _linear_move,
    commands.ArcMove: _arc_move,
    commands.Jog: _jog,
    commands.JogStop: _jog_axis,
    commands.Stop: _fields(),
    commands.PauseMotion: _fields(),
    commands.ResumeMotion: _fields(),
    commands.LoadProgram: _fields(name=_program_name),
    commands.PlayProgram: _fields(),
    commands.SetServoMode: _fields(active=_flag),
    commands.ServoJoint: _servo_joint,
    commands.ServoPose: _servo_pose,
    commands.SetPower: _fields(on=_flag),
    commands.SetEnabled: _fields(on=_flag),
    commands.ClearError: _fields(),
    commands.SetToolFrame: _fields(tool_id=_whole(*TOOL_IDS), pose=_pose, name=_text),
    commands.SelectTool: _fields(tool_id=_whole(0, TOOL_IDS[1])),
    commands.SetUserFrame: _fields(user_frame_id=_whole(*USER_FRAME_IDS), pose=_pose, name=_text),
    commands.SelectUserFrame: _fields(user_frame_id=_whole(0, USER_FRAME_IDS[1])),
    commands.SetPayload: _fields(mass=_within(MASSES, "kg"), centroid=_numbers(3, CENTROID_LIMIT, "m")),
    commands.SetHandGuiding: _fields(active=_flag),
    commands.SetCollisionLevel: _fields(level=_whole(0, 5)),
    commands.SetDigitalOutput: _fields(bank=_bank, index=_whole(*IO_INDICES), value=_flag),
    commands.SetAnalogOutput: _analog_output,
    commands.SetRapidRate: _fields(rate=_within((0.0, 1.0), "")),
    commands.SetFeedPeriod: _fields(period=_within(FEED_PERIODS_S, "s")),
    commands.SetLinkLoss: _fields(seconds=_within(LINK_LOSS_TIMES_S, "s")),
    commands.ForwardKinematics: _fields(joint_position=_numbers(JOINT_COUNT, ANGLE_LIMIT, "rad")),
    commands.InverseKinematics: _fields(target=_pose, reference=_numbers(JOINT_COUNT, ANGLE_LIMIT, "rad")),
    commands.Query: _fields(),
    commands.GetDigitalOutput: _fields(bank=_bank, index=_whole(*IO_INDICES)),
    commands.GetAnalogOutput: _fields(bank=_bank, index=_whole(*IO_INDICES)),
    commands.GetDigitalInput: _fields(bank=_bank, index=_whole(*IO_INDICES)),
    commands.GetAnalogInput: _fields(bank=_bank, index=_whole(*IO_INDICES)),
    commands.ZeroForceSensor: _fields(),
}
