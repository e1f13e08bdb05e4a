"""A black box under ``/use_sim_time``, without a network: messages age by the host's clock."""
import argparse
import contextlib
import struct
from types import SimpleNamespace

import pytest
from live_samples import string_connection, wait_until

from jaka_bag.cli.record import LogRecording
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_blackbox.cli.record import NODE, Assembly, add_arguments, check

PATIENCE_S = 15.0


class Bench:
    """A recording with a black box, as the command line makes it, whose messages are the test's."""

    def __init__(self, folder):
        parser = argparse.ArgumentParser()
        add_arguments(parser)
        args = parser.parse_args(["-a", "--black-box", str(folder), "--before", "5s", "--after", "0.2s"])
        check(args)
        self.folder, self.said = folder, []
        console = SimpleNamespace(always=self.said.append, say=self.said.append)
        recording = LogRecording(args, NODE, console)
        self.assembly = Assembly(recording)
        recording.prepare(self.assembly.open, self.assembly.selection(), clock_wait_s=0.1)
        self.writer = recording.writer
        self.writer.is_simulated_time = True
        self.writer.start()
        self.stream = self.writer.open_stream(string_connection("/t"), "http://n/")
        self.clock_stream = self.writer.open_stream(string_connection("/clock"), "http://n/", is_wanted=False)

    def send(self, payload=b"x"):
        self.writer.take(self.stream, 10**9, payload)

    def clock(self, seconds):
        self.writer.take(self.clock_stream, 10**9, struct.pack("<II", seconds, 0))

    def wait_for_file(self):
        wait_until(lambda: list(self.folder.glob("*.mcap")), "the file is finished", PATIENCE_S)
        (path,) = self.folder.glob("*.mcap")
        with open_log(path) as log:
            return [bytes(message.data) for message in messages_of(log)]


@pytest.fixture
def bench(tmp_path):
    made = Bench(tmp_path)
    with contextlib.ExitStack() as end:
        end.callback(made.writer.finish)
        yield made


def test_a_file_is_written_where_no_clock_ever_comes(bench):
    bench.send()
    wait_until(lambda: bench.stream.received and not bench.writer._queue, "it is taken over", PATIENCE_S)
    bench.assembly.on_signal()
    assert bench.wait_for_file() == [b"x"]


@pytest.mark.parametrize("last", [None, 0], ids=["it stops", "it starts anew"])
def test_a_clock_that_stops_or_starts_anew_leaves_no_file_open(bench, last):
    bench.clock(1000)
    bench.send()
    wait_until(lambda: not bench.writer._queue, "it is taken over", PATIENCE_S)
    bench.assembly.on_signal()
    if last is not None:
        bench.clock(last)
    assert bench.wait_for_file() == [b"x"]
