"""The event loop of a command that serves a controller's ports in one thread."""
import selectors
import socket
from typing import Any, Mapping

from jaka_ros_driver.wire import sockets
from jaka_ros_driver.wire.listeners import Listeners

IDLE_S = 0.5
"""Longest wait, s, of the loop; ``stop`` takes effect after this time at most."""


class PortServer:
    """The base class of a server: it listens on ports and runs the loop; the methods of its second part are overridden.

    Attributes:
        port_numbers: TCP port number by name.
    """

    def __init__(self, host: str, ports: Mapping[str, int]) -> None:
        """Listen at host on the ports by name, 0 for a free one; raise OSError where a port cannot be bound."""
        self._selector = selectors.DefaultSelector()
        self._listeners = Listeners(self._selector)
        self._is_running = True
        try:
            for port, number in ports.items():
                self._listeners.add(port, host, number)
        except OSError:
            self._listeners.close()
            self._selector.close()
            raise
        self.port_numbers = self._listeners.numbers

    def stop(self) -> None:
        """End ``run`` within ``IDLE_S``; also from a signal handler."""
        self._is_running = False

    def run(self) -> None:
        """Serve until ``stop``; then close every socket."""
        try:
            while self._is_running:
                for key, events in self._selector.select(self._wait_s()):
                    if isinstance(key.data, str):
                        accepted = sockets.accept(key.fileobj)
                        if accepted is not None:
                            self._accept(accepted[0], accepted[1], key.data)
                    else:
                        self._serve(key.data, events)
                self._turn()
        finally:
            self._close_all()
            self._listeners.close()
            self._selector.close()

    # --- what the process does --------------------------------------------------------------------------------------

    def _wait_s(self) -> float:
        """Return the longest wait for the next event, s."""
        return IDLE_S

    def _accept(self, link: socket.socket, peer: str, port: str) -> None:
        """Take a new connection of this port; ``peer`` is its address as "host:port"."""
        raise NotImplementedError

    def _serve(self, data: Any, events: int) -> None:
        """Serve a socket that is ready for these events; ``data`` is what it was registered with."""
        raise NotImplementedError

    def _turn(self) -> None:
        """Do the work that is due by time, once in each turn of the loop."""

    def _close_all(self) -> None:
        """Close the server's connections at the end of ``run``."""
        raise NotImplementedError
