"""A path of several segments in custody: audited, sent in order, followed, and answered to its caller."""
import math

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver.client.core.procedures.pausing import pause, resume
from jaka_ros_driver.commands import ArcMove, JointMove, LinearMove, Pose
from jaka_ros_driver.errors import CommandRejected, InvalidCommand, PathInterrupted, StopCause

DOWN = (math.pi, 0.0, 0.0)


def pose(x, y, z=0.3):
    return Pose((x, y, z), DOWN)


def line(x, y, z=0.3, radius=0.0, speed=0.1):
    return LinearMove(pose(x, y, z), speed, 1.0, radius)


class OnPath(Story):
    """A controller that finds joints and poses, and an arm whose tool is led along the path by the test."""

    def __init__(self, **settings):
        super().__init__(**settings)
        self.begun = []
        self.cancelled = False
        self.extra = {"kine_inverse": {"jointPosition": [math.degrees(q) for q in HOME]},
                      "kine_forward": {"cartPosition": [450.0, 100.0, 300.0, 180.0, 0.0, 0.0]}}

    def begin(self, call, *segments):
        self.core.move_path(call, segments, lambda: self.cancelled, lambda: self.begun.append(call), self.now)
        self.perform()
        return self

    def glide(self, x, y, speed=100.0, **fields):
        """Move the tool straight there, mm and mm/s; the joints move with it."""
        while math.dist(self.tcp[:2], (x, y)) > 1e-6:
            away = math.dist(self.tcp[:2], (x, y))
            share = min(1.0, speed * PERIOD / away)
            self.tcp[0] += share * (x - self.tcp[0])
            self.tcp[1] += share * (y - self.tcp[1])
            self.joints[0] += 0.001
            self.run(PERIOD, **dict({"inpos": False}, **fields))
        return self

    @property
    def progress(self):
        return self.core.path and (self.core.path.completed, round(self.core.path.fraction, 1))


SQUARE = (line(0.5, 0.1), line(0.5, 0.2), line(0.4, 0.2), line(0.4, 0.1))
CORNERS = ((500.0, 100.0), (500.0, 200.0), (400.0, 200.0), (400.0, 100.0))


def on_square(corners=0, **settings):
    story = OnPath(**settings).begin("path", *SQUARE).run(0.1)
    for x, y in CORNERS[:corners]:
        story.glide(x, y)
    return story


def test_it_is_sent_in_order_after_its_audit_and_answered_at_rest_at_its_end():
    story = on_square()
    names = story.names()
    assert names.count("kine_inverse") == 4 and names.index("moveL") > names.index("kine_inverse")
    sent = [request["cartPosition"][:2] for _, request in story.sent if request["cmdName"] == "moveL"]
    assert [tuple(round(value, 6) for value in place) for place in sent] == list(CORNERS)
    assert story.told == [True] and story.begun == ["path"]
    for number, (x, y) in enumerate(CORNERS[:3]):
        story.glide(x, y)
        assert story.progress == (number + 1, round(0.25 * (number + 1), 1))
        assert story.core.path.segment == number + 1
    assert story.glide(*CORNERS[3]).error("path") == "pending"
    assert story.core.path.completed == 4 and story.core.path.segment == 3, "there are segments 0 to 3"
    story.run(0.5)
    assert story.error("path") is None and story.core.is_free and story.told == [True, False]
    assert story.answers["path"][1].completed == 4 and story.answers["path"][1].fraction == 1.0
    assert story.count("stop_program") == 0


def test_a_closed_path_is_not_completed_where_it_begins():
    story = on_square().run(0.9, inpos=False)
    assert story.error("path") == "pending" and story.progress == (0, 0.0)
    story.run(1.2)
    assert isinstance(story.error("path"), PathInterrupted) and story.cause("path") is StopCause.FAULT
    assert "did not move" in str(story.error("path")) and story.count("stop_program") >= 1


