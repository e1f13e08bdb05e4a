"""Rules of the core that matter seldom, event by event, as in the other stories."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver.client.core.actions import Close, Open, Port
from jaka_ros_driver.client.core.motion import ArmMotion
from jaka_ros_driver.client.core.motion_guard.joint_corner import JointWay
from jaka_ros_driver.client.core.motion_guard.motion_check import StartPlace
from jaka_ros_driver.client.core.procedures import pausing, power, session, settings
from jaka_ros_driver.client.core.procedures.settings import ReadBackMismatch
from jaka_ros_driver.client.core.servo_planner import PoseServo
from jaka_ros_driver.client.core.stillness import MOVEMENT
from jaka_ros_driver.commands import Jog, JogFrame, JointMove, LinearMove, Pose, ServoJoint, ServoPose
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, StopCause

IDLE, LOADING, PAUSED, RUNNING = range(4)
MOVING = {"inpos": False}


def to(first, tolerance=0.0, speed=0.5):
    return JointMove((first,) + HOME[1:], speed, 1.0, tolerance)


def asked(story, procedure):
    story.core.run("call", procedure(story.core), story.now)
    story.perform()
    return story


# ---- what is possible ----

@pytest.mark.parametrize("state, is_possible", [(IDLE, True), (LOADING, False), (RUNNING, False)])
def test_no_motion_is_possible_beside_a_program_of_the_pendant(state, is_possible):
    story = Story()
    story.fields["interp_state"] = state
    story.run(0.1)
    assert story.core.is_motion_possible(story.now) is is_possible


def test_motion_is_possible_while_this_driver_plays_the_program_itself():
    story = Story()
    story.fields["interp_state"] = IDLE
    story.run(0.1)
    story.core.play("play", "end", story.now)
    story.perform()
    story.fields["interp_state"] = RUNNING
    story.run(0.1)
    assert story.core.is_motion_possible(story.now)


def asked_to_play():
    """Return a story in which a program was asked for, and the controller has not replied."""
    story = Story()
    story.fields["interp_state"] = IDLE
    story.run(0.1)
    story.replies["play_program"] = None
    story.core.play("play", "end", story.now)
    story.perform()
    return story


def test_what_the_feed_shows_before_the_acceptance_says_nothing_of_a_program():
    story = asked_to_play()
    story.fields["interp_state"] = RUNNING
    story.run(0.1)
    assert story.error("play") == "pending"
    story.reply("play_program")
    assert story.run(0.05).error("play") is None


# ---- rounded corners of joint moves ----

@pytest.mark.parametrize("tolerance, is_passed", [(0.02, True), (0.0, False)])
def test_a_joint_target_with_a_rounded_corner_is_passed_beside(tolerance, is_passed):
    # 0.02 m at a lever of 0.1 m are 0.2 rad; the arm turns back 0.1 rad before the target.
    story = Story()
    story.core.move("first", to(0.5, tolerance), False, story.now, "end of first")
    story.core.move("second", to(0.0), False, story.now, "end of second")
    story.perform()
    story.run(1.0, move=0.4, **MOVING).run(0.4, move=0.2, **MOVING)
    assert (story.error("end of first") is None) is is_passed


def test_a_joint_target_that_the_arm_is_far_from_is_not_passed_whatever_its_corner():
    story = Story()
    story.core.move("first", to(1.0, 0.02), False, story.now, "end of first")
    story.core.move("second", to(0.0), False, story.now, "end of second")
    story.perform()
    story.run(1.0, move=0.4, **MOVING).run(0.4, move=0.2, **MOVING)
    assert story.error("end of first") == "pending"


# ---- settings ----

def test_a_speed_is_set_when_the_feed_shows_it():
    story = Story()
    story.fields["rapidrate"] = 1.0
    asked(story.run(0.1), lambda core: pausing.set_speed(core, 0.5)).run(1.0)
    assert story.error("call") == "pending"
    story.fields["rapidrate"] = 0.5
    assert story.run(0.1).answers["call"][1:] == ("speed 50 %", None)


@pytest.mark.parametrize("shown", [1.0, 0.49])
def test_a_speed_that_the_feed_does_not_show_was_not_set(shown):
    story = Story()
    story.fields["rapidrate"] = shown
    asked(story.run(0.1), lambda core: pausing.set_speed(core, 0.5)).run(2.2)
    assert story.cause("call") is StopCause.TIMEOUT and "%.3g %%" % (100.0 * shown) in str(story.error("call"))


def test_a_speed_that_is_not_reported_is_said_not_to_be_verified():
    story = asked(Story(), lambda core: pausing.set_speed(core, 0.5))
    assert "not verified" in story.answers["call"][1]


@pytest.mark.parametrize("held, is_told", [(True, None), (False, ReadBackMismatch)])
def test_hand_guiding_that_the_feed_does_not_show_is_asked_for(held, is_told):
    story = Story()
    story.extra["drag_status"] = {"drag_status": held}
    asked(story, lambda core: settings.set_hand_guiding(core, True)).run(0.1)
    assert story.count("drag_status") == 1
    assert story.error("call") is None if is_told is None else isinstance(story.error("call"), is_told)


# ---- drives ----

def test_a_fault_meanwhile_ends_the_powering_for_good():
    story = Story()
    story.fields.update(powered_on=0, enabled=False)
    asked(story.run(0.1), lambda core: power.auto_enable(core, core.disturbances - core.link_losses)).run(0.1)
    story.run(0.05, errcode="0xf0017")
    story.fields["powered_on"] = 1
    story.run(0.5)
    assert story.count("power_on") == 1 and story.count("enable_robot") == 0


@pytest.mark.parametrize("errcode, disturbs", [("0xf0017", 1), ("0x10034", 0), ("0x10f0001", 0)],
                         ids=["a fault", "a joint that nears its limit", "a note"])
def test_a_fault_disturbs_once_and_what_is_none_does_not(errcode, disturbs):
    story = Story()
    before = story.core.disturbances
    story.run(0.2, errcode=errcode).run(0.1)
    assert story.core.disturbances - before == disturbs
    story.run(0.1, errcode="0xf0017")
    assert story.core.disturbances - before == disturbs + 1


@pytest.mark.parametrize("in_position, stops", [(True, 0), (False, 1)])
def test_an_arm_that_rests_is_disabled_without_a_stop_and_one_that_may_move_is_stopped_first(in_position, stops):
    story = Story()
    story.fields["inpos"] = in_position
    asked(story.run(0.2), lambda core: power.set_enabled(core, False)).run(0.2)
    assert story.count("stop_program") == stops and story.count("disable_robot") == 1
    if stops:
        assert story.names().index("stop_program") < story.names().index("disable_robot")


# ---- links ----

def test_an_end_of_the_connection_that_is_told_twice_costs_no_time():
    story = Story()
    for _ in range(3):
        story.core.closed(Port.STATUS, "cut", story.now)
        story.perform()
    story.feed = False
    cut_at = story.now
    story.run(0.3)
    opened = [at for at, action in story.asked_to_connect if action == Open(Port.STATUS) and at > cut_at]
    assert opened and opened[0] - cut_at == pytest.approx(0.1, abs=0.01)


def test_a_link_that_is_lost_during_the_handshake_is_not_closed_once_more():
    story = Story(ready=False)
    story.replies["get_version"] = None
    story.connect()
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert not [action for _, action in story.asked_to_connect if isinstance(action, Close)]


@pytest.mark.parametrize("host, is_here", [
    ("localhost", True), ("127.0.0.1", True), ("127.8.0.1", True), ("::1", True), ("10.5.5.100", False),
    ("controller", False)])
def test_this_computer_is_known_by_name_and_address(host, is_here):
    assert session.is_loopback(host) is is_here


# ---- servo targets ----

@pytest.mark.parametrize("ahead, is_taken", [(2.0, True), (0.05, False)])
@pytest.mark.parametrize("target", [Pose((0.43, 0.1, 0.3), (math.pi, 0.0, 0.0)),
                                    Pose((0.4, 0.1, 0.3), (math.pi, 0.0, 0.09))], ids=["way", "turn"])
def test_a_pose_that_is_not_reached_in_time_is_refused(target, ahead, is_taken):
    stream = PoseServo(Pose((0.4, 0.1, 0.3), (math.pi, 0.0, 0.0)), 1.0, 0.05, 0.1, ahead, 0.008)
    if is_taken:
        stream.set_target(target, False)
    else:
        with pytest.raises(InvalidCommand, match="would not be there within"):
            stream.set_target(target, False)
    stream.next_frame()
    assert stream.is_at_rest is not is_taken


def test_an_arm_that_lags_behind_a_stream_of_targets_is_where_it_was_sent():
    # The arm is 0.15 rad behind the newest frame; 0.04 rad beside all of them would be too far.
    story = in_servo_mode()
    for n in range(1, 126):
        story.core.set_servo_target(ServoJoint((0.004 * n,) + HOME[1:]), story.now)
        story.joints[0] = max(0.0, 0.004 * n - 0.15)
        story.run(0.016)
    assert story.count("stop_program") == 0 and not story.core.is_free


@pytest.mark.parametrize("away, stops", [(20.0, 0), (50.0, 1)])
def test_a_tool_that_is_not_where_it_was_sent_is_stopped(away, stops):
    # In mm; 30 are allowed.
    story = in_servo_mode().run(0.2)
    story.core.set_servo_target(ServoPose(Pose((0.001, 0.0, 0.0), (0.0, 0.0, 0.0)), True), story.now)
    story.run(0.2)
    story.tcp[1] += away
    story.run(0.05)
    assert story.count("stop_program") == stops and story.core.is_free is False


@pytest.mark.parametrize("away, stops", [(25.0, 0), (35.0, 1)])
def test_a_tool_that_drifts_away_from_where_it_was_sent_is_stopped(away, stops):
    # 30 mm are allowed; the tool goes there so slowly that nothing jumps.
    story = in_servo_mode().run(0.2)
    story.core.set_servo_target(ServoPose(Pose((0.001, 0.0, 0.0), (0.0, 0.0, 0.0)), True), story.now)
    story.run(0.2)
    for _ in range(100):
        story.tcp[1] += away / 100.0
        story.run(0.008)
    assert story.count("stop_program") == stops


def in_servo_mode():
    story = Story()
    story.core.servo_mode("servo", True, story.now)
    story.perform()
    story.run(0.2)
    assert story.error("servo") is None
    return story


def test_a_move_that_is_asked_for_while_servo_mode_is_left_waits_for_that():
    story = in_servo_mode()
    for n in range(1, 30):
        story.core.set_servo_target(ServoJoint((0.004 * n,) + HOME[1:]), story.now)
        story.run(0.008, move=0.004 * n)
    story.core.servo_mode("leave", False, story.now)
    story.core.move("move", to(0.5), True, story.now)
    story.perform()
    assert story.error("move") == "pending" and story.count("joint_move") == 0
    story.run(1.0, move=0.116)
    assert story.error("leave") is None and story.count("joint_move") == 1 and story.count("stop_program") == 0


# ---- replies ----

def test_after_a_reply_that_makes_no_sense_the_arm_is_stopped():
    story = Story()
    story.replies["joint_move"] = None
    story.core.move("move", to(0.5), True, story.now)
    story.perform()
    story.core.received(Port.COMMAND, b'{"cmdName": "joint_move", "errorMsg": ""}', story.now)
    story.run(0.05)
    assert story.count("stop_program") == 1 and not isinstance(story.error("move"), CommandRejected)
    assert story.error("move") not in (None, "pending")


def test_connections_are_counted():
    story = Story()
    assert story.core.links.health().connections == 1
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.core.opened(Port.COMMAND, story.now)
    story.perform()
    assert story.core.links.health().connections == 2


# ---- stops ----

def test_a_stop_is_not_sent_again_before_the_arm_has_had_time_to_come_to_rest():
    story = Story()
    story.fields["interp_state"] = IDLE
    story.run(0.1)
    story.core.play("play", "end", story.now)
    story.perform()
    story.fields["interp_state"] = RUNNING
    story.run(0.1)
    story.core.stop("stop", story.now)
    story.run(0.4)
    assert story.count("stop_program") == 1, "the feed shows the program running, which takes a moment to end"
    assert story.run(0.3).count("stop_program") == 2


def test_an_arm_that_coasts_for_half_a_second_and_rests_then_needs_no_second_stop():
    story = Story()
    story.core.move("move", to(1.0), True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.core.stop("stop", story.now)
    story.run(0.472, move=1.0).run(0.3)
    assert story.core.is_free and story.count("stop_program") == 1


# ---- the log ----

def logged(story, words):
    return sum(words in text for text in story.log)


def test_a_stop_that_is_refused_again_and_again_is_logged_once_a_second():
    story = Story()
    story.core.move("move", to(1.0), True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.replies["stop_program"] = "2"
    story.core.stop("stop", story.now)
    story.run(3.5, move=9.0, **MOVING)
    assert story.count("stop_program") > 30 and 3 <= logged(story, "stop was not accepted") <= 5


def test_what_stops_the_arm_is_logged_and_a_stop_that_was_asked_for_is_not():
    for is_asked_for in (False, True):
        story = Story()
        story.core.move("move", to(1.0), True, story.now)
        story.run(0.3, move=1.0, **MOVING)
        if is_asked_for:
            story.core.stop("stop", story.now)
        story.run(0.1, move=1.0, protective_stop=int(not is_asked_for), **MOVING)
        assert logged(story, "stopping the arm: protective stop") == (not is_asked_for) == logged(story, "stopping the")


def test_a_jog_that_another_one_replaces_stops_nothing_worth_a_warning():
    story = Story()
    for velocity in (0.2, -0.2):
        story.core.jog("jog %g" % velocity, Jog(JogFrame.JOINT, 0, velocity), story.now)
        story.perform()
        story.run(0.3, move=math.copysign(1.0, velocity), speed=0.2, **MOVING)
    assert story.count("stop_program") == 1 and not logged(story, "stopping the arm")


def test_a_controller_that_is_away_is_logged_once():
    story = Story(ready=False)
    for _ in range(5):
        story.core.failed(Port.COMMAND, "nobody listens", story.now)
        story.run(0.6)
    assert logged(story, "nobody listens") == 1


def test_the_end_of_servo_mode_is_logged_where_it_was_on():
    story = in_servo_mode()
    story.core.servo_mode("leave", False, story.now)
    story.run(0.5)
    assert story.error("leave") is None and logged(story, "servo mode has ended: its client left") == 1
    story = Story()
    story.replies["servo_move"] = "2"
    story.core.servo_mode("servo", True, story.now)
    story.run(0.5)
    assert logged(story, "servo mode has ended") == 0


# ---- pauses between tries, what the controller is asked besides ----

def pauses_between_tries(lasts, tries=5):
    """Return the pauses between tries to connect; each time the connection is up for so long, s, and then ends."""
    story = Story()
    pauses = []
    for _ in range(tries):
        story.run(lasts)
        story.core.closed(Port.STATUS, "cut", story.now)
        cut_at = story.now
        story.perform()
        while not [at for at, action in story.asked_to_connect if action == Open(Port.STATUS) and at > cut_at]:
            story.feed = False
            story.run(0.008)
        pauses.append(story.now - cut_at)
        story.core.opened(Port.STATUS, story.now)
        story.feed = True
        story.perform()
    return pauses


def test_a_connection_that_ends_at_once_is_tried_again_more_and_more_slowly():
    assert pauses_between_tries(0.1)[-3:] == pytest.approx([0.4, 0.5, 0.5], abs=0.01)


def test_one_that_was_up_for_long_is_tried_again_at_once():
    assert pauses_between_tries(3.0) == pytest.approx([0.1] * 5, abs=0.01)


@pytest.mark.parametrize("seconds, asked_for", [(0.3, 2), (0.0, 0)])
def test_the_controller_is_asked_to_stop_by_itself_where_that_is_wanted(seconds, asked_for):
    story = Story(link_loss_stop=seconds)
    story.core.move("move", to(0.5), True, story.now)
    story.run(1.2, move=0.5, **MOVING).run(0.3)
    assert story.error("move") is None and story.count("set_network_exception_handle") == asked_for


def test_a_controller_that_cannot_stop_by_itself_is_asked_once():
    story = Story()
    story.replies["set_network_exception_handle"] = "2"
    for number, target in enumerate((0.2, 0.0)):
        story.core.move(number, to(target), True, story.now)
        story.run(0.6, move=target, **MOVING).run(0.3)
        assert story.error(number) is None
    assert story.count("set_network_exception_handle") == 1


def test_a_pose_cannot_be_streamed_where_the_feed_does_not_tell_the_tools():
    story = in_servo_mode()
    story.run(0.2, actual_position=None)
    with pytest.raises(InvalidCommand, match="does not report the tool pose"):
        story.core.set_servo_target(ServoPose(Pose((0.0, 0.0, 0.001), (0.0, 0.0, 0.0)), True), story.now)


@pytest.mark.parametrize("beside, is_there", [(0.001, True), (0.003, False)])
def test_a_line_may_end_two_millimetres_beside_its_target(beside, is_there):
    story = Story()
    pose = Pose((0.5, 0.1, 0.3), (math.pi, 0.0, 0.0))
    story.core.move("move", LinearMove(pose, 0.1, 0.1), True, story.now)
    story.perform()
    story.run(0.2, move=0.1, **MOVING)
    story.joints[0], story.tcp[0] = 0.2, 500.0 - 1000.0 * beside
    story.run(0.6)
    assert (story.error("move") is None) is is_there


def test_who_was_held_up_says_so():
    story = Story()
    story.core.move("move", to(1.0), True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    story.now += 5.0
    story.core.tick(story.now)
    story.perform()
    assert "the driver was held up for 5.0 s" in str(story.error("move"))


def test_a_joint_that_jumps_in_a_motion_stops_it_with_the_very_frame():
    story = Story()
    story.core.move("move", to(1.0), True, story.now)
    story.run(0.3, move=1.0, **MOVING)
    before = story.count("stop_program")
    story.frame(joint_actual_position=[math.degrees(q + 1.5) for q in story.joints], **MOVING)
    assert story.count("stop_program") == before + 1
    story.run(1.0)
    assert "jumps" in str(story.error("move"))


def test_who_was_held_up_asks_the_controller_at_once():
    story = Story()
    asked = story.count("is_in_servomove")
    while story.count("is_in_servomove") == asked:
        story.run(PERIOD)
    story.now += 0.16
    story.core.tick(story.now)
    story.perform()
    assert story.count("is_in_servomove") == asked + 2


# ---- custody that ends as it begins, and replies that come too late ----

class _RefusedAtOnce(ArmMotion):
    """A motion that cannot send its first command."""

    def __init__(self):
        self.outcomes = []

    def begin(self, now):
        raise InvalidCommand("nothing can be sent")

    def ended(self, outcome):
        self.outcomes.append(outcome)


def test_a_motion_that_could_not_send_anything_ends_with_its_error_alone():
    story, motion = Story(), _RefusedAtOnce()
    with pytest.raises(InvalidCommand, match="nothing can be sent"):
        story.core.custody.begin(motion, story.now)
    story.perform()
    assert story.core.is_free and motion.outcomes == [], "its caller has the error; no end is told besides"


def test_a_late_refusal_of_a_program_concerns_no_later_motion():
    story = asked_to_play()
    story.core.stop("stop", story.now)
    story.perform()
    assert story.run(0.6).core.is_free
    story.core.move("move", to(0.4), True, story.now)
    story.perform()
    story.run(0.1, move=0.4, **MOVING)
    stops = story.count("stop_program")
    story.reply("play_program", "2")
    assert story.run(0.1, move=0.4, **MOVING).count("stop_program") == stops
    assert story.error("move") == "pending" and not story.core.custody.is_ending


def test_a_refused_program_that_is_seen_to_run_is_stopped_while_the_arm_rests():
    story = asked_to_play()
    stops = story.count("stop_program")
    story.reply("play_program", "2")
    story.run(0.3)
    assert isinstance(story.error("play"), CommandRejected) and story.count("stop_program") == stops
    story = asked_to_play()
    story.fields["interp_state"] = RUNNING
    story.reply("play_program", "2")
    assert story.run(1.0).count("stop_program") > stops and not story.core.is_free


# ---- looks of the motion guard ----

@pytest.mark.parametrize("away, counts", [(0.0, True), (0.5 * MOVEMENT, True), (2.0 * MOVEMENT, False)])
def test_a_look_counts_only_where_the_motion_begins_near_the_place_that_it_was_made_from(away, counts):
    here, there = StartPlace(HOME, None), StartPlace((HOME[0] - away,) + HOME[1:], None)
    assert there.is_near(here) is here.is_near(there) is counts
    assert not StartPlace.unknown().is_near(there) and not there.is_near(StartPlace.unknown())
    way = JointWay(HOME, HOME, 1.0, 0.0)
    assert not here._replace(way=way).is_near(here), "a corner is rounded at this one"
    unknown = StartPlace.unknown()
    assert unknown.is_near(unknown), "the end of the same queue"
