"""Conversion of ROS requests to commands, and of results and states to ROS messages: shapes, enums and units.

No other file of ``ros`` changes units. A float32 in a request may be larger than the limit that it was made from (2 pi
as float32 is 1.7e-7 rad more). So a joint target, speed or acceleration that exceeds a limit of the arm by no more than
``limits.FLOAT32_SLACK`` of the limit is set to the limit; a larger one is refused. The controller never receives a
value beyond its limits.
"""
import json
import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Dict, List, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar, Union

import genpy
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from jaka_msgs import msg as messages
from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.workspace import Workspace, workspace_of_text
from jaka_ros_driver.client.core.procedures.settings import HeldSettings
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import (
    Transform,
    rotation_vector_from_matrix,
    rotation_vector_from_rpy,
    rpy_from_rotation_vector,
)
from jaka_ros_driver.state import BusTerminals, IoBank, IoState, RobotState
from jaka_ros_driver.units import all_m_to_mm, all_mm_to_m, all_rad_to_deg, mm_to_m

if TYPE_CHECKING:  # a jaka_msgs from elsewhere (JAKA_MSGS_EXTERNAL=1) lacks some of them
    from std_srvs.srv import SetBoolRequest

    from jaka_msgs import srv as requests

SLOWEST = 0.01
"""Smallest share of the programmed speed that a caller can set; pause brings the arm to rest."""
COLLISION_STEPS = (25, 50, 75, 100)
"""Upper ends of the ranges of ``value`` for the levels 1 to 4 (docs/interface.md section 2)."""
COLLISION_LOWEST = 10
VENDOR_IO_FAILURE = -999999.0
VENDOR_KINEMATICS_FAILURE = 9999.0
"""The value of each number in the maker's reply to a failed get_fk or get_ik (docs/interface.md section 5)."""

_STAMP = ("header.stamp.secs", "header.stamp.nsecs")
TWIST_FIELDS = _STAMP + tuple("twist.%s.%s" % (part, axis) for part in ("linear", "angular") for axis in "xyz")
POSE_FIELDS = _STAMP + tuple("pose.position." + axis for axis in "xyz") + tuple(
    "pose.orientation." + axis for axis in "xyzw")
JOINT_FIELDS = _STAMP + ("position", "velocity", "effort")
ROBOT_FIELDS = ("motion_state", "power_state", "servo_state", "collision_state")
"""Fields with numbers of the state topics' messages, in the order of the functions that return these numbers."""

_Member = TypeVar("_Member", bound=IntEnum)
_JOINTS = "six joint angles, rad"
_COORD_MODES = "0 joint, 1 active user frame, 2 tool"
_QUATERNION_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's norm from 1: room for clients that round to three digits."""
_LONGEST_ROTATION = 2.0 * math.pi
"""Longest rotation vector, rad: one turn; a longer one is taken for a mistake."""


@dataclass(frozen=True)
class Terminal:
    """One input or output, as get_io names it."""

    is_digital: bool
    is_output: bool
    bank: IoBank
    index: int

    def __str__(self) -> str:
        return "%s %s %d of %s" % ("digital" if self.is_digital else "analog", "output" if self.is_output else "input",
                                   self.index, self.bank.name.lower())


class ToolPayload(NamedTuple):
    """A load, and the id of the tool that carries it."""

    tool_id: int
    load: c.SetPayload


