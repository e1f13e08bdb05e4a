"""The stop of one driver: a thread and a connection that serve nothing else, and another one where they hang."""
import asyncio
import logging
import queue
import threading
import time
from typing import Any, Callable, Optional
from urllib.parse import urlsplit

import rosgraph
import rospy

from jaka_bag.errors import ConnectionLost
from jaka_bag.live.tcpros import resolve

from .stop_link import Address, StopLink

_LOG = logging.getLogger(__name__)
_SECOND_WAY_S = 0.15
"""Time without an answer, s, after which a stop is sent on a second connection; to stop twice does no harm, and one is
to be on the controller's wire by 0.25 s."""
_GIVE_UP_S = 0.9
"""Time, s, after which a stop is not confirmed: before the page's own second is over."""
_MOST_THREADS = 8
"""Most second connections at a time: a driver that hangs must not take all threads of the panel."""

Done = Callable[[str], None]
"""Told an empty text when the stop was served, else why not."""


class Stopper:
    """Stops what a driver moves."""

    def __init__(self, node: str) -> None:
        """Prepare stops of the driver ``node``; the connection is made at the first stop, and kept."""
        self._service = node + "/stop_move"
        self._address: Optional[Address] = None
        self._asked: queue.Queue[Any] = queue.Queue()
        self._besides = 0
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="stop", daemon=True)
        self._thread.start()

    def find(self) -> None:
        """Ask the master where the driver is, in a thread that may wait: a stop waits for no master."""
        try:
            parts = urlsplit(rosgraph.Master(rospy.get_name()).lookupService(self._service))
            self._address = resolve(parts.hostname or "", parts.port or 0)
        except (rosgraph.MasterException, ConnectionLost, OSError, ValueError) as error:
            _LOG.debug("the stop of a driver is not found: %s", error)

    async def stop(self) -> str:
        """Have the driver stop; empty when it has, else why it is not known to have."""
        loop = asyncio.get_event_loop()
        answers: asyncio.Queue[str] = asyncio.Queue()

        def done(error: str) -> None:
            loop.call_soon_threadsafe(answers.put_nowait, error)

        async def answer(deadline: float) -> Optional[str]:
            """Return the next answer; None where there is none by the deadline."""
            try:
                return await asyncio.wait_for(answers.get(), max(0.0, deadline - time.monotonic()))
            except asyncio.TimeoutError:
                return None

        now = time.monotonic()
        until = now + _GIVE_UP_S
        self._asked.put((done, until))
        error = await answer(now + _SECOND_WAY_S)
        if error == "":
            return ""
        self._on_its_own(done, until)
        errors = [error] if error else []
        while len(errors) < 2:
            error = await answer(until)
            if error == "":
                return ""
            if error is None:
                return "; ".join(errors) or "no answer for %g s" % _GIVE_UP_S
            errors.append(error)
        return "; ".join(errors)

    def close(self) -> None:
        """End the thread, when it is free."""
        self._asked.put(None)

    def _run(self) -> None:
        link = self._link()
        while True:
            asked = self._asked.get()
            if asked is None:
                break
            done, until = asked
            error = self._call(link, until)
            if error:  # the driver may have closed a connection that was idle, or have been started anew
                error = self._call(link, until)
            _tell(done, error)
        link.close()

    def _link(self) -> StopLink:
        return StopLink(rospy.get_name(), self._service)

    def _call(self, link: StopLink, until: float) -> str:
        """Have the driver stop; empty when it has, else why it is not known to have."""
        if self._address is None:
            return "it is not known where the driver is"
        try:
            link.call(self._address, until)
            return ""
        except OSError as error:
            return str(error)

    def _on_its_own(self, done: Done, until: float) -> None:
        with self._lock:
            if self._besides >= _MOST_THREADS:
                done("%d stops hang" % self._besides)
                return
            self._besides += 1

        def work() -> None:
            link = self._link()
            error = self._call(link, until)
            if error and time.monotonic() < until:
                self.find()
                error = self._call(link, until)
            link.close()
            with self._lock:
                self._besides -= 1
            _tell(done, error)

        threading.Thread(target=work, name="stop besides", daemon=True).start()


def _tell(done: Done, error: str) -> None:
    try:
        done(error)
    except RuntimeError:
        _LOG.debug("the loop has ended before a stop")
