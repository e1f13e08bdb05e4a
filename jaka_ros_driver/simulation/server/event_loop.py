"""The sockets of the simulated controller: its ports, served by one thread that also runs the cycles.

One loop does everything, so that nothing needs a lock: it wakes up for cycles, status frames, bytes, and calls from
other threads. It never waits for a client: one that does not read misses frames or is dropped.
"""
import json
import queue
import select
import selectors
import socket
import time
import zlib
from concurrent.futures import Future, wait
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

from jaka_ros_driver.errors import ConnectionLost, FramingError
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.command_spec import LINK_LOSS_COMMAND, Then
from jaka_ros_driver.simulation.controller.executor import Controller, RequestResult
from jaka_ros_driver.simulation.controller.replies import not_understood
from jaka_ros_driver.simulation.dialect.table import COEXISTS, REFUSED
from jaka_ros_driver.simulation.server.connection import FRAME_BACKLOG_BYTES, MAX_UNSENT_BYTES, ClientConnection
from jaka_ros_driver.simulation.server.cycle_clock import CycleClock
from jaka_ros_driver.simulation.server.faults import Delivery, Effect, FaultScript
from jaka_ros_driver.wire import sockets
from jaka_ros_driver.wire.listeners import Listeners
from jaka_ros_driver.wire.log import WireLog
from jaka_ros_driver.wire.sockets import LOOPBACK

OPERATOR = "panel"
"""The operator port's name in the first line of output, in options and in logs."""
_REQUESTS_A_TURN = 20
"""Most requests of a connection in one turn: a flood of them delays no cycle."""
_MAX_CLIENTS = 32
"""Most connections of a port; one more ends the one that is needed least."""
_IDLE_S = 1.0
"""Longest wait, s, where nothing is due."""
_LATE_EVERY = 50
"""One of so many replies has the longer of the two delays: 99 of 100 then come within it."""
_COMPRESSION = 1
"""Level of zlib: the fastest, because nobody else is served meanwhile."""
_LONGEST_ANSWER = 1 << 18
"""Longest answer of the operator port, bytes, that its caller reads."""

OperatorHandler = Callable[[Dict[str, Any]], Dict[str, Any]]


