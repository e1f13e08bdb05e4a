"""The links to one controller, command and status port: kept up, watched, and checked for whose they are.

A loss of a link is passed to the custody of the motion at once; nothing is ever sent twice.
"""
import logging
from dataclasses import dataclass
from typing import Callable, Optional, Tuple

from jaka_ros_driver.client.core.actions import Actions, Port, PublishState
from jaka_ros_driver.client.core.channel import AwaitedReply, CommandChannel, Introduction
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.core.feed import LONGEST_DEBT_S, SILENCE_S, Feed, FeedHealth
from jaka_ros_driver.client.core.link import PortLink, Takeovers
from jaka_ros_driver.client.core.procedures import session
from jaka_ros_driver.client.core.procedures.steps import Running
from jaka_ros_driver.client.core.stillness import ALL_SHOWN, Shown
from jaka_ros_driver.client.core.witness import Witness
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import ConnectionLost, JakaError, ReplyTimeout
from jaka_ros_driver.state import RobotState

_BEAT_PERIOD_S = 0.25
"""Period, s, of the heartbeat. It keeps the age of what a moving arm shows below 0.8 s (docs/safety.md)."""
_GUARD_ACTS_S = 1.0
"""Time, s, after this process was held up, in which a lost connection may have been taken by the guard."""
_JUMP_SETTLES_S = 1.0
"""Time, s, without a jump after which joints are believed where the controller cannot be asked for them."""
_NEVER = float("inf")


@dataclass(frozen=True)
class LinkHealth:
    """The state of the links.

    Attributes:
        command_is_up: The command port is connected and answers.
        status_is_up: The status port is connected.
        connections: How often the command port has been connected since start.
        last_error: Why a link is down, empty when both are up.
        version: The controller's version, empty while unknown.
        feed_period: Period of the status feed as the controller confirmed it, s; None where it does not.
        damaged_replies: Replies that were not JSON since start.
        is_simulated: The controller is a simulated one; None before that is known.
        command_losses: How often a connection to the command port has ended since start.
        status_losses: The same of the status port.
    """

    command_is_up: bool
    status_is_up: bool
    connections: int
    last_error: str
    version: str
    feed_period: Optional[float]
    damaged_replies: int
    is_simulated: Optional[bool]
    command_losses: int
    status_losses: int


