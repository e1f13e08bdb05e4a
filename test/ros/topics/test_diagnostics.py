"""Diagnostics once a second: each check goes bad with its fault and good again after it; one failing silences none."""
import re

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper
from driver_bench import collecting
from raw_client import RawClient
from waiting import eventually

from jaka_msgs.msg import MotionState
from jaka_ros_driver.ros.topics import diagnostics

OK, WARN, ERROR, STALE = range(4)
CHECKS = {"controller link", "arm", "guard", "status feed", "controller state", "emergency stop", "protective stop",
          "soft limit", "temperature", "servo stream", "velocity jog", "kinematic model", "versions", "custody",
          "audit log"}


@pytest.fixture(scope="module")
def reports(arm):
    with collecting("/diagnostics", DiagnosticArray) as received:
        yield received


@pytest.fixture
def healthy(arm, reports):
    """Return the arm with all checks OK but that it is simulated and has no guard; undo whatever a test does to it."""
    assert eventually(lambda: {name for name, (level, _) in newest(reports).items() if level != OK}
                      == {"arm", "guard"}), newest(reports)
    yield arm
    arm.simulator.operate("clear_faults")
    arm.simulator.operate("release_emergency_stop")
    arm.call("clear_err")
    assert arm.call("power", data=True).success and arm.call("enable", data=True).success


def newest(reports):
    """Return level and message of each check of the last second; what a busy host does to the feed is not judged
    here."""
    for _, array in reversed(reports):
        if len(array.status) == len(CHECKS):
            return {s.name.split(": ", 1)[1]: ((OK if is_of_the_host(s.message) else s.level), s.message)
                    for s in array.status if s.name.startswith("jaka_driver: ")}
    return {}


def is_of_the_host(message):
    slow = re.match(r"slow: ([\d.]+) Hz", message)
    return message.startswith("jitter") or (slow is not None and float(slow.group(1)) > 40.0)


def test_every_check_is_reported_with_the_controller_as_hardware_id(arm, reports, healthy):
    assert set(newest(reports)) == CHECKS
    expected = "simulated 127.0.0.1:%d" % arm.simulator.command_port
    assert all(status.hardware_id == expected for status in reports[-1][1].status)
    values = {value.key: value.value for status in reports[-1][1].status for value in status.values}
    assert {"rate, Hz", "age, ms", "jitter p99, ms", "damaged frames", "reconnects", "late cycles of this stream",
            "driver", "controller", "joint 1, deg C"} <= set(values)
    assert 40.0 < float(values["rate, Hz"]) < 135.0
    assert "1.5.14" in values["controller"]


def test_a_simulated_arm_and_a_missing_guard_are_warnings_that_cannot_be_missed(reports, healthy):
    assert newest(reports)["arm"] == (WARN, "SIMULATED: no real arm moves")
    assert newest(reports)["guard"] == (WARN, "switched off: nothing stops the arm when the driver dies")


def test_it_comes_once_a_second(reports):
    count = len(reports)
    assert eventually(lambda: len(reports) >= count + 4)
    times = [at for at, _ in reports[count:count + 4]]
    assert 2.4 < times[3] - times[0] < 6.0


@pytest.mark.parametrize("action, parameters, levels, undo", [
    ("press_emergency_stop", {}, {"emergency stop": ERROR, "controller state": ERROR}, "release_emergency_stop"),
    ("slow_feed", {"rate": 20.0}, {"status feed": WARN}, "clear_faults"),
    ("stall", {"port": "status", "duration_ms": 6000},
     {"status feed": STALE, "controller state": STALE, "controller link": ERROR}, "clear_faults"),
    ("refuse", {"port": "command", "duration_ms": 4000}, {"controller link": ERROR}, "clear_faults"),
    ("fault", {"kind": "garbage", "port": "status", "count": None, "probability": 0.2}, {"status feed": WARN},
     "clear_faults"),
    ("fields", {"add": {"on_soft_limit": 1}}, {"soft limit": WARN}, "clear_faults"),
    ("fields", {"add": {"protective_stop": 1}}, {"protective stop": ERROR}, "clear_faults"),
    ("fields", {"add": {"errcode": "0xF0001", "errmsg": "a fault"}}, {"controller state": ERROR}, "clear_faults"),
    ("fields", {"add": {"monitor_data": [1, 1, 75.0, 1, 1, [[1, 1, 40.0]] * 6]}}, {"temperature": WARN},
     "clear_faults"),
    ("fields", {"add": {"monitor_data": [1, 1, 40.0, 1, 1, [[1, 1, 90.0]] * 6]}}, {"temperature": ERROR},
     "clear_faults"),
    ("fields", {"add": {"actual_position": [400.0, 100.0, 300.0, 180.0, 0.0, -90.0]}}, {"kinematic model": ERROR},
     "clear_faults"),
])
def test_checks_go_bad_with_their_fault_and_good_again(healthy, reports, action, parameters, levels, undo):
    def are(wanted):
        return eventually(lambda: {name: newest(reports)[name][0] for name in wanted} == wanted)
    operate = healthy.simulator.operate
    operate(action, **parameters)
    if action == "refuse":
        operate("close", port="command")
    assert are(levels), newest(reports)
    operate(undo)
    if undo == "release_emergency_stop":
        healthy.call("clear_err")
        assert healthy.call("power", data=True).success and healthy.call("enable", data=True).success
    assert are(dict.fromkeys(levels, OK)), newest(reports)


def test_an_arm_that_is_not_enabled_is_a_warning_that_tells_what_to_do(healthy, reports):
    assert healthy.call("enable", data=False).success
    assert eventually(lambda: newest(reports)["controller state"] == (WARN, "cannot move; to do: enable"))


def test_a_failing_check_says_so_and_stops_at_that(caplog):
    def broken(status):
        raise KeyError("nothing there")
    status = diagnostics._guarded("broken", broken)(DiagnosticStatusWrapper())
    assert status.level == DiagnosticStatus.ERROR and "nothing there" in status.message


def test_an_arm_that_moves_in_nobodys_custody_is_reported_until_it_rests(reports, healthy):
    arm = healthy
    assert newest(reports)["custody"] == (OK, "nobody moves the arm")
    with collecting(arm.name + "/motion_state", MotionState) as told:
        with RawClient(arm.simulator.command_port) as client:
            client.ask("jog", jog_mode=1, coord_map=1, jnum=0, jogvel=3.0)
        assert eventually(lambda: newest(reports)["custody"][0] == WARN)
        assert "nobody's custody" in newest(reports)["custody"][1]
        assert [message.state for _, message in told] == [MotionState.FOREIGN]
        assert eventually(lambda: newest(reports)["controller link"][0] == OK)
        arm.call("stop_move")
        assert eventually(lambda: newest(reports)["custody"] == (OK, "nobody moves the arm"))
        assert [(message.state, message.id) for _, message in told] == [
            (MotionState.FOREIGN, ""), (MotionState.FOREIGN_ENDED, "")]
