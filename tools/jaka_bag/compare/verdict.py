"""The outcome of one check, and of a whole comparison."""
import enum
import re
from dataclasses import dataclass
from typing import Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from ..driver_interface import INPUT_TOPICS
from ..messages.batch import Array
from .matching.alignment import Alignment
from .matching.course import Course
from .runs.run import Run
from .tolerances import Envelope

_INPUTS = tuple("/" + name for name in INPUT_TOPICS)
_PLACE_OF_A_FRAME = re.compile(r".* > .*\.translation(\[\d\])?")
_IN_METRES = {"mm": 1e-3}
_AT_ONCE_S, _ABOUT = 0.1, 2.0
"""Time, s, and factor by which begin and amount of one difference may differ on two topics: one axis, or the distance.
"""
_FOLLOWS_S = 1.0
"""Time, s, by which what follows from a call may seem to come before it, as two logs are laid together."""


class Outcome(enum.Enum):
    """The outcome of one check."""

    SAME = "same"
    DIFFERENT = "different"
    NOT_COMPARED = "not compared"


class Aspect(enum.Enum):
    """The checks in their order."""

    TYPES = "types"
    COUNTS = "counts"
    RATES = "rates"
    JITTER = "jitter"
    GAPS = "gaps"
    LOST = "lost messages"
    STAMPS = "stamps"
    ALIGNMENT = "alignment"
    TIMING = "timing"
    PACE = "pace"
    LATENESS = "lateness"
    JOINTS = "joints"
    POSITION = "position"
    ORIENTATION = "orientation"
    FIELDS = "fields"
    CONTENTS = "contents"
    STATES = "states"
    CALLS = "calls"
    RESPONSES = "responses"
    DURATIONS = "durations"


_SHOWN_BY_THE_ARM = (Aspect.JOINTS, Aspect.POSITION, Aspect.ORIENTATION, Aspect.STATES)


@dataclass(frozen=True)
class Check:
    """One check of one topic or field.

    Attributes:
        aspect: Kind of the check.
        topic: The topic, or the arm's namespace where it is about several.
        field: Field, joint or service; empty where it is about the whole topic.
        outcome: Outcome of the check.
        detail: One sentence: the observation, or the reason why it was not compared.
        measured: The worst value seen; None where the check is not about an amount.
        limit: Allowed value.
        unit: Unit of ``measured`` and ``limit``.
        at: Golden time of the worst moment, s; None where it has none.
        golden: The golden log's value there, readable.
        candidate: The candidate's value there.
        evidence: Amounts from which the outcome under other tolerances follows; empty where ``measured`` is enough.
            For joints, position, orientation and fields first (the worst, how far amounts are upper bounds only), then
            (limit, % of the samples outside of it); of pace (% off, s of golden motion); of durations (s off, s of the
            golden call). Pairs that others outdo in both are left out.
    """

    aspect: Aspect
    topic: str
    field: str
    outcome: Outcome
    detail: str
    measured: Optional[float] = None
    limit: Optional[float] = None
    unit: str = ""
    at: Optional[float] = None
    golden: str = ""
    candidate: str = ""
    evidence: Tuple[Tuple[float, float], ...] = ()

    @property
    def name(self) -> str:
        """Topic, check and field, as reports name it."""
        field = "" if self.field == self.aspect.value else self.field
        return " ".join(part for part in (self.topic, self.aspect.value, field) if part)

    @property
    def amount(self) -> str:
        """The measured amount and the limit; empty where the check is not about an amount."""
        if self.measured is None or self.limit is None:
            return ""
        return ("%.4g of %.4g %s" % (self.measured, self.limit, self.unit)).rstrip()

    @property
    def severity(self) -> float:
        """The measured amount as a multiple of the limit; infinite where something differs that has no amount."""
        if self.measured is None or self.limit is None:
            return float("inf") if self.outcome is Outcome.DIFFERENT else 0.0
        if self.limit <= 0:
            return float("inf") if self.measured > 0 else 0.0
        return self.measured / self.limit if self.measured == self.measured else float("inf")

    @property
    def margin(self) -> Optional[float]:
        """``severity``, of which 1 is the limit: at most 1 where the outcome is the same, above where it is different.

        None where the check was not made.
        """
        return None if self.outcome is Outcome.NOT_COMPARED else self.severity


