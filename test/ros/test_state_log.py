"""The log of one driver's whole interface: what record --state-log takes, and what is made again of it."""
import contextlib
import signal
import subprocess
import threading

import numpy as np
import pytest
import rosgraph
import rospy
from action_bench import PathClient, joint
from command_places import command_of
from driver_bench import HOME
from import_graph import ROOT
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import eventually

from jaka_bag.compare.runs.loading import load_run
from jaka_bag.compare.tolerances import load_tolerances
from jaka_bag.driver_interface import INPUT_TOPICS
from jaka_bag.live.names import NodeNames
from jaka_bag.live.topic_selection import state_log_topics
from jaka_regression.driver_inputs import SentMessage, input_topics, inputs_of
from jaka_regression.log_beginning import with_beginning
from jaka_regression.replay import replay
from jaka_regression.scenario import scenario_of
from jaka_regression.trajectory_client import TrajectoryClient
from jaka_regression.uncaused_motions import uncaused_motions

BUSY_HOST = ROOT / "test" / "data" / "busy_host.yaml"
WAIT = 200
DRIVER = "/jaka_driver"
CONTROLLER = "/cell_controller"
AWAY = [0.25, *HOME[1:]]
_REST_S = 1.5
"""Time, s, between two motions of a log: beside load the first one ends as much later when it is made again."""


@pytest.fixture(scope="module")
def arm(ros_node, simulator, driven_by):
    """Run a driver with names of its own: a trajectory controller's, and those of ROS-Industrial."""
    rospy.set_param(DRIVER + "/trajectory_controller", CONTROLLER.lstrip("/"))
    try:
        with driven_by(simulator, "industrial_names:=true") as running:
            running.wait_until_ready()
            yield running
    finally:
        rospy.delete_param(DRIVER + "/trajectory_controller")


