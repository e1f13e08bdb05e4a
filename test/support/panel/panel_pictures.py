"""Pictures of the panel's page for desk, tablet and wall, in both languages: a real browser, and a server of the tests.

An executable; the arguments are the folder (docs/pictures) and names of pictures. Look at them before they are kept.
"""
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / folder) for folder in (
    ".", "tools", "test/support", "test/support/live", "test/support/panel")]

import browser as browser_module  # noqa: E402
from browser import Browser  # noqa: E402
from fake_panel import FakePanel  # noqa: E402

from jaka_ros_driver.kinematics.arm_models import load_model  # noqa: E402
from jaka_ros_driver.kinematics.forward import forward  # noqa: E402
from jaka_ros_driver.kinematics.rotations import rotation_vector_from_matrix  # noqa: E402

SIZES = {  # name: width, height, language, dark, view
    "panel_desk_en": (1440, 900, "en-GB", False, "desk"), "panel_tablet_zh": (1024, 768, "zh-CN", False, "tablet"),
    "panel_wall_en": (1920, 1080, "en-GB", True, "wall"), "panel_tablet_en": (1024, 768, "en-GB", True, "tablet"),
    "panel_desk_zh": (1440, 900, "zh-CN", True, "desk"), "panel_wall_zh": (1920, 1080, "zh-CN", False, "wall"),
}
QUALITY = 72
JOINTS = [-0.5, 1.25, -1.6, 1.9, 1.5, 0.4]


def scene(panel):
    """Set an arm somewhere, with a history of states and calls."""
    flange = forward(load_model("zu7"), JOINTS)
    panel.state["q"] = JOINTS
    panel.state["tool"].update(p=list(flange[9:]), r=list(rotation_vector_from_matrix(flange[:9])))
    now = time.time()
    panel.first = [
        {"t": "alarms", "alarms": [
            {"n": 1, "wall": now - 95, "until": now - 60, "level": "error", "code": "0x10F0005",
             "text": "joint 3: collision detected", "source": "controller"},
            {"n": 2, "wall": now - 60, "until": None, "level": "info", "code": None, "text": "recovered",
             "source": "driver"},
            {"n": 3, "wall": now - 20, "until": None, "level": "info", "code": None,
             "text": "Chrome, 1920×1080 has control", "source": "panel"}]},
        {"t": "calls", "calls": [
            {"n": 1, "wall": now - 61, "service": "/jaka_driver/recover", "name": "recover", "type": "std_srvs/Trigger",
             "caller": "/jaka_panel", "request": "", "answer": "success: True", "took": 2.1, "ok": True, "error": ""}]},
    ]


def aim(page):
    page.click("#tab-move")
    page.until("document.querySelector('#panel-move input').value !== ''")
    page.type("#panel-move input", "15")
    page.until("document.querySelector('#panel-move .go').dataset.ready === 'true'")
    page.evaluate("scrollTo(0, 0); document.activeElement.blur(); true")


def take(browser, panel, path, width, height, language, dark, view):
    page = browser.open(panel.url.replace("/#", "/?view=%s#" % view), width=width, height=height, language=language,
                        dark=dark)
    page.until("!document.body.classList.contains('stale')")
    page.click("#control-button")
    page.until("document.body.dataset.may === 'control'")
    if view != "wall":
        aim(page)
    page.evaluate("document.querySelector('#toasts').replaceChildren()")
    time.sleep(3.0)
    page.picture(path, quality=QUALITY)
    page.picture(path.with_suffix(".png"))
    assert not page.complaints, page.complaints
    page.close()
    print(path, flush=True)


def main(folder, names):
    browser_module.PATIENCE_S = 120.0  # 3D is drawn by the processor here
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        with FakePanel() as panel, Browser(webgl=True) as browser:
            scene(panel)
            take(browser, panel, folder / (name + ".webp"), *SIZES[name])


if __name__ == "__main__":
    main(Path((sys.argv[1:] + [str(ROOT / "docs" / "pictures")])[0]), sys.argv[2:] or list(SIZES))
