"""The evidence that the arm rests: its measured joints, over fresh frames."""
from collections import deque
from typing import Deque, NamedTuple, Optional, Tuple

from jaka_ros_driver.state import RobotState, Vector

REST_TIME_S = 0.08
"""Stillness, s, of the joints after which the arm counts as at rest."""
SURE_REST_S = 0.8
"""Stillness, s, in which the slowest motion that is taken (``limits.SLOWEST``, of joints or tool) is seen to move.

It is what counts where nothing else shows that a motion has ended: an arm that creeps may look still for half of it.
"""
MOVEMENT = 2e-4
"""Distance, rad (0.011 deg), of a joint from where it was first seen above which it has moved."""
_CREEP_FACTOR = 2.0
"""Factor of the time of its last step for which an arm must be still: clearly longer (``_LONGEST_STEP_S``)."""
_LONGEST_STEP = 3.0 * MOVEMENT
"""Largest step, rad, of an arm that creeps."""
_LONGEST_STEP_S = 0.6
"""Time, s, for one ``MOVEMENT`` above which an arm that rests before and afterwards has twitched.

One that needs less may creep: it counts as at rest when it has been still clearly longer than it was before that step.
So 0.0005 rad/s, with a step every 0.4 s, is no rest once two steps of it were seen; before that, as behind a faster
motion, only ``SURE_REST_S`` tells it from rest. At the usual end of a motion the last step took less than 0.04 s, which
changes nothing.
"""
LONGEST_GAP_S = 0.6
"""Longest gap, s, between two frames across which anything is known."""
_COUNTED_GAP_S = 0.04
"""Share of a longer gap, s, that counts as rest.

A frame that came late may show the moment after the one before it.
"""
_KEPT_GAPS = 256
"""Most gaps kept; older ones lie more than 10 s of rest back, longer than anyone asks for."""


class Shown(NamedTuple):
    """Until when the status feed has shown what there was to be seen.

    Attributes:
        until: The feed has certainly shown this moment, s: it shows what the controller answered to a question of then.
            Infinite where the controller cannot be asked, or its answers are not those of its feed.
        answered_until: It shows what the controller answered to a question of this moment, s; infinite where the
            controller cannot be asked.
    """

    until: float
    answered_until: float


ALL_SHOWN = Shown(float("inf"), float("inf"))


class Stillness:
    """The watch over the joints of every fresh frame. Only measured positions count, no flag of the controller."""

    def __init__(self) -> None:
        self._anchor: Optional[Vector] = None
        self._since = 0.0
        self._step_time = 0.0  # between the last two anchors
        self._seen_since = 0.0
        self._last = 0.0
        self._long_gaps: Deque[Tuple[float, float]] = deque(maxlen=_KEPT_GAPS)  # begin and end, within the rest

    def observe(self, state: RobotState) -> None:
        """Take one fresh frame into account."""
        joints, now = state.joint_position, state.received_at
        anchor = self._anchor
        if anchor is None or now - self._last > LONGEST_GAP_S:
            self._anchor, self._since, self._seen_since = joints, now, now
            self._step_time = 0.0
            self._long_gaps.clear()
        elif (step := max([abs(a - b) for a, b in zip(anchor, joints)])) > MOVEMENT:
            step_time = now - self._since
            is_creep = step <= _LONGEST_STEP and step_time <= _LONGEST_STEP_S
            self._step_time = step_time if is_creep else 0.0
            self._anchor, self._since = joints, now
            self._long_gaps.clear()
        elif now - self._last > _COUNTED_GAP_S:
            self._long_gaps.append((self._last, now))
        self._last = now

    def lose_sight(self) -> None:
        """Forget the last frame: it proves nothing about the next one."""
        self._anchor = None

    @property
    def since(self) -> float:
        """Moment, s, since which no frame has shown the arm move."""
        return self._since

    def duration(self, after: float = 0.0) -> float:
        """Return for how long the arm has been seen at rest, s, counted from ``after`` at the earliest.

        It is 0 while the arm may still creep.
        """
        if self._anchor is None or self._last - self._since < _CREEP_FACTOR * self._step_time:
            return 0.0
        since = max(self._since, after)
        uncounted = sum([max(0.0, end - max(begin, since) - _COUNTED_GAP_S) for begin, end in self._long_gaps])
        return max(0.0, self._last - since - uncounted)

    def elapsed(self, after: float = 0.0) -> float:
        """Return the time since the arm was last seen to move, s, from ``after`` on; gaps between frames count whole.

        It is longer than ``duration``: for what is stopped because it rests too long, not for evidence of rest.
        """
        return 0.0 if self._anchor is None else max(0.0, self._last - max(self._since, after))

    def has_moved_since(self, moment: float) -> bool:
        """Return whether fresh frames after this moment (monotonic, s) show the arm somewhere else than before."""
        return self._anchor is not None and self._since > max(moment, self._seen_since)
