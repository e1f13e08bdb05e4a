"""The guard's arm stopper, on real sockets, with a controller that the test plays."""
import contextlib
import json
import math
import os
import socket
import threading
import time

import pytest

from jaka_ros_driver.client import arm_stopper, stopping
from jaka_ros_driver.client.arm_stopper import ArmStopper
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.custody_file import CustodyFile
from jaka_ros_driver.client.driver_pipe import FAREWELL, MOVING, STOPPING, WATCHING, DriverPipe
from jaka_ros_driver.client.stopping import BLIND_STOPS
from jaka_ros_driver.commands import JogFrame, JogStop
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.protocol.status import encode_frame

FRAME = encode_frame({"joint_actual_position": (0.0, 90.0, -90.0, 90.0, 90.0, 0.0), "powered_on": 1, "enabled": True,
                      "inpos": True, "emergency_stop": 0, "protective_stop": 0, "errcode": "0x0"})
"""The frame of an arm at rest."""
WAIT = 10.0


class Controller:
    """An arm at rest, and two ports.

    Attributes:
        connections: The command names that came on each connection to the command port.
        ended: Numbers of those that the client has closed.
        answers: Whether the requests of a connection are answered, by its number.
        has_feed: The status port sends frames.
    """

    def __init__(self):
        self.listeners = {name: socket.create_server(("127.0.0.1", 0)) for name in ("command", "status")}
        self.ports = {name: one.getsockname()[1] for name, one in self.listeners.items()}
        self.connections, self.ended = [], []
        self.answers = lambda number: True
        self.has_feed = True
        self.is_over = False
        self._threads = [threading.Thread(target=serve, daemon=True) for serve in (self._command, self._status)]
        for thread in self._threads:
            thread.start()

    def refuse(self, name):
        """Stop listening at this port."""
        with contextlib.suppress(OSError):
            self.listeners[name].shutdown(socket.SHUT_RDWR)
        self.listeners[name].close()

    def close(self):
        self.is_over = True
        for name in self.listeners:
            self.refuse(name)
        for thread in self._threads:
            thread.join(WAIT)

    def _accepted(self, name):
        while not self.is_over:
            try:
                sock = self.listeners[name].accept()[0]
            except OSError:
                return
            sock.settimeout(0.1)
            with sock:
                yield sock

    def _command(self):
        for sock in self._accepted("command"):
            self.connections.append([])
            with contextlib.suppress(ConnectionError):
                self._serve(sock, len(self.connections) - 1)

    def _serve(self, sock, number):
        stream = ObjectStream()
        while not self.is_over:
            try:
                data = sock.recv(4096)
            except socket.timeout:
                continue
            if not data:
                self.ended.append(number)
                return
            for request in stream.feed(data):
                self.connections[number].append(request["cmdName"])
                if self.answers(number):
                    sock.sendall(json.dumps({"cmdName": request["cmdName"], "errorCode": "0", "errorMsg": ""}).encode())

    def _status(self):
        for sock in self._accepted("status"):
            with contextlib.suppress(OSError):
                while not self.is_over:
                    if self.has_feed:
                        sock.sendall(FRAME)
                    time.sleep(0.008)


class Bench:
    """A controller, a driver's pipe and the stopper; ``stop`` returns what was logged."""

    def __init__(self, folder):
        self.controller = Controller()
        its_words, self.words = os.pipe()
        self.answers, its_answers = os.pipe()
        self._ends = [its_words, self.answers, its_answers]
        os.set_blocking(its_words, False)  # to read where no word waits fails, and does not wait for ever
        self.pipe = DriverPipe(its_words, its_answers, os.getpid(), True)
        self.file = CustodyFile("127.0.0.1", self.controller.ports["command"], [folder])
        self.said = []

    def driver_dies(self):
        os.close(self.words)
        self.words = None
        self.pipe.read()
        return self

    def stopper(self):
        ports = self.controller.ports
        stopper = ArmStopper("127.0.0.1", ports["command"], ports["status"], self.said.append)
        stopper._file = self.file
        return stopper

    def stop(self):
        stopper = self.stopper()
        stopper.stop(self.pipe)
        return stopper

    def answered(self):
        return os.read(self.answers, 100)

    def close(self):
        self.controller.close()
        for end in self._ends + [self.words] * (self.words is not None):
            os.close(end)


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.setattr(stopping, "_REPLY_TIMEOUT_S", 0.3)
    with contextlib.closing(Bench(str(tmp_path / "private"))) as one:
        yield one


