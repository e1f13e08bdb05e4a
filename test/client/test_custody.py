"""Custody of a moving arm that is never released: odd details of the feed, refused replies, races. Verdicts from the
true arm."""
import math
import threading
import time

import pytest
from arm_bench import LOOSE
from waiting import eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.protocol.framing import encode_object

HOME = tuple(math.radians(q) for q in (0, 90, -90, 90, 90, 0))
SLOW_MOVE = c.JointMove((3.0,) + HOME[1:], 0.2, 4.0)
JOG = c.Jog(c.JogFrame.JOINT, 0, 0.3)
WARNING = {"errcode": "0x020033", "errmsg": "joint 3 is about to hit its soft limit"}
FLICKERS = {"inpos true": {"inpos": True}, "not enabled": {"enabled": False}, "not powered": {"powered_on": 0},
            "a warning": WARNING, "an unknown event": {"errcode": "0x123456", "errmsg": "?"}}


class Hostile:
    """The controller's core, which takes orders and does not always follow them."""

    def __init__(self, one):
        self._core = one.controller.server.controller
        self._execute = self._core.execute
        self._core.execute = self._take
        self.refused_stops = 0
        self.late_start = 0.0
        self.stops = []
        self._pending = None

    def _take(self, request):
        name = request.get("cmdName") if isinstance(request, dict) else None
        if name == "stop_program":
            self.stops.append(time.monotonic())
            self._pending = None
            if self.refused_stops:
                self.refused_stops -= 1
                return self._said(name, "2", "call stop_program failed")
        if name in ("joint_move", "jog") and self.late_start and request.get("jog_mode") != 0:
            self._pending = request
            self._core.state.after(self.late_start, lambda: self._start(request))
            return self._said(name, "0", "")
        return self._execute(request)

    def _start(self, request):
        if self._pending is request:
            self._execute(request)

    def _said(self, name, code, text):
        outcome = self._execute({"cmdName": "get_version"})
        return outcome._replace(command=name, reply=encode_object(
            {"errorCode": code, "errorMsg": text, "cmdName": name}))


def flicker(one, fields, seconds=0.1):
    one.panel("fields", add=fields)
    time.sleep(seconds)  # so long the feed shows it
    one.panel("fields", add={})


def assert_in_custody_while_it_moves(one, arm, seconds):
    """Assert for so long that the arm never moves without an owner for more than 0.3 s, with at least ten sightings."""
    seen = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        seen = [*seen, time.monotonic()] if one.is_moving() and arm.motion_owner is None else []
        assert len(seen) < 10 or seen[-1] - seen[0] < 0.3, "the arm moves and nobody owns its motion"
        time.sleep(0.01)  # between two looks


@pytest.mark.parametrize("detail", FLICKERS)
def test_a_jog_ends_with_its_watchdog_whatever_the_feed_says(bench, detail):
    one = bench()
    arm = one.connect(jog_timeout=1.0)
    called = time.monotonic()
    arm.jog(JOG)
    assert eventually(one.is_moving)
    flicker(one, FLICKERS[detail])
    assert_in_custody_while_it_moves(one, arm, 1.5)
    assert eventually(lambda: not one.is_moving())
    assert one.rest_after(called) - called < 1.0 + LOOSE


@pytest.mark.parametrize("detail", FLICKERS)
def test_a_jog_ends_with_its_watchdog_when_the_feed_lies_for_ever(bench, detail):
    one = bench()
    arm = one.connect(jog_timeout=1.0)
    called = time.monotonic()
    arm.jog(JOG)
    assert eventually(one.is_moving)
    one.panel("fields", add=FLICKERS[detail])
    assert eventually(lambda: not one.is_moving())
    assert one.rest_after(called) - called < 1.0 + LOOSE


@pytest.mark.parametrize("detail", FLICKERS)
def test_the_caller_of_a_move_is_told_its_end_when_the_arm_rests(bench, call, detail):
    one = bench()
    arm = one.connect()
    move = call(arm.move, c.JointMove((0.8,) + HOME[1:], 0.3, 4.0))
    assert eventually(one.is_moving)
    flicker(one, FLICKERS[detail])
    error = move.failure()
    if error is None:
        assert not one.is_moving()
        assert abs(one.controller.state()["joint_position"][0] - math.degrees(0.8)) < 0.1
        return
    assert isinstance(error, MotionInterrupted)
    assert_in_custody_while_it_moves(one, arm, 1.0)
    told = move.ended_at
    assert one.rest_after(told - 1.0) - told < 1.5, "the move itself takes 2.7 s"


