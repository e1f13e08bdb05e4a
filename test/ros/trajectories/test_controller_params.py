"""The yaml of a ros_control cell, as it stands in the controller's namespace."""
import logging

import pytest
import yaml

from jaka_ros_driver.ros.params import WrongParameter, config_from
from jaka_ros_driver.ros.trajectories.controller_params import controller_params

CELL = """
type: position_controllers/JointTrajectoryController
joints: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]
constraints:
  goal_time: 0.6
  stopped_velocity_tolerance: 0.05
  joint_1: {trajectory: 0.1, goal: 0.02}
  joint_6: {goal: 0.0}
state_publish_rate: 25
action_monitor_rate: 10
stop_trajectory_duration: 0.5
allow_partial_joints_goal: true
gains:
  joint_1: {p: 100, d: 1, i: 1, i_clamp: 1}
"""
"""The parameters of a JointTrajectoryController, as its documentation lists them."""


def read(text, **parameters):
    return controller_params(config_from(parameters), yaml.safe_load(text) if text else None)


def test_the_yaml_of_a_cell_is_read_as_it_stands(caplog):
    with caplog.at_level(logging.INFO):
        params = read(CELL)
    assert params.path == (0.1, None, None, None, None, None)
    assert params.goal == (0.02, 0.01, 0.01, 0.01, 0.01, None)
    assert (params.goal_time, params.state_period, params.allows_partial) == (0.6, 0.04, True)
    said = caplog.text
    for name in ("action_monitor_rate", "stop_trajectory_duration", "constraints/stopped_velocity_tolerance",
                 "gains/joint_1/p"):
        assert "parameter jaka_zu7_controller/%s is not used: " % name in said
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.parametrize("nothing", ["", "[]", "3", "{}"])
def test_without_a_yaml_the_drivers_own_parameters_hold(nothing):
    params = read(nothing, trajectory_path_tolerance=0.03, trajectory_goal_time=2.0)
    assert params == ((0.03,) * 6, (0.01,) * 6, 2.0, 0.02, False)


def test_joints_are_known_with_the_prefix_of_the_frames(caplog):
    params = read("constraints: {left_joint_2: {goal: 0.5}, joint_3: {goal: 0.4}}\njoints: [left_joint_1]",
                  frame_prefix="left_")
    assert params.goal[1:3] == (0.5, 0.4)
    assert "the arm's joints are left_joint_1, left_joint_2" in caplog.text


@pytest.mark.parametrize("text, what", [
    ("constraints: {goal_time: -1}", "jaka_zu7_controller/constraints/goal_time is -1; valid: a number, 0 to 60 s"),
    ("constraints: {joint_2: {trajectory: 1%s}}" % ("0" * 400), "valid: a number, 0 to 10 rad"),
    ("constraints: {joint_2: {trajectory: .nan}}",
     "constraints/joint_2/trajectory is nan; valid: a number, 0 to 10 rad"),
    ("constraints: {joint_2: {goal: wide}}", "constraints/joint_2/goal is 'wide'"),
    ("state_publish_rate: 0", "state_publish_rate is 0; valid: a number, 1 to 125 Hz"),
    ("state_publish_rate: true", "state_publish_rate is True"),
    ("allow_partial_joints_goal: 1", "allow_partial_joints_goal is 1; valid: true or false")])
def test_a_value_that_makes_no_sense_is_refused_by_name(text, what):
    with pytest.raises(WrongParameter) as refused:
        read(text)
    assert what in str(refused.value)


def test_an_unknown_name_is_told(caplog):
    read("constraints: {joint_7: {goal: 0.1}}\nspeed: 3")
    assert "parameter jaka_zu7_controller/speed is not known" in caplog.text
    assert "constraints/joint_7/goal is not known" in caplog.text
