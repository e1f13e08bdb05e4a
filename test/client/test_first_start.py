"""The first start of a driver since the computer was switched on: told once, and never where that is not certain."""
import os

import pytest

from jaka_ros_driver.client import first_start
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


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", "\0" * 9000])
def test_a_damaged_note_is_of_a_start_before(folder, text):
    assert start(folder)
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    with open(path, "w") as file:
        file.write(text)
    assert [start(folder), start(folder)] == [False, False]


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


def test_the_note_of_a_start_is_written_once(folder):
    assert start(folder)
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    os.utime(path, (1.0, 1.0))
    assert not start(folder) and os.stat(path).st_mtime == 1.0
