"""The driver's figures for Prometheus: of a real driver, over HTTP, read with Prometheus's own parser."""
import contextlib
import math
import os
import re
import socket
import threading
import urllib.request
from unittest import mock

import pytest
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, begin_move, on
from waiting import eventually, free_ports

from jaka_ros_driver.client.core.actions import NotifyGuard
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.errors import ConnectionLost
from jaka_ros_driver.ros.exit_codes import COMPUTER, CONFIGURATION
from jaka_ros_driver.ros.metrics import figures
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.state import RobotState

parser = pytest.importorskip("prometheus_client.parser")
NAME = "measured"


class Measured:
    """A driver with a page for Prometheus, and its simulated controller."""

    def __init__(self, simulator, port):
        self.arm, self.port = Arm(simulator, "/" + NAME), port

    def families(self):
        """Return all families of the page by name."""
        with urllib.request.urlopen("http://127.0.0.1:%d/metrics" % self.port, timeout=20.0) as answer:
            assert answer.headers["Content-Type"].startswith("text/plain")
            text = answer.read().decode()
        return {family.name: family for family in parser.text_string_to_metric_families(text)}

    def figures(self):
        """Return all figures: by name, those with labels by name and values of these."""
        return {(sample.name, *sample.labels.values()) if sample.labels else sample.name: sample.value
                for family in self.families().values() for sample in family.samples}


@pytest.fixture(scope="module")
def measured(ros_node):
    port, = free_ports(1)
    with contextlib.closing(SimulatorProcess("--start", "enabled")) as simulator, \
            DriverProcess(NAME, metrics_port=port, **on(simulator, guard=False)):
        measured = Measured(simulator, port)
        measured.arm.wait_until_ready()
        yield measured


def test_names_and_units_are_those_that_prometheus_wants(measured):
    families = measured.families()
    own = {name: family for name, family in families.items() if name.startswith("jaka_")}
    assert len(own) > 25 and set(families) - set(own) <= {name for name in families if name.startswith("process_")}
    for name, family in own.items():
        assert re.match(r"jaka_[a-z]+(_[a-z]+)*\Z", name) and family.documentation.endswith("."), name
        assert not re.search(r"_(ms|milliseconds|percent|deg|hz|count|total)\b", name), name
        samples = {sample.name for sample in family.samples}
        assert (family.type == "counter") is any(sample.endswith("_total") for sample in samples), name


def test_the_figures_are_those_of_the_feed_and_of_the_link(measured):
    assert eventually(lambda: measured.figures()["jaka_feed_frames_total"] > 40)
    figures = measured.figures()
    assert figures[("jaka_link_up", "command")] == figures[("jaka_link_up", "status")] == 1.0
    assert 0.0 <= figures["jaka_feed_jitter_seconds"] < 1.0 and figures["jaka_state_age_seconds"] < 5.0
    assert figures["jaka_feed_rate_hertz"] > 10.0 and figures[("jaka_motion_owner", "nobody")] == 1.0
    assert sum(value for key, value in figures.items() if key[0] == "jaka_motion_owner") == 1.0
    assert {key[1] for key in figures if key[0] == "jaka_motions_total"} == {
        owner.name.lower() for owner in MotionOwner}
    assert figures["jaka_speed_override_ratio"] == 1.0
    assert figures["jaka_audit_lost_lines_total"] == 0 and figures["jaka_audit_lag_seconds"] < 30.0
    assert "jaka_guard_up" not in figures, "there is none"
    info, = (sample for family in measured.families().values() for sample in family.samples
             if sample.name == "jaka_driver_info")
    assert info.labels["model"] == "zu7" and "1.5.14" in info.labels["controller"]


def test_motions_stops_and_alarms_are_counted_and_a_hostile_client_delays_no_stop(measured):
    arm, before = measured.arm, measured.figures()
    assert eventually(lambda: arm.call("joint_move", pose=HOME, mvvelo=3.0, mvacc=12.0).ret == 1)
    with contextlib.ExitStack() as stack:
        over = stack.enter_context(flooding(measured.port))
        moving = begin_move(arm)
        assert eventually(arm.simulator.is_moving)
        arm.call("stop_move")
        assert eventually(lambda: not arm.simulator.is_moving())
        moving.wait()
        assert moving.result.ret == 0
        over.set()
    arm.simulator.operate("press_emergency_stop")
    assert eventually(lambda: measured.figures()[("jaka_alarm", "emergency_stop")] == 1.0)
    arm.simulator.operate("release_emergency_stop")
    after = measured.figures()

    def more(*name):
        key = name if len(name) > 1 else name[0]
        return after[key] - before[key]
    assert more("jaka_motions_total", "move") >= 1
    assert more("jaka_stop_latency_seconds_count") == 1 and more("jaka_stop_failures_total") == 0
    assert more("jaka_stop_latency_seconds_sum") < 0.5
    assert more("jaka_alarms_total", "emergency_stop") == 1


