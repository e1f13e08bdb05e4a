"""The jog with a watchdog: it is stopped a fixed time after the last call, whatever the feed shows."""
import logging
from typing import List, Optional

from jaka_ros_driver.client.core.actions import Token
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import ArmMotion, MotionOwner, rest_time_at
from jaka_ros_driver.client.core.motion_guard.feed_watch import FeedWatch
from jaka_ros_driver.client.core.motion_guard.frame_guard import Look
from jaka_ros_driver.client.core.move import NOT_SEEN_TO_BEGIN
from jaka_ros_driver.client.core.stillness import MOVEMENT
from jaka_ros_driver.commands import Jog, JogStop
from jaka_ros_driver.errors import JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.state import RobotState, Vector

_OVER_TIME_S = 0.5
"""Stillness, s, after which a jog whose arm has moved has ended, whatever ``inpos`` says."""


class JogMotion(ArmMotion):
    """A continuous motion of one axis with a watchdog.

    Attributes:
        command: The command that began it.
    """

    owner = MotionOwner.JOG

    def __init__(self, custody: Custody, command: Jog, call: Token, called_at: float, look: Look) -> None:
        """Set up the motion.

        Args:
            custody: Of this motion.
            command: What begins it.
            call: Answered with the controller's acceptance.
            called_at: When it came, s; it may have waited for the arm since then.
            look: Of the motion guard.
        """
        self.command = command
        self.jog_stop = JogStop(command.frame, command.axis)
        self._custody = custody
        self.deadline = called_at + custody.settings.jog_timeout
        self._calls: List[Token] = [call]
        self._accepted_at: Optional[float] = None
        self._start: Optional[Vector] = None
        self._has_moved = False
        self._feed_watch = FeedWatch(look)
        self.rest_time = rest_time_at(abs(command.velocity), command.is_linear)

    def begin(self, now: float) -> None:
        self._custody.channel.request(self.command, now, lambda _, error, at: self._replied(error, at))

    def again(self, call: Token, called_at: float) -> None:
        """Restart the watchdog for another call, which came at ``called_at``, s."""
        self.deadline = max(self.deadline, called_at + self._custody.settings.jog_timeout)
        if self._accepted_at is None:
            self._calls.append(call)
        else:
            self._custody.actions.answer(call)

    def observe(self, state: RobotState, now: float) -> None:
        if self._accepted_at is None or state.received_at <= self._accepted_at:
            return
        if self._start is None:
            self._start = state.joint_position
        trouble = self._feed_watch.trouble(state)
        if trouble:
            self._custody.stop(MotionInterrupted(StopCause.MOTION_GUARD, trouble), now)
            return
        self._has_moved = self._has_moved or max(
            [abs(a - b) for a, b in zip(self._start, state.joint_position)]) > MOVEMENT
        if now - self._accepted_at <= self._custody.start_window(self.rest_time):
            return
        if not self._has_moved:
            self._custody.stop(MotionInterrupted(StopCause.FAULT, "accepted, but the arm did not move"), now)
        elif self._custody.stillness.elapsed(self._accepted_at) >= max(_OVER_TIME_S, self.rest_time):
            self._custody.stop(MotionInterrupted(StopCause.STOPPED, "the jog has ended by itself"), now)

    def tick(self, now: float) -> None:
        if now >= self.deadline:
            self._custody.actions.log(logging.INFO, "jog watchdog: no jog call for %.1f s, stopping"
                                      % self._custody.settings.jog_timeout)
            self._custody.stop(MotionInterrupted(
                StopCause.STOPPED, "no jog call for %.3g s" % self._custody.settings.jog_timeout), now)
        elif (self._accepted_at is not None and not self._has_moved
              and now - self._accepted_at >= self._custody.unseen_start(self.rest_time)):
            self._custody.stop(MotionInterrupted(StopCause.FAULT, NOT_SEEN_TO_BEGIN), now)

    def ended(self, outcome: Optional[MotionInterrupted]) -> None:
        self._custody.actions.answer_all(self._calls, outcome)

    def _replied(self, error: Optional[JakaError], now: float) -> None:
        if self._custody.motion is not self:
            return
        if error is None:
            self._accepted_at = now
            if not self._custody.is_ending:
                self._custody.actions.answer_all(self._calls)
            return
        self._custody.actions.answer_all(self._calls, error)
        self._custody.not_accepted(error, now)
