"""``jaka_bag play``: the command line of the player."""
import argparse
import contextlib
import os
import signal
import struct
import sys
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Tuple

from ..errors import ConnectionLost, UsageError
from ..live.keyboard import Keyboard
from ..live.linux_timing import precise_wakeups
from ..live.log_source import LogSource, Timed
from ..live.names import NodeNames, anonymous_name, node_names, split_remappings
from ..live.player import Pace, Player
from ..live.publisher import Publisher, TopicPublisher, frame_of
from ..live.session import read_parameter
from ..messages.connection import Connection
from ..messages.definitions import definition_md5
from ..messages.selection import Selection, TimePoint, TimeSpan
from ..units import NS_PER_S
from . import quantities
from .main import printable
from .notices import write_account
from .options import TIME_HELP

_TIME = struct.Struct("<II")
_LAST_CLOCK_NS = (1 << 32) * NS_PER_S - 1
_CLOCK_DEFINITION = "time clock\n"
_PATIENCE_S = 30.0
"""Longest wait, s, at the end of a log for subscribers that have not read all; one that hangs must not hold up for
ever."""

EPILOG = """\
Messages go out as they were recorded: type, md5, definition, latching, bytes. Every subscriber gets every message at
any rate: a subscriber that does not keep up holds the player up, and is named. A message that is late does not move
those after it. With -s the newest message of each latched publisher before the start is sent first.

On a terminal, space pauses and goes on, s sends one message while paused. NAME:=VALUE words remap topics;
__name:=, __ns:= are known. At the end it says, by topic, how many messages went out, and how late.

examples:
  jaka_bag play run.bag --clock
  jaka_bag play run.mcap -t /jaka_driver/joint_position -s 1:30 -u 10s -r 0.5

Exit code: 0 done, 1 failed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag play`` to a parser."""
    add = parser.add_argument
    add("files", nargs="*", metavar="FILE", help=".bag, .mcap, .db3 or rosbag2 folder; several are played as one")
    what = parser.add_argument_group("what to play")
    what.add_argument("--bags", nargs="+", default=[], metavar="FILE", help="further files")
    what.add_argument("-t", "--topics", nargs="+", default=[], metavar="TOPIC", help="only these topics")
    what.add_argument("-e", "--regex", action="append", default=[], metavar="REGEX",
                      help="only topics whose whole name matches; may be repeated")
    what.add_argument("-x", "--exclude", action="append", default=[], metavar="REGEX",
                      help="not topics whose whole name matches; may be repeated")
    what.add_argument("-s", "--start", type=quantities.time_point, metavar="TIME", help="from TIME on: " + TIME_HELP)
    what.add_argument("--until", "--end", dest="end", type=quantities.time_point, metavar="TIME",
                      help="up to TIME, given likewise")
    what.add_argument("-u", "--duration", type=quantities.nanoseconds, metavar="TIME",
                      help="play only so much (2m, 5s, 1:30)")
    what.add_argument("-p", "--prefix", default="", metavar="PREFIX", help="put PREFIX in front of all topics")
    when = parser.add_argument_group("when")
    when.add_argument("-r", "--rate", type=quantities.positive_number, default=1.0, metavar="FACTOR",
                      help="log seconds in a second (default 1)")
    when.add_argument("-i", "--immediate", action="store_true", help="without waiting")
    when.add_argument("-l", "--loop", action="store_true", help="again and again")
    when.add_argument("-k", "--keep-alive", action="store_true", help="stay when all is played, for latched topics")
    when.add_argument("--pause", action="store_true", help="begin in pause")
    when.add_argument("-d", "--delay", type=quantities.duration, default=0.2, metavar="TIME",
                      help="wait between advertising and the first message (default 0.2)")
    when.add_argument("--wait-for-subscribers", action="store_true", help="begin when each topic has a subscriber")
    when.add_argument("--skip-empty", type=quantities.duration, metavar="TIME", help="skip gaps longer than this")
    when.add_argument("--clock", action="store_true", help="publish /clock: with each message, and between")
    when.add_argument("--hz", type=quantities.positive_number, default=100.0, metavar="HZ",
                      help="rate of /clock between messages (default 100)")
    when.add_argument("--spin-us", type=quantities.count, default=200, metavar="US",
                      help="poll the clock for the end of each wait, us (default 200; 0 saves CPU)")
    parser.add_argument("--report", metavar="FILE", help="write the account as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="say only what goes wrong")


class _Stop(BaseException):
    """The end of the playing by a signal or another node."""


@contextlib.contextmanager
def _signals_stop() -> Iterator[None]:
    def stop(number: int, frame: Any) -> None:
        raise _Stop(signal.Signals(number).name)

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, stop) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before):
            signal.signal(number, handler)


