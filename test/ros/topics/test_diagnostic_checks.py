"""Each check of the diagnostics, with an arm that the test plays: level and words, without a ROS master."""
import dataclasses
from types import SimpleNamespace

import pytest
import rospkg
from diagnostic_updater import DiagnosticStatusWrapper

from jaka_ros_driver.audit.chain import ChainLink
from jaka_ros_driver.audit.log import Health
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.velocity_jog.motion import JogReport
from jaka_ros_driver.commands import SetPayload
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.ros.controller_profile import ControllerProfile
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics import diagnostics
from jaka_ros_driver.ros.topics.diagnostic_states import NO_STATES, NOTHING, STATES, state_of
from jaka_ros_driver.state import RobotState

OK, WARN, ERROR, STALE = range(4)
CHECKS = {"controller link", "arm", "guard", "status feed", "controller state", "emergency stop", "protective stop",
          "soft limit", "temperature", "servo stream", "velocity jog", "kinematic model", "versions", "custody",
          "audit log"}
STATE = RobotState((0.0,) * 6, True, True, True, False, False)


def with_(**fields):
    return dataclasses.replace(STATE, **fields)


class Updater:
    """A keeper of the checks."""

    def __init__(self):
        self.tasks, self.hardware = {}, None

    def add(self, name, task):
        self.tasks[name] = task

    def setHardwareID(self, name):
        self.hardware = name


class Bench:
    """The checks of an arm in good order, of which a test changes what it likes."""

    def __init__(self, monkeypatch):
        self.updater = Updater()
        monkeypatch.setattr(diagnostics, "Updater", lambda: self.updater)
        self.state = STATE
        self.guard = SimpleNamespace(is_alive=True, last_trouble="", replacements=0)
        self.deviation = SimpleNamespace(is_wrong=False, distance=1e-5, angle=1e-4)
        self.audit = Health("", 0, 0, 7, ChainLink(7, "ab"))
        self.arm = SimpleNamespace(
            fresh_state=self.fresh_state, state=STATE, is_simulated=False, is_servo_active=False, late_servo_cycles=0,
            is_stream_moving=None, motion_owner=None, foreign_motion="", velocity_jog=JogReport("", "", ""),
            model=load_model("zu7"),
            guard=SimpleNamespace(health=lambda: self.guard),
            link_health=SimpleNamespace(command_is_up=True, status_is_up=True, connections=1, last_error="",
                                        damaged_replies=0, version="1.5", feed_period=0.008),
            feed_health=SimpleNamespace(rate=125.0, age=0.004, jitter=0.001, frames=100, damaged=0, last_damage=""))
        self.frames = SimpleNamespace(payload=SetPayload(1.25, (0.0, -0.01, 0.05)), collision_level=4)
        self.checks = diagnostics.Diagnostics(self.arm, DriverConfig(), self.frames, SimpleNamespace(
            check=lambda state: self.deviation), SimpleNamespace(path="/audit", health=lambda: self.audit))

    def fresh_state(self):
        if self.state is None:
            raise ConnectionLost("silent")
        return self.state

    def look(self, name):
        """Return level, words and values of a check."""
        status = self.updater.tasks[name](DiagnosticStatusWrapper())
        level = int(status.level if isinstance(status.level, int) else ord(status.level))
        values = {value.key: value.value for value in status.values}
        assert values.pop("meaning") and values.pop("remedy") != (NOTHING if level != OK else ""), status.message
        return level, status.message, values

    def level(self, name):
        return self.look(name)[:2]


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


def test_an_arm_in_good_order_has_no_complaint(bench):
    assert {bench.level(name)[0] for name in bench.updater.tasks} == {OK} and len(bench.updater.tasks) >= 13


@pytest.mark.parametrize("is_simulated, level, words", [
    (None, OK, "not known yet"), (True, WARN, "SIMULATED"), (False, OK, "real")])
