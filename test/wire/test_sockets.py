"""The arrival times of bytes, which are the system's, not those of the moment at which they are read."""
import contextlib
import platform
import socket
import time

import pytest

from jaka_ros_driver.wire import sockets

ON_LINUX = pytest.mark.skipif(platform.system() != "Linux", reason="other systems stamp otherwise")


@pytest.fixture
def pair():
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as listener, \
            contextlib.closing(socket.create_connection(listener.getsockname())) as sender, \
            contextlib.closing(listener.accept()[0]) as receiver:
        sockets.prepare(receiver)
        yield sender, receiver


def wait_for_stamps(sender, receiver):
    """Wait until Linux stamps packets: it begins a moment after the first socket asks; until then the reading
    counts."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        sender.sendall(b"one before")
        time.sleep(0.05)  # the reader is late
        reading = time.monotonic_ns()
        if sockets.receive_stamped(receiver)[1] < reading - 0.02e9:
            return
    raise AssertionError("the system does not stamp")


@ON_LINUX
def test_bytes_that_wait_are_told_to_have_come_when_they_came(pair):
    sender, receiver = pair
    sockets.stamp_arrivals(receiver)
    assert sockets.receive_stamped(receiver) == (None, pytest.approx(time.monotonic_ns(), abs=1e9))
    wait_for_stamps(sender, receiver)
    before = time.monotonic_ns()
    sender.sendall(b"frame")
    after = time.monotonic_ns()
    time.sleep(0.5)  # the reader is late
    data, at = sockets.receive_stamped(receiver)
    assert data == b"frame" and before - 0.1e9 <= at <= after + 0.3e9, (before, at, after)


@ON_LINUX
def test_a_reader_held_up_between_its_two_clocks_puts_no_arrival_before_the_sending(pair, monkeypatch):
    sender, receiver = pair
    sockets.stamp_arrivals(receiver)
    wait_for_stamps(sender, receiver)

    def held_up_after(clock):
        def read():
            value = clock()
            time.sleep(0.02)
            return value
        return read

    before = time.monotonic_ns()
    sender.sendall(b"frame")
    for name in ("monotonic_ns", "time_ns"):
        monkeypatch.setattr(time, name, held_up_after(getattr(time, name)))
    data, at = sockets.receive_stamped(receiver)
    assert data == b"frame" and at >= before


def test_without_stamps_it_is_the_moment_of_reading(pair):
    sender, receiver = pair
    sender.sendall(b"frame")
    time.sleep(0.05)  # the reader is late
    before = time.monotonic_ns()
    data, at = sockets.receive_stamped(receiver)
    assert data == b"frame" and before <= at <= time.monotonic_ns()


@ON_LINUX
def test_a_stepped_wall_clock_gives_no_moment_in_the_future(pair, monkeypatch):
    sender, receiver = pair
    sockets.stamp_arrivals(receiver)
    sender.sendall(b"frame")
    real = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: real() - 3600 * 10 ** 9)
    _, at = sockets.receive_stamped(receiver)
    assert at <= time.monotonic_ns()


def test_the_end_of_a_connection_is_no_bytes(pair):
    sender, receiver = pair
    sender.close()
    receiver.settimeout(5.0)
    assert sockets.receive_stamped(receiver)[0] == b""
