"""The command jaka_bag serve: foreign viewers receive what is in the file; play, pause, seek and speed."""
import asyncio
import signal
import struct
import time
from typing import Dict, List

import pytest
import waiting
from command_places import command_of
from foxglove_clients import OLD, SDK, JsClient, RawViewer, Recorder, Served, control, data_of, serving, state_of
from log_samples import JOINTS, MODEL, STATES, Sample, in_order, state_log, states, text, write
from mcap.reader import make_reader

from jaka_bag.cli.main import main
from jaka_bag.containers.registry import open_log
from jaka_bag.live.log_source import LogSource
from jaka_bag.messages.connection import Connection

S = 10**9


def with_content(samples):
    """Return (topic, log time, bytes) of each message, in the order of the log."""
    return [(sample.connection.topic, sample.time, sample.data) for sample in samples]


def by_topic(messages) -> Dict[str, List]:
    result = {}
    for topic, moment, data in messages:
        result.setdefault(topic, []).append((moment, data))
    return result


@pytest.fixture(scope="module")
def samples():
    return in_order(state_log(2.0))


@pytest.fixture
def shown(running):
    """Return a function that serves logs in this process: ``shown(*paths, speed=1.0, ...)`` gives the server."""
    from jaka_foxglove.log_playback import LogPlayback, PlaybackOptions

    def show(*paths, exclude=(), **options):
        logs = LogSource([str(path) for path in paths], (), (), exclude, bytes, True)
        return running(LogPlayback("logs", logs, PlaybackOptions(**options), print))
    return show


# ---- foreign clients ----

def test_pymcap_records_the_file_byte_by_byte(samples, tmp_path):
    log = write(tmp_path / "log.bag", samples)
    with serving("-r", "10", str(log)) as served:
        Recorder(served.port, tmp_path / "out.mcap", len(samples)).wait()
        assert served.stop(signal.SIGTERM) == 0, served.lines
    with open(str(tmp_path / "out.mcap"), "rb") as file:
        found = [(schema, channel, message) for schema, channel, message in make_reader(file).iter_messages()]
    assert by_topic((channel.topic, message.log_time, message.data) for _, channel, message in found) == by_topic(
        with_content(samples))
    kinds = {channel.topic: (channel.message_encoding, schema.name, schema.encoding, schema.data.decode())
             for schema, channel, _ in found}
    assert kinds == {c.topic: ("ros1", c.datatype, "ros1msg", c.definition) for c in {s.connection for s in samples}}


@pytest.mark.parametrize("subprotocol", [SDK, OLD])
def test_the_client_of_ws_protocol_gets_the_file_byte_by_byte(samples, tmp_path, subprotocol):
    log = write(tmp_path / "log.mcap", samples)
    with serving("-r", "10", str(log)) as served, JsClient(served.port, subprotocol) as client:
        messages = client.messages(len(samples))
        assert client.values("open") == [subprotocol]
        assert subprotocol == SDK or not client.values("error"), "it does not know the state of a playback"
        assert by_topic(messages) == by_topic(with_content(samples))
        assert client.wait("serverInfo")[0]["capabilities"] == ["playbackControl", "time"]
        channels = {channel["topic"]: channel for channel in client.wait("advertise")[0]}
        for connection in {sample.connection for sample in samples}:
            assert channels[connection.topic]["schema"] == connection.definition
            assert (channels[connection.topic]["encoding"], channels[connection.topic]["schemaEncoding"]) == (
                "ros1", "ros1msg")
        moments = [int(moment) for moment in client.values("time")]
        assert moments == sorted(moments) and moments[0] >= samples[0].time
        assert served.stop(signal.SIGINT) == 0


