"""The triggers of the black box: faults that messages report, and conditions that a user wrote.

A state triggers when it is entered, or when the first message that is seen has it: whoever starts the black box after a
fault still gets what is left of it.
"""
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.driver_interface import CALL_TYPE, DIAGNOSTICS_TYPE, STATE_TYPE, MotionState
from jaka_bag.errors import DefinitionError
from jaka_bag.messages.connection import Connection
from jaka_bag.messages.values import ValueReader

from .expression import Expression, NoValue

_ERROR_LEVEL = 2
LEVELS = ("OK", "WARN", "ERROR", "STALE")
"""Names of the levels of ``diagnostic_msgs/DiagnosticStatus``."""


class Trigger(NamedTuple):
    """The reason why a file is written.

    Attributes:
        kind: ``error``, ``emergency_stop``, ``collision``, ``failed_call``, ``diagnostics``, ``expression``,
            ``service`` or ``signal``.
        detail: The observation in words.
        topic: The topic with the trigger; a service's name for a call, empty for a signal.
    """

    kind: str
    detail: str
    topic: str


_Look = Callable[[Dict[str, Any]], List[Trigger]]


def level_name(level: Any) -> str:
    """Return the name of a diagnostics level; its number where it has none."""
    return LEVELS[level] if isinstance(level, int) and 0 <= level < len(LEVELS) else str(level)


def _state_faults(values: Dict[str, Any]) -> Dict[str, str]:
    """Return the faults in a state message, each with the value that shows it."""
    motion = values.get("motion_state")
    faults = {}
    if motion == MotionState.ERROR:
        faults["error"] = "motion_state is %d, error" % motion
    if motion == MotionState.EMERGENCY_STOP:
        faults["emergency_stop"] = "motion_state is %d, emergency stop" % motion
    if values.get("collision_state"):
        faults["collision"] = "collision_state is %d" % values["collision_state"]
    return faults


class TriggerWatch:
    """The search for triggers in each recorded message.

    Args:
        expressions: Conditions of the user.
        notice: Takes a line for the user.
        watches_faults: Look for faults that the driver's topics report; else only for the expressions.

    Attributes:
        diagnostics: The newest status of each name: level, message, hardware_id, values.
    """

    def __init__(self, expressions: Sequence[Expression], notice: Callable[[str], None],
                 watches_faults: bool = True) -> None:
        self._expressions = expressions
        self._notice = notice
        self._watches_faults = watches_faults
        self._watched = {topic for expression in expressions for topic in expression.topics}
        self._looks: Dict[Connection, Optional[Tuple[ValueReader, List[_Look]]]] = {}
        self._standing: Dict[str, Dict[str, str]] = {}
        self._errors: Dict[Tuple[str, str], bool] = {}
        self._newest: Dict[str, Dict[str, Any]] = {}
        self._held = [False] * len(expressions)
        self._unchanged: Dict[str, bytes] = {}
        self.diagnostics: Dict[str, Dict[str, Any]] = {}

    def look(self, connection: Connection, payload: bytes) -> List[Trigger]:
        """Return the triggers in one message; mostly none."""
        if connection not in self._looks:
            self._looks[connection] = self._prepare(connection)
        known = self._looks[connection]
        if known is None or self._unchanged.get(connection.topic) == payload:
            return []
        if connection.datatype == STATE_TYPE:  # mostly says again what the message before said
            self._unchanged[connection.topic] = payload
        reader, looks = known
        try:
            values = reader.read(payload)
            return [trigger for look in looks for trigger in look(values)]
        except DefinitionError as error:
            self._notice("%s is not watched for triggers: %s" % (connection.topic, error))
        except Exception as error:  # the publisher's own definition makes of its type's fields whatever it likes
            self._notice("%s is not watched for triggers: the fields of %s are not those of its type (%s: %s)" % (
                connection.topic, connection.callerid, type(error).__name__, error))
        self._looks[connection] = None
        return []

    def _prepare(self, connection: Connection) -> Optional[Tuple[ValueReader, List[_Look]]]:
        topic, looks = connection.topic, []
        by_type = {STATE_TYPE: self._look_at_states, CALL_TYPE: self._look_at_call,
                   DIAGNOSTICS_TYPE: self._look_at_diagnostics}
        look = by_type.get(connection.datatype)
        if look is not None and self._watches_faults:
            looks.append(self._of_topic(look, topic))
        if topic in self._watched:
            looks.append(self._of_topic(self._look_at_expressions, topic))
        if not looks:
            return None
        try:
            reader = ValueReader(connection)
        except DefinitionError as error:
            self._notice("%s is not watched for triggers: %s" % (topic, error))
            return None
        for expression in self._expressions:
            for field in expression.fields:
                if field.topic == topic and not reader.has(field.names):
                    self._notice("the trigger %r never acts: %s (%s) has no field %s; its fields are %s" % (
                        expression.text, topic, connection.datatype, ".".join(field.names),
                        ", ".join(reader.field_names())))
        return reader, looks

    @staticmethod
    def _of_topic(look: Callable[[str, Dict[str, Any]], List[Trigger]], topic: str) -> _Look:
        return lambda values: look(topic, values)

    def _look_at_states(self, topic: str, values: Dict[str, Any]) -> List[Trigger]:
        before = self._standing.get(topic, {})
        now = self._standing[topic] = _state_faults(values)
        return [Trigger(kind, detail, topic) for kind, detail in now.items() if kind not in before]

    def _look_at_call(self, topic: str, values: Dict[str, Any]) -> List[Trigger]:
        if values.get("success", True):
            return []
        return [Trigger("failed_call", "%s called by %s failed: %s" % (
            values.get("service", ""), values.get("caller", ""), values.get("error") or "no reason given"), topic)]

    def _look_at_diagnostics(self, topic: str, values: Dict[str, Any]) -> List[Trigger]:
        triggers = []
        for status in values.get("status", ()):
            name, level = str(status["name"]), status["level"]  # texts, whatever the publisher's definition says
            self.diagnostics[name] = {
                "level": level_name(level), "message": str(status["message"]),
                "hardware_id": str(status["hardware_id"]),
                "values": {str(pair["key"]): str(pair["value"]) for pair in status["values"]}}
            was_error = self._errors.get((topic, name), False)
            self._errors[topic, name] = level == _ERROR_LEVEL
            if level == _ERROR_LEVEL and not was_error:
                triggers.append(Trigger("diagnostics", "%s: %s" % (name, status["message"]), topic))
        return triggers

    def _look_at_expressions(self, topic: str, values: Dict[str, Any]) -> List[Trigger]:
        self._newest[topic] = values
        triggers = []
        for number, expression in enumerate(self._expressions):
            if topic not in expression.topics:
                continue
            try:
                holds = expression.holds(self._newest)
            except NoValue:
                holds = False
            if holds and not self._held[number]:
                triggers.append(Trigger("expression", expression.text, topic))
            self._held[number] = holds
        return triggers
