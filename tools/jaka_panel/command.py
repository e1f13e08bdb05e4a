"""The command jaka_panel: it reads the options, becomes a ROS node, serves pages until it is told to end."""
import asyncio
import io
import logging
import signal
import sys
from typing import List, Optional

import rospy

from jaka_regression.ros_node import become_node

from .settings import Settings, WrongSettings, settings_from

_LOG = logging.getLogger(__name__)
_NAME = "jaka_panel"
_INSTALL = ("jaka_panel needs the Python package aiohttp (Debian: apt-get install python3-aiohttp; tools/dev setup "
            "installs it): %s")


def main(argv: Optional[List[str]] = None) -> int:
    """Run the panel.

    Returns:
        0 ended in good order, 1 could not start, 2 wrong usage.
    """
    arguments = rospy.myargv(sys.argv if argv is None else [_NAME] + argv)[1:]
    try:
        settings = settings_from(arguments)
    except WrongSettings as error:
        print("%s: error: %s" % (_NAME, error), file=sys.stderr)
        return 2
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)
    try:
        import aiohttp
    except ImportError as error:
        print(_INSTALL % error, file=sys.stderr)
        return 1
    _LOG.debug("aiohttp %s", aiohttp.__version__)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # while it waits for a master there is nothing to end in order
    become_node(_NAME)
    try:
        asyncio.new_event_loop().run_until_complete(_serve(settings))
    except OSError as error:
        print("%s cannot start: %s" % (_NAME, error), file=sys.stderr)
        return 1
    finally:
        rospy.signal_shutdown("the panel ends")
    return 0


async def _serve(settings: Settings) -> None:
    from .graph.arms import ArmFinder
    from .pages.door import Door
    from .pages.hub import Hub
    from .pages.log_limit import limit_lines
    limit_lines()
    loop = asyncio.get_event_loop()
    ending = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ending.set)
    rospy.on_shutdown(lambda: loop.call_soon_threadsafe(ending.set))
    hub = Hub(settings, ArmFinder(rospy.get_name()))
    door = Door(settings, hub)
    hub.start()
    try:
        await door.start()
        _say(settings, door.port)
        await ending.wait()
    finally:
        await hub.close()
        await door.close()


def _say(settings: Settings, port: int) -> None:
    """Print where the page is. It goes to the terminal only: whoever reads the token can move the arm."""
    print("jaka_panel: open %s" % settings.address(port, settings.token))
    if settings.behind_tls is not None:
        print("jaka_panel: its proxy connects to http://%s:%d" % (settings.host, port))
    if settings.read_only:
        print("jaka_panel: read-only: pages can watch, and stop, and nothing else")
    if not settings.is_loopback:
        print("jaka_panel: WARNING: other computers reach this page at %s" % settings.address_elsewhere(port))
        if settings.tls is None:
            print("jaka_panel: WARNING: without TLS; everybody on the way can read the token, and move the arm with it")


if __name__ == "__main__":
    sys.exit(main())
