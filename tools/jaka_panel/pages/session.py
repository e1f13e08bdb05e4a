"""One page: its messages in and out, what it watches, what it has set in motion."""
import asyncio
import json
from collections import deque
from typing import Any, Coroutine, Deque, Dict, List, Optional, Set, TypeVar

from aiohttp import web

from ..authority.jog_hold import DelayEstimate
from ..authority.rate_limiter import RateLimiter

COSTLY_RATE, COSTLY_BURST = 3.0, 15.0
"""Messages whose answers take milliseconds to make: curves, all that is known of an arm."""
_MOST_WAITING = 2000
"""Most messages that wait for a page; with more it is too slow, and closed."""
_EARLY_S = 0.005
"""Lead, s, with which a state may come and still counts as due: the loop wakes no more exactly."""
_REST_S = 0.5
"""Time, s, without motion after which an arm is no longer moved by a page: states come 30 times a second."""
_LONGEST_NAME = 60
"""Most characters of a page's name, which all others show."""
_CLOSE_S = 1.0
"""Longest wait, s, for a page's answer to the close; a dead one never gives it."""
T = TypeVar("T")


async def run_in(loop: asyncio.AbstractEventLoop, work: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine in this loop, whichever the caller's is; return what it returns, raise what it raises."""
    if loop is asyncio.get_event_loop():
        return await work
    return await asyncio.wrap_future(asyncio.run_coroutine_threadsafe(work, loop))


class Session:
    """A page that is connected. Its connection lives in the loop that made it, all else in the hub's.

    Attributes:
        id: Name that no other page ever has.
        name: Name that the page gives itself.
        may_command: True if it has the token, and this is no read-only panel.
        has_token: True if it has the token.
        why: Why it may not command.
        version: Version of this package.
        watched: Arms whose messages it receives.
        plots: True if it wants curves.
        heard_at: Reception of its last message, monotonic time, s.
        lateness: Delay of its messages.
        costly: Rate limiter of the messages whose answers are costly; visitors share one.
        waiting: Commands that are running.
        is_too_slow: True if it does not take what it is sent.
        address: Where its browser is, host and port, as far as its connection says.
    """

    def __init__(self, page: str, socket: web.WebSocketResponse, transport: Optional[asyncio.BaseTransport],
                 version: str, costly: RateLimiter, now: float) -> None:
        self.id, self.version, self.name = page, version, page
        self.may_command = self.has_token = False
        self.why = ""
        self.watched: Set[str] = set()
        self.plots = False
        self.heard_at = now
        self.lateness = DelayEstimate()
        self.costly = costly
        self.waiting = 0
        self.is_too_slow = False
        peer = None if transport is None else transport.get_extra_info("peername")
        self.address = "%s:%d" % tuple(peer[:2]) if isinstance(peer, tuple) and len(peer) > 1 else ""
        self._socket, self._transport, self._loop = socket, transport, asyncio.get_event_loop()
        self._period = 1.0 / 30.0
        self._texts: Deque[str] = deque()
        self._states: Dict[str, str] = {}
        self._state_at: Dict[str, float] = {}
        self._has_more = asyncio.Event()
        self._under_way: Dict[str, int] = {}
        self._moved: Dict[str, float] = {}

    def call_it(self, name: object) -> None:
        """Set the page's name, as it gives it: text of one line."""
        if isinstance(name, str) and name.strip():
            self.name = "".join(letter if letter.isprintable() else " " for letter in name.strip())[:_LONGEST_NAME]

    def watch(self, arms: Set[str], plots: bool, rate: float) -> None:
        """Set what the page wants to receive; rate: states a second of each arm."""
        self.watched, self.plots, self._period = arms, plots, 1.0 / rate
        self._states.clear()
        self._state_at.clear()

    # ---- out ----

    def send(self, message: Dict[str, Any]) -> None:
        """Queue a message; messages are sent in order, as the page can take them."""
        self.send_text(json.dumps(message))

    def send_text(self, text: str) -> None:
        """Queue a message that is JSON already."""
        if len(self._texts) >= _MOST_WAITING:
            self.is_too_slow = True
            return
        self._texts.append(text)
        self._wake()

    def send_state(self, arm: str, text: str, now: float) -> None:
        """Queue a state in place of an unsent one, so that a slow page gets the newest."""
        if now - self._state_at.get(arm, -1e9) < self._period - _EARLY_S:
            return
        self._state_at[arm] = now
        self._states[arm] = text
        self._wake()

    def _wake(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._has_more.set)
        except RuntimeError:
            self.is_too_slow = True  # its loop has ended

    async def write_for_ever(self) -> None:
        """Send what there is; returns when the page is gone."""
        try:
            while True:
                await self._has_more.wait()
                self._has_more.clear()
                while self._texts:
                    await self._socket.send_str(self._texts.popleft())
                while self._states:
                    await self._socket.send_str(self._states.popitem()[1])
        except (ConnectionError, RuntimeError):
            return  # it is closed; who reads it sees that, too

    async def end(self, code: int, why: str) -> None:
        """Close it, called in any loop; one that does not answer is cut."""
        await run_in(self._loop, self._end(code, why))

    async def _end(self, code: int, why: str) -> None:
        try:
            await asyncio.wait_for(self._socket.close(code=code, message=why.encode()), _CLOSE_S)
        except (asyncio.TimeoutError, ConnectionError, RuntimeError):
            pass
        if isinstance(self._transport, asyncio.WriteTransport) and not self._transport.is_closing():
            self._transport.abort()

    # ---- what it has set in motion ----

    def begins_motion(self, arm: str, now: float) -> None:
        """Note that the page has requested a motion."""
        self._under_way[arm] = self._under_way.get(arm, 0) + 1
        self._moved[arm] = now

    def ends_motion(self, arm: str, now: float) -> None:
        """Note that the request for a motion was answered; the arm may still move."""
        self._under_way[arm] = self._under_way.get(arm, 1) - 1
        self._moved[arm] = now

    def note_motion(self, arm: str, is_moving: bool, now: float) -> None:
        """Note whether an arm moves now."""
        if arm in self._moved and is_moving:
            self._moved[arm] = now

    def motions(self) -> List[str]:
        """Return the arms that move because of the page, as far as is known."""
        return list(self._moved)

    def look_at_motions(self, now: float) -> None:
        """Forget those that have come to rest."""
        for arm, at in list(self._moved.items()):
            if not self._under_way.get(arm) and now - at > _REST_S:
                del self._moved[arm]
