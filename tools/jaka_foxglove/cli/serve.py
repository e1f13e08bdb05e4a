"""``jaka_bag serve``: logs for Foxglove and Lichtblick."""
import argparse
import os
from typing import TYPE_CHECKING

from jaka_bag.cli import quantities
from jaka_bag.cli.notices import Notices
from jaka_bag.errors import UsageError

from .viewers import add_server, run_server

if TYPE_CHECKING:
    from ..source import ChannelSource

EPILOG = """\
In Foxglove: Open connection, Foxglove WebSocket, ws://localhost:8765. Its play bar pauses, seeks and sets the speed;
all viewers see the same playback. It begins with the first subscription and stands still while nobody is subscribed.
Viewers without a play bar for servers (Lichtblick) see it as live data: -r, -l and --pause are for those.

Only what is due is read from the files, by their index, and of that only what somebody is subscribed to. Messages go
out as they were recorded: encoding, type, definition, log time, bytes. A viewer that is too slow misses the oldest.
docs/foxglove.md has more.

examples:
  jaka_bag serve run.mcap
  jaka_bag serve run_0.bag run_1.bag -t /jaka_driver/joint_position -r 2 --loop

Exit code: 0 done, 1 failed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag serve`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE", help=".bag or .mcap; several are shown as one")
    what = parser.add_argument_group("what to show")
    what.add_argument("-t", "--topics", nargs="+", default=[], metavar="TOPIC", help="only these topics")
    what.add_argument("-e", "--regex", action="append", default=[], metavar="REGEX",
                      help="only topics whose whole name matches; may be repeated")
    what.add_argument("-x", "--exclude", action="append", default=[], metavar="REGEX",
                      help="not topics whose whole name matches; may be repeated")
    when = parser.add_argument_group("when")
    when.add_argument("-r", "--rate", type=quantities.positive_number, default=1.0, metavar="FACTOR",
                      help="log seconds in a second (default 1; 0.01 to 100)")
    when.add_argument("-l", "--loop", action="store_true", help="again and again")
    when.add_argument("--pause", action="store_true", help="begin in pause")
    add_server(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM; 0 when all went well."""
    def make_source() -> "ChannelSource":
        from jaka_bag.live.log_source import LogSource

        from ..log_playback import LogPlayback, PlaybackOptions

        name = ", ".join(os.path.basename(path) for path in args.files)
        logs = LogSource(args.files, args.topics, args.regex, args.exclude, bytes, True)
        try:
            source = LogPlayback(name, logs, PlaybackOptions(args.rate, args.pause, args.loop), console.always)
        except BaseException:
            logs.close()
            raise
        console.say("showing %d topics, %.1f s of log" % (len(source.channels), (logs.end - logs.begin) * 1e-9))
        return source

    if not 0.01 <= args.rate <= 100:
        raise UsageError("-r takes 0.01 to 100")
    with Notices("jaka_bag serve", args.quiet) as console:
        return run_server(args, console, "these logs", make_source)
