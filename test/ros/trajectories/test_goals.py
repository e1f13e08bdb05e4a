"""FollowJointTrajectory as a client sees it: on the running node, with requests read in the controller's log."""
import contextlib
import math
import threading
import time

import pytest
import rospy
from action_bench import CONTROLLER, NAMES, START, Client, goal_of, joints_of, point, smooth, trajectory
from driver_bench import SimulatorProcess
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory
from waiting import eventually
from wire_verdict import WireVerdict

from jaka_regression.host_watch import HostWatch
from jaka_ros_driver.ros.other_messages import message_type, stop_motion_type

INVALID_GOAL, INVALID_JOINTS, OLD, PATH, GOAL = -1, -2, -3, -4, -5
REST = [0.0] * 6
LIMIT = 4.0 * math.pi


@pytest.fixture(scope="module")
def cell(ros_node, driven_by, log_file):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", str(log_file))) as simulator:
        with driven_by(simulator, "industrial_names:=true") as arm:
            arm.wait_until_ready()
            yield arm


@pytest.fixture
def arm(cell):
    """Return the arm at the start, at rest, all well, at full speed."""
    cell.simulator.make_well()
    assert eventually(lambda: cell.call("recover").success)
    assert cell.call("set_speed_slider", speed_slider_fraction=1.0).success
    answer = cell.call("joint_move", pose=START, mvvelo=3.0, mvacc=12.0)
    assert answer.ret == 1, answer.message
    return cell


@pytest.fixture
def client(arm):
    with contextlib.closing(Client()) as one:
        yield one


def now():
    return time.monotonic()


def frames(log_file, since):
    """Return (time, joints in rad) of the servo frames since then."""
    return [(at, joints_of(request)) for at, request in WireVerdict(log_file).received()
            if request["cmdName"] == "servo_j" and at >= since]


def all_frames(log_file, since):
    """Return the same once servo mode has been left; the log is written a little later than things happen."""
    assert eventually(lambda: WireVerdict(log_file).times_of("servo_move", since, relFlag=0))
    return frames(log_file, since)


def moving(path):
    """Return the frames from the last one at the start to the first one at the end."""
    first = next(i for i, (_, joints) in enumerate(path) if joints != path[0][1])
    last = max(i for i, (_, joints) in enumerate(path) if joints != path[-1][1])
    return path[first - 1:last + 2]


def largest_acceleration(path):
    joints = [j for _, j in path]
    return max(abs(c - 2.0 * b + a) for p, q, r in zip(joints, joints[1:], joints[2:])
               for a, b, c in zip(p, q, r)) / 0.008 ** 2


def other(values, joint, value):
    return [value if n == joint else v for n, v in enumerate(values)]


def _far(seconds, way=0.3, velocities=REST, **more):
    return point(seconds, [q + way for q in START], velocities, **more)


