"""Trajectories by topic, the controller's state, and the other names that ROS-Industrial clients expect."""
from typing import Any, Callable, Dict, List, Optional

import genpy
import rospy
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMessage

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.ros.audit.recorder import Recorder
from jaka_ros_driver.ros.direct_publisher import direct_publisher
from jaka_ros_driver.ros.other_messages import message_type, stop_motion_type
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.services.server import CallCount, ServiceServer
from jaka_ros_driver.ros.topics.stamps import StampClock, ros_clock
from jaka_ros_driver.ros.trajectories.action import TrajectoryAction, TurnQueue
from jaka_ros_driver.ros.trajectories.controller_params import ControllerParams
from jaka_ros_driver.ros.trajectories.messages import TrajectoryDecoder, fill_states
from jaka_ros_driver.state import RobotState, Vector
from jaka_ros_driver.trajectory.follower import LONGEST_AHEAD_S
from jaka_ros_driver.trajectory.path import JointState

_EARLY_S = 0.004
"""Half an interval, s, of the feed at 125 Hz: a frame that jitter brings early still counts as due."""
_QUEUE = 10
"""Messages that wait, of states for a slow subscriber, of trajectories for the client's thread."""
_LOG_PERIOD_S = 1.0
"""Least time, s, between two warnings of a stream whose every message may be wrong."""


