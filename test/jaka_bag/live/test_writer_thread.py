"""The way from messages to files without a network: buffer, limit, simulated time, snapshots, failures."""
import struct
import threading
import time
from collections import namedtuple
from pathlib import Path

import pytest
import waiting
from live_samples import string_connection, twist_connection, twist_frame

from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError, WriteFailed
from jaka_bag.live.rolling_files import Attachment, DiskFull, FileSettings, RollingFiles
from jaka_bag.live.writer_thread import WriterThread

S = 10**9


class Bench:
    """A recorder that writes into a folder."""

    def __init__(self, folder, settings=None, **options):
        self.folder = folder
        self.said = []
        self.stopped = []
        self.settings = settings or FileSettings(folder / "log", compression="none", fsync_s=0.0)
        self.recorder = WriterThread(self.open, options.pop("buffer_bytes", 0), self.said.append, self.stopped.append,
                                 **options)

    def open(self):
        return RollingFiles(self.settings, {"by": "test"}, [Attachment("a.txt", b"text", "text/plain")],
                        lambda: self.recorder.streams(), self.said.append)

    def log(self, name="log.mcap"):
        with open_log(self.folder / name) as reader:
            return [(m.connection.topic, m.log_time, m.publish_time, m.sequence, m.data) for m in messages_of(reader)]


def test_messages_times_and_numbers_arrive_in_the_file(tmp_path):
    bench = Bench(tmp_path)
    bench.recorder.start()
    stream = bench.recorder.open_stream(twist_connection("/a"), "http://n/")
    plain = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    bench.recorder.take(stream, 100 * S, twist_frame(5, 99 * S)[4:])
    bench.recorder.take(plain, 101 * S, b"\1\0\0\0x")
    bench.recorder.take(stream, 102 * S, b"short")
    bench.recorder.finish()
    assert bench.log() == [("/a", 100 * S, 99 * S, 1, twist_frame(5, 99 * S)[4:]),
                           ("/b", 101 * S, 101 * S, 1, b"\1\0\0\0x"), ("/a", 102 * S, 102 * S, 2, b"short")]
    assert bench.recorder.finished_paths == [str(tmp_path / "log.mcap")]
    assert bench.recorder.messages == 3


def test_a_publisher_that_comes_back_continues_its_account(tmp_path):
    bench = Bench(tmp_path)
    first = bench.recorder.open_stream(twist_connection("/a"), "http://n/")
    assert bench.recorder.open_stream(twist_connection("/a"), "http://n/") is first
    assert bench.recorder.open_stream(twist_connection("/a"), "http://other/") is not first


def test_beyond_the_buffer_is_thrown_away_and_counted(tmp_path):
    bench = Bench(tmp_path, buffer_bytes=250)
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    for _ in range(10):
        bench.recorder.take(stream, S, b"x" * 100)
    bench.recorder.start()
    bench.recorder.finish()
    assert (stream.received, stream.written, stream.overflowed) == (10, 2, 8)
    assert len(bench.log()) == 2


def clock_message(seconds):
    return struct.pack("<II", seconds, 0)


def test_simulated_time_is_that_of_the_clock(tmp_path):
    bench = Bench(tmp_path, is_simulated_time=True)
    bench.recorder.start()
    clock_type = string_connection("/clock")
    clock = bench.recorder.open_stream(clock_type, "http://n/", is_wanted=False)
    stream = bench.recorder.open_stream(twist_connection("/a"), "http://n/")
    bench.recorder.take(stream, 7 * S, twist_frame(1, 50 * S)[4:])
    for second in (60, 61, 40):
        bench.recorder.take(clock, 8 * S, clock_message(second))
        bench.recorder.take(stream, 9 * S, twist_frame(second, 55 * S)[4:])
    bench.recorder.finish()
    assert [entry[1:3] for entry in sorted(bench.log(), key=lambda entry: entry[3])] == [
        (60 * S, 50 * S), (60 * S, 55 * S), (61 * S, 55 * S), (40 * S, 55 * S)]
    assert bench.recorder.untimed == 1
    assert {entry[0] for entry in bench.log()} == {"/a"}


def test_without_any_clock_messages_are_kept_at_the_earliest_time(tmp_path):
    bench = Bench(tmp_path, is_simulated_time=True)
    bench.recorder.start()
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    bench.recorder.take(stream, 7 * S, b"x")
    bench.recorder.finish()
    assert [entry[:2] for entry in bench.log()] == [("/b", 1)]


