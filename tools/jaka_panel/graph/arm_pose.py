"""The pose at which an arm rests, of its tool and of its flange in the base, for points and teaching.

The tool's pose is the controller's, in the active user frame; tool and user frame are the driver's transforms. All of
them are the controller's own numbers: no model of the arm is in between.
"""
import threading
import time
from typing import Any, Dict, List, Mapping, Optional, Set, Tuple

import rospy
from tf2_msgs.msg import TFMessage

from ..teach.rotations import FramePose, compose, invert
from .arm_feed import STALE_S, ArmFeed
from .requests import CallResult
from .rotations import vector_from_quaternion

WAIT_S = 2.0
"""Longest wait, s, for the transforms of a driver: ``/tf_static`` is latched, ``/tf`` comes with each pose."""
_STILL_RAD = 2e-4
"""Largest change, rad, of a joint at rest: noise."""
_REST_S = 0.15
"""Time, s, for which the arm must be seen at rest: more than ten samples at 125 Hz."""
_LOOK_S = 0.02
"""Period, s, of the looks at the clock meanwhile."""
_TF = "/tf"


def resting_pose(feed: ArmFeed) -> CallResult:
    """Return where the arm rests; it must rest from the begin of the call to its end.

    ``data`` has ``q`` rad, ``tool`` and ``flange`` in the base as ``{"p": m, "r": rad}``, ``tool_number``,
    ``user_number`` and ``model``. It waits, up to ``WAIT_S``; a thread of its own calls it.
    """
    driver, begin = feed.driver, time.monotonic()
    before = _joints(feed)
    if before is None:
        return CallResult(False, "the arm moves, or is not seen: a point is taken where it rests")
    names = [driver.prefix + str(driver.parameter(name + "_frame", default)) for name, default in (
        ("base", "base_link"), ("flange", "tool0"), ("tool", "tool"))]
    base, flange, tool = names
    state = feed.state(begin)
    shown = state["tool"]
    if shown is None or shown["age"] > STALE_S:
        return CallResult(False, "the pose of the tool is not seen")
    edges = {(flange, tool)} | ({(base, shown["frame"])} if shown["frame"] != base else set())
    found = _transforms(driver.node, edges, begin + WAIT_S)
    while time.monotonic() < begin + _REST_S:
        time.sleep(_LOOK_S)
    after = _joints(feed)
    if after is None or max(abs(a - b) for a, b in zip(before, after)) > _STILL_RAD:
        return CallResult(False, "the arm has moved meanwhile: a point is taken where it rests")
    if edges - set(found):
        return CallResult(False, "the driver publishes no transform from %s to %s (~publish_tf)" % sorted(
            edges - set(found))[0])
    now = feed.state(time.monotonic())
    shown = now["tool"]
    if shown is None or (now["tool_id"], now["user_id"]) != (state["tool_id"], state["user_id"]):
        return CallResult(False, "tool or user frame have changed meanwhile")
    pose = FramePose(shown["p"], shown["r"])
    base_t_tool = compose(found[(base, shown["frame"])], pose) if shown["frame"] != base else pose
    base_t_flange = compose(base_t_tool, invert(found[(flange, tool)]))
    return CallResult(True, "", {
        "q": [round(value, 6) for value in after], "tool": _shown(base_t_tool), "flange": _shown(base_t_flange),
        "tool_number": now["tool_id"], "user_number": now["user_id"], "model": str(driver.parameter("model", "zu7"))})


def _joints(feed: ArmFeed) -> Optional[Tuple[float, ...]]:
    """Return the joints, rad, of an arm that is seen at rest."""
    now = time.monotonic()
    joints, status = feed.joints, feed.state(now)["status"]
    if joints is None or now - joints.at > STALE_S or status is None or status["age"] > STALE_S or (
            status["in_motion"] is not False):
        return None
    return joints.position


def _transforms(node: str, edges: Set[Tuple[str, str]], until: float) -> Dict[Tuple[str, str], FramePose]:
    """Return the newest transforms of a node by parent and child, as soon as all edges were published."""
    found: Dict[Tuple[str, str], FramePose] = {}
    has_all = threading.Event()

    def take(message: Any) -> None:
        if message._connection_header.get("callerid") != node:
            return  # two arms may have frames of the same names
        for transform in message.transforms:
            edge = (transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/"))
            if edge in edges:
                found[edge] = _pose(transform.transform)
        if not edges - set(found):
            has_all.set()

    subscriber: Any = rospy.Subscriber(_TF, TFMessage, take, queue_size=10)
    try:
        has_all.wait(max(0.0, until - time.monotonic()))
    finally:
        subscriber.unregister()
    return dict(found)


def _pose(transform: Any) -> FramePose:
    place, turn = transform.translation, transform.rotation
    return FramePose([place.x, place.y, place.z], vector_from_quaternion(turn.x, turn.y, turn.z, turn.w))


def _shown(pose: FramePose) -> Mapping[str, List[float]]:
    return {"p": [round(value, 7) for value in pose.position], "r": [round(value, 7) for value in pose.rotation_vector]}
