"""Ten tasks of an operator at the panel's page, counted: clicks, fields that are typed into, and the time that page,
panel and arm take for them. Nobody thinks here, so the seconds are what is waited for, not what a person needs.

A real driver on a simulated controller, a real browser. Where the page offers a shorter way, that one is taken, and the
longer one on an older page: run it at two states to compare them. In the devel space, on a quiet host:

    build/venv/bin/python3 test/benchmark/bench_panel_tasks.py [TASK ...]        all ten, in their order
"""
import json
import math
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/jogging", "test/support/panel")]

from driver_bench import HOME  # noqa: E402
from figures import HostLoad  # noqa: E402
from panel_operator import BUTTON, Operator  # noqa: E402
from ros_graph import master  # noqa: E402
from waiting import eventually  # noqa: E402

CARD = ".card:has(> h3[data-t='setup.%s'])"
CORNERS = [[0.0, 1.5, -1.5, 1.5, 1.5, 0.0], [0.2, 1.5, -1.5, 1.5, 1.5, 0.0], [0.1, 1.4, -1.4, 1.5, 1.5, 0.0]]
JOGGED_RAD = 0.01
SIZE = (1440, 900)
FREE = """((one) => {
    if (!one?.checkVisibility()) return false;
    if (['aria-disabled', 'aria-busy'].some((name) => one.getAttribute(name) === 'true')) return false;
    one.scrollIntoView({ block: 'center' });
    const { x, y, width, height } = one.getBoundingClientRect();
    return one.contains(document.elementFromPoint(x + width / 2, y + height / 2));
})(document.querySelector(%s))"""


class Hand:
    """The hand of an operator: what it clicks and types is counted. A choice from a list is two clicks."""

    def __init__(self, operator):
        self.operator, self.page = operator, operator.open(control=False)
        self.page.resize(*SIZE)
        self.clicks = self.fields = 0

    def click(self, selector):
        """Press what can be pressed and is not covered, as by a note."""
        self.page.until(FREE % json.dumps(selector), "%s can be pressed" % selector)
        self.page.click(selector)
        self.clicks += 1

    def tab(self, name):
        """Open a tab, unless it is seen already."""
        if self.page.evaluate("document.querySelector('#tab-%s').getAttribute('aria-selected')" % name) != "true":
            self.click("#tab-" + name)

    def type(self, selector, text):
        self.page.place(selector)
        self.page.type(selector, text)
        self.fields += 1

    def choose(self, selector, value):
        """Choose from a list, unless that is chosen already."""
        if self.page.evaluate("document.querySelector(%s).value" % json.dumps(selector)) != value:
            self.page.evaluate("((one) => { one.value = %s; one.dispatchEvent(new Event('change')); })"
                               "(document.querySelector(%s))" % (json.dumps(value), json.dumps(selector)))
            self.clicks += 2

    def has(self, selector):
        return self.page.evaluate("document.querySelector(%s) !== null" % json.dumps(selector))

    def kept(self, section):
        """Return the names in a section of the cell's data, as its file has them."""
        with open(self.operator.cell_data, encoding="utf-8") as file:
            return list(json.load(file)["data"].get(section, {}).get(self.operator.live.arm.name, {}))

    def waits_for_kept(self, section, count):
        def is_kept():
            try:
                return len(self.kept(section)) >= count
            except (OSError, ValueError):
                return False
        assert eventually(is_kept), "%s is not kept" % section


# ---- the tasks; each begins where the one before has ended ----

def why(hand):
    """Read why the arm stands: the emergency stop was pressed and released again."""
    simulator = hand.operator.live.simulator
    simulator.operate("press_emergency_stop")
    assert eventually(lambda: not simulator.state()["is_enabled"])
    simulator.operate("release_emergency_stop")
    hand.page.until_text("#line-said", "Cannot move")


def recover(hand):
    hand.click("#control-button")
    hand.click("#arm-bar .primary")
    hand.page.until_text("#line-said", "Can move")


def jog(hand):
    """Jog the first joint; a busy host ends a jog, and it is pressed again."""
    before = hand.operator.joints()[0]
    hand.tab("jog")
    hand.clicks += 1
    for _ in range(20):
        x, y = hand.page.press(BUTTON % (0, 1))
        is_jogged = eventually(lambda: abs(hand.operator.joints()[0] - before) > JOGGED_RAD, 3.0)
        hand.page.mouse("Released", x, y)
        if is_jogged:
            break
    assert is_jogged, hand.page.text("#panel-jog .said")
    assert eventually(lambda: not hand.operator.live.simulator.is_moving())


def set_output(hand):
    hand.tab("io")
    switch = "#panel-io [aria-label='cabinet DO 3']"
    hand.click(switch)
    hand.page.until("document.querySelector(%s).getAttribute('aria-checked') === 'true'" % json.dumps(switch))


def set_payload(hand):
    hand.tab("setup")
    card = CARD % "payload"
    hand.page.until("document.querySelector('#panel-setup [data-t=\"setup.read_done\"]') !== null")
    hand.type(card + " .field:has(label[data-t='setup.mass']) input", "1.5")
    hand.click(card + " [data-t='setup.apply']")
    hand.click(card + " [data-t='setup.write']")
    hand.page.until("document.querySelector(%s) !== null" % json.dumps(card + " [data-t='setup.written']"))


