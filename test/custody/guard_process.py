"""The guard's process on the virtual wire: the product's own ``Stopping`` decides, and both ports are really used.

Only two things stand in for ``DriverPipe`` and ``ArmStopper``: who has spoken, and who carries a step out. What is
decided, and when, is the product's.
"""
from typing import Any, Callable, Dict, Optional

from controller_room import GUARD
from virtual_clock import Clock
from wire import Arrival, Cable, Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.driver_pipe import SILENCE_TIMEOUT_S
from jaka_ros_driver.client.stopping import DriverCondition, Step, Stopping
from jaka_ros_driver.commands import JogStop
from jaka_ros_driver.errors import FramingError, StatusFrameError
from jaka_ros_driver.protocol.framing import FrameStream, ObjectStream
from jaka_ros_driver.protocol.status import parse_status

_TURN = 0.02
_CONNECT_TIMEOUT = 1.0
_FEED_PERIOD, _FEED_TIMEOUT = 0.25, 1.0
MakeStopping = Callable[[float, Callable[[str], None], Optional[JogStop]], Any]


class GuardProcess:
    """A guard that watches one driver, and stops the arm when the driver is dead or silent during a motion.

    Attributes:
        name: The controller's name for it.
        driver: The driver that it watches.
        is_stopping: It is stopping the arm.
        kill_driver: Ends the driver's process; called where a controller serves a frozen driver only.
    """

    def __init__(self, clock: Clock, network: Network, note: Callable[..., None],
                 make_stopping: MakeStopping = Stopping) -> None:
        self.name = GUARD
        self.driver: Any = None
        self.kill_driver: Callable[[], None] = lambda: None
        self._clock, self._network, self._note, self._make_stopping = clock, network, note, make_stopping
        self._stopping: Any = None
        self._is_moving = False
        self._jog_stop: Optional[JogStop] = None
        self._cables: Dict[Port, Optional[Cable]] = dict.fromkeys(Port)
        self._tries = dict.fromkeys(Port, 0)
        self._replies = ObjectStream()
        self._frames = FrameStream()
        self._feed_is_in_use = False
        self._feed_deadline = 0.0

    @property
    def is_stopping(self) -> bool:
        """True while it is stopping the arm."""
        return self._stopping is not None

    # ---- notifications of the driver ----

    def is_told(self, is_moving: bool, jog_stop: Optional[JogStop] = None) -> None:
        """Take the driver's notification; ``jog_stop`` is the end of a jog from its custody file."""
        self._is_moving, self._jog_stop = is_moving, jog_stop

    def driver_is_silent(self) -> None:
        """Look again after the silence time-out: the driver's process stands still from now on."""
        self._clock.after(SILENCE_TIMEOUT_S, self._look)

    def driver_has_ended(self) -> None:
        """Look at once: the pipe has closed; a driver in good order has reported rest before."""
        self._look()

    def _look(self) -> None:
        if self._is_moving and self._stopping is None and self._driver() is not DriverCondition.BACK:
            self._note("guard", "the driver is", self._driver().value)
            self._is_moving = False
            self._stopping = self._make_stopping(self._clock.now, lambda text: self._note("guard logs", text),
                                                 self._jog_stop)
            self._turn(self._stopping)

    def _driver(self) -> DriverCondition:
        if self.driver.is_gone:
            return DriverCondition.DEAD
        return DriverCondition.SILENT if self.driver.is_paused else DriverCondition.BACK

    # ---- its loop ----

    def _turn(self, stopping: Any) -> None:
        """Take a step every 20 ms at least, as its ``select`` does."""
        if stopping is self._stopping:
            self._step()
            self._clock.after(_TURN, lambda: self._turn(stopping))

    def _step(self) -> None:
        now, stopping = self._clock.now, self._stopping
        if stopping is None:
            return
        step = stopping.step(now, self._driver())
        if step is Step.CONNECT:
            self._open(Port.COMMAND)
        elif step is Step.SEND:
            self._send(stopping.request(now))
        elif step is Step.HANG_UP:
            self._close(Port.COMMAND)
        elif step is Step.END_DRIVER and self.driver.is_paused:
            self._note("guard kills the driver")
            self.kill_driver()
        elif step is Step.FINISH:
            self._stopping = None
            for port in Port:
                self._close(port)
            if stopping.has_seen_rest and self.driver.is_gone:
                self.driver.disk.remove_of(self.driver)
            self._clock.after(0.0, self._look)
            return
        self._connect_feed(now)

    def _connect_feed(self, now: float) -> None:
        if now < self._feed_deadline:
            return
        if self._feed_is_in_use:
            self._lose_feed("silent")
            return
        self._feed_is_in_use, self._feed_deadline = True, now + _FEED_TIMEOUT
        self._frames = FrameStream()
        self._open(Port.STATUS)

    def _lose_feed(self, reason: str) -> None:
        self._close(Port.STATUS)
        self._feed_is_in_use, self._feed_deadline = False, self._clock.now + _FEED_PERIOD
        self._stopping.saw_nothing(reason)

    # ---- the wire ----

    def _open(self, port: Port) -> None:
        self._tries[port] += 1
        number = self._tries[port]
        self._network.connect(self, port, _CONNECT_TIMEOUT,
                              lambda cable, reason: self._opened(port, number, cable, reason))

    def _opened(self, port: Port, number: int, cable: Optional[Cable], reason: str) -> None:
        if number != self._tries[port] or self._stopping is None:
            if cable is not None:
                cable.close_by_driver()
            return
        if cable is None:
            self._failed(port, reason, reason == "connection refused")
            return
        self._cables[port] = cable
        if port is Port.COMMAND:
            self._replies = ObjectStream()
            self._stopping.connected()
        if not cable.driver_knows:
            self.lost(cable)
        self._step()

    def _failed(self, port: Port, reason: str, is_turned_away: bool) -> None:
        if port is Port.COMMAND:
            self._stopping.failed(reason, is_turned_away, self._clock.now)
        else:
            self._lose_feed(reason)
        self._step()

    def _close(self, port: Port) -> None:
        self._tries[port] += 1
        cable, self._cables[port] = self._cables[port], None
        if cable is not None:
            cable.close_by_driver()

    def _send(self, data: bytes) -> None:
        cable = self._cables[Port.COMMAND]
        self.on_send(data, self._clock.now)
        if cable is not None:
            cable.to_controller.send(data)

    def on_send(self, data: bytes, now: float) -> None:
        """Do nothing; the judge replaces this."""

    def arrived(self, cable: Cable, arrival: Arrival) -> None:
        """Take bytes that have come to this process."""
        if cable is not self._cables[cable.port] or self._stopping is None:
            return
        now = self._clock.now
        if cable.port is Port.COMMAND:
            for item in self._replies.feed(arrival.data):
                self._stopping.replied(item, now)
        else:
            self._feed_deadline = now + _FEED_TIMEOUT
            for item in self._frames.feed(arrival.data):
                self._see(item, now)
        self._step()

    def _see(self, item: Any, now: float) -> None:
        try:
            if isinstance(item, FramingError):
                raise item
            self._stopping.saw(parse_status(item, now), now)
        except (FramingError, StatusFrameError) as error:
            self._stopping.saw_nothing(str(error))

    def lost(self, cable: Cable) -> None:
        """Handle the end of a connection."""
        if cable is self._cables[cable.port] and self._stopping is not None:
            self._cables[cable.port] = None
            self._failed(cable.port, "connection closed by the controller", True)
