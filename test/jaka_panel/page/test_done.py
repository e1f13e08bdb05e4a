"""The actions of the page: STOP from everywhere, the jog only while it is held and seen, control, and every button."""
import json
import time

import pytest
from fake_panel import ARM
from page_walk import TABS
from waiting import eventually, wait_until

JOG = ".jog-button[data-axis='0'][data-sign='1']"
READY = "document.querySelector('#panel-move .go').dataset.ready === 'true'"
QUIET_S = 0.3
ANSWER_MS = 1500
CHANGES = """new Promise((resolve) => {
    const watch = new MutationObserver((records) => {
        const parent = (one) => one.target.nodeType === 1 ? one.target : one.target.parentElement;
        if (!records.some((one) => !parent(one)?.closest('#age, #status, #joints, #tool'))) return;
        watch.disconnect();
        resolve(true);
    });
    watch.observe(document.body, {subtree: true, childList: true, attributes: true, characterData: true});
    setTimeout(() => { watch.disconnect(); resolve(false); }, %d);
})""" % ANSWER_MS


def beats(panel):
    return panel.sent("jog")


def rested(panel):
    """Return whether heartbeats have ended: none comes for as long as some would have."""
    count = len(beats(panel))
    time.sleep(QUIET_S)  # what must not come has no other sign
    return len(beats(panel)) == count


def test_the_space_bar_stops_wherever_the_focus_is(panel, open_page):
    page = open_page(control=True)
    for focus in ("body", "#control-button", "#tab-move", JOG, "#jog-speed", "#field-1", ".choice button"):
        page.click("#tab-move" if focus == "#field-1" else "#tab-jog")
        page.evaluate("document.querySelector(%s).focus()" % json.dumps(focus))
        before, stops = len(panel.doing()), len(panel.stops)
        page.key(" ")
        wait_until(lambda stops=stops: len(panel.stops) > stops, "stop arrives from " + focus)
        page.until_text("#stop-said", "confirmed at rest")
        assert [one["t"] for one in panel.doing()[before:]] == ["stop"], focus


def test_in_a_field_for_words_the_space_bar_types_and_escape_stops(panel, open_page):
    page = open_page()
    page.click("#tab-move")
    page.click("#point-name")
    page.key(" ")
    assert page.evaluate("document.querySelector('#point-name').value") == " " and not panel.stops
    page.key("Escape")
    wait_until(lambda: panel.stops, "stop arrives")


def test_stop_needs_no_control_and_goes_by_http_where_the_socket_does_not_answer(panel, open_page):
    page = open_page()
    page.click("#stop")
    wait_until(lambda: panel.stops == ["socket"], "one stop for one click: %s" % panel.stops)
    panel.silent = True
    page.click("#stop")
    wait_until(lambda: "http" in panel.stops, "stop arrives another way")
    page.until_text("#stop-said", "NOT CONFIRMED: use the emergency stop button")


def begin(page, panel, count, press):
    """Press until so many heartbeats have come of one press; return its number. A busy host makes a page stand still,
    too."""
    for _ in range(20):
        last = max([one["hold"] for one in beats(panel)], default=0)
        ends = len(panel.sent("jog_stop"))
        press()
        wait_until(lambda last=last, ends=ends: len(panel.sent("jog_stop")) > ends or sum(
            one["hold"] > last for one in beats(panel)) >= count, "heartbeats")
        if len(panel.sent("jog_stop")) == ends:
            return beats(panel)[-1]["hold"]
        page.mouse("Released", 1, 1)
        page.key("Enter", "up")
    raise AssertionError("never so many heartbeats in a row: %s" % page.text("#panel-jog .said"))


def test_the_jog_lasts_as_long_as_the_button_is_held(panel, open_page):
    page = open_page(control=True)
    hold = begin(page, panel, 20, lambda: page.press(JOG))
    x, y = page.place(JOG)
    page.mouse("Released", x, y)
    wait_until(lambda: panel.sent("jog_stop")[-1:] and panel.sent("jog_stop")[-1]["hold"] == hold, "the end is told")
    assert rested(panel)
    sent = [one for one in beats(panel) if one["hold"] == hold]
    assert {(one["space"], one["step"], tuple(one["v"])) for one in sent} == {("joint", None, (1, 0, 0, 0, 0, 0))}
    assert [one["seq"] for one in beats(panel)] == list(range(1, len(beats(panel)) + 1))
    assert all(one["echo"] for one in sent) and sent[-1]["echo"] > sent[0]["echo"]
    assert sent[-1]["clock"] - sent[0]["clock"] > 0.7 * 50 * (len(sent) - 1), "by the clock, not by repetition"
    assert begin(page, panel, 2, lambda: page.press(JOG)) > hold, "each press has a number of its own"
    page.mouse("Released", x, y)


