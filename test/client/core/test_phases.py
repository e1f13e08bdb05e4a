"""The table of custody's phases: complete, true on the page, and without a way to free an arm that may move."""
import re
from pathlib import Path

import pytest
from stories import Story

from jaka_ros_driver.client.core.foreign_motion import LeftBehind, LeftMotion
from jaka_ros_driver.client.core.phases import TRANSITIONS, Event, Phase, transition

PAGE = Path(__file__).resolve().parents[3] / "docs" / "architecture.md"
ROWS = [(phase, event, row) for phase, events in TRANSITIONS.items() for event, row in events.items()]


def written():
    """Return the table as the page shows it."""
    def effect(phase, event):
        row = TRANSITIONS[phase].get(event)
        return "" if row is None else " ignored" if row.is_ignored else " `%s`" % row.to.name
    lines = ["| event |" + "".join(" `%s` |" % phase.name for phase in Phase), "|---|" + "---|" * len(Phase)]
    lines += ["| `%s` |" % event.name + "".join("%s |" % (effect(phase, event) or " ") for phase in Phase)
              for event in Event]
    return "\n".join(lines)


def test_the_page_shows_the_table():
    shown = re.search(r"<!-- phases of custody -->\n(.*?)\n<!-- end -->", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert shown.group(1) == written()


def test_every_phase_and_every_event_is_used():
    assert set(TRANSITIONS) == set(Phase)
    assert {event for _, event, row in ROWS if not row.is_ignored} == set(Event)
    assert all(row.meaning for _, _, row in ROWS)


def test_an_event_that_is_ignored_changes_no_phase():
    assert [(phase, event) for phase, event, row in ROWS if row.is_ignored and row.to is not phase] == []


def test_the_arm_is_free_again_only_by_evidence_of_rest_or_where_nothing_was_sent():
    assert {(phase, event) for phase, event, row in ROWS if row.to is Phase.FREE and phase is not Phase.FREE} == {
        (Phase.HELD, Event.NOT_SENT), (Phase.HELD, Event.FINISH),
        (Phase.SETTLING, Event.AT_REST), (Phase.STOPPING, Event.AT_REST)}


def test_whatever_stops_a_motion_leads_to_a_stop_and_never_back():
    for event in (Event.STOP, Event.STOP_CALL, Event.LINK_LOST, Event.MOVES_ON):
        assert {TRANSITIONS[phase][event].to for phase in Phase if phase is not Phase.FREE
                and event in TRANSITIONS[phase]} == {Phase.STOPPING}
    assert {row.to for row in TRANSITIONS[Phase.STOPPING].values()} == {Phase.STOPPING, Phase.FREE}


@pytest.mark.parametrize("phase, event", [
    (phase, event) for phase in Phase for event in Event if event not in TRANSITIONS[phase]])
def test_an_event_that_cannot_happen_is_an_error(phase, event):
    with pytest.raises(AssertionError, match=re.escape(event.value)):
        transition(phase, event)


def test_custody_asks_the_table():
    story = Story()
    left = LeftBehind(LeftMotion("a jog", None, 0.0, 1))
    story.core.custody.take_over(left, story.now)
    with pytest.raises(AssertionError, match=Phase.STOPPING.value):
        story.core.custody.take_over(left, story.now)
    story.core.custody.finish(story.now)
    assert not story.core.is_free and story.core.custody.must_stop
