"""A program of the controller's own in custody: from before it is played until it is over and the arm rests."""
import pytest
from stories import HOME, Story

from jaka_ros_driver.clearance.guard import DEFAULT_MARGIN, MotionGuard
from jaka_ros_driver.clearance.workspace import workspace_of
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.procedures import programs
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model

IDLE, LOADING, PAUSED, RUNNING = range(4)


def with_program(state=IDLE, **settings):
    story = Story(**settings)
    story.fields["interp_state"] = state
    return story.run(0.1)


def play(story, call="play", end="end"):
    story.core.play(call, end, story.now)
    story.perform()
    return story


def running():
    story = play(with_program()).run(0.1)
    story.fields["interp_state"] = RUNNING
    return story.run(0.1)


def ask(story, call, procedure, exclusive=None):
    story.core.run(call, procedure(story.core), story.now, exclusive)
    story.perform()
    return story


def test_the_caller_is_told_when_the_program_is_seen_running_and_the_guard_before_it_is_played():
    story = play(with_program())
    assert story.told == [True] and story.names()[-1] == "play_program"
    assert story.run(0.5).error("play") == "pending", "accepted is not yet running"
    story.fields["interp_state"] = RUNNING
    assert story.run(0.1).error("play") is None and story.error("end") == "pending" and not story.core.is_free


def test_it_is_over_when_the_feed_says_so_and_the_arm_rests():
    story = running().run(30.0)
    assert not story.core.is_free and story.count("stop_program") == 0
    story.fields["interp_state"] = IDLE
    assert story.run(0.7, move=0.4).error("end") == "pending", "the arm still moves"
    assert story.run(0.5, move=0.4).error("end") is None and story.core.is_free and story.told == [True, False]


def test_a_moment_of_idle_frames_does_not_end_it():
    story = running()
    for _ in range(5):
        story.run(0.2, interp_state=IDLE).run(0.1)
    assert story.error("end") == "pending" and not story.core.is_free


def test_a_program_that_is_not_seen_running_is_stopped():
    story = play(with_program()).run(2.1)
    assert story.cause("play") is StopCause.TIMEOUT and story.count("stop_program") == 1
    assert story.run(0.9).core.is_free


def test_a_refusal_is_told_and_the_arm_is_free_again():
    story = with_program()
    story.replies["play_program"] = "2"
    play(story)
    assert isinstance(story.error("play"), CommandRejected) and isinstance(story.error("end"), CommandRejected)
    assert story.run(0.3).core.is_free and story.count("stop_program") == 0


@pytest.mark.parametrize("state", [LOADING, PAUSED, RUNNING])
def test_only_an_idle_program_is_played(state):
    story = play(with_program(state))
    assert isinstance(story.error("play"), InvalidCommand) and story.count("play_program") == 0
    assert "it must be idle" in str(story.error("play"))


def test_nothing_is_played_where_the_feed_does_not_tell_of_programs():
    story = play(Story())
    assert "does not tell whether a program runs" in str(story.error("play")) and story.count("play_program") == 0


