"""Motion that is not this driver's: one that a dead driver left, and an arm that moves in nobody's custody."""
import logging
from dataclasses import dataclass
from typing import Optional

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.state import PROGRAM_UNDER_WAY, RobotState, Vector

_REST_TIME_S = 0.5
"""Stillness, s, of the joints after which a motion in nobody's custody counts as over."""
_NOTICED = 2e-3
"""Distance, rad (0.11 deg), of a joint from its place of rest above which it moves; opening brakes move it by less."""
_LONGEST_GAP_S = 0.6
"""Longest gap, s, between two frames across which anything is known."""


@dataclass(frozen=True)
class LeftMotion:
    """A driver's custody, as it stands in its file.

    Attributes:
        name: The motion: "a move", "a jog".
        jog_stop: The command that ends its jog; None where it is none.
        since: Since when, s of wall time.
        process: The driver's process id.
    """

    name: str
    jog_stop: Optional[JogStop]
    since: float
    process: int


class LeftBehind(ArmMotion):
    """A motion that a dead driver left: all that is known of it is how to stop it."""

    owner = MotionOwner.LEFT
    rest_time = _REST_TIME_S

    def __init__(self, left: LeftMotion) -> None:
        self.left = left
        self.jog_stop = left.jog_stop

    @property
    def name(self) -> str:
        return self.left.name

    def may_be_left(self, state: RobotState) -> bool:
        return state.program_state not in PROGRAM_UNDER_WAY

    def __str__(self) -> str:
        return "%s that a dead driver (process %d) left moving is being stopped" % (self.name, self.left.process)


class ForeignMotion:
    """The detector of an arm that moves in nobody's custody, which logs that once.

    Attributes:
        text: What is known of it, in words; "" while there is none.
    """

    def __init__(self, actions: Actions) -> None:
        self.text = ""
        self._actions = actions
        self._anchor: Optional[Vector] = None
        self._seen_at = 0.0

    def observe(self, state: RobotState, still_for: float, is_explained: bool) -> None:
        """Take the newest state into account.

        Args:
            state: The newest one; one that was seen before changes nothing.
            still_for: For how long the arm has been seen at rest, s.
            is_explained: This driver moves the arm, or a hand guides it.
        """
        if state.received_at <= self._seen_at:
            return
        gap, self._seen_at = state.received_at - self._seen_at, state.received_at
        if is_explained:
            self._anchor, self.text = None, ""
            return
        if self.text:
            if still_for >= _REST_TIME_S:
                self.text, self._anchor = "", state.joint_position
                self._actions.log(logging.INFO, "the arm, which moved in nobody's custody, rests again")
            return
        if self._anchor is None or gap > _LONGEST_GAP_S or still_for >= REST_TIME_S:
            self._anchor = state.joint_position
        elif max([abs(a - b) for a, b in zip(self._anchor, state.joint_position)]) > _NOTICED:
            self.text = "the arm moves in nobody's custody: " + (
                "a program of the controller's own runs" if state.program_state in PROGRAM_UNDER_WAY
                else "this driver did not begin it, and does not stop it unasked")
            self._actions.log(logging.WARNING, self.text)
