"""The check of every motion, as ``~guard_motion`` asks for it: refused, only logged, or not looked at.

It is no safety function: it knows slim capsules and the zones of a file, and nothing of people.
"""
import logging
import math
from typing import Callable, List, NamedTuple, Optional, Sequence, Union

import numpy as np

from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, Looks, MotionGuard, to_the_end
from jaka_ros_driver.clearance.workspace import Workspace
from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.motion_guard.clear_space import ClearSpace
from jaka_ros_driver.client.core.motion_guard.frame_guard import FrameGuard, Look
from jaka_ros_driver.client.core.motion_guard.joint_corner import JointWay, Way, joint_corners
from jaka_ros_driver.client.core.motion_guard.line_walk import LineWalk, corner_walks, walk
from jaka_ros_driver.client.core.motion_guard.pose_guard import PoseGuard
from jaka_ros_driver.client.core.motion_guard.tool_frames import ToolFrames, tool_frames
from jaka_ros_driver.client.core.stillness import MOVEMENT
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import ArcMove, Jog, JogFrame, JointMove, LinearMove, PathCommand
from jaka_ros_driver.errors import InvalidCommand, UnreachablePose
from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.inverse import inverse
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING
from jaka_ros_driver.kinematics.rotations import (
    IDENTITY,
    Transform,
    compose,
    matrix_from_rotation_vector,
    transform,
)
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.path import Array, Path, highest_fourths, sampled
from jaka_ros_driver.trajectory.rates import LARGEST_OVERSHOOT
from jaka_ros_driver.units import m_to_mm

STOP, WARN, OFF = "stop", "warn", "off"
"""The values of ``~guard_motion``: refuse and brake, only log, do not look."""
_SAMPLE_PERIOD_S = 0.04
"""Longest time, s, between two places of a trajectory that are joined by a straight line in joint space."""
_BESIDE = 0.0025
"""Most, m, by which a distance may be less on the trajectory than on these lines: where the joints accelerate, the
places are so near in time that it is not more, for the longest lever of each joint.
"""
_HIGHEST_ACCELERATION = LARGEST_OVERSHOOT * JOINT_ACCELERATION_CEILING
"""Highest acceleration, rad/s2, that the audit lets pass: a path that asks for more than a joint has is run slower."""
_SAME_TIP = 0.005
"""Distance, m, up to which a tool's point counts as that of before: calibrated arms are some mm beside their model."""
_FAR_TIP = 0.05
"""Distance, m, of a tool's point from all known parts above which they are taken for another tool's: the origin of a
frame may lie between a gripper's fingers, or at the end of a work piece.
"""
_STEP_S = 0.01
"""Time, s, over which the joints' speeds at the begin of a jog of the tool are measured."""
_SAMPLES_AT_ONCE = 4096
"""Places of a trajectory that are held at once: a day of it has two millions."""


class StartPlace(NamedTuple):
    """The place where a motion begins.

    Attributes:
        joints: rad (6,); None where they are not known: behind a line whose frames are not.
        frames: The active tool and user frame; None where they are not known.
        way: The way that ends there, whose corner may be rounded; None where there is none.
    """

    joints: Optional[Vector]
    frames: Optional[ToolFrames]
    way: Optional[Way] = None

    def is_near(self, other: "StartPlace") -> bool:
        """Return whether a motion that was looked at from the other place may begin at this one."""
        if self is other:
            return True
        return (self.way is other.way and self.joints is not None and other.joints is not None
                and max([abs(a - b) for a, b in zip(self.joints, other.joints)]) <= MOVEMENT)

    @classmethod
    def unknown(cls) -> "StartPlace":
        """Return a place of which nothing is known."""
        return cls(None, None)


