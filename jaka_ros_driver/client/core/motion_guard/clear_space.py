"""The space around the last look at an arm: motions within it need no look of their own."""
from typing import Sequence

from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.state import Vector

_MOST_WORK = 4_000
"""Largest work of a look at a motion while it lasts, which the next frame waits for: some ms."""


class ClearSpace:
    """The joints around a place that are known to be clear: nothing of the arm moves farther than is clear there.

    A joint that turns by 1 rad brings nothing nearer to each other by more than ``MotionGuard.reach`` says.
    """

    def __init__(self, guard: MotionGuard, margin: float) -> None:
        """Set up without a place; ``guard`` looks, and ``margin`` is the distance that is kept, m."""
        self._guard, self._margin = guard, margin
        self._place: Vector = ()
        self._room = 0.0

    def trouble(self, way: Sequence[Vector]) -> str:
        """Look at a way of straight lines in joint space; return what it comes too near to, in words; "" for nothing.

        way: Joints, rad (6,) each; the first ones are where the arm is. Where it is in trouble there, only what gets
            nearer counts.
        """
        self._place, self._room = way[0], self._guard.nearest(way[0]).distance - self._margin
        if self.holds(way):
            return ""
        found = self._guard.first_trouble(way, _MOST_WORK)
        return "" if found is None else found.reason

    def holds(self, way: Sequence[Vector]) -> bool:
        """Return whether a way lies within what is known to be clear, which takes no look."""
        for joints in way:
            moved = 0.0
            for reach, here, there in zip(self._guard.reach, self._place, joints):
                moved += reach * abs(there - here)
            if not moved < self._room:  # nor where a joint is no number
                return False
        return True
