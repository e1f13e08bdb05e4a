"""Procedures that pause and resume this driver's motion, and set the speed of all that controller and driver run."""
from typing import Callable, Union

from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.core.motion import ArmMotion
from jaka_ros_driver.client.core.move import Move
from jaka_ros_driver.client.core.planned.path_move import PathMove
from jaka_ros_driver.client.core.procedures.steps import Ask, Procedure, Until
from jaka_ros_driver.client.core.trajectory import Trajectory
from jaka_ros_driver.commands import PauseMotion, ResumeMotion, SetRapidRate
from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, StopCause

_TIMEOUT_S = 2.0
_SAME_RATE = 0.005
_NEVER = float("inf")


def pause(core: ArmCore) -> Procedure:
    """Hold the running trajectory, path or planned moves, at rest on their path; return when the arm rests.

    Raises:
        InvalidCommand: Nothing runs that can be paused, or it has ended meanwhile.
        MotionInterrupted: The arm did not come to rest within 2 s; it is still in custody, and a stop ends it.
        JakaError: As ``Ask``.
    """
    motion = _pausable(core)
    if isinstance(motion, Trajectory):
        motion.is_paused = True
    else:
        yield Ask(PauseMotion())

    def is_held() -> bool:
        _require_still_under_way(core, motion, "paused")
        return motion.is_held if isinstance(motion, Trajectory) else core.state is not None and bool(
            core.state.is_paused)
    if not (yield Until(rests_while(core, is_held, motion.rest_time), _TIMEOUT_S + motion.rest_time)):
        raise MotionInterrupted(StopCause.TIMEOUT, "the arm was not seen paused within %.0f s; %s goes on" % (
            _TIMEOUT_S, motion.owner.value))
    motion.is_paused = True
    return "%s is paused; resume goes on, stop_move ends it" % motion.owner.value


def resume(core: ArmCore) -> Procedure:
    """Resume the motion that ``pause`` has paused.

    Raises:
        InvalidCommand: Nothing is paused, it has ended meanwhile, or the resumption would run a program as well.
        JakaError: As ``Ask``.
    """
    motion = _pausable(core)
    is_held = motion.is_paused or (core.state is not None and bool(core.state.is_paused))
    if not is_held:
        raise InvalidCommand("refused: %s is not paused" % motion.owner.value)
    if motion.is_beside_program and not isinstance(motion, Trajectory):
        raise InvalidCommand("refused: a program was paused at the controller before %s began, and a resumption would "
                             "run that; stop_move ends %s" % (motion.owner.value, motion.owner.value))
    if not isinstance(motion, Trajectory):
        yield Ask(ResumeMotion())
        _require_still_under_way(core, motion, "resumed")
    motion.is_paused = False
    return "%s goes on" % motion.owner.value


def set_speed(core: ArmCore, fraction: float) -> Procedure:
    """Set the controller's speed override, 0 to 1; trajectories of this driver follow it.

    Raises:
        MotionInterrupted: The controller accepted it, and its status feed does not show it within 2 s.
        JakaError: As ``Ask``.
    """
    yield Ask(core.audited(SetRapidRate(fraction)))
    if core.state is None or core.state.rapid_rate is None:
        return "speed %.3g %% set (not verified: this controller does not report it)" % (100.0 * fraction)
    if not (yield from core.seen(lambda s: s.rapid_rate is not None and abs(s.rapid_rate - fraction) <= _SAME_RATE,
                                 _TIMEOUT_S)):
        raise MotionInterrupted(StopCause.TIMEOUT, "the controller accepted a speed of %.3g %%, and still reports "
                                "%.3g %%" % (100.0 * fraction, 100.0 * (core.state.rapid_rate or 0.0)))
    return "speed %.3g %%" % (100.0 * fraction)


def rests_while(core: ArmCore, holds: Callable[[], bool], rest_time: float) -> Callable[[float], bool]:
    """Return a condition of ``Until``: ``holds``, and the arm has been seen at rest for ``rest_time``, s, since it
    does.

    Earlier rest proves nothing: the arm may just have begun to move.
    """
    since = _NEVER

    def rests(now: float) -> bool:
        nonlocal since
        since = min(since, now) if holds() else _NEVER
        return core.custody.rest_since(since) >= rest_time
    return rests


def _pausable(core: ArmCore) -> Union[Move, PathMove, Trajectory]:
    motion = core.custody.motion
    if not isinstance(motion, (Move, PathMove, Trajectory)):
        raise InvalidCommand("refused: %s; only moves, paths and trajectories of this driver can be paused and "
                             "resumed" % ("this driver moves nothing" if motion is None
                                          else "%s owns the arm's motion" % motion.owner.value))
    _require_still_under_way(core, motion, "paused or resumed")
    return motion


def _require_still_under_way(core: ArmCore, motion: ArmMotion, what: str) -> None:
    if core.custody.motion is not motion or core.custody.is_ending or motion.is_leaving:
        raise InvalidCommand("refused: %s has ended, it cannot be %s" % (motion.owner.value, what))