class RequestDecoder:
    """The decoder of the requests of services and topics to commands.

    Every method raises InvalidCommand, which names the field and its valid range.

    Attributes:
        is_vendor: Read requests as the maker's own driver does, where it differs (docs/interface.md section 5).
        blends: A Move's ``mvradii`` is read: moves are queued, not waited for (``~blocking`` false).
    """

    def __init__(self, model: ArmModel, is_vendor: bool = False, is_vendor_2025: bool = False,
                 blends: bool = False) -> None:
        """Set up the decoder.

        is_vendor_2025: With ``is_vendor``, as its driver of 2025 (docs/controller-protocol.md section 9.1).
        """
        self._model = model
        self._is_vendor_2025 = is_vendor_2025
        self.is_vendor = is_vendor
        self._blends = blends

    def joint_move(self, request: "requests.MoveRequest") -> c.JointMove:
        """Decode a Move: ``pose`` is joint angles, rad; ``mvvelo`` rad/s; ``mvacc`` rad/s2."""
        return c.JointMove(self._joint_target("pose", request.pose),
                           _settled_speed(_positive("mvvelo", request.mvvelo), limits.joint_speed_limit(self._model)),
                           _settled_speed(_positive("mvacc", request.mvacc), limits.JOINT_ACCELERATION_CEILING),
                           self._blend_radius(request) or 0.0)

    def linear_move(self, request: "requests.MoveRequest") -> c.LinearMove:
        """Decode a Move: ``pose`` is x, y, z, mm, and a rotation vector, rad; ``mvvelo`` mm/s; ``mvacc`` mm/s2.

        In the vendor's interface the rotation is the inverse; in that of 2025 the last three are roll, pitch and yaw,
        rad. A Move has no angular speed: it follows from the linear one, lowered to what the model's joints can do.
        """
        if self._is_vendor_2025:
            pose = _numbers("pose", request.pose, "x y z, mm, and roll pitch yaw, rad")
            rpy = pose[3:]
        else:
            pose = _numbers("pose", request.pose, "x y z, mm, and a rotation vector, rad")
            turn = _rotation_vector("pose", pose)
            rpy = rpy_from_rotation_vector(tuple(-value for value in turn) if self.is_vendor else turn)
        move = c.LinearMove(
            c.Pose(all_mm_to_m(pose[:3]), rpy),
            _settled_speed(mm_to_m(_positive("mvvelo", request.mvvelo)), limits.tcp_speed_limit(self._model)),
            _settled_speed(mm_to_m(_positive("mvacc", request.mvacc)), limits.TCP_ACCELERATION_CEILING))
        return replace(move, angular_speed=min(move.turn_speed, limits.joint_speed_limit(self._model)),
                       angular_acceleration=move.turn_acceleration,
                       tolerance=self._blend_radius(request) or move.tolerance)

    def jog(self, request: "requests.MoveRequest") -> c.Jog:
        """Decode a Move: speed ``mvvelo``, or ``mvacc`` where that is 0; rad/s, along x, y, z mm/s."""
        frame = _member("coord_mode", request.coord_mode, c.JogFrame, _COORD_MODES)
        _whole("index", request.index, 0, 11)
        name = "mvacc" if request.mvvelo == 0.0 and request.mvacc != 0.0 else "mvvelo"
        axis, is_negative = divmod(request.index, 2)
        jog = c.Jog(frame, axis, _positive(name, getattr(request, name)))
        speed = _settled_speed(mm_to_m(jog.velocity) if jog.is_linear else jog.velocity,
                               limits.jog_speed_limit(jog, self._model))
        return replace(jog, velocity=-speed if is_negative else speed)

    def servo_mode(self, request: "requests.ServoMoveEnableRequest") -> bool:
        """Decode a ServoMoveEnable: True to enter servo mode."""
        return bool(request.enable)

    def servo_joint(self, request: "requests.ServoMoveRequest") -> c.ServoJoint:
        """Decode a ServoMove: ``pose`` is joint angles, rad; in the vendor's interface an increment."""
        if self.is_vendor:
            return c.ServoJoint(_numbers("pose", request.pose, "six joint increments, rad"), relative=True)
        return c.ServoJoint(self._joint_target("pose", request.pose))

    def servo_pose(self, request: "requests.ServoMoveRequest") -> c.ServoPose:
        """Decode a ServoMove: x, y, z, m, and rpy, rad; in the vendor's interface increments, mm and rad."""
        pose = _numbers("pose", request.pose, "x y z, %s, and roll pitch yaw, rad" % ("mm" if self.is_vendor else "m"))
        position = all_mm_to_m(pose[:3]) if self.is_vendor else pose[:3]
        return c.ServoPose(c.Pose(position, pose[3:]), relative=self.is_vendor)

    def servo_joint_topic(self, message: JointState) -> c.ServoJoint:
        """Decode a JointState: joint angles, rad, absolute in both interfaces; in any order where they have names."""
        values = message.position
        if message.name:
            if sorted(message.name) != sorted(c.JOINTS) or len(values) != len(c.JOINTS):
                raise InvalidCommand("name is %s; valid: %s, each with its position, or no names"
                                     % (list(message.name), ", ".join(c.JOINTS)))
            values = [values[message.name.index(joint)] for joint in c.JOINTS]
        return c.ServoJoint(self._joint_target("position", values))

    def servo_pose_topic(self, message: PoseStamped, user_frame: str) -> c.ServoPose:
        """Decode a PoseStamped: position, m, and unit quaternion, absolute in both interfaces.

        user_frame: Name of the active user frame; the message may name no other.
        """
        if message.header.frame_id not in ("", user_frame):
            raise InvalidCommand("frame_id is %.60r; valid: the active user frame %r, or empty"
                                 % (message.header.frame_id, user_frame))
        p, q = message.pose.position, message.pose.orientation
        position = tuple(_finite("position." + axis, getattr(p, axis)) for axis in "xyz")
        x, y, z, w = (_finite("orientation." + axis, getattr(q, axis)) for axis in "xyzw")
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
            raise InvalidCommand("orientation has the norm %.6g; it must be a unit quaternion" % norm)
        sin_half = math.sqrt(x * x + y * y + z * z)
        scale = 2.0 * math.atan2(sin_half, w) / sin_half if sin_half > 0.0 else 0.0
        return c.ServoPose(c.Pose(position, rpy_from_rotation_vector((x * scale, y * scale, z * scale))))

    def path(self, goal: "messages.MovePathGoal") -> Tuple[c.PathCommand, ...]:
        """Decode a MovePath: segments in ROS units, the same in both interfaces."""
        return tuple(self._segment("segments[%d]." % n, segment) for n, segment in enumerate(goal.segments))

    def _segment(self, name: str, segment: "messages.PathSegment") -> c.PathCommand:
        speed = _positive(name + "speed", segment.speed)
        acceleration = _positive(name + "acceleration", segment.acceleration)
        radius = _finite(name + "blend_radius", segment.blend_radius)
        if segment.type == segment.JOINT:
            return c.JointMove(self._joint_target(name + "joints", segment.joints), speed, acceleration, radius)
        target = _pose_in_m(name + "pose", segment.pose)
        if segment.type == segment.LINE:
            line = c.LinearMove(target, speed, acceleration, radius)
            return replace(line, angular_speed=min(line.turn_speed, limits.joint_speed_limit(self._model)),
                           angular_acceleration=line.turn_acceleration)
        if segment.type == segment.ARC:
            return c.ArcMove(_pose_in_m(name + "via", segment.via), target, speed, acceleration, radius)
        raise InvalidCommand("%stype is %d; valid: 0 joint, 1 line, 2 arc" % (name, segment.type))

    def _blend_radius(self, request: "requests.MoveRequest") -> Optional[float]:
        """Return the blend radius of a Move, m; None where its target is to be met.

        The radius is how far the tool may pass the target on its way to the next one.
        """
        if not self._blends or request.mvradii == 0.0:
            return None
        if _finite("mvradii", request.mvradii) < 0.0:
            raise InvalidCommand("mvradii is %.9g; valid: 0 to %g mm" % (
                request.mvradii, all_m_to_mm((limits.TOLERANCES[1],))[0]))
        return mm_to_m(request.mvradii)

    def _joint_target(self, name: str, values: Sequence[float]) -> Tuple[float, ...]:
        return tuple(_settled(value, low, high) for value, (low, high) in zip(
            _numbers(name, values, _JOINTS), self._model.joint_limits))

    def nothing(self, request: genpy.Message) -> None:
        """Decode a request without fields."""

    def clear_error(self, request: "Union[requests.ClearErrRequest, requests.ClearErrorRequest]") -> None:
        """Decode a ClearErr, or a ClearError; raise InvalidCommand where its ``enable`` is false."""
        if not getattr(request, "enable", True):
            raise InvalidCommand("enable is false, which clears nothing; to clear, call with enable true")

    def tool_frame(self, request: "requests.SetTcpFrameRequest") -> c.SetToolFrame:
        """Decode a SetTcpFrame: ``pose`` is x, y, z, mm, and a rotation vector, rad."""
        _whole("tool_num", request.tool_num, *limits.TOOL_IDS)
        return c.SetToolFrame(request.tool_num, _frame_pose(request.pose), "tool_%d" % request.tool_num)

    def user_frame(self, request: "requests.SetUserFrameRequest") -> c.SetUserFrame:
        """Decode a SetUserFrame: ``pose`` is x, y, z, mm, and a rotation vector, rad."""
        _whole("user_num", request.user_num, *limits.USER_FRAME_IDS)
        return c.SetUserFrame(request.user_num, _frame_pose(request.pose), "user_%d" % request.user_num)

    def payload(self, request: "requests.SetPayloadRequest") -> ToolPayload:
        """Decode a SetPayload: mass, kg, centre of mass, mm. It is audited here, because the tool is selected first."""
        _whole("tool_num", request.tool_num, 0, limits.TOOL_IDS[1])
        mass = _finite("mass", request.mass)
        centroid = tuple(_finite(name, getattr(request, name)) for name in ("xc", "yc", "zc"))
        load = c.SetPayload(mass, all_mm_to_m(centroid))
        limits.check(load, self._model)
        return ToolPayload(request.tool_num, load)

    def switch(self, request: "SetBoolRequest") -> bool:
        """Decode a SetBool: its ``data``."""
        return bool(request.data)

    def collision_level(self, request: "requests.SetCollisionRequest") -> int:
        """Decode a SetCollision: 10 to 100 to the levels 1 to 4, 0 where off (docs/interface.md section 2)."""
        if not request.is_enable:
            return 0
        _whole("value", request.value, COLLISION_LOWEST, COLLISION_STEPS[-1])
        return 1 + sum(request.value > step for step in COLLISION_STEPS)

    def speed(self, request: "requests.SetSpeedSliderRequest") -> float:
        """Decode a SetSpeedSlider."""
        fraction = _finite("speed_slider_fraction", request.speed_slider_fraction)
        if not SLOWEST <= fraction <= 1.0:
            raise InvalidCommand("speed_slider_fraction is %.9g; valid: %g to 1" % (fraction, SLOWEST))
        return fraction

    def program_name(self, request: "requests.LoadProgramRequest") -> str:
        """Decode a LoadProgram: the name, which the audit checks."""
        return str(request.name)

    def workspace(self, request: "requests.SetWorkspaceRequest") -> Optional[Workspace]:
        """Decode a SetWorkspace: the zones and the tool; None where it only asks."""
        return workspace_of_text(request.yaml) if request.yaml.strip() else None

    def output(self, request: "requests.SetIORequest") -> Union[c.SetDigitalOutput, c.SetAnalogOutput]:
        """Decode a SetIO. Any value but 0 switches a digital output on."""
        bank = _member("type", request.type, IoBank)
        index = _whole("index", request.index, *limits.IO_INDICES)
        value = _finite("value", request.value)
        if _is_digital(request.signal):
            return c.SetDigitalOutput(bank, index, value != 0.0)
        return c.SetAnalogOutput(bank, index, value)

    def terminal(self, request: "requests.GetIORequest") -> Terminal:
        """Decode a GetIO."""
        is_digital = _is_digital(request.signal)
        is_output = _whole("path", request.path, 0, 1) == 1
        return Terminal(is_digital, is_output, _member("type", request.type, IoBank),
                        _whole("index", request.index, *limits.IO_INDICES))

    def forward(self, request: "requests.GetFKRequest") -> c.ForwardKinematics:
        """Decode a GetFK: joint angles, rad."""
        return c.ForwardKinematics(_numbers("joint", request.joint, _JOINTS))

    def inverse(self, request: "requests.GetIKRequest") -> c.InverseKinematics:
        """Decode a GetIK: ``cartesian_pose`` is x, y, z, mm, and rpy, rad; ``ref_joint`` joint angles, rad."""
        pose = _numbers("cartesian_pose", request.cartesian_pose, "x y z, mm, and roll pitch yaw, rad")
        return c.InverseKinematics(c.Pose(all_mm_to_m(pose[:3]), pose[3:]),
                                   _numbers("ref_joint", request.ref_joint, _JOINTS))


