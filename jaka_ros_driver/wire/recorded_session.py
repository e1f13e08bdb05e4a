"""The recorded session of a wire log: what each connection was sent and when, and the reply to each request. No
sockets.

Status bytes are sent at their times. On the command port, the n-th request of a name gets the n-th recorded reply of
that name, byte for byte, after the recorded time. What the arm does after a request that moves it, or changes whether
it can move, is not sent before that request has come.
"""
import bisect
import itertools
import json
import re
from collections import deque
from typing import Any, Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.protocol.framing import MAX_OBJECT_BYTES, encode_object
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.units import NS_PER_S
from jaka_ros_driver.wire.log import TrueJoints, WireEvent

STREAMED = ("status", "poll")
_ENDS = ("close", "reset", "half open")
_CAUSES = frozenset((
    "power_on", "power_off", "enable_robot", "disable_robot", "clear_error", "joint_move", "moveL", "movc", "end_move",
    "jog", "servo_move", "stop_program", "torque_control_enable"))
"""The requests whose effect is visible in the status feed."""


_FIRST_LOOK = 512
"""Characters of an object that are looked at first."""
_LONGEST_TOKEN = 16
"""Characters before the end of a piece in which an error may come of a token that is cut off there."""
_TOO_DEEP = 500
"""Characters passed over where an object is nested deeper than Python reads: each level takes one at least."""
_DEEPEST, _DEEP = 200, 100
"""Levels at which an object that is longer than what was looked at is given up, and those that are always read."""
_TEXT = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"?', re.DOTALL)
OF_THE_PRESENT = "get_joint_pos"
"""The question that a replay refuses: a recorded answer is not true of the moment at which it is asked."""
_OF_STATE = "get_robot_state"


class RecordedSessionError(JakaError):
    """A wire log that cannot be replayed."""


class Piece(NamedTuple):
    """Bytes that were sent; ``at`` in s since the log's first connection."""

    at: float
    data: bytes


class RecordedConnection(NamedTuple):
    """One connection; times in s since the log's first one.

    Attributes:
        port: "command", "status" or "poll".
        opened: When it was accepted.
        pieces: What the client was sent; empty for the command port, whose replies are in ``Replies``.
        ended: When it ended; None where the log ends first.
        how: "close", "reset" or "half open".
        requests: How many the client made on it.
    """

    port: str
    opened: float
    pieces: Tuple[Piece, ...]
    ended: Optional[float]
    how: str
    requests: int


class RecordedReply(NamedTuple):
    """A recorded reply: ``after``, s since its request, and its bytes."""

    after: float
    data: bytes


def cut_objects(pieces: Sequence[Piece]) -> List[Tuple[float, bytes, Dict[str, Any]]]:
    """Cut the JSON objects out of a recorded stream.

    ``protocol.framing.ObjectStream`` cannot serve here: a recording is played byte for byte, so bytes between objects,
    objects that are damaged, and text that is not UTF-8 must be kept, and each byte belongs to one object's piece.

    Returns:
        For each object: the time of its last byte, s; its raw bytes, with those that stand before it; the object.
    """
    raw = b"".join(piece.data for piece in pieces)
    ends = list(itertools.accumulate(len(piece.data) for piece in pieces))
    text, decoder = raw.decode("latin-1"), json.JSONDecoder()
    found: List[Tuple[float, bytes, Dict[str, Any]]] = []
    begin = position = 0
    while (position := text.find("{", position)) >= 0:
        value, end = _object_at(text, position, decoder)
        if value is None:
            position = end
            continue
        if text[end:end + 1] == "\n":
            end += 1
        found.append((pieces[bisect.bisect_left(ends, end)].at, raw[begin:end], value))
        begin = position = end
    return found


def _object_at(text: str, begin: int, decoder: json.JSONDecoder) -> Tuple[Optional[Dict[str, Any]], int]:
    """Return the object that begins there, and its end; None, and where to look on, where there is none.

    It looks at a short piece first, at a longer one where that is cut off: a decoder that fails counts the lines of all
    that it was given, which for each brace of a long text is too much.
    """
    size = _FIRST_LOOK
    while True:
        piece = text[begin:begin + size]
        try:
            value, length = decoder.raw_decode(piece)
            return value, begin + length
        except RecursionError:
            return None, begin + _TOO_DEEP
        except json.JSONDecodeError as error:
            is_cut_off = error.pos >= len(piece) - _LONGEST_TOKEN or error.msg.startswith("Unterminated string")
            if not is_cut_off or begin + size >= len(text) or size >= MAX_OBJECT_BYTES:
                return None, begin + 1
            depth = _depth(piece)
            if depth > _DEEPEST:  # Python 3.13 reads many thousands of levels, which for each brace is too much
                return None, begin + depth - _DEEP
            size *= 8
        except ValueError:  # a number with more digits than Python reads
            return None, begin + 1


def _depth(piece: str) -> int:
    """Return how many braces and brackets are open at the end of a piece of JSON."""
    plain = _TEXT.sub("", piece)
    return plain.count("{") + plain.count("[") - plain.count("}") - plain.count("]")