def test_a_warning_that_the_arm_nears_a_limit_does_not_end_a_move(bench, call):
    one = bench()
    arm = one.connect()
    move = call(arm.move, c.JointMove((0.3,) + HOME[1:], 0.5, 4.0))
    assert eventually(one.is_moving)
    flicker(one, WARNING, 0.2)
    assert move.failure() is None
    assert one.times_of("stop_program") == []


@pytest.mark.parametrize("act", [lambda arm: arm.move(c.JointMove((0.5,) + HOME[1:], 0.5, 4.0)),
                                 lambda arm: arm.move(c.JointMove((0.005,) + HOME[1:], 0.5, 4.0)),
                                 lambda arm: arm.jog(JOG)])
def test_a_motion_that_starts_late_is_stopped_or_followed(bench, call, act):
    one = bench()
    hostile = Hostile(one)
    arm = one.connect(jog_timeout=2.0)
    hostile.late_start = 1.3
    called = call(act, arm)
    assert_in_custody_while_it_moves(one, arm, 2.5)
    called.wait()
    assert eventually(lambda: hostile.stops and not one.is_moving())


@pytest.mark.parametrize("size", [0.009, 0.005, 0.001, 0.0003])
def test_a_small_move_is_completed_at_its_target(bench, size):
    one = bench()
    arm = one.connect()
    for target in (size, 0.0, size):
        arm.move(c.JointMove((target,) + HOME[1:], 0.02, 4.0))
        assert not one.is_moving()
        assert abs(math.radians(one.controller.state()["joint_position"][0]) - target) < 2e-5


@pytest.mark.parametrize("seconds", [0.1, 0.0])
def test_a_stop_ends_what_was_asked_before_it_and_only_that(bench, call, seconds):
    one = bench()
    arm = one.connect()
    if seconds:
        one.panel("fault", kind="delay", port="command", count=None, delay_ms=20)
    for turn in range(15):
        first = call(arm.move, c.JointMove((1.0 if turn % 2 else -1.0,) + HOME[1:], 0.5, 4.0))
        assert eventually(one.is_moving), first.error
        one.panel("fault", kind="merge", port="command", count=2, hold_ms=20)
        stop = call(arm.stop)
        time.sleep(0.0005 * turn)  # each turn meets the stop at another moment
        second = call(arm.move, c.JointMove((0.05 * turn,) + HOME[1:], 1.0, 4.0))
        assert stop.failure() is None
        assert first.failure().cause is StopCause.STOPPED
        assert_in_custody_while_it_moves(one, arm, 0.3)
        error = second.failure()
        if error is None:
            assert abs(math.radians(one.controller.state()["joint_position"][0]) - 0.05 * turn) < 1e-3
        else:
            assert isinstance(error, (MotionInterrupted, InvalidCommand))
        assert not one.is_moving()


def test_a_jog_asked_for_beside_a_stop_has_its_watchdog(bench, call):
    one = bench()
    arm = one.connect(jog_timeout=0.5)
    for _ in range(6):
        arm.jog(JOG)
        stop, jog = call(arm.stop), call(arm.jog, c.Jog(c.JogFrame.JOINT, 0, -0.2))
        assert stop.failure() is None
        jog.failure()
        assert_in_custody_while_it_moves(one, arm, 0.6)
        assert eventually(lambda: arm.motion_owner is None)
        assert not one.is_moving()


@pytest.mark.parametrize("refusals", [1, 3, 20])
def test_a_stop_that_is_refused_is_repeated(bench, call, refusals):
    one = bench()
    hostile = Hostile(one)
    arm = one.connect()
    move = call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    hostile.refused_stops = refusals
    with pytest.raises(JakaError, match="call stop_program failed"):
        arm.stop()
    assert_in_custody_while_it_moves(one, arm, 0.08 * refusals + 0.5)
    assert move.failure().cause in (StopCause.STOPPED, StopCause.TIMEOUT)  # after 1 s: "the stop is not accepted"
    assert eventually(lambda: arm.motion_owner is None)
    assert not one.is_moving()
    assert len(hostile.stops) >= refusals + 1


