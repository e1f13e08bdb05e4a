"""The commands of pages besides jog and stop: the driver's services, plans, the simulation's operator port."""
import contextlib
import functools
import logging
import threading
import time
from typing import Any, Awaitable, Callable, Dict, NamedTuple, Optional

from ..cell.contents import SECTIONS, WrongCell
from ..graph import motion_lists, trajectories
from ..graph.calls import Calls, NoAnswer, TooManyCalls
from ..graph.requests import (
    BANKS,
    MOTION_S,
    REQUESTS,
    SHORT_S,
    Args,
    CallResult,
    WrongRequest,
    number,
    sent_unless,
    text,
    whole,
)
from ..plans.motion_list import ListPlan
from ..plans.plan_store import LOG_TIMEOUT_S
from ..plans.point_plan import WrongPlan, plan_of_points
from . import simulator_link, teaching
from .arm_session import ArmSession
from .hub import Hub
from .session import Session
from .shared_cell import SharedCell

_LOG = logging.getLogger(__name__)
_SLOWEST_LOG, _FASTEST_LOG = 0.05, 1.0
_SLOWEST_JOG = 0.01
"""Least fraction of the jog speed that a page may set: with less the arm seems to stand."""
_TOO_COSTLY = "too many requests that are costly to answer"
Perform = Callable[[Hub, Session, Any, Args], Awaitable[CallResult]]


class PanelCommand(NamedTuple):
    """A command of a page.

    Attributes:
        perform: Function that carries it out; raises WrongRequest, WrongPlan, WrongCell, NoAnswer, TooManyCalls,
            OSError.
        needs_control: True if the token is not enough.
        needs_arm: True if it is for one arm.
    """

    perform: Perform
    needs_control: bool = True
    needs_arm: bool = True


async def answer_to(hub: Hub, page: Session, message: Args) -> CallResult:
    """Carry out a command that the page may ask for; whatever goes wrong is reported in the outcome."""
    command = COMMANDS[str(message.get("cmd"))]
    args = message.get("args", {})
    arm = hub.arms.get(str(message.get("arm")))
    if not isinstance(args, dict):
        return CallResult(False, "args must be an object")
    if command.needs_arm and arm is None:
        return CallResult(False, "no such arm")
    try:
        outcome: CallResult = await command.perform(hub, page, arm, args)
        return outcome
    except (WrongRequest, WrongPlan, WrongCell, NoAnswer, TooManyCalls, OSError) as error:
        return CallResult(False, str(error))
    except Exception as error:  # whatever it was, the page waits for an answer
        _LOG.exception("a command of a page failed")
        return CallResult(False, "it failed within the panel: %r" % error)


