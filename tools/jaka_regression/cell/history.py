"""The history of a log: the causes that it shows, and what people and the world did at the controller."""
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.driver_interface import CALL_TYPE, STATE_TYPE, MotionState
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.decoding import Decoder
from jaka_bag.messages.selection import Selection
from jaka_bag.paths import PathLike
from jaka_bag.units import NS_PER_S

from ..scenario import IO_TOPIC, CauseKind
from .sightings import Sighting, Sightings, TerminalKey, terminals_in

_HIT_N = 300
"""Force of a hit in place of one that a log has not: it stops an arm at every collision level."""


class Doing(NamedTuple):
    """Something that was done at the controller, not by its driver.

    Attributes:
        arm: Namespace.
        at: Time, s since the log's first message.
        request: The same for the simulated controller's operator port.
    """

    arm: str
    at: float
    request: Mapping[str, Any]


class CellHistory(NamedTuple):
    """The history of one log.

    Attributes:
        sightings: Causes in the order of time.
        doings: Doings in the order of time.
        begins_with: By arm, the levels of its digital terminals where the log begins.
        notes: Sentences about what was seen and cannot be done again.
    """

    sightings: Tuple[Sighting, ...]
    doings: Tuple[Doing, ...]
    begins_with: Dict[str, Dict[TerminalKey, int]]
    notes: Tuple[str, ...]


class _Reader:
    """The reader of one log."""

    def __init__(self, arms: Sequence[str]) -> None:
        self._arms = {arm: Sightings(arm) for arm in arms}
        self._decoders: Dict[Connection, Decoder] = {}
        self._states: Dict[str, Mapping[str, int]] = {}
        self.sightings: List[Sighting] = []
        self.doings: List[Doing] = []
        self.begins_with: Dict[str, Dict[TerminalKey, int]] = {}
        self.notes: List[str] = []

    def wants(self, topic: str) -> bool:
        """Return whether a topic is one of an arm's that are read."""
        arm, _, name = topic.partition("/jaka_driver/")
        return arm in self._arms and name in ("joint_position", "robot_states", "service_calls", IO_TOPIC)

    def take(self, connection: Connection, raw: bytes, at: float) -> None:
        """Read one message, recorded at s since the log's first one."""
        if connection not in self._decoders:
            self._decoders[connection] = Decoder(connection)
        message = self._decoders[connection].decode(raw)
        arm = connection.topic.partition("/jaka_driver/")[0]
        seen = self._arms[arm]
        if connection.topic.endswith("/" + IO_TOPIC):
            self._take_terminals(arm, seen, terminals_in(message), at)
        elif connection.datatype == CALL_TYPE:
            self.sightings += seen.answered(message["service"].rpartition("/jaka_driver/")[2], at)
        elif connection.datatype == STATE_TYPE:
            self._take_state(arm, message, at)
        elif connection.topic.endswith("/joint_position"):
            self.sightings += seen.joints(message["position"], at)

    def _take_terminals(self, arm: str, seen: Sightings, levels: Dict[TerminalKey, int], at: float) -> None:
        self.begins_with.setdefault(arm, levels)
        found = seen.terminals(levels, at)
        self.sightings += found
        for sighting in found:
            if sighting.cause.kind is CauseKind.INPUT:
                bank, index, level = sighting.cause.what
                self.doings.append(Doing(arm, at, set_input(bank, index, level)))

    def _take_state(self, arm: str, state: Mapping[str, int], at: float) -> None:
        before = self._states.setdefault(arm, state)
        self._states[arm] = state
        was, now = (some["motion_state"] for some in (before, state))
        if now != was and MotionState.EMERGENCY_STOP in (was, now):
            pressed = now == MotionState.EMERGENCY_STOP
            self.doings.append(Doing(arm, at, {
                "action": "press_emergency_stop" if pressed else "release_emergency_stop"}))
        if state["collision_state"] and not before["collision_state"]:
            self.doings.append(Doing(arm, at, {"action": "hit", "force": _HIT_N}))
            self.notes.append("the force and the joint of the hit at %.2f s are not in the log" % at)
        if now != was and now == MotionState.PAUSED:
            self.notes.append("the pause at %.2f s: the operator port has none, so that only the cell's nodes make "
                              "it again" % at)


def set_input(bank: str, index: int, level: int) -> Dict[str, Any]:
    """Return the request to the operator port that sets a digital input."""
    request: Dict[str, Any] = {"action": "set_input", "index": index, "value": level}
    return request if bank == "cabinet" else {**request, "bank": bank}


def read_history(log: PathLike, arms: Sequence[str]) -> CellHistory:
    """Read what a log shows.

    Args:
        log: A .bag or .mcap of ROS 1 messages.
        arms: Namespaces of the arms.

    Raises:
        BagError: It cannot be read, or a message does not fit its definition.
    """
    wanted = _Reader(arms)
    begin: Optional[int] = None
    with open_log(log) as reader:
        begin = reader.index.start_time
        topics = [connection.topic for connection in reader.connections if wanted.wants(connection.topic)]
        if topics and begin is not None:
            for message in messages_of(reader, Selection(topics=topics)):
                wanted.take(message.connection, message.data, (message.log_time - begin) / NS_PER_S)
    return CellHistory(tuple(sorted(wanted.sightings, key=lambda sighting: sighting.at)), tuple(wanted.doings),
                   wanted.begins_with, tuple(wanted.notes))