class Replies:
    """The recorded replies by name of the command.

    Attributes:
        answered: Requests that got a reply.
        repeated: Requests that came more often than recorded: they got the last reply of their name again.
        unanswered: Names of requests that the log has no reply to.
    """

    def __init__(self) -> None:
        self._waiting: Dict[str, Deque[RecordedReply]] = {}
        self._last: Dict[str, RecordedReply] = {}
        self._states: List[Tuple[float, RecordedReply]] = []
        self.answered = 0
        self.repeated = 0
        self.unanswered: List[str] = []

    def add(self, name: str, reply: RecordedReply, at: float = 0.0) -> None:
        """Add a recorded reply behind those of its name; ``at``: time of its request, s."""
        if name == _OF_STATE:
            self._states.append((at, reply))
        self._waiting.setdefault(name, deque()).append(reply)

    def next(self, name: str, at: float = 0.0) -> Optional[RecordedReply]:
        """Return the reply to a request of this name at this time, s; None where the log has none.

        The present joints are known from the feed alone, so that question is refused. For the drives' state the reply
        recorded nearest before this time is returned.
        """
        if name == OF_THE_PRESENT:
            self.answered += 1
            return RecordedReply(0.0, encode_object({"errorCode": "1", "errorMsg": "not played", "cmdName": name}))
        if name == _OF_STATE and self._states:
            self.answered += 1
            place = max(1, bisect.bisect_right([asked for asked, _ in self._states], at))
            return self._states[place - 1][1]
        waiting = self._waiting.get(name)
        if waiting:
            self._last[name] = waiting.popleft()
            self.answered += 1
        elif name in self._last:
            self.repeated += 1
        else:
            self.unanswered.append(name)
            return None
        return self._last[name]


class Cause(NamedTuple):
    """A recorded request that moved the arm or changed whether it can move; ``at`` in s since the first connection."""

    at: float
    name: str


class RecordedSession(NamedTuple):
    """The content of a wire log, arranged for replay.

    Attributes:
        connections: By port, in the order of their acceptance.
        replies: The replies of the command port.
        causes: Requests that moved the arm or changed whether it can move, in the order of their times.
        duration: From the first connection to the last event, s.
        start_ns: Time of the first connection, on the log's clock.
    """

    connections: Dict[str, List[RecordedConnection]]
    replies: Replies
    causes: Tuple[Cause, ...]
    duration: float
    start_ns: int


def recorded_session(log: Sequence[Union[WireEvent, TrueJoints]]) -> RecordedSession:
    """Return the recorded session of a wire log; raise RecordedSessionError where the log has no connection."""
    events = [event for event in log if isinstance(event, WireEvent) and event.port in PORTS]
    opened = [event for event in events if event.what == "open"]
    if not opened:
        raise RecordedSessionError("the wire log has no connection")
    start_ns = min(event.time_ns for event in opened)
    by_connection: Dict[Tuple[str, int], List[WireEvent]] = {}
    for event in events:
        by_connection.setdefault((event.port, event.connection), []).append(event)
    connections: Dict[str, List[RecordedConnection]] = {port: [] for port in PORTS}
    replies = Replies()
    found: List[Tuple[float, str, RecordedReply]] = []
    for (port, _), some in sorted(by_connection.items(), key=lambda entry: entry[1][0].time_ns):
        pieces = {what: tuple(Piece((event.time_ns - start_ns) / NS_PER_S, event.data) for event in some
                              if event.what == what) for what in ("in", "out")}
        end = next((event for event in some if event.what in _ENDS), None)
        paired = _paired(pieces["in"], pieces["out"]) if port == "command" else []
        found += paired
        connections[port].append(RecordedConnection(
            port, (some[0].time_ns - start_ns) / NS_PER_S, pieces["out"] if port in STREAMED else (),
            None if end is None else (end.time_ns - start_ns) / NS_PER_S, "close" if end is None else end.what,
            len(paired)))
    found.sort(key=lambda entry: entry[0])
    for at, name, reply in found:
        replies.add(name, reply, at)
    causes = tuple(Cause(at, name) for at, name, _ in found if name in _CAUSES)
    duration = max((event.time_ns - start_ns) / NS_PER_S for event in events)
    return RecordedSession(connections, replies, causes, duration, start_ns)


def _name(value: Dict[str, Any]) -> str:
    return str(value.get("cmdName", ""))


def _paired(requests: Sequence[Piece], replies: Sequence[Piece]) -> List[Tuple[float, str, RecordedReply]]:
    """Pair the n-th request of a name with its n-th reply; return each request's time, s, its name and the reply.

    A reply without a name (to a request that the controller did not understand) belongs to the oldest open request.
    """
    waiting = [(at, _name(value)) for at, _, value in cut_objects(requests)]
    result = []
    for at, raw, value in cut_objects(replies):
        name = _name(value)
        mine = next((asked for asked in waiting if asked[1] == name or not name), None)
        if mine is not None:
            waiting.remove(mine)
            result.append((mine[0], mine[1], RecordedReply(max(0.0, at - mine[0]), raw)))
    return result
