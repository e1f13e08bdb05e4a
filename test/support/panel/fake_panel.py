"""A panel's server of the tests' own: the real page, and arms that do what a test wants. No ROS.

It speaks the page's protocol as far as the page needs it, and keeps what the page has sent.
"""
import asyncio
import contextlib
import copy
import math
import threading
import time
from typing import Any, Callable, Dict, List, Optional

from aiohttp import WSMsgType, web
from import_graph import ROOT

from jaka_panel.cell.contents import Entries, check_change, with_changes
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.urdf import urdf_from_model

WEB = ROOT / "tools" / "jaka_panel" / "web"
TOKEN = "a-token"
RATE_S = 1 / 30
PLOT_S = 0.15
POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
          "connect-src 'self'; manifest-src 'self'; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; "
          "frame-ancestors 'none'")
HOME = [0.0, 1.5, -1.5, 1.5, 1.5, 0.0]
ARM = "/jaka_driver"
ASKED_BY_ITSELF = ("hello", "watch", "cell", "cell_versions", "logs", "settings", "zones")
"""Messages and commands of a page that is only looked at."""
REFUSED = "Error during WebSocket handshake: Unexpected response code: 503"
"""Error that a browser tells of a connection that a server refused."""


def arm_info(name: str = ARM, **changed: Any) -> Dict[str, Any]:
    model = load_model("zu7")
    joints = [{"name": "joint_%d" % (n + 1), "lower": low, "upper": high, "velocity": model.joint_max_speed[n]}
              for n, (low, high) in enumerate(model.joint_limits)]
    return dict({"id": name, "namespace": "/", "label": name.strip("/"), "alive": True, "simulated": True,
                 "model": "zu7", "interface": "documented", "controller": "127.0.0.1:10001", "prefix": "",
                 "joints": joints,
                 "frames": {"base": "base_link", "flange": "tool0", "tool": "tool"},
                 "has": {"programs": True, "speed": True, "recover": True, "wrench": False, "trajectory": True,
                         "zero_force": True, "path": True},
                 "simulator": True, "jog": {"joint": 0.5, "linear": 0.25, "angular": 0.5},
                 "description": "1"}, **changed)


def first_state() -> Dict[str, Any]:
    return {"age": 0.004, "fresh": True, "q": list(HOME), "dq": [0.0] * 6,
            "tool": {"p": [0.42, -0.115, 0.37], "r": [2.2214, -2.2214, 0.0], "frame": "base_link", "age": 0.004},
            "robot": {"motion": 0, "power": 1, "servo": 0, "collision": 0, "age": 0.004},
            "status": {"mode": "auto", "e_stopped": False, "drives_powered": True, "motion_possible": True,
                       "in_motion": False, "in_error": False, "error_code": 0, "age": 0.004},
            "owner": "nobody", "enabled": True, "hand_guiding": False, "tool_id": 0, "user_id": 0, "held_by": "",
            "speed": 1.0, "want": {"q": list(HOME), "e": [0.0] * 6, "age": 0.004}, "wrench": None, "temperature": None,
            "current": None}