def test_messages_of_other_encodings_are_shown_as_they_are(shown, tmp_path):
    idl = Connection("/other", "pkg/msg/Thing", "", "int32 x\n", encoding="cdr", schema_encoding="ros2msg")
    note = Connection("/note", "Note", "", '{"type":"object"}', encoding="json", schema_encoding="jsonschema")
    samples = [Sample(idl, S + i, b"\0\1\0\0" + struct.pack("<i", i)) for i in range(5)]
    samples += [Sample(note, S + 10 + i, b'{"x":%d}' % i) for i in range(5)]
    with JsClient(shown(write(tmp_path / "log.mcap", samples)).port, OLD) as client:
        assert by_topic(client.messages(10)) == by_topic(with_content(samples))
        assert {(c["topic"], c["encoding"], c["schemaName"], c["schemaEncoding"], c["schema"])
                for c in client.wait("advertise")[0]} == {
            ("/other", "cdr", "pkg/msg/Thing", "ros2msg", "int32 x\n"), ("/note", "json", "Note", "jsonschema",
                                                                      '{"type":"object"}')}


def test_several_files_are_shown_as_one(shown, samples, tmp_path):
    half = len(samples) // 2
    first, second = write(tmp_path / "a.bag", samples[:half]), write(tmp_path / "b.mcap", samples[half:])
    server = shown(second, first, exclude=["/model"], speed=20.0)
    wanted = [sample for sample in samples if sample.connection != MODEL]
    with Watching(server) as watching:
        watching.count(len(wanted))
        assert by_topic(watching.messages) == by_topic(with_content(wanted))


# ---- play, pause, seek, speed ----

class Watching:
    """A viewer of one served log, with all that it was sent.

    Attributes:
        messages: (topic, log time, ns, bytes) since the last ``since``.
    """

    def __init__(self, server, *topics):
        self.viewer = RawViewer(server.port)
        info = self.viewer.text("serverInfo")
        self.begin, self.end = (info[name]["sec"] * S + info[name]["nsec"] for name in ("dataStartTime", "dataEndTime"))
        self.names = {c["id"]: c["topic"] for c in self.viewer.text("advertise")["channels"]}
        self.viewer.subscribe(*[n for n, topic in self.names.items() if not topics or topic in topics])
        self.messages = []
        self.at = []
        self._requests = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.viewer.close()

    def until(self, wanted):
        """Keep messages until ``wanted`` makes something of one."""
        def look(message):
            data = data_of(message)
            if data is not None:
                self.messages.append((self.names[data[0]], data[1], data[2]))
                self.at.append(time.monotonic())
            return wanted(message)
        return self.viewer.until(look)

    def count(self, number):
        """Keep messages until there are so many."""
        if len(self.messages) < number:
            self.until(lambda message: True if len(self.messages) >= number else None)

    def state(self, state):
        """Return the next state of this kind."""
        return self.until(lambda m: state_of(m) if state_of(m) and state_of(m).state == state else None)

    def ask(self, is_playing, speed=1.0, seek=None):
        """Return the answer to a control; messages are kept anew from there on."""
        self._requests += 1
        request = "request %d" % self._requests
        self.viewer.send(control(is_playing, speed, seek, request))
        answer = self.until(lambda m: state_of(m) if state_of(m) and state_of(m).request == request else None)
        if seek is not None:
            self.messages, self.at = [], []
        return answer


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    """Write a log of 20 s, in many chunks, with something rare at the begin."""
    samples = in_order(state_log(20.0, rate=25) + [states(1_700_000_000 * S + 1, 9, 9, 9, 9)])
    return write(tmp_path_factory.mktemp("served") / "long.mcap", samples, chunk_size=2000), samples


def expected(samples, begin, end):
    return by_topic(entry for entry in with_content(samples) if begin <= entry[1] <= end)


def test_a_pause_loses_nothing_and_sends_nothing(shown, long_log):
    path, samples = long_log
    with Watching(shown(path, speed=4.0)) as watching:
        watching.count(200)
        paused = watching.ask(False, 4.0)
        assert paused.state == 1 and not paused.did_seek
        time.sleep(0.3)  # what must not come has no other sign
        still = watching.ask(False, 20.0)
        assert still.time == paused.time and still.speed == 20.0
        assert max(moment for _, moment, _ in watching.messages) <= paused.time
        assert watching.ask(True, 20.0).state == 0
        watching.count(len(samples))
        assert by_topic(watching.messages) == by_topic(with_content(samples))
        end = watching.state(3)
        assert end.time == watching.end


