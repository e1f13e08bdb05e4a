"""One controller, one driver: the lock names its holder, and goes with the process that holds it."""
import os
import re
import socket
import subprocess
import sys
from unittest import mock

import pytest
from ros_bench import eventually

from jaka_ros_driver.ros.driver_lock import AlreadyDriven, DriverLock

HOLDER = """
import sys, time
from jaka_ros_driver.ros.driver_lock import DriverLock
lock = DriverLock("10.5.5.100", 10001, "node /other", sys.argv[1])
print("held", flush=True)
time.sleep(60)
"""


def test_the_second_is_told_who_has_it_and_gets_it_after_the_first(tmp_path):
    first = DriverLock("10.5.5.100", 10001, "node /left/jaka_driver", str(tmp_path))
    with pytest.raises(AlreadyDriven, match=r"10.5.5.100:10001 is already driven by node /left/jaka_driver \(pid \d+"):
        DriverLock("10.5.5.100", 10001, "node /right/jaka_driver", str(tmp_path))
    first.release()
    DriverLock("10.5.5.100", 10001, "node /right/jaka_driver", str(tmp_path)).release()


def test_other_controllers_are_free(tmp_path):
    locks = [DriverLock(host, port, "node", str(tmp_path)) for host, port in
             (("10.5.5.100", 10001), ("10.5.5.101", 10001), ("10.5.5.100", 10002), ("../etc/arm", 1))]
    for lock in locks:
        lock.release()


def test_it_goes_with_a_process_that_is_killed(tmp_path):
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(AlreadyDriven, match="node /other"):
            DriverLock("10.5.5.100", 10001, "node /mine", str(tmp_path))
    finally:
        holder.kill()
        holder.wait()
        holder.stdout.close()

    def taken():
        try:
            return DriverLock("10.5.5.100", 10001, "node /mine", str(tmp_path))
        except AlreadyDriven:
            return None
    lock = eventually(taken)
    lock.release()


def test_a_lock_file_of_another_user_locks_as_well(tmp_path, monkeypatch):
    DriverLock("10.5.5.100", 10001, "node /theirs", str(tmp_path)).release()
    real_open = os.open

    def open_as_stranger(path, flags, mode=0o777):
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied", path)
        return real_open(path, flags, mode)

    monkeypatch.setattr(os, "open", open_as_stranger)
    mine = DriverLock("10.5.5.100", 10001, "node /mine", str(tmp_path))
    with pytest.raises(AlreadyDriven):
        DriverLock("10.5.5.100", 10001, "node /third", str(tmp_path))
    mine.release()


@pytest.mark.parametrize("names", [
    ("127.0.0.1", "localhost"), ("localhost", "LOCALHOST"), ("127.0.0.1", "127.0.0.2"), ("127.0.0.1", "127.1"),
    ("127.0.0.1", "::1"), ("127.0.0.1", "0.0.0.0"), ("127.0.0.1", "::ffff:127.0.0.1"), ("10.5.5.100", "10.5.1380"),
    ("10.5.5.100", "::ffff:10.5.5.100"), ("fe80:0::0001", "FE80::1"), ("arm.invalid", "ARM.invalid")])
def test_two_names_of_one_controller_are_one_lock(tmp_path, names):
    first = DriverLock(names[0], 10001, "node /first", str(tmp_path))
    with pytest.raises(AlreadyDriven, match="%s:10001 is already driven by node /first" % re.escape(names[1])):
        DriverLock(names[1], 10001, "node /second", str(tmp_path))
    first.release()


def test_the_name_of_this_machine_is_one_of_loopback(tmp_path):
    try:
        socket.getaddrinfo(socket.gethostname(), None)
    except OSError:
        pytest.skip("the name of this machine has no address")
    first = DriverLock("127.0.0.1", 10001, "node /first", str(tmp_path))
    with pytest.raises(AlreadyDriven):
        DriverLock(socket.gethostname(), 10001, "node /second", str(tmp_path))
    first.release()


def test_a_host_with_several_addresses_is_one_whichever_comes_first(tmp_path, monkeypatch):
    addresses = ["10.5.5.101", "10.5.5.100"]

    def getaddrinfo(host, *_, **__):
        addresses.reverse()
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 0)) for address in addresses]

    monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)
    first = DriverLock("arm", 10001, "node /first", str(tmp_path))
    with pytest.raises(AlreadyDriven):
        DriverLock("arm", 10001, "node /second", str(tmp_path))
    first.release()


def test_the_same_address_in_another_network_is_another_controller(tmp_path, monkeypatch):
    """Containers have their own 127.0.0.1, and may share the folder for temporary files."""
    first = DriverLock("127.0.0.1", 10001, "node /first", str(tmp_path))
    real_stat = os.stat

    def elsewhere(path, **options):
        return mock.Mock(st_ino=7) if path == "/proc/self/ns/net" else real_stat(path, **options)

    monkeypatch.setattr(os, "stat", elsewhere)
    DriverLock("127.0.0.1", 10001, "node /second", str(tmp_path)).release()
    first.release()
