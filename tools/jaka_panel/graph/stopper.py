"""The stop of one driver: a thread and a connection that serve nothing else, and another one where they hang."""
import asyncio
import logging
import queue
import threading
from typing import Any, Callable, List

import rospy
from std_srvs.srv import Empty

_LOG = logging.getLogger(__name__)
_SECOND_WAY_S = 0.3
"""Time without an answer, s, after which a stop is sent on a second connection; to stop twice does no harm."""
_GIVE_UP_S = 5.0
_MOST_THREADS = 8

Done = Callable[[str], None]
"""Told an empty text when the stop was served, else why not."""


class Stopper:
    """Stops what a driver moves."""

    def __init__(self, node: str) -> None:
        """Prepare stops of the driver ``node``; the connection is made at the first stop, and kept."""
        self._service = node + "/stop_move"
        self._asked: queue.Queue[Any] = queue.Queue()
        self._besides = 0
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="stop", daemon=True)
        self._thread.start()

    async def stop(self) -> str:
        """Have the driver stop; empty when it has, else why it is not known to have."""
        loop = asyncio.get_event_loop()
        first: asyncio.Future[str] = loop.create_future()
        errors: List[str] = []

        def told(error: str) -> None:
            if error:
                errors.append(error)
            if not first.done() and (not error or len(errors) == 2):  # both ways have failed
                first.set_result(error)

        def done(error: str) -> None:
            loop.call_soon_threadsafe(told, error)

        self._asked.put(done)
        try:
            return await asyncio.wait_for(asyncio.shield(first), _SECOND_WAY_S)
        except asyncio.TimeoutError:
            pass
        self._on_its_own(done)
        try:
            return await asyncio.wait_for(first, _GIVE_UP_S)
        except asyncio.TimeoutError:
            return "; ".join(errors) or "no answer for %g s" % _GIVE_UP_S

    def close(self) -> None:
        """End the thread, when it is free."""
        self._asked.put(None)

    def _run(self) -> None:
        proxy: Any = None
        while True:
            done = self._asked.get()
            if done is None:
                break
            error = "not asked"
            for _ in range(2):  # the driver may have closed a connection that was idle, or have been started anew
                try:
                    if proxy is None:
                        proxy = rospy.ServiceProxy(self._service, Empty, persistent=True)
                    proxy()
                    error = ""
                    break
                except (rospy.ServiceException, rospy.ROSException, OSError) as raised:
                    error = str(raised)
                    _close(proxy)
                    proxy = None
            _tell(done, error)
        _close(proxy)

    def _on_its_own(self, done: Done) -> None:
        with self._lock:
            if self._besides >= _MOST_THREADS:
                done("%d stops hang" % self._besides)
                return
            self._besides += 1

        def work() -> None:
            error = ""
            try:
                rospy.ServiceProxy(self._service, Empty)()
            except (rospy.ServiceException, rospy.ROSException, OSError) as raised:
                error = str(raised)
            finally:
                with self._lock:
                    self._besides -= 1
            _tell(done, error)

        threading.Thread(target=work, name="stop besides", daemon=True).start()


def _close(proxy: Any) -> None:
    if proxy is not None:
        try:
            proxy.close()
        except OSError as error:
            _LOG.debug("closing: %s", error)


def _tell(done: Done, error: str) -> None:
    try:
        done(error)
    except RuntimeError:
        _LOG.debug("the loop has ended before a stop")
