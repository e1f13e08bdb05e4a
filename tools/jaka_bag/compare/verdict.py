"""The outcome of one check, and of a whole comparison."""
import enum
from dataclasses import dataclass
from typing import Dict, List, NamedTuple, Optional, Tuple

from ..messages.batch import Array
from .matching.alignment import Alignment
from .matching.course import Course
from .runs.run import Run


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
    JOINTS = "joints"
    POSITION = "position"
    ORIENTATION = "orientation"
    FIELDS = "fields"
    STATES = "states"
    CALLS = "calls"
    RESPONSES = "responses"
    DURATIONS = "durations"


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
    """Return a check whether an amount is within its limit; NaN is not within it."""
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


class Residual(NamedTuple):
    """The deviations of one check's samples, beyond what jitter and stops allow.

    Attributes:
        time: Golden time, s, shape (n,): so many of the samples that the curve of all can be drawn.
        off: Deviation in ``unit``, shape (n,).
        limit: Allowed deviation.
        unit: Unit of deviation and limit.
        near_time: Golden time of all samples within a second of the worst one, s, shape (m,).
        near_off: Deviation of those samples in ``unit``, shape (m,).
    """

    time: Array
    off: Array
    limit: float
    unit: str
    near_time: Array
    near_off: Array


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
    """

    golden: Run
    candidate: Run
    alignment: Alignment
    checks: Tuple[Check, ...]
    residuals: Dict[ResidualKey, Residual]
    time_scale: float = 1.0
    course: Optional[Course] = None

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
    def first_divergence(self) -> Optional[Check]:
        """The failed check whose worst moment is the earliest; None where no failed check has a moment."""
        timed = [check for check in self.differences if check.at is not None]
        return min(timed, key=lambda check: check.at or 0.0) if timed else None
