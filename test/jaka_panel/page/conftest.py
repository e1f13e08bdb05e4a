"""A browser for the tests of the page; each test has pages and a server of its own."""
import sys

import pytest

aiohttp = pytest.importorskip("aiohttp")

from browser import CHROMIUM, Browser  # noqa: E402
from fake_panel import FakePanel  # noqa: E402

if CHROMIUM is None or sys.version_info < (3, 9):  # the page does not depend on the version of Python: once is enough
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session")
def browser():
    with Browser() as running:
        yield running


@pytest.fixture
def panel():
    with FakePanel() as server:
        yield server


@pytest.fixture
def open_page(browser, panel):
    """Return a function that opens the page; its complaints fail the test unless they are expected."""
    pages = []

    def begin(url=None, control=False, **options):
        page = browser.open(url or panel.url, **options)
        pages.append(page)
        page.until("!document.body.classList.contains('stale')")
        page.until("document.querySelector('#joints td.number')?.textContent", "it is drawn: nothing moves any more")
        if control:
            page.click("#control-button")
            page.until("document.body.dataset.may === 'control'")
        return page

    yield begin
    for page in pages:
        assert not page.complaints, page.complaints
        page.close()
