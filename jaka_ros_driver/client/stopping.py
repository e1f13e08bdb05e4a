"""The guard's stop of an arm whose driver is dead or frozen, step by step; it has no socket, thread or clock.

The stop is repeated until the controller accepts it, and again as long as the status feed does not show the arm at
rest.
"""
import enum
import math
from typing import Callable, Optional, Set

from jaka_ros_driver.client.core.stillness import SURE_REST_S, Stillness
from jaka_ros_driver.commands import Command, JogStop, Stop, whole_stop
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.exchange import Exchange
from jaka_ros_driver.protocol.framing import FramedItem, encode_object
from jaka_ros_driver.state import RobotState

GIVE_UP_AFTER_S = 60.0
"""Time, s, after which a stop that was not accepted, or an arm not seen at rest, is given up and logged."""
LOCKED_OUT_AFTER_S = 0.25
"""Time, s, of being turned away after which the frozen driver's connection is taken for the reason."""
CONFIRM_AFTER_S = 0.5
"""Time, s, after an accepted stop until it is sent again where the arm is not seen at rest."""
BLIND_STOPS = 3
"""Number of accepted stops that suffice where the status feed cannot be read."""
STILL_FOR_S = SURE_REST_S
"""Stillness, s, in the status feed after which the arm counts as at rest: how fast it was moved is not known."""
_STILL_FOR_NOW_S = 0.12
"""Stillness, s, after which the arm may be at rest: no other stop is sent, and it is left to a driver that is back."""
_BLIND_AFTER_S = 0.5
"""Time, s, without a state after which the arm is not seen any more: five frames of the slowest feed."""
_CONNECT_TIMEOUT_S = 1.0
"""Longest time, s, to connect: a try that hangs is given up for another one."""
_REPLY_TIMEOUT_S = 1.0
"""Longest wait, s, for the reply to a stop; then it is sent on a new connection."""
_CONNECT_PERIOD_S = 0.05
"""Pause, s, before the next connection: short, because the arm moves."""
_REFUSED_PERIOD_S = 0.08
"""Pause, s, from the refusal of a stop to the next one: ten cycles of the controller."""
_AFTER_THE_DRIVER_S = 0.02
"""Time, s, that the kernel has to close the connections of the driver that was killed."""


class DriverCondition(enum.Enum):
    """The state of the driver, as far as the guard knows it."""

    SILENT = "silent"
    DEAD = "dead"
    BACK = "back"


class Step(enum.Enum):
    """The next step of a stop."""

    WAIT = "wait for what happens"
    CONNECT = "connect to the command port"
    SEND = "send what request() returns"
    HANG_UP = "close the connection to the command port"
    END_DRIVER = "end the driver's process, if it is silent still"
    FINISH = "nothing is left to be done"


class _Link(enum.Enum):
    DOWN = enum.auto()
    CONNECTING = enum.auto()
    UP = enum.auto()


