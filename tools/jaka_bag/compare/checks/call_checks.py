"""Service calls: the same ones with the same requests and success, in time; their responses; their durations."""
import math
import re
from dataclasses import replace
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array
from ..matching.alignment import Alignment
from ..matching.course import Decision
from ..matching.sequences import Entry, pair
from ..runs.call_text import changed_fields, top_level_fields
from ..runs.run import Call, Run
from ..tolerances import CallTolerance, Tolerances
from ..verdict import Aspect, Check, equal, judged
from .timing_checks import wait_checks


class CallPair(NamedTuple):
    """The same call in both logs."""

    golden: Call
    candidate: Call


def call_checks(golden: Run, candidate: Run, alignment: Alignment, tolerances: Tolerances,
                common: Tuple[float, float], outer: Decision) -> List[Check]:
    """Check the calls of all services; return no checks where neither log has calls.

    Args:
        golden: The golden log.
        candidate: The candidate.
        alignment: Alignment of both logs.
        tolerances: Limits for deviations.
        common: Golden times between which both logs have messages, s; calls outside of it are not compared.
        outer: Decides whether a call at most so far, s, outside of ``common`` is compared nevertheless.
    """
    limits = tolerances.calls
    lag = alignment.lag
    ours = _inside(golden.calls, 0.0, common, outer)
    theirs = _inside(candidate.calls, lag, common, outer)
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
        events = sorted((both.golden.start, both.candidate.start - both.golden.start, both.golden.short_name)
                        for both in pairs)
        checks += wait_checks("", "waits of calls", events, tolerances.timing)
        checks += _response_checks(pairs, limits)
        checks.append(_duration_check(pairs, limits))
    return checks


def _inside(calls: Sequence[Call], lag: float, common: Tuple[float, float], outer: Decision) -> List[Call]:
    starts = np.array([call.start for call in calls]) - lag
    outside: Array = np.maximum(common[0] - starts, starts - common[1])
    is_inside = outside <= 0
    is_inside[~is_inside] = outer.within(outside[~is_inside])
    return [call for call, wanted in zip(calls, is_inside.tolist()) if wanted]


def _entries(calls: Sequence[Call], limits: CallTolerance) -> List[Entry]:
    return [Entry(call.meaning if limits.request == "exact" else (call.meaning[0], b""), call.start) for call in calls]


def _outcome(call: Call) -> str:
    return "succeeded" if call.success else "failed: %s" % (call.error or "no reason given")


def _without_numbers(text: str) -> str:
    """Return the text of an error without amounts, which change from run to run."""
    return re.sub(r"\d+(\.\d+)?", "#", text)


def _pair_service(ours: Sequence[Call], theirs: Sequence[Call], lag: float,
                  limits: CallTolerance) -> Tuple[List[CallPair], List[Check]]:
    """Pair the calls of one service; return the pairs and a check for each difference.

    Calls that stand alone between two pairs are told as one with a changed request, where each log has one.
    """
    found: List[CallPair] = []
    differences: List[Check] = []

    def differs(call: Call, at: float, words: str, *values: str) -> None:
        differences.append(equal(Aspect.CALLS, call.service, "", False, words, at, *values))

    def is_changed(call: Call, words: str, *values: str) -> None:
        differs(call, call.start, "%s at %.2f s %s" % (call.words, call.start, words), *values)

    places: List[Tuple[int, int]] = []
    for i, j in pair(_entries(ours, limits), _entries(theirs, limits), lag):
        if i is None or j is None:
            continue
        places.append((i, j))
        one, other = ours[i], theirs[j]
        found.append(CallPair(one, other))
        if one.success != other.success or _without_numbers(one.error) != _without_numbers(other.error):
            is_changed(one, _outcome(other), _outcome(one), _outcome(other))
        if one.service_type != other.service_type:
            is_changed(one, "has another type", one.service_type, other.service_type)
        if one.request == other.request and one.request_text != other.request_text:
            is_changed(one, "is told in other words", one.request_text, other.request_text)
        if one.response == other.response and one.response_text != other.response_text:
            is_changed(one, "has the same response in other words", one.response_text, other.response_text)
    for gone, come in _between(places, ours, theirs, lag):
        if gone is not None and come is not None:
            differs(gone, gone.start, "%s at %.2f s asks for something else: %s" % (
                gone.short_name, gone.start, changed_fields(
                    gone.request_text, come.request_text, gone.short_name)),
                gone.words, come.words)
        elif gone is not None:
            differs(gone, gone.start, "%s at %.2f s is missing" % (gone.words, gone.start), gone.words, "no such call")
        elif come is not None:
            at = come.start - lag
            differs(come, at, "%s at %.2f s is new" % (come.words, at), "no such call", come.words)
    return found, differences


