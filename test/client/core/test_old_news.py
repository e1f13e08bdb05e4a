"""The age of what is shown as new over links slower than the feed, and feeds that only look as if they were."""
import math
import random
from collections import deque

import pytest
from stories import HOME, PERIOD, Story

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Close, Open, Port
from jaka_ros_driver.errors import ConnectionLost, StopCause
from jaka_ros_driver.protocol.status import encode_frame

STEP = 0.001
LONGEST_AGE = 0.8
ALIKE = 0.01
"""Distance, rad, up to which frames look alike: an arm that turns back, or creeps, is for a while where it was."""
SWAYING = 0.3
MOVE = c.JointMove((3.0,) + HOME[1:], 0.3, 1.0)


def swaying(t):
    """Return joint 1, rad, of an arm that goes on and on at no more than 0.3 rad/s."""
    return math.sin(SWAYING * (t - 100.0))


def resting(t):
    return 0.0


class SlowLink:
    """A controller that makes frames, a link that carries them at a pace of its own, and a host that reads them.

    Attributes:
        ages: Age of each frame that was shown as new and is not like one of 0.8 s ago, s.
        drops: When the driver dropped the status port.
    """

    def __init__(self, made=0.008, share=1.0, joint=swaying, reads=lambda: 0.0, delay=0.0, **settings):
        self.story = Story(ready=False, **settings)
        self.made, self.pace, self.joint, self.reads, self.delay = made, made / share, joint, reads, delay
        self.ages, self.drops, self.fields = [], [], {}
        self._queue, self._made_at, self._seen = deque(), [], 0
        self._next_frame = self._next_read = self._free_at = self.story.now
        self._read = []
        self.story.connect()

    def run(self, seconds, paused=False):
        story = self.story
        for _ in range(int(seconds / STEP)):
            story.now += STEP
            story.joints[0] = self.joint(story.now)
            if story.now >= self._next_frame:
                self._next_frame += self.made
                fields = dict(story.fields, **self.fields)
                self._queue.append((story.now + self.delay, encode_frame({
                    "joint_actual_position": [math.degrees(q) for q in story.joints], "powered_on": 1,
                    "enabled": True, "inpos": True, "emergency_stop": 0, "protective_stop": 0,
                    "motion_line": len(self._made_at), **fields})))
                self._made_at.append(story.now)
            while self._queue and max(self._queue[0][0], self._free_at) <= story.now:
                self._free_at = max(self._queue[0][0], self._free_at) + self.pace
                self._read.append(self._queue.popleft()[1])
            if paused or story.now < self._next_read:
                continue
            self._next_read = story.now + self.reads()
            if self._read:
                story.core.received(Port.STATUS, b"".join(self._read), story.now)
                story.perform()
                self._read = []
            story.core.tick(story.now)
            story.perform()
            self._look()
        return self

    def _look(self):
        story = self.story
        for state in [show.state for show in story.shown if show.is_new]:
            age = story.now - self._made_at[state.motion_line]
            is_alike = abs(self.joint(story.now - LONGEST_AGE) - state.joint_position[0]) < ALIKE
            self.ages.append(min(age, LONGEST_AGE) if is_alike else age)
        story.shown = []
        for _, action in story.asked_to_connect[self._seen:]:
            if action == Open(Port.STATUS):
                self._queue.clear()
                self._read, self._free_at = [], story.now
                story.core.opened(Port.STATUS, story.now)
                story.perform()
            elif isinstance(action, Close) and action.port is Port.STATUS:
                self.drops.append(story.now)
                self._queue.clear()  # nothing comes over a connection that is closed
                self._read = []
        self._seen = len(story.asked_to_connect)


@pytest.mark.parametrize("made", [0.008, 0.03])
@pytest.mark.parametrize("share", [0.5, 0.85, 0.93, 0.98])
def test_while_the_arm_moves_nothing_old_is_shown_as_new_however_slow_the_link(share, made):
    length = 30.0 if share > 0.95 else 12.0  # after which a feed that nobody drops is 0.6 s old at least
    link = SlowLink(made, share).run(length)
    assert max(link.ages) <= LONGEST_AGE
    assert len(link.drops) >= 1 and len(link.ages) > 0.5 * length * share / made


def test_a_feed_that_falls_behind_stops_what_moves():
    link = SlowLink(share=0.85, joint=resting).run(0.5)
    story = link.story
    story.core.move("move", MOVE, True, story.now)
    begin = story.now
    link.joint = lambda t: 0.3 * (t - begin)
    link.fields["inpos"] = False
    link.run(6.0)
    assert story.cause("move") is StopCause.LINK_LOST and story.count("stop_program") >= 1
    assert "old" in str(story.error("move")) and any("old" in text for text in story.log)


