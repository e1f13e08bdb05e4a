"""``jaka_bag record``: recording into files, and the parts that the modes with messages in memory share.

Those modes, and with them the subcommand, are in ``jaka_blackbox``.
"""
import argparse
import contextlib
import functools
import json
import os
import platform
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Optional, Protocol

from ..driver_interface import PARAMETERS_NAME
from ..errors import JakaBagError, UsageError
from ..live.graph import RemoteNode, master_uri
from ..live.names import NodeNames, node_names, split_remappings
from ..live.rolling_files import Attachment, FileSettings, RollingFiles
from ..live.session import RecordingSession, as_yaml, read_parameter, wait_for_master
from ..live.stream_account import TopicDrops, drops_by_topic
from ..live.subscriber import Subscriber, accept_all
from ..live.topic_selection import TopicSelection, is_of_namespace, state_log_selection
from ..live.writer_thread import CLOCK_WAIT_S, MessageFiles, WriterThread
from ..messages.selection import compile_patterns
from ..operations.signature import load_private_key, sign
from . import quantities
from .notices import Notices, write_account


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that all modes have to a parser."""
    add = parser.add_argument
    add("topics", nargs="*", metavar="TOPIC", help="topics to record; with -e regular expressions")
    what = parser.add_argument_group("what to record")
    what.add_argument("-a", "--all", action="store_true", help="every topic, also those that appear later")
    what.add_argument("-e", "--regex", action="store_true", help="TOPICs are regular expressions for whole names")
    what.add_argument("-x", "--exclude", action="append", default=[], metavar="REGEX",
                      help="leave out topics whose whole name matches; may be repeated")
    what.add_argument("--node", help="every topic that this node subscribes to")
    what.add_argument("--state-log", action="store_true", help="exactly the topics of one driver, see below")
    what.add_argument("-l", "--limit", type=quantities.count, default=0, metavar="N",
                      help="N messages of each topic (0: no limit)")
    where = parser.add_argument_group("where to")
    where.add_argument("-o", "--output-prefix", metavar="PREFIX", help="name is PREFIX and the date")
    where.add_argument("-O", "--output-name", metavar="NAME", help="name; .bag or .mcap at its end chooses the format")
    where.add_argument("--format", choices=("mcap", "bag"), help="default mcap")
    where.add_argument("--force", action="store_true", help="overwrite files of the same name")
    where.add_argument("--split", action="store_true", help="begin a new, numbered file at --size or --duration")
    where.add_argument("--size", type=quantities.megabytes, metavar="MB", help="size of a file; without --split: stop")
    where.add_argument("--duration", type=quantities.duration, metavar="TIME",
                       help="length of a file (2m, 5s, 1:30); without --split: stop")
    where.add_argument("--max-splits", type=quantities.count, default=0, metavar="N",
                       help="keep the newest N files (0: all)")
    where.add_argument("-L", "--min-space", type=quantities.size, default=64 << 20, metavar="SIZE",
                       help="stop when the disk has less left (k, M, G; default 64M)")
    how = parser.add_argument_group("how")
    codec = how.add_mutually_exclusive_group()
    codec.add_argument("--zstd", nargs="?", const="", metavar="LEVEL", help="zstd (mcap; the default there, level 1)")
    codec.add_argument("--lz4", dest="codec", action="store_const", const="lz4", help="lz4")
    codec.add_argument("-j", "--bz2", dest="codec", action="store_const", const="bz2", help="bz2 (bag)")
    codec.add_argument("--no-compression", dest="codec", action="store_const", const="none",
                       help="none (the default for bag)")
    how.add_argument("-b", "--buffsize", type=quantities.megabytes, default=256 << 20, metavar="MB",
                     help="messages that may wait for the disk (default 256; 0: no limit)")
    how.add_argument("--chunksize", type=quantities.count, default=1024, metavar="KB", help="chunk size (default 1024)")
    how.add_argument("--chunk-age", type=quantities.duration, default=1.0, metavar="TIME",
                     help="a chunk is written when its first message is this old (default 1s)")
    how.add_argument("--fsync", type=quantities.duration, default=1.0, metavar="TIME",
                     help="force to the disk this often (default 1s; 0: never)")
    how.add_argument("--repeat-latched", action="store_true",
                     help="begin each further file with the newest message of each latched publisher")
    how.add_argument("--tcpnodelay", action="store_true", help="ask publishers to send each message at once")
    how.add_argument("--stamp", choices=("receive", "kernel"), default="kernel",
                     help="log time: when the kernel got the message (default), or when it was read")
    how.add_argument("--report", metavar="FILE", help="write the account of the recording as JSON")
    how.add_argument("-q", "--quiet", action="store_true", help="say only what went wrong or was lost")
    how.add_argument("--sign", type=quantities.given, metavar="KEY",
                     help="write NAME.sig for each finished file: Ed25519, KEY in PEM")


def _selection(args: argparse.Namespace, names: NodeNames) -> TopicSelection:
    compile_patterns(args.exclude)
    exclude = compile_patterns(["|".join("(?:%s)" % one for one in args.exclude)])[0] if args.exclude else None
    if args.state_log:
        if args.topics or args.all or args.regex or args.node:
            raise UsageError("--state-log chooses the topics itself")
        return state_log_selection(names, exclude)
    node = names.resolve(args.node) if args.node else None
    if args.regex and not args.topics:
        raise UsageError("-e needs regular expressions")
    if not (args.topics or args.all or node):
        raise UsageError("nothing to record: give topics, -a, -e, --node or --state-log")
    if args.regex:
        patterns = tuple(compile_patterns(args.topics))
        return TopicSelection((), args.all, patterns, exclude, node)
    return TopicSelection(tuple(names.resolve(topic) for topic in args.topics), args.all, (), exclude, node)


def _stem(args: argparse.Namespace) -> Path:
    if args.output_name is not None:
        path = Path(args.output_name)
        if path.suffix in (".bag", ".mcap"):
            if args.format not in (None, path.suffix[1:]):
                raise UsageError("--format %s contradicts -O %s" % (args.format, args.output_name))
            args.format = path.suffix[1:]
            path = path.with_suffix("")
        if not path.name:
            raise UsageError("-O needs a name")
        return path
    date = time.strftime("%Y-%m-%d-%H-%M-%S")
    if args.output_prefix is None:
        return Path(date)
    prefix = args.output_prefix
    return Path(prefix + date if prefix.endswith("/") else "%s_%s" % (prefix, date))


def _settings(args: argparse.Namespace) -> FileSettings:
    stem = _stem(args)
    container = args.format or "mcap"
    level = int(args.zstd) if args.zstd else None
    compression = args.codec or ("zstd" if args.zstd is not None or container == "mcap" else "none")
    if args.split and args.size is None and args.duration is None:
        raise UsageError("--split needs --size or --duration")
    if args.max_splits and not args.split:
        raise UsageError("--max-splits needs --split")
    return FileSettings(stem, container, compression, level, args.chunksize << 10, args.chunk_age, args.fsync,
                        args.size, args.duration if args.split else None, args.split, args.max_splits, args.min_space,
                        args.repeat_latched, args.force)


def _take_zstd_level(args: argparse.Namespace) -> None:
    """Split ``--zstd TOPIC`` into ``--zstd`` and a topic: a level is a number."""
    if args.zstd and not args.zstd.isdecimal():
        args.topics.insert(0, args.zstd)
        args.zstd = ""


class Companion(Protocol):
    """A task that runs beside a recording."""

    def start(self, node_uri: str) -> None:
        """Begin; the node is there, at this URI."""

    def close(self) -> None:
        """End what has begun."""


def _merged(before: Dict[str, Any], now: Dict[str, Any]) -> Dict[str, Any]:
    """Return a tree of parameters with a later one over it."""
    return {**before, **{name: _merged(before[name], value) if isinstance(value, dict) and isinstance(
        before.get(name), dict) else value for name, value in now.items()}}


class LogRecording:
    """One recording that a command line asks for: who the node is, what it records, and how it ends.

    Each mode sets where messages go (``prepare``), runs it, and prints its account.

    Args:
        args: The command line.
        node: Name of the node where the command line gives none.
        console: Printer of notices.

    Attributes:
        names: Names of the node.
        selection: The topics to record.
        settings: Settings for the files.
        facts: Facts of the recording, stored in each file.
        attachments: Files stored in each file.
        key: Private key that finished files are signed with; None: they are not.
        console: Printer of notices.
        writer: Takes the messages; from ``prepare`` on.
        failure: Error that ended the recording before its time.

    Raises:
        UsageError: Options contradict each other.
        BagError: The key cannot be read.
    """

    writer: WriterThread
    _session: RecordingSession

    def __init__(self, args: argparse.Namespace, node: str, console: Notices) -> None:
        _take_zstd_level(args)
        args.topics, remappings = split_remappings(args.topics)
        self.args = args
        self.names = node_names(node, remappings, os.environ)
        self.selection = _selection(args, self.names)
        self.settings = _settings(args)
        self.key = load_private_key(args.sign) if args.sign else None
        self.facts = {"program": "jaka_bag record", "host": platform.node(), "node": self.names.node,
                      "master": master_uri(), "arguments": json.dumps(sys.argv[1:]),
                      "started": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        self.attachments: List[Attachment] = []
        self._parameters: Dict[str, Any] = {}
        self.console = console
        self.failure: Optional[Exception] = None
        self._on_usr1: Optional[Callable[[], None]] = None

    def prepare(self, open_files: Callable[[], MessageFiles], selection: Optional[TopicSelection] = None,
                buffer_bytes: Optional[int] = None, item_bytes: int = 0, clock_wait_s: float = CLOCK_WAIT_S) -> None:
        """Set where messages go.

        Args:
            open_files: Makes the receiver of messages; called when the recording begins.
            selection: The topics, where they are others than the command line's.
            buffer_bytes: Bytes of messages that may wait; None for the command line's limit.
            item_bytes: Cost of a waiting message besides its payload, byte.
            clock_wait_s: Longest wait of messages for the first ``/clock``.
        """
        args = self.args
        self.writer = WriterThread(open_files, args.buffsize if buffer_bytes is None else buffer_bytes,
                                   self.console.always, self._end, False, args.limit, item_bytes, clock_wait_s)
        self._session = RecordingSession(
            self.writer, selection or self.selection,
            is_of_namespace(self.names.namespace) if args.state_log else accept_all, self.console.always,
            None if args.split else args.duration, self._dump_parameters)

    def open_log(self, settings: Optional[FileSettings] = None) -> RollingFiles:
        """Begin the files of the recording, or those of other settings."""
        return RollingFiles(settings or self.settings, self.facts, self.attachments, self.writer.streams,
                            self.console.say)

    def run(self, where: str, on_usr1: Optional[Callable[[], None]] = None,
            companion: Optional[Companion] = None) -> bool:
        """Record until SIGINT, SIGTERM, SIGHUP or a limit; what ended it before its time is ``failure``.

        Args:
            where: Description, for the user, of the place where messages go.
            on_usr1: Called at SIGUSR1.
            companion: Runs while the node is there.

        Returns:
            False where it was ended before a master came.
        """
        self._on_usr1 = on_usr1
        with _signals(self._on_signal, on_usr1 is not None):
            master = RemoteNode(master_uri(), self.names.node)
            if not wait_for_master(master, self._session.stop, self.console.always):
                return False
            self.writer.is_simulated_time = bool(read_parameter(master, "/use_sim_time"))
            self.facts["log_time"] = "/clock" if self.writer.is_simulated_time else self.args.stamp
            self._dump_parameters(master)
            master.close()
            try:
                self._session.run(functools.partial(self._connect, where, companion), self.writer.is_simulated_time)
            except Exception as error:  # what was recorded before is signed and told of
                self.failure = error
                if not isinstance(error, (JakaBagError, OSError)):
                    traceback.print_exc()
            finally:
                if companion is not None:
                    companion.close()
        return True

    def _dump_parameters(self, master: RemoteNode) -> None:
        """Add the parameters that there are now: those of a driver that starts after the recorder come with it.

        A file that has begun gets them once more where they have changed, when it is closed. What a master forgets when
        it is started again stays.
        """
        self._parameters = _merged(self._parameters, read_parameter(master, "/") or {})
        found = Attachment(PARAMETERS_NAME, as_yaml(self._parameters), "application/yaml")
        self.attachments[:] = [item for item in self.attachments if item.name != found.name] + [found]

    def _connect(self, where: str, companion: Optional[Companion]) -> Subscriber:
        subscriber = Subscriber(self.names, self.writer.take, self._session.open_stream, self.console.always,
                                self._end, self.args.tcpnodelay, self.args.stamp == "kernel")
        if companion is not None:
            companion.start(subscriber.uri)
        self.console.say("recording to %s, node %s" % (where, self.names.node))
        return subscriber

    def _end(self, reason: str) -> None:
        self._session.end(reason)

    def _on_signal(self, number: int, frame: Any) -> None:
        if number == signal.SIGUSR1 and self._on_usr1 is not None:
            self._on_usr1()
        else:
            self._session.end(signal.Signals(number).name)

    def sign(self) -> None:
        """Sign the finished files where that is asked for."""
        for path in self.writer.finished_paths if self.key is not None else ():
            try:
                self.console.say("signed: %s" % sign(path, self.key))
            except (JakaBagError, OSError) as error:  # somebody may have moved it away
                if self.failure is not None:
                    self.console.always("error: %s" % error)
                self.failure = self.failure or error

    def account(self) -> int:
        """Print files, counts and all that was lost, write them to the file of ``--report``; return the exit code."""
        drops = drops_by_topic(self.writer.streams())
        self._tell(drops)
        if self.args.report:
            write_account(self.args.report, {
                "files": self.writer.finished_paths, "messages": self.writer.messages,
                "end": self._session.end_reason, "error": None if self.failure is None else str(self.failure),
                "untimed": self.writer.untimed,
                "topics": {topic: dict(one._asdict(), lossy=one.is_lossy) for topic, one in drops.items()}})
        if self.failure is not None:
            self.console.always("error: %s" % self.failure)
        return 0 if self.failure is None else 1

    def tell_absent(self) -> int:
        """Print the topics of the command line that gave no message; return 1 where there was no message at all."""
        drops = drops_by_topic(self.writer.streams())
        silent = {topic for topic, account in drops.items() if not account.received}
        for topic in () if self.args.state_log or self.failure is not None else self.selection.names:
            if topic in silent:
                self.console.always("no message on %s: its publisher sent none" % topic)
            elif topic not in drops:
                self.console.always("no message on %s: nobody published it" % topic)
        if self.writer.messages or self.failure is not None:
            return 0
        self.console.always("error: nothing was recorded, no message came")
        return 1

    def _tell(self, drops: Dict[str, TopicDrops]) -> None:
        console = self.console
        if self._session.end_reason:
            console.say("ended: %s" % self._session.end_reason)
        for path in self.writer.finished_paths:
            console.say("wrote %s" % path)
        if self.writer.untimed:
            console.always("%d messages came before the first /clock" % self.writer.untimed)
        for topic, account in drops.items():
            line = "%s: %d messages, %s" % (topic, account.received, account.describe())
            if account.is_lossy:
                console.always("LOST on " + line)
            else:
                console.say(line)
            if len(account.types) > 1:
                console.always("%s has publishers of different types: %s" % (
                    topic, ", ".join("%s (md5 %s)" % kind for kind in account.types)))


@contextlib.contextmanager
def _signals(handler: Callable[[int, Any], None], with_usr1: bool) -> Iterator[None]:
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, *([signal.SIGUSR1] if with_usr1 else [])]
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def record(recorder: LogRecording) -> int:
    """Record into one file, or one after the other; return the exit code."""
    recorder.prepare(recorder.open_log)
    if not recorder.run(str(recorder.settings.path(0))):
        return 1
    recorder.sign()
    code = recorder.account()
    return recorder.tell_absent() or code
