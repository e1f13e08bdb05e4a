"""The steps of procedures: sequences of requests and conditions, written as generators and driven by the core's events.

A procedure yields steps and is resumed with their results; errors are raised inside it, at the step. Its return value
is its result::

    def set_collision_level(level):
        yield Ask(SetCollisionLevel(level))
        held = yield Ask(Query.COLLISION_LEVEL)
        return "level %d" % held
"""
from functools import partial
from typing import Any, Callable, Generator, NamedTuple, Optional, TypeVar, Union

from jaka_ros_driver.clearance.guard import Looks
from jaka_ros_driver.client.core.channel import CommandChannel, Requests
from jaka_ros_driver.commands import Command
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol import codec

_NEVER = float("inf")
_SLICE_WORK = 1500
"""Work of a slice, in that of a distance; with more a stop waits longer for the lock, with less a look takes longer."""
_BREATH_S = 0.001
"""The work of a slice, in that of a distance, and the pause behind it, s, in which a stop takes the lock."""


class Ask(NamedTuple):
    """The step that sends a command and waits for its result; errors are those of ``CommandChannel.request``."""

    command: Command


class SendAhead(NamedTuple):
    """The step that sends a command and continues at once; a failure before the procedure's end is raised in it."""

    command: Command


class Until(NamedTuple):
    """The step that waits until ``holds(now)``, at most ``timeout`` s; its result is False when the time is over, else
    True.

    What ``holds`` raises is raised in the procedure.
    """

    holds: Callable[[float], bool]
    timeout: float


class Now(NamedTuple):
    """The step whose result is the present time, s."""


T = TypeVar("T")
_Step = Union[Ask, SendAhead, Until, Now]
Procedure = Generator[_Step, Any, Any]
"""A procedure: what its steps send it, and what it returns, differs from step to step and from one to the next."""
OnEnd = Callable[[object, Optional[JakaError], float], None]


class Running:
    """The driver of one running procedure."""

    def __init__(self, procedure: Procedure, channel: Requests, on_end: OnEnd,
                 gate: Optional[CommandChannel] = None) -> None:
        """Set up the driver; ``begin`` begins.

        Args:
            procedure: The generator to run.
            channel: Takes its requests.
            on_end: Called with result, error and time, once.
            gate: The channel whose slow replies it does not wait for: what they would hold up is not sent, and refused
                as soon as that is known. None: it waits for them.
        """
        self._procedure = procedure
        self._channel = channel
        self._on_end = on_end
        self._until: Optional[Until] = None
        self._deadline = _NEVER
        self._asked = 0
        self._gate = gate
        self._held: Optional[Ask] = None
        self.has_ended = False

    @property
    def deadline(self) -> float:
        """The latest time at which ``tick`` is due, s."""
        return self._deadline

    def begin(self, now: float) -> None:
        """Run to the first step that must be waited for."""
        self._resume(lambda: self._procedure.send(None), now)

    def tick(self, now: float) -> None:
        """Continue where the awaited condition holds, or has taken too long."""
        until = self._until
        if until is None:
            return
        try:
            holds = until.holds(now)
        except JakaError as error:
            self.throw(error, now)
            return
        if not holds and now < self._deadline:
            return
        held = self._held
        self._until, self._deadline, self._held = None, _NEVER, None
        if held is None:
            self._resume(lambda: self._procedure.send(holds), now)
        elif holds:
            self._resume(lambda: held, now)
        else:
            self._refuse(held, now)

    def throw(self, error: JakaError, now: float) -> None:
        """Raise this error in the procedure, which ends it unless it handles the error."""
        if not self.has_ended:
            self._until, self._deadline, self._held = None, _NEVER, None
            self._asked += 1
            self._resume(lambda: self._procedure.throw(error), now)

    def _hold(self, ask: Ask, gate: CommandChannel, now: float) -> None:
        """Wait until it is known whether a slow reply holds up the one to this step."""
        self._held, self._deadline = ask, gate.held_up_until or now
        self._until = Until(lambda _: gate.held_up_until is None, self._deadline - now)
        self.tick(now)

    def _refuse(self, ask: Ask, now: float) -> None:
        assert self._gate is not None
        try:
            self._gate.require_prompt(codec.command_name(ask.command))
        except JakaError as error:
            self.throw(error, now)

    def _ask(self, command: Command, now: float) -> None:
        self._asked += 1
        number = self._asked
        self._channel.request(command, now, lambda result, error, at: self._replied(number, result, error, at))

    def _replied(self, number: int, result: object, error: Optional[JakaError], now: float) -> None:
        if self.has_ended or number != self._asked:
            return  # it was interrupted while it waited for this reply
        if error is not None:
            self.throw(error, now)
        else:
            self._resume(lambda: self._procedure.send(result), now)

    def _answered(self, _result: object, error: Optional[JakaError], now: float) -> None:
        if error is not None:
            self.throw(error, now)

    def _resume(self, step: Callable[[], _Step], now: float) -> None:
        try:
            while True:
                wanted = step()
                if isinstance(wanted, Now):
                    step = partial(self._procedure.send, now)
                    continue
                if isinstance(wanted, Until):
                    self._until, self._deadline = wanted, now + wanted.timeout
                    self.tick(now)
                    return
                if isinstance(wanted, Ask) and self._gate is not None and self._gate.held_up_until is not None:
                    self._hold(wanted, self._gate, now)
                    return
                try:
                    if isinstance(wanted, Ask):
                        self._ask(wanted.command, now)
                        return
                    self._channel.request(wanted.command, now, self._answered)
                    step = partial(self._procedure.send, None)
                except JakaError as error:
                    step = partial(self._procedure.throw, error)
        except StopIteration as end:
            self.has_ended = True
            self._on_end(end.value, None, now)
        except JakaError as error:
            self.has_ended = True
            self._on_end(None, error, now)


def pause(seconds: float) -> Until:
    """Return a step that lets time pass, s."""
    return Until(lambda now: False, seconds)


def in_slices(looks: Looks[T], check: Callable[[], None]) -> Generator[_Step, object, T]:
    """Run a look of the motion guard to its end, in slices of some ms between which the core takes other events.

    ``check`` is called after each slice; what it raises ends the look.
    """
    work = 0
    while True:
        try:
            work += next(looks)
        except StopIteration as end:
            result: T = end.value
            return result
        if work >= _SLICE_WORK:
            work = 0
            yield pause(_BREATH_S)
            check()
