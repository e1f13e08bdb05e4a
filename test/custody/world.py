"""A whole world in one process: driver core, guard, wire and simulated controller, under virtual time and one seed.

The same scenario runs the same everywhere: every draw comes from the seed, nothing reads the host's clock.
"""
import hashlib
import math
import random
import zlib
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

from clients import Clients
from controller_room import ORPHAN, ControllerRoom
from driver_process import Call, CustodyDisk, DriverProcess
from generator import Event, Scenario, dialect_of
from guard_process import GuardProcess, MakeStopping
from invariants import Judge
from rival import Rival
from slacks import FREE_AFTER, REST_AFTER_STOP
from verdict import RuleBroken
from virtual_clock import Clock
from wire import Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.arm_core import ArmCore
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.client.stopping import Stopping
from jaka_ros_driver.kinematics.arm_models import ArmModel, load_model
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start

MODEL = "zu7"
BEGIN = 1000.0
"""Beginning of the clock, s; not 0, because a host's monotonic clock is not 0 when a driver starts."""
LONGEST_GOOD_BYE = 1.0
"""Time that a driver that shuts down waits for the arm to rest, s, the same as ``ArmClient``."""
QUIET_WAIT = 4.0
RESTART_AFTER = 1.0
"""Time until a driver is started again after its guard has killed it, s."""
SERVO_FRAME_BYTES = 120
"""About the size of a servo frame: sets how slow a link must be to carry less than a servo stream."""
TRIES_TO_STOP = 5
"""Stops at the end, one second apart, of which one must be delivered; one more for each second of the longest reply."""
_NEVER = float("inf")

MakeCore = Callable[[ClientSettings, ArmModel], Any]


class Result(NamedTuple):
    """The outcome of a scenario.

    Attributes:
        broken: The rule that was broken; None for none.
        used: The largest amount of each slack that was needed.
        simulated: Virtual time, s.
        moving: The part of it in which the driver moved the arm, s.
        answers: Counts of answers by kind of call and outcome.
        digest: Hash of the trace, where there is one.
    """

    broken: Optional[RuleBroken]
    used: Dict[str, float]
    simulated: float
    moving: float
    answers: Dict[Tuple[str, str], int]
    digest: str


