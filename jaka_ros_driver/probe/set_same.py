"""The stage that sets values to what they are, and sets back at once the little that it changes.

All that it sends is in ``SETTINGS`` and ``READ_BACK``. What belongs together, a change and its way back, cannot be
interrupted: Ctrl-C is taken when the values are as they were. A value that no command reads is not written: names of
frames have none, so frames are written only where they are zero and not active.
"""
import contextlib
import math
import signal
import time
from typing import Any, Callable, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.commands import GetDigitalOutput, Query
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.probe.ask import NOT_KNOWN, Questioner, TimedReply, code_of
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.look import HeardFeed, listen
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.protocol.codec import decode
from jaka_ros_driver.protocol.framing import JsonObject, encode_object
from jaka_ros_driver.state import FRESH_S, IoBank, Vector, unrest
from jaka_ros_driver.units import s_to_ms

HOLD_S = 1.0
"""Time, s, for which an output has its other value."""
SETTINGS: Dict[str, str] = {
    "set_payload": "the payload that it has",
    "set_clsn_sensitivity": "the collision level that it has",
    "set_tool_id": "the tool that is active",
    "set_user_id": "the user frame that is active",
    "set_port10000_delay_ms": "the period of the feed: for 1 s the 8 ms for which the driver asks, and back",
    "set_tool_offsets": "zero, of tools that are zero and not active",
    "set_user_offsets": "zero, of user frames that are zero and not active; one of them 1 mm and 2 mm along x, to "
                        "learn which spelling of its key is read, and zero again",
    "torque_control_enable": "off, while hand guiding is off",
    "set_digital_output": "the cabinet's output of --output alone: the other value for %.0f s, and back" % HOLD_S,
}
"""All commands that set, and to what."""
READ_BACK: FrozenSet[str] = frozenset((
    "get_payload", "get_clsn_sensitivity", "get_curr_tool_id", "get_curr_user_id", "get_tool_offsets",
    "get_user_offsets", "get_port10000_delay_ms", "get_drag_status", "get_digital_output"))
"""All commands that read, before and after."""
DRAG_COMMAND = "torque_control_enable"
PERIOD_COMMAND, _PERIOD = "set_port10000_delay_ms", "port10000_delay_ms"
ASKED_S = 0.008
"""Period, s, for which the driver asks."""
_BEFORE_S, _LISTENED_S = 0.3, 1.0
"""Time, s, after which frames come at the new period, and for which they are heard."""
_SLOWER = 1.25
"""A longer mean period, in times what was asked for, is not the one that was asked for."""
_LEAST_FRAMES = 5
"""Fewest frames whose mean period is told."""
_ANSWER_S, _SLOW_S = 3.0, 15.0
"""Patience, s, with a reply; with one that may wait for what it begins."""
_GLANCE_S = 0.01
"""Time, s, of a look at frames between two questions: longer than one cycle (8 ms)."""
_HIGHEST_ID = 15
"""Highest id that any source names (docs/controller-protocol.md section 5.7)."""
_SPELLINGS = (("userffset", 1.0), ("useroffset", 2.0))
"""Keys of ``set_user_offsets``, each with the x, mm, that it is tried with."""
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_came: List[int] = []
"""Signals that were put off."""

PrintLine = Callable[[str], None]


class StageEnded(JakaError):
    """The reason why a stage goes on no further."""


