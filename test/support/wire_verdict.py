"""The evidence of a simulated controller's own log: when each request came in, and where the arm really was.

Times are the host's monotonic clock, s, the same as ``time.monotonic()`` of every process on it.
"""
from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.wire.log import TrueJoints, WireEvent, read_log

REST = 1e-6
"""Motion below which an arm is at rest, rad."""


class WireVerdict:
    """The log of one simulated controller, that has ended."""

    def __init__(self, log_file):
        self.events = read_log(str(log_file))
        self._received = None

    def received(self):
        """Return (time, request) of all that came in on the command port."""
        if self._received is None:
            self._received = self._read_requests()
        return list(self._received)

    def _read_requests(self):
        streams, requests = {}, []
        for event in self.wire("command", "in"):
            stream = streams.setdefault(event.connection, ObjectStream())
            requests += [(event.time_ns * 1e-9, request) for request in stream.feed(event.data)
                         if not isinstance(request, FramingError)]
        return requests

    def wire(self, port, *what):
        """Return pieces of bytes, and beginnings and ends of connections, of a port."""
        return [event for event in self.events
                if isinstance(event, WireEvent) and event.port == port and event.what in what]

    def times_of(self, name, after=0.0, **fields):
        """Return when requests of this name, with these fields, came in after a moment."""
        return [at for at, request in self.received() if request["cmdName"] == name and at >= after
                and all(request.get(key) == value for key, value in fields.items())]

    def joints(self):
        """Return (time, joint position in rad) of every cycle."""
        return [(item.time_ns * 1e-9, item.joint_position) for item in self.events if isinstance(item, TrueJoints)]

    def rest_after(self, moment, until=float("inf")):
        """Return when the arm came to rest after this moment; it rests until ``until``, for good without."""
        path = [(at, joints) for at, joints in self.joints() if moment <= at <= until]
        end, since = path[-1][1], path[-1][0]
        for at, joints in reversed(path):
            if max(abs(a - b) for a, b in zip(joints, end)) > REST:
                break
            since = at
        return since
