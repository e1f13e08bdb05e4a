"""Custody of a moving arm that is never released: odd details of the feed, refused replies, races, links that break.

The driver's core and the simulated controller run in virtual time; verdicts are those of the true arm.
"""
import math

import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.client.core.procedures import power
from jaka_ros_driver.errors import ConnectionLost, InvalidCommand, JakaError, MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.simulation.controller.state import Start

MODEL = load_model("zu7")
JOG = c.Jog(c.JogFrame.JOINT, 0, 0.3)
BRAKES_IN = 0.1
"""Time, s, in which an arm that goes at 0.3 rad/s or less rests after the stop."""
WARNING = {"errcode": "0x020033", "errmsg": "joint 3 is about to hit its soft limit"}
FLICKERS = {"inpos true": {"inpos": True}, "not enabled": {"enabled": False}, "not powered": {"powered_on": 0},
            "a warning": WARNING, "an unknown event": {"errcode": "0x123456", "errmsg": "?"}}


def to(first, speed=0.5, acceleration=4.0):
    return c.JointMove((first,) + HOME[1:], speed, acceleration)


SLOW_MOVE = to(3.0, 0.2)


class Hostile(SimulatedArm):
    """An arm whose controller takes orders and does not always follow them.

    Attributes:
        refused_stops: So many stops are refused.
        late_start: A motion begins so much later than it was accepted, s.
        stops: When stops came in, s.
    """

    def __init__(self, **settings):
        self.refused_stops, self.late_start, self.stops, self._pending = 0, 0.0, [], None
        super().__init__(MODEL, HOME, **settings)

    def execute(self, request):
        name = request["cmdName"]
        if name == "stop_program":
            self.stops.append(self.now)
            self._pending = None
            if self.refused_stops:
                self.refused_stops -= 1
                return self._answered(name, "2", "call stop_program failed")
        if name in ("joint_move", "jog") and self.late_start and request.get("jog_mode") != 0:
            self._pending = request
            self.controller.state.after(self.late_start, lambda: self._start(request))
            return self._answered(name, "0", "")
        return super().execute(request)

    def _start(self, request):
        if self._pending is request:
            super().execute(request)

    def _answered(self, name, code, text):
        outcome = super().execute({"cmdName": "get_version"})
        return outcome._replace(command=name, reply=encode_object(
            {"errorCode": code, "errorMsg": text, "cmdName": name}))


@pytest.fixture
def make():
    """Return a function that makes arms; in the end none has moved without custody for longer than a driver may."""
    made = []

    def one(**settings):
        made.append(Hostile(**settings))
        return made[-1]
    yield one
    assert made and all(arm.longest_unowned < 0.3 for arm in made), "the arm moves and nobody owns its motion"


def moving(arm, method, *args):
    call = arm.begin(method, *args)
    arm.until(lambda: arm.is_moving)
    return call


def flicker(arm, fields, seconds=0.1):
    arm.show(**fields)
    arm.run(seconds)
    arm.show()


def at_rest_and_free(arm):
    return not arm.is_moving and arm.core.is_free


@pytest.mark.parametrize("detail", FLICKERS)
def test_a_jog_ends_with_its_watchdog_whatever_the_feed_says(make, detail):
    arm = make(jog_timeout=1.0)
    called = arm.now
    moving(arm, "jog", JOG)
    flicker(arm, FLICKERS[detail])
    arm.run(1.5)
    assert arm.times_of("stop_program")[0] <= called + 1.0
    assert arm.rest_after(called) < called + 1.0 + BRAKES_IN


@pytest.mark.parametrize("detail", FLICKERS)
def test_a_jog_ends_with_its_watchdog_when_the_feed_lies_for_ever(make, detail):
    arm = make(jog_timeout=1.0)
    called = arm.now
    moving(arm, "jog", JOG)
    arm.show(**FLICKERS[detail])
    arm.run(3.0)
    assert arm.times_of("stop_program")[0] <= called + 1.0
    assert arm.rest_after(called) < called + 1.0 + BRAKES_IN


@pytest.mark.parametrize("detail", FLICKERS)
def test_the_caller_of_a_move_has_its_end_when_the_arm_rests_or_brakes(make, detail):
    arm = make()
    began = arm.now
    move = moving(arm, "move", to(0.8, 0.3), True)
    arm.run(0.3)
    flicker(arm, FLICKERS[detail])
    error = arm.ended(move)
    if error is None:
        assert arm.rest_after(began) <= move.ended_at < arm.rest_after(began) + 0.1
        assert abs(arm.joints[0] - 0.8) < 1e-4
        return
    assert isinstance(error, MotionInterrupted)
    assert arm.times_of("stop_program") == [move.ended_at]
    arm.run(1.0)
    assert arm.rest_after(began) < move.ended_at + BRAKES_IN


