"""One owner of the arm's motion at a time; who else wants to move it is told who that is."""
import enum
import threading
from typing import Callable, Optional

from jaka_ros_driver.errors import InvalidCommand


class MotionOwner(enum.Enum):
    """What may hold the arm's motion; the value is its name in refusals."""

    MOVE = "a move"
    JOG = "a jog"
    SERVO = "servo mode"


class Ownership:
    """Who moves the arm now. Stop, reads and settings need no ownership."""

    def __init__(self, on_change: Callable[[bool], None]) -> None:
        """Nobody owns it; ``on_change`` is told whether somebody does, at once."""
        self._lock = threading.Lock()
        self._owner: Optional[MotionOwner] = None
        self._on_change = on_change

    @property
    def owner(self) -> Optional[MotionOwner]:
        """The present owner, None for nobody."""
        return self._owner

    def claim(self, owner: MotionOwner, may_share: bool = False) -> None:
        """Take the motion; ``may_share`` where the same owner may already have it (queued moves).

        Raises:
            InvalidCommand: Somebody has it.
        """
        with self._lock:
            if self._owner is not None and not (may_share and self._owner is owner):
                raise InvalidCommand("refused: %s owns the arm's motion; wait for its end or stop it first"
                                     % self._owner.value)
            self._owner = owner
            self._on_change(True)

    def tell(self) -> None:
        """Tell ``on_change`` once more: what it makes of it may depend on more than the owner."""
        with self._lock:
            self._on_change(self._owner is not None)

    def release(self, owner: MotionOwner) -> None:
        """Give the motion back; nothing happens where another has it."""
        with self._lock:
            if self._owner is owner:
                self._owner = None
                self._on_change(False)
