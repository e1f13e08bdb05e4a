"""``jaka_bag record``: its three modes; files, snapshots of messages in memory, a file around each accident."""
import argparse
import contextlib
import dataclasses
import os
import time
from pathlib import Path
from typing import Callable, Dict, Optional, Tuple

from jaka_bag.cli import quantities, record
from jaka_bag.cli.notices import Notices
from jaka_bag.cli.record import LogRecording
from jaka_bag.errors import BagError, OutputExists, UsageError
from jaka_bag.live.graph import master_uri
from jaka_bag.live.names import anonymous_name
from jaka_bag.live.rolling_files import RollingFiles
from jaka_bag.live.stream_account import TopicDrops
from jaka_bag.live.topic_selection import TopicSelection
from jaka_bag.log_records import ACCIDENT
from jaka_bag.operations.recover import Recovered, recover
from jaka_bag.operations.signature import sign
from jaka_bag.output_file import is_being_written

from ..evidence import Evidence
from ..expression import Expression
from ..files import Keep, cut_off_files, set_aside
from ..recorder import ITEM_BYTES, BlackBox, Window, started_line
from ..service import TriggerService
from ..snapshots import Snapshots
from ..triggers import Trigger, TriggerWatch

EPILOG = """\
Messages are stored as they come over the wire, whatever their type. While it is written the file is called
NAME.mcap.active; SIGINT or SIGTERM finish it and give it its name. After a power cut or kill -9 it can be read as it
is, or made whole with 'jaka_bag recover'; at most the newest second is missing.

Log times are the kernel's times of receipt (--stamp). Where the parameter /use_sim_time is true they are the times of
/clock, as with rosbag record; messages that come before the first /clock get its time, or 1 ns where it does not come
within 2 s. What stays in memory, and for how long, goes by the host's clock all the same.

--state-log records the whole interface of exactly one driver: every topic that jaka_driver of the namespace
(__ns:=/left or ROS_NAMESPACE) publishes, and every one that others send goals, trajectories, jog or servo targets to;
besides joint_states, tf, tf_static and diagnostics of the namespace. Of the global topics /tf, /tf_static and
/diagnostics it takes the messages of the namespace's nodes, and no others.

What was lost is always said at the end, by topic: skipped header.seq numbers, the publishers' own bus statistics, and
what the recorder itself had to throw away; an .mcap holds the same account in its metadata, and the ROS parameters
at the start as an attachment.

--snapshot keeps the newest messages in memory and writes them to a file of their own at each SIGUSR1.

--black-box DIR keeps the newest messages in memory and writes a file that is complete in itself around each accident:
docs/state_logs.md tells what sets it off. jaka_bag report FILE shows what happened.
NAME:=VALUE words remap topics; __name:=, __ns:= are known.

examples:
  jaka_bag record --state-log -O run.mcap
  jaka_bag record -a -x '/camera/.*' --split --size 1G --max-splits 10 -o cell
  jaka_bag record --state-log --black-box /var/log/arm --before 60s --after 20s

Exit code: 0 done, 1 failed or cut short, 2 usage.
"""

NODE = "jaka_black_box"
"""Name of the node; with a fixed name, so that its service has one."""
_DRIVER = "jaka_driver"
_SERVICE = "~trigger"
_BEFORE_S, _AFTER_S = 60.0, 20.0
"""Time, s, that is kept before and after a trigger: what led to it, and how the arm came to rest."""
_CLOCK_WAIT_S = 2.0
"""Longest wait of messages for the first ``/clock``, s: triggers are looked for behind it."""
_TRIGGERS = ("error", "emergency stop", "collision", "failed service call", "diagnostics ERROR", "service ~trigger",
             "SIGUSR1")
