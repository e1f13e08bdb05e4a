"""The stage that reads values on the command port.

All that it sends is in ``QUESTIONS`` and ``ODD``: names that begin with get or is, one name that no controller knows,
and one piece that is no JSON, on a connection of its own. None sets, moves or powers anything
(docs/controller-protocol.md section 5).
"""
import select
import time
from typing import Any, Callable, Dict, FrozenSet, List, NamedTuple, Optional, Set, Tuple

from jaka_ros_driver.commands import Pose, Query
from jaka_ros_driver.errors import FramingError, JakaError
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fields import reply_types
from jaka_ros_driver.probe.look import HeardFeed, kinematics_facts, listen
from jaka_ros_driver.probe.recorded import ConnectionLog, KeptConnection, quantile
from jaka_ros_driver.protocol.codec import decode
from jaka_ros_driver.protocol.framing import JsonObject, ObjectStream, encode_object
from jaka_ros_driver.state import unrest

_ANSWER_S = 3.0
"""Longest wait, s, for an answer of which it is to be known whether it comes at all."""
_SHORT_S = 1.0
"""Longest wait, s, for what a controller has answered before, or may never answer: several questions wait for it."""
_POLLED_S = 2.0
"""Time, s, of asking without a pause: some hundred answers, for the 99th percentile."""
_GLANCE_S = 0.01
"""Time, s, of a look at frames that have come: longer than one cycle (8 ms)."""
_LONGEST_PERIOD_MS = 1e6
"""Longest period, ms, of a feed that is believed; with more the reply means something else."""
_ENVELOPE = frozenset(("cmdName", "errorCode", "errorMsg"))
NOT_KNOWN = "1"
"""``errorCode`` of what a controller does not understand (docs/controller-protocol.md section 4.3)."""


class Question(NamedTuple):
    """A command that only reads.

    Attributes:
        why: What its answer is for.
        fields: The fields of its reply that sources name.
    """

    why: str
    fields: FrozenSet[str]


def _question(why: str, *fields: str) -> Question:
    return Question(why, frozenset(fields))


QUESTIONS: Dict[str, Question] = {
    "get_version": _question("generation of the controller", "version", "robot_name", "robot_id"),
    "get_robot_state": _question("texts or numbers", "enable", "power", "errcode", "msg"),
    "get_joint_pos": _question("the driver's second witness", "joint_pos"),
    "get_tcp_pos": _question("units", "tcp_pos"),
    "get_port10000_delay_ms": _question("period of the feed", "port10000_delay_ms"),
    "get_tool_offsets": _question("the flange behind the tool", "tool_offsets"),
    "get_user_offsets": _question("the base behind the user frame", "user_offsets"),
    "get_curr_tool_id": _question("the active tool", "id"),
    "get_curr_user_id": _question("the active user frame", "id"),
    "get_clsn_sensitivity": _question("key of its reply", "sensitivityLevel", "sensitivityVal"),
    "get_payload": _question("whether it is known", "mass", "centroid"),
    "get_rapid_rate": _question("whether it is known", "value"),
    "get_program_state": _question("whether it is known", "programState"),
    "get_motion_state": _question("whether it is known", "inpos", "paused", "queue", "active_queue", "motion_line",
                                  "err_add_line", "queue_full", "isOnLimit", "isInEstop", "isInCollision"),
    "is_in_servomove": _question("whether it is known", "in_servomove"),
    "get_dh_param": _question("whether it is known", "dh_param"),
    "get_installation_angle": _question("whether it is known", "installation_angle"),
    "get_drag_status": _question("whether it is known", "status", "drag_status"),
}
"""All questions, in their order."""
UNKNOWN_COMMAND = "get_what_no_controller_has"
MALFORMED = b'{"cmdName": "get_version", }'
ODD: Tuple[bytes, ...] = (encode_object({"cmdName": UNKNOWN_COMMAND}), MALFORMED)
"""All that is sent besides the questions."""


