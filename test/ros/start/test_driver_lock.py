"""One controller, one driver: the lock names its holder, and goes with the process that holds it."""
import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading

import pytest
from import_graph import ROOT

from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros import driver_lock
from jaka_ros_driver.ros.driver_lock import AlreadyDriven, DriverLock, holder_of

PORT = 20000 + os.getpid() % 40000
"""A port of no controller: another run of these tests on this computer has another one."""
HOLDER = """
import sys, time
from jaka_ros_driver.protocol.ports import endpoint
from jaka_ros_driver.ros.driver_lock import AlreadyDriven, DriverLock
try:
    lock = DriverLock(sys.argv[1], int(sys.argv[2]), "node /other")
except AlreadyDriven as error:
    print(error, flush=True)
else:
    print("held", flush=True)
    time.sleep(60)  # it is ended before
"""


@contextlib.contextmanager
def elsewhere(*before, host="10.5.5.100", **environment):
    """Run another process that wants the lock, started by the words ``before``; yield it, and its first line."""
    process = subprocess.Popen([*before, sys.executable, "-c", HOLDER, host, str(PORT)], stdout=subprocess.PIPE,
                               text=True, cwd=str(ROOT), env=dict(os.environ, **environment))
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()
        process.stdout.close()


def test_the_second_is_told_who_has_it_and_gets_it_after_the_first():
    first = DriverLock("10.5.5.100", PORT, "node /left/jaka_driver")
    for _ in range(20):  # a refused start takes nothing away
        with pytest.raises(AlreadyDriven, match=r"10.5.5.100:%d is already driven by node /left/jaka_driver "
                                                r"\(pid %d\)" % (PORT, os.getpid())):
            DriverLock("10.5.5.100", PORT, "node /right/jaka_driver")
    first.release()
    DriverLock("10.5.5.100", PORT, "node /right/jaka_driver").release()


def test_other_controllers_are_free():
    locks = [DriverLock(host, port, "node") for host, port in (
        ("10.5.5.100", PORT), ("10.5.5.101", PORT), ("10.5.5.100", PORT + 1), ("../etc/arm", 1),
        *(("%s.%s.invalid" % ("a" * 60, "b" * 40 + end), 1) for end in "cd"))]
    for lock in locks:
        lock.release()


def test_processes_with_other_folders_for_temporary_files_refuse_each_other(tmp_path):
    # As with PrivateTmp of systemd, and with pam_tmpdir.
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    with elsewhere(TMPDIR=str(tmp_path / "one")) as (holder, said):
        assert said == "held"
        with elsewhere(TMPDIR=str(tmp_path / "other")) as (_, refusal):
            assert refusal == ("the controller 10.5.5.100:%d is already driven by node /other (pid %d); "
                               "one controller, one driver" % (PORT, holder.pid))


def test_it_goes_with_a_process_that_is_killed():
    with elsewhere() as (holder, said):
        assert said == "held"
        with pytest.raises(AlreadyDriven, match="node /other"):
            DriverLock("10.5.5.100", PORT, "node /mine")
        holder.kill()
        holder.wait()
        DriverLock("10.5.5.100", PORT, "node /mine").release()


def test_a_frozen_driver_holds_it_too():
    with elsewhere() as (holder, said):
        assert said == "held"
        holder.send_signal(signal.SIGSTOP)
        os.waitpid(holder.pid, os.WUNTRACED)
        with pytest.raises(AlreadyDriven, match=r"already driven by node /other \(pid %d\)" % holder.pid):
            DriverLock("10.5.5.100", PORT, "node /mine")


def test_nobody_has_a_controller_that_is_free_and_who_has_it_is_told_without_a_thread():
    before = threading.active_count()
    assert holder_of("10.5.5.100", PORT) == ""
    lock = DriverLock("10.5.5.100", PORT, "node /mine")
    assert holder_of("10.5.5.100", PORT) == "node /mine (pid %d)" % os.getpid()
    assert holder_of("10.5.5.101", PORT) == holder_of("10.5.5.100", PORT + 1) == ""
    assert threading.active_count() == before
    lock.release()
    assert holder_of("10.5.5.100", PORT) == ""