def test_a_seek_shows_what_was_newest_and_goes_on_from_there(shown, long_log):
    path, samples = long_log
    with Watching(shown(path, is_paused=True)) as watching:
        target = watching.begin + 12 * S + 345
        for goal in (target, target - 5 * S, target):  # forward, back, and forward again
            answer = watching.ask(False, 1.0, goal)
            assert (answer.state, answer.time, answer.did_seek) == (1, goal, True)
            newest = {}
            for topic, moment, data in with_content(samples):
                if moment < goal:
                    newest[topic] = (moment, data)
            watching.count(len(newest))
            assert by_topic(watching.messages) == {topic: [entry] for topic, entry in newest.items()}
        watching.messages.clear()
        watching.ask(True, 20.0)
        rest = expected(samples, target, watching.end)
        watching.count(sum(map(len, rest.values())))
        assert by_topic(watching.messages) == rest


def test_seeks_beyond_the_log_and_play_at_its_end(shown, long_log):
    path, samples = long_log
    with Watching(shown(path, is_paused=True)) as watching:
        assert watching.ask(False, 1.0, 5).time == watching.begin
        assert watching.ask(False, 1.0, 1 << 62).time == watching.end
        watching.ask(True, 100.0)
        watching.state(3)
        again = watching.ask(True, 100.0)  # from the end: from the beginning
        assert (again.state, again.did_seek, again.time) == (0, True, watching.begin)
        watching.messages.clear()
        watching.count(len(samples))
        assert by_topic(watching.messages) == by_topic(with_content(samples))


@pytest.mark.parametrize("steps", range(4))
def test_it_ends_when_the_last_viewer_goes_at_that_moment(samples, tmp_path, steps):
    # ``steps`` of the loop pass between the two. Before Python 3.12 ``asyncio.wait_for`` can lose a cancel that comes
    # then.
    from jaka_foxglove.log_playback import LogPlayback, PlaybackOptions
    log = LogSource([str(write(tmp_path / "log.bag", samples))], (), (), (), bytes, True)

    async def run():
        playback = LogPlayback("logs", log, PlaybackOptions(is_paused=True), print)
        await playback.open()
        playback.want(frozenset(playback.channels))
        for _ in range(10):
            await asyncio.sleep(0)  # a turn of the loop
        playback.want(frozenset())
        for _ in range(steps):
            await asyncio.sleep(0)
        await asyncio.wait([asyncio.ensure_future(playback.close())], timeout=waiting.WAIT)
        assert playback._player.done()
    asyncio.run(run())


@pytest.mark.parametrize("speed", [2.0, 10.0])
def test_the_speed_is_the_one_that_is_asked_for(shown, long_log, speed):
    with waiting.StallWatch() as host, Watching(shown(long_log[0], is_paused=True)) as watching:
        before = time.monotonic()
        watching.ask(True, speed, watching.begin + S)
        watching.count(4 + int(75 * speed * 0.8))  # 75 messages in a second of the log
        in_log = (watching.messages[-1][1] - watching.begin) / S - 1.0
        assert watching.at[-1] - before > in_log / speed - 0.05, "faster than asked for"
        assert host.between(before, watching.at[-1]) < in_log / speed + 3.0


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_speed_that_is_none_is_refused(shown, long_log, speed):
    with Watching(shown(long_log[0], is_paused=True)) as watching:
        watching.viewer.send(control(True, speed))
        assert "cannot be played" in watching.viewer.text("status")["message"]
        assert watching.ask(False).state == 1


def test_all_viewers_see_one_playback_and_a_late_one_what_was_newest(shown, long_log):
    path, samples = long_log
    server = shown(path, is_paused=True)
    with Watching(server) as first:
        target = first.begin + 7 * S
        first.ask(False, 1.0, target)
        first.count(4)
        with Watching(server, JOINTS.topic) as second:
            second.count(1)
            newest = [entry for entry in with_content(samples) if entry[0] == JOINTS.topic and entry[1] <= target][-1]
            assert second.messages == [newest]
            assert second.ask(False, 3.0).speed == 3.0
            assert first.state(1).speed == 3.0


