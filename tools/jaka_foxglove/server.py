"""The WebSocket server: takes viewers in, reads what they ask, sends what waits for them, all in one loop.

aiohttp speaks HTTP and WebSocket here. It is an optional requirement (the extra ``foxglove``), imported with this
module.
"""
import asyncio
import collections
import contextlib
import logging
import signal
import socket
import time
from dataclasses import dataclass
from typing import Any, Callable, Coroutine, Deque, Dict, FrozenSet, Mapping, Optional, Sequence, Set

from aiohttp import WSCloseCode, WSMsgType, web

from jaka_bag.errors import BagError

from .access import AccessRules
from .outbox import SocketFrame
from .protocol import OLD_SUBPROTOCOL, SUBPROTOCOLS, Channel, Parameter, advertise, unadvertise
from .source import Audience, ChannelSource
from .viewer import TooMuch, Viewer

_HANDSHAKE_S = 10.0
"""A connection that has not become a WebSocket by then is closed."""
_HEARTBEAT_S = 20.0
"""Period, s, of pings to a viewer; one that does not answer within half of it is disconnected."""
_CLOSING_S = 1.0
"""Time limit, s, for a viewer's answer to the close of its WebSocket."""
_STUCK_S = 30.0
"""Time, s, after which a viewer that has read nothing of what is being sent to it is disconnected."""
_SEND_BUFFER = 256 << 10
"""Bytes that the system keeps for a viewer: what waits there is old when it arrives, and cannot be taken back."""
_MOST_NEW = 32
"""Connections that may be on their way to become one; the oldest makes room."""
_ROOM_S = 0.1
"""One that makes room has this time left: it may be a viewer's after all, whose request is being read."""
_LARGEST_REQUEST = 1 << 20
"""Longest message, byte, of a viewer: a service's request; with more it would take memory."""
_MOST_AT_ONCE = 16
"""Requests of one viewer that may be unanswered."""
_SENT_IN_ONE_GO = 64
"""Frames sent before other viewers have their turn."""
_PLAIN = "This is a server for Foxglove and Lichtblick: open it there as a Foxglove WebSocket, ws://%s\n"


@dataclass(frozen=True)
class ViewerLimits:
    """The limits of what viewers may use.

    Attributes:
        viewers: Viewers at once.
        waiting: Bytes of messages that may wait for each of them.
    """

    viewers: int = 16
    waiting: int = 32 << 20


