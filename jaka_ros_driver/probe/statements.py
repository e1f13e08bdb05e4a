"""Statements of docs/controller-protocol.md that a probe confirms or contradicts, each with an id that never changes.

Where sources contradict each other, each of their statements has a row. The table in section 15 of that page is made
of this one.
"""
import enum
import re
from typing import Any, Callable, Counter, Dict, List, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.probe.facts import Facts


class Verdict(enum.Enum):
    """The judgement of one probe on one statement."""

    CONFIRMED = "confirmed"
    CONTRADICTED = "contradicted"
    NOT_SEEN = "not seen"


class Statement(NamedTuple):
    """One statement.

    Attributes:
        says: The statement.
        tag: How sure it is, by section 0.1 of the page.
        section: Where it stands.
        facts: Names of the facts that settle it, all of which it needs.
        is_so: Takes their values; returns whether they agree, None where they do not tell.
    """

    says: str
    tag: str
    section: str
    facts: Tuple[str, ...]
    is_so: Callable[..., Optional[bool]]

    def verdict(self, facts: Facts) -> Verdict:
        """Return what the facts of a probe say of it."""
        values = [facts[name].value for name in self.facts if name in facts and facts[name].value is not None]
        if len(values) < len(self.facts):
            return Verdict.NOT_SEEN
        try:
            agrees = self.is_so(*values)
        except (TypeError, ValueError, AttributeError):  # a value of another type, in a report from elsewhere
            return Verdict.NOT_SEEN
        return Verdict.NOT_SEEN if agrees is None else Verdict.CONFIRMED if agrees else Verdict.CONTRADICTED


def _generation(version: str) -> Tuple[int, ...]:
    """Return the first three numbers of a version, such as (1, 5, 14)."""
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def _until_1_5(is_so: Callable[[Any], bool]) -> Callable[[str, Any], Optional[bool]]:
    return lambda version, value: is_so(value) if (1,) <= _generation(version) < (1, 6) else None


def _from_1_7(is_so: Callable[[Any], bool]) -> Callable[[str, Any], Optional[bool]]:
    return lambda version, value: is_so(value) if _generation(version) >= (1, 7) else None


def _is(*values: Any) -> Callable[[Any], bool]:
    return lambda value: value in values


def _last_id_is_10(ids: Sequence[int]) -> Optional[bool]:
    """Return whether the last id that takes a value is 10; None where a lower one is, since those in use are left."""
    highest = max(ids, default=0)
    return None if highest < 10 else highest == 10


