"""The command port's requests and replies, without its socket."""
import dataclasses
import functools
import logging
from typing import Callable, Mapping, Optional, Protocol, Sequence, Tuple

from jaka_ros_driver.client.core.actions import Actions, Send
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import (
    TERMINAL_COMMANDS,
    Command,
    JogStop,
    Query,
    SetEnabled,
    SetPower,
    SetServoMode,
    Stop,
)
from jaka_ros_driver.errors import ConnectionLost, FramingError, InvalidCommand, JakaError, ReplyTimeout
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.exchange import Exchange, PendingRequest
from jaka_ros_driver.protocol.framing import ObjectStream, encode_object

_PIECE_BYTES = 1 << 12
"""Bytes that are taken at once: within so many a flood is noticed."""
_MOST_STRAY_BYTES = 1 << 17
"""Most bytes in a row that answer no request; what sends more is no controller."""
_MOST_STRAYS = 1000
"""Most replies in a row that answer no request.

More are no controller's; all that wait on a connection are far fewer.
"""

OnReply = Callable[[object, Optional[JakaError], float], None]
"""The receiver of a command's result, or of its error, and of the time, s.

Errors: CommandRejected, ProtocolError, ReplyTimeout, ConnectionLost.
"""


class Requests(Protocol):
    """The interface for sending requests: the channel's, or an introduction's."""

    def request(self, command: Command, now: float, on_reply: OnReply) -> None:
        """Send one command; errors as ``CommandChannel.request``."""


_PARTS_OF_A_STOP = (JogStop, SetServoMode, Stop)


@functools.lru_cache(maxsize=None)
def _stop_text(command: Command) -> bytes:
    """Encode a part of a stop; cached, because a stop has up to 20 of them and waits for nothing. There are 21."""
    return encode_object(codec.encode(command))


class _Pending:
    def __init__(self, command: Command, on_reply: OnReply) -> None:
        self.command = command
        self.on_reply = on_reply


AwaitedReply = PendingRequest[_Pending]
"""A request on the wire and who waits for its reply, as ``CommandChannel.overdue`` finds it."""


class Introduction:
    """A new connection whose controller may not be the intended one: all it can be asked is its identity."""

    def __init__(self, channel: "CommandChannel") -> None:
        self._channel = channel

    def request(self, command: Command, now: float, on_reply: OnReply) -> None:
        """Ask for the identity; errors as ``CommandChannel.request``.

        Raises:
            ConnectionLost: The connection has ended; or it is not the identity that is asked for.
        """
        if command is not Query.SIMULATOR_IDENTITY or self._channel.introduction is not self:
            raise ConnectionLost("no link to the controller: it has not said yet who it is")
        self._channel.send_all([command], now, {0: on_reply})


