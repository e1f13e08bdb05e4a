"""The send queue of one viewer: bounded, and the newest messages win."""
import collections
from typing import Deque, NamedTuple, Optional, Tuple, Union

from .protocol import message_data, time_data

_HEAD_BYTES = 128
"""Memory, byte, that a waiting message takes besides its payload, roughly."""
MAX_ANSWERS = 1024
"""Answers that may wait; a viewer that asks for more without reading them is disconnected."""
MAX_ANSWER_BYTES = 32 << 20
"""Bytes of answers that may wait, or the limit of messages where that is more; below it any answer may be added."""

SocketFrame = Union[str, bytes]


class _Message(NamedTuple):
    """One message for one subscription; ``subscription`` is None where it is the time only."""

    subscription: Optional[int]
    time: int
    payload: bytes

    @property
    def size(self) -> int:
        return len(self.payload) + _HEAD_BYTES


class Outbox:
    """Frames for one viewer, in their order; of messages the oldest are dropped where there are too many.

    Args:
        limit: Bytes of messages that may wait; the newest message may wait whatever its size.

    Attributes:
        dropped: Messages dropped so far.
        sent: Messages taken out so far.
        size: Bytes of messages that wait.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._answer_limit = max(limit, MAX_ANSWER_BYTES)
        self._answer_size = 0
        self._messages: Deque[Tuple[int, _Message]] = collections.deque()
        self._answers: Deque[Tuple[int, SocketFrame]] = collections.deque()
        self._number = 0
        self.size = 0
        self.dropped = 0
        self.sent = 0

    def __len__(self) -> int:
        return len(self._messages) + len(self._answers)

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def answer(self, frame: SocketFrame) -> bool:
        """Add a frame that must not be lost; return False where too many of them wait already."""
        if len(self._answers) >= MAX_ANSWERS or self._answer_size >= self._answer_limit:
            return False
        self._answer_size += len(frame)
        self._answers.append((self._next_number(), frame))
        return True

    def message(self, subscription: Optional[int], time: int, payload: bytes = b"") -> None:
        """Add a message of a subscription, or without one the time, ns, alone."""
        message = _Message(subscription, time, payload)
        self._messages.append((self._next_number(), message))
        self.size += message.size
        while self.size > self._limit and len(self._messages) > 1:
            oldest = self._messages.popleft()[1]
            self.size -= oldest.size
            self.dropped += oldest.subscription is not None

    def forget_messages(self) -> None:
        """Drop all messages that wait, because others take their place; not counted as dropped."""
        self._messages.clear()
        self.size = 0

    def forget_subscription(self, subscription: int) -> None:
        """Drop the messages of a subscription that is over: its number may come to mean another one."""
        kept = [entry for entry in self._messages if entry[1].subscription != subscription]
        if len(kept) != len(self._messages):
            self._messages = collections.deque(kept)
            self.size = sum(message.size for _, message in kept)

    def take(self) -> Optional[SocketFrame]:
        """Remove and return the next frame; None where nothing waits."""
        if self._answers and (not self._messages or self._answers[0][0] < self._messages[0][0]):
            frame = self._answers.popleft()[1]
            self._answer_size -= len(frame)
            return frame
        if not self._messages:
            return None
        message = self._messages.popleft()[1]
        self.size -= message.size
        if message.subscription is None:
            return time_data(message.time)
        self.sent += 1
        return message_data(message.subscription, message.time, message.payload)
