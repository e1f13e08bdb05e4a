"""A trajectory in custody: streamed on its path, joined, paused, cancelled, and stopped by whatever contradicts it."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.procedures.pausing import pause, resume, set_speed
from jaka_ros_driver.client.core.trajectory import StartChanged
from jaka_ros_driver.commands import ServoJoint
from jaka_ros_driver.errors import (
    CommandRejected,
    GoalToleranceViolated,
    InvalidCommand,
    PathToleranceViolated,
    StopCause,
)
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.trajectory.build import BuildOptions, build_path
from jaka_ros_driver.trajectory.points import JointTrajectory, TrajectoryPoint, TrajectoryTolerances

MODEL = load_model("zu7")
REST = (0.0,) * 6
LOOSE = TrajectoryTolerances((None,) * 6, (0.01,) * 6, 1.0)


class Following(Story):
    """An arm that is where it was sent one cycle ago, unless its ``joints`` are held by the test.

    Attributes:
        is_held: The arm stays where it is.
        queued: Frames that the controller holds back, as after a stall on the link.
    """

    def __init__(self, **settings):
        self.queued = 0
        super().__init__(**settings)
        self.is_held = False
        self.fields["rapidrate"] = 1.0

    def run(self, seconds, **fields):
        for _ in range(int(round(seconds / PERIOD))):
            sent = frames(self)[:-self.queued or None]
            super().run(PERIOD, **fields)
            if sent and not self.is_held:
                self.joints = list(sent[-1])
        return self

    def follow(self, call, points, tolerances=LOOSE, elapsed=0.0, lead=0.016):
        """Follow points as the shell does: start, path, audit, goal."""
        token = "start of %s" % call
        self.core.trajectory_start(token, lead, self.core.stops, self.now)
        self.perform()
        _, start, error = self.answers[token]
        if error is not None:
            raise error
        path = build_path(start.begin, JointTrajectory(tuple(points)), elapsed, MODEL, BuildOptions(0.01))
        self.core.follow(call, path, start, tolerances, self.core.stops, self.now)
        self.perform()
        return path


def to(time, *ways):
    """Return a point of rest: joint 1 this far from home, and so on."""
    return TrajectoryPoint(time, tuple(h + w for h, w in zip(HOME, ways + REST[len(ways):])), REST)


def frames(story):
    return [tuple(math.radians(q) for q in request["jointPosition"])
            for _, request in story.sent if request["cmdName"] == "servo_j"]


def moves(story):
    """Return the motion of joint 1 from frame to frame, rad."""
    path = [frame[0] for frame in frames(story)]
    return [b - a for a, b in zip(path, path[1:])]


def following(*points, **settings):
    story = Following(**settings)
    story.follow("goal", points or (to(2.0, 0.5),))
    return story


def test_a_trajectory_is_sent_frame_by_frame_and_answered_at_rest_on_its_last_point_with_servo_mode_left():
    story = following(to(1.0, 0.3, 0.1))
    story.run(1.05)
    assert story.error("goal") == "pending" and story.servo_mode
    story.run(0.4)
    assert story.error("goal") is None and not story.servo_mode and story.core.is_free
    assert frames(story)[-1] == pytest.approx(tuple(h + w for h, w in zip(HOME, (0.3, 0.1, 0, 0, 0, 0))), abs=1e-9)
    moving = [step for step in moves(story) if abs(step) > 1e-9]
    assert len(moving) == pytest.approx(1.0 / PERIOD, abs=1)
    assert story.count("stop_program") == 0 and story.told == [True, False]


def test_the_path_is_that_of_its_polynomials_at_each_cycle():
    story = Following()
    path = story.follow("goal", (to(0.6, 0.2), to(1.2, -0.1, 0.2)))
    story.run(1.6)
    begun = next(index for index, step in enumerate(moves(story)) if abs(step) > 0.0)
    for number, frame in enumerate(frames(story)[begun + 1:begun + 140], 1):
        assert frame == pytest.approx(path.at(number * PERIOD).position, abs=1e-9)


def test_a_trajectory_that_starts_later_is_held_until_then():
    story = Following()
    story.follow("goal", (to(1.0, 0.3),), elapsed=-0.5)
    story.run(0.45)
    assert story.servo_mode and not any(abs(step) > 0.0 for step in moves(story))
    story.run(1.1)
    assert story.joints[0] == pytest.approx(0.3, abs=1e-6)


def test_a_trajectory_that_is_replaced_before_servo_mode_is_on_does_not_jump():
    story = Following()
    story.replies["servo_move"] = None
    story.follow("goal", (to(1.0, 0.3),), elapsed=-0.5)
    story.run(0.1)
    story.follow("next", (to(0.6, 0.3),))
    story.run(0.3)
    assert not frames(story)
    del story.replies["servo_move"]
    story.servo_mode = True
    story.reply("servo_move")
    story.run(1.2)
    assert story.error("next") is None and max(map(abs, moves(story))) < 0.01


def test_late_cycles_are_left_out_and_made_up_for_without_a_jump():
    story = following(to(2.0, 0.5)).run(0.8)
    before = max(moves(story))
    story.now += 0.056
    story.frame()
    story.core.tick(story.now)
    story.perform()
    story.run(1.3)
    assert story.core.late_servo_cycles >= 6
    assert max(moves(story)) < 1.15 * max(before, 1.875 * 0.25 * PERIOD)
    times = [at for at, request in story.sent if request["cmdName"] == "servo_j"]
    first = next(i for i, step in enumerate(moves(story)) if abs(step) > 1e-12)
    last = max(i for i, step in enumerate(moves(story)) if abs(step) > 1e-12)
    assert times[last + 1] - times[first] == pytest.approx(2.0, abs=0.02)


def test_no_more_than_a_tenth_of_a_second_of_late_cycles_is_made_up_for():
    story = following(to(4.0, 0.5)).run(0.8)
    for _ in range(10):
        story.now += 0.056
        story.frame()
        story.core.tick(story.now)
        story.perform()
    late = PERIOD * story.core.late_servo_cycles
    assert late > 0.4
    story.run(4.5)
    times = [at for at, request in story.sent if request["cmdName"] == "servo_j"]
    moving = [i for i, step in enumerate(moves(story)) if abs(step) > 1e-12]
    assert times[moving[-1] + 1] - times[moving[0]] == pytest.approx(4.0 + late - 0.1, abs=0.05)


def test_a_cancelled_trajectory_brakes_on_its_path_and_ends_at_rest():
    story = following(to(1.0, 1.0, 0.5)).run(0.6)
    assert story.core.cancel_trajectory("goal", story.now)
    story.run(0.5)
    assert story.cause("goal") is StopCause.CANCELLED and story.core.is_free and not story.servo_mode
    assert story.count("stop_program") == 0
    changes = [abs(b - a) / PERIOD ** 2 for a, b in zip(moves(story), moves(story)[1:])]
    assert max(changes) <= 4.0 * math.pi * 1.03
    at = frames(story)[-1]
    assert at[0] - HOME[0] == pytest.approx(2.0 * (at[1] - HOME[1]), abs=1e-9), "it left its path"
    assert not story.core.cancel_trajectory("goal", story.now)


def test_another_goal_does_not_cancel_this_one():
    story = following().run(0.5)
    assert not story.core.cancel_trajectory("other", story.now)
    assert story.core.cancel_trajectory(None, story.now)


def test_a_trajectory_replaces_the_one_under_way_and_joins_it_where_it_is():
    story = following(to(2.0, 0.8)).run(0.9)
    story.follow("next", (to(1.0, 0.2),))
    assert story.cause("goal") is StopCause.REPLACED and story.error("next") == "pending"
    story.run(1.5)
    assert story.error("next") is None and story.joints[0] == pytest.approx(0.2, abs=1e-6)
    assert story.count("servo_move") == 2 and story.count("stop_program") == 0
    changes = [abs(b - a) / PERIOD ** 2 for a, b in zip(moves(story), moves(story)[1:])]
    assert max(changes) <= 4.0 * math.pi


def test_a_path_that_comes_too_late_to_join_is_refused_and_the_one_under_way_goes_on():
    story = following(to(2.0, 0.8)).run(0.9)
    story.core.trajectory_start("start", 0.016, 0, story.now)
    story.perform()
    start = story.answers["start"][1]
    path = build_path(start.begin, JointTrajectory((to(1.0, 0.2),)), 0.0, MODEL, BuildOptions(0.01))
    story.run(0.05)
    story.core.follow("next", path, start, LOOSE, 0, story.now)
    story.perform()
    assert isinstance(story.error("next"), StartChanged) and story.error("goal") == "pending"


def test_an_arm_that_has_moved_since_the_audit_is_not_streamed():
    story = Following()
    story.core.trajectory_start("start", 0.0, 0, story.now)
    story.perform()
    start = story.answers["start"][1]
    path = build_path(start.begin, JointTrajectory((to(1.0, 0.2),)), 0.0, MODEL, BuildOptions(0.01))
    story.joints[0] += 0.005
    story.run(0.2)
    story.core.follow("goal", path, start, LOOSE, 0, story.now)
    story.perform()
    assert isinstance(story.error("goal"), StartChanged) and story.count("servo_move") == 0 and story.core.is_free


def test_a_stop_ends_it_and_no_frame_follows():
    story = following().run(0.8)
    story.core.stop("stop", story.now)
    story.perform()
    sent = story.count("servo_j")
    story.run(0.5)
    assert story.cause("goal") is StopCause.STOPPED and story.count("servo_j") == sent
    assert story.error("stop") is None and not story.servo_mode and story.core.is_free


@pytest.mark.parametrize("when", ["before its start is known", "while its path is audited"])
def test_a_stop_ends_a_trajectory_that_was_asked_for_before_it(when):
    story = Following()
    if when == "before its start is known":
        story.core.stop("stop", story.now)
        story.run(0.3)
        story.core.trajectory_start("start", 0.016, 0, story.now)
        story.perform()
        assert story.cause("start") is StopCause.STOPPED
        return
    story.core.trajectory_start("start", 0.016, 0, story.now)
    story.perform()
    start = story.answers["start"][1]
    path = build_path(start.begin, JointTrajectory((to(1.0, 0.2),)), 0.0, MODEL, BuildOptions(0.01))
    story.core.stop("stop", story.now)
    story.run(0.3)
    story.core.follow("goal", path, start, LOOSE, 0, story.now)
    story.perform()
    assert story.cause("goal") is StopCause.STOPPED and not story.run(0.3).servo_mode and not frames(story)


@pytest.mark.parametrize("fields, cause", [
    ({"emergency_stop": 1, "enabled": False}, StopCause.EMERGENCY_STOP),
    ({"protective_stop": 1}, StopCause.PROTECTIVE_STOP),
    ({"enabled": False}, StopCause.NOT_ENABLED),
    ({"errcode": "0x10F003"}, StopCause.FAULT)])
def test_whatever_contradicts_it_stops_the_arm_and_nothing_resumes(fields, cause):
    story = following().run(0.8)
    story.run(0.016, **fields)
    sent = story.count("servo_j")
    story.run(1.0)
    assert story.cause("goal") is cause and story.count("stop_program") >= 1 and story.count("servo_j") == sent


def test_a_refused_frame_stops_the_arm():
    story = following().run(0.8)
    story.replies["servo_j"] = "-8"
    story.run(0.5)
    assert story.cause("goal") is StopCause.FAULT and "servo stream ended" in str(story.error("goal"))
    assert story.count("stop_program") == 1


def test_a_lost_link_ends_it_and_the_stop_is_the_first_word_afterwards():
    story = following().run(0.8)
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert story.cause("goal") is StopCause.LINK_LOST
    del story.sent[:]
    story.run(0.3)
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    story.run(0.5)
    assert story.names()[:2] == ["servo_move", "stop_program"] and story.count("servo_j") == 0


def test_servo_mode_that_is_refused_leaves_the_arm_free():
    story = Following()
    story.replies["servo_move"] = "2"
    story.follow("goal", (to(1.0, 0.3),))
    assert isinstance(story.error("goal"), CommandRejected)
    assert story.run(0.3).core.is_free and not frames(story)


def test_an_arm_that_does_not_follow_is_stopped_by_name():
    story = following(to(2.0, 1.0)).run(0.6)
    story.is_held = True
    story.run(0.7)
    assert isinstance(story.error("goal"), PathToleranceViolated) and story.count("stop_program") == 1


def test_a_path_tolerance_of_the_goal_holds_for_its_joint():
    story = Following()
    tolerances = TrajectoryTolerances((None, 0.005, None, None, None, None), (0.01,) * 6, 1.0)
    story.follow("goal", (to(2.0, 0.5, 0.5),), tolerances)
    story.run(0.6)
    assert story.error("goal") == "pending"
    story.is_held = True
    story.run(0.3)
    assert isinstance(story.error("goal"), PathToleranceViolated) and "joint 2" in str(story.error("goal"))


@pytest.mark.parametrize("lag, is_violated", [(25, False), (29, True)])
def test_a_path_tolerance_of_the_goal_grants_a_lag_of_a_fifth_of_a_second(lag, is_violated):
    story = Following()
    story.queued = lag - 1  # cycles behind what was sent
    story.follow("goal", (to(2.0, 0.5),), TrajectoryTolerances((1e-4,) * 6, (0.01,) * 6, 1.0))
    story.run(1.5)
    assert isinstance(story.error("goal"), PathToleranceViolated) is is_violated


def test_an_arm_that_rests_beside_its_goal_violates_the_goal_tolerance():
    story = Following()
    story.follow("goal", (to(1.0, 0.3),), TrajectoryTolerances((None,) * 6, (0.01,) * 6, 0.5))
    story.run(0.9)
    story.is_held = True
    story.joints[0] -= 0.015
    story.run(0.6)
    assert story.error("goal") == "pending", "the goal grants half a second"
    story.run(0.5)
    assert isinstance(story.error("goal"), GoalToleranceViolated) and "joint 1 is 0.0" in str(story.error("goal"))


def test_an_arm_that_somebody_moves_from_its_goal_before_the_end_is_not_said_to_be_there():
    story = following(to(1.0, 0.3)).run(1.05)
    while story.servo_mode:
        story.run(PERIOD)
    story.is_held = True
    story.joints[0] -= 0.05
    story.run(0.5)
    assert story.cause("goal") is StopCause.STOPPED and "moved away" in str(story.error("goal"))


def test_nothing_else_moves_the_arm_meanwhile():
    story = following().run(0.5)
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    assert isinstance(story.error("servo"), InvalidCommand) and "a trajectory owns" in str(story.error("servo"))


# ---- speed, pause and resume ----

@pytest.mark.parametrize("rate, lasts", [(0.5, 2.0), (1.0, 1.0), (100.0, 1.0)])  # a firmware may count in per cent
def test_a_trajectory_runs_at_the_controllers_speed_and_never_faster_than_planned(rate, lasts):
    story = following(to(1.0, 0.3)).run(lasts - 0.1, rapidrate=rate)
    assert story.error("goal") == "pending"
    story.run(0.5, rapidrate=rate)
    assert story.error("goal") is None


def test_speed_changes_leave_the_path_and_the_limits_as_they_are():
    story = Following()
    path = story.follow("goal", (to(2.0, 1.5, -0.7), to(4.0, 0.0)))
    wanted = {1.0: 1.2, 0.3: 0.8, 0.0: 0.5}
    for rate, seconds in wanted.items():
        story.run(seconds, rapidrate=rate)
    assert max(map(abs, moves(story)[-20:])) == 0.0
    story.run(4.0)
    assert story.error("goal") is None
    steps = moves(story)
    assert max(abs(b - a) / PERIOD ** 2 for a, b in zip(steps, steps[1:])) <= 4.0 * math.pi * 1.03
    nearest = [path.at(k * 0.001).position for k in range(4001)]
    for frame in frames(story)[::40]:
        assert min(max(abs(a - b) for a, b in zip(frame, at)) for at in nearest) < 1e-3


def test_pause_rests_on_the_path_and_resume_goes_on():
    story = following(to(1.5, 1.0)).run(0.7)
    story.core.run("pause", pause(story.core), story.now)
    story.perform()
    assert story.error("pause") == "pending"
    story.run(0.6)
    assert story.error("pause") is None and "paused" in story.answers["pause"][1]
    assert max(map(abs, moves(story)[-10:])) == 0.0 and story.servo_mode
    story.run(5.0)
    assert story.error("goal") == "pending" and max(map(abs, moves(story)[-10:])) == 0.0
    story.core.run("resume", resume(story.core), story.now)
    story.perform()
    story.run(1.6)
    assert story.error("resume") is None and story.error("goal") is None


def test_a_trajectory_is_paused_by_its_stream_and_not_by_the_controller():
    story = following().run(0.8)
    story.core.run("pause", pause(story.core), story.now)
    story.run(0.5)
    assert story.error("pause") is None and story.count("pause_program") == 0
    held = frames(story)[-1]
    story.run(0.3)
    assert frames(story)[-1] == held and 0.0 < held[0] < 0.5


def test_an_arm_that_lags_behind_its_stream_is_paused_only_where_it_is_held():
    story = following(to(1.5, 1.0))
    story.queued = 40
    story.run(0.3)
    assert max(map(abs, moves(story))) > 0.0 and story.joints == list(HOME)
    story.core.run("pause", pause(story.core), story.now)
    story.run(0.24)
    assert max(map(abs, moves(story)[-10:])) == 0.0 and story.error("pause") == "pending"
    story.run(0.5)
    assert story.error("pause") is None and story.joints == list(frames(story)[-1])


def test_an_arm_that_keeps_a_distance_from_its_stream_is_paused_when_no_frame_can_be_left():
    story = following(to(1.5, 1.0)).run(0.7)
    story.core.run("pause", pause(story.core), story.now)
    story.run(0.15)
    story.is_held = True
    story.joints = [joint + 0.003 for joint in story.joints]
    story.run(0.4)
    assert max(map(abs, moves(story)[-10:])) == 0.0 and story.error("pause") == "pending"
    story.run(0.3)
    assert story.error("pause") is None


def test_a_paused_trajectory_that_is_stopped_does_not_resume():
    story = following(to(1.5, 1.0)).run(0.7)
    story.core.run("pause", pause(story.core), story.now)
    story.run(0.6)
    story.core.stop("stop", story.now)
    story.perform()
    story.run(0.5)
    story.core.run("resume", resume(story.core), story.now)
    story.perform()
    assert isinstance(story.error("resume"), InvalidCommand) and story.cause("goal") is StopCause.STOPPED


def test_resume_without_a_pause_and_pause_without_a_motion_are_refused():
    story = following().run(0.5)
    story.core.run("resume", resume(story.core), story.now)
    idle = Following()
    idle.core.run("pause", pause(idle.core), idle.now)
    story.perform()
    idle.perform()
    assert "is not paused" in str(story.error("resume")) and "moves nothing" in str(idle.error("pause"))


def test_the_cause_that_the_feed_shows_is_told_when_the_stop_is_accepted():
    story = following().run(0.8)
    story.replies.update({"servo_j": "-8", "stop_program": None})
    story.run(0.03)
    story.run(0.03, emergency_stop=1)
    assert story.error("goal") == "pending"
    story.reply("stop_program")
    assert story.run(0.2).cause("goal") is StopCause.EMERGENCY_STOP


def test_a_cancelled_trajectory_whose_arm_is_not_seen_at_rest_is_stopped():
    story = following(to(2.0, 0.5)).run(0.6)
    assert story.core.cancel_trajectory("goal", story.now)
    for n in range(300):
        story.run(PERIOD)
        story.is_held = True
        story.joints[0] += 0.002 * (-1) ** n
    assert story.count("stop_program") >= 1 and story.cause("goal") is StopCause.CANCELLED


def test_time_that_was_lost_is_made_up_for_at_a_rate_of_five_hundredths_more():
    steady = [TrajectoryPoint(time, (HOME[0] + way,) + HOME[1:], (0.2,) + REST[1:]) for time, way in (
        (1.0, 0.1), (4.0, 0.7))]
    story = following(*steady, to(5.0, 0.8)).run(2.0)
    step = 0.2 * PERIOD
    assert moves(story)[-1] == pytest.approx(step, rel=1e-3)
    sent = len(frames(story))
    story.now += 0.05
    story.run(0.5)
    assert max(moves(story)[sent:]) == pytest.approx(1.05 * step, rel=2e-3)


def test_the_next_frame_is_made_ready_before_it_is_due(monkeypatch):
    story, encoded, encode = following().run(0.5), [], codec.encode
    monkeypatch.setattr(codec, "encode", lambda command: encoded.append(command) or encode(command))
    for _ in range(20):
        story.now += PERIOD
        story.frame()
        sent = len(frames(story))
        del encoded[:]
        story.core.tick(story.now)
        story.perform()
        assert len(frames(story)) == sent + 1 and not any(isinstance(one, ServoJoint) for one in encoded)
        story.joints = list(frames(story)[-1])
        story.core.prepare()


def test_a_speed_that_the_controller_does_not_take_up_is_told():
    story = Following()
    story.core.run("speed", set_speed(story.core, 0.5), story.now)
    story.run(1.5)
    assert story.error("speed") == "pending"
    assert story.run(1.0).cause("speed") is StopCause.TIMEOUT and "still reports 100 %" in str(story.error("speed"))
    story.core.run("again", set_speed(story.core, 0.5), story.now)
    story.fields["rapidrate"] = 0.503
    assert story.run(0.1).error("again") is None


# ---- where the joints are wanted at a moment ----

def wanted(story, at):
    """Return position and velocity of joint 1 at that moment, rad and rad/s."""
    state = story.core.desired_at(at)
    return state.position[0], state.velocity[0]


def test_what_is_said_of_a_later_moment_is_what_the_arm_was_sent_when_it_has_come():
    story = following(to(2.0, 0.5)).run(0.5)
    moment = story.now + 0.6
    foretold = wanted(story, moment)
    assert wanted(story, story.now)[0] < foretold[0]
    story.run(0.6)
    assert frames(story)[-1][0] == pytest.approx(foretold[0], abs=0.01)
    assert wanted(story, story.now) == pytest.approx(foretold, abs=1e-6)
    story.run(0.5)
    assert wanted(story, moment) == pytest.approx(foretold, abs=1e-6)
    assert foretold[1] == pytest.approx((wanted(story, moment + 1e-3)[0] - wanted(story, moment - 1e-3)[0]) / 2e-3)


def test_what_is_said_of_a_moment_behind_the_end_is_the_last_point_at_rest():
    story = following(to(1.0, 0.3)).run(0.4)
    assert wanted(story, story.now + 60.0) == pytest.approx((0.3, 0.0))


def test_a_later_moment_assumes_the_speed_override_of_now():
    story = following(to(2.0, 0.5))
    story.fields["rapidrate"] = 0.5
    story.run(0.8)
    moment = story.now + 1.0
    foretold = wanted(story, moment)
    story.run(1.1)
    assert wanted(story, moment) == pytest.approx(foretold, abs=1e-6)
    story.fields["rapidrate"] = 1.0
    story.run(0.3)
    assert wanted(story, moment) == pytest.approx(foretold, abs=1e-6), "the past keeps the rate that it had"


def test_in_a_pause_the_arm_is_wanted_where_it_rests_and_was_wanted_on_the_way_before():
    story = following(to(1.5, 1.0)).run(0.7)
    earlier = story.now - 0.05
    before = wanted(story, earlier)
    story.core.run("pause", pause(story.core), story.now)
    story.run(0.6)
    rests = frames(story)[-1][0]
    assert wanted(story, story.now + 100.0) == wanted(story, story.now) == (pytest.approx(rests), 0.0)
    assert wanted(story, earlier) == pytest.approx(before, abs=1e-6) and before[1] > 0.5


def test_a_trajectory_that_starts_later_is_wanted_at_its_start_until_then():
    story = Following()
    story.follow("goal", (to(1.0, 0.3),), elapsed=-0.5)
    began = story.now
    assert wanted(story, began + 0.45) == (0.0, 0.0)
    assert wanted(story, began + 1.5) == pytest.approx((0.3, 0.0))
    story.run(0.2)
    assert wanted(story, began + 1.0) == pytest.approx((0.15, 0.45), abs=1e-6)


def test_of_a_moment_before_the_running_path_nothing_is_said():
    story = Following().run(1.0)
    assert story.core.desired_at(story.now) is None
    story.follow("goal", (to(2.0, 0.5),))
    story.run(0.5)
    with pytest.raises(InvalidCommand, match="before the running trajectory was begun"):
        story.core.desired_at(story.now - 0.6)
    story.follow("next", (to(1.0, 0.2),))
    ahead = story.now + 0.7
    foretold = wanted(story, ahead)
    story.run(0.1)
    with pytest.raises(InvalidCommand, match="or joined"):
        story.core.desired_at(story.now - 0.2)
    assert wanted(story, ahead) == pytest.approx(foretold, abs=1e-6)


def test_of_an_arm_that_is_being_stopped_nothing_is_said():
    story = following().run(0.8)
    story.core.stop("stop", story.now)
    story.perform()
    with pytest.raises(InvalidCommand, match="is being stopped"):
        story.core.desired_at(story.now)
    assert story.run(1.0).core.desired_at(story.now) is None
