"""The driver's loop and its guard, beat by beat, with guard processes that the test plays."""
import logging

import pytest
from waiting import eventually

from jaka_ros_driver.client import guard as module
from jaka_ros_driver.client.driver_pipe import FAREWELL, IDLE, MOVING
from jaka_ros_driver.client.guard import Guard


class Post:
    """A guard process: the test chooses whether it answers."""

    made = []

    def __init__(self, now):
        self.began_at = self.received_at = now
        self.has_answered = self.has_ended = self.is_stopping = False
        self.answers = True
        self.words, self.command, self.ends = [], None, []
        Post.made.append(self)

    def launch(self, command):
        self.command = command

    def send(self, word):
        self.words.append(word)

    def listen(self, now):
        if self.answers and not self.has_ended:
            self.has_answered, self.received_at = True, now
        return False

    def silence_limit(self):
        return 0.0

    def answers_now(self):
        return self.answers

    def kill(self):
        self.ends.append("killed")

    def leave(self):
        self.ends.append("left")

    def has_exited(self, timeout):
        return True


@pytest.fixture
def loop(monkeypatch):
    """Return a loop that beats every 21 ms from 100 s on."""
    monkeypatch.setattr(module, "GuardPost", Post)
    monkeypatch.setattr(Post, "made", [])

    class Loop:
        now = 100.0

        def __init__(self):
            self.guard = Guard("127.0.0.1", 9, 10, lambda: self.now)

        def beat(self, seconds):
            until = self.now + seconds
            while self.now < until:
                self.now += 0.021
                self.guard.beat(self.now)
            return self

        def until_replaced(self, count):
            """Send beats until so many guards were made; return how long that took, s."""
            began = self.now
            while len(Post.made) < count and self.now < began + 60.0:
                self.beat(0.02)
            return self.now - began
    return Loop()


def test_a_motion_is_told_at_once_and_with_every_beat(loop):
    loop.guard.notify(True)
    assert Post.made[0].words == [MOVING]
    loop.beat(0.1)
    assert set(Post.made[0].words) == {MOVING} and len(Post.made[0].words) >= 5
    loop.guard.notify(False)
    assert Post.made[0].words[-1] == IDLE and loop.guard.health().is_alive


def test_one_that_ends_is_replaced_at_once_and_its_successor_knows_of_the_motion(loop, caplog):
    caplog.set_level(logging.INFO)
    loop.guard.notify(True)
    loop.beat(0.1)
    Post.made[0].has_ended = True
    assert loop.until_replaced(2) < 0.1 and Post.made[0].ends == ["killed", "left"]
    assert eventually(lambda: Post.made[1].command) and "--moving" in Post.made[1].command
    loop.beat(0.5)
    assert loop.guard.health().replacements == 1 and loop.guard.health().last_trouble == "has ended"
    assert caplog.text.count("watches again") == 1 and caplog.text.count("and is replaced") == 1


def test_the_first_one_is_not_said_to_watch_again(loop, caplog):
    caplog.set_level(logging.INFO)
    loop.beat(1.0)
    assert not caplog.records


def test_those_that_end_at_once_are_replaced_later_and_later(loop):
    loop.beat(0.1)
    waits = []
    for number in range(1, 5):
        Post.made[-1].has_ended = True
        waits.append(loop.until_replaced(number + 1))
    assert waits == pytest.approx([0.02, 0.5, 1.0, 2.0], abs=0.07)


def test_after_one_that_lived_for_long_the_next_one_starts_at_once_again(loop):
    loop.beat(0.1)
    for number in range(1, 4):
        Post.made[-1].has_ended = True
        loop.until_replaced(number + 1)
    loop.beat(120.0)
    Post.made[-1].has_ended = True
    assert loop.until_replaced(5) < 0.1


def test_words_between_two_guards_are_kept_for_the_next_one(loop):
    loop.beat(0.1)
    for number in range(1, 3):
        Post.made[-1].has_ended = True
        if number == 1:
            loop.until_replaced(2)
    loop.beat(0.05)
    loop.guard.notify(True)
    loop.until_replaced(3)
    assert Post.made[2].words[0] == MOVING


@pytest.mark.parametrize("moves, answers", [(False, True), (True, True), (True, False)])
def test_at_the_end_the_arm_is_left_to_a_guard_only_where_it_moves(loop, moves, answers):
    loop.beat(0.1)
    loop.guard.notify(moves)
    Post.made[0].answers = answers
    loop.guard.close()
    first = Post.made[0]
    assert (FAREWELL in first.words) is not moves
    assert len(Post.made) == (1 if answers else 2)
    if not answers:
        assert first.ends == ["killed", "left"] and "--moving" in Post.made[1].command
    assert Post.made[-1].ends == ["left"]
    loop.beat(1.0)
    assert len(Post.made) == (1 if answers else 2), "nobody is replaced after the end"


def test_between_two_guards_the_arm_is_left_to_a_new_one(loop):
    loop.beat(0.1)
    loop.guard.notify(True)
    for number in range(1, 3):
        Post.made[-1].has_ended = True
        if number == 1:
            loop.until_replaced(2)
    loop.beat(0.05)
    loop.guard.close()
    assert len(Post.made) == 3 and "--moving" in Post.made[2].command and Post.made[2].ends == ["left"]
