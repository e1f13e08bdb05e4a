"""The table that ties the simulation to docs/safety.md: for each promise its rules, and the planted defects.

A promise that no simulation of the core can judge names the live tests that do, and the reason. Run as a program, this
writes the table into the page:

    build/venv/bin/python3 test/custody/promises.py
"""
import re
import sys
from pathlib import Path
from typing import Dict, List, NamedTuple, Tuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(folder) for folder in (HERE, HERE / "rules", HERE.parent / "support", HERE.parents[1])]

import defects  # noqa: E402
from verdict import RULES  # noqa: E402

PAGE = HERE.parents[1] / "docs" / "safety.md"
BEGIN, END = "<!-- rules -->", "<!-- end of rules -->"
_ROW = re.compile(r"^\|(.*)\|$")
_ARCHITECTURE = "it is made in a room that the core does not know"


class Promise(NamedTuple):
    """The judgement of one promise.

    Attributes:
        begins: First words of its row; no other row begins with them.
        rules: Names in verdict.RULES, separated by blanks.
        defects: Names in defects.DEFECTS: cores that break the promise; one of its rules must find each.
        live: Tests that judge what the rules cannot; empty where the rules judge all of it.
        why: What the rules cannot judge.
    """

    begins: str
    rules: str
    defects: str
    live: str = ""
    why: str = ""


PROMISES: Tuple[Promise, ...] = (
    Promise("`stop_move` waits for nobody", "i", "StopsLater",
            "test_a_stop_is_delivered_while_the_handshake_goes_on", "locks and threads"),
    Promise("a stop is one thing", "whole", "StopsHalf"),
    Promise("without custody, too", "", "",
            "test_the_caller_is_answered_when_the_arm_is_seen_at_rest"
            " test_of_an_arm_that_moves_on_the_caller_is_told_in_time_and_it_is_stopped_again",
            "verified stops of what others move: the judge follows the driver's own motions"),
    Promise("what a dead driver left moving", "", "",
            "test_what_a_dead_driver_left_moving_is_stopped_as_the_first_word_with_its_axis"
            " test_it_is_stopped_again_while_it_moves_on_and_nothing_else_begins_meanwhile",
            "files and processes"),
    Promise("an arm that moves in nobody's custody", "", "",
            "test_an_arm_that_moves_in_nobodys_custody_is_said_once_and_not_stopped"
            " test_an_arm_that_moves_when_the_driver_starts_is_noticed",
            "what is logged and published"),
    Promise("no call hangs behind", "e", "AnswersNever"),
    Promise("a stop ends what was asked before it", "b", "ForgetsStops SendsAgain"),
    Promise("a refused, lost or disobeyed stop is repeated", "m", "StopsOnce"),
    Promise("a jog ends `jog_timeout`", "c", "JogsOn"),
    Promise("a velocity jog moves only while", "v", "KeepsHold"),
    Promise("a velocity jog begins only after", "v", "NeedsNoRest"),
    Promise("\"completed\" means", "e", "AnswersGood"),
    Promise("a motion that begins late", "late", "WaitsForStart"),
    Promise("what forbids a motion to begin ends one", "against", "IgnoresFaults",
            "test_notes_and_warnings_do_not_stop_a_move", "that something does not stop a motion: others may"),
    Promise("the arm never moves unseen", "j", "DoesNotSeeSilence"),
    Promise("what is published was true at its stamp", "g age", "ShowsOldAsNew KeepsBacklog"),
    Promise("nothing powers, enables or resumes", "d", "PowersAgain"),
    Promise("`~recover` is one act", "recovery d", "RecoversTwice",
            "test_from_each_fault_state_to_an_arm_that_can_move", "when a person must act"),
    Promise("`~robot_status` is true", "", "",
            "test_the_truth_table test_in_motion_is_told_when_a_move_begins_and_when_it_is_over", _ARCHITECTURE),
    Promise("a servo stream reaches its last target", "f", "StreamsOn JumpsInServo LeavesLimits"),
    Promise("a servo target that comes by topic", "", "",
            "test_a_target_that_is_old_or_from_a_clock_ahead_moves_nothing_and_is_logged",
            "stamps: it is made in a room that the core does not know"),
    Promise("a servo stream that goes wrong", "against", "IgnoresRefusedFrames",
            "test_an_arm_that_runs_ahead_or_aside_is_not", "an arm that leaves its stream: the simulated one does not"),
    Promise("a trajectory is audited as a whole", "t f", "BesidePath JumpsInServo",
            "test_a_path_that_breaks_a_limit_anywhere_is_refused_with_joint_time_and_value", "what is refused"),
    Promise("pause, speed, cancel and late cycles", "t p burst", "BesidePath PausesNothing SendsInBursts"),
    Promise("whatever contradicts a trajectory", "against b", "IgnoresFaults StreamsAfterStop"),
    Promise("a path is audited as a whole", "q", "LeavesSegmentsOut",
            "test_malformed_paths_are_rejected_as_a_whole_and_nothing_is_sent", "what is refused"),
    Promise("a program of the controller's own", "r", "LeavesPrograms"),
    Promise("a goal has exactly one end", "e", "AnswersTwice AnswersNever",
            "test_what_ends_a_trajectory_ends_its_goal_once_with_the_code_for_it", "codes: " + _ARCHITECTURE),
    Promise("a driver that dies or freezes", "guard h", "BlindGuard GuardStopsOnce GuardIsNotTold",
            "test_the_arm_is_stopped_when_the_driver_dies_or_freezes", "processes and pipes"),
    Promise("a defect of the driver's core", "", "", "test_a_defect_in_the_core_stops_the_arm_and_keeps_the_evidence",
            "threads and files: a core that fails ends a world"),
    Promise("a driver that ends in good order", "goodbye", "LeavesMoving"),
    Promise("the driver ends in bounded time", "", "",
            "test_with_a_frozen_master_the_arm_is_stopped_at_once_and_the_driver_ends"
            " test_a_driver_in_the_middle_of_its_start_ends_where_the_master_is_frozen",
            "the master: processes"),
    Promise("nothing is powered before clients", "", "",
            "test_a_node_that_no_client_can_reach_refuses_to_start_and_powers_nothing"
            " test_without_time_nothing_is_powered_or_offered_until_it_runs",
            "the graph: processes"),
    Promise("each topic has one use", "", "",
            "test_a_topic_that_is_used_for_something_else_is_refused"
            " test_a_remapping_that_makes_two_topics_one_is_refused",
            "the graph: processes"),
    Promise("`sim:=true` reaches no real arm", "n", "TalksToStrangers",
            "test_with_sim_the_simulated_controller_is_driven_whatever_ip_says", "the launch file"),
    Promise("one driver for one controller", "", "",
            "test_two_names_of_one_controller_are_one_lock test_a_living_node_is_refused_a_second_one_and_lives_on",
            "locks and the master: processes"),
    Promise("a driver whose command port", "", "",
            "test_a_driver_whose_port_is_taken_three_times_gives_way_and_says_so"
            " test_who_owes_a_stop_takes_the_port_for_it_from_whomever",
            "two drivers that both go on: a rival of the simulation takes the port and leaves"),
    Promise("what no arm can be at", "", "",
            "test_a_frame_with_a_value_that_no_arm_can_have_is_damaged"
            " test_readings_that_no_sensor_can_have_are_unknown",
            "values of single frames: the simulated controller has none"))
