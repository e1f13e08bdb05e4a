"""The audit of a path before anything of it is sent: by the controller's own kinematics, tool and user frame.

What lies between the targets is looked at by the motion guard, where it is on and knows tool and user frame. Else a
line between two places within reach may leave it, and the controller then stops the arm there.
"""
from typing import Callable, Sequence

from jaka_ros_driver.client.core.motion_guard.motion_check import MotionCheck, StartPlace
from jaka_ros_driver.client.core.procedures.steps import Ask, Procedure, in_slices
from jaka_ros_driver.commands import (
    ArcMove,
    Command,
    ForwardKinematics,
    InverseKinematics,
    JointMove,
    PathCommand,
    Pose,
)
from jaka_ros_driver.errors import CommandRejected, InvalidCommand
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.segments import MAX_SEGMENTS, PathPlace, SegmentPath


def audit(commands: Sequence[PathCommand], state: RobotState, audited: Callable[[Command], Command],
          check: Callable[[], None], motion_check: MotionCheck) -> Procedure:
    """Find the places between which the segments lead, and check that each can be reached; return a SegmentPath.

    Args:
        commands: Of the segments.
        state: Of the arm at rest, where the path begins.
        audited: Raises InvalidCommand for a command outside the limits of the arm.
        check: Called before each question; what it raises ends the audit.
        motion_check: Looks at the way of each segment.

    Raises:
        InvalidCommand: The first segment that cannot be run, by its number from 0, and why.
        JakaError: As ``Ask``.
    """
    if not 0 < len(commands) <= MAX_SEGMENTS:
        raise InvalidCommand("a path has %d segments; valid: 1 to %d" % (len(commands), MAX_SEGMENTS))
    if state.tcp_position is None or state.tcp_rpy is None:
        raise InvalidCommand("refused: this controller does not report the pose of the tool")
    for number, command in enumerate(commands):
        _require(audited, command, number)
    places = [PathPlace(state.joint_position, Pose(state.tcp_position, state.tcp_rpy))]
    place = motion_check.place_of(state)
    for number, command in enumerate(commands):
        check()
        before = places[-1].joints
        if isinstance(command, JointMove):
            pose = yield Ask(ForwardKinematics(command.joint_position))
            places.append(PathPlace(command.joint_position, pose))
            place = yield from _looked_at(motion_check, command, place, number, check)
            continue
        # before the controller is asked, which does not say why a place is out of reach
        place = yield from _looked_at(motion_check, command, place, number, check)
        if isinstance(command, ArcMove):
            before = yield from _joints_at(command.via, before, audited, number, "via")
        joints = yield from _joints_at(command.target, before, audited, number, "target")
        places.append(PathPlace(joints, command.target))
        if place.joints is None:
            place = yield from _looked_at(motion_check, JointMove(joints, 0.1, 0.1), place, number, check)
    return SegmentPath(commands, places)


def _joints_at(pose: Pose, reference: Vector, audited: Callable[[Command], Command], number: int,
               what: str) -> Procedure:
    try:
        joints = yield Ask(InverseKinematics(pose, reference))
    except CommandRejected as error:
        raise InvalidCommand("segment %d: its %s cannot be reached: %s" % (number, what, error)) from error
    _require(audited, JointMove(joints, 0.1, 0.1), number)
    return joints


def _looked_at(motion_check: MotionCheck, command: PathCommand, place: StartPlace, number: int,
               check: Callable[[], None]) -> Procedure:
    """Return the place behind a segment whose way is clear; its joints are None where the guard does not know them."""
    try:
        return (yield from in_slices(motion_check.after_move(command, place), check))
    except InvalidCommand as error:
        raise InvalidCommand("segment %d: %s" % (number, error)) from error


def _require(audited: Callable[[Command], Command], command: Command, number: int) -> None:
    try:
        audited(command)
    except InvalidCommand as error:
        raise InvalidCommand("segment %d: %s" % (number, error)) from error
