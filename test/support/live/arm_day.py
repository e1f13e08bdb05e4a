"""The whole day of an arm, by the driver's services: power, move, jog, servo, stop, outputs, recovery."""
import contextlib
import math

import pytest
from driver_bench import HOME, Arm, DriverProcess, SimulatorProcess, on
from waiting import eventually


@contextlib.contextmanager
def probed_arm(report, *simulation, guard=True):
    """Yield the arm of a driver with the report of a probe, whose path this is; it is off at first.

    simulation: Options of its simulated controller.
    """
    with contextlib.closing(SimulatorProcess(*simulation)) as simulator:
        with DriverProcess(controller_profile=report, auto_enable=False, **on(simulator, guard=guard)):
            arm = Arm(simulator)
            arm.wait_until_seen()
            yield arm


def joint(arm):
    """Return the angle of the first joint, deg, as the arm itself knows it."""
    return arm.simulator.state()["joint_position"][0]


def live_a_day(arm):
    """Make every call of the day on an arm that is off, and assert what the arm does."""
    assert arm.call("power", data=True).success and arm.call("enable", data=True).success
    arm.go_home()
    assert arm.call("joint_move", pose=[0.1] + HOME[1:], mvvelo=1.0, mvacc=6.0).ret == 1
    assert joint(arm) == pytest.approx(math.degrees(0.1), abs=0.01)

    assert eventually(lambda: arm.call("jog", mvvelo=0.2, coord_mode=0, index=0).ret == 1
                      and joint(arm) > math.degrees(0.12))
    arm.call("stop_move")
    assert eventually(lambda: not arm.simulator.is_moving())

    assert arm.call("servo_move_enable", enable=True).ret == 1
    begun = arm.listen("joint_position", 1)[0].position
    for step in range(1, 6):
        assert arm.call("servo_j", pose=[begun[0] + 0.001 * step, *begun[1:]]).ret == 1
    assert eventually(lambda: joint(arm) > math.degrees(begun[0] + 0.003))
    assert arm.call("servo_move_enable", enable=False).ret == 1

    assert arm.call("set_io", signal="digital", type=0, index=2, value=1.0).ret == 1
    assert eventually(lambda: arm.simulator.state()["digital_outputs"][:4] == [0, 0, 1, 0])

    arm.simulator.operate("press_emergency_stop")
    assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state == 2)
    arm.simulator.operate("release_emergency_stop")
    assert eventually(lambda: arm.listen("robot_states", 1)[0].motion_state != 2)
    recovered = arm.call("recover")
    assert recovered.success, recovered.message
    assert arm.call("joint_move", pose=HOME, mvvelo=1.0, mvacc=6.0).ret == 1