class TimedReply(NamedTuple):
    """The answer to a question; ``content`` is None where none came in time; ``seconds`` is how long it took."""

    content: Optional[JsonObject]
    seconds: float


class Questioner:
    """A connection to the command port that asks one thing at a time; a feed is read while it waits."""

    def __init__(self, connection: KeptConnection, feed: Optional[HeardFeed] = None) -> None:
        self.connection = connection
        self._feed = feed
        self._stream = ObjectStream()
        self._waiting: List[JsonObject] = []

    def ask(self, name: str, patience: float = _ANSWER_S) -> TimedReply:
        """Ask, and wait for the reply."""
        return self.send(encode_object({"cmdName": name}), name, patience)

    def send(self, data: bytes, name: str, patience: float) -> TimedReply:
        """Send bytes, and wait for the reply to a command of this name, or to one that it does not name."""
        begun = time.monotonic()
        if self.connection.is_closed or not self.connection.send(data):
            return TimedReply(None, 0.0)
        return self.next(name, begun, patience)

    def next(self, name: str, begun: float, patience: float) -> TimedReply:
        """Wait for such a reply; ``begun`` is the moment from which the time counts. A late one to another is left."""
        while True:
            while self._waiting:
                found = self._waiting.pop(0)
                if found.get("cmdName", name) == name:
                    return TimedReply(found, time.monotonic() - begun)
            data = self._receive(begun + patience)
            if not data:
                return TimedReply(None, time.monotonic() - begun)
            self._waiting += [item for item in self._stream.feed(data) if not isinstance(item, FramingError)]

    def _receive(self, deadline: float) -> bytes:
        """Return what has come by a moment, as ``KeptConnection.receive`` does, and read the feed meanwhile."""
        feed = self._feed
        while feed is not None and not feed.connection.is_closed and not self.connection.is_closed:
            ready, _, _ = select.select([self.connection, feed.connection], [], [],
                                        max(0.0, deadline - time.monotonic()))
            if feed.connection in ready:
                feed.read()
            if self.connection in ready:
                return self.connection.receive_now()
            if time.monotonic() >= deadline:
                return b""
        return self.connection.receive(deadline)


def ask(record: ConnectionLog, facts: Facts, command_port: int, feed: Optional[HeardFeed],
        tell: Callable[[str], None]) -> None:
    """Ask all that the stage asks.

    Args:
        record: Has the connections.
        facts: Takes what is found, also where this is interrupted.
        command_port: TCP port.
        feed: The status feed, to be read meanwhile; None where there is none.
        tell: Takes a line before each part.

    Raises:
        OSError: The command port cannot be connected.
    """
    asked = Questioner(record.connect("command", command_port))
    tell("%d questions, one after the other" % len(QUESTIONS))
    replies = {name: asked.ask(name) for name in QUESTIONS}
    facts.update(_reply_facts(replies))
    facts.update(kinematics_facts(feed, frames_of(Query.TOOL_FRAMES, replies["get_tool_offsets"].content),
                                  frames_of(Query.USER_FRAMES, replies["get_user_offsets"].content)))
    tell("two questions as one piece, one in two pieces, a name that nobody knows")
    answers_all = all(reply.content is not None for reply in replies.values())
    facts.update(_framing_facts(asked, answers_all))
    tell("get_joint_pos for %.0f s, again as soon as it is answered" % _POLLED_S)
    facts.update(_polling_facts(asked, feed))
    tell("a second connection to the command port, beside the first")
    reason = _unrest(feed)
    facts["second_client"], kept = (Fact(None, reason), None) if reason else _second_client(record, command_port, asked)
    for one in (asked, kept):
        if one is not None:
            one.connection.close()
    time.sleep(_SHORT_S)  # a controller that serves one client must have seen the end of that one
    tell("%s, which is no JSON, on a connection of its own" % MALFORMED.decode())
    reason = _unrest(feed)
    facts["malformed"] = Fact(None, reason) if reason else _malformed(record, command_port, answers_all)


