"""Mutations of golden logs, drawn at random, each beyond the tolerances, and what excuses one that may pass.

The space: every message of the golden logs in ``test/data/golden``.

- flip: one field of one message, of any topic: a flag to its opposite, a whole number to another of 0 to 5 and 77, a
  float by 3 to 60 limits up or down, a text by a letter more, one bit of an array of bytes (an empty one gets a byte),
  a time by 0.4 to 5 s. ``header.seq`` is left out: it tells of lost messages and is no content.
- drop: one message of a topic without a rate; of one with a rate all messages of a time that is longer than the gap
  that is allowed, 2 s at most.
- swap: the contents of two messages of one topic, which differ by more than 3 limits, or in anything else than a float.
  Header, duration and caller stay.

The limits, and which of them excuses a mutation that the comparison calls the same, are told here from the values; of
the comparison's code only the times of stops are taken.
"""
import collections
import copy
import math
import random
from bisect import bisect_left, bisect_right
from functools import lru_cache
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

from jaka_bag.compare.audit.editing import EditableLog, Item, read_log, write_log
from jaka_bag.compare.comparison import CannotCompare, compare_runs
from jaka_bag.compare.matching.alignment import arms_of
from jaka_bag.compare.matching.cut_motions import cut_motions
from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import Tolerances

FOLDER = Path(__file__).resolve().parents[2] / "data" / "golden"
NAMES = sorted(path.stem for path in FOLDER.glob("*.mcap"))
LIMITS = Tolerances()
JITTER_S = LIMITS.timing.jitter_ms / 1000.0 + 0.008  # and the period in which a sample between two others is met
CUT_S = LIMITS.timing.cut_ms / 1000.0
KINDS = ("flip", "drop", "swap")
ALARMS = {"motion_state": {2, 4}, "power_state": {0}, "collision_state": {1}}  # values that nothing excuses

Place = Tuple[Any, ...]  # the way to a field: names and indices


class Fate(NamedTuple):
    """The fate of one mutation.

    Attributes:
        number: Its number.
        name: The golden log.
        kind: One of ``KINDS``.
        words: The change.
        noticed: Kinds of the checks that differ.
        excuse: The tolerance that allows for it; empty where none does.
    """

    number: int
    name: str
    kind: str
    words: str
    noticed: Tuple[str, ...]
    excuse: str

    @property
    def verdict(self) -> str:
        """``noticed``, else the tolerance that allows for the mutation, else ``NEITHER``."""
        return "noticed" if self.noticed else self.excuse or "NEITHER"


class Golden:
    """A golden log with the values of each topic by time.

    Attributes:
        log: The log.
        run: The log as the comparison reads it.
        places: The numbers of each topic's messages, in the order of time.
        values: The fields of each message.
        cuts: Times, s, from and until which a stop may have left an arm elsewhere, by the comparison's own rule.
    """

    def __init__(self, name: str) -> None:
        path = FOLDER / (name + ".mcap")
        self.log = read_log(path)
        self.run = load_run(path, LIMITS)
        self.places: Dict[str, List[int]] = collections.defaultdict(list)
        for number, item in enumerate(self.log.items):
            self.places[item.topic].append(number)
        self.values = [self.log.value(item) for item in self.log.items]
        self.cuts = [(cut.at, cut.until) for arm, found in arms_of(self.run, self.run).items()
                     for cut in cut_motions(self.run, arm, found)]

    def around(self, number: int, seconds: float) -> Iterator[int]:
        """Yield the messages of this one's topic that are at most so far away in time."""
        items, places = self.log.items, self.places[self.log.items[number].topic]
        times = [items[place].time for place in places]
        begin, end = (items[number].time + sign * int(seconds * 1e9) for sign in (-1, 1))
        yield from places[bisect_left(times, begin):bisect_right(times, end)]

    def is_periodic(self, topic: str) -> bool:
        """Return whether a topic has more than ten messages a second."""
        return len(self.places[topic]) > 10.0 * self.log.duration


golden_of = lru_cache(maxsize=None)(Golden)


