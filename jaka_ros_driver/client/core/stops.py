"""Stops: of what this driver moves, and of an arm that somebody else may move. Their callers wait for nothing else."""
from typing import Any, Callable, List

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.channel import Channel
from jaka_ros_driver.client.core.custody import Admission, Custody
from jaka_ros_driver.client.core.links import Links
from jaka_ros_driver.client.core.procedures.procedure import OnEnd, Procedure, Until
from jaka_ros_driver.client.core.stillness import REST_TIME_S
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Command, SetServoMode, Stop
from jaka_ros_driver.errors import JakaError, MotionInterrupted, ReplyTimeout, StopCause

CarryOut = Callable[[Procedure, OnEnd, float], None]


class Stops:
    """Sends them, and ends what waits to begin.

    Attributes:
        count: So many stops were asked for.
    """

    def __init__(self, actions: Actions, channel: Channel, custody: Custody, links: Links, admission: Admission,
                 settings: ClientSettings, carry_out: CarryOut) -> None:
        """carry_out: has a procedure run, and its end told."""
        self.count = 0
        self._actions = actions
        self._channel = channel
        self._custody = custody
        self._links = links
        self._admission = admission
        self._patience = settings.reply_timeout
        self._carry_out = carry_out

    def stop(self, call: Any, now: float) -> None:
        """Stop for a caller, who is answered once; errors as ``ArmCore.stop``."""
        self._end_waiting()
        if self._custody.is_free:
            self._stop_free_arm(call, now)
            return
        is_held_up = self._channel.is_held_up
        answer = _Once(self._actions, call)
        self._custody.stop_for(answer, now)
        if is_held_up:  # its reply may have to wait for power_on or enable_robot, its caller does not
            self._carry_out(self._until(lambda: answer.is_given),
                            lambda _, error, _at: answer(error or self._timeout()), now)

    def stop_own(self, now: float) -> None:
        """A stop that nobody is answered for."""
        self._end_waiting()
        if self._custody.is_free:
            self._stop_free_arm(None, now)
        else:
            self._custody.stop(MotionInterrupted(StopCause.STOPPED), now)

    def require_none_since(self, count: int) -> None:
        """See that no stop came since then; raises MotionInterrupted."""
        if self.count != count:
            raise MotionInterrupted(StopCause.STOPPED, "it was asked for before the stop")

    def _end_waiting(self) -> None:
        self.count += 1
        self._admission.end_waiting(MotionInterrupted(StopCause.STOPPED))

    def _stop_free_arm(self, call: Any, now: float) -> None:
        """A stop where this driver moves nothing: a program, the pendant, or servo mode of somebody else.

        Its reply may have to wait for that to power_on or enable_robot. Then it is answered when the arm has been seen
        at rest.
        """
        answer = _Once(self._actions, call)

        def replied(_result: Any, error: Any, at: float) -> None:
            self._admission.stops_under_way -= 1
            answer(error)
            self._admission.retry(at)

        def watched(rests: bool, error: Any, _at: float) -> None:
            answer(error or (None if rests else self._timeout()))

        is_held_up = self._channel.is_held_up
        commands: List[Command] = [SetServoMode(False)] if self._links.is_servo_active else []
        try:
            self._channel.request_all([*commands, Stop()], now, replied)
        except JakaError as error:
            answer(error)
            return
        self._admission.stops_under_way += 1
        if is_held_up:
            self._carry_out(self._until(lambda: self._custody.stillness.duration(now) >= REST_TIME_S), watched, now)

    def _until(self, holds: Callable[[], bool]) -> Procedure:
        return (yield Until(lambda _now: holds(), self._patience))

    def _timeout(self) -> ReplyTimeout:
        return ReplyTimeout("stop_program", self._patience)


class _Once:
    """Answers a call the first time that it is called.

    Attributes:
        is_given: It has been called.
    """

    def __init__(self, actions: Actions, call: Any) -> None:
        self._actions = actions
        self._call = call
        self.is_given = False

    def __call__(self, error: Any) -> None:
        if not self.is_given:
            self.is_given = True
            self._actions.answer(self._call, None, error)
