"""``jaka_foxglove``: the topics of a running ROS 1 system for Foxglove and Lichtblick."""
import argparse
import os
import signal
from typing import TYPE_CHECKING

from jaka_bag.cli.notices import Notices
from jaka_bag.errors import UsageError
from jaka_bag.interrupts import Flag
from jaka_bag.live.graph import RemoteNode, master_uri
from jaka_bag.live.names import NodeNames, anonymous_name, node_names, split_remappings
from jaka_bag.live.session import read_parameter, wait_for_master
from jaka_bag.live.subscriber import accept_all
from jaka_bag.live.topic_selection import TopicSelection, is_of_namespace, state_log_topics
from jaka_bag.messages.selection import compile_patterns

from .viewers import add_server, run_server

if TYPE_CHECKING:
    from ..source import ChannelSource

EPILOG = """\
In Foxglove or Lichtblick: Open connection, Foxglove WebSocket, ws://localhost:8765. A layout for JAKA arms to import
there is docs/foxglove-layout.json; docs/foxglove.md has more.

Without TOPICs every topic is shown. A topic is subscribed for as long as a viewer is; messages go out as they come over
the wire, with their publisher's definition and the kernel's time of receipt (with /use_sim_time the time of /clock).
A viewer that is too slow misses the oldest messages, and is told.

Viewers see topics, parameters and who publishes what. They change nothing: no publishing, no setting of parameters.
--allow-calls lets them call services besides, as any ROS node may: they MOVE THE ARM. Services whose types are not
installed here are left out.

--state-log shows one driver: its topics below jaka_driver, and joint_states, tf, tf_static and diagnostics, all of the
namespace (__ns:=/left or ROS_NAMESPACE); of its services, those of the namespace.
NAME:=VALUE words remap topics; __name:=, __ns:= are known. Exit code: 0 done, 1 failed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_foxglove`` to a parser."""
    parser.add_argument("topics", nargs="*", metavar="TOPIC", help="topics to show (default: all); with -e regular "
                                                                   "expressions")
    what = parser.add_argument_group("what to show")
    what.add_argument("-e", "--regex", action="store_true", help="TOPICs are regular expressions for whole names")
    what.add_argument("-x", "--exclude", metavar="REGEX", help="leave out topics whose whole name matches")
    what.add_argument("--state-log", action="store_true", help="exactly the topics of one driver, see below")
    what.add_argument("--allow-calls", action="store_true", help="viewers may call services: they move the arm")
    add_server(parser)


def _selection(args: argparse.Namespace, names: NodeNames) -> TopicSelection:
    exclude = compile_patterns([args.exclude])[0] if args.exclude is not None else None
    if args.state_log:
        if args.topics or args.regex:
            raise UsageError("--state-log chooses the topics itself")
        return TopicSelection(state_log_topics(names), exclude=exclude)
    if args.regex:
        if not args.topics:
            raise UsageError("-e needs regular expressions")
        return TopicSelection((), False, tuple(compile_patterns(args.topics)), exclude)
    return TopicSelection(tuple(names.resolve(topic) for topic in args.topics), not args.topics, (), exclude)


def run(args: argparse.Namespace) -> int:
    """Serve until SIGINT or SIGTERM; 0 when all went well."""
    args.topics, remappings = split_remappings(args.topics)
    names = node_names(anonymous_name("jaka_foxglove"), remappings, os.environ)
    selection = _selection(args, names)
    shown = "all shown topics and every parameter"
    if args.allow_calls:
        shown += ", and may call services, which move the arm"

    def make_source() -> "ChannelSource":
        from ..live_topics import LiveOptions, LiveTopics

        with RemoteNode(master_uri(), names.node) as master:
            wait_for_master(master, Flag(), console.always)
            is_simulated = bool(read_parameter(master, "/use_sim_time"))
        accept = is_of_namespace(names.namespace) if args.state_log else accept_all
        services = names.namespace.rstrip("/") + "/" if args.state_log else "/"
        options = LiveOptions(selection, accept, is_simulated, args.allow_calls, services)
        return LiveTopics(names, options, console.always, lambda reason: os.kill(os.getpid(), signal.SIGTERM))

    with Notices("jaka_foxglove", args.quiet) as console:
        if args.allow_calls:
            console.always("--allow-calls: every viewer may call services, which MOVE THE ARM; no dead-man stands "
                           "behind these calls")
        return run_server(args, console, shown, make_source)