class World:
    """One run of one scenario.

    Attributes:
        trace: The events, a line each, where a trace was asked for.
    """

    def __init__(self, scenario: Scenario, make_core: MakeCore = ArmCore,
                 on_line: Optional[Callable[[str], None]] = None, make_stopping: MakeStopping = Stopping) -> None:
        """Build the world; ``run`` runs it.

        Args:
            scenario: The events.
            make_core: Makes the driver's core.
            on_line: Receives the trace, line by line.
            make_stopping: Makes the object that decides how the guard stops an arm.
        """
        self._model = model = load_model(MODEL)
        self._settings = settings = ClientSettings("10.5.5.100", **scenario.settings)
        self._scenario = scenario
        self._on_line = on_line
        self._digest = hashlib.sha256()
        self._clock = clock = Clock(BEGIN)
        self._chance = chance = random.Random(zlib.crc32(b"world %d" % scenario.seed))
        self._network = network = Network(clock, chance, scenario.latency)
        options = Options(dialect_of(scenario), Start(scenario.start), identity=scenario.identity)
        self._room = room = ControllerRoom(clock, network, chance, model, FIRMWARES[scenario.firmware], options,
                                           scenario.full_frames, self.note)
        self._judge = judge = Judge(clock, network, room, model, settings, scenario.lateness, scenario.identity,
                                    self.note)
        self._make_core, self._make_stopping = make_core, make_stopping
        room.on_lost_reply, room.on_refused_stop = judge.obstacle, judge.stop_is_refused
        network.at_controller, network.controller_lost, network.accepted = room.arrived, room.lost, room.accepted
        self._disk = CustodyDisk(clock)
        self._driver = driver = self._new_driver()
        self._clients = Clients(clock, driver, model)
        self._rivals: List[Rival] = []
        self._closing_until: Optional[float] = None
        self._is_over = False
        if on_line is not None:
            room.on_executed = self._note_executed

    def _new_driver(self) -> DriverProcess:
        """Make a driver process with a guard of its own."""
        scenario, guard = self._scenario, None
        if scenario.has_guard:
            guard = GuardProcess(self._clock, self._network, self.note, self._make_stopping)
            guard.on_send, guard.kill_driver = self._judge.guard_sends, self._kill
        driver = DriverProcess(self._clock, self._network, self._chance, self._make_core(self._settings, self._model),
                               self._settings, self._judge, scenario.lateness, scenario.has_turns, guard, self._disk,
                               self.note)
        if guard is not None:
            guard.driver = driver
        self._judge.driver, self._judge.guard = driver, guard
        return driver

    def note(self, what: str, *details: Any) -> None:
        """Add a line to the trace."""
        if self._on_line is not None:
            line = "%10.5f  %s %s" % (self._clock.now - BEGIN, what, " ".join(map(str, details)))
            self._digest.update(line.encode() + b"\n")
            self._on_line(line)

    def _note_executed(self, request: Dict[str, Any], taken: bool, who: str) -> None:
        if request.get("cmdName") not in ("servo_j", "servo_p"):
            self.note("controller %s" % ("executes" if taken else "does not take"), request, who)

    # ---- time ----

    def run(self) -> Result:
        """Run the scenario to its end, or until a rule is broken."""
        clock = self._clock
        broken: Optional[RuleBroken] = None
        try:
            for event in self._scenario.events:
                clock.at(BEGIN + event.at, lambda event=event: self._happens(event))
            clock.at(BEGIN + self._scenario.length, self._end)
            if self._scenario.auto_enable:
                clock.at(BEGIN, self._clients.auto_enable)
            self._driver.start()
            self._loop()
        except RuleBroken as error:
            broken = error
            self.note("BROKEN", error)
        return Result(broken, self._judge.verdicts.used, clock.now - BEGIN,
                      self._judge.cycles_moving * CYCLE_TIME_S, self._judge.answers,
                      self._digest.hexdigest())

    def _loop(self) -> None:
        clock = self._clock
        run_cycle, judge_cycle, next_due = self._room.cycle, self._judge.cycle, clock.next_due
        cycles = 1
        next_cycle = BEGIN + CYCLE_TIME_S
        while not self._is_over:
            driver = self._driver
            next_tick = driver.next_tick if clock.now >= driver.paused_until else _NEVER
            due = next_due()
            if due <= next_tick and due <= next_cycle:
                clock.now = due
                clock.do_next()
            elif next_tick <= next_cycle:
                clock.now = next_tick
                driver.tick()
            else:
                clock.now = next_cycle
                run_cycle()
                judge_cycle()
                if self._closing_until is not None:
                    self._say_good_bye()
                cycles += 1
                next_cycle = BEGIN + cycles * CYCLE_TIME_S

    def _happens(self, event: Event) -> None:
        if event.at <= self._scenario.length:
            self.note("*", event.kind, event.args)
            getattr(self, "do_" + event.kind)(**event.args)

    # ---- the end ----

    def _end(self) -> None:
        """Begin the end: the clients stop asking, and everything becomes well again."""
        self.note("the end begins", self._scenario.ends)
        self._clients.are_gone = True
        if self._scenario.ends == "close in trouble":
            self._close()
        self._clock.after(0.0 if self._scenario.ends == "leave" else 2.0, self._heal)
        if self._scenario.ends == "close":
            self._clock.after(2.0, self._close)
        elif self._scenario.ends == "leave":
            self._clock.after(QUIET_WAIT, lambda: self._last_stop(TRIES_TO_STOP + self._longest_reply()))

    def _longest_reply(self) -> int:
        """Return for how long the controller may hold a reply back, and those behind it, s."""
        dialect = self._room.controller.state.dialect
        return math.ceil(max([getattr(dialect, name + "_delay") + getattr(dialect, name + "_reply_delay")
                              for name in ("power", "enable", "frame", "drag")]))

    def _heal(self) -> None:
        self.note("all is well again")
        self._judge.obstacle()
        for rival in self._rivals:
            rival.leave()
        self._room.heal()
        self._network.heal()

    def _last_stop(self, tries: int) -> None:
        """Stop any running motion; a driver that has not noticed yet that all is well gets more tries."""
        def answered(call: Call) -> None:
            if call.error is None:
                self._room.end_program()
                self._clock.after(REST_AFTER_STOP + CYCLE_TIME_S, self._judge.must_rest)
                self._clock.after(FREE_AFTER, self._judge.must_be_free)
                self._clock.after(FREE_AFTER, lambda: self._last_look(self._longest_reply()))
            elif tries > 1:
                self._clock.after(1.0, lambda: self._last_stop(tries - 1))
            else:
                self._judge.broken("no stop is delivered though all is well: %s" % call.error)
        if self._driver.is_paused or self._driver.is_gone:
            self._clock.at(max(self._clock.now, self._driver.paused_until) + 1.0, lambda: self._last_stop(tries))
            return
        self._clients.are_gone = False
        self._clients.stop(on_answer=answered)
        self._clients.are_gone = True

    def _last_look(self, looks: int, pause: float = 0.0) -> None:
        """Judge that the driver is ready, and close it.

        A controller that holds a reply back answers no look at the arm: a feed that is slower than it was cannot be
        told from an old one until then (seed 2018170, 10 s of ``power_on``).
        """
        if self._room.keeps_driver_waiting and looks:
            self._clock.after(1.0, lambda: self._last_look(looks - 1, FREE_AFTER))
        elif pause:
            self._clock.after(pause, lambda: self._last_look(looks))
        else:
            self._judge.must_be_ready()
            self._clock.after(CYCLE_TIME_S, self._close)

    def _close(self) -> None:
        """Shut the driver down in the way its shell does."""
        if self._driver.is_paused or self._driver.is_gone:
            self._clock.at(max(self._clock.now, self._driver.paused_until) + 0.1, self._close)
            return
        self.note("close")
        self._judge.closes(self._clock.now)
        self._driver.whenever_awake(self._driver.core.close)
        self._closing_until = self._clock.now + LONGEST_GOOD_BYE

    def _say_good_bye(self) -> None:
        """End the driver once the arm rests, or after a time; its guard knows whether the arm still moves."""
        driver, now = self._driver, self._clock.now
        assert self._closing_until is not None
        if driver.is_paused or not (driver.core.is_free or now >= self._closing_until):
            return
        self._closing_until = None
        driver.whenever_awake(driver.core.disconnect)
        driver.leave()
        self.note("the driver has ended", "its guard stops the arm" if driver.is_moving_told else "")
        self._judge.all_are_answered()
        if not driver.is_moving_told:
            self._judge.must_rest("goodbye")
        self._is_over = True

    # ---- what happens: calls ----

    def do_joint_move(self, caller: int, **args: Any) -> None:
        self._clients.joint_move(caller, **args)

    def do_linear_move(self, caller: int, **args: Any) -> None:
        self._clients.linear_move(caller, **args)

    def do_queue(self, caller: int, **args: Any) -> None:
        self._clients.queue(caller, **args)

    def do_jogging(self, caller: int, **args: Any) -> None:
        self._clients.jogging(caller, **args)

    def do_servo_mode(self, caller: int, active: bool) -> None:
        self._clients.servo_mode(caller, active)

    def do_servo_stream(self, caller: int, **args: Any) -> None:
        self._clients.servo_stream(caller, **args)

    def do_servo_burst(self, caller: int, **args: Any) -> None:
        self._clients.servo_burst(caller, **args)

    def do_servo_session(self, caller: int, **args: Any) -> None:
        self._clients.servo_session(caller, **args)

    def do_trajectory(self, caller: int, **args: Any) -> None:
        self._clients.trajectory(caller, **args)

    def do_point_stream(self, caller: int, **args: Any) -> None:
        self._clients.point_stream(caller, **args)

    def do_velocity_jog(self, caller: int, **args: Any) -> None:
        self._clients.velocity_jog(caller, **args)
    def do_path(self, caller: int, **args: Any) -> None:
        self._clients.path(caller, **args)

    def do_program(self, caller: int, **args: Any) -> None:
        self._clients.program(caller, **args)

    def do_procedure(self, caller: int, **args: Any) -> None:
        self._clients.procedure(caller, **args)

    def do_maintenance(self, every: float, recovers: bool = False) -> None:
        self._clients.maintenance(every, recovers)

    def do_stop(self, caller: int) -> None:
        self._clients.stop()

    def do_stop_with(self, caller: int, stop_first: bool, kind: str, args: Dict[str, Any]) -> None:
        if stop_first:
            self._clients.stop()
        getattr(self, "do_" + kind)(caller=caller, **args)
        if not stop_first:
            self._clients.stop()

    # ---- what happens: the wire ----

    def _ports(self, port: str) -> List[Port]:
        return list(Port) if port == "both" else [Port[port]]

    def do_stall(self, port: str, way: str, duration: float) -> None:
        until = self._clock.now + duration
        for one in self._ports(port):
            for to_controller in ((True, False) if way == "both" else (way == "to controller",)):
                terms = self._network.terms[one, to_controller]
                terms.stalled_until = max(terms.stalled_until, until)

    def do_cut(self, port: str, driver_learns: bool, controller_learns: bool) -> None:
        self._judge.obstacle()
        for one in self._ports(port):
            for cable in self._network.on(one):
                cable.cut(driver_learns, controller_learns)

    def do_refuse(self, port: str, duration: float) -> None:
        for one in self._ports(port):
            self._network.refused_until[one] = max(self._network.refused_until[one], self._clock.now + duration)

    def do_unreachable(self, port: str, duration: float) -> None:
        for one in self._ports(port):
            self._network.unreachable_until[one] = max(self._network.unreachable_until[one],
                                                       self._clock.now + duration)

    def do_cut_and_refuse(self, port: str, duration: float) -> None:
        self.do_refuse(port, duration)
        self.do_cut(port, True, True)

    def do_slow_link(self, port: str, carries: float, duration: float) -> None:
        """Let only this share of the feed, or of a servo stream, get through; the rest queues up behind it."""
        until, state = self._clock.now + duration, self._room.controller.state
        for one in self._ports(port):
            rate = (self._room.feed.frame_bytes / state.feed_period if one is Port.STATUS
                    else SERVO_FRAME_BYTES / CYCLE_TIME_S)
            for to_controller in (True, False):
                terms = self._network.terms[one, to_controller]
                terms.slow_until, terms.rate = until, carries * rate

    def do_rival(self, step: float, duration: float) -> None:
        self._rivals.append(Rival(self._clock, self._network, self._clock.now + duration, step, self.note))

    def do_split(self, duration: float) -> None:
        for terms in self._network.terms.values():
            terms.splits_until = self._clock.now + duration

    def do_noise(self, duration: float) -> None:
        self._room.faults.noise_until = self._clock.now + duration

    def do_lose_replies(self, count: int, command: str) -> None:
        self._room.faults.lost_replies[command] = count

    # ---- what happens: the feed ----

    def do_feed_shows(self, what: Dict[str, Any], frames: int = 0, duration: float = 0.0) -> None:
        faults = self._room.feed.faults
        faults.shown, faults.shown_frames, faults.shown_until = what, frames, self._clock.now + duration

    def do_feed_drops(self, fields: Tuple[str, ...], duration: float) -> None:
        self._room.feed.faults.dropped, self._room.feed.faults.dropped_until = fields, self._clock.now + duration

    def do_feed_silent(self, duration: float) -> None:
        self._room.feed.faults.silent_until = self._clock.now + duration

    def do_feed_frozen(self, duration: float) -> None:
        self._room.feed.faults.frozen_until = self._clock.now + duration

    def do_feed_repeats(self, frames: int, age: float) -> None:
        self._room.feed.faults.old_frames, self._room.feed.faults.old_by = frames, age

    def do_feed_jumps(self, by: float, frames: int) -> None:
        self._room.feed.faults.jump_by, self._room.feed.faults.jumping_frames = by, frames

    def do_feed_mangled(self, how: str, frames: int) -> None:
        self._room.feed.faults.mangle, self._room.feed.faults.mangled_frames = how, frames

    # ---- what happens: the controller, and people beside it ----

    def do_refuse_stop(self, count: int) -> None:
        self._room.faults.refused_stops = count

    def do_refuse_stop_for(self, duration: float) -> None:
        self._room.faults.refuses_stop_until = self._clock.now + duration

    def do_refuse_command(self, command: str, duration: float) -> None:
        self._room.faults.refuses_until[command] = self._clock.now + duration

    def do_slow_replies(self, delay: float, duration: float) -> None:
        self._room.faults.reply_delay, self._room.faults.delays_until = delay, self._clock.now + duration

    def do_deny_servo_mode(self, duration: float) -> None:
        self._room.faults.denies_servo_until = self._clock.now + duration

    def do_late_start(self, delay: float, duration: float) -> None:
        self._room.faults.late_start, self._room.faults.starts_late_until = delay, self._clock.now + duration

    def do_restart(self, down: float, silent: bool) -> None:
        self._judge.obstacle()
        self._room.power_cut(down, silent)

    def do_emergency_stop(self, held: float) -> None:
        self._room.press_emergency_stop()
        self._clock.after(held, lambda: self._room.controller.state.release_emergency_stop())

    def do_hit(self, force: float) -> None:
        self._room.hit(force)

    def do_pendant_stop(self) -> None:
        self._room.stop_at_pendant()

    def do_pendant_move(self, joint: int, step: float) -> None:
        self._room.move_at_pendant(joint, step)

    def do_pendant_program(self, duration: float) -> None:
        self._room.play_at_pendant(duration)

    def do_push(self, joint: int, velocity: float, duration: float) -> None:
        self._room.push(joint, velocity, duration)

    def do_guide_at_arm(self, joint: int, velocity: float, duration: float) -> None:
        self._room.guide_at_arm(joint, velocity, duration)

    def do_pendant_pause(self, duration: float) -> None:
        self._room.pause_at_pendant(duration)

    def do_rapid_rate(self, rate: float, duration: float) -> None:
        self._room.controller.state.plant.set_rapid_rate(rate)
        self._clock.after(duration, lambda: self._room.controller.state.plant.set_rapid_rate(1.0))

    def do_lying_refusal(self, command: str, duration: float) -> None:
        self._room.faults.lies_until[command] = self._clock.now + duration

    # ---- what happens: the driver's process ----

    def do_pause(self, duration: float) -> None:
        self._driver.pause(duration)

    def do_kill(self, restart_after: float) -> None:
        if not self._driver.is_gone:
            self._clock.after(restart_after, self._start_again)
            self._kill()

    def _kill(self) -> None:
        """Kill the driver's process, and schedule a new one where its guard did it: nobody else would start one."""
        self.note("the driver is killed")
        if self._driver.is_gone:
            return
        if self._driver.is_paused:
            self._clock.after(RESTART_AFTER, self._start_again)
        self._judge.died(self._clock.now)
        self._room.driver_has_died(ORPHAN)
        self._driver.die(ORPHAN)
        self._clients.has_lost_driver()

    def _start_again(self) -> None:
        if self._driver.is_gone and not self._is_over:
            self.note("a driver starts")
            self._driver = self._new_driver()
            self._judge.starts(self._disk.left is not None, self._clock.now)
            self._clients.has_driver(self._driver)
            self._driver.start()
