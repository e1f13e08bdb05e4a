"""Velocity jog on the running node: every way of release, read in the controller's log, and that nothing resumes."""
import math
import time
from types import SimpleNamespace

import pytest
import rospy
from driver_bench import LiveDriver, collecting
from jog_pad import (
    KILLED,
    PERIOD_S,
    SPEED,
    WAYS,
    Pad,
    begin,
    last_frame_of_motion,
    let_go,
    rests,
    twist_message,
)
from rosgraph_msgs.msg import Log
from waiting import eventually

LONGEST_S = 1.0
"""Time limit, s: 0.3 s on a quiet host (test/benchmark/bench_deadman.py), and what a busy one may take away."""
NONSENSE = (
    (lambda speed: twist_message(speed, frame_id="camera"), "frame_id is 'camera'; valid: base, base_link, tool"),
    (lambda speed: twist_message(speed, stamp=rospy.Time()), "header.stamp is 0"),
    (lambda speed: twist_message(speed, stamp=rospy.Time.now() - rospy.Duration(1.0)), "at most 0.2 s"))
TOPIC = {"silence": "jog_twist", "nan": "jog_twist"}


@pytest.fixture(scope="module")
def session(ros_node, tmp_path_factory):
    told = SimpleNamespace(ways={})
    with LiveDriver(tmp_path_factory.mktemp("jog"), name="jogging", guard=False) as live:
        live.arm.wait_until_ready()
        with collecting("/rosout", Log) as told.log:
            live.arm.go_home()
            for way in [*WAYS, KILLED]:
                told.ways[way] = let_go(live.arm, way, TOPIC.get(way, "jog_joints"))
            live.arm.go_home()
            moved_along_axes(live, told)
            went_on_after_a_stop(live, told)
            said_what_cannot_be_understood(live, told)
        told.verdict = live.verdict()
    return told


def said(told):
    return "\n".join(message.msg for _, message in list(told.log))


def moved_along_axes(live, told):
    """Jog along y of the base by topic, m/s."""
    told.tool_before = live.simulator.state()["tcp_pose"]
    with Pad(live.arm.name, "jog_twist") as pad:
        def is_there():
            if not live.simulator.is_moving():  # at first, and where a busy host has ended the jog
                begin(live.arm, pad, 0.2)
            return live.simulator.state()["tcp_pose"][1] > told.tool_before[1] + 20.0
        assert eventually(is_there)
        pad.speed = 0.0
        assert rests(live.arm)
        told.tool_after = live.simulator.state()["tcp_pose"]


def went_on_after_a_stop(live, told):
    """Hold the stick where it is while stop_move is called."""
    with Pad(live.arm.name) as pad:
        begin(live.arm, pad)
        told.stopped = time.monotonic()
        live.arm.call("stop_move")
        assert rests(live.arm)
        told.rested = time.monotonic()
        time.sleep(0.5)  # what must not come has no other sign
        told.held_on_until = time.monotonic()
        begin(live.arm, pad)
        pad.speed = 0.0
        assert rests(live.arm)


def said_what_cannot_be_understood(live, told):
    """Publish each message until it is in the log."""
    told.nonsense_began = time.monotonic()
    with Pad(live.arm.name, "jog_twist") as pad:
        for pad.make, refusal in NONSENSE:
            for pad.speed in (0.0, SPEED):
                since = pad.sent_at
                assert eventually(lambda since=since: pad.sent_at > since + 5 * PERIOD_S)
            assert eventually(lambda refusal=refusal: refusal in said(told)), refusal


@pytest.mark.parametrize("way", [*WAYS, KILLED])
def test_every_way_of_letting_go_stops_the_arm(session, way):
    since, until = session.ways[way]
    assert last_frame_of_motion(session.verdict, since, until) - since < LONGEST_S
    assert session.verdict.rest_after(since, until) - since < LONGEST_S


def test_the_tool_moves_along_the_axis_that_is_asked_for(session):
    before, after = session.tool_before, session.tool_after
    assert after[1] - before[1] > 20.0
    assert after[:1] + after[2:3] == pytest.approx(before[:1] + before[2:3], abs=0.5)
    assert after[3:] == pytest.approx(before[3:], abs=0.2)


def test_after_stop_move_nothing_resumes_until_rest_was_said(session):
    entered = session.verdict.times_of("servo_move", after=session.stopped, relFlag=1)
    assert entered and entered[0] > session.held_on_until
    moved = [at for at, joints in session.verdict.joints() if session.rested <= at <= session.held_on_until]
    assert session.verdict.rest_after(session.stopped, session.held_on_until) < session.rested and moved


def test_what_cannot_be_understood_moves_nothing_and_is_told(session):
    assert not session.verdict.times_of("servo_move", after=session.nonsense_began)
    assert "no fresh message for 0.2 s; the arm brakes" in said(session)


def test_no_frame_asks_for_more_than_the_limits(session):
    path = [(at, [math.radians(q) for q in request["jointPosition"]]) for at, request in session.verdict.received()
            if request["cmdName"] == "servo_j"]
    for (begun, before), (ended, after) in zip(path, path[1:]):
        if ended - begun < 0.1:
            assert max(abs(b - a) for a, b in zip(before, after)) <= 1.001 * 0.008