@pytest.mark.parametrize("occasion", ["dark feed", "over time", "after a reconnect", "jog watchdog"])
def test_a_stop_of_the_drivers_own_that_is_refused_is_repeated(bench, call, occasion):
    one = bench()
    hostile = Hostile(one)
    arm = one.connect(motion_timeout=1.0, jog_timeout=1.0, **({} if not hasattr(arm_settings(), "link_loss_stop")
                                                              else {"link_loss_stop": 0.0}))
    hostile.refused_stops = 2
    if occasion == "jog watchdog":
        arm.jog(JOG)
    else:
        call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    if occasion == "dark feed":
        one.panel("refuse", port="status", duration_ms=1500)
        one.panel("close", port="status")
    elif occasion == "after a reconnect":
        one.panel("close", port="command")
    assert eventually(lambda: len(hostile.stops) >= 3, 5.0), "the stop was not repeated"
    assert eventually(lambda: not one.is_moving(), 5.0)
    assert eventually(lambda: arm.motion_owner is None)


def arm_settings():
    from jaka_ros_driver.client.settings import ClientSettings
    return ClientSettings("")


def test_slow_replies_are_no_lost_link_and_a_stop_passes_during_the_handshake(bench, call):
    one = bench()
    arm = one.connect()
    call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    connections = arm.link_health.connections
    one.panel("fault", kind="delay", port="command", count=None, delay_ms=650)
    time.sleep(3.0)  # the time in which slow replies would have been taken for a lost link
    assert arm.link_health.connections == connections, "the link was made anew"
    one.panel("close", port="command")
    assert eventually(lambda: arm.link_health.connections > connections or not arm.is_ready)
    assert eventually(lambda: not one.is_moving(), 8.0), "the move itself takes 15 s"


def test_a_stop_is_delivered_while_the_handshake_goes_on(bench):
    one = bench()
    arm = one.connect()
    asked = one.requests("get_simulator_identity")
    one.panel("fault", kind="delay", port="command", count=None, delay_ms=600)
    one.panel("close", port="command")
    assert eventually(lambda: one.requests("get_simulator_identity") > asked)
    began = time.monotonic()
    arm.stop()
    stop, = one.times_of("stop_program")
    assert stop - began < 1.5, "the five questions of the handshake take 3 s"


