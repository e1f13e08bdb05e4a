"""The replayer of a recorded session: it serves a driver the recorded status bytes at their times, and the replies.

``python3 -m jaka_ros_driver.wire.replayer LOG.mcap`` prints a line of JSON with its ports, one when the first client
has connected, and one when all has been played. A port is open while the recorded one was connected. Time stands
still where the driver is late with a request that moved the arm, for ``PATIENCE_S`` (``--patience``) at most. The last
frame comes again and again then: no controller pauses its feed because a client is late, and a feed that owes frames
counts as old.
"""
import argparse
import json
import math
import selectors
import socket
import statistics
import sys
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional

from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.wire import sockets
from jaka_ros_driver.wire.log import clock_offset_ns, read_log
from jaka_ros_driver.wire.port_server import IDLE_S, PortServer
from jaka_ros_driver.wire.recorded_session import (
    STREAMED,
    Piece,
    RecordedConnection,
    RecordedSession,
    cut_objects,
    recorded_session,
)
from jaka_ros_driver.wire.sockets import LOOPBACK
from jaka_ros_driver.wire.startup import port_number, print_ports, raise_priority, stop_on_signals

_EARLY_S = 0.05
"""Lead, s, with which a port opens before its next recorded connection, so that a client that retries finds it in time.
"""
_GRACE_S = 2.0
"""Time, s of the log, that a client may be behind it before the replayer ends the connection."""
PATIENCE_S = 5.0
"""Longest wait, s of wall time, for a request; then the replayer assumes that this driver does not make it."""
_LOOK_BACK = 8
"""Pieces in which the last frame is looked for: a recorder may have got a frame in several."""


class _Client:
    """An accepted connection, the recorded one that it replays, and what is still to be sent."""

    def __init__(self, link: socket.socket, recorded: RecordedConnection, shift: float, grace: float) -> None:
        self.link = link
        self.recorded = recorded
        self.shift = shift
        self._grace = grace
        self.stream = ObjectStream()
        self.due: Deque[Piece] = deque(recorded.pieces)
        self.unsent = b""
        self.requests = 0
        self.sent_at = 0.0
        times = [piece.at for piece in recorded.pieces]
        self.period = statistics.median([b - a for a, b in zip(times, times[1:])] or [math.inf])

    def last_frame(self) -> bytes:
        """Return the last frame that was sent; b"" in the middle of one, and where none was."""
        end = len(self.recorded.pieces) - len(self.due)
        sent = self.recorded.pieces[max(0, end - _LOOK_BACK):end]
        found = cut_objects(sent)[-2:]
        is_whole = len(found) == 2 and b"".join(piece.data for piece in sent).endswith(found[-1][1])
        return found[-1][1] if is_whole else b""

    def end_at(self) -> Optional[float]:
        """Return when to end the connection, s of the recording; None for never. A client that lacks requests gets
        longer.
        """
        if self.recorded.ended is None:
            return None
        grace = self._grace if self.requests < self.recorded.requests else 0.0
        return self.recorded.ended + self.shift + grace