class _LogTopics:
    """The topics of a log as subscribers see them: an offer for each topic and type, and /clock.

    Attributes:
        offers: Offers by number of the log's connection.
    """

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self.offers: Dict[int, TopicPublisher] = {}
        self._latches: List[Optional[int]] = []
        self._clock: Optional[TopicPublisher] = None

    def advertise(self, source: LogSource, prefix: str, has_clock: bool, notice: Callable[[str], None]) -> None:
        """Offer everything that the log holds.

        Raises:
            ConnectionLost: There is no master.
        """
        publisher = self._publisher
        names = publisher.names
        groups: Dict[Any, List[int]] = {}
        for number, connection in enumerate(source.connections):
            topic = names.resolve(prefix + connection.topic)
            groups.setdefault((topic, connection.md5sum, connection.datatype), []).append(number)
            self._latches.append(number if connection.latching else None)
        offered: Dict[str, str] = {}
        for (topic, _, datatype), numbers in groups.items():
            if topic in offered:
                notice("%s has two types, %s and %s: each goes to those who subscribe with its md5"
                       % (topic, offered[topic], datatype))
            offered[topic] = datatype
            latching = any(source.connections[number].latching for number in numbers)
            offer = publisher.advertise(topic, source.connections[numbers[0]], latching)
            self.offers.update(dict.fromkeys(numbers, offer))
        if has_clock:
            clock = Connection("/clock", "rosgraph_msgs/Clock",
                               definition_md5("rosgraph_msgs/Clock", _CLOCK_DEFINITION), _CLOCK_DEFINITION)
            self._clock = publisher.advertise(names.resolve("/clock"), clock, False)

    def send(self, message: Timed) -> None:
        """Publish one message of the log."""
        number = message.connection
        self._publisher.publish(self.offers[number], message.frame, self._latches[number])

    def send_clock(self, log_time: int) -> None:
        """Publish a log time, ns, as the time."""
        if self._clock is not None:
            self._publisher.publish(self._clock, frame_of(_TIME.pack(*divmod(log_time, NS_PER_S))))


def limits_of(args: argparse.Namespace, source: LogSource) -> Tuple[int, int]:
    """Return the first and the last log time to play, ns.

    Raises:
        UsageError: The log has nothing there.
    """
    until_ns = None if args.end is None else args.end.resolve(source.begin, source.end)
    span = TimeSpan(args.start, None if until_ns is None else TimePoint(until_ns, True))
    chosen = span.apply(Selection(), source.begin, source.end)
    begin = source.begin if chosen.start_time is None else chosen.start_time
    ends = [source.end]
    if args.duration is not None:
        ends.append(begin + args.duration)
    if until_ns is not None:
        ends.append(until_ns)
    return begin, min(ends)


def _play_through(args: argparse.Namespace, source: LogSource, log_topics: _LogTopics, publisher: Publisher,
                  player: Player, begin: int, end: int, say: Callable[[str], None]) -> None:
    player.wait(args.delay, begin)
    if args.wait_for_subscribers:
        say("waiting for subscribers")
        while not publisher.has_subscribers():
            player.wait(0.02, begin)
    with precise_wakeups():
        while True:
            if begin > source.begin:
                for message in source.last_before(begin):
                    log_topics.send(message)
            with contextlib.closing(source.play(begin, end)) as messages:
                player.play(messages, begin)
            if not args.loop:
                break
    if args.keep_alive:
        say("all is played; the topics stay until SIGINT")
    while args.keep_alive:
        player.wait(3600.0, end)