def test_a_connection_that_gives_no_reply_is_hung_up_and_the_stop_sent_on_another(bench):
    bench.controller.answers = lambda number: number > 0
    bench.driver_dies().stop()
    assert bench.controller.connections[0].count("stop_program") == 1
    assert bench.controller.ended[:1] == [0], "the controller may have room for one client only"
    assert "stop_program" in bench.controller.connections[1]
    assert bench.said[-1] == "the arm is at rest" and bench.answered() == STOPPING + WATCHING


def test_where_no_status_feed_can_be_had_it_says_why(bench, monkeypatch):
    monkeypatch.setattr(stopping, "CONFIRM_AFTER_S", 0.05)
    bench.controller.refuse("status")
    bench.driver_dies().stop()
    assert bench.controller.connections[0].count("stop_program") == BLIND_STOPS
    assert "could not be seen: status port: cannot connect" in bench.said[-1]


def test_a_status_feed_that_says_nothing_is_connected_anew_and_told(bench, monkeypatch):
    monkeypatch.setattr(arm_stopper, "_FEED_TIMEOUT_S", 0.1)
    monkeypatch.setattr(stopping, "CONFIRM_AFTER_S", 0.3)
    bench.controller.has_feed = False
    bench.driver_dies().stop()
    assert "could not be seen: status port: silent for 0.1 s" in bench.said[-1]


def test_a_controller_that_turns_it_away_is_tried_until_the_driver_is_back(bench):
    for name in ("command", "status"):
        bench.controller.refuse(name)
    back = threading.Timer(0.4, os.write, [bench.words, MOVING])
    back.start()
    bench.pipe._heard_at = -math.inf  # frozen for long
    bench.stop()
    back.join()
    assert "cannot connect" in bench.said[0] and bench.said[-1] == "the driver is back and sees to the arm itself"
    assert any("process %d is not the driver any more" % os.getpid() in text for text in bench.said)


def test_a_driver_that_takes_its_leave_meanwhile_is_heard(bench):
    bench.controller.answers = lambda number: False
    bench.pipe._heard_at = -math.inf
    os.write(bench.words, FAREWELL)
    bench.stop()
    assert bench.pipe.has_left and bench.said[-1] == "the driver is back and sees to the arm itself"
    assert not any("not the driver any more" in text for text in bench.said), "it sent a beat before it was to be ended"


@pytest.mark.parametrize("is_its_own, jogs", [(True, 1), (False, 6)])
def test_the_jog_that_its_driver_noted_is_ended_and_of_no_other_driver(bench, is_its_own, jogs):
    process = os.getpid() if is_its_own else os.getppid()
    bench.file.write(LeftMotion("a jog", JogStop(JogFrame.TOOL, 4), 1764000000.25, process))
    bench.driver_dies().stop()
    assert bench.controller.connections[0][:2 + jogs] == ["servo_move", "stop_program"] + ["jog"] * jogs
    assert len(bench.controller.connections[0]) == 2 + jogs


def test_the_custody_file_of_a_dead_driver_goes_when_its_arm_was_seen_at_rest(bench):
    bench.file.write(LeftMotion("a move", None, 1764000000.25, os.getpid()))
    stopper = bench.stopper()
    stopper.forget(bench.pipe)
    assert bench.file.read() is not None, "nothing was seen of the arm, and the driver lives"
    bench.driver_dies()
    stopper.forget(bench.pipe)
    assert bench.file.read() is not None, "nothing was seen of the arm"
    stopper.stop(bench.pipe)
    bench.pipe.is_closed = False
    stopper.forget(bench.pipe)
    assert bench.file.read() is not None, "its driver sees to it"
    bench.pipe.is_closed = True
    stopper.forget(bench.pipe)
    assert bench.file.read() is None
