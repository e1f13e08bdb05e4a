"""A file of the black box that goes on from another one, without a network: it can be read alone."""
from types import SimpleNamespace

from live_samples import string_connection

from jaka_bag.containers.registry import open_log, read_index, read_metadata
from jaka_bag.containers.time_order import messages_of
from jaka_bag.live.rolling_files import FileSettings, RollingFiles
from jaka_bag.live.stream_account import PublisherStream
from jaka_blackbox.files import Keep
from jaka_blackbox.recorder import BlackBox, Window
from jaka_blackbox.triggers import Trigger

S = 10**9
WINDOW = Window(100.0, 100.0, 1 << 20)


class Bench:
    """A black box whose clock and messages are the test's."""

    def __init__(self, folder, keep):
        self.folder, self.now, self.said = folder, 1000.0, []
        self.streams = []
        self.box = BlackBox(folder, WINDOW, SimpleNamespace(look=lambda connection, payload: []), self.open_file,
                            lambda: self.streams, lambda: self.now, lambda: int(self.now * S), self.said.append, keep,
                            lambda files: None, lambda path: None)

    def open_file(self, stem, drops):
        settings = FileSettings(stem, compression="none", fsync_s=0.0, chunk_bytes=1000)
        return RollingFiles(settings, {}, [], lambda: self.streams, self.said.append, drops)

    def stream(self, topic, latching=False):
        stream = PublisherStream(string_connection(topic)._replace(latching=latching), "http://n/")
        self.streams.append(stream)
        return stream

    def send(self, stream, payload):
        self.now += 0.01
        self.box.add(stream, int(self.now * S), int(self.now * S), payload)


def read(path):
    with open_log(path) as log:
        messages = [(one.connection.topic, bytes(one.data), one.log_time) for one in messages_of(log)]
    index = read_index(path)
    facts = [read_metadata(index, entry) for entry in index.metadata if entry.name == "jaka_bag.trigger"]
    return messages, facts


def test_each_continued_file_has_the_latched_messages_and_no_memory_of_its_own(tmp_path):
    bench = Bench(tmp_path, Keep(0, 40000))
    fixed, other = bench.stream("/tf_static", True), bench.stream("/other")
    bench.send(fixed, b"first")
    for number in range(40):  # in memory before the trigger, and more than one file takes
        bench.send(other, b"%01000d" % number)
    bench.send(fixed, b"second")
    bench.box.trigger(Trigger("error", "", ""))
    bench.box.tick()
    for number in range(40, 60):
        bench.send(other, b"%01000d" % number)
    bench.box.close()
    assert len(bench.box.finished) > 4
    found = sorted(map(read, tmp_path.glob("*.mcap")), key=lambda one: one[0][0][2])  # --keep has removed the oldest
    assert len(found) >= 2
    numbers = []
    for messages, facts in found:
        latched = [data for topic, data, _ in messages if topic == "/tf_static"]
        assert latched and latched == sorted(latched), "the newest at each moment, and no later one before it"
        assert messages[0][0] == "/tf_static" and messages[0][2] <= messages[1][2]
        assert facts[0]["kind"] == "continued" and float(facts[0]["remembered_s"]) == 0.0
        numbers += [int(data) for topic, data, _ in messages if topic == "/other"]
    assert numbers == list(range(numbers[0], 60)), "none twice, none missing"
    assert [data for topic, data, _ in found[-1][0] if topic == "/tf_static"] == [b"second"]


def test_latched_messages_of_several_publishers_begin_each_file_in_their_order(tmp_path):
    bench = Bench(tmp_path, Keep(0, 80000))
    first, second, other = bench.stream("/mode", True), bench.stream("/mode", True), bench.stream("/other")
    for stream, payload in ((first, b"1"), (second, b"2"), (first, b"3")):
        bench.send(stream, payload)
    bench.now += 200.0  # they are no longer in memory
    bench.send(other, b"x")
    bench.box.trigger(Trigger("error", "", ""))
    bench.box.tick()
    for number in range(30):
        bench.send(other, b"%01000d" % number)
    bench.send(second, b"4")
    for number in range(30):
        bench.send(other, b"%01000d" % number)
    bench.box.close()
    found = sorted((read(path)[0] for path in tmp_path.glob("*.mcap")), key=lambda one: one[0][2])
    assert len(found) >= 3
    modes = [[data for topic, data, _ in messages if topic == "/mode"] for messages in found]
    assert modes[0][:2] == modes[1][:2] == [b"2", b"3"] and modes[-1][-2:] == [b"3", b"4"]


def test_latched_messages_that_fill_a_file_do_not_begin_the_next_for_ever(tmp_path):
    bench = Bench(tmp_path, Keep(0, 4000))
    fixed, other = bench.stream("/tf_static", True), bench.stream("/other")
    bench.send(fixed, b"x" * 5000)
    bench.box.trigger(Trigger("error", "", ""))
    bench.box.tick()
    for number in range(3):
        bench.send(other, b"%d" % number)
    bench.box.close()
    assert 2 <= len(bench.box.finished) <= 6 and bench.box.failures == 0