@pytest.mark.parametrize("share", [0.5, 0.85])
def test_frames_of_before_a_motion_are_no_evidence_of_rest_after_its_stop(share):
    # The arm has rested while the feed fell behind, so that nothing contradicted it; the motion is a short one.
    link = SlowLink(share=share, joint=resting).run(5.0)
    story, begin = link.story, link.story.now
    story.core.move("move", MOVE, True, begin)
    link.joint = lambda t: 0.3 * min(max(t - begin, 0.0), 0.2)
    link.run(0.2)
    story.core.stop("stop", story.now)
    story.perform()
    while not story.core.is_free:
        assert story.now < begin + 5.0
        link.run(0.001)
    assert abs(story.core.state.joint_position[0] - 0.06) < 0.005


@pytest.mark.parametrize("behind", [0.08, 0.1, 0.15])
def test_the_first_way_of_a_motion_is_not_taken_for_the_rest_before_it(behind):
    # Up to 5 mrad off the feed's joints an answer agrees with them: here that of 44 ms after the motion's begin does.
    link = SlowLink(joint=resting, delay=behind).run(3.0)
    story, begin = link.story, link.story.now
    story.core.move("move", MOVE, True, begin)
    link.joint = lambda t: 1.3 * min(max(t - begin, 0.0), 0.15) ** 2
    link.run(0.044)
    story.core.stop("stop", story.now)
    story.perform()
    while not story.core.is_free:
        assert story.now < begin + 1.0
        link.run(0.001)
    assert abs(story.core.state.joint_position[0] - link.joint(story.now)) < 1e-4


@pytest.mark.parametrize("share", [0.85, 0.93])
def test_without_a_witness_the_debt_of_the_confirmed_period_decides(share):
    link = SlowLink(share=share)
    link.story.replies["get_joint_pos"] = "1"
    link.run(30.0)
    assert max(link.ages) <= LONGEST_AGE and len(link.drops) >= 2


def test_without_a_witness_a_feed_that_kept_its_period_must_go_on_keeping_it():
    link = SlowLink()
    link.story.replies["get_joint_pos"] = "1"
    link.run(3.0)
    link.pace = 0.1
    link.run(1.5)
    assert link.drops and max(link.ages) <= LONGEST_AGE


def test_drives_that_the_controller_says_are_off_must_be_off_in_the_feed_soon():
    link = SlowLink(share=0.85, joint=resting).run(12.0)
    assert not link.drops
    off_at = link.story.now
    link.story.fields.update(powered_on=0, enabled=False, emergency_stop=1)
    link.run(1.5)
    assert link.drops and link.drops[0] - off_at < LONGEST_AGE
    assert link.story.core.state.emergency_stop


def _busy(chance):
    return lambda: chance.choice((0.0, 0.0, 0.0, 0.01, 0.03, 0.06, 0.12))


@pytest.mark.parametrize("joint", [swaying, resting])
@pytest.mark.parametrize("kind, options", [
    ("as asked", {}),
    ("a clock 1 % slow", {"made": 0.00808}), ("a clock 1 % fast", {"made": 0.00792}),
    ("30 ms whatever is asked", {"made": 0.03}), ("100 ms whatever is asked", {"made": 0.1}),
    ("a delay between frames in place of a period", {"made": 0.0094}),
    ("a long way", {"delay": 0.15}),
    ("a busy host", {"reads": _busy(random.Random(1))}),
    ("a busy host, 30 ms", {"made": 0.03, "reads": _busy(random.Random(2))}),
    ("a busy host, 100 ms", {"made": 0.1, "reads": _busy(random.Random(3))}),
], ids=lambda value: value if isinstance(value, str) else "")
def test_a_feed_that_is_not_old_is_never_taken_for_old(kind, options, joint):
    link = SlowLink(joint=joint, **options).run(60.0)
    assert not link.drops, link.story.log
    assert len(link.ages) > 0.5 * 60.0 / link.made


@pytest.mark.parametrize("made", [0.008, 0.00808, 0.03, 0.1])
def test_nor_is_it_where_the_controller_does_not_know_the_question(made):
    link = SlowLink(made)
    link.story.replies.update(get_joint_pos="1", get_robot_state="1")
    link.run(60.0)
    assert not link.drops, link.story.log
    assert link.story.count("get_joint_pos") == link.story.count("get_robot_state") == 1


@pytest.mark.parametrize("pause", [0.1, 0.3, 0.7])
def test_a_driver_that_was_paused_takes_no_feed_for_old(pause):
    link = SlowLink()
    for _ in range(10):
        link.run(1.0).run(pause, paused=True)
    assert not link.run(1.0).drops, link.story.log


def test_a_rhythm_that_was_seen_not_to_be_old_stays_known_when_the_witness_is_gone():
    link = SlowLink(0.0094).run(20.0)
    link.story.replies["get_joint_pos"] = "1"
    assert not link.run(40.0).drops, link.story.log


def test_joints_that_never_were_those_of_the_feed_are_no_witness():
    link = SlowLink()
    link.story.extra["get_joint_pos"] = {"joint_pos": [0.0] * 6}
    link.run(20.0)
    assert not link.drops and sum("not those" in text for text in link.story.log) == 1


