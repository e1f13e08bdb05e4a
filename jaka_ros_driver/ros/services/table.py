"""The table of all services, and the way from a call to its response and its record.

A refusal or failure is in the response. Only where a type has no field for it (stop_move) does the call fail with a ROS
service error.
"""
import logging
import time
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    NamedTuple,
    Optional,
    Protocol,
    Tuple,
    Type,
    TypeVar,
)

import genpy
import rospy
from std_srvs.srv import Empty, SetBool, Trigger

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.errors import JakaError, ProtocolError
from jaka_ros_driver.ros.audit.recorder import CallEntry, Recorder
from jaka_ros_driver.ros.convert import VENDOR_IO_FAILURE, VENDOR_KINEMATICS_FAILURE, RequestDecoder, wire_pose
from jaka_ros_driver.ros.jaka_types import AbsentType, warn_absent
from jaka_ros_driver.ros.jaka_types import services as types
from jaka_ros_driver.ros.services.call_publisher import CallPublisher, ReceivedCall
from jaka_ros_driver.ros.services.handlers import ServiceHandlers, ServiceOutcome
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer
from jaka_ros_driver.ros.services.wire_definitions import other_definitions

if TYPE_CHECKING:
    from jaka_msgs.srv import GetFKResponse, GetIKResponse, GetIOResponse, SetWorkspaceResponse

_LOG = logging.getLogger(__name__)

_Request = TypeVar("_Request", bound=genpy.Message)
_Request_co = TypeVar("_Request_co", bound=genpy.Message, covariant=True)
_Response_co = TypeVar("_Response_co", bound=genpy.Message, covariant=True)
_Command = TypeVar("_Command")
_Response = TypeVar("_Response", bound=genpy.Message)
FLOAT32_MAX = 3.4028234663852886e38


class WithRet(Protocol):
    """A response of jaka_msgs."""

    ret: int
    message: str


class WithSuccess(Protocol):
    """A response of std_srvs/SetBool or Trigger."""

    success: bool
    message: str


