"""Single steps of the stage of jaka_probe that moves, on simulated controllers of each value of their dimensions."""
import bisect
import contextlib
import functools
import json
import math
import signal
import time
from types import SimpleNamespace

import pytest
from probe_bench import Controller, wrong
from wire_verdict import WireVerdict

from jaka_ros_driver.client.guard import GuardHealth
from jaka_ros_driver.probe import move as stage
from jaka_ros_driver.probe import report
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.look import HeardFeed, listen
from jaka_ros_driver.probe.motion import MotionEnded, Mover, Seen
from jaka_ros_driver.probe.move import blend_fact, dwell, loss_facts
from jaka_ros_driver.probe.moving import AXIS
from jaka_ros_driver.probe.pendant_steps import NOT_ENABLED, PROGRAM, program_fact, unready_fact
from jaka_ros_driver.probe.recorded import ConnectionLog
from jaka_ros_driver.probe.servo_steps import AHEAD, ahead_fact
from jaka_ros_driver.probe.set_same import SetBack, StageEnded
from jaka_ros_driver.simulation.controller.command_table import COMMANDS
from jaka_ros_driver.simulation.controller.replies import CommandRefused
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.simulation.simulated_controller import SimulatedController
from jaka_ros_driver.state import ProgramState
from jaka_ros_driver.wire.log import read_log

GUARD = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, ""), notify=lambda moves: None)


class BusyHost(Exception):
    """The end of a step because this process, or the simulated controller, did not run for a while."""


def again_where_the_host_is_busy(test):
    @functools.wraps(test)
    def again(*arguments, **named):
        for _ in range(3):
            with contextlib.suppress(BusyHost):
                return test(*arguments, **named)
        return test(*arguments, **named)
    return again


class Bench:
    """A simulated controller, and a person beside it who does what is asked for.

    is_here: It runs in this process, so that a test can change it; else in one of its own, with a higher priority.
    """

    def __init__(self, folder, answers=lambda question: "y", is_here=False, **dialect):
        self._answers = answers
        self.dialect = Dialect.default("1.7.2").replaced(dialect)
        if is_here:
            self.log = folder / ("%d.mcap" % time.monotonic_ns())
            self.arm = SimulatedController(start="enabled", firmware="1.7.2", log=str(self.log), dialect=self.dialect)
            self.ports = {name: getattr(self.arm, name) for name in ("command_port", "status_port")}
            self.arm.start()
        else:
            (folder / "dialect.json").write_text(json.dumps(dialect))
            self.arm = Controller(folder, "--dialect", str(folder / "dialect.json"), "--firmware", "1.7.2")
            self.log, self.ports = self.arm.log, self.arm.ports
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
        with contextlib.closing(self.arm), contextlib.closing(record):
            feed = HeardFeed(record.connect("status", self.ports["status_port"]))
            listen([feed], feed.connection.opened_ns * 1e-9 + 0.5)
            mover = Mover(record, self.ports["command_port"], feed, GUARD, AXIS, self.told.append, self.back)
            with contextlib.closing(mover):
                try:
                    stage.move(mover, self.facts, {}, self, self.told.append, **named)
                except (MotionEnded, StageEnded) as ended:
                    if str(ended) in self.back.left and isinstance(ended, StageEnded):
                        raise
                    raise BusyHost(ended) from ended
        self.judge()
        told = " ".join(fact.how for fact in self.facts.values())
        if any(words in told for words in ("no frame came", "held up", "not as fast")):
            raise BusyHost(told)
        return self.facts

    def judge(self):
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


AHEAD_STEP, PROFILE_STEP, BLEND_STEP = stage.STEPS[8], stage.STEPS[1], stage.STEPS[3]


@pytest.mark.parametrize("blends", [True, False])
@pytest.mark.parametrize("others", [{"move_acceleration": 4.0, "feed_period": 0.1},
                                    {"move_acceleration": 0.5, "start_delay": 1.0, "move_jerk_time": 0.2}])
@again_where_the_host_is_busy
def test_whether_the_tolerance_of_a_joint_move_is_kept(tmp_path, monkeypatch, blends, others):
    bench = Bench(tmp_path, joint_blend=blends, **others)
    facts = bench.run(monkeypatch, PROFILE_STEP, BLEND_STEP)
    assert facts["joint_blend"].value is blends, facts["joint_blend"]
    assert not wrong({"joint_blend": facts["joint_blend"]}, bench.dialect)
    assert wrong({"joint_blend": Fact(not blends, "")}, bench.dialect), "a wrong fact must be noticed"
    assert bench.furthest < 3.0 and bench.fastest < 3.5


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


