"""The report of a probe: text for the reader, JSON for scripts, and what differs between two of them."""
import json
import textwrap
from types import MappingProxyType
from typing import Any, Dict, List, Mapping, Sequence

from jaka_ros_driver import __version__
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.probe.facts import DESCRIBED, Fact, Facts, ProbeStage
from jaka_ros_driver.probe.fields import TABLES, different_types, is_table
from jaka_ros_driver.probe.statements import STATEMENTS, Verdict, verdicts
from jaka_ros_driver.simulation.dialect.dimension import FIRMWARE_NAMES, Choice, Range, Subset
from jaka_ros_driver.simulation.dialect.like import LONGEST_REPORT, REPORT_FORMAT
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect

_WIDTH = 110
"""Columns of the report, which terminals and letters have."""
_LARGEST = 1e12
"""Largest number in a fact: no quantity of an arm is larger."""
_LESS_THAN = {"feed_period": 0.002, "frame_bytes": 0.05, "start_delay": 0.15, "servo_leave_delay": 0.02,
              "link_loss_notice": 0.3, "move_acceleration": 0.1, "move_jerk_time": 0.05, "shortest_feed_period": 0.0075}
"""Differences that are chance: of times, s; of a length, as a share; of an acceleration, in times what was asked."""


class ReportError(JakaError):
    """A report that cannot be read."""


def as_json(facts: Facts, stages: Sequence[ProbeStage], is_whole: bool, left: Sequence[str] = (),
            curves: Mapping[str, Any] = MappingProxyType({})) -> Dict[str, Any]:
    """Return the content of probe.json.

    Args:
        facts: By name.
        stages: Those that were begun.
        is_whole: All of them ran to their ends.
        left: A line for each value that could not be set back.
        curves: By name, points of a motion: s, deg.
    """
    return {
        "format": REPORT_FORMAT, "made_by": "jaka_probe %s" % __version__, "stages": [stage.value for stage in stages],
        "is_whole": is_whole, "not_set_back": list(left), "firmware": firmware_of(facts),
        "curves": dict(curves), "dialect": dialect_of(facts),
        "facts": {name: dict(facts[name]._asdict(), unit=DESCRIBED[name].unit, meaning=DESCRIBED[name].meaning)
                  for name in DESCRIBED if name in facts},
        "statements": {number: {"verdict": verdict.value, "says": STATEMENTS[number].says}
                       for number, verdict in verdicts(facts).items()}}


def dialect_of(facts: Facts) -> Dict[str, Any]:
    """Return what the settled facts say of a dialect, as ``Dialect.from_file`` reads it.

    A number beyond the ends of its dimension becomes the end, and one between those that it has the nearest; names that
    the simulated controller cannot leave out are left out.
    """
    found: Dict[str, Any] = {}
    for name, fact in facts.items():
        dimension = DIMENSIONS.get(DESCRIBED[name].dimension)
        if dimension is None or fact.value is None:
            continue
        value: Any = bool(fact.value) if name.endswith("_unknown") else fact.value
        if isinstance(dimension, Range):
            value = min(max(value, dimension.low), dimension.high)
        elif isinstance(dimension, Choice) and type(value) is int:
            value = min(dimension.values, key=lambda one: abs(one - value))
        elif isinstance(dimension, Subset):
            value = [one for one in dimension.names if one in value]
        found[DESCRIBED[name].dimension] = value
    return found