def test_the_keyboard_jogs_while_enter_is_down_and_its_repetition_does_not_count(panel, open_page):
    page = open_page(control=True)
    page.evaluate("document.querySelector(%s).focus()" % json.dumps(JOG))
    hold = begin(page, panel, 5, lambda: page.key("Enter", "down"))
    for _ in range(5):
        page.key("Enter", "down", autoRepeat=True)
    page.key("Enter", "up")
    wait_until(lambda: panel.sent("jog_stop")[-1:] and panel.sent("jog_stop")[-1]["hold"] == hold, "the end is told")
    page.key("Enter", "down", autoRepeat=True)  # as after a press that was lost
    assert rested(panel) and beats(panel)[-1]["hold"] == hold


ENDS = {
    "the pointer slips off": lambda page, x, y: page.mouse("Moved", x + 300, y - 100, 1),
    "the focus goes elsewhere": lambda page, x, y: page.evaluate("document.querySelector('#theme').focus()"),
    "the window loses the focus": lambda page, x, y: page.evaluate("window.dispatchEvent(new Event('blur'))"),
    "the pointer is lost": lambda page, x, y: page.evaluate(
        "document.querySelector(%s).dispatchEvent(new PointerEvent('pointercancel', {pointerId: 1}))"
        % json.dumps(JOG)),
    "the space bar": lambda page, x, y: page.key(" "),
    "the page stands still": lambda page, x, y: page.evaluate(
        "(() => { const end = performance.now() + 400; while (performance.now() < end); })()"),
    "the server says so": None,
    "the page is loaded again": lambda page, x, y: page.call("Page.reload"),
}


def test_every_way_of_letting_go_ends_the_jog_for_good(panel, open_page):
    page = open_page(control=True)
    for how, end in ENDS.items():
        hold = begin(page, panel, 4, lambda: page.press(JOG))
        x, y = page.place(JOG)
        hellos = len(panel.sent("hello"))
        if end is None:
            panel.say(t="jog", hold=hold, state="ended", why="missed", late=0)
        else:
            end(page, x, y)
        if how == "the page is loaded again":
            wait_until(lambda hellos=hellos: len(panel.sent("hello")) > hellos, "there is another page")
        else:
            wait_until(lambda hold=hold: panel.sent("jog_stop")[-1:] and panel.sent("jog_stop")[-1]["hold"] == hold,
                  "the end is told: " + how)
        assert rested(panel), "the button is still down, and nothing goes on: " + how
        page.mouse("Released", x, y)


def test_enter_that_is_held_presses_a_button_once(panel, open_page):
    panel.cell = {"payloads": {ARM: {"heavy": {"mass": 5.0, "centre": [0.0, 0.0, 0.0], "tool": 2}}}}
    page = open_page(control=True)

    def hold_enter(button):
        page.evaluate("document.querySelector(%s).focus()" % json.dumps(button))
        page.key("Enter", "down")
        for _ in range(6):
            time.sleep(0.1)  # the rate of a key that is held, while it is answered
            page.key("Enter", "down", autoRepeat=True)
        page.key("Enter", "up")

    hold_enter("#arm-bar button")
    wait_until(lambda: panel.sent("power"), "it is pressed")
    page.click("#tab-io")
    hold_enter("#panel-io [role=switch]")
    wait_until(lambda: panel.sent("set_output"), "it is pressed")
    page.click("#tab-cell")
    page.until("document.querySelector('#panel-cell .needs-control') !== null")
    hold_enter("#panel-cell .needs-control")
    page.until_text("#panel-cell .needs-control", "press again")
    assert rested(panel) and [len(panel.sent(one)) for one in ("power", "set_output", "payload")] == [1, 1, 0]
    page.key("Enter")
    wait_until(lambda: panel.sent("payload"), "a press of its own does it")
    stops = len(panel.stops)
    page.evaluate("document.querySelector('#stop').focus()")
    page.key("Enter", "down", autoRepeat=True)
    wait_until(lambda: len(panel.stops) > stops, "STOP takes every Enter")


