"""A driver's signs of life to a supervisor as systemd is one: ready when it runs, and silent when it hangs."""
import contextlib
import os
import signal
import socket
import time

import pytest
from driver_bench import DriverProcess, SimulatorProcess, on

from jaka_ros_driver.client.supervisor import supervisor_of

PATIENCE_S = 4.0


@pytest.fixture
def supervisor(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(60.0)
        yield listening


def environment(supervisor):
    return {"NOTIFY_SOCKET": supervisor.getsockname(), "WATCHDOG_USEC": "%d" % (PATIENCE_S * 1e6)}


def drained(supervisor):
    supervisor.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            supervisor.recv(4096)


def test_a_driver_is_ready_when_it_runs_and_a_hang_is_silent_and_leaves_the_stacks(ros_node, supervisor):
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("watched", environment(supervisor), **on(simulator, guard=False)) as driver:
        assert b"READY=1" in supervisor.recv(4096).splitlines()
        times = []
        for _ in range(4):
            assert supervisor.recv(4096) == b"WATCHDOG=1"
            times.append(time.monotonic())
        assert max(b - a for a, b in zip(times, times[1:])) < PATIENCE_S
        pid = driver.process.pid
        os.kill(pid, signal.SIGSTOP)
        drained(supervisor)
        supervisor.settimeout(PATIENCE_S)
        with pytest.raises(socket.timeout):
            supervisor.recv(4096)
        os.kill(pid, signal.SIGABRT)  # as systemd does
        os.kill(pid, signal.SIGCONT)
        code, said = driver.wait()
    # Other threads run while Python writes their stacks; it may crash over one that changes, which ends it as well
    assert code in (-signal.SIGABRT, -signal.SIGSEGV), said
    assert "Fatal Python error: Aborted" in said and "arm_client.py" in said, said


def test_a_driver_that_does_not_start_is_never_ready(ros_node, supervisor):
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("unready", environment(supervisor), **on(simulator), model="foo") as driver:
        assert driver.wait()[0] == 2
    supervisor.settimeout(0.1)
    with pytest.raises(socket.timeout):
        supervisor.recv(4096)


def test_without_a_supervisor_nothing_is_sent_and_one_that_is_gone_is_said_once(tmp_path, caplog):
    assert supervisor_of({}) is None and supervisor_of({"NOTIFY_SOCKET": "nowhere"}) is None
    gone = supervisor_of({"NOTIFY_SOCKET": str(tmp_path / "gone"), "WATCHDOG_USEC": "400000"})
    for now in (10.0, 10.1, 10.2):
        gone.run(now)
        assert gone.due() == pytest.approx(now + 0.1)
    assert caplog.text.count("does not get this driver's signs of life") == 1


def test_signs_are_sent_only_where_they_are_wanted_of_this_process(supervisor):
    address = supervisor.getsockname()
    for variables in ({}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}):
        sender = supervisor_of({"NOTIFY_SOCKET": address, **variables})
        sender.run(5.0)
        assert b"READY=1" in supervisor.recv(4096) and sender.due() is None


def test_a_supervisor_with_an_abstract_name_is_found():
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("\0jaka_test_%d" % os.getpid())
        supervisor_of({"NOTIFY_SOCKET": "@jaka_test_%d" % os.getpid()}).run(1.0)
        assert listening.recv(4096).startswith(b"READY=1\n")


def test_a_supervisor_that_does_not_hear_is_told_again_a_second_later_until_it_does(tmp_path):
    one = supervisor_of({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    one.run(10.0)
    assert one.due() == 11.0
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        one.run(11.0)
        assert b"READY=1" in listening.recv(4096).splitlines() and one.due() is None, "it wants no more than that"