def test_everything_else_that_moves_is_refused_meanwhile():
    story = running()
    story.core.move("move", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.core.servo_mode("servo", True, story.now)
    story.core.trajectory_start("trajectory", 0.016, story.core.stops, story.now)
    story.core.play("again", None, story.now)
    story.perform()
    for call in ("move", "servo", "trajectory", "again"):
        assert "a program owns the arm's motion" in str(story.error(call)), call
    assert story.count("joint_move") == story.count("servo_move") == 0 and story.count("play_program") == 1


def test_a_stop_ends_it_and_custody_stays_until_it_is_not_running_any_more():
    story = running()
    story.core.stop("stop", story.now)
    story.perform()
    assert story.error("stop") is None and story.cause("end") is StopCause.STOPPED
    assert not story.run(0.4).core.is_free, "the feed shows it running"
    assert story.run(0.7).count("stop_program") >= 2, "it is stopped again"
    story.fields["interp_state"] = IDLE
    story.run(0.2)
    story.frame(interp_state=RUNNING)
    assert not story.run(0.2).core.is_free, "a frame that shows none between two that show it may be an old one"
    assert story.run(0.15).core.is_free


def test_after_a_stop_the_controller_must_say_too_that_no_program_runs():
    story = running()
    story.extra["get_program_state"] = {"programState": "running"}
    story.core.stop("stop", story.now)
    story.fields["interp_state"] = IDLE  # as in a feed that is behind, and shows the arm before the program
    assert not story.run(1.5).core.is_free and story.count("get_program_state") >= 10
    assert story.count("stop_program") >= 2, "what goes on is stopped again"
    story.extra["get_program_state"] = {"programState": "idle"}
    assert story.run(0.3).core.is_free


def test_while_the_controller_does_not_answer_for_its_program_custody_stays():
    story = running()
    story.replies["get_program_state"] = None
    story.core.stop("stop", story.now)
    story.fields["interp_state"] = IDLE
    assert not story.run(0.5).core.is_free and story.count("get_program_state") == 1
    story.reply("get_program_state", "1")
    assert story.run(0.1).core.is_free, "it does not know the question"


@pytest.mark.parametrize("fields, cause", [
    ({"emergency_stop": 1}, StopCause.EMERGENCY_STOP), ({"protective_stop": 1}, StopCause.PROTECTIVE_STOP),
    ({"enabled": False}, StopCause.NOT_ENABLED), ({"errcode": "0x7abcde"}, StopCause.FAULT)])
def test_what_contradicts_it_stops_it(fields, cause):
    story = running()
    story.fields.update(fields, interp_state=IDLE)
    story.run(0.2)
    assert story.cause("end") is cause and story.count("stop_program") == 1
    assert story.run(0.8).core.is_free


def test_pause_and_resume_are_told_when_the_feed_shows_them():
    story = ask(running(), "pause", programs.pause)
    assert story.names()[-1] == "pause_program" and story.run(0.5).error("pause") == "pending"
    story.fields["interp_state"] = PAUSED
    assert story.run(0.2).error("pause") is None and not story.run(60.0).core.is_free
    story.core.resume_program("resume", None, story.now)
    story.perform()
    assert story.names()[-1] == "resume_program" and story.run(0.5).error("resume") == "pending"
    story.fields["interp_state"] = RUNNING
    assert story.run(0.1).error("resume") is None and not story.core.is_free


def test_rest_from_before_does_not_count_for_the_pause_of_a_program():
    story = ask(running().run(1.0), "pause", programs.pause)
    story.fields["interp_state"] = PAUSED
    assert story.run(0.04).error("pause") == "pending"
    assert story.run(0.1).error("pause") is None


def test_a_pause_that_is_not_seen_fails_in_time():
    story = ask(running(), "pause", programs.pause).run(2.2)
    assert story.cause("pause") is StopCause.TIMEOUT and story.error("end") == "pending"


@pytest.mark.parametrize("state", [IDLE, PAUSED])
def test_only_what_runs_is_paused(state):
    story = ask(with_program(state), "pause", programs.pause)
    assert isinstance(story.error("pause"), InvalidCommand) and story.count("pause_program") == 0


@pytest.mark.parametrize("state", [IDLE, RUNNING])
def test_only_what_is_paused_is_resumed(state):
    story = with_program(state)
    story.core.resume_program("resume", None, story.now)
    story.perform()
    assert isinstance(story.error("resume"), InvalidCommand) and story.count("resume_program") == 0


def test_a_program_that_was_paused_at_the_pendant_is_taken_into_custody_by_resume():
    story = with_program(PAUSED)
    story.core.resume_program("resume", "end", story.now)
    story.perform()
    assert story.told == [True] and story.names()[-1] == "resume_program"
    story.fields["interp_state"] = RUNNING
    assert story.run(0.1).error("resume") is None and not story.core.is_free


def test_a_program_of_the_pendant_keeps_others_from_the_arm_and_can_be_paused():
    story = with_program(RUNNING)
    story.core.move("move", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.perform()
    story.run(2.4)
    assert "a program of the controller's own runs" in str(story.error("move")) and story.count("joint_move") == 0
    ask(story, "pause", programs.pause)
    story.fields["interp_state"] = PAUSED
    assert story.run(0.2).error("pause") is None


def test_loading_needs_an_idle_program_and_reads_the_name_back():
    for held, is_good in (("weld.ngc", True), ("weld", True), ("weld.jks", True), ("paint.ngc", False)):
        story = with_program()
        story.extra = {"get_loaded_program": {"programName": held}}
        ask(story, "load", lambda core: programs.load(core, "weld.ngc"), exclusive=MotionOwner.LOADING)
        assert (story.error("load") is None) is is_good, (held, story.error("load"))
    for state in (LOADING, PAUSED, RUNNING):
        story = ask(with_program(state), "load", lambda core: programs.load(core, "weld.ngc"))
        assert isinstance(story.error("load"), InvalidCommand) and story.count("load_program") == 0


def test_a_stop_is_seen_when_no_program_runs_and_the_arm_rests():
    story = ask(with_program(RUNNING), "seen", programs.see_stopped).run(1.0)
    assert story.error("seen") == "pending"
    story.fields["interp_state"] = IDLE
    assert story.run(0.15).error("seen") is None
    assert ask(with_program(RUNNING), "seen", programs.see_stopped).run(2.1).cause("seen") is StopCause.TIMEOUT


POST = workspace_of({"cylinders": [{"name": "post", "foot": [0.2, 0.35, 0.0], "height": 1.0, "radius": 0.05}]})


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.5])
def test_a_program_that_nears_a_zone_is_stopped_before_it(speed):
    guard = MotionGuard(load_model("zu7"), POST)
    story = play(with_program(workspace=POST)).run(0.1)
    story.fields["interp_state"] = RUNNING
    story.run(0.1)
    while not story.count("stop_program"):
        story.run(0.008, move=2.0, speed=speed)
        assert story.joints[0] < 1.9
    ahead = [story.joints[0] + 0.1 * speed + 0.5 * speed ** 2 / 6.0, *story.joints[1:]]
    assert guard.nearest(tuple(story.joints)).distance > DEFAULT_MARGIN
    assert 0.0 < guard.nearest(tuple(ahead)).distance < 2.0 * DEFAULT_MARGIN, "in time, and not sooner than needed"
    assert story.cause("end") is StopCause.MOTION_GUARD and "from the cylinder 'post'" in str(story.error("end"))


def test_a_program_that_nears_a_zone_as_it_begins_is_not_reported_as_running():
    guard = MotionGuard(load_model("zu7"), POST)
    story = with_program(workspace=POST)
    while guard.nearest(tuple(story.joints)).distance > 2.0 * DEFAULT_MARGIN:
        story.run(0.008, move=1.9)
    play(story.run(0.3)).run(0.1)
    assert story.error("play") == "pending" and story.count("play_program") == 1
    story.fields["interp_state"] = RUNNING
    story.run(0.008, move=1.9, speed=1.5)
    assert story.count("stop_program") == 1 and story.cause("play") is StopCause.MOTION_GUARD
