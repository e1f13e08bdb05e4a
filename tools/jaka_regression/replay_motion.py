"""``jaka_bag replay-motion``: the command line that has an arm do again what it did in a log."""
import argparse
import signal
import sys
import time
from pathlib import Path
from typing import Any, List, Optional, Tuple

import numpy as np

from jaka_bag.cli.options import Report, add_report, add_span, span_of
from jaka_bag.cli.quantities import duration, positive_number
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.errors import BagError, JakaBagError
from jaka_bag.interrupts import Flag
from jaka_bag.live.graph import RemoteNode, master_uri
from jaka_bag.live.session import read_parameter
from jaka_bag.messages.batch import Array
from jaka_bag.messages.selection import Selection, TimeSpan
from jaka_bag.units import NS_PER_S

from .motion.limits import DESCRIPTION, ArmLimits, LogParameters, UnknownLimits, limits_from_urdf, same_model
from .motion.path import REST_S
from .motion.picture import check_picture, draw_plan
from .motion.plan import MotionPlan, plan_motion
from .motion.recorded import LONGEST_GAP_S, Recording, recorded_joints
from .motion.time_law import SOLVERS

_START_SPEED = 0.2
"""Speed of the fastest joint on the way to the start, rad/s."""
_PEAK = 1.875
"""The highest speed of a quintic from rest to rest, over its mean."""
_SHORTEST_MOVE_S = 1.0
"""Shortest time, s, of the way to the beginning: a short one must be seen."""
_REACH_RAD = 0.01
"""Default distance, rad, from the beginning: the driver's own start tolerance."""
_LARGEST_FACTOR = 10.0
"""Largest factor of the recorded speed that can be asked for; limits hold in any case."""

EPILOG = """\
Takes the joints of the log, whatever moved them: a program, a jog, a hand. Standstill at both ends is cut, measurement
noise is filtered out, and the motion gets the recorded speed again, times --speed, or less where the arm could not:
then it says by how much. The whole way is checked against the limits of the arm, which the running driver tells
(robot_description), and sent as one goal of the driver's action follow_joint_trajectory. Needs the Python package
toppra; with ruckig alone the whole motion is slowed down where toppra slows down only what is too fast.

THE ARM MOVES, also a real one, on the recorded way: what stands in it now is not known to anybody. Look at a dry run,
and begin with --speed 0.2.

The arm must stand where the motion began; --move-to-start moves it there first, each joint straight to its
place, all together, at most 0.2 rad/s fast. Ctrl-C has it brake on its path, and ends when it rests.

--dry-run sends nothing. It draws the motion, beside the log or to --output: .html, .svg or .png. Without a running
driver the limits are those in the log (.mcap, recorded while the driver ran), or of the URDF that --description names.

examples:
  jaka_bag replay-motion guided.mcap --dry-run
  jaka_bag replay-motion guided.mcap --move-to-start --speed 0.5

Exit code: 0 done, 1 refused or stopped, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag replay-motion``."""
    parser.add_argument("log", metavar="LOG", help=".bag or .mcap with joint positions")
    what = parser.add_argument_group("which motion (default: all of it)")
    what.add_argument("--topic", metavar="TOPIC", help="of the joint positions, where there are several")
    add_span(what)
    what.add_argument("--max-pause", type=duration, metavar="TIME",
                      help="cut longer standstills inside to TIME, at least %gs (default: they stay)" % (2.0 * REST_S))
    what.add_argument("--max-gap", type=duration, default=LONGEST_GAP_S, metavar="TIME",
                      help="bridge so much time without samples (default %gs)" % LONGEST_GAP_S)
    how = parser.add_argument_group("how")
    how.add_argument("--speed", type=_factor, default=1.0, metavar="FACTOR",
                     help="of the recorded speed, at most %g (default 1)" % _LARGEST_FACTOR)
    how.add_argument("--move-to-start", action="store_true", help="first move to where the motion began")
    how.add_argument("--start-tolerance", type=positive_number, default=_REACH_RAD, metavar="RAD",
                     help="how far each joint may be from there (default %g)" % _REACH_RAD)
    how.add_argument("--solver", choices=SOLVERS, help="the Python package that gives the motion its times (default: "
                                                       "the first that is installed)")
    how.add_argument("--driver", metavar="NODE", help="whose arm moves, as /left/jaka_driver (default: the log's)")
    how.add_argument("--any-model", action="store_true", help="also where the log tells of another arm's model")
    how.add_argument("--description", metavar="URDF", help="file with the limits of the arm (default: the driver's)")
    how.add_argument("--wait", type=duration, default=20.0, metavar="TIME", help="wait so long for the driver "
                                                                                 "(default 20s)")
    dry = parser.add_argument_group("to look at it first")
    dry.add_argument("-n", "--dry-run", action="store_true", help="draw the motion and end")
    dry.add_argument("-o", "--output", metavar="FILE",
                     help="the picture, .html, .svg or .png; default with --dry-run: LOG as .motion.html")
    dry.add_argument("-f", "--force", action="store_true", help="overwrite the picture")
    add_report(parser)


