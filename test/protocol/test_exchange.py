"""Which reply answers which request."""
from jaka_ros_driver.protocol.exchange import Exchange


def waiting(*names):
    exchange = Exchange()
    return exchange, [exchange.sent(name, 0.0, 1.0, waiter=index) for index, name in enumerate(names)]


def test_replies_pair_in_order():
    exchange, (first, second) = waiting("servo_j", "servo_j")
    assert exchange.answered({"cmdName": "servo_j"}) is first
    assert exchange.answered({"cmdName": "servo_j"}) is second
    assert len(exchange) == 0


def test_a_reply_without_a_name_answers_the_oldest():
    exchange, (first, _) = waiting("odd_command", "stop_program")
    assert exchange.answered({"errorCode": "1"}) is first


def test_replies_in_another_order_find_their_requests_by_name():
    exchange, (first, second) = waiting("get_version", "stop_program")
    assert exchange.answered({"cmdName": "stop_program"}) is second
    assert exchange.answered({"cmdName": "get_version"}) is first
    assert len(exchange) == 0


def test_a_reply_that_nobody_asked_for_is_dropped():
    exchange, (first,) = waiting("stop_program")
    assert exchange.answered({"cmdName": "servo_j"}) is None
    assert len(exchange) == 1
    assert exchange.answered({"cmdName": "stop_program"}) is first
    assert exchange.answered({"cmdName": "stop_program"}) is None
    assert exchange.answered({}) is None


def test_a_late_request_is_overdue_and_a_timely_one_is_not():
    exchange = Exchange()
    slow = exchange.sent("power_on", 0.0, 5.0)
    fast = exchange.sent("stop_program", 0.0, 1.0)
    assert exchange.overdue(0.9) is None
    assert exchange.overdue(1.1) is fast
    exchange.answered({"cmdName": "stop_program"})
    assert exchange.overdue(1.1) is None
    assert exchange.overdue(5.1) is slow


def test_abandon_returns_everything_once():
    exchange, requests = waiting("a", "b")
    assert exchange.abandon() == requests
    assert exchange.abandon() == [] and len(exchange) == 0
