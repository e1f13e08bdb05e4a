"""The record of one run's comparison with the golden log: plain values that pickle, and that a table holds."""
import math
from typing import Dict, List, NamedTuple, Optional, Tuple

from jaka_bag.compare.verdict import Aspect, Check, Comparison, Outcome

SAME, DIFFERENT, UNKNOWN, NOT_COMPARED = "same", "different", "cannot be told", "not compared"
"""Verdicts of a run. ``UNKNOWN``: only of results that are judged again; ``NOT_COMPARED``: the log cannot be read."""


class CheckOutcome(NamedTuple):
    """One check of one run; see ``compare.verdict.Check``.

    Attributes:
        aspect: Kind of the check.
        topic: Topic, arm or service.
        field: Field or joint.
        outcome: ``same``, ``different``, ``not compared``, or ``cannot be told`` of one that is judged again.
        margin: How near to its limit: 1 is the limit, more is different; infinite where something differs that has no
            amount, None where it was not compared.
        measured: Measured amount, in ``unit``; None where the check is not about an amount.
        limit: Largest amount allowed, in ``unit``.
        unit: Unit of both amounts.
        at: Golden time of the worst moment, s.
        detail: Observation, of checks whose outcome is not ``same``.
        golden: The golden value there, likewise.
        candidate: The run's value there.
        evidence: See ``Check.evidence``.
    """

    aspect: str
    topic: str
    field: str
    outcome: str
    margin: Optional[float] = None
    measured: Optional[float] = None
    limit: Optional[float] = None
    unit: str = ""
    at: Optional[float] = None
    detail: str = ""
    golden: str = ""
    candidate: str = ""
    evidence: Tuple[Tuple[float, float], ...] = ()

    @property
    def name(self) -> str:
        """The check's name in reports."""
        return as_check(self).name

    @property
    def worst(self) -> Optional[float]:
        """The largest amount that was measured, also where a share of the samples decided."""
        return self.evidence[0][0] if self.aspect in SAMPLED and self.evidence else self.measured


SAMPLED = tuple(aspect.value for aspect in (Aspect.JOINTS, Aspect.POSITION, Aspect.ORIENTATION, Aspect.FIELDS))
"""Checks that go sample by sample."""


class RunOutcome(NamedTuple):
    """One run against the golden log.

    Attributes:
        run: SHA-256 of the log, hex; empty where it could not be read.
        path: The log.
        cell: Cell in which it was recorded.
        size: Bytes.
        mtime_ns: Time of the file's last change, ns since the epoch.
        start_ns: Log time of the first message, ns since the epoch.
        duration: Length of the log, s.
        verdict: ``SAME``, ``DIFFERENT``, ``UNKNOWN`` or ``NOT_COMPARED``.
        reason: Why it was not compared, or what is different.
        margin: The largest of the checks; None where it was not compared.
        worst: The check that has the largest margin.
        lag: Time by which the run is later in its log than in the golden one, s.
        cycle: Time from the begin of the first motion to the end of the last, s; None where nothing moves.
        course: Limits for which the amounts hold, by decision; see ``compare.course``.
        checks: Checks in the order in which they were made.
    """

    run: str
    path: str
    cell: str = ""
    size: int = 0
    mtime_ns: int = 0
    start_ns: int = 0
    duration: float = 0.0
    verdict: str = NOT_COMPARED
    reason: str = ""
    margin: Optional[float] = None
    worst: str = ""
    lag: float = 0.0
    cycle: Optional[float] = None
    course: Dict[str, Tuple[float, float]] = {}
    checks: Tuple[CheckOutcome, ...] = ()

    @property
    def key(self) -> str:
        """The identity of a run: its content, else its path."""
        return self.run or self.path

    @property
    def place(self) -> Tuple[int, str, str]:
        """The sort key of runs by time."""
        return self.start_ns, self.run, self.path


def _kept(check: Check) -> CheckOutcome:
    is_same = check.outcome is Outcome.SAME
    return CheckOutcome(
        check.aspect.value, check.topic, check.field, check.outcome.value, check.margin, check.measured, check.limit,
        check.unit, check.at, "" if is_same else check.detail, "" if is_same else check.golden,
        "" if is_same else check.candidate, check.evidence)


def as_check(kept: CheckOutcome) -> Check:
    """Restore a check from its record; one whose outcome is the same comes without its words."""
    outcome = Outcome(kept.outcome) if kept.outcome != UNKNOWN else Outcome.NOT_COMPARED
    return Check(Aspect(kept.aspect), kept.topic, kept.field, outcome, kept.detail, kept.measured, kept.limit,
                 kept.unit, kept.at, kept.golden, kept.candidate, kept.evidence)


def judged_run(outcome: RunOutcome) -> RunOutcome:
    """Return the outcome with verdict, reason, margin and worst check derived from its checks."""
    different = [check for check in outcome.checks if check.outcome == DIFFERENT]
    unknown = [check for check in outcome.checks if check.outcome == UNKNOWN]
    margin, worst = -1.0, ""
    for check in outcome.checks:
        if check.margin is not None and check.margin > margin:
            margin, worst = check.margin, check.name
    if different:
        reason = "%d check%s: %s" % (len(different), "s" if len(different) > 1 else "",
                                     ", ".join(dict.fromkeys(check.aspect for check in different)))
    else:
        reason = "; ".join(dict.fromkeys(check.detail for check in unknown))
    return outcome._replace(verdict=DIFFERENT if different else UNKNOWN if unknown else SAME, reason=reason,
                            margin=margin if margin >= 0 else None, worst=worst)


def _cycle(comparison: Comparison) -> Optional[float]:
    """Return the time from the start of any arm's first motion to the end of the last, s of the candidate."""
    motions = [motion for topic, track in comparison.candidate.joints.items() if topic in comparison.golden.joints
               for motion in track.facts.motions]
    if not motions:
        return None
    return max(end for _, end in motions) - min(begin for begin, _ in motions)


def outcome_of(comparison: Comparison, run: str, path: str, cell: str, size: int, mtime_ns: int) -> RunOutcome:
    """Return the record of a comparison of a log with this content and place."""
    candidate = comparison.candidate
    assert comparison.course is not None
    return judged_run(RunOutcome(
        run, path, cell, size, mtime_ns, candidate.start_ns, candidate.duration, lag=comparison.alignment.lag,
        cycle=_cycle(comparison), course=comparison.course.ranges(), checks=tuple(map(_kept, comparison.checks))))


def worst_first(outcomes: List[RunOutcome]) -> List[RunOutcome]:
    """Return the runs that are different, the largest margin first; of equal ones that with more different checks."""
    different = [outcome for outcome in outcomes if outcome.verdict == DIFFERENT]
    return sorted(different, key=lambda one: (
        -(one.margin if one.margin is not None else math.inf),
        -sum(check.outcome == DIFFERENT for check in one.checks), one.place))
