"""Single steps of the stage of jaka_probe that moves, on simulated controllers of each value of their dimensions."""
import bisect
import contextlib
import math
from types import SimpleNamespace

import pytest
from probe_bench import wrong
from wire_verdict import WireVerdict

from jaka_ros_driver.client.guard import GuardHealth
from jaka_ros_driver.probe import move as stage
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.look import HeardFeed, listen
from jaka_ros_driver.probe.motion import Mover
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.pendant_steps import NOT_ENABLED, PROGRAM, program_fact, unready_fact
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.probe.servo_steps import AHEAD, ahead_fact
from jaka_ros_driver.probe.set_same import SetBack, StageEnded
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.dialect.table import DIMENSIONS, Dialect
from jaka_ros_driver.simulation.simulated_controller import SimulatedController
from jaka_ros_driver.state import ProgramState
from jaka_ros_driver.wire.log import read_log

GUARD = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, ""), notify=lambda moves: None)


class Bench:
    """A simulated controller, and a person beside it who does what is asked for."""

    def __init__(self, log, answers=lambda question: "y", **dialect):
        self.log, self._answers = log, answers
        self.arm = SimulatedController(start="enabled", firmware="1.7.2", log=str(log),
                                       dialect=Dialect.default("1.7.2").replaced(dialect))
        self.back, self.facts, self.told = SetBack(), {}, []

    def ask(self, question, meanwhile=lambda: None):
        self.told.append(question)
        answer = self._answers(question)
        for _ in range(20):
            meanwhile()
        return answer

    def run(self, monkeypatch, *steps, **named):
        """Run steps as the stage does; return the facts."""
        monkeypatch.setattr(stage, "STEPS", steps)
        record = ConnectionLog("127.0.0.1")
        with contextlib.closing(record), self.arm:
            feed = HeardFeed(record.connect("status", self.arm.status_port))
            listen([feed], feed.connection.opened_ns * 1e-9 + 0.5)
            mover = Mover(record, self.arm.command_port, feed, GUARD, AXIS, self.told.append, self.back)
            with contextlib.closing(mover):
                stage.move(mover, self.facts, {}, self, self.told.append, **named)
        self._judge()
        return self.facts

    def _judge(self):
        """Note how far from its start and how fast the joint was, by the log of the arm itself: deg, deg/s in 0.1 s."""
        path = [(at, math.degrees(joints[AXIS])) for at, joints in WireVerdict(self.log).joints()]
        times = [at for at, _ in path]
        self.furthest = max(abs(place - path[0][1]) for _, place in path)
        later = [bisect.bisect_left(times, at + 0.1) for at in times]
        self.fastest = max(abs(path[there][1] - path[here][1]) / (times[there] - times[here])
                           for here, there in enumerate(later) if there < len(path))


def sent(log):
    """Return what the controller was sent on its command port."""
    return b"".join(event.data for event in read_log(str(log))
                    if getattr(event, "port", "") == "command" and event.what == "in")


AHEAD_STEP = next(step for step in stage.STEPS if "servo_queue" in step.facts)


@pytest.mark.parametrize("starvation", ["hold", "repeat", "coast", "fault"])
@pytest.mark.parametrize("waiting", DIMENSIONS["servo_queue"].samples())
def test_how_many_frames_wait_whatever_an_arm_does_without_them(tmp_path, monkeypatch, waiting, starvation):
    bench = Bench(tmp_path / "log.mcap", servo_queue=waiting, starvation=starvation)
    bench.facts["starvation"] = Fact(starvation, "as an earlier step found it")
    facts = bench.run(monkeypatch, AHEAD_STEP)
    assert facts["servo_queue"].value == waiting, facts["servo_queue"]
    assert not wrong(facts, bench.arm.dialect)
    assert wrong({"servo_queue": Fact(4 if waiting != 4 else 1, "")}, bench.arm.dialect), "a wrong fact must be noticed"
    assert bench.furthest < 3.0 and bench.fastest < 7.0


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


