"""The action move_path as a client sees it, on the running node; requests and motion are in the controller's log."""
import contextlib
import math
import time

import pytest
from action_bench import SQUARE, PathClient, arc, bow, joint, line, nearest, square, tool_way
from driver_bench import HOME, SimulatorProcess
from waiting import InBackground, eventually
from wire_verdict import WireVerdict

NAN = math.nan
MOTIONS = ("moveL", "movc", "joint_move")


@pytest.fixture(scope="module")
def cell(ros_node, driven_by, log_file):
    with contextlib.closing(SimulatorProcess("--start", "enabled", "--log", str(log_file))) as simulator:
        with driven_by(simulator) as arm:
            arm.wait_until_ready()
            arm.go_home()
            yield arm


@pytest.fixture
def arm(cell):
    """Return the arm at the last corner of the square, at rest, all well."""
    cell.simulator.operate("release_emergency_stop")
    assert eventually(lambda: cell.call("recover").success)
    answer = cell.call("linear_move", pose=[400.0, 100.0, 370.0, 2.2214, -2.2214, 0.0], mvvelo=500.0, mvacc=4000.0)
    assert answer.ret == 1, answer.message
    return cell


@pytest.fixture
def client(arm):
    with contextlib.closing(PathClient()) as one:
        yield one


def sent(log_file, since):
    """Return (time, request) of the motions since then."""
    return [(at, request) for at, request in WireVerdict(log_file).received()
            if request["cmdName"] in MOTIONS and at >= since]


def all_sent(log_file, since, count):
    """Return the same once so many are in the log, which is written a little later than things happen."""
    assert eventually(lambda: len(sent(log_file, since)) >= count)
    return sent(log_file, since)


MALFORMED = {
    "no segments": (list, "0 segments"),
    "201 segments": (lambda: square() * 50 + square()[:1], "201 segments"),
    "an unknown type": (lambda: [_with(line(0.5, 0.1), type=7)], "type is 7"),
    "five joints": (lambda: [joint(HOME[:5])], "joints has 5 values"),
    "a pose of three": (lambda: [_with(line(0.5, 0.1), pose=[0.4, 0.1, 0.3])], "pose has 3 values"),
    "an arc without via": (lambda: [_with(arc((0.5, 0.1), (0.5, 0.2)), via=[])], "via has 0 values"),
    "NaN": (lambda: [line(NAN, 0.1)], "finite"),
    "an infinite speed": (lambda: [line(0.5, 0.1, speed=math.inf)], "finite"),
    "no speed": (lambda: [line(0.5, 0.1, speed=0.0)], "above 0"),
    "too fast": (lambda: square() + [line(0.5, 0.1, speed=20.0)], "segment 4: speed is 20 m/s"),
    "too hard": (lambda: [joint(HOME, acceleration=50.0)], "acceleration is 50 rad/s2"),
    "a joint beyond its limit": (lambda: [joint([7.0] + HOME[1:])], "joint 1"),
    "a radius that is NaN": (lambda: [line(0.5, 0.1, radius=NAN)], "blend_radius"),
    "a negative radius": (lambda: square(radius=-0.01), "-0.01"),
    "a radius at the end": (lambda: [line(0.46, 0.1, radius=0.01)], "no corner behind it"),
    "a radius larger than half of a side": (lambda: square(radius=0.031), "valid: at most half"),
    "out of reach": (lambda: square() + [line(1.5, 0.0)],
                     "segment 4: refused: its target cannot be reached: out of reach"),
    "an arc out of reach": (lambda: [arc((1.5, 0.1), (0.45, 0.2))],
                            "segment 0: refused: after 612 mm of 3593 mm it cannot go on: out of reach: shoulder"),
    "an arc on a line": (lambda: [arc((0.43, 0.1), (0.46, 0.1))], "no circle"),
}


def _with(segment, **fields):
    for name, value in fields.items():
        setattr(segment, name, value)
    return segment


def test_malformed_paths_are_rejected_as_a_whole_and_nothing_is_sent(arm, client, log_file):
    since = time.monotonic()
    for name, (make, reason) in MALFORMED.items():
        state, result = client.run(make())
        assert state == "REJECTED" and not result.success and reason in result.message, (name, state, result)
        assert (result.completed, result.fraction) == (0, 0.0)
    assert len(client.ends) == len(MALFORMED) and sent(log_file, since) == []