class Stopping:
    """One stop of the arm, from the moment at which its driver fell silent until the arm is seen at rest.

    The caller asks for the next ``step``, carries it out, and reports the result.

    Attributes:
        has_seen_rest: True once the arm was seen at rest after the stop.
    """

    def __init__(self, now: float, log: Callable[[str], None], jog: Optional[JogStop] = None) -> None:
        """Begin a stop.

        jog: The command that ends the driver's jog; None where it began none, or that is not known.
        """
        self._log = log
        self._jog = jog
        self.has_seen_rest = False
        self._logged: Set[str] = set()
        self._give_up_at = now + GIVE_UP_AFTER_S
        self._next_at = now
        self._link = _Link.DOWN
        self._link_since = now
        self._has_replied = False
        self._locked_out_since: Optional[float] = None
        self._exchange: Exchange[Command] = Exchange()
        self._acceptances = 0
        self._accepted_at = now
        self._stillness = Stillness()
        self._seen_at = -math.inf
        self._has_no_drives = False
        self._feed_trouble = ""

    # ---- what is to be done ----

    def step(self, now: float, driver: DriverCondition) -> Step:
        """Return the next step."""
        if self._has_ended(now, driver):
            return Step.FINISH
        if self._link is _Link.UP:
            return self._step_on_the_link(now)
        if self._link is _Link.CONNECTING:
            return self._hang_up("no answer", False, now) if now > self._link_since + _CONNECT_TIMEOUT_S else Step.WAIT
        if now < self._next_at or self._may_rest(now):
            return Step.WAIT
        if driver is DriverCondition.BACK:
            self._log("the driver is back and sees to the arm itself")
            return Step.FINISH
        since = self._locked_out_since
        if driver is DriverCondition.SILENT and since is not None and now - since >= LOCKED_OUT_AFTER_S:
            self._locked_out_since, self._next_at = None, now + _AFTER_THE_DRIVER_S
            return Step.END_DRIVER
        self._link, self._link_since, self._has_replied = _Link.CONNECTING, now, False
        return Step.CONNECT

    def request(self, now: float) -> bytes:
        """Return the stop to send, the whole of it (``whole_stop``), and record its requests."""
        commands = whole_stop(self._jog, is_repeated=self._acceptances > 0)
        for command in commands:
            self._exchange.sent(codec.command_name(command), now, _REPLY_TIMEOUT_S, command)
        return b"".join(encode_object(codec.encode(command)) for command in commands)

    def _step_on_the_link(self, now: float) -> Step:
        late = self._exchange.overdue(now)
        if late is not None:
            return self._hang_up("no reply to %s" % late.name, True, now)
        if len(self._exchange) or now < self._next_at or self._may_rest(now):
            return Step.WAIT
        if self._acceptances and self._is_seen(now):
            self._log_once("the arm moves on %.1f s after an accepted stop, sending the stop again" % CONFIRM_AFTER_S)
        return Step.SEND

    def _hang_up(self, reason: str, is_turned_away: bool, now: float) -> Step:
        self.failed("command port: " + reason, is_turned_away, now)
        return Step.HANG_UP

    def _has_ended(self, now: float, driver: DriverCondition) -> bool:
        still_for = _STILL_FOR_NOW_S if driver is DriverCondition.BACK else STILL_FOR_S
        is_still = self._stillness.duration(self._accepted_at) >= still_for
        if is_still and (self._acceptances or self._has_no_drives):
            self.has_seen_rest = True
            self._log("the arm is at rest" if self._acceptances else "the arm is at rest, its drives are off")
        elif self._acceptances >= BLIND_STOPS and not self._is_seen(now):
            self._log("whether the arm is at rest could not be seen: %s; the controller accepted %d stops" % (
                self._feed_trouble or "status port: no frame has come", self._acceptances))
        elif now >= self._give_up_at:
            self._log("giving up after %.0f s: %s" % (GIVE_UP_AFTER_S, (
                "the controller accepted %d stops, and the arm was not seen at rest" % self._acceptances
                if self._acceptances else "the arm could not be stopped")))
        else:
            return False
        return True

    def _may_rest(self, now: float) -> bool:
        """Return whether the arm has looked still since an accepted stop; one that creeps may look so for a while."""
        return self._acceptances > 0 and self._is_seen(now) and (
            self._stillness.duration(self._accepted_at) >= _STILL_FOR_NOW_S)

    def _is_seen(self, now: float) -> bool:
        return now - self._seen_at <= _BLIND_AFTER_S

    # ---- what has happened ----

    def connected(self) -> None:
        """Take note that the command port is connected."""
        self._link = _Link.UP

    def failed(self, reason: str, is_turned_away: bool, now: float) -> None:
        """Take note that the command port was not connected, or was lost.

        is_turned_away: The controller is reachable and refused.
        """
        if not is_turned_away or self._has_replied:
            self._locked_out_since = None
        elif self._locked_out_since is None:
            self._locked_out_since = self._link_since
        was_waiting = bool(len(self._exchange))
        self._exchange.abandon()
        self._link = _Link.DOWN
        if was_waiting or not self._acceptances:
            self._next_at = now + _CONNECT_PERIOD_S
            self._log_once(reason)

    def replied(self, item: FramedItem, now: float) -> None:
        """Take a reply, or bytes that are none."""
        self._has_replied, self._locked_out_since = True, None
        if isinstance(item, FramingError):
            self._refused("a reply cannot be read: %s" % item, now)
            return
        request = self._exchange.answered(item, now)
        if request is None or not isinstance(request.waiter, Stop):
            return  # servo mode was left, a jog ended, or there was none: all are fine
        try:
            codec.raise_if_rejected(request.name, item)
        except JakaError as error:
            self._refused(str(error), now)
            return
        self._exchange.abandon()
        if not self._acceptances:
            self._log("the controller accepted the stop")
            self._accepted_at = now
        self._acceptances += 1
        self._next_at = now + CONFIRM_AFTER_S

    def _refused(self, reason: str, now: float) -> None:
        self._exchange.abandon()
        self._next_at = now + _REFUSED_PERIOD_S
        self._log_once(reason)

    def saw(self, state: RobotState, now: float) -> None:
        """Take a state of the status feed."""
        self._stillness.observe(state)
        self._seen_at = now
        self._has_no_drives = not state.is_powered or not state.is_enabled

    def saw_nothing(self, reason: str) -> None:
        """Take note that the status feed cannot be read."""
        self._feed_trouble = reason

    def _log_once(self, text: str) -> None:
        """Log a text once, though its cause may come many times a second."""
        if text not in self._logged:
            self._logged.add(text)
            self._log(text)
