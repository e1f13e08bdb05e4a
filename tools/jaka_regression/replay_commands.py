"""``jaka_bag replay-commands``: the command line that makes the service calls of a log again."""
import argparse
import json
import math
import select
import signal
import sys
import time
from typing import Any, List, Optional

from jaka_bag.cli.quantities import duration, positive_number
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import LongTrack, Run
from jaka_bag.errors import BagError, JakaBagError, UsageError
from jaka_bag.interrupts import Flag

from .attended import ReplayStopped
from .command_player import CommandPlayer, ServiceReply
from .command_schedule import Planned, as_text, plan
from .driver_inputs import SentMessage, inputs_of
from .preconditions import (
    KEYS,
    Difference,
    ToolPlace,
    clock_trouble,
    conditions_of_log,
    differences,
    log_begins_ns,
    pose_difference,
    unchecked_starts,
    untold,
)
from .uncaused_motions import in_words, uncaused_motions

_START_SPEED = 0.2
"""Speed, rad/s, on the way to the place of the beginning: a person must see where it leads."""
_START_ACCELERATION = 0.5
"""Acceleration, rad/s2, on that way."""
_REACH_RAD = 0.01
"""Default distance, rad, from where the log began: the driver's own start tolerance."""
_LOOK_S = 0.1
"""Longest wait, s, before the next look at what was typed, or a stop."""
_JOINTS = "/joint_position"
_OWN_SPEED = ("play", "resume", "set_speed_slider")
"""Calls after which the arm moves at a speed that no field of theirs tells, of a program or of what was paused."""
_TOLD_WITHIN_S = 3.0
"""Time, s, to wait for a message that a driver publishes once a second."""

EPILOG = """\
Makes the calls that the log's service_calls topics tell of again, against a live driver, with the same bytes, and sends
the goals, trajectories, jog and servo targets of the log again, with their stamps moved to now. Each comes at its
recorded time, but never before what it followed has ended; what overlapped overlaps again.

Nothing moves where the log does not fit: model, interface, tool, user frame, speed override, payload and collision
level must be those of the log, where both tell of them on /diagnostics; the same joints must put the tool at the same
pose; the log's clock must not have been set; each of its motions must have been begun by what is made again; and it
must tell where an arm stood that is to move. --anyway KEY leaves one of these out.

The arm must stand where the log began; --go-to-start moves it there first, slowly (0.2 rad/s), by joint_move: see
that the way is free. The replay ends at the first call that is refused and was not in the log; then, as after Ctrl-C,
stop_move is called.

--speed-limit 25 asks for at most 25 % of each recorded speed, and stretches the times between calls as much; what is no
call has a time of its own, and what plays a program, resumes or sets the override moves at a speed of its own: a log
with such is refused then.
--dry-run prints the calls and needs neither ROS nor a driver.

examples:
  jaka_bag replay-commands golden.mcap --dry-run
  jaka_bag replay-commands golden.mcap --go-to-start --speed-limit 25

Exit code: 0 all calls made, 1 stopped or refused, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag replay-commands``."""
    add = parser.add_argument
    add("log", metavar="LOG", help=".bag or .mcap with service_calls, or with what was sent to the driver's topics")
    add("-n", "--dry-run", action="store_true", help="print the calls and end")
    add("--after-previous", action="store_true", help="each call as soon as those it followed have ended")
    add("--speed-limit", type=_percent, default=100.0, metavar="PERCENT", help="of the recorded speeds (default 100)")
    add("--time-scale", type=positive_number, default=1.0, metavar="N",
        help="the times between calls are N times shorter: for a simulated controller that runs N times faster")
    add("--go-to-start", action="store_true", help="first move to where the log began")
    add("--start-tolerance", type=positive_number, default=_REACH_RAD, metavar="RAD",
        help="how far each joint may be from where the log began (default %g)" % _REACH_RAD)
    add("--anyway", action="append", default=[], choices=KEYS, metavar="KEY",
        help="though this differs: %s" % ", ".join(KEYS))
    add("--wait", type=duration, default=20.0, metavar="TIME", help="wait so long for the driver (default 20s)")
    add("--progress", action="store_true", help="a line of JSON at each start and end of a call, for scripts")
    add("--begin-at-stdin", action="store_true",
        help="a line on stdin tells when the log begins, in s of the monotonic clock, for scripts")
    add("-q", "--quiet", action="store_true", help="say only what went wrong")


def _percent(text: str) -> float:
    value = positive_number(text)
    if value > 100.0:
        raise argparse.ArgumentTypeError("%r is more than 100" % text)
    return value