def test_joints_that_come_back_to_where_a_path_began_have_moved_all_the_same():
    story = on_square(4).run(1.2, move=HOME[0], inpos=False)
    assert story.joints[0] == HOME[0] and story.error("path") == "pending"
    assert story.run(0.5).error("path") is None and story.count("stop_program") == 0


def test_a_path_that_has_not_begun_1_s_after_its_first_acceptance_is_stopped_however_slow_the_feed():
    story = on_square()
    story.feed = False
    for _ in range(10):
        story.run(0.1).frame()
    assert story.count("stop_program") == 1


def test_a_path_that_is_too_slow_to_be_seen_in_1_s_has_as_long_as_a_move_of_its_speed():
    story = OnPath().begin("path", line(0.5, 0.1, speed=5e-4), line(0.5, 0.2, speed=5e-4)).run(1.1)
    assert story.count("stop_program") == 0
    assert story.run(0.3).count("stop_program") == 1


def test_a_path_of_an_arm_that_is_known_to_begin_late_has_that_much_longer():
    story = on_square(start_delay=4.0).run(4.8)
    assert story.count("stop_program") == 0
    assert story.run(0.2).count("stop_program") == 1


def test_a_path_that_is_held_near_its_end_is_not_completed_without_a_stop():
    story = OnPath().begin("path", line(0.5, 0.1)).run(0.05).glide(499.5, 100.0, speed=500.0, inpos=True).run(0.9)
    assert story.error("path") == "pending" and story.count("stop_program") == 0
    assert story.run(0.3).error("path") is None and story.count("stop_program") == 1


def test_an_arm_that_leaves_segments_out_is_not_called_done():
    story = on_square().glide(450.0, 100.0).glide(400.0, 100.0).run(1.5)
    error = story.error("path")
    assert isinstance(error, PathInterrupted) and error.completed < 3 and story.core.is_free


def test_the_next_segment_is_sent_when_the_one_before_was_accepted_and_none_after_a_refusal():
    story = OnPath()
    story.replies["moveL"] = None
    story.begin("path", *SQUARE).run(0.1)
    assert story.count("moveL") == 1 and story.begun == []
    story.reply("moveL")
    assert story.count("moveL") == 2 and story.begun == ["path"]
    story.reply("moveL", "2")
    assert story.count("moveL") == 2 and story.count("stop_program") == 1
    story.run(0.5)
    assert story.cause("path") is StopCause.FAULT and "moveL" in str(story.error("path"))
    assert story.run(0.5).core.is_free


def test_a_refusal_of_the_first_segment_is_told_and_stops_nothing():
    story = OnPath()
    story.replies["moveL"] = "2"
    story.begin("path", *SQUARE)
    assert isinstance(story.error("path"), CommandRejected) and story.begun == []
    assert story.run(0.3).core.is_free and story.count("stop_program") == 0 and story.count("moveL") == 1


@pytest.mark.parametrize("how", ["stop", "cancel", "emergency stop", "fault"])
def test_what_ends_it_is_told_with_how_far_it_came_when_the_arm_rests(how):
    story = on_square(1).glide(500.0, 150.0)
    if how == "stop":
        story.core.stop("stop", story.now)
    elif how == "cancel":
        assert story.core.cancel_path("path", story.now)
        assert not story.core.cancel_path("path", story.now)
    else:
        story.fields.update({"emergency_stop": 1} if how == "emergency stop" else {"errcode": "0x7abcde"})
        story.run(PERIOD)
    story.perform()
    assert story.count("stop_program") == 1 and story.error("path") == "pending"
    story.glide(500.0, 160.0).run(0.3)
    error = story.error("path")
    assert isinstance(error, PathInterrupted) and error.completed == 1
    assert error.fraction == pytest.approx(0.4, abs=0.01)
    assert "1 of 4 segments completed, 40." in str(error)
    assert story.cause("path") is {"stop": StopCause.STOPPED, "cancel": StopCause.CANCELLED, "fault": StopCause.FAULT,
                                   "emergency stop": StopCause.EMERGENCY_STOP}[how]
    assert story.run(0.6).core.is_free and story.count("moveL") == 4
    story.fields.clear()
    assert story.run(2.0).count("moveL") == 4, "nothing resumes"


