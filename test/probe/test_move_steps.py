"""Single steps of the stage of jaka_probe that moves, on simulated controllers of each value of their dimensions.

All in virtual time: a whole run on a terminal, over sockets, with the processes and signals, is in test_move.py.
"""
import math
import signal

import pytest
from probe_bench import wrong
from virtual_probe import StepBench

from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.motion import Mover, Seen
from jaka_ros_driver.probe.move import STEPS, blend_fact, dwell, loss_facts
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.pendant_steps import NOT_ENABLED, PROGRAM, program_fact, unready_fact
from jaka_ros_driver.probe.servo_steps import AHEAD, ahead_fact
from jaka_ros_driver.probe.set_same import StageEnded
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.replies import CommandRefused
from jaka_ros_driver.simulation.controller.state import ControllerState, LinkLoss
from jaka_ros_driver.state import ProgramState


def requests(bench, name):
    """Return the requests of this name that the controller was sent, in order."""
    return [request for request in bench.requests if request["cmdName"] == name]


STARVE_STEP, AHEAD_STEP, PROFILE_STEP, BLEND_STEP = STEPS[7], STEPS[8], STEPS[1], STEPS[3]


@pytest.mark.parametrize("blends", [True, False])
@pytest.mark.parametrize("others", [{"move_acceleration": 4.0, "feed_period": 0.1},
                                    {"move_acceleration": 0.5, "start_delay": 1.0, "move_jerk_time": 0.2}])
def test_whether_the_tolerance_of_a_joint_move_is_kept(blends, others):
    bench = StepBench(joint_blend=blends, **others)
    facts = bench.run(PROFILE_STEP, BLEND_STEP)
    assert facts["joint_blend"].value is blends, facts["joint_blend"]
    assert not wrong({"joint_blend": facts["joint_blend"]}, bench.dialect)
    assert wrong({"joint_blend": Fact(not blends, "")}, bench.dialect), "a wrong fact must be noticed"
    assert bench.furthest == pytest.approx(2.5) and bench.fastest < 3.001


@pytest.mark.parametrize("passing, kept, without, told", [
    (0.13, 0.14, 0.63, True), (0.13, 0.62, 0.63, False), (0.13, 0.4, 0.63, None), (0.13, 0.13, 0.14, None),
    (None, 0.1, 0.6, None), (0.13, None, 0.63, None), (0.13, 0.1, None, None)])
def test_only_a_clear_time_at_the_junction_tells(passing, kept, without, told):
    assert blend_fact(passing, kept, without).value is told


@pytest.mark.parametrize("curve, told", [
    ([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)], 0.4), ([(0.0, 0.0), (1.0, -1.0), (2.0, -2.0)], 0.4),
    ([(0.0, 2.0), (1.0, 1.0), (2.0, 0.0)], 0.4), ([(0.0, 0.0), (1.0, 1.1)], None), ([], None)])
def test_the_time_at_the_junction_of_a_curve(curve, told):
    assert dwell(curve) == (told if told is None else pytest.approx(told))


@pytest.mark.parametrize("period", [0.008, 0.1])
@pytest.mark.parametrize("starvation", ["hold", "repeat", "coast", "fault"])
def test_what_an_arm_does_whose_stream_runs_dry(starvation, period):
    bench = StepBench(starvation=starvation, feed_period=period)
    facts = bench.run(STARVE_STEP)
    assert facts["starvation"].value == starvation, facts["starvation"]
    assert not wrong(facts, bench.dialect) and bench.furthest < 3.0
    assert wrong({"starvation": Fact("hold" if starvation != "hold" else "coast", "")}, bench.dialect)


@pytest.mark.parametrize("held_up", [0.0, 0.03, 0.06])
def test_an_arm_that_goes_on_without_frames_is_stopped_by_its_way_also_on_a_busy_computer(monkeypatch, held_up):
    bench = StepBench(starvation="repeat")
    select = bench.select

    def late(*words):
        bench.sleep(held_up)
        return select(*words)
    monkeypatch.setattr(bench, "select", late)
    bench.run(STARVE_STEP)
    assert 1.9 <= bench.furthest < 3.0