class FakePanel:
    """A server on a free port of loopback, in a thread of its own.

    Attributes:
        arms, state: What pages receive; a test may change both.
        wave: The arm swings by so much, rad.
        received: Messages of pages, in order, but pings.
        silent: Nothing is sent any more, as by a server that stands still.
        cell, cell_revision: The data of the cell, which pages change as with a real server.
        refusing: No page gets a connection, as from a server that is not there.
        answers: By command: a function that makes an answer of the arguments, None for one that comes later; other
            commands are answered with success.
        history: A function that makes the samples of a request for the history; there are none at first.
    """

    def __init__(self) -> None:
        self.arms = [arm_info()]
        self.state = first_state()
        self.io = {"banks": {"cabinet": {"di": [True] + [False] * 15, "do": [False] * 16, "ai": [0.0] * 2,
                                         "ao": [0.0] * 2},
                             "tool": {"di": [False] * 2, "do": [False] * 2, "ai": [], "ao": []}}, "relays": []}
        self.first: List[Dict[str, Any]] = []
        self.cell: Entries = {}
        self.cell_revision = 1
        self.wave = 0.0
        self.may, self.why = "command", ""
        self.silent = False
        self.refusing = False
        self.received: List[Dict[str, Any]] = []
        self.stops: List[str] = []
        pose = {"p": [0.4, 0.1, 0.2], "r": [0.0, 0.0, 0.0]}
        self.answers: Dict[str, Callable[[Dict[str, Any]], Optional[Dict[str, Any]]]] = {
            "present_pose": lambda arguments: {"data": {"q": list(HOME), "tool": pose, "flange": pose, "model": "zu7"}},
            "teach_user_frame": lambda arguments: {"data": dict(pose, residual=None, turn=0.005)},
            "cell_export": lambda arguments: {"data": {"text": "{}"}},
            "cell_versions": lambda arguments: {"data": {"versions": [{"revision": 1, "saved": "", "by": ""}]}}}
        self.history: Callable[[Dict[str, Any]], Dict[str, Any]] = lambda asked: {
            "s": [], "last": [], "min": [[]] * 6, "max": [[]] * 6}
        self.number = 0
        self._pages: Dict[str, web.WebSocketResponse] = {}
        self._holder: Optional[str] = None
        self._asked: Optional[str] = None
        self._counter = 0
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        assert self._ready.wait(30.0)

    @property
    def url(self) -> str:
        return "http://127.0.0.1:%d/#token=%s" % (self.port, TOKEN)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        app = web.Application()
        app.router.add_get("/", self._file)
        app.router.add_get("/web/{path:.*}", self._file)
        app.router.add_get("/description", self._description)
        app.router.add_post("/api/stop", self._stop)
        app.router.add_get("/ws", self._talk)
        runner = web.AppRunner(app)
        self._loop.run_until_complete(runner.setup())
        site = web.TCPSite(runner, "127.0.0.1", 0)
        self._loop.run_until_complete(site.start())
        self.port = site._server.sockets[0].getsockname()[1]  # type: ignore[union-attr]
        self._ready.set()
        self._loop.run_forever()
        self._loop.run_until_complete(runner.cleanup())
        self._loop.close()

    async def _file(self, request: web.Request) -> web.StreamResponse:
        path = WEB / request.match_info.get("path", "index.html")
        return web.FileResponse(path, headers={"Content-Security-Policy": POLICY, "Cache-Control": "no-store"})

    async def _description(self, request: web.Request) -> web.Response:
        return web.Response(text=urdf_from_model(load_model("zu7")), content_type="application/xml")

    async def _stop(self, request: web.Request) -> web.Response:
        self.stops.append("http")
        while self.silent:
            await asyncio.sleep(0.01)
        return web.json_response({"ok": self.may == "command" and request.headers.get(
            "Authorization") == "Bearer " + TOKEN, "message": "", "now": time.monotonic()})

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        if self.refusing:
            raise web.HTTPServiceUnavailable
        socket = web.WebSocketResponse(protocols=["jaka-panel.v1"])
        await socket.prepare(request)
        self._counter += 1
        page = "p%d" % self._counter
        self._pages[page] = socket
        stream, watched = None, None
        async for message in socket:
            if message.type != WSMsgType.TEXT:
                break
            said = message.json()
            if said["t"] != "ping":
                self.received.append(dict(said, page=page))
            if said["t"] == "watch" and said["arms"] != watched:
                if stream is not None:
                    stream.cancel()
                stream, watched = asyncio.ensure_future(self._stream(socket, said)), said["arms"]
            await self._answer(page, socket, said)
        if stream is not None:
            stream.cancel()
        del self._pages[page]
        if self._holder == page:
            self._holder = None
            await self._tell_control()
        return socket

    async def _answer(self, page: str, socket: web.WebSocketResponse, said: Dict[str, Any]) -> None:
        kind = said["t"]
        if self.silent:
            return
        if kind == "hello":
            await self._send(socket, {"t": "welcome", "v": 1, "page": page, "may": self.may, "why": self.why,
                                      "read_only": False, "wall": time.time(), "version": "0", "rate": 30,
                                      "jog": {"period": 0.05, "valid": 0.2, "missed": 0.15, "trip": 0.15,
                                              "fraction": 0.1, "max_fraction": 1.0},
                                      "control": self._control(page), "logs": True, "arms": self.arms})
        elif kind == "ping":
            await self._send(socket, {"t": "pong", "clock": said["clock"]})
        elif kind == "stop":
            self.stops.append("socket")
            await self._send(socket, {"t": "answer", "id": said["id"], "ok": self.may == "command", "message": "",
                                      "took": 0.001})
        elif kind == "take_control":
            free = self._holder in (None, page)
            if free:
                self._holder = page
            else:
                self._asked = page
            await self._send(socket, {"t": "answer", "id": said["id"], "ok": free, "pending": not free, "message": ""})
            await self._tell_control()
        elif kind == "release_control":
            self._holder = None
            await self._tell_control()
        elif kind == "answer_control":
            if said["give"]:
                self._holder = self._asked
            elif self._asked in self._pages:
                await self._send(self._pages[self._asked], {"t": "error", "code": "control_refused", "message": "no"})
            self._asked = None
            await self._tell_control()
        elif kind == "cell":
            await self._send(socket, {"t": "cell", "revision": self.cell_revision, "saved": "", "by": "", "problem": "",
                                      "file": "cell.json", "data": self.cell})
        elif kind == "cmd" and said["cmd"] == "cell_change":
            is_present = said["args"]["revision"] == self.cell_revision
            if is_present:
                changes = [check_change(change, 1) for change in said["args"]["changes"]]
                self.cell = with_changes(self.cell, changes)
                self.cell_revision += 1
                for other in list(self._pages.values()):
                    await self._send(other, {"t": "cell_changed", "revision": self.cell_revision, "by": page,
                                             "problem": "", "changes": said["args"]["changes"]})
            await self._send(socket, {"t": "answer", "id": said["id"], "ok": is_present, "message": "stale"})
        elif kind == "cmd":
            answer = self.answers.get(said["cmd"], lambda arguments: {})(said["args"])
            done = {"t": "answer", "id": said["id"], "ok": True, "message": "", "data": {}}
            if answer is not None:
                await self._send(socket, dict(done, **answer))
        elif kind == "history":
            await self._send(socket, dict(self.history(said), t="history", id=said["id"], ok=True, what=said["what"]))

    def _control(self, page: str) -> Dict[str, Any]:
        def named(one: str) -> Dict[str, str]:
            return {"page": one, "name": "page " + one}
        return {"holder": named(self._holder) if self._holder else None, "you": self._holder == page,
                "asked": dict(named(self._asked), until=time.monotonic() + 10) if self._asked else None}

    async def _tell_control(self) -> None:
        for page, socket in list(self._pages.items()):
            await self._send(socket, dict(self._control(page), t="control"))

    async def _send(self, socket: web.WebSocketResponse, message: Dict[str, Any]) -> None:
        with contextlib.suppress(ConnectionError, RuntimeError):
            await socket.send_json(dict({"now": time.monotonic()}, **message))

    async def _stream(self, socket: web.WebSocketResponse, watched: Dict[str, Any]) -> None:
        arm = watched["arms"][0]
        plotted = time.monotonic()
        for message in [dict(self.io, t="io", age=0.01), {"t": "diag", "wall": time.time(), "status": []},
                        {"t": "alarms", "alarms": []}, {"t": "calls", "calls": []},
                        {"t": "program", "state": "idle", "program": "", "reason": ""}, *self.first]:
            await self._send(socket, dict(message, arm=arm))
        while not socket.closed:
            now = time.monotonic()
            if not self.silent:
                self.number += 1
                await self._send(socket, self._state(arm, now))
                if now - plotted > PLOT_S:
                    await self._send(socket, self._plot(arm, plotted, now))
                    plotted = now
            await asyncio.sleep(RATE_S)

    def joints(self, moment: float) -> List[float]:
        return [q + self.wave * math.sin(0.7 * moment + n) for n, q in enumerate(self.state["q"])]

    def _state(self, arm: str, now: float) -> Dict[str, Any]:
        state = copy.deepcopy(self.state)
        if self.wave:
            state["q"] = self.joints(now)
            state["dq"] = [self.wave * 0.7 * math.cos(0.7 * now + n) for n in range(6)]
        return dict(state, t="state", arm=arm, n=self.number, now=now)

    def _plot(self, arm: str, since: float, now: float) -> Dict[str, Any]:
        moments = [since + 0.008 * step for step in range(int((now - since) / 0.008))]
        rows = [self.joints(moment) for moment in moments]
        columns = [[row[n] for row in rows] for n in range(6)]
        speeds = [[self.wave * 0.7 * math.cos(0.7 * moment + n) for moment in moments] for n in range(6)]
        return {"t": "plot", "arm": arm, "s": moments, "q": columns, "dq": speeds,
                "e": [[0.001 * speed for speed in row] for row in speeds]}

    def say(self, **message: Any) -> None:
        """Send a message to every page."""
        async def send() -> None:
            for socket in list(self._pages.values()):
                await self._send(socket, dict({"arm": ARM}, **message))
        asyncio.run_coroutine_threadsafe(send(), self._loop).result(30.0)

    def cut(self) -> None:
        """Close every page's connection."""
        async def close() -> None:
            for socket in list(self._pages.values()):
                await socket.close()
        asyncio.run_coroutine_threadsafe(close(), self._loop).result(30.0)

    def sent(self, kind: str) -> List[Dict[str, Any]]:
        """Return messages of a kind that pages have sent; of a command, by its name."""
        return [one for one in list(self.received) if kind in (one["t"], one.get("cmd"))]

    def doing(self) -> List[Dict[str, Any]]:
        """Return what pages have sent but the questions that a page asks by itself, at any moment."""
        return [one for one in list(self.received) if one.get("cmd", one["t"]) not in ASKED_BY_ITSELF]

    def close(self) -> None:
        self.silent = False
        with contextlib.suppress(Exception):
            self.cut()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(30.0)

    def __enter__(self) -> "FakePanel":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