def test_without_control_nothing_is_sent_and_the_page_says_how_to_get_it(panel, open_page):
    page = open_page()
    page.press(JOG)
    page.until_text("#toasts", "Take control first")
    page.click("#arm-bar button")
    assert not panel.doing()


def test_taking_over_asks_the_other_page_and_is_shown_to_both(panel, open_page):
    first, second = open_page(control=True), open_page()
    second.until_text("#control-said", "page p1 has control")
    for give in (False, True):
        second.click("#control-button")
        first.until_text("#take-over", "page p2 asks for control")
        second.until_text("#take-over", "Asked for control")
        first.click("#take-over button:%s-child" % ("first" if give else "last"))
        if not give:
            second.until_text("#toasts", "keeps control")
            for page in (first, second):
                page.until("document.querySelector('#take-over').hidden")
    second.until("document.body.dataset.may === 'control'")
    first.until("document.body.dataset.may === 'take'")
    first.until("document.querySelector('#take-over').hidden")


def test_a_page_without_the_token_only_watches_and_says_why(panel, open_page):
    panel.may, panel.why = "watch", "no token"
    page = open_page()
    page.until_text("#control-said", "open the link with the token")
    page.until_text("#stop-said", "no token: cannot stop the arm")
    assert page.evaluate("document.querySelector('#stop').ariaDisabled") == "true"
    page.click("#stop")
    page.until_text("#stop-said", "This page cannot stop the arm: use the emergency stop button")
    assert page.evaluate("document.querySelector('#control-button').hidden")


def test_a_target_is_shown_before_go_goes_there_and_only_there(panel, open_page):
    page = open_page(control=True)
    page.click("#tab-move")
    page.until("document.querySelector('#panel-move input').value === '0.00'")
    page.click("#panel-move .go")
    page.until_text("#toasts", "no target yet")
    page.type("#panel-move input", "20")
    page.until(READY)
    page.click("#panel-move .go")
    wait_until(lambda: panel.sent("joint_move"), "the move is asked for")
    (move,) = panel.sent("joint_move")
    assert move["args"]["q"] == pytest.approx([0.349066, 1.5, -1.5, 1.5, 1.5, 0.0], abs=1e-3)
    page.type("#panel-move input", "9999")
    page.until_text("#panel-move .said", "beyond its limit")
    page.type("#panel-move input", "12x")
    page.until_text("#panel-move .said", "Type a number")
    page.click("#panel-move .go")
    assert len(panel.sent("joint_move")) == 1


def test_a_target_that_is_typed_while_the_arm_is_under_way_stays(panel, open_page):
    panel.answers["joint_move"] = lambda arguments: None  # answered below
    page = open_page(control=True)
    page.click("#tab-move")
    page.type("#panel-move input", "20")
    page.until(READY)
    page.click("#panel-move .go")
    wait_until(lambda: panel.sent("joint_move"), "the move is asked for")
    page.type("#panel-move input", "25")
    page.until(READY)
    panel.say(t="answer", id=panel.sent("joint_move")[0]["id"], ok=True, message="it is there")
    page.until_text("#toasts", "it is there")
    page.click("#panel-move .go")
    wait_until(lambda: len(panel.sent("joint_move")) == 2, "the second move is asked for")
    assert panel.sent("joint_move")[1]["args"]["q"][0] == pytest.approx(0.436332, abs=1e-3)


def test_a_line_is_asked_of_the_controllers_kinematics_first(panel, open_page):
    panel.answers["ik"] = lambda arguments: ({"data": {"q": [0.1, 1.4, -1.5, 1.5, 1.5, 0.0]}} if arguments["p"][0] < 0.6
                                             else {"ok": False, "message": "out of reach"})
    page = open_page(control=True)
    page.click("#tab-move")
    page.click("#panel-move [data-name=line]")
    field = "#panel-move .fields:not([hidden]) input"
    page.until("document.querySelector('%s').value === '420.00'" % field)
    page.type(field, "700")
    page.until_text("#panel-move .said", "out of reach")
    page.type(field, "400")
    page.until(READY)
    page.click("#panel-move .go")
    wait_until(lambda: panel.sent("linear_move"), "the line is asked for")
    (move,) = panel.sent("linear_move")
    assert move["args"]["p"] == pytest.approx([0.4, -0.115, 0.37])
    assert [abs(value) for value in move["args"]["r"]] == pytest.approx([2.2214, 2.2214, 0.0], abs=1e-3)


