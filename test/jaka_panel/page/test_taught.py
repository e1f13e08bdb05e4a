"""Teaching and the cell's data in a real browser: points to a frame, kept for the cell, set on the controller."""
import json
import time

import pytest
from fake_panel import ARM, HOME
from waiting import eventually

from jaka_panel.teach.user_frame import CannotTeach, user_frame

PLACES = [[0.4, 0.1, 0.2], [0.6, 0.1, 0.2], [0.4, 0.3, 0.2], [0.5, 0.2, 0.2008]]


def until(holds, what):
    assert eventually(holds), what


def nothing_is_sent(panel, kind):
    time.sleep(0.3)  # what must not come has no other sign; it would come at once
    return not panel.sent(kind)


def teach(arguments):
    """Answer as the panel does."""
    try:
        frame = user_frame(arguments["points"])
    except CannotTeach as error:
        return {"ok": False, "message": str(error)}
    return {"data": {"p": frame.position, "r": frame.rotation_vector, "residual": frame.residual, "turn": frame.turn}}


def test_a_frame_is_taught_kept_and_set_after_a_question(panel, open_page):
    places = [PLACES[0], [0.402, 0.1, 0.2], *PLACES[1:]]
    panel.answers["teach_user_frame"] = teach
    panel.answers["present_pose"] = lambda arguments: {"data": {
        "q": HOME, "tool": {"p": places.pop(0), "r": [0, 0, 0]}, "flange": {"p": [0, 0, 0], "r": [0, 0, 0]},
        "model": "zu7", "tool_number": 1, "user_number": 0}}
    page = open_page(control=True)
    page.click("#tab-teach")
    for point in ("origin", "x_axis"):
        page.click("#teach-frame [data-point=%s]" % point)
    page.until_text("#teach-frame .points", "402.0")
    page.click("#teach-frame [data-point=x_axis]")
    page.until_text("#teach-frame .points", "600.0")
    page.click("#teach-frame [data-point=plane]")
    page.until_text("#teach-frame .mark", "take a check point")
    page.click("#teach-frame [data-point=check]")
    page.until_text("#teach-frame .mark", "0.80 mm off the plane")
    page.until_text("#teach-frame .said", "400.0 / 100.0 / 200.0 mm")
    assert page.evaluate("document.querySelector('#teach-user_frame-name').value") == "Frame 1"
    page.type("#teach-user_frame-name", "table <b>")
    page.click("#teach-user_frame-name + button")
    until(lambda: "table <b>" in panel.cell.get("user_frames", {}).get(ARM, {}), "it is kept")
    kept = panel.cell["user_frames"][ARM]["table <b>"]
    assert kept["residual"] == pytest.approx(0.0008) and kept["points"] == PLACES and kept["number"] == 1
    assert not panel.sent("user_frame")
    page.click("#teach-frame .needs-control")
    page.until_text("#teach-frame .needs-control", "press again")
    page.evaluate("document.querySelector('#teach-frame .needs-control').dispatchEvent("
                  "new MouseEvent('click', {detail: 2, bubbles: true, cancelable: true}))")
    assert nothing_is_sent(panel, "user_frame"), "a double click asks, and answers nothing"
    page.click("#teach-frame .needs-control")
    until(lambda: panel.sent("user_frame"), "it is set after the second press")
    assert panel.sent("user_frame")[0]["args"] == {"number": 1, "p": kept["p"], "r": kept["r"]}
    page.type("#teach-user_frame-name", "shelf")
    for _ in range(2):
        page.click("#teach-frame .needs-control")
    until(lambda: len(panel.sent("user_frame")) == 2, "it is set")
    assert "shelf" in panel.cell["user_frames"][ARM], "and kept before that"
    page.type("#teach-user_frame-name", "")
    for _ in range(2):
        page.click("#teach-frame .needs-control")
    page.until_text("#toasts", "Give it a name first")
    assert len(panel.sent("user_frame")) == 2
    page.click("#tab-cell")
    page.until_text("#panel-cell .points", "table <b>")


def test_points_of_the_browser_are_offered_once_and_changes_of_others_are_shown(panel, open_page):
    page = open_page(control=False)
    page.evaluate("localStorage.setItem('jaka-panel-points', %s)" % json.dumps(json.dumps(
        {ARM: [{"name": "old", "q": HOME}, {"name": "x", "q": [1]}]})))
    page.load_again()
    page.until("document.querySelector('#joints td.number')?.textContent", "it is drawn: nothing moves any more")
    page.until("document.querySelector('#cell-offer') && !document.querySelector('#cell-offer').hidden")
    page.click("#tab-cell")
    page.click("#name-label")
    page.call("Input.insertText", text="gripper closed")
    page.click("#name-label + button")
    until(lambda: panel.cell.get("io") == {ARM: {"cabinet.di.0": {"label": "gripper closed"}}}, "the name is kept")
    page.until_text("#cell-names .points", "gripper closed")
    page.click("#cell-offer .primary")
    until(lambda: panel.cell.get("points") == {ARM: {"old": {"q": HOME}}}, "they are taken over")
    page.until("document.querySelector('#cell-offer').hidden && localStorage.getItem('jaka-panel-points') === null")
    change = {"section": "points", "arm": ARM, "name": "of another page", "entry": {"q": HOME}}
    panel.say(t="cell_changed", revision=panel.cell_revision + 1, by="p9", problem="", changes=[change])
    page.click("#tab-move")
    page.until_text("#panel-move .points", "of another page")
    page.until_text("#panel-move .points", "old")
    page.click("#panel-move [data-t='points.export']")
    until(lambda: [one["args"]["version"] for one in panel.sent("cell_export")] == [None], "they are exported")


def test_a_list_of_motions_is_made_drawn_kept_and_run(panel, open_page):
    panel.cell = {"points": {ARM: {"a": {"q": HOME}, "b <i>": {"q": HOME}}}}
    panel.answers["plan_list"] = lambda arguments: {"data": {
        "plan": "k7", "duration": 3.0, "start": HOME, "end": HOME, "path": [HOME, HOME], "t": [0.0, 3.0],
        "warnings": []}}
    page = open_page(control=True)
    page.click("#tab-run")
    add = "#list-run .buttons > button[data-t='list.add']"
    page.click(add)
    assert page.evaluate("document.querySelector('#list-point').value") == "b <i>", "the next point is chosen"
    page.click("#list-run [data-name=arc]")
    page.click(add)
    page.click("#list-run [data-name=wait]")
    page.click(add)
    page.until_text("#list-steps", "b <i>")
    page.click("#list-steps li:last-child [data-t-label='list.up']")
    page.click("#list-run .needs-control")
    until(lambda: panel.sent("plan_list"), "it is planned")
    steps = panel.sent("plan_list")[0]["args"]["steps"]
    assert [step["kind"] for step in steps] == ["joint", "wait", "arc"]
    assert steps[2] == {"kind": "arc", "point": "b <i>", "via": "a", "speed": 0.05}
    page.until_text("#panel-run .said", "3.0 s")
    page.click("#list-name")
    page.call("Input.insertText", text="pick")
    page.click("#list-name + button")
    until(lambda: panel.cell.get("lists") == {ARM: {"pick": {"steps": steps}}}, "it is kept")
    page.click("#panel-run .go")
    until(lambda: panel.sent("plan_run"), "it is run by its number")
    assert panel.sent("plan_run")[0]["args"] == {"plan": "k7"}
