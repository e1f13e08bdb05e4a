"""Both links to one controller, kept up, and what is asked of the controller whenever they come up."""
import logging
import threading
from dataclasses import dataclass
from typing import Any, Callable, List, Optional

from jaka_ros_driver.client.link_keeper import LinkKeeper
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.client.status_monitor import StatusMonitor
from jaka_ros_driver.client.transport import CommandLink
from jaka_ros_driver.commands import Command, Query, SetFeedPeriod, SetServoMode, Stop
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, JakaError, ProtocolError

_LOG = logging.getLogger(__name__)

_HEARTBEAT_PERIOD = 0.25
_HEARTBEAT_TIMEOUT = 0.6


@dataclass(frozen=True)
class LinkHealth:
    """How the links do.

    Attributes:
        command_is_up: The command port is connected and answers.
        status_is_up: The status port is connected.
        connections: How often the command port has been connected since start.
        last_error: Why a link is down, empty when both are up.
        version: The controller's version, empty before it told.
        feed_period: Period of the status feed as the controller confirmed it, s; None where it does not say.
        damaged_replies: Replies that were not JSON since start.
    """

    command_is_up: bool
    status_is_up: bool
    connections: int
    last_error: str
    version: str
    feed_period: Optional[float]
    damaged_replies: int


class ArmLinks:
    """Command and status port of one controller. Nothing is ever sent twice: what a lost link swallowed is lost."""

    def __init__(self, settings: ClientSettings, status: StatusMonitor, on_command_lost: Callable[[str], None],
                 on_status_lost: Callable[[str], None], on_beat: Callable[[], None]) -> None:
        """Prepare; ``start`` begins.

        Args:
            settings: Addresses and time limits.
            status: Gets the status port's bytes.
            on_command_lost: Told why the command port went down, in its keeper's thread.
            on_status_lost: The same for the status port.
            on_beat: Called a few times a second.
        """
        self._settings = settings
        self._on_beat = on_beat
        self._status = status
        self._link: Optional[CommandLink] = None
        self._version = ""
        self._feed_period: Optional[float] = None
        self._damaged_before = 0
        self._is_closing = threading.Event()
        self.is_servo_active = False
        self.must_stop_first = False
        """Set when motion was under way as the link went down: the first word on the next one is stop."""
        self._command_keeper = LinkKeeper("command port", self._connect_command, on_command_lost)
        self._status_keeper = LinkKeeper("status port", self._connect_status, on_status_lost)
        self._heartbeat = threading.Thread(target=self._beat, name="heartbeat", daemon=True)

    def start(self) -> None:
        """Begin to connect both."""
        self._command_keeper.start()
        self._status_keeper.start()
        self._heartbeat.start()

    def close(self) -> None:
        """Disconnect both."""
        self._is_closing.set()
        self._command_keeper.stop()
        self._status_keeper.stop()
        if self._link is not None:
            self._link.close("driver shut down")
        self._status.close("driver shut down")
        if self._heartbeat.is_alive():
            self._heartbeat.join()

    @property
    def command(self) -> CommandLink:
        """The command port, ready for use.

        Raises:
            ConnectionLost: It is down.
        """
        link = self._link
        if link is None or not self._command_keeper.is_up:
            raise ConnectionLost("no link to the controller at %s:%d: %s" % (
                self._settings.host, self._settings.command_port, self._command_keeper.last_error))
        return link

    @property
    def is_up(self) -> bool:
        """Both links are up."""
        return self._command_keeper.is_up and self._status_keeper.is_up

    def health(self) -> LinkHealth:
        """How the links do."""
        damaged = self._damaged_before + (self._link.damaged_replies if self._link is not None else 0)
        return LinkHealth(self._command_keeper.is_up, self._status_keeper.is_up, self._command_keeper.connections,
                          self._command_keeper.last_error or self._status_keeper.last_error, self._version,
                          self._feed_period, damaged)

    def _connect_status(self) -> None:
        self._status.connect(self._settings.host, self._settings.status_port, self._settings.connect_timeout,
                             self._status_keeper.closed)
        if self._is_closing.is_set():
            self._status.close("driver shut down")

    def _connect_command(self) -> None:
        if self._link is not None:
            self._damaged_before += self._link.damaged_replies
            self._link = None
        link = CommandLink(self._settings.host, self._settings.command_port, self._settings.connect_timeout,
                           self._settings.reply_timeout, self._command_keeper.closed)
        try:
            if self.must_stop_first:
                self._stop_what_was_under_way(link)
            self._version = _ask(link, Query.VERSION) or ""
            self._ask_for_feed_period(link)
            self.is_servo_active = bool(_ask(link, Query.SERVO_MODE))
            if self._is_closing.is_set():
                raise ConnectionLost("driver shut down")
        except JakaError:
            link.close("handshake failed")
            raise
        self._link = link

    def _stop_what_was_under_way(self, link: CommandLink) -> None:
        _LOG.warning("stopping the motion that was under way when the link went down")
        for pending in link.begin([SetServoMode(False), Stop()]):
            try:
                link.finish(pending)
            except CommandRejected as rejection:
                _LOG.warning("%s", rejection)
        self.must_stop_first = False

    def _ask_for_feed_period(self, link: CommandLink) -> None:
        wanted = self._settings.feed_period
        _ask(link, SetFeedPeriod(wanted))
        self._feed_period = _ask(link, Query.FEED_PERIOD)
        if self._feed_period is None or abs(self._feed_period - wanted) > 1e-6:
            _LOG.warning("the controller confirms a status period of %s s, %.3f s was asked for", self._feed_period,
                         wanted)

    def _beat(self) -> None:
        """Notices a command port that has gone silent, and keeps track of servo mode."""
        while not self._is_closing.wait(_HEARTBEAT_PERIOD):
            self._on_beat()
            try:
                self.is_servo_active = bool(self.command.request(Query.SERVO_MODE, _HEARTBEAT_TIMEOUT))
            except JakaError as error:
                _LOG.debug("heartbeat: %s", error)


def _ask(link: CommandLink, command: Command) -> Any:
    """What the controller answers, None where its firmware does not know the command."""
    try:
        return link.request(command)
    except (CommandRejected, ProtocolError) as error:
        _LOG.info("%s", error)
        return None


def request_all(link: CommandLink, commands: List[Command]) -> None:
    """Send the commands in one go; only the refusal of the last one counts."""
    pendings = link.begin(commands)
    for pending in pendings[:-1]:
        try:
            link.finish(pending)
        except CommandRejected as rejection:
            _LOG.info("%s", rejection)
    link.finish(pendings[-1])