MALFORMED = {
    "a name twice": (lambda: goal_of([_far(1.0)], NAMES[:5] + NAMES[:1]), INVALID_JOINTS),
    "a foreign name": (lambda: goal_of([_far(1.0)], NAMES[:5] + ["wrist"]), INVALID_JOINTS),
    "a name is missing": (lambda: goal_of([point(1.0, START[:5])], NAMES[:5]), INVALID_JOINTS),
    "no names": (lambda: goal_of([_far(1.0)], []), INVALID_JOINTS),
    "seven names": (lambda: goal_of([_far(1.0)], NAMES + ["rail"]), INVALID_JOINTS),
    "no positions": (lambda: goal_of([point(1.0, [], REST)]), INVALID_GOAL),
    "five positions": (lambda: goal_of([point(1.0, START[:5])]), INVALID_GOAL),
    "seven positions": (lambda: goal_of([point(1.0, START + [0.0])]), INVALID_GOAL),
    "five velocities": (lambda: goal_of([point(1.0, START, REST[:5])]), INVALID_GOAL),
    "five accelerations": (lambda: goal_of([point(1.0, START, REST, REST[:5])]), INVALID_GOAL),
    "accelerations without velocities": (lambda: goal_of([point(1.0, START, (), REST)]), INVALID_GOAL),
    "a position is NaN": (lambda: goal_of([point(1.0, other(START, 2, math.nan), REST)]), INVALID_GOAL),
    "a position is infinite": (lambda: goal_of([point(1.0, other(START, 2, math.inf))]), INVALID_GOAL),
    "a velocity is NaN": (lambda: goal_of([_far(1.0, velocities=other(REST, 0, math.nan)), _far(2.0)]), INVALID_GOAL),
    "an acceleration is infinite": (
        lambda: goal_of([point(1.0, START, REST, other(REST, 5, -math.inf)), _far(2.0)]), INVALID_GOAL),
    "a position of 1e38": (lambda: goal_of([point(1.0, other(START, 0, 1e38), REST)]), INVALID_GOAL),
    "a position of 1e308": (lambda: goal_of([point(1.0, other(START, 0, 1e308))]), INVALID_GOAL),
    "a velocity of 1e308": (lambda: goal_of([_far(1.0, velocities=[1e308] * 6), _far(2.0)]), INVALID_GOAL),
    "beyond a joint limit": (lambda: goal_of([point(5.0, other(START, 0, 6.5), REST)]), INVALID_GOAL),
    "beyond a limit between two points": (
        lambda: goal_of([point(0.0, START, REST), point(2.0, other(START, 4, 2.0), other(REST, 4, 0.0)),
                         point(2.4, other(START, 0, 0.9), other(REST, 0, 3.0)),
                         point(9.0, START, other(REST, 0, 3.0)), point(12.0, START, REST)]), INVALID_GOAL),
    "too fast": (lambda: goal_of([_far(0.5, way=1.5)]), INVALID_GOAL),
    "too much acceleration": (lambda: goal_of([_far(0.2, way=0.3)]), INVALID_GOAL),
    "a speed that jumps": (lambda: goal_of([point(0.0, START, REST), _far(1.0, velocities=()), _far(2.0)]),
                           INVALID_GOAL),
    "straight and far too fast": (lambda: goal_of([point(0.1, [q + 1.0 for q in START])]), INVALID_GOAL),
    "times that stand still": (lambda: goal_of([_far(1.0), _far(1.0, way=0.2)]), INVALID_GOAL),
    "times that fall": (lambda: goal_of([_far(2.0), _far(1.0, way=0.2)]), INVALID_GOAL),
    "only a negative time": (lambda: goal_of([point(-1.0, START, REST)]), INVALID_GOAL),
    "no points and no names": (lambda: goal_of([], []), INVALID_JOINTS),
    "longer than a day": (lambda: goal_of([_far(1e6)]), INVALID_GOAL),
    "it begins elsewhere": (lambda: goal_of([_far(0.0, way=0.05), _far(1.0)]), INVALID_GOAL),
    "its last point moves": (lambda: goal_of([_far(1.0, velocities=[0.5] * 6)]), INVALID_GOAL),
    "all of it is past": (lambda: goal_of([_far(1.0)], stamp=rospy.Time.now() - rospy.Duration(10.0)), OLD),
    "it starts in an hour": (lambda: goal_of([_far(1.0)], stamp=rospy.Time.now() + rospy.Duration(3600.0)),
                             INVALID_GOAL),
    "a tolerance of a foreign joint": (lambda: goal_of([_far(1.0)], path=[("rail", 0.1)]), INVALID_JOINTS),
    "a tolerance is NaN": (lambda: goal_of([_far(1.0)], end=[("joint_1", math.nan)]), INVALID_GOAL),
}