def test_stored_points_are_kept_shown_and_run_through(panel, open_page):
    panel.answers["plan_points"] = lambda arguments: {"data": {
        "plan": "k1", "duration": 4.0, "start": arguments["points"][0]["q"], "end": arguments["points"][-1]["q"],
        "path": [point["q"] for point in arguments["points"]], "t": [0.0, 4.0], "warnings": ["a <b>warning</b>"]}}
    page = open_page(control=True)
    page.click("#tab-move")
    page.click("#point-name")
    page.call("Input.insertText", text="pick & place")
    store = "#panel-move .card .buttons button"

    def says(part):
        """Press; again where a busy host shows what is old, which is no place to store."""
        page.click(store)
        return eventually(lambda: part in page.text("#toasts") + page.text("#panel-move .points"), 3.0)
    panel.state["dq"] = [0.1] + [0.0] * 5
    page.until_text("#line-said", "Moving")
    wait_until(lambda: says("wait until it rests"), "it is not stored")
    panel.state["dq"] = [0.0] * 6
    page.until_text("#line-said", "Can move")
    assert not panel.sent("cell_change"), "where a point is, the arm has rested"
    wait_until(lambda: says("pick & place"), "it is stored")
    page.click("#tab-run")
    page.click("#panel-run .card:first-child > .buttons button")
    page.until_text("#panel-run .way", "pick & place")
    page.click("#panel-run .card:first-child .needs-control")
    page.until_text("#panel-run .said", "4.0 s")
    page.until_text("#panel-run .warnings", "<b>")
    page.click("#panel-run .go")
    wait_until(lambda: panel.sent("plan_run"), "it is run by its number")
    assert panel.sent("plan_run")[0]["args"] == {"plan": "k1"}


def test_an_output_shows_what_the_controller_reports_not_what_was_asked(panel, open_page):
    page = open_page(control=True)
    page.click("#tab-io")
    switch = "#panel-io [aria-label='cabinet DO 3']"
    page.click(switch)
    wait_until(lambda: panel.sent("set_output"), "it is asked for")
    assert panel.sent("set_output")[0]["args"] == {"signal": "digital", "bank": "cabinet", "index": 3, "value": True}
    assert page.evaluate("document.querySelector(%s).getAttribute('aria-checked')" % json.dumps(switch)) == "false"
    panel.io["banks"]["cabinet"]["do"][3] = True
    panel.say(t="io", **panel.io)
    page.until("document.querySelector(%s).getAttribute('aria-checked') === 'true'" % json.dumps(switch))


def test_an_output_that_was_set_by_hand_says_by_whom_until_it_is_set_otherwise(panel, open_page):
    def by_hand(*outputs):
        return {"t": "by_hand", "outputs": [{"bank": "cabinet", "signal": signal, "index": index, "value": value,
                                             "wall": time.time(), "by": "<b>page"}
                                            for signal, index, value in outputs]}
    panel.first = [by_hand(("digital", 3, True), ("analog", 1, 2.5))]
    panel.io["banks"]["cabinet"]["do"] += [False] * 30
    said = "[...document.querySelectorAll('#panel-io .by-hand')].filter((one) => one.checkVisibility())" \
           ".map((one) => one.closest('.terminal-name').textContent)"
    page = open_page(language="en-GB")
    page.click("#tab-io")
    page.until(said + ".length === 2")
    assert [one[:26] for one in page.evaluate(said)] == ["DO 3set by hand here, " + time.strftime("%H:%M")[:4],
                                                         "AO 1set by hand here, " + time.strftime("%H:%M")[:4]]
    assert all(one.endswith(", <b>page") for one in page.evaluate(said))
    page.load_again()
    page.until("document.querySelector('#joints td.number')?.textContent", "it is drawn: nothing moves any more")
    page.click("#tab-io")
    page.until(said + ".length === 2")
    panel.say(**by_hand(("digital", 3, True), ("digital", 40, False)))
    page.until(said + ".map((one) => one.split('set')[0]).join() === 'DO 3,DO 40'", "an unusual one is shown for it")
    page.click("#language")
    page.until(said + ".every((one) => one.includes('在此手动设置，<b>page'))")
    panel.say(**by_hand())
    page.until(said + ".length === 0")


