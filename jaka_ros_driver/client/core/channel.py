"""The command port's requests and replies, without its socket."""
import dataclasses
import logging
from typing import Any, Callable, Optional, Protocol, Sequence, Tuple

from jaka_ros_driver.client.core.actions import Actions, Send
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import TERMINAL_COMMANDS, Command, Query, SetEnabled, SetPower
from jaka_ros_driver.errors import ConnectionLost, FramingError, JakaError, ReplyTimeout
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.exchange import Exchange
from jaka_ros_driver.protocol.framing import ObjectStream, encode_object

OnReply = Callable[[Any, Optional[JakaError], float], None]
"""Gets the command's result, or the error, and the time, s. Errors: CommandRejected, ProtocolError, ReplyTimeout,
ConnectionLost."""


class Requests(Protocol):
    """A place to send requests to: the channel, or an introduction."""

    def request(self, command: Command, now: float, on_reply: OnReply) -> None:
        """Send one command; errors as ``Channel.request``."""


class _Pending:
    def __init__(self, command: Command, on_reply: OnReply) -> None:
        self.command = command
        self.on_reply = on_reply


class Introduction:
    """A new connection, whose controller may be another one than was meant: all it can be asked is its identity."""

    def __init__(self, channel: "Channel") -> None:
        self._channel = channel

    def request(self, command: Command, now: float, on_reply: OnReply) -> None:
        """Ask for the identity; errors as ``Channel.request``.

        Raises:
            ConnectionLost: The connection has ended; or it is not the identity that is asked for.
        """
        if command is not Query.SIMULATOR_IDENTITY or self._channel.introduction is not self:
            raise ConnectionLost("no link to the controller: it has not said yet who it is")
        self._channel.send_all([command], now, on_reply)


class Channel:
    """Several requests may be on their way; a late reply ends the connection (docs/controller-protocol.md section 3.2).

    What the controller did of a command whose reply is late is unknown, and later replies could no longer be told
    apart. Nothing is ever sent twice.

    Attributes:
        is_open: The port is connected to the controller that was meant: requests can be sent.
        introduction: The connection while its controller is not known to be that one; None otherwise.
        damaged_replies: Pieces of the stream that are no replies, since start.
        io_index_base: Index on the wire of the first terminal, 0 or 1.
    """

    def __init__(self, actions: Actions, settings: ClientSettings) -> None:
        self._actions = actions
        self._settings = settings
        self._stream = ObjectStream()
        self._exchange: Exchange[_Pending] = Exchange()
        self._down_reason = "not connected yet"
        self._prepared: Optional[Tuple[Command, bytes]] = None
        self.is_open = False
        self.introduction: Optional[Introduction] = None
        self.damaged_replies = 0
        self.io_index_base = settings.io_index_base or 0

    def open(self) -> Introduction:
        """Begin with a new connection, on which nothing is outstanding; ``trust`` makes it usable."""
        self._stream = ObjectStream()
        self.introduction = Introduction(self)
        return self.introduction

    def trust(self, introduction: Introduction) -> None:
        """Use this connection from now on: its controller is the one that was meant. No effect where it has ended."""
        if introduction is self.introduction:
            self.is_open, self.introduction = True, None

    def close(self, reason: str, now: float, late: Optional[Any] = None) -> None:
        """The connection has ended; who waits for a reply is told."""
        self.is_open, self.introduction = False, None
        self._down_reason = reason
        for request in self._exchange.abandon():
            if request.waiter is not None:
                error: JakaError = ConnectionLost(reason)
                if request is late:
                    error = ReplyTimeout(request.name, request.patience)
                request.waiter.on_reply(None, error, now)

    def prepare(self, command: Command) -> None:
        """Encode a command that is likely to be the next one; nothing is sent. Raises InvalidCommand as ``request``."""
        on_wire = self._on_wire(command)
        if self._prepared is None or self._prepared[0] != on_wire:
            self._prepared = on_wire, encode_object(codec.encode(on_wire))

    def request(self, command: Command, now: float, on_reply: OnReply) -> None:
        """Send one command.

        Raises:
            InvalidCommand: A number in it is not finite; nothing was sent.
            ConnectionLost: There is no connection, or it is not known yet whose it is.
        """
        self.request_all([command], now, on_reply)

    def request_all(self, commands: Sequence[Command], now: float, on_last: OnReply) -> None:
        """Send the commands in one piece, of which only the last one's reply matters; errors as ``request``."""
        if not self.is_open:
            raise ConnectionLost("no link to the controller: " + (
                self._down_reason if self.introduction is None else "it has not said yet who it is"))
        self.send_all(commands, now, on_last)

    def send_all(self, commands: Sequence[Command], now: float, on_last: OnReply) -> None:
        """Put the commands on the connection; for ``request_all`` and an introduction, which know that there is one."""
        texts = [self._encoded(command) for command in commands]
        for place, command in enumerate(commands, 1):
            patience, is_slow = self._patience(command)
            self._exchange.sent(codec.command_name(command), now, patience,
                                _Pending(command, on_last) if place == len(commands) else None, is_slow)
        self._actions.add(Send(b"".join(texts)))

    def received(self, data: bytes, now: float) -> None:
        for item in self._stream.feed(data):
            if isinstance(item, FramingError):
                self.damaged_replies += 1
                self._actions.log(logging.DEBUG, "damaged reply: %s" % item)
                continue
            request = self._exchange.answered(item, now)
            if request is None or request.waiter is None:
                continue
            pending = request.waiter
            try:
                result = codec.decode(pending.command, item)
            except JakaError as error:
                pending.on_reply(None, error, now)
            else:
                pending.on_reply(result, None, now)

    @property
    def is_held_up(self) -> bool:
        """True where the reply to a request that is sent now may have to wait for one that takes its time."""
        return self._exchange.is_held_up

    def done(self, command: Command, now: float) -> None:
        """What this command asked for is seen to be done; its reply is due in the usual time now."""
        self._exchange.done(codec.command_name(command), now, self._settings.reply_timeout)

    def overdue(self, now: float) -> Optional[Any]:
        """A request whose reply is late, if there is one; hand it to ``close``."""
        return self._exchange.overdue(now)

    def _patience(self, command: Command) -> Tuple[float, bool]:
        """How long the reply may take, s, and whether later replies may wait for it.

        A controller can hold back the replies to power_on and enable_robot until that is done
        (docs/controller-protocol.md section 5.1).
        """
        settings = self._settings
        if isinstance(command, (SetPower, SetEnabled)):
            own = settings.power_timeout if isinstance(command, SetPower) else settings.enable_timeout
            return own + settings.reply_timeout, True
        return settings.reply_timeout, False

    def _encoded(self, command: Command) -> bytes:
        on_wire = self._on_wire(command)
        if self._prepared is not None and self._prepared[0] == on_wire:
            return self._prepared[1]
        return encode_object(codec.encode(on_wire))

    def _on_wire(self, command: Command) -> Command:
        """Terminals count from 0 in this program, from ``io_index_base`` on the wire."""
        if self.io_index_base and isinstance(command, TERMINAL_COMMANDS):
            return dataclasses.replace(command, index=command.index + self.io_index_base)
        return command