class _Teller:
    """The printer of what begins and ends: for people, or as JSON for scripts.

    Scripts get a call's number among the calls alone, and null for a message: a scenario's events name calls by it.
    """

    def __init__(self, args: argparse.Namespace, planned: List[Planned]) -> None:
        self._args = args
        self._count = len(planned)
        calls = [entry.number for entry in planned if not isinstance(entry.call, SentMessage)]
        self._numbers = {number: place for place, number in enumerate(calls)}

    def tell(self, entry: Planned, at: float, reply: Optional[ServiceReply]) -> None:
        """Print that a call or message begins (no reply yet) or ends, ``at`` monotonic s."""
        if self._args.progress:
            event = {"call": self._numbers.get(entry.number), "service": entry.call.service,
                     "event": "start" if reply is None else "end", "monotonic_s": at,
                     "success": None if reply is None else reply.success}
            print(json.dumps(event), flush=True)
        elif reply is not None and not self._args.quiet:
            print("%d/%d %s: %s" % (entry.number + 1, self._count, entry.call.words,
                                    "succeeded" if reply.success else "refused: %s" % reply.text), flush=True)


def run(args: argparse.Namespace) -> int:
    """Make the calls; 0 all made, 1 stopped or refused."""
    log = load_run(args.log, with_contents=False)
    inputs = inputs_of(args.log, log)
    if not inputs:
        raise BagError("%s holds no service calls, and nothing else that moved an arm: record the topic service_calls"
                       % args.log)
    if args.speed_limit < 100.0 and args.time_scale != 1.0:
        raise UsageError("--speed-limit and --time-scale do not go together")
    stretch = 100.0 / args.speed_limit / args.time_scale
    timed = sorted({one.short_name for one in inputs if isinstance(one, SentMessage)})
    if stretch != 1.0 and timed:
        raise UsageError("%s has %s, which go by their own time: no --speed-limit, and no --time-scale" % (
            args.log, ", ".join(timed)))
    fast = sorted({one.service for one in inputs if not isinstance(one, SentMessage) and one.short_name in _OWN_SPEED})
    if args.speed_limit < 100.0 and fast:
        raise UsageError("%s has %s, after which the arm moves as fast as it may, for no call tells that speed: no "
                         "--speed-limit" % (args.log, ", ".join(fast)))
    planned = plan(inputs, stretch)
    if args.dry_run:
        print(as_text(planned))
        return 0
    _require_same(args, clock_trouble(log))
    _require_same(args, unchecked_starts(log, inputs))
    uncaused = uncaused_motions(log, inputs, {})
    _require_same(args, [Difference("motion", in_words(uncaused))] if uncaused else [])
    return _play(args, log, planned)


def _play(args: argparse.Namespace, log: Run, planned: List[Planned]) -> int:
    try:
        from .driver_client import DriverClient
        from .message_player import MessagePlayer
    except ImportError as error:
        raise BagError("replay-commands needs ROS: %s" % error) from error
    from jaka_bag.live.graph import RemoteNode, master_uri
    try:
        with RemoteNode(master_uri(), "/jaka_bag_replay") as master:
            master.call("getPid")
    except (JakaBagError, OSError) as error:
        raise BagError("no ROS master: %s" % error) from error
    cancelled = Flag()
    client = DriverClient("jaka_bag_replay", cancelled, args.speed_limit / 100.0)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: cancelled.set())
    messages = [one.call for one in planned if isinstance(one.call, SentMessage)]
    sender = MessagePlayer(lambda: "interrupted" if cancelled.is_set() else None)
    nodes: List[str] = []
    try:
        client.wait_for(sorted({call.service for call in log.calls}), args.wait)
        nodes = sorted({call.topic.rsplit("/", 1)[0] for call in log.calls}
                       | {topic.rsplit("/", 1)[0] for topic in log.joints if messages and topic.endswith(_JOINTS)})
        sender.advertise(messages, args.wait)
        if not args.begin_at_stdin:
            for node in nodes:
                _check_conditions(args, client, log, node)
        _make_calls(args, log, planned, client, sender, cancelled)
        return 0
    except ReplayStopped as error:
        for problem in [str(error), *client.stop_all(nodes)]:
            print("jaka_bag replay-commands: error: %s" % problem, file=sys.stderr)
        return 1
    finally:
        sender.close()
        client.close()