STATEMENTS: Dict[str, Statement] = {
    "S1": Statement("several clients of the status port are served at once", "I", "1", ("second_status_client",),
                    _is("coexists")),
    "S2": Statement("the port that the maker's SDK polls is open", "C", "1", ("polled_port",), _is("open")),
    "S3": Statement("the command port serves one client", "D", "1", ("second_client",), _is("replaces", "refused")),
    "S4": Statement("a newer client of the command port does not end the older one's session", "C", "1",
                    ("second_client",), _is("coexists", "refused")),
    "S5": Statement("requests that are glued together are all answered", "I", "3.1", ("two_in_one_segment",), _is(2)),
    "S6": Statement("frames come without a request", "O", "3.3", ("frame_bytes",), lambda value: value > 0),
    "S7": Statement("a frame is as long as its `len`", "O", "3.3", ("feed_damage",), _is(0)),
    "S8": Statement("frames have up to about 15000 bytes", "D*", "3.3", ("frame_bytes",), lambda value: value <= 15500),
    "S9": Statement("a model of the line has the arm's kinematics", "CALC", "4.2", ("model",), bool),
    "S10": Statement("`errorCode` is a text before V3", "O", "4.3", ("version", "error_code"),
                     lambda version, value: value == "text" if (1,) <= _generation(version) < (2,) else None),
    "S11": Statement("a command that nobody knows is answered with code 1", "O", "4.3", ("unknown_command",),
                     lambda value: value.split(",")[0] == "code 1"),
    "S12": Statement("that reply has no `cmdName`", "O", "4.3", ("unknown_command",),
                     lambda value: value.endswith("without a name") if value.startswith("code 1,") else None),
    "S13": Statement("`get_version` answers `version`", "O", "5.1", ("version",), bool),
    "S14": Statement("`get_robot_state` answers texts on 1.5 and older", "O", "5.1", ("version", "robot_state"),
                     _until_1_5(_is("texts"))),
    "S15": Statement("`get_robot_state` answers numbers on 1.7 and newer", "D*", "5.1", ("version", "robot_state"),
                     _from_1_7(_is("numbers"))),
    "S16": Statement("`get_motion_state` exists from 1.7.2 on", "C", "5.4.7", ("version", "commands_missing"),
                     lambda version, missing: "get_motion_state" not in missing
                     if _generation(version) >= (1, 7, 2) else None),
    "S17": Statement("`stop_program` ends a running move", "C", "5.4.4", ("stop_ends_move",), bool),
    "S18": Statement("`stop_program` ends any motion: a jog, too", "D", "5.4.4", ("stop_ends_jog",), bool),
    "S19": Statement("`stop_program` ends any motion: a servo stream, too", "D", "5.4.4", ("stop_ends_servo",), bool),
    "S20": Statement("the stop of a jog must name its axis", "D*", "5.5", ("jog_stop_ends",), _is("its axis")),
    "S21": Statement("servo mode lasts for a cycle or more after it was left", "I", "5.6.1", ("servo_leave_delay",),
                     lambda value: value >= 0.004),
    "S22": Statement("the arm holds the last target of a servo stream that starves", "I", "5.6.5", ("starvation",),
                     _is("hold")),
    "S23": Statement("tools have ids up to 10", "D", "5.7", ("tool_ids",), _last_id_is_10),
    "S24": Statement("user frames have ids up to 10", "D", "5.7", ("user_ids",), _last_id_is_10),
    "S25": Statement("payload, tool and user frame can be set and read back", "C", "5.7", ("same_values",),
                     lambda values: {"set_payload", "set_tool_id", "set_user_id"} <= set(values) or None),
    "S26": Statement("the key of a user frame is `userffset`", "O", "14", ("user_frame_key",),
                     _is("userffset", "either")),
    "S27": Statement("the key of a user frame is `useroffset`", "C", "5.7", ("user_frame_key",),
                     _is("useroffset", "either")),
    "S28": Statement("`torque_control_enable` switches hand guiding", "O", "14", ("drag_command",),
                     _is("torque_control_enable")),
    "S29": Statement("`get_clsn_sensitivity` answers `sensitivityLevel`", "O", "14", ("sensitivity_key",),
                     _is("sensitivityLevel", "both")),
    "S30": Statement("the index of the first output is 0 on 1.5 and older", "C", "5.11", ("version", "io_index_base"),
                     _until_1_5(_is(0))),
    "S31": Statement("the index of the first output is 1 on 1.7 and newer", "D*", "5.11", ("version", "io_index_base"),
                     _from_1_7(_is(1))),
    "S32": Statement("the feed has a period of about 30 ms on 1.5", "O", "6.1", ("version", "feed_period"),
                     _until_1_5(lambda value: 0.02 <= value <= 0.045)),
    "S33": Statement("the controller tells the period of its feed", "C", "6.1", ("feed_period", "feed_period_told"),
                     lambda seen, told: abs(seen - told) <= max(0.25 * seen, 0.002)),
    "S34": Statement("`inpos` may be true although the arm moves, on 1.7 and newer", "D", "6.2",
                     ("version", "inpos"),
                     lambda version, value: True if value == "early" and _generation(version) >= (1, 7) else None),
    "S35": Statement("a motion is refused with code 2 while the arm is not enabled", "I", "4.3", ("unready_code",),
                     _is("2")),
    "S36": Statement("`stop_program` stops a running program", "C", "5.4.4", ("stop_ends_program",), bool),
    "S37": Statement("a controller can be asked to stop the motion of a client that is lost", "D", "5.13",
                     ("link_loss_stops",), bool),
    "S38": Statement("a feed that is asked for 8 ms has a frame every 8 ms", "I", "6.1", ("feed_period_asked",),
                     lambda value: value <= 0.01),
}
"""All statements by id. An id is never used again for another statement."""

Arms = Dict[Verdict, Counter[str]]
"""Numbers of arms by firmware, of each verdict."""


def verdicts(facts: Facts) -> Dict[str, Verdict]:
    """Return the verdict of a probe's facts on each statement, by id."""
    return {number: statement.verdict(facts) for number, statement in STATEMENTS.items()}


def arms_behind(probes: Sequence[Tuple[str, Facts]]) -> Dict[str, Arms]:
    """Return how many arms confirm and contradict each statement, by its id.

    probes: Firmware, in words, and the facts of each arm.
    """
    found: Dict[str, Arms] = {number: {verdict: Counter() for verdict in Verdict} for number in STATEMENTS}
    for firmware, facts in probes:
        for number, verdict in verdicts(facts).items():
            found[number][verdict][firmware or "unknown"] += 1
    return found


def tag_of(statement: Statement, arms: Arms) -> str:
    """Return a statement's tag: [O] where an arm of somebody confirms it."""
    return "O" if arms[Verdict.CONFIRMED] else statement.tag


def table_rows(probes: Sequence[Tuple[str, Facts]]) -> List[List[str]]:
    """Return the rows of the table in section 15 of the page, without its head.

    probes: As ``arms_behind``.
    """
    arms = arms_behind(probes)
    return [[number, one.says, one.section, "[%s]" % tag_of(one, arms[number]).replace("*", "\\*"),
             ", ".join("`%s`" % name for name in one.facts),
             "; ".join("%s by %s" % (verdict.value, ", ".join(
                 "%d of %s" % (count, firmware) for firmware, count in sorted(arms[number][verdict].items())))
                 for verdict in (Verdict.CONFIRMED, Verdict.CONTRADICTED) if arms[number][verdict]) or "none"]
            for number, one in STATEMENTS.items()]
