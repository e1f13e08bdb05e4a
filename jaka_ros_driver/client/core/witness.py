"""The second witness of the status feed's age: the controller's answers on the command port.

A link that carries less than the feed delivers it at a steady rhythm of its own, which arrivals alone do not tell from
the rhythm of a slow controller. Content does: what the controller answers when it is asked must appear in the feed soon
afterwards. A feed that does not show it in time is older than that time, however regularly its frames come.
"""
import logging
from collections import deque
from typing import Any, Deque, List, NamedTuple, Optional

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.channel import Channel
from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import CommandRejected, JakaError, ProtocolError
from jaka_ros_driver.state import RobotState, Vector

NEAR = 0.005
"""rad; answer and feed may differ by so much where both tell of the same moment: one may be measured, one commanded."""
_LEAST_AGE_S = 0.25
_PERIODS = 3.0
"""A frame of a feed with long pauses is by itself one period old, and may be late once."""
_AGE_SHARE = 1.0 / 3.0
"""Age at which the feed is given up, as a share of the promise: the next question, and its answer, take time, too."""
_DRIVES_S = 0.5
"""s; the feed may show drives ready for so long after the controller first answered that they are not."""
_LONGEST_HISTORY = 250
"""Frames; a question whose answer takes longer says nothing."""
_TRIES = 8
_MISREAD = 3
"""Replies in a row that cannot be read, after which the question is not put any more."""
_KEPT_ANSWERS = 4
"""A second's: an answer far from all of them could not have been found in a feed that is a second old."""


class _Answer(NamedTuple):
    joints: Vector
    at: float


class Witness:
    """Asks for joints and drives at each beat, and compares each answer with the frames since its question.

    Attributes:
        is_trusted: An answer of this connection has been found in the feed. Before that its contradiction says nothing.
    """

    def __init__(self, actions: Actions, channel: Channel, silence_timeout: float) -> None:
        """silence_timeout: s; a frame that is taken for new must not be older than this."""
        self._actions = actions
        self._channel = channel
        self._longest_age = max(_LEAST_AGE_S, _AGE_SHARE * silence_timeout)
        self.open()

    def open(self) -> None:
        """Begin with a new connection of the command port: another controller may answer there."""
        self.is_trusted = False
        self._refused: List[Query] = []
        self._misread = dict.fromkeys((Query.JOINTS, Query.DRIVES_READY), 0)
        self._tries = _TRIES
        self._newest: Optional[RobotState] = None
        self._knows_drives = False
        self.forget()

    def forget(self) -> None:
        """Drop the open questions: the feed is a new one, or nobody read it for a while."""
        self._history: List[Vector] = []
        self._answer: Optional[_Answer] = None
        self._drives_off_since: Optional[float] = None
        self._answers: Deque[Vector] = deque(maxlen=_KEPT_ANSWERS)
        self._is_telling = self._was_moving = False

    def ask(self, now: float) -> None:
        """Put the questions, where the command port is open and the feed has shown something."""
        if self._newest is None:
            return
        if Query.DRIVES_READY not in self._refused:
            self._channel.request(Query.DRIVES_READY, now, self._drives_told)
        if Query.JOINTS not in self._refused and self._answer is None and not self._history:
            self._history = [self._newest.joint_position]
            self._channel.request(Query.JOINTS, now, self._joints_told)

    def saw(self, state: RobotState, is_new: bool, period: float) -> str:
        """Compare a frame; returns why the feed is too old, "" where nothing says so. ``period``: the usual one, s."""
        before, self._newest = self._newest, state
        if not (state.is_powered and state.is_enabled):
            self._drives_off_since = None
        if self._history:
            self._history.append(state.joint_position)
            if len(self._history) > _LONGEST_HISTORY:
                self._history = []
        now, answer = state.received_at, self._answer
        if answer is not None and before is not None:
            if _passes(before.joint_position, state.joint_position, answer.joints):
                self._confirmed()
            elif is_new and now - answer.at > max(self._longest_age, _PERIODS * period):
                self._answer = None
                if self._is_contradicted():
                    return ("its frames are more than %.2f s old: they do not show where the controller says the arm is"
                            % (now - answer.at))
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

    def _joints_told(self, result: Any, error: Optional[JakaError], now: float) -> None:
        history, self._history = self._history, []
        if error is not None:
            self._note_refusal(Query.JOINTS, error)
            return
        self._misread[Query.JOINTS] = 0
        if not history:
            return
        joints: Vector = result
        self._is_telling = len(self._answers) == _KEPT_ANSWERS and not any(
            _is_near(earlier, joints, 4.0 * NEAR) for earlier in self._answers)
        self._answers.append(joints)
        self._answer = _Answer(joints, now)
        pairs = zip(history, history[1:] or history)
        if any(_passes(before, after, joints) for before, after in pairs):
            self._confirmed()

    def _confirmed(self) -> None:
        self._answer = None
        self.is_trusted = True
        self._was_moving = self._was_moving or self._is_telling

    def _is_contradicted(self) -> bool:
        """Return whether that counts: not of a witness that has not been right yet, or is wrong again at once."""
        was_trusted, self.is_trusted = self.is_trusted, False
        if not was_trusted and self._tries:
            self._tries -= 1
            if not self._tries:
                self._actions.log(logging.WARNING, "the joints that the controller answers with are not those of its "
                                                   "status feed: how old that is shows from its rhythm only")
        return was_trusted

    def _drives_told(self, result: Any, error: Optional[JakaError], now: float) -> None:
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
        slack = NEAR + abs(b - a)
        if not min(a, b) - slack <= q <= max(a, b) + slack:
            return False
    return True
