"""The stage of jaka_probe that moves: what it settles, where the arm stays, and that it rests however it ends."""
import bisect
import contextlib
import dataclasses
import json
import math
import signal
import socket
import time
from types import SimpleNamespace

import pytest
from probe_bench import WAIT, ProbeOnTerminal, command, facts_in, left_room, wrong
from wire_verdict import WireVerdict

from jaka_ros_driver.client.guard import GuardHealth
from jaka_ros_driver.commands import Pose
from jaka_ros_driver.probe.ask import QUESTIONS, UNKNOWN_COMMAND
from jaka_ros_driver.probe.facts import DESCRIBED, Fact, ProbeStage
from jaka_ros_driver.probe.motion import ROOM_M, MotionEnded, Mover, Seen
from jaka_ros_driver.probe.move import MOVES, STEPS, inpos_fact, stop_facts, why_not
from jaka_ros_driver.probe.moving import AXIS, Moving
from jaka_ros_driver.probe.servo_steps import starvation_fact
from jaka_ros_driver.probe.set_same import READ_BACK, SETTINGS, SetBack, uninterrupted
from jaka_ros_driver.protocol.framing import FrameStream
from jaka_ros_driver.protocol.status import parse_status
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.state import ProgramState, RobotState

STATE = RobotState((0.0,) * 6, True, True, True, False, False, tcp_position=(0.4, 0.0, 0.3), tool_id=0, user_frame_id=0)
GUARD = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, ""))
DIMENSIONS_OF_MOVE = {row.dimension for row in DESCRIBED.values() if row.stage is ProbeStage.MOVE} - {""}


def frames(*pieces, period=0.02, inpos=lambda at, moves: not moves):
    """Return frames of pieces (seconds, deg/s)."""
    seen, place, at = [], 0.0, 100.0
    for seconds, speed in pieces:
        for _ in range(round(seconds / period)):
            place, at = place + math.radians(speed) * period, at + period
            seen.append(Seen(at, place, inpos(at - 100.0, speed != 0.0), False))
    return seen


@pytest.mark.parametrize("inpos, told", [
    (lambda at, moves: not moves, "exact"), (lambda at, moves: at > 0.1, "early"), (lambda at, moves: False, "never"),
    (lambda at, moves: at > 3.5, "late"), (lambda at, moves: at > 1.0, None)])
def test_when_inpos_is_true(inpos, told):
    seen = frames((0.5, 0.0), (1.0, 2.0), (3.4, 0.0), inpos=inpos)
    assert inpos_fact(seen, 100.5).value == told
    assert told != "never" or inpos_fact(seen[:150], 100.5).value is None, "it was not watched for long enough"


def test_a_stop_has_a_time_a_way_and_where_frames_suffice_a_deceleration():
    seen = frames((0.5, 3.0), (0.1, 2.0), (0.1, 1.0), (0.5, 0.0))
    found = stop_facts(seen, 100.5)
    assert found["stop_time"].value == pytest.approx(0.2, abs=0.03)
    assert found["stop_distance"].value == pytest.approx(0.3)
    assert found["stop_deceleration"].value == pytest.approx(15.0, rel=0.2)
    abrupt = stop_facts(frames((0.5, 3.0), (0.5, 0.0), period=0.05), 100.5)
    assert abrupt["stop_deceleration"].value is None and abrupt["stop_ends_move"].value is True
    assert stop_facts(seen[:3], 100.06)["stop_time"].value is None


@pytest.mark.parametrize("beyond, speed, has_fault, told", [
    (0.0, 0.0, False, "hold"), (0.02, 0.0, False, "coast"), (0.1, 5.0, False, "repeat"), (-0.5, 0.0, False, None),
    (0.0, 0.0, True, "fault"), (0.009, 0.0, False, None), (-2.0, 5.0, False, None)])
