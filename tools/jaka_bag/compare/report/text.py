"""The result of a comparison as a few lines of text, and as plain data."""
import math
from typing import Any, Dict, List, Optional, Sequence

from ..verdict import Check, Comparison, Outcome

FORMAT_VERSION = 1


def check_line(check: Check) -> str:
    """Return one check as a line, for a difference with its amount and both values."""
    line = "%-13s %s: %s" % (check.outcome.value.upper(), check.name, check.detail)
    if check.outcome is not Outcome.DIFFERENT:
        return line
    if check.amount:
        line += " [%s]" % check.amount
    if check.golden or check.candidate:
        line += "\n%-13s   golden: %s\n%-13s   candidate: %s" % ("", check.golden, "", check.candidate)
    return line


def also_words(more: Sequence[Check], before: str = "") -> str:
    """Return the checks that show the same as another one, by their names; empty where there are none."""
    return before + "the same: " + ", ".join(check.name for check in more) if more else ""


def headline(comparison: Comparison) -> str:
    """Return the verdict in one line."""
    different = comparison.differences
    compared = [check for check in comparison.checks if check.outcome is not Outcome.NOT_COMPARED]
    if not different:
        return "same: %d checks, lag %.3f s" % (len(compared), comparison.alignment.lag)
    return "DIFFERENT: %d of %d checks: %s" % (len(different), len(compared), ", ".join(
        dict.fromkeys(check.aspect.value for check in different)))


def beginning_words(check: Check, further: int) -> str:
    """Return the difference that a comparison's others may follow from, in one line.

    Args:
        check: That difference.
        further: The number of the others.
    """
    words = "%s: %s" % (check.name, check.detail)
    if " at %.2f s" % (check.at or 0.0) not in words:
        words += " at %.2f s" % (check.at or 0.0)
    return words + ("; %d further %s" % (further, "difference" if further == 1 else "differences") if further else "")


def coverage_line(comparison: Comparison) -> str:
    """Return how much of both logs was compared, and what was not, in one line."""
    compared = sum(check.outcome is not Outcome.NOT_COMPARED for check in comparison.checks)
    return "%d checks; %s" % (compared, comparison.coverage.words)


def unmatched_lines(comparison: Comparison) -> List[str]:
    """Return a line for each name in the tolerances that limits nothing, as the golden log lacks it."""
    return ["note: tolerances: %s" % text for text in comparison.unmatched]


def as_text(comparison: Comparison, verbose: bool = False) -> str:
    """Return the differences, the worst first, the one that they begin with, and the verdict; ``verbose``: every check.

    The last line tells how much was compared.
    """
    lines = ["golden:    %s" % comparison.golden.path, "candidate: %s" % comparison.candidate.path]
    if comparison.time_scale != 1.0:
        lines.append("the candidate ran %g times faster" % comparison.time_scale)
    if verbose:
        lines += [check_line(check) for check in comparison.checks]
    else:
        lines += [check_line(first) + also_words(more, "\n%-13s   " % "") for first, more in comparison.folded]
    if comparison.beginning is not None:
        lines.append("it begins with: " + beginning_words(comparison.beginning, len(comparison.differences) - 1))
    skipped = sum(check.outcome is Outcome.NOT_COMPARED for check in comparison.checks)
    if skipped and not verbose:
        lines.append("%d checks were not compared (--verbose tells why)" % skipped)
    lines += unmatched_lines(comparison)
    return "\n".join(lines + [headline(comparison), coverage_line(comparison)])


def _finite(value: Optional[float]) -> Any:
    """Convert infinity and NaN, which JSON does not have, to text."""
    return value if value is None or math.isfinite(value) else str(value)


def check_data(check: Check) -> Dict[str, Any]:
    """Return one check as plain data."""
    return {"check": check.aspect.value, "topic": check.topic, "field": check.field, "outcome": check.outcome.value,
            "detail": check.detail, "measured": _finite(check.measured), "limit": _finite(check.limit),
            "unit": check.unit, "at_s": _finite(check.at), "golden": check.golden, "candidate": check.candidate}


def as_data(comparison: Comparison) -> Dict[str, Any]:
    """Return the whole result as plain data, for JSON."""
    alignment = comparison.alignment
    first, beginning = comparison.first_divergence, comparison.beginning
    episodes: List[Dict[str, Any]] = [
        {"arm": episode.arm, "start_s": episode.start, "end_s": episode.end, "lag_s": episode.lag,
         "pace": episode.pace, "is_alike": episode.is_alike}
        for found in alignment.episodes.values() for episode in found]
    return {"format": FORMAT_VERSION, "same": comparison.same, "summary": headline(comparison),
            "golden": comparison.golden.path, "candidate": comparison.candidate.path,
            "time_scale": comparison.time_scale,
            "coverage": {"topics": comparison.coverage.topics, "fields": comparison.coverage.fields, "not_compared": [
                gap._asdict() for gap in comparison.coverage.gaps]},
            "unmatched_tolerances": list(comparison.unmatched),
            "alignment": {"lag_s": alignment.lag, "method": alignment.method, "motions": episodes},
            "first_divergence": None if first is None else check_data(first),
            "beginning": None if beginning is None else check_data(beginning),
            "checks": [check_data(check) for check in comparison.checks]}
