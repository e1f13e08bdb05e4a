"""The judge: what must hold of the arm, at every cycle, whatever goes wrong around the driver.

Evidence is the simulated arm's true state, the controller's executed commands with their times, and the bytes on the
wire; never the core's own account, except for its answers, which are themselves judged. Each exception stands here with
its reason.
"""
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

from controller_room import DRIVER, ORPHAN, STREAMED, ControllerRoom, Reply, is_motion
from driver_process import Call, DriverProcess
from guard_process import GuardProcess
from motion_rules import MotionRules
from path_rules import passes, told_truly
from sent_rules import SentRules, is_whole_stop, requests_in
from shown_rules import ShownRules
from slacks import (
    ANSWER_SLACK,
    AT_REST,
    GUARD_ACTS,
    GUARD_AGAIN,
    GUARD_KILLS,
    JOG_BRAKE,
    JOG_LAG,
    JOG_SLACK,
    JOG_STOP,
    LONGEST_TRAJECTORY,
    LOOK_PERIOD,
    MOVING,
    OLD_NEWS,
    PAUSE_SLACK,
    RECOVERY_SLACK,
    REST_AFTER_STOP,
    SIGHT_SLACK,
    STOP_AGAIN,
    STOP_ANSWER_SLACK,
    UNOWNED,
    UNSEEN_WAY,
    UNTELLING,
)
from status_feed import Frame
from verdict import RuleBroken, Verdicts
from virtual_clock import Clock
from wire import Network

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.kinematics.rotations import matrix_from_rpy, rotation_angle_between
from jaka_ros_driver.simulation.controller.state import ProgramState
from jaka_ros_driver.simulation.dialect.table import REFUSED
from jaka_ros_driver.state import RobotState, Vector

_JOINT_TOLERANCE, _POSITION_TOLERANCE, _ANGLE_TOLERANCE = 0.01, 0.002, 0.02
_CYCLE = 0.008
_NEVER = float("inf")


class _Quiet(NamedTuple):
    """A demand for rest: from ``since`` on no motion that was asked for before call ``number`` moves the arm."""

    since: float
    number: int
    rule: str
    why: str