def test_a_setting_is_read_asked_for_written_and_read_back(panel, open_page):
    frames = [{"p": [0.0, 0.0, 0.0], "r": [0.0, 0.0, 0.0]}, {"p": [0.0, 0.0, 0.12], "r": [0.0, 0.0, 0.0]}]
    held = {"tool": 1, "user_frame": 0, "tools": frames, "user_frames": frames, "collision_level": 2,
            "payload": {"mass": 1.5, "centre": [0.0, -0.02, 0.0412345]}}

    def write(arguments):
        held["payload"] = {"mass": arguments["mass"], "centre": arguments["centre"]}
        return {}
    panel.answers.update(settings=lambda arguments: {"data": held}, payload=write)
    page = open_page(control=True)
    page.click("#tab-setup")
    card = "#panel-setup .card:nth-child(3) "
    mass, z = card + ".field:nth-child(2) input", card + ".field:nth-child(5) input"
    page.until("document.querySelector(%s).value === '1.50'" % json.dumps(mass))
    assert page.evaluate("document.querySelector('#panel-setup [data-name=level2]').ariaPressed") == "true"
    assert page.evaluate("document.querySelector('#panel-setup .card .field:nth-child(4) input').value") == "120.00"
    number = card + ".field:nth-child(1) input"
    page.type(number, "2")
    page.until_text(card + ".said", "does not report this")
    values = "[...document.querySelectorAll(%s)].map((one) => one.value)" % json.dumps(card + "input")
    assert page.evaluate(values) == ["2", "", "", "", ""], "what is held belongs to the active tool"
    page.type(number, "1")
    page.until(values + ".join() === '1,1.50,0.00,-20.00,41.23'")
    page.click(card + "> .buttons button")
    page.until_text(card + ".said", "No changes.")
    page.type(mass, "1.2")
    page.until_text(card + ".field:nth-child(2) .note", "now 1.50")
    page.click(card + "> .buttons button")
    page.until_text(card + ".ask", "Mass: 1.50 → 1.20 kg")
    page.until_text(card + ".ask", "Lighter than before")
    assert not panel.sent("payload")
    page.click(card + ".ask button")
    page.until_text(card + ".said", "Written, and read back the same")
    assert [one["args"] for one in panel.sent("payload")] == [
        {"tool": 1, "mass": 1.2, "centre": [0.0, -0.02, 0.0412345]}], "what nobody changed, to the last digit"
    held["payload"]["centre"] = [0.0, 0.0, 0.0]  # by a pendant
    page.type(mass, "0")
    page.click(card + "> .buttons button")
    page.until_text(card + ".said", "have changed since they were shown")
    assert len(panel.sent("payload")) == 1
    assert page.evaluate("document.querySelector(%s).value" % json.dumps(z)) == "0.00"


def test_every_button_answers(panel, open_page):
    # Each one is pressed in each tab: something is sent, or something on the page changes.
    page = open_page(control=True, height=1400)
    dead = []
    clicked = 0
    for tab in page.evaluate(TABS):
        page.evaluate("document.getElementById(%s).click()" % json.dumps(tab))
        count = page.evaluate("document.querySelectorAll('main button, .switches button').length")
        for number in range(count):
            name = page.evaluate("""(() => {
                const button = document.querySelectorAll('main button, .switches button')[%d];
                document.querySelectorAll('[data-chosen]').forEach((one) => one.removeAttribute('data-chosen'));
                if (!button || !button.checkVisibility()) return '';
                if (button.matches('.choice [aria-pressed=true], [data-tested], .tabs *, .view-buttons *')) return '';
                if (button.matches('[role=switch]:not([aria-label$=" 3"])')) return '';
                button.setAttribute('data-chosen', '');
                button.setAttribute('data-tested', '');
                return button.textContent + '|' + (button.ariaLabel ?? '');
            })()""" % number)
            if not name:
                continue
            clicked += 1
            before = len(panel.received)
            page.evaluate("document.querySelector('#toasts').replaceChildren()")
            x, y = page.place("[data-chosen]")
            page.evaluate("window.changed = false; %s.then((changed) => { window.changed = changed; }); true" % CHANGES)
            page.mouse("Moved", x, y)
            page.mouse("Pressed", x, y, 1)
            page.mouse("Released", x, y)
            if not eventually(lambda before=before: len(panel.received) > before or page.evaluate("window.changed"),
                              ANSWER_MS / 1000):
                dead.append((tab, name))
    assert clicked > 60 and not dead, (clicked, dead)