def test_an_answer_that_comes_late_is_looked_for_in_what_came_meanwhile():
    link = SlowLink()
    story = link.story
    link.run(2.0)
    story.replies["get_joint_pos"] = None
    asked = story.count("get_joint_pos")
    for _ in range(500):
        if story.count("get_joint_pos") == asked:
            link.run(STEP)
    assert story.count("get_joint_pos") == asked + 1
    story.extra["get_joint_pos"] = {"joint_pos": [math.degrees(q) for q in story.joints]}
    link.run(0.6)
    story.reply("get_joint_pos")
    story.extra.clear()
    story.replies.clear()
    assert not link.run(3.0).drops, story.log


def jumps(story, by=1.5):
    story.frame(joint_actual_position=[math.degrees(q + by) for q in story.joints])


def test_joints_that_jump_while_the_arm_is_free_are_not_believed_until_the_controller_says_so():
    # The same holds where they rest there: nothing begins from where they jumped to.
    story = Story()
    true = list(story.joints)
    story.extra["get_joint_pos"] = {"joint_pos": [math.degrees(q) for q in true]}
    del story.shown[:]
    story.joints = [q + 1.5 for q in true]
    story.run(0.25)
    assert not [show for show in story.shown if show.is_new]
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    assert isinstance(story.error("move"), ConnectionLost) and "jumps" in str(story.error("move"))
    story.joints = true
    story.run(0.1)
    assert story.shown[-1].is_new and story.core.is_ready(story.now)


def test_joints_that_did_jump_are_believed_as_soon_as_the_controller_says_so():
    story = Story()
    story.joints = [q + 1.5 for q in story.joints]
    story.run(0.05)
    assert story.shown[-1].is_new and story.core.is_ready(story.now)


def test_where_the_controller_cannot_say_joints_that_jumped_are_believed_after_a_second():
    story = Story()
    story.replies["get_joint_pos"] = "1"
    story.run(0.5)
    jumped_at = story.now
    story.joints = [q + 1.5 for q in story.joints]
    story.run(0.9)
    assert not story.shown[-1].is_new
    story.run(0.2)
    assert story.shown[-1].is_new and story.now - jumped_at > 1.0


def test_a_feed_that_repeats_itself_while_the_arm_moves_is_not_believed_on_a_new_connection_either():
    story = Story()
    story.run(0.5)
    moving = list(story.joints)
    story.extra["get_joint_pos"] = {"joint_pos": [math.degrees(q) for q in moving]}
    for _ in range(75):  # joint 1 goes on by 0.3 rad/s, the feed does not show it
        moving[0] += 0.3 * PERIOD
        story.extra["get_joint_pos"]["joint_pos"][0] = math.degrees(moving[0])
        story.run(PERIOD)
    assert any(action == Close(Port.STATUS, action.reason) for _, action in story.asked_to_connect
               if isinstance(action, Close))
    del story.shown[:]
    story.core.opened(Port.STATUS, story.now)
    story.run(1.0)
    assert story.shown and not [show for show in story.shown if show.is_new]
    story.joints = moving
    story.run(0.2)
    assert story.shown[-1].is_new


def test_an_earlier_jump_is_no_reason_to_believe_an_old_feed_when_the_controller_is_gone():
    story = Story()
    story.joints = [q + 1.5 for q in story.joints]
    assert story.run(0.5).shown[-1].is_new
    story.extra["get_joint_pos"] = {"joint_pos": [math.degrees(q) + 20.0 for q in story.joints]}
    story.run(0.6)
    assert Port.STATUS in [action.port for _, action in story.asked_to_connect if isinstance(action, Close)]
    story.core.closed(Port.COMMAND, "closed by the controller", story.now)
    story.core.opened(Port.STATUS, story.now)
    del story.shown[:]
    story.run(3.0)
    assert story.shown and not [show for show in story.shown if show.is_new]


def test_an_arm_that_has_just_begun_is_not_shown_at_rest_by_a_feed_that_is_behind():
    # The controller reports a refusal, and moves all the same; the feed shows the arm as it was 0.2 s ago.
    story = Story().run(0.5)
    story.replies["joint_move"] = "1"
    story.core.move("move", MOVE, True, story.now)
    story.perform()
    away = [math.degrees(q) for q in story.joints]
    story.run(0.06)
    away[0] += 10.0
    story.extra["get_joint_pos"] = {"joint_pos": away}
    assert not story.run(0.14).core.is_free, "the answers of 0.08 s after the refusal show it elsewhere"
    story.joints[0] += math.radians(10.0)
    assert not story.run(0.1).core.is_free and story.count("stop_program") == 1


def test_where_feed_and_controller_never_agree_a_move_is_refused_with_that_reason_for_eight_seconds():
    story = Story(ready=False)
    elsewhere = [math.degrees(q) + 3.0 for q in story.joints]
    story.extra["get_joint_pos"] = {"joint_pos": elsewhere}
    story.connect()
    story.run(0.3)
    story.core.move("early", MOVE, False, story.now)
    story.perform()
    assert "within 2.3 s the status feed has not shown where the controller says" in str(story.run(2.4).error("early"))
    assert story.count("joint_move") == 0
    story.run(8.0).core.move("late", MOVE, False, story.now)
    assert story.run(0.1).error("late") is None and "not those of its status feed" in "".join(story.log)
