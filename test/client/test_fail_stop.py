"""Fail-stop: a defect in the core stops the arm before the driver ends, and leaves its evidence in a file."""
import math
from pathlib import Path

import pytest
from waiting import InBackground, eventually

from jaka_ros_driver import commands as c
from jaka_ros_driver.client import fail_stop
from jaka_ros_driver.client.core.move import Move
from jaka_ros_driver.errors import CommandRejected, ConnectionLost

FAR = c.JointMove((2.0,) + tuple(math.radians(q) for q in (90, -90, 90, 90, 0)), 0.5, 2.0)


@pytest.fixture
def evidence(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    return lambda: list(tmp_path.glob("jaka_driver_failure_*.txt"))


def raising(error):
    def fail(*args, **kwargs):
        raise error
    return fail


@pytest.mark.parametrize("defect", [KeyError("planted"), CommandRejected("get_version", 2, "escaped")],
                         ids=["a bug", "an error that escapes an event"])
def test_a_defect_in_the_core_stops_the_arm_and_keeps_the_evidence(bench, evidence, monkeypatch, caplog, defect):
    one = bench()
    arm = one.connect(link_loss_stop=0.0)
    move = InBackground(arm.move, FAR)
    assert eventually(one.is_moving)
    monkeypatch.setattr(Move, "observe", raising(defect))
    assert eventually(lambda: arm.has_failed and not one.is_moving())
    assert isinstance(move.failure(), ConnectionLost)
    assert eventually(evidence)
    text = evidence()[0].read_text()
    assert "planted" in text or "escaped" in text
    assert "a motion runs" in text and "joint_position" in text
    assert eventually(lambda: "its state is in %s" % evidence()[0] in caplog.text)
    for act in (lambda: arm.move(FAR), lambda: arm.servo_target(c.ServoJoint((0.0,) * 6))):
        with pytest.raises(ConnectionLost):
            act()
    assert one.requests("stop_program") >= 1


def test_the_stop_goes_out_before_the_evidence_is_written(bench, evidence, monkeypatch):
    one = bench()
    arm = one.connect(link_loss_stop=0.0)
    move = InBackground(arm.move, FAR)
    assert eventually(one.is_moving)
    stopped_before = []
    monkeypatch.setattr(fail_stop, "write_evidence", lambda core, error: stopped_before.append(
        eventually(lambda: one.requests("stop_program"), 5.0)))
    monkeypatch.setattr(Move, "observe", raising(KeyError("planted")))
    assert eventually(lambda: stopped_before) == [1]
    assert isinstance(move.failure(), ConnectionLost)


def test_a_defect_in_a_call_ends_the_driver_too(bench, evidence, monkeypatch):
    # The core may be half-way through the call: nothing that it reports afterwards can be relied upon.
    one = bench()
    arm = one.connect(link_loss_stop=0.0)
    move = InBackground(arm.move, FAR)
    assert eventually(one.is_moving)
    monkeypatch.setattr(arm._core, "jog", raising(ZeroDivisionError("planted")))
    with pytest.raises(ZeroDivisionError):
        arm.jog(c.Jog(c.JogFrame.JOINT, 0, 0.1))
    assert eventually(lambda: arm.has_failed and not one.is_moving())
    assert isinstance(move.failure(), ConnectionLost) and eventually(evidence)


def test_an_error_that_belongs_to_a_call_ends_nothing(bench):
    arm = bench().connect()
    for _ in range(3):
        with pytest.raises(Exception, match="servo mode"):
            arm.servo_target(c.ServoJoint((0.0,) * 6))
    assert arm.is_ready and not arm.has_failed


def test_evidence_that_cannot_be_written_is_no_second_failure(bench, monkeypatch):
    arm = bench().connect()
    assert fail_stop.write_evidence(arm._core, ValueError("x"), "/nonexistent/folder") is None
    monkeypatch.setenv("ROS_LOG_DIR", "/nonexistent/folder")
    path = fail_stop.write_evidence(arm._core, ValueError("x"))
    assert path is not None and "ValueError" in Path(path).read_text()
    Path(path).unlink()
