"""A slow linear move is slow for every joint, whatever it turns: the encoded request on the simulated plant."""
import math

import pytest

from jaka_ros_driver.commands import LinearMove
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import (
    compose,
    matrix_from_rotation_vector,
    pose_from_transform,
    rotation_angle_between,
    transform,
    transform_from_pose,
)
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import encode_object, parse_object
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.firmware import FIRMWARES
from jaka_ros_driver.simulation.controller.state import Options, Start

QUARTER = math.pi / 2.0


def turned(axis, speed):
    """Return the fastest joint, rad/s, and the angle turned, rad, of a quarter turn about an axis of the tool, done at
    its place."""
    controller = Controller(load_model("zu7"), FIRMWARES["1.7"], Options(start=Start.ENABLED))
    plant = controller.state.plant
    begin = transform_from_pose(plant.tcp_pose())
    quarter = transform(matrix_from_rotation_vector([QUARTER * share for share in axis]), (0.0, 0.0, 0.0))
    command = LinearMove(pose_from_transform(compose(begin, quarter)), speed, 1.0)
    reply = controller.execute(parse_object(encode_object(codec.encode(command)))).reply
    codec.decode(command, parse_object(reply))
    fastest = 0.0
    for _ in range(int(60.0 / CYCLE_TIME_S)):
        controller.step(CYCLE_TIME_S)
        fastest = max(fastest, *map(abs, plant.joint_velocity))
    return fastest, rotation_angle_between(begin, transform_from_pose(plant.tcp_pose()))


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_a_turn_on_the_spot_at_1_mm_a_second_moves_no_joint_fast(axis):
    fastest, angle = turned(axis, 0.001)
    assert angle == pytest.approx(0.01 * 60.0, rel=0.02)
    assert math.degrees(fastest) < 3.0 * math.degrees(0.01)
