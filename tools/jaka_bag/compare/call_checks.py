"""Service calls: the same ones with the same requests and success, in time; their responses; their durations."""
import math
import re
from dataclasses import replace
from typing import Dict, List, NamedTuple, Sequence, Tuple

from .alignment import Alignment
from .run import Call, Run
from .sequences import Entry, pair
from .tolerances import CallTolerance, Tolerances
from .verdict import Aspect, Check, equal, judged


class CallPair(NamedTuple):
    """The same call in both logs."""

    golden: Call
    candidate: Call


def call_checks(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                common: Tuple[float, float]) -> List[Check]:
    """All services; none where neither log has calls.

    Args:
        golden: The golden log.
        candidate: The candidate.
        alignment: Of both.
        tolerances: What is allowed.
        common: Golden times between which both logs have messages, s; calls outside of it are not compared.
    """
    limits = tolerances.calls
    lag = alignment.lag
    begin, end = common[0] - limits.timing_s, common[1] + limits.timing_s
    ours = [call for call in golden.calls if begin <= call.start <= end]
    theirs = [call for call in candidate.calls if begin <= call.start - lag <= end]
    checks: List[Check] = []
    pairs: List[CallPair] = []
    for service in sorted({call.service for call in ours + theirs}):
        some = [call for call in ours if call.service == service]
        others = [call for call in theirs if call.service == service]
        found, differences = _pair_service(some, others, lag, limits)
        pairs += found
        first = min(differences, key=lambda check: check.at or 0.0,
                    default=equal(Aspect.CALLS, service, "", True, "%d calls" % len(some)))
        if len(differences) > 1:
            first = replace(first, detail="%s; %d differences in all" % (first.detail, len(differences)))
        checks.append(first)
    if pairs:
        checks += _order_and_timing(pairs, lag, limits)
        checks += _response_checks(pairs, limits)
        checks.append(_duration_check(pairs, limits))
    return checks


def _entries(calls: Sequence[Call], limits: CallTolerance) -> List[Entry]:
    return [Entry((call.md5sum, call.request if limits.request == "exact" else b""), call.start) for call in calls]


def _outcome(call: Call) -> str:
    return "succeeded" if call.success else "failed: %s" % (call.error or "no reason given")


def _pair_service(ours: Sequence[Call], theirs: Sequence[Call], lag: float,
                  limits: CallTolerance) -> Tuple[List[CallPair], List[Check]]:
    """Pairs of the calls of one service, and what differs."""
    found: List[CallPair] = []
    differences: List[Check] = []

    def differs(call: Call, at: float, words: str, *values: str) -> None:
        differences.append(equal(Aspect.CALLS, call.service, "", False, "%s at %.2f s %s" % (call.words, at, words),
                                 at, *values))

    for i, j in pair(_entries(ours, limits), _entries(theirs, limits), lag):
        if i is not None and j is not None:
            one, other = ours[i], theirs[j]
            found.append(CallPair(one, other))
            if one.success != other.success:
                differs(one, one.start, _outcome(other), _outcome(one), _outcome(other))
        elif i is not None:
            differs(ours[i], ours[i].start, "is missing", ours[i].words, "no such call")
        elif j is not None:
            differs(theirs[j], theirs[j].start - lag, "is new", "no such call", theirs[j].words)
    return found, differences


def _order_and_timing(pairs: Sequence[CallPair], lag: float, limits: CallTolerance) -> List[Check]:
    late = max(pairs, key=lambda both: abs(both.candidate.start - lag - both.golden.start))
    off = late.candidate.start - lag - late.golden.start
    checks = [judged(Aspect.CALLS, "", "timing", abs(off), limits.timing_s, "s", "%s arrives %.3f s %s"
                     % (late.golden.words, abs(off), "later" if off > 0 else "sooner"), late.golden.start)]
    # A call that began after another had ended must do so again.
    latest = -math.inf
    swapped = None
    for both in sorted(pairs, key=lambda both: both.candidate.start):
        if latest > both.golden.end and swapped is None:
            swapped = both
        latest = max(latest, both.golden.start)
    checks.append(equal(Aspect.CALLS, "", "order", swapped is None, "calls come in the same order" if swapped is None
                        else "%s comes after a call that it came before" % swapped.golden.words,
                        None if swapped is None else swapped.golden.start))
    return checks


def _values(text: str) -> Dict[str, str]:
    """The top-level fields of a response as text, but for ``message``."""
    values: Dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        if line[:1].strip() and not line.startswith("-") and ":" in line:
            name, _, rest = line.partition(":")
            values[name] = rest.strip()
        elif name:
            values[name] += "\n" + line.strip()
    values.pop("message", None)
    return values


def _same_word(ours: str, theirs: str, absolute: float) -> bool:
    try:
        return ours == theirs or math.isclose(float(ours), float(theirs), rel_tol=0.0, abs_tol=absolute)
    except ValueError:
        return False


def _same_value(ours: str, theirs: str, absolute: float) -> bool:
    words_g, words_c = (re.sub(r"[][,]", " ", text).split() for text in (ours, theirs))
    return len(words_g) == len(words_c) and all(_same_word(*words, absolute) for words in zip(words_g, words_c))


def _same_response(ours: Call, theirs: Call, limits: CallTolerance) -> bool:
    if limits.response == "exact":
        return ours.response == theirs.response
    values_g, values_c = _values(ours.response_text), _values(theirs.response_text)
    return bool(ours.response) == bool(theirs.response) and set(values_g) == set(values_c) and all(
        _same_value(values_g[name], values_c[name], limits.value_absolute) for name in values_g)


def _response_checks(pairs: Sequence[CallPair], limits: CallTolerance) -> List[Check]:
    if limits.response == "ignore":
        return []
    wrong = [both for both in pairs if both.golden.success == both.candidate.success
             and not _same_response(both.golden, both.candidate, limits)]
    if not wrong:
        return [equal(Aspect.RESPONSES, "", "", True, "%d responses" % len(pairs))]
    first = min(wrong, key=lambda both: both.golden.start)
    return [equal(Aspect.RESPONSES, first.golden.service, "", False, "%s at %.2f s is answered differently, %d in all"
                  % (first.golden.words, first.golden.start, len(wrong)), first.golden.start,
                  *[" ".join(call.response_text.split()) or "no response" for call in first])]


def _duration_check(pairs: Sequence[CallPair], limits: CallTolerance) -> Check:
    def allowed(both: CallPair) -> float:
        return limits.duration_s + 0.01 * limits.duration_percent * both.golden.duration

    def excess(both: CallPair) -> float:
        return abs(both.candidate.duration - both.golden.duration) / max(allowed(both), 1e-9)

    worst = max(pairs, key=excess)
    return judged(Aspect.DURATIONS, worst.golden.service, "", abs(worst.candidate.duration - worst.golden.duration),
                  allowed(worst), "s", "%s takes %.3f s, %.3f s in the golden log"
                  % (worst.golden.words, worst.candidate.duration, worst.golden.duration), worst.golden.start,
                  "%.3f s" % worst.golden.duration, "%.3f s" % worst.candidate.duration)
