"""Stamps are arrival times in ROS time, and strictly increase."""
import rospy

from jaka_ros_driver.ros.topics.stamps import StampClock

EPOCH = 1_700_000_000


class Host:
    """A computer with a monotonic clock and a system clock that can be set."""

    def __init__(self):
        self.monotonic = 50.0
        self.offset_ns = EPOCH * 10 ** 9

    def clock(self):
        return StampClock(lambda: _time_ns(self), lambda: self.monotonic)


def _time_ns(host):
    return host.offset_ns + int(host.monotonic * 1e9)


def test_the_stamp_is_when_the_frame_arrived_not_now():
    host = Host()
    clock = host.clock()
    host.monotonic = 60.25
    assert abs((clock.stamp(60.0) - rospy.Time(EPOCH + 60)).to_sec()) < 1e-6


def test_stamps_increase_also_within_the_grain_of_the_clock_and_over_small_steps_back():
    host = Host()
    clock = host.clock()
    stamps = [clock.stamp(host.monotonic) for _ in range(3)]
    host.offset_ns -= 20_000_000
    for _ in range(5):
        host.monotonic += 0.008
        stamps.append(clock.stamp(host.monotonic))
    assert all(a < b for a, b in zip(stamps, stamps[1:]))
    assert (stamps[-1] - stamps[2]).to_sec() < 0.021


def test_a_clock_that_is_set_back_is_followed_with_a_warning(caplog):
    host = Host()
    clock = host.clock()
    before = clock.stamp(host.monotonic)
    host.offset_ns -= 3600 * 10 ** 9
    host.monotonic += 0.008
    with caplog.at_level("WARNING", "jaka_ros_driver.ros.topics.stamps"):
        after = clock.stamp(host.monotonic)
    assert (before - after).to_sec() > 3599 and "set back by 3599.99" in caplog.text


def test_a_stamp_is_never_zero_and_increases_also_while_a_simulated_clock_stands_at_zero():
    now_ns = [0]
    clock = StampClock(lambda: now_ns[0], lambda: 50.0)
    stamps = [clock.stamp(50.0), clock.stamp(50.0)]
    now_ns[0] = 5 * 10 ** 9
    stamps.append(clock.stamp(49.9))
    now_ns[0] = 0
    stamps.append(clock.stamp(49.9))
    assert all(a < b for a, b in zip(stamps, stamps[1:])) and not stamps[0].is_zero()
    now_ns[0] = 10 ** 7  # the simulation begins anew
    assert not clock.stamp(49.9).is_zero()