def test_real_and_simulated_arms_are_told_apart(bench, is_simulated, level, words):
    bench.arm.is_simulated = is_simulated
    found = bench.level("arm")
    assert found[0] == level and found[1].startswith(words)


def test_load_and_collision_level_are_told_where_they_are_known(bench):
    values = bench.look("controller state")[2]
    assert (values["payload"], values["collision level"]) == ("1.25 kg at 0, -0.01, 0.05 m", "4")
    bench.frames.payload = bench.frames.collision_level = None
    values = bench.look("controller state")[2]
    assert values["payload"] == values["collision level"] == "unknown"


@pytest.mark.parametrize("is_simulated, kind", [(None, ""), (True, "simulated "), (False, "controller ")])
def test_the_hardware_says_which_it_is(bench, is_simulated, kind):
    bench.checks._name_hardware(is_simulated)
    assert bench.updater.hardware == kind + "127.0.0.1:10001"


def test_a_link_that_is_down_names_its_error_and_a_new_one_is_told_once(bench):
    assert bench.level("controller link") == (OK, "up"), "the first connection is no news"
    bench.arm.link_health.connections = 3
    assert bench.level("controller link") == (WARN, "connected anew")
    level, _, values = bench.look("controller link")
    assert level == OK and values["reconnects"] == "2"
    for port, other in (("command", "status"), ("status", "command")):
        setattr(bench.arm.link_health, port + "_is_up", False)
        bench.arm.link_health.last_error = "cut"
        level, words, values = bench.look("controller link")
        assert (level, words) == (ERROR, "down: cut")
        assert values[port + " port"].endswith("down") and values[other + " port"].endswith("up")
        setattr(bench.arm.link_health, port + "_is_up", True)


@pytest.mark.parametrize("age, expected", [
    (float("inf"), (ERROR, NO_STATES)), (0.6, (ERROR, NO_STATES)), (0.1, (OK, "up"))])
def test_a_link_over_which_no_states_come_is_not_shown_as_up(bench, age, expected):
    bench.arm.feed_health.age = age
    assert bench.level("controller link") == expected


def test_each_state_of_the_table_is_of_a_check_and_can_be_found():
    assert {state.check for state in STATES} <= CHECKS | {""}
    for state in STATES:
        assert state_of(state.check or "versions", state.level, "5" + state.words) == state


def test_without_a_connection_yet_there_are_no_reconnects(bench):
    bench.arm.link_health.connections = 0
    assert bench.look("controller link")[2]["reconnects"] == "0"


def test_the_guard_is_missed_when_it_is_off_silent_or_replaced(bench):
    assert bench.level("guard") == (OK, "watches")
    bench.guard.is_alive = False
    assert bench.level("guard") == (ERROR, "does not answer: it is being started")
    bench.guard.last_trouble = "killed"
    assert bench.level("guard") == (ERROR, "does not answer: killed")
    bench.guard.is_alive, bench.guard.replacements = True, 1
    assert bench.level("guard") == (WARN, "was replaced: killed")
    assert bench.level("guard") == (OK, "watches")
    bench.arm.guard = None
    assert bench.level("guard")[0] == WARN and "switched off" in bench.level("guard")[1]


@pytest.mark.parametrize("fields, level, words", [
    ({}, OK, "125.0 Hz"), ({"age": 0.6}, STALE, "no fresh state"), ({"age": 0.6, "frames": 0}, STALE, "no state yet"),
    ({"age": 0.4}, OK, "125.0 Hz"), ({"rate": 110.0}, WARN, "slow: 110.0 Hz"), ({"rate": 120.0}, OK, "120.0 Hz"),
    ({"jitter": 0.005}, WARN, "jitter 5.0 ms"), ({"jitter": 0.003}, OK, "125.0 Hz"),
    ({"damaged": 2}, WARN, "2 damaged frames in the last second")])
def test_the_feed(bench, fields, level, words):
    vars(bench.arm.feed_health).update(fields)
    assert bench.level("status feed") == (level, words)


