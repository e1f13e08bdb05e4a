"""The audit log on a disk that is full, slow, gone or was cut off: nobody waits, and no loss goes unrecorded."""
import errno
import json
import logging
import os
import shutil
import threading
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from waiting import eventually

from jaka_bag.operations.audit_log import verify_audit
from jaka_ros_driver.audit import folder as folder_module
from jaka_ros_driver.audit import log as log_module
from jaka_ros_driver.audit.log import AuditLog

PATIENCE_S = 20.0
AT_ONCE_S = 5.0
"""Time limit, s, for a thousand lines beside a disk that is held for PATIENCE_S; on a quiet host it is 2 ms."""
YEAR_NS = 365 * 86400 * 10 ** 9


@pytest.fixture
def place(tmp_path):
    return str(tmp_path / "logs" / "arm")


@pytest.fixture
def begin(place):
    """Return a function that starts a log in the place; all logs end with the test."""
    logs = []

    def start(**options):
        log = AuditLog(place, options.pop("days", 0), **options)
        log.start()
        logs.append(log)
        return log
    yield start
    for log in logs:
        log.close(PATIENCE_S)


@pytest.fixture(autouse=True)
def quick_retries(monkeypatch):
    monkeypatch.setattr(log_module, "_RETRY_PERIOD_S", 0.05)


def files(place):
    return sorted(name for name in os.listdir(place) if name.endswith(".jsonl"))


def lines(place):
    found = []
    for name in files(place):
        with open(os.path.join(place, name), "rb") as file:
            for line in file:
                try:
                    found.append(json.loads(line.decode("utf-8")))
                except ValueError:
                    found.append(line)
    return found


def kinds(place):
    return [line["kind"] if isinstance(line, dict) else "?" for line in lines(place)]


def whole(place):
    account, = verify_audit([place])
    assert account.defect is None, account.defect
    return account


class Disk:
    """The log's ``os.write``, which refuses, is slow or takes a part only, as the test chooses."""

    def __init__(self, monkeypatch):
        self.error, self.room, self.holding = None, None, None
        self._write = os.write
        monkeypatch.setattr(log_module.os, "write", self.write)

    def write(self, descriptor, data):
        if self.holding is not None and not threading.current_thread().name.startswith("MainThread"):
            self.holding.wait(PATIENCE_S)
        if self.error is not None:
            if self.room:
                taken, self.room = self._write(descriptor, bytes(data[:self.room])), 0
                return taken
            raise OSError(self.error, os.strerror(self.error))
        return self._write(descriptor, data)


@pytest.fixture
def disk(monkeypatch):
    return Disk(monkeypatch)


def test_lines_are_chained_over_files_and_starts(begin, place):
    for start in range(3):
        log = begin(file_bytes=1000)
        for number in range(10):
            log.write("call", {"number": number, "start": start})
            assert eventually(lambda log=log: not log.health().waiting)
        assert log.close(PATIENCE_S)
    account = whole(place)
    assert account.lines == 30 and account.files == len(files(place)) > 3
    assert [(line["start"], line["number"]) for line in lines(place)] == [(a, b) for a in range(3) for b in range(10)]
    for name in files(place):
        with open(os.path.join(place, name), "rb") as file:
            assert json.loads(file.readline())["n"] == int(name[6:18])


def test_nobody_waits_for_a_disk_that_does_not_answer(begin, disk, place, monkeypatch):
    monkeypatch.setattr(log_module, "_STUCK_S", 0.2)
    log = begin(most_waiting=100)
    log.write("call", {})
    assert eventually(lambda: log.health().written == 1)
    disk.holding = threading.Event()
    since = time.monotonic()
    for number in range(1000):
        log.write("call", {"number": number}, is_urgent=True)
    assert time.monotonic() - since < AT_ONCE_S
    assert eventually(lambda: log.health().trouble == "the disk does not answer")
    since = time.monotonic()
    assert not log.close(0.2) and time.monotonic() - since < PATIENCE_S / 2
    assert log.health().lost >= 800
    disk.holding.set()
    log._thread.join(PATIENCE_S)
    assert not log._thread.is_alive()


@pytest.mark.parametrize("room", [0, 1, 130, 1000])
def test_a_full_disk_is_said_once_and_what_is_lost_is_counted_in_the_chain(begin, disk, place, caplog, room):
    log = begin(most_waiting=50)
    log.write("call", {"number": -1})
    assert eventually(lambda: log.health().written == 1)
    disk.error, disk.room = errno.ENOSPC, room
    with caplog.at_level(logging.WARNING):
        for number in range(300):
            log.write("call", {"number": number})
        assert eventually(lambda: "No space left" in log.health().trouble)
        assert eventually(lambda: log.health().lost >= 200)
        time.sleep(0.3)  # some more tries
        assert sum("cannot be written" in line.getMessage() for line in caplog.records) == 1
    disk.error = None
    assert eventually(lambda: not log.health().trouble and not log.health().waiting)
    assert log.close(PATIENCE_S)
    account = whole(place)
    written = [line["number"] for line in lines(place) if isinstance(line, dict) and line["kind"] == "call"]
    lost = [line["count"] for line in lines(place) if isinstance(line, dict) and line["kind"] == "lost"]
    assert len(written) == len(set(written)) and written == sorted(written)
    assert len(written) + sum(lost) == 301 and sum(lost) == log.health().lost
    assert any("lost" in note for note in account.notes)


