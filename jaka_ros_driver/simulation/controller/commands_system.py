"""Commands about power, states, errors and positions (docs/controller-protocol.md sections 5.1, 5.10, 5.12, 5.13)."""
import math
from typing import Optional, Tuple

from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import (
    LINK_LOSS_COMMAND,
    SIMULATED_ONLY,
    CommandSpec,
    Handler,
    Held,
    Then,
    plain,
    slow_reply,
)
from jaka_ros_driver.simulation.controller.replies import CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState, LinkLoss
from jaka_ros_driver.simulation.controller.wire_units import joints_to_wire, pose_from_wire, pose_to_wire, rounded
from jaka_ros_driver.units import all_deg_to_rad, deg_to_rad, m_to_mm, ms_to_s, rad_to_deg

_ROBOT_ID = "0"
"""The robot id in a reply, a guess: the key is known, a real controller's value is not."""


def _robot_state(state: ControllerState) -> Reply:
    if state.dialect.robot_state == "texts":
        return {"enable": "robot_enabled" if state.is_enabled else "robot_disabled",
                "power": "powered_on" if state.is_powered else "powered_off"}
    code, text = state.alarms.shown()
    return {"enable": state.is_enabled, "power": int(state.is_powered), "errcode": code, "msg": text}


def _power_on(state: ControllerState, _arguments: Arguments) -> Optional[Held]:
    """Begin to power; a held reply reports that the drives have power (docs/controller-protocol.md section 5.1)."""
    state.power_on()
    return slow_reply(state, state.dialect.power_reply, state.dialect.power_reply_delay,
                      lambda: not state.is_powering, lambda: not state.is_powered)


def _enable(state: ControllerState, _arguments: Arguments) -> Optional[Held]:
    """Begin to enable; a held reply reports that the brakes are open. Without power nothing happens, code 0."""
    if not state.enable():
        return None
    return slow_reply(state, state.dialect.enable_reply, state.dialect.enable_reply_delay,
                      lambda: not state.is_enabling, lambda: not state.is_enabled)


def _shutdown(state: ControllerState, _arguments: Arguments) -> None:
    if state.is_powered or state.is_enabled:
        raise CommandRefused()


def _set_installation_angle(state: ControllerState, arguments: Arguments) -> None:
    about_x, about_z = arguments.number("angleX"), arguments.number("angleZ")
    if not 0.0 <= about_x <= 180.0 or not 0.0 <= about_z < 360.0:
        raise CommandRefused()
    state.memory.installation_angles = (about_x, about_z)


def _installation_angle(state: ControllerState) -> Reply:
    """Return quaternion (scalar first) and rpy, deg, of the mounting.

    It turns about x, then about z (docs/sdk-client.md section 6).
    """
    about_x, about_z = state.memory.installation_angles
    cx, sx = math.cos(deg_to_rad(about_x) / 2.0), math.sin(deg_to_rad(about_x) / 2.0)
    cz, sz = math.cos(deg_to_rad(about_z) / 2.0), math.sin(deg_to_rad(about_z) / 2.0)
    quaternion = rounded((cz * cx, cz * sx, sz * sx, sz * cx))
    return {"installation_angle": [quaternion, [about_x, 0.0, about_z]]}


def _set_network_exception_handle(state: ControllerState, arguments: Arguments) -> None:
    delay, reaction = arguments.number("timeLimit"), arguments.integer("motType")
    if delay < 0.0 or reaction not in tuple(LinkLoss):
        raise CommandRefused()
    state.link_loss, state.link_loss_delay = LinkLoss(reaction), ms_to_s(delay)


def _kine_forward(state: ControllerState, arguments: Arguments) -> Reply:
    pose = state.plant.forward(all_deg_to_rad(arguments.vector("jointPosition", 6)))
    return {"cartPosition": pose_to_wire(pose)}


def _kine_inverse(state: ControllerState, arguments: Arguments) -> Reply:
    pose = pose_from_wire(arguments.vector("cartPosition", 6))
    reference = all_deg_to_rad(arguments.vector("jointPosition", 6))
    try:
        joints = state.plant.inverse_nearest(pose, reference)
    except TargetRejected as error:
        raise CommandRefused("-4", "inverse kinematics failed") from error
    return {"jointPosition": joints_to_wire(joints)}


def _dh_param(state: ControllerState) -> Reply:
    """Return the modified DH table, deg and mm.

    Its alpha and a are those of the link before (docs/sdk-client.md section 6).
    """
    rows = state.model.dh
    alphas = [0.0] + [rad_to_deg(row.alpha) for row in rows[:-1]]
    lengths = [0.0] + [m_to_mm(row.a) for row in rows[:-1]]
    return {"dh_param": [rounded(values) for values in (
        alphas, lengths, [m_to_mm(row.d) for row in rows], [rad_to_deg(row.theta_offset) for row in rows])]}


def _joints(key: str) -> Handler:
    return plain(lambda state: {key: joints_to_wire(state.plant.joint_position)})


def _tool(key: str) -> Handler:
    return plain(lambda state: {key: pose_to_wire(state.plant.tcp_pose())})


SYSTEM_COMMANDS: Tuple[CommandSpec, ...] = (
    CommandSpec("power_on", "5.1", _power_on),
    CommandSpec("power_off", "5.1", plain(ControllerState.power_off)),
    CommandSpec("enable_robot", "5.1", _enable),
    CommandSpec("disable_robot", "5.1", plain(ControllerState.disable)),
    CommandSpec("shutdown", "5.1", _shutdown, then=Then.SHUT_DOWN),
    CommandSpec("quit", "5.1", plain(lambda state: None), then=Then.CLOSE),
    CommandSpec("get_robot_state", "5.1", plain(_robot_state)),
    CommandSpec("get_version", "5.1", plain(lambda state: {
        "version": state.firmware.version, "robot_name": state.model.name, "robot_id": _ROBOT_ID})),
    CommandSpec("set_installation_angle", "5.1", _set_installation_angle),
    CommandSpec("get_installation_angle", "sdk-client.md 6", plain(_installation_angle)),
    CommandSpec(LINK_LOSS_COMMAND, "sdk-client.md 2", _set_network_exception_handle),
    CommandSpec("get_simulator_identity", SIMULATED_ONLY, plain(
        lambda state: {"identity": state.options.identity})),
    CommandSpec("clear_error", "5.10", plain(ControllerState.clear_error)),
    CommandSpec("protective_stop_status", "5.10", plain(
        lambda state: {"protective_stop": int(state.protective_stop)})),
    CommandSpec("emergency_stop_status", "5.10", plain(
        lambda state: {"emergency_stop": int(state.emergency_stop)})),
    CommandSpec("kine_forward", "5.12", _kine_forward),
    CommandSpec("kine_inverse", "5.12", _kine_inverse),
    CommandSpec("get_dh_param", "sdk-client.md 6", plain(_dh_param)),
    CommandSpec("get_joint_pos", "5.13", _joints("joint_pos")),
    CommandSpec("get_tcp_pos", "5.13", _tool("tcp_pos")),
    CommandSpec("get_actual_joint_pos", "5.13", _joints("position")),
    CommandSpec("get_actual_tcp_pos", "5.13", _tool("position")),
)
