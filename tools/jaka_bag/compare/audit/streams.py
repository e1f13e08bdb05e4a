"""The defects of times: stamps, losses, doubles, silences, waits and pace."""
from typing import Callable, Dict, List, Optional

from ...operations.tool_poses import TWIST_TYPE
from .defects import JOINT_TYPE, Defect, Golden
from .editing import EditableLog, Item, Value

_WAIT_S = 0.5


def _only(golden: Golden, keep: Callable[[int, Item], bool]) -> EditableLog:
    """Return the messages that ``keep``, called with the number of each on its topic, wants; counted anew."""
    counts: Dict[str, int] = {}
    items: List[Item] = []
    for item in golden.log.items:
        number = counts[item.topic] = counts.get(item.topic, -1) + 1
        if keep(number, item):
            items.append(item)
    return golden.log.with_items(items).numbered()


def _topic(golden: Golden, datatype: str) -> str:
    return (golden.log.topics_of(datatype) or [""])[0]


def _one_in_ten(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, TWIST_TYPE)
    return _only(golden, lambda number, item: item.topic != topic or number % 10 != 0)


def _half(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, JOINT_TYPE)
    return _only(golden, lambda number, item: item.topic != topic or number % 2 == 0)


def _silences(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, TWIST_TYPE)
    return _only(golden, lambda number, item: item.topic != topic or golden.log.seconds(item) % 3.0 >= 0.4)


def _ends_early(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, JOINT_TYPE)
    end = golden.log.duration - 1.0
    return _only(golden, lambda number, item: item.topic != topic or golden.log.seconds(item) < end)


def _without_topic(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, TWIST_TYPE)
    return _only(golden, lambda number, item: item.topic != topic)


def _doubled(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, JOINT_TYPE)
    log = golden.log
    return log.with_items(log.items + [item for item in log.items if item.topic == topic])


def _lost_on_the_way(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, TWIST_TYPE)
    log = golden.log
    counts = iter(range(len(log.items)))
    return log.with_items([item for item in log.items if item.topic != topic or next(counts) % 20 != 0])


def _bursts(golden: Golden) -> Optional[EditableLog]:
    topic = _topic(golden, JOINT_TYPE)
    step = 10**8
    return golden.log.with_items([item._replace(time=item.time // step * step + step) if item.topic == topic else item
                                  for item in golden.log.items])


def _stamps(change: Callable[[int], int]) -> Defect:
    """Return a defect of the stamps of the tool poses, ns."""
    def apply(value: Value, _now: float) -> None:
        stamp = change(value["header"]["stamp"][0] * 10**9 + value["header"]["stamp"][1])
        value["header"]["stamp"] = (stamp // 10**9, stamp % 10**9)
    return lambda golden: golden.log.edited(_topic(golden, TWIST_TYPE), apply)


def _stamps_swapped(golden: Golden) -> Optional[EditableLog]:
    topic, log = _topic(golden, TWIST_TYPE), golden.log
    places = [i for i, item in enumerate(log.items) if item.topic == topic]
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


DEFECTS: Dict[str, Defect] = {
    "stamps: 50 ms old": _stamps(lambda stamp: stamp - 50_000_000),
    "stamps: all 0": _stamps(lambda stamp: 0),
    "stamps: of four messages each the same": _stamps(lambda stamp: stamp // 32_000_000 * 32_000_000),
    "stamps: two swapped": _stamps_swapped,
    "messages: one in ten is never published": _one_in_ten,
    "messages: each second one is never published": _half,
    "messages: one in twenty is lost": _lost_on_the_way,
    "messages: each comes twice": _doubled,
    "messages: silent for 0.4 s in 3": _silences,
    "messages: in bursts of 0.1 s": _bursts,
    "messages: none in the last second": _ends_early,
    "messages: a topic is missing": _without_topic,
    "time: all 2 % slower": _slower,
    "time: a wait of 0.5 s is dropped": _wait_dropped,
    "time: a wait of 0.5 s is added": _wait_added,
}
