"""The loop that serves all service connections with a few threads; stops have an epoll and threads of their own.

A connection is armed for one event. The thread that takes the event serves the connection and arms it again: requests
of one connection stay in order, and nothing is handed from thread to thread. Handlers may block, some for minutes:
further threads are then started, and end when they are idle.
"""
import contextlib
import logging
import select
import threading
import time
from typing import Dict, Optional, Protocol

_LOG = logging.getLogger(__name__)

_STOP_THREADS = 2
"""Threads that wait for stops: a second stop finds one that waits while the first is being carried out."""
_OTHER_THREADS = 3
"""Threads that wait for all other calls: a few that wait for the controller's reply hold up no others."""
_LONG_CALL_S = 0.005
"""Time, s, after which a running call counts as one that blocks, and its thread is replaced."""
_SPARE_IDLE_S = 1.0
"""Time, s, without a call after which an additional thread ends."""
_MOST_AT_ONCE = 64
"""Most threads that are started at once; many blocking calls may come together."""
_RETRY_S = 0.01
"""Pause, s, after an epoll that failed."""
_LOG_PERIOD_S = 10.0
"""Shortest period, s, of the error that no thread can be started."""


class Served(Protocol):
    """A connection as the loop serves it. One thread at a time calls it."""

    def fileno(self) -> int: ...

    def serve(self) -> int:
        """Do what can be done now; return the epoll events to wait for next, 0 where the connection is to be closed."""
        ...

    def close(self) -> None: ...


class _Threads:
    """The threads that serve the connections of one epoll. At least one waits, or is about to be started."""

    def __init__(self, name: str, count: int) -> None:
        """Start the threads.

        Args:
            name: Of the threads.
            count: How many stay for good.
        """
        self._name = name
        self._count = count
        self._epoll = select.epoll()
        self._connections: Dict[int, Served] = {}
        self._lock = threading.Lock()
        self._waiting = 0
        self._logged_at = -_LOG_PERIOD_S
        self._began: Dict[int, float] = {}
        """The moment at which each thread that serves began to, monotonic time, s, by its identity."""
        self._start(count, stay=True)

    def add(self, connection: Served) -> None:
        """Serve a connection until it ends; raise OSError where the system has no room for it."""
        descriptor = connection.fileno()
        self._connections[descriptor] = connection
        try:
            self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLONESHOT)
        except OSError:
            del self._connections[descriptor]
            raise

    def _last_one_left(self) -> None:
        """Provide for the next event: the calling thread has left nobody who waits for it."""
        raise NotImplementedError

    def _start(self, count: int, stay: bool = False) -> None:
        """Start threads, which count as waiting from now on; log where the system has no more."""
        with self._lock:
            self._waiting += count
        for number in range(count):
            try:
                threading.Thread(target=self._work, args=(stay,), name=self._name, daemon=True).start()
            except RuntimeError as error:
                with self._lock:
                    self._waiting -= count - number
                if time.monotonic() - self._logged_at >= _LOG_PERIOD_S:
                    self._logged_at = time.monotonic()
                    _LOG.error("%s: no further thread can be started (%s); calls wait until a running one has ended",
                               self._name, error)
                return

    def _work(self, stays: bool) -> None:
        """Serve connections, one event after the other."""
        while True:
            try:
                ready = self._epoll.poll(None if stays else _SPARE_IDLE_S, 1)
            except OSError:
                _LOG.exception("%s: no connection can be waited for", self._name)
                time.sleep(_RETRY_S)
                continue
            if ready:
                self._serve(ready[0][0])
            elif self._may_end():
                return

    def _may_end(self) -> bool:
        with self._lock:
            if self._waiting == 1:  # all others serve, and this one would be missing
                return False
            self._waiting -= 1
            return True

    def _serve(self, descriptor: int) -> None:
        connection, me = self._connections[descriptor], threading.get_ident()
        with self._lock:
            self._waiting -= 1
            self._began[me] = time.monotonic()
            is_last = self._waiting == 0
        if is_last:
            self._last_one_left()
        events = 0
        try:
            events = connection.serve()
        except BaseException:  # whatever it is ends this connection, and no thread
            _LOG.exception("%s: a connection is closed", self._name)
        with self._lock:  # before the connection is armed: its next event is not to find one thread too few
            del self._began[me]
            self._waiting += 1
        if events:
            try:
                self._epoll.modify(descriptor, events | select.EPOLLONESHOT)
                return
            except OSError:
                _LOG.exception("%s: a connection cannot be waited for, and is closed", self._name)
        del self._connections[descriptor]
        with contextlib.suppress(OSError):  # whatever the system says of it, the thread goes on
            self._epoll.unregister(descriptor)
        with contextlib.suppress(OSError):
            connection.close()


class _StopThreads(_Threads):
    """The threads of the stops: whoever takes the last place has a further thread started before it serves."""

    def _last_one_left(self) -> None:
        self._start(1)


class _OtherThreads(_Threads):
    """The threads of all other calls: calls that turn out to be long have theirs replaced.

    Most calls take less time than the start of a thread, so that none is started for a call that is merely one of
    many.
    """

    def __init__(self, name: str, count: int) -> None:
        self._is_needed = threading.Event()
        super().__init__(name, count)
        threading.Thread(target=self._replace, name=name + ": long calls", daemon=True).start()

    def _last_one_left(self) -> None:
        self._is_needed.set()

    def _replace(self) -> None:
        """Start threads whenever none waits, in place of those whose calls are long."""
        while True:
            self._is_needed.wait()
            self._is_needed.clear()
            started = 0
            while not self._waiting:
                time.sleep(_LONG_CALL_S)
                missing = self._missing()
                if missing > 0:
                    started = min(max(missing, 2 * started), _MOST_AT_ONCE)
                    self._start(started)

    def _missing(self) -> int:
        """Return how many threads are missing, so that as many as ever wait or have a short call."""
        with self._lock:
            if self._waiting:
                return 0
            latest = time.monotonic() - _LONG_CALL_S
            return self._count - sum(began > latest for began in self._began.values())


class ServiceLoop:
    """The loop of a process; it starts with its first service, or with a connection that comes before."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stops: Optional[_Threads] = None
        self._others: Optional[_Threads] = None

    def start(self) -> None:
        """Start the threads, unless they run."""
        with self._lock:
            self._stops = self._stops or _StopThreads("stops", _STOP_THREADS)
            self._others = self._others or _OtherThreads("services", _OTHER_THREADS)

    def add(self, connection: Served, is_stop: bool) -> None:
        """Serve a connection until it ends.

        Args:
            connection: Its socket does not block.
            is_stop: Its service stops something: it is served by the threads of the stops.

        Raises:
            OSError: The system has no room for it.
        """
        self.start()
        threads = self._stops if is_stop else self._others
        assert threads is not None
        threads.add(connection)


SERVICE_LOOP = ServiceLoop()
