"""The dead-man of a page, driven by events and times: which heartbeats count, and the reason for each end."""
import pytest

from jaka_panel.authority.jog_hold import (
    LATE_S,
    MISSED_S,
    SEEN_S,
    DelayEstimate,
    JogHold,
    JogSpeedLimits,
    Place,
    WrongHeartbeat,
    heartbeat_from,
)

LIMITS = JogSpeedLimits(0.5, 0.25, 0.5)
HERE = Place((0.0,) * 6, ((0.4, 0.0, 0.3), (3.14, 0.0, 0.0)))
ZERO = (0.0,) * 6


class Hand:
    """A page's hand and the driver's ear."""

    def __init__(self):
        self.said, self.told = [], []
        self.jog = JogHold(self.said.append, lambda page, message: self.told.append((page, message)))
        self.now = 100.0
        self.sequence = 0

    def beat(self, page="p1", hold=1, passed=0.05, old=0.03, lateness=0.0, place=HERE, **changes):
        """Send a heartbeat; an arm that is not placed elsewhere has moved a little with each velocity said before."""
        self.now += passed
        self.sequence += 1
        message = dict({"arm": "/a", "hold": hold, "seq": self.sequence, "clock": 1.0, "echo": self.now - old,
                        "space": "joint", "v": [1.0, 0, 0, 0, 0, 0], "step": None}, **changes)
        if place is HERE:
            place = Place((0.001 * sum(map(any, self.velocities())),) + HERE.joints[1:], HERE.tool)
        self.jog.heartbeat(page, heartbeat_from(message), lateness, place, LIMITS, self.now)

    def why(self):
        return self.told[-1][1]["why"]

    def velocities(self):
        return [velocity.values for velocity in self.said]


@pytest.fixture
def hand():
    return Hand()


def test_rest_is_said_first_and_then_one_message_for_each_heartbeat(hand):
    for _ in range(4):
        hand.beat()
    assert hand.velocities() == [ZERO] + 3 * [(0.05, 0.0, 0.0, 0.0, 0.0, 0.0)]
    assert [message["state"] for _, message in hand.told] == ["holding", "moving"]


def test_moving_is_what_the_arm_does_and_not_what_was_sent(hand):
    for _ in range(9):
        hand.beat(place=Place(HERE.joints, HERE.tool))
    assert hand.velocities()[-1] != ZERO and [message["state"] for _, message in hand.told] == ["holding"]
    hand.beat()
    assert hand.told[-1][1]["state"] == "moving"


def test_a_press_over_a_link_that_is_too_slow_is_refused_with_the_reason_and_dead(hand):
    for _ in range(3):
        hand.beat(old=0.41)
    assert not hand.said and len(hand.told) == 1 and "too slow" in hand.why() and "0.41 s" in hand.why()
    hand.beat()
    assert not hand.said, "the press is dead"
    hand.beat(hold=2)
    assert hand.told[-1][1]["state"] == "holding"


def test_release_says_rest_at_once_and_the_press_is_dead(hand):
    hand.beat()
    hand.beat()
    hand.jog.stop("p1", 1)
    assert hand.velocities()[-1] == ZERO and hand.why() == "released"
    count = len(hand.said)
    hand.beat()
    assert len(hand.said) == count and hand.jog.arm is None
    hand.beat(hold=2)
    assert hand.velocities()[-1] == ZERO and hand.told[-1][1]["state"] == "holding"


@pytest.mark.parametrize("change", [
    {"old": SEEN_S + 0.01}, {"old": -SEEN_S - 0.01}, {"lateness": LATE_S + 0.01}, {"seq": 1}], ids=str)
def test_what_does_not_count_moves_nothing_and_keeps_nothing(hand, change):
    hand.beat()
    hand.beat()
    count = len(hand.said)
    for _ in range(2):
        hand.beat(**change)
    assert len(hand.said) == count
    hand.jog.tick(hand.now + MISSED_S)
    assert hand.velocities()[-1] == ZERO and hand.told[-1][1]["state"] == "ended"


def test_silence_ends_it_on_a_tick_or_with_the_next_heartbeat(hand):
    hand.beat()
    hand.beat()
    hand.jog.tick(hand.now + MISSED_S - 0.01)
    assert hand.jog.arm == "/a"
    hand.beat(passed=MISSED_S + 0.01)
    assert hand.velocities()[-1] == ZERO and hand.why() == "missed"
    hand.beat()
    assert hand.velocities()[-1] == ZERO, "the same press does not begin again"


