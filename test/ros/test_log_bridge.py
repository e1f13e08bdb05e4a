"""Log records on their way to the screen and rosout: a failing record never ends the handler of the others."""
import io
import logging
import threading

import pytest

from jaka_ros_driver.background_log import Background
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


@pytest.mark.parametrize("where", ["screen or rosout", "log file"])
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
