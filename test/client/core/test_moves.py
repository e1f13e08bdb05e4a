"""The end of an accepted move: when it counts as completed, when it is stopped, and the answer to its caller."""
import math

import pytest
from stories import HOME, WHOLE_STOP, Story

from jaka_ros_driver.client.core.custody import START_WINDOW_S
from jaka_ros_driver.client.core.procedures.pausing import pause
from jaka_ros_driver.commands import Jog, JogFrame, JointMove, LinearMove, Pose
from jaka_ros_driver.errors import CommandRejected, ConnectionLost, InvalidCommand, ReplyTimeout, StopCause

TARGET = (0.5,) + HOME[1:]
MOVING = {"inpos": False}


def begun(target=TARGET, wait=True, speed=1.0, **settings):
    story = Story(**settings)
    story.core.move("move", JointMove(target, speed, 1.0), wait, story.now)
    story.perform()
    return story


def test_the_guard_is_told_before_the_first_byte():
    story = begun()
    assert story.told == [True] and story.names()[-1] == "joint_move"


def test_a_move_is_completed_when_the_arm_rests_at_the_target():
    story = begun().run(1.0, move=0.5, **MOVING)
    assert story.error("move") == "pending" and story.told == [True]
    story.run(0.2)
    assert story.error("move") is None and story.told == [True, False] and story.core.is_free
    assert story.count("stop_program") == 0


def test_flags_alone_complete_nothing():
    story = begun().run(0.9, move=0.5)
    assert story.error("move") == "pending"
    assert story.run(0.3, move=0.5).error("move") is None


def test_an_arm_that_still_moves_within_the_tolerance_of_its_target_is_not_there_yet():
    story = begun().run(0.99, move=0.5)
    for _ in range(50):
        story.run(0.008, move=0.5, speed=0.05)
        if story.joints[0] < 0.5:
            assert story.error("move") == "pending"
    assert story.run(0.1).error("move") is None


@pytest.mark.parametrize("target, is_there", [(0.504, True), (0.52, False)])
def test_the_tolerance_of_a_joint_target_is_half_a_degree(target, is_there):
    story = begun((target,) + HOME[1:]).run(1.1, move=0.5, **MOVING).run(0.6)
    assert (story.error("move") is None) is is_there
    assert story.count("stop_program") == (0 if is_there else 1)


def test_the_controller_watches_its_client_while_the_arm_moves_and_then_no_more():
    story = begun().run(1.1, move=0.5, **MOVING).run(0.2)
    watched = [request for _, request in story.sent if request["cmdName"] == "set_network_exception_handle"]
    assert [(request["motType"], request["timeLimit"]) for request in watched] == [(2, 300.0), (0, 0.0)]
    assert story.names()[-2:] != ["set_network_exception_handle"] * 2 and story.core.is_free


def test_a_move_to_where_the_arm_is_is_completed_at_rest_by_a_stop_for_it_may_begin_later():
    story = begun(HOME).run(0.05)
    assert story.error("move") == "pending", "rest before the acceptance is no evidence"
    story.run(0.12)
    assert story.error("move") == "pending" and story.count("stop_program") == 1, "it may begin in that very moment"
    story.run(0.12)
    assert story.error("move") is None and story.count("stop_program") == 1


def test_a_move_to_where_the_arm_is_that_moves_when_it_is_ended_is_not_completed():
    story = begun(HOME).run(0.17)
    assert story.error("move") == "pending" and story.count("stop_program") == 1
    story.run(0.1, move=0.02, **MOVING)
    assert "the arm moved" in str(story.run(0.3).error("move"))


@pytest.mark.parametrize("away", [0.009, 0.005, 0.001])
def test_a_short_move_is_not_completed_before_it_has_begun(away):
    story = begun((away,) + HOME[1:]).run(0.5)
    assert story.error("move") == "pending"
    story.run(0.1, move=away)
    assert story.run(0.15).error("move") is None


@pytest.mark.parametrize("false_for, true_for", [(0.0, 0.2), (0.1, 0.0), (0.2, 0.1)])
def test_a_move_that_is_held_near_its_target_is_not_completed_without_a_stop(false_for, true_for):
    # ``inpos`` may be true all the time, false for a moment after the acceptance, or true before the arm rests.
    speed = 0.096 / (false_for + true_for)
    story = begun((0.1,) + HOME[1:]).run(false_for, move=0.095, speed=speed, inpos=False)
    story.run(true_for, move=0.095, speed=speed, inpos=True).run(0.9)
    assert story.error("move") == "pending" and story.count("stop_program") == 0
    assert story.run(0.25).error("move") is None and story.count("stop_program") == 1