def test_a_stop_of_which_rest_is_not_seen_is_told_in_time():
    story = on_square(1)
    story.core.stop("stop", story.now)
    story.perform()
    story.glide(500.0, 200.0, speed=80.0)
    assert isinstance(story.error("path"), PathInterrupted)


def test_a_lost_link_ends_it_at_once():
    from jaka_ros_driver.client.core.actions import Port
    story = on_square(1)
    story.core.closed(Port.COMMAND, "cut", story.now)
    story.perform()
    assert story.cause("path") is StopCause.LINK_LOST
    assert not story.core.is_free


def test_a_stop_during_the_audit_ends_it_before_anything_is_sent():
    for how in ("stop", "cancel"):
        story = OnPath()
        story.replies["kine_inverse"] = None
        story.begin("path", *SQUARE).run(0.1)
        assert story.count("kine_inverse") == 1 and story.told == []
        if how == "stop":
            story.core.stop("stop", story.now)
        else:
            story.cancelled = True
        story.perform()
        story.reply("kine_inverse")
        assert story.cause("path") is (StopCause.STOPPED if how == "stop" else StopCause.CANCELLED)
        assert story.run(0.5).count("moveL") == 0 and story.told == [] and story.core.is_free


@pytest.mark.parametrize("how", ["stop", "cancel"])
def test_a_stop_during_the_last_question_of_the_audit_ends_it_too(how):
    story = OnPath()
    story.replies["kine_inverse"] = None
    story.begin("path", SQUARE[0]).run(0.1)
    if how == "stop":
        story.core.stop("stop", story.now)
    else:
        story.cancelled = True
    story.reply("kine_inverse")
    assert story.cause("path") is (StopCause.STOPPED if how == "stop" else StopCause.CANCELLED)
    assert story.run(0.5).count("moveL") == 0 and story.told == [] and story.core.is_free


def test_an_arm_that_has_moved_during_the_audit_is_not_sent_anywhere():
    story = OnPath()
    story.replies["kine_inverse"] = None
    story.begin("path", SQUARE[0]).run(0.3, move=0.1)
    story.reply("kine_inverse")
    assert "has moved since" in str(story.error("path")) and story.count("moveL") == 0


def test_nothing_else_begins_during_the_audit_and_while_it_is_under_way():
    story = OnPath()
    story.replies["kine_inverse"] = None
    story.begin("path", SQUARE[0]).run(0.1)
    story.core.move("move", JointMove(HOME, 1.0, 1.0), True, story.now)
    story.perform()
    assert story.error("move") == "pending" and story.count("joint_move") == 0
    story.reply("kine_inverse")
    assert story.count("moveL") == 1 and "a path owns the arm's motion" in str(story.error("move"))
    story.begin("second", SQUARE[0])
    assert "a path owns" in str(story.error("second")) and story.count("joint_move") == 0


BAD = {
    "no segment": ((), "0 segments"),
    "too many": ((SQUARE[0],) * 201, "201 segments"),
    "a joint beyond its limit": ((JointMove((7.0,) + HOME[1:], 1.0, 1.0),), "segment 0: joint_position"),
    "NaN": ((line(math.nan, 0.0),), "segment 0: target"),
    "too fast": ((line(0.5, 0.1), line(0.5, 0.2, speed=9.0)), "segment 1: speed"),
    "a radius at the end": ((line(0.5, 0.1, radius=0.01),), "segment 0: blend_radius is 0.01 m; the last"),
    "a radius too large": ((line(0.5, 0.1, radius=0.051), line(0.5, 0.2)), "segment 0: blend_radius is 0.051 m"),
    "a radius too large for the next": ((line(0.5, 0.1, radius=0.03), line(0.5, 0.15)), "segment 0: blend_radius"),
    "a negative radius": ((line(0.5, 0.1, radius=-0.01), line(0.5, 0.2)), "segment 0: tolerance"),
    "an arc on a line": ((ArcMove(pose(0.45, 0.1), pose(0.5, 0.1), 0.1, 1.0),), "segment 0: no circle"),
    "an arc that ends at via": ((ArcMove(pose(0.5, 0.1), pose(0.5, 0.1), 0.1, 1.0),), "segment 0: no circle"),
}


