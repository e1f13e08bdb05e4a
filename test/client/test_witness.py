"""The witness of the feed's age, question by question: what counts as shown, and when a question is put no more."""
import pytest

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.witness import NEAR, Witness
from jaka_ros_driver.commands import Query
from jaka_ros_driver.errors import CommandRejected, ProtocolError
from jaka_ros_driver.state import RobotState

PERIOD = 0.1


class Asked:
    """A witness whose questions the test answers; ``asked`` are those that wait, with what takes their answer."""

    def __init__(self):
        self.now = 10.0
        self.asked = []
        self.witness = Witness(Actions(), self, 1.0)

    def request(self, command, now, on_reply):
        self.asked.append((command, on_reply))

    def frame(self, joint, is_enabled=True, is_powered=True, period=PERIOD):
        """Show joint 1 there, rad, one period later; returns why the feed is too old."""
        self.now += period
        state = RobotState(joints(joint), is_powered, is_enabled, True, False, False, received_at=self.now)
        return self.witness.saw(state, True, period)

    def ask(self):
        """Have the witness ask; return its questions."""
        del self.asked[:]
        self.witness.ask(self.now)
        return [command for command, _ in self.asked]

    def answer(self, query, result=None, error=None):
        dict(self.asked)[query](result, error, self.now)


def joints(first):
    return (first, 0.5, -0.5, 0.5, 0.5, 0.0)


@pytest.fixture
def one():
    made = Asked()
    made.frame(0.0)
    return made


@pytest.mark.parametrize("before, after, answer, is_shown", [
    (0.0, 0.0, 0.0, True), (0.0, 0.0, 0.9 * NEAR, True), (0.0, 0.0, -0.9 * NEAR, True),
    (0.0, 0.0, 1.1 * NEAR, False), (0.0, 0.0, -1.1 * NEAR, False),
    (0.0, 0.1, 0.05, True), (0.1, 0.0, 0.05, True),  # on the way between two frames, either way
    (0.0, 0.1, 0.119, True), (0.0, 0.1, -0.019, True),  # it has turned back between them
    (0.0, 0.1, 0.121, False), (0.0, 0.1, -0.021, False)])
def test_an_answer_is_shown_by_the_way_between_two_frames_and_next_to_it(one, before, after, answer, is_shown):
    one.frame(before)
    one.ask()
    one.frame(after)
    one.answer(Query.JOINTS, joints(answer))
    assert one.witness.is_trusted is is_shown


def test_a_motion_that_answers_and_feed_both_show_is_told_once(one):
    told = []
    for step in range(8):
        one.frame(0.1 * step)
        one.ask()
        one.answer(Query.JOINTS, joints(0.1 * step))
        told.append(one.witness.take_motion_seen())
    assert told == [False] * 4 + [True] * 4, "four answers that differ are needed before one tells of motion"
    assert not one.witness.take_motion_seen(), "it was told"
    for _ in range(3):  # now the arm rests
        one.frame(0.7)
        one.ask()
        one.answer(Query.JOINTS, joints(0.7))
        assert not one.witness.take_motion_seen()


@pytest.mark.parametrize("place, later, is_found_old", [
    (0.03, 0.0, True), (-0.03, 0.0, True), (-0.03, 0.004, True),
    (0.017, 0.0, False), (-0.017, 0.0, False),  # the arm may have gone there and back between two frames
    (0.03, 0.1, False)])  # a feed that moves passes by many places
def test_a_place_that_a_standing_feed_never_showed_is_not_passed_by_by_a_later_answer(one, place, later, is_found_old):
    one.ask()
    one.answer(Query.JOINTS, joints(0.0))
    one.frame(0.0)
    for told in (place, later):
        one.ask()
        one.answer(Query.JOINTS, joints(told))
    assert any(one.frame(joint) for joint in (0.0, later, later, later, later)) is is_found_old


@pytest.mark.parametrize("query", [Query.JOINTS, Query.DRIVES_READY])
def test_a_question_whose_answer_cannot_be_read_three_times_in_a_row_is_not_put_any_more(one, query):
    results = {Query.JOINTS: joints(0.0), Query.DRIVES_READY: True}
    for can_be_read in (False, False, True, False, False, False):  # one that can be read begins the count anew
        assert one.ask() == [Query.DRIVES_READY, Query.JOINTS]
        for other, result in results.items():
            if can_be_read or other is not query:
                one.answer(other, result)
            else:
                one.answer(query, error=ProtocolError("half an answer"))
    assert one.ask() == [other for other in (Query.DRIVES_READY, Query.JOINTS) if other is not query]


def test_a_question_that_the_controller_refuses_is_not_put_again(one):
    one.ask()
    one.answer(Query.JOINTS, error=CommandRejected("get_joint_pos", 1, "unknown"))
    one.answer(Query.DRIVES_READY, True)
    assert one.ask() == [Query.DRIVES_READY] and not one.witness.can_tell


