"""The state in which a log begins, for the simulated controller in its replay: joints, frames, load, terminals."""
import math
from dataclasses import replace
from typing import Any, Dict, List, Mapping, Optional

from jaka_bag.compare.runs.run import Run
from jaka_bag.containers.registry import open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError
from jaka_bag.messages.selection import Selection
from jaka_bag.messages.values import ValueReader

from .preconditions import conditions_of_log, log_begins_ns, numbers_in
from .scenario import BANKS, IO_TOPIC, Scenario

_SIDES = ("digital_inputs", "digital_outputs", "analog_inputs", "analog_outputs")
_FRAMES, _OVERRIDE = "/tf", "speed_scaling_factor"
_TOOL = "tool"
_USER_FRAME = "user_frame_"
_NO_OFFSET = 1e-9
"""Largest part of a frame's offset that is none: rounding of floats."""
_SUFFIXES = (".jks", ".ngc")
"""Endings that a program's name may have when it is loaded."""


def with_beginning(scenario: Scenario, run: Run) -> Scenario:
    """Return a scenario whose simulated controllers begin as the log does; what its ``state`` tells goes before.

    Raises:
        BagError: A tool or user frame was active, and neither the log nor the scenario tells where it is.
    """
    return replace(scenario, arms=tuple(
        replace(arm, state=tuple({**_beginning(run, arm.namespace, dict(arm.state)), **dict(arm.state)}.items()))
        for arm in scenario.arms))


def _beginning(run: Run, arm: str, told: Mapping[str, Any]) -> Dict[str, Any]:
    node = arm + "/jaka_driver"
    found: Dict[str, Any] = {}
    track = run.joints.get(node + "/joint_position")
    if track is not None and track.facts.finite_count:
        found["joints"] = track.beginning().value[0].tolist()
    first = _first_messages(run, node)
    if IO_TOPIC in first:
        found["terminals"] = _terminals(first[IO_TOPIC])
    loaded = [call.request[4:].decode("utf-8", "replace") for call in run.calls
              if call.success and call.service == node + "/program/load"]
    if loaded:
        found["programs"] = sorted({name[:-4] if name.endswith(_SUFFIXES) else name for name in loaded})
    if _OVERRIDE in first:
        found["speed_override"] = min(1.0, max(0.0, float(first[_OVERRIDE]["data"])))
    places = {one["child_frame_id"]: _offset(one["transform"]) for one in first.get(_FRAMES, {}).get("transforms", ())}
    active = conditions_of_log(run.path, node, log_begins_ns(run))
    if "payload" in active:
        mass, *centroid = numbers_in(active["payload"])
        found["payload"] = {"mass": mass, "centroid": centroid}
    if "collision-level" in active:
        found["collision_level"] = int(active["collision-level"])
    for key, name in (("tool", "tool"), ("user_frame", "user-frame")):
        number = active.get(name, "0")
        ending = _TOOL if key == "tool" else _USER_FRAME + number
        place = next((place for child, place in places.items() if child.endswith(ending)), None)
        if place is not None and number == "0" and any(abs(part) > _NO_OFFSET for part in place):
            number = "1"  # the log does not tell which; the offset is what counts
        if number == "0" or key in told:
            continue
        if place is None:
            raise BagError("%s: %s %s was active where it begins, and no /tf tells where that is; give it in the "
                           "scenario (arms: state: %s)" % (run.path, name.replace("-", " "), number, key))
        found[key] = {"id": int(number), "offset": place}
    return found


def _first_messages(run: Run, node: str) -> Dict[str, Mapping[str, Any]]:
    """Return the first message of each topic that tells of the start, by its name below the node or its global one."""
    missing = {_FRAMES: _FRAMES, **{node + "/" + name: name for name in (IO_TOPIC, _OVERRIDE)}}
    found: Dict[str, Mapping[str, Any]] = {}
    with open_log(run.path) as log:  # not the run: what its comparison ignores begins all the same
        there = {connection.topic for connection in log.connections}
        missing = {topic: name for topic, name in missing.items() if topic in there}
        for message in messages_of(log, Selection(topics=sorted(missing))) if missing else ():
            connection = message.connection
            is_foreign = connection.topic == _FRAMES and connection.callerid not in (node, None)
            if connection.topic in missing and not is_foreign:
                found[missing.pop(connection.topic)] = ValueReader(connection).read(message.data)
            if not missing:
                break
    return found


def _offset(transform: Mapping[str, Mapping[str, float]]) -> List[float]:
    x, y, z, w = (transform["rotation"][name] for name in "xyzw")
    rpy = (math.atan2(2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
           math.asin(min(1.0, max(-1.0, 2.0 * (y * w - x * z)))),
           math.atan2(2.0 * (x * y + z * w), 1.0 - 2.0 * (y * y + z * z)))
    return [*[transform["translation"][name] for name in "xyz"], *rpy]


def _terminals(message: Mapping[str, Mapping[str, Any]]) -> Dict[str, Dict[str, Dict[int, float]]]:
    """Return the terminals of a message of ``~io_states`` that are not 0, as ``jaka_sim --begin-with`` takes them."""
    found: Dict[str, Dict[str, Dict[int, float]]] = {}
    for bank in BANKS:
        for side in _SIDES:
            levels: Optional[Any] = message.get(bank, {}).get(side)
            on = {index: float(level) for index, level in enumerate(levels or ()) if level}
            if on:
                found.setdefault(bank, {})[side] = on
    return found
