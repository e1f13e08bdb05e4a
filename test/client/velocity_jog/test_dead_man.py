"""The dead-man: which messages count, and what ends the hold."""
import pytest

from jaka_ros_driver.client.core.velocity_jog.dead_man import ALONE_S, FRESH_S, DeadMan, JogMessage
from jaka_ros_driver.client.core.velocity_jog.ramp import Wish
from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.errors import InvalidCommand

REST = Wish(JogFrame.JOINT, (0.0,) * 6)
WISH = Wish(JogFrame.JOINT, (0.2,) + (0.0,) * 5)
BEGIN = 100.0


def message(now, wish=WISH, source="/pad", age=0.0, stamp=None, problem=""):
    """Return a message that arrives now; ``stamp``: s, of the publisher's clock."""
    return JogMessage(source, int(1e9 * (now - age if stamp is None else stamp)), age, now, wish, problem)


def held(now=BEGIN, source="/pad"):
    dead_man = DeadMan()
    dead_man.take(message(now, REST, source), now)
    assert dead_man.is_held
    return dead_man


def refused(dead_man, told, now, match):
    with pytest.raises(InvalidCommand, match=match):
        dead_man.take(told, now)


def test_a_message_of_rest_comes_first():
    dead_man = DeadMan()
    refused(dead_man, message(BEGIN), BEGIN, "zero velocity must come first .nothing has been held")
    assert dead_man.wish(BEGIN) is None
    dead_man.take(message(BEGIN + 0.02, REST), BEGIN + 0.02)
    dead_man.take(message(BEGIN + 0.04), BEGIN + 0.04)
    assert dead_man.wish(BEGIN + 0.05) == WISH and dead_man.source == "/pad"


@pytest.mark.parametrize("age", [0.0, 0.05, 0.15])
def test_a_message_counts_from_its_stamp_for_so_long(age):
    dead_man = held(BEGIN - 0.18)
    dead_man.take(message(BEGIN, age=age), BEGIN)
    assert dead_man.wish(BEGIN + FRESH_S - age - 1e-6) == WISH
    assert dead_man.wish(BEGIN + FRESH_S - age + 1e-6) is None and not dead_man.is_held
    refused(dead_man, message(BEGIN + 0.3), BEGIN + 0.3, "must come first .no fresh message for 0.2 s")


def test_time_that_a_message_has_waited_in_this_process_counts():
    dead_man = held(BEGIN - 0.1)
    late = message(BEGIN)
    dead_man.take(late, BEGIN + 0.09)
    assert dead_man.wish(BEGIN + FRESH_S + 1e-6) is None
    dead_man = held(BEGIN + 0.25)
    refused(dead_man, late, BEGIN + 0.26, "is 0.260 s old; at most 0.2 s")


def test_what_arrives_after_the_time_without_a_tick_between_does_not_keep_hold():
    dead_man = held()
    refused(dead_man, message(BEGIN + 0.201), BEGIN + 0.201, "must come first")


@pytest.mark.parametrize("make, match", [
    (lambda now: message(now, age=0.21), "is 0.210 s old"),
    (lambda now: message(now, age=-0.06), "0.060 s in the future"),
    (lambda now: message(now, stamp=BEGIN), "not later than that of the message before"),
    (lambda now: message(now, stamp=BEGIN - 0.01), "not later"),
    (lambda now: message(now, stamp=0.0), "header.stamp is 0")])
def test_what_does_not_count_does_not_keep_hold(make, match):
    # The hold ends when the time of the last message that counted is over, and not before.
    dead_man = held()
    for number in range(1, 20):
        now = BEGIN + 0.01 * number
        refused(dead_man, make(now), now, match)
        assert dead_man.is_held
    assert dead_man.wish(BEGIN + FRESH_S + 1e-6) is None


def test_a_message_that_cannot_be_understood_lets_go_at_once():
    dead_man = held()
    refused(dead_man, message(BEGIN + 0.01, None, problem="twist holds nan"), BEGIN + 0.01, "twist holds nan")
    assert dead_man.wish(BEGIN + 0.01) is None
    refused(dead_man, message(BEGIN + 0.02), BEGIN + 0.02, "must come first .twist holds nan")


@pytest.mark.parametrize("second", [REST, WISH, None], ids=["rest", "motion", "nonsense"])
def test_a_second_publisher_lets_go_until_one_is_left_and_has_said_rest(second):
    dead_man, now = held(), BEGIN + 0.01
    refused(dead_man, message(now, second, "/other", problem="?"), now, "several publishers at once: /other, /pad")
    assert dead_man.wish(now) is None
    for number in range(1, 50):
        now = BEGIN + 0.01 + 0.01 * number
        refused(dead_man, message(now, REST), now, "several publishers")
    now = BEGIN + 0.01 + ALONE_S + 0.01
    refused(dead_man, message(now), now, "must come first")
    dead_man.take(message(now + 0.01, REST), now + 0.01)
    assert dead_man.source == "/pad"


def test_rest_of_one_publisher_does_not_let_another_begin():
    dead_man, now = held(), BEGIN + ALONE_S + 0.1
    refused(dead_man, message(now, WISH, "/other"), now, "must come first")


def test_after_the_clock_was_set_back_rest_begins_anew():
    dead_man = held()
    for number in range(1, 25):
        now = BEGIN + 0.01 * number
        refused(dead_man, message(now, stamp=now - 3600.0), now, "not later|must come first")
    now = BEGIN + 0.3
    dead_man.take(message(now, REST, stamp=now - 3600.0), now)
    dead_man.take(message(now + 0.01, WISH, stamp=now - 3599.99), now + 0.01)
    assert dead_man.wish(now + 0.02) == WISH


def test_each_hold_has_a_number_of_its_own():
    dead_man = held()
    first = dead_man.grip
    dead_man.release("a stop")
    dead_man.release("something later")
    assert dead_man.last_end == "a stop"
    dead_man.take(message(BEGIN + 0.01, REST), BEGIN + 0.01)
    assert dead_man.grip == first + 1