@pytest.mark.parametrize("waiting, starvation", [
    (0, "repeat"), (1, "repeat"), (4, "fault"), (4, "coast"), (49, "hold")])
@again_where_the_host_is_busy
def test_how_many_frames_wait_whatever_an_arm_does_without_them(tmp_path, monkeypatch, waiting, starvation):
    bench = Bench(tmp_path, servo_queue=waiting, starvation=starvation)
    bench.facts["starvation"] = Fact(starvation, "as an earlier step found it")
    facts = bench.run(monkeypatch, AHEAD_STEP)
    assert facts["servo_queue"].value == waiting, facts["servo_queue"]
    assert not wrong(facts, bench.dialect)
    assert wrong({"servo_queue": Fact(4 if waiting != 4 else 1, "")}, bench.dialect), "a wrong fact must be noticed"
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


JOG_STOP_STEP, LOSS_STEP = stage.STEPS[5], stage.STEPS[12]


@pytest.mark.parametrize("notice, second_client", [(0.0, "refused"), (2.5, "coexists"), (5.0, "replaces")])
@again_where_the_host_is_busy
def test_when_a_controller_notices_that_its_client_is_lost(tmp_path, monkeypatch, notice, second_client):
    bench = Bench(tmp_path, link_loss_notice=notice, second_client=second_client)
    facts = bench.run(monkeypatch, LOSS_STEP)
    assert facts["link_loss_notice"].value == pytest.approx(notice, abs=0.3) and facts["link_loss_stops"].value is True
    assert not wrong(facts, bench.dialect)
    assert wrong({"link_loss_notice": Fact(notice + 0.5 if notice < 5.0 else 4.0, "")}, bench.dialect)
    assert bench.furthest < 2.5 and bench.fastest < 2.5 and not bench.back.left
    times = WireVerdict(bench.log).times_of("set_network_exception_handle")
    assert len(times) == 2 and WireVerdict(bench.log).times_of("set_network_exception_handle", times[1], motType=0)


@again_where_the_host_is_busy
def test_a_move_that_a_loss_does_not_stop_ends_in_the_room(tmp_path, monkeypatch):
    bench = Bench(tmp_path, is_here=True)
    monkeypatch.setattr(bench.arm.server.controller.state, "client_lost", lambda: None)
    facts = bench.run(monkeypatch, LOSS_STEP)
    assert facts["link_loss_stops"].value is False and facts["link_loss_notice"].value is None, facts
    assert 2.39 < bench.furthest < 2.41 and not bench.back.left


@again_where_the_host_is_busy
def test_a_controller_that_does_not_know_of_the_loss_of_a_client_is_not_moved(tmp_path, monkeypatch):
    bench = Bench(tmp_path, missing_commands=["set_network_exception_handle"])
    bench.facts["commands_missing"] = Fact(["wait_complete"], "")
    facts = bench.run(monkeypatch, LOSS_STEP)
    assert facts["link_loss_notice"].value is None and "refused with code 1" in facts["link_loss_notice"].how
    assert facts["commands_missing"].value == ["set_network_exception_handle", "wait_complete"]
    assert bench.furthest == 0.0


@again_where_the_host_is_busy
def test_a_setting_that_cannot_be_put_back_is_said(tmp_path, monkeypatch):
    bench = Bench(tmp_path, is_here=True)
    command = COMMANDS["set_network_exception_handle"]

    def handler(state, arguments):
        if arguments.integer("motType") == 0:
            raise CommandRefused()
        return command.handler(state, arguments)
    monkeypatch.setitem(COMMANDS, "set_network_exception_handle", command._replace(handler=handler))
    facts = bench.run(monkeypatch, LOSS_STEP)
    assert facts["link_loss_stops"].value is True
    assert len(bench.back.left) == 1 and "set_network_exception_handle was not put back" in bench.back.left[0]