async def _service(name: str, hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    request = REQUESTS[name]
    stopped = threading.Event()

    def why_not() -> str:
        if stopped.is_set() or hub.is_closing:
            return "nothing was sent: the arm was stopped before this began"
        return "" if hub.control.holder == page.id else "nothing was sent: the page has lost control"

    def perform() -> CallResult:
        with sent_unless(why_not) if request.begins else contextlib.nullcontext():
            return request.perform(arm.driver, args)

    if request.is_motion:
        page.begins_motion(arm.driver.node, time.monotonic())
    arm.cancels.add(stopped)
    try:
        outcome: CallResult = await hub.calls.run(perform, request.timeout)
        return outcome
    finally:
        arm.cancels.discard(stopped)
        if request.is_motion:
            page.ends_motion(arm.driver.node, time.monotonic())


async def _set_output(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    """Set an output by hand; it is marked so until something else sets it."""
    key = text(args, "bank", tuple(BANKS)), text(args, "signal"), whole(args, "index")
    arm.feed.hand_outputs.expect(key, time.monotonic())
    outcome = await _service("set_output", hub, page, arm, args)
    if outcome.ok and outcome.data is not None:
        arm.feed.set_by_hand(key, outcome.data["value"], page.name)
    return outcome


async def _jog_speed(hub: Hub, page: Session, arm: Optional[ArmSession], args: Args) -> CallResult:
    fraction = number(args, "fraction")
    if not _SLOWEST_JOG <= fraction <= hub.settings.jog_fraction:
        return CallResult(False, "fraction must be within %g to %g" % (_SLOWEST_JOG, hub.settings.jog_fraction))
    hub.set_jog_fraction(fraction)
    return CallResult(True, "", {"fraction": fraction})


async def _plan_points(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    plan = plan_of_points(args.get("points"), arm.joint_limits)
    return CallResult(True, "", plan.shown(hub.plans.put(arm.driver.node, plan)))


async def _plan_list(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    steps = args.get("steps")
    SECTIONS["lists"]({"steps": steps}, "the list")
    joints = arm.feed.joints
    if joints is None or arm.place(time.monotonic()) is None:
        return CallResult(False, "the arm's joints are not known")
    points = hub.cell.entries("points", arm.driver.node)
    begin, limits = joints.position, arm.joint_limits
    if arm.is_planning:  # each pose is a question to the controller
        return CallResult(False, "another list is being planned")
    arm.is_planning = True
    try:
        plan = await hub.calls.run(lambda: motion_lists.plan(arm.driver, steps or [], points, begin, limits),
                                   motion_lists.PLAN_S + 5.0)
    finally:
        arm.is_planning = False
    return CallResult(True, "", plan.shown(hub.plans.put(arm.driver.node, plan)))


async def _plan_log(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    factor = number(args, "speed", 1.0)
    if not _SLOWEST_LOG <= factor <= _FASTEST_LOG:
        return CallResult(False, "speed must be within %g to %g" % (_SLOWEST_LOG, _FASTEST_LOG))
    about, name = arm.description, text(args, "file")
    if about is None:
        return CallResult(False, "the arm's description is not known")
    urdf = about.text
    plan = await hub.calls.run(lambda: hub.logs.plan(name, factor, urdf), LOG_TIMEOUT_S + 1.0)
    return CallResult(True, "", plan.shown(hub.plans.put(arm.driver.node, plan)))


async def _plan_run(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    plan = hub.plans.get(arm.driver.node, args.get("plan"))
    cancelled = threading.Event()
    run: Callable[[], CallResult]
    if isinstance(plan, ListPlan):
        going = motion_lists.ListRun(arm.feed, lambda: hub.control.holder == page.id, cancelled)
        run = functools.partial(going.run, plan)
    else:
        action, joints = arm.driver.action, arm.feed.joints
        if action is None:
            return CallResult(False, "the driver takes no trajectories")
        problem = trajectories.away_from_start(plan, None if arm.place(time.monotonic()) is None or joints is None
                                               else joints.position)
        if problem is not None:
            return CallResult(False, problem)
        run = functools.partial(trajectories.run, action, plan, cancelled)
    arm.cancels.add(cancelled)
    page.begins_motion(arm.driver.node, time.monotonic())
    try:
        outcome: CallResult = await hub.calls.run(run, MOTION_S)
        return outcome
    finally:
        page.ends_motion(arm.driver.node, time.monotonic())
        arm.cancels.discard(cancelled)


async def _logs(hub: Hub, page: Session, arm: Optional[ArmSession], args: Args) -> CallResult:
    if not page.costly.spend(time.monotonic()):
        return CallResult(False, _TOO_COSTLY)
    return CallResult(True, "", {"logs": await hub.calls.run(hub.logs.entries, SHORT_S)})


async def _simulator(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    action = text(args, "action", simulator_link.ACTIONS)
    if not arm.has_simulator or arm.feed.simulated is not True:
        return CallResult(False, "this arm's controller is no simulated one whose operator port can be reached")
    if action not in simulator_link.READING and hub.control.holder != page.id:
        return CallResult(False, "this needs control")
    answer = await simulator_link.ask(arm.simulator_port, args)
    ok = answer.pop("ok", False) is True
    return CallResult(ok, str(answer.pop("error", "")), answer)


async def _cell(work: Callable[[SharedCell, Session, Args], Awaitable[CallResult]], is_costly: bool, hub: Hub,
                page: Session, arm: Optional[ArmSession], args: Args) -> CallResult:
    if is_costly and not page.costly.spend(time.monotonic()):
        return CallResult(False, _TOO_COSTLY)
    return await work(hub.cell, page, args)


async def _present_pose(hub: Hub, page: Session, arm: ArmSession, args: Args) -> CallResult:
    if not page.costly.spend(time.monotonic()):
        return CallResult(False, _TOO_COSTLY)
    return await teaching.present_pose(hub.calls, arm)


async def _teach(work: Callable[[Calls, Args], Awaitable[CallResult]], hub: Hub, page: Session,
                 arm: Optional[ArmSession], args: Args) -> CallResult:
    return await work(hub.calls, args)


def _of_cell(work: Callable[[SharedCell, Session, Args], Awaitable[CallResult]],
             is_costly: bool = False) -> PanelCommand:
    return PanelCommand(functools.partial(_cell, work, is_costly), needs_control=False, needs_arm=False)


COMMANDS: Dict[str, PanelCommand] = {
    **{name: PanelCommand(functools.partial(_service, name), request.needs_control)
       for name, request in REQUESTS.items()},
    "set_output": PanelCommand(_set_output), "jog_speed": PanelCommand(_jog_speed, needs_arm=False),
    "plan_points": PanelCommand(_plan_points), "plan_list": PanelCommand(_plan_list),
    "plan_log": PanelCommand(_plan_log), "plan_run": PanelCommand(_plan_run),
    "logs": PanelCommand(_logs, needs_control=False, needs_arm=False),
    "sim": PanelCommand(_simulator, needs_control=False),
    "cell_change": _of_cell(SharedCell.change), "cell_upload": _of_cell(SharedCell.upload),
    "cell_restore": _of_cell(SharedCell.restore), "cell_versions": _of_cell(SharedCell.versions, is_costly=True),
    "cell_export": _of_cell(SharedCell.export, is_costly=True),
    "present_pose": PanelCommand(_present_pose, needs_control=False),
    "teach_user_frame": PanelCommand(functools.partial(_teach, teaching.teach_user_frame), needs_control=False,
                                needs_arm=False),
    "teach_tool": PanelCommand(functools.partial(_teach, teaching.teach_tool), needs_control=False, needs_arm=False)}
"""Commands by the name that pages use."""
