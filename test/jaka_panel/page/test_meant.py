"""Buttons do what was shown when they were offered: for that arm, in that frame, with those values."""
import json
import time

from fake_panel import ARM, HOME, arm_info
from waiting import eventually

OTHER = "/other_driver"
SAID = "[...document.querySelectorAll('#panel-run .said')].map((one) => one.textContent).join()"
START = [0.5, 1.5, -1.5, 1.5, 1.5, 0.0]
PLAN = {"plan": "k1", "duration": 4.0, "start": START, "end": HOME, "path": [START, HOME], "t": [0.0, 4.0],
        "warnings": []}
QUIET_S = 0.3
LATER = dict.fromkeys(("plan_log", "plan_run"), lambda arguments: None)


def until(holds, what):
    assert eventually(holds), what


def choose(page, selector, value):
    page.evaluate("(() => { const one = document.querySelector(%s); one.value = %s; "
                  "one.dispatchEvent(new Event('change', {bubbles: true})); })()" % (
                      json.dumps(selector), json.dumps(value)))


def switch_to(page, arm):
    choose(page, "#arm", arm)
    page.until("document.querySelector('#arm').value === %s" % json.dumps(arm))
    page.until("!document.body.classList.contains('stale')")


def nothing_is_sent(panel, kind):
    time.sleep(QUIET_S)  # what must not come has no other sign
    return not panel.sent(kind)


def press(page, text, card="#panel-run"):
    page.evaluate("[...document.querySelectorAll('%s button')].find((one) => one.textContent === %s).click()" % (
        card, json.dumps(text)))


def plan_a_log(panel, page):
    """Ask for the plan of a log; return the request."""
    page.click("#tab-run")
    page.until("document.querySelector('#log-file').value === 'a.bag'")
    count = len(panel.sent("plan_log"))
    plan = "document.querySelector('#log-file').closest('section').querySelector('.needs-control')"
    page.until(plan + ".getAttribute('aria-busy') !== 'true'")
    page.evaluate(plan + ".click()")
    until(lambda: len(panel.sent("plan_log")) > count, "it is asked for")
    return panel.sent("plan_log")[-1]


def with_two_arms(panel):
    panel.arms = [arm_info(), arm_info(OTHER)]
    panel.answers.update(LATER, logs=lambda arguments: {"data": {"logs": [{"file": "a.bag", "size": 1, "wall": 1}]}})


def test_a_plan_and_how_its_run_ended_are_of_the_arm_that_is_shown(panel, open_page):
    with_two_arms(panel)
    page = open_page(control=True)
    asked = plan_a_log(panel, page)
    assert asked["arm"] == ARM
    switch_to(page, OTHER)
    panel.say(t="answer", id=asked["id"], ok=True, message="", data=PLAN)
    asked = plan_a_log(panel, page)
    assert asked["arm"] == OTHER and "Planned" not in page.evaluate(SAID), "the answer of before is of the other arm"
    press(page, "Go to start")
    assert nothing_is_sent(panel, "joint_move")
    panel.say(t="answer", id=asked["id"], ok=True, message="", data=PLAN)
    page.until(SAID + ".includes('Planned')")
    press(page, "Run")
    until(lambda: panel.sent("plan_run"), "it is run")
    assert panel.sent("plan_run")[0]["arm"] == OTHER
    switch_to(page, ARM)
    page.evaluate("document.querySelector('#toasts').replaceChildren()")
    panel.say(t="answer", id=panel.sent("plan_run")[0]["id"], ok=True, message="it is at its end", data={})
    page.until_text("#toasts", "it is at its end")
    assert "Done." not in page.evaluate(SAID)


def test_a_plan_of_before_a_new_connection_is_offered_no_more(panel, open_page):
    with_two_arms(panel)
    page = open_page(control=True)
    asked = plan_a_log(panel, page)
    panel.say(t="answer", id=asked["id"], ok=True, message="", data=PLAN)
    page.until(SAID + ".includes('Planned')")
    hellos = len(panel.sent("hello"))
    panel.cut()
    until(lambda: len(panel.sent("hello")) > hellos, "it connects again")
    page.until("document.querySelector('#link-loss').hidden")
    page.until(SAID + ".includes('Nothing is planned')")
    page.click("#control-button")
    page.until("document.body.dataset.may === 'control'")
    press(page, "Run")
    page.until_text("#toasts", "Nothing is planned")
    assert not panel.sent("plan_run")


def show_a_line(page, x):
    page.click("#tab-move")
    page.click("#panel-move [data-name=line]")
    field = "#panel-move .fields:not([hidden]) input"
    page.until("document.querySelector('%s').value !== ''" % field)
    page.type(field, x)
    page.until("document.querySelector('#panel-move .go').dataset.ready === 'true'")


def test_a_line_that_was_shown_in_another_frame_is_not_gone(panel, open_page):
    panel.answers["ik"] = lambda arguments: {"data": {"q": START}}
    page = open_page(control=True)

    def call(name):
        panel.say(t="call", call={"n": 1, "wall": time.time(), "service": ARM + "/" + name, "name": name, "type": "",
                                  "caller": "/other", "request": "", "answer": "", "took": 0.1, "ok": True,
                                  "error": ""})
    changes = {"number of the user frame": lambda: panel.state.update(user_id=3),
               "number of the tool": lambda: panel.state.update(tool_id=2),
               "name of the frame": lambda: panel.state["tool"].update(frame="user_frame_3"),
               "the user frame's values": lambda: call("set_userframe"),
               "the tool's values": lambda: call("set_toolframe")}
    for number, (what, change) in enumerate(changes.items()):
        show_a_line(page, str(400 + number))
        change()
        page.until("document.querySelector('#panel-move .go').dataset.ready === 'false'", what)
        page.until_text("#panel-move .said", "The tool or user frame has changed")
        page.click("#panel-move .go")
        page.until_text("#toasts", "no target yet")
        assert not panel.sent("linear_move"), what
        page.evaluate("document.querySelector('#toasts').replaceChildren()")
    show_a_line(page, "410")
    call("set_payload")
    panel.state.update(tool_id=None, user_id=None)  # they are not told any more: nothing says that they are others
    page.click("#panel-move .go")
    until(lambda: panel.sent("linear_move"), "the line is asked for")
    assert panel.sent("linear_move")[0]["args"]["q"] == START, "the panel checks it against the controller, too"