def _factor(text: str) -> float:
    value = positive_number(text)
    if not 0.01 <= value <= _LARGEST_FACTOR:
        raise argparse.ArgumentTypeError("%r is not within 0.01 to %g" % (text, _LARGEST_FACTOR))
    return value


def run(args: argparse.Namespace) -> int:
    """Plan the motion, draw it, have the arm do it; 0 done, 1 refused or stopped."""
    report, span = Report(args), span_of(args)
    target = args.output or (str(Path(args.log).with_suffix(".motion.html")) if args.dry_run else None)
    if target is not None:
        check_picture(target, args.force)
    recording = _recording(args, span)
    node = args.driver or recording.node
    parameters = LogParameters(args.log, recording.node)
    limits, model_of_log = _limits(args, recording, node, parameters)
    notes: List[str] = []
    if model_of_log is None:
        notes.append("the log does not tell with which arm it was recorded; the motion is checked against the limits "
                     "of the %s" % limits.model)
    elif not same_model(model_of_log, limits.model) and not args.any_model:
        raise BagError("%s was recorded with a %s, and this arm is a %s; --any-model replays it all the same, within "
                       "the limits of this arm" % (args.log, model_of_log, limits.model))
    plan = plan_motion(recording, limits, args.speed, args.max_pause, args.solver)
    report.tell("note", notes + plan.notes)
    if target is not None:
        draw_plan(plan, target, args.force)
        report.done("%s: the motion to be sent, beside the recorded one" % target)
    report.done("%d points, %.2f s (recorded: %.2f s), at most %.2f mrad from the samples, whose noise is %.3f mrad" % (
        len(plan.time), plan.duration, plan.smoothed.path.duration, 1e3 * plan.smoothed.deviation,
        1e3 * plan.smoothed.noise))
    end, code = (None, 0) if args.dry_run else _perform(args, plan, node, report)
    report.finish({**plan.document(), "notes": notes + plan.notes, "picture": target, "end": end})
    return code


def _recording(args: argparse.Namespace, span: TimeSpan) -> Recording:
    log = load_run(args.log, with_contents=False)
    end_ns = log.start_ns + int(round(log.duration * NS_PER_S))
    chosen = span.apply(Selection(), log.start_ns, end_ns)
    return recorded_joints(log, args.topic, chosen.start_time, chosen.end_time, args.max_gap)


def _limits(args: argparse.Namespace, recording: Recording, node: str,
            parameters: LogParameters) -> Tuple[ArmLimits, Optional[str]]:
    """Return the limits of the arm that is to move, and the recorded arm's model, None if the log does not have it."""
    in_log = parameters.description
    model = limits_from_urdf(in_log, recording.names).model if in_log is not None else parameters.model
    if args.description:
        try:
            text: Optional[str] = Path(args.description).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise BagError("cannot read %s: %s" % (args.description, error)) from error
    else:
        text = _running_description(node, args.dry_run)
        if text is None and args.dry_run:
            text = in_log
    if text is None:
        raise UnknownLimits("the limits of the arm are not known: %s; --description names a URDF file" % (
            "no driver runs, and the log has no robot_description (only .mcap does, recorded while the driver ran)"
            if args.dry_run else "the driver %s has set no robot_description" % node))
    return limits_from_urdf(text, recording.names), model


