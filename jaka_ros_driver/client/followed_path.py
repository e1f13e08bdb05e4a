"""The path that the arm follows for a trajectory: where it joins, built by the client's settings, told in the log."""
import logging

from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.trajectory import TrajectoryStart
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.path import Path
from jaka_ros_driver.trajectory.points import InvalidTrajectory, JointTrajectory

_LOG = logging.getLogger(__name__)
_JOIN_LEAD_S = 0.016
"""Shortest lead, s, of a join: two servo cycles.

The path must be built and begun before the arm is there. Where it is not, the lead is doubled (``ArmClient.follow``);
a longer one replaces the running trajectory later.
"""
_BUILD_TIME_S = 5e-6
"""Time, s, that each point adds to the lead, for building and audit; too short a time costs another try."""
LONGEST_LEAD_S = 1.0
"""Lead, s, above which none is doubled any more: the last try joins up to 2 s ahead, then the goal is refused."""
_LOGGED_LATE_S = 0.001
"""Shortest delay, s, that is logged: an eighth of a servo cycle."""


def lead_of(trajectory: JointTrajectory) -> float:
    """Return how far ahead on a running path it is joined, s: two cycles, and the time that the building takes."""
    return _JOIN_LEAD_S + _BUILD_TIME_S * len(trajectory.points)


def followed_path(start: TrajectoryStart, trajectory: JointTrajectory, elapsed: float, model: ArmModel,
                  core: ArmCore, stops: int) -> Path:
    """Return the audited path of a trajectory; log where it is slowed or led elsewhere, or begins late.

    Args:
        start: The place where it begins.
        trajectory: The points.
        elapsed: Time since the trajectory was to start, s.
        model: The arm's limits.
        core: Has the tolerances, and looks at the whole path.
        stops: The number of stops when the trajectory was asked for.

    Raises:
        InvalidTrajectory: As ``build_path``, or the way is not clear.
        MotionInterrupted: A stop came meanwhile.
    """
    settings, motion_check = core.settings, core.custody.motion_check
    path = build_path(start.begin, trajectory, elapsed, model, BuildOptions(
        settings.trajectory_start_tolerance, settings.late_stamp, settings.trajectory_overshoot == "scale"))
    trouble = motion_check.trajectory_trouble(path, lambda: core.require_no_stop_since(stops))
    if trouble and motion_check.refuses:
        raise InvalidTrajectory(trouble)
    if trouble:
        _LOG.warning("followed, as ~guard_motion is %s: %s", settings.guard_motion, trouble)
    if path.rates is not None:
        _LOG.info("the trajectory is slowed, and takes %.3f s longer than its %.3f s: %s", path.rates.delay(),
                  trajectory.points[-1].time, path.rates.text)
    if path.led:
        _LOG.warning("the trajectory does not reach all its points: %s", path.led)
    if start.begin.is_at_rest and path.begin < elapsed - _LOGGED_LATE_S:
        _LOG.info("the trajectory begins %.3f s late: its stamp was %.3f s ago when it was taken", elapsed - path.begin,
                  elapsed)
    return path