@pytest.mark.parametrize("waiting, starvation", [
    (0, "repeat"), (1, "repeat"), (4, "fault"), (4, "coast"), (49, "hold")])
def test_how_many_frames_wait_whatever_an_arm_does_without_them(waiting, starvation):
    bench = StepBench(servo_queue=waiting, starvation=starvation)
    bench.facts["starvation"] = Fact(starvation, "as an earlier step found it")
    facts = bench.run(AHEAD_STEP)
    assert facts["servo_queue"].value == waiting, facts["servo_queue"]
    assert not wrong(facts, bench.dialect)
    assert wrong({"servo_queue": Fact(4 if waiting != 4 else 1, "")}, bench.dialect), "a wrong fact must be noticed"
    assert bench.furthest < 1.5 and bench.fastest < 2.001


@pytest.mark.parametrize("moving, holding, told", [
    (1.0, 0.0, 0), (None, 0.0, 0), (1.0, 1.0, 1), (1.0, None, 1), (3.0, 2.0, 4), (None, 2.0, 4), (25.0, 25.0, 49),
    (27.0, 27.0, 53), (0.0, 0.0, None), (None, None, None), (3.0, 1.0, None), (2.0, 3.0, None), (1.4, 1.0, None)])
def test_how_many_frames_counted_is_told_by_two_ways_that_agree(moving, holding, told):
    assert ahead_fact(moving, holding).value == told


def test_more_frames_than_were_sent_may_wait():
    fact = ahead_fact(AHEAD / 2, AHEAD / 2)
    assert fact.value == AHEAD - 1 and "all counted: more may wait" in fact.how
    assert report.dialect_of({"servo_queue": fact})["servo_queue"] == 49, "the nearest that a simulated one has"
    assert report.dialect_of({"servo_queue": Fact(14, "")})["servo_queue"] == 4


JOG_STOP_STEP, LOSS_STEP = STEPS[5], STEPS[12]


@pytest.mark.parametrize("notice, second_client", [(0.0, "refused"), (2.5, "coexists"), (5.0, "replaces")])
def test_when_a_controller_notices_that_its_client_is_lost(notice, second_client):
    bench = StepBench(link_loss_notice=notice, second_client=second_client)
    facts = bench.run(LOSS_STEP)
    assert facts["link_loss_notice"].value == pytest.approx(notice, abs=0.02) and facts["link_loss_stops"].value is True
    assert not wrong(facts, bench.dialect)
    assert wrong({"link_loss_notice": Fact(notice + 0.5 if notice < 5.0 else 4.0, "")}, bench.dialect)
    assert bench.furthest == pytest.approx(0.1 + 0.25 * (notice + 0.5), abs=0.01) and bench.fastest < 2.001
    assert not bench.back.left and bench.controller.state.link_loss is LinkLoss.KEEP
    assert [setting["motType"] for setting in requests(bench, "set_network_exception_handle")] == [LinkLoss.ABORT, 0]


def test_a_move_that_a_loss_does_not_stop_ends_in_the_room(monkeypatch):
    bench = StepBench()
    monkeypatch.setattr(bench.controller.state, "client_lost", lambda: None)
    facts = bench.run(LOSS_STEP)
    assert facts["link_loss_stops"].value is False and facts["link_loss_notice"].value is None, facts
    assert bench.furthest == pytest.approx(2.4) and not bench.back.left


def test_a_controller_that_does_not_know_of_the_loss_of_a_client_is_not_moved():
    bench = StepBench(missing_commands=["set_network_exception_handle"])
    bench.facts["commands_missing"] = Fact(["wait_complete"], "")
    facts = bench.run(LOSS_STEP)
    assert facts["link_loss_notice"].value is None and "refused with code 1" in facts["link_loss_notice"].how
    assert facts["commands_missing"].value == ["set_network_exception_handle", "wait_complete"]
    assert bench.furthest == 0.0


