"""The parameters of a ros_control cell, as its yaml file has them in the controller's namespace.

Names and meanings are those of ros_controllers' ``joint_trajectory_controller`` (its ``tolerances.h`` and ``init``).
What a cell has set there wins over the driver's own parameters.
"""
import logging
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

from jaka_ros_driver.commands import JOINTS
from jaka_ros_driver.ros.params import DriverConfig, WrongParameter

_LOG = logging.getLogger(__name__)

STATE_RATE_HZ = 50.0
"""Default of ``state_publish_rate``, Hz: that of ros_controllers' JointTrajectoryController."""
_RATES_HZ = (1.0, 125.0)
"""Lowest and highest ``state_publish_rate``, Hz: the feed has no more than 125."""
_NOT_USED = {
    "action_monitor_rate": "feedback has 20 Hz",
    "constraints/stopped_velocity_tolerance": "a trajectory ends at rest, whatever is asked for",
    "gains": "the controller has its own",
    "hold_trajectory_duration": "a cancelled trajectory is braked as fast as the joints can",
    "stop_trajectory_duration": "a cancelled trajectory is braked as fast as the joints can",
    "velocity_ff": "the controller has its own",
}
"""Parameters that are read by a JointTrajectoryController and mean nothing here, each with the reason."""
_OURS = ("type", "joints", "state_publish_rate", "allow_partial_joints_goal", "constraints")

JointTolerances = Tuple[Optional[float], ...]


class ControllerParams(NamedTuple):
    """The values that hold for goals that name nothing else.

    Attributes:
        path: Tolerance on the way of each joint, rad (6,); None: not watched.
        goal: Tolerance at the end, rad (6,); None: not watched.
        goal_time: Longest time after the end at which the arm must rest there, s.
        state_period: Of the topic ``state``, s.
        allows_partial: Goals may name some of the joints; the others are held.
    """

    path: JointTolerances
    goal: JointTolerances
    goal_time: float
    state_period: float = 1.0 / STATE_RATE_HZ
    allows_partial: bool = False


def controller_params(config: DriverConfig, values: Any) -> ControllerParams:
    """Return the parameters of the controller.

    Args:
        config: The driver's own parameters, which hold where the cell has set none.
        values: The content of the controller's namespace on the parameter server; None where there is none.

    Raises:
        WrongParameter: A value makes no sense; the message has all of them with what is valid.
    """
    wrong: List[str] = []
    name = config.trajectory_controller_name
    given = _flat(values) if isinstance(values, Mapping) else {}

    def number(key: str, default: Optional[float], low: float, high: float, unit: str) -> Optional[float]:
        value = given.pop(key, None)
        if value is None:
            return default
        if type(value) not in (int, float) or not low <= value <= high:
            wrong.append("parameter %s/%s is %.60r; valid: a number, %g to %g %s" % (name, key, value, low, high, unit))
            return default
        return float(value)

    path: List[Optional[float]] = [config.trajectory_path_tolerance or None] * len(JOINTS)
    goal: List[Optional[float]] = [config.trajectory_goal_tolerance or None] * len(JOINTS)
    for index, joint in enumerate(JOINTS):
        for spelled in dict.fromkeys((joint, config.frame_prefix + joint)):
            for kind, tolerances in (("trajectory", path), ("goal", goal)):
                tolerances[index] = number("constraints/%s/%s" % (spelled, kind), tolerances[index], 0.0, 10.0,
                                           "rad") or None
    goal_time = number("constraints/goal_time", config.trajectory_goal_time, 0.0, 60.0, "s")
    rate = number("state_publish_rate", STATE_RATE_HZ, *_RATES_HZ, "Hz")
    allows_partial = given.pop("allow_partial_joints_goal", False)
    if type(allows_partial) is not bool:
        wrong.append("parameter %s/allow_partial_joints_goal is %.60r; valid: true or false" % (name, allows_partial))
    joints = given.pop("joints", None)
    known = [config.frame_prefix + joint for joint in JOINTS]
    if joints is not None and joints not in (known, list(JOINTS)):
        _LOG.warning("%s/joints is %.200r; the arm's joints are %s", name, joints, ", ".join(known))
    for key in sorted(given):
        reason = next((text for other, text in _NOT_USED.items() if key == other or key.startswith(other + "/")), None)
        if reason is not None:
            _LOG.info("parameter %s/%s is not used: %s", name, key, reason)
        elif key not in _OURS:
            _LOG.warning("parameter %s/%s is not known, and not used", name, key)
    if wrong:
        raise WrongParameter("; ".join(wrong))
    assert goal_time is not None and rate is not None
    return ControllerParams(tuple(path), tuple(goal), goal_time, 1.0 / rate, allows_partial)


def _flat(values: Mapping[str, Any], prefix: str = "") -> Dict[str, Any]:
    """Return the values of nested dictionaries, each by its path."""
    found: Dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            found.update(_flat(value, "%s%s/" % (prefix, key)))
        else:
            found["%s%s" % (prefix, key)] = value
    return found
