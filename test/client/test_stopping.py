"""The guard's stopping of an arm, step by step: its next step after each event."""
import pytest

from jaka_ros_driver.client.stopping import DriverCondition, Step, Stopping
from jaka_ros_driver.commands import JogFrame, JogStop
from jaka_ros_driver.errors import FramingError
from jaka_ros_driver.protocol.framing import ObjectStream
from jaka_ros_driver.state import RobotState

PERIOD = 0.008
STILL_FOR_S, LOCKED_OUT_AFTER_S, GIVE_UP_AFTER_S = 0.8, 0.25, 60.0
"""The figures in docs/safety.md."""
REFUSED = "command port: connection refused"


class Story:
    """A stop and its clock."""

    def __init__(self):
        self.now = 100.0
        self.said = []
        self.stopping = Stopping(self.now, self.said.append)
        self.joint = 0.0

    def step(self, driver=DriverCondition.DEAD):
        return self.stopping.step(self.now, driver)

    def until(self, step, driver=DriverCondition.DEAD, timeout=100.0, speed=None, **flags):
        """Let time pass, with a frame of an arm of this speed every 8 ms, until this is the next step; return the
        seconds."""
        began = self.now
        while self.now < began + timeout:
            if self.step(driver) is step:
                return self.now - began
            self.now += PERIOD
            if speed is not None:
                self.frame(speed * PERIOD, **flags)
        raise AssertionError("%s did not come; said: %s" % (step, self.said))

    def frame(self, change=0.0, is_on=True):
        self.joint += change
        self.stopping.saw(RobotState((self.joint,) + (0.0,) * 5, is_on, is_on, True, False, False, self.now), self.now)

    def connect(self):
        self.until(Step.CONNECT)
        self.stopping.connected()

    def send(self):
        assert self.step() is Step.SEND
        return [request["cmdName"] for request in ObjectStream().feed(self.stopping.request(self.now))]

    def reply(self, name="stop_program", code="0"):
        self.stopping.replied({"cmdName": name, "errorCode": code, "errorMsg": ""}, self.now)

    def turn_away(self):
        self.stopping.failed(REFUSED, True, self.now)


@pytest.fixture
def story():
    return Story()


def test_it_leaves_servo_mode_and_stops_and_waits_for_the_stops_reply_only(story):
    story.connect()
    assert story.send() == ["servo_move", "stop_program"] + ["jog"] * 6
    story.reply("servo_move", "2")
    story.reply("jog", "2")
    assert story.step() is Step.WAIT
    story.reply()
    assert story.until(Step.FINISH, speed=0.0) == pytest.approx(STILL_FOR_S, abs=2.1 * PERIOD)
    assert story.said[-1] == "the arm is at rest"


def test_it_ends_the_jog_that_the_driver_began_and_every_one_where_the_arm_moves_on(story):
    story.stopping = Stopping(story.now, story.said.append, JogStop(JogFrame.TOOL, 4))
    story.connect()
    story.until(Step.SEND)
    jogs = []
    for _ in range(2):
        jogs.append([(request["coord_map"], request["jnum"]) for request in ObjectStream().feed(
            story.stopping.request(story.now)) if request["cmdName"] == "jog"])
        story.reply()
        story.until(Step.SEND, speed=1.0)
    assert jogs[0] == [(2, 4)]
    assert sorted(jogs[1]) == [(frame, axis) for frame in range(3) for axis in range(6)]


def test_stillness_before_the_stop_was_accepted_is_no_evidence(story):
    # A move may be accepted and not have begun.
    for _ in range(50):
        story.now += PERIOD
        story.frame()
    story.connect()
    story.send()
    story.reply()
    assert story.step() is Step.WAIT
    assert story.until(Step.FINISH, speed=0.0) > 0.9 * STILL_FOR_S


def test_a_slow_arm_is_not_at_rest(story):
    story.connect()
    story.send()
    story.reply()
    for _ in range(5):
        assert story.until(Step.SEND, speed=0.01) == pytest.approx(0.5, abs=2 * PERIOD)
        story.send()
        story.reply()
    assert story.until(Step.FINISH, speed=0.0) < 2 * STILL_FOR_S


@pytest.mark.parametrize("speed", [0.00035, 0.0005, 0.0006, 0.001, 0.0015, 0.002])
def test_an_arm_that_creeps_on_after_an_accepted_stop_is_stopped_again_and_never_at_rest(story, speed):
    story.connect()
    story.send()
    story.reply()
    for _ in range(10):
        assert 0.4 < story.until(Step.SEND, speed=speed) < 1.4
        story.send()
        story.reply()
    assert not story.stopping.has_seen_rest


def test_it_gives_up_after_a_minute_of_an_arm_that_moves_on(story):
    story.connect()
    began, stops = story.now, 0
    while story.step() is not Step.FINISH:
        assert story.now - began < 2.0 * GIVE_UP_AFTER_S
        if story.step() is Step.SEND:
            story.send()
            story.reply()
            stops += 1
        story.now += PERIOD
        story.frame(1.0 * PERIOD)
    assert story.now - began == pytest.approx(GIVE_UP_AFTER_S, abs=0.1) and stops > 100
    assert "was not seen at rest" in story.said[-1] and len(story.said) < 6


