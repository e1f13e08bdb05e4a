"""One log as the comparison sees it: streams, joints, poses, states, calls, all on one clock in s.

Joints, poses and times of messages may be too many to be kept: they are read in windows of time, again and again.
"""
from dataclasses import dataclass, field, replace
from typing import Callable, Collection, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ...driver_interface import plain_request
from ...messages.batch import Array
from .call_text import as_typed

TimeWindow = Tuple[float, float]
"""Time span from a time, s, up to but without another."""


def are_numbers(value: Array) -> Array:
    """Return whether all values of each row are numbers, bool, shape (n, columns) to (n,)."""
    finite = np.isfinite(value)
    good: Array = np.ones(len(value), bool) if finite.all() else finite.all(axis=1)
    return good


class Arrivals(NamedTuple):
    """Messages of one topic in the order of recording.

    Attributes:
        log_time: Time of recording, s, shape (n,), ascending.
        stamp: header.stamp, s; None where the type has no header.
        sequence: header.seq, int64; None where it has none.
    """

    log_time: Array
    stamp: Optional[Array] = None
    sequence: Optional[Array] = None

    def some(self, which: Union[Array, slice]) -> "Arrivals":
        """Return the messages that ``which``, indices or a slice, picks; a missing column stays missing."""
        return Arrivals(self.log_time[which], *[None if column is None else column[which] for column in self[1:]])


def joined(parts: Sequence[Arrivals]) -> Arrivals:
    """Return messages of at least one part, one part after the other."""
    if len(parts) == 1:
        return parts[0]
    stamps = [part.stamp for part in parts if part.stamp is not None]
    sequences = [part.sequence for part in parts if part.sequence is not None]
    return Arrivals(np.concatenate([part.log_time for part in parts]), *[
        np.concatenate(columns) if len(columns) == len(parts) else None for columns in (stamps, sequences)])


@dataclass(frozen=True)
class Stream:
    """The facts that every topic has, whatever it carries.

    Attributes:
        topic: Name.
        types: (type, md5) of its publishers, sorted.
        count: Messages.
        is_stamped: The messages have a header.stamp that is not always 0.
        between: Reads the messages recorded in a window.
    """

    topic: str
    types: Tuple[Tuple[str, str], ...]
    count: int
    is_stamped: bool
    between: Callable[[float, float], Arrivals]

    def __len__(self) -> int:
        return self.count


@dataclass(frozen=True)
class Track:
    """Numbers over time, one row a sample; rows that repeat the stamp before them are left out.

    Attributes:
        topic: Topic of the messages.
        names: One a column.
        time: header.stamp where there is one, else log time; s, shape (n,), ascending.
        value: Shape (n, len(names)).
        frames: The header's frame ids, sorted; of poses only.
    """

    topic: str
    names: Tuple[str, ...]
    time: Array
    value: Array
    frames: Tuple[str, ...] = ()

    def finite(self) -> "Track":
        """Return the samples of which all values are numbers."""
        good = are_numbers(self.value)
        return self if good.all() else replace(self, time=self.time[good], value=self.value[good])


@dataclass(frozen=True)
class TrackFacts:
    """The facts of a track that are known without reading it again; times in s.

    Attributes:
        count: Samples.
        first: Time of the first sample of which all values are numbers; infinite where there is none.
        last: Time of the last such sample.
        finite_count: Samples of which all values are numbers.
        step: Median of the steps above 0.1 ms between such samples; 0 where there are none.
        rhythm: Median of all steps between such samples; 0 where there are none.
        reach: Number of samples to either side that make 24 ms: speeds are taken over them.
        motions: (start, end) of each motion, from rest to rest; see ``spans.SpanFinder``.
    """

    count: int
    first: float
    last: float
    finite_count: int
    step: float
    rhythm: float
    reach: int
    motions: Tuple[TimeWindow, ...]


@dataclass(frozen=True)
class LongTrack:
    """A track of any length, of which a window at a time is read.

    Attributes:
        topic: Topic of the messages.
        names: One a column.
        facts: Facts of all samples.
        windows: Windows in the order of time; together they hold every sample.
        between: Reads the samples of a window.
        frames: The header's frame ids, sorted; of poses only.
    """

    topic: str
    names: Tuple[str, ...]
    facts: TrackFacts
    windows: Tuple[TimeWindow, ...]
    between: Callable[[float, float], Track]
    frames: Tuple[str, ...] = ()

    def blocks(self) -> Iterator[Track]:
        """Yield all samples, window by window."""
        for begin, end in self.windows:
            yield self.between(begin, end)

    def around(self, begin: float, end: float, rows: int = 1) -> Track:
        """Return finite samples from ``begin`` to ``end``, and ``rows`` more at either side if there are."""
        low = high = 4.0 * rows * max(self.facts.step, 1e-3)
        while True:
            part = self.between(begin - low, end + high).finite()
            before = int(np.searchsorted(part.time, begin))
            behind = len(part.time) - int(np.searchsorted(part.time, end, "right"))
            lacks_before = before < rows and begin - low > self.facts.first
            lacks_behind = behind < rows and end + high <= self.facts.last
            if not (lacks_before or lacks_behind):
                return part
            low, high = (4.0 * low if lacks_before else low), (4.0 * high if lacks_behind else high)

    def beginning(self) -> Track:
        """Return the first finite sample, with one more behind it if there is one; none where there is none."""
        return self.around(self.facts.first, self.facts.first)

    def at(self, times: Array) -> Array:
        """Return values at ascending times, s, interpolated and held at the ends, shape (len(times), columns)."""
        result = np.empty((len(times), len(self.names)))
        done = 0
        last: Optional[Track] = None
        for block in self.blocks():
            block = block.finite()
            if not len(block.time):
                continue
            if last is not None:
                block = replace(block, time=np.concatenate([last.time, block.time]),
                                value=np.concatenate([last.value, block.value]))
            end = int(np.searchsorted(times, block.time[-1], "right"))
            for column in range(result.shape[1]):
                result[done:end, column] = np.interp(times[done:end], block.time, block.value[:, column])
            done = end
            last = replace(block, time=block.time[-1:], value=block.value[-1:])
        result[done:] = np.nan if last is None else last.value
        return result