def test_where_inpos_has_followed_the_motion_it_tells_the_end():
    story = begun((0.1,) + HOME[1:]).run(0.2, move=0.095, **MOVING).run(0.15)
    assert story.error("move") is None and story.count("stop_program") == 0


def test_a_move_that_is_accepted_and_never_begins_is_stopped_before_it_is_called_a_fault():
    story = begun().run(START_WINDOW_S - 0.05)
    assert story.error("move") == "pending"
    story.run(0.1)
    assert story.cause("move") is StopCause.FAULT and story.count("stop_program") == 1
    assert "it is 0.5000 rad from the target" in str(story.error("move"))


@pytest.mark.parametrize("flags", [
    {"inpos": False}, {"inpos": False, "paused": True}, {"inpos": False, "rapidrate": 0.0}], ids=str)
def test_a_start_that_is_late_is_stopped_whatever_a_flag_says(flags):
    story = begun().run(START_WINDOW_S - 0.05, **flags)
    assert story.error("move") == "pending"
    story.run(0.1, **flags)
    assert story.cause("move") is StopCause.FAULT and story.count("stop_program") == 1


@pytest.mark.parametrize("begin", [
    lambda core, now: core.move("call", JointMove(TARGET, 1.0, 1.0), True, now),
    lambda core, now: core.jog("call", Jog(JogFrame.JOINT, 0, 0.3), now)], ids=["move", "jog"])
@pytest.mark.parametrize("feed", [True, False], ids=["seen", "unseen"])
def test_an_arm_that_is_known_to_begin_late_has_that_much_longer(begin, feed):
    story = Story(start_delay=4.0, jog_timeout=60.0, silence_timeout=60.0)
    begin(story.core, story.now)
    story.perform()
    story.feed = feed
    assert story.run(3.9 + START_WINDOW_S).count("stop_program") == 0
    assert story.run(0.4).count("stop_program") == 1


@pytest.mark.parametrize("inpos", [True, False])
def test_a_jog_that_begins_late_is_stopped_whatever_inpos_says(inpos):
    story = Story()
    story.core.jog("jog", Jog(JogFrame.JOINT, 0, 0.3), story.now)
    story.run(START_WINDOW_S - 0.05, inpos=inpos)
    assert story.error("jog") is None and story.count("stop_program") == 0
    assert story.run(0.1, inpos=inpos).count("stop_program") == 1


@pytest.mark.parametrize("command", [Jog(JogFrame.JOINT, 0, 0.3), JointMove(TARGET, 1.0, 1.0)], ids=["jog", "move"])
def test_a_gap_in_the_feed_gives_a_late_start_no_more_time(command):
    story = Story()
    if isinstance(command, Jog):
        story.core.jog("call", command, story.now)
    else:
        story.core.move("call", command, True, story.now)
    story.run(0.5)
    story.feed = False
    story.run(0.65)
    story.feed = True
    assert story.count("stop_program") == 0
    assert story.run(0.05).count("stop_program") == 1


def test_queueing_more_moves_gives_the_first_no_more_time_to_begin():
    story = begun(wait=False)
    for count in range(3):
        story.run(0.4, **MOVING)
        story.core.move("more %d" % count, JointMove(HOME, 1.0, 1.0), False, story.now)
        story.perform()
    assert story.count("stop_program") == 1


def test_rest_within_a_move_is_waited_out_for_1_s_at_most_unless_the_feed_gives_a_reason():
    for held in ({"paused": True}, {"rapidrate": 0.0}):
        story = begun().run(0.2, move=0.1, **MOVING).run(5.0, inpos=False, **held)
        assert story.error("move") == "pending" and story.count("stop_program") == 0
        story.run(1.0, move=0.5, **MOVING)
        assert story.run(0.2).error("move") is None
    story = begun().run(0.2, move=0.1, **MOVING).run(1.2, **MOVING)
    assert story.cause("move") is StopCause.STOPPED and story.count("stop_program") == 1


def test_rest_elsewhere_than_at_the_target_was_a_stop_and_is_made_sure_of():
    story = begun().run(0.2, move=0.1, **MOVING).run(0.2)
    assert story.error("move") == "pending"
    story.run(0.2)
    assert story.cause("move") is StopCause.STOPPED and story.count("stop_program") == 1
    assert "the arm came to rest 0.4000 rad from the target" in str(story.error("move"))


