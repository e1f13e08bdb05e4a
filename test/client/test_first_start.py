"""The first start of a driver since the computer was switched on: told once, and never where that is not certain."""
import os
import shutil

import pytest

from jaka_ros_driver.client import first_start, runtime_file
from jaka_ros_driver.client.first_start import is_first_start


@pytest.fixture
def folder(tmp_path):
    return str(tmp_path / "private")


def start(folder, host="127.0.0.1", port=10001):
    return is_first_start(host, port, [folder])


def test_the_first_start_of_each_controller_is_the_only_one(folder):
    assert [start(folder), start(folder), start(folder, "localhost")] == [True, False, False]
    assert start(folder, port=10002) and start(folder, "10.5.5.100")


def test_another_start_of_the_computer_has_a_first_start_of_its_own(folder, monkeypatch):
    assert start(folder)
    monkeypatch.setattr(first_start, "boot", lambda: "another boot")
    assert [start(folder), start(folder)] == [True, False]


def damage(folder, content):
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    with open(path, "wb") as file:
        file.write(content)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b"\0" * 9000, b"\xff\xfe\0"])
def test_a_damaged_note_is_of_a_start_before(folder, content):
    assert start(folder)
    damage(folder, content)
    assert [start(folder), start(folder)] == [False, False]


def start_with(*folders):
    return is_first_start("127.0.0.1", 10001, list(folders))


@pytest.fixture
def two(tmp_path, monkeypatch):
    """Return a folder that goes when its user logs out, and one that stays."""
    monkeypatch.setattr(runtime_file, "_OF_SESSIONS", str(tmp_path / "session"))
    return str(tmp_path / "session"), str(tmp_path / "temporary")


def test_a_log_out_makes_no_second_first_start(two):
    of_session, of_computer = two
    assert start_with(*two)
    shutil.rmtree(of_session)
    assert not start_with(*two) and not start_with(of_session)
    shutil.rmtree(of_computer)
    assert not start_with(*two) and not start_with(of_computer)


def test_one_note_that_cannot_be_read_is_enough(two, monkeypatch):
    first, second = two
    assert start_with(first, second)
    monkeypatch.setattr(first_start, "boot", lambda: "another boot")
    os.chmod(first, 0o777)  # anybody can have changed it
    assert not start_with(first, second)
    monkeypatch.setattr(first_start, "boot", lambda: "a third boot")
    os.chmod(first, 0o700)
    damage(first, b"")
    assert not start_with(first, second)


def test_where_nothing_can_be_noted_no_start_is_the_first(folder, caplog, monkeypatch):
    assert not start("/proc/nobody") and "it cannot be noted that the driver of 127.0.0.1:10001" in caplog.text
    assert start(folder)
    os.chmod(folder, 0o777)
    assert not start(folder)

    def unknown():
        raise FileNotFoundError
    monkeypatch.setattr(first_start, "boot", unknown)
    os.chmod(folder, 0o700)
    assert not start(folder)
