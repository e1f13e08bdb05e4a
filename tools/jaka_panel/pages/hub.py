"""Arms and pages: states to the pages, control, jog and stop."""
import asyncio
import itertools
import json
import logging
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Coroutine, Dict, List, Optional, Set

from ..authority.control import Control
from ..authority.jog_hold import (
    FRACTION,
    MISSED_S,
    PERIOD_S,
    SEEN_S,
    TRIP_S,
    Heartbeat,
    JogHold,
    Velocity,
)
from ..authority.rate_limiter import RateLimiter
from ..graph.arm_feed import STALE_S
from ..graph.arms import ArmFinder, Driver
from ..graph.calls import Calls
from ..plans.plan_store import LogDirectory, PlanStore
from ..settings import Settings
from . import simulator_link
from .arm_session import ArmSession
from .session import COSTLY_BURST, COSTLY_RATE, Session, T, run_in
from .shared_cell import SharedCell

_LOG = logging.getLogger(__name__)
RATE = 30.0
"""Rate, Hz, of the states for each page: a screen shows no more, and the driver is on the same computer."""
_VISITS_RATE, _VISITS_BURST = 5.0, 16.0
"""Visitors that may come in, a second and at once."""
LOOK_S = 2.0
"""Period, s, of the looks at the ROS graph and at simulated controllers: each asks the master for all of it."""
SILENT_S = 3.0
"""Longest silence, s, of a page, which sends something each half second; then it is closed."""
_JOG_LOOK_S = 0.02
"""Period, s, of the looks whether heartbeats still come: it adds to the time until a jog ends without them."""
_SAMPLE_S = 0.008
"""The driver's own period: two samples of the joints are so far apart unless the controller is slow."""
_BEHIND_S = 0.0025
"""Delay of messages to pages behind a sample, s, so that the work for them is over when the next one comes: the driver,
and a simulated controller on the same computer, would wait for it.
"""


def behind_a_sample(due: float, heard_at: float) -> float:
    """Return the first time from ``due`` on that lies behind a sample, by when the newest was received; monotonic, s.

    ``due`` itself where the newest is too old to tell when the next ones come.
    """
    if due - heard_at > STALE_S:
        return due
    return due + (heard_at + _BEHIND_S - due) % _SAMPLE_S


