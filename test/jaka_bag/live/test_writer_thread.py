"""The way from messages to files without a network: buffer, limit, simulated time, failures."""
import contextlib
import struct
import threading
from collections import namedtuple
from pathlib import Path

import pytest
import waiting
from live_samples import string_connection, twist_connection, twist_frame

from jaka_bag.containers.mcap.writer import McapWriter
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError, WriteFailed
from jaka_bag.live import writer_thread
from jaka_bag.live.rolling_files import Attachment, DiskFull, FileSettings, RollingFiles
from jaka_bag.live.stream_account import PublisherStream
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


def test_messages_wait_for_a_clock_that_comes_late(tmp_path, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(writer_thread.time, "monotonic", lambda: now[0])
    bench = Bench(tmp_path, is_simulated_time=True, buffer_bytes=250)
    recorder = bench.recorder
    stream = recorder.open_stream(string_connection("/b"), "http://n/")
    clock = recorder.open_stream(string_connection("/clock"), "http://n/", is_wanted=False)
    recorder.take(stream, 7 * S, b"x" * 100)
    for now[0] in (100.0, 102.5, 130.0, 159.0):
        assert recorder._waits_for_clock()
    recorder.take(stream, 7 * S, b"x" * 100)
    assert not recorder._waits_for_clock(), "less than half of the buffer is free"
    recorder.take(clock, 9 * S, clock_message(60))
    recorder.start()
    recorder.finish()
    assert [entry[1] for entry in bench.log()] == [60 * S, 60 * S]


def test_messages_do_not_wait_for_a_clock_that_never_comes(tmp_path):
    bench = Bench(tmp_path, is_simulated_time=True, clock_wait_s=0.1)
    bench.recorder.start()
    stream = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    try:
        bench.recorder.take(stream, 7 * S, b"x")
        waiting.wait_until(lambda: stream.written == 1, "it is written", 15.0)
        bench.recorder.take(stream, 8 * S, b"y")
        waiting.wait_until(lambda: stream.written == 2, "the next one waits for nothing", 15.0)
        assert len([line for line in bench.said if "no /clock comes" in line]) == 1, "it is said at once, and once"
        clock = bench.recorder.open_stream(string_connection("/clock"), "http://n/", is_wanted=False)
        bench.recorder.take(clock, 9 * S, clock_message(60))
        bench.recorder.take(stream, 9 * S, b"z")
    finally:
        bench.recorder.finish()
    assert [(entry[1], entry[4]) for entry in bench.log()] == [(1, b"x"), (1, b"y"), (60 * S, b"z")]
    assert bench.recorder.untimed == 2


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


def rolling(folder, **settings):
    """Return a bench whose recording begins a new file at each second of log time, and keeps two."""
    bench = Bench(folder, FileSettings(folder / "log", compression="none", fsync_s=0.0, split_s=1.0, is_split=True,
                                       max_splits=2, **settings))
    bench.recorder.start()
    return bench, bench.recorder.open_stream(string_connection("/b"), "http://n/")


def take_and_wait(bench, stream, seconds):
    bench.recorder.take(stream, seconds * S, b"x")
    waiting.wait_until(lambda: bench.stopped or stream.written == seconds, "it is taken over")


def test_a_finished_file_that_was_moved_away_ends_no_recording(tmp_path):
    bench, stream = rolling(tmp_path)
    for seconds in (1, 2, 3, 4):
        if (tmp_path / "log_0.mcap").exists():
            (tmp_path / "log_0.mcap").rename(tmp_path / "mine.mcap")
        take_and_wait(bench, stream, seconds)
    bench.recorder.finish()
    assert (stream.received, stream.written, stream.unwritten) == (4, 4, 0) and not bench.stopped
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log_2.mcap", "log_3.mcap", "mine.mcap"]
    assert len(bench.log("mine.mcap")) == 1


def begun_files(folder, log_times):
    """Return the number of files that messages at these times, s, make where each file has 10 s of log time."""
    stream = PublisherStream(string_connection("/b"), "http://n/")
    files = RollingFiles(FileSettings(folder / "log", compression="none", fsync_s=0.0, split_s=10.0, is_split=True), {},
                         [], lambda: [stream], lambda line: None)
    for log_time in log_times:
        files.add(stream, int(log_time * S), 0, b"x")
    files.close()
    return len(files.finished)


def test_files_are_split_though_the_clock_was_set_back(tmp_path):
    assert begun_files(tmp_path, [*range(5000, 5005), *range(1, 101)]) >= 10


def test_files_are_split_though_the_clock_starts_anew_again_and_again(tmp_path):
    assert begun_files(tmp_path, [second for _ in range(20) for second in range(1, 7)]) >= 8


def test_times_that_go_back_by_little_do_not_split(tmp_path):
    jitter = [100.0 + number / 100 - (number % 2) * 0.2 for number in range(1, 900)]
    assert begun_files(tmp_path, jitter) == 1


def test_a_further_file_begins_with_latched_messages_in_their_order(tmp_path):
    bench = Bench(tmp_path, FileSettings(tmp_path / "log", compression="none", fsync_s=0.0, split_s=10.0, is_split=True,
                                         repeat_latched=True))
    bench.recorder.start()
    mode = string_connection("/mode")._replace(latching=True)
    first, second = (bench.recorder.open_stream(mode, uri) for uri in ("http://a/", "http://b/"))
    other = bench.recorder.open_stream(string_connection("/b"), "http://n/")
    for seconds, stream, payload in ((1, first, b"1"), (2, second, b"2"), (3, first, b"3"), (20, other, b"x"),
                                     (40, other, b"x"), (41, second, b"4"), (60, other, b"x")):
        bench.recorder.take(stream, seconds * S, payload)
    bench.recorder.finish()
    modes = [[entry[4] for entry in bench.log("log_%d.mcap" % number) if entry[0] == "/mode"] for number in range(4)]
    assert modes == [[b"1", b"2", b"3"], [b"2", b"3"], [b"2", b"3", b"4"], [b"3", b"4"]]


def test_a_finished_file_that_cannot_be_removed_is_said(tmp_path, monkeypatch):
    bench, stream = rolling(tmp_path)

    def refuse(path):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "unlink", refuse)
    for seconds in (1, 2, 3):
        take_and_wait(bench, stream, seconds)
    bench.recorder.finish()
    assert (stream.written, stream.unwritten) == (3, 0) and not bench.stopped
    assert any("log_0.mcap" in line and "not permitted" in line for line in bench.said), bench.said
    assert bench.recorder.finished_paths[-1] == str(tmp_path / "log_2.mcap")


