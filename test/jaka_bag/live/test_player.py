"""The times at which messages go out: order, deadlines, pause, step, clock; without ROS."""
import gc
import os
import pty
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaka_bag.live.keyboard import Keyboard
from jaka_bag.live.latency_histogram import LatencyHistogram
from jaka_bag.live.linux_timing import precise_wakeups
from jaka_bag.live.log_source import Timed
from jaka_bag.live.player import Pace, Player

BASE = 10**18
MS = 10**6


class Keys:
    """A keyboard whose keys are pressed by the test: ``script`` is asked at each wait."""

    is_active = True

    def __init__(self, script):
        self.script = script

    def wait(self, timeout_s):
        return self.script()


class Stage:
    """A player with nobody listening; keeps what it does."""

    def __init__(self, pace, script=lambda: ""):
        self.done = []
        self.said = []
        self.player = Player(pace, lambda m: self.done.append(("sent", m.time - BASE)),
                             lambda t: self.done.append(("clock", t - BASE)), Keys(script), lambda: None,
                             self.said.append)

    def play(self, *at_ms):
        self.player.play([Timed(BASE + int(at * MS), 0, b"") for at in at_ms], BASE)
        return self

    def sent(self):
        return [at / MS for what, at in self.done if what == "sent"]


def test_all_are_sent_in_order_and_none_early():
    stage = Stage(Pace(rate=10.0)).play(0, 1, 1, 50, 20, 100)
    assert stage.sent() == [0, 1, 1, 50, 20, 100]
    account = stage.player.total_of([0])
    assert account.count == 6
    assert account.max_s >= 0.0


def test_a_rate_of_nearly_nothing_would_take_long_so_immediate_does_not_wait():
    stage = Stage(Pace(is_immediate=True)).play(0, 10**9, 2 * 10**9)
    assert stage.sent() == [0, 10**9, 2 * 10**9]
    assert stage.player.total_of([0]).max_s == 0.0


def test_gaps_are_skipped_and_what_follows_keeps_its_distance():
    assert Stage(Pace(skip_empty_s=1.0)).play(0, 10**7, 10**7 + 5).sent() == [0, 10**7, 10**7 + 5]


def test_the_clock_never_runs_ahead_of_the_next_message_nor_back():
    stage = Stage(Pace(clock_period_s=0.002)).play(0, 20, 1000)  # a busy host lets it wake up a few times in this
    clocks = [at for what, at in stage.done if what == "clock"]
    assert clocks == sorted(clocks)
    for i, (what, at) in enumerate(stage.done):
        if what == "sent" and at:
            assert stage.done[i - 1] == ("clock", at)
        later = [t for w, t in stage.done[i:] if w == "sent"]
        assert what == "sent" or not later or at <= later[0]
    assert len(clocks) > 4


def test_a_pause_at_the_start_sends_nothing_until_space():
    pressed = iter(["", "", "", " "])
    stage = Stage(Pace(is_paused=True), lambda: next(pressed, "")).play(0, 1)
    assert stage.sent() == [0, 1]
    assert stage.said == ["paused: space goes on, s steps", "goes on"]
    assert next(pressed, None) is None


def test_each_step_sends_one_message():
    counts = []
    stage = Stage(Pace(is_paused=True, is_immediate=True), lambda: script())

    def script():
        counts.append(len(stage.done))
        return "s"
    stage.play(0, 5, 10)
    assert stage.sent() == [0, 5, 10]
    assert counts == [0, 1, 2]


def test_several_steps_at_once_send_as_many():
    stage = Stage(Pace(is_paused=True), iter(["sss"]).__next__)
    stage.play(0, 10**6, 2 * 10**6)
    assert stage.sent() == [0, 10**6, 2 * 10**6]


def test_the_clock_stands_still_in_a_pause_and_is_told():
    told = []
    stage = Stage(Pace(is_paused=True, clock_period_s=1e-6), lambda: script())

    def script():
        told.append(None)
        return " " if len(told) > 5 else ""
    stage.play(3)
    before = [at for what, at in stage.done if what == "clock"][:5]
    assert before == [0] * 5


def test_waiting_serves_subscribers_and_keys():
    served = []
    player = Player(Pace(), lambda m: None, lambda t: None, Keyboard(), lambda: served.append(None), str)
    player.wait(0.01, 0)
    assert served


def test_lateness_of_nothing_is_zero():
    assert LatencyHistogram().quantile(0.99) == 0.0


@given(st.lists(st.floats(-1e-3, 100.0), min_size=1))
def test_quantiles_are_right_within_a_tenth_and_never_above_the_largest(values):
    account = LatencyHistogram()
    for value in values:
        account.add(value)
    exact = sorted(max(0.0, value) for value in values)
    median = exact[(len(exact) - 1) // 2]
    assert account.count == len(values)
    assert account.max_s == max(0.0, exact[-1])
    assert account.quantile(1.0) <= account.max_s
    assert median * 0.99 - 2e-7 <= account.quantile(0.5) <= median * 1.1 + 2e-7


def test_accounts_add_up():
    one, two = LatencyHistogram(), LatencyHistogram()
    one.add(0.001)
    two.add(0.1)
    one.merge(two)
    assert (one.count, one.max_s) == (2, 0.1)
    assert one.quantile(0.5) == pytest.approx(0.001, rel=0.1)


def test_punctuality_ends_with_its_context():
    interval = sys.getswitchinterval()
    with precise_wakeups():
        assert not gc.isenabled()
        assert sys.getswitchinterval() < interval
    assert gc.isenabled()
    assert sys.getswitchinterval() == interval


def test_a_pipe_or_a_hung_up_terminal_has_no_keys():
    out, into = os.pipe()
    with Keyboard(out) as keyboard:
        assert not keyboard.is_active
        os.write(into, b" ")
        assert keyboard.wait(0.0) == ""
    os.close(out)
    os.close(into)
    ours, theirs = pty.openpty()
    with Keyboard(theirs) as keyboard:  # a terminal, but of no job of ours
        assert not keyboard.is_active
    os.close(ours)
    os.close(theirs)
