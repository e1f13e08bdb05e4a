"""The log of trajectories that come by topic, which has no answer: refusals and early ends; no ROS master."""
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
import rospy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.trajectories import topics
from jaka_ros_driver.ros.trajectories.controller_params import controller_params

SOON_S, LATER_S = 0.1, 2.0
"""Times of a last point: of a stream's, which is followed at once, and of a trajectory's, which waits for its turn."""


@pytest.fixture
def bench(monkeypatch):
    """Return ``send(seconds)``, the futures of what the arm follows, and the log."""
    found = SimpleNamespace(followed=[], log=[], refusal=None)
    monkeypatch.setattr(topics, "ros_clock", lambda: lambda: 0)
    monkeypatch.setattr(topics, "TurnQueue", lambda: SimpleNamespace(put=lambda work: work()))
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: found.log.append(text))
    monkeypatch.setattr(rospy, "loginfo", lambda text, *values: found.log.append(text % values))

    def follow(*_):
        if found.refusal is not None:
            raise found.refusal
        found.followed.append(Future())
        return found.followed[-1]

    arm, config = SimpleNamespace(follow=follow, follow_point=follow, stops=0), config_from({})
    taken = topics.TrajectoryInterface(arm, config, controller_params(config, None), lambda state: None, Recorder(None))
    found.send = lambda seconds: taken._command(JointTrajectory(
        joint_names=["joint_%d" % n for n in range(1, 7)], points=[JointTrajectoryPoint(
            positions=[0.0] * 6, time_from_start=rospy.Duration.from_sec(seconds))]), "cell/command")
    return found


@pytest.mark.parametrize("seconds", [SOON_S, LATER_S])
def test_an_early_end_is_logged_with_its_reason_and_a_good_one_is_not(bench, seconds):
    bench.send(seconds)
    bench.followed.pop().set_result(None)
    assert bench.log == []
    bench.send(seconds)
    bench.followed.pop().set_exception(MotionInterrupted(StopCause.STOPPED))
    assert bench.log == ["cell/command: stopped by request"]


@pytest.mark.parametrize("seconds", [SOON_S, LATER_S])
def test_what_is_refused_at_once_is_logged_with_its_reason(bench, seconds):
    bench.refusal = InvalidCommand("the arm is jogged")
    bench.send(seconds)
    assert bench.log == ["cell/command: the arm is jogged"]
