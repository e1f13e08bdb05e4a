"""Signs of life for the supervisor of a service (sd_notify(3)), sent by the thread that reads the status feed.

A driver that hangs is killed and started again by its supervisor; its guard has stopped the arm long before.
"""
import logging
import os
import socket
from typing import Mapping, Optional

from jaka_ros_driver.client.loop_task import LoopTask

_LOG = logging.getLogger(__name__)

_SIGNS_IN_TIME = 4
"""Number of signs within the supervisor's patience; one that is lost or late does not matter."""


class Supervisor(LoopTask):
    """The sender of READY when the thread begins to run, and of WATCHDOG as often as the supervisor wants it."""

    def __init__(self, address: str, patience: Optional[float]) -> None:
        """Set up the sender.

        Args:
            address: The supervisor's Unix socket, a path, or a name with @ in front.
            patience: Its longest wait between two signs, s; None where it wants none.
        """
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._period = None if patience is None else patience / _SIGNS_IN_TIME
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._due: Optional[float] = 0.0
        self._message = b"READY=1\nSTATUS=the driver runs\nWATCHDOG=1"
        self._has_warned = False

    def due(self) -> Optional[float]:
        """Return when the next sign is due, s; None where there is none to come."""
        return self._due

    def run(self, now: float) -> None:
        """Send a sign of life. It does not wait: where the socket takes nothing now, the next one follows."""
        try:
            self._socket.sendto(self._message, self._address)
            self._message = b"WATCHDOG=1"
        except OSError as error:
            if not self._has_warned:
                self._has_warned = True
                _LOG.warning("the supervisor at %s does not get this driver's signs of life: %s", self._address, error)
            if self._period is None:
                self._due = now + 1.0
                return
        self._due = None if self._period is None else now + self._period


def supervisor_of(environment: Mapping[str, str]) -> Optional[Supervisor]:
    """Return the sender of signs of life to the supervisor that started this process; None where none wants them."""
    address = environment.get("NOTIFY_SOCKET", "")
    if address[:1] not in ("/", "@"):
        return None
    patience = environment.get("WATCHDOG_USEC", "")
    is_ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return Supervisor(address, int(patience) / 1e6 if patience.isdigit() and int(patience) and is_ours else None)
