"""A recording session's end: what arrives while it ends belongs to it."""
import threading
from types import SimpleNamespace

from jaka_bag.live.session import RecordingSession
from jaka_bag.live.topic_selection import TopicSelection


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
