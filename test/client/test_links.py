"""Links that are cut, stall, fall silent and come back; verdicts from the controller's log."""
import math
import os
import random
import threading
import time

import pytest
from raw_client import RawClient
from waiting import StallWatch, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core import link
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.errors import ConnectionLost, JakaError, ReplyTimeout, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
SLOW_MOVE = c.JointMove((3.0,) + HOME[1:], 0.2, 4.0)
NEVER_BY_ITSELF = {"power_on", "enable_robot", "clear_error"}

CUTS = {
    "close": lambda one: one.operate("close"),
    "reset": lambda one: one.operate("reset"),
    "half open": lambda one: one.operate("half_open"),
    "half a frame": lambda one: one.operate("fault", kind="cut", port="status", bytes=1000),
    "reboot": lambda one: one.operate("reboot", down=0.5),
    "power failure": lambda one: one.operate("reboot", down=0.5, silent=1),
    "refused for a while": lambda one: (one.operate("refuse", duration_ms=500), one.operate("close")),
    "reply lost": lambda one: one.operate("fault", kind="drop", port="command"),
}


@pytest.mark.parametrize("cut", CUTS)
def test_a_cut_is_noticed_and_the_link_comes_back(bench, cut):
    one = bench()
    arm = one.connect()
    before = arm.link_health.connections
    with StallWatch() as host:
        cut_at = time.monotonic()
        CUTS[cut](one)
        assert cut == "reply lost" or eventually(lambda: not arm.is_ready)
        assert host.between(cut_at) < 6.0
    assert eventually(lambda: arm.is_ready and (arm.link_health.connections > before or cut == "half a frame"))
    assert arm.execute(c.Query.VERSION)
    assert eventually(lambda: arm.link_health.feed_period == 0.008)
    names = {request["cmdName"] for _, request in one.received()}
    assert names.isdisjoint(NEVER_BY_ITSELF | {"joint_move", "servo_move", "stop_program"})


def test_the_client_may_start_before_the_controller(bench):
    one = bench()
    one.operate("reboot", down=1.0)
    arm = one.connect(ready=False)
    with pytest.raises(ConnectionLost):
        arm.execute(c.Query.VERSION)
    with pytest.raises(ConnectionLost):
        arm.move(SLOW_MOVE)
    assert eventually(lambda: arm.is_ready)


@pytest.mark.parametrize("start", ["jog", "servo"])
def test_a_link_lost_in_a_jog_or_stream_stops_the_arm_at_its_return(bench, start):
    one = bench()
    arm = one.connect()
    if start == "jog":
        arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.2))
    else:
        arm.set_servo_mode(True)
    one.operate("close", port="command")
    assert eventually(lambda: arm.motion_owner is None)
    assert eventually(lambda: arm.is_ready and not one.is_moving())
    assert not one.controller.state()["is_servo_active"]
    assert len(one.times_of("stop_program")) == 1


def test_a_stream_is_ended_and_servo_mode_left_when_the_status_port_goes_down(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    assert eventually(lambda: one.requests("servo_j"))
    one.operate("refuse", port="status", duration_ms=60000)
    one.operate("close", port="status")
    assert eventually(lambda: not one.controller.state()["is_servo_active"])
    assert eventually(lambda: not arm.is_ready)
    with pytest.raises(ConnectionLost, match="no link|no fresh"):
        arm.move(SLOW_MOVE)
    one.operate("refuse", port="status", duration_ms=0)
    assert eventually(lambda: arm.motion_owner is None)
    leaves = [at for at, request in one.received() if request == {"cmdName": "servo_move", "relFlag": 0}]
    stop, = one.times_of("stop_program")
    assert len(leaves) == 1 and max(one.times_of("servo_j")) <= leaves[0] <= stop


@pytest.mark.parametrize("start", ["jog", "servo", "move"])
def test_a_stop_that_a_silent_link_swallowed_is_the_first_word_on_the_next(bench, call, start):
    one = bench()
    arm = one.connect()
    if start == "servo":
        arm.set_servo_mode(True)
    else:
        call(arm.jog, c.Jog(c.JogFrame.JOINT, 0, 0.2)) if start == "jog" else call(arm.move, SLOW_MOVE)
        assert eventually(one.is_moving)
    one.operate("half_open")
    assert eventually(lambda: arm.motion_owner is None)
    assert eventually(lambda: arm.is_ready)
    assert eventually(lambda: not one.is_moving() and not one.controller.state()["is_servo_active"])
    assert len(one.times_of("stop_program")) == 1


@pytest.mark.parametrize("command, act", [
    ("jog", lambda arm: arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.2))),
    ("joint_move", lambda arm: arm.move(SLOW_MOVE)),
    ("servo_move", lambda arm: arm.set_servo_mode(True))])