def test_malformed_goals_are_rejected_with_their_code_and_nothing_is_sent(arm, client, log_file):
    since = now()
    for name, (make, code) in MALFORMED.items():
        state, result = client.run(make())
        assert (state, result.error_code) == ("REJECTED", code), (name, result.error_string)
        assert result.error_string, name
    assert frames(log_file, since) == [] and WireVerdict(log_file).times_of("servo_move", since) == []


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.02, 0.01, 0.008, 0.004])
def test_a_plan_takes_its_time_whatever_the_spacing_of_its_points(arm, client, log_file, spacing):
    since, plan = now(), smooth(0.8, 2.0, spacing, has_accelerations=spacing != 0.02)
    with HostWatch() as host:
        state, result = client.run(goal_of(plan))
    assert (state, result.error_code) == ("SUCCEEDED", 0), result.error_string
    path = moving(all_frames(log_file, since))
    # a busy host skips cycles, and makes up for 0.1 s at most; test_clock and the stories have the exact figures
    stood_still = sum(pause.lasted_s for pause in host.pauses)
    assert 150 <= len(path) - 1 <= 252 and 1.85 < path[-1][0] - path[0][0] < 2.8 + stood_still
    assert path[-1][1] == pytest.approx(plan[-1].positions, abs=1e-6)
    assert largest_acceleration(path) < LIMIT
    assert len(client.ends) == 1


def test_joints_come_in_any_order(arm, client):
    order = [3, 0, 5, 1, 4, 2]
    target = [q + 0.05 * (n + 1) for n, q in enumerate(START)]
    state, result = client.run(goal_of([point(1.5, [target[n] for n in order], REST)], [NAMES[n] for n in order]))
    assert state == "SUCCEEDED", result.error_string
    reached = [math.radians(q) for q in arm.simulator.state()["joint_position"]]
    assert reached == pytest.approx(target, abs=1e-4)