def test_a_pause_in_being_in_position_is_not_the_end():
    story = begun().run(0.2, move=0.1, **MOVING).run(0.2).run(1.0, move=0.5, **MOVING)
    assert story.run(0.2).error("move") is None


@pytest.mark.parametrize("fields, cause", [
    ({"emergency_stop": 1, "powered_on": 0, "enabled": False}, StopCause.EMERGENCY_STOP),
    ({"protective_stop": 1}, StopCause.PROTECTIVE_STOP),
    ({"enabled": False}, StopCause.NOT_ENABLED),
    ({"powered_on": 0}, StopCause.NOT_ENABLED),
    ({"errcode": "0x0F0017", "errmsg": "unreachable"}, StopCause.FAULT)])
def test_what_contradicts_the_move_stops_it_and_names_itself(fields, cause):
    story = begun().run(0.2, move=0.5, **MOVING)
    story.frame(**fields)
    assert story.cause("move") is cause and story.count("stop_program") == 1
    assert not story.core.is_free and story.told == [True]
    story.run(0.9)
    assert story.core.is_free and story.told[-1] is False


@pytest.mark.parametrize("errcode", ["0x10F0015", "0x020033", "0x050034"])
def test_notes_and_warnings_do_not_stop_a_move(errcode):
    story = begun().run(1.0, move=0.5, errcode=errcode, **MOVING).run(0.2, errcode=errcode)
    assert story.error("move") is None


def test_a_fault_that_stood_before_is_not_this_motions():
    story = Story()
    story.fields = {"errcode": "0xF0017"}
    story.run(0.1)
    story.core.move("move", JointMove(TARGET, 1.0, 1.0), True, story.now)
    story.perform()
    story.run(0.2, move=0.5, **MOVING)
    assert story.error("move") == "pending"
    story.frame(errcode="0xF0018")
    assert story.cause("move") is StopCause.FAULT


def test_a_move_that_takes_too_long_is_stopped():
    story = begun(motion_timeout=2.0).run(2.1, move=0.5, speed=0.1, **MOVING)
    assert story.cause("move") is StopCause.TIMEOUT and story.count("stop_program") == 1


def line_begun(away, **settings):
    story = Story(**settings)
    story.core.move("move", LinearMove(Pose((0.4 + away, 0.1, 0.3), (math.pi, 0.0, 0.0)), 0.1, 0.1), True, story.now)
    story.perform()
    return story


def test_a_line_is_completed_by_the_tool_pose():
    story = line_begun(0.1).run(0.2, move=0.1, **MOVING)
    story.joints[0], story.tcp[0] = 0.2, 499.9
    assert story.run(0.3).error("move") is None


def test_a_line_that_ends_elsewhere_was_stopped():
    story = line_begun(0.1).run(0.2, move=0.1, **MOVING)
    story.joints[0], story.tcp[0] = 0.2, 450.0
    assert story.run(0.5).cause("move") is StopCause.STOPPED
    assert "0.0500 m" in str(story.error("move"))


def test_a_line_that_reaches_its_place_in_another_orientation_was_stopped():
    story = line_begun(0.1).run(0.2, move=0.1, **MOVING)
    story.joints[0], story.tcp[0], story.tcp[5] = 0.2, 500.0, 5.0
    assert story.run(0.5).cause("move") is StopCause.STOPPED
    assert "0.0873 rad" in str(story.error("move"))


def test_where_the_tool_pose_is_not_reported_rest_after_motion_is_the_end():
    story = line_begun(0.1).run(0.3, actual_position=None)
    assert story.error("move") == "pending"
    story.run(0.3, move=0.1, actual_position=None, **MOVING)
    assert story.run(0.5, actual_position=None).error("move") is None


def test_a_refused_move_leaves_the_arm_free_once_it_is_seen_at_rest():
    story = Story()
    story.replies["joint_move"] = "2"
    story.core.move("move", JointMove(TARGET, 1.0, 1.0), True, story.now)
    story.perform()
    assert isinstance(story.error("move"), CommandRejected) and story.told == [True]
    story.run(0.05)
    assert story.told == [True] and not story.core.is_free
    story.run(0.15)
    assert story.told == [True, False] and story.count("stop_program") == 0


