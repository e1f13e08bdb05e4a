"""The WebSocket session of one page, from hello to the end (docs/panel.md, "Protocol")."""
import asyncio
import logging
import math
import time
from typing import Any, Callable, Dict, Mapping, Optional

from aiohttp import WSMsgType, web

from jaka_bag.json_text import load_json

from .. import __version__
from ..authority.jog_hold import WrongHeartbeat, heartbeat_from
from ..authority.rate_limiter import RateLimiter
from ..record.history import KINDS, MOST_BUCKETS, SECONDS
from .access import HEADERS, Access
from .commands import COMMANDS, answer_to
from .hub import Hub
from .peer import LONGEST_MESSAGE, OPERATOR, VISITOR, Peer
from .session import COSTLY_BURST, COSTLY_RATE, Session

_LOG = logging.getLogger(__name__)
HELLO_S = 5.0
"""Longest wait, s, for a page's first message: a connection that says nothing takes a place."""
SUBPROTOCOL = "jaka-panel.v1"
_MOST_WAITING = 16
"""Most commands of a page at a time: a page that asks for ever must not take all threads."""
_LONGEST_WHOLE = 18
"""Most digits that are read as a whole number: Python takes long for long ones, and 18 fit into 64 bits."""
_WRONG_TOKEN_S = 0.5
"""Pause, s, after a wrong token."""
_POLICY, _TOO_MANY = 1008, 1013
_Message = Dict[str, Any]


