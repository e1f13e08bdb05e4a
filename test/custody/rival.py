"""A second driver, somewhere in the network, that takes the command port for itself and perhaps moves the arm."""
from typing import Callable, Optional

from controller_room import RIVAL
from virtual_clock import Clock
from wire import Arrival, Cable, Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.protocol.framing import encode_object

_AGAIN_AFTER = 0.5
"""Pause, s, before a driver that has lost its port connects anew, as the one under test does."""


class Rival:
    """A client that wants the command port for so long.

    Attributes:
        name: The controller's name for it.
    """

    def __init__(self, clock: Clock, network: Network, until: float, step: float, note: Callable[..., None]) -> None:
        """Begin to connect; ``step``: joint 1 moves by this much whenever it gets the port, rad; 0.0: it only asks."""
        self.name = RIVAL
        self._clock, self._network, self._until, self._step, self._note = clock, network, until, step, note
        self._cable: Optional[Cable] = None
        self._connect()
        clock.at(until, self.leave)

    def _connect(self) -> None:
        if self._clock.now < self._until:
            self._network.connect(self, Port.COMMAND, 1.0, self._connected)

    def _connected(self, cable: Optional[Cable], reason: str) -> None:
        if cable is None or self._clock.now >= self._until:
            if cable is not None:
                cable.close_by_driver()
            self._clock.after(_AGAIN_AFTER, self._connect)
            return
        self._note("a rival has the command port")
        self._cable = cable
        requests = [{"cmdName": "get_version"}]
        if self._step:
            requests.append({"cmdName": "joint_move", "relFlag": 1, "jointPosition": [self._step * 57.3] + [0.0] * 5,
                             "speed": 10.0, "accel": 100.0, "tol": 0.0})
        cable.to_controller.send(b"".join(map(encode_object, requests)))

    def leave(self) -> None:
        """Give the port up for good."""
        self._until = min(self._until, self._clock.now)
        if self._cable is not None:
            self._cable.close_by_driver()
            self._cable = None

    def arrived(self, cable: Cable, arrival: Arrival) -> None:
        """Ignore a reply."""

    def lost(self, cable: Cable) -> None:
        """Connect again later: another client has taken the port, or the link is gone."""
        if cable is self._cable:
            self._cable = None
            self._clock.after(_AGAIN_AFTER, self._connect)