def test_damage_is_told_in_the_second_in_which_it_came(bench):
    bench.arm.feed_health.damaged = 2
    assert bench.level("status feed")[0] == WARN and bench.level("status feed")[0] == OK
    bench.arm.feed_health.damaged = 3
    assert bench.level("status feed") == (WARN, "1 damaged frames in the last second")


def test_whose_velocity_is_published_is_told(bench):
    assert bench.look("status feed")[2]["joint velocity"] == "filtered difference"
    bench.arm.state = with_(joint_velocity=(0.0,) * 6)
    assert bench.look("status feed")[2]["joint velocity"] == "the controller's"
    bench.arm.state = None
    assert "joint velocity" not in bench.look("status feed")[2]


@pytest.mark.parametrize("fields, level, words", [
    ({}, OK, None), ({"error_code": 0xF0034, "error_message": "hit"}, ERROR, "event 0xF0034 hit"),
    ({"is_powered": False, "is_enabled": False}, WARN, "cannot move; to do: power, enable"),
    ({"emergency_stop": True}, WARN, "cannot move; to do: release the emergency stop")])
def test_the_controllers_state(bench, fields, level, words):
    bench.state = with_(**fields)
    found = bench.level("controller state")
    assert found[0] == level and (words is None or found[1] == words)


def test_who_moves_the_arm_is_told(bench):
    assert bench.look("controller state")[2]["motion owner"] == "nobody"
    bench.arm.motion_owner = MotionOwner.JOG
    assert bench.look("controller state")[2]["motion owner"] == "a jog"


@pytest.mark.parametrize("check, field, level", [
    ("emergency stop", "emergency_stop", ERROR), ("protective stop", "protective_stop", ERROR),
    ("soft limit", "on_soft_limit", WARN)])
def test_flags(bench, check, field, level):
    assert bench.level(check)[0] == OK
    bench.state = with_(**{field: True})
    assert bench.level(check)[0] == level
    bench.state = None
    assert bench.level(check) == (STALE, "no fresh state")


@pytest.mark.parametrize("joints, cabinet, level, words", [
    (None, None, OK, "not reported"), ((40.0,) * 6, None, OK, "hottest 40.0"), (None, 75.0, WARN, "hottest 75"),
    ((40.0,) * 5 + (71.0,), 30.0, WARN, "hottest 71"), ((81.0,) + (40.0,) * 5, None, ERROR, "hottest 81"),
    ((69.0,) * 6, None, OK, "hottest 69"), ((79.0,) * 6, None, WARN, "hottest 79")])
def test_temperatures(bench, joints, cabinet, level, words):
    bench.state = with_(joint_temperature=joints, cabinet_temperature=cabinet)
    found, message, values = bench.look("temperature")
    assert found == level and message.startswith(words)
    assert ("cabinet, deg C" in values) is (cabinet is not None)
    assert [values.get("joint %d, deg C" % n) for n in (1, 6)] == (
        [None, None] if joints is None else ["%.1f" % joints[0], "%.1f" % joints[5]])


def test_late_cycles_are_those_of_the_last_second(bench):
    assert bench.level("servo stream") == (OK, "not in servo mode")
    bench.arm.is_servo_active = True
    assert bench.level("servo stream") == (OK, "on time")
    bench.arm.late_servo_cycles = 3
    assert bench.level("servo stream") == (WARN, "3 cycles too late in the last second")
    assert bench.level("servo stream") == (OK, "on time")
    bench.arm.late_servo_cycles = 1
    assert bench.level("servo stream") == (OK, "on time"), "another stream counts anew"
    bench.arm.late_servo_cycles = 2
    assert bench.level("servo stream") == (WARN, "1 cycles too late in the last second")


