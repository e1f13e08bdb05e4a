"""The command-line options that both servers for Foxglove and Lichtblick share: access, address, limits."""
import argparse
import os
from typing import TYPE_CHECKING, Callable, List

from jaka_bag.cli import quantities
from jaka_bag.cli.notices import Notices
from jaka_bag.errors import MissingDependency, UsageError

if TYPE_CHECKING:  # aiohttp is needed when a server runs, not for its help
    from ..source import ChannelSource

DEFAULT_PORT = 8765
"""The port that Foxglove and Lichtblick offer for a WebSocket of their protocol."""
_OPEN = "%s: everybody who reaches this port sees %s; nothing is encrypted, and nobody is asked for a password"


def add_server(parser: argparse.ArgumentParser) -> None:
    """Add the options of a server to a parser."""
    group = parser.add_argument_group("who may connect")
    group.add_argument("--host", type=quantities.given, default="127.0.0.1", metavar="ADDRESS",
                       help="listen there (default 127.0.0.1: only this machine connects)")
    group.add_argument("--port", type=_port, default=DEFAULT_PORT, metavar="PORT",
                       help="port (default %d; 0: any that is free)" % DEFAULT_PORT)
    group.add_argument("--allow-origin", action="append", default=[], metavar="ORIGIN",
                       help="trust the pages of ORIGIN, as http://localhost:8080, besides those of Foxglove and "
                            "Lichtblick; may be repeated")
    group.add_argument("--allow-host", action="append", default=[], metavar="NAME",
                       help="viewers may call this machine NAME; may be repeated")
    group.add_argument("--max-viewers", type=quantities.count, default=16, metavar="N",
                       help="viewers at once (default 16)")
    group.add_argument("--buffer", type=quantities.megabytes, default=32 << 20, metavar="MB",
                       help="messages that may wait for each viewer (default 32); beyond it the oldest are left out, "
                            "which the viewer is told")
    parser.add_argument("-q", "--quiet", action="store_true", help="say only what goes wrong")


def _port(text: str) -> int:
    number = quantities.count(text)
    if number > 65535:
        raise argparse.ArgumentTypeError("%r is no port" % text)
    return number


def run_server(args: argparse.Namespace, console: Notices, shown: str,
               make_source: Callable[[], "ChannelSource"]) -> int:
    """Serve until SIGINT or SIGTERM; return the exit code.

    Args:
        args: Options of ``add_server``.
        console: Printer of notices.
        shown: Description, for the user, of what viewers see and may do.
        make_source: Makes the source.

    Raises:
        MissingDependency: aiohttp is not installed.
        UsageError: An option makes no sense.
        BagError: The address cannot be listened on.
    """
    try:
        from .. import server as servers
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "aiohttp":
            raise
        raise MissingDependency("this needs the Python package aiohttp (python3-aiohttp, or pip install "
                                "'jaka-bag[foxglove]')") from None
    from ..access import AccessRules, is_loopback

    names: List[str] = list(args.allow_host)
    if not args.max_viewers:
        raise UsageError("--max-viewers 0 would refuse everybody")
    if not is_loopback(args.host):
        names.append(os.uname().nodename)
        console.always(_OPEN % (args.host, shown))
    rules = AccessRules(args.allow_origin, names)
    limits = servers.ViewerLimits(args.max_viewers, args.buffer)
    server = servers.FoxgloveServer(make_source(), rules, limits, console.always)

    def ready() -> None:
        host = "localhost" if is_loopback(args.host) else args.host
        console.always("open ws://%s:%d in Foxglove or Lichtblick (Open connection, Foxglove WebSocket)"
                       % ("[%s]" % host if ":" in host else host, server.port))

    servers.serve(server, args.host, args.port, ready)
    return 0