def fields_of(value: Any, place: Place = ()) -> Iterator[Place]:
    """Yield the way to each field that holds no other fields."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield from fields_of(part, (*place, name))
    elif isinstance(value, list):
        for index, part in enumerate(value):
            yield from fields_of(part, (*place, index))
    else:
        yield place


def get(value: Any, place: Place) -> Any:
    """Return what stands at a place."""
    for part in place:
        value = value[part]
    return value


def put(value: Any, place: Place, new: Any) -> None:
    """Replace what stands at a place."""
    get(value, place[:-1])[place[-1]] = new


def limit_of(golden: Golden, topic: str, place: Place) -> float:
    """Return the amount by which a number may be off, after the table of tolerances in docs/regression_testing.md."""
    if place[0] == "position":
        return LIMITS.joints.position_rad
    if place[:2] == ("twist", "linear"):
        return LIMITS.tcp.position_mm / 1000.0
    if place[:2] == ("twist", "angular"):
        return LIMITS.tcp.orientation_rad
    if place == ("duration",):
        return LIMITS.calls.duration_s + 0.02 * 60.0
    numbers = [float(get(golden.values[i], place)) for i in golden.places[topic]]
    steps = sorted(abs(after - before) for before, after in zip(numbers, numbers[1:])) or [0.0]
    span = max(numbers) - min(numbers)
    return max(0.1 * span, 0.01 * max(map(abs, numbers)), min(6.0 * steps[-1], 0.5 * span), 1e-6)


def flip(golden: Golden, dice: random.Random, items: List[Item]) -> Tuple[str, str]:
    """Change one field of one message; return what was done, and the tolerance that would excuse it."""
    topic = dice.choice(sorted(golden.places))
    number = dice.choice(golden.places[topic])
    value = copy.deepcopy(golden.values[number])
    place = dice.choice([place for place in fields_of(value) if place[:2] != ("header", "seq")])
    old, excuse = get(value, place), ""
    if isinstance(old, bool):
        new: Any = not old
    elif isinstance(old, int):
        new, excuse = flipped_integer(golden, dice, number, place, old)
    elif isinstance(old, float):
        limit = limit_of(golden, topic, place)
        new = old + dice.choice((-1.0, 1.0)) * limit * dice.uniform(3.0, 60.0)
    elif isinstance(old, str):
        at = dice.randrange(len(old) + 1)
        new = old[:at] + dice.choice("abcxyz_%") + old[at:]
        excuse = "calls.response 'values'" if place == ("response_text",) else ""
        if place[0] == "caller":
            excuse = "ignore_fields"
    elif isinstance(old, bytes):
        if not old:
            new = b"\x01"
        else:
            at = dice.randrange(len(old))
            new = old[:at] + bytes([old[at] ^ (1 << dice.randrange(8))]) + old[at + 1:]
        excuse = "calls.response 'values'" if place == ("response",) else ""
    else:  # a time: seconds and nanoseconds
        by = dice.choice((-1, 1)) * dice.randrange(400_000_000, 5_000_000_000)
        stamp = old[0] * 10**9 + old[1] + by
        new = (stamp // 10**9, stamp % 10**9)
    put(value, place, new)
    if place[0] in ("position", "twist"):
        excuse = excuse_of(golden, number, place, value)
    items[number] = golden.log.with_value(items[number], value)
    return "%s[%d] %s: %r -> %r" % (topic, number, ".".join(map(str, place)), old, new), excuse


def flipped_integer(golden: Golden, dice: random.Random, number: int, place: Place, old: int) -> Tuple[int, str]:
    """Return another value of an integer; one message is brief, so that a known state may be excused."""
    new = dice.choice([one for one in (0, 1, 2, 3, 4, 5, 77) if one != old])
    known = {get(golden.values[i], place) for i in golden.places[golden.log.items[number].topic]}
    if new in ALARMS.get(str(place[-1]), set()) or new not in known:
        return new, ""
    return new, "states.brief_s"


def quaternion(vector: Sequence[float]) -> Tuple[float, ...]:
    """Return the unit quaternion w x y z of a rotation vector, rad."""
    angle = math.sqrt(sum(one * one for one in vector))
    factor = math.sin(0.5 * angle) / angle if angle else 0.5
    return (math.cos(0.5 * angle), *(factor * one for one in vector))


def distance(one: Dict[str, Any], other: Dict[str, Any], place: Place) -> float:
    """Return how far apart two messages are in what a field belongs to: m, rad between orientations, rad of a joint."""
    if place[0] == "position":
        return abs(float(get(one, place)) - float(get(other, place)))
    vectors = [[value["twist"][place[1]][axis] for axis in "xyz"] for value in (one, other)]
    if place[1] == "linear":
        return math.dist(*vectors)
    return 2.0 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(*map(quaternion, vectors))))))


def excuse_of(golden: Golden, number: int, place: Place, new: Dict[str, Any]) -> str:
    """Return what excuses a message: it is the first or last of its topic, which a lag leaves out; the path has its
    values within the time by which a sample may be off; or stops, each by the way of ``cut_ms``, may have left the arm
    there."""
    topic = golden.log.items[number].topic
    limit = limit_of(golden, topic, place)
    numbers = golden.places[topic]
    if number in (numbers[0], numbers[-1]):
        return "outside the golden times"
    off = min(distance(golden.values[i], new, place) for i in golden.around(number, JITTER_S))
    if off <= limit:
        return "timing.jitter_ms"
    now = golden.log.seconds(golden.log.items[number])
    stops = sum(at - CUT_S <= now <= until + CUT_S for at, until in golden.cuts)
    if not stops:
        return ""
    window = int(CUT_S * len(numbers) / golden.log.duration) + 1
    moved = max(distance(golden.values[i], golden.values[j], place) for i, j in zip(numbers, numbers[window:]))
    return "timing.cut_ms" if off <= limit + stops * moved else ""


def drop(golden: Golden, dice: random.Random, items: List[Item]) -> Optional[Tuple[str, str]]:
    """Drop a call, or the messages of a topic for longer than a gap; return what was done.

    None where the topic was silent then.
    """
    topic = dice.choice(sorted(golden.places))
    places = golden.places[topic]
    if not golden.is_periodic(topic):
        number = dice.choice(places)
        items[number] = items[number]._replace(topic="")
        return "%s[%d] dropped" % (topic, number), ""
    least = max(LIMITS.streams.gap_s, LIMITS.streams.gap_length_s) + 0.05
    length = dice.uniform(least, 2.0)
    begin = dice.uniform(0.0, golden.log.duration - length)
    gone = [i for i in places if begin <= golden.log.seconds(items[i]) < begin + length]
    if len(gone) < least * len(places) / golden.log.duration:
        return None
    for number in gone:
        items[number] = items[number]._replace(topic="")
    return "%s: %d messages dropped, %.2f s from %.2f s on" % (topic, len(gone), length, begin), ""


def swap(golden: Golden, dice: random.Random, items: List[Item]) -> Optional[Tuple[str, str]]:
    """Swap what two messages of a topic say, not their headers; None where they say the same within tolerance."""
    topic = dice.choice(sorted(golden.places))
    if len(golden.places[topic]) < 2:
        return None
    one, other = sorted(dice.sample(golden.places[topic], 2))
    values = [copy.deepcopy(golden.values[i]) for i in (one, other)]
    if not is_beyond(golden, topic, *values):
        return None
    for name in ("header", "duration"):
        if name in values[0]:
            values[0][name], values[1][name] = values[1][name], values[0][name]
    items[one], items[other] = (golden.log.with_value(items[i], value)
                                for i, value in zip((one, other), values[::-1]))
    return "%s: what [%d] and [%d] say swapped" % (topic, one, other), swap_excuse(golden, topic, one, other)


def is_beyond(golden: Golden, topic: str, one: Dict[str, Any], other: Dict[str, Any]) -> bool:
    """Return whether two messages of a topic differ by more than the tolerances."""
    for place in fields_of({name: part for name, part in one.items() if name not in ("header", "duration", "caller")}):
        try:
            ours, theirs = get(one, place), get(other, place)
        except (IndexError, KeyError):
            return True
        if isinstance(ours, float):
            if abs(ours - theirs) > 3.0 * limit_of(golden, topic, place):
                return True
        elif ours != theirs and place[0] in ("service", "request", "success") or (
                isinstance(ours, int) and ours != theirs):
            return True
    return False


def swap_excuse(golden: Golden, topic: str, one: int, other: int) -> str:
    """Return the tolerance that excuses a swap: each value that moved is met on the path, or a known state is brief."""
    ours, theirs = golden.values[one], golden.values[other]
    if "motion_state" in ours:
        alarm = any(value[name] in values for value in (ours, theirs) for name, values in ALARMS.items()
                    if ours[name] != theirs[name])
        return "" if alarm else "states.brief_s"
    moved = [(one, theirs), (other, ours)]
    places = [place for place in fields_of(ours) if place[0] in ("position", "twist")]
    excuses = {excuse_of(golden, number, place, value) for number, value in moved for place in places}
    return "" if not excuses or "" in excuses else " and ".join(sorted(excuses))


def fate_of(seed: int, number: int, path: Path) -> Fate:
    """Draw a mutation, and compare the log that has it with its golden log.

    Args:
        seed: Seed of all mutations of a run.
        number: Number of this one; each golden log and kind comes in turn.
        path: File that the mutated log is written to.
    """
    dice = random.Random("%d:%d" % (seed, number))
    name, kind = NAMES[number % len(NAMES)], KINDS[number // len(NAMES) % len(KINDS)]
    golden = golden_of(name)
    done = None
    while done is None:
        items = list(golden.log.items)
        done = {"flip": flip, "drop": drop, "swap": swap}[kind](golden, dice, items)
        if done is None and dice.random() < 0.01:
            kind = "flip"  # a log in which hardly anything moves
    log = EditableLog([item for item in items if item.topic], golden.log.connections)
    write_log(log, path)
    try:
        comparison = compare_runs(golden.run, load_run(path, LIMITS), LIMITS)
        noticed = tuple(dict.fromkeys(check.aspect.value for check in comparison.differences))
    except CannotCompare as error:
        noticed = ("cannot be compared: %s" % error,)
    return Fate(number, name, kind, done[0], noticed, done[1])