class Links:
    """The command port's channel and the status port's feed, with what keeps them up.

    Attributes:
        is_ready: The command port is connected and the controller has answered all that is asked first.
        is_servo_active: The controller is in servo mode; False while that is not known.
        about: The controller's answers about itself.
    """

    def __init__(self, settings: ClientSettings, actions: Actions, channel: CommandChannel, custody: Custody,
                 on_disturbed: Callable[[str], None], on_link_lost: Callable[[str], None]) -> None:
        """Set up without a connection; ``start`` connects.

        Args:
            settings: Times, and whose controller it is.
            actions: Where actions go.
            channel: Of the command port.
            custody: Who moves the arm.
            on_disturbed: Called with what the arm shows that ends an act that was begun without a call.
            on_link_lost: Called with a lost link or feed, which ends such an act, too.
        """
        self._settings = settings
        self._actions = actions
        self._channel = channel
        self._custody = custody
        self._on_disturbed = on_disturbed
        self._on_link_lost = on_link_lost
        self._feed = Feed(settings.feed_period)
        self._witness = Witness(actions, channel, settings.silence_timeout)
        self._command = PortLink(Port.COMMAND, actions)
        self._status = PortLink(Port.STATUS, actions)
        self._handshake: Optional[Running] = None
        self._next_beat = _NEVER
        self._last_event = 0.0
        self._held_up = 0.0
        self._held_up_at = -_NEVER
        self._takeovers = Takeovers()
        self._may_be_held = False  # by a controller that serves its first client only and does not know that it left
        self._has_sight = False
        self._jumped_at = 0.0
        self._health = _HealthWatch()
        self._is_closing = False
        self.is_ready = False
        self.is_servo_active = False
        self.about = session.About()
        self.is_output_reported = False

    # ---- what is known ----

    @property
    def state(self) -> Optional[RobotState]:
        """The newest state, however old; None before the first."""
        return self._feed.state

    @property
    def last_error(self) -> str:
        """The reason for which a link is down; empty when both are up."""
        return self._command.last_error or self._status.last_error or (
            "" if self.is_ready else "the controller has not answered yet")

    @property
    def is_up(self) -> bool:
        """True while both links are up."""
        return self.is_ready and self._status.is_up

    @property
    def deadline(self) -> float:
        """The time at which ``tick`` is due, s."""
        return min(self._command.retry_at, self._status.retry_at, self._next_beat)

    @property
    def is_in_question(self) -> bool:
        """True while the feed has not shown what the controller answered, and may show it."""
        return self._witness.can_tell and self._witness.is_unanswered

    def fresh_state(self, now: float) -> RobotState:
        """Return the newest state.

        Raises:
            ConnectionLost: It is stale, or there is none.
        """
        state = self._feed.fresh_state(self._settings.stale_after, now)
        if state is None:
            raise ConnectionLost("no fresh status of the arm: " + (
                self.last_error or self._witness.dispute or "the status feed is silent"))
        return state

    def health(self) -> LinkHealth:
        """Return the state of the links."""
        about = self.about
        return LinkHealth(self.is_ready, self._status.is_up, self._command.connections, self.last_error,
                          about.version, about.feed_period, self._channel.damaged_replies, about.is_simulated,
                          self._command.losses, self._status.losses)

    def feed_health(self, now: float) -> FeedHealth:
        """Return the state of the status feed."""
        return self._feed.health(now, self._settings.silence_timeout)

    # ---- events ----

    def start(self, now: float) -> None:
        """Begin to connect.

        The state of a controller that must identify itself is not read before it has.
        """
        self._last_event = now
        self._command.start(now)
        if not self._settings.simulator:
            self._status.start(now)

    def note_time(self, now: float) -> None:
        """Take the time of an event, and notice where nobody came for a while, as after the process was stopped.

        Every event passes here.
        """
        gap, self._last_event = now - self._last_event, now
        if gap > SILENCE_S:
            self._held_up, self._held_up_at = gap, now
            self._feed.held_up()
            if self._next_beat < _NEVER:
                self._next_beat = now

    def opened(self, port: Port, now: float) -> None:
        if port is Port.STATUS:
            self._status.opened(now)
            self._feed.open(now)
            self._witness.forget()
            return
        self._command.opened(now)
        self._witness.open()
        introduction = self._channel.open()
        if not self._settings.simulator:
            self._trust(introduction, now)
            return
        self._handshake = Running(
            session.introduction(self._settings, self._actions), introduction,
            lambda _, error, at: self._handshake_failed(error, at) if error else self._trust(introduction, at))
        self._handshake.begin(now)

    def failed(self, port: Port, reason: str, now: float) -> None:
        (self._status if port is Port.STATUS else self._command).failed(reason, now)

    def closed(self, port: Port, reason: str, now: float) -> None:
        if port is Port.STATUS:
            self._status.lost(reason, now)
            self._sight_lost(reason, now)
        else:
            self._command_ended(reason, now)

    def received(self, port: Port, data: bytes, now: float) -> None:
        if port is Port.COMMAND:
            self._channel.received(data, now)
            if self._command.is_up and self._channel.is_flooded:
                self._drop_command("command port: nothing that comes answers a request", now)
            return
        doubt = ""
        for state, is_new in self._feed.received(data, now, self._is_believed):
            trouble = self._health.trouble(state)
            if trouble:
                self._on_disturbed(trouble)
            doubt = doubt or self._witness.saw(state, is_new, self._feed.usual_period)
            is_new = is_new and not doubt
            if is_new:
                self._has_sight = True
                witness = self._witness
                self._custody.observe(state, now, Shown(witness.rested_at, witness.agreed_at)
                                      if witness.can_tell else ALL_SHOWN)
            self._actions.add(PublishState(state, is_new))
        if self._channel.is_open and self._witness.wants_to_ask(self._custody.question_due, now):
            self._witness.ask(now)
        if self._witness.take_motion_seen():
            self._feed.refute_debt()
        elif not doubt and self._feed.owed > LONGEST_DEBT_S and not (
                self._witness.is_trusted and now - self._witness.agreed_at < self._settings.silence_timeout):
            doubt = "frames of %.2f s have not come, though it never fell silent" % self._feed.owed
        if self._witness.dispute:
            self._feed.give_up()
        if doubt:
            self._jumped_at = 0.0
            self._feed.give_up()
            self._drop_feed("status port: old news: " + doubt, now)
        elif self._feed.is_flooded:
            self._drop_feed("status port: what comes are no status frames", now)

    def tick(self, now: float) -> None:
        late = self._channel.overdue(now)
        if late is not None:
            self._drop_command(str(ReplyTimeout(late.name, late.allowed_s)), now, late)
        self._watch_feed(now)
        if self._handshake is not None:
            self._handshake.tick(now)
        if self._custody.must_stop:
            self._command.hurry()
        self._command.tick(now)
        self._status.tick(now)
        if now >= self._next_beat and self._channel.is_open:
            self._next_beat = _NEVER
            self._channel.request(Query.SERVO_MODE, now, lambda result, error, at: self._beat_replied(
                result, error, now, at))
            if self._has_sight or self._witness.dispute:
                self._witness.ask(now)

    def take_port(self, now: float) -> bool:
        """Connect at once where the command port was left to another client; return whether it was."""
        is_left = self._command.is_left_to_others
        if is_left:
            self._command.hurry(now)
        return is_left

    def close(self) -> None:
        """Take note that the driver is about to end."""
        self._is_closing = True

    def disconnect(self, now: float) -> None:
        """Close both links for good; answer those who wait for a reply."""
        reason = "driver shut down"
        self._command.stop(reason)
        self._status.stop(reason)
        self._command_lost(reason, now)

    # ---- inside ----

    def _trust(self, introduction: Introduction, now: float) -> None:
        """Use the connection of the intended controller: what is owed to it goes out first."""
        self._channel.trust(introduction)
        self._custody.link_up(now)
        if self._settings.simulator:
            self._status.start(now)
        self._handshake = Running(session.handshake(self._settings, self._actions), self._channel,
                                  self._handshake_ended)
        self._handshake.begin(now)

    def _handshake_ended(self, about: object, error: Optional[JakaError], now: float) -> None:
        if error is not None:
            self._handshake_failed(error, now)
            return
        self._handshake = None
        assert isinstance(about, session.About)
        self.about = about
        self.is_output_reported = False
        self._feed.confirmed(about.feed_period)
        self.is_servo_active = about.is_servo_active
        self._channel.io_index_base = session.io_index_base(self._settings, about.version)
        self.is_ready = True
        self._may_be_held = False
        self._next_beat = now + _BEAT_PERIOD_S

    def _handshake_failed(self, error: JakaError, now: float) -> None:
        self._handshake = None
        if self._command.is_up:
            self._drop_command(str(error), now)

    def _beat_replied(self, result: object, error: Optional[JakaError], asked_at: float, now: float) -> None:
        """Take the answer to the heartbeat.

        It reveals a port that has fallen silent, and whether servo mode is on.
        """
        pause = _BEAT_PERIOD_S if asked_at > self._held_up_at else 0.0  # what piled up must be compared at once
        self._next_beat = now + pause if self.is_ready else _NEVER
        if error is None:
            self.is_servo_active = bool(result)
            self._custody.note_servo_mode(self.is_servo_active, asked_at, now)

    def _command_ended(self, reason: str, now: float) -> None:
        """Handle a connection that the controller has ended.

        A client that takes the port again and again is given way.
        """
        lasted = self._command.lasted(now)
        is_all_well = (self._has_sight and self._status.is_up and now - self._held_up_at > _GUARD_ACTS_S
                       and self._feed.fresh_state(self._settings.stale_after, now) is not None
                       and (self._channel.was_answered or not self._may_be_held))
        if is_all_well and self._command.is_up:
            self._takeovers.note(lasted, now)
        was_giving_way = self._command.gives_way(now)
        is_taken = is_all_well and (was_giving_way or self._takeovers.are_rivalry(now))
        if is_taken:
            reason = "%s: %s" % (self._takeovers, reason)
        self._command.lost(reason, now)
        if is_taken:
            self._command.give_way(now)
            if not was_giving_way:
                self._actions.log(logging.ERROR, "giving way: %s" % self._takeovers)
        self._command_lost(reason, now)
        if self._custody.must_stop:
            self._command.hurry()

    def _drop_command(self, reason: str, now: float, late: Optional[AwaitedReply] = None) -> None:
        self._may_be_held = True
        self._command.drop(reason, now)
        self._command_lost(reason, now, late)

    def _command_lost(self, reason: str, now: float, late: Optional[AwaitedReply] = None) -> None:
        was_ready = self.is_ready
        self.is_ready = self.is_servo_active = False
        self._next_beat = _NEVER
        self._channel.close(reason, now, late)
        self._custody.link_lost(reason, now)
        if was_ready:
            self._on_link_lost("the link was lost")
        if self._settings.simulator and self._status.is_wanted:
            was_up = self._status.is_up
            self._status.stop("it is not known whose it is")  # also where it is still connecting
            if was_up:
                self._sight_lost(reason, now)

    def _is_believed(self, state: RobotState) -> bool:
        """Return whether a frame that has come in time may be taken for true; joints that jump may not.

        Where no witness can settle that, joints that have not jumped for a while may.
        """
        now, witness = state.received_at, self._witness
        jump = self._custody.notice_jump(state, now)
        if jump:
            self._jumped_at = now
            witness.distrust(jump, now)
        elif witness.dispute and now - self._jumped_at > _JUMP_SETTLES_S:
            if not witness.can_tell or (self._jumped_at and not self._channel.is_open):
                witness.settle()
        return not witness.dispute

    def _watch_feed(self, now: float) -> None:
        held_up, self._held_up = self._held_up, 0.0
        silent = now - self._feed.last_byte_at
        timeout = self._settings.silence_timeout
        if self._status.is_up and max(silent, held_up) > timeout:
            reason = ("the driver was held up for %.1f s" % held_up if held_up > timeout
                      else "status port: silent for %.1f s" % silent)
            self._drop_feed(reason, now)
        elif self._has_sight and self._feed.fresh_state(timeout, now) is None:
            self._sight_lost("no status frame that can be believed for %.1f s: %s" % (timeout, self._witness.dispute)
                             if self._witness.dispute else "no readable status frame for %.1f s" % timeout, now)

    def _drop_feed(self, reason: str, now: float) -> None:
        self._status.drop(reason, now)
        self._sight_lost(reason, now)

    def _sight_lost(self, reason: str, now: float) -> None:
        if self._has_sight:
            self._has_sight = False
            self._on_link_lost("the status feed was lost")
        self._custody.sight_lost(reason, now)


class _HealthWatch:
    """The detector of a stop, a fault, or drives that go off, in every frame, old or new.

    A trouble that joins another counts, too.
    """

    def __init__(self) -> None:
        self._before: Tuple[bool, ...] = (True,) * 3
        self._was_powered = self._was_enabled = False

    def trouble(self, state: RobotState) -> str:
        """Return what has become worse with this frame, in words; "" for nothing."""
        now = (state.emergency_stop, state.protective_stop, state.has_fault and not state.has_warning)
        trouble = ""
        if now != self._before and any(is_bad and not was_bad for is_bad, was_bad in zip(now, self._before)):
            trouble = "the arm was stopped or has a fault"
        elif (self._was_powered and not state.is_powered) or (self._was_enabled and not state.is_enabled):
            trouble = "the drives went off"
        self._before, self._was_powered, self._was_enabled = now, state.is_powered, state.is_enabled
        return trouble