def test_a_setting_that_cannot_be_put_back_is_said(monkeypatch):
    bench = StepBench()
    command = COMMANDS["set_network_exception_handle"]

    def handler(state, arguments):
        if arguments.integer("motType") == 0:
            raise CommandRefused()
        return command.handler(state, arguments)
    monkeypatch.setitem(COMMANDS, "set_network_exception_handle", command._replace(handler=handler))
    facts = bench.run(LOSS_STEP)
    assert facts["link_loss_stops"].value is True
    assert len(bench.back.left) == 1 and "set_network_exception_handle was not put back" in bench.back.left[0]


def test_ctrl_c_after_the_loss_stops_the_arm_and_puts_the_setting_back(monkeypatch, ctrl_c):
    bench = StepBench(link_loss_notice=5.0)
    hang_up, came = Mover.hang_up, []

    def interrupted(mover):
        is_moving = mover.position != mover.start[AXIS]
        hang_up(mover)
        if is_moving and not came:
            came.append(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
    monkeypatch.setattr(Mover, "hang_up", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bench.run(LOSS_STEP)
    assert 0.1 < bench.furthest < 0.12 and not bench.back.left
    assert bench.controller.state.link_loss is LinkLoss.KEEP
    assert requests(bench, "set_network_exception_handle")[-1]["motType"] == 0 and requests(bench, "stop_program")


@pytest.mark.parametrize("pieces, told, notice", [
    ([(1.0, 0.25), (2.0, 0.0)], True, 0.5), ([(0.4, 0.25), (2.0, 0.0)], True, 0.0),
    ([(9.6, 0.25), (1.0, 0.0)], False, None), ([(2.0, 0.2), (1.0, 0.0)], True, None),
    ([(3.0, 0.25)], None, None), ([], None, None)])
def test_what_the_frames_after_a_loss_tell(pieces, told, notice):
    seen, place, at = [], 0.0, 100.0
    for seconds, speed in pieces:
        for _ in range(round(seconds / 0.02)):
            place, at = place + math.radians(speed) * 0.02, at + 0.02
            seen.append(Seen(at, place, True, False))
    found = loss_facts(seen, 100.0, math.radians(2.4))
    assert found["link_loss_stops"].value is told
    assert found.get("link_loss_notice", Fact(None, "")).value == (
        notice if notice is None else pytest.approx(notice, abs=0.05))


@pytest.mark.parametrize("ends", ["any", "its axis"])
def test_the_stops_of_all_joints_end_a_jog_whichever_its_own_does(ends):
    bench = StepBench(jog_stop_ends=ends)
    facts = bench.run(JOG_STOP_STEP)
    assert facts["jog_stop_ends"].value == ends and facts["jog_stop_all"].value is True, facts
    assert wrong({"jog_stop_ends": Fact("its axis" if ends == "any" else "any", "")}, bench.dialect)
    jogs = [request["jnum"] for request in requests(bench, "jog") if request["jog_mode"] == 0]
    assert any(jogs[place:place + 6] == list(range(6)) for place in range(len(jogs)))
    assert bench.furthest < 1.5 and bench.fastest < 2.001


def test_a_jog_that_goes_on_after_the_stops_of_all_joints_is_told(monkeypatch):
    bench = StepBench(jog_stop_ends="its axis")
    stops = []
    stop_jog = ControllerState.stop_jog

    def deaf(state, frame, axis):
        stops.append(axis)
        if stops.count(5) != 2:
            stop_jog(state, frame, axis)
    monkeypatch.setattr(ControllerState, "stop_jog", deaf)
    facts = bench.run(JOG_STOP_STEP)
    assert facts["jog_stop_all"].value is False, (facts, stops)


@pytest.mark.parametrize("ends", [True, False])
def test_whether_stop_program_ends_a_program(ends):
    def answers(question):
        if "End it at the pendant" in question:
            bench.controller.state.stop()
        return "y"
    bench = StepBench(answers, stop_ends_program=ends)
    bench.controller.state.memory.program_name = "weld.jks"
    facts = bench.run(PROGRAM, program="weld")
    assert facts["stop_ends_program"].value is ends, facts
    assert not wrong(facts, bench.dialect)
    assert wrong({"stop_ends_program": Fact(not ends, "")}, bench.dialect), "a wrong fact must be noticed"
    assert any("may run on" in line for line in bench.told) is not ends, "who is asked to end it"
    assert not bench.back.left


def test_a_program_that_nobody_ends_is_said_first_and_ends_the_stage():
    bench = StepBench(stop_ends_program=False)
    bench.controller.state.memory.program_name = "weld"
    with pytest.raises(StageEnded, match="may run on"):
        bench.run(PROGRAM, NOT_ENABLED, program="weld")
    assert bench.facts["stop_ends_program"].value is False and "unready_code" not in bench.facts
    assert len(bench.back.left) == 1 and "may run on: end it at the pendant" in bench.back.left[0]


@pytest.mark.parametrize("named, is_played", [("", False), ("paint", False), ("weld", True), ("weld.jks", True)])
def test_only_the_program_that_is_named_and_loaded_is_played(named, is_played):
    bench = StepBench()
    bench.controller.state.memory.program_name = "weld"
    facts = bench.run(PROGRAM, program=named)
    assert ("stop_ends_program" in facts) == bool(named)
    assert not named or (facts["stop_ends_program"].value is True) == is_played
    assert bool(requests(bench, "play_program")) == is_played


def test_a_program_that_moves_the_arm_is_stopped_and_settles_nothing(monkeypatch):
    bench = StepBench()
    bench.controller.state.memory.program_name = "weld"
    state = bench.controller.state
    monkeypatch.setitem(COMMANDS, "play_program", COMMANDS["play_program"]._replace(handler=lambda state, arguments: (
        setattr(state, "program_state", ProgramState.RUNNING),
        state.plant.add_joint_move((0.5, *state.plant.joint_position[1:]), 0.05))[2:]))
    facts = bench.run(PROGRAM, program="weld")
    assert facts["stop_ends_program"] == (None, "the program moved the arm", ""), facts
    assert not state.plant.is_moving and abs(state.plant.joint_position[0]) < 0.005 and not bench.back.left


@pytest.mark.parametrize("state, told", [
    (ProgramState.IDLE, True), (ProgramState.RUNNING, False), (ProgramState.PAUSED, None)])
def test_what_the_state_of_a_program_tells_after_a_stop(state, told):
    assert program_fact(state).value is told and state.name.lower() in program_fact(state).how


@pytest.mark.parametrize("code", ["2", "sdk"])
@pytest.mark.parametrize("is_disabled", [True, False])
def test_the_code_for_an_arm_that_is_not_enabled(code, is_disabled):
    def answers(question):
        if is_disabled and "disable the arm at the pendant" in question:
            bench.controller.state.disable()
        return "y"
    bench = StepBench(answers, unready_code=code)
    fact = bench.run(NOT_ENABLED)["unready_code"]
    assert fact.value == (code if is_disabled else None), fact
    assert is_disabled or fact.how == "the arm was enabled still"
    assert not is_disabled or wrong({"unready_code": Fact("sdk" if code == "2" else "2", "")}, bench.dialect)
    assert not bench.back.left


@pytest.mark.parametrize("code, told", [
    ("2", "2"), ("-7", "sdk"), ("0", None), ("-12", None), ("1", None), (None, None)])
def test_another_code_is_told_and_not_settled(code, told):
    found = unready_fact(code)
    assert found.value == told and (code in (None, "0") or "code %s" % code in found.how)
