"""The defects of what topics say: tool poses, joints, states and calls.

A defect returns the log that has it, or None where this log has nothing that it could be planted into.
"""
import math
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from ...driver_interface import CALL_TYPE, STATE_TYPE, MotionState
from ...messages.value_writer import in_ns, time_of
from ...operations.tool_poses import TWIST_TYPE
from .editing import EditableLog, Item, Value

_BEFORE_STOP_S = 0.25
"""Time, s, before a stop from which on nothing is planted: what comes just before it counts as displaced, too."""
JOINT_TYPE = "sensor_msgs/JointState"


class Golden(NamedTuple):
    """A golden log and the moments that defects need.

    Attributes:
        log: The log.
        motions: Begin and end of each motion of the first arm, s.
        displaced: Times, s, from and until which a stop may have left the arm elsewhere.
    """

    log: EditableLog
    motions: Tuple[Tuple[float, float], ...]
    displaced: Tuple[Tuple[float, float], ...] = ()

    @property
    def middle(self) -> Optional[float]:
        """The time in the middle of the longest motion that no stop displaces, s; None where there is none."""
        parts = []
        for begin, end in self.motions:
            for at, until in self.displaced:
                if begin < until and end > at - _BEFORE_STOP_S:
                    begin, end = (begin, at - _BEFORE_STOP_S) if begin < at else (until, end)
            parts.append((begin, end))
        longest = max(parts, key=lambda part: part[1] - part[0], default=(0.0, 0.0))
        return 0.5 * (longest[0] + longest[1]) if longest[1] > longest[0] else None

    @property
    def quiet(self) -> float:
        """A time at rest before the first motion, s."""
        return 0.5 * (self.motions[0][0] if self.motions else self.log.duration)


PlantedDefect = Callable[[Golden], Optional[EditableLog]]


def edit(datatype: str, change: Callable[[Value, float], None],
         span: Callable[[Golden], Optional[Tuple[float, float]]] = lambda golden: (-1.0, 1e12)) -> PlantedDefect:
    """Return a defect that changes the messages of a type's first topic, those within a span of time, s."""
    def plant(golden: Golden) -> Optional[EditableLog]:
        topic, times = golden.log.first_topic_of(datatype), span(golden)
        return None if topic is None or times is None else golden.log.edited(topic, change, *times)
    return plant


def _in_motion(length: float) -> Callable[[Golden], Optional[Tuple[float, float]]]:
    return lambda golden: None if golden.middle is None else (golden.middle, golden.middle + length)


def _at_rest(length: float) -> Callable[[Golden], Optional[Tuple[float, float]]]:
    return lambda golden: (golden.quiet, golden.quiet + length)


def _after_a_stop(golden: Golden) -> Optional[Tuple[float, float]]:
    if not golden.displaced:
        return None
    begin, end = golden.displaced[0]
    return begin + 0.3, min(end, begin + 0.8)


def _moving(defect: PlantedDefect) -> PlantedDefect:
    """Return a defect that shows only in a log in which something moves."""
    return lambda golden: defect(golden) if golden.motions else None


def _stale(datatype: str, names: Sequence[str], delay_s: float) -> PlantedDefect:
    """Return a defect that gives each message the fields of one ``delay_s`` before it, under its own stamp."""
    def plant(golden: Golden) -> Optional[EditableLog]:
        topic = golden.log.first_topic_of(datatype)
        if topic is None:
            return None
        past: List[Tuple[float, Dict[str, Any]]] = []

        def change(value: Value, now: float) -> None:
            past.append((now, {name: value[name] for name in names}))
            while len(past) > 1 and past[1][0] <= now - delay_s:
                past.pop(0)
            value.update(past[0][1])
        return golden.log.edited(topic, change)
    return _moving(plant)


def _frozen(datatype: str, names: Sequence[str], length: float) -> PlantedDefect:
    def plant(golden: Golden) -> Optional[EditableLog]:
        topic = golden.log.first_topic_of(datatype)
        if topic is None or golden.middle is None:
            return None
        kept: Dict[str, Any] = {}

        def change(value: Value, _now: float) -> None:
            kept.update({name: value[name] for name in names if name not in kept})
            value.update(kept)
        return golden.log.edited(topic, change, golden.middle, golden.middle + length)
    return plant


def _place(axis: str, change: Callable[[float, float], float]) -> Callable[[Value, float], None]:
    def apply(value: Value, now: float) -> None:
        value["twist"]["linear"][axis] = change(value["twist"]["linear"][axis], now)
    return apply


def _swap_axes(value: Value, _now: float) -> None:
    axes = value["twist"]["linear"]
    axes["x"], axes["y"] = axes["y"], axes["x"]


def _swap_turns(value: Value, _now: float) -> None:
    axes = value["twist"]["angular"]
    axes["y"], axes["z"] = axes["z"], axes["y"]


def _turn(value: Value, _now: float) -> None:
    angular = value["twist"]["angular"]
    length = math.sqrt(sum(one * one for one in angular.values())) or 1.0
    value["twist"]["angular"] = {axis: one * (1.0 + 0.01 / length) for axis, one in angular.items()}


