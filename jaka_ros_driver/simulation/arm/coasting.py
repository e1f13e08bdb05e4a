"""The coasting of joints to rest: after servo mode or hand guiding was left, or a path broke off."""
from typing import List, Sequence

from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.state import Vector


class Coast:
    """A motion in which all joints slow down together.

    The fastest one brakes at its acceleration limit, and harder where it would otherwise pass a soft limit.

    Attributes:
        joints: The present position, rad (6,).
        end_joints: The position of rest, rad (6,).
        is_done: True once it is at rest.
    """

    def __init__(self, model: ArmModel, joints: Vector, velocity: Sequence[float]) -> None:
        """Begin to coast from joints, rad (6,), at velocity, rad/s (6,)."""
        times: List[float] = [abs(v) / a for v, a in zip(velocity, model.joint_max_acceleration)]
        self._duration = max(times)
        for q, v, (low, high) in zip(joints, velocity, model.joint_limits):
            room = max(0.0, high - q if v > 0.0 else q - low)
            if 0.5 * abs(v) * self._duration > room:
                self._duration = 2.0 * room / abs(v)
        self.joints = joints
        self._start, self._velocity, self._elapsed = joints, tuple(velocity), 0.0
        self.end_joints: Vector = tuple(q + 0.5 * v * self._duration for q, v in zip(joints, velocity))
        self.is_done = self._duration <= 0.0

    def step(self, dt: float) -> Vector:
        """Run one cycle of ``dt`` s; return the joints, rad (6,)."""
        self._elapsed += dt
        if self._elapsed >= self._duration:
            self.is_done = True
            self.joints = self.end_joints
        else:
            time = self._elapsed * (1.0 - 0.5 * self._elapsed / self._duration)
            self.joints = tuple(q + v * time for q, v in zip(self._start, self._velocity))
        return self.joints
