"""The tolerances of a candidate: the defaults, and YAML files that change them."""
import dataclasses
import difflib
import math
import re
import sys
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, Hashable, Mapping, Optional, Sequence, Tuple, Type, TypeVar

import yaml

from ..errors import BagError
from ..paths import PathLike
from ..yaml_text import BoundedLoader

_Section = TypeVar("_Section")
Rule = TypeVar("Rule")


Envelope = Tuple[Tuple[float, float], ...]
"""Pieces of a limit: a golden time, s, ascending, and the amount from there on, in the unit that the check shows.

The first amount holds before the first time, too.
"""


class ToleranceError(BagError):
    """A tolerance file that is not understood; the text names the file, the key and what is allowed there."""


def _number(default: float, doc: str) -> float:
    value: float = field(default=default, metadata={"doc": doc})
    return value


def _choice(default: str, allowed: Tuple[str, ...], doc: str) -> str:
    value: str = field(default=default, metadata={"doc": doc, "allowed": allowed})
    return value


@dataclass(frozen=True)
class StreamTolerance:
    """The limits for any topic, whatever it carries."""

    rate_percent: float = _number(7.0, "mean rate: off by this much, either way, of the golden rate")
    jitter_ms: float = _number(40.0, "99th percentile of |interval - mean interval|: more than the golden one by this")
    gap_s: float = _number(0.25, "a silence longer than this is a gap: both logs must have the same ones")
    gap_length_s: float = _number(0.5, "length of a gap: off by this much")
    lost_percent: float = _number(2.0, "messages that header.seq shows to be missing: more than the golden by this")
    latency_ms: float = _number(25.0, "median of log time - header.stamp: off from the golden one by this")
    repeated_percent: float = _number(40.0, "messages that repeat the stamp before: more than the golden share by this")
    count_percent: float = _number(0.0, "count of a topic that is not periodic: off by this much")


@dataclass(frozen=True)
class TimingTolerance:
    """The limits for times of events, after the lag that both logs have in common is taken out."""

    event_s: float = _number(0.25, "start of a motion, a change of state, a call: off by this much")
    jitter_ms: float = _number(100.0, "stamp of one sample: off by this much")
    cut_ms: float = _number(200.0, "a motion cut off (stop, end of a jog, emergency stop) ends so much sooner or later")
    pace_percent: float = _number(1.0, "duration of a motion, and of all together: off by this much")
    stale_ms: float = _number(20.0, "values while the arm moves: so much older or newer than their stamps, on average")
    wait_s: float = _number(0.2, "time from one call or motion to the next: off by this much")
    pace_floor_ms: float = _number(25.0, "duration of one motion: this much is always allowed")


@dataclass(frozen=True)
class JointTolerance:
    """Joint positions."""

    position_rad: float = _number(0.002, "each joint")
    outside_percent: float = _number(0.0, "share of the samples that may be outside")
    per_joint: Dict[str, float] = field(
        default_factory=dict, metadata={"doc": "joint name: rad, instead of position_rad"})


@dataclass(frozen=True)
class TcpTolerance:
    """Position and orientation of the tool centre point."""

    position_mm: float = _number(0.5, "distance between the two positions")
    orientation_rad: float = _number(0.003, "angle between the two orientations")
    outside_percent: float = _number(0.0, "share of the samples that may be outside")


@dataclass(frozen=True)
class StateTolerance:
    """Sequences of states."""

    brief_s: float = _number(0.12, "a state that lasts no longer may be missing in either log")
    timing_s: float = _number(0.25, "when a state changes: off by this much")


@dataclass(frozen=True)
class ContentTolerance:
    """Numbers that nothing above is about, in any topic: the largest of these limits counts."""

    range_percent: float = _number(10.0, "a number: off by this share of the range that it has in the golden log")
    value_percent: float = _number(1.0, "a number: off by this share of its largest golden amount")
    noise: float = _number(6.0, "a number: off by so many golden steps from sample to sample, up to half the range")
    absolute: float = _number(1e-6, "a number: this much is always allowed")
    brief_ms: float = _number(30.0, "topics on change: a value that lasts no longer may be missing in either log")