def wire_pose(pose: c.Pose) -> Tuple[float, ...]:
    """Return a pose as the ``cartesian_pose`` of get_fk: x, y, z, mm, and rpy, rad."""
    return all_m_to_mm(pose.position) + tuple(pose.rpy)


def settings_text(held: HeldSettings) -> str:
    """Return the settings as the JSON of get_settings: m, rotation vectors in rad, kg; null for what is not known."""
    payload = held.payload
    return json.dumps({
        "tool": held.tool_id, "user_frame": held.user_frame_id,
        "tools": None if held.tools is None else [_frame(pose) for pose in held.tools],
        "user_frames": None if held.user_frames is None else [_frame(pose) for pose in held.user_frames],
        "payload": None if payload is None else {"mass": payload.mass, "centre": _rounded(payload.centroid)},
        "collision_level": held.collision_level})


def _frame(pose: c.Pose) -> Dict[str, List[float]]:
    return {"p": _rounded(pose.position), "r": _rounded(rotation_vector_from_rpy(pose.rpy))}


def _rounded(values: Sequence[float]) -> List[float]:
    """Return the values to a tenth of a micrometre or microradian."""
    return [round(value, 7) for value in values]


# ---- state to messages ----

def tool_twist(state: RobotState, is_vendor: bool) -> Optional[Tuple[float, ...]]:
    """Return the numbers of ``~tool_position``, shape (6,): m and rotation vector, rad (vendor's interface: mm and rpy,
    deg).

    It is None where the controller does not report the pose.
    """
    if state.tcp_position is None or state.tcp_rpy is None:
        return None
    if is_vendor:
        return all_m_to_mm(state.tcp_position) + all_rad_to_deg(state.tcp_rpy)
    return state.tcp_position + rotation_vector_from_rpy(state.tcp_rpy)


