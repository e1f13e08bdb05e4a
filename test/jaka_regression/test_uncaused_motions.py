"""Motions of a log that no call began: what a replay of calls cannot repeat."""
from dataclasses import replace

import pytest
from import_graph import ROOT

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.runs.run import Call, LongTrack, Run, Track, TrackFacts
from jaka_bag.containers.registry import create_log, open_log
from jaka_bag.containers.time_order import messages_of
from jaka_bag.errors import BagError
from jaka_bag.messages.selection import Selection
from jaka_bag.operations.convert import Job, convert_file
from jaka_regression.cell.run import run_cell
from jaka_regression.driver_inputs import inputs_of
from jaka_regression.replay import replay
from jaka_regression.scenario import scenario_of
from jaka_regression.uncaused_motions import MOVING_SERVICES, UncausedMotion, in_words, uncaused_motions

GOLDEN = ROOT / "test" / "data" / "golden"


def call(service, start, end, success=True, arm="", request=b"\x00"):
    node = arm + "/jaka_driver/"
    return Call(node + "service_calls", start, end - start, node + service, "t/T", "0" * 32, request, b"", success, "",
                "", "")


def run_of(calls, motions, arm=""):
    topic = arm + "/jaka_driver/joint_position"
    facts = TrackFacts(1000, 0.0, 60.0, 1000, 0.008, 0.008, 3, tuple(motions))
    track = LongTrack(topic, ("joint_1",), facts, (), lambda begin, end: Track(topic, ("joint_1",), [], []))
    return Run("log.mcap", 0, 60.0, joints={topic: track}, calls=tuple(calls))


def starts(calls, motions, moments=()):
    return [motion.start for motion in uncaused_motions(run_of(calls, motions), calls, {"": moments})]


@pytest.mark.parametrize("calls, motions", [
    ([call("joint_move", 1.0, 3.0)], [(1.02, 2.9)]),
    ([call("joint_move", 1.0, 3.0)], [(0.95, 2.9)]),  # seen a little early
    ([call("linear_move", 1.0, 1.01)], [(1.9, 4.0)]),  # answered on acceptance, begun late
    ([call("joint_move", 1.0, 9.0), call("pause", 2.0, 2.1), call("resume", 5.0, 5.1)], [(1.1, 2.1), (5.1, 8.9)]),
    ([call("joint_move", 1.0, 1.1), call("joint_move", 1.2, 1.3), call("joint_move", 1.4, 1.5)],
     [(1.1, 4.0), (4.2, 8.0), (8.1, 12.0)]),  # a queue
    ([call("program/play", 1.0, 1.1)], [(1.5, 3.0), (20.0, 21.0), (50.0, 51.0)]),
    ([call("servo_move_enable", 1.0, 1.1), call("servo_j", 5.0, 5.0)], [(5.02, 6.0)]),
    ([call("jog", 1.0, 1.0)], [(1.0, 4.1)]),
], ids=["a move", "early", "late", "resumed", "queue", "program", "servo", "jog"])
def test_motions_that_calls_began_are_no_news(calls, motions):
    assert starts(calls, motions) == []


@pytest.mark.parametrize("calls, motions, found", [
    ([], [(1.0, 2.0)], [1.0]),
    ([call("joint_move", 1.0, 3.0)], [(1.02, 2.9), (5.0, 6.0)], [5.0]),
    ([call("joint_move", 9.0, 9.9)], [(1.0, 2.0), (9.0, 9.8)], [1.0]),
    ([call("set_io", 1.0, 1.1)], [(1.05, 2.0)], [1.05]),
    ([call("servo_move_enable", 1.0, 1.1)], [(1.2, 2.0)], [1.2]),  # targets by topic
    ([call("joint_move", 1.0, 3.0), call("stop_move", 2.0, 2.1)], [(1.0, 2.3), (4.3, 6.0)], [4.3]),
    ([call("joint_move", 1.0, 1.1, success=False)], [(3.0, 4.0)], [3.0]),
    ([call("program/play", 1.0, 1.1), call("program/stop", 5.0, 5.1)], [(1.5, 3.0), (20.0, 21.0)], [20.0]),
], ids=["no call", "later", "earlier", "an output", "servo topics", "behind a stop", "refused", "program stopped"])
def test_motions_that_no_call_began_are_found(calls, motions, found):
    assert starts(calls, motions) == found


def test_a_guided_arm_is_moved_by_a_hand_though_a_call_switched_it_on():
    calls = [call("drag_mode", 1.0, 1.1, request=b"\x01"), call("drag_mode", 9.0, 9.1, request=b"\x00")]
    found = uncaused_motions(run_of(calls, [(2.0, 3.0), (20.0, 21.0)]), calls, {})
    assert found == [UncausedMotion("", 2.0, 3.0, True), UncausedMotion("", 20.0, 21.0, False)]
    assert "2 motions" in in_words(found) and "a hand guided it" in in_words(found)


def test_an_event_of_the_scenario_is_a_cause():
    assert starts([], [(5.0, 6.0)], [4.5]) == []
    assert starts([], [(5.0, 6.0)], [3.0]) == [5.0]


def test_each_arm_has_its_own_calls():
    two = run_of([call("joint_move", 1.0, 2.0, arm="/left")], [(1.0, 2.0)], "/left")
    right = run_of([], [(1.0, 2.0)], "/right")
    found = uncaused_motions(replace(two, joints={**two.joints, **right.joints}), two.calls, {})
    assert [motion.arm for motion in found] == ["/right"]
    assert "/right moved at 1.000 s" in in_words(found)


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("*.mcap")), ids=lambda path: path.stem)
def test_the_shipped_golden_logs_have_a_cause_for_each_motion_and_need_it(path):
    run = load_run(path)
    assert uncaused_motions(run, inputs_of(path, run), {}) == []
    motions = [motion for track in run.joints.values() for motion in track.facts.motions]
    rest = [call for call in run.calls if call.short_name not in MOVING_SERVICES]
    assert bool(uncaused_motions(run, rest, {})) is bool(motions)


def test_a_log_whose_motions_no_call_began_is_refused_before_anything_starts(tmp_path):
    convert_file(Job(str(GOLDEN / "joint_moves.mcap"), str(tmp_path / "bare.mcap"),
                     selection=Selection(exclude=("/jaka_driver/service_calls",))))
    with pytest.raises(BagError, match="no call and no message in the log began 4 motions.*replay-motion"):
        replay(tmp_path / "bare.mcap", tmp_path / "out", scenario=scenario_of(GOLDEN / "joint_moves.mcap"))
    assert "no call and no message in the log began" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert not list((tmp_path / "out").glob("*.log"))


def test_a_cells_log_in_which_a_hand_moved_the_arm_is_refused_before_anything_starts(tmp_path):
    log = tmp_path / "moved.mcap"
    with open_log(GOLDEN / "joint_moves.mcap") as source, create_log(log) as target:
        channels = {connection: target.add_channel(connection) for connection in source.connections}
        moves = 0
        for message in messages_of(source, Selection()):
            is_move = message.connection.topic.endswith("service_calls") and b"joint_move" in bytes(message.data)
            moves += is_move
            if not (is_move and moves == 1):
                target.add_message(channels[message.connection], message.log_time, bytes(message.data))
    with pytest.raises(BagError, match="no call and no message in the log began the only motion: the arm moved at"):
        run_cell(tmp_path / "none.launch", log, tmp_path / "out")
    assert "the pendant or a hand did" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert not list((tmp_path / "out").glob("*.log"))