@pytest.mark.parametrize("answered", [Query.JOINTS, Query.DRIVES_READY])
def test_a_question_that_waits_for_its_answer_is_not_put_again(one, answered):
    assert one.ask() == [Query.DRIVES_READY, Query.JOINTS]
    one.answer(answered, {Query.JOINTS: joints(0.0), Query.DRIVES_READY: True}[answered])
    assert one.ask() == [answered]


@pytest.mark.parametrize("how", ["not asked", "asked", "agreed", "agreed, then a new feed"])
def test_until_the_feed_has_shown_an_answer_on_this_connection_it_is_in_question(one, how):
    if how != "not asked":
        one.ask()
    if how.startswith("agreed"):
        one.answer(Query.JOINTS, joints(0.0))
    if how.endswith("new feed"):
        one.witness.forget()
    assert one.witness.is_unanswered is (how != "agreed")


@pytest.mark.parametrize("refused, is_trusted", [(Query.JOINTS, False), (Query.DRIVES_READY, True)])
def test_only_a_refusal_to_tell_the_joints_ends_the_trust_in_the_witness(one, refused, is_trusted):
    one.ask()
    one.answer(Query.JOINTS, joints(0.0))
    one.answer(Query.DRIVES_READY, True)
    assert one.witness.is_trusted
    one.ask()
    one.answer(refused, error=CommandRejected("a question", 1, "unknown"))
    assert one.witness.is_trusted is is_trusted and one.witness.can_tell is is_trusted


@pytest.mark.parametrize("shown_at", [None, 3])
def test_drives_that_the_controller_says_are_off_must_be_shown_off_once_within_half_a_second(one, shown_at):
    # shown_at: the frame that shows them powered and not enabled; None: no frame does
    for is_ready in (True, False):
        one.ask()
        one.answer(Query.DRIVES_READY, is_ready)
    doubts = [bool(one.frame(0.0, is_enabled=number != shown_at)) for number in range(1, 9)]
    assert doubts == [shown_at is None and number == 6 for number in range(1, 9)]


def test_an_answer_to_a_question_about_an_earlier_feed_says_nothing_of_the_new_one(one):
    one.ask()
    one.witness.forget()
    one.frame(0.0)
    one.answer(Query.JOINTS, joints(0.0))
    assert not one.witness.is_trusted


@pytest.mark.parametrize("frames, is_found_old", [(12, False), (20, True)])
def test_a_feed_that_stays_disputed_is_too_old_anew_after_two_seconds(one, frames, is_found_old):
    one.witness.distrust("a reason", one.now)
    for _ in range(frames):
        assert one.frame(0.0) == ""
    one.ask()
    one.answer(Query.JOINTS, joints(1.0))
    told = [one.frame(0.0) for _ in range(6)]
    assert any("they do not show" in text for text in told) is is_found_old


def test_a_disputed_feed_is_asked_about_once_it_shows_something_and_one_question_at_a_time(one):
    one.ask()
    one.answer(Query.JOINTS, joints(0.0))
    one.frame(0.0)
    one.witness.distrust("a reason", one.now)
    assert not one.witness.wants_to_ask(0.0, one.now), "there is nothing to compare an answer with"
    one.frame(0.0)
    assert one.witness.wants_to_ask(0.0, one.now)
    one.ask()
    assert not one.witness.wants_to_ask(0.0, one.now)


@pytest.mark.parametrize("shown", [(True, False), (False, True), (False, False)])
def test_drives_count_as_known_only_from_an_answer_while_the_feed_shows_them_on(shown):
    one = Asked()
    one.frame(0.0, is_enabled=shown[1], is_powered=shown[0])
    one.ask()
    one.answer(Query.DRIVES_READY, True)
    one.frame(0.0)
    one.ask()
    one.answer(Query.DRIVES_READY, False)  # of a controller whose answer need not be that of these drives
    assert not any(one.frame(0.0) for _ in range(12))


@pytest.mark.parametrize("frames, is_shown_in_time", [(1, True), (3, True), (4, False)])
def test_an_answer_agrees_with_a_feed_that_shows_it_later_within_a_third_of_the_silence_timeout(
        one, frames, is_shown_in_time):
    one.ask()
    one.answer(Query.JOINTS, joints(0.1))
    for _ in range(frames - 1):
        one.frame(0.0)
    assert not one.witness.is_trusted and one.witness.is_unanswered
    one.frame(0.1)
    assert one.witness.is_trusted is is_shown_in_time and one.witness.is_unanswered is not is_shown_in_time


@pytest.mark.parametrize("period, frames", [(0.1, 4), (0.2, 3), (0.4, 2)])
def test_a_feed_with_long_pauses_has_two_of_them_and_a_little_more_to_show_an_answer(one, period, frames):
    for told in (0.0, 1.0):
        one.ask()
        one.answer(Query.JOINTS, joints(told))
    doubts = [bool(one.frame(0.0, period=period)) for _ in range(frames)]
    assert doubts == [False] * (frames - 1) + [True]
