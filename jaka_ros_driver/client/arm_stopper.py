"""The sockets of the guard's stop: they carry out what stopping.py decides, and answer the driver meanwhile."""
import itertools
import select
import time
from typing import Iterator, List

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.custody_file import CustodyFile
from jaka_ros_driver.client.driver_pipe import STOPPING, WATCHING, DriverPipe, LogText
from jaka_ros_driver.client.stopping import Step, Stopping
from jaka_ros_driver.client.transport import Opened, Received, Transport, TransportEvent, addresses_of
from jaka_ros_driver.errors import FramingError, StatusFrameError
from jaka_ros_driver.protocol.framing import FrameStream, ObjectStream
from jaka_ros_driver.protocol.status import parse_status

_TURN_S = 0.02
"""Longest pause, s, of the loop: the deadlines of the stop are kept to within one beat of a driver."""
_CONNECT_TIMEOUT_S = 1.0
"""Longest time, s, to connect; ``stopping`` gives the command port up after the same time."""
_ACKNOWLEDGE_TIMEOUT_S = 1.0
"""Longest time, s, that the kernel waits for a peer that is gone.

The stop is sent anew, on a connection of its own, before that.
"""
_FEED_PERIOD_S = 0.25
"""Pause, s, before a lost status port is connected anew: a try or two before ``stopping`` counts it as blind."""
_FEED_TIMEOUT_S = 1.0
"""Silence, s, of the status port after which it is connected anew: ten frames of the slowest feed."""


class ArmStopper:
    """The guard's access to the arm. It has one thread, so nothing here waits for the controller."""

    def __init__(self, host: str, command_port: int, status_port: int, log: LogText) -> None:
        """Resolve the controller's name now, because that may take too long when the arm must be stopped."""
        self._file = CustodyFile(host, command_port)
        self._has_seen_rest = False
        self._log = log
        self._transport = Transport(host, {Port.COMMAND: command_port, Port.STATUS: status_port},
                                    _CONNECT_TIMEOUT_S, _ACKNOWLEDGE_TIMEOUT_S)
        self._addresses: List[str] = []
        try:
            self._addresses = addresses_of(host)
        except OSError as error:
            log("%s cannot be resolved: %s" % (host, error))

    def stop(self, pipe: DriverPipe) -> None:
        """Stop the arm; return when that is done or given up."""
        pipe.answer(STOPPING)
        found = self._file.read()
        jog = found.left.jog_stop if found is not None and found.left.process == pipe.driver_process else None
        stopping = Stopping(time.monotonic(), self._log, jog)
        command = _CommandPort(stopping, self._transport, self._addresses)
        status = _StatusPort(stopping, self._transport, self._addresses)
        try:
            step = Step.WAIT
            while step is not Step.FINISH:
                step = stopping.step(time.monotonic(), pipe.driver())
                if step is Step.END_DRIVER:
                    pipe.end_driver(self._log)
                command.take(step)
                status.connect_when_due(time.monotonic())
                sources: List[object] = [self._transport] if pipe.is_closed else [self._transport, pipe]
                if pipe in select.select(sources, [], [], _TURN_S)[0]:
                    pipe.read()
                for event in self._transport.read():
                    (command if event.port is Port.COMMAND else status).learn(event, time.monotonic())
            self._has_seen_rest = stopping.has_seen_rest
        finally:
            for port in Port:
                self._transport.close(port)
            pipe.answer(WATCHING)

    def forget(self, pipe: DriverPipe) -> None:
        """Remove the custody file of a driver that is dead, where the arm was seen at rest since it last moved it."""
        if self._has_seen_rest and pipe.is_closed:
            self._file.remove_of(pipe.driver_process)


class _CommandPort:
    """The command port of a stop: it carries out the steps and reports their results to ``stopping``."""

    def __init__(self, stopping: Stopping, transport: Transport, addresses: List[str]) -> None:
        self._stopping = stopping
        self._transport = transport
        self._addresses = _in_turn(addresses)
        self._stream = ObjectStream()

    def take(self, step: Step) -> None:
        if step is Step.CONNECT:
            self._transport.open(Port.COMMAND, next(self._addresses))
        elif step is Step.SEND:
            self._transport.send(self._stopping.request(time.monotonic()))
        elif step is Step.HANG_UP:
            self._transport.close(Port.COMMAND)

    def learn(self, event: TransportEvent, now: float) -> None:
        if isinstance(event, Opened):
            self._stream = ObjectStream()
            self._stopping.connected()
        elif isinstance(event, Received):
            for item in self._stream.feed(event.data):
                self._stopping.replied(item, now)
        else:
            self._stopping.failed(event.reason, event.is_turned_away, now)


class _StatusPort:
    """The status port of a stop: it reports states to ``stopping``, or why there are none, and connects as soon as it
    can.
    """

    def __init__(self, stopping: Stopping, transport: Transport, addresses: List[str]) -> None:
        self._stopping = stopping
        self._transport = transport
        self._addresses = _in_turn(addresses)
        self._stream = FrameStream()
        self._is_in_use = False
        self._deadline = 0.0

    def connect_when_due(self, now: float) -> None:
        """Begin to connect when that is due, and end a connection that has been silent for too long."""
        if now < self._deadline:
            return
        if self._is_in_use:
            self._lose("%s: silent for %.1f s" % (Port.STATUS.value, _FEED_TIMEOUT_S), now)
            return
        self._is_in_use, self._deadline = True, now + _FEED_TIMEOUT_S
        self._stream = FrameStream()
        self._transport.open(Port.STATUS, next(self._addresses))

    def learn(self, event: TransportEvent, now: float) -> None:
        if isinstance(event, Received):
            self._deadline = now + _FEED_TIMEOUT_S
            self._read(event.data, now)
        elif not isinstance(event, Opened):
            self._lose(event.reason, now)

    def _read(self, data: bytes, now: float) -> None:
        for item in self._stream.feed(data):
            try:
                if isinstance(item, FramingError):
                    raise item
                self._stopping.saw(parse_status(item, now), now)
            except (FramingError, StatusFrameError) as error:
                self._stopping.saw_nothing(str(error))
        if self._stream.is_flooded:
            self._lose("%s: what comes are no status frames" % Port.STATUS.value, now)

    def _lose(self, reason: str, now: float) -> None:
        self._transport.close(Port.STATUS)
        self._is_in_use, self._deadline = False, now + _FEED_PERIOD_S
        self._stopping.saw_nothing(reason)


def _in_turn(addresses: List[str]) -> Iterator[str]:
    """Return each address in turn, without end.

    Without any, ``Transport`` resolves the name again for each connection.
    """
    return itertools.cycle(addresses or [""])
