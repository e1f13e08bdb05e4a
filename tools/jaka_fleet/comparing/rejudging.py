"""Kept outcomes under other tolerances, without the logs.

An amount that was measured is judged again by its new limit. Some tolerances decide what is measured: with these the
logs must be read again, ``needs_logs`` names them. Of others a comparison noted how far they could be other
(``compare.course``), and of samples how many are outside of which limit: where that is not enough to tell, the outcome
is ``cannot be told``.
"""
import dataclasses
import math
import re
from typing import List, Optional, Tuple

from jaka_bag.compare.checks.call_checks import allowed_duration
from jaka_bag.compare.checks.content_checks import fixed_limit
from jaka_bag.compare.checks.motion_checks import ONE_MOTION
from jaka_bag.compare.checks.timing_checks import allowed_pace
from jaka_bag.compare.comparison import scaled
from jaka_bag.compare.matching.course import left_by
from jaka_bag.compare.runs.publishers import base_of
from jaka_bag.compare.tolerances import Tolerances
from jaka_bag.compare.verdict import Aspect, Outcome
from jaka_bag.units import m_to_mm, mm_to_m

from .outcome import DIFFERENT, NOT_COMPARED, SAME, SAMPLED, UNKNOWN, CheckOutcome, RunOutcome, judged_run

_READ_AGAIN = {"streams": ("gap_s",), "timing": ("jitter_ms", "cut_ms"), "calls": ("request", "response")}
_SHARE = "% of the samples outside"


def needs_logs(before: Tolerances, after: Tolerances) -> List[str]:
    """Return the tolerances, as ``streams.gap_s``, that differ and decide what is measured."""
    names = ["%s.%s" % (section, name) for section, keys in _READ_AGAIN.items() for name in keys
             if getattr(getattr(before, section), name) != getattr(getattr(after, section), name)]
    names += [name for name in ("contents", "nan", "ignore_topics", "ignore_fields", "envelopes")
              if getattr(before, name) != getattr(after, name)]
    if before.envelopes:  # below an envelope no samples were counted for other limits
        names += ["%s.outside_percent" % section for section in ("joints", "tcp") if getattr(
            before, section).outside_percent != getattr(after, section).outside_percent]
    plain = [{(topic, field): dataclasses.replace(rule, absolute=0.0)
              for topic, rules in one.fields.items() for field, rule in rules.items()} for one in (before, after)]
    return names + (["fields"] if plain[0] != plain[1] else [])


def rejudged(run: RunOutcome, tolerances: Tolerances, time_scale: float = 1.0) -> RunOutcome:
    """Return the run's outcome under other tolerances; ``needs_logs`` must be empty for them.

    Args:
        run: The run's outcome as it was kept.
        tolerances: The new ones.
        time_scale: Factor of time of the comparison.
    """
    if run.verdict == NOT_COMPARED:
        return run
    limits = scaled(tolerances, time_scale)
    left = left_by(run.course, limits)
    checks = tuple(_unknown(check, "%s decides what is measured: the log must be read again" % ", ".join(left))
                   if left and _depends(check, left) else _rejudged(check, limits) for check in run.checks)
    return judged_run(run._replace(checks=checks))


def _depends(check: CheckOutcome, left: List[str]) -> bool:
    """Return whether a check depends on measurements that other tolerances would have changed."""
    if "joints.position_rad" in left:  # the alignment
        return check.aspect != Aspect.TYPES.value
    about_calls = check.aspect in (Aspect.CALLS.value, Aspect.RESPONSES.value, Aspect.DURATIONS.value)
    return "calls.timing_s" in left and about_calls or check.aspect in (
        Aspect.STATES.value, Aspect.CONTENTS.value) and any(
        name.startswith("states.") for name in left)


def _unknown(check: CheckOutcome, why: str) -> CheckOutcome:
    if check.outcome == Outcome.NOT_COMPARED.value:
        return check
    return check._replace(outcome=UNKNOWN, margin=None, detail=why)


def _with(check: CheckOutcome, measured: float, limit: float, unit: Optional[str] = None) -> CheckOutcome:
    """Return the check with another amount and limit, judged."""
    if limit > 0:
        margin = measured / limit
    else:
        margin = math.inf if measured > 0 else 0.0
    is_same = measured <= limit
    return check._replace(outcome=SAME if is_same else DIFFERENT, margin=math.inf if margin != margin else margin,
                          measured=measured, limit=limit, unit=check.unit if unit is None else unit)


