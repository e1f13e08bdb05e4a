"""Pictures of the panel's page at five sizes, in both languages and both colours, by a browser and a tests' server.

An executable; the arguments are the folder (build/pictures) and names of pictures (all). Look at them, then keep in
docs/pictures those that its pages show.
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
from panel_contents import fill  # noqa: E402

SIZES = {"desk_1024": (1024, 768), "desk_1440": (1440, 900), "desk_1920": (1920, 1080), "tablet": (1024, 768),
         "wall": (1920, 1080)}
"""Width and height, px, by view and width."""
LANGUAGES = {"en": "en-GB", "zh": "zh-CN"}
NAMES = ["panel_%s_%s_%s" % (size, language, colours) for size in SIZES for language in LANGUAGES
         for colours in ("light", "dark")]
QUALITY = 72


def aim(page):
    """Have the page show a target that the arm could go to."""
    page.click("#tab-move")
    page.until("document.querySelector('#panel-move input').value !== ''")
    page.type("#panel-move input", "15")
    page.until("document.querySelector('#panel-move .go').dataset.ready === 'true'")
    page.evaluate("scrollTo(0, 0); document.activeElement.blur(); true")


def take(browser, panel, folder, name):
    size, language, colours = name[len("panel_"):].rsplit("_", 2)
    view = size.partition("_")[0]
    width, height = SIZES[size]
    page = browser.open(panel.url.replace("/#", "/?view=%s#" % view), width=width, height=height,
                        language=LANGUAGES[language], dark=colours == "dark")
    page.until("!document.body.classList.contains('stale')")
    page.click("#control-button")
    page.until("document.body.dataset.may === 'control'")
    if view != "wall":
        aim(page)
    if page.evaluate("document.querySelector('.plot-bar').checkVisibility()"):
        page.click("[data-span='120']")
    page.evaluate("document.querySelector('#toasts').replaceChildren()")
    time.sleep(3.0)
    page.picture(folder / (name + ".webp"), quality=QUALITY)
    page.picture(folder / (name + ".png"))
    assert not page.complaints, page.complaints
    page.close()
    print(folder / name, flush=True)


def main(folder, names):
    browser_module.PATIENCE_S = 600.0  # 3D is drawn by the processor here
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        with FakePanel() as panel, Browser(webgl=True) as browser:
            fill(panel)
            take(browser, panel, folder, name)


if __name__ == "__main__":
    main(Path((sys.argv[1:] + [str(ROOT / "build" / "pictures")])[0]), sys.argv[2:] or NAMES)
