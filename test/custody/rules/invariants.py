"""The judge: what must hold of the arm, at every cycle, whatever goes wrong around the driver.

Judged is what is true of the simulated arm, what the controller executed and when, what was on the wire; never what
the core says of itself, but for its answers, which are themselves judged. Each exception stands here with its reason.
"""
from collections import deque
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional, Tuple

from controller_room import DRIVER, ORPHAN, STREAMED, ControllerRoom, Reply, is_motion
from driver_process import Call, DriverProcess
from guard_process import GuardProcess
from motion_rules import MotionRules
from path_rules import passes, told_truly
from sent_rules import SentRules, is_whole_stop, requests_in
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

MOVING = 2e-3
"""rad/s; an arm with a faster joint moves."""
AT_REST = 5e-3
"""rad/s; an arm without a faster joint has completed its move."""
UNSEEN_WAY = 5e-4
"""rad"""
UNOWNED = 0.3
"""s that an arm may move without custody: a driver sees late what it sees."""
REST_AFTER_STOP = 0.5
"""s; the longest coast that the generator's motions have is shorter."""
JOG_SLACK = 0.3
"""s; the arm rests so soon after the deadline, as the page says: 0.26 s were needed at most in 2,300 seeds."""
JOG_LAG = 0.15
"""s; so late an arm follows the frames of a jog, at most: 0.10 s in 2,600 seeds."""
JOG_BRAKE = 0.1
STOP_AGAIN = 0.2
"""s; from the last refusal of a stop to the next one."""
SIGHT_SLACK = 0.3
UNTELLING = 0.006
"""rad; a feed that shows joints as near as this to where they are is not known to repeat itself."""
SHOWN_AGE = 0.15
"""s; so old may a state be that is shown as new, beside the wire's own latency."""
AGE_SLACK = 0.1
"""s, over ``silence_timeout``: the driver's timer, the wire's latency and one cycle."""
OLD_NEWS = 0.3
"""s; after a frame that came on time with what was not true then."""
SHOWN_PERIODS = 3.5
"""A hiccup of a slow feed that is shorter cannot be told from its usual jitter: so many periods old a state may be."""
STOP_ANSWER_SLACK = 0.06
"""s, over the time-out of the reply: nothing else holds the answer to a stop up but the driver's timer of 0.02 s and
the judge's look of 0.04 s; 0.016 s were needed in 1,500 seeds."""
ANSWER_SLACK = 3.5
"""s, over what a call may take by its settings: 1.5 s of waiting for rest and 2 s for servo mode to be confirmed. 2.1 s
were needed in 1,500 seeds."""
RECOVERY_SLACK = 3.5
"""s, over that: a recovery waits for rest, and twice for what clear_error does. 1,500 seeds needed none of it."""
LONGEST_TRAJECTORY = 300.0
"""s; a trajectory may be paused or slowed for most of a scenario."""
PAUSE_SLACK = 0.02
"""s; of rest that was seen."""
FREE_AFTER = 2.0
"""s; so long after everything is well and the arm at rest, custody has ended."""
_JOINT_TOLERANCE, _POSITION_TOLERANCE, _ANGLE_TOLERANCE = 0.01, 0.002, 0.02
_SAME_JOINT = 1e-6
_CYCLE = 0.008
_HISTORY_S = 8.0
_GUARD_AGAIN = 2.2
"""s; a guard that was turned away, or gets no reply, begins anew: 1 s to connect, 1 s for the reply, and its pauses."""
GUARD_ACTS = 0.35
"""s; from the driver's last sign of life: 0.25 s of silence, its turns of 20 ms, the connection, the request. With the
time to rest, 0.31 s more than REST_AFTER_STOP were needed in 2,200 seeds."""
_NEVER = float("inf")
GUARD_KILLS = 0.4
"""s; before that a guard is turned away for 0.25 s, and then ends the driver's process."""
_LOOK_PERIOD = 0.04
"""s; what changes slowly is looked at so often: obstacles, calls that are not answered."""


