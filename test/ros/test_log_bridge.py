"""Log records on their way to the screen and rosout: a failing record never ends the handler of the others."""
import ast
import io
import logging
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest
import rospy
from rosgraph_msgs.msg import Log

from jaka_ros_driver.background_log import QUEUE_LIMIT, Background
from jaka_ros_driver.ros import log_bridge
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.log_bridge import log_to_ros

WAIT = 10.0


class Kept(logging.Handler):
    """A stream that keeps texts; it raises where the test wants it, as a handler that does not guard its stream."""

    def __init__(self, refuses=lambda text: False):
        super().__init__()
        self.texts = []
        self._refuses = refuses

    def emit(self, record):
        text = self.format(record)
        if self._refuses(text):
            raise RuntimeError("no")
        self.texts.append(text)


class Screen(logging.Handler):
    """A screen handler like rospy's: it writes, and lets errors out."""

    def __init__(self, encoding):
        super().__init__()
        self.raw = io.BytesIO()
        self._stream = io.TextIOWrapper(self.raw, encoding=encoding, write_through=True)

    def emit(self, record):
        self._stream.write(self.format(record) + "\n")

    def lines(self):
        return self.raw.getvalue().decode("utf-8").splitlines()


def said(handler, *records):
    """Pass the records through a Background; each is the arguments of a log call."""
    background = Background(handler)
    logger = logging.Logger("test")
    logger.addHandler(background)
    for record in records:
        logger.warning(*record)
    assert background.drain(WAIT), "the thread has ended"


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
@pytest.mark.parametrize("text", ["half \ud800 of it", "\udcff", "\u8b66\u544a", "\x00\x1b"])
def test_no_text_ends_the_screen(encoding, text):
    screen = Screen(encoding)
    said(screen, ("before",), ("%s", text), ("after",))
    lines = screen.lines()
    assert (lines[0], lines[-1]) == ("before", "after") and len(lines) == 3, lines


def test_half_a_character_reaches_no_handler():
    kept = Kept()
    said(kept, ("a %s b", "\ud800"))
    assert kept.texts == ["a ? b"]


def test_a_handler_that_raises_goes_on_with_the_next_record():
    kept = Kept(lambda text: "bad" in text)
    said(kept, ("1",), ("bad",), ("2",), ("bad",), ("3",))
    assert kept.texts == ["1", "2", "3"]


def test_what_a_handler_cannot_write_it_gets_in_plain_letters():
    kept = Kept(lambda text: not text.isascii())
    said(kept, ("\u8b66",))
    assert kept.texts == [r"\u8b66"]


def test_a_message_that_does_not_fit_its_arguments_is_told_as_far_as_possible():
    kept = Kept()
    said(kept, ("%d", "x"), ("%s and %s", 1), ("next",))
    assert len(kept.texts) == 3 and "'%d' with ('x',)" in kept.texts[0] and kept.texts[2] == "next"


def test_a_traceback_with_half_a_character_is_written():
    screen = Screen("utf-8")
    background = Background(screen)
    logger = logging.Logger("test")
    logger.addHandler(background)
    try:
        raise ValueError("half \udfff")
    except ValueError:
        logger.exception("failed")
    assert background.drain(WAIT)
    lines = screen.lines()
    assert lines[0] == "failed" and lines[-1] == "ValueError: half ?"


# ---- the package's records ----

@pytest.fixture
def bridge(monkeypatch):
    """Return a function that begins to pass records on to these handlers of rospy; the test's end takes it back."""
    package = logging.getLogger("jaka_ros_driver")
    level, propagate, handlers = package.level, package.propagate, list(package.handlers)
    monkeypatch.setattr(logging, "lastResort", None)
    monkeypatch.setattr(log_bridge, "RosoutHandler", Kept)

    def begin(*of_rospy, file=None):
        """Begin; ``file``: the handler of rospy's log file, which is the root logger's."""
        monkeypatch.setattr(logging.getLogger("rosout"), "handlers", list(of_rospy))
        monkeypatch.setattr(logging.getLogger(), "handlers", [] if file is None else [file])
        return log_to_ros()
    yield begin
    package.setLevel(level)
    package.propagate, package.handlers = propagate, handlers


@pytest.mark.parametrize("file", [None, logging.NullHandler()])
def test_the_log_of_last_resort_has_a_thread_where_there_is_no_log_file(bridge, monkeypatch, file):
    monkeypatch.setattr(logging, "lastResort", logging.NullHandler())
    bridge(file=file)
    assert isinstance(logging.lastResort, Background) is (file is None)


def test_a_record_is_on_the_screen_and_in_the_log_file_once(bridge):
    screen, file = Kept(), Kept()
    drain = bridge(screen, file=file)
    logging.getLogger("jaka_ros_driver.ros.node").warning("the link is lost")
    assert drain(WAIT) and screen.texts == file.texts == ["the link is lost"]


@pytest.mark.parametrize("where", ["screen", "log file"])
def test_nobody_waits_for_a_handler_and_a_drain_is_complete_when_every_one_has_written(bridge, where):
    class Slow(logging.Handler):
        """A handler that writes only when the test lets it."""

        may_write = threading.Event()

        def emit(self, record):
            assert threading.current_thread() is not threading.main_thread(), "the caller waits for the disk"
            self.may_write.wait(WAIT)

    slow = Slow()
    drain = bridge(Kept(), slow) if where != "log file" else bridge(Kept(), file=slow)
    logging.getLogger("jaka_ros_driver.ros.node").warning("the link is lost")
    assert not drain(0.1)
    slow.may_write.set()
    assert drain(WAIT)


# ---- /rosout ----