def test_an_arm_that_moves_though_the_move_was_refused_is_stopped():
    story = Story()
    story.replies["joint_move"] = "2"
    story.core.move("move", JointMove(TARGET, 1.0, 1.0), True, story.now)
    story.run(0.1, move=0.5)
    assert story.count("stop_program") == 1 and not story.core.is_free


def test_a_reply_that_does_not_come_ends_the_link_and_the_stop_is_the_next_ones_first_word():
    story = Story()
    story.replies["joint_move"] = None
    story.core.move("move", JointMove(TARGET, 1.0, 1.0), True, story.now)
    story.run(1.0)
    assert isinstance(story.error("move"), ReplyTimeout) and not story.core.is_free
    del story.sent[:]
    story.connect()
    assert story.names()[:8] == WHOLE_STOP
    assert story.run(0.9).core.is_free


def test_moves_that_are_not_waited_for_are_queued_and_answered_on_acceptance():
    story = begun(wait=False)
    assert story.error("move") is None and not story.core.is_free
    story.core.move("second", JointMove((0.8,) + HOME[1:], 1.0, 1.0), False, story.now)
    story.run(1.2, move=0.5, **MOVING)
    assert story.error("second") is None and not story.core.is_free
    story.run(0.8, move=0.8, **MOVING)
    assert not story.core.is_free
    assert story.run(0.2).core.is_free and story.count("stop_program") == 0


def test_rest_at_one_target_of_a_queue_is_not_its_end_while_another_is_not_accepted():
    story = begun(wait=False, reply_timeout=4.0)
    story.replies["joint_move"] = None
    story.core.move("second", JointMove((0.8,) + HOME[1:], 1.0, 1.0), False, story.now, "end of second")
    story.run(1.1, move=0.5, **MOVING).run(1.5)
    assert story.error("second") == "pending" and not story.core.is_free and story.count("stop_program") == 0
    story.reply("joint_move")
    story.run(0.7, move=0.8, **MOVING).run(0.2)
    assert story.error("end of second") is None and story.core.is_free and story.count("stop_program") == 0


@pytest.mark.parametrize("is_seen", [True, False])
def test_a_queue_of_targets_near_each_other_is_run_when_each_was_seen_in_its_turn(is_seen):
    story = begun((0.005,) + HOME[1:], wait=False)
    for number, way in enumerate((0.0, 0.005)):
        story.core.move("more %d" % number, JointMove((way,) + HOME[1:], 1.0, 1.0), False, story.now)
        story.perform()
    story.run(0.1, move=0.005, **MOVING)
    if is_seen:
        story.run(0.1, move=0.0, **MOVING).run(0.1, move=0.005, **MOVING)
        assert story.run(0.2).core.is_free and story.count("stop_program") == 0
    else:
        assert not story.run(0.8).core.is_free and story.count("stop_program") == 0
        assert story.run(0.4).core.is_free and story.count("stop_program") == 1


def test_each_move_of_a_queue_has_its_time_and_a_caller_who_waits_is_answered_within_that_of_its_own():
    for waits in (True, False):
        story = begun(wait=waits, motion_timeout=2.0)
        for number, way in enumerate((0.0, 0.5) * 2):
            story.core.move("more %d" % number, JointMove((way,) + HOME[1:], 1.0, 1.0), False, story.now)
            story.perform()
            story.run(0.9, move=0.5 - way, speed=0.6, **MOVING)
        assert story.cause("move") is (StopCause.TIMEOUT if waits else None)
        assert (story.count("stop_program") > 0) is waits


def test_rest_at_the_last_target_of_a_queue_is_made_sure_of_where_one_before_it_was_not_reached():
    story = begun(wait=False)
    for number, target in enumerate((0.9, 0.2)):
        story.core.move(number, JointMove((target,) + HOME[1:], 1.0, 1.0), False, story.now, "end of %d" % number)
    story.run(1.1, move=0.5, **MOVING).run(0.7, move=0.2, **MOVING).run(0.5)
    assert not story.core.is_free and story.count("stop_program") == 0, "0.9 rad may still be approached"
    story.run(1.0)
    assert story.core.is_free and story.count("stop_program") == 1
    assert story.cause("end of 0") is StopCause.STOPPED


def line_to(story, call, end, x, y, radius=0.0):
    pose = Pose((x, y, 0.3), (math.pi, 0.0, 0.0))
    story.core.move(call, LinearMove(pose, 0.1, 1.0, radius or 0.0005), False, story.now, end)
    story.perform()