def test_what_an_arm_does_without_servo_frames(beyond, speed, has_fault, told):
    seen = [Seen(100.0 + 0.02 * n, math.radians(1.5 + beyond + 0.02 * n * speed), True, has_fault) for n in range(12)]
    assert starvation_fact(seen, 100.0, math.radians(1.5), math.radians(0.5), False).value == told
    assert starvation_fact(seen, 100.0, math.radians(1.5), math.radians(0.5), True).value is None
    mirrored = [one._replace(position=-one.position) for one in seen]
    assert starvation_fact(mirrored, 100.0, math.radians(-1.5), math.radians(-0.5), False).value == told


@pytest.mark.parametrize("change, reason", [
    ({"is_enabled": False}, "not powered and enabled"), ({"error_code": 0x0F0011}, "not powered and enabled"),
    ({"protective_stop": True}, "not powered and enabled"), ({"is_hand_guided": True}, "hand guiding"),
    ({"rapid_rate": 0.5}, "speed override is 50 %"),
    ({"program_state": ProgramState.RUNNING}, "a program"),
    ({"joint_position": (0.0,) * 5 + (6.0,)}, "too far from zero"), ({}, "")])
def test_an_arm_that_is_not_ready_is_not_moved(change, reason):
    values = {**vars(STATE), **change}
    found = why_not([RobotState(**values)] * 3, [Pose((0.0, 0.1, 0.2), (0.0,) * 3)])
    assert reason in found and bool(reason) == bool(found)


def test_a_tool_that_stands_far_out_or_is_not_known_is_not_swung():
    tools = [Pose((0.0, 0.0, 9.0), (0.0,) * 3), Pose((0.35, 0.0, 0.0), (0.0,) * 3)]
    assert "350 mm from the axis" in why_not([STATE] * 3, tools)
    assert "tools are not known" in why_not([STATE] * 3, None)
    assert "whether the arm moves" in why_not([], [])


@pytest.mark.parametrize("change, reason", [
    ({"joint_position": (0.0,) * 5 + (math.radians(3.6),)}, "joint 6 was 3.6 deg"),
    ({"joint_position": (math.radians(-0.3),) + (0.0,) * 5}, "joint 1 was 0.3 deg"),
    ({"tcp_position": (0.4, 0.0, 0.3 + ROOM_M + 0.001)}, "the tool was 61 mm"),
    ({"tcp_position": None}, "no position of the tool any more"),
    ({"tool_id": 1}, "somebody changed the tool"), ({"is_enabled": False}, "not enabled any more"),
    ({"joint_position": (math.radians(0.1),) * 5 + (math.radians(3.4),), "tcp_position": (0.4, ROOM_M - 0.001, 0.3)},
     "")])
def test_every_frame_is_held_against_the_room(change, reason):
    feed = SimpleNamespace(states=[STATE], on_state=None, connection=SimpleNamespace(is_closed=True))
    arm = Mover(None, 0, feed, GUARD, AXIS, print)
    feed.states.append(RobotState(**{**vars(STATE), **change, "received_at": time.monotonic()}))
    feed.on_state(feed.states[-1])
    raised = ""
    try:
        arm.turn(0.0)
    except Exception as error:
        raised = str(error)
    assert reason in raised and bool(reason) == bool(raised)


class LateArm:
    """An arm whose reply to the first move comes when it moves already."""

    start = (0.0,) * 6

    def __init__(self, late):
        self.late = late
        self.seen = [Seen(time.monotonic() - 0.1, 0.0, True, False)]

    def joints(self, position):
        return (*self.start[:AXIS], position)

    def require(self, command):
        self.see(0.0, False)
        for _ in range(20):
            time.sleep(self.late / 20)
            self.see(self.seen[-1].position + math.radians(0.1), False)
        return {}

    def see(self, place, is_in_position):
        self.seen.append(Seen(time.monotonic(), place, is_in_position, False))

    @property
    def position(self):
        return self.seen[-1].position

    def wait(self, seconds, until=lambda: False):
        for _ in range(3):
            if until():
                return True
            self.see(self.position, True)
        return until()

    def has_rested(self, seconds, after=0.0):
        return True