class _OneLine(logging.Handler):
    """A logging handler that passes aiohttp's reports on as notices of one line, as that a peer does not speak HTTP.

    Args:
        notice: Takes a line for the user.
    """

    def __init__(self, notice: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._notice = notice

    def emit(self, record: logging.LogRecord) -> None:
        reason = record.exc_info[1] if record.exc_info else None
        self._notice(" ".join(("%s%s" % (record.getMessage(), ": %s" % reason if reason else "")).split())[:300])


class _Link:
    """One viewer's WebSocket and the connection below it."""

    def __init__(self, websocket: web.WebSocketResponse, transport: Any) -> None:
        self.socket = websocket
        self._transport = transport

    def abort(self) -> None:
        """Close the connection at once; frames that wait in it are lost."""
        if self._transport is not None:
            self._transport.abort()


class FoxgloveServer(Audience):
    """A WebSocket server that shows a source to viewers.

    Args:
        source: Source of channels, services and parameters.
        rules: Access rules.
        limits: Limits of what viewers may use.
        notice: Takes a line for the user.

    Attributes:
        port: TCP port; 0 before the server listens.
    """

    def __init__(self, source: ChannelSource, rules: AccessRules, limits: ViewerLimits,
                 notice: Callable[[str], None]) -> None:
        self._source = source
        self._rules = rules
        self._limits = limits
        self._notice = notice
        self._session = str(time.time_ns())
        self._viewers: Dict[Viewer, _Link] = {}
        self._transports: Set[Any] = set()
        self._new: Deque[Any] = collections.deque()
        self._runner: Optional[web.AppRunner] = None
        self._stop: Optional[asyncio.Event] = None
        self._loop: Optional[asyncio.AbstractEventLoop] = None
        self._ending: Set[asyncio.Task[None]] = set()
        self.port = 0
        source.audience = self

    async def run(self, host: str, port: int, ready: Callable[[], None]) -> None:
        """Serve until ``stop``.

        Args:
            host: Address to listen on.
            port: 0 for any that is free.
            ready: Called when viewers can connect.

        Raises:
            BagError: It cannot listen there.
        """
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        app = web.Application()
        app.router.add_route("*", "/{path:.*}", self._connect)
        logger = logging.Logger("aiohttp")
        logger.addHandler(_OneLine(self._notice))
        self._runner = web.AppRunner(app, access_log=None, handle_signals=False, logger=logger)
        await self._runner.setup()
        try:
            try:
                listener = await self._loop.create_server(self._accept, host, port)
            except (OSError, OverflowError) as error:
                raise BagError("cannot listen on %s, port %d: %s" % (host, port, error)) from error
            async with listener:
                for one in listener.sockets:  # connections that are taken inherit it
                    one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
                self.port = listener.sockets[0].getsockname()[1]
                await self._source.open()
                watcher = asyncio.ensure_future(self._drop_stuck())
                try:
                    ready()
                    await self._stop.wait()
                finally:
                    watcher.cancel()
                    await self._source.close()
                    listener.close()
                    await self._let_all_go()
        finally:
            await self._runner.cleanup()

    def stop(self) -> None:
        """End; may be called from any thread once ``ready`` was called, and from signal handlers of the loop."""
        if self._loop is not None and self._stop is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(self._stop.set)

    # Connections

    def _accept(self) -> Any:
        assert self._runner is not None and self._runner.server is not None and self._loop is not None
        handler = self._runner.server()
        self._new.append(handler)
        if len(self._new) > _MOST_NEW:
            self._loop.call_later(_ROOM_S, self._drop_silent, self._new.popleft())
        self._loop.call_later(_HANDSHAKE_S, self._drop_silent, handler)
        return handler

    def _drop_silent(self, handler: Any) -> None:
        if handler.transport is not None and handler.transport not in self._transports:
            handler.transport.abort()

    async def _drop_stuck(self) -> None:
        """Drop viewers that have stopped reading: aiohttp's pings do not end a connection whose send buffer is full."""
        while True:
            await asyncio.sleep(1.0)
            now = time.monotonic()
            for viewer, link in list(self._viewers.items()):
                if viewer.sending_since is not None and now - viewer.sending_since > _STUCK_S:
                    self._viewers.pop(viewer)
                    self._notice("viewer %s is let go: it has read nothing for %g s" % (viewer.name, _STUCK_S))
                    link.abort()

    def _refusal(self, request: web.Request) -> Optional[web.Response]:
        origins, hosts = (request.headers.getall(name, []) for name in ("Origin", "Host"))
        reason = self._rules.refusal(origins[0] if origins else None, hosts[0] if hosts else None)
        if reason is None and len(origins) > 1:
            reason = "more than one Origin"
        if reason is not None:
            self._notice("refused %s: %s" % (request.remote, reason))
            return web.Response(status=403, text=reason + "\n")
        if request.headers.get("Upgrade", "").lower() != "websocket":
            return web.Response(status=426, text=_PLAIN % hosts[0], headers={"Upgrade": "websocket"})
        offered = request.headers.get("Sec-WebSocket-Protocol", "").split(",")
        if not {name.strip() for name in offered} & set(SUBPROTOCOLS):
            return web.Response(status=400, text="none of the subprotocols %s is offered\n" % ", ".join(SUBPROTOCOLS))
        if len(self._viewers) >= self._limits.viewers:
            self._notice("refused %s: there are %d viewers already" % (request.remote, len(self._viewers)))
            return web.Response(status=503, text="there are %d viewers already\n" % len(self._viewers))
        return None

    async def _connect(self, request: web.Request) -> web.StreamResponse:
        refusal = self._refusal(request)
        if refusal is not None:
            return refusal
        websocket = web.WebSocketResponse(protocols=SUBPROTOCOLS, heartbeat=_HEARTBEAT_S, compress=False,
                                          max_msg_size=_LARGEST_REQUEST, timeout=_CLOSING_S)
        transport = request.transport
        link = _Link(websocket, transport)
        self._transports.add(transport)
        try:
            await websocket.prepare(request)
            await self._attend(link, "%s, %s" % (request.remote, request.headers.get("Origin", "no page")))
        finally:
            self._transports.discard(transport)
            link.abort()  # one that does not read would keep what was sent to it last
        return websocket

    async def _attend(self, link: _Link, name: str) -> None:
        waiting = asyncio.Event()
        viewer = Viewer(name, self._source, self._session, self._limits.waiting, waiting.set, self._changed)
        viewer.knows_playback = link.socket.ws_protocol != OLD_SUBPROTOCOL
        self._viewers[viewer] = link
        self._notice("viewer %s came, %s" % (name, link.socket.ws_protocol))
        writer = asyncio.ensure_future(_send(link, viewer, waiting))
        under_way: Set[asyncio.Task[None]] = set()
        try:
            viewer.greet()
            async for message in link.socket:
                if message.type not in (WSMsgType.TEXT, WSMsgType.BINARY):
                    break
                request = viewer.parse(message.data)
                task = None if request is None else viewer.serve(request)
                if task is not None:
                    self._begin(viewer, task, under_way)
        except TooMuch as error:
            self._let_go(viewer, str(error))
        finally:
            self._viewers.pop(viewer, None)
            self._changed()
            for running in [writer, *under_way]:
                running.cancel()
            await asyncio.gather(writer, *under_way, return_exceptions=True)
            await asyncio.gather(*self._ending, return_exceptions=True)
            box = viewer.outbox
            left_out = ", %d left out" % box.dropped if box.dropped else ""
            self._notice("viewer %s left: %d messages sent%s" % (name, box.sent, left_out))

    def _begin(self, viewer: Viewer, work: Coroutine[None, None, None], under_way: Set["asyncio.Task[None]"]) -> None:
        if len(under_way) >= _MOST_AT_ONCE:
            work.close()
            raise TooMuch("it asks for more than %d things at once" % _MOST_AT_ONCE)

        def ended(task: "asyncio.Task[None]") -> None:
            under_way.discard(task)
            error = None if task.cancelled() else task.exception()
            if isinstance(error, TooMuch):
                self._let_go(viewer, str(error))
            elif error is not None:
                raise error  # a mistake of ours, which the loop reports

        task = asyncio.ensure_future(work)
        under_way.add(task)
        task.add_done_callback(ended)

    def _let_go(self, viewer: Viewer, reason: str) -> None:
        link = self._viewers.pop(viewer, None)
        if link is not None:
            self._notice("viewer %s is let go: %s" % (viewer.name, reason))
            task = asyncio.ensure_future(_close(link, WSCloseCode.POLICY_VIOLATION, reason))
            self._ending.add(task)
            task.add_done_callback(self._ending.discard)

    async def _let_all_go(self) -> None:
        links = list(self._viewers.values())
        self._viewers.clear()
        await asyncio.gather(*(_close(link, WSCloseCode.GOING_AWAY, "the server ends") for link in links))

    def _changed(self) -> None:
        """Pass the channels, parameters and graph that viewers want now on to the source."""
        viewers = list(self._viewers)
        nothing: FrozenSet[int] = frozenset()
        self._source.want(nothing.union(*(viewer.channels for viewer in viewers)))
        self._source.watch(any(viewer.watches_parameters for viewer in viewers),
                           any(viewer.watches_graph for viewer in viewers))

    # What the source tells

    def _each(self, act: Callable[[Viewer], None]) -> None:
        for viewer in list(self._viewers):
            try:
                act(viewer)
            except TooMuch as error:
                self._let_go(viewer, str(error))

    def advertise(self, channels: Sequence[Channel]) -> None:
        if channels:
            self.tell(advertise(channels))

    def unadvertise(self, channels: Sequence[int]) -> None:
        if channels:
            self.tell(unadvertise(channels))
            for viewer in self._viewers:
                for channel in channels:
                    viewer.forget_channel(channel)
            self._changed()

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        self._each(lambda viewer: viewer.deliver(channel, time, payload))

    def tell_time(self, time: int) -> None:
        self._each(lambda viewer: viewer.tell_time(time))

    def tell(self, frame: SocketFrame) -> None:
        self._each(lambda viewer: viewer.tell(frame))

    def tell_parameters(self, changed: Mapping[str, Parameter]) -> None:
        self._each(lambda viewer: viewer.tell_parameters(changed))

    def tell_graph(self, frame: SocketFrame) -> None:
        self._each(lambda viewer: viewer.tell(frame) if viewer.watches_graph else None)

    def forget_messages(self) -> None:
        for viewer in self._viewers:
            viewer.outbox.forget_messages()


async def _send(link: _Link, viewer: Viewer, waiting: asyncio.Event) -> None:
    """Send what waits for a viewer, for as long as it is there."""
    outbox = viewer.outbox
    with contextlib.suppress(ConnectionError):  # it has gone, which the reading notices, too
        while True:
            await waiting.wait()
            waiting.clear()
            count = 0
            while True:
                frame = outbox.take()
                if frame is None:
                    break
                viewer.sending_since = time.monotonic()
                if isinstance(frame, str):
                    await link.socket.send_str(frame)
                else:
                    await link.socket.send_bytes(frame)
                viewer.sending_since = None
                count += 1
                if count % _SENT_IN_ONE_GO == 0:
                    await asyncio.sleep(0)  # sending waits only where the viewer is slow


async def _close(link: _Link, code: int, reason: str) -> None:
    """Close a WebSocket; a viewer that does not answer is not waited for."""
    with contextlib.suppress(ConnectionError, asyncio.TimeoutError):
        await asyncio.wait_for(link.socket.close(code=code, message=reason.encode()[:120]), 2 * _CLOSING_S)


def serve(server: FoxgloveServer, host: str, port: int, ready: Callable[[], None]) -> None:
    """Run a server in a loop of its own until SIGINT, SIGTERM or SIGHUP; only for the main thread.

    Args:
        server: The server.
        host: Address to listen on.
        port: 0 for any that is free.
        ready: Called when viewers can connect.

    Raises:
        BagError: It cannot listen there.
    """
    async def run() -> None:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, server.stop)
        await server.run(host, port, ready)

    asyncio.run(run())
