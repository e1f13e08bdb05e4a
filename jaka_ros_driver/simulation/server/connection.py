"""One client of one port: what it sent and is not answered yet, what it is to be sent and when. Time is told."""
from collections import deque
from typing import Callable, Deque, List, NamedTuple, Optional

from jaka_ros_driver.simulation.controller.command_spec import Then
from jaka_ros_driver.simulation.server.faults import Delivery, Effect
from jaka_ros_driver.simulation.server.request_parser import Item, RequestParser

MAX_UNSENT_BYTES = 1 << 20
"""A command client that lets so much pile up is dropped."""
FRAME_BACKLOG_BYTES = 1 << 16
"""A status client that lets so much pile up misses frames until it has read them."""


class HeldReply(NamedTuple):
    """A reply that waits for something, and with it every later request of the client (controller protocol 5.4.6)."""

    until: Callable[[], bool]
    command: Optional[str]
    reply: bytes
    then: Then


class Connection:
    """One accepted connection, without its socket.

    Attributes:
        port: "command", "status" or "poll".
        number: Counts the connections of a server, from 1.
        peer: Address of the client.
        parser: Cuts requests out of what it sends.
        inbox: Requests not yet carried out.
        held: The reply that holds the inbox up.
        is_half_open: Nothing is read or sent any more, as a wire fault.
        is_closing: It is closed once everything is sent.
        resets: The end is a reset, not a close.
    """

    def __init__(self, port: str, number: int, peer: str) -> None:
        self.port = port
        self.number = number
        self.peer = peer
        self.parser = RequestParser()
        self.inbox: Deque[Item] = deque()
        self.held: Optional[HeldReply] = None
        self.is_half_open = False
        self.is_closing = False
        self.resets = False
        self._waiting: Deque[Delivery] = deque()
        self._unsent: Deque[bytes] = deque()
        self._unsent_bytes = 0

    @property
    def unsent_bytes(self) -> int:
        """Bytes that are due or waiting."""
        return self._unsent_bytes + sum(len(delivery.data) for delivery in self._waiting)

    def post(self, deliveries: List[Delivery]) -> None:
        """Put deliveries in line; none goes out before the one in front of it, unless it overtakes."""
        for delivery in deliveries:
            if delivery.overtakes and self._waiting:
                held = self._waiting.pop()
                self._waiting += [delivery, held._replace(at=delivery.at)]
                continue
            if self._waiting and delivery.at < self._waiting[-1].at:
                delivery = delivery._replace(at=self._waiting[-1].at)
            self._waiting.append(delivery)

    def next_due(self) -> Optional[float]:
        """When the next delivery goes out, s; None for nothing in line."""
        return self._waiting[0].at if self._waiting else None

    def has_unsent(self) -> bool:
        """True while bytes that are due have not been taken by the network."""
        return bool(self._unsent)

    def pump(self, now: float, send: Callable[[bytes], int]) -> None:
        """Send what is due.

        Args:
            now: s on the clock of the deliveries.
            send: Takes bytes, returns how many the network took.
        """
        while self._send(send) and self._waiting and self._waiting[0].at <= now:
            self._make_due(now)

    def _make_due(self, now: float) -> None:
        """Move deliveries that go out in one piece from the line to the unsent bytes."""
        piece = bytearray()
        while self._waiting and self._waiting[0].at <= now:
            delivery = self._waiting.popleft()
            piece += delivery.data
            if delivery.effect is not None:
                self._end(delivery.effect)
            if delivery.alone:
                break
        if piece:
            self._unsent.append(bytes(piece))
            self._unsent_bytes += len(piece)

    def _end(self, effect: Effect) -> None:
        self._waiting.clear()
        self.is_half_open = effect is Effect.HALF_OPEN
        self.is_closing = not self.is_half_open
        self.resets = effect is Effect.RESET

    def _send(self, send: Callable[[bytes], int]) -> bool:
        """True when nothing unsent is left."""
        while self._unsent:
            piece = self._unsent.popleft()
            taken = send(piece)
            self._unsent_bytes -= taken
            if taken < len(piece):
                self._unsent.appendleft(piece[taken:])
                return False
        return True
