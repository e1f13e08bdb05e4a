"""The guard of a stream of joint frames: a frame goes out only where the arm can stand behind it before it touches."""
import math
from typing import Callable, Optional, Sequence

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S
from jaka_ros_driver.state import Vector

Look = Callable[[Sequence[Vector]], str]
"""A look at a way of straight lines in joint space: it returns why the arm must stand, in words; "" where it need not.
"""
_STEP_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2
"""Largest change, rad, of a joint's step from one cycle to the next."""
_ROUNDING = 1e-9


class FrameGuard:
    """The guard of one stream, which brakes all joints alike, on a straight line in joint space, where it must.

    Attributes:
        trouble: Why it brakes, in words; "" while it passes frames on.
    """

    def __init__(self, look: Look, joints: Vector) -> None:
        """Begin at rest at these joints, rad (6,)."""
        self._look = look
        self._joints = joints
        self._step: Vector = (0.0,) * JOINT_COUNT
        self._less: Vector = self._step
        self.trouble = ""

    @property
    def is_standing(self) -> bool:
        """True where it has braked to a stand."""
        return bool(self.trouble) and not any(self._step)

    def admitted(self, joints: Vector, stand: Optional[Vector] = None) -> Vector:
        """Return the joints of the frame to be sent, rad (6,): these, or where it must brake, those of the brake.

        Args:
            joints: Of the stream's own frame, rad (6,).
            stand: Where the stream comes to rest if nothing more is asked of it, rad (6,); None where it brakes.
        """
        step = tuple([new - old for new, old in zip(joints, self._joints)])
        cycles = max(1, math.ceil(max(map(abs, step)) / _STEP_CHANGE - _ROUNDING))
        if stand is None:
            stand = tuple([at + 0.5 * (cycles - 1) * s for at, s in zip(joints, step)])
        self.trouble = self._look((self._joints, joints, stand))
        if self.trouble:
            return self.braked()
        self._joints, self._step = joints, step
        self._less = tuple([s / cycles for s in step])
        return joints

    def braked(self) -> Vector:
        """Return the joints of the next frame of the brake, rad (6,); at last those where it stands."""
        self._step = tuple([0.0 if abs(s) <= abs(less) * (1.0 + _ROUNDING) else s - less
                            for s, less in zip(self._step, self._less)])
        self._joints = tuple([at + s for at, s in zip(self._joints, self._step)])
        return self._joints