@pytest.mark.parametrize("late", [0.02, 0.15])
def test_a_move_whose_reply_comes_late_begins_at_once(late):
    facts = {}
    moving = Moving(LateArm(late), facts, {})
    STEPS[0].run(moving)
    assert facts["start_delay"].value == 0.0 and "inpos" in facts and len(moving.curves["move"]) > 10


class WatchedArm:
    """A client of the status port that sees the joint move and rest."""

    def __init__(self, arm):
        self._socket = socket.create_connection(("127.0.0.1", arm.ports["status_port"]), WAIT)
        self._stream = FrameStream()
        self.begun = self._next()

    def close(self):
        self._socket.close()

    def _next(self):
        while True:
            frames = [item for item in self._stream.feed(self._socket.recv(65536)) if isinstance(item, dict)]
            if frames:
                return parse_status(frames[-1], time.monotonic()).joint_position[AXIS]

    def wait_until_it_moves(self):
        deadline = time.monotonic() + WAIT
        while abs(self._next() - self.begun) < math.radians(0.3):
            assert time.monotonic() < deadline

    def wait_until_it_rests(self):
        deadline, place, since = time.monotonic() + WAIT, self._next(), time.monotonic()
        while time.monotonic() < since + 0.6:
            assert time.monotonic() < deadline
            newest = self._next()
            if abs(newest - place) > 1e-5:
                place, since = newest, time.monotonic()


def test_a_probe_that_was_held_up_or_is_to_end_stops_what_it_moves(ctrl_c):
    feed = SimpleNamespace(states=[dataclasses.replace(STATE, received_at=time.monotonic())], on_state=None,
                           connection=SimpleNamespace(is_closed=True))
    trouble = [""]
    guard = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, trouble[0]))
    arm = Mover(None, 0, feed, guard, AXIS, print)
    arm.turn(0.0)
    trouble[0] = "found this driver silent"
    with pytest.raises(MotionEnded, match="silent"):
        arm.turn(0.0)
    trouble[0] = ""
    with pytest.raises(KeyboardInterrupt), uninterrupted(), uninterrupted():
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(MotionEnded, match="signal"):
            arm.turn(0.0)
    arm.turn(0.0)
    time.sleep(1.1)  # a process that does not run: the subject
    feed.states.append(dataclasses.replace(STATE, received_at=time.monotonic()))
    with pytest.raises(MotionEnded, match="held up"):
        arm.turn(0.0)


@pytest.mark.parametrize("end", [lambda: signal.raise_signal(signal.SIGINT), lambda: 1 / 0, lambda: None])
@pytest.mark.parametrize("rest", [lambda: False, lambda: 1 / 0])
def test_an_arm_that_was_not_seen_at_rest_is_told_however_the_step_ends(ctrl_c, end, rest):
    feed = SimpleNamespace(states=[dataclasses.replace(STATE, received_at=time.monotonic())], on_state=None,
                           connection=SimpleNamespace(is_closed=True))
    notified, said, back = [], [], SetBack()
    guard = SimpleNamespace(beat=lambda now: None, health=lambda: GuardHealth(True, 0, ""), notify=notified.append)
    arm = Mover(None, 0, feed, guard, AXIS, said.append, back)
    arm.seen = [Seen(time.monotonic(), 0.0, True, False)]
    arm._come_to_rest = rest
    with pytest.raises((KeyboardInterrupt, ZeroDivisionError, MotionEnded)):
        arm.run(end)
    assert notified == [True], "the guard goes on"
    assert len(back.left) == 1 and "not seen at rest: use the emergency stop" in back.left[0]
    assert back.left[0] in said


def moved(tmp_path, arm, *words, **answers):
    return ProbeOnTerminal(command(tmp_path / "out", arm.ports, "--stage", "move", *words), arm=arm, **answers)


