"""The custody file: its content, which files are believed, and a driver whose disk fails."""
import dataclasses
import json
import logging
import os
import shutil
import subprocess
import sys
import threading
import time

import pytest
from waiting import eventually

from jaka_ros_driver.client import runtime_file
from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.foreign_motion import LeftMotion
from jaka_ros_driver.client.custody_file import CustodyFile, CustodyKeeper
from jaka_ros_driver.commands import JogFrame, JogStop

JOG = JogStop(JogFrame.TOOL, 4)


@pytest.fixture
def folder(tmp_path):
    return str(tmp_path / "private")


@pytest.fixture
def file(folder):
    return CustodyFile("127.0.0.1", 10001, [folder])


@pytest.fixture
def keeper(file):
    keeper = CustodyKeeper(file)
    keeper.start()
    yield keeper
    keeper.close()


def left_by(process, jog=JOG):
    return LeftMotion("a jog", jog, 1764000000.25, process)


@pytest.mark.parametrize("jog", [JOG, None])
def test_what_is_written_is_read_under_any_name_of_the_controller(file, folder, jog):
    file.write(left_by(os.getpid(), jog))
    for host in ("127.0.0.1", "localhost"):
        found = CustodyFile(host, 10001, [folder]).read()
        assert found.left == left_by(os.getpid(), jog) and found.is_alive
    assert CustodyFile("127.0.0.1", 10002, [folder]).read() is None
    file.remove()
    assert file.read() is None and os.listdir(folder) == []


def test_a_process_that_has_died_is_dead_also_where_its_id_runs_again(file, folder):
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    file.write(left_by(process.pid))
    assert file.read().is_alive
    process.kill()
    process.wait()
    process.stdin.close()
    assert not file.read().is_alive
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    with open(path) as opened:
        fields = json.load(opened)
    with open(path, "w") as opened:
        json.dump({**fields, "process": os.getpid()}, opened)
    assert not file.read().is_alive


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"process": "x"}', "\0" * 9000, '{"jog": {"axis": 9}}'])
def test_a_file_that_cannot_be_understood_tells_nothing(file, folder, caplog, text):
    file.write(left_by(1))
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    with open(path, "w") as opened:
        opened.write(text)
    assert file.read() is None and "is not read" in caplog.text


def test_the_folder_is_private_and_one_that_is_not_is_neither_read_nor_written(file, folder, tmp_path):
    file.write(left_by(1))
    assert os.stat(folder).st_mode & 0o777 == 0o700
    os.chmod(folder, 0o777)
    assert file.read() is None
    with pytest.raises(OSError, match="not a private folder"):
        file.write(left_by(2))
    os.chmod(folder, 0o700)
    os.symlink(folder, str(tmp_path / "link"))
    other = CustodyFile("127.0.0.1", 10001, [str(tmp_path / "link")])
    assert other.read() is None
    with pytest.raises(OSError, match="not a private folder"):
        other.write(left_by(3))
    assert file.read().left.process == 1


def test_a_symbolic_link_in_place_of_the_file_is_replaced_and_not_followed(file, folder, tmp_path):
    file.write(left_by(1))
    path, = (os.path.join(folder, name) for name in os.listdir(folder))
    precious = tmp_path / "precious"
    os.rename(path, str(precious))
    os.symlink(str(precious), path)
    assert file.read() is None
    file.write(left_by(2))
    assert json.loads(precious.read_text())["process"] == 1 and file.read().left.process == 2


def test_where_the_first_folder_cannot_be_used_the_next_one_is(tmp_path):
    second = str(tmp_path / "second")
    file = CustodyFile("127.0.0.1", 10001, [str(tmp_path / "not" / "there"), second])
    file.write(left_by(1))
    assert file.read().left.process == 1 and len(os.listdir(second)) == 1
    file.remove()
    assert file.read() is None


def test_what_moves_is_known_after_a_log_out_and_the_newest_word_counts(tmp_path, monkeypatch):
    of_session, of_computer = str(tmp_path / "session"), str(tmp_path / "computer")
    monkeypatch.setattr(runtime_file, "_OF_SESSIONS", of_session)
    CustodyFile("127.0.0.1", 10001, [of_computer]).write(dataclasses.replace(left_by(1), since=1.0))
    file = CustodyFile("127.0.0.1", 10001, [of_session, of_computer])
    CustodyFile("127.0.0.1", 10001, [of_session]).write(dataclasses.replace(left_by(2), since=2.0))
    assert file.read().left.process == 2
    file.write(dataclasses.replace(left_by(3), since=3.0))
    shutil.rmtree(of_session)
    assert file.read().left.process == 3
    file.remove()
    assert file.read() is None


def test_the_default_is_a_folder_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    file = CustodyFile("127.0.0.1", 10001)
    file.write(left_by(1))
    assert os.listdir(str(tmp_path)) == ["jaka_ros_driver"]
    file.remove()


def test_only_its_own_file_is_removed_for_a_dead_driver(file):
    file.write(left_by(7))
    file.remove_of(8)
    assert file.read() is not None
    file.remove_of(7)
    assert file.read() is None


def test_custody_is_on_disk_while_it_lasts(file, keeper):
    before = time.time()
    keeper.note(NotifyGuard(True, "a jog", JOG))
    assert eventually(file.read)
    left = file.read().left
    assert (left.name, left.jog_stop, left.process) == ("a jog", JOG, os.getpid()) and left.since >= before
    keeper.note(NotifyGuard(False))
    assert eventually(lambda: file.read() is None)


def test_nobody_waits_for_the_disk_and_only_the_newest_word_is_written(folder):
    gate, written = threading.Event(), []

    class Slow(CustodyFile):
        def write(self, left):
            gate.wait(20.0)
            written.append(left.name)

        def remove(self):
            written.append("removed")
    keeper = CustodyKeeper(Slow("127.0.0.1", 10001, [folder]))
    keeper.start()
    began = time.monotonic()
    for number in range(1000):
        keeper.note(NotifyGuard(True, "move %d" % number))
        keeper.note(NotifyGuard(False))
    assert time.monotonic() - began < 5.0
    gate.set()
    keeper.close()
    assert written[-1] == "removed" and len(written) < 10


def test_a_disk_that_fails_is_told_once(tmp_path, caplog):
    caplog.set_level(logging.WARNING)
    keeper = CustodyKeeper(CustodyFile("127.0.0.1", 10001, [str(tmp_path / "not" / "there")]))
    keeper.start()
    for number in range(5):
        keeper.note(NotifyGuard(True, "move %d" % number))
        assert eventually(lambda: not keeper._is_due)
    keeper.close()
    assert caplog.text.count("cannot be noted on disk") == 1


def test_nobody_else_may_read_or_write_it(file, folder):
    before = os.umask(0)
    try:
        file.write(left_by(1))
    finally:
        os.umask(before)
    name, = os.listdir(folder)
    assert os.stat(os.path.join(folder, name)).st_mode & 0o7777 == 0o600