def test_a_folder_that_cannot_be_written_costs_one_warning_and_is_tried_again(begin, place, caplog):
    def told():
        return sum("cannot be written" in line.getMessage() for line in caplog.records)
    os.makedirs(os.path.dirname(place))
    with open(place, "w"):  # a file where the folder is to be
        pass
    log = begin()
    with caplog.at_level(logging.WARNING):
        log.write("call", {"number": 1})
        assert eventually(lambda: log.health().trouble and told())
    os.unlink(place)
    assert eventually(lambda: not log.health().trouble and log.health().written == 1)
    assert whole(place).lines == 1 and told() == 1


def test_a_second_process_does_not_write_the_same_log(begin, place):
    first = begin()
    first.write("call", {"who": "first"})
    assert eventually(lambda: first.health().written == 1)
    second = begin()
    second.write("call", {"who": "second"})
    assert eventually(lambda: "another process writes" in second.health().trouble)
    first.close(PATIENCE_S)
    assert eventually(lambda: second.health().written == 1)
    assert [line["who"] for line in lines(place)] == ["first", "second"] and whole(place).lines == 2


def remove(place):
    """Remove a folder in one moment, whatever is written into it meanwhile."""
    os.rename(place, place + ".gone")
    shutil.rmtree(place + ".gone")


@pytest.mark.parametrize("is_urgent", [False, True])
def test_a_newest_file_that_is_removed_under_the_log_leaves_no_hole(begin, place, is_urgent):
    many_files(begin, 3)
    log = begin()
    log.write("call", {"number": 3})
    assert eventually(lambda: log.health().written == 1)
    os.unlink(os.path.join(place, files(place)[-1]))
    log.write("call", {"number": 4}, is_urgent=is_urgent)
    left = len(kinds(place))
    assert eventually(lambda: log.health().trouble or len(kinds(place)) > left)
    assert eventually(lambda: "lost" in kinds(place) and not log.health().waiting)
    assert log.close(PATIENCE_S)
    told, = [line for line in lines(place) if line["kind"] == "lost"]
    calls = [line["number"] for line in lines(place) if line["kind"] == "call"]
    assert told["count"] + len(calls) == 5 and told["count"] > 0 and log.health().lost == told["count"]
    assert len(told["sha256"]) == 64 and "removed" in told["text"]
    assert not is_urgent or calls[-1] == 4, "an urgent line is on the disk, or is not counted as written"
    assert any("removed" in note for note in whole(place).notes)


def test_a_folder_that_is_removed_under_the_log_is_made_again_and_taken(begin, place):
    many_files(begin, 3)
    log = begin()
    log.write("call", {"number": 3}, is_urgent=True)
    assert eventually(lambda: log.health().written == 1)
    remove(place)
    assert eventually(lambda: os.path.isdir(place) and "lost" in kinds(place)), "without a line that comes"
    log.write("call", {"number": 4}, is_urgent=True)
    assert eventually(lambda: "call" in kinds(place))
    with pytest.raises(folder_module.LogInUse):
        folder_module.AuditFolder(place).take()
    assert log.close(PATIENCE_S)
    assert [line["count"] for line in lines(place) if line["kind"] == "lost"] == [4]
    assert whole(place).lines == 2


def test_what_a_removed_line_said_was_lost_is_said_again(begin, place):
    log = begin()
    for number in range(3):
        log.write("call", {"number": number})
    assert eventually(lambda: log.health().written == 3)
    remove(place)
    assert eventually(lambda: os.path.isdir(place) and "lost" in kinds(place))
    remove(place)
    assert eventually(lambda: os.path.isdir(place) and "lost" in kinds(place))
    told, = lines(place)
    assert told["count"] == 4, "three calls, and the line that said so"


def test_a_log_that_ends_just_after_its_file_was_removed_says_so(begin, place):
    log = begin()
    log.write("call", {})
    assert eventually(lambda: log.health().written == 1)
    os.unlink(os.path.join(place, files(place)[0]))
    log.write("end", {}, is_urgent=True)
    assert log.close(PATIENCE_S)
    assert kinds(place)[-2:] in (["lost", "end"], ["end", "lost"]) and whole(place).lines == 2