class ControllerServer:
    """The server of one controller.

    Attributes:
        controller: The controller.
        faults: The script of wire faults.
        is_off: True while the controller is turned off: only the operator port listens, and simulated time stands
            still.
        port_numbers: TCP port number by name of the port.
    """

    def __init__(self, controller: Controller, host: str, ports: Mapping[str, int], *, time_scale: float = 1.0,
                 seed: int = 0, log: Optional[WireLog] = None, reply_delays: Tuple[float, float] = (0.0, 0.0),
                 operator_handler: Optional[OperatorHandler] = None) -> None:
        """Listen; raise OSError where a port cannot be bound.

        Args:
            controller: The controller to serve.
            host: Address for the ports; the operator port always listens on loopback.
            ports: TCP port by name, 0 for a free one: those of ``PORTS`` and, for an operator port, ``OPERATOR``.
            time_scale: Simulated seconds a wall second.
            seed: Of the random generator of the wire faults.
            log: Receives every byte.
            reply_delays: Delays of replies, s of simulated time: the usual one, and that of one of fifty.
            operator_handler: Answers the operator port's requests.
        """
        self.controller = controller
        self.faults = FaultScript(seed)
        self.is_off = False
        self._log = log
        self._reply_delays = tuple(delay / time_scale for delay in reply_delays)
        self._replies = 0
        self._operator_handler = operator_handler
        self._selector = selectors.EpollSelector()
        self._listeners = Listeners(self._selector)
        self.port_numbers = self._listeners.numbers
        self._sockets: Dict[ClientConnection, socket.socket] = {}
        self._command_client: Optional[ClientConnection] = None
        self._loss_matters_of: Optional[ClientConnection] = None
        self._count = 0
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._wake_receive, self._wake_send = socket.socketpair()
        self._wake_receive.setblocking(False)
        self._selector.register(self._wake_receive, selectors.EVENT_READ)
        self._is_running = False
        self._is_closed = False
        self._stalled_until: Dict[str, float] = {}
        self._refusing_until: Dict[str, float] = {}
        self._boot_at: Optional[float] = None
        self._clock = CycleClock(time_scale, time.monotonic())
        try:
            for port, number in ports.items():
                self._listeners.add(port, LOOPBACK if port == OPERATOR else host, number)
        except OSError:
            self.close()
            raise

    # --- life -------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Serve until ``stop``; then close every socket."""
        self._is_running = True
        self._clock.restart(time.monotonic())
        try:
            while self._is_running:
                self._turn()
        finally:
            self.close()

    def stop(self) -> None:
        """End ``run``; from any thread or signal handler."""
        self._calls.put(self._end)
        self._wake()

    def _end(self) -> None:
        self._is_running = False

    def call(self, action: Callable[[], Any], timeout: float = 30.0) -> Any:
        """Call ``action`` in the server's thread, and return its result.

        It raises what ``action`` raises, and ConnectionLost where the thread does not run.
        """
        done: Future[Any] = Future()

        def act() -> None:
            try:
                done.set_result(action())
            except Exception as error:  # raised again in the caller's thread
                done.set_exception(error)

        self._calls.put(act)
        self._wake()
        deadline = time.monotonic() + timeout
        while not wait([done], 0.1).done:
            if self._is_closed or time.monotonic() > deadline:
                raise ConnectionLost("the simulated controller does not run")
        return done.result()

    def _wake(self) -> None:
        try:
            self._wake_send.send(b"\0")
        except OSError:
            pass  # full: the loop will wake up anyway; closed: the loop has ended

    def close(self) -> None:
        """Close every socket."""
        self._is_closed = True
        for connection in list(self._sockets):
            self._drop(connection)
        self._listeners.close()
        self._selector.close()
        self._wake_receive.close()
        self._wake_send.close()

    # --- the loop ---------------------------------------------------------------------------------------------------

    def _turn(self) -> None:
        now = time.monotonic()
        self._advance(now)
        self._end_of_faults(now)
        for connection in list(self._sockets):
            self._serve(connection, now)
        self._wait(time.monotonic())
        for key, events in self._selector.select(0):
            if key.fileobj is self._wake_receive:
                self._take_calls()
            elif isinstance(key.data, str):
                self._accept(key.data, key.fileobj)
            elif events & selectors.EVENT_READ and key.data in self._sockets:
                self._read(key.data, time.monotonic())

    def _wait(self, now: float) -> None:
        """Wait for the next deadline or event. epoll counts in whole ms; select on epoll's descriptor is exact."""
        deadline = self._next_deadline(now)
        if deadline > now:
            select.select([self._selector.fileno()], [], [], deadline - now)

    def _next_deadline(self, now: float) -> float:
        times = [now + _IDLE_S, *self._refusing_until.values(), *self._stalled_until.values()]
        if self._boot_at is not None:
            times.append(self._boot_at)
        if not self.is_off:
            times.append(self._clock.next_tick)
            if self._clients("status"):
                times.append(self._clock.next_frame)
        for connection in self._sockets:
            if connection.is_half_open or self._is_stalled(connection.port, now):
                continue
            if connection.inbox and not connection.replies.is_blocked and not connection.is_closing:
                return now
            for moment in (connection.next_due(), connection.parser.next_deadline()):
                if moment is not None and not connection.has_unsent():
                    times.append(moment)
        return min(times)

    def _advance(self, now: float) -> None:
        if self.is_off:
            return
        cycles = self._clock.due_cycles(now)
        for _ in range(cycles):
            self.controller.step(CYCLE_TIME_S)
        if cycles and self._log:
            self._log.joints(time.monotonic_ns(), self.controller.state.now,
                             self.controller.state.plant.joint_position)
        # A controller skips no frame because its client's computer is busy; what comes late has the state of now.
        for _ in range(self._clock.due_frames(now, self.controller.state.feed_period)):
            self._send_frames(now)

    def _take_calls(self) -> None:
        sockets.receive(self._wake_receive)
        while not self._calls.empty():
            self._calls.get()()

    # --- clients ----------------------------------------------------------------------------------------------------

    def _clients(self, port: str) -> List[ClientConnection]:
        """Return the connections of a port, without those that are half open."""
        return [one for one in self._sockets if one.port == port and not one.is_half_open]

    def _accept(self, port: str, listener: Any) -> None:
        accepted = sockets.accept(listener)
        if accepted is None:
            return
        client, peer = accepted
        if port == "command" and self._second_client == REFUSED and self._has_client():
            client.close()
            return
        present = [one for one in self._sockets if one.port == port]
        if len(present) >= _MAX_CLIENTS:
            self._drop(self._least_needed(present))
        self._count += 1
        if self._log:
            sockets.stamp_arrivals(client)
        connection = ClientConnection(port, self._count, peer, time.monotonic())
        self._sockets[connection] = client
        self._selector.register(client, selectors.EVENT_READ, connection)
        self._note(connection, "open")
        if port == "command" and not self._has_client() and (
                self._second_client != COEXISTS or len(self._clients("command")) == 1):
            self._take_over(connection)

    @property
    def _second_client(self) -> str:
        return self.controller.state.dialect.second_client

    def _take_over(self, connection: ClientConnection) -> None:
        """Make this the command client from now on.

        Another one is dropped (docs/controller-protocol.md section 1).
        """
        replaced, self._command_client = self._command_client, connection
        self._loss_matters_of = None
        if replaced is not None:
            self._drop(replaced)
        self.controller.state.client_connected()

    def _come_in(self, connection: ClientConnection) -> None:
        """Make room for the request of another client than the command client, by the dialect.

        Where clients coexist, one that comes changes nothing that the others have set, and the command client is the
        one that was here first.
        """
        if self._second_client != COEXISTS:
            self._take_over(connection)
        elif self._command_client is None:
            self._command_client = connection

    def _least_needed(self, clients: List[ClientConnection]) -> ClientConnection:
        """Return the client of a full port that goes: one that reads nothing any more, else the one idle for the
        longest time.

        The command client stays, and so does the client of another port that came together with it: both are one
        process's.
        """
        owner = self._command_client
        spared = None if owner is None else min(clients, key=lambda one: abs(one.opened_at - owner.opened_at))
        return min((one for one in clients if one is not spared), key=lambda one: (
            not one.is_half_open, not one.unsent_bytes, one.last_request_at))

    def _drop(self, connection: ClientConnection) -> None:
        client = self._sockets.pop(connection, None)
        if client is None:
            return
        self._unwatch(client)
        sockets.close(client, connection.resets)
        self._note(connection, "reset" if connection.resets else "close")
        self._client_lost(connection)

    def _has_client(self) -> bool:
        """Return whether a command client is connected; one whose connection is half open does not count."""
        return self._command_client is not None

    def _client_lost(self, connection: ClientConnection) -> None:
        """Handle a connection that ended or fell silent for good: the command client's leaves no one in its place.

        What ``set_network_exception_handle`` has set follows the loss of the connection on which it came.
        """
        if connection is self._command_client:
            self._command_client = None
        if connection is self._loss_matters_of:
            self._loss_matters_of = None
            if not self.is_off:
                self.controller.state.client_lost()

    def _note(self, connection: ClientConnection, what: str) -> None:
        if self._log:
            self._log.event(time.monotonic_ns(), connection.port, connection.number, what, connection.peer)

    def _read(self, connection: ClientConnection, now: float) -> None:
        if connection.is_half_open or self._is_stalled(connection.port, now):
            return
        # All that waits at once: a busy computer's pause between two readings would be taken for one of the client.
        data, arrived_ns = sockets.receive_stamped(self._sockets[connection])
        if data is None:
            return
        if not data:
            self._drop(connection)
            return
        if self._log and connection.port != OPERATOR:
            self._log.bytes_in(arrived_ns, connection.port, connection.number, data)
        if connection.port != "status":
            connection.inbox.extend(connection.parser.feed(data, now))
        self._carry_out(connection, now)
        self._flush(connection, now)

    def _serve(self, connection: ClientConnection, now: float) -> None:
        """Do what is due by time: requests that were not finished, held replies, scheduled deliveries."""
        if connection.is_half_open:
            return
        if self._is_stalled(connection.port, now):
            self._unwatch(self._sockets[connection])
            return
        connection.inbox.extend(connection.parser.expire(now))
        self._carry_out(connection, now)
        self._flush(connection, now)

    def _carry_out(self, connection: ClientConnection, now: float) -> None:
        self._send_replies(connection, now)
        for _ in range(_REQUESTS_A_TURN):
            if connection.replies.is_blocked or not connection.inbox or connection.is_closing:
                return
            if self.is_off and connection.port != OPERATOR:
                return
            request = connection.inbox.popleft()
            connection.last_request_at = now
            if connection.port == "command" and connection is not self._command_client:
                if not isinstance(request, dict):
                    self._refuse(connection, not_understood(self.controller.state.dialect), now)
                    return
                self._come_in(connection)
            if connection.port == "poll":
                if isinstance(request, dict) and request.get("cmdName") == "data_request":
                    self._answer_poll(connection, now)
            elif connection.port == OPERATOR:
                self._answer_operator(connection, request, now)
            else:
                result = self.controller.execute(request)
                if result.command == LINK_LOSS_COMMAND:
                    self._loss_matters_of = connection
                connection.replies.add(result)
                self._send_replies(connection, now)

    def _send_replies(self, connection: ClientConnection, now: float) -> None:
        for result in connection.replies.take_due():
            self._reply(connection, result, now)

    def _reply(self, connection: ClientConnection, result: RequestResult, now: float) -> None:
        self._replies += 1
        delay = self._reply_delays[self._replies % _LATE_EVERY == 0]
        connection.post(self.faults.deliveries("command", result.due_reply(), result.command, now + delay))
        if result.then is not Then.NOTHING:
            connection.post([Delivery(b"", now, Effect.CLOSE)])
        if result.then is Then.SHUT_DOWN:
            self._calls.put(lambda: self.shut_down(None) if OPERATOR in self.port_numbers else self._end())
            self._wake()

    def _answer_poll(self, connection: ClientConnection, now: float) -> None:
        text = self.faults.frame_text("poll", self.controller.polled_frame.text())
        connection.post(self.faults.deliveries("poll", zlib.compress(text, _COMPRESSION), None, now))

    def _answer_operator(self, connection: ClientConnection, request: Any, now: float) -> None:
        if isinstance(request, FramingError) or self._operator_handler is None:
            answer = {"ok": False, "error": "%s; the operator port takes JSON objects only" % request}
            self._refuse(connection, json.dumps(answer).encode("utf-8") + b"\n", now)
        else:
            connection.post([Delivery(json.dumps(self._operator_handler(request)).encode("utf-8") + b"\n", now)])

    @staticmethod
    def _refuse(connection: ClientConnection, text: bytes, now: float) -> None:
        """Answer and close, whatever else has come: a web page can send bytes here, with requests among them."""
        connection.inbox.clear()
        connection.is_closing = True
        connection.post([Delivery(text, now)])

    def _send_frames(self, now: float) -> None:
        clients = [connection for connection in self._clients("status")
                   if connection.unsent_bytes <= FRAME_BACKLOG_BYTES]
        if not clients or self._is_stalled("status", now):
            return
        text = self.controller.feed_frame.text()
        for connection in clients:
            connection.post(self.faults.deliveries("status", self.faults.frame_text("status", text), None, now))

    def _flush(self, connection: ClientConnection, now: float) -> None:
        if connection not in self._sockets:
            return
        try:
            connection.pump(now, lambda data: self._send(connection, data))
        except OSError:
            self._drop(connection)
            return
        if connection.is_half_open:
            self._unwatch(self._sockets[connection])
            self._note(connection, "half open")
            self._client_lost(connection)
        elif connection.unsent_bytes > MAX_UNSENT_BYTES or (connection.is_closing and not connection.has_unsent()):
            self._drop(connection)
        else:
            self._watch(connection)

    def _watch(self, connection: ClientConnection) -> None:
        """Wait for bytes only while no request waits, and for room only while something is unsent."""
        events = 0 if connection.inbox or connection.is_closing else selectors.EVENT_READ
        events |= selectors.EVENT_WRITE if connection.has_unsent() else 0
        sockets.watch(self._selector, self._sockets[connection], events, connection)

    def _unwatch(self, client: socket.socket) -> None:
        sockets.watch(self._selector, client, 0)

    def _send(self, connection: ClientConnection, data: bytes) -> int:
        begun_ns = time.monotonic_ns()  # before it is sent: an answer to it must not seem to have come first
        try:
            taken = self._sockets[connection].send(data)
        except BlockingIOError:
            return 0
        if self._log and connection.port != OPERATOR:
            self._log.bytes_out(begun_ns, connection.port, connection.number, data[:taken])
        return taken

    # --- faults that concern whole ports ----------------------------------------------------------------------------

    def _is_stalled(self, port: str, now: float) -> bool:
        return now < self._stalled_until.get(port, now)

    def stall(self, ports: Tuple[str, ...], duration: float) -> None:
        """Stop reading and sending on these ports for ``duration`` s; command clients count as lost meanwhile."""
        until = time.monotonic() + duration
        self._stalled_until.update((port, until) for port in ports)
        if "command" in ports and duration > 0.0 and not self.is_off and self._loss_matters_of is not None:
            self.controller.state.client_lost()

    def end_connections(self, ports: Tuple[str, ...], effect: Effect) -> int:
        """Close, reset or half-open every connection of these ports now; return how many there were."""
        now = time.monotonic()
        struck = [connection for port in ports for connection in self._clients(port)]
        for connection in struck:
            connection.post([Delivery(b"", now, effect)])
            self._flush(connection, now)
        return len(struck)

    def refuse(self, ports: Tuple[str, ...], duration: float) -> None:
        """Refuse new connections on these ports for ``duration`` s of wall time."""
        until = time.monotonic() + duration
        for port in ports:
            self._listeners.shut(port)
            self._refusing_until[port] = until

    def shut_down(self, down: Optional[float], silent: bool = False) -> None:
        """Turn the controller off: drive power and connections end, and no port but the operator's listens.

        Args:
            down: Time until it starts again by itself, s of wall time; None for never.
            silent: True where clients notice nothing, as when the power fails; otherwise their connections are closed.
        """
        self.is_off = True
        self.end_connections(PORTS, Effect.HALF_OPEN if silent else Effect.CLOSE)
        for port in PORTS:
            self._listeners.shut(port)
        self._boot_at = None if down is None else time.monotonic() + down

    def boot(self) -> None:
        """Start the controller again; no effect while it is on."""
        if not self.is_off:
            return
        self.is_off, self._boot_at = False, None
        self._stalled_until.clear()
        self._refusing_until.clear()
        self.controller.restart()
        self._clock.restart(time.monotonic())
        for connection in [c for c in self._sockets if c.is_half_open]:
            connection.resets = True
            self._drop(connection)
        for port in PORTS:
            self._listeners.open(port)

    def _end_of_faults(self, now: float) -> None:
        for port in [port for port, until in self._stalled_until.items() if now >= until]:
            del self._stalled_until[port]
            if port == "command" and self._clients("command"):
                self.controller.state.client_back()
        for port in [port for port, until in self._refusing_until.items() if now >= until]:
            del self._refusing_until[port]
            if not self.is_off:
                self._listeners.open(port)
        if self._boot_at is not None and now >= self._boot_at:
            self.boot()

    def described(self) -> Dict[str, Any]:
        """Return the connections, faults and lateness of the cycles, for the operator port's action ``wire``."""
        return {
            "connections": [{"port": c.port, "number": c.number, "peer": c.peer, "half_open": c.is_half_open,
                             "unsent_bytes": c.unsent_bytes} for c in self._sockets],
            "faults": [rule.described() for rule in self.faults.active()],
            "is_off": self.is_off, "failures": self.controller.failures,
            "cycle_lateness": self._clock.lateness()}


def ask_operator_port(port: int, request: Dict[str, Any], timeout: float = 10.0) -> Dict[str, Any]:
    """Send a request to a simulated controller's operator port on this machine, and return the answer.

    Raises:
        ConnectionLost: Nobody answers.
    """
    try:
        with socket.create_connection((LOOPBACK, port), timeout) as link:
            link.sendall(json.dumps(request).encode("utf-8") + b"\n")
            with link.makefile("rb") as stream:
                answer: Dict[str, Any] = json.loads(stream.readline(_LONGEST_ANSWER))
    except (OSError, ValueError) as error:
        raise ConnectionLost("no operator port answers on port %d: %s" % (port, error)) from error
    return answer