class MotionCheck:
    """The check of motions before they are sent, which makes the watches over those that run.

    Attributes:
        tools: ``flange_t_tool`` by tool id, from the controller's table; None while it is not known.
    """

    def __init__(self, model: ArmModel, settings: ClientSettings, actions: Actions) -> None:
        self._model, self._actions, self._mode = model, actions, settings.guard_motion
        self._guard = MotionGuard(model, settings.workspace)
        self._has_told_frames = False
        self._known_tip: Vector = (0.0, 0.0, 0.0)
        self.tools: Optional[Sequence[Transform]] = None

    @property
    def workspace(self) -> Workspace:
        """The zones and the tool that are kept now; another one is another object."""
        return self._guard.workspace

    def keep(self, guard: MotionGuard) -> None:
        """Keep what this guard keeps, from the next motion on; call it while nothing moves the arm."""
        self._guard = guard

    @property
    def is_on(self) -> bool:
        """True where motions are looked at."""
        return self._mode != OFF

    @property
    def refuses(self) -> bool:
        """True where a motion in trouble is refused or braked; False where that is logged at most."""
        return self._mode == STOP

    def look(self) -> Look:
        """Return the look at one motion while it lasts. Where trouble is only to be logged, it is logged once."""
        space, act = ClearSpace(self._guard, DEFAULT_MARGIN), self._actor()
        return lambda way: "" if space.holds(way) else act(lambda: space.trouble(way))

    def place_of(self, state: RobotState) -> StartPlace:
        """Return the place of an arm at rest."""
        frames = tool_frames(self._model, state, self.tools)
        if frames is not None and self.is_on:
            self._tell_unseen_tool(frames.flange_t_tool[9:])
        return StartPlace(state.joint_position, frames)

    def after_move(self, command: PathCommand, start: StartPlace) -> Looks[StartPlace]:
        """Check one move from its start; return the place where it ends.

        Raises:
            InvalidCommand: It would come too near to something, or cannot be followed, or the look itself has failed
                (nothing is sent unchecked in silence); the message has place and reason.
        """
        ends = [StartPlace(command.joint_position if isinstance(command, JointMove) else None, start.frames)]
        trouble = (yield from _found(self._move_trouble(command, start, ends))) if self.is_on else ""
        if trouble and self.refuses:
            raise InvalidCommand("refused: " + trouble)
        if trouble:
            self._log_sent(trouble)
        return ends[-1]

    def jog_speeds(self, command: Jog, state: RobotState) -> Optional[Vector]:
        """Return the joints' speeds, rad/s (6,), with which a jog begins; None where they are not known.

        They are not where the frames are not known, or the tool cannot go on in this direction.
        """
        one = [command.velocity if axis == command.axis else 0.0 for axis in range(JOINT_COUNT)]
        if command.frame is JogFrame.JOINT:
            return tuple(one)
        place = self.place_of(state)
        if place.frames is None:
            self._tell_unknown_frames()
            return None
        step = transform(matrix_from_rotation_vector([_STEP_S * part for part in one[3:]]),
                         tuple([_STEP_S * part for part in one[:3]]))
        tool = place.frames.tool_at(self._model, state.joint_position)
        if command.frame is JogFrame.TOOL:
            moved = compose(tool, step)
        else:
            moved = transform(compose(step, tool)[:9], tuple([a + b for a, b in zip(tool[9:], step[9:])]))
        try:
            reached = inverse(self._model, place.frames.flange_of(moved), state.joint_position)
        except UnreachablePose:
            return None
        return tuple([(new - old) / _STEP_S for new, old in zip(reached, state.joint_position)])

    def pose_guard(self, state: RobotState, look: Look) -> Optional[PoseGuard]:
        """Return the guard of a stream of poses that begins with an arm at rest; None where nobody looks.

        Nobody does where the frames are not known, which is logged once.
        """
        frames = self.place_of(state).frames
        if frames is None or not self.is_on:
            self._tell_unknown_frames()
            return None
        return PoseGuard(self._model, frames, FrameGuard(look, state.joint_position), look, self._actor())

    def trajectory_trouble(self, path: Path, check: Callable[[], None] = lambda: None) -> str:
        """Return what a trajectory comes too near to, and when; "" where it is clear, or nobody looks.

        It may be called from any thread. What ``check`` raises, which is called again and again, ends it.
        """
        return to_the_end(_found(self._trajectory_trouble(path)), check) if self.is_on else ""

    # ---- inside ----

    def _actor(self) -> Callable[[Callable[[], str]], str]:
        """Return the function that finds, for one motion, the trouble for which it must stand; "" for none."""
        told: List[str] = []

        def act(find: Callable[[], str]) -> str:
            trouble = to_the_end(_found(_at_once(find))) if self.is_on else ""
            if not trouble or self.refuses:
                return trouble
            if not told:
                told.append(trouble)
                self._log_sent(trouble)
            return ""
        return act

    def _log_sent(self, trouble: str) -> None:
        self._actions.log(logging.WARNING, "sent, as ~guard_motion is %s: %s" % (self._mode, trouble))

    def _trajectory_trouble(self, path: Path) -> Looks[str]:
        times = _times_of(path, self._guard.reach)
        pieces = (path.samples(times[at:at + _SAMPLES_AT_ONCE + 1])[0]
                  for at in range(0, max(1, len(times) - 1), _SAMPLES_AT_ONCE))
        trouble = yield from self._guard.looks(pieces)
        if trouble is None:
            return ""
        begin, end = times[trouble.index], times[min(trouble.index + 1, len(times) - 1)]
        return "after %.3f s %s" % (begin + trouble.share * (end - begin), trouble.reason)

    def _move_trouble(self, command: PathCommand, start: StartPlace, ends: List[StartPlace]) -> Looks[str]:
        if isinstance(command, JointMove):
            return (yield from self._joint_trouble(command, start, ends))
        if start.joints is None or start.frames is None:
            self._tell_unknown_frames()
            return ""
        return (yield from self._line_trouble(command, start.joints, start, ends))

    def _joint_trouble(self, command: JointMove, start: StartPlace, ends: List[StartPlace]) -> Looks[str]:
        begin, end = start.joints, command.joint_position
        if begin is None:
            return self._guard.trouble(end)
        trouble = yield from self._guard.looks([np.array((begin, end))])
        if trouble is not None:
            return "after %.0f %% of the way %s" % (100.0 * trouble.share, trouble.reason)
        longest = max([abs(b - a) for a, b in zip(begin, end)])
        way = JointWay(begin, end, longest / command.speed, command.tolerance)
        ends.append(_end_of(way, start))
        return (yield from self._corner_trouble(start, way))

    def _corner_trouble(self, start: StartPlace, way: Way) -> Looks[str]:
        """Look at the rounded corners that may lie between the way that ends at the start, and this one."""
        if isinstance(start.way, LineWalk) and isinstance(way, LineWalk):
            for corner in corner_walks(start.way, way):
                trouble = yield from self._way_trouble(corner)
                if trouble:
                    return "on the rounded corner where it begins, " + trouble
        elif start.way is not None:
            tool = IDENTITY if start.frames is None else start.frames.flange_t_tool
            for joints in joint_corners(self._model, tool, start.way, way):
                found = yield from self._guard.looks([np.array(joints)])
                if found is not None:
                    return "on the rounded corner where it begins, after %.0f %% of it %s" % (
                        100.0 * (found.index + found.share) / (len(joints) - 1), found.reason)
        return ""

    def _line_trouble(self, command: Union[LinearMove, ArcMove], begin: Vector, start: StartPlace,
                      ends: List[StartPlace]) -> Looks[str]:
        assert start.frames is not None
        try:
            inverse(self._model, start.frames.flange_at(command.target), begin)
        except UnreachablePose as error:
            return "its target cannot be reached: %s" % error
        way = walk(self._model, start.frames, begin, command)
        trouble = yield from self._way_trouble(way)
        if trouble:
            return trouble
        ends.append(_end_of(way, start))
        return (yield from self._corner_trouble(start, way))

    def _way_trouble(self, way: LineWalk) -> Looks[str]:
        yield from way.looks()
        trouble = yield from self._guard.looks([np.array(way.joints)])
        if trouble is not None:
            return _place_text(way.share_at(trouble.index, trouble.share), way.length, trouble.reason)
        if way.early_end is not None:
            return _place_text(way.early_end.share, way.length, "it cannot go on: " + way.early_end.reason)
        return ""

    def _tell_unseen_tool(self, tip: Vector) -> None:
        """Log where the point of the active tool, m in the flange's frame, lies far outside of all known parts.

        Nobody but the workspace says what shape a tool has; a frame that was set for it changes none.
        """
        if math.dist(tip, self._known_tip) <= _SAME_TIP:
            return
        self._known_tip = tip
        outside = self._guard.distance_from_tool((tip[0], tip[1], tip[2]))
        if outside > _FAR_TIP:
            self._actions.log(logging.WARNING, "the point of the active tool is %.0f mm outside of all parts that the "
                              "motion guard knows: it does not see this tool; describe it under 'tool' in the file of "
                              "~workspace" % m_to_mm(outside))

    def _tell_unknown_frames(self) -> None:
        if self.is_on and not self._has_told_frames:
            self._has_told_frames = True
            self._actions.log(logging.WARNING, "the motion guard does not look at the way of lines and poses while the "
                              "active tool and user frame are not known, or do not fit the model; said once")