@pytest.mark.parametrize("radius", [0.0, 0.005, 0.02])
def test_corners_are_rounded_within_their_radius_in_order_as_one_queue(arm, client, log_file, radius):
    since = time.monotonic()
    state, result = client.run(square(radius))
    assert state == "SUCCEEDED" and result.success, result
    assert (result.completed, result.fraction) == (4, 1.0) and len(client.ends) == 1
    requests = all_sent(log_file, since, 4)
    assert [request["tol"] for _, request in requests] == pytest.approx([1000.0 * radius] * 3 + [0.0])
    way = tool_way(log_file, since)
    found = [nearest(way, (x, y, 0.37)) for x, y in SQUARE[:3]]
    assert [index for _, index in found] == sorted(index for _, index in found), "the corners are not in order"
    for distance, index in found:
        assert 0.2 * radius - 1e-6 <= distance <= radius + (0.01 * radius + 2e-5) * bow(log_file, since, index)
    under_way = [feedback.segment for feedback in client.feedback]
    assert under_way == sorted(under_way) and set(under_way) <= {0, 1, 2, 3, 4} and len(set(under_way)) >= 3


def test_joint_motions_lines_and_arcs_in_one_path(arm, client, log_file):
    since = time.monotonic()
    state, result = client.run([line(0.46, 0.10, radius=0.01), line(0.46, 0.16), arc((0.43, 0.19), (0.40, 0.16)),
                                joint(HOME), joint([0.2] + HOME[1:])])
    assert state == "SUCCEEDED", result
    assert [r["cmdName"] for _, r in all_sent(log_file, since, 5)] == ["moveL", "moveL", "movc", "joint_move",
                                                                     "joint_move"]
    way = tool_way(log_file, since)
    distance, _ = nearest(way, (0.43, 0.19, 0.37))
    assert distance < 1e-3, "the arc does not pass its via"
    assert arm.simulator.state()["joint_position"][0] == pytest.approx(math.degrees(0.2), abs=0.01)


ENDS = {
    "stop_move": ("ABORTED", "stopped by request"), "cancel": ("PREEMPTED", "cancelled by its client"),
    "emergency stop": ("ABORTED", "emergency stop"), "collision": ("ABORTED", "protective stop"),
}


@pytest.mark.parametrize("how", list(ENDS))
def test_what_ends_it_tells_how_far_it_came_and_nothing_is_sent_afterwards(arm, client, log_file, how):
    since = time.monotonic()
    handle = client.send(square(0.01, speed=0.05))
    client.come_to(0.3)
    ended = time.monotonic()
    if how == "stop_move":
        arm.call("stop_move")
    elif how == "cancel":
        client.cancel(handle)
    elif how == "collision":
        arm.simulator.operate("hit", force=500.0)
    else:
        arm.simulator.operate("press_emergency_stop")
    state, result = client.end(handle)
    assert state == ENDS[how][0] and ENDS[how][1] in result.message and "segments completed" in result.message, result
    assert result.completed == 1 and 0.3 <= result.fraction < 0.5 and not result.success
    assert not arm.simulator.is_moving(), "the end is published when the arm rests"
    arm.simulator.operate("release_emergency_stop")
    assert eventually(lambda: arm.call("recover").success)
    where = arm.simulator.state()["tcp_pose"]
    assert math.dist(where[:2], [460.0, 100.0 + 60.0 * (4.0 * result.fraction - 1.0)]) < 3.0, (where, result)
    assert len(client.ends) == 1 and [at for at, _ in sent(log_file, since) if at > ended + 0.5] == []
    assert eventually(lambda: WireVerdict(log_file).times_of("stop_program", ended))


def test_pause_rests_on_the_path_and_resume_goes_on(arm, client):
    handle = client.send(square(0.01, speed=0.1))
    client.come_to(0.3)
    assert arm.call("pause").success
    assert not arm.simulator.is_moving() and eventually(lambda: client.feedback[-1].paused)
    told = client.feedback[-1].fraction
    assert arm.call("resume").success
    state, result = client.end(handle)
    assert state == "SUCCEEDED" and told < 0.95, result


def test_one_motion_at_a_time(arm, client, log_file):
    first = client.send(square(speed=0.05))
    client.come_to(0.05)
    state, result = client.run(square())
    assert state == "REJECTED" and "a path owns the arm's motion" in result.message
    refused = arm.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=1.0)
    assert refused.ret == 0 and "a path owns the arm's motion" in refused.message
    arm.call("stop_move")
    assert client.end(first)[0] == "ABORTED"
    move = InBackground(arm.call, "joint_move", pose=[1.0] + HOME[1:], mvvelo=0.1, mvacc=1.0)
    assert eventually(arm.simulator.is_moving)
    state, result = client.run(square())
    assert state == "REJECTED" and "a move owns the arm's motion" in result.message
    arm.call("stop_move")
    assert move.join().ret == 0
    arm.go_home()
