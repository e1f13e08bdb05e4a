"""TCP connections to the controller, each with its reader thread; the only sockets of the driver."""
import socket
import threading
import time
from typing import Any, Callable, List, Mapping, Optional

from jaka_ros_driver.commands import Command
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, FramingError, ProtocolError, ReplyTimeout
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.exchange import Exchange
from jaka_ros_driver.protocol.framing import ObjectStream, encode_object

_RECEIVE_BYTES = 1 << 16
_POLL_S = 0.1

Rejected = Callable[[CommandRejected], None]


class Connection:
    """One TCP connection. A thread reads it and hands the bytes on; it ends once, with one reason."""

    def __init__(self, host: str, port: int, connect_timeout: float, name: str,
                 on_bytes: Callable[[bytes, bool], None], on_closed: Callable[[str], None],
                 silence_timeout: Optional[float] = None, on_idle: Optional[Callable[[], None]] = None) -> None:
        """Connect, and start reading.

        Args:
            host: Address of the peer.
            port: Its port.
            connect_timeout: s.
            name: What the connection is for, in messages and as the thread's name.
            on_bytes: Gets what arrives, in the reader thread; True with it where more has piled up behind it.
            on_closed: Called once, in the reader thread, with the reason.
            silence_timeout: The connection counts as lost after so long without a byte, s.
            on_idle: Called in the reader thread at least every 0.1 s.

        Raises:
            ConnectionLost: The peer cannot be reached.
        """
        self.name = name
        self._on_bytes = on_bytes
        self._on_closed = on_closed
        self._on_idle = on_idle
        self._silence_timeout = silence_timeout
        self._reason: Optional[str] = None
        self._reason_lock = threading.Lock()
        try:
            self._socket = socket.create_connection((host, port), timeout=connect_timeout)
        except OSError as error:
            raise ConnectionLost("cannot connect to the %s of %s:%d: %s" % (name, host, port, error)) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._socket.settimeout(_POLL_S)
        self._thread = threading.Thread(target=self._read, name=name, daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def send(self, data: bytes) -> None:
        """Hand the bytes to the network.

        Raises:
            ConnectionLost: The connection is closed, or the peer takes no bytes.
        """
        try:
            self._socket.sendall(data)
        except OSError as error:
            self.close("%s: sending failed: %s" % (self.name, error))
            raise ConnectionLost(self._reason) from error

    def close(self, reason: str) -> None:
        """End the connection; the first reason given is the one that counts."""
        with self._reason_lock:
            if self._reason is not None:
                return
            self._reason = reason
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    def join(self) -> None:
        """Wait until the reader thread has ended."""
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _read(self) -> None:
        try:
            self._read_until_closed()
        finally:  # also where a listener failed: a link that nobody reads must not look like one that is up
            self.close("%s: the driver failed to read it" % self.name)
            self._socket.close()
            self._on_closed(self._reason or "")

    def _read_until_closed(self) -> None:
        last = time.monotonic()
        while self._reason is None:
            try:
                data = self._socket.recv(_RECEIVE_BYTES)
            except socket.timeout:
                silent = time.monotonic() - last
                if self._silence_timeout is not None and silent > self._silence_timeout:
                    self.close("%s: silent for %.1f s" % (self.name, silent))
            except OSError as error:
                self.close("%s: %s" % (self.name, error))
            else:
                if not data:
                    self.close("%s: closed by the controller" % self.name)
                    break
                last = time.monotonic()
                self._on_bytes(data, len(data) == _RECEIVE_BYTES)
            if self._on_idle is not None:
                self._on_idle()


class Pending:
    """A request that waits for its reply, or that only wants to hear of a refusal."""

    def __init__(self, command: Command, timeout: float, on_rejected: Optional[Rejected] = None) -> None:
        self.command = command
        self.timeout = timeout
        self.on_rejected = on_rejected
        self.event = threading.Event()
        self.reply: Optional[Mapping[str, Any]] = None


class CommandLink:
    """The command port: requests out, replies back, several may be on their way (controller protocol 3.2).

    A late reply ends the connection: what the controller did of that command is unknown, and later replies could
    no longer be told apart.
    """

    def __init__(self, host: str, port: int, connect_timeout: float, reply_timeout: float,
                 on_closed: Callable[[str], None]) -> None:
        """Connect.

        Raises:
            ConnectionLost: The controller cannot be reached.
        """
        self._reply_timeout = reply_timeout
        self._on_closed = on_closed
        self._stream = ObjectStream()
        self._exchange: Exchange[Pending] = Exchange()
        self._exchange_lock = threading.Lock()
        self._send_lock = threading.Lock()
        self._closed_reason = ""
        self.damaged_replies = 0
        self._connection = Connection(host, port, connect_timeout, "command port", self._received, self._closed,
                                      on_idle=self._check_overdue)
        self._connection.start()

    @property
    def is_open(self) -> bool:
        """False once the connection has ended."""
        return not self._closed_reason

    def request(self, command: Command, reply_timeout: Optional[float] = None) -> Any:
        """Send the command and wait for the controller's word on it.

        Returns:
            The command's result, None where it has none.

        Raises:
            InvalidCommand: A number in it is not finite; nothing was sent.
            CommandRejected: The controller refused it.
            ReplyTimeout: No reply in time; the connection is closed.
            ConnectionLost: The connection ended before the reply.
            ProtocolError: The reply does not hold the result.
        """
        return self.finish(self.begin([command], reply_timeout)[0])

    def begin(self, commands: List[Command], reply_timeout: Optional[float] = None) -> List["Pending"]:
        """Send the commands in one go, and return what to wait for with ``finish``, one for each.

        Raises:
            InvalidCommand: A number in them is not finite; nothing was sent.
            ConnectionLost: The connection is closed.
        """
        timeout = self._reply_timeout if reply_timeout is None else reply_timeout
        pendings = [Pending(command, timeout) for command in commands]
        self._send(pendings)
        return pendings

    def finish(self, pending: "Pending") -> Any:
        """Wait for the reply to a command sent with ``begin``; result and errors as ``request``."""
        if not pending.event.wait(pending.timeout + _POLL_S):
            name = codec.command_name(pending.command)
            self._connection.close("no reply to %s within %.3g s" % (name, pending.timeout))
            raise ReplyTimeout(name, pending.timeout)
        if pending.reply is None:
            raise ConnectionLost(self._closed_reason or "command port closed")
        return codec.decode(pending.command, pending.reply)

    def post(self, command: Command, on_rejected: Rejected) -> None:
        """Send a command without waiting for its reply; a refusal is told in the reader thread.

        Raises:
            InvalidCommand: A number in it is not finite; nothing was sent.
            ConnectionLost: The connection is closed.
        """
        self._send([Pending(command, self._reply_timeout, on_rejected)])

    def close(self, reason: str) -> None:
        """End the connection; who waits for a reply gets ConnectionLost."""
        self._connection.close(reason)
        self._connection.join()

    def _send(self, pendings: List[Pending]) -> None:
        texts = [encode_object(codec.encode(pending.command)) for pending in pendings]
        with self._send_lock:
            now = time.monotonic()
            with self._exchange_lock:
                if self._closed_reason:
                    raise ConnectionLost(self._closed_reason)
                for pending in pendings:
                    self._exchange.sent(codec.command_name(pending.command), now, pending.timeout, pending)
            for text in texts:
                self._connection.send(text)

    def _received(self, data: bytes, is_backlog: bool) -> None:
        for item in self._stream.feed(data):
            if isinstance(item, FramingError):
                self.damaged_replies += 1
                continue
            with self._exchange_lock:
                request = self._exchange.answered(item)
            if request is not None and request.waiter is not None:
                self._deliver(request.waiter, item)

    @staticmethod
    def _deliver(pending: Pending, reply: Mapping[str, Any]) -> None:
        pending.reply = reply
        pending.event.set()
        if pending.on_rejected is not None:
            try:
                codec.raise_if_rejected(codec.command_name(pending.command), reply)
            except CommandRejected as rejection:
                pending.on_rejected(rejection)
            except ProtocolError as error:
                pending.on_rejected(CommandRejected(codec.command_name(pending.command), "none", str(error)))

    def _check_overdue(self) -> None:
        now = time.monotonic()
        with self._exchange_lock:
            late = self._exchange.overdue(now)
        if late is not None:
            self._connection.close("no reply to %s within %.3g s" % (late.name, now - late.sent_at))

    def _closed(self, reason: str) -> None:
        with self._exchange_lock:
            self._closed_reason = reason or "command port closed"
            lost = self._exchange.abandon()
        for request in lost:
            if request.waiter is not None:
                request.waiter.event.set()
        self._on_closed(self._closed_reason)