@pytest.mark.parametrize("what", list(BAD))
def test_a_path_that_cannot_be_run_is_refused_with_the_segment_and_the_reason(what):
    segments, reason = BAD[what]
    story = OnPath().begin("path", *segments)
    assert isinstance(story.error("path"), InvalidCommand) and reason in str(story.error("path")), story.error("path")
    assert story.told == [] and not {"moveL", "movc", "joint_move"} & set(story.names())


def test_a_target_that_the_controller_cannot_reach_is_refused():
    story = OnPath()
    story.replies["kine_inverse"] = "-4"
    story.begin("path", *SQUARE)
    assert "segment 0: its target cannot be reached" in str(story.error("path")) and story.count("moveL") == 0
    story = OnPath()
    story.extra["kine_inverse"] = {"jointPosition": [400.0] + [math.degrees(q) for q in HOME[1:]]}
    assert "segment 0: joint_position[0]" in str(story.begin("path", *SQUARE).error("path"))


def test_a_segment_that_leads_nowhere_is_not_sent():
    story = OnPath().begin("path", line(0.4, 0.1), line(0.5, 0.1)).run(0.1)
    assert story.count("moveL") == 1
    story.glide(500.0, 100.0).run(0.5)
    assert story.error("path") is None and story.answers["path"][1].completed == 2
    story = OnPath().begin("path", line(0.4, 0.1))
    assert story.error("path") is None and story.count("moveL") == 0 and story.told == []


def test_joint_motions_and_arcs_are_sent_as_such():
    story = OnPath().begin("path", JointMove((0.1,) + HOME[1:], 0.5, 1.0, 0.01),
                           ArcMove(pose(0.5, 0.15), pose(0.45, 0.2), 0.1, 1.0))
    assert story.error("path") == "pending", story.error("path")
    joint, arc = [request for _, request in story.sent if request["cmdName"] in ("joint_move", "movc")]
    assert joint["tol"] == pytest.approx(10.0) and arc["pos_mid"][:2] == pytest.approx([500.0, 150.0])


def test_pause_and_resume():
    story = on_square(1, motion_timeout=3.0).glide(500.0, 150.0)
    story.core.run("pause", pause(story.core), story.now)
    story.perform()
    assert story.names()[-1] == "pause_program"
    story.fields.update(paused=True, inpos=False)
    story.run(0.3)
    assert story.error("pause") is None and story.core.path.is_paused
    assert story.run(20.0).error("path") == "pending", "the time limit waits, too"
    story.core.run("resume", resume(story.core), story.now)
    story.perform()
    story.fields.clear()
    for x, y in CORNERS[1:]:
        story.glide(x, y)
    assert story.run(0.5).error("path") is None


def test_a_segment_that_takes_too_long_ends_it():
    story = on_square(1, motion_timeout=3.0).glide(500.0, 150.0).run(3.0, inpos=False, paused=True)
    assert story.cause("path") is StopCause.TIMEOUT


def test_rest_on_the_path_ends_it_after_1_s_whatever_inpos_says():
    story = on_square(1).glide(500.0, 150.0).run(0.9, inpos=False)
    assert story.error("path") == "pending"
    assert story.run(0.3, inpos=False).cause("path") is StopCause.STOPPED


def test_the_rounded_corner_counts_as_passed():
    story = OnPath().begin("path", line(0.5, 0.1, radius=0.03), line(0.5, 0.2)).run(0.1)
    story.glide(440.0, 100.0).glide(485.0, 115.0)
    assert story.glide(500.0, 160.0).progress == (1, 0.8)
    assert story.glide(500.0, 200.0).run(0.5).error("path") is None