def test_who_holds_a_velocity_jog(bench):
    assert bench.level("velocity jog") == (OK, "not held")
    bench.arm.velocity_jog = JogReport("/pad", "silence", "joint 4 is at its limit")
    level, words, values = bench.look("velocity jog")
    assert (level, words, values["last end"]) == (OK, "held by /pad", "silence")
    assert values["stands at"] == "joint 4 is at its limit"


def test_the_model(bench):
    level, words, values = bench.look("kinematic model")
    assert level == OK and "agrees" in words
    assert (values["distance, mm"], values["angle, mrad"]) == ("0.0100", "0.1000")
    bench.deviation.is_wrong = True
    assert bench.level("kinematic model")[0] == ERROR
    bench.deviation = None
    level, words, values = bench.look("kinematic model")
    assert level == OK and "not compared" in words and not values


def test_versions(bench):
    values = bench.look("versions")[2]
    assert values["controller"] == "1.5" and values["status period, ms"] == "8" and values["model"] == "zu7"
    bench.arm.link_health.version, bench.arm.link_health.feed_period = "", None
    values = bench.look("versions")[2]
    assert values["controller"] == "unknown" and values["status period, ms"] == "unknown"


def test_what_of_the_controller_is_known_and_what_is_assumed(bench):
    values = bench.look("versions")[2]
    assert values["first terminal"] == "0, assumed, by its version" and "controller profile" not in values
    assert "assumed" in values["loss of the link"] and values["period of the feed"] == "known: told by the controller"
    profile = ControllerProfile("probe.json", "1.5", 1, stop_ends_jog=True)
    bench.checks._config = DriverConfig(controller_profile=profile)
    values = bench.look("versions")[2]
    assert values["first terminal"] == "1, seen on this controller" and "seen" in values["stop of a jog"]
    assert values["controller profile"] == "probe.json, of version 1.5"
    bench.arm.link_health.version = "1.7"
    assert "which is not this controller's" in bench.look("versions")[2]["controller profile"]


def test_a_check_that_fails_says_so_and_no_more(bench):
    del bench.arm.velocity_jog
    level, words, _ = bench.look("velocity jog")
    assert level == ERROR and "this check failed" in words
    assert bench.level("arm")[0] == OK


@pytest.mark.parametrize("owner, foreign, level, words", [
    (None, "", OK, "nobody moves the arm"), (MotionOwner.JOG, "", OK, "a jog"),
    (None, "the arm moves", WARN, "the arm moves"), (MotionOwner.JOG, "the arm moves", WARN, "the arm moves")])
def test_whose_custody_the_arm_is_in(bench, owner, foreign, level, words):
    bench.arm.motion_owner, bench.arm.foreign_motion = owner, foreign
    name = next(name for name in bench.updater.tasks if "custody" in name)
    assert bench.level(name) == (level, words)


def test_an_audit_log_that_cannot_be_written_or_that_lost_lines_is_a_warning(bench):
    level, words, values = bench.look("audit log")
    assert (level, words, values["last line"], values["its sha256"]) == (OK, "written", "7", "ab")
    bench.audit = bench.audit._replace(trouble="no space", waiting=3)
    assert bench.level("audit log") == (WARN, "cannot be written: no space")
    bench.audit = bench.audit._replace(trouble="", lost=5)
    assert bench.level("audit log") == (WARN, "5 lines were lost")
    assert bench.level("audit log") == (OK, "written")  # like other losses, reported once and kept in the values
    assert bench.look("audit log")[2]["lost lines"] == "5"


def test_an_audit_log_that_is_switched_off_is_a_warning(bench):
    bench.checks._audit = None
    assert bench.level("audit log") == (WARN, "switched off: nobody records who does what")


def test_a_driver_of_which_ros_has_no_package_reports_an_unknown_version(monkeypatch):
    def no_package(name):
        raise rospkg.ResourceNotFound(name)
    monkeypatch.setattr(diagnostics.rospkg, "RosPack", lambda: SimpleNamespace(get_manifest=no_package))
    assert Bench(monkeypatch).level("versions") == (OK, "driver unknown, controller 1.5")