def glide(story, x, y, speed=100.0):
    """Move the tool straight there, mm; the joints move with it."""
    while math.dist(story.tcp[:2], (x, y)) > 1e-6:
        away = math.dist(story.tcp[:2], (x, y))
        share = min(1.0, speed * 0.008 / away)
        story.tcp[0] += share * (x - story.tcp[0])
        story.tcp[1] += share * (y - story.tcp[1])
        story.joints[0] += 0.001
        story.run(0.008, **MOVING)


def test_each_call_of_a_queue_has_its_end_when_its_target_is_passed_even_on_a_rounded_corner():
    story = Story()
    line_to(story, "first", "end of first", 0.45, 0.1, radius=0.02)
    line_to(story, "second", "end of second", 0.45, 0.15)
    glide(story, 420.0, 100.0)
    assert story.error("first") is None and story.error("end of first") == "pending"
    glide(story, 445.0, 110.0)
    assert story.error("end of first") is None and story.error("end of second") == "pending"
    glide(story, 450.0, 150.0)
    assert story.run(0.3).error("end of second") is None and story.core.is_free
    assert story.count("stop_program") == 0


def test_a_target_that_the_arm_did_not_come_near_is_not_told_as_reached():
    story = Story()
    line_to(story, "first", "end of first", 0.6, 0.1, radius=0.02)
    line_to(story, "second", "end of second", 0.45, 0.15)
    glide(story, 450.0, 150.0)
    story.run(2.0)
    assert story.cause("end of first") is StopCause.STOPPED and story.core.is_free


def test_the_last_move_of_a_queue_must_meet_its_target_whatever_its_radius():
    story = Story()
    line_to(story, "only", "end", 0.45, 0.1, radius=0.02)
    glide(story, 440.0, 100.0)
    assert story.run(0.6).cause("end") is StopCause.STOPPED


def test_a_stop_ends_every_call_of_a_queue():
    story = begun(wait=False)
    story.core.move("second", JointMove((0.8,) + HOME[1:], 1.0, 1.0), False, story.now, "end of second")
    story.run(0.2, move=0.5, **MOVING)
    story.core.stop("stop", story.now)
    story.perform()
    assert story.cause("end of second") is StopCause.STOPPED


def test_a_refused_move_ends_with_its_refusal():
    story = begun(wait=False)
    story.replies["joint_move"] = "2"
    story.core.move("second", JointMove((0.8,) + HOME[1:], 1.0, 1.0), False, story.now, "end")
    story.perform()
    assert isinstance(story.error("second"), CommandRejected) and isinstance(story.error("end"), CommandRejected)


def test_a_second_move_is_refused_and_told_who_owns_the_arm():
    story = begun()
    story.core.move("second", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.perform()
    assert isinstance(story.error("second"), InvalidCommand) and "a move owns" in str(story.error("second"))


def test_while_somebody_else_moves_the_arm_a_move_waits_and_is_refused_in_the_end():
    story = Story().run(0.2, move=9.0)
    story.core.move("move", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.run(2.2, move=9.0)
    assert story.error("move") == "pending" and story.told == [] and story.count("joint_move") == 0
    story.run(0.2, move=9.0)
    assert isinstance(story.error("move"), InvalidCommand) and "not by this driver" in str(story.error("move"))


def test_when_an_arm_that_somebody_else_moved_rests_the_move_begins():
    story = Story().run(0.2, move=9.0)
    story.core.move("move", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.run(0.05)
    assert story.count("joint_move") == 0
    assert story.run(0.1).count("joint_move") == 1


def test_without_a_link_nothing_is_begun():
    story = Story()
    story.core.closed(story_port("COMMAND"), "cut", story.now)
    story.core.move("move", JointMove(TARGET, 1.0, 1.0), True, story.now)
    story.perform()
    assert isinstance(story.error("move"), ConnectionLost) and True not in story.told


def story_port(name):
    from jaka_ros_driver.client.core.actions import Port
    return Port[name]


def test_rest_from_before_a_move_does_not_count_for_its_pause():
    story = begun().run(0.016, move=TARGET[0], speed=0.005, **MOVING)
    story.core.run("pause", pause(story.core), story.now)
    story.perform()
    story.run(0.016, move=TARGET[0], speed=0.002, paused=True, **MOVING)
    assert story.error("pause") == "pending", "the arm has moved less than 0.1 mrad, and has not been seen at rest"
    assert "paused" in story.run(0.15, paused=True, **MOVING).answers["pause"][1]