def test_refused_stops_are_repeated_ten_times_a_second_or_more(story):
    story.connect()
    for _ in range(20):
        story.send()
        story.reply(code="2")
        assert 0.05 <= story.until(Step.SEND, speed=1.0) <= 0.1
    assert len(story.said) == 1 and "code 2" in story.said[0]


def test_an_arm_without_drives_is_at_rest_though_the_controller_refuses_stops(story):
    story.connect()
    story.send()
    story.reply(code="2")
    assert story.until(Step.FINISH, speed=0.0, is_on=False) < 2 * STILL_FOR_S
    assert "its drives are off" in story.said[-1]


def test_an_unreadable_reply_is_no_acceptance(story):
    story.connect()
    story.send()
    story.stopping.replied(FramingError("bytes"), story.now)
    assert 0.0 < story.until(Step.SEND) <= 0.1


def test_without_a_feed_three_accepted_stops_must_do(story):
    story.connect()
    story.stopping.saw_nothing("status port: connection refused")
    for number in range(3):
        assert story.until(Step.SEND) == pytest.approx(0.5 if number else 0.0, abs=2 * PERIOD)
        story.send()
        story.reply()
    assert story.step() is Step.FINISH
    assert "could not be seen: status port: connection refused" in story.said[-1]


def test_a_feed_that_ends_while_the_arm_moves_is_no_evidence_of_rest(story):
    story.connect()
    story.send()
    story.reply()
    story.until(Step.SEND, speed=1.0)
    for _ in range(2):
        story.until(Step.SEND)
        story.send()
        story.reply()
    story.until(Step.FINISH)
    assert "could not be seen" in story.said[-1]


def test_a_reply_that_never_comes_ends_the_connection(story):
    story.connect()
    story.send()
    assert story.until(Step.HANG_UP) == pytest.approx(1.0, abs=2 * PERIOD)
    assert story.until(Step.CONNECT) < 0.1


def test_a_connection_that_is_neither_made_nor_refused_is_tried_anew_and_the_driver_let_live(story):
    story.until(Step.CONNECT, DriverCondition.SILENT)
    for _ in range(5):
        assert story.until(Step.HANG_UP, DriverCondition.SILENT) == pytest.approx(1.0, abs=2 * PERIOD)
        assert story.until(Step.CONNECT, DriverCondition.SILENT) < 0.1


def test_a_frozen_driver_is_ended_after_a_quarter_of_a_second_of_being_turned_away(story):
    began, step = story.now, Step.WAIT
    while step is not Step.END_DRIVER and story.now < began + 1.0:
        step = story.step(DriverCondition.SILENT)
        if step is Step.CONNECT:
            story.turn_away()
        story.now += PERIOD
    assert story.now - began == pytest.approx(LOCKED_OUT_AFTER_S, abs=0.1)
    ended_at = story.now - PERIOD
    story.until(Step.CONNECT, DriverCondition.SILENT)
    assert 0.02 <= story.now - ended_at < 0.05, "the system takes a moment to close its connection"


def test_a_frozen_driver_is_ended_where_the_controller_takes_the_connection_and_never_replies(story):
    story.connect()
    story.send()
    story.until(Step.HANG_UP, DriverCondition.SILENT)
    assert story.until(Step.END_DRIVER, DriverCondition.SILENT) < 0.1


def test_a_frozen_driver_is_let_live_where_the_guard_was_served_before(story):
    for _ in range(5):
        story.connect()
        story.send()
        story.reply("servo_move")
        story.now += 0.2
        story.turn_away()
    story.until(Step.CONNECT, DriverCondition.SILENT)


@pytest.mark.parametrize("driver", [DriverCondition.DEAD, DriverCondition.BACK])
def test_a_driver_that_is_dead_or_back_is_never_ended(story, driver):
    while story.now < 110.0:
        step = story.step(driver)
        assert step is not Step.END_DRIVER
        if step is Step.CONNECT:
            story.turn_away()
        story.now += PERIOD


def test_a_driver_that_is_back_gets_the_command_port_and_the_guard_finishes_what_it_has_begun(story):
    story.connect()
    assert story.step(DriverCondition.BACK) is Step.SEND
    story.send()
    story.reply(code="2")
    story.until(Step.SEND, DriverCondition.BACK, speed=1.0)
    story.send()
    story.turn_away()  # the driver has connected
    story.until(Step.FINISH, DriverCondition.BACK, speed=1.0)
    assert "the driver is back" in story.said[-1]


def test_a_connection_lost_after_the_stop_is_not_made_anew_while_the_arm_comes_to_rest(story):
    story.connect()
    story.send()
    story.reply()
    story.turn_away()
    story.until(Step.FINISH, DriverCondition.BACK, timeout=0.4, speed=0.0)
    assert story.said[-1] == "the arm is at rest"


def test_an_arm_that_looks_still_is_left_to_a_driver_that_is_back_sooner_than_to_nobody(story):
    story.connect()
    story.send()
    story.reply()
    assert story.until(Step.FINISH, DriverCondition.BACK, speed=0.0) == pytest.approx(0.12, abs=2.1 * PERIOD)


def test_an_arm_that_was_last_seen_half_a_second_ago_is_not_seen(story):
    story.connect()
    for _ in range(3):
        story.until(Step.SEND, speed=1.0)
        story.send()
        story.reply()
    assert story.until(Step.FINISH) == pytest.approx(0.5, abs=3 * PERIOD)
    assert "could not be seen" in story.said[-1]