def as_ret(response: WithRet, outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set ``ret``, 1 or 0, and ``message`` (docs/interface.md section 4.1)."""
    response.ret = int(outcome.is_success)
    response.message = outcome.message


def as_text(response: "SetWorkspaceResponse", outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set the fields of set_workspace; the text is empty on failure."""
    as_ret(response, outcome, is_vendor)
    response.yaml = outcome.text


def as_success(response: WithSuccess, outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set the fields of std_srvs/SetBool and Trigger."""
    response.success = outcome.is_success
    response.message = outcome.message


def as_exception(response: genpy.Message, outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Raise rospy.ServiceException on failure: std_srvs/Empty has no field for it."""
    if not outcome.is_success:
        raise rospy.ServiceException(outcome.message)


def as_value(response: "GetIOResponse", outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set the fields of get_io, without ``ret``: failure is NaN and ``error:`` (docs/interface.md section 4.1)."""
    response.message = outcome.message if outcome.is_success else "error: " + outcome.message
    response.value = outcome.value if outcome.is_success else VENDOR_IO_FAILURE if is_vendor else float("nan")


def as_pose(response: "GetFKResponse", outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set the fields of get_fk; the pose is empty on failure."""
    response.message = outcome.message
    response.cartesian_pose = wire_pose(outcome.value) if outcome.is_success else _no_numbers(is_vendor)


def as_joints(response: "GetIKResponse", outcome: ServiceOutcome, is_vendor: bool) -> None:
    """Set the fields of get_ik; the joints are empty on failure."""
    response.message = outcome.message
    response.joint = outcome.value if outcome.is_success else _no_numbers(is_vendor)


def require_float32(value: Any) -> None:
    """Raise ProtocolError where float32 cannot hold a result: serialising it would end the call without a reason."""
    numbers = wire_pose(value) if isinstance(value, Pose) else value if isinstance(value, (tuple, list)) else (value,)
    if not all(isinstance(number, (int, float)) and -FLOAT32_MAX <= number <= FLOAT32_MAX for number in numbers):
        raise ProtocolError("the result %.200r holds what is no number of float32" % (value,))


def _no_numbers(is_vendor: bool) -> Tuple[float, ...]:
    return (VENDOR_KINEMATICS_FAILURE,) * 6 if is_vendor else ()


class ServiceSpec(NamedTuple):
    """One service: its name, type, decoder, handler, and the way in which its outcome is reported.

    Attributes:
        name: Its name in the node's private namespace.
        srv_type: The generated service type.
        to_command: Decodes the request: checks shapes and enums, changes units, raises InvalidCommand. It does nothing
            else.
        perform: Carries the command out; raises a JakaError where that fails.
        report: Writes the outcome into the response.
        is_stop: It stops the arm: in place of a command it is given what is to be called once the stop is sent.
    """

    name: str
    srv_type: Any
    to_command: Callable[[RequestDecoder, Any], Any]
    perform: Callable[[ServiceHandlers, Any], ServiceOutcome]
    report: Callable[[Any, ServiceOutcome, bool], None] = as_ret
    is_stop: bool = False


class _Definition(Protocol[_Request_co, _Response_co]):
    """A generated service type, by the classes of its requests and responses."""

    @property
    def _request_class(self) -> Type[_Request_co]: ...

    @property
    def _response_class(self) -> Type[_Response_co]: ...


def service(name: str, srv_type: _Definition[_Request, _Response],
            to_command: Callable[[RequestDecoder, _Request], _Command],
            perform: Callable[[ServiceHandlers, _Command], ServiceOutcome],
            report: Callable[[_Response, ServiceOutcome, bool], None]) -> ServiceSpec:
    """Return a service whose decoder takes the requests of its type, whose handler takes what that decodes, and whose
    responses are of its type.

    A type checker sees that they fit each other.
    """
    return ServiceSpec(name, srv_type, to_command, perform, report)


def stop_service(name: str, srv_type: _Definition[Any, _Response],
                 perform: Callable[[ServiceHandlers, Callable[[], object]], ServiceOutcome],
                 report: Callable[[_Response, ServiceOutcome, bool], None]) -> ServiceSpec:
    """Return a service without arguments that stops the arm, and has its call recorded once the stop is sent."""
    return ServiceSpec(name, srv_type, RequestDecoder.nothing, perform, report, is_stop=True)


_ROWS: Tuple[ServiceSpec, ...] = (
    service("linear_move", types.Move, RequestDecoder.linear_move, ServiceHandlers.move, as_ret),
    service("joint_move", types.Move, RequestDecoder.joint_move, ServiceHandlers.move, as_ret),
    service("jog", types.Move, RequestDecoder.jog, ServiceHandlers.jog, as_ret),
    service("servo_move_enable", types.ServoMoveEnable, RequestDecoder.servo_mode, ServiceHandlers.servo_mode, as_ret),
    service("servo_p", types.ServoMove, RequestDecoder.servo_pose, ServiceHandlers.servo_target, as_ret),
    service("servo_j", types.ServoMove, RequestDecoder.servo_joint, ServiceHandlers.servo_target, as_ret),
    stop_service("stop_move", Empty, ServiceHandlers.stop, as_exception),
    service("set_toolframe", types.SetTcpFrame, RequestDecoder.tool_frame, ServiceHandlers.tool_frame, as_ret),
    service("set_userframe", types.SetUserFrame, RequestDecoder.user_frame, ServiceHandlers.user_frame, as_ret),
    service("set_payload", types.SetPayload, RequestDecoder.payload, ServiceHandlers.payload, as_ret),
    service("drag_mode", SetBool, RequestDecoder.switch, ServiceHandlers.hand_guiding, as_success),
    service("drag_move", SetBool, RequestDecoder.switch, ServiceHandlers.hand_guiding, as_success),
    service("set_collisionlevel", types.SetCollision, RequestDecoder.collision_level, ServiceHandlers.collision_level,
            as_ret),
    service("get_settings", Trigger, RequestDecoder.nothing, ServiceHandlers.held_settings, as_success),
    service("set_io", types.SetIO, RequestDecoder.output, ServiceHandlers.output, as_ret),
    service("get_io", types.GetIO, RequestDecoder.terminal, ServiceHandlers.read, as_value),
    service("zero_ftsensor", Trigger, RequestDecoder.nothing, ServiceHandlers.zero_force_sensor, as_success),
    service("clear_err", types.ClearErr, RequestDecoder.clear_error, ServiceHandlers.clear_error, as_ret),
    service("clear_err", types.ClearError, RequestDecoder.clear_error, ServiceHandlers.clear_error, as_ret),
    service("get_fk", types.GetFK, RequestDecoder.forward, ServiceHandlers.forward, as_pose),
    service("get_ik", types.GetIK, RequestDecoder.inverse, ServiceHandlers.inverse, as_joints),
    service("recover", Trigger, RequestDecoder.nothing, ServiceHandlers.recover, as_success),
    service("pause", Trigger, RequestDecoder.nothing, ServiceHandlers.pause, as_success),
    service("resume", Trigger, RequestDecoder.nothing, ServiceHandlers.resume, as_success),
    service("program/play", Trigger, RequestDecoder.nothing, ServiceHandlers.play_program, as_success),
    service("program/pause", Trigger, RequestDecoder.nothing, ServiceHandlers.pause_program, as_success),
    service("program/resume", Trigger, RequestDecoder.nothing, ServiceHandlers.resume_program, as_success),
    stop_service("program/stop", Trigger, ServiceHandlers.stop_program, as_success),
    service("power", SetBool, RequestDecoder.switch, ServiceHandlers.power, as_success),
    service("enable", SetBool, RequestDecoder.switch, ServiceHandlers.enable, as_success),
    service("set_speed_slider", types.SetSpeedSlider, RequestDecoder.speed, ServiceHandlers.speed, as_success),
    service("program/load", types.LoadProgram, RequestDecoder.program_name, ServiceHandlers.load_program, as_success),
    service("set_workspace", types.SetWorkspace, RequestDecoder.workspace, ServiceHandlers.workspace, as_text),
)


def _first_installed(rows: Iterable[ServiceSpec]) -> Tuple[ServiceSpec, ...]:
    """Return, of the rows of each name, the first whose type is installed."""
    found: Dict[str, ServiceSpec] = {}
    for row in rows:
        if not isinstance(row.srv_type, AbsentType):
            found.setdefault(row.name, row)
    return tuple(found.values())


SERVICES = _first_installed(_ROWS)


def absent_types() -> Dict[str, str]:
    """Return the name of each type that the installed jaka_msgs lacks, with what that changes, in words."""
    offered = {spec.name: spec.srv_type._type for spec in SERVICES}
    lost: Dict[str, List[str]] = {}
    for row in _ROWS:
        if isinstance(row.srv_type, AbsentType):
            kind = offered.get(row.name)
            lost.setdefault(row.srv_type.name, []).append(
                "~%s is %s" % (row.name, "not offered" if kind is None else "served as " + kind))
    return {name: ", ".join(services) for name, services in lost.items()}


class _RunningCall:
    """A running call with its records: its lines of the audit log, and its message on ``~service_calls``."""

    def __init__(self, service_name: str, called_as: Any, request: genpy.Message, entry: CallEntry,
                 publisher: CallPublisher) -> None:
        self._name, self._called_as, self._request = service_name, called_as, request
        self._entry, self._publisher = entry, publisher
        self._received: Optional[ReceivedCall] = None

    def begin(self) -> ReceivedCall:
        """Record that the call has come: of a stop once that is sent, for nothing delays a stop."""
        if self._received is None:
            self._received = ReceivedCall(
                self._name, self._called_as, self._request, rospy.Time.now(), time.monotonic())
            self._entry.begin()
        return self._received

    def answered(self, response: genpy.Message, outcome: ServiceOutcome) -> None:
        """Record the answer."""
        received = self.begin()
        self._entry.answered(outcome.is_success, outcome.message)
        self._publisher.answered(received, response, outcome)

    def failed(self, error: str) -> None:
        """Record that it ended with a ROS service error in place of an answer."""
        received = self.begin()
        self._entry.failed(error)
        self._publisher.failed(received, error)


class Services:
    """All services of the table on one arm."""

    def __init__(self, decoder: RequestDecoder, handlers: ServiceHandlers, call_publisher: CallPublisher,
                 recorder: Recorder) -> None:
        self._decoder = decoder
        self._handlers = handlers
        self._call_publisher = call_publisher
        self._recorder = recorder
        self._calls = CallCount()
        self._servers: List[ServiceServer] = []

    def offer(self) -> None:
        for name, change in absent_types().items():
            warn_absent(name, "%s; everything else is served" % change)
        for spec in SERVICES:
            self._recorder.offers_service("~" + spec.name)
            self._servers.append(ServiceServer(
                "~" + spec.name, spec.srv_type, self._handler(spec), self._calls,
                other_definitions(spec.srv_type), spec.is_stop))

    def finish_calls(self, timeout: float) -> None:
        """Wait until every running call is answered, at most ``timeout`` s."""
        if not self._calls.wait_for_none(timeout):
            _LOG.warning("some service calls were not answered before the driver shut down")

    def _handler(self, spec: ServiceSpec) -> Callable[[Any], Any]:
        private = "~" + spec.name
        name = rospy.resolve_name(private)
        others = {other._request_class: other for other in other_definitions(spec.srv_type).values()}

        def handle(request: Any) -> Any:
            call = _RunningCall(name, others.get(type(request), spec.srv_type), request,
                                self._recorder.prepared_call(private, request), self._call_publisher)
            if not spec.is_stop:
                call.begin()
            try:
                outcome = self._outcome(spec, request, call.begin)
                response = spec.srv_type._response_class()
                spec.report(response, outcome, self._decoder.is_vendor)
            except rospy.ServiceException as error:
                call.failed(str(error))
                raise
            except Exception as error:
                call.failed("internal error: %r" % error)
                raise
            call.answered(response, outcome)
            return response

        return handle

    def _outcome(self, spec: ServiceSpec, request: Any, when_sent: Callable[[], object]) -> ServiceOutcome:
        try:
            command = when_sent if spec.is_stop else spec.to_command(self._decoder, request)
            outcome = spec.perform(self._handlers, command)
            if outcome.value is not None:
                require_float32(outcome.value)
            return outcome
        except JakaError as error:
            _LOG.info("%s: %s", spec.name, error)
            return ServiceOutcome(str(error), is_success=False)
