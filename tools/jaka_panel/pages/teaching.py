"""The commands by which frames and tools are taught: the present pose, and what poses give."""
from typing import Any, List

from ..graph.arm_pose import WAIT_S, resting_pose
from ..graph.calls import Calls
from ..graph.requests import Args, CallResult, WrongRequest, numbers
from ..teach.tool_centre import tool_centre
from ..teach.user_frame import CannotTeach, user_frame
from .arm_session import ArmSession

_SLACK_S = 8.0
"""Time, s, beside its own waits that a pose may take: reading it is a thread's, which may have to wait for others."""
_COMPUTE_S = 5.0
"""Longest wait, s, for a frame or a tool from at most ``_MOST`` points, which takes milliseconds."""
_MOST = 20
"""Most points or poses in one request: as many as ``teach`` takes."""


async def present_pose(calls: Calls, arm: ArmSession) -> CallResult:
    """Return the pose at which the arm rests."""
    if not arm.is_listed:
        return CallResult(False, "the driver is not there")
    answer: CallResult = await calls.run(lambda: resting_pose(arm.feed), WAIT_S + _SLACK_S)
    return answer


async def teach_user_frame(calls: Calls, args: Args) -> CallResult:
    """Return the frame of ``points``."""
    points = [numbers({"points": point}, "points", 3) for point in _some(args, "points")]
    try:
        frame = await calls.run(lambda: user_frame(points), _COMPUTE_S)
    except CannotTeach as error:
        return CallResult(False, str(error))
    return CallResult(True, "", {"p": frame.position, "r": frame.rotation_vector, "residual": frame.residual,
                                 "turn": frame.turn})


async def teach_tool(calls: Calls, args: Args) -> CallResult:
    """Return the tip of the tool of ``poses`` of the flange; its axes are the flange's."""
    poses = _some(args, "poses")
    if not all(isinstance(pose, dict) for pose in poses):
        raise WrongRequest("a pose must be an object of p and r")
    places, turns = ([numbers(pose, name, 3) for pose in poses] for name in ("p", "r"))
    try:
        tool = await calls.run(lambda: tool_centre(places, turns), _COMPUTE_S)
    except CannotTeach as error:
        return CallResult(False, str(error))
    return CallResult(True, "", {"p": tool.position, "r": [0.0, 0.0, 0.0], "residual": tool.residual,
                                 "worst": tool.worst, "uncertainty": tool.uncertainty})


def _some(args: Args, name: str) -> List[Any]:
    values = args.get(name)
    if not isinstance(values, list) or len(values) > _MOST:
        raise WrongRequest("%s must be a list of at most %d" % (name, _MOST))
    return values
