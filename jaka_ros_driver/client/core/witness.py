"""The second witness of the status feed's age: the controller's answers on the command port.

A link that carries less than the feed delivers it at a steady rhythm of its own, which arrivals alone do not
distinguish from the rhythm of a slow controller. Content does: the controller's answer to a question must appear in the
feed soon afterwards. A feed that does not show it in time is older than that time, however regularly its frames come.
"""
import logging
from collections import deque
from typing import Deque, List, NamedTuple, Optional, cast

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.channel import CommandChannel
from jaka_ros_driver.client.core.stillness import LONGEST_GAP_S, MOVEMENT, REST_TIME_S
from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import CommandRejected, JakaError, ProtocolError
from jaka_ros_driver.state import RobotState, Vector

NEAR = 0.005
"""Largest difference, rad, between answer and feed at the same moment.

One may be measured, the other commanded.
"""
_TURN = 0.015
"""Largest excess, rad, of a joint that turns back between two frames over what they show: 12.6 rad/s2 at 10 Hz."""
_BRIEF_TURN = 0.79
"""Way, rad, there and back within one second at 12.6 rad/s2; it grows with the square of the time."""
_LEAST_AGE_S = 0.25
"""Shortest age, s, at which the feed is given up, however short the silence timeout: the period of the questions."""
_AGE_SHARE = 1.0 / 3.0
"""Age at which the feed is given up, as a share of the silence timeout.

The next question, and its answer, take time, too.
"""
_PERIODS, _LATE_S = 2.0, 0.1
"""Periods of the feed, and time, s, beyond them, in which it must show an answer: one period old, and one late."""
_MOST_AGE_SHARE = 0.6
"""Largest share of the silence timeout that is granted to a feed with long pauses.

Its frames are by themselves one period old, and one may be late.
"""
_DRIVES_S = 0.5
"""Longest time, s, for which the feed may show drives ready after the controller first answered that they are not."""
_LONGEST_HISTORY = 250
"""Most frames kept; a question whose answer takes longer proves nothing."""
_ANEW_S = 2.0
"""Shortest period, s, at which a feed that stays disputed is connected anew."""
_TRIES = 30
"""Contradictions, one after the other, by which a witness that has never been right is known to be none: about 8 s.

A feed that has stood since before the driver started looks the same for as long as it stands.
"""
_MISREAD = 3
"""Replies in a row that cannot be read, after which the question is not asked any more."""
_KEPT_ANSWERS = 4
"""Most answers kept, a second's.

An answer far from all of them could not have been found in a feed that is a second old.
"""


class _Answer(NamedTuple):
    joints: Vector
    at: float
    asked_at: float


