"""The ways of the panel's stop to a driver, over sockets: refused, hung, and served on the second."""
import asyncio
import contextlib
import socket
import struct
import threading
import time

import pytest
from waiting import free_port

from jaka_panel.graph import stopper
from jaka_panel.graph.stopper import Stopper

FOR_EVER_S = 60.0
AT_ONCE_S = 10.0
SOON_S = 0.05


class Driver:
    """The stop service of a driver on a port of its own.

    Args:
        is_frozen: Whether it takes connections and answers nothing.
    """

    def __init__(self, is_frozen=False):
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address, self._is_frozen, self.stops = self._listener.getsockname(), is_frozen, 0
        self._open, self.is_reached = [], threading.Event()
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self):
        for sock in [self._listener, *self._open]:
            with contextlib.suppress(OSError):  # the peer has closed it
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                sock, _ = self._listener.accept()
                self._open.append(sock)
                self.is_reached.set()
                if not self._is_frozen:
                    threading.Thread(target=self._serve, args=(sock,), daemon=True).start()

    def _serve(self, sock):
        (length,) = struct.unpack("<I", sock.recv(4, socket.MSG_WAITALL))
        sock.recv(length, socket.MSG_WAITALL)
        sock.sendall(struct.pack("<I", 0))
        with contextlib.suppress(OSError):
            while sock.recv(4, socket.MSG_WAITALL) == struct.pack("<I", 0):
                self.stops += 1
                sock.sendall(b"\1" + struct.pack("<I", 0))


@pytest.fixture()
def driver():
    with contextlib.closing(Driver()) as driver:
        yield driver


@pytest.fixture()
def stop(monkeypatch):
    """Stop a driver that was found at one address and is at another now; return the answer, and how long it took, s."""
    made = []

    def stop(old, new):
        monkeypatch.setattr(Stopper, "find", lambda self: setattr(self, "_address", new))
        made.append(Stopper("/arm"))
        made[-1]._address = old
        since = time.monotonic()
        error = asyncio.get_event_loop_policy().new_event_loop().run_until_complete(made[-1].stop())
        return error, time.monotonic() - since

    yield stop
    for one in made:
        one.close()


def nobody():
    return "127.0.0.1", free_port()


def test_the_stop_of_a_driver_that_was_started_anew_elsewhere_waits_for_nothing(stop, driver, monkeypatch):
    monkeypatch.setattr(stopper, "_SECOND_WAY_S", FOR_EVER_S)
    monkeypatch.setattr(stopper, "_GIVE_UP_S", FOR_EVER_S)
    error, took_s = stop(nobody(), driver.address)
    assert not error and driver.stops == 1
    assert took_s < AT_ONCE_S


def test_a_stop_that_hangs_is_sent_on_a_second_connection(stop, driver, monkeypatch):
    monkeypatch.setattr(stopper, "_SECOND_WAY_S", SOON_S)
    monkeypatch.setattr(stopper, "_GIVE_UP_S", FOR_EVER_S)
    with contextlib.closing(Driver(is_frozen=True)) as frozen:
        began = stopper.Stopper._on_its_own

        def then_elsewhere(self, done, until):
            assert frozen.is_reached.wait(AT_ONCE_S), "the first way has read no address"
            self._address = driver.address
            began(self, done, until)
        monkeypatch.setattr(Stopper, "_on_its_own", then_elsewhere)
        error, took_s = stop(frozen.address, driver.address)
    assert not error and driver.stops == 1
    assert took_s < AT_ONCE_S


def test_a_stop_that_both_ways_refuse_says_why_both_times_at_once(stop, monkeypatch):
    monkeypatch.setattr(stopper, "_GIVE_UP_S", FOR_EVER_S)
    error, took_s = stop(nobody(), nobody())
    assert error.count("refused") == 2
    assert took_s < AT_ONCE_S


def test_a_stop_that_nobody_answers_ends_in_time(stop, monkeypatch):
    monkeypatch.setattr(stopper, "_SECOND_WAY_S", SOON_S)
    monkeypatch.setattr(stopper, "_GIVE_UP_S", 4 * SOON_S)
    with contextlib.closing(Driver(is_frozen=True)) as frozen:
        error, took_s = stop(frozen.address, frozen.address)
    assert "no answer" in error
    assert took_s < AT_ONCE_S
