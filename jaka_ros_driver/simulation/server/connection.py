"""One client of one port, without socket and clock: its unanswered requests, and its scheduled deliveries."""
from collections import deque
from typing import Callable, Deque, List, Optional

from jaka_ros_driver.protocol.framing import FramedItem
from jaka_ros_driver.simulation.controller.executor import ReplyLine
from jaka_ros_driver.simulation.server.faults import Delivery, Effect
from jaka_ros_driver.simulation.server.request_parser import RequestParser

MAX_UNSENT_BYTES = 1 << 20
"""Most unsent bytes of a command client; one with more is dropped."""
FRAME_BACKLOG_BYTES = 1 << 16
"""Most unsent bytes of a status client; one with more receives no new frames until it has read some."""


class ClientConnection:
    """One accepted connection, without its socket.

    Attributes:
        port: "command", "status" or "poll".
        number: Counts the connections of a server, from 1.
        peer: Address of the client.
        parser: Cuts requests out of what it sends.
        inbox: Requests not yet carried out.
        replies: Those not sent yet, because they are not due (docs/controller-protocol.md sections 5.1, 5.4.6).
        opened_at: s on the caller's clock.
        last_request_at: When it last sent a request, s; before the first, ``opened_at``.
        is_half_open: True where a wire fault says that nothing is read or sent any more.
        is_closing: True where it is to be closed once everything is sent.
        resets: True where it is to end with a reset (RST) instead of a close.
    """

    def __init__(self, port: str, number: int, peer: str, now: float) -> None:
        self.port = port
        self.number = number
        self.peer = peer
        self.parser = RequestParser()
        self.inbox: Deque[FramedItem] = deque()
        self.replies = ReplyLine()
        self.opened_at = self.last_request_at = now
        self.is_half_open = False
        self.is_closing = False
        self.resets = False
        self._waiting: Deque[Delivery] = deque()
        self._unsent: Deque[bytes] = deque()
        self._unsent_bytes = 0

    @property
    def unsent_bytes(self) -> int:
        """The number of bytes that are due or scheduled, and not taken by the network yet."""
        return self._unsent_bytes + sum(len(delivery.data) for delivery in self._waiting)

    def post(self, deliveries: List[Delivery]) -> None:
        """Schedule deliveries. They go out in this order, except that one may overtake the one before it."""
        for delivery in deliveries:
            if delivery.overtakes and self._waiting:
                held = self._waiting.pop()
                self._waiting += [delivery, held._replace(at=delivery.at)]
                continue
            if self._waiting and delivery.at < self._waiting[-1].at:
                delivery = delivery._replace(at=self._waiting[-1].at)
            self._waiting.append(delivery)

    def next_due(self) -> Optional[float]:
        """Return when the next delivery is due, s on the caller's clock; None where none is scheduled."""
        return self._waiting[0].at if self._waiting else None

    def has_unsent(self) -> bool:
        """Return whether due bytes have not been taken by the network."""
        return bool(self._unsent)

    def pump(self, now: float, send: Callable[[bytes], int]) -> None:
        """Send what is due at ``now``, s.

        ``send`` takes bytes and returns how many the network took.
        """
        while self._send(send) and self._waiting and self._waiting[0].at <= now:
            self._make_due(now)

    def _make_due(self, now: float) -> None:
        """Move the due deliveries that go out together from the schedule to the unsent bytes."""
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
        """Send what is unsent; return True when nothing of it is left."""
        while self._unsent:
            piece = self._unsent.popleft()
            taken = send(piece)
            self._unsent_bytes -= taken
            if taken < len(piece):
                self._unsent.appendleft(piece[taken:])
                return False
        return True
