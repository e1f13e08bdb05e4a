"""Procedures step by step: what each step waits for, and what resumes it."""
import pytest

from jaka_ros_driver.client.core.procedures.steps import Ask, Now, Running, SendAhead, in_slices
from jaka_ros_driver.commands import Query, SetPower
from jaka_ros_driver.errors import ConnectionLost


class AnsweredLater:
    """A channel whose replies the test gives; ``waiting`` are those that wait for one."""

    def __init__(self):
        self.sent = []
        self.waiting = []

    def request(self, command, now, on_reply):
        self.sent.append(command)
        self.waiting.append(on_reply)


def begun(procedure):
    channel, ends = AnsweredLater(), []
    running = Running(procedure, channel, lambda *end: ends.append(end))
    running.begin(5.0)
    return channel, ends, running


def test_what_is_sent_ahead_waits_for_no_reply_and_what_is_asked_does():
    def procedure():
        told = yield SendAhead(SetPower(True))
        at = yield Now()
        return told, at, (yield Ask(Query.VERSION))

    channel, ends, running = begun(procedure())
    assert channel.sent == [SetPower(True), Query.VERSION] and not ends, "the second one does not wait for the first"
    channel.waiting[0]("the reply to what was told", None, 5.1)
    assert not ends
    channel.waiting[1]("1.7", None, 5.2)
    assert ends == [((None, 5.0, "1.7"), None, 5.2)] and running.has_ended


@pytest.mark.parametrize("fails", [0, 1])
def test_what_is_told_or_asked_and_fails_ends_the_procedure(fails):
    def procedure():
        yield SendAhead(SetPower(True))
        return (yield Ask(Query.VERSION))

    channel, ends, _ = begun(procedure())
    error = ConnectionLost("cut")
    channel.waiting[fails](None, error, 5.1)
    channel.waiting[1 - fails]("late", None, 5.2)
    assert ends == [(None, error, 5.1)]


def test_a_long_look_rests_between_its_slices_for_no_longer_than_a_cycle():
    def looks():
        for _ in range(3):
            yield 10000
        return "clear"

    checks = []
    _, ends, running = begun(in_slices(looks(), lambda: checks.append(5.0)))
    for number in range(1, 4):
        assert not ends and len(checks) == number - 1
        running.tick(5.0 + 0.008 * number)
    assert ends == [("clear", None, 5.024)] and len(checks) == 3
