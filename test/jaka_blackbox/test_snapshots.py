"""Snapshots without a network: what they hold, a system that refuses to write one."""
import time
from types import SimpleNamespace

import live_samples
import pytest
from everywhere import hangs
from live_samples import string_connection

from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import WriteFailed
from jaka_bag.live.rolling_files import FileSettings, RollingFiles
from jaka_bag.live.writer_thread import WriterThread
from jaka_blackbox import snapshots
from jaka_blackbox.snapshots import Snapshots

S = 10**9


class Bench:
    """A recording without a network, whose snapshots go to a folder."""

    def __init__(self, folder, newest_s, buffer_bytes=0):
        self.folder = folder
        self.settings = FileSettings(folder / "log", compression="none", fsync_s=0.0)
        self.args = SimpleNamespace(buffsize=buffer_bytes)
        self.said, self.stopped = [], []
        self.console = SimpleNamespace(always=self.said.append)
        self.snapshots = Snapshots(self, newest_s)
        self.writer = WriterThread(self.snapshots.begin, buffer_bytes, self.said.append, self.stopped.append)
        self.writer.start()
        self.stream = self.writer.open_stream(string_connection("/b"), "http://n/")

    def wait_for(self, payload):
        ring = self.snapshots._ring
        live_samples.wait_until(lambda: ring and ring[-1][-1] == payload, "it is taken over")

    def open_log(self, settings):
        return RollingFiles(settings, {}, [], self.writer.streams, self.said.append)

    def logs(self):
        found = []
        for path in sorted(self.folder.glob("log_snapshot_*.mcap")):
            with open_log(path) as reader:
                found.append([message.data for message in messages_of(reader)])
        return found


def clock_of(monotonic_s):
    """Return the module of time where so much has passed."""
    return SimpleNamespace(monotonic=lambda: monotonic_s, time_ns=time.time_ns, strftime=time.strftime)


@pytest.mark.parametrize("stamps", [(1000, 1001, 5), (5, 1000, 1001)], ids=["back", "forth"])
def test_a_clock_that_is_set_changes_nothing_of_what_is_in_memory(tmp_path, monkeypatch, stamps):
    bench = Bench(tmp_path, 100.0)
    monkeypatch.setattr(time, "time_ns", lambda: 7)
    for number, stamp in enumerate(stamps):
        bench.writer.take(bench.stream, stamp * S, b"%d" % number)
    monkeypatch.setattr(time, "time_ns", lambda: 10**6 * S)
    bench.snapshots.trigger()
    bench.writer.finish()
    assert [sorted(log) for log in bench.logs()] == [[b"0", b"1", b"2"]]


def test_a_snapshot_forgets_what_is_old_after_the_clock_was_set_back(tmp_path, monkeypatch):
    bench = Bench(tmp_path, 100.0)
    began = time.monotonic()
    for passed, stamp in ((0, 10**6), (500, 3)):
        monkeypatch.setattr(snapshots, "time", clock_of(began + passed))
        monkeypatch.setattr(time, "time_ns", lambda s=stamp: s * S)
        bench.writer.take(bench.stream, stamp * S, b"%d" % stamp)
        bench.wait_for(b"%d" % stamp)
    bench.snapshots.trigger()
    bench.writer.finish()
    assert bench.logs() == [[b"3"]]


def test_a_snapshot_holds_the_newest_time_and_starts_anew(tmp_path, monkeypatch):
    bench, now = Bench(tmp_path, 100.0), time.time_ns()
    began = time.monotonic()
    for passed, payload in ((0, b"old"), (450, b"new"), (500, b"newest")):
        monkeypatch.setattr(snapshots, "time", clock_of(began + passed))
        bench.writer.take(bench.stream, now, payload)
        bench.wait_for(payload)
    bench.snapshots.trigger()
    live_samples.wait_until(lambda: bench.said, "it is written")
    assert bench.logs() == [[b"new", b"newest"]]
    bench.writer.take(bench.stream, now, b"more")
    bench.snapshots.trigger()
    bench.writer.finish()
    assert sorted(bench.logs()) == [[b"more"], [b"new", b"newest"]]
    assert bench.writer.messages == 3 and len(bench.writer.finished_paths) == 2


def test_memory_is_that_of_the_buffer(tmp_path):
    bench = Bench(tmp_path, 100.0, buffer_bytes=30)
    for number in range(9):
        bench.writer.take(bench.stream, time.time_ns(), b"%010d" % number)
        live_samples.wait_until(lambda: not bench.writer._queue, "it is taken over")
    bench.snapshots.trigger()
    bench.writer.finish()
    assert bench.logs() == [[b"%010d" % number for number in (6, 7, 8)]]


def test_a_refused_write_ends_the_recording_and_is_raised(tmp_path, monkeypatch):
    bench = Bench(tmp_path, 100.0)

    def refuse(*arguments):
        raise WriteFailed("log", OSError(5, "Input/output error"))
    bench.writer.take(bench.stream, time.time_ns(), b"before")
    monkeypatch.setattr(RollingFiles, "add", refuse)
    bench.snapshots.trigger()
    live_samples.wait_until(lambda: bench.stopped, "it stops")
    with pytest.raises(WriteFailed):
        bench.writer.finish()
    assert bench.said == []


def test_a_trigger_that_comes_at_any_line_of_another_waits_for_nothing(tmp_path):
    def begin():
        snapshots = Snapshots(None, 100.0)
        return snapshots.trigger, snapshots.trigger

    assert hangs(begin) == []
