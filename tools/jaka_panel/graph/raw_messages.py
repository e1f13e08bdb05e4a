"""Fields out of the bytes of messages, of those alone that are shown: deserialising all of them costs much more.

Every function takes a message as it comes over TCPROS, without its length, and raises struct.error or IndexError where
it is shorter than its type says. Types of packages that need not be installed (industrial_msgs, control_msgs) are read
in the same way.
"""
import struct
from typing import List, NamedTuple, Optional, Tuple

_HEADER = struct.Struct("<III")
_LENGTH = struct.Struct("<I")
_SIX = struct.Struct("<6d")
_SEVEN = struct.Struct("<7d")
_ROBOT = struct.Struct("<4h")
_STATUS = struct.Struct("<6bi")
_F64 = 8
JOINTS = 6


class Stamped(NamedTuple):
    """Stamp, ns; frame; where the content begins."""

    stamp_ns: int
    frame_id: str
    begin: int


def header(raw: bytes) -> Stamped:
    """Read a std_msgs/Header at the beginning."""
    _, seconds, nanoseconds = _HEADER.unpack_from(raw)
    (length,) = _LENGTH.unpack_from(raw, 12)
    return Stamped(seconds * 1000000000 + nanoseconds, raw[16:16 + length].decode("utf-8", "replace"), 16 + length)


def _names_end(raw: bytes, at: int) -> int:
    """Return the offset behind a string[]."""
    (count,) = _LENGTH.unpack_from(raw, at)
    at += 4
    for _ in range(count):
        (length,) = _LENGTH.unpack_from(raw, at)
        at += 4 + length
    return at


def _numbers(raw: bytes, at: int) -> Tuple[Optional[Tuple[float, ...]], int]:
    """Read a float64[]; return it if it has six numbers, else None, and the offset behind it."""
    (count,) = _LENGTH.unpack_from(raw, at)
    end = at + 4 + _F64 * count
    if count != JOINTS:
        return None, end
    return _SIX.unpack_from(raw, at + 4), end


def joint_state(raw: bytes) -> Tuple[int, Optional[Tuple[float, ...]], Optional[Tuple[float, ...]]]:
    """Read a sensor_msgs/JointState of six joints in their order: stamp, ns, position, velocity."""
    head = header(raw)
    position, at = _numbers(raw, _names_end(raw, head.begin))
    velocity, _ = _numbers(raw, at)
    return head.stamp_ns, position, velocity


def six_numbers(raw: bytes) -> Tuple[Stamped, Tuple[float, ...]]:
    """Read a geometry_msgs/TwistStamped or WrenchStamped: header, and two vectors one after the other (6,)."""
    head = header(raw)
    return head, _SIX.unpack_from(raw, head.begin)


def pose(raw: bytes) -> Tuple[Stamped, Tuple[float, ...]]:
    """Read a geometry_msgs/PoseStamped: header, and position and quaternion x y z w (7,)."""
    head = header(raw)
    return head, _SEVEN.unpack_from(raw, head.begin)


def robot_states(raw: bytes) -> Tuple[int, ...]:
    """Read a jaka_msgs/RobotMsg: motion, power, servo, collision."""
    return _ROBOT.unpack_from(raw)


def robot_status(raw: bytes) -> Tuple[int, Tuple[int, ...]]:
    """Read an industrial_msgs/RobotStatus.

    Returns:
        Stamp, ns; mode, e_stopped, drives_powered, motion_possible, in_motion, in_error, error_code.
    """
    head = header(raw)
    return head.stamp_ns, _STATUS.unpack_from(raw, head.begin)


def controller_state(raw: bytes) -> Tuple[int, Optional[Tuple[float, ...]], Optional[Tuple[float, ...]]]:
    """Read a control_msgs/JointTrajectoryControllerState: stamp, ns, desired positions, errors of the positions."""
    head = header(raw)
    at = _names_end(raw, head.begin)
    points: List[Optional[Tuple[float, ...]]] = []
    for _ in range(3):  # desired, actual, error: positions, velocities, accelerations, effort, time_from_start
        positions, at = _numbers(raw, at)
        for _ in range(3):
            _, at = _numbers(raw, at)
        at += 8
        points.append(positions)
    return head.stamp_ns, points[0], points[2]


def number_array(raw: bytes) -> Optional[Tuple[float, ...]]:
    """Read a std_msgs/Float64MultiArray of six numbers."""
    (dimensions,) = _LENGTH.unpack_from(raw)
    at = 4
    for _ in range(dimensions):
        (length,) = _LENGTH.unpack_from(raw, at)
        at += 4 + length + 8
    values, _ = _numbers(raw, at + 4)
    return values


def number(raw: bytes) -> float:
    """Read a std_msgs/Float64."""
    return float(struct.unpack_from("<d", raw)[0])