def _end_of(way: Way, start: StartPlace) -> StartPlace:
    """Return the place where a way ends.

    One that leads nowhere leaves the way before it: a controller need not queue it, and then rounds the corner there.
    """
    assert start.joints is not None
    places = way.joints if isinstance(way, LineWalk) else [way.end]  # an arc may end where it begins
    is_nowhere = all(abs(a - b) <= MOVEMENT for joints in places for a, b in zip(start.joints, joints))
    return StartPlace(way.end, start.frames, start.way if is_nowhere else way)


def _found(looks: Looks[str]) -> Looks[str]:
    """Return what a look returns, or in words that it has failed."""
    try:
        return (yield from looks)
    except InvalidCommand as error:
        return str(error)
    except Exception as defect:
        return "the motion guard has failed, so that nobody knows whether the way is clear: %r" % defect


def _at_once(find: Callable[[], str]) -> Looks[str]:
    """Return the look that takes a single step."""
    return find()
    yield 0


def _place_text(share: float, length: float, reason: str) -> str:
    if length < 1e-3:
        return "after %.0f %% of its turn %s" % (100.0 * share, reason)
    return "after %.0f mm of %.0f mm %s" % (1e3 * share * length, 1e3 * length, reason)


def _times_of(path: Path, reach: Vector) -> Array:
    """Return the times of a path at whose places the straight lines between them are near enough to it, s.

    reach: The most, m, by which 1 rad of each joint changes a distance, shape (6,).
    """
    begin = max(path.begin, float(path.breaks[0]))  # before its polynomials the arm rests where they begin
    marks = [begin, *[at for at in path.breaks.tolist() if begin < at < path.end], path.end]
    if path.approach is not None and begin < path.approach.until < path.end:
        marks = sorted({*marks, path.approach.until})
    periods = _periods(path, np.array(marks[:-1]), reach)
    counts = np.maximum(1, np.ceil(np.diff(marks) / periods).astype(int)).tolist()
    pieces = [np.linspace(a, b, count, endpoint=False) for a, b, count in zip(marks, marks[1:], counts)]
    return np.concatenate([*pieces, [path.end]])


def _periods(path: Path, begins: Array, reach: Vector) -> Array:
    """Return the longest times, s (m,), between two places of the parts of a path that begin at these times, s (m,).

    An acceleration is at most h^2/8 times its highest second derivative above that of both ends of its piece.
    """
    index = np.clip(np.searchsorted(path.breaks, begins, side="right") - 1, 0, len(path.coefficients) - 1)
    coefficients, durations = path.coefficients[index], np.diff(path.breaks)[index]
    first, last = (np.abs(sampled(at, coefficients)[2]) for at in (0.0 * durations, durations))
    fourth = highest_fourths(coefficients, durations)
    highest = np.minimum(np.maximum(first, last) + durations[:, None] ** 2 / 8.0 * fourth, _HIGHEST_ACCELERATION)
    if path.approach is not None:
        highest[begins < path.approach.until] = _HIGHEST_ACCELERATION
    return np.minimum(_SAMPLE_PERIOD_S, np.sqrt(8.0 * _BESIDE / np.maximum(highest @ np.array(reach), 1e-9)))