class SessionReplayer(PortServer):
    """The server of a recorded controller's ports.

    Args:
        session: The recorded session. It can be played once.
        speed: Factor by which it is played faster than recorded.
        ports: TCP port by name, 0 for a free one.
        notice: Called with "begin" and with "end", and with the facts of that moment as keywords.
        patience_s: Longest wait for a request, s of wall time.

    Attributes:
        port_numbers: TCP port by name.
    """

    def __init__(self, session: RecordedSession, speed: float, ports: Dict[str, int],
                 notice: Callable[..., None], patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._script = session
        self._speed = speed
        self._notice = notice
        self._clients: Dict[socket.socket, _Client] = {}
        self._coming = {port: deque(session.connections[port]) for port in PORTS}
        self._begin: Optional[float] = None
        self._causes = list(session.causes)
        self._held = 0.0
        self._latest_shift = 0.0
        self._held_since: Optional[float] = None
        self._is_over = False
        super().__init__(LOOPBACK, {port: ports.get(port, 0) for port in PORTS})

    def _close_all(self) -> None:
        for client in list(self._clients.values()):
            self._drop(client, "close")

    def _now(self) -> float:
        """Return the time of the replay, s of the recording.

        It stands still while a request that moves the arm is missing.
        """
        if self._begin is None:
            return 0.0
        clock = time.monotonic()
        now = (clock - self._begin) * self._speed - self._held
        # what came before the request on a connection that was made a little later than then, comes first here, too
        before = self._causes[0].at + self._latest_shift if self._causes else math.inf
        if now <= before:
            self._held_since = None
            return now
        if self._held_since is None:
            self._held_since = clock
        elif clock - self._held_since > self._patience_s:
            self._causes.pop(0)
            self._held_since = None
            return self._now()
        self._held += now - before
        return before

    def _wait_s(self) -> float:
        if self._begin is None:
            return IDLE_S
        now = self._now()
        moments = [client.due[0].at + self._shift(client) for client in self._clients.values() if client.due]
        moments += [end for end in (client.end_at() for client in self._clients.values()) if end is not None]
        again = [client.sent_at + client.period / self._speed - time.monotonic() for client in self._waiting_clients()]
        further = [coming[0].opened - _EARLY_S for coming in self._coming.values() if coming]
        further.append(self._script.duration)
        moments += [moment for moment in further if moment > now]
        return min([IDLE_S] + [max(0.0, wait) for wait in again]
                   + [max(moment - now, 0.0) / self._speed for moment in moments])

    def _waiting_clients(self) -> List[_Client]:
        """Return the clients whose feed would pause because time stands still."""
        if self._held_since is None:
            return []
        return [client for client in self._clients.values() if client.recorded.port in STREAMED]

    @staticmethod
    def _shift(client: _Client) -> float:
        """Return the offset to the times of a client's pieces, s: none for replies, which are timed from the live
        request.
        """
        return 0.0 if client.recorded.port == "command" else client.shift

    def _accept(self, link: socket.socket, peer: str, port: str) -> None:
        if not self._coming[port]:
            link.close()
            return
        recorded = self._coming[port].popleft()
        if self._begin is None:
            self._begin = time.monotonic() - recorded.opened / self._speed
            self._notice("begin", monotonic_s=self._begin, start_ns=self._script.start_ns)
        client = _Client(link, recorded, max(0.0, self._now() - recorded.opened), _GRACE_S * self._speed)
        self._latest_shift = max(self._latest_shift, self._shift(client))
        self._clients[link] = client
        self._selector.register(link, selectors.EVENT_READ, client)

    def _serve(self, client: _Client, events: int) -> None:
        data = sockets.receive(client.link)
        if data is None:
            return
        if not data:
            self._drop(client, "close")
        elif client.recorded.port == "command":
            for item in client.stream.feed(data):
                if not isinstance(item, FramingError):
                    self._answer(client, str(item.get("cmdName", "")))

    def _answer(self, client: _Client, name: str) -> None:
        client.requests += 1
        cause = next((cause for cause in self._causes if cause.name == name), None)
        if cause is not None:
            self._causes.remove(cause)  # time goes on where it waited for this request
        reply = self._script.replies.next(name, self._now())
        if reply is not None:
            at = self._now() + reply.after
            if client.due:
                at = max(at, client.due[-1].at)
            client.due.append(Piece(at, reply.data))

    def _turn(self) -> None:
        now = self._now()
        for client in list(self._clients.values()):
            while client.due and client.due[0].at + self._shift(client) <= now:
                client.unsent += client.due.popleft().data
                client.sent_at = time.monotonic()
                self._send(client)
            end = client.end_at()
            if end is not None and end <= now and not client.due:
                self._drop(client, client.recorded.how)
        for client in self._waiting_clients():
            if time.monotonic() - client.sent_at >= client.period / self._speed:
                client.unsent += client.last_frame()
                client.sent_at = time.monotonic()
                self._send(client)
        if self._begin is None:
            return
        for port, coming in self._coming.items():
            busy = any(client.recorded.port == port for client in self._clients.values())
            if coming and (busy or coming[0].opened - _EARLY_S <= now):
                self._listeners.open(port)
            else:
                self._listeners.shut(port)
        if not self._is_over and self._is_done(now):
            self._is_over = True
            replies = self._script.replies
            self._notice("end", answered=replies.answered, repeated=replies.repeated,
                         unanswered=sorted(set(replies.unanswered)))

    def _is_done(self, now: float) -> bool:
        """Return whether everything was played; a driver that is slower than the recorded one gets a little longer."""
        if now < self._script.duration:
            return False
        waits = any(self._coming.values()) or any(client.due or client.requests < client.recorded.requests
                                                  for client in self._clients.values())
        return not waits or now >= self._script.duration + 2.0 * _GRACE_S * self._speed

    def _send(self, client: _Client) -> None:
        try:
            client.unsent = sockets.send(client.link, client.unsent)
        except OSError:
            self._drop(client, "close")

    def _drop(self, client: _Client, how: str) -> None:
        if client.link not in self._clients:
            return
        sockets.watch(self._selector, client.link, 0)
        if how == "half open":
            client.due.clear()
            client.recorded = client.recorded._replace(ended=None)
            return
        del self._clients[client.link]
        sockets.close(client.link, is_reset=how == "reset")


def _print(event: str, **facts: Any) -> None:
    print(json.dumps({"event": event, **facts}), flush=True)


def _arguments(argv: Optional[List[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="replayer", description="Plays a wire log to a driver.")
    parser.add_argument("log", metavar="LOG.mcap", help="of jaka_sim --log or jaka_sim proxy")
    parser.add_argument("--speed", type=float, default=1.0, metavar="N", help="N times faster, default 1")
    parser.add_argument("--patience", type=float, default=PATIENCE_S, metavar="S",
                        help="longest wait for a request that moved the arm, s, default %g" % PATIENCE_S)
    for port in PORTS:
        parser.add_argument("--%s-port" % port, type=port_number(0), default=0, metavar="N", help="default: a free one")
    options = parser.parse_args(argv)
    if not 0.1 <= options.speed <= 100.0:
        parser.error("--speed is %g; it must be 0.1 to 100" % options.speed)
    return options


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return 0 when a signal ended it, 1 when it failed, 2 for wrong usage."""
    options = _arguments(argv)
    try:
        session = recorded_session(read_log(options.log))
        offset = clock_offset_ns(options.log)
        numbers: Dict[str, int] = {port: getattr(options, port + "_port") for port in PORTS}
        replayer = SessionReplayer(session, options.speed, numbers, _print, options.patience)
        stop_on_signals(replayer.stop)
        raise_priority(False)
        print_ports(replayer.port_numbers, duration_s=session.duration, start_ns=session.start_ns,
                    realtime_minus_monotonic_ns=offset)
        replayer.run()
    except (JakaError, OSError) as error:
        print("replayer: error: %s" % error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