def test_a_file_that_was_replaced_by_its_copy_is_gone_on_with(begin, place):
    log = begin()
    log.write("call", {"number": 0})
    assert eventually(lambda: log.health().written == 1)
    path = os.path.join(place, files(place)[0])
    shutil.copy(path, path + ".new")
    os.replace(path + ".new", path)
    time.sleep(0.6)  # some looks
    log.write("call", {"number": 1}, is_urgent=True)
    assert log.close(PATIENCE_S)
    assert kinds(place) == ["call", "call"] and whole(place).lines == 2


def file_of_three_calls(begin, place):
    """Write three calls of some 200 bytes each, end the log, and return the path of its file."""
    log = begin()
    for number in range(3):
        log.write("call", {"number": number, "text": "x" * 200})
    log.close(PATIENCE_S)
    return os.path.join(place, files(place)[0])


@pytest.mark.parametrize("cut", [1, 2, 40, 200])
def test_a_line_that_was_cut_off_stays_and_the_next_start_says_so(begin, place, cut):
    path = file_of_three_calls(begin, place)
    with open(path, "rb+") as file:
        file.truncate(os.path.getsize(path) - cut)
    with open(path, "rb") as file:
        before = file.read()
    again = begin()
    again.write("call", {"number": 3})
    again.close(PATIENCE_S)
    with open(path, "rb") as file:
        assert file.read().startswith(before), "what is there is not touched"
    account = whole(place)
    if cut == 1:  # the line end alone: the line is whole
        assert kinds(place) == ["call"] * 4
    else:
        assert kinds(place) == ["call", "call", "?", "cut", "call"]
        cut_line = lines(place)[3]
        assert cut_line["bytes"] == len(before.rpartition(b"\n")[2])
        assert any("cut off" in note for note in account.notes)
    with open(path, "rb+") as file:  # who takes away what was left of the line is found out
        content = file.read()
        if cut != 1:
            rest = before.rpartition(b"\n")[2]
            file.seek(0)
            file.write(content.replace(rest + b"\n", b""))
            file.truncate()
            assert verify_audit([place])[0].defect is not None


def test_a_file_that_has_its_size_is_ended_before_the_next_one_begins(begin, place):
    path = file_of_three_calls(begin, place)
    with open(path, "rb+") as file:
        file.truncate(os.path.getsize(path) - 100)
    again = begin(file_bytes=500)
    again.write("call", {"number": 3})
    again.close(PATIENCE_S)
    assert files(place) == ["audit-000000000001.jsonl", "audit-000000000004.jsonl"] and whole(place).lines == 4
    assert kinds(place) == ["call", "call", "?", "cut", "call"]


@pytest.mark.parametrize("rest", [b"\0" * 5000, b"\n\n", b"{\"n\":4,\"prev\":\n\0\0\nmore", b"\xff"])
def test_whatever_a_loss_of_power_leaves_at_the_end_is_kept_and_told(begin, place, rest):
    log = begin()
    log.write("call", {})
    log.close(PATIENCE_S)
    path = os.path.join(place, files(place)[0])
    with open(path, "ab") as file:
        file.write(rest)
    again = begin()
    again.write("call", {})
    again.close(PATIENCE_S)
    assert whole(place).lines == 3
    with open(path, "rb") as file:
        assert rest in file.read()


def test_an_empty_newest_file_is_gone_on_with(begin, place):
    log = begin()
    log.write("call", {})
    log.close(PATIENCE_S)
    with open(os.path.join(place, "audit-000000000002.jsonl"), "w"):
        pass
    again = begin()
    again.write("call", {})
    again.close(PATIENCE_S)
    assert whole(place).lines == 2 and len(files(place)) == 2


def test_a_clock_that_is_set_back_is_seen(begin, place, monkeypatch):
    log = begin()
    log.write("call", {})
    assert eventually(lambda: log.health().written == 1)
    real = time.time_ns
    monkeypatch.setattr(log_module.time, "time_ns", lambda: real() - 3600 * 10 ** 9)
    log.write("call", {})
    assert eventually(lambda: log.health().written == 3)
    log.close(PATIENCE_S)
    assert kinds(place) == ["call", "clock", "call"] and lines(place)[1]["step_s"] == pytest.approx(-3600.0, abs=1.0)
    again = begin()  # the clock goes back while no driver runs, too
    monkeypatch.setattr(log_module.time, "time_ns", lambda: real() - 7200 * 10 ** 9)
    again.write("call", {})
    again.close(PATIENCE_S)
    assert kinds(place)[3:] == ["clock", "call"] and lines(place)[3]["before"] == lines(place)[2]["time"]
    assert whole(place).lines == 5


def many_files(begin, count=6):
    log = begin(file_bytes=100)
    for number in range(count):
        log.write("call", {"number": number})
        assert eventually(lambda number=number: log.health().written == number + 1)
    log.close(PATIENCE_S)