def test_an_arm_that_is_not_seen_is_not_jogged(hand):
    hand.beat(place=None)
    assert not hand.said and "not fresh" in hand.why()
    hand.beat(hold=2)
    hand.beat(hold=2)
    hand.beat(hold=2, place=None)
    assert hand.velocities()[-1] == ZERO and "not fresh" in hand.why()


@pytest.mark.parametrize("change", [{"space": "tool"}, {"arm": "/b"}, {"hold": 2}, {"page": "p2"}])
def test_another_space_arm_press_or_page_ends_it(hand, change):
    for _ in range(3):
        hand.beat()
    hand.beat(**change)
    assert (hand.said[3].values, hand.said[3].arm, hand.said[3].space) == (ZERO, "/a", "joint")
    assert hand.told[2][1]["state"] == "ended"


def test_after_a_jog_by_joints_the_tool_rests_until_the_driver_listens_to_its_topic(hand):
    hand.beat()
    hand.beat()
    hand.jog.stop("p1", 1)
    count = len(hand.said)
    for _ in range(14):
        hand.beat(hold=2, space="base")
    assert set(hand.velocities()[count:]) == {ZERO}
    for _ in range(3):
        hand.beat(hold=2, space="base")
    assert hand.velocities()[-1] != ZERO and hand.told[-1][1]["state"] == "moving"


def test_speeds_are_shares_of_the_limits_and_no_diagonal_is_faster(hand):
    for _ in range(2):
        hand.beat(space="base", v=[1.0, 1.0, 0, 0, 0, 0.5])
    x, y, z, _, _, turn = hand.velocities()[-1]
    assert (x * x + y * y) ** 0.5 == pytest.approx(0.1 * 0.25) and z == 0.0 and turn == pytest.approx(0.5 * 0.1 * 0.5)
    hand.jog.fraction = 1.0
    hand.beat(space="base", v=[0, 0, -1.0, 0, 0, 0])
    assert hand.velocities()[-1] == (0.0, 0.0, -0.25, 0.0, 0.0, 0.0)


def test_a_step_slows_down_and_ends_by_itself(hand):
    speeds, at = [], 0.0
    for _ in range(200):
        hand.beat(step=0.05, v=[-1.0, 0, 0, 0, 0, 0], place=Place((at, 0, 0, 0, 0, 0), None))
        if hand.jog.arm is None:
            break
        at += 0.05 * hand.velocities()[-1][0]
        speeds.append(abs(hand.velocities()[-1][0]))
    assert hand.why() == "step done" and at == pytest.approx(-0.05, abs=0.003) and speeds[-1] < 0.2 * max(speeds)


@pytest.mark.parametrize("wrong", [
    {"space": "user"}, {"space": None}, {"v": [1.0] * 5}, {"v": [2.0, 0, 0, 0, 0, 0]}, {"v": [float("nan")] * 6},
    {"v": "x"}, {"v": [True] * 6}, {"hold": 1.5}, {"seq": None}, {"clock": "1"}, {"echo": float("inf")},
    {"step": 0.01, "v": [0.5, 0, 0, 0, 0, 0]}, {"step": 0.01, "v": [1.0, 1.0, 0, 0, 0, 0]}, {"step": -0.1},
    {"step": 9.0}, {"step": "far"}])
def test_what_is_no_heartbeat(wrong):
    good = {"arm": "/a", "hold": 1, "seq": 1, "clock": 1.0, "echo": 1.0, "space": "joint", "v": [1.0, 0, 0, 0, 0, 0],
            "step": None}
    assert heartbeat_from(good).share[0] == 1.0
    with pytest.raises(WrongHeartbeat):
        heartbeat_from({**good, **wrong})


def test_lateness_is_against_the_quickest_of_the_last_seconds():
    late = DelayEstimate()
    assert late.of(1.0, 51.0) == 0.0
    assert late.of(2.0, 52.3) == pytest.approx(0.3)
    assert late.of(3.0, 52.9) == 0.0
    assert late.of(4.0, 54.0) == pytest.approx(0.1)
    assert late.of(20.0, 70.1) == 0.0, "what is long ago counts no more: clocks drift"
