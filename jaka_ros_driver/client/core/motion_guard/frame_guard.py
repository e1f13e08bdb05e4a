"""The guard of a stream of joint frames: a frame goes out only where the arm can stand behind it before it touches."""
from typing import Callable, Sequence

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S, braked_steps
from jaka_ros_driver.state import Vector

Look = Callable[[Sequence[Vector]], str]
"""A look at a way of straight lines in joint space: it returns why the arm must stand, in words; "" where it need not.
"""
_STEP_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S ** 2
"""Largest change, rad, of a joint's step from one cycle to the next."""
_ROUNDING = 1e-9
"""Allowance for rounding."""


def brake_end(before: Vector, joints: Vector) -> Vector:
    """Return where an arm stands that is sent these joints after those before, one cycle apart, and then brakes.

    All joints brake alike, so that it stays on the straight line, and the fastest one with its acceleration, rad (6,).
    """
    step = [new - old for new, old in zip(joints, before)]
    steps = braked_steps(max(map(abs, step)) / _STEP_CHANGE)
    return tuple([at + steps * s for at, s in zip(joints, step)])


class FrameGuard:
    """The guard of one stream, which brakes all joints alike, on a straight line in joint space, where it must.

    A frame goes out only where this brake behind it is clear: where the stream itself would stand is not enough, as its
    joints need not come there on a straight line, and it is this brake that is left if the next frame is in trouble.

    Attributes:
        joints: Of the last frame, rad (6,).
        trouble: Why it brakes, in words; "" while it passes frames on.
    """

    def __init__(self, look: Look, joints: Vector) -> None:
        """Begin at rest at these joints, rad (6,)."""
        self._look = look
        self.joints = joints
        self._step: Vector = (0.0,) * JOINT_COUNT
        self.trouble = ""

    @property
    def is_standing(self) -> bool:
        """True where it has braked to a stand."""
        return bool(self.trouble) and not any(self._step)

    def admitted(self, joints: Vector) -> Vector:
        """Return the joints of the frame to be sent, rad (6,): these, or where it must brake, those of the brake.

        joints: Of the stream's own frame, rad (6,).
        """
        trouble = self._look((self.joints, joints, brake_end(self.joints, joints)))
        if trouble:
            return self.brakes_for(trouble)
        self._step = tuple([new - old for new, old in zip(joints, self.joints)])
        self.joints = joints
        return joints

    def brakes_for(self, trouble: str) -> Vector:
        """Begin to brake for this trouble; return the joints of the first frame of the brake, rad (6,)."""
        self.trouble = trouble
        return self.braked()

    def braked(self) -> Vector:
        """Return the joints of the next frame of the brake, rad (6,); at last those where it stands."""
        fastest = max(map(abs, self._step))
        left = fastest - _STEP_CHANGE
        share = left / fastest if left > _ROUNDING * _STEP_CHANGE else 0.0
        self._step = tuple([share * s for s in self._step])
        self.joints = tuple([at + s for at, s in zip(self.joints, self._step)])
        return self.joints