BESIDES: Dict[str, str] = {
    "a": "custody itself, on which the promises rest",
    "k": "a driver that is always in custody keeps every other promise",
    "l": "a driver that is never ready keeps every other promise",
    "state": "custody itself, seen from within",
    "contract": "a core that fails keeps no promise",
}
"""Rules that serve no single promise, each with the reason why it exists."""


def rows(text: str) -> List[str]:
    """Return the promises on the page, each by the text of its row."""
    part = text.split("## Promises", 1)[1].split("\n## ", 1)[0].split(BEGIN, 1)[0]
    found = [match.group(1).split("|")[0].strip() for match in map(_ROW.match, part.split("\n")) if match]
    return [row for row in found if row != "promise" and set(row) != {"-"}]


def table() -> str:
    """Return the rules table as the page must have it."""
    lines = ["| promise | rules of the simulation | planted defects | live tests, and for what |", "|---|---|---|---|"]
    for promise in PROMISES:
        lines.append("| %s ... | %s | %s | %s |" % (
            promise.begins, "; ".join([RULES[name] for name in promise.rules.split()]),
            ", ".join(["`%s`" % name for name in promise.defects.split()]),
            "; ".join([", ".join(["`%s`" % name for name in promise.live.split()]), promise.why]).strip("; ")))
    return "\n".join(lines)


def written(text: str) -> str:
    """Return the page's text with this table in it."""
    before, rest = text.split(BEGIN, 1)
    return before + BEGIN + "\n" + table() + "\n" + END + rest.split(END, 1)[1]


def rule_of(name: str) -> str:
    """Return the rule that must find a planted defect."""
    return next(defect.rule for defect in defects.DEFECTS if defect.make.__name__ == name)


def main() -> None:
    """Write the table into the page."""
    PAGE.write_text(written(PAGE.read_text()))


if __name__ == "__main__":
    main()