@contextlib.contextmanager
def handled_by(handler: Callable[[int, Any], None], numbers: Sequence[int]) -> Iterator[None]:
    """Have these signals handled so until the end of the block, but for those that this process ignores."""
    before = {number: signal.signal(number, handler) for number in numbers
              if signal.getsignal(number) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for number, its_own in before.items():
            signal.signal(number, its_own)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Put off the signals that would end this process until the end of the block; for the main thread alone.

    They are not blocked: another thread would take them (OpenBLAS begins some), and Python would raise their exception
    in this one all the same.
    """
    is_inner = _put_off in map(signal.getsignal, _ENDING)
    try:
        with handled_by(_put_off, _ENDING):
            yield
    finally:
        if not is_inner and is_interrupted():
            first = _came[0]
            _came.clear()
            signal.raise_signal(first)


def is_interrupted() -> bool:
    """Return whether a signal was put off."""
    return bool(_came)


def _put_off(number: int, frame: Any) -> None:
    _came.append(number)


class SetBack:
    """The account of what a stage changed and could not set back.

    Attributes:
        left: A line for each such value, for the reader.
    """

    def __init__(self) -> None:
        self.left: List[str] = []

    def note(self, what: str, before: Any, after: Any) -> None:
        """Note a value that is not what it was; ``after`` is None where it could not be read."""
        self.left.append("%s: was %s, %s" % (what, before, "could not be read back" if after is None
                                              else "is %s" % after))


class Desk:
    """A connection to the command port beside the feed, which is read while an answer is waited for.

    Args:
        record: Has the connections.
        command_port: TCP port.
        feed: The status feed.
    """

    def __init__(self, record: ConnectionLog, command_port: int, feed: HeardFeed) -> None:
        self._record = record
        self._port = command_port
        self._asked: Optional[Questioner] = None
        self.feed = feed

    def ask(self, name: str, patience: float = _ANSWER_S, **parameters: Any) -> TimedReply:
        """Send a request and wait for its reply. A connection without an answer is made again for the next one."""
        try:
            if self._asked is None:
                self._asked = Questioner(self._record.connect("command", self._port), self.feed)
        except OSError:
            return TimedReply(None, 0.0)
        reply = self._asked.send(encode_object({"cmdName": name, **parameters}), name, patience)
        if reply.content is None:
            self.close()  # a late answer would be taken for that of the next request
        return reply

    def read(self, name: str, **parameters: Any) -> Optional[JsonObject]:
        """Return the reply to a question; None where there is none, or the controller refuses. Ask twice at most."""
        for _ in range(2):
            reply = self.ask(name, **parameters).content
            if reply is not None:
                return reply if code_of(reply) == "0" else None
        return None

    def close(self) -> None:
        """Close the connection."""
        if self._asked is not None:
            self._asked.connection.close()
        self._asked = None

    def frames(self, seconds: float) -> List[float]:
        """Listen for this time, s; return when frames came meanwhile, monotonic s."""
        seen = len(self.feed.times)
        listen([self.feed], time.monotonic() + seconds)
        return self.feed.times[seen:]

    def outputs(self, seconds: float) -> Optional[Vector]:
        """Return the cabinet's outputs in the newest frame of the next time, s, index 0 first; None without one."""
        return self.feed.states[-1].io.values(IoBank.CABINET, True, True) if self.frames(seconds) else None

    def require_rest(self) -> None:
        """Raise StageEnded unless fresh frames show an arm at rest that nobody guides by hand."""
        listen([self.feed], time.monotonic() + _GLANCE_S)
        reason = unrest(self.feed.states[-10:], time.monotonic())
        if not reason and self.feed.states[-1].is_hand_guided:
            reason = "hand guiding is on"
        if reason:
            raise StageEnded(reason)


class _Same(NamedTuple):
    """A setting that is set to the value that it has.

    Attributes:
        getter: The command that reads it.
        value: Takes the reply; returns the parameters of the setter, or raises what damaged replies raise.
        patience: For the setter's reply, s.
    """

    getter: str
    value: Callable[[JsonObject], Dict[str, Any]]
    patience: float = _ANSWER_S


def _payload(reply: JsonObject) -> Dict[str, Any]:
    decode(Query.PAYLOAD, reply)
    return {"mass": reply["mass"], "centroid": reply["centroid"]}


def _level(reply: JsonObject) -> Dict[str, Any]:
    return {"sensitivityVal": decode(Query.COLLISION_LEVEL, reply)}


def _frame_id(reply: JsonObject) -> int:
    number = reply["id"]
    if type(number) is not int or not 0 <= number <= _HIGHEST_ID:
        raise ValueError("%r is no id" % (number,))
    return number


_SAME: Dict[str, _Same] = {
    "set_payload": _Same("get_payload", _payload),
    "set_clsn_sensitivity": _Same("get_clsn_sensitivity", _level),
    "set_tool_id": _Same("get_curr_tool_id", lambda reply: {"tool_id": _frame_id(reply)}, _SLOW_S),
    "set_user_id": _Same("get_curr_user_id", lambda reply: {"user_frame_id": _frame_id(reply)}, _SLOW_S),
}


def set_same(desk: Desk, facts: Facts, back: SetBack, output: Optional[int], ask_person: Callable[[str], str],
             tell: PrintLine) -> None:
    """Set all that the stage sets.

    Args:
        desk: The command port and the feed.
        facts: Takes what is found, also where this is interrupted.
        back: Takes what could not be set back.
        output: Index, in commands, of an output of the cabinet that may be switched; None for none.
        ask_person: Takes a question and returns the answer; "" where nobody is there.
        tell: Takes a line before each part.

    Raises:
        StageEnded: The arm moves, is guided, or is not seen any more; what was changed is set back.
    """
    taken: List[str] = []
    outcomes: List[str] = []
    try:
        for setter in _SAME:
            tell("now %s" % setter)
            desk.require_rest()
            outcome = _same(desk, setter, back)
            outcomes.append("%s %s" % (setter, outcome or "reads back the same"))
            taken += [] if outcome else [setter]
    finally:
        facts["same_values"] = Fact(taken, "; ".join(outcomes))
    tell("now %s" % PERIOD_COMMAND)
    desk.require_rest()
    facts["feed_period_asked"] = _asked_period(desk, facts, back)
    tell("now set_tool_offsets")
    tools = _free_frames(desk, back, "tool", ("tooloffset",))
    facts["tool_ids"] = tools.fact
    tell("now set_user_offsets")
    users = _free_frames(desk, back, "user", tuple(key for key, _ in _SPELLINGS))
    facts["user_ids"] = users.fact
    facts["user_frame_key"] = _spelling(desk, back, users)
    tell("now %s" % DRAG_COMMAND)
    desk.require_rest()
    facts["drag_command"] = _drag_command(desk)
    if facts["drag_command"].value == "not known":
        note_missing(facts, DRAG_COMMAND)
    if output is not None:
        tell("now set_digital_output")
        desk.require_rest()
        _switch_output(desk, facts, back, output, ask_person)


def note_missing(facts: Facts, command: str) -> None:
    """Note a command that the controller does not know."""
    missing = facts.get("commands_missing")
    if missing is not None and missing.value is not None:
        facts["commands_missing"] = missing._replace(value=sorted({*missing.value, command}))


def _same(desk: Desk, setter: str, back: SetBack) -> str:
    """Set a value to what it is; return why that is not settled, "" where it reads back the same."""
    row = _SAME[setter]
    before = _value(desk, row)
    if before is None:
        return "was not sent, %s has no such answer" % row.getter
    with uninterrupted():
        reply = desk.ask(setter, row.patience, **before)
        after = _as_before(desk, setter, row, before, 1)
        if not _is_equal(after, before):
            back.note(setter, before, after)
            return "does not read back the same"
    return _why_refused(reply)


def _as_before(desk: Desk, setter: str, row: _Same, before: Dict[str, Any], tries: int) -> Optional[Dict[str, Any]]:
    """Set a value that is not what it was so many times at most; return what it is in the end."""
    after = _value(desk, row)
    for _ in range(tries):
        if _is_equal(after, before):
            break
        desk.ask(setter, row.patience, **before)
        after = _value(desk, row)
    return after


def _value(desk: Desk, row: _Same) -> Optional[Dict[str, Any]]:
    reply = desk.read(row.getter)
    try:
        return None if reply is None else row.value(reply)
    except (JakaError, KeyError, TypeError, ValueError):
        return None


def _why_refused(reply: TimedReply) -> str:
    if reply.content is None:
        return "is not answered"
    return "" if code_of(reply.content) == "0" else "is refused with code %s" % code_of(reply.content)


def _is_equal(one: Any, other: Any) -> bool:
    """Return whether two values of JSON are the same but for a controller's rounding."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_is_equal(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)) and isinstance(other, (list, tuple)):
        return len(one) == len(other) and all(map(_is_equal, one, other))
    try:
        return math.isclose(float(one), float(other), rel_tol=1e-6, abs_tol=1e-3)
    except (TypeError, ValueError, OverflowError):
        return bool(one == other)


# ---- frames ----

class _Frames(NamedTuple):
    """The frames that may be written: which ids took their own value, and the names of their commands and keys."""

    fact: Fact
    ids: Tuple[int, ...]
    kind: str
    keys: Tuple[str, ...]

    def read(self, desk: Desk) -> Optional[List[List[float]]]:
        """Return the table by id, mm and deg as on the wire; None where it is not known."""
        reply = desk.read("get_%s_offsets" % self.kind)
        try:
            if reply is not None:
                decode(Query.TOOL_FRAMES if self.kind == "tool" else Query.USER_FRAMES, reply)
                return [list(map(float, row)) for row in reply["%s_offsets" % self.kind]]
        except (JakaError, KeyError, TypeError, ValueError, OverflowError):
            pass
        return None

    def write(self, desk: Desk, number: int, x: float, keys: Sequence[str]) -> TimedReply:
        """Write the frame of an id, zero but for x, mm, under these keys."""
        pose = [x, 0.0, 0.0, 0.0, 0.0, 0.0]
        return desk.ask("set_%s_offsets" % self.kind, _ANSWER_S, id=number, **dict.fromkeys(keys, pose))


def _free_frames(desk: Desk, back: SetBack, kind: str, keys: Tuple[str, ...]) -> _Frames:
    """Set every frame that is zero and not active to zero, and see which ids are taken."""
    desk.require_rest()
    frames = _Frames(Fact(None, ""), (), kind, keys)
    before, active = frames.read(desk), _active(desk, kind)
    if before is None or active is None:
        return frames._replace(fact=Fact(None, "the table, or which of it is active, is not known"))
    free = [number for number in range(1, min(len(before), _HIGHEST_ID + 1))
            if number not in active and not any(before[number])]
    taken, codes = [], []
    for number in free:
        desk.require_rest()
        with uninterrupted():
            why = _why_refused(frames.write(desk, number, 0.0, keys))
            after = frames.read(desk)
            if not _is_equal(after, before):
                frames.write(desk, number, 0.0, keys)
                after = frames.read(desk)
            if not _is_equal(after, before):
                back.note("%s frames, after id %d was set to zero" % (kind, number), before, after)
                return frames._replace(fact=Fact(None, "id %d does not read back what it was" % number))
        taken += [] if why else [number]
        codes += [why] if why else []
    how = "of the table's 0 to %d, %s are zero and not active" % (len(before) - 1, _numbers(free))
    if codes:
        how += "; others: %s" % ", ".join(sorted(set(codes)))
    return frames._replace(fact=Fact(taken or None, how), ids=tuple(taken))


def _active(desk: Desk, kind: str) -> Optional[Tuple[int, ...]]:
    """Return the active id by the reply and by the feed; None where neither has it."""
    reply, state = desk.read("get_curr_%s_id" % kind), desk.feed.states[-1]
    found = [state.tool_id if kind == "tool" else state.user_frame_id]
    with contextlib.suppress(KeyError, TypeError, ValueError):
        found.append(None if reply is None else _frame_id(reply))
    return tuple(number for number in found if number is not None) or None


def _numbers(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or "none"


def _spelling(desk: Desk, back: SetBack, users: _Frames) -> Fact:
    """Find out which key of ``set_user_offsets`` is read, on one frame that is zero and not active."""
    if not users.ids:
        return Fact(None, "no user frame that is zero and not active takes a value")
    number = max(users.ids)
    read: List[str] = []
    desk.require_rest()
    with uninterrupted():
        before = users.read(desk)
        if before is None or any(before[number]):
            return Fact(None, "user frame %d is not zero any more" % number)
        try:
            for key, x in _SPELLINGS:
                users.write(desk, number, x, (key,))
                table = users.read(desk)
                if table is not None and number < len(table) and _is_equal(table[number][0], x):
                    read.append(key)
        finally:
            is_back = _zero_again(desk, back, users, number, before)
    if not is_back:
        return Fact(None, "user frame %d did not become zero again" % number)
    how = "user frame %d read back what was set under %s" % (number, " and ".join(read) or "neither key")
    return Fact({2: "either", 1: read[0] if read else None, 0: None}[len(read)], how)


def _zero_again(desk: Desk, back: SetBack, users: _Frames, number: int, before: List[List[float]]) -> bool:
    """Set a user frame to zero; return whether the table is as it was before."""
    after: Optional[List[List[float]]] = None
    for _ in range(2):
        users.write(desk, number, 0.0, users.keys)
        after = users.read(desk)
        if _is_equal(after, before):
            return True
    back.note("user frame %d" % number, "zero", None if after is None else after[number:number + 1])
    return False


# ---- the feed ----

def _told_period(reply: JsonObject) -> Dict[str, Any]:
    if not decode(Query.FEED_PERIOD, reply) > 0.0:
        raise ValueError("%r is no period" % (reply[_PERIOD],))
    return {_PERIOD: reply[_PERIOD]}


_TOLD = _Same("get_%s" % _PERIOD, _told_period)


def _asked_period(desk: Desk, facts: Facts, back: SetBack) -> Fact:
    """Ask for the period for which the driver asks, see at which one frames come, and set it back."""
    before = _value(desk, _TOLD)
    if before is None:
        return Fact(None, "the controller does not tell its period, so it could not be set back")
    times: List[float] = []
    with uninterrupted():
        try:
            reply = desk.ask(PERIOD_COMMAND, **{_PERIOD: round(s_to_ms(ASKED_S))})
            if not _why_refused(reply):
                desk.frames(_BEFORE_S)
                times = desk.frames(_LISTENED_S)
        finally:
            after = _as_before(desk, PERIOD_COMMAND, _TOLD, before, 2)
            if not _is_equal(after, before):
                back.note("period of the feed, ms", before[_PERIOD], None if after is None else after[_PERIOD])
    if reply.content is not None and code_of(reply.content) == NOT_KNOWN:
        note_missing(facts, PERIOD_COMMAND)
    why = _why_refused(reply)
    if why or len(times) < _LEAST_FRAMES:
        return Fact(None, "%s %s" % (PERIOD_COMMAND, why or "was taken, and %d frames came" % len(times)))
    mean = (times[-1] - times[0]) / (len(times) - 1)
    return Fact(ASKED_S if mean <= _SLOWER * ASKED_S else round(mean, 5),
                "mean of %d frames: %.2f ms, 8 ms were asked for" % (len(times), s_to_ms(mean)))


# ---- hand guiding, outputs ----

def _drag_command(desk: Desk) -> Fact:
    """Find out whether the command is known, by switching off what is off."""
    shown = desk.feed.states[-1].is_hand_guided
    reply = desk.read("get_drag_status") or {}
    told = [value for value in (shown, reply.get("status", reply.get("drag_status"))) if value is not None]
    if not told or any(str(value).lower() not in ("false", "0") for value in told):
        return Fact(None, "whether hand guiding is off is not known")
    with uninterrupted():
        answer = desk.ask(DRAG_COMMAND, _SLOW_S, enable_flag=0)
    if answer.content is None:
        return Fact(None, "%s 0 is not answered within %.0f s" % (DRAG_COMMAND, _SLOW_S))
    code = code_of(answer.content)
    return Fact("not known" if code == NOT_KNOWN else DRAG_COMMAND, "its answer to 0 has code %s, after %.2f s" % (
        code, answer.seconds))


def _switch_output(desk: Desk, facts: Facts, back: SetBack, index: int, ask_person: Callable[[str], str]) -> None:
    """Switch an output and see which terminal changes in the feed, and which one a person sees."""
    before = desk.outputs(2.0 * FRESH_S)
    if before is None or len(before) <= index:
        facts["io_index_base"] = Fact(None, "the feed does not show outputs 0 to %d" % index)
        return
    value = _output_value(desk, index, before)
    if value is None:
        facts["io_index_base"] = Fact(None, "the value of index %d is not known" % index)
        return
    with uninterrupted():
        during: Optional[Vector] = None
        try:
            reply = desk.ask("set_digital_output", type=int(IoBank.CABINET), index=index, value=int(not value))
            during = _shown(desk, HOLD_S, before)
        finally:
            changed = [place for place in range(len(before)) if during is not None and during[place] != before[place]]
            found = [place for place in changed if place in (index - 1, index)]
            _switch_back(desk, back, index, bool(before[found[0]]) if len(found) == 1 else value, before)
    how = "set_digital_output of index %d changed %s of the feed's outputs, counted from 0%s" % (
        index, _numbers(changed), "" if not _why_refused(reply) else "; it " + _why_refused(reply))
    base = index - found[0] if len(found) == 1 and changed == found else None
    facts["io_index_base"] = Fact(base, how)
    facts["io_terminal"] = Fact(None, "nobody was asked, or has seen it")
    seen = ask_person("which of the cabinet's digital outputs has switched for %.0f s, by its label? (a number; Enter "
                      "where you did not see it) " % HOLD_S).strip()
    if not (seen.isdigit() and len(seen) < 4):
        return
    facts["io_terminal"] = Fact(int(seen), "as a person saw it, of index %d in the command" % index)
    if base is not None and int(seen) not in (found[0], found[0] + 1):
        facts["io_index_base"] = Fact(None, "%s, and a person saw %s" % (how, seen))


def _output_value(desk: Desk, index: int, before: Vector) -> Optional[bool]:
    reply = desk.read("get_digital_output", type=int(IoBank.CABINET), index=index)
    with contextlib.suppress(JakaError):
        if reply is not None:
            return bool(decode(GetDigitalOutput(IoBank.CABINET, index), reply))
    return bool(before[index]) if before[index] == before[index - 1] else None


def _shown(desk: Desk, seconds: float, before: Vector) -> Optional[Vector]:
    """Return the outputs as ``Desk.outputs`` does; None also where the feed does not show all that it showed before."""
    found = desk.outputs(seconds)
    return found if found is not None and len(found) >= len(before) else None


def _switch_back(desk: Desk, back: SetBack, index: int, value: bool, before: Vector) -> None:
    """Switch an output back until the feed shows both terminals that the index can mean as they were.

    Without a frame nothing is known of how the index is counted, so the value that is sent stays.
    """
    places = (index - 1, index)
    after: Optional[Vector] = None
    for _ in range(3):
        desk.ask("set_digital_output", type=int(IoBank.CABINET), index=index, value=int(value))
        after = _shown(desk, 0.3 * HOLD_S, before)
        if after is None:
            continue
        wrong = [place for place in places if after[place] != before[place]]
        if not wrong:
            return
        value = bool(before[wrong[0]])  # the index is counted otherwise in what reads it
    back.note("outputs %d and %d, counted from 0" % places, [before[place] for place in places],
              None if after is None else [after[place] for place in places])