def test_a_cancelled_goal_comes_to_rest_smoothly_and_is_preempted(arm, client, log_file):
    since = now()
    handle = client.send(goal_of(smooth(1.6, 2.0, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.9)
    client.cancel(handle)
    cancelled = now()
    state, result = client.end(handle)
    assert state == "PREEMPTED" and "cancelled" in result.error_string
    path = all_frames(log_file, since)
    assert largest_acceleration(path) < LIMIT * 1.05
    assert moving(path)[-1][0] - cancelled < 1.0, "the stream did not come to rest"
    assert WireVerdict(log_file).times_of("stop_program", since) == []
    assert len(client.ends) == 1


def test_feedback_tells_desired_actual_and_error(arm, client):
    assert client.run(goal_of(smooth(0.8, 1.5, 0.05)))[0] == "SUCCEEDED"
    told = [f for f in client.feedback if 0.2 < f.desired.time_from_start.to_sec() < 1.3]
    assert len(told) >= 5
    for one in told:
        assert one.joint_names == NAMES and len(one.actual.positions) == 6
        for desired, actual, error in zip(one.desired.positions, one.actual.positions, one.error.positions):
            assert error == pytest.approx(desired - actual, abs=1e-9) and abs(error) < 0.3


def test_a_new_goal_replaces_the_one_under_way_and_the_arm_never_stops_for_it(arm, client, log_file):
    since = now()
    first = client.send(goal_of(smooth(1.2, 2.0, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    second = client.send(goal_of([point(1.5, [q + 0.2 for q in START], REST)]))
    state, result = client.end(first)
    assert state == "PREEMPTED" and "replaced" in result.error_string
    assert client.end(second)[0] == "SUCCEEDED"
    assert largest_acceleration(all_frames(log_file, since)) < LIMIT * 1.05
    assert len(WireVerdict(log_file).times_of("servo_move", since)) == 2
    assert len(client.ends) == 2


def rests_at(arm, way):
    return eventually(lambda: not arm.simulator.state()["is_servo_active"]) and [
        math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(
            [q + way for q in START], abs=1e-4)


def test_topic_and_action_replace_each_other(arm, client, command):
    goal = client.send(goal_of(smooth(1.2, 2.0, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    command.publish(trajectory([point(1.0, [q + 0.3 for q in START], REST)]))
    assert client.end(goal)[0] == "PREEMPTED" and rests_at(arm, 0.3)
    command.publish(trajectory([point(2.0, START, REST)]))
    assert eventually(arm.simulator.is_moving)
    assert client.run(goal_of([point(1.5, [q + 0.1 for q in START], REST)]))[0] == "SUCCEEDED" and rests_at(arm, 0.1)


def test_a_message_replaces_one_that_runs_and_an_old_one_does_not(arm, command, log_file):
    since = now()
    command.publish(trajectory(smooth(0.8, 2.0, 0.05)))
    assert eventually(arm.simulator.is_moving)
    command.publish(trajectory([_far(0.5, way=-0.3)], stamp=rospy.Time.now() - rospy.Duration(3.0)))
    time.sleep(0.5)  # what must not come has no other sign
    command.publish(trajectory([point(1.5, [q + 0.2 for q in START], REST)]))
    assert rests_at(arm, 0.2)
    assert min(joints[0] for _, joints in all_frames(log_file, since)) > START[0] - 1e-6


def test_an_empty_message_preempts_a_goal(arm, client, command, log_file):
    since = now()
    goal = client.send(goal_of(smooth(1.2, 2.0, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    command.publish(trajectory([]))
    assert client.end(goal)[0] == "PREEMPTED" and not arm.simulator.is_moving()
    way = [joints[0] for _, joints in all_frames(log_file, since)]
    assert way == sorted(way) and way[0] < way[-1] < START[0] + 1.2, "it brakes on its way, and does not go back"


def test_an_old_goal_is_rejected_and_the_running_one_goes_on(arm, client):
    running = client.send(goal_of(smooth(0.8, 2.0, 0.05)))
    assert eventually(lambda: client.feedback)
    state, result = client.run(goal_of([_far(1.0)], stamp=rospy.Time.now() - rospy.Duration.from_sec(1.0)))
    assert (state, result.error_code) == ("REJECTED", OLD)
    assert client.end(running)[0] == "SUCCEEDED"


def test_an_empty_goal_ends_what_is_under_way_and_succeeds_at_rest(arm, client, command):
    first = client.send(goal_of(smooth(1.2, 2.0, 0.05)))
    assert eventually(lambda: client.feedback)
    assert client.run(goal_of([]))[0] == "SUCCEEDED"
    assert client.end(first)[0] == "PREEMPTED" and not arm.simulator.is_moving()
    command.publish(trajectory([point(5.0, [q + 1.2 for q in START], REST)]))
    assert eventually(arm.simulator.is_moving) and client.run(goal_of([]))[0] == "SUCCEEDED"
    assert not arm.simulator.is_moving() and arm.simulator.state()["joint_position"][0] < math.degrees(START[0] + 1.1)


def test_a_goal_starts_at_its_stamp(arm, client, log_file):
    for _ in range(3):  # a host that stands still for more than a second has the arm stopped
        since, start = now(), rospy.Time.now() + rospy.Duration(1.0)
        state, result = client.run(goal_of(smooth(0.4, 1.0, 0.05), stamp=start))
        if "held up" not in result.error_string:
            break
        assert arm.call("joint_move", pose=START, mvvelo=3.0, mvacc=12.0).ret == 1
    assert state == "SUCCEEDED", result.error_string
    assert 0.7 < moving(all_frames(log_file, since))[0][0] - since < 2.5


@pytest.mark.parametrize("trouble, words", [("stop", "stopped by request"), ("emergency stop", "emergency stop"),
                                            ("collision", "protective stop"), ("lost link", "link to the controller")])
def test_whatever_stops_the_arm_aborts_the_goal_and_nothing_resumes(arm, client, log_file, trouble, words):
    handle = client.send(goal_of(smooth(1.6, 2.5, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    if trouble == "stop":
        arm.call("stop_move")
    elif trouble == "emergency stop":
        arm.simulator.operate("press_emergency_stop")
    elif trouble == "collision":
        arm.simulator.operate("hit", force=400.0)
    else:
        arm.simulator.operate("reset", port="command")
    state, result = client.end(handle)
    assert state == "ABORTED" and result.error_code == PATH and words in result.error_string
    assert eventually(lambda: not arm.simulator.is_moving())
    since = now()
    arm.simulator.operate("release_emergency_stop")
    time.sleep(1.0)  # what must not come has no other sign
    assert frames(log_file, since) == []


def test_a_goal_is_rejected_while_the_arm_cannot_move_or_somebody_else_moves_it(arm, client):
    assert arm.call("servo_move_enable", enable=True).ret == 1
    state, result = client.run(goal_of([_far(1.0)]))
    assert (state, result.error_code) == ("REJECTED", INVALID_GOAL) and "servo mode owns" in result.error_string
    assert arm.call("servo_move_enable", enable=False).ret == 1
    assert arm.call("enable", data=False).success
    state, result = client.run(goal_of([_far(1.0)]))
    assert (state, result.error_code) == ("REJECTED", INVALID_GOAL) and "not enabled" in result.error_string
    assert arm.call("enable", data=True).success


def test_tolerances_of_the_goal_hold(arm, client):
    handle = client.send(goal_of(smooth(1.6, 2.0, 0.05), path=[("joint_1", 0.02)]))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    arm.simulator.freeze_feed()
    state, result = client.end(handle)
    assert (state, result.error_code) == ("ABORTED", PATH) and "joint 1 is" in result.error_string
    arm.simulator.operate("clear_faults")
    assert eventually(lambda: not arm.simulator.is_moving())
    start = [math.radians(q) for q in arm.simulator.state()["joint_position"]]
    arm.simulator.freeze_feed()
    arm.listen("joint_position", 2)
    # by less than the driver needs to notice that the feed does not show where the controller reports the arm
    state, result = client.run(goal_of([point(1.0, other(start, 0, start[0] + 0.004), REST)], end=[("joint_1", 0.002)],
                                       seconds=0.2))
    arm.simulator.operate("clear_faults")
    assert (state, result.error_code) == ("ABORTED", GOAL) and "joint 1" in result.error_string


# ---- what clocks and other planners make of a goal ----

@pytest.mark.parametrize("late", [0.1, 0.15, 0.8])
def test_a_plan_whose_stamp_is_late_is_followed_as_a_whole(arm, client, log_file, late):
    since = now()
    stamp = rospy.Time.now() - rospy.Duration.from_sec(late)
    state, result = client.run(goal_of(smooth(0.8, 2.0, 0.05), stamp=stamp))
    assert (state, result.error_code) == ("SUCCEEDED", 0), result.error_string
    path = moving(all_frames(log_file, since))
    assert path[0][1] == pytest.approx(START, abs=1e-6)
    for _, joints in path:  # on the straight line in joint space that the plan is
        way = joints[0] - START[0]
        assert joints[1:] == pytest.approx([q + way / (n + 2) for n, q in enumerate(START[1:])], abs=2e-6)


def test_a_stamp_that_is_too_old_is_named_as_the_cause(arm, client):
    stamp = rospy.Time.now() - rospy.Duration.from_sec(1.6)
    state, result = client.run(goal_of(smooth(0.8, 2.0, 0.05), stamp=stamp))
    assert (state, result.error_code) == ("REJECTED", OLD) and "header.stamp" in result.error_string


def test_a_plan_that_needs_a_little_more_than_there_is_takes_a_little_longer(arm, client, log_file):
    since, plan = now(), smooth(0.9, 0.62, 0.02)  # 13.5 rad/s2 for joint 1
    state, result = client.run(goal_of(plan))
    assert (state, result.error_code) == ("SUCCEEDED", 0), result.error_string
    path = moving(all_frames(log_file, since))
    assert largest_acceleration(path) < LIMIT * 1.05
    assert path[-1][1] == pytest.approx(plan[-1].positions, abs=1e-6)


@pytest.mark.parametrize("first", ["cancel", "goal"])
def test_a_goal_and_a_cancel_in_one_instant_are_both_served(arm, client, first):
    one = client.send(goal_of(smooth(1.2, 2.0, 0.05)))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 0.8)
    if first == "cancel":
        client.cancel(one)
    other_goal = client.send(goal_of([point(1.5, [q + 0.2 for q in START], REST)]))
    if first == "goal":
        client.cancel(one)
    assert client.end(one)[0] == "PREEMPTED"
    state, result = client.end(other_goal)
    assert state == "SUCCEEDED", result.error_string
    assert [math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(
        [q + 0.2 for q in START], abs=1e-4)


def test_points_of_negative_time_are_past(arm, client):
    running = client.send(goal_of(smooth(0.8, 2.0, 0.05)))
    assert eventually(lambda: client.feedback)
    state, result = client.run(goal_of([point(-0.1, [q + 1.0 for q in START], REST), _far(1.5, way=0.1)]))
    assert state == "SUCCEEDED" and client.end(running)[0] == "PREEMPTED", result.error_string
    assert rests_at(arm, 0.1)


# ---- speed ----

def test_speed_changes_and_pauses_leave_path_and_limits_as_they_are(arm, client, log_file):
    speeds = []
    subscriber = rospy.Subscriber(arm.name + "/speed_scaling_factor", Float64, lambda m: speeds.append(m.data))
    since, plan = now(), smooth(1.6, 4.0, 0.05)
    handle = client.send(goal_of(plan))
    assert eventually(lambda: client.feedback and client.feedback[-1].desired.time_from_start.to_sec() > 1.0)
    assert arm.call("set_speed_slider", speed_slider_fraction=0.3).success
    time.sleep(1.0)  # a part of the way at this speed
    answer = arm.call("pause")
    assert answer.success, answer.message
    held = [math.radians(q) for q in arm.simulator.state()["joint_position"]]
    time.sleep(0.5)  # what must not come has no other sign
    assert held == pytest.approx([math.radians(q) for q in arm.simulator.state()["joint_position"]], abs=1e-6)
    assert arm.call("set_speed_slider", speed_slider_fraction=1.0).success
    assert arm.call("resume").success
    assert client.end(handle)[0] == "SUCCEEDED"
    subscriber.unregister()
    path = all_frames(log_file, since)
    assert largest_acceleration(path) < LIMIT * 1.05
    for _, joints in path:  # on the straight line in joint space that the plan is
        way = joints[0] - START[0]
        assert joints[1:] == pytest.approx([q + way / (n + 2) for n, q in enumerate(START[1:])], abs=2e-6)
    assert 0.3 in speeds and speeds[-1] == 1.0


def test_a_planned_move_is_paused_and_resumed(arm):
    answers = []

    def move():
        answers.append(arm.call("joint_move", pose=[q + 0.8 for q in START], mvvelo=0.5, mvacc=2.0))
    mover = threading.Thread(target=move)
    mover.start()
    assert eventually(arm.simulator.is_moving)
    answer = arm.call("pause")
    assert answer.success, answer.message
    place = arm.simulator.state()["joint_position"]
    time.sleep(0.5)  # what must not come has no other sign
    assert arm.simulator.state()["joint_position"] == place and not answers
    assert arm.call("resume").success
    mover.join(60.0)
    assert answers[0].ret == 1, answers[0].message


# ---- topics and other names ----

def test_the_command_topic_moves_the_arm_and_an_empty_one_stops_it(arm, log_file):
    publisher = rospy.Publisher(CONTROLLER + "/command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    target = [q + 0.2 for q in START]
    publisher.publish(trajectory([point(1.0, target)]))
    assert eventually(lambda: [math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(
        target, abs=1e-4))
    assert eventually(lambda: not arm.simulator.state()["is_servo_active"])
    publisher.publish(trajectory([point(2.0, START, REST)]))
    assert eventually(arm.simulator.is_moving)
    publisher.publish(trajectory([]))
    assert eventually(lambda: not arm.simulator.is_moving() and not arm.simulator.state()["is_servo_active"])
    assert [math.radians(q) for q in arm.simulator.state()["joint_position"]] != pytest.approx(START, abs=1e-3)


def stream(publisher, rate, periods, seconds, place, until=lambda: False):
    """Publish single points as MoveIt Servo does, stamped 0, each so many periods ahead; return the last positions."""
    begun, sent = now(), 0
    positions = START
    while now() - begun < seconds and not until():
        ahead = periods / rate
        positions = [q + place(sent / rate + ahead) for q in START]
        publisher.publish(trajectory([point(ahead, positions)]))
        sent += 1
        time.sleep(max(0.0, begun + sent / rate - now()))  # the rate of a stream
    return positions


def sway(seconds):
    return 0.15 * (1.0 - math.cos(2.0 * seconds))


@pytest.fixture
def command(arm):
    publisher = rospy.Publisher(CONTROLLER + "/command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    yield publisher
    publisher.unregister()


@pytest.mark.parametrize("rate, periods", [(30, 1.02), (10, 3), (125, 1)])
def test_points_as_moveit_servo_publishes_them_are_followed_and_the_last_one_is_held(
        arm, command, log_file, rate, periods):
    since = now()
    last = stream(command, rate, periods, 3.0, sway)
    assert eventually(lambda: not arm.simulator.state()["is_servo_active"])
    assert [math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(last, abs=1e-4)
    path = all_frames(log_file, since)
    assert max(joints[0] - START[0] for _, joints in path) > 0.2  # it swung, and back
    assert largest_acceleration(path) < LIMIT * 1.05


def without_a_pause(attempt):
    """Call until the host has not stood still for so long that a stream counts as paused; return its answer."""
    for _ in range(5):
        with HostWatch() as host:
            answer = attempt()
        if not any(pause.lasted_s > 0.2 for pause in host.pauses):
            return answer
        time.sleep(0.6)  # the next attempt is another stream
    pytest.fail("in each of five attempts the host stood still for more than 0.2 s")


def test_a_stream_that_was_stopped_is_taken_again_only_after_a_pause(arm, command, log_file):
    def frames_after_the_stop():
        stopped = []

        def stop():
            time.sleep(1.0)  # in the middle of the stream
            arm.call("stop_move")
            stopped.append(now())
        stopper = threading.Thread(target=stop)
        stopper.start()
        stream(command, 30, 1.02, 3.0, lambda seconds: 0.3 * sway(seconds))
        stopper.join()
        assert eventually(lambda: not arm.simulator.is_moving())
        return [at for at, _ in frames(log_file, stopped[0]) if at > stopped[0] + 0.3]
    assert without_a_pause(frames_after_the_stop) == []
    time.sleep(0.6)  # the pause that makes it another stream
    place = [math.radians(q) for q in arm.simulator.state()["joint_position"]]
    command.publish(trajectory([point(0.1, [q + 0.01 for q in place])]))
    assert eventually(lambda: [math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(
        [q + 0.01 for q in place], abs=1e-4))
    assert eventually(lambda: not arm.simulator.state()["is_servo_active"])


def test_an_empty_message_ends_a_stream_and_a_goal_replaces_one(arm, command, client, log_file):
    def end_of_a_goal_beside_a_stream():
        streamed = threading.Thread(target=stream, args=(command, 30, 1.02, 3.0, sway))
        streamed.start()
        assert eventually(arm.simulator.is_moving)
        state, result = client.run(goal_of([point(2.0, START, REST)]))
        streamed.join()
        return state, result.error_string
    assert without_a_pause(end_of_a_goal_beside_a_stream)[0] == "SUCCEEDED"
    assert [math.radians(q) for q in arm.simulator.state()["joint_position"]] == pytest.approx(START, abs=1e-4)
    time.sleep(0.6)  # the pause that makes it another stream
    streamed = threading.Thread(target=stream, args=(command, 30, 1.02, 1.5, sway))
    streamed.start()
    assert eventually(arm.simulator.is_moving)
    command.publish(trajectory([]))
    assert eventually(lambda: not arm.simulator.state()["is_servo_active"])
    streamed.join()
    assert not arm.simulator.is_moving()


def test_a_jump_on_the_topic_moves_nothing(arm, command, log_file):
    since = now()
    command.publish(trajectory([point(0.034, [q + 0.5 for q in START])]))
    time.sleep(1.0)  # what must not come has no other sign
    assert len({tuple(joints) for _, joints in frames(log_file, since)}) <= 1


def test_a_stream_of_short_trajectories_is_followed_without_a_halt(arm, log_file):
    # MoveIt Servo sends them so: a point with its velocity a little ahead, replaced before it is reached.
    publisher = rospy.Publisher(CONTROLLER + "/command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    since, begun = now(), now()
    ahead, speed = 0.5, 0.2
    while now() - begun < 1.5:
        seconds = now() - begun
        ramp = min(1.0, seconds / 0.3)
        place = speed * (seconds - 0.15 if seconds > 0.3 else seconds * seconds / 0.6)
        publisher.publish(trajectory([point(ahead, [q + place + speed * ahead for q in START], [speed * ramp] * 6)]))
        time.sleep(0.04)  # the rate of a stream
    assert eventually(lambda: not arm.simulator.state()["is_servo_active"])
    path = all_frames(log_file, since)
    assert path[-1][1][0] - START[0] > 0.2
    assert largest_acceleration(path) < LIMIT * 1.05
    assert len(WireVerdict(log_file).times_of("servo_move", since)) == 2


def test_the_state_topic_tells_what_is_desired_at_50_hz(arm, client):
    states = []
    subscriber = rospy.Subscriber(CONTROLLER + "/state", message_type("control_msgs/JointTrajectoryControllerState"),
                                  states.append)
    assert eventually(lambda: len(states) > 5)
    assert list(states[-1].desired.positions) == pytest.approx(START, abs=1e-4)
    held = states[-1]
    assert held.joint_names == NAMES and not held.actual.accelerations and not held.error.accelerations
    assert {len(values) for one in (held.desired, held.actual, held.error)
            for values in (one.positions, one.velocities, held.desired.accelerations)} == {6}
    del states[:]
    begun = now()
    client.run(goal_of(smooth(0.5, 1.0, 0.05)))
    subscriber.unregister()
    assert 20 <= len(states) <= 50 * (now() - begun) + 5
    assert max(s.desired.velocities[0] for s in states) == pytest.approx(0.5 * 1.875, rel=0.1)
    stamps = [s.header.stamp for s in states]
    assert stamps == sorted(set(stamps))


def test_the_names_of_ros_industrial_serve_as_well(arm):
    with contextlib.closing(Client("/joint_trajectory_action")) as other_name:
        assert other_name.run(goal_of([_far(1.0, way=0.1)]))[0] == "SUCCEEDED"
    states = []
    subscriber = rospy.Subscriber("/feedback_states", message_type("control_msgs/FollowJointTrajectoryFeedback"),
                                  states.append)
    assert eventually(lambda: states)
    subscriber.unregister()
    publisher = rospy.Publisher("/joint_path_command", JointTrajectory, queue_size=1)
    assert eventually(lambda: publisher.get_num_connections())
    publisher.publish(trajectory([point(2.0, START)]))
    assert eventually(arm.simulator.is_moving)
    stop = rospy.ServiceProxy("/stop_motion", stop_motion_type())
    assert stop().code.val == 1
    assert eventually(lambda: not arm.simulator.is_moving())


def test_forty_goals_and_cancels_each_end_once(arm, client):
    handles = []
    for number in range(40):
        way = 0.05 if number % 2 else -0.05
        handles.append(client.send(goal_of([point(0.6, [q + way for q in START], REST)])))
        time.sleep(0.02 * (number % 5))  # goals and cancels meet at ever other moments
        if number % 3 == 0:
            client.cancel(handles[-1])
    ends = [client.end(handle)[0] for handle in handles]
    assert set(ends) <= {"SUCCEEDED", "PREEMPTED", "RECALLED", "REJECTED"}, ends
    time.sleep(0.3)  # what must not come has no other sign
    assert len(client.ends) == 40
