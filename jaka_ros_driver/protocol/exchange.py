"""The list of outstanding requests on the command port: it pairs replies with them and finds overdue ones."""
from collections import deque
from dataclasses import dataclass
from typing import Any, Deque, Generic, List, Mapping, Optional, TypeVar

T = TypeVar("T")


@dataclass(eq=False)
class PendingRequest(Generic[T]):
    """A request that was sent and is not answered yet.

    Attributes:
        name: Its ``cmdName``.
        patience: How long its reply may take, s.
        deadline: Monotonic time by which the reply is due, s.
        waiter: An object that the caller gets back with the reply; None where nobody waits for it.
        is_slow: True where the replies to later requests may have to wait for this one's.
        sent_at: Monotonic time at which it was sent, s.
        is_done: Its effect is visible.
        was_passed: The reply to a later request came first while this one was slow or done: it is lost, or others pass
            it.
    """

    name: str
    patience: float
    deadline: float
    waiter: Optional[T]
    is_slow: bool
    sent_at: float
    is_done: bool = False
    was_passed: bool = False

    @property
    def allowed_s(self) -> float:
        """The time that its reply was given in the end, s: more behind a slow one, less once its effect is visible."""
        return self.deadline - self.sent_at


class Exchange(Generic[T]):
    """The requests without a reply, in order, with ``cmdName`` as the check (docs/controller-protocol.md section 3.2).

    A reply answers the oldest outstanding request of its ``cmdName``. A reply without a name, as with error code 1,
    answers the oldest of those whose effect is not visible, else the oldest. A reply that answers no request is stale
    and is dropped.
    """

    def __init__(self) -> None:
        self._outstanding: Deque[PendingRequest[T]] = deque()

    def __len__(self) -> int:
        return len(self._outstanding)

    def sent(self, name: str, now: float, patience: float, waiter: Optional[T] = None,
             is_slow: bool = False) -> PendingRequest[T]:
        """Record a request that is sent now, whose reply is due within ``patience`` s; ``is_slow`` as in the record."""
        request = PendingRequest(name, patience, now + patience, waiter, is_slow, now)
        self._outstanding.append(request)
        return request

    def answered(self, reply: Mapping[str, Any], now: float) -> Optional[PendingRequest[T]]:
        """Remove the request that this reply answers, and return it; None for a stale reply."""
        name = reply.get("cmdName")
        is_refusal = name is None and not all(request.is_done for request in self._outstanding)
        for place, request in enumerate(self._outstanding):
            if request.name == name or (name is None and not (is_refusal and request.is_done)):
                del self._outstanding[place]
                others = list(self._outstanding)
                for passed in others[:place]:
                    passed.was_passed = passed.was_passed or passed.is_slow or passed.is_done
                    passed.is_slow = False  # its reply is lost, or later ones pass it: nothing waits for it
                for behind in others[place:] if request.is_slow else ():
                    behind.deadline = max(behind.deadline, now + behind.patience)
                return request
        return None

    def is_outstanding(self, name: str) -> bool:
        """Return whether a request of this name is outstanding."""
        return any(request.name == name for request in self._outstanding)

    @property
    def slow(self) -> Optional[PendingRequest[T]]:
        """The oldest request that may hold up the reply to a request sent now; None where none does."""
        return next((request for request in self._outstanding if request.is_slow), None)

    @property
    def is_held_up(self) -> bool:
        """True where the reply to a request sent now may have to wait for another."""
        return self.slow is not None

    def done(self, name: str, now: float, patience: float) -> None:
        """Give a slow request whose work is done the usual time to be answered: ``patience`` s.

        The requests behind it get their usual time, too.
        """
        is_behind = False
        for request in self._outstanding:
            if is_behind:
                request.deadline = max(request.deadline, now + request.patience)
            elif request.name == name and request.is_slow:
                is_behind, request.is_slow, request.is_done, request.deadline = True, False, True, now + patience

    def overdue(self, now: float) -> Optional[PendingRequest[T]]:
        """Return an outstanding request whose reply is late, or None.

        Those behind a slow one are not late yet, and one that is done is never late where later replies have passed it.
        """
        for request in self._outstanding:
            if request.deadline < now and not (request.is_done and request.was_passed):
                return request
            if request.is_slow:
                return None
        return None

    def abandon(self) -> List[PendingRequest[T]]:
        """Forget and return all outstanding requests, which will not be answered because the link is lost."""
        lost = list(self._outstanding)
        self._outstanding.clear()
        return lost