_MOST_LOSSES = 5
"""Losses of a file that a line names."""
_ALONE = ("output_name", "output_prefix", "split", "size", "duration", "snapshot", "limit", "max_splits")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag record`` to a parser."""
    record.add_arguments(parser)
    group = parser.add_argument_group("snapshots")
    group.add_argument("--snapshot", type=quantities.duration, metavar="TIME",
                       help="write the newest TIME of messages at each SIGUSR1, and only then")
    group = parser.add_argument_group("black box")
    group.add_argument("--black-box", type=quantities.given, metavar="DIR",
                       help="keep the newest messages in memory; write a file to DIR around each accident")
    add = group.add_argument
    add("--before", type=quantities.duration, metavar="TIME", help="from so long before it (default 60s)")
    add("--after", type=quantities.duration, metavar="TIME", help="until so long after it (default 20s)")
    add("--trigger", action="append", default=[], metavar="CONDITION",
        help="also where this becomes true, as 'TOPIC.field > 3'; may be repeated")
    add("--keep", type=quantities.count, metavar="N", help="keep the newest N files in DIR (default all)")
    add("--keep-bytes", type=quantities.size, metavar="SIZE",
        help="keep the newest files in DIR that have this size in all (k, M, G)")


def check(args: argparse.Namespace) -> None:
    """Refuse options that do not go together; set the defaults of those that do.

    Raises:
        UsageError: They do not.
    """
    if not args.black_box:
        for name in ("before", "after", "trigger", "keep", "keep_bytes"):
            if getattr(args, name) not in (None, []):
                raise UsageError("--%s needs --black-box DIR" % name.replace("_", "-"))
        return
    for name in _ALONE:
        if getattr(args, name):
            raise UsageError("--black-box and --%s do not go together" % name.replace("_", "-"))
    if args.format == "bag":
        raise UsageError("a black box writes .mcap: a .bag has no place for what makes its files complete")
    if not args.buffsize:
        raise UsageError("a black box needs a limit of its memory: --buffsize MB")
    args.before = _BEFORE_S if args.before is None else args.before
    args.after = _AFTER_S if args.after is None else args.after
    args.output_name = str(Path(args.black_box) / "blackbox")


def run(args: argparse.Namespace) -> int:
    """Record until SIGINT, SIGTERM or a limit; 0 when all went well."""
    check(args)
    with Notices("jaka_bag record", args.quiet) as console:
        if args.black_box:
            return record_black_box(LogRecording(args, NODE, console))
        recorder = LogRecording(args, anonymous_name("jaka_bag_record"), console)
        return record.record(recorder) if args.snapshot is None else record_snapshots(recorder)


def record_snapshots(recorder: LogRecording) -> int:
    """Keep the newest messages in memory and write a file at each SIGUSR1; return the exit code."""
    newest_s = recorder.args.snapshot
    snapshots = Snapshots(recorder, newest_s)
    recorder.prepare(snapshots.begin)
    if not recorder.run("memory, the newest %g s" % newest_s, snapshots.trigger):
        return 1
    recorder.sign()
    return recorder.account()


def record_black_box(recorder: LogRecording) -> int:
    """Keep the newest messages in memory and write a file around each accident; return the exit code."""
    box = Assembly(recorder)
    recorder.prepare(box.open, box.selection(), box.memory_bytes, ITEM_BYTES, _CLOCK_WAIT_S)
    if not recorder.run("memory, the newest %g s" % recorder.args.before, box.on_signal, box):
        return 1
    return max(recorder.account(), 1 if box.failures else 0)


class Assembly:
    """The parts of one black box.

    Args:
        recorder: The recording; the names of its files are the black box's own.

    Raises:
        UsageError: The folder cannot be made or written, or a condition is not understood.
    """

    def __init__(self, recorder: LogRecording) -> None:
        args, names, console = recorder.args, recorder.names, recorder.console
        self._recorder = recorder
        self._names = names
        self._console = console
        self._keep = Keep(args.keep or 0, args.keep_bytes or 0)
        self._folder = Path(args.black_box)
        self._expressions = [Expression(text, names.resolve) for text in args.trigger]
        self.memory_bytes = max(args.buffsize // 2, 1)
        self._window = Window(args.before, args.after, self.memory_bytes)
        self._watch = TriggerWatch(self._expressions, console.always)
        self._evidence = Evidence(master_uri(), names.node, names.resolve(_DRIVER), self._diagnostics, self._look_after)
        self._service: Optional[TriggerService] = None
        self._box: Optional[BlackBox] = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError("cannot make the folder %s: %s" % (self._folder, error.strerror)) from error
        if not os.access(str(self._folder), os.W_OK | os.X_OK):
            raise UsageError("cannot write into the folder %s" % self._folder)

    @property
    def failures(self) -> int:
        """Files that could not be begun or finished."""
        return 0 if self._box is None else self._box.failures

    def selection(self) -> TopicSelection:
        """Return the topics to be recorded, those of the conditions among them."""
        selection = self._recorder.selection
        more = tuple(dict.fromkeys(topic for expression in self._expressions for topic in expression.topics
                                   if topic not in selection.names))
        return dataclasses.replace(selection, names=selection.names + more)

    def open(self) -> BlackBox:
        """Return the black box itself; called when recording begins."""
        self._make_leftovers_whole()
        self._box = BlackBox(self._folder, self._window, self._watch, self._open_file, self._recorder.writer.streams,
                             time.monotonic, self._log_time, self._console.always, self._keep, self._before_end,
                             self._after_end)
        triggers = list(_TRIGGERS) + [expression.text for expression in self._expressions]
        self._console.say(started_line(self._window, self._folder, triggers))
        return self._box

    def _log_time(self) -> int:
        writer = self._recorder.writer
        return (writer.clock or 0) if writer.is_simulated_time else time.time_ns()

    def _open_file(self, stem: Path, drops: Callable[[], Dict[str, TopicDrops]]) -> RollingFiles:
        facts = dict(self._recorder.facts, before_s="%g" % self._window.before_s, after_s="%g" % self._window.after_s)
        files = RollingFiles(dataclasses.replace(self._recorder.settings, stem=stem), facts,
                             self._evidence.attachments(), self._recorder.writer.streams, self._console.say, drops)
        files.add_metadata(ACCIDENT, self._evidence.facts())
        return files

    def start(self, node_uri: str) -> None:
        """Offer the service, collect evidence."""
        self._service = TriggerService(self._names.resolve(_SERVICE), self._names.node, node_uri, self._on_call)
        self._service.register()
        self._evidence.start()

    def close(self) -> None:
        """End what ``start`` began."""
        self._evidence.close()
        if self._service is not None:
            self._service.close()

    def on_signal(self) -> None:
        """Request a file of the black box, on SIGUSR1."""
        if self._box is not None:
            self._box.trigger(Trigger("signal", "SIGUSR1", ""))

    def _on_call(self) -> Tuple[bool, str]:
        assert self._box is not None
        name = self._names.resolve(_SERVICE)
        return self._box.trigger(Trigger("service", "%s was called" % name, name)).wait()

    def _look_after(self) -> None:
        if self._service is not None:
            self._service.register()

    def _diagnostics(self) -> Dict[str, Dict[str, object]]:
        return dict(self._watch.diagnostics)

    def _before_end(self, files: RollingFiles) -> None:
        files.add_attachment(self._evidence.last_attachment())
        files.add_metadata(ACCIDENT + ".end", self._evidence.facts())

    def _after_end(self, path: Path) -> None:
        if self._recorder.key is not None:
            self._console.say("signed: %s" % sign(path, self._recorder.key))

    def _make_leftovers_whole(self) -> None:
        """Finish the files of black boxes that were killed; what is not whole stays, as evidence, by another name."""
        for path in cut_off_files(self._folder):
            target = path.with_suffix("")
            if is_being_written(path):
                continue
            try:
                result = recover(path, target)
            except OutputExists:
                continue
            except (BagError, OSError) as error:
                self._console.always("%s was cut off: %s" % (path, error))
                continue
            if result.is_whole:
                with contextlib.suppress(OSError):
                    path.unlink()
                self._console.always("%s was cut off; made whole: %d messages" % (target, result.messages))
            else:
                with contextlib.suppress(OSError):
                    path = set_aside(path)
                self._console.always("%s was cut off; recovered, not whole: %d messages; lost: %s; what was left is %s"
                                     % (target, result.messages, _text_of(result), path))
            try:
                self._after_end(target)
            except (BagError, OSError) as error:
                self._console.always("error: %s" % error)


def _text_of(result: Recovered) -> str:
    """Return the losses of a recovery as text, the first few of many."""
    losses = [loss.describe() for loss in result.losses]
    more = ["and %d more" % (len(losses) - _MOST_LOSSES)] if len(losses) > _MOST_LOSSES else []
    return "; ".join(losses[:_MOST_LOSSES] + more) or "%d messages" % ((result.expected or 0) - result.messages)
