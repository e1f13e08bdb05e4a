"""The assignment of replies to requests."""
import pytest

from jaka_ros_driver.protocol.exchange import Exchange


def waiting(*names):
    exchange = Exchange()
    return exchange, [exchange.sent(name, 0.0, 1.0, waiter=index) for index, name in enumerate(names)]


def test_replies_pair_in_order():
    exchange, (first, second) = waiting("servo_j", "servo_j")
    assert exchange.answered({"cmdName": "servo_j"}, 1.0) is first
    assert exchange.answered({"cmdName": "servo_j"}, 1.0) is second
    assert len(exchange) == 0


def test_a_reply_without_a_name_answers_the_oldest():
    exchange, (first, _) = waiting("odd_command", "stop_program")
    assert exchange.answered({"errorCode": "1"}, 1.0) is first


def test_replies_in_another_order_find_their_requests_by_name():
    exchange, (first, second) = waiting("get_version", "stop_program")
    assert exchange.answered({"cmdName": "stop_program"}, 1.0) is second
    assert exchange.answered({"cmdName": "get_version"}, 1.0) is first
    assert len(exchange) == 0


def test_a_reply_that_nobody_asked_for_is_dropped():
    exchange, (first,) = waiting("stop_program")
    assert exchange.answered({"cmdName": "servo_j"}, 1.0) is None
    assert len(exchange) == 1
    assert exchange.answered({"cmdName": "stop_program"}, 1.0) is first
    assert exchange.answered({"cmdName": "stop_program"}, 1.0) is None
    assert exchange.answered({}, 1.0) is None


def test_a_late_request_is_overdue_and_a_timely_one_is_not():
    exchange = Exchange()
    slow = exchange.sent("power_on", 0.0, 5.0)
    fast = exchange.sent("stop_program", 0.0, 1.0)
    assert exchange.overdue(0.9) is None
    assert exchange.overdue(1.1) is fast
    exchange.answered({"cmdName": "stop_program"}, 1.0)
    assert exchange.overdue(1.1) is None
    assert exchange.overdue(5.1) is slow


def test_abandon_returns_everything_once():
    exchange, requests = waiting("a", "b")
    assert exchange.abandon() == requests
    assert exchange.abandon() == [] and len(exchange) == 0


def test_what_waits_behind_a_slow_request_is_not_late_for_that():
    exchange = Exchange()
    slow = exchange.sent("power_on", 0.0, 30.0, is_slow=True)
    behind = exchange.sent("stop_program", 5.0, 1.0)
    assert exchange.overdue(29.0) is None
    assert exchange.answered({"cmdName": "power_on"}, 8.0) is slow
    assert exchange.overdue(8.9) is None
    assert exchange.overdue(9.1) is behind


def test_a_slow_request_whose_reply_never_comes_is_late_and_hides_none_that_was_sent_before():
    exchange = Exchange()
    before = exchange.sent("get_version", 0.0, 1.0)
    slow = exchange.sent("power_on", 0.0, 30.0, is_slow=True)
    assert exchange.overdue(1.1) is before
    exchange.answered({"cmdName": "get_version"}, 1.1)
    assert exchange.overdue(30.1) is slow


def test_a_later_reply_shows_that_nothing_waits_for_the_slow_one():
    exchange = Exchange()
    exchange.sent("enable_robot", 0.0, 30.0, is_slow=True)
    exchange.sent("is_in_servomove", 0.0, 1.0)
    exchange.answered({"cmdName": "is_in_servomove"}, 0.5)
    stop = exchange.sent("stop_program", 1.0, 1.0)
    assert exchange.overdue(2.1) is stop


def test_what_is_seen_done_must_be_answered_soon_and_nothing_before_it_gets_more_time():
    exchange = Exchange()
    before = exchange.sent("stop_program", 0.0, 1.0)
    slow = exchange.sent("power_on", 0.1, 30.0, is_slow=True)
    behind = exchange.sent("is_in_servomove", 0.2, 1.0)
    exchange.done("power_on", 8.0, 1.0)
    assert exchange.overdue(1.1) is before
    exchange.answered({"cmdName": "stop_program"}, 1.1)
    assert exchange.overdue(8.9) is None and not exchange.is_held_up
    assert exchange.overdue(9.1) is slow and slow.allowed_s == pytest.approx(8.9), "told as it was, not as 30 s"
    exchange.answered({"cmdName": "power_on"}, 9.1)
    assert exchange.overdue(9.2) is behind


def test_what_is_done_is_not_refused_by_a_reply_without_a_name_unless_nothing_else_waits():
    exchange = Exchange()
    slow = exchange.sent("power_on", 0.0, 30.0, is_slow=True)
    first = exchange.sent("set_network_exception_handle", 0.1, 1.0)
    second = exchange.sent("joint_move", 0.2, 1.0)
    exchange.done("power_on", 0.3, 1.0)
    assert exchange.answered({"errorCode": "1"}, 0.4) is first
    assert exchange.answered({"errorCode": "1"}, 0.5) is second
    assert exchange.answered({"errorCode": "1"}, 0.6) is slow


@pytest.mark.parametrize("name", ["stop_program", None])
def test_what_is_done_may_be_answered_late_where_later_replies_pass_it(name):
    exchange = Exchange()
    exchange.sent("power_on", 0.0, 30.0, is_slow=True)
    exchange.done("power_on", 0.3, 1.0)
    exchange.sent("stop_program", 0.4, 1.0)
    exchange.answered({"cmdName": name} if name else {"errorCode": "1"}, 0.5)
    late = exchange.sent("joint_move", 5.0, 1.0)
    assert exchange.overdue(5.9) is None and not exchange.is_held_up
    assert exchange.overdue(6.1) is late


def test_the_reply_to_a_slow_request_gives_no_more_time_to_those_before_it():
    exchange = Exchange()
    stop = exchange.sent("stop_program", 0.0, 1.0)
    exchange.sent("enable_robot", 0.5, 30.0, is_slow=True)
    exchange.answered({"cmdName": "enable_robot"}, 0.9)
    assert exchange.overdue(1.1) is stop


def test_nothing_gets_more_time_where_nothing_slow_is_waited_for():
    exchange = Exchange()
    stop = exchange.sent("stop_program", 0.0, 1.0)
    exchange.done("power_on", 0.9, 1.0)
    assert exchange.overdue(1.1) is stop
