"""The world of a golden log as events, each after its cause; and the scenario file that people read and edit."""
import dataclasses
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

import yaml

from ..scenario import BEGIN, CauseKind, ControllerEvent, EventCause, Scenario
from .history import CellHistory, Doing, set_input
from .sightings import READS, Sighting

_AFTER_OUTPUT_S = 10.0
"""An input answers the output before it up to so long after it, whatever came between."""
_MARK = "# Derived from the golden log. What causes what is a guess by time: read it, and mend it where it is wrong.\n"


def derive_events(history: CellHistory) -> Tuple[ControllerEvent, ...]:
    """Return what the world did in a log, each event after what most likely caused it.

    An input comes after the newest change of an output, if that is at most 10 s ago. All else comes after the newest
    of: a begin of motion, an answer of a service that does more than read, and, for an input, another terminal. What
    nothing comes before is placed by the log's beginning. Inputs that were on from the beginning are set before the
    nodes begin. Analog inputs are left out.
    """
    events = [ControllerEvent(arm, BEGIN, 0.0, set_input(bank, index, 1))
              for arm, levels in history.begins_with.items() for (kind, bank, index), level in levels.items()
              if kind is CauseKind.INPUT and level]
    for doing in history.doings:
        cause = _cause_of(doing, history.sightings)
        events.append(ControllerEvent(doing.arm, BEGIN if cause is None else cause.cause,
                                      round(doing.at - (0.0 if cause is None else cause.at), 3), doing.request))
    return tuple(events)


def _cause_of(doing: Doing, sightings: Sequence[Sighting]) -> Optional[Sighting]:
    is_input = doing.request["action"] == "set_input"
    before = [sighting for sighting in sightings if sighting.at < doing.at and sighting.cause.arm == doing.arm]
    outputs = [sighting for sighting in before if sighting.cause.kind is CauseKind.OUTPUT
               and doing.at - sighting.at <= _AFTER_OUTPUT_S]
    if is_input and outputs:
        return outputs[-1]
    kinds = [CauseKind.MOTION, CauseKind.ANSWER] + ([CauseKind.INPUT, CauseKind.OUTPUT] if is_input else [])
    others = [sighting for sighting in before if sighting.cause.kind in kinds and not _only_tells(sighting.cause)]
    return others[-1] if others else None


def _only_tells(cause: EventCause) -> bool:
    """Return whether an answer is no cause of its own: of a read, or of set_io, which is seen at the output."""
    return cause.kind is CauseKind.ANSWER and (cause.what[0].startswith(READS) or cause.what[0] == "set_io")


def cause_as_data(cause: EventCause) -> Dict[str, Any]:
    """Return a cause as the keys and values of an event in a scenario file."""
    if cause.kind is CauseKind.BEGIN:
        return {}
    if cause.kind in (CauseKind.CALL, CauseKind.MOTION):
        return {cause.kind.value: cause.nth}
    if cause.kind is CauseKind.ANSWER:
        told: Dict[str, Any] = {"service": cause.what[0]}
    else:
        bank, index, level = cause.what
        told = {**({} if bank == "cabinet" else {"bank": bank}), "index": index, "value": level}
    return {cause.kind.value: {**told, **({"nth": cause.nth} if cause.nth else {})}}


def event_as_data(event: ControllerEvent, is_only_arm: bool = True) -> Dict[str, Any]:
    """Return an event as the keys and values of a scenario file."""
    return {**({} if is_only_arm else {"arm": event.arm}), **cause_as_data(event.after), "delay_s": event.delay_s,
            **event.request}


def write_scenario(path: Path, scenario: Scenario, text: str, notes: Sequence[str]) -> None:
    """Write a scenario file with the scenario's events, to be put beside the golden log.

    Args:
        path: The file.
        scenario: The scenario.
        text: The scenario file without events that is beside the log; empty where there is none.
        notes: Sentences for its reader.
    """
    lines: List[str] = [text.rstrip() + "\n"] if text.strip() else [_flow({"arms": [
        {"namespace": arm.namespace, "model": arm.model, "simulation": list(arm.simulation),
         "parameters": dict(arm.parameters)} for arm in scenario.arms]}, block=True)]
    lines.append(_MARK)
    lines += ["# Not in here: %s.\n" % note for note in notes]
    lines.append("events:\n" if scenario.events else "events: []\n")
    lines += ["- " + _flow(event_as_data(event, len(scenario.arms) == 1)) for event in scenario.events]
    path.write_text("".join(lines), encoding="utf-8")


def _flow(value: Any, block: bool = False) -> str:
    return yaml.safe_dump(value, default_flow_style=None if block else True, sort_keys=False, width=1000)


def with_derived_events(scenario: Scenario, history: CellHistory) -> Scenario:
    """Return the scenario with the events of a log in place of its own."""
    return dataclasses.replace(scenario, events=derive_events(history), has_events=True)
