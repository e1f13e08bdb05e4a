"""The facts that a probe can settle: their names, meanings and units, and the dimensions of a dialect that they set."""
import enum
from typing import Any, Dict, NamedTuple


class ProbeStage(enum.Enum):
    """Stages of a probe, in the order in which they run."""

    LOOK = "look"
    ASK = "ask"
    SET = "set"
    MOVE = "move"


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

_LOOK, _ASK, _SET, _MOVE = ProbeStage.LOOK, ProbeStage.ASK, ProbeStage.SET, ProbeStage.MOVE
DESCRIBED: Dict[str, Described] = {
    "feed_period": Described(_LOOK, "period of the status feed", "s", "6.1", "feed_period"),
    "feed_longest_gap": Described(_LOOK, "longest pause between two frames", "s", "6.1"),
    "feed_damage": Described(_LOOK, "damaged frames among those that came", "", "3.3"),
    "frame_bytes": Described(_LOOK, "length of the longest frame", "bytes", "3.3", "frame_bytes"),
    "frame_fields_missing": Described(_LOOK, "fields that a controller may leave out, and that never came", "",
                                      "6.1", "missing_frame_fields"),
    "frame_fields_unknown": Described(_LOOK, "fields that no source knows", "", "6.2", "unknown_frame_fields"),
    "frame_fields": Described(_LOOK, "fields of a frame, with type, least and greatest number", "", "6.2"),
    "frame_clock": Described(_LOOK, "field of a frame that is a clock, and its unit", "", "6.2"),
    "clock_drift": Described(_LOOK, "that clock is faster than this computer's by", "ppm", "6.2"),
    "second_status_client": Described(_LOOK, "a second client of the status port coexists with the first, "
                                      "replaces it or is refused", "", "1"),
    "polled_port": Described(_LOOK, "the port that the maker's SDK polls", "", "1"),
    "polled_port_sends": Described(_LOOK, "what that port sends without a request", "", "6.6"),
    "units": Described(_LOOK, "units of joints and tool pose by which a model fits", "", "6.2"),
    "model": Described(_LOOK, "models whose tool pose is the controller's, from the same joints", "", "4.2"),
    "version": Described(_ASK, "version of the controller's software", "", "5.1"),
    "error_code": Described(_ASK, "type of `errorCode`", "", "4.3", "error_code"),
    "robot_state": Described(_ASK, "answers of `get_robot_state`", "", "5.1", "robot_state"),
    "sensitivity_key": Described(_ASK, "key of the reply of `get_clsn_sensitivity`", "", "5.9",
                                 "sensitivity_key"),
    "reply_fields_unknown": Described(_ASK, "fields in replies that no source knows", "", "4.3",
                                      "unknown_reply_fields"),
    "reply_types": Described(_ASK, "types of the keys of each reply", "", "4.3"),
    "commands_missing": Described(_ASK, "commands that the controller does not know, of those sent", "", "5",
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
    "same_values": Described(_SET, "settings that take the value that they have, and read it back", "", "5.7"),
    "feed_period_asked": Described(_SET, "period of the feed where the driver's 8 ms are asked for", "s", "6.1",
                                   "shortest_feed_period"),
    "tool_ids": Described(_SET, "ids of tools that take a value", "", "5.7"),
    "user_ids": Described(_SET, "ids of user frames that take a value", "", "5.7"),
    "user_frame_key": Described(_SET, "key of `set_user_offsets` that is read", "", "5.7", "user_frame_key"),
    "drag_command": Described(_SET, "command that switches hand guiding", "", "5.8"),
    "io_index_base": Described(_SET, "index, in commands, of the first output in the feed", "", "5.11",
                               "io_index_base"),
    "io_terminal": Described(_SET, "label of the terminal that `--output` switched, as a person saw it", "", "5.11"),
    "start_delay": Described(_MOVE, "from the acceptance of a move to its beginning", "s", "2", "start_delay"),
    "move_acceleration": Described(_MOVE, "acceleration of a move, as a share of what was asked for", "times", "5.2",
                                   "move_acceleration"),
    "move_jerk_time": Described(_MOVE, "how long that acceleration builds up", "s", "5.4.3", "move_jerk_time"),
    "joint_blend": Described(_MOVE, "`tol` of a `joint_move` is kept: no stop on the way to the next one's target", "",
                             "5.2", "joint_blend"),
    "inpos": Described(_MOVE, "when `inpos` is true: at rest (exact), already in motion (early), later, never", "",
                       "6.2", "inpos"),
    "stop_ends_move": Described(_MOVE, "`stop_program` ends a move", "", "5.4.4"),
    "stop_time": Described(_MOVE, "from sending a stop to rest", "s", "5.4.4"),
    "stop_distance": Described(_MOVE, "way of the joint meanwhile", "deg", "5.4.4"),
    "stop_deceleration": Described(_MOVE, "mean deceleration of a stopped move", "deg/s2", "5.4.4"),
    "stop_ends_jog": Described(_MOVE, "`stop_program` ends a jog", "", "5.5", "stop_ends_jog"),
    "jog_stop_ends": Described(_MOVE, "the stop of a jog ends that of any axis, or of its axis", "", "5.5",
                               "jog_stop_ends"),
    "jog_stop_all": Described(_MOVE, "the six requests of the maker's SDK to stop all joints end a jog", "", "5.5"),
    "pause_pauses_moves": Described(_MOVE, "`pause_program` pauses a move", "", "5.4.5", "pause_pauses_moves"),
    "servo_on_time": Described(_MOVE, "from the acceptance of servo mode until it is on", "s", "5.6.1"),
    "servo_gaps": Described(_MOVE, "pauses of a servo stream, ms, after which it goes on", "", "5.6.5"),
    "starvation": Described(_MOVE, "reaction of the arm to a servo stream that runs dry", "", "5.6.5", "starvation"),
    "servo_queue": Described(_MOVE, "servo frames that wait behind the one for the next cycle", "", "5.6.5",
                             "servo_queue"),
    "stop_drops_frames": Described(_MOVE, "leaving servo mode drops the frames that wait", "", "5.6.1",
                                   "stop_drops_frames"),
    "servo_leave_delay": Described(_MOVE, "from the acceptance of leaving servo mode until it is off", "s", "5.6.1",
                                   "servo_leave_delay"),
    "stop_ends_servo": Described(_MOVE, "`stop_program` ends a servo stream", "", "5.6.1", "stop_ends_servo"),
    "link_loss_stops": Described(_MOVE, "the controller stops a move whose client is lost, where it was asked to", "",
                                 "5.13"),
    "link_loss_notice": Described(_MOVE, "from the loss of the client to the controller's notice of it", "s", "5.13",
                                  "link_loss_notice"),
    "stop_ends_program": Described(_MOVE, "`stop_program` ends a program", "", "5.4.4", "stop_ends_program"),
    "unready_code": Described(_MOVE, "a move of an arm that is not enabled is refused with code 2, or with that of the "
                              "maker's SDK for it", "", "4.3", "unready_code"),
    "twin_angle": Described(_MOVE, "a simulated controller made of this report is that near to this arm", "deg", "5.2"),
    "twin_time": Described(_MOVE, "and that near in time", "s", "5.2"),
    "room": Described(_MOVE, "largest distance of the tool from where the stage began", "mm", "5.2"),
}
"""All facts, in the order of the report."""
