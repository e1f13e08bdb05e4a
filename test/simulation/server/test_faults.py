import itertools

import pytest

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.protocol.ports import PORTS
from jaka_ros_driver.simulation.server.connection import ClientConnection
from jaka_ros_driver.simulation.server.faults import KINDS, Delivery, Effect, FaultScript


def sent_over(script, port, messages, times):
    """Return what a connection sends, and when: messages posted at time 0, looked at at the given times."""
    connection = ClientConnection(port, 1, "peer", 0.0)
    for message in messages:
        connection.post(script.deliveries(port, message, None, 0.0))
    sent = []
    for now in times:
        connection.pump(now, lambda data, now=now: sent.append((now, data)) or len(data))
    return sent, connection


def test_without_a_rule_messages_pass_unchanged():
    sent, connection = sent_over(FaultScript(), "status", [b"a", b"b"], [0.0, 1.0])
    assert sent == [(0.0, b"ab")] and connection.next_due() is None


def test_rules_strike_in_the_order_in_which_they_were_added():
    script = FaultScript()
    script.add("duplicate", "status")
    script.add("split", "status", bytes=2, gap_ms=100)
    sent, _ = sent_over(script, "status", [b"abc"], [0.0, 0.05, 0.1, 0.2])
    assert b"".join(data for _, data in sent) == b"abcabc"
    assert [data for _, data in sent] == [b"ab", b"c", b"ab", b"c"]


def test_count_port_and_command_choose_what_is_struck():
    script = FaultScript()
    script.add("drop", "command", 2, command="jog")
    assert script.deliveries("status", b"x", None, 0.0)
    assert script.deliveries("command", b"x", "moveL", 0.0)
    assert [bool(script.deliveries("command", b"x", "jog", 0.0)) for _ in range(3)] == [False, False, True]
    assert script.active() == ()


@pytest.mark.parametrize("value", [float("inf"), -float("inf"), float("nan"), 1e300, 10 ** 400, -1000001, "7", None])
@pytest.mark.parametrize("kind, name", [(kind, name) for kind, row in KINDS.items() for name in row.defaults])
def test_a_parameter_that_is_no_finite_number_makes_no_rule(kind, name, value):
    script = FaultScript()
    with pytest.raises(InvalidCommand, match=name):
        script.add(kind, "status", **{name: value})
    assert script.active() == () and script.frame_text("status", b'{"len": 9}') == b'{"len": 9}'


@pytest.mark.parametrize("offset, told", [(7, b"16"), (-9, b"0"), (-10, b"-1"), (1000000, b"1000009")])
def test_a_len_is_wrong_by_the_offset(offset, told):
    script = FaultScript()
    script.add("wrong_len", "status", offset=offset)
    assert script.frame_text("status", b'{"len": 9}') == b'{"len": %s}' % told


@pytest.mark.parametrize("port", PORTS)
def test_any_two_rules_in_any_order_with_parameters_of_zero_do_no_harm(port):
    for first, second in itertools.product(KINDS, KINDS):
        script = FaultScript()
        for kind in (first, second):
            script.add(kind, port, None, **dict.fromkeys(KINDS[kind].defaults, 0))
        sent_over(script, port, [b"a", b"", b"bc"] * 2, [0.0, 1.0, 1000.0])


@pytest.mark.parametrize("kind, params", [(["drop"], {}), ({}, {}), (None, {}), ("drop", {"self": 1})])
def test_a_rule_that_is_none_is_refused(kind, params):
    with pytest.raises(InvalidCommand):
        FaultScript().add(kind, "status", **params)


def test_rule_without_count_stays_until_cleared():
    script = FaultScript()
    script.add("drop", "status", None)
    assert not any(script.deliveries("status", b"x", None, 0.0) for _ in range(100))
    script.clear()
    assert script.deliveries("status", b"x", None, 0.0) == [Delivery(b"x", 0.0)]


def test_delayed_message_is_not_overtaken():
    script = FaultScript()
    script.add("delay", "status", delay_ms=500)
    sent, _ = sent_over(script, "status", [b"late", b"next"], [0.0, 0.4, 0.6])
    assert sent == [(0.6, b"latenext")]


def test_what_follows_an_end_is_never_sent():
    for kind, is_closing, resets in (("close", True, False), ("reset", True, True), ("half_open", False, False)):
        script = FaultScript()
        script.add(kind, "status")
        sent, connection = sent_over(script, "status", [b"a", b"b"], [0.0, 1.0])
        assert sent == [] and connection.next_due() is None
        assert (connection.is_closing, connection.resets) == (is_closing, resets)
        assert connection.is_half_open is (kind == "half_open")


def test_partial_sends_lose_nothing():
    connection = ClientConnection("status", 1, "peer", 0.0)
    connection.post([Delivery(b"abcdef", 0.0), Delivery(b"gh", 1.0, Effect.CLOSE)])
    sent = bytearray()

    def take_two(data):
        sent.extend(data[:2])
        return min(2, len(data))
    for _ in range(2):
        connection.pump(0.0, take_two)
        assert connection.has_unsent()
    for now in (0.0, 1.0):
        connection.pump(now, take_two)
    assert bytes(sent) == b"abcdefgh" and connection.is_closing and not connection.has_unsent()
    assert connection.unsent_bytes == 0


def test_len_is_falsified_in_the_text_only_where_the_rule_says():
    script = FaultScript()
    script.add("wrong_len", "poll", 1, offset=-5)
    assert script.frame_text("status", b'{"len": 20, "a": 1}') == b'{"len": 20, "a": 1}'
    assert script.frame_text("poll", b'{"len": 20, "a": 1}') == b'{"len": 15, "a": 1}'
    assert script.frame_text("poll", b'{"len": 20, "a": 1}') == b'{"len": 20, "a": 1}'


@pytest.mark.parametrize("kind, port, more", [
    ("explode", "status", {}), ("drop", "panel", {}), ("drop", "status", {"count": -1}),
    ("drop", "status", {"count": 1.5}), ("drop", "status", {"probability": -0.1}),
    ("drop", "status", {"command": "jog"}),
    ("drop", "status", {"bytes": 1}), ("split", "status", {"bytes": "x"}), ("delay", "status", {"delay_ms": 1e9}),
])
def test_wrong_rules_are_refused(kind, port, more):
    script = FaultScript()
    with pytest.raises(InvalidCommand):
        script.add(kind, port, **more)
    assert script.active() == ()
