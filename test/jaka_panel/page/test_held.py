"""The dead-man's switch under hands that do more than one thing: two buttons of a mouse, two fingers."""
import json
import time

import pytest
from fake_panel import ARM
from waiting import eventually

JOG = ".jog-button[data-axis='0'][data-sign='1']"
HELD = "document.querySelector('.jog-button.held') !== null"
TRIES = 10


def quiet(panel):
    """Return whether no heartbeat comes for as long as six would have, once the jog's end has come.

    A page that has ended its jog may have heartbeats on their way, to a panel that is busy.
    """
    words = ("jog", "jog_stop")
    assert eventually(lambda: [one["t"] for one in panel.doing() if one["t"] in words][-1:] == ["jog_stop"])
    count = len(panel.sent("jog"))
    time.sleep(0.3)  # what must not come has no other sign
    return len(panel.sent("jog")) == count


def held_by(page, press, release):
    """Press until it is held for four heartbeats: a busy host makes a page stand still, and ends a jog."""
    for _ in range(TRIES):
        press()
        time.sleep(0.2)  # four heartbeats, which a hold that has ended does not send
        if page.evaluate(HELD):
            return
        release()
    raise AssertionError("never held: %s" % page.text("#panel-jog .said"))


def test_a_jog_ends_with_the_button_that_began_it_though_another_is_down(panel, open_page):
    page = open_page(control=True)
    x, y = page.place(JOG)

    def mouse(kind, button, buttons):
        page.call("Input.dispatchMouseEvent", type="mouse" + kind, x=x, y=y, button=button, buttons=buttons,
                  clickCount=1, pointerType="mouse")

    held_by(page, lambda: mouse("Pressed", "left", 1), lambda: mouse("Released", "left", 0))
    mouse("Pressed", "right", 3)
    mouse("Released", "left", 2)
    page.until("!(%s)" % HELD, timeout=2.0)
    assert quiet(panel)
    mouse("Pressed", "left", 3)  # over a right button that is still down: no press of its own
    assert quiet(panel)
    mouse("Released", "left", 2)
    mouse("Released", "right", 0)
    assert quiet(panel)


@pytest.mark.parametrize("kind", ["touch", "pen"])
def test_a_finger_and_a_pen_jog_for_as_long_as_they_touch(panel, open_page, kind):
    page = open_page(control=True)
    x, y = page.place(JOG)

    def pen(event, buttons):
        page.call("Input.dispatchMouseEvent", type="mouse" + event, x=x, y=y, button="left", buttons=buttons,
                  clickCount=1, pointerType="pen")

    def touch(event, *points):
        page.call("Input.dispatchTouchEvent", type="touch" + event, touchPoints=list(points))
    if kind == "pen":
        press, move, release = (lambda: pen("Pressed", 1)), (lambda: pen("Moved", 1)), (lambda: pen("Released", 0))
    else:
        page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
        press, release = (lambda: touch("Start", {"x": x, "y": y, "id": 0})), (lambda: touch("End"))
        move = lambda: touch("Move", {"x": x + 3, "y": y, "id": 0})  # noqa: E731
    for _ in range(TRIES):
        held_by(page, press, release)
        move()
        time.sleep(0.1)  # two heartbeats
        if page.evaluate(HELD):
            break
        release()
    else:
        raise AssertionError(page.text("#panel-jog .said"))
    release()
    page.until("!(%s)" % HELD, timeout=2.0)
    assert quiet(panel)


def test_a_second_finger_on_the_jog_speed_ends_the_jog(panel, open_page):
    page = open_page(control=True)
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
    page.place(JOG)
    boxes = page.evaluate("[%s, '#jog-speed'].map((one) => {"
                          "const box = document.querySelector(one).getBoundingClientRect();"
                          "return [box.x, box.y, box.width, box.height]; })" % json.dumps(JOG))
    (left, top, width, height), slider = boxes
    first = {"x": left + width / 2, "y": top + height / 2, "id": 0}

    def touch(event, *points):
        page.call("Input.dispatchTouchEvent", type="touch" + event, touchPoints=list(points))

    def second(share):
        return {"x": slider[0] + slider[2] * share, "y": slider[1] + slider[3] / 2, "id": 1}
    held_by(page, lambda: touch("Start", first), lambda: touch("End"))
    touch("Start", first, second(0.1))
    for step in range(2, 9):
        touch("Move", first, second(0.1 * step))
        time.sleep(0.02)  # the pace of a finger
    page.until("document.querySelector('#jog-speed').value > 30", timeout=5.0)
    page.until("!(%s)" % HELD, timeout=2.0)
    assert quiet(panel)
    touch("End", second(0.8))
    touch("End")


def test_a_jog_speed_that_another_sets_ends_the_jog(panel, open_page):
    page = open_page(control=True)
    x, y = page.place(JOG)
    held_by(page, lambda: page.press(JOG), lambda: page.mouse("Released", x, y))
    panel.say(t="jog_speed", arm=ARM, fraction=0.5)
    page.until("!(%s)" % HELD, timeout=2.0)
    assert quiet(panel)
    page.mouse("Released", x, y)


@pytest.mark.parametrize("reason", ["wrist singularity: jog joint 5", "joint 3 is at its limit"])
def test_why_a_held_jog_stands_is_said_on_the_page_until_it_is_let_go(panel, open_page, reason):
    page = open_page(control=True)
    x, y = page.place(JOG)
    held_by(page, lambda: page.press(JOG), lambda: page.mouse("Released", x, y))
    panel.say(t="motion", id="jog", state="stopped", reason=reason)
    page.until("document.querySelector('#panel-jog .said').textContent === %s" % json.dumps(
        "The tool has stopped: " + reason), timeout=5.0)
    assert page.evaluate("document.querySelector('#panel-jog .said').classList.contains('bad')")
    page.mouse("Released", x, y)
    page.until("!document.querySelector('#panel-jog .said').textContent.includes(%s)" % json.dumps(reason), timeout=5.0)
