"""One log as the comparison sees it: streams, joints, poses, states, calls, all on one clock in s."""
from dataclasses import dataclass, field, replace
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ..messages.batch import Array


@dataclass(frozen=True)
class Stream:
    """What every topic has, whatever it carries.

    Attributes:
        topic: Name.
        types: (type, md5) of its publishers, sorted.
        log_time: Time of recording, s, shape (n,), ascending.
        stamp: header.stamp, s, in the order of ``log_time``; None where the type has no header.
        lost: Messages that header.seq shows to be missing; None where it does not count.
    """

    topic: str
    types: Tuple[Tuple[str, str], ...]
    log_time: Array
    stamp: Optional[Array] = None
    lost: Optional[int] = None

    def __len__(self) -> int:
        return len(self.log_time)


@dataclass(frozen=True)
class Track:
    """Numbers over time, one row a sample; rows that repeat the stamp before them are left out.

    Attributes:
        topic: Where they came from.
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
        """The samples of which all values are numbers."""
        good = np.isfinite(self.value).all(axis=1)
        return self if good.all() else replace(self, time=self.time[good], value=self.value[good])


class Call(NamedTuple):
    """One service call that a driver served.

    Attributes:
        topic: The topic that tells of it.
        start: When it arrived, s.
        duration: Until it was answered, s.
        service: Resolved name.
        service_type: ``package/Type``.
        md5sum: Of the type as the caller sent it.
        request: As on the wire.
        response: As on the wire; empty where there was none.
        success: Answered, and successful as far as the type can tell.
        error: Why not.
        request_text: Readable, a field a line.
        response_text: As request_text.
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
        """When it was answered, s."""
        return self.start + self.duration

    @property
    def short_name(self) -> str:
        """Name without namespace and node."""
        return self.service.rsplit("/", 1)[-1]

    @property
    def words(self) -> str:
        """Name and request in one line."""
        request = " ".join(self.request_text.split())
        return "%s(%s)" % (self.short_name, request if len(request) <= 160 else request[:157] + "...")


@dataclass(frozen=True)
class Run:
    """One log; every time in it is in s since ``start_ns``.

    Attributes:
        path: The file.
        start_ns: Log time of the first message, ns since the epoch.
        duration: To the last message, s.
        streams: By topic.
        joints: Joint positions, rad, by topic; the columns are joints.
        poses: Tool poses, m and rotation vectors in rad, by topic; shape (n, 6).
        states: Whole numbers that stand for states, by topic.
        fields: Further numeric fields, by topic and field path.
        calls: By time of arrival.
    """

    path: str
    start_ns: int
    duration: float
    streams: Dict[str, Stream] = field(default_factory=dict)
    joints: Dict[str, Track] = field(default_factory=dict)
    poses: Dict[str, Track] = field(default_factory=dict)
    states: Dict[str, Track] = field(default_factory=dict)
    fields: Dict[str, Dict[str, Track]] = field(default_factory=dict)
    calls: Tuple[Call, ...] = ()

    @property
    def arms(self) -> List[str]:
        """Namespaces of the arms: what stands before the node's name in the topics of joint positions."""
        driver = {topic.rsplit("/", 2)[0] for topic in self.joints if topic.endswith("/joint_position")}
        return sorted(driver) or sorted({topic.rsplit("/", 1)[0] for topic in self.joints})


def arm_of(topic: str, arms: List[str]) -> str:
    """The arm that a topic or service belongs to: the longest namespace it lies in; else the first."""
    inside = [arm for arm in arms if topic.startswith(arm + "/")]
    return max(inside, key=len) if inside else arms[0] if arms else ""