@dataclass(frozen=True)
class CallTolerance:
    """Service calls."""

    request: str = _choice("exact", ("exact", "ignore"), "exact: the same bytes; ignore: not compared")
    response: str = _choice("values", ("exact", "values", "ignore"), "values: all fields but message; exact: the bytes")
    value_absolute: float = _number(1e-4, "numbers in a response, with 'values': off by this much")
    duration_s: float = _number(0.25, "duration of a call: off by this much,")
    duration_percent: float = _number(2.0, "and this share of the golden duration")
    timing_s: float = _number(0.25, "when a call arrives: off by this much")


@dataclass(frozen=True)
class FieldTolerance:
    """One numeric field of any topic, instead of what ``ContentTolerance`` allows.

    Attributes:
        absolute: Allowed deviation in the field's own unit.
        relative: Allowed deviation as a share of the golden value.
        wraps: Differences are angles, taken in -pi to pi.
    """

    absolute: float = 0.0
    relative: float = 0.0
    wraps: bool = False


@dataclass(frozen=True)
class Tolerances:
    """All tolerances of a comparison.

    Attributes:
        ignore_topics: Regular expressions; a topic that one matches in full is left out.
        optional_topics: Regular expressions likewise; such a topic may be missing in either log.
        ignore_fields: Regular expressions for topic, blank and field; such a field is not compared.
        nan: ``same``: NaN only where the golden log has it; ``fail``: never; ``ignore``: not compared.
        fields: Tolerances by topic and field path, such as ``twist.linear.x``.
        envelopes: Limits along the golden log by topic and joint, ``position``, ``orientation`` or field path, instead
            of the one limit that they have else.
    """

    streams: StreamTolerance = StreamTolerance()
    timing: TimingTolerance = TimingTolerance()
    joints: JointTolerance = field(default_factory=JointTolerance)
    tcp: TcpTolerance = TcpTolerance()
    states: StateTolerance = StateTolerance()
    contents: ContentTolerance = ContentTolerance()
    calls: CallTolerance = CallTolerance()
    nan: str = _choice("same", ("same", "fail", "ignore"), "NaN: same as in the golden log, never, or not compared")
    ignore_topics: Tuple[str, ...] = ("/rosout", "/rosout_agg", "/clock", "(.*/)?diagnostics(_agg)?")
    optional_topics: Tuple[str, ...] = ()
    # the error of a trajectory is desired less actual, which are compared: its amount is that of their delay
    ignore_fields: Tuple[str, ...] = ("(.*/)?service_calls caller",
                                      r"(.*/)?(state|feedback_states|feedback) (feedback\.)?error\..*")
    fields: Dict[str, Dict[str, FieldTolerance]] = field(default_factory=dict)
    envelopes: Dict[str, Dict[str, Envelope]] = field(default_factory=dict)

    def ignores(self, topic: str) -> bool:
        """Return whether the topic is left out."""
        return any(re.fullmatch(p, topic) for p in self.ignore_topics)

    def ignores_field(self, topic: str, name: str) -> bool:
        """Return whether a field of a topic is left out."""
        return any(re.fullmatch(p, "%s %s" % (topic, name)) for p in self.ignore_fields)

    def is_optional(self, topic: str) -> bool:
        """Return whether the topic may be missing in either log."""
        return any(re.fullmatch(p, topic) for p in self.optional_topics)


_SECTIONS: Dict[str, Type[Any]] = {
    "streams": StreamTolerance, "timing": TimingTolerance, "joints": JointTolerance, "tcp": TcpTolerance,
    "states": StateTolerance, "contents": ContentTolerance, "calls": CallTolerance}

_MOST_BITS = 2000
"""Bits of the largest whole number that is read: Python shows none of more than 4,300 digits."""