class Witness:
    """The witness that asks for joints and drives at each beat, and compares each answer with the frames since its
    question.

    A feed that contradicts a witness which has been right before is disputed: none of its frames is believed until they
    show an answer again, also on a new connection. So a feed that repeats itself on time starts no motion.

    Attributes:
        is_trusted: The last answer that could be compared was found in the feed. Else a contradiction proves nothing
            new.
        agreed_at: When the newest answer that was found in the feed was asked for, s: the feed has shown that moment.
        rested_at: When the newest question was put, s, whose answer was found in the feed and shows the arm where the
            answers of ``REST_TIME_S`` before it have shown it. A feed that is a little old, and shows the rest before a
            motion, contains an answer from the first ``NEAR`` of that motion, too; this one it does not.
        dispute: Why no frame is believed, in words; "" where they are.
    """

    def __init__(self, actions: Actions, channel: CommandChannel, silence_timeout: float) -> None:
        """Set up without a question.

        silence_timeout: s; a frame that is taken for new must not be older than this.
        """
        self._actions = actions
        self._channel = channel
        self._longest_age = max(_LEAST_AGE_S, _AGE_SHARE * silence_timeout)
        self._most_age = _MOST_AGE_SHARE * silence_timeout
        self.is_trusted = False
        self.dispute = ""
        self._was_right = False
        self._generation = 0
        self._counts_from = 0.0
        self._began_at: Optional[float] = None
        self.open()

    def open(self) -> None:
        """Begin with a new connection of the command port.

        A witness that has been right stays one: where another controller answers now, with joints that are not those of
        its feed, nothing is believed before the driver is started anew.
        """
        self._refused: List[Query] = []
        self._misread = dict.fromkeys((Query.JOINTS, Query.DRIVES_READY), 0)
        self._tries = _TRIES
        self._newest: Optional[RobotState] = None
        self._period = 0.0
        self._asks_drives = False
        self._knows_drives = False
        self._rests_since: Optional[_Answer] = None
        self._answered_at = 0.0
        self.forget()

    def forget(self) -> None:
        """Drop the open questions, because the feed is a new one."""
        self._generation += 1
        self._asks_joints = False
        self._frames: Deque[RobotState] = deque(maxlen=_LONGEST_HISTORY)
        self._open: List[_Answer] = []
        self._began_at = None
        self._asked_at = self.agreed_at = self.rested_at = 0.0
        self._drives_off_since: Optional[float] = None
        self._answers: Deque[Vector] = deque(maxlen=_KEPT_ANSWERS)
        self._is_telling = self._was_moving = False

    @property
    def can_tell(self) -> bool:
        """True where the controller knows the question, and its answers are not known to differ from its feed."""
        return Query.JOINTS not in self._refused and (self._was_right or self._tries > 0)

    @property
    def is_unanswered(self) -> bool:
        """True while an answer has not been found in the feed, or none was on these connections: what they show may be
        old, or damaged, from their first frame on.
        """
        return bool(self._open) or not self.agreed_at

    def wants_to_ask(self, rest_after: float, now: float) -> bool:
        """Return whether a question is due: where the feed is disputed, or was not compared yet, and no open one could
        settle it, or for rest.

        rest_after: Somebody waits for evidence that the arm has rested at this moment, s.
        """
        if self._asks_joints:
            return False
        if self.dispute:
            return not self._open and bool(self._frames)
        if not self.can_tell or 0.0 < self.rested_at >= rest_after:
            return False
        if not self.agreed_at:
            return not self._open
        first = self._rests_since
        return self._asked_at < rest_after <= now or (
            first is not None and self._asked_at < first.at + REST_TIME_S <= now)

    def distrust(self, why: str, counts_from: float) -> None:
        """Dispute the feed: what it showed before this moment, s, proves nothing."""
        if not self.dispute:
            self._actions.log(logging.WARNING, "status feed: not believed until it shows where the controller says the "
                                               "arm is: " + why)
        self.dispute, self._counts_from = why, counts_from
        self.forget()

    def settle(self) -> None:
        """Believe the feed again."""
        if self.dispute:
            self.dispute = ""
            self._actions.log(logging.INFO, "status feed: believed again")

    def ask(self, now: float) -> None:
        """Send the questions, where the command port is open and the feed has shown something.

        One that waits for its answer is not put again: replies are paired by name, and one that is lost would never be
        missed.
        """
        if self._newest is None:
            return
        if Query.DRIVES_READY not in self._refused and not self._asks_drives:
            self._asks_drives = True
            self._channel.request(Query.DRIVES_READY, now, self._drives_answered)
        if Query.JOINTS not in self._refused and not self._asks_joints:
            self._asks_joints, self._asked_at = True, now
            generation = self._generation
            self._channel.request(Query.JOINTS, now, lambda result, error, at: self._joints_answered(
                result, error, at, generation, now))

    def saw(self, state: RobotState, is_new: bool, period: float) -> str:
        """Compare a frame with the answers; return why the feed is too old, "" where nothing proves it.

        period: The usual one, s.
        """
        self._newest, now, self._period = state, state.received_at, period
        if now < self._counts_from:
            return ""
        before = self._frames[-1] if self._frames else state
        self._began_at = now if self._began_at is None else self._began_at
        if not (state.is_powered and state.is_enabled):
            self._drives_off_since = None
        self._frames.append(state)
        longest = max(self._longest_age, min(_PERIODS * period + _LATE_S, self._most_age))
        is_late = bool(self._open) and now - self._open[0].at > longest  # also where it is found now: then this is old
        at = self._open[0].at if is_late else now
        for number, answer in reversed(list(enumerate(self._open))):
            if _passes(before.joint_position, state.joint_position, answer.joints):
                unseen = [earlier for earlier in self._open[:number] if self._was_never_shown(earlier)]
                if now - answer.at <= longest:
                    is_late = is_late and self._open[0] in unseen
                    self._confirmed(answer.asked_at, now)
                self._open = unseen + self._open[number + 1:]
                break
        if is_late and (is_new or self.dispute):
            self._open = [answer for answer in self._open if answer.at > at]
            text = ("its frames are more than %.2f s old: they do not show where the controller says the arm is"
                    % (now - at))
            if self._is_contradicted(now):
                self.distrust(text, now)
                return text
        if is_new and self._drives_off_since is not None and now - self._drives_off_since > _DRIVES_S:
            self._drives_off_since, self._knows_drives = None, False
            return ("its frames are more than %.2f s old: they show drives on that the controller says are off"
                    % _DRIVES_S)
        return ""

    def take_motion_seen(self) -> bool:
        """Return, once, whether an answer was found in time in a feed that showed motion: that one was not old."""
        was_moving, self._was_moving = self._was_moving, False
        return was_moving

    # ---- inside ----

    def _joints_answered(self, result: object, error: Optional[JakaError], now: float, generation: int, asked_at: float
                     ) -> None:
        if error is not None:
            self._note_refusal(Query.JOINTS, error)
        if generation != self._generation:
            return
        self._asks_joints = False
        if error is not None:
            return
        self._misread[Query.JOINTS] = 0
        joints = cast(Vector, result)
        rests_since = self._rests_since
        if rests_since is None or now - self._answered_at > LONGEST_GAP_S or not _is_near(
                rests_since.joints, joints, MOVEMENT):
            self._rests_since = _Answer(joints, now, asked_at)
        self._answered_at = now
        self._is_telling = len(self._answers) == _KEPT_ANSWERS and not any(
            _is_near(earlier, joints, 4.0 * NEAR) for earlier in self._answers)
        self._answers.append(joints)
        frames = self._frames_since(asked_at)
        pairs = zip(frames, frames[1:] or frames)
        if any(_passes(before.joint_position, after.joint_position, joints) for before, after in pairs):
            self._confirmed(asked_at, now)
            self._open = [earlier for earlier in self._open if self._was_never_shown(earlier)]
        else:
            self._open.append(_Answer(joints, now, asked_at))

    def _frames_since(self, moment: float) -> List[RobotState]:
        """Return the frames from the last one before this moment, s, on."""
        frames: List[RobotState] = []
        for frame in reversed(self._frames):
            frames.append(frame)
            if frame.received_at <= moment:
                break
        return frames[::-1]

    def _was_never_shown(self, answer: _Answer) -> bool:
        """Return whether the feed has stood since a question, elsewhere than where its answer shows the arm.

        Then an arm that went there and back is shown late. A feed that moves passes by many places between its frames.
        """
        frames = self._frames_since(answer.asked_at)
        stands_at = frames[-1].joint_position
        gap = max([self._period] + [b.received_at - a.received_at for a, b in zip(frames, frames[1:])])
        return all(_is_near(frame.joint_position, stands_at, NEAR) for frame in frames) and not _is_near(
            stands_at, answer.joints, 2.0 * NEAR + _BRIEF_TURN * gap * gap)

    def _confirmed(self, asked_at: float, now: float) -> None:
        self.is_trusted = self._was_right = True
        self.agreed_at = asked_at
        if self._rests_since is not None and asked_at - self._rests_since.at >= REST_TIME_S:
            self.rested_at = asked_at
        self._was_moving = self._was_moving or self._is_telling
        self.settle()

    def _is_contradicted(self, now: float) -> bool:
        """Return whether a contradiction counts.

        That of a witness that has not been right yet, or is wrong again at once, does not.
        """
        was_trusted, self.is_trusted = self.is_trusted, False
        if was_trusted:
            return True
        if self._tries and not self._was_right:
            self._tries -= 1
            if not self._tries:
                self._actions.log(logging.WARNING, "the joints that the controller answers with are not those of its "
                                                   "status feed: how old that is shows from its rhythm only")
        return bool(self.dispute) and self._began_at is not None and now - self._began_at > _ANEW_S

    def _drives_answered(self, result: object, error: Optional[JakaError], now: float) -> None:
        self._asks_drives = False
        if error is not None:
            self._note_refusal(Query.DRIVES_READY, error)
            return
        self._misread[Query.DRIVES_READY] = 0
        state = self._newest
        is_shown = state is not None and state.is_powered and state.is_enabled
        if result:
            self._drives_off_since = None
            self._knows_drives = self._knows_drives or is_shown
        elif is_shown and self._knows_drives and self._drives_off_since is None:
            self._drives_off_since = now

    def _note_refusal(self, query: Query, error: JakaError) -> None:
        self._misread[query] += isinstance(error, ProtocolError)
        if isinstance(error, CommandRejected) or self._misread[query] >= _MISREAD:
            self._refused.append(query)
            if query is Query.JOINTS:
                self.is_trusted = False
                self._actions.log(logging.INFO, "how old the status feed is shows from its rhythm only: %s" % error)


def _is_near(a: Vector, b: Vector, tolerance: float) -> bool:
    return all(abs(p - q) <= tolerance for p, q in zip(a, b))


def _passes(before: Vector, after: Vector, joints: Vector) -> bool:
    """Return whether the way between two frames leads by these joints; one may have turned back between them."""
    for a, b, q in zip(before, after, joints):
        slack = NEAR + min(abs(b - a), _TURN)
        if not min(a, b) - slack <= q <= max(a, b) + slack:
            return False
    return True
