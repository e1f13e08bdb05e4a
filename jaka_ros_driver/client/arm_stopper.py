"""The guard's part that stops the arm: carries out what stopping.py decides, and answers the driver meanwhile."""
import select
import time
from typing import List, Optional, Union

from jaka_ros_driver.client.driver_pipe import STOPPING, WATCHING, DriverPipe, Say
from jaka_ros_driver.client.stop_link import Address, FeedLink, Line, StopLink, TurnedAway, addresses_of
from jaka_ros_driver.client.stopping import Step, Stopping
from jaka_ros_driver.errors import ConnectionLost

_TURN_S = 0.02
_FEED_PERIOD_S = 0.25
_FEED_TIMEOUT_S = 1.0

_Source = Union[DriverPipe, Line]


class Feed:
    """The status feed while the arm is being stopped: connected as soon as it can be."""

    def __init__(self, addresses: List[Address]) -> None:
        self._addresses = addresses
        self._tries = 0
        self._next_at = 0.0
        self._heard_at = 0.0
        self.link: Optional[FeedLink] = None

    def serve(self, stopping: Stopping, is_ready: bool, now: float) -> None:
        """Tell ``stopping`` what the feed shows, or why it shows nothing."""
        try:
            if self.link is None:
                self._connect(now)
            elif is_ready:
                self._read(self.link, stopping, now)
            elif now - self._heard_at > _FEED_TIMEOUT_S:
                raise ConnectionLost("status port: silent for %.1f s" % _FEED_TIMEOUT_S)
        except ConnectionLost as error:
            self.close()
            self._next_at = now + _FEED_PERIOD_S
            stopping.saw_nothing(str(error))

    def _connect(self, now: float) -> None:
        if now < self._next_at:
            return
        self._next_at, self._heard_at = now + _FEED_PERIOD_S, now
        self.link = FeedLink(_next_of(self._addresses, self._tries))
        self._tries += 1

    def _read(self, link: FeedLink, stopping: Stopping, now: float) -> None:
        if link.is_connecting:
            link.finish_connecting()
            return
        for state in link.states(now):
            self._heard_at = now
            stopping.saw(state, now)
        if link.trouble:
            stopping.saw_nothing(link.trouble)

    def close(self) -> None:
        """Close the connection, if there is one."""
        if self.link is not None:
            self.link.close()
            self.link = None


class ArmStopper:
    """Stops the arm, and answers the driver meanwhile."""

    def __init__(self, host: str, command_port: int, status_port: int, say: Say) -> None:
        """Resolve the controller's name now, because that may take too long when the arm must be stopped."""
        self._host = host
        self._ports = (command_port, status_port)
        self._say = say
        self._addresses: List[List[Address]] = [[], []]
        self._find_addresses()

    def _find_addresses(self) -> None:
        try:
            self._addresses = [addresses_of(self._host, port) for port in self._ports]
        except ConnectionLost as error:
            self._say(str(error))

    def stop(self, pipe: DriverPipe) -> None:
        """Stop the arm; returns when that is done or given up."""
        if not self._addresses[0]:
            self._find_addresses()
        pipe.answer(STOPPING)
        feed = Feed(self._addresses[1])
        work = _Work(Stopping(time.monotonic(), self._say), self._addresses[0])
        try:
            step = Step.WAIT
            while step is not Step.FINISH:
                step = work.stopping.step(time.monotonic(), pipe.driver())
                if step is Step.END_DRIVER:
                    pipe.end_driver(self._say)
                work.take(step)
                ready = _ready_of(pipe, work.link, feed.link)
                if pipe in ready:
                    pipe.read()
                work.serve(work.link in ready)
                feed.serve(work.stopping, feed.link in ready, time.monotonic())
        finally:
            work.close()
            feed.close()
            pipe.answer(WATCHING)


class _Work:
    """The command port while the arm is being stopped: carries out the steps and tells their results."""

    def __init__(self, stopping: Stopping, addresses: List[Address]) -> None:
        self.stopping = stopping
        self.link: Optional[StopLink] = None
        self._addresses = addresses
        self._tries = 0

    def take(self, step: Step) -> None:
        try:
            if step is Step.CONNECT:
                self._tries += 1
                self.link = StopLink(_next_of(self._addresses, self._tries - 1))
            elif step is Step.SEND and self.link is not None:
                self.link.send(self.stopping.request(time.monotonic()))
            elif step is Step.HANG_UP:
                self.close()
        except ConnectionLost as error:
            self._failed(error)

    def serve(self, is_ready: bool) -> None:
        if self.link is None or not is_ready:
            return
        try:
            if self.link.is_connecting:
                self.link.finish_connecting()
                self.stopping.connected()
                return
            for item in self.link.replies():
                self.stopping.replied(item, time.monotonic())
        except ConnectionLost as error:
            self._failed(error)

    def _failed(self, error: ConnectionLost) -> None:
        self.close()
        self.stopping.failed(str(error), isinstance(error, TurnedAway), time.monotonic())

    def close(self) -> None:
        if self.link is not None:
            self.link.close()
            self.link = None


def _next_of(addresses: List[Address], tries: int) -> Address:
    if not addresses:
        raise ConnectionLost("the controller's name cannot be resolved")
    return addresses[tries % len(addresses)]


def _ready_of(pipe: DriverPipe, *lines: Optional[Line]) -> List[_Source]:
    """Those connections that are ready now or within 20 ms."""
    reading: List[_Source] = [] if pipe.is_closed else [pipe]
    writing: List[_Source] = []
    for line in lines:
        if line is not None:
            (writing if line.is_connecting else reading).append(line)
    readable, writable, _ = select.select(reading, writing, [], _TURN_S)
    return readable + writable