def read(path: str) -> Dict[str, Any]:
    """Return the content of a probe.json; raise ReportError where it is none."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(LONGEST_REPORT + 1)
        content = json.loads(text) if len(text) <= LONGEST_REPORT else None
    except (OSError, ValueError, RecursionError) as error:
        raise ReportError("%s: %s" % (path, error)) from error
    if not isinstance(content, dict) or content.get("format") != REPORT_FORMAT or not isinstance(
            content.get("facts"), dict):
        raise ReportError("%s is no probe.json of format %d" % (path, REPORT_FORMAT))
    return content


def facts_of(content: Mapping[str, Any]) -> Facts:
    """Return the facts in a probe.json; raise ReportError where one is none, or its value is of another kind."""
    try:
        facts = {name: Fact(row["value"], str(row["how"]), str(row.get("spread", "")))
                 for name, row in content["facts"].items() if name in DESCRIBED}
    except (TypeError, KeyError, AttributeError) as error:
        raise ReportError("a fact of this probe.json cannot be read: %r" % error) from error
    for name, fact in facts.items():
        kind = "" if fact.value is None else _other_kind(name, fact.value)
        if kind:
            raise ReportError("the fact %s of this probe.json is %.60r; it must be %s" % (name, fact.value, kind))
    return facts


def _other_kind(name: str, value: Any) -> str:
    """Return what kind of value a fact must have; "" where this is one. Which one of the kind it is does not matter."""
    if name in TABLES:
        return "" if is_table(name, value) else "a table of types"
    dimension = DIMENSIONS.get(DESCRIBED[name].dimension)
    if DESCRIBED[name].unit or isinstance(dimension, Range):
        return "" if type(value) in (int, float) and abs(value) <= _LARGEST else "a number"
    if isinstance(dimension, Subset) or name.endswith("_unknown"):
        return "" if type(value) is list and all(type(one) is str for one in value) else "a list of names"
    if isinstance(dimension, Choice):
        kind = type(dimension.values[0])
        return "" if type(value) is kind else {bool: "true or false", int: "a whole number"}.get(kind, "a text")
    return ""


def firmware_of(facts: Facts) -> str:
    """Return the simulated generation that is nearest to the version that the controller tells; "" for none."""
    version = facts.get("version", Fact(None, "")).value
    for name in sorted(FIRMWARE_NAMES, key=len, reverse=True):
        if isinstance(version, str) and version.startswith(name):
            return name
    return ""


def left_of(content: Mapping[str, Any]) -> List[str]:
    """Return what could not be set back, by a probe.json."""
    left = content.get("not_set_back", [])
    return [str(line) for line in left] if isinstance(left, list) else []


def text(facts: Facts, left: Sequence[str] = ()) -> List[str]:
    """Return the lines of the report; what could not be set back, ``left``, is said first."""
    lines: List[str] = []
    if left:
        lines += ["NOT SET BACK", "", *(row for line in left for row in _wrapped(line)), ""]
    settled = {name: fact for name, fact in facts.items() if fact.value is not None}
    lines += ["Settled", ""]
    for name in DESCRIBED:
        if name in settled:
            lines += _fact_lines(name, settled[name])
    if "twin_angle" in settled and "twin_time" in settled:
        lines += ["", *_wrapped("This twin is within %.3f deg and %.0f ms of your arm, in %s" % (
            settled["twin_angle"].value, 1000.0 * settled["twin_time"].value, settled["twin_angle"].how))]
    open_ones = [name for name in DESCRIBED if name in facts and name not in settled]
    if open_ones:
        lines += ["", "Not settled", ""]
        for name in open_ones:
            lines += _wrapped("%s: %s" % (DESCRIBED[name].meaning, facts[name].how))
    firmware = firmware_of(facts)
    if firmware:
        lines += ["", "Otherwise than the simulated controller of firmware %s" % firmware, ""]
        lines += [row for line in differences(facts, firmware) for row in _wrapped(line)] or [
            "  nothing that was looked for"]
    return lines + _statement_lines(facts)


def _statement_lines(facts: Facts) -> List[str]:
    """Return a line for each statement that is contradicted or confirmed, and one that counts the others."""
    judged = verdicts(facts)
    lines = ["", "Statements of docs/controller-protocol.md", ""]
    for verdict in (Verdict.CONTRADICTED, Verdict.CONFIRMED):
        for number, one in STATEMENTS.items():
            if judged[number] is verdict:
                lines += _wrapped("%s %s: %s (section %s, [%s]); found: %s" % (
                    number, verdict.value, one.says, one.section, one.tag,
                    "; ".join(words(facts[name].value) for name in one.facts)))
    unseen = [number for number in STATEMENTS if judged[number] is Verdict.NOT_SEEN]
    return lines + (_wrapped("%s: %s" % (Verdict.NOT_SEEN.value, ", ".join(unseen))) if unseen else [])


def _fact_lines(name: str, fact: Fact) -> List[str]:
    described = DESCRIBED[name]
    value = " ".join(filter(None, [words(fact.value), described.unit]))
    return _wrapped("%s: %s  (%s)" % (described.meaning, value, "; ".join(filter(None, [fact.how, fact.spread]))))


def _wrapped(line: str) -> List[str]:
    return textwrap.wrap(line, _WIDTH, initial_indent="  ", subsequent_indent="      ", break_long_words=False,
                         break_on_hyphens=False)


def words(value: Any) -> str:
    """Return a value for the reader; of a table, how many rows it has."""
    if isinstance(value, dict):
        return "%d, in probe.html and probe.json" % len(value)
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value)) if value else "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "not settled" if value is None else "%s" % value


def differences(facts: Facts, firmware: str) -> List[str]:
    """Return a line for each settled dimension that is otherwise than in this firmware's simulated controller."""
    usual = Dialect.default(firmware).as_dict()
    lines: List[str] = []
    for key, value in dialect_of(facts).items():
        expected = usual[key]
        if key == "frame_bytes" and not expected:
            continue  # 0: as long as its fields are
        if key in _LESS_THAN and abs(value - expected) <= _LESS_THAN[key]:
            continue
        if key == "missing_commands" and set(value) <= set(expected):
            continue  # not all of them are asked
        if value != expected:
            lines.append("%s: %s, there %s (%s)" % (key, words(value), words(expected), DIMENSIONS[key].meaning))
    return lines


def difference(one: Facts, other: Facts) -> List[str]:
    """Return a line for each fact that two probes do not share; none for what only varies by chance."""
    lines: List[str] = []
    for name in DESCRIBED:
        a, b = (facts.get(name, Fact(None, "")).value for facts in (one, other))
        if name in TABLES and isinstance(a, dict) and isinstance(b, dict):
            lines += [row for line in different_types(name, a, b)
                      for row in _wrapped("%s: %s" % (DESCRIBED[name].meaning, line))]
        elif a != b and not _is_chance(name, a, b):
            lines += _wrapped("%s: %s and %s" % (DESCRIBED[name].meaning, words(a), words(b)))
    return lines


def _is_chance(name: str, a: Any, b: Any) -> bool:
    if DESCRIBED[name].unit and isinstance(a, (int, float)) and isinstance(b, (int, float)):
        if name in ("feed_period", "feed_period_told", "feed_period_asked", "frame_bytes"):
            return abs(a - b) <= max(0.05 * max(a, b), 0.0005)
        if name in _LESS_THAN:
            return abs(a - b) <= _LESS_THAN[name]
        if DESCRIBED[name].stage is ProbeStage.MOVE:
            return abs(a - b) <= max(0.25 * max(abs(a), abs(b)), 0.05)
        return True  # times of replies and pauses are those of the host, too
    return False
