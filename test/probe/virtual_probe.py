"""The command jaka_probe beside a simulated controller, in virtual time: what does each stage send, where is the arm?

The stages run as the command runs them, each with its own code, and in one process with the controller; their clock,
their connections, the guard process and the person at the terminal are those of this file. A request takes 1 ms there
and 1 ms back, and nothing else takes any time. test/soak/soak_probe_virtual.py does this with many drawn controllers.
"""
import contextlib
import itertools
import math
import re
import sys
from types import SimpleNamespace
from unittest import mock

from jaka_ros_driver.client.guard import GuardHealth
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.probe import ask, command, move
from jaka_ros_driver.probe.ask import MALFORMED
from jaka_ros_driver.probe.facts import ProbeStage
from jaka_ros_driver.probe.look import HeardFeed, listen
from jaka_ros_driver.probe.motion import Mover
from jaka_ros_driver.probe.move import ASKED
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.set_same import SetBack
from jaka_ros_driver.probe.twin import twin_facts
from jaka_ros_driver.protocol.framing import FramingError, ObjectStream
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.command_spec import LINK_LOSS_COMMAND
from jaka_ros_driver.simulation.controller.executor import Controller, ReplyLine
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start
from jaka_ros_driver.simulation.dialect.table import COEXISTS, REFUSED, REPLACES, Dialect
from jaka_ros_driver.simulation.server.request_parser import RequestParser

LATENCY_S = 0.001
POLLED_S = 0.1
"""Time for which the probe polls here: it sends the same question again and again."""
PROGRAM = "weld"
NO_REQUEST = "no request"
"""The name of bytes that are no request, nor the one piece that the probe sends as such."""
_REPLACED = ("time", "select")
"""Modules for which the bench stands in, in every file of the probe that imports them."""
_GUARD = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, ""), notify=lambda moves: None,
                         close=lambda: None)


class _Connection:
    """A connection of the probe, as ``recorded.KeptConnection`` is one."""

    def __init__(self, bench, port):
        self._bench, self.port = bench, port
        self.is_closed = self.has_ended = False
        self.unread = b""
        self.stream, self.parser, self.line, self.inbox = ObjectStream(), RequestParser(), ReplyLine(), []

    @property
    def is_ready(self):
        return bool(self.unread) or self.has_ended

    def send(self, data):
        if self.is_closed or self.has_ended:
            self.is_closed = True
            return False
        self._bench.take(self, data)
        return True

    def receive(self, deadline):
        ready, _, _ = self._bench.select([self], [], [], deadline - self._bench.now)
        return self.receive_now() if ready else b""

    def receive_now(self):
        data, self.unread = self.unread, b""
        self.is_closed = not data
        return data

    def close(self):
        self.has_ended = True
        self._bench.lost(self)


class VirtualBench:
    """A controller of a dialect, its clock, and what it was sent.

    It stands in for the modules ``time`` and ``select``, and for the log of the probe's connections.

    Attributes:
        now: Virtual time, s.
        begun: Its beginning, s.
        sent: (stage, name of the request) of each request, on any port, in order.
        requests: The same requests with their fields.
        path: The joints, rad (6,), at the start and after each cycle of the controller.
        before_move: How many of them lie before the stage move.
        left_out: As of ``recorded.ConnectionLog``.
    """

    left_out = 0

    def __init__(self, dialect, firmware):
        self.controller = Controller(load_model("zu7"), FIRMWARES[firmware], Options(dialect, Start.ENABLED))
        self.dialect = dialect
        self.begun = self.now = self._next_frame = 100.0
        self._next_cycle = self.begun + CYCLE_TIME_S
        self.sent, self.requests, self.stages, self.connections = [], [], [], set()
        self.path, self.before_move = [self.controller.state.plant.joint_position], 1
        self._owner = self._loss_matters_of = None

    # ---- time ----

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self._pass(self.now + seconds)

    def select(self, readers, writers, others, seconds):
        deadline = self.now + max(0.0, seconds)
        while True:
            ready = [one for one in readers if one.is_ready]
            if ready or self.now >= deadline:
                return ready, [], []
            self._pass(min(deadline, self._next_cycle, self._next_frame))

    def _pass(self, until):
        while min(self._next_cycle, self._next_frame) <= until:
            self.now = min(self._next_cycle, self._next_frame)
            if self.now < self._next_frame:
                self._next_cycle += CYCLE_TIME_S
                self.controller.step(CYCLE_TIME_S)
                self.path.append(self.controller.state.plant.joint_position)
                if ProbeStage.MOVE not in self.stages:
                    self.before_move = len(self.path)
                for one in list(self.connections):
                    self._carry_out(one)
                continue
            self._next_frame += self.controller.state.feed_period
            for one in [one for one in self.connections if one.port == "status"]:
                one.unread += self.controller.feed_frame.text()
        self.now = max(self.now, until)

    # ---- connections ----

    def connect(self, port, number):
        made = _Connection(self, port)
        if port == "command" and self.dialect.second_client == REFUSED and self._owner in self.connections:
            made.has_ended = True
            return made
        self.connections.add(made)
        if port == "command" and (self._owner not in self.connections or self.dialect.second_client == COEXISTS):
            self._owner = made
        return made

    def lost(self, connection):
        """Forget a connection; the controller notices the loss of the one that has asked it to."""
        self.connections.discard(connection)
        if connection is self._loss_matters_of:
            self._loss_matters_of = None
            self.controller.state.client_lost()

    def take(self, connection, data):
        """Take bytes of the probe: note what they ask for, and carry it out."""
        if data == MALFORMED:
            self.sent.append((self.stages[-1], "malformed"))
        else:
            items = connection.stream.feed(data)
            self.sent += [(self.stages[-1], NO_REQUEST if isinstance(item, FramingError) else item.get("cmdName"))
                          for item in items]
            self.requests += [item for item in items if not isinstance(item, FramingError)]
            if connection.port != "command":
                self.sent.append((self.stages[-1], "bytes on port %s" % connection.port))
        self._pass(self.now + LATENCY_S)
        if connection.port == "command":
            if self._owner is not connection and self.dialect.second_client == REPLACES:
                self._owner.has_ended, self._owner, self._loss_matters_of = True, connection, None
            connection.inbox += connection.parser.feed(data, self.now)
            self._carry_out(connection)
        self._pass(self.now + LATENCY_S)

    @staticmethod
    def _replies(connection):
        return b"".join(result.due_reply() for result in connection.line.take_due())

    def _carry_out(self, connection):
        connection.unread += self._replies(connection)
        while connection.inbox and not connection.line.is_blocked:
            result = self.controller.execute(connection.inbox.pop(0))
            if result.command == LINK_LOSS_COMMAND:
                self._loss_matters_of = connection
            connection.line.add(result)
            connection.unread += self._replies(connection)

    # ---- the arm ----

    @property
    def furthest(self):
        """Largest distance of a joint from where it began, deg."""
        return max(_ways(self.path, itertools.repeat(self.path[0])))

    @property
    def fastest(self):
        """Highest speed of a joint in a cycle, deg/s."""
        return max(_ways(self.path, self.path[1:])) / CYCLE_TIME_S