def judged(aspect: Aspect, topic: str, field: str, measured: float, limit: float, unit: str, detail: str,
           at: Optional[float] = None, golden: str = "", candidate: str = "",
           evidence: Tuple[Tuple[float, float], ...] = ()) -> Check:
    """Return the check of an amount against its limit; NaN is beyond it."""
    outcome = Outcome.SAME if measured <= limit else Outcome.DIFFERENT
    return Check(aspect, topic, field, outcome, detail, measured, limit, unit, at, golden, candidate, evidence)


def equal(aspect: Aspect, topic: str, field: str, is_same: bool, detail: str, at: Optional[float] = None,
          golden: str = "", candidate: str = "") -> Check:
    """Return a check without an amount."""
    outcome = Outcome.SAME if is_same else Outcome.DIFFERENT
    return Check(aspect, topic, field, outcome, detail, None, None, "", at, golden, candidate)


def not_compared(aspect: Aspect, topic: str, field: str, why: str) -> Check:
    """Return a check that was left out, with the reason."""
    return Check(aspect, topic, field, Outcome.NOT_COMPARED, why)


def _is_asked(check: Check) -> bool:
    """Return whether a check is about what was asked of a driver: a call, or a message on a topic of its input."""
    if check.aspect in (Aspect.CONTENTS, Aspect.FIELDS):
        return check.topic.endswith(_INPUTS)
    return check.aspect is Aspect.CALLS and not check.field


def _subject(check: Check) -> str:
    """Return what a check of a joint or of a place is about, whatever its topic; empty of others."""
    if check.aspect is Aspect.JOINTS:
        return check.field
    if check.aspect is Aspect.POSITION or _PLACE_OF_A_FRAME.fullmatch(check.field):
        return Aspect.POSITION.value
    return ""


def _are_of_one_arm(one: str, other: str) -> bool:
    """Return whether two topics are different ones, of which one stands in the namespace of the other."""
    short, long = sorted((topic.rpartition("/")[0] + "/" for topic in (one, other)), key=len)
    return one != other and long.startswith(short)


class Gap(NamedTuple):
    """A topic, or one field of it, that nothing compares.

    Attributes:
        topic: The topic.
        field: The field; empty where it is the whole topic.
        reason: Why not.
        is_accepted: The tolerances leave exactly this out.
    """

    topic: str
    field: str
    reason: str
    is_accepted: bool = False

    @property
    def words(self) -> str:
        """Topic, field and reason in a few words."""
        return "%s (%s)" % (" ".join(filter(None, (self.topic, self.field))), self.reason)


class Coverage(NamedTuple):
    """The share of two logs that was compared.

    Attributes:
        topics: Topics of both logs.
        fields: Fields of the topics whose fields are known.
        gaps: Topics and fields that were not compared.
    """

    topics: int
    fields: int
    gaps: Tuple[Gap, ...]

    @property
    def is_whole(self) -> bool:
        """True where every topic and field was compared, or is left out one by one."""
        return all(gap.is_accepted for gap in self.gaps)

    @property
    def words(self) -> str:
        """Numbers of topics and fields that were compared, and what was not."""
        left = sum(not gap.field for gap in self.gaps)
        text = "%d of %d topics, %d of %d fields" % (
            self.topics - left, self.topics, self.fields - sum(bool(gap.field) for gap in self.gaps), self.fields)
        return text + ("; not compared: %s" % ", ".join(gap.words for gap in self.gaps) if self.gaps else "")


class Residual(NamedTuple):
    """The deviations of one check's samples, beyond what jitter and stops allow.

    Attributes:
        time: Golden time, s, shape (n,): so many of the samples that the curve of all can be drawn.
        off: Deviation in ``unit``, shape (n,).
        envelope: Allowed deviation, along the golden log.
        unit: Unit of deviation and limit.
        near_time: Golden time of all samples within a second of the worst one, s, shape (m,).
        near_off: Deviation of those samples in ``unit``, shape (m,).
    """

    time: Array
    off: Array
    envelope: Envelope
    unit: str
    near_time: Array
    near_off: Array