def test_a_motion_whose_reply_is_lost_is_stopped(bench, command, act):
    one = bench()
    arm = one.connect(reply_timeout=0.5)
    one.operate("fault", kind="drop", port="command", command=command)
    with pytest.raises((ReplyTimeout, ConnectionLost)):
        act(arm)
    assert eventually(lambda: arm.is_ready and arm.motion_owner is None)
    assert eventually(lambda: not one.is_moving() and not one.controller.state()["is_servo_active"])
    assert one.times_of(command)[0] < one.times_of("stop_program")[0]


def test_a_motion_left_unstopped_by_a_lost_link_is_told_as_moving_until_it_is_stopped(bench):
    one = bench()
    told = []

    class Ear:
        """A stand-in for the guard."""

        def notify(self, is_moving):
            told.append(is_moving)

        def beat(self, now):
            pass

    one.arm = arm = ArmClient(ClientSettings("127.0.0.1", one.controller.command_port, one.controller.status_port,
                                             link_loss_stop=0.0), load_model("zu7"), Ear())
    arm.start()
    assert eventually(lambda: arm.is_ready)
    arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.2))
    assert eventually(one.is_moving)
    one.operate("refuse", port="command", duration_ms=60000)
    one.operate("close", port="command")
    assert eventually(lambda: not arm.is_ready)
    assert told[-1] and one.is_moving() and arm.motion_owner is MotionOwner.JOG
    one.operate("refuse", port="command", duration_ms=0)
    assert eventually(lambda: arm.is_ready and not told[-1])
    assert arm.motion_owner is None and not one.is_moving()
    assert one.times_of("stop_program")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_reader_that_fails_makes_its_link_anew(bench):
    one = bench()
    arm = one.connect()
    failures = [KeyError("a defect")]

    def fail(_state, _is_new):
        if failures:
            raise failures.pop()
    arm.add_listener(fail)
    assert eventually(lambda: not failures)
    frames = arm.feed_health.frames
    assert eventually(lambda: arm.is_ready and arm.feed_health.frames > frames + 10)


def test_another_client_on_the_port_is_noticed_and_the_arm_is_stopped(bench, call):
    one = bench(single_client="replace")
    arm = one.connect()
    move = call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)

    with RawClient(one.controller.command_port) as other:
        other.send(b'{"cmdName": "get_version"}')
        assert move.failure().cause is StopCause.LINK_LOST
    assert eventually(lambda: arm.is_ready and not one.is_moving())


def test_short_connections_of_others_beside_it_disturb_no_move(bench, call):
    # Public clients open one for each request (docs/controller-protocol.md section 1).
    one = bench(single_client="coexist")
    arm = one.connect()
    move = call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    for _ in range(10):
        with RawClient(one.controller.command_port) as other:
            assert other.code("get_version") == "0"
    assert one.is_moving() and arm.is_ready
    arm.stop()
    assert move.failure().cause is StopCause.STOPPED and arm.is_ready


def test_a_feed_of_damaged_frames_only_is_as_good_as_none(bench, call):
    one = bench()
    arm = one.connect(stale_after=0.5)
    move = call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    one.operate("fault", kind="wrong_len", port="status", count=None)
    assert move.failure().cause is StopCause.LINK_LOST
    assert eventually(lambda: not one.is_moving())
    with pytest.raises(ConnectionLost):
        arm.fresh_state()
    one.operate("clear_faults")
    assert eventually(lambda: arm.is_ready)
    assert arm.feed_health.damaged > 0