def _rejudged(check: CheckOutcome, limits: Tolerances) -> CheckOutcome:
    aspect = check.aspect
    if aspect == Aspect.TYPES.value:
        return _type_again(check, limits)
    if check.measured is None or check.outcome == Outcome.NOT_COMPARED.value:
        return check
    if aspect == Aspect.CONTENTS.value and not check.field.endswith(" timing"):
        return check  # its limit follows from the golden log
    if aspect in SAMPLED and not check.evidence:
        return check  # its limit is an envelope, the same one
    if aspect in SAMPLED:
        return _samples_again(check, *_sample_limits(check, limits))
    if aspect == Aspect.PACE.value:
        return max((_with(check, percent, allowed_pace(span, limits.timing)) for percent, span in check.evidence),
                   key=_margin)
    if aspect == Aspect.DURATIONS.value:
        return max((_with(check, off, allowed_duration(length, limits.calls)) for off, length in check.evidence),
                   key=_margin)
    return _with(check, check.measured, _plain_limit(check, limits))


def _margin(check: CheckOutcome) -> float:
    return check.margin or 0.0


def _plain_limit(check: CheckOutcome, limits: Tolerances) -> float:
    """Return the limit of a check that has one amount."""
    streams = limits.streams
    if check.aspect == Aspect.STAMPS.value:
        return streams.latency_ms if check.field == "latency" else streams.repeated_percent
    if check.aspect == Aspect.LATENESS.value:
        return ONE_MOTION * limits.timing.stale_ms if check.field.endswith("one motion") else limits.timing.stale_ms
    if check.aspect == Aspect.TIMING.value and check.field.startswith("waits"):
        return limits.timing.wait_s
    return {Aspect.COUNTS.value: streams.count_percent, Aspect.RATES.value: streams.rate_percent,
            Aspect.JITTER.value: streams.jitter_ms, Aspect.GAPS.value: streams.gap_length_s,
            Aspect.LOST.value: streams.lost_percent, Aspect.ALIGNMENT.value: limits.timing.event_s,
            Aspect.TIMING.value: limits.timing.event_s, Aspect.STATES.value: limits.states.timing_s,
            Aspect.CONTENTS.value: limits.states.timing_s,
            Aspect.CALLS.value: limits.calls.timing_s, Aspect.RESPONSES.value: limits.calls.value_absolute,
            }[check.aspect]


def _sample_limits(check: CheckOutcome, limits: Tolerances) -> Tuple[float, float, str]:
    """Limit of each sample, allowed share of the samples outside, %, and unit."""
    if check.aspect == Aspect.JOINTS.value:
        joints = limits.joints
        return joints.per_joint.get(check.field, joints.position_rad), joints.outside_percent, "rad"
    if check.aspect == Aspect.POSITION.value:
        return mm_to_m(limits.tcp.position_mm) * m_to_mm(1.0), limits.tcp.outside_percent, "mm"
    if check.aspect == Aspect.ORIENTATION.value:
        return limits.tcp.orientation_rad, limits.tcp.outside_percent, "rad"
    name = re.sub(r"\[\d+\]$", "", check.field)
    rule = limits.fields.get(check.topic, {}).get(base_of(name))
    fixed = fixed_limit(name, limits)
    return rule.absolute if rule is not None else check.limit or 0.0 if fixed is None else fixed, 0.0, ""


def _samples_again(check: CheckOutcome, limit: float, outside_percent: float, unit: str) -> CheckOutcome:
    (worst, floor), rungs = check.evidence[0], check.evidence[1:]
    if worst <= limit:
        return _with(check, worst, limit, unit)
    if worst <= floor:
        return _unknown(check, "amounts are told from %.4g %s on: the log must be read again" % (floor, unit))
    most, least = 100.0, 0.0
    for rung, share in rungs:
        if rung <= limit:
            most = min(most, share)
        if rung >= limit:
            least = max(least, share)
    if outside_percent == 0 or least > outside_percent:
        return _with(check, worst, limit, unit)
    if most <= outside_percent:
        return _with(check, most, outside_percent, _SHARE)
    return _unknown(check, "how many samples are more than %.4g %s off was not counted: the log must be read again"
                    % (limit, unit))


def _type_again(check: CheckOutcome, limits: Tolerances) -> CheckOutcome:
    """Evaluate a check of types again, as a topic that one log lacks may be optional now."""
    is_missing = "only in the candidate" in check.detail or "not in the candidate" in check.detail
    if check.outcome == SAME or not is_missing:
        return check
    if limits.is_optional(check.topic):
        return check._replace(outcome=Outcome.NOT_COMPARED.value, margin=None)
    return check._replace(outcome=DIFFERENT, margin=math.inf)