class _UniqueKeys(BoundedLoader):
    """YAML in which a key given twice is an error, and a number that no error text could show."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        value = super().construct_object(node, deep)
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise yaml.constructor.ConstructorError(None, None, "a number of thousands of digits", node.start_mark)
        return value

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                raise yaml.constructor.ConstructorError(None, None, "a key is no text", key_node.start_mark)
            if key in seen:
                raise yaml.constructor.ConstructorError(None, None, "%r is given twice" % (key,), key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def _mapping(where: str, value: Any) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ToleranceError("%s: expected names with values, not %r" % (where, value))
    return value


def check_names(where: str, given: Mapping[Any, Any], known: Sequence[str], kind: Type[BagError]) -> None:
    """Raise ``kind`` where a key is not a known one; the text guesses which was meant."""
    for key in given:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1)
            hint = "did you mean %r?" % near[0] if near else "known are " + ", ".join(known)
            raise kind("%s: unknown key %r; %s" % (where, key, hint))


def _amount(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= sys.float_info.max:
        raise ToleranceError("%s: expected a number, 0 or more, not %r" % (where, value))
    return float(value)


def _word(where: str, value: Any, allowed: Tuple[str, ...]) -> str:
    if value not in allowed:
        raise ToleranceError("%s: expected one of %s, not %r" % (where, ", ".join(allowed), value))
    return str(value)


def _section(where: str, kind: Type[_Section], given: Mapping[str, Any]) -> _Section:
    fields = {item.name: item for item in dataclasses.fields(kind)}  # type: ignore[arg-type]
    check_names(where, given, list(fields), ToleranceError)
    values: Dict[str, Any] = {}
    for key, value in given.items():
        inner = "%s.%s" % (where, key)
        if key == "per_joint":
            values[key] = {name: _amount("%s.%s" % (inner, name), v) for name, v in _mapping(inner, value).items()}
        elif "allowed" in fields[key].metadata:
            values[key] = _word(inner, value, fields[key].metadata["allowed"])
        elif key == "wraps":
            if not isinstance(value, bool):
                raise ToleranceError("%s: expected true or false, not %r" % (inner, value))
            values[key] = value
        else:
            values[key] = _amount(inner, value)
    return kind(**values)


def _patterns(where: str, value: Any) -> Tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise ToleranceError("%s: expected a list of regular expressions, not %r" % (where, value))
    for pattern in value:
        try:
            re.compile(pattern)
        except re.error as error:
            raise ToleranceError("%s: %r is not a regular expression: %s" % (where, pattern, error)) from error
    return tuple(value)


def _envelope(where: str, value: Any) -> Envelope:
    if not isinstance(value, list) or not value or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise ToleranceError("%s: expected pairs of a time and a limit, as [[0, 0.001], [2.5, 0.002]], not %r"
                             % (where, value))
    steps = tuple((_amount(where + " time", time), _amount(where + " limit", limit)) for time, limit in value)
    for before, after in zip(steps, steps[1:]):
        if after[0] <= before[0]:
            raise ToleranceError("%s: time %g comes after %g; times ascend" % (where, after[0], before[0]))
    return steps


def _by_topic(where: str, value: Any, parse: Callable[[str, Any], Rule]) -> Dict[str, Dict[str, Rule]]:
    """Return what stands below each topic and field path, parsed."""
    return {topic: {path: parse("%s.%s.%s" % (where, topic, path), rule)
                    for path, rule in _mapping("%s.%s" % (where, topic), rules).items()}
            for topic, rules in _mapping(where, value).items()}


def parse_tolerances(text: str, name: str = "tolerances") -> Tolerances:
    """Parse tolerances from YAML text; a missing one keeps its default.

    Raises:
        ToleranceError: The text is not YAML, or has an unknown or repeated key or a value of the wrong type or range.
    """
    try:
        document = yaml.load(text, _UniqueKeys)
    except (yaml.YAMLError, ValueError) as error:  # a date that is none raises ValueError
        raise ToleranceError("%s: %s" % (name, " ".join(str(error).split()))) from error
    given = _mapping(name, document)
    check_names(name, given, [item.name for item in dataclasses.fields(Tolerances)], ToleranceError)
    values: Dict[str, Any] = {}
    for key, value in given.items():
        where = "%s: %s" % (name, key)
        if key in _SECTIONS:
            values[key] = _section(where, _SECTIONS[key], _mapping(where, value))
        elif key == "nan":
            values[key] = _word(where, value, ("same", "fail", "ignore"))
        elif key == "fields":
            values[key] = _by_topic(where, value, lambda inner, rule: _section(
                inner, FieldTolerance, _mapping(inner, rule)))
        elif key == "envelopes":
            values[key] = _by_topic(where, value, _envelope)
        else:
            values[key] = _patterns(where, value)
    return Tolerances(**values)


def load_tolerances(path: Optional[PathLike]) -> Tolerances:
    """Load tolerances from a YAML file; None gives the defaults.

    Raises:
        ToleranceError: The file cannot be read or is invalid.
    """
    if path is None:
        return Tolerances()
    try:
        with open(str(path), encoding="utf-8") as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ToleranceError("cannot read %s: %s" % (path, reason)) from error
    return parse_tolerances(text, str(path))


def _number_text(value: float) -> str:
    text = "%g" % value
    if float(text) != value:
        text = "%r" % value
    return text if "e" not in text or "." in text else text.replace("e", ".0e")  # YAML takes 1e-06 for a text


def _quoted(text: str) -> str:
    return str(yaml.safe_dump(text, default_style='"', width=math.inf)).strip()


def _name_text(name: str) -> str:
    return name if re.fullmatch(r"/[A-Za-z0-9_/]+", name) else _quoted(name)


def _pattern_text(pattern: str) -> str:
    """Return a pattern in single quotes, in which backslashes stay what they are, unless it has odd characters."""
    is_plain = pattern.isascii() and pattern.isprintable()
    return "'%s'" % pattern.replace("'", "''") if is_plain else _quoted(pattern)


def as_yaml(tolerances: Tolerances) -> str:
    """Return the tolerances as a YAML file with a comment at each key; ``parse_tolerances`` reads it."""
    lines = ["# Tolerances of jaka_bag compare; what is left out keeps its default."]
    for name, kind in _SECTIONS.items():
        lines += ["", "%s:  # %s" % (name, (kind.__doc__ or "").rstrip("."))]
        section = getattr(tolerances, name)
        for item in dataclasses.fields(kind):
            value = getattr(section, item.name)
            shown = "{%s}" % ", ".join(
                "%s: %s" % (_quoted(joint), _number_text(limit)) for joint, limit in value.items()) \
                if item.name == "per_joint" else value if isinstance(value, str) else _number_text(value)
            lines.append("  %s: %s  # %s" % (item.name, shown, item.metadata["doc"]))
    lines += ["", "nan: %s  # same, fail or ignore" % tolerances.nan,
              "ignore_topics:  # regular expressions for whole names"]
    lines += ["  - " + _pattern_text(pattern) for pattern in tolerances.ignore_topics] or ["  []"]
    lines += ["optional_topics: [%s]" % ", ".join(map(_pattern_text, tolerances.optional_topics)),
              "ignore_fields: [%s]  # regular expressions for topic, blank and field" % ", ".join(
                  map(_pattern_text, tolerances.ignore_fields)),
              "# Numeric fields with limits of their own, by topic and field path:",
              "# fields:", "#   /left/force:", "#     wrench.force.z: {absolute: 0.5, relative: 0.01, wraps: false}"]
    if tolerances.fields:
        fields = {"fields": dataclasses.asdict(tolerances)["fields"]}
        lines.append(yaml.safe_dump(fields, default_flow_style=None, sort_keys=False).rstrip())
    if tolerances.envelopes:
        lines += ["# Limits along the golden log, by topic and joint, position (mm), orientation (rad) or field path:",
                  "# [from this golden time, s, limit]; a check that has one has no other limit.", "envelopes:"]
    for topic, envelopes in tolerances.envelopes.items():
        lines.append("  %s:" % _name_text(topic))
        lines += ["    %s: [%s]" % (_quoted(name), ", ".join("[%s, %s]" % tuple(map(_number_text, step))
                                                                for step in envelope))
                  for name, envelope in envelopes.items()]
    return "\n".join(lines) + "\n"
