"""Control between pages, and how many messages one may send."""
import logging

import pytest

from jaka_panel.authority.control import ANSWER_S, Asked, Control
from jaka_panel.authority.frames import FrameCounter
from jaka_panel.authority.rate_limiter import RateLimiter
from jaka_panel.pages import log_limit


def test_what_nobody_has_is_given_and_what_somebody_has_is_asked_for():
    control = Control()
    assert control.take("a", 0.0) and control.holder == "a"
    assert control.take("a", 1.0)
    assert not control.take("b", 2.0) and control.asked == Asked("b", 2.0 + ANSWER_S)
    assert not control.take("c", 3.0) and control.asked.page == "b", "who came first is asked about first"
    assert control.answer("b", True) is None and control.answer("c", True) is None, "only the holder answers"
    assert control.answer("a", False) == "b" and control.holder == "a" and control.asked is None
    assert control.answer("a", True) is None
    control.take("b", 4.0)
    assert control.answer("a", True) == "b" and control.holder == "b"


def test_a_holder_that_does_not_answer_loses_control():
    control = Control()
    control.take("a", 0.0)
    control.take("b", 5.0)
    assert not control.tick(5.0 + ANSWER_S - 0.1) and control.holder == "a"
    assert control.tick(5.0 + ANSWER_S) and control.holder == "b" and control.asked is None
    assert not control.tick(100.0)


def test_who_goes_holds_and_asks_for_nothing_any_more():
    control = Control()
    control.take("a", 0.0)
    control.take("b", 0.0)
    assert control.leave("b") and control.asked is None and control.holder == "a"
    assert not control.leave("b")
    control.take("b", 1.0)
    assert control.leave("a") and control.holder == "b", "who had asked gets it"
    assert control.leave("b") and control.holder is None


def test_a_rate_limit_is_spent_and_comes_back():
    limiter = RateLimiter(10.0, 5.0, 0.0)
    assert [limiter.spend(0.0) for _ in range(6)] == [True] * 5 + [False]
    assert limiter.spend(0.1) and not limiter.spend(0.1)
    assert [limiter.spend(100.0) for _ in range(6)] == [True] * 5 + [False]


def test_an_amount_is_spent_as_a_whole_or_not_at_all():
    limiter = RateLimiter(10.0, 5.0, 0.0)
    assert not limiter.spend(0.0, 6.0) and limiter.spend(0.0, 5.0) and not limiter.spend(0.0)
    assert limiter.spend(0.2, 2.0) and limiter.spend(0.2, 0.0) and not limiter.spend(0.2)


def frame(first, payload=b"", mask=True):
    length = (bytes([len(payload) | 0x80 * mask]) if len(payload) < 126
              else bytes([126 | 0x80 * mask]) + len(payload).to_bytes(2, "big") if len(payload) < 65536
              else bytes([127 | 0x80 * mask]) + len(payload).to_bytes(8, "big"))
    return bytes([first]) + length + bytes(4 * mask) + payload


TEXT, PING, BEGIN, FURTHER, LAST = 0x81, 0x89, 0x01, 0x00, 0x80


@pytest.mark.parametrize("piece", [1, 2, 3, 7, 64, 1000, 1000000])
def test_frames_are_counted_wherever_the_stream_is_cut(piece):
    frames = [frame(TEXT, b"x" * size, mask) for size in (0, 1, 125, 126, 300, 65535, 65536) for mask in (True, False)]
    frames += [frame(PING), frame(BEGIN, b"y" * 200), frame(PING, b"z"), frame(FURTHER, b"y" * 300)]
    stream, counter = b"".join(frames), FrameCounter()
    assert sum(counter.feed(stream[at:at + piece]) for at in range(0, len(stream), piece)) == len(frames)
    assert counter.unfinished == 500, "bytes of the message that goes on"
    assert counter.feed(frame(LAST, b"end")) == 1 and counter.unfinished == 0


def test_log_lines_beyond_the_limit_are_left_out_and_counted(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(log_limit.time, "monotonic", lambda: now[0])
    limit, written = log_limit.LogLimit(), []

    def log(text):
        record = logging.makeLogRecord({"msg": text})
        if limit.filter(record):
            written.append(record.getMessage())
    for _ in range(50):
        log("a request failed")
    assert len(written) == 20
    now[0] += 5.0
    log("a request failed")
    log("a request failed")
    assert written[20:] == ["a request failed (30 lines before were left out)"]
