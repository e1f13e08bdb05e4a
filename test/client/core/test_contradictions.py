"""The table of contradictions, walked as a whole: each condition, each kind of motion, each moment of its life."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core import contradictions
from jaka_ros_driver.client.core.contradictions import MOTIONS, STREAMS, TABLE, AtStart, JumpWatch
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.procedures.pausing import pause
from jaka_ros_driver.client.core.velocity_jog.dead_man import JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.errors import InvalidCommand, JakaError, MotionInterrupted
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint, TrajectoryTolerances

MODEL = load_model("zu7")
REST = (0.0,) * 6
FAR = (1.0,) + HOME[1:]
NOTICED_S = 0.4
"""Time until anything is noticed, s: the heartbeat asks for servo mode every 0.25 s, the next frame shows the rest."""
PAUSABLE = (MotionOwner.MOVE, MotionOwner.PATH, MotionOwner.TRAJECTORY)
REQUESTS = {MotionOwner.MOVE: "joint_move", MotionOwner.PATH: "moveL", MotionOwner.JOG: "jog",
            MotionOwner.PROGRAM: "play_program", **dict.fromkeys(STREAMS, "servo_move")}


class Cell(Story):
    """An arm that obeys: it follows servo frames, else joint 1 goes on slowly while it is moved."""

    moves = False
    wish = None

    def __init__(self):
        super().__init__()
        self.fields.update(interp_state=0, current_user_id=1)
        self.extra = {"kine_inverse": {"jointPosition": [math.degrees(q) for q in HOME]},
                      "kine_forward": {"cartPosition": [450.0, 100.0, 300.0, 180.0, 0.0, 0.0]}}
        self.run(0.1)

    def run(self, seconds, **fields):
        for _ in range(int(round(seconds / PERIOD))):
            if self.wish is not None:
                self.say(self.wish)
            frames = [request["jointPosition"] for _, request in self.sent if request["cmdName"] == "servo_j"]
            if frames:
                self.joints = [math.radians(q) for q in frames[-1]]
            super().run(PERIOD, move=1.0 if self.moves else None, speed=0.1, inpos=not self.moves, **fields)
        return self

    def say(self, velocity):
        try:
            self.core.jog_velocity(JogMessage("/pad", int(1e9 * self.now), 0.0, self.now, Wish(
                c.JogFrame.JOINT, (velocity,) + (0.0,) * 5), ""), self.now)
        except JakaError as error:
            self.answers.setdefault("motion", (self.now, None, error))
        self.perform()

    def begin(self, owner):
        """Ask for a motion of this kind; its call is "motion"."""
        core, now = self.core, self.now
        if owner is MotionOwner.MOVE:
            core.move("motion", c.JointMove(FAR, 0.1, 1.0), True, now)
        elif owner is MotionOwner.PATH:
            line = c.LinearMove(c.Pose((0.5, 0.1, 0.3), (math.pi, 0.0, 0.0)), 0.1, 1.0, 0.0)
            core.move_path("motion", [line], lambda: False, lambda: None, now)
        elif owner is MotionOwner.JOG:
            core.jog("motion", c.Jog(c.JogFrame.JOINT, 0, 0.1), now)
        elif owner is MotionOwner.PROGRAM:
            core.play("motion", None, now)
        elif owner is MotionOwner.SERVO:
            core.servo_mode("motion", True, now)
        elif owner is MotionOwner.VELOCITY_JOG:
            self.say(0.0)
            self.say(0.1)
            self.wish = 0.1
        else:
            self.follow()
        self.perform()
        return self

    def follow(self):
        self.core.trajectory_start("start", 0.016, self.core.stops, self.now)
        self.perform()
        for _ in range(300):
            if "start" in self.answers:
                break
            self.run(PERIOD)
        _, start, error = self.answers.pop("start")
        if error is not None:
            self.answers["motion"] = self.now, None, error
            return
        path = build_path(start.begin, JointTrajectory((TrajectoryPoint(8.0, (0.8,) + HOME[1:], REST),)), 0.0, MODEL,
                          BuildOptions(0.01))
        self.core.follow("motion", path, start, TrajectoryTolerances((None,) * 6, (0.01,) * 6, 1.0), self.core.stops,
                         self.now)

    def under_way(self, owner):
        self.begin(owner).run(0.1)
        if owner is MotionOwner.PROGRAM:
            self.fields["interp_state"] = 3
        self.moves = owner not in STREAMS
        self.run(0.3)
        assert self.core.motion_owner is owner and self.count("stop_program") == 0
        return self

    def suffers(self, condition, owner):
        """Bring the condition about, from now on."""
        self.fields.update({
            "emergency stop": {"emergency_stop": 1}, "protective stop": {"protective_stop": 1},
            "no power": {"powered_on": 0}, "drives disabled": {"enabled": False},
            "new fault": {"errcode": "0x0F0017"}, "hand guiding": {"drag_status": True},
            "another's program": {"interp_state": 3}, "another frame": {"current_user_id": 3}}.get(condition, {}))
        if condition == "program not told":
            del self.fields["interp_state"]
        elif condition == "servo mode":
            self.servo_mode = owner not in STREAMS
        elif condition == "joints jump":
            self.frame(joint_actual_position=[math.degrees(q) + (80.0 if i == 2 else 0.0)
                                              for i, q in enumerate(self.joints)])
        return self

    def is_stopped(self):
        return self.count("stop_program") > 0

    def has_begun(self, owner):
        return self.count(REQUESTS[owner]) > 0


CASES = [(row, owner) for row in TABLE for owner in MOTIONS]
AT_START = [case for case in CASES if case[0].name != "servo mode" or case[1] not in STREAMS]
IDS = ["%s, %s" % (row.name, owner.value) for row, owner in CASES]


def expects_stop(row, owner):
    return owner not in row.except_for


@pytest.mark.parametrize("row, owner", CASES, ids=IDS)
def test_what_forbids_a_motion_ends_one_under_way(row, owner):
    cell = Cell().under_way(owner).suffers(row.name, owner).run(NOTICED_S)
    assert cell.is_stopped() is expects_stop(row, owner)


@pytest.mark.parametrize("row, owner", [case for case in CASES if case[1] in PAUSABLE])
def test_a_motion_that_is_paused_is_ended_too(row, owner):
    cell = Cell().under_way(owner)
    cell.core.run("pause", pause(cell.core), cell.now)
    cell.perform()
    cell.moves = False
    cell.run(0.5, paused=owner is not MotionOwner.TRAJECTORY)
    assert cell.error("pause") is None
    cell.suffers(row.name, owner).run(NOTICED_S, paused=owner is not MotionOwner.TRAJECTORY)
    assert cell.is_stopped() is expects_stop(row, owner)


@pytest.mark.parametrize("row, owner", CASES, ids=IDS)
def test_a_motion_that_is_sent_and_not_accepted_yet_is_ended_too(row, owner):
    cell = Cell()
    cell.replies[REQUESTS[owner]] = None
    cell.begin(owner).run(0.1)
    assert cell.has_begun(owner) and cell.core.motion_owner is owner
    cell.suffers(row.name, owner).run(NOTICED_S)
    enters = row.name == "servo mode" and owner in STREAMS  # it waits for that mode
    assert cell.is_stopped() is (expects_stop(row, owner) and not enters)


@pytest.mark.parametrize("row, owner", AT_START)
def test_what_ends_a_motion_forbids_one_to_begin(row, owner):
    # A stream has no case of servo mode: it begins while that is off.
    cell = Cell().suffers(row.name, owner).run(0.35)
    cell.begin(owner).run(0.1)
    if owner in row.except_for and not (owner is MotionOwner.PROGRAM and row.name == "another's program"):
        assert cell.has_begun(owner), row.except_for[owner]
    elif row.at_start is AtStart.ALLOWS:
        assert cell.has_begun(owner), row.why_at_start
    else:
        cell.run(2.4)
        assert not cell.has_begun(owner) and isinstance(cell.error("motion"), InvalidCommand)


@pytest.mark.parametrize("owner", [MotionOwner.MOVE, MotionOwner.JOG])
def test_what_must_be_waited_for_is(owner):
    # Another's program that ends within 2.3 s costs nobody his motion.
    cell = Cell().suffers("another's program", owner).run(0.2).begin(owner).run(0.3)
    assert cell.error("motion") == "pending" and not cell.has_begun(owner)
    cell.fields["interp_state"] = 0
    assert cell.run(0.2).has_begun(owner)


def test_an_answer_to_a_question_of_before_the_motion_says_nothing_of_it():
    cell = Cell()
    cell.replies["is_in_servomove"] = None
    cell.run(0.3).begin(MotionOwner.MOVE).run(0.1)
    cell.servo_mode = True
    cell.reply("is_in_servomove")
    cell.servo_mode = False
    cell.replies["is_in_servomove"] = "0"
    cell.moves = True
    assert not cell.run(0.5).is_stopped()


def test_a_planted_hole_in_the_table_is_found(monkeypatch):
    # The walk can fail: with one row missing a motion goes on.
    holes = tuple(row for row in TABLE if row.name != "hand guiding")
    monkeypatch.setattr(contradictions, "TABLE", holes)
    assert not Cell().under_way(MotionOwner.MOVE).suffers("hand guiding", MotionOwner.MOVE).run(NOTICED_S).is_stopped()


def test_every_exception_has_a_reason():
    for row in TABLE:
        assert all(reason for reason in row.except_for.values())
        assert row.at_start is not AtStart.ALLOWS or row.why_at_start
    for cells in contradictions.described():
        assert all(cells.values()) and len(cells) == 2 + len(MOTIONS)


def test_a_fast_arm_and_a_late_frame_are_no_jump():
    cell = Cell()
    watch = JumpWatch(MODEL.joint_max_speed)
    state = cell.core.fresh_state(cell.now)

    def at(moment, first):
        joints = (first,) + state.joint_position[1:]
        return type(state)(**{**vars(state), "joint_position": joints, "received_at": moment})
    speed = MODEL.joint_max_speed[0]
    assert not watch.jump(at(10.0, 0.0)) and not watch.jump(at(10.1, 0.1 * speed))
    assert not watch.jump(at(10.108, 0.1 * speed + 0.158 * speed)), "a frame that was 0.15 s late"
    assert "joint 1" in watch.jump(at(10.116, 0.258 * speed + math.radians(60.0)))
    watch.lose_sight()
    assert not watch.jump(at(99.0, 0.0))


def test_what_stops_a_motion_names_itself():
    for row in TABLE:
        cell = Cell()
        owner = MotionOwner.PROGRAM if row.name == "program not told" else MotionOwner.MOVE
        cell.begin(owner).run(0.1)
        cell.moves = True
        if owner is MotionOwner.PROGRAM:
            cell.fields["interp_state"] = 3
        cell.run(0.2).suffers(row.name, owner).run(NOTICED_S)
        log = " ".join(cell.log)
        assert "stopping the arm" in log, row.name
        assert owner is MotionOwner.PROGRAM or isinstance(cell.error("motion"), MotionInterrupted)


def test_what_was_seen_before_the_sight_was_lost_is_not_what_an_arm_jumps_from():
    cell = Cell()
    watch = JumpWatch(MODEL.joint_max_speed)
    state = cell.core.fresh_state(cell.now)
    moved = type(state)(**{**vars(state), "joint_position": (math.radians(60.0),) + state.joint_position[1:],
                           "received_at": state.received_at + 0.008})
    assert not watch.jump(state) and watch.jump(moved)
    watch.jump(state)
    watch.lose_sight()
    assert not watch.jump(moved)
