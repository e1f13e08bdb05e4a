"""The admission of requests for the arm: who may take custody next, and who waits until the arm is free and at rest."""
from typing import List, Optional, Protocol

from jaka_ros_driver.client.core.actions import Actions, Token
from jaka_ros_driver.client.core.contradictions import STREAMS, ArmEvidence, require_no_wait, require_start
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.stillness import REST_TIME_S, SURE_REST_S
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, JakaError
from jaka_ros_driver.state import RobotState

_WAIT_FOR_REST_S = 1.5 + SURE_REST_S
"""Longest time, s, that a motion waits for the arm to come to rest from an earlier one, and to be sure of that."""


class Sight(Protocol):
    """The interface to the present knowledge of the arm, which ``Links`` implements."""

    @property
    def is_up(self) -> bool:
        """True while both connections are up."""

    @property
    def last_error(self) -> str:
        """The reason for which a connection is down; empty when both are up."""

    @property
    def is_servo_active(self) -> bool:
        """True while the controller is in servo mode; False while that is not known."""

    @property
    def is_in_question(self) -> bool:
        """True while the feed has not shown what the controller answered, and may show it."""

    def fresh_state(self, now: float) -> RobotState:
        """Return the newest state; raise ConnectionLost where it is stale."""


class ArmRequest:
    """One caller's request for the arm: it begins at once, or when the arm has come to rest. A stop ends it.

    Attributes:
        call: Who is answered, once; None for nobody.
        owner: The kind of motion that it asks for.
        deadline: When it has waited long enough for the arm to come to rest, s.
    """

    owner = MotionOwner.SETTING

    def __init__(self, call: Token, admission: "Admission", asked_at: float) -> None:
        """Set up the request, which ``enter`` begins.

        asked_at: s; it waits from then on.
        """
        self.call = call
        self.asked_at = asked_at
        self.deadline = asked_at + _WAIT_FOR_REST_S
        self._admission = admission

    def enter(self, now: float) -> None:
        """Begin, have the running motion take it in, or wait; tried again while it waits.

        Raises:
            JakaError: It cannot begin; this is the call's answer.
        """
        self.check(now)
        if not self.join(now) and self._admission.may_begin(self, now):
            self.begin(now)

    def audit(self) -> None:
        """Check what does not depend on the arm's state, once.

        Raises:
            InvalidCommand: It is outside the model's limits.
        """

    def check(self, now: float) -> None:
        """Check that nothing forbids the motion now.

        Raises:
            JakaError: Something does.
        """

    def join(self, now: float) -> bool:
        """Have the running motion take this request in, where it can; return whether it did.

        Raises:
            JakaError: It refuses.
        """
        return False

    def begin(self, now: float) -> None:
        """Begin on an arm that is free and at rest.

        Raises:
            JakaError: Nothing was sent.
        """
        raise NotImplementedError