def test_a_warning_that_the_arm_nears_a_limit_does_not_end_a_move(make):
    arm = make()
    move = moving(arm, "move", to(0.3), True)
    flicker(arm, WARNING, 0.2)
    assert arm.ended(move) is None
    assert arm.times_of("stop_program") == []


@pytest.mark.parametrize("act", [("move", to(0.5), True), ("move", to(0.005), True), ("jog", JOG)])
def test_a_motion_that_starts_late_is_stopped_or_followed(make, act):
    arm = make(jog_timeout=2.0)
    arm.late_start = 1.3
    call = arm.begin(*act)
    arm.run(2.5)
    assert call.is_over
    assert arm.stops and at_rest_and_free(arm)


@pytest.mark.parametrize("size", [0.009, 0.005, 0.001, 0.0003])
def test_a_small_move_is_completed_at_its_target(make, size):
    arm = make()
    for target in (size, 0.0, size):
        assert arm.ended(arm.begin("move", to(target, 0.02), True)) is None
        assert not arm.is_moving
        assert abs(arm.joints[0] - target) < 2e-5


@pytest.mark.parametrize("delay", [0.02, 0.0])
@pytest.mark.parametrize("turn", range(15))
def test_a_stop_ends_what_was_asked_before_it_and_only_that(make, delay, turn):
    arm = make()
    arm.reply_delay = delay
    first = moving(arm, "move", to(1.0 if turn % 2 else -1.0), True)
    arm.join_replies(0.02)
    stop = arm.begin("stop")
    arm.run(0.002 * turn)  # each turn meets the stop at another moment
    second = arm.begin("move", to(0.05 * turn, 1.0), True)
    assert arm.ended(stop) is None
    assert arm.ended(first).cause is StopCause.STOPPED
    error = arm.ended(second)
    if error is None:
        assert abs(arm.joints[0] - 0.05 * turn) < 1e-3
    else:
        assert isinstance(error, (MotionInterrupted, InvalidCommand))
    assert not arm.is_moving


@pytest.mark.parametrize("later", [0.0, 0.001, 0.01, 0.05, 0.1, 0.2])
def test_a_jog_asked_for_beside_a_stop_has_its_watchdog(make, later):
    arm = make(jog_timeout=0.5)
    arm.begin("jog", JOG)
    arm.run(0.1)
    stop = arm.begin("stop")
    arm.run(later)
    jog = arm.begin("jog", c.Jog(c.JogFrame.JOINT, 0, -0.2))
    assert arm.ended(stop) is None
    arm.ended(jog)
    arm.run(0.5 + BRAKES_IN + 0.2)
    assert at_rest_and_free(arm)


@pytest.mark.parametrize("refusals", [1, 3, 20])
def test_a_stop_that_is_refused_is_repeated(make, refusals):
    arm = make()
    move = moving(arm, "move", SLOW_MOVE, True)
    arm.refused_stops = refusals
    began = arm.now
    stop = arm.begin("stop")
    assert isinstance(stop.error, JakaError) and "call stop_program failed" in str(stop.error)
    arm.run(0.05 * refusals + BRAKES_IN + 0.9)
    assert arm.stops == pytest.approx([began + 0.05 * turn for turn in range(refusals + 1)], abs=1e-6)
    assert move.error.cause in (StopCause.STOPPED, StopCause.TIMEOUT)  # after 1 s: "the stop is not accepted"
    assert at_rest_and_free(arm)


@pytest.mark.parametrize("occasion", ["dark feed", "over time", "after a reconnect", "jog watchdog"])
def test_a_stop_of_the_drivers_own_that_is_refused_is_repeated(make, occasion):
    arm = make(motion_timeout=1.0, jog_timeout=1.0, link_loss_stop=0.0)
    arm.refused_stops = 2
    if occasion == "jog watchdog":
        moving(arm, "jog", JOG)
    else:
        moving(arm, "move", SLOW_MOVE, True)
    if occasion == "dark feed":
        arm.cut(Port.STATUS, 1.5)
    elif occasion == "after a reconnect":
        arm.cut(Port.COMMAND)
    arm.until(lambda: len(arm.stops) >= 3, 2.0)
    assert arm.stops[:3] == pytest.approx([arm.stops[0] + 0.05 * turn for turn in range(3)], abs=1e-6)
    arm.until(lambda: not arm.is_moving, BRAKES_IN)
    arm.until(lambda: arm.core.is_free, 3.0)


def test_slow_replies_are_no_lost_link_and_a_stop_passes_during_the_handshake(make):
    arm = make()
    moving(arm, "move", SLOW_MOVE, True)
    connections = arm.core.links.health().connections
    arm.reply_delay = 0.65
    arm.run(3.0)
    assert arm.core.links.health().connections == connections, "the link was made anew"
    arm.cut(Port.COMMAND)
    cut_at = arm.now
    arm.until(lambda: not arm.is_moving, 1.0)
    assert arm.stops[0] < cut_at + 0.2, "the five questions of the handshake take 3 s"