def change_tool(hand):
    """Change the tool to number 2, 120 mm long."""
    hand.tab("setup")
    card = CARD % "tool_frame"
    for field, text in ((1, "2"), (4, "120")):
        hand.type(card + " .fields > .field:nth-child(%d) input" % field, text)
    hand.click(card + " [data-t='setup.apply']")
    hand.click(card + " [data-t='setup.write']")
    hand.page.until("document.querySelector(%s) !== null" % json.dumps(card + " [data-t='setup.written']"))


def store_points(hand):
    """Store two points, where the arm is and a bit further."""
    hand.tab("move")
    for number, joints in enumerate(CORNERS[:2], 1):
        hand.operator.go(joints)
        hand.page.until_text("#line-said", "Can move")  # a point is stored of an arm at rest
        hand.click("[data-t='points.save']")
        hand.waits_for_kept("points", number)


def teach_frame(hand):
    """Set a user frame that three points teach, and keep it."""
    hand.tab("teach")
    for name, joints in zip(("origin", "x_axis", "plane"), CORNERS):
        hand.operator.go(joints)
        button = "#teach-frame [data-point=%s]" % name
        hand.click(button)
        taken = "document.querySelector(%s).closest('li').textContent.includes('mm')" % json.dumps(button)
        while not eventually(lambda taken=taken: hand.page.evaluate(taken), 3.0):
            hand.page.click(button)  # a busy host shows the rest late, and the pose is refused
    hand.page.until("document.querySelector('#teach-user_frame-name').checkVisibility()")
    name = "#teach-user_frame-name"
    if not hand.page.evaluate("document.querySelector('%s').value" % name):
        hand.type(name, "table")
    if not hand.has("#teach-frame [data-t='teach.keep_and_set']"):
        hand.click(name + " + button")
        hand.waits_for_kept("user_frames", 1)
    for _ in range(2):  # it asks
        hand.click("#teach-frame .needs-control")
    hand.page.until_text("#toasts", "done")
    hand.waits_for_kept("user_frames", 1)


def run_list(hand):
    """Make a list of two motions through stored points, and run it."""
    hand.operator.go(HOME)
    hand.tab("run")
    for name in ("P1", "P2"):
        hand.choose("#list-point", name)
        hand.click("#list-run [data-t='list.add']")
    hand.click("#list-run [data-t='run.make_plan']")
    hand.page.until("document.querySelector('#panel-run [data-t=\"run.planned\"]') !== null")
    hand.click("#panel-run .go")
    assert eventually(lambda: hand.operator.is_at(CORNERS[1])), hand.page.text("#panel-run")


def export_points(hand):
    """Export the points, from where they are stored."""
    hand.page.click("#tab-move")
    hand.page.sent.clear()
    hand.page.evaluate("window.exported = new Promise((resolve) => { URL.createObjectURL = (blob) => { "
                       "blob.text().then(resolve); return '#'; }; }); true")
    if hand.has("#panel-move [data-t='points.export']"):
        hand.click("#panel-move [data-t='points.export']")
    else:
        hand.tab("cell")
        hand.click("#cell-file [data-t='cell.export']")
    assert "P2" in hand.page.evaluate("window.exported")


TASKS = {"the arm stands: why?": why, "recover": recover, "jog a joint": jog, "set an output": set_output,
         "set the payload": set_payload, "store two points": store_points, "teach a frame by three points": teach_frame,
         "run a list of two motions": run_list, "export the points": export_points, "change the tool": change_tool}


class Bench(Operator):
    """The driver, the panel with the data of its cell, and the browser."""

    def __init__(self, folder):
        self.cell_data = str(Path(folder) / "cell" / "cell.json")
        super().__init__(folder, panel=("--cell-data", self.cell_data))

    def joints(self):
        return [math.radians(value) for value in self.live.simulator.state()["joint_position"]]

    def is_at(self, target):
        return all(abs(a - b) < 1e-3 for a, b in zip(self.joints(), target))

    def go(self, target):
        """Move the arm, as somebody does who guides it by hand: nothing of it is counted."""
        assert eventually(lambda: self.live.arm.call("joint_move", pose=target, mvvelo=2.0, mvacc=8.0).ret == 1)


def main(names):
    load = HostLoad()
    total = [0, 0]
    with tempfile.TemporaryDirectory() as folder, master(), Bench(folder) as operator:
        hand = Hand(operator)
        print("%-32s %6s %6s %8s" % ("task", "clicks", "fields", "s"))
        for name in names:
            hand.clicks, hand.fields = 0, 0
            since = time.monotonic()
            TASKS[name](hand)
            print("%-32s %6d %6d %8.1f" % (name, hand.clicks, hand.fields, time.monotonic() - since), flush=True)
            total = [total[0] + hand.clicks, total[1] + hand.fields]
    print("%-32s %6d %6d      (%s)" % ("together", *total, load))


if __name__ == "__main__":
    main(sys.argv[1:] or list(TASKS))
