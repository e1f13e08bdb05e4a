"""The motions of an arm, each from its begin to its end, as its joints show them."""
from collections import deque
from typing import Any, Deque, Dict, List, Optional, Sequence

from .history import GAP_S

KEPT = 200
"""Newest motions that are kept, and that each page gets when it comes."""
REST_RAD_S = 0.001
"""Speed of a joint up to which no motion is seen."""
_REST_S = 0.3
"""Rest, s, that ends a motion; a shorter one is a pause within it."""


class MoveBook:
    """The newest motions. Every method returns what was changed, as JSON has it.

    What was not seen is not claimed: a motion during which the samples cease ends, as ``lost``, with the last of them.
    """

    def __init__(self) -> None:
        self._moves: Deque[Dict[str, Any]] = deque(maxlen=KEPT)
        self._count = 0
        self._open: Optional[Dict[str, Any]] = None
        self._seen_at = self._moved_at = -1e9

    def all(self) -> List[Dict[str, Any]]:
        """Return all motions, oldest first."""
        return list(self._moves)

    def sample(self, at: float, speeds: Optional[Sequence[float]]) -> List[Dict[str, Any]]:
        """Take a sample of the joints' speeds, rad/s, at a monotonic time, s, later than the one before."""
        changed = self.look(at)
        self._seen_at = at
        if speeds is None:
            return changed
        if any(abs(speed) > REST_RAD_S for speed in speeds):
            self._moved_at = at
            if self._open is None:
                self._count += 1
                self._open = {"n": self._count, "s": round(at, 3), "to": None, "owner": "", "lost": False}
                self._moves.append(self._open)
                changed.append(dict(self._open))
        elif at - self._moved_at > _REST_S:
            changed += self._end(self._moved_at, False)
        return changed

    def look(self, now: float) -> List[Dict[str, Any]]:
        """End a motion that is not seen any more."""
        return self._end(self._seen_at, True) if now - self._seen_at > GAP_S else []

    def name(self, owner: str) -> List[Dict[str, Any]]:
        """Take who moves the arm, as the driver calls it; empty for nobody."""
        if self._open is None or not owner or self._open["owner"] == owner:
            return []
        self._open["owner"] = owner
        return [dict(self._open)]

    def _end(self, at: float, is_lost: bool) -> List[Dict[str, Any]]:
        ended, self._open = self._open, None
        if ended is None:
            return []
        ended.update(to=round(at, 3), lost=is_lost)
        return [dict(ended)]