def test_files_that_are_old_are_named_in_the_log_and_deleted(begin, place, monkeypatch):
    many_files(begin)
    names = files(place)
    assert len(names) >= 5
    real = time.time_ns
    monkeypatch.setattr(log_module.time, "time_ns", lambda: real() + 6 * YEAR_NS)
    log = begin(days=1826.0)
    log.write("call", {})
    assert eventually(lambda: files(place)[0] == names[2])
    log.close(PATIENCE_S)
    pruned, = [line for line in lines(place) if line["kind"] == "pruned"]
    assert [file["name"] for file in pruned["files"]] == names[:2], "two at a time: the clock may be wrong by years"
    assert any("pruned" in note for note in whole(place).notes)
    os.unlink(os.path.join(place, files(place)[0]))  # one more, which the log does not name
    assert verify_audit([place])[0].defect.what.startswith("missing")


def test_nothing_is_deleted_before_its_time_or_where_it_is_kept_for_ever(begin, place, monkeypatch):
    many_files(begin)
    names = files(place)
    for days, years in ((1826.0, 4), (0, 100)):
        real = time.time_ns
        with monkeypatch.context() as later:
            later.setattr(log_module.time, "time_ns", lambda years=years, real=real: real() + years * YEAR_NS)
            log = begin(days=days)
            log.write("call", {})
            assert eventually(lambda log=log: log.health().written >= 1)
            log.close(PATIENCE_S)
    assert files(place)[:len(names)] == names


def test_an_urgent_line_is_on_the_disk_at_once_and_others_within_a_second(begin, place, monkeypatch):
    synced = []
    real = os.fsync
    monkeypatch.setattr(log_module.os, "fsync", lambda descriptor: (synced.append(time.monotonic()), real(descriptor)))
    log = begin()
    since = time.monotonic()
    for _ in range(200):
        log.write("call", {})
        time.sleep(0.001)
    assert eventually(lambda: len(synced) >= 1)
    plain = len(synced)
    assert plain <= time.monotonic() - since + 2.0  # and not once a line
    log.write("call", {}, is_urgent=True)
    assert eventually(lambda: len(synced) > plain)


def test_a_defect_in_a_task_does_not_end_the_log(begin, place, caplog):
    log = begin()
    log.add_task(lambda: 1 // 0)
    log.write("call", {})
    assert eventually(lambda: any("defect" in line.getMessage() for line in caplog.records))
    log._tasks.clear()
    log.write("call", {"number": 2})
    log.close(PATIENCE_S)
    assert whole(place).lines == 2


def test_a_field_that_json_cannot_hold_costs_that_line_its_fields(begin, place):
    log = begin()
    log.write("call", {"value": float("inf")})
    log.write("call", {"value": object()})
    log.write("call", {"value": 1})
    log.close(PATIENCE_S)
    first, second, third = lines(place)
    assert "left_out" in first and "left_out" in second and third["value"] == 1 and whole(place).lines == 3


def test_lines_of_many_threads_are_all_there(begin, place):
    log = begin()
    threads = [threading.Thread(target=lambda who=who: [log.write("call", {"who": who, "number": number})
                                                        for number in range(100)]) for who in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    log.close(PATIENCE_S)
    seen = [(line["who"], line["number"]) for line in lines(place)]
    assert len(seen) == len(set(seen)) == 800
    assert all([n for w, n in seen if w == who] == list(range(100)) for who in range(8)) and whole(place).lines == 800


def test_the_newest_file_is_never_old(begin, place):
    many_files(begin)
    names = files(place)
    folder = folder_module.AuditFolder(place)
    assert names[-1] not in [old.name for old in folder.older_than("9999")] and len(folder.older_than("9999")) == 2


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(lives=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 900), st.binary(max_size=40)), min_size=1,
                      max_size=4), file_bytes=st.integers(100, 2000))
def test_whatever_is_left_at_the_end_the_log_goes_on_as_one_chain(tmp_path_factory, lives, file_bytes):
    # Each life writes some lines; then the newest file loses its end and gets some garbage, as by a loss of power.
    place = str(tmp_path_factory.mktemp("power"))
    for count, cut, garbage in [*lives, (1, 0, b"")]:
        log = AuditLog(place, 0, file_bytes=file_bytes)
        log.start()
        for number in range(count):
            log.write("call", {"number": number, "text": "x" * 50})
        assert log.close(PATIENCE_S)
        if not (files(place) and (cut or garbage)):
            continue
        path = os.path.join(place, files(place)[-1])
        with open(path, "rb+") as file:
            file.truncate(max(0, os.path.getsize(path) - cut))
            file.seek(0, os.SEEK_END)
            file.write(garbage)
    whole(place)
