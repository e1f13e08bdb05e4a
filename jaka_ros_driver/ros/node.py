"""The driver node, command jaka_driver: parameters, client, services, topics and diagnostics put together."""
import argparse
import faulthandler
import io
import logging
import os
import select
import signal
import sys
import threading
import time
from typing import Any, Callable, List, Optional, Tuple

import rospy
from std_msgs.msg import Bool

from jaka_ros_driver.clearance.collision_urdf import collision_elements
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.motion_guard.motion_check import STOP
from jaka_ros_driver.client.custody_file import CustodyFile
from jaka_ros_driver.client.first_start import is_first_start
from jaka_ros_driver.client.guard import Guard
from jaka_ros_driver.client.supervisor import supervisor_of
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import ArmModel, file_or_none
from jaka_ros_driver.kinematics.urdf import urdf_from_model
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.audit.recorder import ClientEvents, Recorder
from jaka_ros_driver.ros.audit.setting_up import audit_log_of, start_fields
from jaka_ros_driver.ros.connections import keep_serving, serve_from_the_start
from jaka_ros_driver.ros.convert import RequestDecoder
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.driver_lock import DriverLock
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.exit_codes import CONFIGURATION, DEFECT, ENDED, exit_code_of
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.log_bridge import log_to_ros, log_without_a_file
from jaka_ros_driver.ros.master_watch import MasterWatch
from jaka_ros_driver.ros.metrics.endpoint import metrics_of
from jaka_ros_driver.ros.model_check import ModelCheck
from jaka_ros_driver.ros.params import DriverConfig, config_from, with_common_ip
from jaka_ros_driver.ros.services.call_publisher import CallPublisher
from jaka_ros_driver.ros.services.gripper_action import GripperAction, GripperJoint
from jaka_ros_driver.ros.services.handlers import ServiceHandlers
from jaka_ros_driver.ros.services.path_action import PathAction
from jaka_ros_driver.ros.services.recover_action import RecoverAction
from jaka_ros_driver.ros.services.server import take_connection
from jaka_ros_driver.ros.services.table import Services
from jaka_ros_driver.ros.single_name import refuse_second_node, refuse_shutdown_of_others, resolved_node_name
from jaka_ros_driver.ros.start_checks import (
    refuse_taken_topics,
    refuse_topics_used_twice,
    refuse_unreachable_node,
    refuse_words_that_are_not_taken,
    wait_for_master,
    wait_for_time,
)
from jaka_ros_driver.ros.topics.diagnostics import Diagnostics, package_version
from jaka_ros_driver.ros.topics.io_states import IoPublisher
from jaka_ros_driver.ros.topics.jog_topics import JogSubscribers
from jaka_ros_driver.ros.topics.motion_ends import MotionEnds
from jaka_ros_driver.ros.topics.robot_status import RobotStatusPublisher
from jaka_ros_driver.ros.topics.sensors import SensorPublishers
from jaka_ros_driver.ros.topics.servo_topics import ServoTopics
from jaka_ros_driver.ros.topics.speed import SpeedPublisher
from jaka_ros_driver.ros.topics.state_publishers import FrameNames, StatePublishers
from jaka_ros_driver.ros.topics.workspace_markers import WorkspaceMarkers
from jaka_ros_driver.ros.trajectories.controller_manager import ControllerManager
from jaka_ros_driver.ros.trajectories.controller_params import ControllerParams, controller_params
from jaka_ros_driver.ros.trajectories.query import StateQuery
from jaka_ros_driver.ros.trajectories.topics import TrajectoryInterface
from jaka_ros_driver.scheduling import ask_for_short_slices, set_real_time

_LOG = logging.getLogger(__name__)

