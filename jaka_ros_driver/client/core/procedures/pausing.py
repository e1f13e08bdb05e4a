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
"""Longest time, s, until the arm is seen at rest, or the speed as it was set, beside the rest's own time."""
_SAME_RATE = 0.005
"""Largest difference from a speed that counts as the same: of a controller that rounds to whole percents, too."""
_NEVER = float("inf")


def pause(core: ArmCore) -> Procedure:
    """Hold the running trajectory, path or planned moves, at rest on their path; return when the arm rests.

    Raises:
        InvalidCommand: Nothing runs that can be paused, or it has ended meanwhile.
        MotionInterrupted: The arm was not seen to come to rest within 2 s; it is still in custody, and a stop ends it.
            A trajectory stays held until it is resumed, a path or move may go on.
        JakaError: As ``Ask``.
    """
    motion = _pausable(core)
    if isinstance(motion, Trajectory):
        yield from _pause_trajectory(core, motion)
    else:
        yield Ask(PauseMotion())
        if not (yield from _seen_held(core, motion, lambda: core.state is not None and bool(core.state.is_paused))):
            raise MotionInterrupted(StopCause.TIMEOUT, "the arm was not seen paused within %.0f s; %s goes on" % (
                _TIMEOUT_S, motion.name))
        motion.is_paused = True
    return "%s is paused; resume goes on, stop_move ends it" % motion.name


def _pause_trajectory(core: ArmCore, motion: Trajectory) -> Procedure:
    """Hold the stream of a trajectory, which stays held whether or not the arm is seen at rest."""
    was_paused, motion.is_paused = motion.is_paused, True
    try:
        is_seen = yield from _seen_held(core, motion, lambda: motion.is_held)
    except InvalidCommand:  # cancelled; another one may take over, and must not be held by a pause that was refused
        if not was_paused:
            motion.is_paused = False
        raise
    if not is_seen:
        raise MotionInterrupted(StopCause.TIMEOUT, "the arm was not seen at rest within %.0f s; %s" % (
            _TIMEOUT_S, "%s is held, resume goes on with it, stop_move ends it" % motion.name if motion.is_paused
            else "%s was resumed meanwhile" % motion.name))


def _seen_held(core: ArmCore, motion: ArmMotion, is_held: Callable[[], bool]) -> Procedure:
    """Return whether the arm is seen at rest in time, where the motion is held."""
    def is_held_under_way() -> bool:
        _require_still_under_way(core, motion, "paused")
        return is_held()
    return (yield Until(rests_while(core, is_held_under_way, motion.rest_time), _TIMEOUT_S + motion.rest_time))


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