@contextlib.contextmanager
def recorded(path, *options):
    with subprocess.Popen([*command_of("jaka_bag"), "record", "--state-log", "-O", str(path), *options],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as recorder:
        try:
            assert any("recording to" in line for line in recorder.stdout)
            yield recorder
        finally:
            recorder.send_signal(signal.SIGINT)
            recorder.communicate(timeout=WAIT)


def graph():
    """Return the topics that the driver publishes, and those that it listens to."""
    publishers, subscribers, _ = rosgraph.Master("/tests").getSystemState()
    return [{topic for topic, nodes in side if DRIVER in nodes} for side in (publishers, subscribers)]


def listened_to(name):
    _, subscribers, _ = rosgraph.Master("/tests").getSystemState()
    return {topic for topic, nodes in subscribers if any(node.startswith(name) for node in nodes)}


def test_the_recorder_listens_to_every_topic_of_the_running_driver(arm, tmp_path):
    published, taken = graph()
    assert CONTROLLER + "/state" in published and "/joint_path_command" in taken, "the names of this driver's own"
    with recorded(tmp_path / "log.mcap"):
        wanted = (published | taken) - {"/rosout"}
        assert eventually(lambda: wanted <= listened_to("/jaka_bag_record")), wanted - listened_to("/jaka_bag_record")
        assert "/rosout" not in listened_to("/jaka_bag_record")


def test_the_list_of_inputs_has_every_topic_that_the_running_driver_listens_to(arm):
    _, taken = graph()
    missing = {topic for topic in taken if not topic.endswith(tuple("/" + name for name in INPUT_TOPICS))}
    assert missing == set()
    types = dict(rosgraph.Master("/tests").getTopicTypes())
    known = {topic: kind for topic in taken for name, kind in INPUT_TOPICS.items() if topic.endswith("/" + name)}
    assert {topic: types[topic] for topic in taken if types.get(topic, "*") != "*"} == {
        topic: kind for topic, kind in known.items() if types.get(topic, "*") != "*"}


def test_the_fixed_names_of_a_state_log_are_those_of_the_running_driver(arm):
    """Check the list from which a recorder begins: what it lacks is only found later, and loses its first messages."""
    published, taken = graph()
    own = {topic for topic in published | taken if topic.startswith(DRIVER + "/")}
    of_actions = {topic for topic in own if topic.endswith(("/feedback", "/result", "/status"))}
    listed = set(state_log_topics(NodeNames("/jaka_bag_record")))
    assert own - of_actions <= listed
    assert {topic for topic in taken if topic in listed} >= {DRIVER + "/" + name for name in (
        "jog_joints", "jog_twist", "servo_j_command", "servo_p_command", "move_path/goal", "recover/cancel")}


def stand_at(arm, joints):
    assert arm.call("joint_move", pose=joints, mvvelo=1.5, mvacc=6.0).ret == 1


def joints_of(arm):
    return list(arm.listen("joint_position", 1)[0].position)


def to_targets(arm):
    """Move the arm by a path, a goal, a trajectory of the topic, a jog and servo targets."""
    paths = PathClient(DRIVER + "/move_path")
    assert eventually(lambda: paths._client.pub_goal.get_num_connections() >= 2), "driver, recorder"
    assert paths.run([joint([0.1, *HOME[1:]], 0.5, 2.0), joint(HOME, 0.5, 2.0)])[0] == "SUCCEEDED"
    paths.close()
    rospy.sleep(_REST_S)
    names = ["joint_%d" % number for number in range(1, 7)]
    client = TrajectoryClient(CONTROLLER + "/follow_joint_trajectory", 10.0)
    goals = client._client.action_client.pub_goal
    assert eventually(lambda: goals.get_num_connections() >= 2), "driver, recorder"
    there, none = np.array([AWAY]), np.zeros((1, 6))
    assert client.follow(names, np.array([1.5]), there, none, none, threading.Event()).succeeded
    client.close()
    command = rospy.Publisher(CONTROLLER + "/command", JointTrajectory, queue_size=1)
    jog = rospy.Publisher(DRIVER + "/jog_joints", JointState, queue_size=10)
    servo = rospy.Publisher(DRIVER + "/servo_j_command", JointState, queue_size=10)
    assert eventually(lambda: all(one.get_num_connections() >= 2 for one in (command, jog, servo))), "driver, recorder"
    message = JointTrajectory(joint_names=names, points=[JointTrajectoryPoint(
        positions=[0.4, *HOME[1:]], velocities=[0.0] * 6, time_from_start=rospy.Duration(1))])
    command.publish(message)
    assert eventually(lambda: abs(joints_of(arm)[0] - 0.4) < 1e-3) and eventually(lambda: not arm.simulator.is_moving())
    rospy.sleep(_REST_S)
    for _ in range(25):
        stamped = JointState(name=names[:1], velocity=[0.2])
        stamped.header.stamp = rospy.Time.now()
        jog.publish(stamped)
        rospy.sleep(0.02)  # the rate of a stream
    assert eventually(lambda: not arm.simulator.is_moving() and not arm.simulator.state()["is_servo_active"])
    rospy.sleep(_REST_S)
    here = joints_of(arm)
    assert arm.call("servo_move_enable", enable=True).ret == 1
    for step in range(1, 51):
        stamped = JointState(name=names, position=[here[0] - 0.002 * step, *here[1:]])
        stamped.header.stamp = rospy.Time.now()
        servo.publish(stamped)
        rospy.sleep(0.016)  # the rate of a stream
    assert arm.call("servo_move_enable", enable=False).ret == 1
    for one in (command, jog, servo):
        one.unregister()
    return joints_of(arm)


@pytest.fixture(scope="module")
def moved(arm, tmp_path_factory):
    """Return a log of an arm that everything but a call moved, and where it stood at its end."""
    path = tmp_path_factory.mktemp("moved") / "moved.mcap"
    stand_at(arm, HOME)
    with recorded(path):
        assert eventually(lambda: CONTROLLER + "/command" in listened_to("/jaka_bag_record"))
        rospy.sleep(1.0)  # diagnostics come once a second
        end = to_targets(arm)
        rospy.sleep(1.0)  # the end is recorded, too: of nothing that comes then is known that it does
    return path, end


def test_goals_trajectories_jog_and_servo_targets_are_in_the_log_and_are_what_moved_the_arm(moved):
    run = load_run(moved[0])
    found = [one for one in inputs_of(moved[0], run) if isinstance(one, SentMessage)]
    counts = {topic: sum(one.connection.topic == topic for one in found) for topic in input_topics(run)}
    assert counts[CONTROLLER + "/follow_joint_trajectory/goal"] == 1 and counts[CONTROLLER + "/command"] == 1
    assert counts[DRIVER + "/move_path/goal"] == 1
    assert counts[DRIVER + "/jog_joints"] == 25 and counts[DRIVER + "/servo_j_command"] == 50
    goals = [one for one in found if one.goal_id]
    assert len(goals) == 2 and all(goal.success and 0.3 < goal.duration < 10.0 for goal in goals)
    assert uncaused_motions(run, inputs_of(moved[0], run), {}) == []
    assert len(uncaused_motions(run, run.calls, {})) >= 3, "calls alone do not explain them"


def test_they_are_made_again_and_the_arm_ends_where_it_did(arm, moved):
    path, end = moved
    stand_at(arm, HOME)
    done = subprocess.run([*command_of("jaka_bag"), "replay-commands", str(path)], capture_output=True, text=True,
                          timeout=WAIT)
    assert done.returncode == 0, done.stderr
    assert "2 calls made, 78 messages sent" in done.stdout
    assert joints_of(arm) == pytest.approx(end, abs=5e-3)


def test_what_goes_by_its_own_time_is_not_slowed_down(moved):
    done = subprocess.run([*command_of("jaka_bag"), "replay-commands", str(moved[0]), "--speed-limit", "50"],
                          capture_output=True, text=True, timeout=WAIT)
    assert done.returncode == 2 and "jog_joints" in done.stderr and "go by their own time" in done.stderr


def test_a_goal_that_is_refused_now_ends_the_replay_with_a_stop(arm, moved):
    stand_at(arm, HOME)
    assert arm.call("enable", data=False).success
    try:
        done = subprocess.run([*command_of("jaka_bag"), "replay-commands", str(moved[0])], capture_output=True,
                              text=True, timeout=WAIT)
        assert done.returncode == 1
        assert "move_path/goal" in done.stderr and "was refused, unlike in the log" in done.stderr
    finally:
        assert arm.call("enable", data=True).success


def test_a_log_of_goals_and_targets_happens_again(moved, tmp_path):
    """Check the whole replay: a master, a simulated controller and a driver of its own."""
    found = replay(moved[0], tmp_path, load_tolerances(BUSY_HOST))
    assert found.same, found.summary


@pytest.fixture
def fitted(arm):
    """Fit an arm with a gripper: tool, load, user frame, half the speed, an output that is on; take them back."""
    stand_at(arm, AWAY)
    assert arm.call("set_toolframe", pose=[0.0, 5.0, 120.0, 0.1, 0.2, 0.3], tool_num=2).ret == 1
    assert arm.call("set_userframe", pose=[300.0, 100.0, 50.0, 0.0, 0.0, 0.5], user_num=3).ret == 1
    assert arm.call("set_payload", tool_num=2, mass=1.25, xc=0.0, yc=-10.0, zc=50.0).ret == 1
    assert arm.call("set_collisionlevel", is_enable=True, value=80).ret == 1
    assert arm.call("set_speed_slider", speed_slider_fraction=0.5).success
    assert arm.call("set_io", signal="digital", type=0, index=4, value=1.0).ret == 1
    yield arm
    arm.call("set_io", signal="digital", type=0, index=4, value=0.0)
    arm.call("set_speed_slider", speed_slider_fraction=1.0)
    assert arm.call("set_payload", tool_num=2, mass=0.0, xc=0.0, yc=0.0, zc=0.0).ret == 1
    assert arm.call("set_collisionlevel", is_enable=True, value=60).ret == 1
    for service, number in (("set_toolframe", {"tool_num": 2}), ("set_userframe", {"user_num": 3})):
        assert arm.call(service, pose=[0.0] * 6, **number).ret == 1


def test_a_log_of_a_fitted_arm_happens_again(fitted, tmp_path):
    """Check that the start is restored: joints, frames, speed and terminals are those of the log."""
    log = tmp_path / "fitted.mcap"
    with recorded(log):
        rospy.sleep(2.5)  # diagnostics come once a second
        assert fitted.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=3.0).ret == 1
        assert fitted.call("get_io", signal="digital", path=1, type=0, index=4).value == 1.0
        rospy.sleep(1.0)  # the end is recorded, too
    run = load_run(log)
    state = dict(with_beginning(scenario_of(log), run).arms[0].state)
    assert state["joints"] == pytest.approx(AWAY, abs=1e-3) and state["speed_override"] == 0.5
    assert state["tool"]["id"] == 2 and state["tool"]["offset"][:3] == pytest.approx([0.0, 0.005, 0.12])
    assert state["user_frame"]["id"] == 3 and state["user_frame"]["offset"][5] == pytest.approx(0.5)
    assert state["payload"] == {"mass": 1.25, "centroid": [0.0, -0.01, 0.05]} and state["collision_level"] == 4
    assert state["terminals"]["cabinet"]["digital_outputs"] == {4: 1.0}
    found = replay(log, tmp_path / "again", load_tolerances(BUSY_HOST))
    assert found.same, found.summary