@again_where_the_host_is_busy
def test_ctrl_c_after_the_loss_stops_the_arm_and_puts_the_setting_back(tmp_path, monkeypatch, ctrl_c):
    bench = Bench(tmp_path, link_loss_notice=5.0)
    hang_up, came = Mover.hang_up, []

    def interrupted(mover):
        is_moving = mover.position != mover.start[AXIS]
        hang_up(mover)
        if is_moving and not came:
            came.append(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
    monkeypatch.setattr(Mover, "hang_up", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bench.run(monkeypatch, LOSS_STEP)
    bench.judge()
    assert bench.furthest < 0.6 and not bench.back.left
    verdict = WireVerdict(bench.log)
    assert verdict.times_of("set_network_exception_handle", motType=0) and verdict.times_of("stop_program")


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
@again_where_the_host_is_busy
def test_the_stops_of_all_joints_end_a_jog_whichever_its_own_does(tmp_path, monkeypatch, ends):
    bench = Bench(tmp_path, jog_stop_ends=ends)
    facts = bench.run(monkeypatch, JOG_STOP_STEP)
    assert facts["jog_stop_ends"].value == ends and facts["jog_stop_all"].value is True, facts
    assert wrong({"jog_stop_ends": Fact("its axis" if ends == "any" else "any", "")}, bench.dialect)
    jogs = [request["jnum"] for _, request in WireVerdict(bench.log).received()
            if request["cmdName"] == "jog" and request["jog_mode"] == 0]
    assert any(jogs[place:place + 6] == list(range(6)) for place in range(len(jogs)))
    assert bench.furthest < 3.0


@again_where_the_host_is_busy
def test_a_jog_that_goes_on_after_the_stops_of_all_joints_is_told(tmp_path, monkeypatch):
    bench = Bench(tmp_path, is_here=True, jog_stop_ends="its axis")
    stops = []
    stop_jog = ControllerState.stop_jog

    def deaf(state, frame, axis):
        stops.append(axis)
        if stops.count(5) != 2:
            stop_jog(state, frame, axis)
    monkeypatch.setattr(ControllerState, "stop_jog", deaf)
    facts = bench.run(monkeypatch, JOG_STOP_STEP)
    assert facts["jog_stop_all"].value is False, (facts, stops)


@pytest.mark.parametrize("ends", [True, False])
@again_where_the_host_is_busy
def test_whether_stop_program_ends_a_program(tmp_path, monkeypatch, ends):
    def answers(question):
        if "End it at the pendant" in question:
            bench.arm.operate("end_program")
        return "y"
    bench = Bench(tmp_path, answers, stop_ends_program=ends)
    bench.arm.operate("load_program", name="weld.jks")
    facts = bench.run(monkeypatch, PROGRAM, program="weld")
    assert facts["stop_ends_program"].value is ends, facts
    assert not wrong(facts, bench.dialect)
    assert wrong({"stop_ends_program": Fact(not ends, "")}, bench.dialect), "a wrong fact must be noticed"
    assert any("may run on" in line for line in bench.told) is not ends, "who is asked to end it"
    assert not bench.back.left


@again_where_the_host_is_busy
def test_a_program_that_nobody_ends_is_said_first_and_ends_the_stage(tmp_path, monkeypatch):
    bench = Bench(tmp_path, stop_ends_program=False)
    bench.arm.operate("load_program", name="weld")
    with pytest.raises(StageEnded, match="may run on"):
        bench.run(monkeypatch, PROGRAM, NOT_ENABLED, program="weld")
    assert bench.facts["stop_ends_program"].value is False and "unready_code" not in bench.facts
    assert len(bench.back.left) == 1 and "may run on: end it at the pendant" in bench.back.left[0]


@pytest.mark.parametrize("named, is_played", [("", False), ("paint", False), ("weld", True), ("weld.jks", True)])
@again_where_the_host_is_busy
def test_only_the_program_that_is_named_and_loaded_is_played(tmp_path, monkeypatch, named, is_played):
    bench = Bench(tmp_path)
    bench.arm.operate("load_program", name="weld")
    facts = bench.run(monkeypatch, PROGRAM, program=named)
    assert ("stop_ends_program" in facts) == bool(named)
    assert not named or (facts["stop_ends_program"].value is True) == is_played
    assert (b"play_program" in sent(bench.log)) == is_played


@again_where_the_host_is_busy
def test_a_program_that_moves_the_arm_is_stopped_and_settles_nothing(tmp_path, monkeypatch):
    bench = Bench(tmp_path, is_here=True)
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
@again_where_the_host_is_busy
def test_the_code_for_an_arm_that_is_not_enabled(tmp_path, monkeypatch, code, is_disabled):
    def answers(question):
        if is_disabled and "disable the arm at the pendant" in question:
            bench.arm.operate("disable")
        return "y"
    bench = Bench(tmp_path, answers, unready_code=code)
    fact = bench.run(monkeypatch, NOT_ENABLED)["unready_code"]
    assert fact.value == (code if is_disabled else None), fact
    assert is_disabled or fact.how == "the arm was enabled still"
    assert not is_disabled or wrong({"unready_code": Fact("sdk" if code == "2" else "2", "")}, bench.dialect)
    assert not bench.back.left


@pytest.mark.parametrize("code, told", [
    ("2", "2"), ("-7", "sdk"), ("0", None), ("-12", None), ("1", None), (None, None)])
def test_another_code_is_told_and_not_settled(code, told):
    found = unready_fact(code)
    assert found.value == told and (code in (None, "0") or "code %s" % code in found.how)
