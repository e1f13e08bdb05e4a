"""The defects of times: stamps, losses, doubles, silences, waits and pace."""
from typing import Callable, Dict, List, Optional

from ...messages.value_writer import in_ns, time_of
from ...operations.tool_poses import TWIST_TYPE
from .defects import JOINT_TYPE, Golden, PlantedDefect, edit
from .editing import EditableLog, Item, Value

_WAIT_S = 0.5
"""Length, s, of the wait that is planted: above the tolerance of every wait, and short beside real rests."""


def _only(golden: Golden, keep: Callable[[int, Item], bool]) -> EditableLog:
    """Return the messages that ``keep``, called with the number of each on its topic, wants; counted anew."""
    counts: Dict[str, int] = {}
    items: List[Item] = []
    for item in golden.log.items:
        number = counts[item.topic] = counts.get(item.topic, -1) + 1
        if keep(number, item):
            items.append(item)
    return golden.log.with_items(items).numbered()


def _dropping(datatype: str, keep: Callable[[Golden, int, float], bool]) -> PlantedDefect:
    """Return a defect that drops messages of a type's first topic; ``keep`` gets number and time, s, of each."""
    def plant(golden: Golden) -> Optional[EditableLog]:
        topic = golden.log.first_topic_of(datatype)
        return _only(golden, lambda number, item: item.topic != topic
                     or keep(golden, number, golden.log.seconds(item)))
    return plant


def _doubled(golden: Golden) -> Optional[EditableLog]:
    topic = golden.log.first_topic_of(JOINT_TYPE)
    log = golden.log
    return log.with_items(log.items + [item for item in log.items if item.topic == topic])


def _lost_on_the_way(golden: Golden) -> Optional[EditableLog]:
    topic = golden.log.first_topic_of(TWIST_TYPE)
    log = golden.log
    counts = iter(range(len(log.items)))
    return log.with_items([item for item in log.items if item.topic != topic or next(counts) % 20 != 0])


def _bursts(golden: Golden) -> Optional[EditableLog]:
    topic = golden.log.first_topic_of(JOINT_TYPE)
    step = 10**8
    return golden.log.with_items([item._replace(time=item.time // step * step + step) if item.topic == topic else item
                                  for item in golden.log.items])


def _stamps(change: Callable[[int], int]) -> PlantedDefect:
    """Return a defect of the stamps of the tool poses, ns."""
    def apply(value: Value, _now: float) -> None:
        value["header"]["stamp"] = time_of(change(in_ns(value["header"]["stamp"])))
    return edit(TWIST_TYPE, apply)


def _stamps_swapped(golden: Golden) -> Optional[EditableLog]:
    log = golden.log
    topic = log.first_topic_of(TWIST_TYPE)
    places = [i for i, item in enumerate(log.items) if item.topic == topic]
    if len(places) < 2:
        return None
    one, other = places[len(places) // 2: len(places) // 2 + 2]
    items = list(log.items)
    values = [log.value(items[i]) for i in (one, other)]
    values[0]["header"]["stamp"], values[1]["header"]["stamp"] = (value["header"]["stamp"] for value in values[::-1])
    items[one], items[other] = (log.with_value(items[i], value) for i, value in zip((one, other), values))
    return log.with_items(items)


def _slower(golden: Golden) -> Optional[EditableLog]:
    return golden.log.retimed(lambda now: 0.02 * now) if golden.motions else None


def _rest(golden: Golden) -> Optional[float]:
    """Return the begin of a rest between two motions that has room for the wait, s; None where there is none."""
    rests = [(after[0] - before[1], before[1]) for before, after in zip(golden.motions, golden.motions[1:])
             if after[0] - before[1] > _WAIT_S]
    return min(rests)[1] + 0.02 if rests else None


def _wait_dropped(golden: Golden) -> Optional[EditableLog]:
    begin = _rest(golden)
    if begin is None:
        return None
    end = begin + _WAIT_S - 0.05
    log = _only(golden, lambda number, item: not begin <= golden.log.seconds(item) < end)
    return log.retimed(lambda now: begin - end if now >= end else 0.0)


def _wait_added(golden: Golden) -> Optional[EditableLog]:
    begin = _rest(golden)
    return None if begin is None else golden.log.retimed(lambda now: _WAIT_S if now >= begin else 0.0)


DEFECTS: Dict[str, PlantedDefect] = {
    "stamps: 50 ms old": _stamps(lambda stamp: stamp - 50_000_000),
    "stamps: all 0": _stamps(lambda stamp: 0),
    "stamps: of four messages each the same": _stamps(lambda stamp: stamp // 32_000_000 * 32_000_000),
    "stamps: two swapped": _stamps_swapped,
    "messages: one in ten is never published": _dropping(TWIST_TYPE, lambda golden, number, at: number % 10 != 0),
    "messages: each second one is never published": _dropping(JOINT_TYPE, lambda golden, number, at: number % 2 == 0),
    "messages: one in twenty is lost": _lost_on_the_way,
    "messages: each comes twice": _doubled,
    "messages: silent for 0.4 s in 3": _dropping(TWIST_TYPE, lambda golden, number, at: at % 3.0 >= 0.4),
    "messages: in bursts of 0.1 s": _bursts,
    "messages: none in the last second": _dropping(
        JOINT_TYPE, lambda golden, number, at: at < golden.log.duration - 1.0),
    "messages: a topic is missing": _dropping(TWIST_TYPE, lambda golden, number, at: False),
    "time: all 2 % slower": _slower,
    "time: a wait of 0.5 s is dropped": _wait_dropped,
    "time: a wait of 0.5 s is added": _wait_added,
}