class _Quiet(NamedTuple):
    """From ``since`` on nothing moves the arm that was asked for before call ``number``."""

    since: float
    number: int
    rule: str
    why: str


class Judge:
    """Watches one world; the first broken rule ends it.

    Attributes:
        sent: Rules about the command port.
        cycles_moving: Cycles in which the driver's motion was under way: a seed in which nothing moves shows nothing.
        answers: How often which kind of call ended how.
    """

    def __init__(self, clock: Clock, network: Network, room: ControllerRoom, model: ArmModel, settings: ClientSettings,
                 lateness: float, identity: str, note: Callable[..., None]) -> None:
        self._clock, self._network, self._room, self._settings, self._note = clock, network, room, settings, note
        self.driver: DriverProcess
        self.guard: Optional[GuardProcess] = None
        self.verdicts = Verdicts()
        self._model, self._lateness, self._identity = model, lateness, identity
        self._old_until = -1e9
        self._guarded_from = _NEVER
        self._guard_excused_until = clock.now
        self.cycles_moving = 0
        self.answers: Dict[Tuple[str, str], int] = {}
        low, high = network.terms[Port.STATUS, False].latency
        self._wire_age = high + _CYCLE + lateness
        self._shown_age = SHOWN_AGE + self._wire_age
        # to find out that a connection is dead, by a beat and its time-out, or by one that nobody answers; the
        # longest pause before the next try; a round trip
        self._relink = (0.25 + settings.reply_timeout + settings.connect_timeout + 0.5 + 4.0 * high + _LOOK_PERIOD
                        + 2.0 * lateness)
        self._joints: Deque[Tuple[float, Vector]] = deque()
        self._next_look = clock.now
        self._joints_before: Optional[Vector] = None
        self._begin_anew()

    def _begin_anew(self) -> None:
        """A driver's process starts: what was asked of another one before it is none of its business."""
        now = self._clock.now
        self.sent = SentRules(self._room, self._model, self._settings, self._lateness, self._identity, self.verdicts)
        self.motion = MotionRules(self._room, self.verdicts, self._lateness)
        self._awake_since = now
        self._asleep_for = 0.0
        self._paused_for = 0.0
        self._unowned_since: Optional[float] = None
        self._untold_from: Optional[Vector] = None
        self._loose_since, self._why_loose = now, ""
        self._excused_until = now
        self._seen_at = self._true_at = now
        self._jog_word_at = -1e9
        self._stop_wanted_at = _NEVER
        self._mute_until = now
        self._quiet: List[_Quiet] = []
        self._stops_before = 0
        self._stop_is_owed = False
        self._showed_fault = False
        self._restarts_seen = 0
        self._closed_at: Optional[float] = None

    # ---- events of the driver's process ----

    def broken(self, text: str) -> None:
        """The core breaks the contract of core and shell."""
        raise RuleBroken("contract", self._clock.now, text)

    def paused(self, now: float, until: float) -> None:
        """The process stands still: no driver can act. Judged again from its end; meanwhile its guard is."""
        self._asleep_for += until - now
        if self.driver.is_moving_told and self.guard is not None:
            self._guarded_from = now

    def died(self, now: float) -> None:
        """The process was killed: nobody answers its calls."""
        self.sent.open_calls.clear()
        self._quiet.clear()
        if self.driver.is_moving_told and self.guard is not None:
            self._guarded_from = min(self._guarded_from, now)

    def starts(self, now: float) -> None:
        """Another process has been started in its place."""
        self._begin_anew()
        self._excused_until = now + self._relink

    def guard_sends(self, data: bytes, now: float) -> None:
        """The guard's bytes for the command port."""
        if not is_whole_stop(requests_in(data)):
            self.verdicts.breaks("guard's whole stop", "whole", now, "the guard's stop is only %r" % data)

    def tells(self, is_moving: bool, now: float) -> None:
        """The driver's word to its guard."""
        self.motion.tells(is_moving, now)

    def reads_replies(self, replies: Tuple[Reply, ...], now: float) -> None:
        """The driver has read the last bytes of these replies."""
        for reply in replies:
            if reply.command == "get_simulator_identity" and self._settings.simulator:
                self.sent.is_confirmed = self._settings.simulator.encode() in reply.text
            self.motion.reads_reply(reply, now)

    def resumed(self, now: float) -> None:
        """It goes on."""
        self._guarded_from = _NEVER
        self._awake_since = now
        self._excused_until = now + self._relink
        self.sent.resumed(now)

    def obstacle(self) -> None:
        """Connections may be dead, and the driver has not been told."""
        self._mute(self._clock.now)
        self._excused_until = self._clock.now + self._relink
        self._guard_excused_until = self._clock.now + _GUARD_AGAIN

    def _mute(self, now: float) -> None:
        """The controller's answers do not come through, which would tell how old a slow feed is."""
        self._mute_until = now + self._relink + self._settings.silence_timeout

    def link_up(self, port: Port, now: float) -> None:
        """A connection has been made."""

    def link_lost(self, port: Port, now: float) -> None:
        """The driver knows that a connection has ended: by a fault, or because it gave it up itself."""
        self.sent.alarmed(is_fault=False)
        self.sent.jog.ended(now)
        self.motion.ended()
        if port is Port.COMMAND:
            self._mute(now)
            self.sent.knows_controller = False
            self.sent.is_confirmed = not self._settings.simulator

    def reads_frames(self, frames: Tuple[Frame, ...], now: float) -> None:
        """The driver has read the last bytes of these status frames."""
        for frame in frames:
            if not frame.is_readable:
                continue
            self._seen_at = now
            self.motion.reads_frame(frame, now)
            if frame.is_old:
                self._old_until = now + OLD_NEWS
            if now >= self._room.feed.faults.frozen_until:
                self._true_at = now
            if frame.shows_fault:
                self.sent.alarmed(is_fault=True, is_standing=self._showed_fault)
                if not self._showed_fault:  # rest that is said while it stands is said after it
                    self.sent.jog.ended(now)
            self._showed_fault = frame.shows_fault
            if frame.restarts > self._restarts_seen:
                self._restarts_seen = frame.restarts
                self.sent.alarmed(is_fault=False)

    def called(self, call: Call) -> None:
        """The core is about to get a call."""
        self.sent.called(call)
        self.sent.asking = call
        if call.kind == "jog_message":
            self.sent.jog.told(*call.command, self._clock.now)
        elif call.kind == "stop":
            self.sent.jog.ended(self._clock.now)
        if call.command == ("resume", None):
            self._quiet = [quiet for quiet in self._quiet if quiet.rule != "p"]
        self._stops_before = self.sent.stops_seen
        self._stop_is_owed = (call.kind == "stop" and self.driver.cables[Port.COMMAND] is not None
                              and (not self._settings.simulator or self.sent.knows_controller))

    def was_called(self, call: Call) -> None:
        """Everything that the core does at once because of this call has been done."""
        self.sent.asking = None
        if self._stop_is_owed and self.sent.stops_seen == self._stops_before:
            raise RuleBroken("i", self._clock.now, "%s: the command port is open, and no stop went out" % call)

    def sends(self, data: bytes, is_open: bool, now: float) -> None:
        """Bytes for the command port."""
        if not is_open:
            raise RuleBroken("contract", now, "bytes for a command port that is not open: %r" % data[:200])
        for request in self.sent.sends(data, self.driver.is_moving_told, now):
            name = request["cmdName"]
            self.motion.sends(request, now)
            if name == "stop_program":
                self._stop_wanted_at = min(self._stop_wanted_at, now)
            elif is_motion(request):
                self._stop_wanted_at = _NEVER
                if name == "jog":
                    self._jog_word_at = max(self._jog_word_at, now)
            if name not in STREAMED:
                self._note("sends", request)
        self._quiet = [quiet for quiet in self._quiet if quiet.number > self.sent.last_motion]

    def answered(self, call: Call, was_answered: bool, now: float) -> None:
        """A call has ended."""
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
        elif call.command == ("pause", None) and call.error is None:
            self._is_quiet(_Quiet(now + PAUSE_SLACK, call.number, "p", "after %s was answered" % call))
        if call.kind == "path":
            told_truly(call, self.verdicts, now)
        if call.was_sent and isinstance(call.error, MotionInterrupted) and call.error.cause in (
                StopCause.STOPPED, StopCause.CANCELLED):
            self._is_quiet(_Quiet(now + REST_AFTER_STOP, call.number + 1, "e",
                                  "after %s was told that it is stopped" % call))

    def _is_quiet(self, quiet: _Quiet) -> None:
        if quiet.number > self.sent.last_motion:
            self._quiet = self._quiet[-7:] + [quiet]

    def shown(self, state: RobotState, is_new: bool, now: float) -> None:
        """A state for the publishers."""
        if not is_new:
            return
        self.motion.shown(state, now)
        if now < self._old_until:
            return  # no driver can know; see the rules for what it does of it
        age = max(self._shown_age, SHOWN_PERIODS * self._room.controller.state.feed_period + self._wire_age)
        oldest = now - age
        until = now
        for since, joints in reversed(self._joints):
            if until < oldest:
                break
            if max([abs(a - b) for a, b in zip(joints, state.joint_position)]) <= _SAME_JOINT:
                self.verdicts.uses("SHOWN_AGE", now - until - self._wire_age)
                return
            until = since
        if self._network.is_slow(Port.STATUS, False) and (
                now < self._mute_until or not self._is_older(state.joint_position, now)):
            return  # without the controller's answers, nothing tells how old a slow feed is
        check = "age" if self._network.is_slow(Port.STATUS, False) else "g"
        self.verdicts.breaks(check, check, now, "a state is shown as new that the arm was not in within the last %.3f "
                             "s; %s" % (age, self._age_of(state.joint_position, now)))

    def _is_older(self, joints: Vector, now: float) -> bool:
        """Than may be shown on a link slower than the feed; excepted is motion too small to be told from rest."""
        until, oldest = now, now - self._settings.silence_timeout - AGE_SLACK - self._wire_age
        for since, known in reversed(self._joints):
            if until < oldest:
                break
            if max([abs(a - b) for a, b in zip(known, joints)]) <= UNTELLING:
                return False
            until = since
        return True

    def _age_of(self, joints: Vector, now: float) -> str:
        until = now
        for since, known in reversed(self._joints):
            if max([abs(a - b) for a, b in zip(known, joints)]) <= _SAME_JOINT:
                return "it is %.3f s old" % (now - until)
            until = since
        return "it is older than anything known, or was never true"

    def closes(self, now: float) -> None:
        """The driver is told to shut down."""
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
            self._joints.append((now, joints))
            while len(self._joints) > 2 and self._joints[1][0] < now - _HISTORY_S:
                self._joints.popleft()
        if now >= self._next_look:
            self._next_look = now + _LOOK_PERIOD
            self._look_for_obstacles(now)
            self._scan_calls(now)
            self._note_arrivals(plant)  # also of an arm that rests: its move may lead to where it is
            if room.controller.state.is_paused:
                self._paused_for += _LOOK_PERIOD
            if not self.driver.is_paused and not self.driver.is_gone and self._closed_at is None:
                self.motion.look(now, max(self._excused_until, self._awake_since))
        frozen = room.feed.frozen_joints
        if frozen and max([abs(a - b) for a, b in zip(frozen, plant.joint_position)]) < UNTELLING:
            self._true_at = now
        if plant.is_moving:  # whoever moves it
            for call in self.sent.open_calls.values():
                if call.kind == "path" and call.was_sent:
                    passes(call, plant)
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
        """Excepted: what ``_unowned`` excepts, and a driver that cannot see or stop it yet."""
        program, driver = self._room.controller.state.program_state, self.driver
        if program is ProgramState.IDLE or self._room.player is not DRIVER:
            self._loose_since, self._why_loose = now, ""
            return
        self._why_loose = self._why_loose or self._room.feed.blindness() or (
            "program on a slow link" if self._network.is_slow(Port.STATUS, False) else "")
        if (program is not ProgramState.RUNNING or not driver.core.is_free or driver.is_paused or driver.is_gone
                or self._room.is_off):
            self._loose_since = now
        elif now - max(self._loose_since, self._awake_since, self._excused_until) > UNOWNED:
            self.verdicts.breaks(self._why_loose, "r", now, "a program of the driver's runs without custody")

    def _look_for_obstacles(self, now: float) -> None:
        """Until when no driver could have stopped the arm, whatever it does."""
        faults, network = self._room.faults, self._network
        is_mute = (now < faults.noise_until or now < faults.delays_until or self._room.is_off
                   or self._room.keeps_driver_waiting or not network.carries(Port.COMMAND))
        if is_mute:
            self._mute(now)
        if (is_mute or network.is_slow(Port.COMMAND, True) or network.is_slow(Port.COMMAND, False)):
            self._excused_until = now + self._relink
            self._guard_excused_until = now + _GUARD_AGAIN
        elif self.driver.is_paused:
            self._excused_until = now + self._relink
        elif now < faults.refuses_stop_until:
            self.stop_is_refused()

    def stop_is_refused(self) -> None:
        """A stop that is refused is to be repeated."""
        self._excused_until = max(self._excused_until, self._clock.now + STOP_AGAIN)
        self._guard_excused_until = max(self._guard_excused_until, self._clock.now + STOP_AGAIN)

    def _guarded(self, now: float, plant: Any) -> None:
        """The driver is dead or frozen with a motion in custody: its guard stops the arm."""
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
            uses("JOG_LAG", now - max(self.sent.jog.rests_from, self._excused_until, self._awake_since + JOG_BRAKE))
        for quiet in self._quiet:
            if quiet.rule == "p" and self._room.resumed_at > quiet.since - PAUSE_SLACK:
                continue  # at the pendant
            if now > max(quiet.since, self._awake_since) + _CYCLE:
                raise RuleBroken(quiet.rule, now, "the arm moves at %.4f rad/s, %.3f s %s" % (
                    max(map(abs, plant.joint_velocity)), now - quiet.since + REST_AFTER_STOP, quiet.why))
        if plant.queue.is_jogging and now > max(self._jog_word_at + self._settings.jog_timeout,
                                          self._excused_until) + JOG_SLACK:
            raise RuleBroken("c", now, "the arm is jogged, %.3f s after the last accepted call" % (
                now - self._jog_word_at))
        rests_from = max(self.sent.jog.rests_from, self._excused_until, self._awake_since + JOG_BRAKE)
        if self.sent.jog.is_running and now > rests_from + JOG_LAG:
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
            self.verdicts.breaks("frozen", "j", now, "the arm moves, %.3f s after the last true status frame" % (
                now - self._true_at))

    def _note_arrivals(self, plant: Any) -> None:
        for call in self.sent.open_calls.values():
            if call.kind != "path" and call.waits and call.was_sent and not call.was_there:
                call.was_there = _is_there(call.command, plant)[0]

    def _untold(self, now: float, joints: Vector) -> None:
        """Excepted: less than a driver can see, as the last 10 um of a move that is where it is to go already."""
        if self.driver.is_moving_told or self._untold_from is None:
            self._untold_from = None if self.driver.is_moving_told else joints
        elif max([abs(a - b) for a, b in zip(joints, self._untold_from)]) > UNSEEN_WAY:
            self.verdicts.breaks(self._room.feed.blindness(), "h", now,
                                 "the arm moves, and the guard's last word is that it rests")

    def _unowned(self, now: float) -> None:
        """Excepted: a pause of the process, judged from its end; coasting after a stop that was carried out.

        Hand guiding and what others move never come here.
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
            self.verdicts.breaks(self._room.feed.blindness(), "a", now,
                                 "the arm has been moving for %.3f s without custody" % (now - self._unowned_since))

    # ---- answers ----

    def _is_completed(self, call: Call, now: float) -> None:
        plant = self._room.controller.state.plant
        blindness = call.blindness or self._room.feed.blindness()
        speed = max(map(abs, plant.joint_velocity))
        if self._room.mover is DRIVER and speed > AT_REST:
            self.verdicts.breaks(blindness, "e", now, "%s is completed, and the arm moves at %.4f rad/s" % (
                call, speed))
        is_there, away = _is_there(call.command[-1] if call.kind == "path" else call.command, plant)
        # other moves were queued behind it: the arm was at its target, and is at theirs now
        was_passed = self.sent.last_motion > call.number and call.was_there
        if not is_there and not was_passed:
            self.verdicts.breaks(blindness, "e", now, "%s is completed, and the arm is %s away" % (call, away))

    def _scan_calls(self, now: float) -> None:
        blindness = self._room.feed.blindness()
        for call in self.sent.open_calls.values():
            call.blindness = call.blindness or blindness
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
        """Nobody wants motion any more, and nothing stands against a stop; or the driver is gone, and no guard acts."""
        plant = self._room.controller.state.plant
        if plant.is_moving and self._room.mover is DRIVER and max(map(abs, plant.joint_velocity)) > MOVING:
            self.verdicts.breaks(self._room.feed.blindness() if rule == "goodbye" else "", rule, self._clock.now,
                                 "the arm has not come to rest at the end")

    def must_be_free(self) -> None:
        """As ``must_rest``; and there is nothing left to guard."""
        if self._room.controller.state.plant.is_servo_active:
            raise RuleBroken("k", self._clock.now, "all is well, and the controller is still in servo mode")
        if not self.driver.core.is_free or self.driver.is_moving_told:
            raise RuleBroken("k", self._clock.now, "the arm rests, all is well, and it is still in custody: %s" % (
                self.driver.core.motion_owner))

    def must_be_ready(self) -> None:
        """Everything has been well for a while: whoever wants to move the arm can."""
        if not self.driver.core.is_ready(self._clock.now):
            raise RuleBroken("l", self._clock.now, "all is well, and the driver is not ready: %s, %s" % (
                self.driver.core.links.health(), self.driver.core.links.feed_health(self._clock.now)))

    def all_are_answered(self) -> None:
        """The driver has ended."""
        for call in self.sent.open_calls.values():
            raise RuleBroken("e", self._clock.now, "%s is not answered at the end" % call)


def _is_there(command: Any, plant: Any) -> Tuple[bool, str]:
    """Whether the arm is at the target of a move, and how far it is from it, in words."""
    if isinstance(command, c.JointMove):
        away = max([abs(a - b) for a, b in zip(command.joint_position, plant.joint_position)])
        return away <= _JOINT_TOLERANCE, "%.4f rad" % away
    pose, target = plant.tcp_pose(), command.target
    away = sum([(a - b) ** 2 for a, b in zip(pose.position, target.position)]) ** 0.5
    turn = rotation_angle_between(matrix_from_rpy(pose.rpy), matrix_from_rpy(target.rpy))
    return (away <= max(_POSITION_TOLERANCE, command.tolerance) and turn <= _ANGLE_TOLERANCE,
            "%.4f m and %.4f rad" % (away, turn))
