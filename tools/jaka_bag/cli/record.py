"""``jaka_bag record``: the command line of the recorder."""
import argparse
import contextlib
import dataclasses
import json
import os
import platform
import signal
import sys
import time
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Optional

from ..errors import JakaBagError, UsageError
from ..live.graph import RemoteNode, master_uri
from ..live.names import NodeNames, anonymous_name, node_names, split_remappings
from ..live.rolling_files import Attachment, FileSettings, RollingFiles
from ..live.session import Session, parameter_dump, read_parameter, wait_for_master
from ..live.stream_account import TopicDrops, drops_by_topic
from ..live.subscriber import Subscriber, accept_all
from ..live.topic_selection import TopicSelection, is_of_namespace, state_log_topics
from ..live.writer_thread import MessageFiles, WriterThread
from ..messages.selection import compile_patterns
from ..operations.signature import load_private_key, sign
from . import quantities
from .evidence import black_box
from .notices import Notices, write_account

EPILOG = """\
Messages are stored as they come over the wire, whatever their type. While it is written the file is called
NAME.mcap.active; SIGINT or SIGTERM finish it and give it its name. After a power cut or kill -9 it can be read as it
is, or made whole with 'jaka_bag recover'; at most the newest second is missing.

Log times are the kernel's times of receipt (--stamp). Where the parameter /use_sim_time is true they are the times of
/clock, as with rosbag record; messages that come before the first /clock get its time.

--state-log records exactly one driver: jaka_driver/tool_position, joint_position, robot_states and service_calls,
and joint_states, tf, tf_static and diagnostics, all of the namespace (__ns:=/left or ROS_NAMESPACE). Of the global
topics /tf, /tf_static and /diagnostics it takes the messages of the namespace's nodes, and no others.

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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag record``."""
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
    how.add_argument("--snapshot", type=quantities.duration, metavar="TIME",
                     help="write the newest TIME of messages at each SIGUSR1, and only then")
    how.add_argument("--repeat-latched", action="store_true",
                     help="begin each further file with the newest message of each latched publisher")
    how.add_argument("--tcpnodelay", action="store_true", help="ask publishers to send each message at once")
    how.add_argument("--stamp", choices=("receive", "kernel"), default="kernel",
                     help="log time: when the kernel got the message (default), or when it was read")
    how.add_argument("--report", metavar="FILE", help="write the account of the recording as JSON")
    how.add_argument("-q", "--quiet", action="store_true", help="say only what went wrong or was lost")
    how.add_argument("--sign", type=quantities.given, metavar="KEY",
                     help="write NAME.sig for each finished file: Ed25519, KEY in PEM")
    black_box.add_options(parser)


def _selection(args: argparse.Namespace, names: NodeNames) -> TopicSelection:
    compile_patterns(args.exclude)
    exclude = compile_patterns(["|".join("(?:%s)" % one for one in args.exclude)])[0] if args.exclude else None
    if args.state_log:
        if args.topics or args.all or args.regex or args.node:
            raise UsageError("--state-log chooses the topics itself")
        return TopicSelection(state_log_topics(names), exclude=exclude)
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
    """``--zstd TOPIC`` is ``--zstd`` and a topic: the level is a number."""
    if args.zstd and not args.zstd.isdigit():
        args.topics.insert(0, args.zstd)
        args.zstd = ""


@contextlib.contextmanager
def _signals(session: Session, on_usr1: Optional[Callable[[], None]]) -> Iterator[None]:
    def on_end(number: int, frame: Any) -> None:
        session.end(signal.Signals(number).name)

    def on_trigger(number: int, frame: Any) -> None:
        assert on_usr1 is not None
        on_usr1()

    ends = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    handlers: Dict[int, Callable[[int, Any], None]] = dict.fromkeys(ends, on_end)
    if on_usr1 is not None:
        handlers[signal.SIGUSR1] = on_trigger
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _write_report(path: str, recorder: WriterThread, session: Session, drops: Dict[str, TopicDrops],
                  failure: Optional[Exception]) -> None:
    report = {"files": recorder.finished_paths, "messages": recorder.messages, "end": session.end_reason,
              "error": None if failure is None else str(failure), "untimed": recorder.untimed,
              "topics": {topic: dict(account._asdict(), lossy=account.is_lossy) for topic, account in drops.items()}}
    write_account(path, report)


