"""The hub with drivers and pages of the tests' own: what is sent, and what is not any more, when something goes."""
import asyncio
import io
import json
import socket
import threading
import time
from types import SimpleNamespace

import pytest
from waiting import happens

from jaka_panel.authority.rate_limiter import RateLimiter
from jaka_panel.graph import requests
from jaka_panel.pages.commands import answer_to
from jaka_panel.pages.door import Door
from jaka_panel.pages.hub import Hub
from jaka_panel.pages.server import Server
from jaka_panel.pages.session import Session
from jaka_panel.pages.websocket_session import WebSocketSession
from jaka_panel.settings import Settings

JOINTS = {"q": [0.0] * 6, "speed": 0.5}
LIMIT_S = 30.0


class OneArm:
    """An arm's session, whose stop takes a while."""

    def __init__(self, node, stop_s=0.0, error=""):
        self.driver = SimpleNamespace(node=node, interface="documented", offers=lambda name: True)
        self.cancels, self.notes, self.asked_at = set(), [], []
        self.feed = SimpleNamespace(note=lambda level, text: self.notes.append((level, text)))
        self.stopper = SimpleNamespace(stop=self._stop)
        self._stop_s, self._error = stop_s, error

    def cancel(self):
        for cancelled in self.cancels:
            cancelled.set()

    def close(self):
        pass

    async def _stop(self):
        self.asked_at.append(time.monotonic())
        await asyncio.sleep(self._stop_s)
        return self._error


class Socket:
    """The connection of a page, which takes a while to close."""

    def __init__(self, close_s=0.0):
        self._close_s = close_s

    async def close(self, code, message):
        await asyncio.sleep(self._close_s)


class Bench:
    """A hub with arms, and pages that have said hello; the first has control."""

    def __init__(self, *arms, close_s=(0.0,)):
        self.hub = Hub(Settings(), None)
        self.hub._loop = asyncio.get_event_loop()
        self.hub.arms.update({arm.driver.node: arm for arm in arms})
        self.pages = [self._page(seconds) for seconds in close_s]
        self.hub.take_control(self.pages[0])

    def _page(self, seconds):
        page = Session(self.hub.next_page(), Socket(seconds), None, "0", RateLimiter(9.0, 9.0, time.monotonic()),
                       time.monotonic())
        page.has_token = page.may_command = True
        page.told = []
        page.send = page.told.append
        self.hub.pages[page.id] = page
        return page

    def command(self, name, args, page=None):
        return asyncio.ensure_future(answer_to(self.hub, page or self.pages[0], {
            "t": "cmd", "cmd": name, "arm": next(iter(self.hub.arms)), "args": args}))


@pytest.fixture
def service(monkeypatch):
    """Return the services of the drivers: a look-up at the master that waits to be released, and what was sent."""
    told = SimpleNamespace(looked=threading.Event(), released=threading.Event(), sent=[])

    class Proxy:
        def __init__(self, name, kind):
            self.name, self._kind = name, kind

        def __call__(self, request):
            told.looked.set()
            assert told.released.wait(LIMIT_S)
            packed = io.BytesIO()
            request.serialize(packed)
            told.sent.append((self.name, packed.getvalue()))
            return self._kind._response_class()
    monkeypatch.setattr(requests.rospy, "ServiceProxy", Proxy)
    yield told
    told.released.set()


def run(work):
    asyncio.new_event_loop().run_until_complete(asyncio.wait_for(work(), LIMIT_S))


async def seen(event):
    await happens(event.is_set, "the driver is asked")


@pytest.mark.parametrize("how", ["stop", "leave", "close", "lost control"])
@pytest.mark.parametrize("name, args", [("joint_move", JOINTS), ("resume", {}), ("program_play", {}),
                                        ("program_resume", {})])
def test_what_was_on_its_way_is_not_sent_after_the_arm_was_stopped_or_its_page_has_gone(service, name, args, how):
    async def work():
        arm = OneArm("/arm")
        bench = Bench(arm)
        answer = bench.command(name, args)
        await seen(service.looked)
        if how == "stop":
            assert await bench.hub.stop("/arm") == ""
        elif how == "leave":
            bench.hub.leave(bench.pages[0])
        elif how == "close":
            await bench.hub.close()
        else:
            bench.hub.release_control(bench.pages[0])
        service.released.set()
        told = await answer
        assert not told.ok and "nothing was sent" in told.message and not service.sent and not arm.cancels
    run(work)


def test_what_nobody_stops_is_sent(service):
    async def work():
        service.released.set()
        bench = Bench(OneArm("/arm"))
        await bench.command("joint_move", JOINTS)
        assert [name for name, _ in service.sent] == ["/arm/joint_move"]
        await bench.hub.stop("/arm")
        assert not (await bench.command("program_stop", {})).ok
        assert service.sent[-1][0] == "/arm/program/stop", "what ends a motion is sent after a stop, too"
    run(work)


@pytest.mark.parametrize("name, args", [
    ("fk", {"q": [1e39] * 6}), ("joint_move", {"q": [0.0] * 6, "speed": 1e39}),
    ("payload", {"tool": 1, "mass": 1e39, "centre": [0.0] * 3})])
