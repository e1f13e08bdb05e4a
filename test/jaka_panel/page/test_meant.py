"""What a button does is what was shown when it was offered: for that arm, in that frame, with those values."""
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
    page.evaluate("(() => { const one = document.querySelector(%s); one.value = %s; one.dispatchEvent(new Event('change', "
                  "{bubbles: true})); })()" % (json.dumps(selector), json.dumps(value)))


def switch_to(page, arm):
    choose(page, "#arm", arm)
    page.until("document.querySelector('#arm').value === %s" % json.dumps(arm))
    page.until("!document.body.classList.contains('stale')")


def nothing_is_sent(panel, kind):
    time.sleep(QUIET_S)
    return not panel.sent(kind)


def button(text, card="#panel-run"):
    """Return an expression for the button of this text."""
    return "[...document.querySelectorAll('%s button')].find((one) => one.textContent === %s)" % (card, json.dumps(text))


def press(page, text, card="#panel-run"):
    page.evaluate(button(text, card) + ".click()")


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
    press(page, "Go to its start")
    assert nothing_is_sent(panel, "joint_move")
    panel.say(t="answer", id=asked["id"], ok=True, message="", data=PLAN)
    page.until(SAID + ".includes('Planned')")
    press(page, "Run it")
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
    press(page, "Run it")
    page.until_text("#toasts", "Nothing is planned")
    assert not panel.sent("plan_run")