@pytest.fixture
def rosout(monkeypatch):
    """Return a function that makes a logger of /rosout, and what is published there; text "bad" cannot be."""
    published = []

    def publish(message):
        if message.msg == "bad":
            raise ValueError("a defect")
        published.append(message)

    monkeypatch.setattr(log_bridge, "direct_publisher", lambda *_, **__: SimpleNamespace(publish=publish))
    monkeypatch.setattr(log_bridge, "get_topic_manager", lambda: SimpleNamespace(get_topics=lambda: {"/a"}))
    monkeypatch.setattr(rospy.Time, "now", classmethod(lambda cls: rospy.Time(7)))

    def make(is_without_topics=False):
        monkeypatch.setattr(rospy, "get_param", lambda name, default: is_without_topics)
        logger = logging.Logger("test")
        logger.addHandler(log_bridge.RosoutHandler())
        return logger, published
    return make


@pytest.mark.parametrize("is_without_topics", [True, False])
def test_a_line_on_rosout_has_level_moment_and_place_and_the_topics_where_wanted(rosout, is_without_topics):
    logger, published = rosout(is_without_topics)
    for level in (logging.DEBUG, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL, 25):
        logger.log(level, "a %s", "text")
    assert ERRANDS.drain(WAIT)
    assert [one.level for one in published] == [Log.DEBUG, Log.INFO, Log.WARN, Log.ERROR, Log.FATAL, Log.INFO]
    assert {(one.msg, one.header.stamp.secs, one.file, tuple(one.topics)) for one in published} == {
        ("a text", 7, "test_log_bridge.py", () if is_without_topics else ("/a",))}


def test_a_line_that_rosout_cannot_take_is_told_in_the_log_file_alone_and_the_next_one_comes(rosout, monkeypatch):
    logger, published = rosout()
    told = Kept()
    monkeypatch.setattr(logging.getLogger("rospy.rosout"), "handlers", [told])
    for text in ("bad", "good"):
        logger.warning(text)
    assert ERRANDS.drain(WAIT) and [one.msg for one in published] == ["good"]
    text, = told.texts
    assert "not on /rosout" in text and "a defect" in text


def test_lines_that_come_faster_than_they_are_published_take_bounded_memory(rosout):
    logger, published = rosout()
    may_go_on = threading.Event()
    ERRANDS.soon(lambda: may_go_on.wait(WAIT))
    for _ in range(3 * QUEUE_LIMIT):
        logger.warning("a line")
    assert ERRANDS.waiting <= QUEUE_LIMIT + 1
    may_go_on.set()
    assert ERRANDS.drain(WAIT) and QUEUE_LIMIT - 1 <= len(published) <= QUEUE_LIMIT + 1


# ---- /rosout, with a listener that reads nothing ----

NODE = """
import logging, socket, sys, threading, time, genpy, rospy
from io import BytesIO
from rosgraph.network import encode_ros_handshake_header
from rosgraph_msgs.msg import Log
from rospy.impl import tcpros_base
from jaka_ros_driver.ros.errands import ERRANDS
from jaka_ros_driver.ros.log_bridge import log_to_ros

def listener(name, limit=None):
    sock = socket.socket()
    if limit is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, limit)
    sock.connect(tcpros_base.get_tcpros_server_address())
    sock.sendall(encode_ros_handshake_header({"topic": "/rosout", "callerid": name, "type": Log._type,
                                              "md5sum": Log._md5sum}))
    size = int.from_bytes(sock.recv(4, socket.MSG_WAITALL), "little")
    sock.recv(size, socket.MSG_WAITALL)
    return sock

def read(sock):
    message = Log()
    size = int.from_bytes(sock.recv(4, socket.MSG_WAITALL), "little")
    return message.deserialize(sock.recv(size, socket.MSG_WAITALL))

sys.stdout = sys.stderr = open("/dev/null", "w")
rospy.init_node("talks", disable_signals=True, disable_rosout=True)
drain = log_to_ros()
log = logging.getLogger("jaka_ros_driver.ros.node")
log.warning("half \\ud800 of it")
drain(10.0)
latched = read(listener("/late"))
stands, reads = listener("/stands", 4096), listener("/reads")
read(reads)
got, reader = [], threading.Thread(target=lambda: [got.append(read(reads)) for _ in range(LINES)], daemon=True)
reader.start()
longest = 0.0
for number in range(LINES):
    began = time.monotonic()
    log.error("%d %s", number, 10000 * "x")
    longest = max(longest, time.monotonic() - began)
    if number % 20 == 0:
        ERRANDS.drain(10.0)
is_drained = ERRANDS.drain(10.0)
reader.join(20.0)
late = [read(stands)]
while not late[-1].msg.startswith("%d " % (LINES - 1)):
    late.append(read(stands))
print(dict(latched=[latched.msg, latched.level, latched.name, "/rosout" in latched.topics], longest=longest,
           drained=is_drained, levels=sorted({one.level for one in got}),
           reads=[int(one.msg.split(" ")[0]) for one in got], late=[one.msg.split(" ")[0] for one in late[1:]]),
      file=sys.__stdout__, flush=True)
rospy.signal_shutdown("the test ends it")
"""


def test_a_listener_of_rosout_that_stands_still_delays_nobody_and_gets_the_newest_lines(ros_node):
    count = 2000
    ended = subprocess.run([sys.executable, "-c", NODE.replace("LINES", str(count))], stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True, timeout=120)
    assert ended.returncode == 0, ended.stdout
    told = ast.literal_eval(ended.stdout.strip().splitlines()[-1])
    assert told["latched"] == ["half ? of it", 4, "/talks", True]
    assert told["drained"] and told["longest"] < 1.0
    assert told["levels"] == [8] and told["reads"] == list(range(count)), "the other listener has missed lines"
    newest = [int(number) for number in told["late"][-100:]]
    assert newest == list(range(count - 100, count)) and len(told["late"]) < count