def _between(places: Sequence[Tuple[int, int]], ours: Sequence[Call], theirs: Sequence[Call], lag: float
             ) -> List[Tuple[Optional[Call], Optional[Call]]]:
    """Pair the calls between the places of equal ones, in order and by nearness; None where one stands alone."""
    result: List[Tuple[Optional[Call], Optional[Call]]] = []
    first_g = first_c = 0
    for end_g, end_c in [*places, (len(ours), len(theirs))]:
        gone, come = ours[first_g:end_g], theirs[first_c:end_c]
        result += [(None if i is None else gone[i], None if j is None else come[j]) for i, j in pair(
            [Entry(call.meaning[0], call.start) for call in gone],
            [Entry(call.meaning[0], call.start) for call in come], lag)]
        first_g, first_c = end_g + 1, end_c + 1
    return result


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


def _off(ours: str, theirs: str) -> float:
    """Return the deviation of a number in a response from the golden one; infinite for different text."""
    if ours == theirs:
        return 0.0
    try:
        golden, candidate = float(ours), float(theirs)
    except ValueError:
        return math.inf
    off = 0.0 if golden == candidate else abs(golden - candidate)
    return off if off == off else math.inf


def _value_off(ours: str, theirs: str) -> float:
    words_g, words_c = (re.sub(r"[][,]", " ", text).split() for text in (ours, theirs))
    return max(map(_off, words_g, words_c), default=0.0) if len(words_g) == len(words_c) else math.inf


def _response_off(ours: Call, theirs: Call, limits: CallTolerance) -> float:
    """Return the largest deviation of a response's numbers; infinite where something else differs."""
    if limits.response == "exact":
        return 0.0 if ours.response == theirs.response else math.inf
    values_g, values_c = (top_level_fields(call.response_text) for call in (ours, theirs))
    for values in (values_g, values_c):
        values.pop("message", None)
    if bool(ours.response) != bool(theirs.response) or set(values_g) != set(values_c):
        return math.inf
    return max((_value_off(values_g[name], values_c[name]) for name in values_g), default=0.0)


def _response_checks(pairs: Sequence[CallPair], limits: CallTolerance) -> List[Check]:
    if limits.response == "ignore":
        return []
    offs = [_response_off(both.golden, both.candidate, limits) if both.golden.success == both.candidate.success else 0.0
            for both in pairs]
    worst = max(offs)
    wrong = [both for both, off in zip(pairs, offs) if off > limits.value_absolute]
    if not wrong:
        return [judged(Aspect.RESPONSES, "", "", worst, limits.value_absolute, "", "%d responses" % len(pairs))]
    first = min(wrong, key=lambda both: both.golden.start)
    words = "%s at %.2f s is answered differently, %d in all" % (first.golden.words, first.golden.start, len(wrong))
    golden, candidate = (" ".join(call.response_text.split()) or "no response" for call in first)
    if math.isinf(worst):
        return [equal(Aspect.RESPONSES, first.golden.service, "", False, words, first.golden.start, golden,
                      candidate)]
    return [judged(Aspect.RESPONSES, first.golden.service, "", worst, limits.value_absolute, "", words,
                   first.golden.start, golden, candidate)]


def _worst_durations(pairs: Sequence[CallPair]) -> Tuple[Tuple[float, float], ...]:
    """Return (deviation, s, duration of the golden call, s) of the calls that no shorter call exceeds."""
    worst: List[Tuple[float, float]] = []
    for length, off in sorted((both.golden.duration, -abs(both.candidate.duration - both.golden.duration))
                              for both in pairs):
        if not worst or -off > worst[-1][0]:
            worst.append((-off, length))
    return tuple(worst)


def allowed_duration(golden_s: float, limits: CallTolerance) -> float:
    """Return the allowed deviation, s, of the duration of a call that takes ``golden_s``."""
    return limits.duration_s + 0.01 * limits.duration_percent * golden_s


def _duration_check(pairs: Sequence[CallPair], limits: CallTolerance) -> Check:
    def excess(both: CallPair) -> float:
        return abs(both.candidate.duration - both.golden.duration) / max(
            allowed_duration(both.golden.duration, limits), 1e-9)

    worst = max(pairs, key=excess)
    return judged(Aspect.DURATIONS, worst.golden.service, "", abs(worst.candidate.duration - worst.golden.duration),
                  allowed_duration(worst.golden.duration, limits), "s", "%s takes %.3f s, %.3f s in the golden log"
                  % (worst.golden.words, worst.candidate.duration, worst.golden.duration), worst.golden.start,
                  "%.3f s" % worst.golden.duration, "%.3f s" % worst.candidate.duration, _worst_durations(pairs))
