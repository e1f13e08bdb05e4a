"""The controller's side of the world: the simulated controller's core, its two ports, and their faults.

The core is the product's own, in the dialect of the scenario. Put around it are faults of real controllers that a clean
simulation lacks: a stop that is refused, a reply that is late or lost, a queue that hesitates between two motions, a
feed that shows what is not so.
"""
import contextlib
import random
from collections import deque
from typing import Any, Callable, Deque, Dict, List, NamedTuple, Optional

from status_feed import FeedFaults, StatusFeed, noise
from virtual_clock import Clock
from wire import Arrival, Cable, Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm.events import TargetRejected
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.command_spec import LINK_LOSS_COMMAND
from jaka_ros_driver.simulation.controller.executor import Controller, ReplyLine, RequestResult
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.simulation.controller.replies import CommandRefused, accepted, refused
from jaka_ros_driver.simulation.controller.state import Options, ProgramState
from jaka_ros_driver.simulation.dialect.table import COEXISTS, REFUSED
from jaka_ros_driver.simulation.server.request_parser import RequestParser

DRIVER, GUARD, RIVAL, ORPHAN = "driver", "guard", "rival", "driver that is dead"
PENDANT, HAND, NOBODY = "pendant", "hand", "nobody"
"""Names of those who move the arm. The first four are clients of the command port; an orphan is a motion that a dead
driver has left."""

FINDS_DEAD_CLIENT_AFTER = 1.0
"""Time, s, after which a controller that serves only its first client checks whether that one is still there.

The time begins with the second client. It is not known of real controllers."""
PLANNED = frozenset(("joint_move", "moveL", "movc"))
STREAMED = frozenset(("servo_j", "servo_p"))


def is_motion(request: Dict[str, Any]) -> bool:
    """Return whether the request asks for motion, or for the mode in which targets move the arm."""
    name = request.get("cmdName")
    if name == "jog":
        return request.get("jog_mode") != 0
    if name == "servo_move":
        return bool(request.get("relFlag"))
    return name in PLANNED or name in STREAMED or name == "play_program"


def is_part_of_stop(request: Dict[str, Any]) -> bool:
    """Return whether the request ends a jog, servo mode or whatever is planned."""
    name = request.get("cmdName")
    return name == "stop_program" or (name in ("jog", "servo_move") and not is_motion(request))


def succeeded(reply: bytes) -> bool:
    """Return whether the simulated controller's reply reports that it took the command."""
    return b'"errorCode": "0"' in reply or b'"errorCode": 0,' in reply


class Reply(NamedTuple):
    """A reply that has arrived whole, as the client sees it.

    Attributes:
        command: Its ``cmdName``.
        is_accepted: The controller reports that it took the command.
        request: The request that it answers.
        text: The reply itself.
    """

    command: str
    is_accepted: bool
    request: Any
    text: bytes


class _Held(NamedTuple):
    """An accepted motion that has not begun: it begins at ``due`` at the earliest, after rest of ``rest``, s."""

    due: float
    rest: float
    request: Dict[str, Any]
    who: str


class _Client:
    """One connection to the command port: requests that are not carried out, and replies that are not sent yet."""

    def __init__(self, cable: Cable) -> None:
        self.cable = cable
        self.parser = RequestParser()
        self.inbox: Deque[Any] = deque()
        self.replies = ReplyLine()
        self.requests: Dict[int, Any] = {}
        self.last_reply_at = 0.0


class Faults:
    """The present faults of the command port; times are ends, s."""

    def __init__(self) -> None:
        self.refuses_stop_until = 0.0
        self.refused_stops = 0
        self.refuses_until: Dict[str, float] = {}
        self.lies_until: Dict[str, float] = {}
        self.reply_delay = 0.0
        self.delays_until = 0.0
        self.lost_replies: Dict[str, int] = {}
        self.late_start = 0.0
        self.starts_late_until = 0.0
        self.noise_until = 0.0
        self.denies_servo_until = 0.0


