"""A recording session's end: what arrives while it ends belongs to it."""
import threading
from types import SimpleNamespace

import live_samples
import pytest
from everywhere import hangs

from jaka_bag.live import session as session_module
from jaka_bag.live.rolling_files import FileSettings, RollingFiles
from jaka_bag.live.session import RecordingSession
from jaka_bag.live.stream_account import drops_by_topic
from jaka_bag.live.topic_selection import TopicSelection
from jaka_bag.live.writer_thread import WriterThread


class Transport:
    """A transport whose one publisher answers only when the recording is being ended."""

    def __init__(self, session):
        self.session, self.names, self.connected = session, SimpleNamespace(node="/log"), []
        self.answered = threading.Event()
        self.master = SimpleNamespace(call=lambda method, *arguments: [])

    def links(self):
        if self.session.stop.is_set() and threading.current_thread().name != "graph-watch":
            self.answered.wait(10.0)  # as publishers are asked, which takes its time
        return list(self.connected)

    def poll(self, timeout):
        if self.session.stop.is_set():
            self.connected = [(3, "/a", "http://127.0.0.1:1")]
            self.answered.set()
        else:
            self.session.end("a signal")

    def resubscribe(self):
        return False

    def wake(self):
        pass

    close = wake


def test_a_publisher_that_is_connected_while_the_recording_ends_is_told_of():
    recorder = SimpleNamespace(start=lambda: None, finish=lambda: None, failure=None, streams=list, full_topics=set())
    told = []
    session = RecordingSession(recorder, TopicSelection(), lambda connection: True, print,
                               new_publishers=told.append)
    transport = Transport(session)
    session.run(lambda: transport, False)
    assert transport.connected and told == [transport.master]


@pytest.mark.parametrize("seconds", [[1000, 1001, 1002, 1, 2, 3, 4], [1000, 1006], [1, 2, 1, 2, 1, 2, 1, 2, 1, 2]],
                         ids=["anew", "forth", "again and again"])
def test_a_duration_of_a_clock_that_starts_anew_is_over_all_the_same(seconds):
    recorder = SimpleNamespace(start=lambda: None, finish=lambda: None, failure=None, streams=list, full_topics=set(),
                               clock=None)
    session = RecordingSession(recorder, TopicSelection(), lambda connection: True, print, duration_s=5.0)
    transport = Transport(session)
    transport.answered.set()
    left = list(seconds)
    transport.subscribe = lambda *arguments: None

    def poll(timeout):
        if left:
            recorder.clock = left.pop(0) * 10**9
        elif not session.stop.is_set():
            session.end("it goes on and on")
    transport.poll = poll
    session.run(lambda: transport, True)
    assert session.end_reason == "the time is over"


def test_a_topic_that_is_advertised_anew_with_another_type_has_lost_nothing(tmp_path, monkeypatch):
    uri, said = "http://mux:4000/", []
    counts = [990]
    monkeypatch.setattr(session_module, "ask_publishers", lambda uris, node, wait: {(uri, "/a"): counts[0]})
    writer = WriterThread(lambda: RollingFiles(FileSettings(tmp_path / "log"), {}, [], writer.streams, said.append), 0,
                          said.append, said.append)
    writer.start()
    session = RecordingSession(writer, TopicSelection(everything=True), lambda connection: True, said.append)
    transport = Transport(session)
    transport.answered.set()
    transport.poll = lambda timeout: None

    def send(connection, number):
        stream = writer.open_stream(connection, uri)
        for _ in range(number):
            writer.take(stream, 10**9, b"1234")
        session._drain(transport)
    old = live_samples.string_connection("/a")
    counts[0] = 10
    send(old, 10)
    counts[0] = 1000
    send(old._replace(datatype="std_msgs/Float32", md5sum="b" * 32), 1000)
    assert drops_by_topic(writer.streams())["/a"].describe() == "nothing lost"
    counts[0] = 7
    send(old, 5)
    writer.finish()
    assert drops_by_topic(writer.streams())["/a"].undelivered == 2, "the first is the one that is open again"


def a_session():
    recorder = SimpleNamespace(start=lambda: None, finish=lambda: None, failure=None, streams=list, full_topics=set())
    return RecordingSession(recorder, TopicSelection(), lambda connection: True, print)


@pytest.mark.parametrize("act", [lambda session: session.end("SIGTERM"), lambda session: session.stop.wait(0.01),
                                 lambda session: session.stop.set()], ids=["end", "wait", "set"])
def test_a_signal_that_comes_at_any_line_of_the_end_waits_for_nothing(act):
    sessions = []

    def begin():
        session = a_session()
        sessions.append(session)
        return lambda: act(session), lambda: session.end("SIGINT")

    assert hangs(begin) == []
    assert all(session.stop.is_set() for session in sessions[:-1]) and len(sessions) > 2


def test_the_watch_goes_on_after_odd_statistics(monkeypatch):
    asked = []

    def ask(uris, node, wait):
        asked.append(1)
        raise OverflowError("cannot convert float infinity to integer")
    monkeypatch.setattr(session_module, "ask_publishers", ask)
    monkeypatch.setattr(session_module, "_STATISTICS_PERIOD_S", 0.0)
    recorder = SimpleNamespace(start=lambda: None, finish=lambda: None, failure="no drain", streams=list,
                               full_topics=set())
    told = []
    session = RecordingSession(recorder, TopicSelection(), lambda connection: True, told.append)
    transport = Transport(session)
    transport.answered.set()
    transport.poll = lambda timeout: len(asked) < 2 and session.stop.wait(0.01) or len(asked) >= 2 and session.end("")
    patience = threading.Timer(20.0, session.end, ["patience"])
    patience.start()
    session.run(lambda: transport, False)
    patience.cancel()
    assert len(asked) >= 2
    assert len([text for text in told if "infinity" in text]) == 1, "it is said once"


def test_the_watch_goes_on_after_what_nobody_foresaw():
    recorder = SimpleNamespace(start=lambda: None, finish=lambda: None, failure=None, streams=list, full_topics=set())
    told, looks = [], []
    session = RecordingSession(recorder, TopicSelection(), lambda connection: True, told.append)
    transport = Transport(session)

    def resubscribe():
        looks.append(1)
        if len(looks) >= 2:
            session.end("a signal")
        raise ValueError("too many values to unpack")

    def poll(timeout):
        transport.answered.set()
        session.stop.wait(0.01)
    transport.resubscribe, transport.poll = resubscribe, poll
    patience = threading.Timer(20.0, session.end, ["patience"])
    patience.start()
    session.run(lambda: transport, False)
    patience.cancel()
    assert len(looks) >= 2
    assert len([text for text in told if "too many values" in text]) == 1, "it is said once"
