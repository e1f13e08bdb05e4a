"""The gate of the stream of points: what ended a stream keeps its next points out, until they pause."""
import pytest
from simulated_arm import SimulatedArm

from jaka_ros_driver.client.core.point_stream import PointGate, StreamPoint
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.arm.plant import HOME
from jaka_ros_driver.trajectory.follower import HOLD_S

MODEL = load_model("zu7")
PERIOD_S = 0.02


def streamed(arm, count=20):
    """Send points that lead joint 1 on from where it is; return the error of the last one."""
    first = arm.joints[0]
    for number in range(1, count + 1):
        call = arm.begin("follow_point", StreamPoint((first + 0.005 * number, *HOME[1:]), arm.now + PERIOD_S),
                         arm.core.stops)
        arm.run(PERIOD_S)
    return call.error


@pytest.mark.parametrize("end", ["cancel", "stop"])
def test_a_stream_that_was_ended_is_refused_until_it_pauses(end):
    arm = SimulatedArm(MODEL, HOME)
    assert streamed(arm) is None and arm.is_moving
    if end == "cancel":
        assert arm.core.cancel_trajectory(None, arm.now), "it runs"
    else:
        assert arm.ended(arm.begin("stop")) is None
    error = streamed(arm, 50)
    assert isinstance(error, InvalidCommand) and "the stream was ended" in str(error)
    at = arm.joints
    assert not arm.is_moving and streamed(arm, 5) is not None and arm.joints == at, "as long as it does not pause"
    arm.run(HOLD_S + PERIOD_S)
    assert streamed(arm) is None and arm.joints[0] > at[0] + 0.05
    assert not arm.core.cancel_trajectory(object(), arm.now), "a stream has no goal"


def test_the_gate_keeps_the_first_reason_and_opens_after_a_pause_and_no_sooner():
    gate = PointGate()
    gate.pass_through(10.0)
    gate.close("a stop")
    gate.close("its end")
    for now in (10.1, 10.1 + 0.9 * HOLD_S):
        with pytest.raises(InvalidCommand, match=r"the stream was ended \(a stop\)"):
            gate.pass_through(now)
    gate.pass_through(10.2 + 1.9 * HOLD_S)
    gate.require_open()