def test_each_dimension_of_motion_is_found_in_its_room_and_the_arm_is_where_it_was(tmp_path, controller):
    dialect = {"start_delay": 0.5, "inpos": "late", "stop_ends_jog": False, "stop_ends_servo": False,
               "jog_stop_ends": "its axis", "pause_pauses_moves": False, "servo_leave_delay": 0.08,
               "starvation": "repeat", "stop_drops_frames": False, "servo_queue": 0, "move_acceleration": 0.5,
               "unready_code": "sdk", "stop_ends_program": False,
               "joint_blend": True, "link_loss_notice": 1.0}
    (tmp_path / "dialect.json").write_text(json.dumps(dialect))
    arm = controller("--dialect", str(tmp_path / "dialect.json"), "--firmware", "1.7.2")
    arm.operate("load_program", name="weld")
    terminal = moved(tmp_path, arm, "--program", "weld")
    assert terminal.end() == 0, terminal.text
    found = facts_in(tmp_path / "out")
    assert {DESCRIBED[name].dimension for name, fact in found.items() if fact.value is not None} >= (
        DIMENSIONS_OF_MOVE - {"move_jerk_time", "move_acceleration"}), "what a curve tells is a matter of the host"
    assert found["twin_angle"].value < 1.0 and "within" in terminal.text  # on a busy computer 0.25 was seen
    assert not wrong(found, Dialect.default("1.7.2").replaced(dialect))
    assert wrong(dict(found, inpos=Fact("exact", "")), Dialect.default("1.7.2").replaced(dialect))
    names = arm.sent()
    assert set(names) <= {*QUESTIONS, UNKNOWN_COMMAND, "malformed", *SETTINGS, *READ_BACK, *MOVES}
    assert set(MOVES) - {"clear_error"} <= set(names)
    assert names.count("play_program") == 1
    assert "set_digital_output" not in names and "io_index_base" not in found, "nobody named an output"
    path = [joints for _, joints in WireVerdict(arm.log).joints()]
    assert max(abs(a - b) for one in path for a, b in zip(one, path[0])) <= math.radians(3.0) and not left_room(path)
    assert max(abs(a - b) for a, b in zip(path[-1], path[0])) < 1e-4
    assert {round(a - b, 9) for one in path for a, b in zip(one[:AXIS], path[0])} == {0.0}
    times = [at for at, _ in WireVerdict(arm.log).joints()]
    later = [bisect.bisect_left(times, at + 0.1) for at in times]
    ways = [abs(path[there][AXIS] - path[here][AXIS]) for here, there in enumerate(later) if there < len(path)]
    assert math.degrees(max(ways)) / 0.1 <= 9.0


@pytest.mark.parametrize("number, code", [
    (signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_arm_whose_probe_is_ended_in_a_motion_comes_to_rest(tmp_path, controller, number, code):
    arm = controller()
    with contextlib.closing(WatchedArm(arm)) as watched:
        terminal = moved(tmp_path, arm)
        terminal.wait_for("step 1 of")
        watched.wait_until_it_moves()
        terminal.process.send_signal(number)
        assert terminal.end() == code, terminal.text
        ended = time.monotonic()
        watched.wait_until_it_rests()
    arm.close()
    verdict = WireVerdict(arm.log)
    assert verdict.times_of("stop_program") and verdict.rest_after(ended - 10.0) < ended + 2.0
    goal = math.radians(2.0)
    gone = abs(verdict.joints()[-1][1][AXIS] - verdict.joints()[0][1][AXIS])
    assert 0.0 < gone < goal - 0.001, "it was stopped before it arrived"


def test_without_the_arms_name_or_a_consent_nothing_moves(tmp_path, controller):
    arm = controller()
    terminal = moved(tmp_path, arm, name=lambda told: "another", confirm=lambda done: "y")
    assert terminal.end() == 1 and "that was not its name" in terminal.text and terminal.confirmed == 0
    again = ProbeOnTerminal(command(tmp_path / "again", arm.ports, "--stage", "move"), confirm=lambda done: "no")
    assert again.end() == 1 and "step 1 was not confirmed" in again.text
    assert not set(arm.sent()) & (set(MOVES) - set(QUESTIONS)) and arm.is_at_rest_throughout()