def test_many_targets_at_once_do_not_run_the_arm_away(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    for step in range(1, 41):
        try:
            arm.servo_target(c.ServoJoint((0.1 * step,) + HOME[1:]))
        except InvalidCommand:
            pass
        time.sleep(0.0005)  # far faster than the arm can follow
    last = time.monotonic()
    assert eventually(lambda: not one.is_moving())
    assert 0.0 < max(abs(joints[0]) for _, joints in one.joints()) < 0.5
    assert one.rest_after(last) - last < LOOSE


def test_increments_do_not_add_up_beyond_a_joint_limit_on_the_wire(bench):
    one = bench(time_scale=1.0)
    arm = one.connect()
    arm.move(c.JointMove(HOME[:5] + (6.2,), 3.0, 12.0))
    arm.set_servo_mode(True)
    refused = 0
    for _ in range(100):
        try:
            arm.servo_target(c.ServoJoint((0.0,) * 5 + (0.004,), relative=True))
        except InvalidCommand:
            refused += 1
        time.sleep(0.008)  # the rate of a stream
    assert refused > 50
    sent = [request["jointPosition"][5] for _, request in one.received() if request["cmdName"] == "servo_j"]
    assert max(sent) <= 360.0


def test_servo_mode_is_not_claimed_while_the_command_port_is_down(bench):
    one = bench()
    arm = one.connect()
    arm.set_servo_mode(True)
    assert arm.is_servo_active
    one.panel("refuse", port="command", duration_ms=6000)
    one.panel("close", port="command")
    assert eventually(lambda: not arm.is_servo_active, 5.0)


def test_the_controller_itself_stops_the_arm_when_the_network_falls_silent(bench):
    one = bench()
    arm = one.connect(link_loss_stop=0.3)
    arm.jog(JOG)
    assert eventually(one.is_moving)
    one.panel("stall", duration_ms=4000)
    struck = time.monotonic()
    assert eventually(lambda: not one.is_moving())
    assert time.monotonic() - struck < 3.0, "the driver itself can do nothing for 4 s"
    assert eventually(lambda: arm.is_ready and arm.motion_owner is None)
    assert not one.is_moving()


def test_the_controller_is_asked_to_watch_its_client_in_custody_only(bench):
    one = bench()
    arm = one.connect(link_loss_stop=0.25)
    arm.move(c.JointMove((0.2,) + HOME[1:], 1.0, 4.0))
    arm.execute(c.Query.VERSION)
    asked = [(request["cmdName"], request.get("motType"), request.get("timeLimit")) for _, request in one.received()
             if request["cmdName"] in ("set_network_exception_handle", "joint_move")]
    assert asked == [("set_network_exception_handle", 2, 250.0), ("joint_move", None, None),
                     ("set_network_exception_handle", 0, 0.0)]


def test_a_controller_that_is_not_the_one_meant_is_left_alone(bench):
    one = bench(start="powered")
    shown = []
    arm = one.connect(ready=False, simulator="the-one-that-was-launched")
    arm.add_listener(lambda state, is_new: shown.append(state))
    arm.auto_enable()
    for act in (lambda: arm.move(SLOW_MOVE), lambda: arm.jog(JOG), arm.stop, lambda: arm.execute(c.SetPower(True))):
        with pytest.raises(ConnectionLost):
            act()
    assert eventually(lambda: "is not the simulated one" in arm.link_health.last_error)
    time.sleep(0.5)  # what must not come has no other sign
    assert not arm.is_ready and not shown
    assert {request["cmdName"] for _, request in one.received()} == {"get_simulator_identity"}


def test_the_simulated_controller_that_was_launched_is_driven(bench):
    one = bench(identity="this-one")
    arm = one.connect(simulator="this-one")
    assert arm.link_health.is_simulated is True
    arm.move(c.JointMove((0.1,) + HOME[1:], 1.0, 4.0))


def test_the_simulated_controller_that_was_launched_is_stopped_and_driven_again_after_a_cut(bench, call):
    one = bench(identity="this-one")
    arm = one.connect(simulator="this-one", link_loss_stop=0.0)
    move = call(arm.move, SLOW_MOVE)
    assert eventually(one.is_moving)
    one.panel("close", port="command")
    assert move.failure().cause is StopCause.LINK_LOST
    assert eventually(lambda: arm.is_ready and arm.motion_owner is None)
    assert not one.is_moving()
    arm.move(c.JointMove((0.1,) + HOME[1:], 1.0, 4.0))


def test_an_arm_that_somebody_else_moves_is_not_moved(bench):
    one = bench()
    arm = one.connect()
    plant = one.controller.server.controller.state.plant
    one.controller.server.call(lambda: plant.add_joint_move((1.0,) + HOME[1:], 0.2))
    assert eventually(one.is_moving)
    assert eventually(lambda: arm.fresh_state().joint_position[0] > 0.01)
    with pytest.raises(InvalidCommand, match="not by this driver"):
        arm.move(SLOW_MOVE)
    assert one.times_of("joint_move") == []


def test_thirty_callers_at_once_leave_the_arm_owned_or_at_rest(bench):
    one = bench()
    arm = one.connect(jog_timeout=0.3)
    over = threading.Event()

    def caller(number):
        turn = 0
        while not over.is_set():
            turn += 1
            try:
                if number % 3 == 0:
                    arm.jog(c.Jog(c.JogFrame.JOINT, number % 6, 0.1))
                elif number % 3 == 1:
                    arm.move(c.JointMove((0.01 * (turn % 7),) + HOME[1:], 0.5, 4.0), wait=turn % 2 == 0)
                else:
                    arm.stop()
            except JakaError:
                pass
            time.sleep(0.02 * (number % 5))  # each caller has its own rhythm
    threads = [threading.Thread(target=caller, args=(number,)) for number in range(30)]
    for thread in threads:
        thread.start()
    try:
        assert_in_custody_while_it_moves(one, arm, 4.0)
    finally:
        over.set()
        for thread in threads:
            thread.join()
    assert eventually(lambda: arm.motion_owner is None)
    assert not one.is_moving()