def _scale_place(value: Value, _now: float) -> None:
    value["twist"]["linear"] = {axis: 1000.0 * one for axis, one in value["twist"]["linear"].items()}


def _opposite_turn(value: Value, _now: float) -> None:
    value["twist"]["angular"]["z"] += 0.02
    value["twist"]["angular"]["x"] = -value["twist"]["angular"]["x"]


def _frame(value: Value, _now: float = 0.0) -> None:
    value["header"]["frame_id"] += "_2"


def _joint(number: int, change: Callable[[float, float], float]) -> Callable[[Value, float], None]:
    def apply(value: Value, now: float) -> None:
        value["position"][number] = change(value["position"][number], now)
    return apply


def _swap(name: str) -> Callable[[Value, float], None]:
    def apply(value: Value, _now: float) -> None:
        value[name][1], value[name][2] = value[name][2], value[name][1]
    return apply


def _degrees(value: Value, _now: float) -> None:
    value["position"] = [math.degrees(one) for one in value["position"]]


def _add_effort(value: Value, _now: float) -> None:
    value["effort"] = [1.0] * len(value["position"])


def _one_joint_less(value: Value, _now: float) -> None:
    value["name"], value["position"] = value["name"][:-1], value["position"][:-1]


def _set(name: str, state: int) -> Callable[[Value, float], None]:
    def apply(value: Value, _now: float) -> None:
        value[name] = state
    return apply


def _instead_of_running(state: int) -> PlantedDefect:
    def change(value: Value, _now: float) -> None:
        if value["motion_state"] == MotionState.RUNNING:
            value["motion_state"] = state
    return _moving(edit(STATE_TYPE, change))


def _late_states(delay_s: float) -> PlantedDefect:
    return _stale(STATE_TYPE, ("motion_state", "power_state", "servo_state", "collision_state"), delay_s)


def _call(change: Callable[[Value], None], wanted: Callable[[Value], bool] = lambda value: True) -> PlantedDefect:
    """Return a defect of the last call that is wanted."""
    def plant(golden: Golden) -> Optional[EditableLog]:
        log = golden.log
        items = list(log.items)
        for i in range(len(items) - 1, -1, -1):
            if log.connections[items[i].topic].datatype == CALL_TYPE and wanted(log.value(items[i])):
                value = log.value(items[i])
                change(value)
                items[i] = log.with_value(items[i], value)
                return log.with_items(items)
        return None
    return plant


def _calls_of(golden: Golden) -> List[int]:
    log = golden.log
    topic = log.first_topic_of(CALL_TYPE)
    return [i for i, item in enumerate(log.items) if item.topic == topic]


def _call_missing(golden: Golden) -> Optional[EditableLog]:
    places = _calls_of(golden)
    items = golden.log.items
    return golden.log.with_items(items[:places[-1]] + items[places[-1] + 1:]) if places else None


def _call_twice(golden: Golden) -> Optional[EditableLog]:
    places = _calls_of(golden)
    if not places:
        return None
    call = golden.log.items[places[0]]
    return golden.log.with_items(golden.log.items + [call._replace(time=call.time + 1000)]).numbered()


def _calls_swapped(golden: Golden) -> Optional[EditableLog]:
    """Swap the contents of the last two calls that have other requests."""
    log, places = golden.log, _calls_of(golden)
    items: List[Item] = list(log.items)
    for before, after in list(zip(places, places[1:]))[::-1]:
        one, other = log.value(items[before]), log.value(items[after])
        if (one["service"], one["request"]) == (other["service"], other["request"]):
            continue
        one["header"], other["header"] = other["header"], one["header"]
        one["duration"], other["duration"] = other["duration"], one["duration"]
        items[before] = items[before]._replace(raw=log.with_value(items[after], other).raw)
        items[after] = items[after]._replace(raw=log.with_value(log.items[before], one).raw)
        return log.with_items(items)
    return None


def _later(seconds: float) -> Callable[[Value], None]:
    def apply(value: Value) -> None:
        value["header"]["stamp"] = time_of(in_ns(value["header"]["stamp"]) + int(seconds * 1e9))
    return apply


def _put(**values: Any) -> Callable[[Value], None]:
    return lambda value: value.update(values)


