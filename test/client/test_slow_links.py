"""The true age of what is published through a link that carries less than the status feed, on real sockets."""
import bisect
import contextlib
import math
import select
import socket
import threading
import time

import pytest
from waiting import StallWatch, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.kinematics.arm_models import load_model

LENGTH = 9.0
SPEED = 0.3
LONGEST_AGE = 0.8
SLACK = 0.15
"""Slack of a machine whose processors are shared, s: the proxy and the record of true joints are threads, too."""
PIECE = 256


class Throttle:
    """A link that carries a share of the bytes of a feed of 8 ms, in small pieces; the rest waits at the sender.

    Attributes:
        turns, idle: Pieces that were due, and those of them for which nothing waited.
    """

    def __init__(self, port, share):
        self._port, self._share = port, share
        self.turns = self.idle = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._is_over = False
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def _accept(self):
        while not self._is_over:
            if not select.select([self._listener], [], [], 0.05)[0]:
                continue
            near, _ = self._listener.accept()
            with near, socket.socket() as far, contextlib.suppress(OSError):
                far.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 14)
                far.connect(("127.0.0.1", self._port))
                near.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._carry(far, near)

    def _carry(self, far, near):
        head = far.recv(64, socket.MSG_PEEK)
        rate = self._share * int(head.split(b":")[1].split(b",")[0]) / 0.008
        began, carried = time.monotonic(), 0
        while not self._is_over:
            due = int((time.monotonic() - began) * rate) - carried
            if due < PIECE:
                if select.select([near], [], [], PIECE / rate)[0]:
                    return
                continue
            self.turns += 1
            self.idle += not select.select([far], [], [], 0.0)[0]
            data = far.recv(due)
            if not data:
                return
            near.sendall(data)
            carried += len(data)

    def close(self):
        self._is_over = True
        self._thread.join()
        self._listener.close()


class TrueJoint:
    """Joint 1 after each cycle of the simulated controller."""

    def __init__(self, controller):
        self.times, self.angles = [], []
        step, plant = controller.step, controller.state.plant

        def recorded(seconds):
            step(seconds)
            self.times.append(time.monotonic())
            self.angles.append(plant.joint_position[0])
        controller.step = recorded

    def age(self, angle, at, alike, host):
        """Return for how long, s, the joint has been elsewhere than at this angle, at a time; no stall of the host
        counts."""
        last = bisect.bisect_right(self.times, at) - 1
        for index in range(last, -1, -1):
            if abs(self.angles[index] - angle) <= alike:
                return host.between(self.times[index], at)
        return math.inf


def jog_to_and_fro(arm, true, until):
    """Keep joint 1 moving; begin a jog that the driver stops again when it lets one begin."""
    while time.monotonic() < until:
        direction = -1.0 if true.angles[-1] > 1.0 else 1.0
        edge = time.monotonic() + 4.0
        while time.monotonic() < min(until, edge) and direction * true.angles[-1] < 1.2:
            with contextlib.suppress(JakaError):
                arm.jog(c.Jog(c.JogFrame.JOINT, 0, direction * SPEED))
            time.sleep(0.2)  # the rate of a caller
        with contextlib.suppress(JakaError):
            arm.stop()


@pytest.mark.parametrize("share", [0.85, 0.93])
def test_what_is_published_as_new_is_not_old_however_slow_the_link(bench, share, caplog):
    one = bench()
    true = TrueJoint(one.controller.server.controller)
    throttle = Throttle(one.controller.status_port, share)
    shown = []
    one.arm = arm = ArmClient(ClientSettings("127.0.0.1", one.controller.command_port, throttle.port),
                              load_model("zu7"))
    arm.add_listener(lambda state, is_new: shown.append((time.monotonic(), state)) if is_new else None)
    with StallWatch() as host:
        try:
            arm.start()
            assert eventually(lambda: arm.is_ready)
            jog_to_and_fro(arm, true, time.monotonic() + LENGTH)
        finally:
            arm.close()
            throttle.close()
        ages = [true.age(state.joint_position[0], at, 0.002, host) for at, state in shown]
    assert max(ages) < LONGEST_AGE + SLACK, "%.2f s" % max(ages)
    assert len(shown) > 0.5 * share * LENGTH / 0.008
    assert max(true.angles) - min(true.angles) > 0.3
    print("share %.2f, idle %.2f: oldest %.2f s of %d" % (share, throttle.idle / throttle.turns, max(ages), len(ages)))
    # a busy machine makes fewer frames, which the link carries
    assert "old news" in caplog.text or max(ages) < 0.5 * LONGEST_AGE or throttle.idle > 0.1 * throttle.turns