def test_a_limit_takes_so_many_of_each_topic(tmp_path):
    bench = Bench(tmp_path, limit=2)
    bench.recorder.start()
    streams = [bench.recorder.open_stream(string_connection(topic), "http://n/") for topic in ("/a", "/b")]
    for i in range(5):
        for stream in streams:
            bench.recorder.take(stream, S + i, b"x")
    bench.recorder.finish()
    assert sorted(entry[0] for entry in bench.log()) == ["/a", "/a", "/b", "/b"]
    assert bench.recorder.full_topics == {"/a", "/b"}


def test_a_snapshot_holds_the_newest_time_and_starts_anew(tmp_path):
    now = time.time_ns()
    bench = Bench(tmp_path, snapshot_s=100.0)
    bench.recorder.start()
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    for age, payload in ((500, b"old"), (50, b"new"), (0, b"newest")):
        bench.recorder.take(stream, now - age * S, payload)
    bench.recorder.trigger_snapshot()
    waiting.wait_until(lambda: bench.said, "it is written")
    assert [entry[4] for entry in bench.log()] == [b"new", b"newest"]
    bench.recorder.finish()


def test_conflicting_types_are_said(tmp_path):
    bench = Bench(tmp_path)
    bench.recorder.open_stream(twist_connection("/a"), "http://n/")
    bench.recorder.open_stream(string_connection("/a"), "http://m/")
    assert len(bench.said) == 1
    assert "both are recorded" in bench.said[0]


@pytest.mark.parametrize("owner, method, lost", [(McapWriter, "append", 2), (RollingFiles, "tick", 1)])
def test_a_refused_write_ends_the_recording_whole_and_is_raised(tmp_path, monkeypatch, owner, method, lost):
    bench = Bench(tmp_path, FileSettings(tmp_path / "log", compression="none", fsync_s=0.0, chunk_age_s=3.0))
    bench.recorder.start()
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    bench.recorder.take(stream, S, b"before")
    waiting.wait_until(lambda: stream.written == 1, "it is taken over")

    def refuse(*arguments):
        raise WriteFailed("log", OSError(5, "Input/output error"))
    with monkeypatch.context() as patch:
        patch.setattr(owner, method, refuse)
        waiting.wait_until(lambda: bench.stopped, "it stops")
    bench.recorder.take(stream, 2 * S, b"after")
    with pytest.raises(WriteFailed, match="Input/output error"):
        bench.recorder.finish()
    assert stream.unwritten == lost  # the chunk where it was refused, and what came after
    assert len(bench.log()) == 2 - lost
    assert stream.received == stream.written + stream.unwritten


def test_a_bug_in_the_writer_does_not_end_the_recording_unnoticed(tmp_path, monkeypatch):
    bench = Bench(tmp_path)
    bench.recorder.start()
    monkeypatch.setattr(RollingFiles, "tick", lambda self: 1 // 0)
    waiting.wait_until(lambda: bench.stopped, "it stops")
    with pytest.raises(ZeroDivisionError):
        bench.recorder.finish()


Disk = namedtuple("Disk", "f_bavail f_frsize")


def test_a_disk_that_fills_ends_a_recording_with_everything_taken_in_the_file(tmp_path, monkeypatch):
    free = [10**9]
    monkeypatch.setattr("os.fstatvfs", lambda descriptor: Disk(free[0], 1))
    bench = Bench(tmp_path, FileSettings(tmp_path / "log", compression="none", chunk_bytes=1000, min_space=5000,
                                         chunk_age_s=0.5))
    bench.recorder.start()
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    for payload in (b"x" * 100, b"y" * 100):
        bench.recorder.take(stream, S, payload)
    waiting.wait_until(lambda: stream.written == 2, "they are taken over")
    free[0] = 6000
    waiting.wait_until(lambda: bench.stopped, "it stops")
    with pytest.raises(DiskFull, match="is full"):
        bench.recorder.finish()
    assert len(bench.log()) == 2


def test_a_file_that_cannot_be_made_is_an_error_at_the_start(tmp_path):
    bench = Bench(tmp_path, FileSettings(tmp_path / "nowhere" / "log"))
    with pytest.raises(BagError, match="no folder"):
        bench.recorder.start()
    assert not [thread for thread in threading.enumerate() if thread.name == "log-writer"]


def test_files_are_numbered_where_they_are_split():
    settings = FileSettings(Path("a/log"), "bag", is_split=True)
    assert [str(settings.path(n)) for n in (0, 11)] == ["a/log_0.bag", "a/log_11.bag"]
    assert str(FileSettings(Path("v1.2/my.log")).path(0)) == "v1.2/my.log.mcap"