def limits_at(envelope: Envelope, time: Array) -> Array:
    """Return the limit at each golden time, s, shape (n,)."""
    starts, limits = np.array(envelope).T
    found: Array = limits[np.maximum(np.searchsorted(starts, time, "right") - 1, 0)]
    return found


ResidualKey = Tuple[Aspect, str, str]
"""Check, topic and field."""


@dataclass(frozen=True)
class Comparison:
    """Two logs, compared.

    Attributes:
        golden: The golden log.
        candidate: The candidate.
        alignment: Alignment of both in time.
        checks: Checks in the order they were made.
        residuals: Residuals of the checks that go sample by sample.
        time_scale: The candidate ran this many times faster.
        course: Limits for which the amounts would be the same; None where that was not recorded.
        coverage: Share of both logs that was compared.
        unmatched: Names in the tolerances that the golden log lacks, a line each.
    """

    golden: Run
    candidate: Run
    alignment: Alignment
    checks: Tuple[Check, ...]
    residuals: Dict[ResidualKey, Residual]
    time_scale: float = 1.0
    course: Optional[Course] = None
    coverage: Coverage = Coverage(0, 0, ())
    unmatched: Tuple[str, ...] = ()

    @property
    def differences(self) -> List[Check]:
        """The checks that failed, in their order."""
        return [check for check in self.checks if check.outcome is Outcome.DIFFERENT]

    @property
    def same(self) -> bool:
        """True where no check failed."""
        return not self.differences

    @property
    def worst_first(self) -> List[Check]:
        """The checks that failed, the largest excess over its limit first; those without an amount lead."""
        return sorted(self.differences, key=lambda check: -check.severity)

    @property
    def folded(self) -> List[Tuple[Check, Tuple[Check, ...]]]:
        """The checks that failed as ``worst_first`` has them, each with those that show the same on another topic.

        Joints are on ``joint_position`` and ``joint_states``, the tool's place is on ``tool_position`` and ``/tf``.
        """
        groups: List[Tuple[Check, List[Check]]] = []
        for check in self.worst_first:
            again = next((more for first, more in groups if self._is_again(first, check)), None)
            if again is None:
                groups.append((check, []))
            else:
                again.append(check)
        return [(first, tuple(more)) for first, more in groups]

    def _is_again(self, one: Check, other: Check) -> bool:
        """Return whether two failed checks show the same: subject, arm, begin, and about the amount."""
        subject, begins = _subject(one), (self._onset(one), self._onset(other))
        if not subject or subject != _subject(other) or not _are_of_one_arm(one.topic, other.topic):
            return False
        amounts = [(check.measured or 0.0) * _IN_METRES.get(check.unit, 1.0) for check in (one, other)]
        return None not in begins and abs((begins[0] or 0.0) - (begins[1] or 0.0)) <= _AT_ONCE_S and (
            max(amounts) <= _ABOUT * min(amounts))

    @property
    def beginning(self) -> Optional[Check]:
        """The difference from which others may follow; None where no failed check has a moment.

        The earliest call, goal or other message to a driver that is changed, missing or new, unless the arm was
        elsewhere, or in another state, before it.
        """
        calls = [check for check in self.differences if _is_asked(check)]
        others = [check for check in self.differences if not calls or check.aspect in _SHOWN_BY_THE_ARM]
        timed = [(onset, check) for check in others for onset in [self._onset(check)] if onset is not None]
        call = min(calls, key=lambda check: check.at or 0.0, default=None)
        onset, first = min(timed, key=lambda one: one[0], default=(0.0, None))
        return first if call is None or (first is not None and onset < (call.at or 0.0) - _FOLLOWS_S) else call

    def _onset(self, check: Check) -> Optional[float]:
        """Return when the first sample of a failed check was beyond its limit, s; without samples, its worst moment."""
        residual = self.residuals.get((check.aspect, check.topic, check.field))
        beyond = [] if residual is None else residual.time[
            residual.off > limits_at(residual.envelope, residual.time)].tolist()
        return min(beyond, default=check.at)

    @property
    def first_divergence(self) -> Optional[Check]:
        """The failed check whose worst moment is the earliest; None where no failed check has a moment."""
        timed = [check for check in self.differences if check.at is not None]
        return min(timed, key=lambda check: check.at or 0.0) if timed else None
