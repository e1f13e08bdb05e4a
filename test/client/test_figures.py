"""Figures that pages and other software rely on, and the feed's report of itself."""
import pytest

from jaka_ros_driver.client.core.feed import Feed
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.client.stopping import DriverCondition, Step, Stopping
from jaka_ros_driver.commands import LoadProgram, SetRapidRate
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics import limits
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol.status import encode_frame

ZU7 = load_model("zu7")
FRAME = encode_frame({"joint_actual_position": [0.0, 90.0, -90.0, 90.0, 90.0, 0.0], "powered_on": 1, "enabled": True,
                      "inpos": True, "emergency_stop": 0, "protective_stop": 0, "errcode": "0x0"})
DEFAULTS = {
    "connect_timeout": 1.0, "reply_timeout": 0.9, "silence_timeout": 0.8, "stale_after": 0.5, "feed_period": 0.008,
    "motion_timeout": 300.0, "power_timeout": 30.0, "enable_timeout": 30.0, "jog_timeout": 3.0, "servo_timeout": 10.0,
    "servo_ahead": 0.2, "servo_max_joint_jump": 0.1, "servo_max_linear_jump": 0.05, "servo_max_angular_jump": 0.1,
    "stream_ahead": 0, "trajectory_start_tolerance": 0.01, "late_stamp": 1.0, "trajectory_overshoot": "scale",
    "jog_max_joint_speed": 0.5, "jog_max_linear_speed": 0.25,
    "jog_max_angular_speed": 0.5, "link_loss_stop": 0.3, "command_port": 10001, "status_port": 10000}
"""The defaults in docs/parameters.md."""


def test_what_nobody_sets_has_the_values_of_the_page():
    settings = ClientSettings("10.5.5.100")
    assert {name: getattr(settings, name) for name in DEFAULTS} == DEFAULTS
    assert settings.io_index_base is None and settings.simulator == ""


@pytest.mark.parametrize("command, is_taken", [
    (SetRapidRate(0.0), True), (SetRapidRate(1.0), True), (SetRapidRate(1.01), False), (SetRapidRate(-0.01), False),
    (LoadProgram("a"), True), (LoadProgram(""), False), (LoadProgram(" a"), False), (LoadProgram("a\n"), False)])
def test_what_is_taken_at_the_edges(command, is_taken):
    if is_taken:
        limits.check(command, ZU7)
    else:
        with pytest.raises(InvalidCommand):
            limits.check(command, ZU7)


def test_a_frozen_driver_is_ended_a_quarter_of_a_second_after_the_first_refusal():
    stopping, now = Stopping(100.0, lambda text: None), 100.0
    while True:
        step = stopping.step(now, DriverCondition.SILENT)
        if step is Step.END_DRIVER:
            break
        if step is Step.CONNECT:
            stopping.failed("refused", True, now)
        now += 0.001
        assert now < 101.0
    assert 0.2 < now - 100.0 < 0.3


# ---- the feed ----

def fed(intervals, begin=10.0):
    feed, now = Feed(0.008), begin
    feed.open(now)
    for interval in intervals:
        now += interval
        feed.received(FRAME, now)
    return feed, now


def test_a_feed_that_has_not_begun_reports_nothing():
    health = Feed(0.008).health(10.0, 0.8)
    assert (health.rate, health.jitter, health.frames, health.damaged) == (0.0, 0.0, 0, 0)


def test_rate_and_age_of_a_steady_feed():
    feed, now = fed([0.008] * 200)
    health = feed.health(now + 0.1, 0.8)
    assert health.rate == pytest.approx(125.0, rel=0.01) and health.age == pytest.approx(0.1)
    assert health.jitter < 1e-6 and health.frames == 200
    assert feed.health(now + 1.0, 0.8).rate == 0.0, "it is silent"


def test_jitter_is_that_of_the_worst_frames_and_not_of_the_best():
    feed, now = fed([0.008, 0.008, 0.008, 0.012, 0.004] * 40)
    assert feed.health(now, 0.8).jitter == pytest.approx(0.004, abs=1e-4)


def test_damage_is_counted_from_none():
    feed, now = fed([0.008] * 3)
    feed.received(FRAME.replace(b"true", b"nope"), now + 0.008)
    assert feed.health(now, 0.8).damaged == 1


def test_what_was_missing_on_one_connection_is_not_missing_on_the_next():
    feed, now = fed([0.008] * 50 + [0.4])
    feed.open(now + 1.0)
    feed.received(FRAME, now + 1.0)
    states = feed.received(FRAME * 50, now + 1.4)
    assert [is_new for _, is_new in states] == [False] * 49 + [True]