def _report(console: Notices, recorder: WriterThread, session: Session, drops: Dict[str, TopicDrops]) -> None:
    """Files, counts, and all that was lost."""
    if session.end_reason:
        console.say("ended: %s" % session.end_reason)
    for path in recorder.finished_paths:
        console.say("wrote %s" % path)
    if recorder.untimed:
        console.always("%d messages came before the first /clock" % recorder.untimed)
    for topic, account in drops.items():
        line = "%s: %d messages, %s" % (topic, account.received, account.describe())
        if account.is_lossy:
            console.always("LOST on " + line)
        else:
            console.say(line)
        if len(account.types) > 1:
            console.always("%s has publishers of different types: %s" % (
                topic, ", ".join("%s (md5 %s)" % kind for kind in account.types)))


def run(args: argparse.Namespace) -> int:
    """Record until SIGINT, SIGTERM or a limit; 0 when all went well."""
    _take_zstd_level(args)
    args.topics, remappings = split_remappings(args.topics)
    names = node_names(black_box.NODE if args.black_box else anonymous_name("jaka_bag_record"), remappings, os.environ)
    black_box.check(args)
    selection = _selection(args, names)
    settings = _settings(args)
    key = load_private_key(args.sign) if args.sign else None
    with Notices("jaka_bag record", args.quiet) as console:
        return _record(args, names, selection, settings, console, key)


def _record(args: argparse.Namespace, names: NodeNames, selection: TopicSelection, settings: FileSettings,
            console: Notices, key: Any) -> int:
    facts = {"program": "jaka_bag record", "host": platform.node(), "node": names.node, "master": master_uri(),
             "arguments": json.dumps(sys.argv[1:]),
             "started": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
    attachments: List[Attachment] = []
    box = black_box.Assembly(args, names, settings, facts, console, key) if args.black_box else None

    def open_files() -> MessageFiles:
        if box is not None:
            return box.open(recorder)
        chosen = settings
        if args.snapshot is not None:
            chosen = dataclasses.replace(settings, stem=_snapshot_stem(settings))
        return RollingFiles(chosen, facts, attachments, lambda: recorder.streams(), console.say)

    def connect() -> Subscriber:
        transport = Subscriber(names, recorder.take, session.open_stream, console.always, session.end,
                               args.tcpnodelay, args.stamp == "kernel")
        if box is not None:
            box.start(transport.uri)
        console.say("recording to %s, node %s" % (
            settings.path(0) if not in_memory else "memory, the newest %g s" % in_memory, names.node))
        return transport

    in_memory = args.before if box is not None else args.snapshot
    recorder = WriterThread(open_files, args.buffsize if box is None else box.memory_bytes, console.always,
                            lambda reason: session.end(reason), False, args.limit, args.snapshot,
                            0 if box is None else box.item_bytes)
    session = Session(recorder, selection if box is None else box.selection(selection),
                      is_of_namespace(names.namespace) if args.state_log else accept_all,
                      console.always, None if args.split else args.duration)
    failure: Optional[Exception] = None
    on_usr1 = box.on_signal if box is not None else recorder.trigger_snapshot if args.snapshot is not None else None
    with _signals(session, on_usr1):
        master = RemoteNode(master_uri(), names.node)
        if not wait_for_master(master, session.stop, console.always):
            return 1
        recorder.is_simulated_time = bool(read_parameter(master, "/use_sim_time"))
        facts["log_time"] = "/clock" if recorder.is_simulated_time else args.stamp
        attachments.append(Attachment("rosparam.yaml", parameter_dump(master), "application/yaml"))
        master.close()
        try:
            session.run(connect, recorder.is_simulated_time)
        except JakaBagError as error:
            failure = error
        finally:
            if box is not None:
                box.close()
    for path in recorder.finished_paths if key is not None and box is None else ():
        console.say("signed: %s" % sign(path, key))
    drops = drops_by_topic(recorder.streams())
    _report(console, recorder, session, drops)
    if args.report:
        _write_report(args.report, recorder, session, drops, failure)
    if failure is not None:
        console.always("error: %s" % failure)
    return 0 if failure is None and not (box is not None and box.failures) else 1


def _snapshot_stem(settings: FileSettings) -> Path:
    date = time.strftime("%Y-%m-%d-%H-%M-%S")
    stem = settings.stem.with_name("%s_snapshot_%s" % (settings.stem.name, date))
    number = 1
    while dataclasses.replace(settings, stem=stem).path(0).exists():
        number += 1
        stem = settings.stem.with_name("%s_snapshot_%s_%d" % (settings.stem.name, date, number))
    return stem
