"""Curves that are shortened and keep every spike; alarms that are published once, with their text and their end."""
import math

import pytest

from jaka_panel.record.alarms import KEPT, AlarmBook, event_of
from jaka_panel.record.history import Differences, History


def test_a_spike_is_never_lost():
    history = History()
    for n in range(5000):
        spike = 9.0 if n == 3210 else -9.0 if n == 777 else math.sin(0.001 * n)
        history.add(0.008 * n, ([spike] + [0.0] * 5, None if n % 3 else [0.1] * 6, None))
    curve = history.shortened("q", 0.0, 40.0, 40)
    assert len(curve["s"]) == 40 and max(curve["max"][0]) == 9.0 and min(curve["min"][0]) == -9.0
    assert curve["max"][0].index(9.0) == int(3210 * 0.008)
    assert history.shortened("dq", 0.0, 40.0, 40)["max"][2] == [0.1] * 40
    assert set(history.shortened("e", 0.0, 40.0, 40)["min"][2]) == {None}
    assert history.shortened("q", 50.0, 60.0, 10)["s"] == []


def test_no_part_of_a_curve_reaches_over_a_gap():
    history = History()
    for n in range(1000):
        if not 400 < n < 450 and n != 600:  # 0.4 s without a sample, and one that is lost
            history.add(0.008 * n, ([float(n)] * 6, None, None))
    for buckets in (1, 7, 800):
        curve = history.shortened("q", 0.0, 8.0, buckets)
        between = [(a, b) for a, b in zip(curve["last"], curve["s"][1:]) if b - a > 0.3]
        assert between == [(3.2, 3.6)], buckets
        assert all(begin <= last for begin, last in zip(curve["s"], curve["last"]))
        assert len(curve["s"]) == len(curve["min"][5]) == len(curve["max"][5]) <= buckets + 1
        assert not any(a < 3.3 < b for a, b in zip(curve["s"], curve["last"])), buckets


def test_what_is_old_is_overwritten():
    history = History()
    for n in range(80000):
        history.add(0.008 * n, ([float(n)] * 6, None, None))
    curve = history.shortened("q", 0.0, 640.0, 1)
    assert curve["min"][0] == [5000.0] and curve["max"][0] == [79999.0]


def test_speeds_from_positions():
    speeds = Differences()
    assert speeds.of(0.0, [0.0] * 6) is None
    assert speeds.of(0.01, [0.01] * 6) == pytest.approx([1.0] * 6)
    assert speeds.of(5.0, [0.0] * 6) is None, "after a pause"


def test_an_event_is_one_alarm_with_its_text_and_its_end():
    book = AlarmBook()
    (alarm,) = book.event(10.0, 0x10, "", True)
    assert (alarm["code"], alarm["text"], alarm["until"], alarm["level"]) == ("0x10", "", None, "error")
    assert book.event(10.1, 0x10, "", True) == []
    (told,) = book.event(11.0, 0x10, "emergency stop", True)
    assert told["n"] == alarm["n"] and told["text"] == "emergency stop"
    ended, new = book.event(12.0, 0x20, "other", False)
    assert (ended["n"], ended["until"]) == (alarm["n"], 12.0) and new["level"] == "warning"
    (ended,) = book.event(13.0, 0, "", False)
    assert ended["until"] == 13.0 and book.event(14.0, 0, "", False) == []


def test_notes_that_repeat_are_one_and_only_the_newest_are_kept():
    book = AlarmBook()
    assert book.note(1.0, "info", "x", "panel") and not book.note(2.0, "info", "x", "panel")
    assert book.note(9.0, "info", "x", "panel")
    for n in range(2 * KEPT):
        book.note(10.0, "info", str(n), "driver")
    assert len(book.all()) == KEPT and book.all()[-1]["text"] == str(2 * KEPT - 1)


@pytest.mark.parametrize("text, event", [("0x10F0005 drives off", (0x10F0005, "drives off")), ("0x0 ", (0, "")),
                                         ("", (0, "")), ("none", (0, ""))])
def test_an_event_as_the_diagnostics_have_it(text, event):
    assert event_of(text) == event
