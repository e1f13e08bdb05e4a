"""The wire between driver and controller: TCP connections that are late, stand still, break, or are never made.

TCP's guarantees hold: the bytes of one direction stay in order and whole, and nothing arrives that was not sent. What
TCP leaves open is drawn: how bytes are cut into pieces, how late they are, how many a second get through, and whether
both ends learn of an end.
"""
import random
from collections import deque
from typing import Any, Callable, Deque, List, NamedTuple, Optional, Protocol, Tuple

from virtual_clock import Clock

from jaka_ros_driver.client.core.actions import Port

CONNECT_ROUND_TRIPS = 1.0
_AFTER_BACKLOG = 0.3
"""Time after a backlog, s: its last bytes were late like those before them, and they may be read a little later."""
_PIECE_GAPS = (0.0001, 0.002)
PORTS = (Port.COMMAND, Port.STATUS)


class Terms:
    """The conditions of one direction of a port, on every connection.

    Attributes:
        latency: Shortest and longest, s.
        stalled_until: Nothing arrives before; then all of it at once.
        splits_until: Until then bytes arrive in random pieces.
        slow_until: Until then only ``rate`` bytes a second get through; the others queue up behind them.
        rate: Bytes a second.
    """

    def __init__(self, latency: Tuple[float, float]) -> None:
        self.latency = latency
        self.stalled_until = 0.0
        self.splits_until = 0.0
        self.slow_until = 0.0
        self.rate = 0.0


class Arrival(NamedTuple):
    """Bytes at the far end, and the marks of the messages that ended in them."""

    data: bytes
    marks: Tuple[Any, ...]


class _Message(NamedTuple):
    at: float
    data: Optional[bytes]  # None: the end of the stream
    marks: Tuple[Tuple[int, Any], ...]  # each with the bytes after which a reader has what it marks