class Admission:
    """The queue of requests for the arm, of which one at a time is admitted.

    Attributes:
        busy_with: The change that needs the arm at rest and is being made, or the look at the way of a motion; None
            for nothing.
        is_guided: Hand guiding was switched on by this driver; not every feed has that.
        stops_under_way: Stops that were sent while nobody had custody, and are not answered yet.
    """

    def __init__(self, actions: Actions, custody: Custody, sight: Sight) -> None:
        self._actions = actions
        self._custody = custody
        self._sight = sight
        self._waiting: List[ArmRequest] = []
        self.busy_with: Optional[MotionOwner] = None
        self.is_guided = False
        self.stops_under_way = 0

    @property
    def owner(self) -> Optional[MotionOwner]:
        """The kind of motion that has the arm on behalf of this driver; None for none."""
        if self._custody.motion is not None:
            return self._custody.motion.owner
        return self.busy_with

    @property
    def deadline(self) -> float:
        """The time at which ``retry`` is due, s."""
        return min([request.deadline for request in self._waiting], default=float("inf"))

    def require_ready_to_move(self, owner: MotionOwner, now: float) -> RobotState:
        """Check that nothing forbids a motion of this kind now; return the arm's state.

        Raises:
            InvalidCommand: Something does (``contradictions``).
            ConnectionLost: There is no fresh state, or no link.
        """
        state = self._sight.fresh_state(now)
        require_start(owner, self.evidence(owner, state))
        self._custody.channel.require_prompt(owner.value)
        if not self._sight.is_up:
            raise ConnectionLost("no link to the controller: " + self._sight.last_error)
        return state

    def is_guided_in(self, state: RobotState) -> bool:
        """Return whether somebody guides the arm by hand; where the feed lacks that, what this driver switched on
        counts.
        """
        return self.is_guided if state.is_hand_guided is None else state.is_hand_guided

    def evidence(self, owner: MotionOwner, state: RobotState) -> ArmEvidence:
        """Return what is known before a motion of this kind."""
        is_free = self.owner is None  # else servo mode is this driver's own
        return ArmEvidence(state, self.is_guided_in(state), self._sight.is_servo_active if is_free else None,
                           None if owner in STREAMS else False)

    def may_begin(self, request: ArmRequest, now: float) -> bool:
        """Return whether the motion may begin; otherwise its request waits for the present one to come to rest.

        Raises:
            InvalidCommand: Somebody else has the arm, and keeps it.
            ConnectionLost: Whether the arm rests is not known.
        """
        owner = request.owner
        if self.is_free_at_rest(owner, now):
            return True
        if now >= request.deadline:
            raise InvalidCommand("refused: within %.1f s %s" % (_WAIT_FOR_REST_S, self._waited_for(request, now)))
        self._waiting.append(request)
        return False

    def _waited_for(self, request: ArmRequest, now: float) -> str:
        """Return what a request has waited for in vain, in words that follow a time; errors as ``may_begin``."""
        if self._custody.motion is None:
            if self.busy_with is not None:
                return "%s has not ended" % self.busy_with.value
            if self.stops_under_way:
                return "the controller has not answered a stop"
            require_no_wait(request.owner, self.evidence(request.owner, self._sight.fresh_state(now)))
            if self._sight.is_in_question and self._custody.stillness.duration() >= REST_TIME_S:
                return "the status feed has not shown where the controller says the arm is"
        return self._custody.unrest(request.asked_at)

    def wait(self, request: ArmRequest, now: float) -> None:
        """Have the request enter again later, behind those that wait already; until then its time does not count."""
        request.asked_at, request.deadline = now, now + _WAIT_FOR_REST_S
        self._waiting.append(request)

    def is_free_at_rest(self, owner: MotionOwner, now: float) -> bool:
        """Return whether a new motion may begin now; False while the arm comes to rest from an earlier one.

        Raises:
            InvalidCommand: Somebody else has the arm, and keeps it.
            ConnectionLost: Whether the arm rests is not known.
        """
        motion = self._custody.motion
        if motion is not None and not self._custody.is_ending and not motion.is_leaving:
            raise InvalidCommand("refused: %s owns the arm's motion; wait for its end or stop it first"
                                 % motion.owner.value)
        if not self._custody.is_free or self.busy_with is not None or self.stops_under_way:
            return False
        state = self._sight.fresh_state(now)
        try:
            require_no_wait(owner, self.evidence(owner, state))
        except InvalidCommand:
            return False
        return self._custody.stillness.duration() >= REST_TIME_S and not self._sight.is_in_question

    def is_waiting(self, request: ArmRequest) -> bool:
        """Return whether this request waits for the arm to come to rest."""
        return request in self._waiting

    def retry(self, now: float) -> None:
        """Try again to begin the waiting requests."""
        waiting, self._waiting = self._waiting, []
        for request in waiting:
            try:
                request.enter(now)
            except JakaError as error:
                self._actions.answer(request.call, None, error)

    def end_waiting(self, error: JakaError) -> None:
        """Answer every waiting request with this error."""
        self._actions.answer_all([one.call for one in self._waiting], error)
        self._waiting = []