def _unrest(feed: Optional[HeardFeed]) -> str:
    """Return why no other connection is made now: somebody may have taken the port since, and move the arm."""
    if feed is None or not feed.states:
        return ""
    listen([feed], time.monotonic() + _GLANCE_S)
    return unrest(feed.states, time.monotonic())


def _reply_facts(replies: Dict[str, TimedReply]) -> Facts:
    contents = {name: reply.content for name, reply in replies.items() if reply.content is not None}
    how = "%d of %d questions were answered" % (len(contents), len(replies))
    if not contents:
        return {"reply_time": Fact(None, how)}
    times = [replies[name].seconds for name in contents]
    known = {name: content for name, content in contents.items() if code_of(content) == "0"}
    extra = sorted({key for name, content in contents.items()
                    for key in set(content) - _ENVELOPE - QUESTIONS[name].fields})
    missing = sorted(name for name, content in contents.items() if code_of(content) == NOT_KNOWN)
    codes = {type(content.get("errorCode")) for content in contents.values()}
    facts = {
        "reply_time": Fact(round(quantile(times, 0.5), 5), how, "%.4f to %.4f" % (min(times), max(times))),
        "error_code": _choice({str: "text", int: "number"}, codes, how),
        "reply_fields_unknown": Fact(extra, how),
        "reply_types": Fact(reply_types(contents), how),
        "commands_missing": Fact(missing, how) if len(contents) == len(replies) else Fact(
            None, "%s; code 1: %s" % (how, ", ".join(missing) or "none")),
        "version": _text(known.get("get_version", {}).get("version"), "as it answers"),
        "robot_state": _robot_state(known.get("get_robot_state", {})),
        "sensitivity_key": _sensitivity_key(known.get("get_clsn_sensitivity", {}))}
    facts["feed_period_told"] = _told_period(known.get("get_port10000_delay_ms", {}).get("port10000_delay_ms"))
    return facts


def _told_period(value: Any) -> Fact:
    """Return the period, s, of an answer in ms, which may be a text of digits."""
    if isinstance(value, str) and value.isdigit() and len(value) < 7:
        value = int(value)
    if type(value) not in (int, float) or not 0 <= value <= _LONGEST_PERIOD_MS:
        return Fact(None, "it does not answer with a period")
    return Fact(round(value / 1000.0, 4), "as it answers")


def code_of(content: JsonObject) -> str:
    """Return the ``errorCode`` of a reply as a text; "" where it has none."""
    return str(content.get("errorCode", "")).strip()


def _text(value: Any, how: str) -> Fact:
    return Fact(value, how) if isinstance(value, str) and value else Fact(None, "it does not answer with a text")


def _choice(names: Dict[type, str], seen: Set[type], how: str) -> Fact:
    """Return the one name that all values have; not settled where they differ."""
    found = {names.get(kind, kind.__name__) for kind in seen}
    if len(found) == 1 and seen <= set(names):
        return Fact(found.pop(), how)
    return Fact(None, "they are %s" % ", ".join(sorted(found)))


def _robot_state(reply: JsonObject) -> Fact:
    values = [reply[key] for key in ("enable", "power") if key in reply]
    if not values:
        return Fact(None, "no such reply")
    kinds = {"texts" if isinstance(value, str) else "numbers" for value in values}
    return Fact(kinds.pop(), "%s" % values) if len(kinds) == 1 else Fact(None, "%s" % values)


def _sensitivity_key(reply: JsonObject) -> Fact:
    keys = sorted(set(reply) & QUESTIONS["get_clsn_sensitivity"].fields)
    if not keys:
        return Fact(None, "no such reply")
    return Fact(keys[0] if len(keys) == 1 else "both", ", ".join(keys))


def frames_of(query: Query, reply: Optional[JsonObject]) -> Optional[Tuple[Pose, ...]]:
    """Return the frames in a reply by id; None where there is none, or it does not hold them."""
    try:
        found: Optional[Tuple[Pose, ...]] = decode(query, reply) if reply is not None else None
        return found
    except JakaError:
        return None


