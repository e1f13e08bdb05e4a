"""The facts that a probe can settle: their names, meanings and units, and the dimensions of a dialect that they set."""
import enum
from typing import Any, Dict, NamedTuple


class ProbeStage(enum.Enum):
    """Stages of a probe, in the order in which they run."""

    LOOK = "look"
    ASK = "ask"


class Described(NamedTuple):
    """The description of a fact.

    Attributes:
        stage: The stage that settles it.
        meaning: What its value is, for the reader.
        unit: Of its value; "" for none.
        point: Section of docs/controller-protocol.md that it bears upon.
        dimension: The dimension of ``simulation.dialect.table.Dialect`` that has its value; "" for none.
    """

    stage: ProbeStage
    meaning: str
    unit: str
    point: str
    dimension: str = ""


class Fact(NamedTuple):
    """One thing that was looked for.

    Attributes:
        value: What was found, as JSON has it; None where it is not settled.
        how: How it was measured, or why it is not settled.
        spread: How much the measurements differ, in words; "" where there is one.
    """

    value: Any
    how: str
    spread: str = ""


Facts = Dict[str, Fact]
"""Facts by the names of ``DESCRIBED``."""

_LOOK, _ASK = ProbeStage.LOOK, ProbeStage.ASK
DESCRIBED: Dict[str, Described] = {
    "feed_period": Described(_LOOK, "period of the status feed", "s", "6.1", "feed_period"),
    "feed_longest_gap": Described(_LOOK, "longest pause between two frames", "s", "6.1"),
    "feed_damage": Described(_LOOK, "damaged frames among those that came", "", "3.3"),
    "frame_bytes": Described(_LOOK, "length of the longest frame", "bytes", "3.3", "frame_bytes"),
    "frame_fields_missing": Described(_LOOK, "fields that a controller may leave out, and that never came", "",
                                      "6.1", "missing_frame_fields"),
    "frame_fields_unknown": Described(_LOOK, "fields that no source knows", "", "6.2", "unknown_frame_fields"),
    "second_status_client": Described(_LOOK, "a second client of the status port coexists with the first, "
                                      "replaces it or is refused", "", "1"),
    "polled_port": Described(_LOOK, "the port that the maker's SDK polls", "", "1"),
    "model": Described(_LOOK, "models whose tool pose is the controller's, from the same joints", "", "4.2"),
    "version": Described(_ASK, "version of the controller's software", "", "5.1"),
    "error_code": Described(_ASK, "type of `errorCode`", "", "4.3", "error_code"),
    "robot_state": Described(_ASK, "answers of `get_robot_state`", "", "5.1", "robot_state"),
    "sensitivity_key": Described(_ASK, "key of the reply of `get_clsn_sensitivity`", "", "5.9",
                                 "sensitivity_key"),
    "reply_fields_unknown": Described(_ASK, "fields in replies that no source knows", "", "4.3",
                                      "unknown_reply_fields"),
    "commands_missing": Described(_ASK, "questions that the controller does not know", "", "5",
                                  "missing_commands"),
    "reply_time": Described(_ASK, "median time from question to reply", "s", "2"),
    "reply_time_p99": Described(_ASK, "99 of 100 replies came within", "s", "2"),
    "feed_period_told": Described(_ASK, "period of the feed that the controller tells", "s", "6.1"),
    "two_in_one_segment": Described(_ASK, "answers to two questions that are sent as one piece", "", "3.1"),
    "cut_in_two": Described(_ASK, "a question sent as two pieces, 0.1 s apart, is answered", "", "3.1"),
    "poll_rate": Described(_ASK, "questions answered in a second, each sent when the last was answered", "Hz",
                           "2"),
    "feed_under_polling": Described(_ASK, "longest pause of the feed meanwhile", "s", "6.1"),
    "unknown_command": Described(_ASK, "reply to a command that nobody knows", "", "4.3"),
    "malformed": Described(_ASK, "what becomes of a question that is no JSON", "", "3.2"),
    "second_client": Described(_ASK, "a second client of the command port coexists with the first, replaces it "
                               "or is refused", "", "1", "second_client"),
}
"""All facts, in the order of the report."""
