"""One connection below requests and messages: what its peer may send is counted before anything parses it."""
import asyncio
import logging
import time
from http import HTTPStatus
from typing import Any, Dict, NamedTuple, Optional, cast

from aiohttp import web

from ..authority.frames import FrameCounter
from ..authority.rate_limiter import RateLimiter
from .access import HEADERS
from .tls import Tls, TlsTransport

_LOG = logging.getLogger(__name__)
HEAD_S = 5.0
"""Time, s, within which the first request of a connection is whole."""
KEEP_S = 10.0
"""Longest pause, s, between two requests on a connection: one that is idle takes a place of ``MOST_PEERS``."""
LONGEST_LINE = 4096
"""Longest line of a request's head, byte: an address with a token, and a browser's headers."""
LONGEST_MESSAGE = 64 * 1024
"""Longest message, byte, of a page that is in: its largest command."""
MOST_PEERS = 64
"""Most connections that are not pages yet: visitors without a token must not take all memory."""
_END = b"\r\n\r\n"


class Share(NamedTuple):
    """The share of one connection: bytes and WebSocket frames, of any kind, a second and at once."""

    bytes_rate: float
    bytes_burst: float
    frame_rate: float
    frame_burst: float


VISITOR = Share(16e3, 48e3, 40.0, 80.0)
OPERATOR = Share(256e3, 512e3, 200.0, 100.0)
"""The shares without and with the token."""


class PeerRegistry:
    """The connections of one server, oldest first: where there are too many, the oldest without a place is cut."""

    def __init__(self) -> None:
        self._peers: Dict[Peer, None] = {}

    def add(self, peer: "Peer") -> None:
        """Add one that has come."""
        self._peers[peer] = None
        asking = [one for one in self._peers if not one.has_place]
        if len(asking) > MOST_PEERS:
            asking[0].cut()

    def remove(self, peer: "Peer") -> None:
        """Remove one that has gone."""
        self._peers.pop(peer, None)


class Peer(web.RequestHandler):
    """The protocol of a connection: aiohttp's, with limits on what reaches it.

    A browser sends a request when the one before is answered, and frames when its socket is open, never before.

    Attributes:
        has_place: True if it has a place for a page.
    """

    __slots__ = ("has_place", "_is_page", "_peers", "_begin", "_tls", "_encrypted", "_bytes", "_frame_limit",
                 "_frames", "_is_answering", "_tail", "_late")

    def __init__(self, manager: web.Server, peers: PeerRegistry, share: Share, begin: bytes = b"",
                 tls: Optional[Tls] = None) -> None:
        """Begin with the text that was read already."""
        super().__init__(manager, loop=asyncio.get_event_loop(), access_log=None,  # type: ignore[arg-type]
                         keepalive_timeout=KEEP_S, max_line_size=LONGEST_LINE, max_field_size=LONGEST_LINE,
                         lingering_time=0.0)
        self.has_place = self._is_page = False
        self._peers, self._begin, self._tls = peers, begin, tls
        self._encrypted: Optional[TlsTransport] = None
        self._frames = FrameCounter()
        self._is_answering = False
        self._tail = b""
        self._late: Optional[asyncio.TimerHandle] = None
        self.share(share)

    def share(self, share: Share) -> None:
        """Set what the peer may send from now on."""
        now = time.monotonic()
        self._bytes = RateLimiter(share.bytes_rate, share.bytes_burst, now)
        self._frame_limit = RateLimiter(share.frame_rate, share.frame_burst, now)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; a peer that asks nothing is cut."""
        if self._tls is not None:
            transport = self._encrypted = TlsTransport(cast(asyncio.Transport, transport), self._tls)
        super().connection_made(transport)
        self._peers.add(self)
        self._late = asyncio.get_event_loop().call_later(HEAD_S, self.cut)
        if self._begin:
            self._receive(self._begin, None)

    def connection_lost(self, exc: Optional[BaseException]) -> None:
        """Forget the connection, which has ended."""
        self._peers.remove(self)
        self.begins()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Pass bytes on as far as the peer's share goes; beyond it the connection is cut."""
        self._receive(data, self._encrypted)

    def _receive(self, data: bytes, encrypted: Optional[TlsTransport]) -> None:
        """Count bytes as they come, and what they say; pass on what is within the share."""
        try:
            if self._bytes.spend(time.monotonic(), len(data)):
                text = data if encrypted is None else encrypted.decrypted(data)
                if not text:
                    return  # a part of a record, or none that says anything
                if self._is_within(text):
                    super().data_received(text)
                    return
        except Exception as error:  # of aiohttp's parser, such as ValueError for an address that is none; of TLS
            _LOG.debug("a request cannot be read: %s", error)
        self.cut()

    def _is_within(self, text: bytes) -> bool:
        """Return whether frames are within the share, and requests one at a time."""
        if self._is_page:
            return (self._frame_limit.spend(time.monotonic(), self._frames.feed(text))
                    and self._frames.unfinished <= LONGEST_MESSAGE)
        if self._is_answering:
            return False
        seen = self._tail + text
        end = seen.find(_END)
        self._is_answering = end >= 0
        self._tail = b"" if self._is_answering else seen[1 - len(_END):]
        return end < 0 or end + len(_END) == len(seen)

    def begins(self) -> None:
        """Note that a request has come."""
        if self._late is not None:
            self._late.cancel()
            self._late = None

    def answered(self) -> None:
        """Note that the request is answered: the next one may come."""
        self._is_answering = False

    def expect_frames(self, share: Share) -> None:
        """Count frames from now on, in place of requests."""
        self._is_page = True
        self.share(share)

    def cut(self) -> None:
        """End the connection at once."""
        if isinstance(self.transport, asyncio.WriteTransport):
            self.transport.abort()

    def handle_error(self, request: web.BaseRequest, status: int = 500, exc: Optional[BaseException] = None,
                     message: Optional[str] = None) -> web.StreamResponse:
        """Answer what cannot be answered, without a word about the server; raises ConnectionError in mid-answer."""
        if status >= 500:
            _LOG.error("a request failed", exc_info=exc)
        if request.writer.output_size > 0:
            raise ConnectionError("an answer is being sent")
        response = web.Response(status=status, text=HTTPStatus(status).phrase + "\n", headers=HEADERS)
        response.force_close()
        return response

    def log_exception(self, *args: Any, **kw: Any) -> None:
        """Log through this module, whose lines are limited."""
        _LOG.error(*args, **kw)
