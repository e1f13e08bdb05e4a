"""The door: the listener, on a loop and thread of its own, and where each connection goes from there.

A connection whose first request has the token goes to the hub's loop: stop and heartbeats share that loop and its
thread with nobody who has not. All others are served here: visitors, and the page's files. The handshake of TLS is
here, too; what it has begun goes on in either loop.
"""
import asyncio
import contextlib
import errno
import logging
import socket
import ssl
import threading
from typing import Any, Dict, Optional

from ..settings import PORTS_TRIED, Settings
from .access import Access
from .hub import Hub
from .peer import HEAD_S, MOST_PEERS, OPERATOR, VISITOR
from .server import Server
from .tls import Tls, tls_context

_LOG = logging.getLogger(__name__)
_LONGEST_HEAD = 32 * 1024
"""Bytes of a connection until its first request has a head, those of a TLS handshake among them."""
_BACKLOG = 128
"""Connections that wait to be accepted: more than pages open when a panel comes back."""
_FULL = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_FULL_S = 0.1
"""Pause, s, where the process or the computer can have no further connection."""
_END_S = 2.0
"""Longest wait, s, at the end for sessions that close."""


class Door:
    """The listener of a panel.

    Attributes:
        port: On which it listens, when it does.
    """

    def __init__(self, settings: Settings, hub: Hub) -> None:
        self._settings, self._hub = settings, hub
        self._access = access = Access(settings)
        self._operators = Server(settings, hub, access, OPERATOR)
        self._visitors = Server(settings, hub, access, VISITOR)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="door", daemon=True)
        self._context: Optional[ssl.SSLContext] = None
        self._listener: Optional[socket.socket] = None
        self._accepting: Any = None
        self._entering: Dict[asyncio.Task[None], None] = {}
        self.port = 0

    async def start(self) -> None:
        """Listen; called in the hub's loop. Raises OSError where no port is free or a TLS file cannot be used."""
        if self._settings.tls is not None:
            self._context = tls_context(*self._settings.tls)
        self._listener = _listener(self._settings)
        self.port = int(self._listener.getsockname()[1])
        await self._operators.start()
        self._thread.start()
        await self._here(self._visitors.start())
        self._accepting = asyncio.run_coroutine_threadsafe(self._accept_for_ever(), self._loop)

    async def close(self) -> None:
        """Listen no more, and end all connections."""
        if self._accepting is None:
            return
        self._accepting.cancel()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(asyncio.gather(self._operators.close(), self._here(self._visitors.close())), _END_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_END_S)
        if self._listener is not None:
            self._listener.close()

    async def _here(self, work: Any) -> Any:
        """Run a coroutine in the door's loop, called in the hub's."""
        return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(work, self._loop))

    async def _accept_for_ever(self) -> None:
        assert self._listener is not None
        while True:
            try:
                link, _ = await self._loop.sock_accept(self._listener)
            except OSError as error:
                if error.errno in _FULL:  # those that ask nothing end soon
                    _LOG.error("no connection can be accepted: %s", error)
                    await asyncio.sleep(_FULL_S)
                continue  # a peer that has gone by now
            link.setblocking(False)
            if len(self._entering) >= MOST_PEERS:
                oldest = next(iter(self._entering))
                del self._entering[oldest]
                oldest.cancel()
            task = self._loop.create_task(self._admit(link))
            self._entering[task] = None
            task.add_done_callback(lambda done: self._entering.pop(done, None))
            await asyncio.sleep(0)  # where more connections wait, sock_accept does not let anybody else run

    async def _admit(self, link: socket.socket) -> None:
        """Pass a connection to who serves it; one that asks nothing in time, or too much, is closed."""
        try:
            tls = None if self._context is None else Tls(self._context)
            head = await asyncio.wait_for(self._head(link, tls), HEAD_S)
            task = asyncio.current_task()
            assert task is not None
            self._entering.pop(task, None)  # it has asked, and makes way for none any more
            if not head:
                link.close()
            elif self._access.has_token(head):
                await self._hub.ask(self._operators.take(link, head, tls))
            else:
                await self._visitors.take(link, head, tls)
        except (OSError, asyncio.TimeoutError):
            link.close()
        except asyncio.CancelledError:
            link.close()
            raise

    async def _head(self, link: socket.socket, tls: Optional[Tls]) -> bytes:
        """Read the head of the first request, and the handshake of TLS before it; empty where none comes.

        Raises:
            OSError: The peer has gone, or what it sends is no TLS.
        """
        head, left = b"", _LONGEST_HEAD
        while b"\r\n\r\n" not in head:
            data = await self._loop.sock_recv(link, left)
            left -= len(data)
            if not data or not left:
                return b""
            if tls is None:
                head += data
            else:
                head += tls.decrypt(data)
                await self._loop.sock_sendall(link, tls.take_waiting())
        return head


def _listener(settings: Settings) -> socket.socket:
    """Return a listener on the first free port; raises OSError where there is none."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    last = min(settings.port + PORTS_TRIED, 65536) - 1
    for port in range(settings.port, last + 1):
        try:
            listener = socket.create_server((settings.host, port), family=family, backlog=_BACKLOG)
            listener.setblocking(False)
            return listener
        except OSError as error:
            if error.errno != errno.EADDRINUSE or port == last:
                raise
    raise OSError(errno.EADDRINUSE, "no port is free")