def tool_position(twist: Sequence[float], stamp: genpy.Time, frame_id: str) -> TwistStamped:
    """Return the message of ``~tool_position`` with the numbers of ``tool_twist``."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = twist
    return message


def tool_pose(state: RobotState) -> Optional[Tuple[float, ...]]:
    """Return the numbers of ``~tool_position`` in the vendor's interface of 2025, shape (7,): mm and unit quaternion.

    It is None where the controller does not report the pose.
    """
    if state.tcp_position is None or state.tcp_rpy is None:
        return None
    return all_m_to_mm(state.tcp_position) + quaternion(rotation_vector_from_rpy(state.tcp_rpy))


def tool_position_2025(pose: Sequence[float], stamp: genpy.Time, frame_id: str) -> PoseStamped:
    """Return the message of ``~tool_position`` with the numbers of ``tool_pose``."""
    message = PoseStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose
    return message


def joint_position(state: RobotState, stamp: genpy.Time, names: Sequence[str],
                   velocity: Optional[Sequence[float]]) -> JointState:
    """Return a JointState: positions, rad, and velocities, rad/s, where these are known."""
    message = JointState()
    message.header.stamp = stamp
    message.name = list(names)
    message.position = list(state.joint_position)
    message.velocity = list(velocity) if velocity is not None else []
    return message


def robot_conditions(state: RobotState, is_servo_active: bool, is_vendor: bool,
                     is_stream_moving: Optional[bool] = None) -> Tuple[int, int, int, int]:
    """Return the numbers of ``~robot_states``; ``is_stream_moving`` as for ``shown_motion_state``.

    ``servo_state`` is 1 in servo mode, in the vendor's interface while the arm is enabled.
    """
    return (int(state.shown_motion_state(is_stream_moving)), int(state.is_powered),
            int(state.is_enabled if is_vendor else is_servo_active), int(state.protective_stop))


def robot_states(conditions: Sequence[int]) -> "messages.RobotMsg":
    """Return the message of ``~robot_states`` with the numbers of ``robot_conditions``."""
    return messages.RobotMsg(**dict(zip(ROBOT_FIELDS, conditions)))


def transform_message(parent_t_child: Transform, parent: str, child: str, stamp: genpy.Time) -> TransformStamped:
    """Return a TransformStamped: m and unit quaternion."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = parent
    message.child_frame_id = child
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = parent_t_child[9:]
    rotation.x, rotation.y, rotation.z, rotation.w = quaternion(rotation_vector_from_matrix(parent_t_child))
    return message