class Pipe:
    """One direction of a connection.

    Attributes:
        is_dead: Nothing arrives any more.
        unsent_bytes: Bytes on their way.
    """

    def __init__(self, clock: Clock, chance: random.Random, terms: Terms, deliver: Callable[[Arrival], None],
                 ended: Callable[[], None]) -> None:
        self._clock, self._chance, self._terms = clock, chance, terms
        self._deliver, self._ended = deliver, ended
        self._queue: Deque[_Message] = deque()
        self._is_waiting = False
        self._busy_until = 0.0
        self.is_dead = False
        self.unsent_bytes = 0

    @property
    def is_backed_up(self) -> bool:
        """True while bytes wait for others that a slow link has not carried yet, or did a moment ago."""
        return not self.is_dead and self._busy_until + _AFTER_BACKLOG > self._clock.now

    def send(self, data: Optional[bytes], mark: Any = None, copies: int = 1) -> None:
        """Put bytes in; None ends the stream behind what was sent before.

        ``copies``: how often these bytes hold what is marked; a reader has it after the first.
        """
        if self.is_dead:
            return
        low, high = self._terms.latency
        at = self._clock.now + low + (high - low) * self._chance.random()
        if self._clock.now < self._terms.slow_until:
            self._busy_until = max(self._busy_until, self._clock.now) + len(data or b"") / self._terms.rate
            at += self._busy_until - self._clock.now
        if self._queue and at < self._queue[-1].at:
            at = self._queue[-1].at
        self.unsent_bytes += len(data or b"")
        self._queue.append(_Message(at, data, () if mark is None else ((len(data or b"") // copies, mark),)))
        self._wait()

    def wake(self) -> None:
        """Compute anew when the next bytes are due, after the terms have changed."""
        self._is_waiting = False
        self._wait()

    def catch_up(self) -> None:
        """Carry at once what a slow link has held back."""
        latest = self._clock.now + self._terms.latency[1]
        self._queue = deque(message._replace(at=min(message.at, latest)) for message in self._queue)
        self._busy_until = min(self._busy_until, self._clock.now)
        self.wake()

    def die(self) -> None:
        """Drop everything on its way, and notify nobody."""
        self.is_dead = True
        self._queue.clear()

    def _wait(self) -> None:
        if not self._is_waiting and self._queue and not self.is_dead:
            self._is_waiting = True
            self._clock.at(max(self._queue[0].at, self._terms.stalled_until), self._arrive)

    def _arrive(self) -> None:
        now, queue = self._clock.now, self._queue
        self._is_waiting = False
        if self.is_dead or now < self._terms.stalled_until or not queue or queue[0].at > now:
            self._wait()
            return
        message = queue.popleft()
        if not queue or queue[0].at > now:
            data, marks = message.data, message.marks  # the usual case: one message
        else:
            queue.appendleft(message)
            data, marks = self._all_due(now)
        if data is not None and now < self._terms.splits_until and len(data) > 1:
            here = self._chance.randrange(1, len(data))
            queue.appendleft(_Message(now + self._chance.uniform(*_PIECE_GAPS), data[here:], tuple(
                [(end - here, mark) for end, mark in marks if end > here])))
            data, marks = data[:here], tuple([(end, mark) for end, mark in marks if end <= here])
        self._wait()
        if data is not None:
            self.unsent_bytes -= len(data)
            self._deliver(Arrival(data, tuple([mark for _, mark in marks])))
        else:
            self.is_dead = True
            self._ended()

    def _all_due(self, now: float) -> Tuple[Optional[bytes], Tuple[Tuple[int, Any], ...]]:
        """Return all bytes that are due, in one piece; the end of the stream comes alone."""
        pieces: List[bytes] = []
        marks: List[Tuple[int, Any]] = []
        length = 0
        queue = self._queue
        while queue and queue[0].at <= now and not (pieces and queue[0].data is None):
            message = queue.popleft()
            if message.data is None:
                return None, ()
            pieces.append(message.data)
            marks += [(length + end, mark) for end, mark in message.marks]
            length += len(message.data)
        return b"".join(pieces), tuple(marks)


class Host(Protocol):
    """A process that connects to the controller: a driver, its guard, or a rival.

    Attributes:
        name: Identifies it in the controller's records.
    """

    name: str

    def arrived(self, cable: "Cable", arrival: Arrival) -> None:
        """Take bytes that have come to this host."""

    def lost(self, cable: "Cable") -> None:
        """Handle the end of a connection."""


class Cable:
    """One TCP connection, as both ends see it.

    Attributes:
        host: Who made it.
        port: The controller's port.
        number: Counts connections.
        driver_knows, controller_knows: That end believes that it is open; "driver" is its host, of any name.
    """

    def __init__(self, network: "Network", host: Host, port: Port, number: int) -> None:
        self.host, self.port, self.number = host, port, number
        self.driver_knows = self.controller_knows = True
        self._is_cut = False
        clock, chance = network.clock, network.chance
        self.to_controller = Pipe(clock, chance, network.terms[port, True],
                                  lambda arrival: network.at_controller(self, arrival), self._controller_learns)
        self.to_driver = Pipe(clock, chance, network.terms[port, False],
                              lambda arrival: host.arrived(self, arrival), self._driver_learns)
        self._network = network

    @property
    def works(self) -> bool:
        """True while bytes get through both ways."""
        return not (self.to_controller.is_dead or self.to_driver.is_dead) and self.driver_knows

    def close_by_driver(self) -> None:
        """Close the driver's end: bytes sent before still arrive, then the end."""
        self.driver_knows = False
        self.to_driver.die()
        self.to_controller.send(None)

    def close_by_controller(self) -> None:
        """Close the controller's end: bytes sent before still arrive, then the end."""
        self.controller_knows = False
        self.to_controller.die()
        self.to_driver.send(None)

    def cut(self, driver_learns: bool, controller_learns: bool) -> None:
        """Cut the connection: bytes on their way are lost, and each end learns of it or not."""
        self.to_controller.die()
        self.to_driver.die()
        self._is_cut = True
        if driver_learns:
            self._driver_learns()
        if controller_learns:
            self._controller_learns()

    def send(self, data: bytes, acknowledge_timeout: float) -> None:
        """Send to the controller; the host learns in so many s that nobody acknowledges what a cut has swallowed."""
        self.to_controller.send(data)
        if self._is_cut:
            self._network.clock.after(acknowledge_timeout, self._driver_learns)

    def controller_finds_it_dead(self) -> None:
        """Let the controller's host find out that nobody is at the other end."""
        if not self.works:
            self._controller_learns()

    def _driver_learns(self) -> None:
        if self.driver_knows:
            self.driver_knows = False
            self.host.lost(self)

    def _controller_learns(self) -> None:
        if self.controller_knows:
            self.controller_knows = False
            self._network.controller_lost(self)


class Network:
    """The maker of connections, which knows those that exist.

    Attributes:
        at_controller: Called with a cable and the bytes that have arrived at the controller.
        controller_lost: Called when the controller learns that a connection is over.
        accepted: Called with a new cable at the controller.
        refused_until, unreachable_until: By port; refused at once, or no answer at all.
        is_off: The controller is without power: nobody listens.
    """

    def __init__(self, clock: Clock, chance: random.Random, latency: Tuple[float, float]) -> None:
        self.clock, self.chance = clock, chance
        self.terms = {(port, to_controller): Terms(latency) for port in PORTS for to_controller in (True, False)}
        self.cables: List[Cable] = []
        self.refused_until = dict.fromkeys(PORTS, 0.0)
        self.unreachable_until = dict.fromkeys(PORTS, 0.0)
        self.is_off = False
        self.at_controller: Callable[[Cable, Arrival], None] = lambda cable, arrival: None
        self.controller_lost: Callable[[Cable], None] = lambda cable: None
        self.accepted: Callable[[Cable], None] = lambda cable: None
        self._count = 0

    def connect(self, host: Host, port: Port, timeout: float, done: Callable[[Optional[Cable], str], None]) -> None:
        """Try to connect; ``done`` gets the cable, or None and the reason."""
        if self.clock.now < max(self.unreachable_until[port], self.terms[port, True].stalled_until,
                                self.terms[port, False].stalled_until):
            self.clock.after(timeout, lambda: done(None, "timed out"))
            return
        low, high = self.terms[port, True].latency
        delay = 2.0 * CONNECT_ROUND_TRIPS * (low + (high - low) * self.chance.random())
        self.clock.after(delay, lambda: self._connected(host, port, done))

    def _connected(self, host: Host, port: Port, done: Callable[[Optional[Cable], str], None]) -> None:
        if self.is_off or self.clock.now < max(self.refused_until[port], self.unreachable_until[port]):
            done(None, "connection refused")
            return
        self._count += 1
        cable = Cable(self, host, port, self._count)
        self.cables = [other for other in self.cables if other.driver_knows or other.controller_knows] + [cable]
        self.accepted(cable)
        done(cable, "")

    def on(self, port: Port) -> List[Cable]:
        """Return a port's connections that at least one end takes for open."""
        return [cable for cable in self.cables if cable.port is port and (cable.driver_knows or cable.controller_knows)]

    def carries(self, port: Port) -> bool:
        """Return whether a new connection would be made now, and carry bytes."""
        return not self.is_off and self.clock.now >= max(self.refused_until[port], self.unreachable_until[port],
                                     self.terms[port, True].stalled_until, self.terms[port, False].stalled_until)

    def is_slow(self, port: Port, to_controller: bool) -> bool:
        """Return whether bytes of this direction queue up, or did and are still on their way."""
        return self.clock.now < self.terms[port, to_controller].slow_until or any(
            (cable.to_controller if to_controller else cable.to_driver).is_backed_up for cable in self.on(port))

    def heal(self) -> None:
        """End every obstacle to connections; broken connections stay broken."""
        now = self.clock.now
        for port in PORTS:
            self.refused_until[port] = min(self.refused_until[port], now)
            self.unreachable_until[port] = min(self.unreachable_until[port], now)
        for terms in self.terms.values():
            terms.stalled_until = min(terms.stalled_until, now)
            terms.splits_until = min(terms.splits_until, now)
            terms.slow_until = min(terms.slow_until, now)
        for cable in self.cables:
            cable.to_controller.catch_up()
            cable.to_driver.catch_up()
