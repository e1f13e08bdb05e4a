"""The rules for what is shown as new: that the arm was there a moment ago."""
import math
from collections import deque
from typing import Deque, Tuple

from controller_room import ControllerRoom, Reply
from slacks import AGE_SLACK, SHOWN_AGE, SHOWN_PERIODS, STOOD_AGE, UNTELLING
from verdict import RuleBroken, Verdicts
from wire import Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.state import RobotState, Vector

_SAME_JOINT = 1e-6
_HISTORY_S = 8.0
_CYCLE = 0.008
_STOOD_S = 1.0
"""Time, s, after a pause of the process for which ``STOOD_AGE`` counts: that of the next questions and answers."""
_JUST_SHOWN_S, _BY_THE_WAY = 0.4, 0.02
"""Time, s, within which an answer must be shown, with a frame more; how near a place, rad, counts as shown."""
_ASKS = "get_joint_pos"
_UNANSWERED_S = 0.3
"""Time, s, that an answer may take without which nothing shows how old a slow feed is (docs/safety.md)."""


class ShownRules:
    """The judge of the states that a driver shows as new, who knows where the arm has been.

    Attributes:
        mute_until: Until then the controller's answers, which would show how old a slow feed is, do not come through,
            or prove nothing.
    """

    def __init__(self, network: Network, room: ControllerRoom, settings: ClientSettings, lateness: float,
                 verdicts: Verdicts) -> None:
        self._network, self._room, self._verdicts = network, room, verdicts
        self._wire_age = network.terms[Port.STATUS, False].latency[1] + _CYCLE + lateness
        self._longest = settings.silence_timeout + AGE_SLACK + self._wire_age
        self._joints: Deque[Tuple[float, Vector]] = deque()
        self._questions: Deque[float] = deque()
        self._answered_late_at = 0.0
        self.mute_until = self._awake_since = 0.0

    def begin_anew(self, now: float) -> None:
        """Begin with another connection of the command port: what was asked before is not answered."""
        self._questions.clear()
        self.mute_until = now

    def sends(self, name: str, now: float) -> None:
        """Note a request."""
        if name == _ASKS:
            self._questions.append(now)

    def reads_reply(self, reply: Reply, now: float) -> None:
        """Note a reply."""
        is_answer = reply.command == _ASKS and reply.is_accepted and bool(self._questions)
        if is_answer and now - self._questions.popleft() > _UNANSWERED_S:
            self._answered_late_at = now

    def resumed(self, now: float) -> None:
        """Note that the process runs again: a slow feed may be older for a while."""
        self._awake_since = now

    def reads_old_frame(self, now: float) -> None:
        """Note a frame that came on time and shows another moment: the way from it may lead by an answer."""
        self.mute_until = max(self.mute_until, now + self._longest)

    def was_at(self, joints: Vector, now: float) -> None:
        """Note where the arm is."""
        self._joints.append((now, joints))
        while len(self._joints) > 2 and self._joints[1][0] < now - _HISTORY_S:
            self._joints.popleft()

    def shown(self, state: RobotState, now: float) -> None:
        """Judge a state."""
        age = max(SHOWN_AGE + self._wire_age,
                  SHOWN_PERIODS * self._room.controller.state.feed_period + self._wire_age)
        oldest = now - age
        until = now
        for since, joints in reversed(self._joints):
            if until < oldest:
                break
            if _distance(joints, state.joint_position) <= _SAME_JOINT:
                self._verdicts.uses("SHOWN_AGE", now - until - self._wire_age)
                return
            until = since
        is_slow = self._network.is_slow(Port.STATUS, False)
        if is_slow and (self._is_unanswered(now) or not self._is_older(state.joint_position, now)):
            return  # without the controller's answers, nothing shows how old a slow feed is
        true_age = self._age(state.joint_position, now)
        if is_slow and self._leads_by_the_arm(now, true_age):
            return
        raise RuleBroken("age" if is_slow else "g", now, "a state is shown as new that the arm was not in within the "
                         "last %.3f s; it is %.3f s old" % (age, true_age))

    def _is_unanswered(self, now: float) -> bool:
        """Return whether the controller's answers do not come, or came late a moment ago."""
        return (now < self.mute_until or now < self._answered_late_at + self._longest
                or bool(self._questions) and now - self._questions[0] > _UNANSWERED_S)

    def _is_older(self, joints: Vector, now: float) -> bool:
        """Return whether joints are older than a link slower than the feed allows.

        Motion too small to differ from rest does not count.
        """
        longest = self._longest + (STOOD_AGE if now < self._awake_since + _STOOD_S else 0.0)
        until, oldest = now, now - longest
        for since, known in reversed(self._joints):
            if until < oldest:
                break
            if _distance(known, joints) <= UNTELLING:
                return False
            until = since
        return True

    def _leads_by_the_arm(self, now: float, age: float) -> bool:
        """Return whether what a late feed has just shown leads by where the arm is: then it shows every answer, too."""
        here = self._joints[-1][1]
        return any(_distance(joints, here) <= _BY_THE_WAY for at, joints in self._joints
                   if now - age - _JUST_SHOWN_S <= at <= now - age)

    def _age(self, joints: Vector, now: float) -> float:
        """Return how old a shown state is, s; infinite where it is older than anything known, or was never true."""
        until = now
        for since, known in reversed(self._joints):
            if _distance(known, joints) <= _SAME_JOINT:
                return now - until
            until = since
        return math.inf


def _distance(a: Vector, b: Vector) -> float:
    return max([abs(p - q) for p, q in zip(a, b)])
