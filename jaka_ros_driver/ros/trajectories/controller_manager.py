"""The services of ros_control's controller_manager, for a driver that has one controller which always runs.

Clients look for them beside a trajectory controller: rqt_joint_trajectory_controller lists the running ones there, and
MoveIt's moveit_ros_control_interface finds the action by them. Nothing here moves, stops or energises the arm.
"""
import logging
import time
from typing import Any, Callable, List, NamedTuple, Optional, Sequence

import rospy

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.other_messages import OLD_SWITCH_MD5, message_type, old_switch_type, service_type
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer
from jaka_ros_driver.ros.start_checks import server_of

_LOG = logging.getLogger(__name__)

CONTROLLER_TYPE = "position_controllers/JointTrajectoryController"
"""A class for which moveit_ros_control_interface has a handle; rqt looks for "JointTrajectoryController" in it."""
_INTERFACE = "hardware_interface::PositionJointInterface"
_BASE_CLASS = "controller_interface::ControllerBase"
_STRICT = 2
_AUTO_DELAY_S = 10.0
"""Delay, s, in which a real controller_manager of the cell can be there first (~controller_manager auto)."""


class OneController:
    """The answers of a manager of one running controller. Each refusal is a text; "" means done."""

    def __init__(self, name: str, is_following: Callable[[], bool]) -> None:
        """Set up the answers.

        Args:
            name: The controller's, without its namespace.
            is_following: Returns whether a trajectory runs.
        """
        self.name = name
        self._is_following = is_following

    def switch(self, start: Sequence[str], stop: Sequence[str], strictness: int) -> str:
        """Start and stop controllers: the only one runs, and goes on.

        In both lists it is restarted, which does nothing to an arm that follows no trajectory. As in ros_control, a
        name that is not known matters where the strictness is STRICT.
        """
        unknown = [name for name in (*start, *stop) if name != self.name]
        if unknown and strictness == _STRICT:
            return "no controller is named %.60r; there is only %s" % (unknown[0], self.name)
        if self.name not in stop:
            return ""
        if self.name not in start:
            return "%s cannot be stopped: it is part of the driver; ~stop_move stops the arm" % self.name
        return "%s cannot be restarted: it follows a trajectory" % self.name if self._is_following() else ""

    def load(self, name: str) -> str:
        """Load a controller: there is no other one to be loaded."""
        if name == self.name:
            return "%s is loaded already" % name
        return "%.60r cannot be loaded: this driver has one controller, %s" % (name, self.name)

    def unload(self, name: str) -> str:
        """Unload a controller: the only one runs."""
        if name == self.name:
            return "%s cannot be unloaded: it is running" % name
        return "no controller is named %.60r; there is only %s" % (name, self.name)

    def reload(self) -> str:
        """Load the libraries of controllers anew: there are none."""
        return "no libraries to be loaded anew: %s is part of the driver" % self.name


class _Spec(NamedTuple):
    """One of the services: it fills its response, or answers only whether the request is refused.

    Attributes:
        fill: Fills the response.
        refusal: Returns why a request is refused, "" where it is not.
    """

    name: str
    type_name: str
    fill: Optional[Callable[[Any], None]] = None
    refusal: Callable[[Any], str] = lambda request: ""


class ControllerManager:
    """The services, in the namespace of the trajectory controller, and the parameters that describe it."""

    def __init__(self, arm: ArmClient, config: DriverConfig, recorder: Recorder) -> None:
        """Set up the services; ``offer`` begins."""
        self._controller: str = rospy.resolve_name(config.trajectory_controller_name)
        namespace, name = self._controller.rsplit("/", 1)
        self._manager = namespace + "/controller_manager"
        self._mode = config.controller_manager
        self._recorder = recorder
        self._joints = [config.frame_prefix + joint for joint in JOINTS]
        one = self._one = OneController(name, lambda: arm.trajectory is not None)
        self._specs = (
            _Spec("list_controllers", "ListControllers", self._list),
            _Spec("list_controller_types", "ListControllerTypes", _types),
            _Spec("load_controller", "LoadController", refusal=lambda request: one.load(request.name)),
            _Spec("unload_controller", "UnloadController", refusal=lambda request: one.unload(request.name)),
            _Spec("switch_controller", "SwitchController", refusal=lambda request: one.switch(
                request.start_controllers, request.stop_controllers, request.strictness)),
            _Spec("reload_controller_libraries", "ReloadControllerLibraries", refusal=lambda request: one.reload()))
        self._services: List[ServiceServer] = []
        self._offer_at: Optional[float] = None

    def offer(self) -> None:
        """Offer the services, where they are wanted and nobody else serves one of the names, and set the parameters.

        Where nobody has asked for them they come later (``offer_late``): a real manager that starts at the same time
        must be first.
        """
        if self._mode == "true":
            self._offer()
        elif self._mode == "auto":
            self._offer_at = time.monotonic() + _AUTO_DELAY_S

    def offer_late(self) -> None:
        """Offer the services where ``offer`` has put it off and the time has come; this waits for the master."""
        if self._offer_at is not None and time.monotonic() >= self._offer_at:
            self._offer_at = None
            self._offer()

    def _offer(self) -> None:
        names = ["%s/%s" % (self._manager, spec.name) for spec in self._specs]
        for name in names:
            server = server_of(name)
            if server:
                _LOG.log(logging.WARNING if self._mode == "true" else logging.INFO, "%s is served by %s already: this "
                         "driver offers no controller_manager, and software that looks for %s there does not find it",
                         name, server, self._one.name)
                return
        for name, spec in zip(names, self._specs):
            if spec.fill is None:
                self._recorder.offers_service(name)
            self._services.append(self._server(name, spec))
        self.set_parameters()

    def set_parameters(self) -> None:
        """Set the controller's parameters ``type`` and ``joints``, unless they are there; log where they differ.

        A real controller_manager reads them, too, so that they are set only where this one is offered.
        """
        if not self._services:
            return
        for key, value in (("type", CONTROLLER_TYPE), ("joints", self._joints)):
            name = "%s/%s" % (self._controller, key)
            present = rospy.get_param(name, None)
            if present is None:
                rospy.set_param(name, value)
            elif present != value:
                _LOG.warning("the parameter %s is %.200r, and left so; of this driver it is %r", name, present, value)

    # ---- inside ----

    def _server(self, name: str, spec: _Spec) -> ServiceServer:
        kind = service_type("controller_manager_msgs/" + spec.type_name)
        other = {OLD_SWITCH_MD5: old_switch_type()} if spec.type_name == "SwitchController" else None
        return ServiceServer(name, kind, lambda request: self._answer(name, spec, request, kind._response_class()),
                             CallCount(), other)

    def _answer(self, name: str, spec: _Spec, request: Any, response: Any) -> Any:
        if spec.fill is not None:
            spec.fill(response)
            return response
        entry = self._recorder.call(name, request)
        refusal = spec.refusal(request)
        if refusal:
            _LOG.warning("%s: refused: %s", name, refusal)
        response.ok = not refusal
        entry.answered(response.ok, refusal or "nothing was to be done")
        return response

    def _list(self, response: Any) -> None:
        state = message_type("controller_manager_msgs/ControllerState")()
        state.name, state.state, state.type = self._one.name, "running", CONTROLLER_TYPE
        claimed = message_type("controller_manager_msgs/HardwareInterfaceResources")()
        claimed.hardware_interface, claimed.resources = _INTERFACE, self._joints
        state.claimed_resources = [claimed]
        response.controller = [state]


def _types(response: Any) -> None:
    response.types, response.base_classes = [CONTROLLER_TYPE], [_BASE_CLASS]