class Contents(NamedTuple):
    """One topic's fields as sequences of values, and how each field of its type is compared.

    Attributes:
        names: Fields that are sequences of values, one a column.
        time: header.stamp where there is one, else log time, of the messages before and behind each change; s,
            shape (n,), ascending.
        value: Whole numbers, or keys of other values, int64, shape (n, len(names)).
        labels: Readable values by field and key, of those that are no whole numbers.
        repeats: Messages with the contents of the message before.
        handled: How each field is compared, by field; of a field that is not, an empty text.
    """

    names: Tuple[str, ...]
    time: Array
    value: Array
    labels: Dict[str, Dict[int, str]]
    repeats: int
    handled: Dict[str, str]

    def without(self, names: Collection[str]) -> "Contents":
        """Return the contents without some of their sequences."""
        kept = [column for column, name in enumerate(self.names) if name not in names]
        return self._replace(names=tuple(self.names[column] for column in kept), value=self.value[:, kept])

    def track(self, topic: str) -> Track:
        """Return the sequences as a track."""
        return Track(topic, self.names, self.time, self.value)


class Call(NamedTuple):
    """One service call that a driver served.

    Attributes:
        topic: The topic on which the driver reports calls.
        start: Time of arrival, s.
        duration: Time until the answer, s.
        service: Resolved name.
        service_type: ``package/Type``.
        md5sum: MD5 sum of the type as the caller sent it.
        request: Bytes on the wire.
        response: Bytes on the wire; empty where there was none.
        success: Answered, and successful as far as the type shows it.
        error: The reason of a failure.
        request_text: Readable, a field a line.
        response_text: Readable, a field a line.
    """

    topic: str
    start: float
    duration: float
    service: str
    service_type: str
    md5sum: str
    request: bytes
    response: bytes
    success: bool
    error: str
    request_text: str
    response_text: str

    @property
    def end(self) -> float:
        """The time of the answer, s."""
        return self.start + self.duration

    @property
    def meaning(self) -> Tuple[str, bytes]:
        """The md5 and the request, the same for both definitions of ServoMove where ``speed`` is empty."""
        return plain_request(self.md5sum, self.request)

    @property
    def short_name(self) -> str:
        """Name without namespace and node."""
        return self.service.rsplit("/", 1)[-1]

    @property
    def words(self) -> str:
        """Name and request in one line."""
        request = " ".join(as_typed(self.request_text).split())
        return "%s(%s)" % (self.short_name, request if len(request) <= 160 else request[:157] + "...")


@dataclass(frozen=True)
class Run:
    """One log; every time in it is in s since ``start_ns``.

    Attributes:
        path: The file.
        start_ns: Log time of the first message, ns since the epoch.
        duration: Time to the last message, s.
        streams: Streams by topic.
        joints: Joint positions, rad, by topic; the columns are joints.
        poses: Tool poses, m and rotation vectors in rad, by topic; six columns.
        states: Whole numbers that stand for states, by topic; only the samples at which one changes, the first and
            the last.
        fields: Numeric fields beyond joints and poses, by topic and field path.
        contents: Fields as sequences of values, by topic.
        ignored: Topics that the tolerances leave out.
        calls: Calls by time of arrival.
        windows: Windows of log time that hold all messages, each a bounded number of them.
    """

    path: str
    start_ns: int
    duration: float
    streams: Dict[str, Stream] = field(default_factory=dict)
    joints: Dict[str, LongTrack] = field(default_factory=dict)
    poses: Dict[str, LongTrack] = field(default_factory=dict)
    states: Dict[str, Track] = field(default_factory=dict)
    fields: Dict[str, Dict[str, LongTrack]] = field(default_factory=dict)
    contents: Dict[str, Contents] = field(default_factory=dict)
    ignored: Tuple[str, ...] = ()
    calls: Tuple[Call, ...] = ()
    windows: Tuple[TimeWindow, ...] = ()

    @property
    def arms(self) -> List[str]:
        """Namespaces of the arms: what stands before the node's name in the topics of joint positions."""
        driver = {topic.rsplit("/", 2)[0] for topic in self.joints if topic.endswith("/joint_position")}
        return sorted(driver) or sorted({topic.rsplit("/", 1)[0] for topic in self.joints})


def arm_of(topic: str, arms: List[str]) -> str:
    """Return the arm that a topic or service belongs to: the longest namespace it lies in; else the first."""
    inside = [arm for arm in arms if topic.startswith(arm + "/")]
    return max(inside, key=len) if inside else arms[0] if arms else ""