def io_states(io: IoState, stamp: genpy.Time) -> "messages.IOStates":
    """Return the message of ``~io_states`` (jaka_msgs/IOStates)."""
    message = messages.IOStates()
    message.header.stamp = stamp
    for name, bank in (("cabinet", IoBank.CABINET), ("tool", IoBank.TOOL), ("extension", IoBank.EXTENSION)):
        setattr(message, name, _io_bank(BusTerminals(
            io.digital_inputs.get(bank, ()), io.digital_outputs.get(bank, ()),
            io.analog_inputs.get(bank, ()), io.analog_outputs.get(bank, ()))))
    message.relays = list(map(bool, io.relays))
    for bus, terminals in io.field_buses.items():
        setattr(message, bus.name.lower(), _io_bank(terminals))
    return message


def _io_bank(terminals: BusTerminals) -> "messages.IOBank":
    return messages.IOBank(
        digital_inputs=list(map(bool, terminals.digital_inputs)),
        digital_outputs=list(map(bool, terminals.digital_outputs)),
        analog_inputs=list(terminals.analog_inputs), analog_outputs=list(terminals.analog_outputs))


def wrench(values: Sequence[float], stamp: genpy.Time, frame_id: str) -> WrenchStamped:
    """Return the message of ``~wrench``: force, N, and torque, N m, shape (6,)."""
    message = WrenchStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values
    return message


