"""The addresses of the panel, for the connections of one loop."""
import asyncio
import json
import socket
import time
from typing import Any, Optional

from aiohttp import web

from .. import __version__
from ..settings import Settings
from .access import HEADERS, Access, sent_twice
from .files import page_file
from .hub import Hub
from .peer import Peer, PeerRegistry, Share
from .tls import Tls
from .websocket_session import converse

_DECIDE = ("Host", "Origin", "Sec-Fetch-Site", "Authorization")
_NO_PAGE = "The files of the page are not installed."


class Server:
    """HTTP and WebSockets of one hub, on the loop in which it is started."""

    def __init__(self, settings: Settings, hub: Hub, access: Access, share: Share) -> None:
        """Set up; ``share`` is what each connection may send at first."""
        self._settings, self._hub, self._access, self._share = settings, hub, access, share
        self._peers = PeerRegistry()
        self._runner: Optional[web.AppRunner] = None

    async def start(self) -> None:
        """Begin to serve what ``take`` is given."""
        app = web.Application(middlewares=[self._guard], client_max_size=1024)
        app.router.add_get("/", self._index)
        app.router.add_get("/index.html", self._index)
        app.router.add_get("/web/{name:.+}", self._file)
        app.router.add_get("/api/info", self._info)
        app.router.add_get("/description", self._description)
        app.router.add_get("/mesh", self._mesh)
        app.router.add_get("/ws", self._socket)
        app.router.add_post("/api/stop", self._stop)
        self._runner = web.AppRunner(app, access_log=None, handle_signals=False)
        await self._runner.setup()

    async def take(self, link: socket.socket, head: bytes, tls: Optional[Tls]) -> None:
        """Serve a connection, of which ``head`` was read already; raises OSError where it ends before it begins."""
        assert self._runner is not None and self._runner.server is not None
        manager, loop = self._runner.server, asyncio.get_event_loop()
        await loop.connect_accepted_socket(  # type: ignore[attr-defined]
            lambda: Peer(manager, self._peers, self._share, head, tls), link)

    async def close(self) -> None:
        """End all connections."""
        if self._runner is not None:
            await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse what other sites ask, and put the headers on every answer."""
        peer = request.protocol
        assert isinstance(peer, Peer)
        peer.begins()
        is_socket = request.path == "/ws" or request.method == "POST"
        why = "a header stands twice" if sent_twice(request, _DECIDE) else self._access.refusal(
            request.headers, is_socket, request.path in ("/", "/index.html"))
        if why is not None:
            response: web.StreamResponse = web.Response(status=403, text=why + "\n")
        else:
            try:
                response = await handler(request)
            except web.HTTPException as error:
                response = web.Response(status=error.status, text=error.reason + "\n", headers={
                    name: value for name, value in error.headers.items() if name == "Allow"})
        if not response.prepared:
            if self._settings.behind_tls is not None:
                response.force_close()  # a proxy would send others' requests on it: the first one decides who serves it
            response.headers.update(HEADERS)
            response.headers.setdefault("Cache-Control", "no-cache")
        peer.answered()
        return response

    async def _index(self, request: web.Request) -> web.StreamResponse:
        found = page_file("index.html")
        return web.Response(text=_NO_PAGE, status=503) if found is None else web.FileResponse(
            found.path, headers={"Content-Type": "text/html; charset=utf-8"})

    async def _file(self, request: web.Request) -> web.StreamResponse:
        found = page_file(request.match_info["name"])
        if found is None:
            raise web.HTTPNotFound
        return web.FileResponse(found.path, headers={
            "Content-Type": found.kind + ("; charset=utf-8" if found.is_text else "")})

    async def _info(self, request: web.Request) -> web.StreamResponse:
        return web.json_response({"protocol": 1, "version": __version__, "read_only": self._settings.read_only,
                                  "arms": json.loads(self._hub.arms_told)["arms"]})

    async def _description(self, request: web.Request) -> web.StreamResponse:
        arm = self._hub.arms.get(request.query.get("arm", ""))
        if arm is None or arm.description is None:
            return web.Response(status=404, text="no description of this arm\n")
        return web.Response(text=arm.description.text, content_type="application/xml")

    async def _mesh(self, request: web.Request) -> web.StreamResponse:
        arm = self._hub.arms.get(request.query.get("arm", ""))
        about = arm.description if arm is not None else None
        uri = request.query.get("uri", "")
        path = None if about is None else await asyncio.get_event_loop().run_in_executor(None, about.mesh_file, uri)
        if path is None:
            return web.Response(status=404, text="the description names no such file, or it is not there\n")
        return web.FileResponse(path, headers={"Content-Type": "application/octet-stream"})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        return await converse(self._hub, self._access, request)

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        """Stop an arm, or all, for a page whose WebSocket does not answer."""
        if not self._access.has_bearer(request.headers):
            return web.Response(status=401, text="a stop needs the token\n")
        arm = request.query.get("arm")
        if arm is not None and arm not in self._hub.arms:
            return web.Response(status=404, text="no such arm\n")
        error = await self._hub.ask(self._hub.stop(arm))
        return web.json_response({"ok": not error, "message": error, "now": round(time.monotonic(), 4)},
                                 dumps=json.dumps)