class Judge:
    """The judge of one world; the first broken rule ends it.

    Attributes:
        sent: Rules about the command port.
        cycles_moving: Cycles in which a motion of the driver ran: a seed in which nothing moves shows nothing.
        answers: Counts of answers by kind of call and outcome.
    """

    def __init__(self, clock: Clock, network: Network, room: ControllerRoom, model: ArmModel, settings: ClientSettings,
                 lateness: float, identity: str, note: Callable[..., None]) -> None:
        self._clock, self._network, self._room, self._settings, self._note = clock, network, room, settings, note
        self.driver: DriverProcess
        self.guard: Optional[GuardProcess] = None
        self.verdicts = Verdicts()
        self._model, self._lateness, self._identity = model, lateness, identity
        self._jog_lag = JOG_LAG + _CYCLE * settings.stream_ahead
        self._old_until = -1e9
        self._guarded_from = _NEVER
        self._guard_excused_until = clock.now
        self._end_is_due = 0.0
        self._owes_stop = False
        self.cycles_moving = 0
        self.answers: Dict[Tuple[str, str], int] = {}
        low, high = network.terms[Port.STATUS, False].latency
        # The time to find out that a connection is dead (a heartbeat and its time-out, or a try that nobody answers),
        # the longest pause before the next try, and a round trip.
        self._relink = (0.25 + settings.reply_timeout + settings.connect_timeout + 0.5 + 4.0 * high + LOOK_PERIOD
                        + 2.0 * lateness)
        self._seen = ShownRules(network, room, settings, lateness, self.verdicts)
        self._next_look = clock.now
        self._joints_before: Optional[Vector] = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Reset what is judged of a driver's process: a new one is not answerable for the calls of the one before
        it."""
        now = self._clock.now
        self.sent = SentRules(self._room, self._model, self._settings, self._lateness, self._identity)
        self.motion = MotionRules(self._room, self.verdicts, self._lateness)
        self._awake_since = now
        self._asleep_for = 0.0
        self._paused_for = 0.0
        self._resumed_by = 0
        self._unowned_since: Optional[float] = None
        self._untold_from: Optional[Vector] = None
        self._loose_since = now
        self._excused_until = now
        self._seen_at = self._true_at = now
        self._jog_word_at = -1e9
        self._stop_wanted_at = _NEVER
        self._seen.begin_anew(now)
        self._quiet: List[_Quiet] = []
        self._stops_before = 0
        self._stop_is_owed = False
        self._showed_fault = False
        self._restarts_seen, self._knows_loss = 0, False
        self._closed_at: Optional[float] = None

    # ---- events of the driver's process ----

    def broken(self, text: str) -> None:
        """Report that the core breaks the interface of core and shell."""
        raise RuleBroken("contract", self._clock.now, text)

    def paused(self, now: float, until: float) -> None:
        """Note that the process stands still: no driver can act. It is judged again from the end; until then its guard
        is."""
        self._asleep_for += until - now
        if self.driver.is_moving_told and self.guard is not None:
            self._guarded_from = now

    def died(self, now: float) -> None:
        """Note that the process was killed: nobody answers its calls."""
        self.sent.open_calls.clear()
        self._quiet.clear()
        if self.driver.is_moving_told and self.guard is not None:
            self._guarded_from = min(self._guarded_from, now)

    def starts(self, has_left: bool, now: float) -> None:
        """Note that another process has been started in its place.

        ``has_left`` means that it finds what a dead one left moving.
        """
        self._begin_anew()
        self._owes_stop = has_left
        self._excused_until = now + self._relink

    def guard_sends(self, data: bytes, now: float) -> None:
        """Judge the guard's bytes for the command port."""
        if not is_whole_stop(requests_in(data)):
            raise RuleBroken("whole", now, "the guard's stop is only %r" % data)

    def tells(self, is_moving: bool, now: float) -> None:
        """Note the driver's notification to its guard."""
        self.motion.tells(is_moving, now)

    def reads_replies(self, replies: Tuple[Reply, ...], now: float) -> None:
        """Note that the driver has read the last bytes of these replies."""
        for reply in replies:
            if reply.command == "get_simulator_identity" and self._settings.simulator:
                self.sent.is_confirmed = self._settings.simulator.encode() in reply.text
            self.motion.reads_reply(reply, now)
            self._seen.reads_reply(reply, now)

    def resumed(self, now: float) -> None:
        """Note that the process runs again."""
        self._guarded_from = _NEVER
        self._awake_since = now
        self._excused_until = now + self._relink
        self.sent.resumed(now)
        self._seen.resumed(now)

    def obstacle(self) -> None:
        """Pause the rules for driver and guard for a while: connections may be dead without either having noticed."""
        self._mute(self._clock.now)
        self._excused_until = self._clock.now + self._relink
        self._guard_excused_until = self._clock.now + GUARD_AGAIN

    def _mute(self, now: float) -> None:
        """Note that the controller's answers, which would show how old a slow feed is, do not come through."""
        self._seen.begin_anew(now + self._relink + self._settings.silence_timeout)

    def link_up(self, port: Port, now: float) -> None:
        """Ignore a new connection."""

    def link_lost(self, port: Port, now: float) -> None:
        """Note that the driver knows of a connection's end: by a fault, or because it gave it up itself."""
        self.sent.alarmed(is_fault=False)
        self._knows_loss = True
        self.sent.jog.ended(now)
        self.motion.ended()
        if port is Port.COMMAND:
            self._mute(now)
            self.sent.knows_controller = False
            self.sent.is_confirmed = not self._settings.simulator

    def reads_frames(self, frames: Tuple[Frame, ...], now: float) -> None:
        """Note that the driver has read the last bytes of these status frames."""
        for followers, frame in zip(reversed(range(len(frames))), frames):
            if not frame.is_readable:
                continue
            self._seen_at = now
            self.motion.reads_frame(frame, followers, now)
            if frame.is_old:
                self._old_until = now + OLD_NEWS
                self._seen.reads_old_frame(now)
            if now >= self._room.feed.faults.frozen_until:
                self._true_at = now
            if frame.shows_fault:
                self.sent.alarmed(is_fault=True, is_standing=self._showed_fault)
                if not self._showed_fault:  # a message of rest while the fault stands counts as one after it
                    self.sent.jog.ended(now)
            self._showed_fault = frame.shows_fault
            if frame.restarts > self._restarts_seen and not self._knows_loss:  # else it ended the link, which was told
                self.sent.alarmed(is_fault=False)
            # the most: a frame that is repeated may be one of before the restart
            self._restarts_seen, self._knows_loss = max(self._restarts_seen, frame.restarts), False

    def called(self, call: Call) -> None:
        """Note a call that the core is about to get."""
        self.sent.called(call)
        self.sent.asking = call
        if call.kind == "jog_message":
            self.sent.jog.told(*call.command, self._clock.now)
        elif call.kind == "stop":
            self.sent.jog.ended(self._clock.now)
        if call.command == ("resume", None):
            self._quiet = [quiet for quiet in self._quiet if quiet.rule != "p"]
            self._resumed_by = call.number
        self._stops_before = self.sent.stops_seen
        self._stop_is_owed = (call.kind == "stop" and self.driver.cables[Port.COMMAND] is not None
                              and (not self._settings.simulator or self.sent.knows_controller))

    def was_called(self, call: Call) -> None:
        """Judge a call after the core has done all that it does at once: a stop must have gone out."""
        self.sent.asking = None
        if self._stop_is_owed and self.sent.stops_seen == self._stops_before:
            raise RuleBroken("i", self._clock.now, "%s: the command port is open, and no stop went out" % call)

    def sends(self, data: bytes, is_open: bool, now: float) -> None:
        """Judge bytes for the command port."""
        if not is_open:
            raise RuleBroken("contract", now, "bytes for a command port that is not open: %r" % data[:200])
        for request in self.sent.sends(data, self.driver.is_moving_told, now):
            name = request["cmdName"]
            self.motion.sends(request, now)
            self._seen.sends(name, now)
            if name == "stop_program":
                self._owes_stop = False
                self._stop_wanted_at = min(self._stop_wanted_at, now)
            elif is_motion(request):
                if self._owes_stop:
                    raise RuleBroken("left", now, "%s is sent before a stop of what a dead driver left moving" % name)
                self._stop_wanted_at = _NEVER
                if name == "jog":
                    self._jog_word_at = max(self._jog_word_at, now)
            if name not in STREAMED:
                self._note("sends", request)
        self._quiet = [quiet for quiet in self._quiet if quiet.number > self.sent.last_motion]

    def answered(self, call: Call, was_answered: bool, now: float) -> None:
        """Judge the answer to a call."""
        if was_answered:
            raise RuleBroken("e", now, "%s is answered twice" % call)
        self.sent.answered(call, now)
        self.verdicts.uses(self._slack_of(call), now - call.given_at - self._longest(call) - self._asleep_for
                           - self._paused_for + self._slacks(call))
        key = call.kind, type(call.error).__name__ if call.error is not None else "done"
        self.answers[key] = self.answers.get(key, 0) + 1
        if call.kind == "stop" and call.error is None:
            self._is_quiet(_Quiet(now + REST_AFTER_STOP, call.number, "b", "after %s was answered" % call))
        elif call.kind == "jog" and call.error is None:
            self._jog_word_at = now
        elif call.kind in ("move", "trajectory", "path") and call.waits and call.error is None:
            self._is_completed(call, now)
        elif call.command == ("pause", None) and call.error is None and call.number > self._resumed_by:
            self._is_quiet(_Quiet(now + PAUSE_SLACK, call.number, "p", "after %s was answered" % call))
        if call.kind == "path":
            told_truly(call, now)
        if call.was_sent and isinstance(call.error, MotionInterrupted) and call.error.cause in (
                StopCause.STOPPED, StopCause.CANCELLED):
            self._is_quiet(_Quiet(now + REST_AFTER_STOP, call.number + 1, "e",
                                  "after %s was answered as stopped" % call))

    def _is_quiet(self, quiet: _Quiet) -> None:
        if quiet.number > self.sent.last_motion:
            self._quiet = self._quiet[-7:] + [quiet]

    def shown(self, state: RobotState, is_new: bool, now: float) -> None:
        """Judge a state that the driver hands to its publishers."""
        if not is_new:
            return
        self.motion.shown(state, now)
        if now < self._old_until:
            return  # no driver can know it; other rules judge what it does because of it
        self._seen.shown(state, now)

    def closes(self, now: float) -> None:
        """Note that the driver shuts down from now on."""
        self._closed_at = now
        self.sent.is_closed = True

    # ---- each cycle ----

    def cycle(self) -> None:
        """Judge the arm as it is now."""
        now, room = self._clock.now, self._room
        plant = room.controller.state.plant
        joints = plant.joint_position
        if self._joints_before is not joints:
            self._joints_before = joints
            self._seen.was_at(joints, now)
        if now >= self._next_look:
            self._next_look = now + LOOK_PERIOD
            self._look_for_obstacles(now)
            self._scan_calls(now)
            self._note_arrivals(plant)  # also of an arm that rests: its move may lead to where it is
            if room.controller.state.is_paused:
                self._paused_for += LOOK_PERIOD
            if not self.driver.is_paused and not self.driver.is_gone and self._closed_at is None:
                self.motion.look(now, max(self._excused_until, self._awake_since))
        frozen = room.feed.frozen_joints
        if frozen and max([abs(a - b) for a, b in zip(frozen, plant.joint_position)]) < UNTELLING:
            self._true_at = now
        if plant.is_moving:  # by anybody
            for call in self.sent.open_calls.values():
                if call.kind == "path" and call.was_sent:
                    passes(call, plant, now - self._seen_at)
        self._program(now)
        if self._guarded_from < _NEVER:
            self._guarded(now, plant)
        if (plant.is_moving and room.mover is DRIVER and not self.driver.is_gone and not room.is_off
                and max(map(abs, plant.joint_velocity)) > MOVING):
            self.cycles_moving += 1
            self._moving(now, plant)
        elif self._unowned_since is not None or self._untold_from is not None:
            self._unowned_since = self._untold_from = None

    def _program(self, now: float) -> None:
        """Judge that a program runs in custody, but for what ``_unowned`` excepts and what cannot be seen yet."""
        program, driver = self._room.controller.state.program_state, self.driver
        if program is ProgramState.IDLE or self._room.player is not DRIVER:
            self._loose_since = now
            return
        if (program is not ProgramState.RUNNING or not driver.core.is_free or driver.is_paused or driver.is_gone
                or self._room.is_off):
            self._loose_since = now
        elif now - max(self._loose_since, self._awake_since, self._excused_until) > UNOWNED:
            raise RuleBroken("r", now, "a program of the driver's runs without custody")

    def _look_for_obstacles(self, now: float) -> None:
        """Note until when no driver could have stopped the arm, whatever it does."""
        faults, network = self._room.faults, self._network
        is_mute = (now < faults.noise_until or now < faults.delays_until or self._room.is_off
                   or self._room.keeps_driver_waiting or not network.carries(Port.COMMAND))
        if is_mute:
            self._mute(now)
        if (is_mute or network.is_slow(Port.COMMAND, True) or network.is_slow(Port.COMMAND, False)):
            self._excused_until = now + self._relink
            self._guard_excused_until = now + GUARD_AGAIN
        elif self.driver.is_paused:
            self._excused_until = now + self._relink
        elif now < faults.refuses_stop_until:
            self.stop_is_refused("stop_program")

    def stop_is_refused(self, part: str) -> None:
        """Give the driver and its guard the time to repeat a refused stop; ``part`` is the request that was refused.

        No reply tells whether a refused end of a jog or of servo mode had one to end: the stop was accepted, and is
        sent again. A refusal is known when its reply comes, or is overdue.
        """
        now, faults = self._clock.now, self._room.faults
        if part in ("jog", "servo_move"):
            self._end_is_due = now + STOP_AGAIN + REST_AFTER_STOP
        slow = min(faults.reply_delay, self._settings.reply_timeout) if now < faults.delays_until else 0.0
        self._excused_until = max(self._excused_until, now + slow + STOP_AGAIN)
        self._guard_excused_until = max(self._guard_excused_until, now + STOP_AGAIN)

    def _guarded(self, now: float, plant: Any) -> None:
        """Judge the guard of a driver that is dead or frozen with a motion in custody: it must stop the arm."""
        is_without = self.driver.is_paused or self.driver.is_gone
        is_its = self._room.mover is ORPHAN or (is_without and self._room.mover is DRIVER)
        if not is_its and not is_without and self.guard is not None and not self.guard.is_stopping:
            self._guarded_from = _NEVER
        if not plant.is_moving or not is_its or self._room.is_off or max(map(abs, plant.joint_velocity)) <= MOVING:
            return
        acts = GUARD_ACTS + (GUARD_KILLS if self._room.controller.state.dialect.second_client == REFUSED else 0.0)
        self.verdicts.uses("GUARD_ACTS", now - max(self._guarded_from, self._guard_excused_until) - REST_AFTER_STOP
                           - acts + GUARD_ACTS)
        if now > max(self._guarded_from, self._guard_excused_until) + acts + REST_AFTER_STOP:
            raise RuleBroken("guard", now, "the arm moves, %.3f s after its driver's last sign of life" % (
                now - self._guarded_from))

    def _moving(self, now: float, plant: Any) -> None:
        self._note_arrivals(plant)
        if self._closed_at is None:
            self._unowned(now)
            self._untold(now, plant.joint_position)
        uses = self.verdicts.uses
        uses("REST_AFTER_STOP", now - max(self._stop_wanted_at, self._excused_until))
        uses("SIGHT_SLACK", now - max(self._seen_at + self._settings.silence_timeout, self._excused_until)
             - REST_AFTER_STOP)
        if plant.queue.is_jogging:
            uses("JOG_SLACK", now - max(self._jog_word_at + self._settings.jog_timeout, self._excused_until))
        if self.sent.jog.is_running:
            uses("JOG_LAG", now - max(self.sent.jog.rests_from, self._excused_until, self._awake_since + JOG_BRAKE)
                 - self._jog_lag + JOG_LAG)
        for quiet in self._quiet if now >= self._end_is_due else ():
            if quiet.rule == "p" and self._room.resumed_at > quiet.since - PAUSE_SLACK:
                continue  # at the pendant
            if now > max(quiet.since, self._awake_since) + _CYCLE:
                raise RuleBroken(quiet.rule, now, "the arm moves at %.4f rad/s, %.3f s %s" % (
                    max(map(abs, plant.joint_velocity)), now - quiet.since + REST_AFTER_STOP, quiet.why))
        deadline = max(self._jog_word_at + self._settings.jog_timeout, self._excused_until)
        stopped_at = self._room.stop_executed_at
        brakes_until = stopped_at + REST_AFTER_STOP if self._jog_word_at < stopped_at < deadline + JOG_STOP else 0.0
        if plant.queue.is_jogging and now > max(deadline + JOG_SLACK, brakes_until):
            raise RuleBroken("c", now, "the arm is jogged, %.3f s after the last accepted call" % (
                now - self._jog_word_at))
        rests_from = max(self.sent.jog.rests_from, self._excused_until, self._awake_since + JOG_BRAKE)
        if self.sent.jog.is_running and now > rests_from + self._jog_lag:
            raise RuleBroken("v", now, "the arm moves, %.3f s after its jog should rest" % (now - rests_from))
        if now > max(self._stop_wanted_at, self._excused_until) + REST_AFTER_STOP:
            raise RuleBroken("m", now, "the arm moves, %.3f s after the driver sent a stop" % (
                now - self._stop_wanted_at))
        if now > max(self._seen_at + self._settings.silence_timeout,
                     self._excused_until) + SIGHT_SLACK + REST_AFTER_STOP:
            raise RuleBroken("j", now, "the arm moves, %.3f s after the last readable status frame" % (
                now - self._seen_at))
        if now > max(self._true_at + self._settings.silence_timeout,
                     self._excused_until) + SIGHT_SLACK + REST_AFTER_STOP:
            raise RuleBroken("j", now, "the arm moves, %.3f s after the last true status frame" % (
                now - self._true_at))

    def _note_arrivals(self, plant: Any) -> None:
        for call in self.sent.open_calls.values():
            if call.was_there or not call.was_sent or not call.waits:
                continue
            if call.kind == "path":
                call.was_there = call.passed == len(call.command) and _is_there(call.command[-1], plant)[0]
            else:
                call.was_there = _is_there(call.command, plant)[0]

    def _untold(self, now: float, joints: Vector) -> None:
        """Judge that the guard knows of the motion.

        Excepted: less than a driver can see, as the last 10 um of a move that is where it is to go already.
        """
        if self.driver.is_moving_told or self._untold_from is None:
            self._untold_from = None if self.driver.is_moving_told else joints
        elif max([abs(a - b) for a, b in zip(joints, self._untold_from)]) > UNSEEN_WAY:
            raise RuleBroken("h", now, "the arm moves, and the guard was last notified that it rests")

    def _unowned(self, now: float) -> None:
        """Judge that the arm moves in custody only.

        Excepted: a pause of the process, judged from its end; coasting after a stop that was carried out. Hand guiding,
        and motions of others than the driver, never come here.
        """
        if not self.driver.core.is_free or self.driver.is_paused or (
                now - self._room.stop_executed_at < REST_AFTER_STOP
                and self._room.motion_executed_at < self._room.stop_executed_at):
            self._unowned_since = None
            return
        if self._unowned_since is None:
            self._unowned_since = now
        self.verdicts.uses("UNOWNED", now - max(self._unowned_since, self._awake_since))
        if now - max(self._unowned_since, self._awake_since) > UNOWNED:
            raise RuleBroken("a", now, "the arm has been moving for %.3f s without custody" % (
                now - self._unowned_since))

    # ---- answers ----

    def _is_completed(self, call: Call, now: float) -> None:
        plant = self._room.controller.state.plant
        speed = max(map(abs, plant.joint_velocity))
        # excepted: the end of a way that somebody held up there, less than a driver can see
        is_at_the_end = isinstance(call.command, c.JointMove) and max(
            abs(a - b) for a, b in zip(call.command.joint_position, plant.joint_position)) <= UNSEEN_WAY
        if self._room.mover is DRIVER and speed > AT_REST and not is_at_the_end:
            raise RuleBroken("e", now, "%s is completed, and the arm moves at %.4f rad/s" % (call, speed))
        is_there, away = _is_there(call.command[-1] if call.kind == "path" else call.command, plant)
        # other moves were queued behind it: the arm was at its target, and is at theirs now
        was_passed = self.sent.last_motion > call.number and call.was_there
        # somebody else moves it from there, and the feed has not told so for less than the age that is promised
        has_left_unseen = (call.was_there and self._room.mover is not DRIVER
                           and now - self._true_at <= self._settings.silence_timeout)
        if not is_there and not was_passed and not has_left_unseen:
            raise RuleBroken("e", now, "%s is completed, and the arm is %s away" % (call, away))

    def _scan_calls(self, now: float) -> None:
        for call in self.sent.open_calls.values():
            if now - call.given_at > self._longest(call) + self._asleep_for + self._paused_for:
                raise RuleBroken("e", now, "%s is not answered after %.1f s" % (call, now - call.given_at))

    @staticmethod
    def _slack_of(call: Call) -> str:
        if call.kind in ("stop", "servo_target", "jog_message"):
            return "STOP_ANSWER_SLACK"
        return "RECOVERY_SLACK" if call.command == ("recover", None) else "ANSWER_SLACK"

    def _slacks(self, call: Call) -> float:
        return {"STOP_ANSWER_SLACK": STOP_ANSWER_SLACK, "ANSWER_SLACK": ANSWER_SLACK,
                "RECOVERY_SLACK": RECOVERY_SLACK + ANSWER_SLACK}[self._slack_of(call)]

    def _longest(self, call: Call) -> float:
        settings = self._settings
        if call.kind in ("stop", "servo_target", "jog_message"):
            return settings.reply_timeout + STOP_ANSWER_SLACK
        longest = 2.0 * settings.reply_timeout + ANSWER_SLACK
        if call.kind in ("trajectory", "path"):
            longest += LONGEST_TRAJECTORY
        elif call.kind == "move" and call.waits:
            longest += settings.motion_timeout
        elif call.kind == "run":
            longest += settings.power_timeout + settings.enable_timeout
            if call.command == ("recover", None):
                longest += RECOVERY_SLACK
        return longest

    # ---- the end ----

    def must_rest(self, rule: str = "e") -> None:
        """Judge that the arm rests at the end: no motion wanted, no stop obstructed, or driver gone without guard."""
        plant = self._room.controller.state.plant
        if plant.is_moving and self._room.mover is DRIVER and max(map(abs, plant.joint_velocity)) > MOVING:
            raise RuleBroken(rule, self._clock.now, "the arm has not come to rest at the end")

    def must_be_free(self) -> None:
        """Judge that the arm is out of custody at the end, and servo mode left."""
        if self._room.controller.state.plant.is_servo_active:
            raise RuleBroken("k", self._clock.now, "all is well, and the controller is still in servo mode")
        if not self.driver.core.is_free or self.driver.is_moving_told:
            raise RuleBroken("k", self._clock.now, "the arm rests, all is well, and it is still in custody: %s" % (
                self.driver.core.motion_owner))

    def must_be_ready(self) -> None:
        """Judge that the driver is ready for a motion, all having been well for a while."""
        if not self.driver.core.is_ready(self._clock.now):
            raise RuleBroken("l", self._clock.now, "all is well, and the driver is not ready: %s, %s" % (
                self.driver.core.links.health(), self.driver.core.links.feed_health(self._clock.now)))

    def all_are_answered(self) -> None:
        """Judge that the driver has answered every call before its end."""
        for call in self.sent.open_calls.values():
            raise RuleBroken("e", self._clock.now, "%s is not answered at the end" % call)


def _is_there(command: Any, plant: Any) -> Tuple[bool, str]:
    """Return whether the arm is at the target of a move, and how far it is from it, in words."""
    if isinstance(command, c.JointMove):
        away = max([abs(a - b) for a, b in zip(command.joint_position, plant.joint_position)])
        return away <= _JOINT_TOLERANCE, "%.4f rad" % away
    pose, target = plant.tcp_pose(), command.target
    away = sum([(a - b) ** 2 for a, b in zip(pose.position, target.position)]) ** 0.5
    turn = rotation_angle_between(matrix_from_rpy(pose.rpy), matrix_from_rpy(target.rpy))
    return (away <= max(_POSITION_TOLERANCE, command.tolerance) and turn <= _ANGLE_TOLERANCE,
            "%.4f m and %.4f rad" % (away, turn))
