"""The command port's requests and replies, without its socket."""
import dataclasses
import logging
from typing import Any, Callable, Optional, Sequence, Tuple

from jaka_ros_driver.client.core.actions import Actions, Send
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import TERMINAL_COMMANDS, Command, SetEnabled, SetPower
from jaka_ros_driver.errors import ConnectionLost, FramingError, JakaError, ReplyTimeout
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.exchange import Exchange
from jaka_ros_driver.protocol.framing import ObjectStream, encode_object

OnReply = Callable[[Any, Optional[JakaError], float], None]
"""Gets the command's result, or the error, and the time, s. Errors: CommandRejected, ProtocolError, ReplyTimeout,
ConnectionLost."""


class _Pending:
    def __init__(self, command: Command, on_reply: OnReply) -> None:
        self.command = command
        self.on_reply = on_reply


class Channel:
    """Several requests may be on their way; a late reply ends the connection (docs/controller-protocol.md section 3.2).

    What the controller did of a command whose reply is late is unknown, and later replies could no longer be told
    apart. Nothing is ever sent twice.

    Attributes:
        is_open: The port is connected.
        is_confirmed: The controller is the one that was meant.
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
        self.is_confirmed = False
        self.damaged_replies = 0
        self.io_index_base = settings.io_index_base or 0

    def open(self, is_confirmed: bool) -> None:
        """A new connection: nothing is outstanding on it.

        Only what asks who the controller is, is sent before ``is_confirmed``: it may be another one than was meant.
        """
        self._stream = ObjectStream()
        self.is_open = True
        self.is_confirmed = is_confirmed

    def close(self, reason: str, now: float, late: Optional[Any] = None) -> None:
        """The connection has ended; who waits for a reply is told."""
        self.is_open = self.is_confirmed = False
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

    def request(self, command: Command, now: float, on_reply: OnReply, asks_who: bool = False) -> None:
        """Send one command; ``asks_who``: it belongs to asking who the controller is.

        Raises:
            InvalidCommand: A number in it is not finite; nothing was sent.
            ConnectionLost: There is no connection.
        """
        self.request_all([command], now, on_reply, asks_who)

    def request_all(self, commands: Sequence[Command], now: float, on_last: OnReply, asks_who: bool = False) -> None:
        """Send the commands in one piece, of which only the last one's reply matters; errors as ``request``."""
        texts = [self._encoded(command) for command in commands]
        if not self.is_open or not (self.is_confirmed or asks_who):
            raise ConnectionLost("no link to the controller: " + (
                "it has not said yet who it is" if self.is_open else self._down_reason))
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