@pytest.mark.parametrize("kind", ["wrong_len", "garbage", "noise", "drop", "split", "merge", "duplicate"])
def test_damage_in_the_feed_changes_nothing_but_a_counter(bench, kind):
    one = bench()
    arm = one.connect()
    bad = []
    arm.add_listener(lambda state, _: bad.append(state) if max(map(abs, state.joint_position)) > 7 else None)
    damaged = arm.feed_health.damaged
    one.operate("fault", kind=kind, port="status", count=None, probability=0.5)
    frames = arm.feed_health.frames
    assert eventually(lambda: arm.feed_health.frames > frames + 100)
    if kind in ("wrong_len", "garbage", "noise"):
        assert arm.feed_health.damaged > damaged
    assert bad == [] and arm.is_ready


@pytest.mark.parametrize("kind", ["split", "merge", "duplicate", "garbage", "delay", "reorder"])
def test_damaged_replies_are_survived(bench, kind):
    one = bench()
    arm = one.connect()
    one.operate("fault", kind=kind, port="command", count=None, probability=0.7,
              **({"delay_ms": 50} if kind == "delay" else {}))
    answered = 0
    for _ in range(20):
        try:
            assert arm.execute(c.Query.VERSION)
            answered += 1
        except (ConnectionLost, ReplyTimeout):
            assert eventually(lambda: arm.is_ready)
    assert answered >= 10


def test_a_lost_reply_is_told_and_the_command_is_not_repeated(bench):
    one = bench()
    arm = one.connect(reply_timeout=0.5)
    one.operate("fault", kind="drop", port="command", command="set_payload")
    with pytest.raises((ReplyTimeout, ConnectionLost)):
        arm.execute(c.SetPayload(1.0, (0.0, 0.0, 0.0)))
    assert eventually(lambda: arm.is_ready)
    assert len(one.times_of("set_payload")) == 1


def test_a_slow_feed_is_reported_as_it_is(bench):
    one = bench()
    arm = one.connect()
    one.operate("slow_feed", rate=33)
    assert eventually(lambda: 25 < arm.feed_health.rate < 45)


def test_fields_that_are_missing_or_new_are_survived(bench):
    one = bench()
    arm = one.connect()
    one.operate("fields", drop=["actual_position", "monitor_data", "tio_ain"], add={"novelty": [1, {"x": None}]})
    assert eventually(lambda: arm.fresh_state().tcp_position is None)
    arm.move(c.JointMove((0.1,) + HOME[1:], 1.0, 4.0))
    one.operate("fields", drop=["protective_stop"], add={})
    assert eventually(lambda: not arm.is_ready)
    assert "protective_stop" in arm.feed_health.last_damage


def test_many_cuts_leave_no_thread_and_no_descriptor_behind(bench, monkeypatch):
    monkeypatch.setattr(link, "_LONGEST_WAY_S", 0.1)  # so many cuts look like those of another client
    one = bench()
    arm = one.connect()
    chance = random.Random(1)
    threads, descriptors = [], []
    for _ in range(25):
        try:
            one.operate(chance.choice(["close", "reset"]), port=chance.choice(["command", "status"]))
            arm.execute(c.Query.VERSION)
        except JakaError:
            pass
        assert eventually(lambda: arm.is_ready)
        threads.append(threading.active_count())
        descriptors.append(len(os.listdir("/proc/self/fd")))
    assert max(threads[-5:]) <= max(threads[:5]) + 1
    assert max(descriptors[-5:]) <= max(descriptors[:5]) + 4


def test_two_drivers_of_one_controller_give_way_and_each_says_that_there_is_another(bench):
    one = bench(single_client="replace")
    first = one.connect()
    settings = ClientSettings("127.0.0.1", one.controller.command_port, one.controller.status_port)
    second = ArmClient(settings, load_model("zu7"))
    second.start()
    try:
        said = set()

        def each_has_said_so():
            said.update(arm for arm in (first, second) if "another client" in arm.link_health.last_error)
            return len(said) == 2
        assert eventually(each_has_said_so)

        def is_refused_and_says_why(arm):
            try:
                arm.execute(c.Query.VERSION)
            except JakaError as error:
                return "another client" in str(error)
            return False
        assert eventually(lambda: is_refused_and_says_why(first) or is_refused_and_says_why(second))
    finally:
        second.close()