class CommandChannel:
    """The command port's outstanding requests, of which several may be on their way.

    A late reply ends the connection (docs/controller-protocol.md section 3.2): whether the controller acted on the
    command is unknown, and later replies could no longer be told apart. Nothing is ever sent twice.

    Attributes:
        is_open: The port is connected to the intended controller: requests can be sent.
        introduction: The connection while its controller is not known to be that one; None otherwise.
        was_answered: A request was answered on the newest connection.
        damaged_replies: Pieces of the stream that are no replies, since start.
        io_index_base: Index on the wire of the first terminal, 0 or 1.
    """

    def __init__(self, actions: Actions, settings: ClientSettings) -> None:
        self._actions = actions
        self._settings = settings
        self._stream = ObjectStream()
        self._exchange: Exchange[_Pending] = Exchange()
        self._down_reason = "not connected yet"
        self._stray_bytes = self._strays = 0
        self._lets_pass = False
        self._prepared: Optional[Tuple[Command, bytes]] = None
        self.is_open = self.was_answered = False
        self.introduction: Optional[Introduction] = None
        self.damaged_replies = 0
        self.io_index_base = settings.io_index_base or 0

    def open(self) -> Introduction:
        """Begin with a new connection, on which nothing is outstanding; ``trust`` makes it usable."""
        self._stream = ObjectStream()
        self._stray_bytes = self._strays = 0
        self._lets_pass = self.was_answered = False
        self.introduction = Introduction(self)
        return self.introduction

    def trust(self, introduction: Introduction) -> None:
        """Use this connection from now on: its controller is the intended one. No effect where it has ended."""
        if introduction is self.introduction:
            self.is_open, self.introduction = True, None

    def close(self, reason: str, now: float, late: Optional[AwaitedReply] = None) -> None:
        """Close the channel after the connection has ended; answer those who wait for a reply with an error."""
        self.is_open, self.introduction = False, None
        self._down_reason = reason
        for request in self._exchange.abandon():
            if request.waiter is not None:
                error: JakaError = ConnectionLost(reason)
                if request is late:
                    error = ReplyTimeout(request.name, request.allowed_s)
                request.waiter.on_reply(None, error, now)

    def prepare(self, command: Command) -> None:
        """Encode a command that is likely to be the next one; nothing is sent. Raise InvalidCommand as ``request``
        does.
        """
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

    def request_all(self, commands: Sequence[Command], now: float, on_reply: OnReply, judged: int = 0,
                    besides: Optional[Mapping[int, OnReply]] = None) -> None:
        """Send the commands in one piece; errors as ``request``.

        Only the reply to that at place ``judged`` matters, and those at the places of ``besides``.
        """
        if not self.is_open:
            raise ConnectionLost("no link to the controller: " + (
                self._down_reason if self.introduction is None else "it has not said yet who it is"))
        self.send_all(commands, now, {**(besides or {}), judged: on_reply})

    def send_all(self, commands: Sequence[Command], now: float, on_reply: Mapping[int, OnReply]) -> None:
        """Send the commands, for ``request_all`` and an introduction, which know that there is a connection."""
        texts = [self._encoded(command) for command in commands]
        for place, command in enumerate(commands):
            patience, is_slow = self._patience(command)
            self._exchange.sent(codec.command_name(command), now, patience,
                                _Pending(command, on_reply[place]) if place in on_reply else None, is_slow)
        self._actions.add(Send(b"".join(texts)))

    @property
    def is_flooded(self) -> bool:
        """True where the received bytes answer no request any more; they are not read."""
        return self._stray_bytes > _MOST_STRAY_BYTES or self._strays > _MOST_STRAYS

    def received(self, data: bytes, now: float) -> None:
        """Take bytes of the port, and pass replies to those who wait for them. Their cost is bounded, whatever they
        are.
        """
        for start in range(0, len(data), _PIECE_BYTES):
            if self.is_flooded or not (self.is_open or self.introduction):
                return
            piece = data[start:start + _PIECE_BYTES]
            self._stray_bytes += len(piece)
            self._take(piece, now)

    def _take(self, data: bytes, now: float) -> None:
        for item in self._stream.feed(data):
            self._strays += 1
            if isinstance(item, FramingError):
                self.damaged_replies += 1
                self._actions.log(logging.DEBUG, "damaged reply: %s" % item)
                continue
            request = self._exchange.answered(item, now)
            if request is not None:
                self._stray_bytes = self._strays = 0
                self.was_answered = True
                # What others passed, and that comes all the same, was not lost: this controller lets replies pass.
                if request.was_passed and not self._exchange.is_outstanding(request.name):
                    self._lets_pass = True
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

    @property
    def held_up_until(self) -> Optional[float]:
        """The moment at which it is known whether later replies wait for a slow one, s; None where none do.

        A later reply that came first, the heartbeat's at the latest, shows that none wait for this one; where the slow
        one comes after it, none do on this connection. Where no later one has come by then, they do.
        """
        slow = self._exchange.slow
        return None if slow is None or self._lets_pass else slow.sent_at + self._settings.reply_timeout

    def require_prompt(self, what: str) -> None:
        """Raise unless replies need not wait for a slow one.

        Raises:
            InvalidCommand: They may have to; ``what`` names what was not sent.
        """
        slow = self._exchange.slow
        if slow is not None and not self._lets_pass:
            raise InvalidCommand("refused, %s was not sent: the controller may hold its replies back until %s is done; "
                                 "stop_move, and what the status feed tells, are served" % (what, slow.name))

    def done(self, command: Command, now: float) -> None:
        """Give the reply to this command the usual time from now, because its effect is visible."""
        self._exchange.done(codec.command_name(command), now, self._settings.reply_timeout)

    def overdue(self, now: float) -> Optional[AwaitedReply]:
        """Return a request whose reply is late, or None; pass it to ``close``."""
        return self._exchange.overdue(now)

    def _patience(self, command: Command) -> Tuple[float, bool]:
        """Return how long the reply may take, s, and whether later replies may wait for it.

        A controller can hold back the replies to power_on and enable_robot until that is done
        (docs/controller-protocol.md section 5.1).
        """
        settings = self._settings
        if isinstance(command, (SetPower, SetEnabled)):
            own = settings.power_timeout if isinstance(command, SetPower) else settings.enable_timeout
            return own + settings.reply_timeout, True
        return settings.reply_timeout, False

    def _encoded(self, command: Command) -> bytes:
        if isinstance(command, _PARTS_OF_A_STOP):
            return _stop_text(command)
        on_wire = self._on_wire(command)
        if self._prepared is not None and self._prepared[0] == on_wire:
            return self._prepared[1]
        return encode_object(codec.encode(on_wire))

    def _on_wire(self, command: Command) -> Command:
        """Return the command as it is sent.

        Terminals count from 0 in this driver, from ``io_index_base`` on the wire.
        """
        if self.io_index_base and isinstance(command, TERMINAL_COMMANDS):
            return dataclasses.replace(command, index=command.index + self.io_index_base)
        return command
