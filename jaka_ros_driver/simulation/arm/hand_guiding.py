"""Hand guiding: joints follow a push with bounded acceleration and stop before their soft limits."""
import math
from typing import List, Optional, Tuple

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm.profiles import stoppable_speed
from jaka_ros_driver.state import Vector

MAX_SPEED = math.pi / 2.0
"""Highest joint speed, rad/s, under a push. No vendor value exists."""
ACCELERATION = math.pi
"""Acceleration, rad/s2, of a pushed joint. No vendor value exists."""


class HandGuiding:
    """The joints of an arm that is guided by hand.

    Attributes:
        joints: Their position, rad (6,).
        velocity: rad/s (6,).
        hit_limit: The joint that reached a soft limit, and True where that is the upper one; None before.
    """

    def __init__(self, model: ArmModel, joints: Vector) -> None:
        self.joints = joints
        self.velocity: Vector = (0.0,) * 6
        self.hit_limit: Optional[Tuple[int, bool]] = None
        self._model = model
        self._pushes: List[float] = [0.0] * 6

    def push(self, joint: int, velocity: float) -> None:
        """Push joint 0..5 at velocity rad/s from now on."""
        self._pushes[joint] = min(max(velocity, -MAX_SPEED), MAX_SPEED)

    def step(self, dt: float) -> Vector:
        """Run one cycle of ``dt`` s; return the joints, rad (6,)."""
        joints, velocities = list(self.joints), list(self.velocity)
        for n, ((low, high), wanted) in enumerate(zip(self._model.joint_limits, self._pushes)):
            velocity = velocities[n]
            change = min(max(wanted - velocity, -ACCELERATION * dt), ACCELERATION * dt)
            upwards = velocity + change > 0.0
            room = high - joints[n] if upwards else joints[n] - low
            stoppable = stoppable_speed(abs(velocity), room, ACCELERATION, dt)
            if stoppable <= 0.0 and velocity + change != 0.0:
                joints[n], velocities[n] = (high if upwards else low), 0.0
                self.hit_limit = (n, upwards)
                continue
            after = math.copysign(min(abs(velocity + change), stoppable), velocity + change)
            joints[n] += 0.5 * (velocity + after) * dt
            velocities[n] = after
        self.joints, self.velocity = tuple(joints), tuple(velocities)
        return self.joints