@pytest.mark.parametrize("beside, is_there", [(1.0, True), (3.0, False)])
def test_a_path_may_end_two_millimetres_beside_its_target(beside, is_there):
    story = OnPath().begin("path", line(0.5, 0.1)).run(0.1)
    story.glide(500.0 - beside, 100.0).run(1.5)
    assert (story.error("path") is None) is is_there and story.core.is_free


def test_a_corner_may_be_rounded_by_half_of_the_shorter_segment_beside_it():
    for radius, is_taken in ((0.05, True), (0.0501, False)):
        story = OnPath().begin("path", line(0.5, 0.1, radius=radius), line(0.5, 0.3)).run(0.1)
        assert isinstance(story.error("path"), InvalidCommand) is not is_taken


def test_a_turn_in_place_is_followed_by_its_angle():
    story = OnPath()
    turned = LinearMove(Pose((0.4, 0.1, 0.3), (math.pi, 0.0, 1.0)), 0.1, 1.0, 0.0)
    story.begin("path", turned).run(0.1)
    seen = []
    for degree in range(58):
        story.tcp[5] = float(degree)
        story.joints[0] += 0.001
        story.run(0.2, inpos=False)
        seen.append(story.core.path.fraction if story.core.path else 1.0)
    assert seen == sorted(seen) and seen[28] == pytest.approx(0.49, abs=0.05) and seen[-1] > 0.95


def test_rest_on_the_path_that_the_controller_confirms_ends_it_after_0_3_s():
    story = on_square(1).glide(500.0, 150.0).run(0.2)
    assert story.error("path") == "pending" and story.count("stop_program") == 0
    assert story.run(0.3).cause("path") is StopCause.STOPPED


def test_where_more_could_still_begin_the_end_is_made_sure_by_a_stop_after_1_s():
    # The arm rests 1 mm beside the end of the last of two segments: near enough, and perhaps not the end.
    story = OnPath().begin("path", line(0.5, 0.1), line(0.5, 0.2)).run(0.1)
    story.glide(500.0, 100.0).glide(500.0, 199.0).run(0.9)
    assert story.error("path") == "pending" and story.count("stop_program") == 0
    story.run(0.4)
    assert story.error("path") is None and story.count("stop_program") == 1 and story.core.is_free


@pytest.mark.parametrize("segments, inpos", [([line(0.5, 0.1)], True), ([line(0.5, 0.1), line(0.5, 0.2)], False)],
                         ids=["inpos has not followed it", "more could still begin"])
def test_beside_its_end_an_arm_has_arrived_at_once_only_where_inpos_tells_so_of_a_single_segment(segments, inpos):
    # inpos: what the feed shows while the arm moves
    story = OnPath().begin("path", *segments).run(0.1)
    for x, y in CORNERS[:len(segments) - 1]:
        story.glide(x, y, inpos=inpos)
    x, y = CORNERS[len(segments) - 1]
    aside = (x, y + 1.0) if len(segments) == 1 else (x + 1.0, y)
    story.glide(*aside, inpos=inpos).run(0.9)
    assert story.error("path") == "pending" and story.count("stop_program") == 0
    assert story.run(0.4).error("path") is None and story.count("stop_program") == 1


def test_beside_the_end_of_a_single_segment_inpos_that_has_followed_it_tells_the_arrival():
    story = OnPath().begin("path", line(0.5, 0.1)).run(0.1).glide(500.0, 101.0, inpos=False).run(0.3)
    assert story.error("path") is None and story.count("stop_program") == 0


def test_an_arm_that_is_under_way_before_the_last_segment_was_accepted_goes_on():
    story = OnPath()
    story.replies["moveL"] = None
    story.begin("path", line(0.5, 0.1), line(0.5, 0.2)).run(0.05)
    story.reply("moveL")
    story.glide(450.0, 100.0)
    assert story.error("path") == "pending" and story.count("moveL") == 2
    story.reply("moveL")
    assert story.glide(500.0, 100.0).glide(500.0, 200.0).run(0.5).error("path") is None