def _make_calls(args: argparse.Namespace, log: Run, planned: List[Planned], client: Any, sender: Any,
                cancelled: Flag) -> None:
    """Move to the start where that is wanted, and make all calls."""
    if not args.begin_at_stdin:  # then a recorded controller says where the arm stands
        for topic, track in log.joints.items():
            start = track.beginning().value
            if topic.endswith(_JOINTS) and len(start):
                _check_start(args, client, topic, start[0].tolist())
                _check_pose(args, client, log, topic)
    begin = time.monotonic()
    if args.begin_at_stdin:
        print(json.dumps({"event": "ready"}), flush=True)
        begin = float(_line_of_stdin(cancelled) or begin)
    if args.progress:
        print(json.dumps({"event": "begin", "monotonic_s": begin}), flush=True)
    player = CommandPlayer(planned, lambda one: (sender if isinstance(one, SentMessage) else client).perform(one),
                           _Teller(args, planned).tell, args.after_previous, cancelled)
    player.run(begin)
    if not args.quiet and not args.progress:
        sent = sum(isinstance(one.call, SentMessage) for one in planned)
        print("%d calls made, %sat most %.1f ms late" % (
            len(planned) - sent, "%d messages sent, " % sent if sent else "", 1e3 * max(player.lateness)))


def _line_of_stdin(cancelled: Flag) -> str:
    """Wait for the next line, without a thread that would block the process's end; raise ReplayStopped on a cancel."""
    while not select.select([sys.stdin], [], [], _LOOK_S)[0]:
        if cancelled.is_set():
            raise ReplayStopped("interrupted")
    return sys.stdin.readline()


def _require_same(args: argparse.Namespace, found: List[Difference], node: str = "") -> None:
    """Raise BagError for what differs and was not allowed."""
    forbidden = [difference for difference in found if difference.key not in args.anyway]
    if forbidden:
        raise BagError("%s%s (%s)" % (node and node + ": ", "; ".join([difference.text for difference in forbidden]),
                                      " ".join(["--anyway " + difference.key for difference in forbidden])))


def _check_conditions(args: argparse.Namespace, client: Any, log: Run, node: str) -> None:
    before = conditions_of_log(args.log, node, log_begins_ns(log))
    now = client.conditions(node, _TOLD_WITHIN_S)
    _require_same(args, differences(before, now), node)
    missing = untold(before, now, _pose_of(log, node) is not None)
    if missing and not args.quiet and not args.progress:
        print("%s: not compared, for it is not told: %s" % (node, ", ".join(missing)), flush=True)


def _pose_of(log: Run, node: str) -> Optional[LongTrack]:
    """Return the tool's recorded poses; None where they are not compared, as they, or the joints, are not there."""
    tracks = [track for track in (log.poses.get(node + "/tool_position"), log.joints.get(node + _JOINTS))
              if track is not None and track.facts.finite_count]
    return tracks[0] if len(tracks) == 2 else None


def _check_pose(args: argparse.Namespace, client: Any, log: Run, topic: str) -> None:
    """Compare where the tool is at the joints of the log's begin."""
    joints = log.joints[topic]
    tool = _pose_of(log, topic.rsplit("/", 1)[0])
    if tool is None:
        return
    pose = tool.beginning()
    stood = joints.at(pose.time[:1])[0]
    before = ToolPlace(stood.tolist(), pose.value[0].tolist(), tool.frames)
    _require_same(args, pose_difference(before, client.place(topic, tool.topic, args.wait)), topic.rsplit("/", 1)[0])


def _check_start(args: argparse.Namespace, client: Any, topic: str, start: List[float]) -> None:
    end = time.monotonic() + args.wait
    here = client.joint_position(topic, args.wait)
    if len(here) != len(start):
        raise BagError("%s has %d joints, %d in the log" % (topic, len(here), len(start)))
    unknown = [number for number, value in enumerate(here, 1) if not math.isfinite(value)]
    if unknown:
        raise BagError("%s: where joint %d stands is no number" % (topic, unknown[0]))
    away = [abs(a - b) for a, b in zip(here, start)]
    if max(away) <= args.start_tolerance:
        return
    if not args.go_to_start:
        raise BagError("%s: joint %d stands %.4f rad from where the log began; --go-to-start moves the arm there"
                       % (topic, away.index(max(away)) + 1, max(away)))
    client.move_to(topic.rsplit("/", 1)[0], start, _START_SPEED, _START_ACCELERATION)
    while True:
        here = client.joint_position(topic, max(end - time.monotonic(), 1.0))
        if all(abs(a - b) <= args.start_tolerance for a, b in zip(here, start)):
            return
        if time.monotonic() > end:
            raise BagError("%s: the arm did not reach where the log began" % topic)