def test_it_stands_still_while_nobody_watches(shown, long_log):
    server = shown(long_log[0], speed=20.0)
    with Watching(server) as watching:
        watching.count(50)
    source = server._source

    def position():
        return source._clock.position(time.monotonic())

    waiting.wait_until(lambda: not source._topics and position() == position(), "it is noticed that nobody watches")
    stood_at, sent_to = position(), source._sent_to
    time.sleep(0.3)  # what must not come has no other sign
    assert position() == stood_at
    with Watching(server) as watching:
        watching.count(10)
        assert sorted(moment for _, moment, _ in watching.messages)[4] > sent_to


def test_in_a_loop_every_round_is_whole(shown, tmp_path):
    samples = in_order(state_log(0.5))
    with Watching(shown(write(tmp_path / "log.bag", samples), is_looping=True, speed=5.0)) as watching:
        watching.count(3 * len(samples))
        rounds = by_topic(watching.messages[:3 * len(samples)])
        assert rounds == {topic: 3 * entries for topic, entries in by_topic(with_content(samples)).items()}


def test_the_file_is_read_by_its_index_not_loaded(tmp_path):
    big = Connection("/big", "std_msgs/String", "", "string data\n")
    megabyte = text("x" * 1_000_000)
    samples = [one for i in range(150) for one in (Sample(big, S + i * S // 10, megabyte),
                                                   states(S + i * S // 10 + 1, i, 0, 0, 0))]
    path = write(tmp_path / "big.bag", samples, chunk_size=1_000_000)

    def peak(process):
        return int(open("/proc/%d/status" % process.pid).read().split("VmHWM:")[1].split()[0]) * 1024

    with serving("--pause", str(path)) as served:
        before = peak(served.process)
        with Watching(served, STATES.topic) as watching:
            for tenth in (140, 30, 110):
                watching.ask(False, 1.0, S + tenth * S // 10 + 1)
                watching.count(2)  # the newest before, and that of the moment itself
                assert struct.unpack_from("<h", watching.messages[-1][2])[0] == tenth
        assert peak(served.process) - before < 60e6, "150 MB of messages are in the file"


def test_a_damaged_chunk_is_told_and_ends_the_playback(shown, long_log, tmp_path):
    with open_log(long_log[0]) as log:
        chunk = log.index.chunks[len(log.index.chunks) // 3]
    raw = bytearray(long_log[0].read_bytes())
    raw[chunk.position + 100:chunk.position + 200] = bytes(100)  # its data, and not the index behind it
    (tmp_path / "damaged.mcap").write_bytes(raw)
    with RawViewer(shown(tmp_path / "damaged.mcap", speed=100.0).port) as viewer:
        viewer.subscribe(*[c["id"] for c in viewer.text("advertise")["channels"]])
        assert "jaka_bag recover" in viewer.text("status")["message"]
        viewer.until(lambda m: state_of(m) if state_of(m) and state_of(m).state == 3 else None)


@pytest.mark.parametrize("words", [["-r", "0.001"], ["--allow-origin", "localhost"], ["--max-viewers", "0"]])
def test_usage_errors_are_one_line(words, long_log, capsys):
    assert main(["serve", str(long_log[0]), *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_nothing_to_show_and_no_file_are_errors(long_log, capsys):
    assert main(["serve", str(long_log[0]), "-t", "/none"]) == 1
    assert main(["serve", "none.bag"]) == 1
    assert capsys.readouterr().err.count("error:") == 2


def test_an_address_beyond_this_machine_is_said(long_log):
    command = [*command_of("jaka_bag"), "serve", "--port", "0", "--host", "0.0.0.0", str(long_log[0])]
    with Served(*command) as served:
        assert any("everybody who reaches this port sees these logs" in line for line in served.lines)
        with RawViewer(served.port) as viewer:
            assert viewer.text("serverInfo")
