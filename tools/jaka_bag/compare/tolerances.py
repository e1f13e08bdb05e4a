"""The tolerances of a candidate: the defaults, and YAML files that change them."""
import dataclasses
import difflib
import math
import re
from dataclasses import dataclass, field
from typing import Any, Dict, Hashable, Mapping, Optional, Sequence, Tuple, Type, TypeVar

import yaml

from ..errors import BagError
from ..paths import PathLike

Section = TypeVar("Section")


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

    rate_percent: float = _number(25.0, "mean rate: off by this much, either way, of the golden rate")
    jitter_ms: float = _number(75.0, "99th percentile of |interval - mean interval|: more than the golden one by this")
    gap_s: float = _number(0.5, "a silence longer than this is a gap: both logs must have the same ones")
    gap_length_s: float = _number(1.0, "length of a gap: off by this much")
    lost_percent: float = _number(2.0, "messages that header.seq shows to be missing: more than the golden by this")
    latency_ms: float = _number(75.0, "median of log time - header.stamp: off from the golden one by this")
    repeated_percent: float = _number(40.0, "messages that repeat the stamp before: more than the golden share by this")
    count_percent: float = _number(0.0, "count of a topic that is not periodic: off by this much")


@dataclass(frozen=True)
class TimingTolerance:
    """The limits for times of events, after the lag that both logs have in common is taken out."""

    event_s: float = _number(0.4, "start of a motion, a change of state, a call: off by this much")
    jitter_ms: float = _number(100.0, "stamp of one sample: off by this much")
    cut_ms: float = _number(200.0, "a motion cut off (stop, end of a jog, emergency stop) ends so much sooner or later")
    pace_percent: float = _number(1.0, "duration of a motion, and of all together: off by this much")
    pace_floor_ms: float = _number(60.0, "duration of one motion: this much is always allowed")


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
    timing_s: float = _number(0.5, "when a state changes: off by this much")


@dataclass(frozen=True)
class CallTolerance:
    """Service calls."""

    request: str = _choice("exact", ("exact", "ignore"), "exact: the same bytes; ignore: not compared")
    response: str = _choice("values", ("exact", "values", "ignore"), "values: all fields but message; exact: the bytes")
    value_absolute: float = _number(1e-4, "numbers in a response, with 'values': off by this much")
    duration_s: float = _number(0.5, "duration of a call: off by this much,")
    duration_percent: float = _number(2.0, "and this share of the golden duration")
    timing_s: float = _number(0.5, "when a call arrives: off by this much")


@dataclass(frozen=True)
class FieldTolerance:
    """One numeric field of a topic that is no part of the driver's interface.

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
        nan: ``same``: NaN only where the golden log has it; ``fail``: never; ``ignore``: not compared.
        fields: Tolerances by topic and field path, such as ``twist.linear.x``.
    """

    streams: StreamTolerance = StreamTolerance()
    timing: TimingTolerance = TimingTolerance()
    joints: JointTolerance = field(default_factory=JointTolerance)
    tcp: TcpTolerance = TcpTolerance()
    states: StateTolerance = StateTolerance()
    calls: CallTolerance = CallTolerance()
    nan: str = _choice("same", ("same", "fail", "ignore"), "NaN: same as in the golden log, never, or not compared")
    ignore_topics: Tuple[str, ...] = ("/rosout", "/rosout_agg", "/clock", "(.*/)?diagnostics(_agg)?")
    optional_topics: Tuple[str, ...] = ()
    fields: Dict[str, Dict[str, FieldTolerance]] = field(default_factory=dict)

    def ignores(self, topic: str) -> bool:
        """Return whether the topic is left out."""
        return any(re.fullmatch(p, topic) for p in self.ignore_topics)

    def is_optional(self, topic: str) -> bool:
        """Return whether the topic may be missing in either log."""
        return any(re.fullmatch(p, topic) for p in self.optional_topics)


_SECTIONS: Dict[str, Type[Any]] = {
    "streams": StreamTolerance, "timing": TimingTolerance, "joints": JointTolerance, "tcp": TcpTolerance,
    "states": StateTolerance, "calls": CallTolerance}


class _UniqueKeys(yaml.SafeLoader):
    """YAML in which a key given twice is an error."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
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
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value < 0:
        raise ToleranceError("%s: expected a number, 0 or more, not %r" % (where, value))
    return float(value)


def _word(where: str, value: Any, allowed: Tuple[str, ...]) -> str:
    if value not in allowed:
        raise ToleranceError("%s: expected one of %s, not %r" % (where, ", ".join(allowed), value))
    return str(value)


def _section(where: str, kind: Type[Section], given: Mapping[str, Any]) -> Section:
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


def parse_tolerances(text: str, name: str = "tolerances") -> Tolerances:
    """Parse tolerances from YAML text; a missing one keeps its default.

    Raises:
        ToleranceError: The text is not YAML, or has an unknown or repeated key or a value of the wrong type or range.
    """
    try:
        document = yaml.load(text, _UniqueKeys)
    except yaml.YAMLError as error:
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
            values[key] = {topic: {path: _section("%s.%s.%s" % (where, topic, path), FieldTolerance,
                                                  _mapping("%s.%s.%s" % (where, topic, path), rule))
                                   for path, rule in _mapping("%s.%s" % (where, topic), rules).items()}
                           for topic, rules in _mapping(where, value).items()}
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


def as_yaml(tolerances: Tolerances) -> str:
    """Return the tolerances as a YAML file with a comment at each key; ``parse_tolerances`` reads it."""
    lines = ["# Tolerances of jaka_bag compare; what is left out keeps its default."]
    for name, kind in _SECTIONS.items():
        lines += ["", "%s:  # %s" % (name, (kind.__doc__ or "").rstrip("."))]
        section = getattr(tolerances, name)
        for item in dataclasses.fields(kind):
            value = getattr(section, item.name)
            shown = "{%s}" % ", ".join("%s: %s" % pair for pair in value.items()) if item.name == "per_joint" \
                else value if isinstance(value, str) else "%g" % value
            lines.append("  %s: %s  # %s" % (item.name, shown, item.metadata["doc"]))
    lines += ["", "nan: %s  # same, fail or ignore" % tolerances.nan,
              "ignore_topics:  # regular expressions for whole names"]
    lines += ["  - '%s'" % pattern for pattern in tolerances.ignore_topics] or ["  []"]
    lines += ["optional_topics: [%s]" % ", ".join("'%s'" % p for p in tolerances.optional_topics),
              "# Further numeric fields, by topic and field path:",
              "# fields:", "#   /left/force:", "#     wrench.force.z: {absolute: 0.5, relative: 0.01, wraps: false}"]
    if tolerances.fields:
        fields = {"fields": dataclasses.asdict(tolerances)["fields"]}
        lines.append(yaml.safe_dump(fields, default_flow_style=None, sort_keys=False).rstrip())
    return "\n".join(lines) + "\n"