def test_many_targets_at_once_do_not_run_the_arm_away(make):
    arm = make()
    assert arm.ended(arm.begin("servo_mode", True)) is None
    refused = 0
    for step in range(1, 41):
        try:
            arm.target(c.ServoJoint((0.1 * step,) + HOME[1:]))
        except InvalidCommand:
            refused += 1
        arm.run(0.0005)
    last = arm.now
    assert refused
    arm.run(0.5)
    assert arm.rest_after(last) < last + 0.3
    assert 0.0 < max(abs(joints[0]) for _, joints in arm.frames) < 0.5 and 0.0 < abs(arm.joints[0]) < 0.5


def test_increments_do_not_add_up_beyond_a_joint_limit_on_the_wire(make):
    arm = make()
    assert arm.ended(arm.begin("move", c.JointMove(HOME[:5] + (6.2,), 3.0, 12.0), True)) is None
    assert arm.ended(arm.begin("servo_mode", True)) is None
    refused = 0
    for _ in range(100):
        try:
            arm.target(c.ServoJoint((0.0,) * 5 + (0.004,), relative=True))
        except InvalidCommand:
            refused += 1
        arm.run(0.008)
    assert refused > 50
    assert max(joints[5] for _, joints in arm.frames) <= 2.0 * math.pi + 1e-12


def test_servo_mode_is_not_claimed_while_the_command_port_is_down(make):
    arm = make()
    assert arm.ended(arm.begin("servo_mode", True)) is None
    assert arm.core.links.is_servo_active
    arm.cut(Port.COMMAND, 6.0)
    assert not arm.core.links.is_servo_active
    arm.run(5.0)
    assert not arm.core.links.is_servo_active


def test_the_controller_is_asked_to_watch_its_client_in_custody_only(make):
    arm = make(link_loss_stop=0.25)
    assert arm.ended(arm.begin("move", to(0.2, 1.0), True)) is None
    assert arm.ended(arm.begin("run", arm.core.ask(c.Query.VERSION))) is None
    asked = [(request["cmdName"], request.get("motType"), request.get("timeLimit")) for _, request in arm.sent
             if request["cmdName"] in ("set_network_exception_handle", "joint_move")]
    assert asked == [("set_network_exception_handle", 2, 250.0), ("joint_move", None, None),
                     ("set_network_exception_handle", 0, 0.0)]


def test_a_controller_that_is_not_the_one_meant_is_left_alone(make):
    arm = make(is_ready=False, start=Start.POWERED, simulator="the-one-that-was-launched")
    arm.core.run(None, power.auto_enable(arm.core, arm.core.disturbances - arm.core.link_losses), arm.now)
    calls = [arm.begin("move", SLOW_MOVE, True), arm.begin("jog", JOG), arm.begin("stop"),
             arm.begin("run", power.set_power(arm.core, True))]
    for call in calls:
        assert isinstance(arm.ended(call, 5.0), ConnectionLost)
    arm.run(10.0)
    assert "is not the simulated one" in arm.core.links.health().last_error
    assert not arm.core.is_ready(arm.now) and not arm.shown
    assert {request["cmdName"] for _, request in arm.sent} == {"get_simulator_identity"}


def test_the_simulated_controller_that_was_launched_is_driven(make):
    arm = make(identity="this-one", simulator="this-one")
    assert arm.core.links.about.is_simulated is True
    assert arm.ended(arm.begin("move", to(0.1, 1.0), True)) is None


def test_the_simulated_controller_that_was_launched_is_stopped_and_driven_again_after_a_cut(make):
    arm = make(identity="this-one", simulator="this-one", link_loss_stop=0.0)
    move = moving(arm, "move", SLOW_MOVE, True)
    arm.cut(Port.COMMAND)
    assert arm.ended(move).cause is StopCause.LINK_LOST
    arm.until(lambda: arm.core.is_ready(arm.now) and arm.core.is_free, 5.0)
    assert not arm.is_moving
    assert arm.ended(arm.begin("move", to(0.1, 1.0), True)) is None


def test_an_arm_that_somebody_else_moves_is_not_moved(make):
    arm = make()
    arm.controller.state.plant.add_joint_move((1.0,) + HOME[1:], 0.2)
    arm.run(0.3)
    assert arm.is_moving
    error = arm.ended(arm.begin("move", SLOW_MOVE, True), 5.0)
    assert isinstance(error, InvalidCommand) and "not by this driver" in str(error)
    assert arm.times_of("joint_move") == []
    arm.longest_unowned = 0.0  # it is moved by another
