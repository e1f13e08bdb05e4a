"""Evidence when things go wrong: kill -9, a full disk, a buffer that overflows."""
import contextlib
import json
import os
import random
import resource
import signal
import subprocess
import threading
import time

import pytest
import waiting
from live_samples import content, twist_connection, twist_frame
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from mcap.stream_reader import StreamReader
from ros_graph import with_subscribers

KILLED_LOSS_S = 1.1
"""Messages older than this at the moment of kill -9 are in the file."""


@contextlib.contextmanager
def sending(publisher, outlet, period_s=0.002):
    """Send numbered messages, stamped with the time of sending, until the context ends; yield the list of times, ns."""
    stamps = []

    def send():
        now = time.time_ns()
        publisher.publish(outlet, twist_frame(len(stamps) + 1, now))
        stamps.append(now)
    with waiting.repeating(send, period_s):
        yield stamps


def readable_stamps(path):
    """Return send times in an .mcap that was cut off, ns, as the mcap library reads it."""
    stamps = []
    with open(str(path), "rb") as file, contextlib.suppress(EndOfFile):
        for _, _, message in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False):
            stamps.append(message.publish_time)
    return stamps


@pytest.mark.parametrize("chance", [1, 2, 3])
def test_kill_9_loses_at_most_the_newest_second(graph, chance):
    recorder = graph.record("/a", "-O", "log")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        with sending(publisher, a) as stamps:
            waiting.wait_until(lambda: len(stamps) > 700, "messages flow")
            threading.Event().wait(random.Random(chance).random())
            killed_at = time.time_ns()
            recorder.popen.kill()
            recorder.wait()
    found = readable_stamps(graph.folder / "log.mcap.active")
    due = [stamp for stamp in stamps if stamp < killed_at - KILLED_LOSS_S * 1e9]
    assert found[:len(due)] == due
    recovered = graph.jaka_bag("recover", "log.mcap.active", "-o", "whole.mcap")
    recovered.wait()
    assert len(content(graph.folder / "whole.mcap")["/a"]) >= len(due)


def test_a_killed_bag_recording_is_recovered_to_its_last_chunk(graph):
    recorder = graph.record("/a", "-O", "log.bag")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        with sending(publisher, a) as stamps:
            waiting.wait_until(lambda: len(stamps) > 700, "messages flow")
            killed_at = time.time_ns()
            recorder.popen.kill()
            recorder.wait()
    recovered = graph.jaka_bag("recover", "log.bag.active", "-o", "whole.bag")
    recovered.wait()
    due = [stamp for stamp in stamps if stamp < killed_at - KILLED_LOSS_S * 1e9]
    assert len(content(graph.folder / "whole.bag")["/a"]) >= len(due)


@contextlib.contextmanager
def small_disk(folder, size):
    """Provide a file system that can be filled in ``folder``, a tmpfs; yield False where that is not permitted."""
    folder.mkdir()
    mount = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=%d" % size, "jaka-test", str(folder)],
                           stderr=subprocess.PIPE)
    try:
        yield mount.returncode == 0
    finally:
        if mount.returncode == 0:
            subprocess.run(["umount", str(folder)], check=True)


def fill(graph, recorder, publisher, outlet):
    """Publish until the recorder gives up; return the number of messages sent."""
    number = 0
    deadline = time.monotonic() + waiting.WAIT
    while recorder.popen.poll() is None:
        assert time.monotonic() < deadline, "the recorder goes on: %s" % recorder.output
        number += 1
        publisher.publish(outlet, twist_frame(number))
        if number % 500 == 0:
            threading.Event().wait(0.01)
    return number


@pytest.mark.parametrize("suffix", ["mcap", "bag"])
@pytest.mark.parametrize("limit", ["disk", "file size"])
def test_a_full_disk_leaves_a_whole_file_and_code_1(graph, suffix, limit):
    size = 1500000
    with small_disk(graph.folder / "disk", size) as is_mounted:
        options = {}
        if limit == "file size" or not is_mounted:  # the same refusal by the system, without being root
            options["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        recorder = graph.record("/a", "-O", "disk/log." + suffix, "--no-compression", "-L", "0", "--chunksize", "64",
                                "--report", "report.json", **options)
        with graph.publisher("/source") as publisher:
            a = publisher.advertise("/a", twist_connection("/a"), False)
            with_subscribers(publisher, a)
            fill(graph, recorder, publisher, a)
        assert recorder.wait() == 1
        assert "error: " in recorder.output
        assert "full" in recorder.output or "largest size" in recorder.output
        log = content(graph.folder / "disk" / ("log." + suffix))["/a"]
        assert log == [twist_frame(n)[4:] for n in range(1, len(log) + 1)]
        assert len(log) * 100 > size // 4
        account = json.loads((graph.folder / "report.json").read_text())["topics"]["/a"]
        assert account["written"] == len(log)
        assert account["received"] == account["written"] + account["unwritten"] + account["overflowed"]
        assert os.listdir(str(graph.folder / "disk")) == ["log." + suffix]


def test_less_room_than_asked_for_is_refused_at_once(graph):
    refused = graph.jaka_bag("record", "/a", "-O", "log", "-L", "1000000G")
    assert refused.wait() == 1
    assert "the disk of log is full" in refused.output
    assert not list(graph.folder.glob("log*"))


def test_a_full_buffer_throws_away_counts_and_says_so(graph):
    recorder = graph.jaka_bag("record", "/a", "-O", "log", "-b", "2k", "-q", "--report", "report.json")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        for number in range(1, 5001):
            publisher.publish(a, twist_frame(number))
        assert recorder.stop() == 0
    account = json.loads((graph.folder / "report.json").read_text())["topics"]["/a"]
    log = content(graph.folder / "log.mcap")["/a"]
    assert account["received"] == 5000
    assert account["overflowed"] == 5000 - len(log) > 0
    assert account["missing"] == 0
    assert "LOST on /a" in recorder.output
    with open(str(graph.folder / "log.mcap"), "rb") as file:
        sequences = [record.sequence for record in StreamReader(file).records if hasattr(record, "sequence")]
    assert sequences == sorted(set(sequences))
    assert max(sequences) > len(log)  # the gaps show in the file itself


def test_a_burst_at_full_speed_is_recorded_whole(graph):
    recorder = graph.record("/a", "-O", "log", "--report", "report.json")
    with graph.publisher("/source") as publisher:
        a = publisher.advertise("/a", twist_connection("/a"), False)
        with_subscribers(publisher, a)
        for number in range(1, 50001):
            publisher.publish(a, twist_frame(number))
        assert recorder.stop(signal.SIGTERM) == 0
    assert content(graph.folder / "log.mcap")["/a"] == [twist_frame(n)[4:] for n in range(1, 50001)]