def _ways(path, others):
    return [math.degrees(abs(a - b)) for one, other in zip(path, others) for a, b in zip(one, other)]


class StepBench(VirtualBench):
    """A controller on which single steps of the stage move are run, and a person beside it.

    Attributes:
        facts: What the steps have found.
        back: What they could not set back.
        told: What the person was told and asked.
    """

    def __init__(self, answers=lambda question: "y", **dialect):
        """Make a controller of firmware 1.7.2; ``answers`` takes a question, may work at the pendant, and answers."""
        super().__init__(Dialect.default("1.7.2").replaced(dialect), "1.7.2")
        self._answers, self.stages = answers, [ProbeStage.MOVE]
        self.facts, self.back, self.told = {}, SetBack(), []

    def ask(self, question, meanwhile=lambda: None):
        self.told.append(question)
        answer = self._answers(question)
        for _ in range(20):
            meanwhile()
        return answer

    def run(self, *steps, program=""):
        """Run these steps as the stage does; return the facts."""
        with _replaced(self), mock.patch.object(move, "STEPS", steps):
            feed = HeardFeed(self.connect("status", 0))
            listen([feed], self.now + 0.5)
            arm = Mover(self, 0, feed, _GUARD, AXIS, self.told.append, self.back)
            with contextlib.closing(arm):
                move.move(arm, self.facts, {}, self, self.told.append, program)
        return self.facts


class _Person:
    """Somebody who types the arm's name, consents to every step, and does at the pendant what is asked for."""

    is_there = True

    def __init__(self, bench):
        self._state = bench.controller.state

    def ask(self, question, meanwhile=lambda: None):
        meanwhile()
        if "disable the arm at the pendant" in question:
            self._state.disable()
        if "End it at the pendant" in question:
            self._state.stop()
            return "y"
        named = re.search(r"Its name is (.+); type it", question)
        return named.group(1) if named else "y" if "y begins this step" in question else ""


@contextlib.contextmanager
def _replaced(bench):
    with contextlib.ExitStack() as stack:
        def replace(place, name, value):
            stack.enter_context(mock.patch.object(place, name, value))
        files = [file for name, file in sys.modules.items() if name.startswith("jaka_ros_driver.probe.")]
        for file, name in itertools.product(files, _REPLACED):
            if hasattr(file, name):
                replace(file, name, bench)
        replace(ask, "_POLLED_S", POLLED_S)
        replace(command, "ConnectionLog", lambda host: bench)
        replace(command, "Guard", lambda *where: _GUARD)
        replace(command, "Person", lambda name: _Person(bench))
        replace(command, "holder_of", lambda *where: "")
        replace(command, "DriverLock", lambda *where: SimpleNamespace(release=lambda: None))
        yield


def probed(dialect, firmware, stage=ProbeStage.SET, output=None, fits=False, seconds=1.5):
    """Run the stages up to this one; return the bench, with what was sent, and the facts.

    The stage move plays the program that is loaded.

    Args:
        dialect: Of the controller.
        firmware: One of ``FIRMWARE_NAMES``.
        stage: The last stage.
        output: Index of the output that the stage set may switch; None for none.
        fits: Also return what the curves of the stage move tell, which takes a while.
        seconds: Time for which the feed is listened to.
    """
    bench = VirtualBench(dialect, firmware)
    bench.controller.state.memory.program_name = PROGRAM
    words = ["arm", "--out", "none", "--seconds", "%g" % seconds, "--stage", stage.value]
    words += ["--output", str(output)] if output else []
    words += ["--program", PROGRAM] if stage is ProbeStage.MOVE else []
    with _replaced(bench):
        run = command._Run(command.parser().parse_args(words))
        bench.stages = run._done
        run.stages()
    if fits:
        run._facts.update(twin_facts(run._facts, run._curves, ASKED))
    return bench, run._facts