@pytest.mark.parametrize("holder", ["node /" + "far/" * 60 + "away", "node /\u8b66"], ids=["long", "foreign"])
def test_the_holders_name_may_be_anything(holder):
    lock = DriverLock("fd00:1111:2222:3333:4444:5555:6666:7777", PORT, holder)
    with pytest.raises(AlreadyDriven, match="%s \\(pid %d\\)" % (holder[-2:], os.getpid())):
        DriverLock("fd00:1111:2222:3333:4444:5555:6666:7777", PORT, "node /mine")
    lock.release()


def test_a_lock_whose_holder_is_not_told_holds_all_the_same(monkeypatch, tmp_path):
    lock = DriverLock("10.5.5.100", PORT, "node /first")
    lock._sockets.pop().close()
    for there in (driver_lock._LIST, tmp_path / "nothing"):
        monkeypatch.setattr(driver_lock, "_LIST", there)
        assert holder_of("10.5.5.100", PORT) == "another driver"
        with pytest.raises(AlreadyDriven, match="driven by another driver;"):
            DriverLock("10.5.5.100", PORT, "node /second")
    lock.release()


def test_a_host_with_two_addresses_is_locked_under_both(monkeypatch):
    def getaddrinfo(host, *_, **__):
        addresses = ["10.5.5.100", "10.5.5.101"] if host == "arm" else [host]
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 0)) for address in addresses]

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    first = DriverLock("arm", PORT, "node /first")
    for host in ("arm", "10.5.5.101", "10.5.5.100"):
        with pytest.raises(AlreadyDriven):
            DriverLock(host, PORT, "node /second")
    first.release()
    second = DriverLock("10.5.5.101", PORT, "node /second")
    with pytest.raises(AlreadyDriven):
        DriverLock("arm", PORT, "node /first")
    DriverLock("10.5.5.100", PORT, "node /third").release()  # what a refused one had taken is free again
    second.release()


@pytest.mark.parametrize("names", [
    ("127.0.0.1", "localhost"), ("localhost", "LOCALHOST"), ("127.0.0.1", "127.0.0.2"), ("127.0.0.1", "127.1"),
    ("127.0.0.1", "::1"), ("127.0.0.1", "0.0.0.0"), ("127.0.0.1", "::ffff:127.0.0.1"), ("10.5.5.100", "10.5.1380"),
    ("10.5.5.100", "::ffff:10.5.5.100"), ("fe80:0::0001", "FE80::1"), ("arm.invalid", "ARM.invalid")])
def test_two_names_of_one_controller_are_one_lock(names):
    first = DriverLock(names[0], PORT, "node /first")
    with pytest.raises(AlreadyDriven, match="%s is already driven by node /first" % (
            re.escape(endpoint(names[1], PORT)))):
        DriverLock(names[1], PORT, "node /second")
    first.release()


def test_the_name_of_this_machine_is_one_of_loopback():
    try:
        socket.getaddrinfo(socket.gethostname(), None)
    except OSError:
        pytest.skip("the name of this machine has no address")
    first = DriverLock("127.0.0.1", PORT, "node /first")
    with pytest.raises(AlreadyDriven):
        DriverLock(socket.gethostname(), PORT, "node /second")
    first.release()


def test_the_same_address_in_another_network_is_another_controller():
    # Containers have their own 127.0.0.1.
    unshare = ["unshare", "--net", "--user", "--map-root-user", "--"]
    if shutil.which("unshare") is None or subprocess.run([*unshare, "true"], stderr=subprocess.DEVNULL).returncode:
        pytest.skip("this machine permits no network namespace")
    first = DriverLock("127.0.0.1", PORT, "node /first")
    with elsewhere(*unshare, host="127.0.0.1") as (_, said):
        assert said == "held"
    with elsewhere(host="127.0.0.1") as (_, said):
        assert "already driven by node /first" in said
    first.release()
