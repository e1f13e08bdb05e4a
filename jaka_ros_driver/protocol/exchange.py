"""Pairs the replies of the command port with requests, and tells which are overdue. The caller tells the time."""
from collections import deque
from dataclasses import dataclass
from typing import Any, Deque, Generic, List, Mapping, Optional, TypeVar

T = TypeVar("T")


@dataclass(eq=False)
class Request(Generic[T]):
    """A request that was sent and not answered yet.

    Attributes:
        name: Its ``cmdName``.
        deadline: Monotonic time by which the reply is due, s.
        waiter: An object that the caller gets back with the reply; None where nobody waits for it.
    """

    name: str
    deadline: float
    waiter: Optional[T]


class Exchange(Generic[T]):
    """Pairs replies with requests: in order, with ``cmdName`` as the check (docs/controller-protocol.md section 3.2).

    A reply answers the oldest outstanding request of its ``cmdName``. A reply without a name, as with error code 1,
    answers the oldest request of all. A reply that answers no request is stale and is dropped.
    """

    def __init__(self) -> None:
        self._outstanding: Deque[Request[T]] = deque()

    def __len__(self) -> int:
        return len(self._outstanding)

    def sent(self, name: str, now: float, deadline_s: float, waiter: Optional[T] = None) -> Request[T]:
        """Note a request that is sent now, whose reply is due within ``deadline_s``."""
        request = Request(name, now + deadline_s, waiter)
        self._outstanding.append(request)
        return request

    def answered(self, reply: Mapping[str, Any]) -> Optional[Request[T]]:
        """Take the request that this reply answers off the record and return it; None for a stale reply."""
        name = reply.get("cmdName")
        for request in self._outstanding:
            if name is None or request.name == name:
                self._outstanding.remove(request)
                return request
        return None

    def overdue(self, now: float) -> Optional[Request[T]]:
        """An outstanding request whose reply is late, if there is one."""
        return next((request for request in self._outstanding if request.deadline < now), None)

    def abandon(self) -> List[Request[T]]:
        """Forget and return all outstanding requests, which will not be answered because the link is lost."""
        lost = list(self._outstanding)
        self._outstanding.clear()
        return lost
