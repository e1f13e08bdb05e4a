"""Curves that are shortened and keep every spike; alarms that are published once, with their text and their end."""
import math

import pytest

from jaka_panel.record.alarms import KEPT, AlarmBook, event_of
from jaka_panel.record.hand_outputs import HandOutputs
from jaka_panel.record.history import Differences, History
from jaka_panel.record.moves import MoveBook


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


MOVES, RESTS = [0.0, 0.1] + [0.0] * 4, [0.0] * 6


def moves_of(*stretches):
    """Return a book, and what it told, after stretches of samples at 125 Hz: begin and end, s, and speeds, rad/s."""
    book, told = MoveBook(), []
    for begin, end, speeds in stretches:
        for n in range(int(round((end - begin) * 125))):
            told += book.sample(begin + 0.008 * n, speeds)
    return book, told


def test_a_motion_goes_from_its_first_sample_to_its_last_one():
    book, told = moves_of((0.0, 1.0, RESTS), (1.0, 2.0, MOVES), (2.0, 2.2, RESTS), (2.2, 3.0, MOVES), (3.0, 4.0, RESTS),
                          (4.0, 4.4, None), (4.4, 5.0, MOVES))
    first, second = book.all()
    assert first == {"n": 1, "s": 1.0, "to": 2.992, "owner": "", "lost": False}, "a pause of 0.2 s is within it"
    assert (second["n"], second["s"], second["to"]) == (2, 4.4, None), "and one goes on"
    assert [(one["n"], one["to"]) for one in told] == [(1, None), (1, 2.992), (2, None)]
    assert book.name("trajectory")[0]["owner"] == "trajectory" and book.name("trajectory") == [] == book.name("")
    assert book.all()[0]["owner"] == "", "who moves now has not moved it then"


def test_a_motion_that_is_not_seen_to_its_end_ends_with_the_last_sample():
    book, _ = moves_of((0.0, 1.0, MOVES))
    assert book.look(1.2) == []
    assert [(one["to"], one["lost"]) for one in book.look(1.4)] == [(0.992, True)] and book.look(1.5) == []
    book, _ = moves_of((0.0, 1.0, MOVES), (5.0, 6.0, MOVES))
    assert [(one["s"], one["to"], one["lost"]) for one in book.all()] == [(0.0, 0.992, True), (5.0, None, False)]


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


DIGITAL, ANALOG = ("cabinet", "digital", 1), ("tool", "analog", 0)


def reported(one=True, volts=2.5):
    """Return what status frames report: the second digital output of the cabinet, the first analog one of the tool."""
    return {"cabinet": {"do": [False, one], "ao": []}, "tool": {"do": [], "ao": [volts]}}


def marked():
    outputs = HandOutputs()
    outputs.set(DIGITAL, True, "a page", 10.0, 1000.0)
    outputs.set(ANALOG, 2.5, "another", 10.0, 1000.0)
    return outputs


def names(outputs):
    return [(one["bank"], one["signal"], one["index"]) for one in outputs.all()]


def test_an_output_that_was_set_by_hand_is_marked_until_the_controller_reports_another_value():
    outputs = marked()
    assert outputs.all()[0] == {"bank": "cabinet", "signal": "digital", "index": 1, "value": True, "wall": 1000.0,
                                "by": "a page"}
    assert not outputs.look(reported(False, 0.0), 9.9), "a frame from before"
    assert not outputs.look(reported(False, 0.0), 10.1), "one on its way when it was set"
    assert not outputs.look(reported(), 10.2) and not outputs.look(reported(volts=2.501), 10.3)
    assert outputs.look(reported(False), 10.4) and names(outputs) == [ANALOG]
    assert not outputs.look({}, 11.0) and names(outputs) == [ANALOG], "frames without that row say nothing of it"
    assert outputs.look(reported(volts=2.6), 12.0) and names(outputs) == []


def test_a_mark_that_the_controller_never_confirms_ends():
    outputs = marked()
    assert not outputs.look(reported(False), 11.9) and outputs.look(reported(False), 12.1)
    assert names(outputs) == [ANALOG]


def test_a_call_of_somebody_else_ends_the_mark_whatever_it_sets():
    outputs = marked()
    outputs.expect(DIGITAL, 20.0)
    assert not outputs.called(DIGITAL, True, 20.1), "the page's own"
    assert not outputs.called(("cabinet", "digital", 0), False, 20.2), "of another output"
    assert outputs.called(DIGITAL, True, 20.3) and names(outputs) == [ANALOG], "by a list of motions of this panel"
    outputs.expect(ANALOG, 21.0)
    assert outputs.called(ANALOG, False, 21.1) and names(outputs) == []