def for_each_joint(values: Sequence[float]) -> Float64MultiArray:
    """Return a message with a number for each joint, joint 1 first; std_msgs has no type with names."""
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label="joint", size=len(values), stride=len(values))])
    return Float64MultiArray(layout=layout, data=list(values))


def quaternion(rotation_vector: Sequence[float]) -> Tuple[float, float, float, float]:
    """Return the unit quaternion (x, y, z, w) of a rotation vector, rad (3,)."""
    x, y, z = rotation_vector
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return x * scale, y * scale, z * scale, math.cos(0.5 * angle)


# ---- shapes ----

def _finite(name: str, value: float) -> float:
    if not math.isfinite(value):
        raise InvalidCommand("%s is %r; it must be a finite number" % (name, value))
    return float(value)


def _positive(name: str, value: float) -> float:
    if _finite(name, value) <= 0.0:
        raise InvalidCommand("%s is %.9g; it must be above 0" % (name, value))
    return float(value)


def _numbers(name: str, values: Sequence[float], what: str) -> Tuple[float, ...]:
    if len(values) != 6:
        raise InvalidCommand("%s has %d values; it must have 6: %s" % (name, len(values), what))
    for n, value in enumerate(values):
        if not math.isfinite(value):
            _finite("%s[%d]" % (name, n), value)
    return tuple(map(float, values))


def _pose_in_m(name: str, values: Sequence[float]) -> c.Pose:
    pose = _numbers(name, values, "x y z, m, and a rotation vector, rad")
    return c.Pose(pose[:3], rpy_from_rotation_vector(_rotation_vector(name, pose)))


def _frame_pose(values: Sequence[float]) -> c.Pose:
    pose = _numbers("pose", values, "x y z, mm, and a rotation vector, rad")
    return c.Pose(all_mm_to_m(pose[:3]), rpy_from_rotation_vector(_rotation_vector("pose", pose)))


def _rotation_vector(name: str, pose: Sequence[float]) -> Tuple[float, ...]:
    """Return the rotation vector, rad (3,), in the last three of the six values.

    More than a whole turn is refused: it is a mistake or in degrees, and a much larger one has lost its digits.
    """
    vector = tuple(pose[3:])
    angle = math.hypot(*vector)
    if angle > _LONGEST_ROTATION * (1.0 + limits.FLOAT32_SLACK):
        raise InvalidCommand("%s[3], [4] and [5] are (%s), a rotation vector of %.9g rad; valid: at most %.9g rad"
                             % (name, ", ".join("%.9g" % value for value in vector), angle, _LONGEST_ROTATION))
    return vector


def _whole(name: str, value: int, low: int, high: int) -> int:
    if not low <= value <= high:
        raise InvalidCommand("%s is %d; valid: %d to %d" % (name, value, low, high))
    return int(value)


def _member(name: str, value: int, kind: "Type[_Member]", valid: str = "") -> "_Member":
    try:
        return kind(value)
    except ValueError:
        raise InvalidCommand("%s is %d; valid: %s" % (name, value, valid or ", ".join(
            ["%d %s" % (member, member.name.lower()) for member in kind]))) from None


def _is_digital(signal: str) -> bool:
    if signal not in ("digital", "analog"):
        raise InvalidCommand("signal is %.60r; valid: digital, analog" % signal)
    return signal == "digital"


def _settled(value: float, low: float, high: float) -> float:
    if low <= value <= high:
        return value
    slack = limits.FLOAT32_SLACK * max(abs(low), abs(high))
    if low - slack <= value <= high + slack:
        return min(max(value, low), high)
    return value


def _settled_speed(value: float, high: float) -> float:
    return high if high < value <= high * (1.0 + limits.FLOAT32_SLACK) else value