class ControllerRoom:
    """The controller, its clients, and people beside it.

    Attributes:
        controller: The simulated controller's core.
        faults: Faults of its command port.
        feed: Its status feed.
        mover: Who started the running motion.
        is_off: It is without power.
        stop_executed_at: When it last carried out a stop, s.
        resumed_at: When a paused motion was last resumed at the pendant, s.
        motion_executed_at: When it last began to carry out a motion, s.
        player: Who started the running program.
        way: The length of the newest joint motion, rad; infinite for other motions.
    """

    def __init__(self, clock: Clock, network: Network, chance: random.Random, model: ArmModel, firmware: Firmware,
                 options: Options, full_frames: bool, note: Callable[..., None]) -> None:
        self.clock, self._network, self._chance, self._note = clock, network, chance, note
        self.controller = Controller(model, firmware, options)
        self.faults = Faults()
        self.mover = NOBODY
        self.is_off = False
        self.stop_executed_at = -1e9
        self.resumed_at = -1e9
        self.motion_executed_at = -1e9
        self.player = NOBODY
        self.controller.state.memory.program_name = "weld.ngc"
        self.on_executed: Callable[[Dict[str, Any], bool, str], None] = lambda request, taken, who: None
        self.on_lost_reply: Callable[[], None] = lambda: None
        self.on_refused_stop: Callable[[str], None] = lambda part: None
        self._clients: List[_Client] = []
        self._first: Optional[_Client] = None
        self._loss_matters_of: Optional[_Client] = None
        self._held: List[_Held] = []
        self._is_held_paused = False
        self._moved_at = -1e9
        self.feed = StatusFeed(clock, network, chance, self.controller, full_frames)

    # ---- time ----

    def cycle(self) -> None:
        """Run one cycle of the controller, and send a status frame where one is due."""
        if self.is_off:
            return
        now = self.clock.now
        if self._held:
            self._begin_held(now)
        self.controller.step(CYCLE_TIME_S)
        for client in list(self._clients):
            self._carry_out(client)
        if not self.controller.state.plant.is_moving:
            if self.mover is not NOBODY and self.is_idle:
                self.mover = NOBODY
        else:
            self._moved_at = now
        self.feed.cycle()

    def _begin_held(self, now: float) -> None:
        """Begin a held motion once its time has come and the arm has rested for a while."""
        held = self._held[0]
        if self._is_held_paused:
            return
        if held.due <= now and now - self._moved_at >= held.rest:
            self._held.pop(0)
            self._execute(held.request, held.who)

    @property
    def is_idle(self) -> bool:
        """True while nothing moves, waits to move, or can be streamed to."""
        plant = self.controller.state.plant
        return (plant.is_in_position and not plant.is_servo_active and not plant.is_hand_guided
                and not plant.queue.is_jogging and not self._held)

    def heal(self) -> None:
        """End every fault and release every button."""
        self.faults, self.feed.faults = Faults(), FeedFaults()
        self.controller.state.release_emergency_stop()
        self.end_program()

    def end_program(self) -> None:
        """End a program at the pendant, where no command of a client ends it in this dialect."""
        if not self.controller.state.dialect.stop_ends_program:
            self.stop_at_pendant()

    # ---- the command port ----

    def accepted(self, cable: Cable) -> None:
        """Accept or reject a client that has connected (docs/controller-protocol.md section 1)."""
        if cable.port is not Port.COMMAND:
            return
        if self._second_client == REFUSED and self._first is not None:
            first = self._first.cable
            cable.close_by_controller()
            self.clock.after(FINDS_DEAD_CLIENT_AFTER, first.controller_finds_it_dead)
            return
        client = _Client(cable)
        self._clients.append(client)
        if self._first is None and (self._second_client != COEXISTS or len(self._clients) == 1):
            self._take_over(client)

    @property
    def _second_client(self) -> str:
        return self.controller.state.dialect.second_client

    def _take_over(self, client: _Client) -> None:
        """Make this client the only one."""
        for other in self._clients:
            if other is not client:
                other.cable.close_by_controller()
        self._clients, self._first, self._loss_matters_of = [client], client, None
        self.controller.state.client_connected()

    def lost(self, cable: Cable) -> None:
        """Drop a client whose connection has ended."""
        client = self._client_of(cable)
        if client is None:
            return
        self._clients.remove(client)
        if client is self._first:
            self._first = None
        if client is self._loss_matters_of:
            self._loss_matters_of = None
            self.controller.state.client_lost()

    def _client_of(self, cable: Cable) -> Optional[_Client]:
        for client in self._clients:
            if client.cable is cable:
                return client
        return None

    def arrived(self, cable: Cable, arrival: Arrival) -> None:
        """Take bytes of a client."""
        client = self._client_of(cable)
        if client is not None and not self.is_off:
            client.inbox.extend(client.parser.feed(arrival.data, self.clock.now))
            self._carry_out(client)

    def _carry_out(self, client: _Client) -> None:
        """Carry out a client's requests, unless it waits for a reply, and send the replies that are due."""
        self._send_due(client)
        while client.inbox and not client.replies.is_blocked and client in self._clients and not self.is_off:
            request = client.inbox.popleft()
            if client is not self._first:
                if self._second_client != COEXISTS:
                    self._take_over(client)
                elif self._first is None:
                    self._first = client
            result = self._answer(request, client.cable.host.name)
            if result.command == LINK_LOSS_COMMAND:
                self._loss_matters_of = client
            client.replies.add(result)
            client.requests[id(result)] = request
            self._send_due(client)

    def _send_due(self, client: _Client) -> None:
        for result in client.replies.take_due():
            self._post(client, client.requests.pop(id(result)), result.due_reply())

    @property
    def keeps_driver_waiting(self) -> bool:
        """True while no request of the driver is carried out: a reply is outstanding, or another client has the
        port."""
        if any(client.replies.is_blocked for client in self._clients if client.cable.host.name in (DRIVER, ORPHAN)):
            return True
        first = self._first
        if first is None or self._second_client == COEXISTS:
            return False
        return first.cable.host.name is RIVAL or (self._second_client == REFUSED and not first.cable.works)

    def _post(self, client: _Client, request: Any, reply: bytes) -> None:
        faults, now = self.faults, self.clock.now
        name = str(request.get("cmdName", "")) if isinstance(request, dict) else ""
        if faults.lost_replies.get(name, faults.lost_replies.get("", 0)) > 0:
            key = name if name in faults.lost_replies else ""
            faults.lost_replies[key] -= 1
            self._note("lost reply", name)
            self.on_lost_reply()
            return
        mark = Reply(name, succeeded(reply), request, reply)
        copies = 1
        if now < faults.noise_until:
            if self._chance.random() < 0.5:
                copies, reply = 2, reply + reply
            else:
                reply = noise(self._chance, 5) + reply
        at = now + (faults.reply_delay * self._chance.random() if now < faults.delays_until else 0.0)
        client.last_reply_at = at = max(at, client.last_reply_at)
        if at > now:
            self.clock.at(at, lambda: client.cable.to_driver.send(reply, mark, copies))
        else:
            client.cable.to_driver.send(reply, mark, copies)

    def _answer(self, request: Any, who: str) -> RequestResult:
        """Carry a request out, or pretend to, or refuse it."""
        if not isinstance(request, dict):
            return self.controller.execute(request)
        faults, now, name = self.faults, self.clock.now, str(request.get("cmdName"))
        is_stop = name == "stop_program"
        if is_stop and (faults.refused_stops > 0 or now < faults.refuses_stop_until):
            faults.refused_stops = max(0, faults.refused_stops - 1)
            self.on_refused_stop(name)
            return self._refusal(request, who)
        if now < faults.refuses_until.get(name, 0.0):
            if is_part_of_stop(request):
                self.on_refused_stop(name)
            return self._refusal(request, who)
        if now < faults.lies_until.get(name, 0.0) and is_motion(request):
            self._execute(request, who)
            self._note("reports a refusal of what it did")
            return RequestResult(name, refused(self.controller.state.dialect, name, CommandRefused()))
        if name == "is_in_servomove" and now < faults.denies_servo_until:
            return RequestResult(name, accepted(self.controller.state.dialect, name, {"in_servomove": False}))
        can_wait = is_motion(request) and (name in PLANNED or name == "jog")
        if can_wait and (self._held or now < faults.starts_late_until):
            return self._hold(request, who)
        return self._execute(request, who)

    def _refusal(self, request: Dict[str, Any], who: str) -> RequestResult:
        name = str(request.get("cmdName"))
        self._note("refuses", name)
        self.on_executed(request, False, who)
        return RequestResult(name, refused(self.controller.state.dialect, name, CommandRefused()))

    def _hold(self, request: Dict[str, Any], who: str) -> RequestResult:
        """Accept now and begin later; a motion that could not begin now is refused as usual."""
        state, name = self.controller.state, str(request["cmdName"])
        if not state.is_enabled or state.emergency_stop or state.protective_stop or state.plant.is_servo_active:
            return self._execute(request, who)
        late = self.faults.late_start
        held = _Held(self.clock.now + late * self._chance.random(), late * self._chance.random(), request, who)
        self._held.append(held)
        self._note("begins later", name, "by %.4f s, after rest of %.4f s" % (held.due - self.clock.now, held.rest))
        return RequestResult(name, accepted(state.dialect, name, {}))

    def _execute(self, request: Dict[str, Any], who: str) -> RequestResult:
        result = self.controller.execute(request)
        taken = succeeded(result.reply)
        name = request.get("cmdName")
        if taken:
            if name in ("play_program", "resume_program"):
                self.player = who
            if name in ("resume_program", "stop_program"):
                self._is_held_paused = False
            elif name == "pause_program" and self._held and self.controller.state.dialect.pause_pauses_moves:
                self._is_held_paused = True
            if name == "stop_program" or (name == "jog" and request.get("jog_mode") == 0):
                self._held = []  # a held motion never begins after this
            if name == "stop_program":
                self.stop_executed_at = self.clock.now
            elif is_motion(request):
                self.motion_executed_at = self.clock.now
                self.mover = who
        self.on_executed(request, taken, who)
        return result

    # ---- people beside it ----

    def driver_has_died(self, name: str) -> None:
        """Assign the dead driver's motions to ``name``; its requests may still be on their way."""
        if self.mover is DRIVER:
            self.mover = name
        if self.player is DRIVER:
            self.player = name
        self._held = [held._replace(who=name) if held.who is DRIVER else held for held in self._held]

    def press_emergency_stop(self) -> None:
        """Press the emergency stop button."""
        self._held = []
        self.controller.state.press_emergency_stop()

    def hit(self, force: float) -> None:
        """Let the arm hit somebody who stands in its way."""
        if self.controller.state.hit(force):
            self._held = []

    def stop_at_pendant(self) -> None:
        """Stop the program at the pendant; this is not the driver's stop."""
        self._held = []
        self.controller.state.stop()

    def move_at_pendant(self, joint: int, step: float) -> None:
        """Move an idle arm from the pendant."""
        if self.is_idle and self.controller.state.is_enabled:
            target = [0.0] * 6
            target[joint] = step
            try:
                self.controller.state.plant.add_joint_move(target, 0.3, 2.0, relative=True)
            except TargetRejected:
                return
            self.mover = PENDANT

    def play_at_pendant(self, duration: float) -> None:
        """Play a program from the pendant, and stop it later."""
        state = self.controller.state
        if self.is_idle and state.is_enabled and state.program_state is ProgramState.IDLE:
            state.program_state, self.player = ProgramState.RUNNING, PENDANT
            self.clock.after(duration, lambda: self.player is PENDANT and self.stop_at_pendant() or None)

    def pause_at_pendant(self, duration: float) -> None:
        """Pause the running motion at the pendant, and resume it later if it is still there."""
        self.controller.state.pause()
        self.clock.after(duration, self._resume)

    def _resume(self) -> None:
        self.resumed_at = self.clock.now
        with contextlib.suppress(CommandRefused):
            self.controller.state.resume()

    def guide_at_arm(self, joint: int, velocity: float, duration: float) -> None:
        """Guide the arm by hand, with the button on it pressed."""
        with contextlib.suppress(CommandRefused, TargetRejected):
            self.controller.state.set_hand_guiding(True)
            self.push(joint, velocity, 0.5 * duration)
            self.clock.after(duration, lambda: self.controller.state.set_hand_guiding(False))

    def push(self, joint: int, velocity: float, duration: float) -> None:
        """Push the arm; it gives way in hand guiding only."""
        if self.controller.state.push(joint, velocity, duration):
            self.mover = HAND

    def power_cut(self, down: float, silent: bool) -> None:
        """Cut the cabinet's power until it starts again by itself; silent: no end of a connection is seen."""
        if self.is_off:
            return
        self.is_off = self._network.is_off = True
        self._held = []
        for port in Port:
            for cable in self._network.on(port):
                cable.cut(driver_learns=not silent, controller_learns=False)
                cable.controller_knows = False
        self._clients, self._first, self._loss_matters_of = [], None, None
        self.clock.after(down, self._boot)

    def _boot(self) -> None:
        self.controller.restart()
        self.is_off = self._network.is_off = False
        self.mover = NOBODY
        self.feed.start()
        for port in Port:  # a driver that still believes in its connection learns of the end with its next bytes
            for cable in self._network.on(port):
                cable.cut(driver_learns=True, controller_learns=False)