def _running_description(node: str, may_be_missing: bool) -> Optional[str]:
    """Return the URDF of a running driver; None if there is none.

    Raises:
        BagError: There is no master, and it may not be missing.
    """
    words = [word for word in node.split("/")[:-1] if word]
    try:
        with RemoteNode(master_uri(), "/jaka_bag_replay") as master:
            for count in range(len(words), -1, -1):
                text = read_parameter(master, "/" + "/".join([*words[:count], DESCRIPTION]))
                if isinstance(text, str) and text.strip():
                    return text
    except (JakaBagError, OSError) as error:
        if not may_be_missing:
            raise BagError("no ROS master: %s" % error) from error
    return None


def _perform(args: argparse.Namespace, plan: MotionPlan, node: str, report: Report) -> Tuple[str, int]:
    """Have the arm perform the motion; return how it ended, and the exit code."""
    try:
        from .driver_client import DriverClient
        from .trajectory_client import TrajectoryClient, action_of
    except ImportError as error:
        raise BagError("replay-motion needs ROS: %s" % error) from error
    cancelled = Flag()
    with RemoteNode(master_uri(), "/jaka_bag_replay") as master:
        action = action_of(master, node)
    driver = DriverClient("jaka_bag_replay", cancelled)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: cancelled.set())
    try:
        arm = driver.unless_cancelled(lambda: TrajectoryClient(action, args.wait))
        try:
            end = _go_to_start(args, plan, driver, arm, node, cancelled)
            if end is None:
                report.done("%s begins" % action)
                sys.stdout.flush()
                end = arm.follow(plan.recording.names, plan.time, plan.position, plan.velocity, plan.acceleration,
                                 cancelled)
        finally:
            arm.close()
        if not end.succeeded:
            report.tell("error", [end.text])
            why = None if end.is_known else driver.stop(node)
            report.tell("error", [] if why is None else ["%s could not be stopped: %s" % (node, why)])
            return end.text, 1
        report.done("done: %s" % end.text)
        return end.text, 0
    finally:
        driver.close()


def _go_to_start(args: argparse.Namespace, plan: MotionPlan, driver: Any, arm: Any, node: str,
                 cancelled: Flag) -> Any:
    """Move the arm to where the motion began, unless it stands there; return how that failed, None where it did not.

    Raises:
        BagError: It stands elsewhere, and shall not be moved, or does not come there.
    """
    def away() -> Array:
        here = driver.joint_position(node + "/joint_position", args.wait)
        if len(here) != len(plan.start):
            raise BagError("%s has %d joints, %d in the log" % (node, len(here), len(plan.start)))
        distance: Array = np.abs(np.array(here) - np.array(plan.start))
        return distance

    distance = away()
    if distance.max() <= args.start_tolerance:
        return None
    if not args.move_to_start:
        raise BagError("%s stands %.4f rad from where the motion began; --move-to-start moves the arm there" % (
            plan.recording.names[int(distance.argmax())], distance.max()))
    seconds = max(_SHORTEST_MOVE_S, _PEAK * float(distance.max()) / _START_SPEED)
    nothing = np.zeros((1, len(plan.start)))
    end = arm.follow(plan.recording.names, np.array([seconds]), np.array([plan.start]), nothing, nothing, cancelled)
    if not end.succeeded:
        return end._replace(text="the move to the start: %s" % end.text)
    deadline = time.monotonic() + args.wait
    while away().max() > args.start_tolerance:
        if time.monotonic() > deadline:
            raise BagError("the arm did not come to where the motion began")
    return None