_SWITCH_INTERVAL_S = 0.0005
"""The longest time, s, that a Python thread keeps the others waiting: the default, 5 ms, is most of a cycle of 8 ms."""
_ANSWER_TIMEOUT_S = 0.3
"""Longest wait, s, for calls of one kind to be answered at the end; with five kinds it fits ``_END_TIMEOUT_S``."""
_DRAIN_TIMEOUT_S = 0.5
"""Longest wait, s, for the last lines of the log, which are nearly always there at once."""
_AUDIT_TIMEOUT_S = 0.5
"""Longest wait, s, at the end for the disk of the audit log."""
_LOOK_ROUND_S = 0.1
"""Longest pause, s, between two looks of a waiting thread whether the node is to end."""
_KIND_PERIOD_S = 0.1
"""Period, s, of looks whether the arm is known to be real or simulated."""
_END_TIMEOUT_S = 5.0
"""Longest time, s, to the node's end: stopping the arm and answering the calls takes 2 s, the rest is the master's."""
_NAME = "jaka_driver"
_DESCRIPTION = "robot_description"
_NOT_FIRST = ("auto_enable: the driver was started again since this computer was switched on: the arm is left as it is "
              "(~first_start_only)")


class DriverNode:
    """The driver node: everything that runs in it, from its start to its end."""

    def __init__(self, config: DriverConfig, model: ArmModel, controller: ControllerParams) -> None:
        """Lock the controller, and create services and topics; raise AlreadyDriven where another driver has it."""
        self._config = config
        self._model = model
        self._endpoint = endpoint(config.ip, config.command_port)
        self._lock = DriverLock(config.ip, config.command_port, "node " + rospy.get_name())
        self._audit = audit_log_of(config)
        self._recorder = Recorder(self._audit)
        self._client_events = ClientEvents(self._recorder)
        self._moved = ""
        self._guard = Guard(config.ip, config.command_port, config.status_port) if config.guard else None
        self._arm = ArmClient(config.client_settings(), model, self._guard,
                              CustodyFile(config.ip, config.command_port))
        supervisor = supervisor_of(os.environ)
        if supervisor is not None:
            self._arm.add_task(supervisor)
        self._frames = FrameReader(self._arm)
        decoder = RequestDecoder(model, config.is_vendor, config.is_vendor_2025, not config.blocking)
        self._publishers = StatePublishers(self._arm, config, self._frames)
        self._ends = MotionEnds(self._arm)
        self._markers = WorkspaceMarkers(model, FrameNames(config))
        handlers = ServiceHandlers(self._arm, config, self._frames, self._ends, self._markers.publish)
        self._services = Services(decoder, handlers, CallPublisher(), self._recorder)
        self._gripper = None if config.gripper is None else GripperAction(
            self._arm, config.gripper, handlers.output, GripperJoint(
                config.gripper, config.frame_prefix + config.gripper.joint, self._publishers.joint_states.publish,
                self._publishers.stamps), self._recorder)
        self._recover = RecoverAction(self._arm, self._recorder)
        self._paths = PathAction(self._arm, decoder, self._recorder)
        self._trajectories = TrajectoryInterface(
            self._arm, config, controller, self._publishers.joint_velocity, self._recorder)
        self._query = StateQuery(self._arm, config)
        self._manager = ControllerManager(self._arm, config, self._recorder)
        self._status = RobotStatusPublisher(self._arm)
        self._speed = SpeedPublisher(self._arm)
        self._io = IoPublisher(self._arm, self._publishers.stamps)
        self._sensors = SensorPublishers(self._arm, self._publishers.stamps, FrameNames(config).flange)
        self._topics = ServoTopics(self._arm, decoder, FrameNames(config), self._recorder)
        self._jog_topics = JogSubscribers(self._arm, FrameNames(config), self._frames, self._recorder)
        self._diagnostics = Diagnostics(
            self._arm, config, self._frames, ModelCheck(self._arm, self._frames), self._audit)
        self._metrics = metrics_of(self._arm, config, self._audit, package_version())
        self._master_watch = MasterWatch(self._set_parameters, (self._sensors.offer, self._manager.offer_late))
        self._simulated = direct_publisher("~simulated", Bool, 1, latch=True)
        self._is_simulated: Optional[bool] = None
        self._end_kind: Callable[[], None] = lambda: None
        self._closing = threading.Lock()
        self._is_closed = False

    @property
    def has_failed(self) -> bool:
        """True where the thread that moves and stops the arm has ended by a defect; the node must end then."""
        return self._arm.has_failed

    def start(self) -> None:
        """Start the driver. The controller need not be reachable yet; a master that does not answer holds this up.

        Raises:
            WrongParameter: A topic would be used for two things.
        """
        self._set_description()
        if self._audit is not None:
            self._audit.start()
            self._recorder.event("start", True, **start_fields(self._config))
            self._client_events.begin()
            self._arm.add_custody_listener(self._record_custody)
        keep_serving(take_connection)
        self._publishers.start()
        self._status.start()
        self._speed.start()
        self._io.start()
        self._sensors.start()
        self._ends.start()
        self._markers.publish(self._arm.settings.workspace)
        self._services.offer()
        self._recover.offer()
        self._paths.offer()
        if self._gripper is not None:
            self._gripper.offer()
        self._trajectories.offer()
        self._query.offer()
        self._manager.offer()
        self._topics.start()
        self._jog_topics.start()
        refuse_topics_used_twice()
        may_enable = self._config.auto_enable and self._may_enable()
        with self._closing:
            if self._is_closed:
                return
            self._recorder.event("recorded", names=sorted(map(" ".join, self._recorder.names)))
            self._arm.start()
            self._frames.start()
            self._diagnostics.start()
            self._end_kind = ERRANDS.every(_KIND_PERIOD_S, self.publish_kind)
            if self._metrics is not None:
                self._metrics.start()
            self._master_watch.start()
            if may_enable:
                self._recorder.event("driver", True, level="INFO", text="auto_enable: the arm is to be powered and "
                                     "enabled once it is seen without a fault; asked for by ~auto_enable")
                self._arm.auto_enable()
        if self._config.guard_motion != STOP:
            _LOG.warning("~guard_motion is %s: a motion that would hit the arm itself or a zone is not refused",
                         self._config.guard_motion)
        if self._config.workspace:
            _LOG.info("the motion guard keeps the zones of %s", self._config.workspace)
        _LOG.info("driving a JAKA %s at %s and %d, interface %s", self._model.name, self._endpoint,
                  self._config.status_port, self._config.interface)

    def _may_enable(self) -> bool:
        """Return whether ``~auto_enable`` may power the arm at this start; log where it may not."""
        if not self._config.first_start_only or is_first_start(self._config.ip, self._config.command_port):
            return True
        self._recorder.event("driver", True, level="WARNING", text=_NOT_FIRST)
        _LOG.warning(_NOT_FIRST)
        return False

    def publish_kind(self) -> None:
        """Log, and publish on a latched topic, whether the arm is real or simulated, whenever that becomes known."""
        is_simulated = self._arm.is_simulated
        if is_simulated is None or is_simulated is self._is_simulated:
            return
        self._is_simulated = is_simulated
        self._simulated.publish(Bool(is_simulated))
        self._recorder.event("driver", level="INFO", text="the controller is that of a %s arm" % (
            "SIMULATED" if is_simulated else "REAL"))
        if is_simulated:
            _LOG.warning("SIMULATED ARM: the controller at %s is a simulated one, no real arm moves", self._endpoint)
        else:
            _LOG.info("REAL ARM: the controller at %s", self._endpoint)

    def close(self) -> None:
        """Stop what this driver moves, answer every pending call, disconnect, and release the controller's lock.

        A second caller waits until the first one has done so.
        """
        with self._closing:
            if self._is_closed:
                return
            self._is_closed = True
            self._arm.close()
            self._services.finish_calls(_ANSWER_TIMEOUT_S)
            self._recover.finish_goals(_ANSWER_TIMEOUT_S)
            self._paths.finish_goals(_ANSWER_TIMEOUT_S)
            if self._gripper is not None:
                self._gripper.finish_goals(_ANSWER_TIMEOUT_S)
            self._trajectories.finish_goals(_ANSWER_TIMEOUT_S)
            self._master_watch.close()
            self._end_kind()
            self._diagnostics.close()  # all motion ends before it are published then
            if self._metrics is not None:
                self._metrics.close()
            self._frames.close()
            if self._guard is not None:
                self._guard.close()
            self._end_audit()
            self._lock.release()

    def _record_custody(self, tell: NotifyGuard) -> None:
        """Record in the client's thread that the driver begins to move the arm, or that this has ended."""
        self._moved = tell.name or self._moved
        self._recorder.event("motion", state="begins" if tell.is_moving else "has ended", motion=self._moved)

    def _end_audit(self) -> None:
        if self._audit is None:
            return
        self._client_events.end()
        self._recorder.close_streams()
        self._recorder.event("end", True, has_failed=self._arm.has_failed)
        if not self._audit.close(_AUDIT_TIMEOUT_S):
            _LOG.warning("the audit log in %s could not be written to its end", self._audit.path)

    def _set_parameters(self) -> None:
        self._set_description()
        self._manager.set_parameters()

    def _set_description(self) -> None:
        """Set ``robot_description``, unless another node has set it."""
        if not self._config.publish_description:
            return
        urdf = urdf_from_model(self._model, self._config.frame_prefix, self._config.base_frame,
                               self._config.flange_frame,
                               collision_elements(self._model, self._arm.settings.workspace.tool))
        marker = urdf.splitlines()[1]
        present = rospy.get_param(_DESCRIPTION, "")
        if not present or marker in str(present):
            rospy.set_param(_DESCRIPTION, urdf)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node until it receives a signal or a shutdown request.

    Returns:
        An exit code (``exit_codes``).
    """
    arguments = rospy.myargv(sys.argv if argv is None else ["jaka_driver"] + argv)[1:]
    parser = argparse.ArgumentParser(
        prog="jaka_driver", description="ROS driver of one JAKA arm. Its private parameters are described in "
        "docs/parameters.md; start it with launch/robot_start_launch.launch.")
    parser.add_argument("--urdf", metavar="MODEL", help="print the URDF of this model, and do nothing else")
    parser.add_argument("--dh-file", metavar="FILE", default="", type=file_or_none,
                        help="with --urdf: a model file of your own instead; none: no file")
    parser.add_argument("--frame-prefix", metavar="TEXT", default="", help="with --urdf: in front of every name")
    options = parser.parse_args(arguments)
    if options.urdf is not None:
        return _print_urdf(options)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    ask_for_short_slices()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # a log in a file is to be complete while the driver runs
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # there is nothing to stop yet
    if "WATCHDOG_USEC" in os.environ:
        faulthandler.enable()  # the supervisor ends a hang by SIGABRT: where each thread stood is in its log then
    try:
        refuse_words_that_are_not_taken(sys.argv[1:])
        wait_for_master(_NAME)
        refuse_second_node(resolved_node_name(_NAME, sys.argv))
    except JakaError as error:
        print("%s cannot start: %s" % (_NAME, error), file=sys.stderr)
        return exit_code_of(error)
    serve_from_the_start()
    refuse_shutdown_of_others()
    log_without_a_file()
    rospy.init_node(_NAME, disable_signals=True, disable_rosout=True)  # log_to_ros has its own
    drain_log = log_to_ros()
    signals = _Signals()
    life = _Life(drain_log)
    life.start()
    while life.is_running and not signals.received:
        signals.wait(_LOOK_ROUND_S)
    is_over = life.end("signal %s" % signals.received)
    if not drain_log(_DRAIN_TIMEOUT_S) or not is_over:
        os._exit(life.exit_code)  # a terminal or a master that does not answer would keep the process from ending
    return life.exit_code


class _Life:
    """The driver's life; it begins in a thread of its own, and goes on in those that this has started.

    So the main thread, which takes the signals, never waits for the master.

    Attributes:
        exit_code: One of ``exit_codes``.
    """

    def __init__(self, drain_log: Callable[[float], bool]) -> None:
        self.exit_code = ENDED
        self._drain_log = drain_log
        self._driver: Optional[DriverNode] = None
        self._ending = threading.Event()
        self._is_alive = False
        self._thread = threading.Thread(target=self._run, name="driver start", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._is_alive = True
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """False where it is over, or where the node was asked to shut down."""
        driver = self._driver
        return (self._is_alive and not rospy.core.is_shutdown_requested() and not rospy.is_shutdown()
                and not (driver is not None and driver.has_failed))

    def end(self, reason: str) -> bool:
        """Stop the arm at once, then leave the ROS graph; return False where that is not done in time."""
        self._ending.set()
        deadline = time.monotonic() + _END_TIMEOUT_S
        ending = threading.Thread(target=self._shut_down, args=(reason,), name="shutdown", daemon=True)
        ending.start()
        ending.join(_END_TIMEOUT_S)
        while not rospy.is_shutdown() and time.monotonic() < deadline:  # another thread does it, on rosnode kill
            time.sleep(_LOOK_ROUND_S)
        if self._driver is not None and self._driver.has_failed:
            self.exit_code = DEFECT
        if not ending.is_alive() and rospy.is_shutdown():
            return True
        _LOG.error("the ROS master does not answer; ending without it")
        return False

    def _shut_down(self, reason: str) -> None:
        if self._driver is not None:
            self._driver.close()
        rospy.signal_shutdown(reason)

    def _run(self) -> None:
        try:
            values, notice = with_common_ip(rospy.get_param("~", {}), *_common_ip())
            if notice:
                _LOG.warning("%s", notice)
            config = config_from(values)
            _set_scheduler(config.realtime_priority)
            refuse_unreachable_node()
            refuse_taken_topics(config)
            controller = controller_params(config, rospy.get_param(config.trajectory_controller_name, None))
            driver = self._driver = DriverNode(config, config.arm_model(), controller)
            rospy.on_shutdown(driver.close)
            rospy.on_shutdown(lambda: self._drain_log(_DRAIN_TIMEOUT_S))
            wait_for_time(self._ending)
            if not self._ending.is_set():
                driver.start()
            return
        except (JakaError, OSError) as error:
            self.exit_code = exit_code_of(error)
            rospy.logfatal("%s cannot start: %s", rospy.get_name(), error)
        except Exception:
            self.exit_code = DEFECT
            _LOG.exception("a defect of the node")
        self._is_alive = False


class _Signals:
    """The SIGINT and SIGTERM that come from now on.

    The handler only records them: one that ended the driver itself, as rospy's does, could wait for a lock that the
    interrupted code holds.
    """

    def __init__(self) -> None:
        self.received: List[int] = []
        self._woken, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda received, _: self.received.append(received))

    def wait(self, timeout: float) -> None:
        """Wait until a signal has come, or for ``timeout``, s."""
        if select.select([self._woken], [], [], timeout)[0]:
            os.read(self._woken, 64)


def _common_ip() -> Tuple[str, Any]:
    """Return name and value of the nearest parameter ``ip`` in the node's namespace or above it; "" for none."""
    space = rospy.get_name().rpartition("/")[0] + "/"
    while True:
        value = rospy.get_param(space + "ip", None)
        if value is not None:
            return space + "ip", value
        if space == "/":
            return "", None
        space = space.rstrip("/").rpartition("/")[0] + "/"


def _print_urdf(options: argparse.Namespace) -> int:
    try:
        config = config_from({"model": options.urdf, "dh_file": options.dh_file, "frame_prefix": options.frame_prefix})
        model = config.arm_model()
        print(urdf_from_model(model, config.frame_prefix, config.base_frame, config.flange_frame,
                              collision_elements(model)), end="")
        return 0
    except JakaError as error:
        print("jaka_driver: error: %s" % error, file=sys.stderr)
        return CONFIGURATION


def _set_scheduler(priority: int) -> None:
    """Take real-time priority where it is wanted and permitted."""
    if not priority:
        return
    try:
        set_real_time(priority)
    except OSError as error:
        _LOG.warning("~realtime_priority %d: not permitted (limit rtprio: %s); going on without", priority,
                     error.strerror)
