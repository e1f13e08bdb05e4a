"""One controller, one driver: the lock names its holder, and goes with the process that holds it."""
import os
import subprocess
import sys

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
