"""The proxy ``jaka_sim proxy`` between a driver and a real controller: it forwards every byte unchanged and logs it.

Both directions of the ports 10001, 10000 and 10004 are forwarded at once (TCP_NODELAY), whatever the bytes are. The log
is a wire log as the simulated controller writes it; ``jaka_bag replay-wire`` plays it. When one side ends a connection,
the other side's is ended, too.
"""
import argparse
import errno
import os
import selectors
import socket
import sys
import time
from typing import Dict, List, Optional, Union

from jaka_ros_driver.background_log import StandardErrorLog
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol.ports import PORT_NUMBERS, PORTS
from jaka_ros_driver.wire import sockets
from jaka_ros_driver.wire.log import WireLog
from jaka_ros_driver.wire.port_server import PortServer
from jaka_ros_driver.wire.sockets import LOOPBACK
from jaka_ros_driver.wire.startup import port_number, print_ports, raise_priority, stop_on_signals

_CONNECT_S = 3.0
"""Longest wait, s, for the controller; then the client's connection is closed, as the controller's would be."""
_LOG_TIMEOUT_S = 0.5
"""Longest wait, s, at the end for messages that wait to be printed."""
_MOST_BACKLOG = 4 << 20
"""Bytes that wait for a side that does not read; beyond it the connection is closed, as memory would grow."""


class _Side:
    """One of the two connected sockets between which bytes are forwarded: the client's or the controller's."""

    def __init__(self, link: socket.socket, port: str, number: int, is_client: bool) -> None:
        self.link = link
        self.port = port
        self.number = number
        self.is_client = is_client
        self.unsent = b""
        self.is_finished = False
        self.peer: _Side


class _Connecting:
    """A client that waits until the controller has accepted the connection; nothing is read from it before that."""

    def __init__(self, client: socket.socket, controller: socket.socket, peer: str, port: str) -> None:
        self.client = client
        self.controller = controller
        self.peer = peer
        self.port = port
        self.deadline = time.monotonic() + _CONNECT_S

    def close(self) -> None:
        self.client.close()
        self.controller.close()


