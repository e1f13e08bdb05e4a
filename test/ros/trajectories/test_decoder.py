"""Goals to trajectories and tolerances, and the types that are made where no package has them; no running driver."""
import hashlib
import logging
import math
import sys
import time
import types

import genmsg.gentools
import genmsg.msg_loader
import pytest
import rospy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from jaka_ros_driver.ros import other_messages
from jaka_ros_driver.ros.params import config_from
from jaka_ros_driver.ros.trajectories import action
from jaka_ros_driver.ros.trajectories.controller_params import controller_params
from jaka_ros_driver.ros.trajectories.messages import InvalidJoints, TrajectoryDecoder, fill_states
from jaka_ros_driver.trajectory.path import JointState
from jaka_ros_driver.trajectory.points import InvalidTrajectory

NAMES = ["joint_%d" % n for n in range(1, 7)]
AT = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
ACTION = "control_msgs/FollowJointTrajectoryAction"


def decoder(yaml=None, **parameters):
    config = config_from(parameters)
    return TrajectoryDecoder(config, controller_params(config, yaml))


def message(names=NAMES, **fields):
    point = JointTrajectoryPoint(**{"positions": AT, "time_from_start": rospy.Duration(2), **fields})
    return JointTrajectory(joint_names=list(names), points=[point])


def goal(**fields):
    made = other_messages.made_type("control_msgs/FollowJointTrajectoryGoal")()
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def tolerance(name, position, **fields):
    return other_messages.made_type("control_msgs/JointTolerance")(
        **{"name": name, "position": position, "velocity": 0.0, "acceleration": 0.0, **fields})


# ---- trajectories ----