class Places:
    """The places for pages, in any thread: those with the token have theirs, and visitors half as many of their own."""

    def __init__(self, pages: int) -> None:
        self._most = {True: pages, False: max(1, pages // 2)}
        self._taken = {True: 0, False: 0}
        self._visits = RateLimiter(_VISITS_RATE, _VISITS_BURST, time.monotonic())
        self._lock = threading.Lock()

    def enter(self, has_token: bool) -> bool:
        """Take a place; return False where there is none, or too many visitors come in."""
        with self._lock:
            if self._taken[has_token] >= self._most[has_token]:
                return False
            if not has_token and not self._visits.spend(time.monotonic()):
                return False
            self._taken[has_token] += 1
            return True

    def leave(self, has_token: bool) -> None:
        """Give a place back."""
        with self._lock:
            self._taken[has_token] -= 1


class Hub:
    """The state that all pages share. Everything but ``_look`` runs in one event loop, the thread of stop and jog.

    Attributes:
        settings: Settings of the user.
        arms: Arms by the names of their drivers.
        pages: The pages that have said hello.
        control: The page that has control.
        jog: The button that is held.
        calls: Calls of services.
        plans: Plans that pages may run.
        logs: Folder of logs.
        cell: The data of the cell.
        places: The places for pages.
        visitors_costly: Rate limiter of visitors' messages whose answers are costly.
        arms_told: The newest message ``arms``, JSON.
        is_closing: True once the panel ends: stops are served, and nothing begins.
    """

    def __init__(self, settings: Settings, finder: ArmFinder) -> None:
        self.settings = settings
        self.arms: Dict[str, ArmSession] = {}
        self.pages: Dict[str, Session] = {}
        self.control = Control()
        self.jog = JogHold(self._say, self.tell)
        self.calls = Calls()
        self.plans = PlanStore()
        self.logs = LogDirectory(settings.logs)
        self.cell = SharedCell(settings.cell_data, settings.read_only, self.tell_all)
        self._finder = finder
        self._graph = ThreadPoolExecutor(1, "graph")
        self._looks: Optional[asyncio.Event] = None
        self.arms_told = json.dumps({"t": "arms", "arms": []})
        self.places = Places(settings.pages)
        self.visitors_costly = RateLimiter(COSTLY_RATE, COSTLY_BURST, time.monotonic())
        self._loop: Optional[asyncio.AbstractEventLoop] = None
        self._pages = itertools.count(1)
        self._tasks: Set[asyncio.Task[Any]] = set()
        self._stopping: Set[asyncio.Task[Any]] = set()
        self.is_closing = False
        self._jog_timer: Optional[asyncio.TimerHandle] = None

    # ---- begin and end ----

    def start(self) -> None:
        """Begin, in the loop."""
        self._loop = asyncio.get_event_loop()
        self._looks = asyncio.Event()
        for work in (self._tick_for_ever(), self._look_for_ever(), self._ask_simulators_for_ever(),
                     self.cell.follow_for_ever()):
            self.spawn(work)

    async def ask(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in the hub's loop, called in any."""
        assert self._loop is not None
        return await run_in(self._loop, work)

    def call(self, function: Callable[..., Any], *args: Any) -> None:
        """Call a function in the hub's loop, from any: at once where the caller is in it."""
        assert self._loop is not None
        if self._loop is asyncio.get_event_loop():
            function(*args)
        else:
            self._loop.call_soon_threadsafe(function, *args)

    def spawn(self, work: Any) -> "asyncio.Task[Any]":
        """Run a coroutine; what it raises is logged."""
        task: asyncio.Task[Any] = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: "asyncio.Task[Any]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            _LOG.error("a task failed", exc_info=task.exception())

    async def close(self) -> None:
        """Begin nothing more, end every jog, stop what pages have set in motion, release the drivers."""
        self.is_closing = True
        self.jog.end("the panel ends")
        pages = list(self.pages.values())
        await asyncio.gather(*(self._stop_motions(page) for page in pages), return_exceptions=True)
        await asyncio.gather(*(page.end(1001, "the panel ends") for page in pages), return_exceptions=True)
        await asyncio.gather(*self._stopping, return_exceptions=True)
        for task in list(self._tasks):
            task.cancel()
        for session in self.arms.values():
            session.close()
        self._graph.shutdown(wait=False)
        await self.cell.close()

    # ---- pages ----

    def next_page(self) -> str:
        """Return an id that no page had before."""
        return "p%d" % next(self._pages)

    def welcome(self, page: Session) -> Dict[str, Any]:
        """Register a page that has said hello; return its welcome."""
        self.pages[page.id] = page
        now = time.monotonic()
        return {"t": "welcome", "v": 1, "page": page.id, "may": "command" if page.may_command else "watch",
                "why": page.why, "read_only": self.settings.read_only, "now": round(now, 4),
                "wall": round(time.time(), 3), "version": page.version, "rate": int(RATE),
                "jog": {"period": PERIOD_S, "valid": SEEN_S, "missed": MISSED_S, "trip": TRIP_S,
                        "fraction": self.jog.fraction, "max_fraction": self.settings.jog_fraction},
                "control": self._control_for(page), "logs": self.logs.folder is not None, "arms": self._arms(now)}

    def leave(self, page: Session) -> None:
        """Remove a page that has gone: end its hold, stop what it has set in motion."""
        if self.pages.pop(page.id, None) is None:
            return
        self._end_jog_of(page.id, "the page has gone")
        self.jog.forget(page.id)
        self.cell.forget(page.id)
        before = self.control.holder
        if self.control.leave(page.id):
            self._control_changed(before)
        task = self.spawn(self._stop_motions(page))
        self._stopping.add(task)
        task.add_done_callback(self._stopping.discard)

    async def _stop_motions(self, page: Session) -> None:
        arms = [arm for arm in page.motions() if arm in self.arms]
        errors = await asyncio.gather(*(self.stop(arm) for arm in arms), return_exceptions=True)
        for arm, error in zip(arms, errors):
            self.arms[arm].feed.note("error" if error else "warning", "the page that moved the arm has gone: %s" % (
                "its stop is NOT confirmed: %s" % error if error else "stopped"))

    def tell(self, page: str, message: Dict[str, Any]) -> None:
        """Send a message to one page; drop it if the page has gone."""
        if page in self.pages:
            self.pages[page].send(message)

    def tell_all(self, message: Dict[str, Any]) -> None:
        """Send a message to all pages."""
        text = json.dumps(message)
        for page in list(self.pages.values()):
            page.send_text(text)

    def watch(self, page: Session) -> None:
        """Send a page all that is known of the arms that it has begun to watch."""
        now = time.monotonic()
        for arm in page.watched:
            session = self.arms.get(arm)
            if session is None:
                continue
            state = session.next_state(now, True)
            for message in [state, *session.named(session.feed.snapshot(now))]:
                if message is not None:
                    page.send(message)
        if self._looks is not None:
            self._looks.set()

    # ---- control ----

    def take_control(self, page: Session) -> bool:
        """Request control for a page; return False if the holder is asked first."""
        before = self.control.holder
        taken = self.control.take(page.id, time.monotonic())
        if not taken or before != page.id:
            self._control_changed(before)
        return taken

    def answer_control(self, page: Session, give: bool) -> None:
        """Answer the pending request for control, for its holder."""
        before, asker = self.control.holder, self.control.answer(page.id, give)
        if asker is not None:
            if not give:
                self.tell(asker, {"t": "error", "code": "control_refused", "message": "%s keeps control" % page.name})
            self._control_changed(before)

    def release_control(self, page: Session) -> None:
        """Release a page's control."""
        before = self.control.holder
        if self.control.leave(page.id):
            self._control_changed(before)

    def _control_changed(self, before: Optional[str] = None) -> None:
        """Notify all pages; where control has changed hands, first end what the previous holder held."""
        if before is None or self.control.holder != before:
            self._end_jog_of(None, "control lost")
            self.set_jog_fraction(min(FRACTION, self.settings.jog_fraction))
            holder = self.pages.get(self.control.holder or "")
            for session in self.arms.values():
                session.feed.note("info", "nobody has control" if holder is None else "control: %s" % holder.name)
        for page in list(self.pages.values()):
            page.send({"t": "control", **self._control_for(page)})

    def _control_for(self, page: Session) -> Dict[str, Any]:
        holder, asked = self.pages.get(self.control.holder or ""), self.control.asked
        asker = self.pages.get(asked.page) if asked is not None else None
        return {"holder": None if holder is None else {"page": holder.id, "name": holder.name},
                "you": self.control.holder == page.id,
                "asked": None if asked is None or asker is None else {
                    "page": asker.id, "name": asker.name, "until": round(asked.until, 3)}}

    def set_jog_fraction(self, fraction: float) -> None:
        """Set the share of the driver's jog limits from now on."""
        self.jog.fraction = fraction
        self.tell_all({"t": "jog_speed", "fraction": fraction})

    # ---- jog and stop ----

    def heartbeat(self, page: Session, beat: Heartbeat, lateness: float) -> None:
        """Handle a heartbeat of the page that has control."""
        now = time.monotonic()
        session = self.arms[beat.arm]
        if not session.jog.is_heard(beat.space):
            self.jog.refuse(page.id, beat, "the driver does not listen to this panel")
            return
        self.jog.heartbeat(page.id, beat, lateness, session.place(now), session.limits, now)
        if self.jog.arm is not None and self._jog_timer is None:
            self._jog_timer = asyncio.get_event_loop().call_later(_JOG_LOOK_S, self._look_at_jog)

    def _look_at_jog(self) -> None:
        """Look whether heartbeats still come, as long as something is held."""
        self._jog_timer = None
        arm = self.jog.arm
        if arm is None:
            return
        self.jog.tick(time.monotonic())
        if self.jog.arm is None:
            self.arms[arm].feed.note("warning", "the jog has ended: its heartbeats did not come")
        else:
            self._jog_timer = asyncio.get_event_loop().call_later(_JOG_LOOK_S, self._look_at_jog)

    def _end_jog_of(self, page: Optional[str], why: str) -> None:
        """End the hold, of this page or of any."""
        if page is None or page == self.control.holder:
            self.jog.end(why)

    def _say(self, velocity: Velocity) -> None:
        session = self.arms.get(velocity.arm)
        if session is not None:
            session.jog.publish(velocity.space, velocity.values)

    async def stop(self, arm: Optional[str]) -> str:
        """Stop one arm, or all; return which did not confirm it, empty if all have stopped."""
        self.jog.end("stopped", arm)
        sessions = [self.arms[arm]] if arm is not None else list(self.arms.values())
        for session in sessions:
            session.cancel()
        errors = await asyncio.gather(*(session.stopper.stop() for session in sessions))
        return "; ".join("%s: %s" % (session.driver.node, error) for session, error in zip(sessions, errors) if error)

    # ---- over and over ----

    async def _tick_for_ever(self) -> None:
        due = time.monotonic()
        while True:
            due = max(due + 1.0 / RATE, time.monotonic())
            heard = max((session.feed.joints_heard_at for session in self.arms.values()), default=-1e9)
            await asyncio.sleep(behind_a_sample(due, heard) - time.monotonic())
            try:
                self._tick(time.monotonic())
            except Exception:  # whatever it was, pages are told on, and who is silent is let go
                _LOG.exception("a tick failed")

    def _tick(self, now: float) -> None:
        watched = {arm for page in self.pages.values() for arm in page.watched}
        for arm, session in self.arms.items():
            readers = [page for page in self.pages.values() if arm in page.watched]
            for message in session.named(session.feed.take_news(now)):
                _send_all(readers, message)
            plot = session.next_plot(now)
            if arm not in watched:
                continue
            if plot is not None:
                _send_all([page for page in readers if page.plots], plot)
            state = session.next_state(now)
            if state is not None:
                text = json.dumps(state)
                for page in readers:
                    page.send_state(arm, text, now)
        before = self.control.holder
        if self.control.tick(now):
            self._control_changed(before)
        for page in list(self.pages.values()):
            for arm in page.motions():
                page.note_motion(arm, arm in self.arms and self.arms[arm].is_moving(now), now)
            page.look_at_motions(now)
            why = "silent" if now - page.heard_at > SILENT_S else "too slow" if page.is_too_slow else ""
            if why:
                self.leave(page)
                self.spawn(page.end(1001 if why == "silent" else 1008, why))

    async def _look_for_ever(self) -> None:
        assert self._looks is not None
        loop = asyncio.get_event_loop()
        while True:
            self._looks.clear()
            watched = {arm for page in self.pages.values() for arm in page.watched}
            try:
                self.arms.update(await loop.run_in_executor(self._graph, self._look, dict(self.arms), watched))
                self._tell_arms()
            except Exception:  # such as a master that has gone in the middle of it; the next look may be better
                _LOG.exception("a look at the ROS graph failed")
            try:
                await asyncio.wait_for(self._looks.wait(), LOOK_S)
            except asyncio.TimeoutError:
                pass

    def _look(self, arms: Dict[str, ArmSession], watched: Set[str]) -> Dict[str, ArmSession]:
        """Ask the master, subscribe and advertise, in a thread that may wait; the arms that are there from now on."""
        found: Optional[Dict[str, Driver]] = self._finder.find()
        now = time.monotonic()
        for node, driver in (found or {}).items():
            if node not in arms:
                arms[node] = ArmSession(driver, self.settings.simulator_port)
        for node, session in arms.items():
            session.is_listed = found is None or node in found
            session.look((found or {}).get(node, session.driver), node in watched, now)
        return arms

    async def _ask_simulators_for_ever(self) -> None:
        while True:
            for session in list(self.arms.values()):
                session.simulator_port = self.settings.simulator_port or session.driver.simulator_port
                session.has_simulator = bool(session.feed.simulated and session.simulator_port) and bool(
                    (await simulator_link.ask(session.simulator_port, {"action": "state"})).get("ok"))
            await asyncio.sleep(LOOK_S)

    def _arms(self, now: float) -> List[Dict[str, Any]]:
        return [session.shown(now) for _, session in sorted(self.arms.items())]

    def _tell_arms(self) -> None:
        """Send the arms to all pages if anything has changed."""
        text = json.dumps({"t": "arms", "arms": self._arms(time.monotonic())})
        if text != self.arms_told:
            self.arms_told = text
            for page in list(self.pages.values()):
                page.send_text(text)


def _send_all(pages: List[Session], message: Dict[str, Any]) -> None:
    if pages:
        text = json.dumps(message)
        for page in pages:
            page.send_text(text)
