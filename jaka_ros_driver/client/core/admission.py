"""Who may begin to move the arm, or to change what a motion means, and who waits for the arm to come to rest first."""
from typing import Any, Callable, List, NamedTuple, Optional

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.links import Links
from jaka_ros_driver.client.core.motion import MotionOwner, require_drives
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, JakaError
from jaka_ros_driver.state import RobotState

_WAIT_FOR_REST_S = 1.5
"""s; a motion waits so long for the arm to come to rest from what was before it."""

Enter = Callable[[float], None]
"""Begins a call at a time, s; tried again while the call waits. What it raises is the call's answer."""


class _Waiting(NamedTuple):
    call: Any
    enter: Enter
    deadline: float


class Admission:
    """Lets one call at a time at the arm.

    Attributes:
        is_setting: A change that needs the arm at rest is under way.
        is_guided: Hand guiding was switched on by this driver; not every feed tells.
        stops_under_way: Stops that were sent while nobody had custody, and are not answered yet.
    """

    def __init__(self, actions: Actions, custody: Custody, links: Links) -> None:
        self._actions = actions
        self._custody = custody
        self._links = links
        self._waiting: List[_Waiting] = []
        self.is_setting = False
        self.is_guided = False
        self.stops_under_way = 0

    @property
    def owner(self) -> Optional[MotionOwner]:
        """What has the arm on behalf of this driver."""
        if self._custody.motion is not None:
            return self._custody.motion.owner
        return MotionOwner.SETTING if self.is_setting else None

    @property
    def deadline(self) -> float:
        """When ``retry`` is due, s."""
        return min([waiting.deadline for waiting in self._waiting], default=float("inf"))

    def require_ready_to_move(self, now: float) -> RobotState:
        """See that the arm can be moved now; returns its state.

        Raises:
            InvalidCommand: Its drives are not ready, or a hand guides it.
            ConnectionLost: There is no fresh state, or no link.
        """
        state = self._links.fresh_state(now)
        require_drives(state)
        if state.is_hand_guided or (state.is_hand_guided is None and self.is_guided):
            raise InvalidCommand("refused: hand guiding owns the arm's motion; switch it off first")
        if not self._links.is_up:
            raise ConnectionLost("no link to the controller: " + self._links.last_error)
        return state

    def may_begin(self, call: Any, enter: Enter, asked_at: float, now: float) -> bool:
        """Whether something new may begin; else the call waits for the end of what comes to rest.

        Raises:
            InvalidCommand: Somebody else has the arm, and keeps it.
            ConnectionLost: Whether the arm rests is not known.
        """
        motion = self._custody.motion
        if motion is not None and not self._custody.is_ending and not motion.is_leaving:
            raise InvalidCommand("refused: %s owns the arm's motion; wait for its end or stop it first"
                                 % motion.owner.value)
        if self._custody.is_free and not self.is_setting and not self.stops_under_way:
            self._links.fresh_state(now)
            if self._custody.stillness.duration() >= REST_TIME_S:
                return True
        if now - asked_at >= _WAIT_FOR_REST_S:
            self._links.fresh_state(now)
            owner = self.owner
            raise InvalidCommand("refused: the arm has not come to rest within %.1f s; %s" % (
                _WAIT_FOR_REST_S, "it moves, and not by this driver" if owner is None
                else "%s is still being ended" % owner.value))
        self._waiting.append(_Waiting(call, enter, asked_at + _WAIT_FOR_REST_S))
        return False

    def retry(self, now: float) -> None:
        """Try again to begin what waits."""
        if not self._waiting:
            return
        waiting, self._waiting = self._waiting, []
        for one in waiting:
            try:
                one.enter(now)
            except JakaError as error:
                self._actions.answer(one.call, None, error)

    def end_waiting(self, error: JakaError) -> None:
        """Answer every call that waits with this error."""
        waiting, self._waiting = self._waiting, []
        for one in waiting:
            self._actions.answer(one.call, None, error)