def _report(log_topics: _LogTopics, player: Player, end_reason: str) -> Dict[str, Any]:
    def account(numbers: Iterable[int]) -> Dict[str, Any]:
        total = player.total_of([number for number in numbers if number in player.accounts])
        return {"sent": total.count, "late_p50_s": total.quantile(0.5), "late_p99_s": total.quantile(0.99),
                "late_max_s": total.max_s}

    topics: Dict[str, List[int]] = {}
    for number, offer in log_topics.offers.items():
        topics.setdefault(offer.topic, []).append(number)
    return {**account(player.accounts), "topics": {topic: account(topics[topic]) for topic in sorted(topics)},
            "end": end_reason}


def _line(name: str, account: Dict[str, float], is_immediate: bool) -> str:
    text = "%s: %d messages" % (name, account["sent"])
    if is_immediate or not account["sent"]:
        return text
    return "%s, late by p50 %.0f us, p99 %.0f us, at most %.1f ms" % (
        text, account["late_p50_s"] * 1e6, account["late_p99_s"] * 1e6, account["late_max_s"] * 1e3)


def run(args: argparse.Namespace) -> int:
    """Play to the end, or until SIGINT or SIGTERM; 0 when all went well."""
    def notice(line: str) -> None:
        print("jaka_bag play: %s" % printable(line), file=sys.stderr, flush=True)

    def say(line: str) -> None:
        if not args.quiet:
            notice(line)

    words, remappings = split_remappings(args.files + args.topics + args.bags)
    paths = [word for word in args.files + args.bags if word in words]
    if not paths:
        raise UsageError("no FILE")
    if args.immediate and args.rate != 1.0:
        raise UsageError("-i has no rate")
    names = node_names(anonymous_name("jaka_bag_play"), remappings, os.environ)
    wanted = [topic for topic in args.topics if topic in words]
    with contextlib.closing(LogSource(paths, wanted, args.regex, args.exclude)) as source:
        if not source.connections:
            missing = "; ".join(source.unmatched()) or "no topic is wanted"
            raise UsageError("nothing to play: %s: %s" % (", ".join(paths), missing))
        for note in source.notes:
            notice("note: %s" % note)
        for line in source.unmatched():
            notice(line)
        begin, end = limits_of(args, source)
        if args.clock and end > _LAST_CLOCK_NS:
            raise UsageError("/clock has no times after 2106, and the log goes on until %.0f s: end it before, with "
                             "--until, or play it without --clock" % (end / NS_PER_S))
        report = _perform(args, names, source, begin, end, notice, say)
    if args.report:
        write_account(args.report, report)
    return 0


def _perform(args: argparse.Namespace, names: NodeNames, source: LogSource, begin: int, end: int,
             notice: Callable[[str], None], say: Callable[[str], None]) -> Dict[str, Any]:
    pace = Pace(args.rate, args.immediate, args.pause, args.spin_us * 1e-6, args.skip_empty,
                1.0 / args.hz if args.clock else None)
    end_reason = "end of the log"
    publisher = Publisher(names, notice, lambda reason: os.kill(os.getpid(), signal.SIGTERM))
    with Keyboard() as keyboard:
        log_topics = _LogTopics(publisher)
        player = Player(pace, log_topics.send, log_topics.send_clock, keyboard, publisher.admit, say)
        try:
            with _signals_stop():
                if args.clock and not read_parameter(publisher.master, "/use_sim_time"):
                    notice("the parameter /use_sim_time is not true: nodes will not use /clock")
                log_topics.advertise(source, args.prefix, args.clock, notice)
                topics = {offer.topic for offer in log_topics.offers.values()}
                say("playing %d topics, %.1f s of log, node %s"
                    % (len(topics), (source.end - source.begin) * 1e-9, names.node))
                _play_through(args, source, log_topics, publisher, player, begin, end, say)
        except ConnectionLost as error:
            raise ConnectionLost("there is no ROS master: %s (roscore starts one, ROS_MASTER_URI names another)"
                                 % error) from error
        except _Stop as stop:
            end_reason = str(stop)
        finally:
            with contextlib.suppress(KeyboardInterrupt):
                publisher.close(_PATIENCE_S if end_reason == "end of the log" else 0.5)
    report = _report(log_topics, player, end_reason)
    for topic, account in report["topics"].items():
        say(_line(topic, account, args.immediate))
    say(_line("all", report, args.immediate) + ", " + end_reason)
    return report
