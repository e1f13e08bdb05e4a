"""The addresses of the panel, and its end."""
import asyncio
import errno
import json
import logging
import ssl
from typing import Any, Optional

from aiohttp import web

from .. import __version__
from ..settings import PORTS_TRIED, Settings
from .access import HEADERS, Access, sent_twice
from .files import page_file
from .hub import Hub
from .websocket_session import converse

_LOG = logging.getLogger(__name__)
_DECIDE = ("Host", "Origin", "Sec-Fetch-Site", "Authorization")
_NO_PAGE = "The files of the page are not installed."
_END_S = 2.0


class Server:
    """HTTP and WebSockets of one hub.

    Attributes:
        port: On which it listens, when it does.
    """

    def __init__(self, settings: Settings, hub: Hub) -> None:
        self._settings, self._hub = settings, hub
        self._access = Access(settings)
        self._runner: Optional[web.AppRunner] = None
        self.port = 0

    async def start(self) -> None:
        """Listen; raises OSError where no port is free or a TLS file cannot be used."""
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
        context = None
        if self._settings.tls is not None:
            context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
            context.load_cert_chain(*self._settings.tls)
        last = min(self._settings.port + PORTS_TRIED, 65536) - 1
        for port in range(self._settings.port, last + 1):
            try:
                await web.TCPSite(self._runner, self._settings.host, port, ssl_context=context).start()
                break
            except OSError as error:
                if error.errno != errno.EADDRINUSE or port == last:
                    raise
        self.port = int(self._runner.addresses[0][1])

    async def close(self) -> None:
        """Listen no more."""
        if self._runner is not None:
            try:
                await asyncio.wait_for(self._runner.cleanup(), _END_S)
            except asyncio.TimeoutError:
                _LOG.info("a connection did not end in time")

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse what other sites ask, and put the headers on every answer."""
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
            response.headers.update(HEADERS)
            response.headers.setdefault("Cache-Control", "no-cache")
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
                                  "arms": self._hub.arms_now()})

    async def _description(self, request: web.Request) -> web.StreamResponse:
        desk = self._hub.arms.get(request.query.get("arm", ""))
        if desk is None or desk.description is None:
            return web.Response(status=404, text="no description of this arm\n")
        return web.Response(text=desk.description.text, content_type="application/xml")

    async def _mesh(self, request: web.Request) -> web.StreamResponse:
        desk = self._hub.arms.get(request.query.get("arm", ""))
        about = desk.description if desk is not None else None
        uri = request.query.get("uri", "")
        path = None if about is None else await asyncio.get_event_loop().run_in_executor(None, about.mesh_file, uri)
        if path is None:
            return web.Response(status=404, text="the description names no such file, or it is not there\n")
        return web.FileResponse(path, headers={"Content-Type": "application/octet-stream"})

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        return await converse(self._hub, self._access, request)

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        """Stop an arm, or all, for a page whose WebSocket does not answer."""
        kind, _, token = request.headers.get("Authorization", "").partition(" ")
        if kind != "Bearer" or not self._access.is_token(token.strip()):
            return web.Response(status=401, text="a stop needs the token\n")
        arm = request.query.get("arm")
        if arm is not None and arm not in self._hub.arms:
            return web.Response(status=404, text="no such arm\n")
        error = await self._hub.stop(arm)
        return web.json_response({"ok": not error, "message": error}, dumps=json.dumps)
