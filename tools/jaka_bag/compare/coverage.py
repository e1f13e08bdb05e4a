"""The share of two logs that a comparison reads: what nothing compares is named."""
from typing import Collection, Dict, List

from .checks.content_checks import is_of_any_speed
from .runs.contents import AGE, NUMBERS
from .runs.run import Run
from .tolerances import Tolerances
from .verdict import Coverage, Gap


def coverage_of(golden: Run, candidate: Run, tolerances: Tolerances, comparable: Collection[str],
                on_change: Collection[str], time_scale: float) -> Coverage:
    """Return the coverage of a comparison.

    Args:
        golden: The golden log.
        candidate: The candidate.
        tolerances: Tolerances of the comparison.
        comparable: Topics that both logs have, with the same types.
        on_change: Topics that are published on change.
        time_scale: The candidate ran this many times faster.
    """
    gaps: List[Gap] = []
    topics = sorted({*golden.streams, *candidate.streams, *golden.ignored, *candidate.ignored})
    calls = {call.topic for call in golden.calls + candidate.calls}
    fields = 0
    for topic in topics:
        handled = {**candidate.contents[topic].handled, **golden.contents[topic].handled} \
            if topic in golden.contents and topic in candidate.contents else None
        if topic in golden.ignored or topic in candidate.ignored:
            gaps.append(Gap(topic, "", "ignore_topics"))
        elif topic not in comparable:
            gaps.append(Gap(topic, "", "not in both logs with one type"))
        elif handled is None:
            gaps.append(Gap(topic, "", "contents not read"))
        else:
            fields += len(handled) + (topic in calls and tolerances.calls.response == "values")
            gaps += _field_gaps(topic, handled, tolerances, topic in calls, topic in on_change, time_scale)
    return Coverage(len(topics), fields, tuple(gaps))


def _field_gaps(topic: str, handled: Dict[str, str], tolerances: Tolerances, is_calls: bool, is_on_change: bool,
                time_scale: float) -> List[Gap]:
    gaps: List[Gap] = []
    limits = tolerances.calls
    for name, how in handled.items():
        if tolerances.ignores_field(topic, name):
            gaps.append(Gap(topic, name, "ignore_fields", True))
        elif not how:
            gaps.append(Gap(topic, name, "no check is about it"))
        elif how == AGE and is_on_change:
            gaps.append(Gap(topic, name, "a time, in messages published on change"))
        elif how == NUMBERS and time_scale != 1.0 and not is_of_any_speed(name):
            gaps.append(Gap(topic, name, "may change with speed"))
        elif is_calls and name == "request" and limits.request == "ignore":
            gaps.append(Gap(topic, name, "calls.request: ignore"))
        elif is_calls and name == "response" and limits.response == "ignore":
            gaps.append(Gap(topic, name, "calls.response: ignore"))
    if is_calls and limits.response == "values":
        gaps.append(Gap(topic, "message of responses", "calls.response: values", True))
    return gaps