def test_a_number_that_the_message_cannot_hold_is_answered(service, name, args):
    async def work():
        service.released.set()
        told = await Bench(OneArm("/arm")).command(name, args)
        assert not told.ok and "/arm/" in told.message and not service.sent
    run(work)


def test_whatever_goes_wrong_in_a_command_is_answered(monkeypatch, caplog):
    def broken(driver, args):
        raise KeyError("planted")
    monkeypatch.setitem(requests.REQUESTS, "settings", requests.Request(broken, needs_control=False))

    async def work():
        told = await Bench(OneArm("/arm")).command("settings", {})
        assert not told.ok and "planted" in told.message
    run(work)
    assert "planted" in caplog.text


def test_the_arms_of_a_page_that_goes_are_stopped_at_once_and_what_is_told_of_them_is_true():
    async def work():
        slow, quick = OneArm("/slow", 0.6, "no answer"), OneArm("/quick")
        bench = Bench(slow, quick)
        now = time.monotonic()
        for arm in ("/slow", "/quick"):
            bench.pages[0].begins_motion(arm, now)
        bench.hub.leave(bench.pages[0])
        await happens(lambda: any("has gone" in text for _, text in quick.notes), "the quick arm's stop is noted")
        assert quick.asked_at[0] - slow.asked_at[0] < 0.4
        level, text = slow.notes[-1]
        assert level == "error" and "NOT confirmed" in text and "no answer" in text
        assert quick.notes[-1] == ("warning", "the page that moved the arm has gone: stopped")
    run(work)


def test_a_panel_that_ends_begins_nothing_more_and_stops_what_its_pages_moved(service):
    async def work():
        arm = OneArm("/arm")
        bench = Bench(arm, close_s=(0.5, 0.5, 0.5))
        closing = asyncio.ensure_future(bench.hub.close())
        began = time.monotonic()
        await asyncio.sleep(0.1)  # the closing is in its middle: each page takes 0.5 s
        page = bench.pages[0]
        session = WebSocketSession(bench.hub, None, page)
        for message in ({"t": "cmd", "id": 1, "cmd": "joint_move", "arm": "/arm", "args": JOINTS},
                        {"t": "jog", "hold": 1, "arm": "/arm"}):
            session.take(message)
        assert not page.told[-2]["ok"] and page.told[-2]["message"] == "the panel ends"
        assert page.told[-1]["t"] == "error"
        page.begins_motion("/arm", time.monotonic())  # as of a call that was answered late
        bench.hub.leave(page)
        await closing
        assert arm.asked_at and time.monotonic() - began < 1.2, "pages are ended beside each other"
        assert not service.looked.is_set()
    run(work)


def test_the_answer_to_a_stop_says_when_it_was_served():
    async def work():
        bench = Bench(OneArm("/arm", stop_s=0.05))
        began = time.monotonic()
        server = Server(Settings(), bench.hub, SimpleNamespace(has_bearer=lambda headers: True), None)
        posted = json.loads((await server._stop(SimpleNamespace(headers={}, query={}))).text)
        page = bench.pages[0]
        WebSocketSession(bench.hub, None, page).take({"t": "stop", "id": 1, "arm": "/arm"})
        await happens(lambda: page.told[-1]["t"] == "answer", "the stop is answered")
        told = page.told[-1]
        assert posted["ok"] and told["ok"]
        assert began + 0.04 < posted["now"] < told["now"] <= time.monotonic() + 0.001
    run(work)


def test_a_folder_of_logs_that_does_not_answer_holds_up_no_stop():
    async def work():
        bench, released = Bench(OneArm("/arm")), threading.Event()
        bench.hub.logs.entries = lambda: (released.wait(LIMIT_S), [])[1]
        answer = bench.command("logs", {})
        await asyncio.sleep(0.1)  # the folder does not answer meanwhile
        assert not answer.done() and await bench.hub.stop(None) == ""
        released.set()
        assert (await answer).data == {"logs": []}
    run(work)


def test_connections_that_wait_to_be_accepted_do_not_keep_the_door_from_serving_those_that_came(monkeypatch):
    door = Door(Settings(), Hub(Settings(), None))
    door._listener = socket.create_server(("127.0.0.1", 0), backlog=128)
    door._listener.setblocking(False)
    links = [socket.create_connection(door._listener.getsockname()) for _ in range(100)]
    served, turns = [], []

    async def admit(link):
        served.append(link)
    monkeypatch.setattr(door, "_admit", admit)

    async def count():
        while True:
            turns.append(True)
            await asyncio.sleep(0)

    async def work():
        others = [asyncio.ensure_future(count()), asyncio.ensure_future(door._accept_for_ever())]
        while len(served) < len(links):
            await asyncio.sleep(0)
        for task in others:
            task.cancel()
    try:
        door._loop.run_until_complete(asyncio.wait_for(work(), LIMIT_S))
        assert len(turns) >= len(links)
    finally:
        for link in links + served + [door._listener]:
            link.close()
        door._loop.close()