class WebSocketSession:
    """The WebSocket session of one page: handles its messages, sends answers."""

    def __init__(self, hub: Hub, access: Access, page: Session) -> None:
        self._hub, self._access, self._page = hub, access, page
        self._is_refused_jog = -1
        self._parts: Dict[str, Callable[[_Message], None]] = {
            "ping": self._ping, "watch": self._watch, "jog": self._jog, "jog_stop": self._jog_stop,
            "stop": self._stop, "cmd": self._command, "history": self._history, "take_control": self._take_control,
            "answer_control": self._answer_control, "release_control": self._release_control,
            "cell": self._cell}

    def hello(self, message: _Message) -> None:
        """Answer the first message."""
        page, given = self._page, message.get("token")
        page.call_it(message.get("name"))
        page.has_token = page.has_token or self._access.is_token(given)
        page.may_command = page.has_token and not self._hub.settings.read_only
        if not page.may_command:
            page.why = "read-only" if page.has_token else "no token" if given is None else "wrong token"
        page.heard_at = time.monotonic()
        page.send(self._hub.welcome(page))

    def take(self, message: _Message) -> None:
        """Handle one message after hello; one that cannot be handled changes nothing."""
        part = self._parts.get(str(message.get("t")))
        try:
            if part is not None:
                part(message)
        except Exception:  # whatever a page sends, the others are served on
            _LOG.exception("a message of a page failed")
            self._error("bad_message", "this message cannot be handled")

    # ---- watching ----

    def _ping(self, message: _Message) -> None:
        clock, now = _number(message.get("clock")), time.monotonic()
        if clock is not None:
            self._page.lateness.of(clock / 1000.0, now)
        self._page.send({"t": "pong", "clock": clock, "now": round(now, 4)})

    def _watch(self, message: _Message) -> None:
        arms, rate = message.get("arms"), _number(message.get("rate", 30))
        if not isinstance(arms, list) or rate is None:
            self._error("bad_message", "watch needs a list of arms and a rate")
            return
        if not self._page.costly.spend(time.monotonic()):
            self._error("rate", "too many requests that are costly to answer")
            return
        self._page.watch({arm for arm in arms if isinstance(arm, str) and arm in self._hub.arms},
                         message.get("plots") is True, min(30.0, max(1.0, rate)))
        self._hub.watch(self._page)

    def _history(self, message: _Message) -> None:
        desk, what = self._hub.arms.get(str(message.get("arm"))), message.get("what")
        begin, end, buckets = _number(message.get("from")), _number(message.get("to")), message.get("buckets")
        answer: _Message = {"t": "history", "id": message.get("id"), "ok": False, "what": what}
        if desk is None or not isinstance(what, str) or what not in KINDS or begin is None or end is None or (
                type(buckets) is not int or not 1 <= buckets <= MOST_BUCKETS or not -SECONDS <= begin < end <= 0.0):
            self._page.send({**answer, "message": "from and to: s, -%g to 0; buckets: 1 to %d; what: one of %s" % (
                SECONDS, MOST_BUCKETS, ", ".join(KINDS))})
            return
        now = time.monotonic()
        if not self._page.costly.spend(now):
            self._page.send({**answer, "message": "too many requests that are costly to answer"})
            return
        self._page.send({**answer, "ok": True, **desk.feed.history.shortened(what, now + begin, now + end, buckets)})

    def _cell(self, message: _Message) -> None:
        if self._page.costly.spend(time.monotonic()):
            self._page.send_text(self._hub.cell.told)
        else:
            self._error("rate", "too many requests that are costly to answer")

    # ---- control ----

    def _take_control(self, message: _Message) -> None:
        if not self._may_command(message):
            return
        taken = self._hub.take_control(self._page)
        self._answer(message, taken, "" if taken else "the page that has control is asked", pending=not taken)

    def _answer_control(self, message: _Message) -> None:
        self._hub.answer_control(self._page, message.get("give") is True)

    def _release_control(self, message: _Message) -> None:
        self._hub.release_control(self._page)

    # ---- jog and stop ----

    def _jog(self, message: _Message) -> None:
        page, hub = self._page, self._hub
        hold = message.get("hold")
        if hub.control.holder != page.id or not page.may_command or hub.is_closing:
            if hold != self._is_refused_jog:  # once for each press
                self._is_refused_jog = hold if type(hold) is int else -1
                self._error("no_control" if page.may_command else "no_token", "only a page that has control jogs")
            return
        try:
            beat = heartbeat_from(message)
        except WrongHeartbeat as error:
            hub.jog.end("refused: %s" % error)
            self._error("bad_message", str(error))
            return
        if beat.arm in hub.arms:
            hub.heartbeat(page, beat, page.lateness.of(beat.clock, time.monotonic()))

    def _jog_stop(self, message: _Message) -> None:
        hold = message.get("hold")
        if type(hold) is int:
            self._hub.jog.stop(self._page.id, hold)

    def _stop(self, message: _Message) -> None:
        if not self._page.has_token:
            self._answer(message, False, "a stop needs the token")
            return
        arm = message.get("arm")
        if arm is not None and (not isinstance(arm, str) or arm not in self._hub.arms):
            self._answer(message, False, "no such arm")
            return
        self._hub.spawn(self._stop_and_answer(message, arm))

    async def _stop_and_answer(self, message: _Message, arm: Optional[str]) -> None:
        begin = time.monotonic()
        error = await self._hub.stop(arm)
        now = time.monotonic()
        self._answer(message, not error, error, took=round(now - begin, 4), now=round(now, 4))

    # ---- commands ----

    def _command(self, message: _Message) -> None:
        command = COMMANDS.get(str(message.get("cmd")))
        if command is None:
            self._answer(message, False, "no such command")
        elif not self._page.has_token:
            self._answer(message, False, "this needs the token")
        elif command.needs_control and not self._may_command(message):
            return
        elif command.needs_control and self._hub.control.holder != self._page.id:
            self._answer(message, False, "this needs control")
        elif self._page.waiting >= _MOST_WAITING:
            self._answer(message, False, "%d commands are running" % _MOST_WAITING)
        else:
            self._hub.spawn(self._perform(message))

    async def _perform(self, message: _Message) -> None:
        self._page.waiting += 1
        begin = time.monotonic()
        try:
            outcome = await answer_to(self._hub, self._page, message)
            self._answer(message, outcome.ok, outcome.message, data=outcome.data,
                         took=round(time.monotonic() - begin, 4))
        finally:
            self._page.waiting -= 1

    def _may_command(self, message: Mapping[str, Any]) -> bool:
        if not self._page.may_command:
            self._answer(message, False, "this panel is read-only" if self._page.has_token else "this needs the token")
        elif self._hub.is_closing:
            self._answer(message, False, "the panel ends")
        return self._page.may_command and not self._hub.is_closing

    def _answer(self, message: Mapping[str, Any], ok: bool, text: str, **further: Any) -> None:
        self._page.send({"t": "answer", "id": message.get("id"), "ok": ok, "message": text, **further})

    def _error(self, code: str, text: str) -> None:
        self._page.send({"t": "error", "code": code, "message": text})


