"""The WebSocket session of one page, from hello to the end (docs/panel.md, "Protocol")."""
import asyncio
import json
import math
import time
from typing import Any, Callable, Dict, Mapping, Optional

from aiohttp import WSMsgType, web

from .. import __version__
from ..authority.jog_hold import WrongHeartbeat, heartbeat_from
from ..record.history import KINDS, MOST_BUCKETS, SECONDS
from .access import Access
from .commands import COMMANDS, answer_to
from .hub import Hub
from .session import LONGEST_MESSAGE, Session

HELLO_S = 5.0
SUBPROTOCOL = "jaka-panel.v1"
_MOST_WAITING = 16
_WRONG_TOKEN_S = 0.5
_POLICY, _TOO_MANY = 1008, 1013
Message = Dict[str, Any]


class WebSocketSession:
    """The WebSocket session of one page: handles its messages, sends answers."""

    def __init__(self, hub: Hub, access: Access, page: Session) -> None:
        self._hub, self._access, self._page = hub, access, page
        self._is_refused_jog = -1
        self._parts: Dict[str, Callable[[Message], None]] = {
            "ping": self._ping, "watch": self._watch, "jog": self._jog, "jog_stop": self._jog_stop,
            "stop": self._stop, "cmd": self._command, "history": self._history, "take_control": self._take_control,
            "answer_control": self._answer_control, "release_control": self._release_control}

    async def hello(self, message: Message) -> bool:
        """Handle the first message; return False if it is no hello."""
        if message.get("t") != "hello" or message.get("v") != 1:
            return False
        page, given = self._page, message.get("token")
        page.call_it(message.get("name"))
        page.has_token = self._access.is_token(given)
        page.may_command = page.has_token and not self._hub.settings.read_only
        if not page.may_command:
            page.why = "read-only" if page.has_token else "no token" if given is None else "wrong token"
        if given is not None and not page.has_token:
            await asyncio.sleep(_WRONG_TOKEN_S)  # who guesses gets few tries
        page.heard_at = time.monotonic()
        page.send(self._hub.welcome(page))
        return True

    def take(self, message: Message) -> None:
        """Handle one message after hello."""
        part = self._parts.get(str(message.get("t")))
        if part is not None:
            part(message)

    # ---- watching ----

    def _ping(self, message: Message) -> None:
        clock, now = _number(message.get("clock")), time.monotonic()
        if clock is not None:
            self._page.lateness.of(clock / 1000.0, now)
        self._page.send({"t": "pong", "clock": clock, "now": round(now, 4)})

    def _watch(self, message: Message) -> None:
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

    def _history(self, message: Message) -> None:
        desk, what = self._hub.arms.get(str(message.get("arm"))), message.get("what")
        begin, end, buckets = _number(message.get("from")), _number(message.get("to")), message.get("buckets")
        answer: Message = {"t": "history", "id": message.get("id"), "ok": False, "what": what}
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

    # ---- control ----

    def _take_control(self, message: Message) -> None:
        if not self._may_command(message):
            return
        taken = self._hub.take_control(self._page)
        self._answer(message, taken, "" if taken else "the page that has control is asked", pending=not taken)

    def _answer_control(self, message: Message) -> None:
        self._hub.answer_control(self._page, message.get("give") is True)

    def _release_control(self, message: Message) -> None:
        self._hub.release_control(self._page)

    # ---- jog and stop ----

    def _jog(self, message: Message) -> None:
        page, hub = self._page, self._hub
        hold = message.get("hold")
        if hub.control.holder != page.id or not page.may_command:
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

    def _jog_stop(self, message: Message) -> None:
        hold = message.get("hold")
        if type(hold) is int:
            self._hub.jog.stop(self._page.id, hold)

    def _stop(self, message: Message) -> None:
        if not self._page.has_token:
            self._answer(message, False, "a stop needs the token")
            return
        arm = message.get("arm")
        if arm is not None and (not isinstance(arm, str) or arm not in self._hub.arms):
            self._answer(message, False, "no such arm")
            return
        self._hub.spawn(self._stop_and_answer(message, arm))

    async def _stop_and_answer(self, message: Message, arm: Optional[str]) -> None:
        begin = time.monotonic()
        error = await self._hub.stop(arm)
        self._answer(message, not error, error, took=round(time.monotonic() - begin, 4))

    # ---- commands ----

    def _command(self, message: Message) -> None:
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
            self._answer(message, False, "%d commands are under way" % _MOST_WAITING)
        else:
            self._hub.spawn(self._perform(message))

    async def _perform(self, message: Message) -> None:
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
        return self._page.may_command

    def _answer(self, message: Mapping[str, Any], ok: bool, text: str, **further: Any) -> None:
        self._page.send({"t": "answer", "id": message.get("id"), "ok": ok, "message": text, **further})

    def _error(self, code: str, text: str) -> None:
        self._page.send({"t": "error", "code": code, "message": text})


async def converse(hub: Hub, access: Access, request: web.Request) -> web.WebSocketResponse:
    """Serve one page until it ends."""
    socket = web.WebSocketResponse(max_msg_size=LONGEST_MESSAGE, protocols=(SUBPROTOCOL,), compress=False,
                                   timeout=1.0)
    await socket.prepare(request)
    if hub.connections >= hub.settings.pages:
        await socket.close(code=_TOO_MANY, message=b"too many pages")
        return socket
    hub.connections += 1
    page = Session(hub.next_page(), socket, request.transport, __version__, time.monotonic())
    session = WebSocketSession(hub, access, page)
    writer: asyncio.Future[None] = asyncio.ensure_future(page.write_for_ever())
    try:
        why = await _greeted(socket, session) or await _listen(socket, session, page)
        if why:
            await page.end(_POLICY, why)
    finally:
        hub.connections -= 1
        hub.leave(page)
        writer.cancel()
    return socket


async def _greeted(socket: web.WebSocketResponse, session: WebSocketSession) -> str:
    """Wait for hello; empty when it has come, else why the page is refused."""
    try:
        first = await asyncio.wait_for(socket.receive(), HELLO_S)
    except asyncio.TimeoutError:
        return "no hello"
    message = _object(first)
    return "" if message is not None and await session.hello(message) else "no hello"


async def _listen(socket: web.WebSocketResponse, session: WebSocketSession, page: Session) -> str:
    """Take messages until the page ends; why it is ended, empty where it has ended by itself."""
    async for received in socket:
        page.heard_at = time.monotonic()
        if not page.message_rate.spend(page.heard_at):
            return "too many messages"
        message = _object(received)
        if message is None:
            return "not a JSON object"
        session.take(message)
    return ""


def _object(received: Any) -> Optional[Message]:
    if received.type != WSMsgType.TEXT:
        return None
    try:
        message = json.loads(received.data)
    except (ValueError, RecursionError):
        return None
    return message if isinstance(message, dict) else None


def _number(value: Any) -> Optional[float]:
    """Return a finite number as it is; None for anything else."""
    return value if type(value) in (int, float) and math.isfinite(value) else None