class Proxy(PortServer):
    """The proxy between clients and one controller.

    Args:
        controller: Address of the controller.
        controller_ports: Its TCP ports by name.
        host: Address to listen on.
        ports: TCP ports to listen on by name, 0 for a free one.
        log: Receives every byte.

    Attributes:
        port_numbers: TCP port by name.

    Raises:
        OSError: A port cannot be bound, or the controller's name is not known.
    """

    def __init__(self, controller: str, controller_ports: Dict[str, int], host: str, ports: Dict[str, int],
                 log: WireLog) -> None:
        self._family, _, _, _, self._controller = socket.getaddrinfo(controller, None, type=socket.SOCK_STREAM)[0]
        self._controller_ports = controller_ports
        self._log = log
        super().__init__(host, {port: ports[port] for port in PORTS})
        self._errors = StandardErrorLog("jaka_sim proxy")
        self._sides: List[_Side] = []
        self._connecting: List[_Connecting] = []
        self._count = 0

    def _serve(self, data: Union[_Side, _Connecting], events: int) -> None:
        if isinstance(data, _Connecting):
            self._connected(data, data.controller.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR))
            return
        if events & selectors.EVENT_WRITE:
            self._send(data)
        if events & selectors.EVENT_READ:
            self._read(data)

    def _close_all(self) -> None:
        for side in list(self._sides):
            if side.is_client:
                self._end(side)
        for waiting in self._connecting:
            waiting.close()
        self._errors.close(_LOG_TIMEOUT_S)

    def _accept(self, link: socket.socket, peer: str, port: str) -> None:
        """Connect to the controller, without waiting: a port that does not answer must not hold up the others."""
        controller = socket.socket(self._family, socket.SOCK_STREAM)
        sockets.prepare(controller)
        code = controller.connect_ex((self._controller[0], self._controller_ports[port], *self._controller[2:]))
        waiting = _Connecting(link, controller, peer, port)
        self._connecting.append(waiting)
        sockets.watch(self._selector, controller, selectors.EVENT_WRITE, waiting)
        if code not in (0, errno.EINPROGRESS):
            self._connected(waiting, code)

    def _turn(self) -> None:
        now = time.monotonic()
        for waiting in [one for one in self._connecting if one.deadline <= now]:
            self._connected(waiting, errno.ETIMEDOUT)

    def _connected(self, waiting: _Connecting, code: int) -> None:
        """Begin to forward for a client whose connection the controller accepted.

        Where ``code`` is an error, the client is dropped.
        """
        if waiting not in self._connecting:
            return
        self._connecting.remove(waiting)
        sockets.watch(self._selector, waiting.controller, 0)
        if code:
            waiting.close()
            self._errors.write("the controller's %s port: %s" % (waiting.port, os.strerror(code)))
            return
        self._count += 1
        sides = [_Side(waiting.client, waiting.port, self._count, True),
                 _Side(waiting.controller, waiting.port, self._count, False)]
        sides[0].peer, sides[1].peer = sides[1], sides[0]
        for side in sides:
            sockets.stamp_arrivals(side.link)
            self._selector.register(side.link, selectors.EVENT_READ, side)
        self._sides += sides
        self._log.event(time.monotonic_ns(), waiting.port, self._count, "open", waiting.peer)

    def _read(self, side: _Side) -> None:
        if side not in self._sides:
            return
        data, arrived_ns = sockets.receive_stamped(side.link)
        if data is None:
            return
        if not data:
            self._finish(side)
            return
        if side.is_client:
            self._log.bytes_in(arrived_ns, side.port, side.number, data)
        else:
            self._log.bytes_out(arrived_ns, side.port, side.number, data)
        side.peer.unsent += data
        self._send(side.peer)

    def _send(self, side: _Side) -> None:
        if side not in self._sides:
            return
        try:
            side.unsent = sockets.send(side.link, side.unsent)
        except OSError:
            self._end(side)
            return
        if len(side.unsent) > _MOST_BACKLOG:
            self._end(side)
            return
        if not side.unsent and side.peer.is_finished:
            self._end(side)
            return
        self._watch(side)

    def _watch(self, side: _Side) -> None:
        """Register a side for reading until it has ended, and for writing while bytes for it are unsent."""
        events = (0 if side.is_finished else selectors.EVENT_READ) | (selectors.EVENT_WRITE if side.unsent else 0)
        sockets.watch(self._selector, side.link, events, side)

    def _finish(self, side: _Side) -> None:
        """End a connection whose one side has ended, after the other side was sent what is left."""
        side.is_finished = True
        if side.peer.unsent:
            self._watch(side)
        else:
            self._end(side)

    def _end(self, side: _Side) -> None:
        if side not in self._sides:
            return
        for one in (side, side.peer):
            self._sides.remove(one)
            sockets.watch(self._selector, one.link, 0)
            one.link.close()
        self._log.event(time.monotonic_ns(), side.port, side.number, "close",
                        "client" if side.is_client else "controller")


def main(argv: Optional[List[str]] = None) -> int:
    """Run ``jaka_sim proxy``; return 0 when a signal ended it, 1 when it failed, 2 for wrong usage."""
    parser = argparse.ArgumentParser(
        prog="jaka_sim proxy", description="Stands between a driver and a real controller, forwards every byte "
        "unchanged and logs it. Its first line of output is JSON with its ports. Start the driver with this computer's "
        "address instead of the controller's.")
    parser.add_argument("controller", metavar="ADDRESS", help="of the controller")
    parser.add_argument("--log", metavar="FILE.mcap", required=True, help="the wire log to write")
    parser.add_argument("--host", default=LOOPBACK, metavar="ADDRESS", help="where to listen; default loopback only")
    for port, number in PORT_NUMBERS.items():
        parser.add_argument("--%s-port" % port, type=port_number(0), default=number, metavar="N",
                            help="where to listen; 0 for a free port, default %d" % number)
        parser.add_argument("--controller-%s-port" % port, type=port_number(1), default=number, metavar="N",
                            help="of the controller, default %d" % number)
    options = vars(parser.parse_args(argv))
    try:
        log = WireLog(options["log"])
        try:
            proxy = Proxy(options["controller"],
                          {port: options["controller_%s_port" % port] for port in PORTS}, options["host"],
                          {port: options["%s_port" % port] for port in PORTS}, log)
            stop_on_signals(proxy.stop)
            raise_priority(False)
            print_ports(proxy.port_numbers)
            proxy.run()
        finally:
            log.close()
    except (JakaError, OSError) as error:
        print("jaka_sim proxy: error: %s" % error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