def _flip_byte(name: str) -> Callable[[Value], None]:
    def apply(value: Value) -> None:
        raw = bytearray(value[name])
        raw[len(raw) // 2] ^= 0x40
        value[name] = bytes(raw)
    return apply


def _other_ret(value: Value) -> None:
    value["response_text"] = value["response_text"].replace("1", "7", 1)


_POSE = ("twist",)
DEFECTS: Dict[str, PlantedDefect] = {
    "tool: x off by 1 mm": edit(TWIST_TYPE, _place("x", lambda one, now: one + 0.001)),
    "tool: z off by 2 mm in one motion": edit(TWIST_TYPE, _place("z", lambda one, now: one + 0.002), _in_motion(0.4)),
    "tool: mm for m": edit(TWIST_TYPE, _scale_place),
    "tool: sign of y": edit(TWIST_TYPE, _place("y", lambda one, now: -one)),
    "tool: x and y swapped": edit(TWIST_TYPE, _swap_axes),
    "tool: drifts 0.3 mm/s": edit(TWIST_TYPE, _place("z", lambda one, now: one + 0.0003 * now)),
    "tool: one sample 20 mm off": edit(TWIST_TYPE, _place("x", lambda one, now: one + 0.02), _at_rest(0.009)),
    "tool: 5 mm off where a stop left the arm": edit(TWIST_TYPE, _place("x", lambda one, now: one + 0.005),
                                                     _after_a_stop),
    "tool: turned by 0.01 rad": edit(TWIST_TYPE, _turn),
    "tool: parts of the rotation vector swapped": edit(TWIST_TYPE, _swap_turns),
    "tool: sign of the rotation vector": edit(TWIST_TYPE, _opposite_turn),
    "tool: 40 ms stale": _stale(TWIST_TYPE, _POSE, 0.04),
    "tool: 96 ms stale": _stale(TWIST_TYPE, _POSE, 0.096),
    "tool: stands still for 0.3 s of a motion": _frozen(TWIST_TYPE, _POSE, 0.3),
    "tool: other frame": edit(TWIST_TYPE, _frame),
    "tool: not a number for 0.2 s": edit(TWIST_TYPE, _place("x", lambda one, now: math.nan), _at_rest(0.2)),
    "joints: first off by 5 mrad": edit(JOINT_TYPE, _joint(0, lambda one, now: one + 0.005)),
    "joints: sign of the second": edit(JOINT_TYPE, _joint(1, lambda one, now: -one)),
    "joints: second and third swapped": edit(JOINT_TYPE, _swap("position")),
    "joints: degrees for radians": edit(JOINT_TYPE, _degrees),
    "joints: last drifts 1 mrad/s": edit(JOINT_TYPE, _joint(-1, lambda one, now: one + 0.001 * now)),
    "joints: one sample 50 mrad off": edit(JOINT_TYPE, _joint(2, lambda one, now: one + 0.05), _at_rest(0.009)),
    "joints: 96 ms stale": _stale(JOINT_TYPE, ("position",), 0.096),
    "joints: stand still for 0.3 s of a motion": _frozen(JOINT_TYPE, ("position",), 0.3),
    "joints: names swapped": edit(JOINT_TYPE, _swap("name")),
    "joints: names swapped for 0.5 s": edit(JOINT_TYPE, _swap("name"), _at_rest(0.5)),
    "joints: efforts that were not there": edit(JOINT_TYPE, _add_effort),
    "joints: one less for 0.5 s": edit(JOINT_TYPE, _one_joint_less, _at_rest(0.5)),
    "joints: other frame": edit(JOINT_TYPE, _frame),
    "states: error for 50 ms": edit(STATE_TYPE, _set("motion_state", MotionState.ERROR), _at_rest(0.05)),
    "states: emergency stop for 100 ms": edit(STATE_TYPE, _set("motion_state", MotionState.EMERGENCY_STOP),
                                              _at_rest(0.1)),
    "states: collision in one message": edit(STATE_TYPE, _set("collision_state", 1), _at_rest(0.009)),
    "states: no power for 50 ms": edit(STATE_TYPE, _set("power_state", 0), _at_rest(0.05)),
    "states: error in place of running": _instead_of_running(MotionState.ERROR),
    "states: paused in place of running": _instead_of_running(MotionState.PAUSED),
    "states: 77 in place of running": _instead_of_running(77),
    "states: stopped in place of running": _instead_of_running(MotionState.STOPPED),
    "states: servo mode for 1 s": edit(STATE_TYPE, _set("servo_state", 1), lambda golden: (0.1, 1.1)),
    "states: 60 ms late": _late_states(0.06),
    "states: 400 ms late": _late_states(0.4),
    "calls: one is missing": _call_missing,
    "calls: one comes twice": _call_twice,
    "calls: two in other order": _calls_swapped,
    "calls: one byte of a request": _call(_flip_byte("request"), lambda value: bool(value["request"])),
    "calls: one fails": _call(_put(success=False, error="refused"), lambda value: bool(value["success"])),
    "calls: other reason of a failure": _call(_put(error="for another reason"), lambda value: not value["success"]),
    "calls: other value in a response": _call(_other_ret, lambda value: "1" in value["response_text"]),
    "calls: another service": _call(lambda value: value.update(service=value["service"] + "_2")),
    "calls: another version of the type": _call(_put(md5sum="f" * 32)),
    "calls: other frame": _call(_frame),
    "calls: a request told in other words": _call(lambda value: value.update(request_text=value["request_text"] + "#")),
    "calls: one is 0.4 s late": _call(_later(0.4)),
    "calls: one takes 1 s longer": _call(lambda value: value.update(duration=value["duration"] + 1.0)),
}