class TrajectoryInterface:
    """All names under which trajectories are taken, and the topics of their state."""

    def __init__(self, arm: ArmClient, config: DriverConfig, params: ControllerParams,
                 joint_velocity: Callable[[RobotState], Optional[Vector]], recorder: Recorder) -> None:
        """Set up the names; ``offer`` begins.

        joint_velocity: Returns the velocity of the joints in the newest state, rad/s (6,).
        """
        self._arm = arm
        self._recorder = recorder
        self._controller = config.trajectory_controller_name
        self._decoder = TrajectoryDecoder(config, params)
        self._turns = TurnQueue()
        self._goals = CallCount()
        self._has_industrial_names = config.industrial_names
        names = [self._controller + "/follow_joint_trajectory"]
        names += ["joint_trajectory_action"] if config.industrial_names else []
        ros_time = ros_clock()
        self._clock = StampClock(ros_time)
        self._actions = [TrajectoryAction(name, arm, self._decoder, self._turns, self._goals, recorder,
                                          StampClock(ros_time)) for name in names]
        self._states: List[rospy.Publisher[Any]] = []
        self._joint_velocity = joint_velocity
        self._published_at = 0.0
        self._newest: Dict[str, JointTrajectoryMessage] = {}
        self._stop_service: Optional[ServiceServer] = None

    def offer(self) -> None:
        """Begin to take trajectories, and to publish."""
        self._states = [direct_publisher(self._controller + "/state", message_type(
            "control_msgs/JointTrajectoryControllerState"), _QUEUE)]
        commands = [self._controller + "/command"]
        if self._has_industrial_names:
            self._states.append(direct_publisher("feedback_states", message_type(
                "control_msgs/FollowJointTrajectoryFeedback"), _QUEUE))
            commands.append("joint_path_command")
            stop_motion = stop_motion_type()
            self._recorder.offers_service("stop_motion")
            self._stop_service = ServiceServer("stop_motion", stop_motion, lambda request: self._stop_motion(
                request, stop_motion._response_class()), CallCount(), is_stop=True)
        self._arm.add_listener(self._arrived)
        for action in self._actions:
            action.offer()
        for name in commands:
            self._recorder.takes_topic(name)
            rospy.Subscriber(name, JointTrajectoryMessage, self._command, name, queue_size=_QUEUE, tcp_nodelay=True)

    def finish_goals(self, timeout: float) -> None:
        """Wait until every goal has its result, at most ``timeout`` s."""
        if not self._goals.wait_for_none(timeout):
            rospy.logwarn("a trajectory's goal was not answered before the driver shut down")

    # ---- inside ----

    def _command(self, message: JointTrajectoryMessage, name: str) -> None:
        """Take a trajectory; of several that wait only the newest is followed.

        A faster stream than can be audited must not be followed late. One without points ends the running trajectory at
        once, and all that wait.
        """
        self._newest[name] = message
        if not message.points:
            self._recorder.message(name, message, state="stop")
        if message.points:
            if self._is_point_of_a_stream(message):
                self._follow_point(message, name)
                return
            stops = self._arm.stops
            self._turns.put(lambda: self._follow(message, name, stops))
            return
        self._newest.clear()
        self._arm.end_trajectories()

    def _follow(self, message: JointTrajectoryMessage, name: str, stops: int) -> None:
        """Follow a trajectory of a topic; log a refusal or an early end, because a topic has no answer."""
        if self._newest.get(name) is not message:
            self._recorder.message(name, message, "a newer one came before it began")
            return
        try:
            trajectory = self._decoder.trajectory(message, is_goal=False)
            assert trajectory is not None
            done = self._arm.follow(trajectory, self._decoder.tolerances(), stops)
        except JakaError as error:
            self._recorder.message(name, message, str(error))
            rospy.logwarn_throttle(_LOG_PERIOD_S, "%s: %s" % (name, error))
            return
        self._recorder.message(name, message)
        done.add_done_callback(lambda ended: _log_end(name, ended.exception()))

    @staticmethod
    def _is_point_of_a_stream(message: JointTrajectoryMessage) -> bool:
        """Return whether a message has one point that is due soon; some senders repeat it, which means nothing else."""
        first = message.points[0]
        return (first.time_from_start.to_sec() <= LONGEST_AHEAD_S
                and all(point.positions == first.positions for point in message.points[1:]))

    def _follow_point(self, message: JointTrajectoryMessage, name: str) -> None:
        """Follow a point at once: a stream that waited for its turn would be followed late."""
        try:
            position, due = self._decoder.stream_point(message)
            taken = self._arm.follow_point(position, due)
        except JakaError as error:
            self._point_ended(message, name, error)
            return
        taken.add_done_callback(lambda ended: self._point_ended(message, name, ended.exception()))

    def _point_ended(self, message: JointTrajectoryMessage, name: str, error: Optional[BaseException]) -> None:
        self._recorder.message(name, message, "" if error is None else str(error))
        if error is not None:
            rospy.logwarn_throttle(_LOG_PERIOD_S, "%s: %s" % (name, error))

    def _stop_motion(self, request: genpy.Message, response: Any) -> Any:
        entry = self._recorder.prepared_call("stop_motion", request)
        try:
            self._arm.stop(entry.begin)
            response.code.val = 1
            entry.answered(True, "stopped")
        except JakaError as error:
            entry.answered(False, str(error))
            rospy.logwarn("stop_motion: %s", error)
            response.code.val = -1
        return response

    def _arrived(self, state: RobotState, is_new: bool) -> None:
        if not is_new or state.received_at - self._published_at < self._decoder.params.state_period - _EARLY_S:
            return
        heard = [publisher for publisher in self._states if publisher.get_num_connections()]
        if not heard:
            return
        self._published_at = state.received_at
        velocity = self._joint_velocity(state)
        progress = self._arm.trajectory
        desired = _resting(state) if progress is None else progress.desired
        stamp = self._clock.stamp(state.received_at)
        for publisher in heard:
            publisher.publish(fill_states(publisher.data_class(), self._decoder.joint_names, stamp, desired,
                                          (state.joint_position, velocity), 0.0 if progress is None
                                          else progress.time))


def _log_end(name: str, error: Optional[BaseException]) -> None:
    if error is not None:
        rospy.loginfo("%s: %s", name, error)


def _resting(state: RobotState) -> JointState:
    """Return the desired state while no trajectory runs: the position that the controller commands."""
    commanded: Vector = state.joint_position_commanded or state.joint_position
    return JointState(commanded, (0.0,) * len(commanded), (0.0,) * len(commanded))
