"""The connections to a controller: to listen to its status feed, and to ask what the driver asks at its start.

``QUESTIONS`` is all that is ever sent. Each reads a value; none moves, sets or powers anything, and the period of the
feed, which the driver sets, is only read (docs/controller-protocol.md section 5).
"""
import socket
import time
from typing import Any, Dict, List, NamedTuple, Optional

from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.protocol.codec import command_name, decode, encode
from jaka_ros_driver.protocol.framing import FrameStream, JsonObject, ObjectStream, encode_object
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.state import RobotState

QUESTIONS = (Query.VERSION, Query.FEED_PERIOD, Query.SERVO_MODE, Query.TOOL_FRAMES, Query.USER_FRAMES)
CONNECT_S = 3.0
"""Longest wait, s, for a connection: nothing answers at a wrong address, and a person waits for the report."""
_ANSWER_S = 3.0
"""Longest wait, s, for one answer: longer than the driver's own (``reply_timeout``), to tell a slow one from none."""
_LISTEN_S = 1.5
"""Time, s, for which the feed is listened to: 15 frames of the slowest one (10 Hz)."""
_STAYS_S = 1.0
"""Time, s, for which a connection must stay after the last answer: another client that takes the port ends it."""
_RECEIVE_BYTES = 1 << 16
"""Bytes read at a time: seven of the longest frames."""


class FeedSample(NamedTuple):
    """Frames and states that came from a status port for a while.

    Attributes:
        error: Why it could not be connected; None where it was.
        states: The states that arrived, oldest first.
        damaged: Number of frames that were cut or wrong.
        newest: The newest frame as it was sent; empty where none came.
        seconds: For how long it was listened to, s.
        was_closed: The controller closed the connection.
        ended_at: Monotonic time at which listening ended, s.
    """

    error: Optional[OSError]
    states: List[RobotState]
    damaged: int
    newest: JsonObject
    seconds: float
    was_closed: bool
    ended_at: float


class Answers(NamedTuple):
    """Answers of a controller on its command port.

    Attributes:
        error: Why the port could not be connected; None where it was.
        values: The answers; a question that the controller refuses has none.
        refusals: Why, by question.
        was_closed: The controller closed the connection.
        is_silent: It left a question without an answer.
    """

    error: Optional[OSError]
    values: Dict[Query, Any]
    refusals: Dict[Query, str]
    was_closed: bool
    is_silent: bool


def listen_to_feed(host: str, port: int, seconds: float = _LISTEN_S) -> FeedSample:
    """Connect a status port and read for ``seconds``; send nothing."""
    stream, states, newest = FrameStream(), [], {}
    damaged, was_closed = 0, False
    try:
        connection = socket.create_connection((host, port), CONNECT_S)
    except (OSError, UnicodeError) as error:
        return FeedSample(_as_os_error(error), [], 0, {}, 0.0, False, time.monotonic())
    begun = time.monotonic()
    with connection:
        while not was_closed and time.monotonic() - begun < seconds:
            data = _receive(connection, begun + seconds)
            was_closed = data == b""
            for item in stream.feed(data or b""):
                try:
                    if isinstance(item, FramingError):
                        raise item
                    states.append(parse_status(item, time.monotonic()))
                    newest = item
                except JakaError:
                    damaged += 1
    ended = time.monotonic()
    return FeedSample(None, states, damaged, newest, ended - begun, was_closed, ended)


def ask_controller(host: str, port: int) -> Answers:
    """Connect a command port, ask ``QUESTIONS`` one after the other, and see whether the connection stays."""
    values: Dict[Query, Any] = {}
    refusals: Dict[Query, str] = {}
    try:
        connection = socket.create_connection((host, port), CONNECT_S)
    except (OSError, UnicodeError) as error:
        return Answers(_as_os_error(error), values, refusals, False, False)
    with connection:
        stream = ObjectStream()
        for query in QUESTIONS:
            try:
                connection.sendall(encode_object(encode(query)))
                reply = _reply(connection, stream, command_name(query))
            except (ConnectionError, EOFError):
                return Answers(None, values, refusals, True, False)
            except OSError:
                return Answers(None, values, refusals, False, True)
            try:
                values[query] = decode(query, reply)
            except JakaError as error:
                refusals[query] = str(error)
        was_closed = _receive(connection, time.monotonic() + _STAYS_S) == b""
    return Answers(None, values, refusals, was_closed, False)


def _reply(connection: socket.socket, stream: ObjectStream, name: str) -> JsonObject:
    """Return the reply to a command of this name.

    Raises:
        EOFError: The controller has closed the connection.
        OSError: Nothing came in time.
    """
    deadline = time.monotonic() + _ANSWER_S
    while True:
        data = _receive(connection, deadline)
        if data is None:
            raise socket.timeout("no answer")
        if data == b"":
            raise EOFError
        for item in stream.feed(data):
            if not isinstance(item, FramingError) and item.get("cmdName", name) == name:
                return item


def _receive(connection: socket.socket, deadline: float) -> Optional[bytes]:
    """Return bytes that have arrived; empty where the other end has closed, None where nothing comes in time."""
    connection.settimeout(max(0.001, deadline - time.monotonic()))
    try:
        return connection.recv(_RECEIVE_BYTES)
    except ConnectionError:
        return b""
    except OSError:
        return None


def _as_os_error(error: Exception) -> OSError:
    return error if isinstance(error, OSError) else OSError(str(error))