@pytest.mark.parametrize("owner, method, error", [
    (RollingFiles, "_open", OSError(5, "Input/output error")), (RollingFiles, "_check_space", OSError(5, "no")),
    (McapWriter, "add_channel", BagError("no")), (McapWriter, "_write", OSError(5, "no")),
    (McapWriter, "encode", BagError("a time is out of range")), (McapWriter, "encode", ValueError("no")),
    (McapWriter, "append", WriteFailed("log", OSError(5, "no")))], ids=str)
def test_each_message_is_in_one_count_whatever_goes_wrong(tmp_path, monkeypatch, owner, method, error):
    bench, stream = rolling(tmp_path, repeat_latched=True, chunk_bytes=4)
    stream.connection = stream.connection._replace(latching="1")
    take_and_wait(bench, stream, 1)

    def refuse(*arguments, **options):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(owner, method, refuse)
        for seconds in (2, 3):
            bench.recorder.take(stream, seconds * S, b"x" * seconds)
        waiting.wait_until(lambda: bench.stopped or stream.written + stream.unwritten == 3, "it is over")
    with contextlib.suppress(type(error)):
        bench.recorder.finish()
    names = [path.name for path in tmp_path.iterdir()]
    assert stream.received == stream.written + stream.unwritten + stream.overflowed == 3
    assert bench.recorder.messages == stream.written
    kept = [entry for name in names if name.endswith(".mcap") for entry in bench.log(name)]
    assert len({entry[1:] for entry in kept}) <= stream.written, (kept, stream.written)
