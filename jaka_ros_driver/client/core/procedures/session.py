"""The questions to a controller whose command port was connected, one of which checks that it is the intended one."""
import ipaddress
import logging
import re
from dataclasses import dataclass
from typing import Optional

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.procedures.steps import Ask, Procedure
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Command, Query, SetFeedPeriod
from jaka_ros_driver.errors import CommandRejected, JakaError, ProtocolError
from jaka_ros_driver.protocol.ports import endpoint


class ForeignController(JakaError):
    """The error that this is not the simulated controller that was launched beside this driver.

    It is left alone.
    """


@dataclass(frozen=True)
class About:
    """The controller's answers about itself; ``LinkHealth`` describes them."""

    version: str = ""
    feed_period: Optional[float] = None
    is_servo_active: bool = False
    is_simulated: Optional[bool] = None


def introduction(settings: ClientSettings, actions: Actions) -> Procedure:
    """Ask for the identity, which must be that of the simulated controller that was launched with this driver.

    Raises:
        ForeignController: It is not.
        JakaError: As ``Ask``.
    """
    if (yield from _ask(Query.SIMULATOR_IDENTITY, actions)) != settings.simulator:
        raise ForeignController(
            "the controller at %s is not the simulated one that was launched with this driver; it is left alone"
            % endpoint(settings.host, settings.command_port))


def handshake(settings: ClientSettings, actions: Actions) -> Procedure:
    """Set the period of the feed, and ask for version and servo mode; return an About.

    Raises:
        JakaError: As ``Ask``.
    """
    is_simulated = bool(settings.simulator) or (
        is_loopback(settings.host) and (yield from _ask(Query.SIMULATOR_IDENTITY, actions)) is not None)
    version = (yield from _ask(Query.VERSION, actions)) or ""
    wanted = settings.feed_period
    yield from _ask(SetFeedPeriod(wanted), actions)
    period = yield from _ask(Query.FEED_PERIOD, actions)
    if period is None or abs(period - wanted) > 1e-6:
        actions.log(logging.WARNING, "the controller confirms a status period of %s s, %.3f s was asked for"
                    % (period, wanted))
    is_servo_active = bool((yield from _ask(Query.SERVO_MODE, actions)))
    return About(version, period, is_servo_active, is_simulated)


def io_index_base(settings: ClientSettings, version: str) -> int:
    """Return the index on the wire of the first input or output: the one that was set, else 1 from version 1.7 on, else
    0.

    No source settles it (docs/controller-protocol.md section 13); every output that is set is looked up in the feed.
    """
    if settings.io_index_base is not None:
        return settings.io_index_base
    numbers = re.match(r"\D*(\d+)\.(\d+)", version)
    return int(numbers is not None and (int(numbers[1]), int(numbers[2])) >= (1, 7))


def is_loopback(host: str) -> bool:
    """Return whether the host is this computer, where no real controller listens."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _ask(command: Command, actions: Actions) -> Procedure:
    """Return the controller's answer, None where its firmware does not know the command."""
    try:
        return (yield Ask(command))
    except (CommandRejected, ProtocolError) as error:
        actions.log(logging.INFO, str(error))
        return None
