"""The driver's process: the core under test, and the thin shell around it, on a virtual wire.

Connections are made and dropped as the core asks, bytes go out at once, and the core is ticked when it wants to be,
and every 20 ms at least. The process may stand still for a while, as every process can: then bytes pile up unread,
calls wait, and nothing is ticked. It may die; then the kernel closes its connections.
"""
import random
import traceback
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

from controller_room import DRIVER
from verdict import RuleBroken
from virtual_clock import Clock
from wire import Arrival, Cable, Network

from jaka_ros_driver.client.core.actions import Answer, Close, Log, NotifyGuard, Open, Port, PublishState, Send
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.core.invariants import check_invariants
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.state import RobotState

LONGEST_TICK = 0.02
READ_BYTES = 1 << 16
KERNEL_BYTES = 1 << 18
"""Bytes of the status feed that the kernel keeps for a reader that stands still; further frames are lost."""
_SHORTEST_TICK = 5e-5
_WRITE_TIME = 0.002
"""Time from a driver's message to the file on disk, which is written in a thread of its own, s."""
_TOO_MANY_TURNS = 1000


class CustodyDisk:
    """The file in which a driver's custody stands while it lasts.

    Attributes:
        left: What stands there; None for nothing.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._writer: Any = None
        self._drivers: List[Any] = []
        self.left: Optional[LeftMotion] = None

    def note(self, driver: "DriverProcess", tell: NotifyGuard) -> None:
        """Write what a driver moves, or that it moves nothing; a driver that is killed meanwhile writes nothing."""
        left = None
        if tell.is_moving:
            left = LeftMotion(tell.name, tell.jog_stop, self._clock.now, self._number_of(driver))
        self._clock.after(_WRITE_TIME, lambda: self._write(driver, left))

    def remove_of(self, driver: "DriverProcess") -> None:
        """Remove what this driver left: the arm was seen at rest since."""
        if self._writer is driver:
            self.left = None

    def _number_of(self, driver: "DriverProcess") -> int:
        if driver not in self._drivers:
            self._drivers.append(driver)
        return self._drivers.index(driver) + 1

    def _write(self, driver: "DriverProcess", left: Optional[LeftMotion]) -> None:
        if not driver.is_gone:
            self._writer, self.left = driver, left


class Call:
    """One request to the driver.

    Attributes:
        number: The call's place in the order in which the core got them; 0 before.
        kind: The core's method that it goes to.
        command: Its argument: a command, or True or False, or the name of a procedure.
        waits: It is a move whose answer comes at its end.
        made_at, given_at, answered_at: When the client made it, the core got it, and it was answered, s.
        was_sent: The motion that it asks for has gone out.
        was_there: The arm has been at its target since.
        error: The error of its answer; None for success.
        give: Hands it to the core.
        path, start: For a trajectory: its path, and where it begins.
        asked: For a trajectory: the call that asked for its start.
        stops: The core's number of stops then.
        next_segment, passed: For a path: the numbers of segments sent, and of corners that the arm has passed.
        is_cancelled: For a path: its client has cancelled it.
    """

    def __init__(self, kind: str, command: Any, give: Callable[[Any, "Call", float], None], waits: bool = False,
                 on_answer: Optional[Callable[["Call"], None]] = None) -> None:
        self.number = 0
        self.kind, self.command, self.waits = kind, command, waits
        self.give = give
        self.on_answer = on_answer
        self.made_at = self.given_at = self.answered_at = -1.0
        self.is_answered = False
        self.was_sent = self.was_there = False
        self.result: Any = None
        self.error: Optional[JakaError] = None
        self.path: Any = None
        self.start: Any = None
        self.asked: Any = None
        self.stops = 0
        self.next_segment = self.passed = 0
        self.is_cancelled = False

    @property
    def is_given(self) -> bool:
        """True once the core has got it."""
        return self.number > 0

    def __str__(self) -> str:
        return "%s #%d %s" % (self.kind, self.number, self.command)

    __repr__ = __str__  # an address would make each trace another one


class _Unread(NamedTuple):
    cable: Cable
    data: Optional[bytes]  # None: the connection has ended
    marks: Tuple[Any, ...]


class DriverProcess:
    """One driver.

    Attributes:
        name: The controller's name for it: "driver", or another one once it is dead.
        core: The core under test.
        shown: The newest state that was shown as new.
        is_moving_told: The newest notification to the guard.
        paused_until: It stands still until then, s.
        is_gone: It has ended.
        guard: Its guard; None where it has none.
        disk: Where its custody stands for later drivers.
        cables: Its connections.
        next_tick: When the core is ticked next, s.
    """

    def __init__(self, clock: Clock, network: Network, chance: random.Random, core: Any, settings: ClientSettings,
                 judge: Any, lateness: float, has_turns: bool, guard: Any, disk: "CustodyDisk",
                 note: Callable[..., None]) -> None:
        self.name = DRIVER
        self.disk = disk
        self.guard = guard
        self.core = core
        self.shown: Optional[RobotState] = None
        self.is_moving_told = False
        self._jog_stop: Optional[JogStop] = None
        self.paused_until = 0.0
        self.is_gone = False
        self.cables: Dict[Port, Optional[Cable]] = dict.fromkeys(Port)
        self.next_tick = clock.now
        self._clock, self._network, self._chance = clock, network, chance
        self._settings, self._judge, self._lateness = settings, judge, lateness
        self._has_turns, self._lost_in_turn = has_turns, False
        self._note = note
        self._last_tick = clock.now
        self._tries = dict.fromkeys(Port, 0)
        self._unread: List[_Unread] = []
        self._unseen: List[Cable] = []  # connected by the kernel while the process stands still
        self._unread_bytes = dict.fromkeys(Port, 0)
        self._waiting: List[Callable[[], None]] = []
        self._calls = 0
        self._turns_at = (0.0, 0)

    # ---- events ----

    def start(self) -> None:
        """Start the process, which finds what a dead one left."""
        left = self.disk.left
        self._do(lambda now: self.core.start(now, left))

    def tick(self) -> None:
        """Run the shell's timer."""
        now = self._clock.now
        at, turns = self._turns_at
        self._turns_at = (now, turns + 1 if at == now else 1)
        if self._turns_at[1] > _TOO_MANY_TURNS:
            self._judge.broken("the core asks for ticks without end, at deadline %r" % self.core.next_deadline())
        self._last_tick = now
        self._do(self.core.tick, has_ticked=True)
        self._of_core(self.core.prepare)

    def call(self, call: Call) -> None:
        """Take a client's request."""
        call.made_at = self._clock.now
        self._when_awake(lambda: self._give(call))

    def whenever_awake(self, action: Callable[[float], None]) -> None:
        """Do something in this process, once it is awake."""
        self._when_awake(lambda: self._do(action))

    def pause(self, duration: float) -> None:
        """Pause the process for ``duration``, s."""
        now = self._clock.now
        if self.is_gone or self.is_paused:
            return
        self.paused_until = now + duration
        self._judge.paused(now, self.paused_until)
        self._clock.at(self.paused_until, self._wake_up)
        if self.guard is not None:
            self.guard.driver_is_silent()

    def die(self, name: str) -> None:
        """Kill the process; ``name`` owns the controller's motions from now on."""
        self.name = name
        self.leave()

    def leave(self) -> None:
        """End the process: its connections end with it, and the pipe to its guard."""
        self.is_gone = True
        if self.guard is not None:
            self.guard.driver_has_ended()
        self.next_tick = float("inf")
        for port, cable in self.cables.items():
            if cable is not None:
                cable.close_by_driver()
            self.cables[port] = None
        for cable in self._unseen:
            cable.close_by_driver()

    @property
    def is_paused(self) -> bool:
        """True while it stands still."""
        return self._clock.now < self.paused_until

    def arrived(self, cable: Cable, arrival: Arrival) -> None:
        """Take bytes that have come to this host, or leave them to the kernel."""
        if cable is not self.cables[cable.port] or self.is_gone:
            return
        if self.is_paused:
            if self._unread_bytes[cable.port] < KERNEL_BYTES:
                self._unread_bytes[cable.port] += len(arrival.data)
                self._unread.append(_Unread(cable, arrival.data, arrival.marks))
            return
        self._take([_Unread(cable, arrival.data, arrival.marks)])

    def lost(self, cable: Cable) -> None:
        """Note that a connection has ended."""
        if cable is not self.cables[cable.port] or self.is_gone:
            return
        if self.is_paused:
            self._unread.append(_Unread(cable, None, ()))
        else:
            self._take([_Unread(cable, None, ())])

    # ---- inside ----

    def _wake_up(self) -> None:
        """Take up everything that waits, in a random order, as between a program's threads."""
        if self.is_gone:
            return
        self._note("process goes on")
        if self.guard is not None:
            self.guard.is_told(self.is_moving_told, self._jog_stop)  # a driver notifies its guard 50 times a second
        self._judge.resumed(self._clock.now)
        turns = [self._read_all, self._give_all]
        if not self._has_turns:
            turns.append(self.tick)
        self._chance.shuffle(turns)
        for turn in turns:
            turn()

    def _read_all(self) -> None:
        """Read the bytes that wait on each port in one piece, if they are not too many."""
        unread, self._unread = self._unread, []
        self._unread_bytes = dict.fromkeys(Port, 0)
        ports, events = list(Port), []
        self._chance.shuffle(ports)
        for port in ports:
            data, marks, cable = b"", (), None
            for item in [item for item in unread if item.cable.port is port]:
                if cable is not None and (item.data is None or len(data) + len(item.data) > READ_BYTES):
                    events.append(_Unread(cable, data, marks))
                    data, marks, cable = b"", (), None
                if item.data is None:
                    events.append(item)
                else:
                    data, marks, cable = data + item.data, marks + item.marks, item.cable
            if cable is not None:
                events.append(_Unread(cable, data, marks))
        self._take(events)

    def _give_all(self) -> None:
        waiting, self._waiting = self._waiting, []
        for action in waiting:
            action()

    def _when_awake(self, action: Callable[[], None]) -> None:
        if self.is_gone:
            return
        if self.is_paused or self._waiting:
            self._waiting.append(action)
        else:
            action()

    def _take(self, events: List[_Unread]) -> None:
        """Hand events of the wire to the core: each by itself, or as one turn of a loop that ends in a tick."""
        if not self._has_turns:
            for event in events:
                self._do(self._heard(event))
            return
        heard = [self._heard(event) for event in events]

        def turn(now: float) -> None:
            for tell in heard:
                tell(now)
            self._last_tick = now
            self.core.tick(now)
        self._lost_in_turn = False
        self._do(turn, has_ticked=True)
        self._lost_in_turn = False

    def _heard(self, event: _Unread) -> Callable[[float], None]:
        """Return the function that passes an event on to the core."""
        cable = event.cable

        def tell(now: float) -> None:
            if cable is not self.cables[cable.port]:
                return
            if event.data is not None:
                if cable.port is Port.STATUS:
                    self._judge.reads_frames(event.marks, now)
                else:
                    self._judge.reads_replies(event.marks, now)
                self.core.received(cable.port, event.data, now)
                return
            self.cables[cable.port] = None
            self._lost_in_turn = self._has_turns and (self._lost_in_turn or cable.port is Port.COMMAND)
            self._note("lost", cable.port.name)
            self._judge.link_lost(cable.port, now)
            self.core.closed(cable.port, "connection closed by the controller", now)
        return tell

    def _give(self, call: Call) -> None:
        self._calls += 1
        call.number, call.given_at = self._calls, self._clock.now
        self._note("call", call)
        self._judge.called(call)
        self._do(lambda now: call.give(self.core, call, now))
        self._judge.was_called(call)

    def _do(self, event: Callable[[float], Any], has_ticked: bool = False) -> None:
        """Run one event of the core, and perform the actions that it asks for."""
        if self.is_gone:
            return
        now = self._clock.now
        actions = self._of_core(lambda: event(now) or self.core.take_actions())
        while actions:
            for action in actions:
                self._perform(action, now)
            actions = self.core.take_actions()
        try:
            check_invariants(self.core, self.is_moving_told, now, has_ticked)
        except AssertionError as broken:
            raise RuleBroken("state", now, str(broken)) from broken
        due = min(self._of_core(self.core.next_deadline), self._last_tick + LONGEST_TICK)
        self.next_tick = max(due, now + _SHORTEST_TICK) + self._lateness * self._chance.random()

    def _of_core(self, asked: Callable[[], Any]) -> Any:
        """Return the core's result; an exception from it breaks its interface."""
        try:
            return asked()
        except RuleBroken:
            raise
        except JakaError:
            self._judge.broken("an error comes out of the core:\n" + traceback.format_exc())
        except Exception:
            self._judge.broken("a bug in the core:\n" + traceback.format_exc())

    def _perform(self, action: Any, now: float) -> None:
        if isinstance(action, PublishState):
            if action.is_new:
                self.shown = action.state
            self._judge.shown(action.state, action.is_new, now)
        elif isinstance(action, Send):
            self._send(action.data, now)
        elif isinstance(action, Answer):
            self._answer(action, now)
        elif isinstance(action, NotifyGuard):
            self.is_moving_told, self._jog_stop = action.is_moving, action.jog_stop
            if self.guard is not None:
                self.guard.is_told(action.is_moving, action.jog_stop)
            self.disk.note(self, action)
            self._judge.tells(action.is_moving, now)
            self._note("notifies guard", "moving" if action.is_moving else "at rest")
        elif isinstance(action, Log):
            self._note("log", action.level, action.text)
        elif isinstance(action, Open):
            self._open(action.port)
        elif isinstance(action, Close):
            self._close(action.port, action.reason, now)
        else:
            self._judge.broken("an action that the interface does not have: %r" % (action,))

    def _send(self, data: bytes, now: float) -> None:
        cable = self.cables[Port.COMMAND]
        if cable is None and self._lost_in_turn:
            return  # it was asked for in the same turn, before the core knew of the end
        self._judge.sends(data, cable is not None, now)
        if cable is not None:
            cable.send(data, self._settings.reply_timeout)

    def _answer(self, action: Answer, now: float) -> None:
        call = action.call
        shown = "a start" if call.kind == "trajectory_start" else action.result
        self._note("answer", call, "error: %s" % action.error if action.error is not None else shown)
        was_answered = call.is_answered
        call.is_answered, call.answered_at = True, now
        call.result, call.error = action.result, action.error
        self._judge.answered(call, was_answered, now)
        if call.on_answer is not None and not was_answered:
            self._clock.after(0.0, lambda: call.on_answer(call))  # its thread runs when the core's lock is free

    def _open(self, port: Port) -> None:
        if self.cables[port] is not None:
            self._judge.broken("the core opens the %s, which is open" % port.value)
        self._tries[port] += 1
        number = self._tries[port]

        def done(cable: Optional[Cable], reason: str) -> None:
            if cable is not None and self.is_gone:
                cable.close_by_driver()
            elif cable is not None:
                self._unseen.append(cable)
            self._when_awake(lambda: self._opened(port, number, cable, reason))
        self._network.connect(self, port, self._settings.connect_timeout, done)

    def _opened(self, port: Port, number: int, cable: Optional[Cable], reason: str) -> None:
        if cable is not None:
            self._unseen.remove(cable)
        if number != self._tries[port]:
            if cable is not None:
                cable.close_by_driver()
            return
        if cable is None:
            self._note("failed", port.name, reason)
            self._do(lambda now: self.core.failed(port, reason, now))
            return
        self._note("opened", port.name, cable.number)
        self.cables[port] = cable
        self._judge.link_up(port, self._clock.now)
        self._do(lambda now: self.core.opened(port, now))
        if not cable.driver_knows:  # it ended before this process looked
            self._take([_Unread(cable, None, ())])

    def _close(self, port: Port, reason: str, now: float) -> None:
        self._note("closes", port.name, reason)
        self._tries[port] += 1
        cable, self.cables[port] = self.cables[port], None
        if cable is not None:
            cable.close_by_driver()
            self._judge.link_lost(port, now)