@pytest.mark.parametrize("ends", [True, False])
def test_whether_stop_program_ends_a_program(tmp_path, monkeypatch, ends):
    def answers(question):
        if "End it at the pendant" in question:
            bench.arm.operate("end_program")
        return "y"
    bench = Bench(tmp_path / "log.mcap", answers, stop_ends_program=ends)
    bench.arm.operate("load_program", name="weld.jks")
    facts = bench.run(monkeypatch, PROGRAM, program="weld")
    assert facts["stop_ends_program"].value is ends, facts
    assert not wrong(facts, bench.arm.dialect)
    assert wrong({"stop_ends_program": Fact(not ends, "")}, bench.arm.dialect), "a wrong fact must be noticed"
    assert any("may run on" in line for line in bench.told) is not ends, "who is asked to end it"
    assert not bench.back.left


def test_a_program_that_nobody_ends_is_said_first_and_ends_the_stage(tmp_path, monkeypatch):
    bench = Bench(tmp_path / "log.mcap", stop_ends_program=False)
    bench.arm.operate("load_program", name="weld")
    with pytest.raises(StageEnded, match="may run on"):
        bench.run(monkeypatch, PROGRAM, NOT_ENABLED, program="weld")
    assert bench.facts["stop_ends_program"].value is False and "unready_code" not in bench.facts
    assert len(bench.back.left) == 1 and "may run on: end it at the pendant" in bench.back.left[0]


@pytest.mark.parametrize("named, is_played", [("", False), ("paint", False), ("weld", True), ("weld.jks", True)])
def test_only_the_program_that_is_named_and_loaded_is_played(tmp_path, monkeypatch, named, is_played):
    bench = Bench(tmp_path / "log.mcap")
    bench.arm.operate("load_program", name="weld")
    facts = bench.run(monkeypatch, PROGRAM, program=named)
    assert ("stop_ends_program" in facts) == bool(named)
    assert not named or (facts["stop_ends_program"].value is True) == is_played
    assert (b"play_program" in sent(bench.log)) == is_played


def test_a_program_that_moves_the_arm_is_stopped_and_settles_nothing(tmp_path, monkeypatch):
    bench = Bench(tmp_path / "log.mcap")
    bench.arm.operate("load_program", name="weld")
    state = bench.arm.server.controller.state
    monkeypatch.setitem(COMMANDS, "play_program", COMMANDS["play_program"]._replace(handler=lambda state, arguments: (
        setattr(state, "program_state", ProgramState.RUNNING),
        state.plant.add_joint_move((0.5, *state.plant.joint_position[1:]), 0.05))[2:]))
    facts = bench.run(monkeypatch, PROGRAM, program="weld")
    assert facts["stop_ends_program"] == (None, "the program moved the arm", ""), facts
    assert not state.plant.is_moving and abs(state.plant.joint_position[0]) < 0.005 and not bench.back.left


@pytest.mark.parametrize("state, told", [
    (ProgramState.IDLE, True), (ProgramState.RUNNING, False), (ProgramState.PAUSED, None)])
def test_what_the_state_of_a_program_tells_after_a_stop(state, told):
    assert program_fact(state).value is told and state.name.lower() in program_fact(state).how


@pytest.mark.parametrize("code", ["2", "sdk"])
@pytest.mark.parametrize("is_disabled", [True, False])
def test_the_code_for_an_arm_that_is_not_enabled(tmp_path, monkeypatch, code, is_disabled):
    def answers(question):
        if is_disabled and "disable the arm at the pendant" in question:
            bench.arm.operate("disable")
        return "y"
    bench = Bench(tmp_path / "log.mcap", answers, unready_code=code)
    fact = bench.run(monkeypatch, NOT_ENABLED)["unready_code"]
    assert fact.value == (code if is_disabled else None), fact
    assert is_disabled or fact.how == "the arm was enabled still"
    assert not is_disabled or wrong({"unready_code": Fact("sdk" if code == "2" else "2", "")}, bench.arm.dialect)
    assert not bench.back.left


@pytest.mark.parametrize("code, told", [
    ("2", "2"), ("-7", "sdk"), ("0", None), ("-12", None), ("1", None), (None, None)])
def test_another_code_is_told_and_not_settled(code, told):
    found = unready_fact(code)
    assert found.value == told and (code in (None, "0") or "code %s" % code in found.how)