@contextlib.contextmanager
def flooding(port):
    """Have four threads ask without a pause, and twenty connections say nothing; yield the event that ends them."""
    over = threading.Event()

    def flood():
        while not over.is_set():
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0) as client:
                client.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
                client.recv(100)
    threads = [threading.Thread(target=flood) for _ in range(4)]
    for thread in threads:
        thread.start()
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            with contextlib.suppress(OSError):
                stack.enter_context(socket.create_connection(("127.0.0.1", port), 0.5))
        try:
            yield over
        finally:
            over.set()
            for thread in threads:
                thread.join()


def test_a_lost_link_is_counted_and_no_old_state_is_shown(measured):
    before = measured.figures()
    measured.arm.simulator.operate("stall", port="status", duration_ms=3000)

    def is_stale():
        figures = measured.figures()
        return figures["jaka_state_fresh"] == 0.0 and "jaka_powered" not in figures and figures
    stale = eventually(is_stale)
    assert stale and stale["jaka_state_age_seconds"] > 0.1
    assert eventually(lambda: measured.figures()["jaka_state_fresh"] == 1.0)
    lost = measured.figures()[("jaka_link_losses_total", "status")] - before[("jaka_link_losses_total", "status")]
    assert lost >= 1


def test_before_the_first_state_its_age_is_infinite(ros_node):
    port, dead = free_ports(2)
    with DriverProcess("unlinked", ip="127.0.0.1", command_port=dead, status_port=dead + 1, guard=False,
                       metrics_port=port):
        def figures():
            with contextlib.suppress(OSError):
                return Measured(None, port).figures()
            return None
        found = eventually(figures)
        assert found["jaka_state_age_seconds"] == math.inf and found["jaka_state_fresh"] == 0.0
        assert found[("jaka_link_up", "command")] == 0.0 and found[("jaka_link_losses_total", "command")] == 0.0
        with DriverProcess("rival", ip="127.0.0.1", command_port=dead + 2, status_port=dead + 1, guard=False,
                           metrics_port=port) as rival:
            code, said = rival.wait()
        assert code == COMPUTER and "cannot be served at 127.0.0.1:%d: Address already in use" % port in said


def test_without_the_library_a_driver_says_what_to_install(ros_node, tmp_path):
    (tmp_path / "prometheus_client.py").write_text(
        "raise ModuleNotFoundError('No module named prometheus_client', name='prometheus_client')\n")
    with contextlib.closing(SimulatorProcess()) as simulator, \
            DriverProcess("bare", {"PYTHONPATH": "%s:%s" % (tmp_path, os.environ["PYTHONPATH"])},
                          metrics_port=9100, **on(simulator, guard=False)) as driver:
        code, said = driver.wait()
    assert code == CONFIGURATION and "apt install python3-prometheus-client" in said and "Traceback" not in said, said


@pytest.mark.parametrize("owner", [None, *MotionOwner])
def test_one_alone_holds_the_motion(owner):
    arm = mock.MagicMock(motion_owner=owner)
    found = {family.name: family for family in figures.Figures(arm, DriverConfig(), None, "1.0.0").collect()}
    samples = found["jaka_motion_owner"].samples
    assert [sample.labels["owner"] for sample in samples if sample.value == 1.0] == [
        owner.name.lower() if owner else "nobody"]
    assert sum(sample.value for sample in samples) == 1.0


def test_temperatures_are_told_by_the_number_of_the_joint():
    state = RobotState(HOME, True, True, False, False, False, received_at=1.0,
                       joint_temperature=(31.0, 32.0, 33.0, 34.0, 35.0, 36.0), cabinet_temperature=40.0)
    found = {family.name: family for family in figures._of_state(state)}["jaka_temperature_celsius"].samples
    assert {sample.labels["part"]: sample.value for sample in found} == {
        **{"joint_%d" % number: 30.0 + number for number in range(1, 7)}, "cabinet": 40.0}


def test_of_a_controller_without_temperatures_there_is_no_such_figure():
    state = RobotState(HOME, True, True, False, False, False, received_at=1.0)
    assert "jaka_temperature_celsius" not in {family.name for family in figures._of_state(state)}


def test_a_motion_is_counted_once_by_its_kind_when_it_begins():
    arm = mock.MagicMock(fresh_state=mock.Mock(side_effect=ConnectionLost("none")), guard=None)
    counted = figures.Figures(arm, DriverConfig(), None, "1.0")
    counted.start()
    notify, = arm.add_custody_listener.call_args[0]
    for owner in (MotionOwner.JOG, MotionOwner.MOVE, MotionOwner.MOVE):
        notify(NotifyGuard(True, owner.value))
        notify(NotifyGuard(False))
    notify(NotifyGuard(True, "a motion of another kind"))
    family, = (family for family in counted.collect() if family.name == "jaka_motions")
    assert {sample.labels["kind"]: sample.value for sample in family.samples if sample.value} == {"jog": 1, "move": 2}