async def converse(hub: Hub, access: Access, request: web.Request) -> web.WebSocketResponse:
    """Serve one page until it ends."""
    has_token = access.offers_token(request.headers)
    peer = request.protocol
    assert isinstance(peer, Peer)
    peer.expect_frames(OPERATOR if has_token else VISITOR)
    socket = web.WebSocketResponse(max_msg_size=LONGEST_MESSAGE, protocols=(SUBPROTOCOL,), compress=False,
                                   timeout=1.0)
    socket.headers.update(HEADERS)
    await socket.prepare(request)
    if not hub.places.enter(has_token):
        await socket.close(code=_TOO_MANY, message=b"too many pages")
        return socket
    peer.has_place = True
    now = time.monotonic()
    costly = RateLimiter(COSTLY_RATE, COSTLY_BURST, now) if has_token else hub.visitors_costly
    page = Session(hub.next_page(), socket, request.transport, __version__, costly, now)
    page.has_token = has_token
    session = WebSocketSession(hub, access, page)
    writer: asyncio.Future[None] = asyncio.ensure_future(page.write_for_ever())
    try:
        why = await _greeted(socket, hub, access, session) or await _listen(socket, hub, session, page)
        if why:
            await page.end(_POLICY, why)
    finally:
        hub.places.leave(has_token)
        hub.call(hub.leave, page)
        writer.cancel()
    return socket


async def _greeted(socket: web.WebSocketResponse, hub: Hub, access: Access, session: WebSocketSession) -> str:
    """Wait for hello; empty when it has come, else why the page is refused."""
    try:
        message = _object(await asyncio.wait_for(socket.receive(), HELLO_S))
    except asyncio.TimeoutError:
        return "no hello"
    if message is None or message.get("t") != "hello" or message.get("v") != 1:
        return "no hello"
    given = message.get("token")
    if given is not None and not access.is_token(given):
        await asyncio.sleep(_WRONG_TOKEN_S)  # who guesses gets few tries
    hub.call(session.hello, message)
    return ""


async def _listen(socket: web.WebSocketResponse, hub: Hub, session: WebSocketSession, page: Session) -> str:
    """Take messages until the page ends; why it is ended, empty where it has ended by itself."""
    async for received in socket:
        page.heard_at = time.monotonic()
        message = _object(received)
        if message is None:
            return "not a JSON object"
        hub.call(session.take, message)
    return ""


def _object(received: Any) -> Optional[_Message]:
    if received.type != WSMsgType.TEXT:
        return None
    try:
        message = load_json(received.data, parse_int=_whole)
    except ValueError:
        return None
    return message if isinstance(message, dict) else None


def _whole(digits: str) -> float:
    """Return a whole number; as a float, which may be infinite, where it is longer than any that is meant."""
    return int(digits) if len(digits) <= _LONGEST_WHOLE else float(digits)


def _number(value: Any) -> Optional[float]:
    """Return a finite number as it is; None for anything else."""
    return value if type(value) in (int, float) and math.isfinite(value) else None
