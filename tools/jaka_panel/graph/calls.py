"""Calls of services in threads of their own: one that hangs holds up nobody else."""
import asyncio
import logging
import threading
from typing import Any, Callable

_LOG = logging.getLogger(__name__)
MOST_CALLS = 32
"""Threads at once; those of calls that hang count until they return."""


class TooManyCalls(RuntimeError):
    """Refusal of a call, as too many are still waiting."""


class NoAnswer(RuntimeError):
    """A call did not return in time; it may still be carried out."""


class Calls:
    """A runner of blocking functions, for one event loop."""

    def __init__(self) -> None:
        self._count = 0
        self._lock = threading.Lock()

    async def run(self, function: Callable[[], Any], timeout: float) -> Any:
        """Run the function in a thread of its own; return what it returns, raise what it raises.

        Raises:
            TooManyCalls: ``MOST_CALLS`` are running.
            NoAnswer: It did not return within ``timeout``, s.
        """
        with self._lock:
            if self._count >= MOST_CALLS:
                raise TooManyCalls("%d calls are running" % self._count)
            self._count += 1
        loop = asyncio.get_event_loop()
        done: asyncio.Future[Any] = loop.create_future()

        def tell(result: Any, error: Any) -> None:
            if not done.done():
                if error is None:
                    done.set_result(result)
                else:
                    done.set_exception(error)

        def work() -> None:
            result, error = None, None
            try:
                result = function()
            except Exception as raised:  # whatever it is, it is told to the page, and this thread ends
                error = raised
            finally:
                with self._lock:
                    self._count -= 1
            try:
                loop.call_soon_threadsafe(tell, result, error)
            except RuntimeError:
                _LOG.debug("the loop has ended before a call")

        threading.Thread(target=work, name="call", daemon=True).start()
        try:
            return await asyncio.wait_for(done, timeout)
        except asyncio.TimeoutError:
            raise NoAnswer("no answer for %g s" % timeout) from None