def test_joints_come_in_any_order_and_each_value_goes_with_its_name():
    names = ["joint_3", "joint_1", "joint_6", "joint_2", "joint_5", "joint_4"]
    sent = message(names, positions=[3.0, 1.0, 6.0, 2.0, 5.0, 4.0], velocities=[0.3, 0.1, 0.6, 0.2, 0.5, 0.4],
                   accelerations=[30.0, 10.0, 60.0, 20.0, 50.0, 40.0])
    (point,) = decoder().trajectory(sent).points
    assert point.position == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0) and point.velocity == (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    assert point.acceleration == (10.0, 20.0, 30.0, 40.0, 50.0, 60.0) and point.time == 2.0


def test_joints_are_known_with_the_prefix_of_the_frames_and_without():
    one = decoder(frame_prefix="left_")
    assert one.joint_names == ["left_" + name for name in NAMES]
    assert one.trajectory(message(one.joint_names)) == one.trajectory(message())


@pytest.mark.parametrize("names, what", [
    (NAMES[:5], "joint_names lacks joint_6"),
    (NAMES[:5] + ["joint_7"], "joint_names has 'joint_7'; the arm has joint_1"),
    (NAMES[:5] + ["joint_5"], "joint 5 of the arm twice"),
    (NAMES + ["joint_1"], "joint 1 of the arm twice"),
    ([], "joint_names lacks joint_1"),
    (["Joint_1"] + NAMES[1:], "'Joint_1'")])
def test_other_names_than_those_of_the_six_joints_are_refused_by_name(names, what):
    with pytest.raises(InvalidJoints, match=what):
        decoder().trajectory(message(names))


@pytest.mark.parametrize("field, values, what", [
    ("positions", AT[:5], "point 1 has 5 positions; it must be 6"), ("positions", (), "point 1 has 0 positions"),
    ("velocities", AT[:3], "point 1 has 3 velocities; it must be 6, or none"),
    ("accelerations", AT * 2, "point 1 has 12 accelerations; it must be 6, or none")])
def test_lengths_that_do_not_fit_are_refused(field, values, what):
    with pytest.raises(InvalidTrajectory, match=what) as refused:
        decoder().trajectory(message(**{field: values}))
    assert not isinstance(refused.value, InvalidJoints)


def test_what_is_not_specified_is_none_and_a_trajectory_without_points_is_a_stop():
    (point,) = decoder().trajectory(message()).points
    assert point.velocity is None and point.acceleration is None
    assert decoder().trajectory(JointTrajectory(joint_names=NAMES)) is None
    for names in ((), ("elbow",)):  # as ros_controllers: an empty message of the topic stops, of the action it is wrong
        assert decoder().trajectory(JointTrajectory(joint_names=names), is_goal=False) is None
        with pytest.raises(InvalidJoints):
            decoder().trajectory(JointTrajectory(joint_names=names))


def test_a_stamp_is_the_moment_at_which_it_starts_and_none_means_at_once(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
    sent = message()
    assert decoder().trajectory(sent).starts_at is None
    for later in (2.0, -0.5):
        asked_at = time.monotonic()
        sent.header.stamp = rospy.Time.now() + rospy.Duration.from_sec(later)
        starts_at = decoder().trajectory(sent).starts_at
        assert asked_at + later - 0.1 < starts_at < time.monotonic() + later + 0.1


def test_only_a_topic_may_ask_for_a_last_point_in_motion():
    assert not decoder().trajectory(message()).may_end_moving
    assert decoder().trajectory(message(), is_goal=False).may_end_moving


def test_a_goal_for_some_joints_is_taken_only_where_the_cell_allows_it():
    some = message(["joint_5", "joint_2"], positions=[0.5, 0.2], velocities=[5.0, 2.0])
    with pytest.raises(InvalidJoints, match="joint_names lacks joint_1, joint_3, joint_4, joint_6"):
        decoder().trajectory(some)
    found = decoder({"allow_partial_joints_goal": True}).trajectory(some)
    assert found.held == (0, 2, 3, 5)
    assert found.points[0].position[1] == 0.2 and found.points[0].velocity[4] == 5.0
    with pytest.raises(InvalidJoints):
        decoder({"allow_partial_joints_goal": True}).trajectory(message([]))


def test_points_of_negative_time_are_left_out():
    sent = message()
    sent.points.insert(0, JointTrajectoryPoint(positions=AT, time_from_start=rospy.Duration.from_sec(-0.1)))
    assert [point.time for point in decoder().trajectory(sent).points] == [2.0]


def test_a_point_of_a_stream_is_due_soon(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
    sent = message(time_from_start=rospy.Duration.from_sec(0.034))
    asked_at = time.monotonic()
    position, due = decoder().stream_point(sent)
    assert position == AT and asked_at + 0.034 <= due <= time.monotonic() + 0.034
    for stamp, what in ((-1.5, "is due in -1.4"), (1.0, "is due in 1.0")):
        sent.header.stamp = rospy.Time.now() + rospy.Duration.from_sec(stamp)
        with pytest.raises(InvalidTrajectory, match=what):
            decoder().stream_point(sent)
    for wrong in ({"positions": AT[:5]}, {"positions": (math.nan,) * 6}):
        with pytest.raises(InvalidTrajectory):
            decoder().stream_point(message(time_from_start=rospy.Duration.from_sec(0.034), **wrong))


# ---- tolerances ----

def test_without_tolerances_those_of_the_parameters_hold():
    for asked in (None, goal(), goal(path_tolerance=[tolerance("joint_2", 0.0)])):
        found = decoder(trajectory_path_tolerance=0.03, trajectory_goal_time=2.0).tolerances(asked)
        assert (found.path, found.goal, found.goal_time) == ((0.03,) * 6, (0.01,) * 6, 2.0)
    found = decoder(trajectory_goal_tolerance=0.0).tolerances()
    assert found.path == (None,) * 6 and found.goal == (None,) * 6 and found.goal_time == 1.0


def test_tolerances_of_the_goal_are_those_of_their_joint_and_negative_ones_are_none(caplog):
    caplog.set_level(logging.INFO)
    found = decoder(trajectory_path_tolerance=0.03).tolerances(goal(
        path_tolerance=[tolerance("joint_5", 0.2), tolerance("joint_1", -1.0)],
        goal_tolerance=[tolerance("joint_6", 0.001, velocity=0.5), tolerance("joint_2", -0.1)]))
    assert found.path == (None, 0.03, 0.03, 0.03, 0.2, 0.03)
    assert found.goal == (0.01, None, 0.01, 0.01, 0.01, 0.001)
    said, = [record.message for record in caplog.records]
    assert said.startswith("goal_tolerance of joint_6: only the position is watched")


@pytest.mark.parametrize("asked, found", [(0.0, 1.0), (0.25, 0.25), (-1.0, None)])
def test_the_time_at_the_goal(asked, found):
    assert decoder().tolerances(goal(goal_time_tolerance=rospy.Duration.from_sec(asked))).goal_time == found


@pytest.mark.parametrize("field", ["path_tolerance", "goal_tolerance"])
def test_tolerances_that_make_no_sense_are_refused(field):
    with pytest.raises(InvalidJoints, match="%s names joint 'joint_0'" % field):
        decoder().tolerances(goal(**{field: [tolerance("joint_0", 0.1)]}))
    with pytest.raises(InvalidTrajectory, match="%s of joint_1 holds" % field):
        decoder().tolerances(goal(**{field: [tolerance("joint_1", math.nan)]}))
    with pytest.raises(InvalidTrajectory, match="finite"):
        decoder().tolerances(goal(**{field: [tolerance("joint_1", 0.1, velocity=math.inf)]}))


# ---- states ----

@pytest.mark.parametrize("name", ["control_msgs/FollowJointTrajectoryFeedback",
                                  "control_msgs/JointTrajectoryControllerState"])
def test_states_are_told_with_their_error_which_is_desired_less_actual(name):
    desired = JointState(AT, (0.5,) * 6, (0.1,) * 6)
    told = fill_states(other_messages.made_type(name)(), NAMES, rospy.Time(5), desired, ((0.0,) * 6, (0.2,) * 6), 1.5)
    assert told.joint_names == NAMES and told.header.stamp == rospy.Time(5)
    assert told.desired.positions == AT and told.desired.accelerations == (0.1,) * 6
    assert told.error.positions == AT and told.error.velocities == pytest.approx((0.3,) * 6)
    assert told.actual.velocities == (0.2,) * 6 and told.desired.time_from_start == rospy.Duration.from_sec(1.5)
    told = fill_states(told, NAMES, rospy.Time(5), desired, ((0.0,) * 6, None), -2.0)
    assert told.actual.velocities == () and told.error.velocities == () and told.desired.time_from_start.is_zero()


# ---- types ----

@pytest.mark.parametrize("name, md5", [
    (ACTION, "bc4f9b743838566551c0390c65f1a248"),
    ("control_msgs/FollowJointTrajectoryFeedback", "10817c60c2486ef6b33e97dcd87f4474"),
    ("control_msgs/JointTrajectoryControllerState", "10817c60c2486ef6b33e97dcd87f4474"),
    ("control_msgs/GripperCommandAction", "950b2a6ebe831f5d4f4ceaba3d8be01e"),
    ("industrial_msgs/RobotStatus", "b733cb45a38101840b75c4c0d6093d19"),
    ("visualization_msgs/MarkerArray", "d155b9ce5188fbaf89745847fd5882d7")])
def test_a_type_of_our_own_is_the_published_one_on_the_wire(name, md5):
    made = other_messages.made_type(name)
    assert made._type == name and made._md5sum == other_messages.MD5[name] == md5
    assert other_messages.message_type(name)._md5sum == md5


def test_no_md5_is_without_a_pin():
    assert len(other_messages.MD5) == 6 + len(SERVICES) + 2


SERVICES = {
    "control_msgs/QueryTrajectoryState": "ec93cdecbd8062d761aa52b7c90cd44b",
    "controller_manager_msgs/ListControllerTypes": "c1d4cd11aefa9f97ba4aeb5b33987f4e",
    "controller_manager_msgs/ListControllers": "1341feb2e63fa791f855565d0da950d8",
    "controller_manager_msgs/LoadController": "647e5c54b8d6468952d8d31f1efe96c0",
    "controller_manager_msgs/ReloadControllerLibraries": "40e8c411fd1797d2e2c486018f846040",
    "controller_manager_msgs/SwitchController": "b29a7abc673b2c54c14b54e50f8d06a5",
    "controller_manager_msgs/UnloadController": "647e5c54b8d6468952d8d31f1efe96c0",
}


def md5_of(request, response):
    """Return the checksum that ROS gives to a service of these two messages."""
    texts = []
    for message in (request, response):
        context = genmsg.MsgContext.create_default()
        for name, text in other_messages._DEFINITIONS.items():
            context.register(name, genmsg.msg_loader.load_msg_from_string(context, text, name))
        texts.append(genmsg.gentools.compute_md5_text(context, context.get_registered(message._type)))
    return hashlib.md5("".join(texts).encode()).hexdigest()


@pytest.mark.parametrize("name, md5", sorted(SERVICES.items()))
def test_a_service_of_our_own_is_the_published_one_on_the_wire(name, md5):
    made = other_messages.made_service(name)
    assert made._type == name and made._md5sum == other_messages.MD5[name] == md5
    assert md5_of(made._request_class, made._response_class) == md5


def test_clients_of_the_older_switch_controller_are_known():
    made = other_messages.old_switch_type()
    assert made._type == "controller_manager_msgs/SwitchController" and made._request_class.STRICT == 2
    assert md5_of(made._request_class, made._response_class) == made._md5sum == "5e857dedf71d6f337975e15a1e7cfdd8"


def test_the_state_of_a_controller_is_the_published_one_on_the_wire():
    assert other_messages.made_type("controller_manager_msgs/ControllerState")._md5sum == other_messages.MD5[
        "controller_manager_msgs/ControllerState"] == "aeb6b261d97793ab74099a3740245272"


def test_the_service_of_our_own_is_the_published_one_on_the_wire():
    made = other_messages.stop_motion_type()
    assert made._type == "industrial_msgs/StopMotion" and made._md5sum == "50b1f38f75f5677e5692f3b3e7e1ea48"
    assert made._request_class()._md5sum == "d41d8cd98f00b204e9800998ecf8427e"
    response = made._response_class()
    response.code.val = -1
    assert response.code.FAILURE == -1 and response.code.SUCCESS == 1


def test_the_codes_of_the_result_are_those_that_the_action_answers():
    result = other_messages.made_type("control_msgs/FollowJointTrajectoryResult")
    assert [getattr(result, name) for name in (
        "SUCCESSFUL", "INVALID_GOAL", "INVALID_JOINTS", "OLD_HEADER_TIMESTAMP", "PATH_TOLERANCE_VIOLATED",
        "GOAL_TOLERANCE_VIOLATED")] == [0, -1, -2, -3, -4, -5]


def test_installed_packages_are_taken(monkeypatch):
    installed = types.SimpleNamespace(FollowJointTrajectoryAction="the action", StopMotion="the service")
    monkeypatch.setitem(sys.modules, "control_msgs.msg", installed)
    monkeypatch.setitem(sys.modules, "industrial_msgs.srv", installed)
    assert other_messages.message_type(ACTION) == "the action"
    assert other_messages.stop_motion_type() == "the service"


def test_the_codes_of_results_are_those_of_control_msgs():
    assert (action.SUCCESSFUL, action.INVALID_GOAL, action.INVALID_JOINTS, action.OLD_HEADER_TIMESTAMP,
            action.PATH_TOLERANCE_VIOLATED, action.GOAL_TOLERANCE_VIOLATED) == (0, -1, -2, -3, -4, -5)
