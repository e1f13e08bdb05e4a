"""The facts that a log has about itself: cell, arm, versions, triggers, messages that the recorder knows to be lost.

Reading raises ``BagFormatError`` where the log is damaged.
"""
import json
import re
from typing import Any, Dict, Iterator, NamedTuple, Tuple

from jaka_bag.containers.interface import LogReader
from jaka_bag.containers.time_order import messages_of
from jaka_bag.driver_interface import DIAGNOSTICS_TYPE
from jaka_bag.errors import DefinitionError
from jaka_bag.log_records import ACCIDENT, DROPS, TRIGGER
from jaka_bag.messages.selection import Selection
from jaka_bag.messages.values import ValueReaders

from .runs import TriggerEvent

CELL_KEY = "cell"
"""Key of a metadata record of any name; ``jaka_bag attach --metadata`` writes such."""
_LOST_COUNTS = ("undelivered", "overflowed", "unwritten")
_VERSION_KEYS = {"driver": "driver_version", "controller": "controller_version", "model": "model"}
_LOOKED_AT = 100
"""Messages of diagnostics until the driver's versions must have come."""
_MOST_LOST = 1 << 40
"""Messages that no recorder loses: a count from here on is none, and sums of those below fit into a table."""


class LogFacts(NamedTuple):
    """The facts found in a log; a text is empty where the log does not have it.

    Attributes:
        cell: Cell in which it was recorded.
        arm_model: Model of the arm, as ``zu7``.
        controller_firmware: Version that the controller reports.
        driver_version: Version of the driver.
        triggers: Triggers of a black box, by time.
        lost: Number of messages that the recorder knows to be lost, by topic.
    """

    cell: str
    arm_model: str
    controller_firmware: str
    driver_version: str
    triggers: Tuple[TriggerEvent, ...]
    lost: Dict[str, int]


def read_facts(reader: LogReader) -> LogFacts:
    """Read the facts that a log has about itself."""
    records = [(entry.name, reader.read_metadata(entry)) for entry in reader.index.metadata]
    facts: Dict[str, str] = {}
    triggers = []
    lost: Dict[str, int] = {}
    for name, values in records:
        if name == TRIGGER:
            triggers.append(TriggerEvent(_whole(values.get("time_ns")), values.get("kind", ""),
                                         values.get("detail", "")))
        elif name == DROPS:
            for topic, text in values.items():
                lost[topic] = lost.get(topic, 0) + _lost(text)
        elif name.startswith(ACCIDENT):
            facts.update(values)
    if not all(facts.get(key) for key in _VERSION_KEYS.values()):
        facts = {**_versions(reader), **{key: value for key, value in facts.items() if value}}
    cells = [values[CELL_KEY] for _, values in records if values.get(CELL_KEY)]
    return LogFacts(cells[0] if cells else "", facts.get("model", ""), facts.get("controller_version", ""),
                    facts.get("driver_version", ""), tuple(sorted(triggers)), lost)


def _whole(text: Any) -> int:
    """Return a time of a record, ns; 0 where it is none, or none that a table can hold."""
    return int(text) if re.fullmatch("[0-9]{1,18}|[1-8][0-9]{18}", str(text)) else 0


def _lost(text: str) -> int:
    """Count the messages that an account of the recorder reports as lost."""
    try:
        account = json.loads(text)
    except ValueError:
        return 0
    counts = [account.get(name) for name in _LOST_COUNTS] if isinstance(account, dict) else []
    return sum(count for count in counts if isinstance(count, int) and 0 <= count < _MOST_LOST)


def _versions(reader: LogReader) -> Dict[str, str]:
    """Read arm and versions from the driver's diagnostics."""
    for status in _statuses(reader):
        if status["name"].endswith("versions"):
            values = {pair["key"]: pair["value"] for pair in status["values"]}
            return {name: values[key] for key, name in _VERSION_KEYS.items() if values.get(key)}
    return {}


def _statuses(reader: LogReader) -> Iterator[Dict[str, Any]]:
    """Iterate over the first statuses of diagnostics."""
    readers = ValueReaders()
    try:
        for number, message in enumerate(messages_of(reader, Selection(types=(DIAGNOSTICS_TYPE,)))):
            if number >= _LOOKED_AT:
                return
            yield from readers[message.connection].read(message.data)["status"]
    except DefinitionError:
        return