def _framing_facts(asked: Questioner, answers_all: bool) -> Facts:
    """Return what becomes of odd requests.

    answers_all: Every question was answered; without that, silence does not tell anything of these.
    """
    name = "get_version"
    question = encode_object({"cmdName": name})
    begun = time.monotonic()
    answers = [asked.send(question + question, name, _SHORT_S), asked.next(name, begun, _SHORT_S)]
    count = sum(answer.content is not None for answer in answers)
    facts = {"two_in_one_segment": Fact(count if count or answers_all and not asked.connection.is_closed else None,
                                        "%d answers within %.0f s" % (count, _SHORT_S))}
    if asked.connection.is_closed or not asked.connection.send(question[:9]):
        return {**facts, "cut_in_two": Fact(None, "the connection was closed")}
    time.sleep(0.1)
    whole = asked.send(question[9:], name, _SHORT_S)
    is_answered = whole.content is not None
    facts["cut_in_two"] = Fact(is_answered if is_answered or answers_all and not asked.connection.is_closed else None,
                               "%s within %.0f s" % (_words(whole, asked), _SHORT_S))
    odd = asked.ask(UNKNOWN_COMMAND, _SHORT_S)
    facts["unknown_command"] = Fact(None, "no answer within %.0f s" % _SHORT_S) if odd.content is None else Fact(
        "code %s%s" % (code_of(odd.content), ", which names it" if odd.content.get("cmdName") else ", without a name"),
        str(odd.content.get("errorMsg", ""))[:80])
    return facts


def _polling_facts(asked: Questioner, feed: Optional[HeardFeed]) -> Facts:
    begun = time.monotonic()
    times: List[float] = []
    seen = 0 if feed is None else len(feed.times)
    while time.monotonic() < begun + _POLLED_S:
        reply = asked.ask("get_joint_pos", _SHORT_S)
        if reply.content is None:
            break
        times.append(reply.seconds)
        if feed is not None:
            listen([feed], time.monotonic() + 0.002)
    took = time.monotonic() - begun
    if len(times) < 2:
        return {"poll_rate": Fact(None, "%d questions were answered" % len(times))}
    how = "%d questions in %.1f s" % (len(times), took)
    facts = {"poll_rate": Fact(round(len(times) / took, 1), how),
             "reply_time_p99": Fact(round(quantile(times, 0.99), 5), how)}
    gaps = [] if feed is None else feed.gaps[seen:]
    if gaps:
        facts["feed_under_polling"] = Fact(round(max(gaps), 4), "%d frames meanwhile" % len(gaps))
    return facts


def _second_client(record: ConnectionLog, port: int, first: Questioner) -> Tuple[Fact, Optional[Questioner]]:
    if first.connection.is_closed:
        return Fact(None, "the first connection was closed before"), None
    try:
        second = Questioner(record.connect("command", port))
    except OSError as error:
        return Fact("refused", "it could not connect: %s" % error), None
    answer = second.ask("get_version", _SHORT_S)
    before = first.ask("get_version", _SHORT_S)
    seen = "the second is %s, the first then %s" % (_words(answer, second), _words(before, first))
    fate = {(True, True): "coexists", (True, False): "replaces", (False, True): "refused"}.get(
        (answer.content is not None, before.content is not None))
    return Fact(fate, seen), second


def _words(reply: TimedReply, asked: Questioner) -> str:
    return "answered" if reply.content is not None else "closed" if asked.connection.is_closed else "silent"


def _malformed(record: ConnectionLog, port: int, answers_all: bool) -> Fact:
    try:
        asked = Questioner(record.connect("command", port))
    except OSError as error:
        return Fact(None, "it could not connect: %s" % error)
    try:
        reply = asked.send(MALFORMED, "get_version", _SHORT_S)
        words = _words(reply, asked)
        after = asked.ask("get_version", _SHORT_S)
        fate = words if words != "silent" else "ignored" if answers_all else None
        return Fact(fate, "it is %s, a question after it %s" % (words, _words(after, asked)))
    finally:
        asked.connection.close()
