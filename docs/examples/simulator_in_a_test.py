"""A pytest file that tests code of your own against the simulated controller. No ROS is needed.

Run it with ``pytest simulator_in_a_test.py``. The controller listens on free ports of this computer and speaks as a
real one does, so that whatever talks to a JAKA controller can be tested like this: the driver's client, as here, the
maker's SDK, or a socket of your own.
"""
import threading
import time

import pytest

from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import JointMove
from jaka_ros_driver.errors import MotionInterrupted, StopCause
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.simulation.simulated_controller import SimulatedController

START = (0.0, 1.5708, -1.5708, 1.5708, 1.5708, 0.0)  # rad
PLACE = (0.8,) + START[1:]
FAR = (3.0,) + START[1:]


def move(arm, target):
    """Run the code under test: yours stands here."""
    arm.move(JointMove(target, speed=1.0, acceleration=3.0))  # rad/s, rad/s2; returns at the target, or raises


@pytest.fixture
def controller():
    """Run a controller whose drives are enabled already; a real one starts with its drives off."""
    with SimulatedController(model="zu7", start="enabled") as running:
        yield running


@pytest.fixture
def arm(controller):
    """Connect the driver's client to it."""
    client = ArmClient(ClientSettings("127.0.0.1", controller.command_port, controller.status_port),
                       load_model("zu7"))
    client.start()
    deadline = time.monotonic() + 20.0
    while not client.is_ready:
        assert time.monotonic() < deadline, client.link_health.last_error
        time.sleep(0.01)
    yield client
    client.close()


def test_the_arm_arrives(arm, controller):
    move(arm, PLACE)
    # What is true of the simulated arm, in the units of the wire: deg and mm.
    assert controller.state()["joint_position"][0] == pytest.approx(45.84, abs=0.1)


def test_a_collision_ends_the_move_and_is_named(arm, controller):
    # The operator port is what a person at the arm can do: here somebody pushes against it, after half a second.
    threading.Timer(0.5, lambda: controller.operate("hit", force=150.0)).start()
    with pytest.raises(MotionInterrupted) as caught:
        move(arm, FAR)
    assert caught.value.cause is StopCause.PROTECTIVE_STOP
    assert controller.state()["joint_position"][0] < 60.0