def test_a_question_is_asked_again_where_what_it_names_is_another_one(panel, open_page):
    wait = {"kind": "wait", "s": 1.0}
    panel.arms = [arm_info(), arm_info(OTHER)]
    panel.cell = {"lists": {arm: {name: {"steps": [wait]} for name in ("weld", "paint")} for arm in (ARM, OTHER)}}
    panel.answers["cell_versions"] = lambda arguments: {"data": {"versions": [
        {"revision": revision, "saved": "", "by": ""} for revision in (2, 1)]}}
    page = open_page(control=True)

    def changed():
        return [(one["arm"], one["name"]) for sent in panel.sent("cell_change") for one in sent["args"]["changes"]]

    page.click("#tab-run")
    page.until("document.querySelector('#list-choice').options.length === 3")
    remove = "#list-choice ~ button"
    choose(page, "#list-choice", "weld")
    page.click(remove)
    page.until_text(remove, "weld")
    choose(page, "#list-choice", "paint")
    page.click(remove)
    page.until_text(remove, "paint")
    switch_to(page, OTHER)
    choose(page, "#list-choice", "paint")
    page.click(remove)
    page.until_text(remove, "paint")
    assert nothing_is_sent(panel, "cell_change"), "each press has asked for another one"
    page.click(remove)
    until(lambda: changed() == [(OTHER, "paint")], "it is the one that was asked for")

    page.click("#tab-teach")
    for point in ("origin", "x_axis", "plane"):
        page.click("#teach-frame [data-point=%s]" % point)
        page.until_text("#teach-frame li:has([data-point=%s]) .second" % point, "mm")
    number, keep = "#teach-frame .field input", "#teach-frame .needs-control"
    page.click(keep)
    page.until_text(keep, "1")
    page.type(number, "7")
    page.click(keep)
    page.until_text(keep, "7")
    assert nothing_is_sent(panel, "user_frame")
    page.click(keep)
    until(lambda: [one["args"]["number"] for one in panel.sent("user_frame")] == [7], "the one that was asked for")

    page.click("#tab-cell")
    page.until("document.querySelector('#cell-version').options.length === 2")
    restore = "#cell-version ~ button:last-child"
    page.click(restore)
    choose(page, "#cell-version", "1")
    page.click(restore)
    assert nothing_is_sent(panel, "cell_restore")
    page.click(restore)
    until(lambda: [one["args"]["version"] for one in panel.sent("cell_restore")] == [1], "the one that was asked for")

    def give_file(name):
        page.evaluate("(() => { const files = new DataTransfer(); files.items.add(new File(['{}'], %s)); "
                      "document.querySelector('#cell-import').files = files.files; })()" % json.dumps(name))
    give_file("one.json")
    page.click("#cell-import + button")
    page.until_text("#cell-import + button", "one.json")
    give_file("two.json")
    page.click("#cell-import + button")
    page.until_text("#cell-import + button", "two.json")
    assert nothing_is_sent(panel, "cell_upload")
    page.click("#cell-import + button")
    until(lambda: panel.sent("cell_upload"), "it is imported")


def test_settings_of_one_arm_are_not_written_to_another(panel, open_page):
    payload = {"mass": 1.5, "centre": [0.0, 0.0, 0.0]}
    told = {"tool": 1, "user_frame": 0, "tools": None, "user_frames": None, "payload": payload, "collision_level": 4}
    with_two_arms(panel)
    panel.answers["settings"] = lambda arguments: {"data": told}
    page = open_page(control=True)
    page.click("#tab-setup")
    pressed = ("[...document.querySelectorAll('#panel-setup .choice [aria-pressed=true]')]"
               ".map((one) => one.dataset.name).join()")
    page.until(pressed + " === 'level4'")
    switch_to(page, OTHER)
    page.until(pressed + " === ''", "what the other one holds is not known")
    collision = "#panel-setup .card:has(.choice) "
    page.click(collision + "button.needs-control")
    page.until_text(collision + ".said", "No changes.")
    page.click(collision + "[data-name=level2]")
    switch_to(page, ARM)
    page.until(pressed + " === ''", "nor is what was to be written to the other one")
    assert page.text(collision + ".said") == "" and not panel.sent("collision")

    page.click("#panel-setup [data-t='setup.read']")
    page.until(pressed + " === 'level4'")
    card = "#panel-setup .card:nth-child(3) "
    mass = card + ".field:nth-child(2) input"
    page.type(mass, "1.2")
    panel.answers["settings"] = lambda arguments: None
    count = len(panel.sent("settings"))
    page.click(card + "> .buttons button")
    until(lambda: len(panel.sent("settings")) > count, "it is read again")
    switch_to(page, OTHER)
    panel.say(t="answer", id=panel.sent("settings")[-1]["id"], ok=True, message="", data=told)
    page.until("document.querySelector(%s).getAttribute('aria-busy') === null" % json.dumps(card + "> .buttons button"))
    assert page.evaluate("document.querySelector(%s).hidden" % json.dumps(card + ".ask"))
    assert nothing_is_sent(panel, "payload")
