"""The progress of an arm on a path of segments: what it can have reached since it was seen last, and no more."""
import pytest

from jaka_ros_driver.commands import JointMove, LinearMove, Pose
from jaka_ros_driver.state import RobotState
from jaka_ros_driver.trajectory.segments import PathPlace, PathTracker, SegmentPath

SPEED = 0.5
TOOL = Pose((0.4, 0.1, 0.3), (0.0, 0.0, 0.0))


def joints(first):
    return (first, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def tracker():
    """Return a tracker of joint 1 that goes to 1 rad in 2 s, and back."""
    ways = (0.0, 1.0, 0.0)
    commands = [JointMove(joints(way), SPEED, 1.0) for way in ways[1:]]
    return PathTracker(SegmentPath(commands, [PathPlace(joints(way), TOOL) for way in ways]), 10.0)


def seen(tracker, first, at):
    tracker.observe(RobotState(joints(first), True, True, False, False, False, received_at=at))
    return tracker.time


@pytest.mark.parametrize("faster", [0.5, 1.0, 1.15])
def test_an_arm_is_followed_a_little_above_its_programmed_speed_too(tracker, faster):
    for seconds in (0.4, 0.8, 1.2):
        assert seen(tracker, SPEED * seconds * faster, 10.0 + seconds) == pytest.approx(seconds * faster, abs=0.01)


def test_an_arm_that_is_farther_than_it_can_have_come_is_moved_by_something_else(tracker):
    assert seen(tracker, SPEED * 0.4, 10.4) == pytest.approx(0.4, abs=0.01)
    assert seen(tracker, SPEED * 1.2, 10.8) == pytest.approx(0.4, abs=0.01), "three times as fast"
    assert seen(tracker, SPEED * (0.4 + 0.4 * 1.8), 10.8) == pytest.approx(0.4, abs=0.01), "almost twice as fast"


def test_an_arm_that_is_seen_on_its_way_back_has_ended_the_first_segment(tracker):
    for step in range(1, 31):
        seen(tracker, min(0.1 * step, 4.0 - 0.1 * step) * SPEED, 10.0 + 0.1 * step)
    assert tracker.time == pytest.approx(3.0, abs=0.01) and tracker.completed == 1


@pytest.mark.parametrize("turned_at, completed", [(0.98, 0), (0.998, 1), (1.0, 1)])
def test_a_corner_is_passed_only_by_an_arm_that_was_there(tracker, turned_at, completed):
    # As where the controller drops the first segment from its queue, and goes to the end of the second: a way near by.
    for step in range(1, 196):
        seen(tracker, min(0.02 * step, 2.0 * turned_at / SPEED - 0.02 * step) * SPEED, 10.0 + 0.02 * step)
    assert tracker.completed == completed and (tracker.time < 2.0) is (completed == 0)


def test_an_arm_that_was_not_seen_between_two_frames_may_have_been_at_the_corner(tracker):
    for seconds in (0.5, 1.0, 1.5, 1.9, 2.1, 2.3, 2.5, 2.7, 2.9, 3.1):
        seen(tracker, min(seconds, 4.0 - seconds) * SPEED, 10.0 + seconds)
    assert tracker.time == pytest.approx(3.1, abs=0.01) and tracker.completed == 1


def test_an_arm_that_comes_into_sight_before_a_corner_is_not_behind_it():
    # The tool is 3 mm from the begin of the line, the joints are 0.05 rad from it: two measures of the same place.
    begin, corner, end = (PathPlace(joints(q), Pose((x, 0.1, 0.3), (0.0, 0.0, 0.0)))
                          for q, x in ((0.0, 0.4), (0.5, 0.43), (0.6, 0.63)))
    commands = [JointMove(joints(0.5), SPEED, 1.0), LinearMove(end.tool, 0.1, 1.0, 0.0)]
    tracker = PathTracker(SegmentPath(commands, [begin, corner, end]), 10.0)
    tracker.observe(RobotState(joints(0.45), True, True, False, False, False, received_at=12.5,
                               tcp_position=(0.427, 0.1, 0.3), tcp_rpy=(0.0, 0.0, 0.0)))
    assert tracker.time == pytest.approx(0.9, abs=0.01) and tracker.completed == 0


def test_the_rate_of_a_segment_is_its_programmed_speed_whatever_its_length():
    far, near = (Pose((0.4 + way, 0.1, 0.3), TOOL.rpy) for way in (0.6, 0.1))
    for target in (far, near):
        segment = SegmentPath([LinearMove(target, 0.2, 1.0, 0.0)], [PathPlace(joints(0.0), TOOL),
                                                              PathPlace(joints(0.1), target)]).segments[0]
        assert segment.rate == pytest.approx(0.2)


def test_an_arm_that_leaves_its_line_at_a_slant_makes_no_progress_on_it():
    end = Pose((0.6, 0.1, 0.3), TOOL.rpy)
    tracker = PathTracker(SegmentPath([LinearMove(end, 0.1, 1.0, 0.0)], [
        PathPlace(joints(0.0), TOOL), PathPlace(joints(0.1), end)]), 10.0)
    for way, aside in ((0.01, 0.002), (0.02, 0.01)):
        tracker.observe(RobotState(joints(0.0), True, True, False, False, False, received_at=10.0 + way / 0.1,
                                   tcp_position=(0.4 + way, 0.1 + aside, 0.3), tcp_rpy=TOOL.rpy))
        assert tracker.time == pytest.approx(0.1, abs=0.01)
