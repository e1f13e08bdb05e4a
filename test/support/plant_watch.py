"""A plant whose every cycle is checked: nothing jumps, nothing is faster or harder than the model allows."""
from typing import List

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.kinematics.arm_models import load_model
from jaka_ros_driver.kinematics.rotations import Transform
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.frames import ArmFrames
from jaka_ros_driver.simulation.arm.plant import CYCLE_TIME_S, HOME, Plant

ZU7 = load_model("zu7")
NO_TURN = (0.0, 0.0, 0.0)


class PlantWatch:
    """A plant whose cycles are all checked, and what was seen of them.

    Attributes:
        plant: The plant.
        joints: After each cycle, the start first.
        events: All events.
        fastest: Highest share of a joint's speed limit seen.
        hardest: Highest share of a joint's acceleration limit seen.
    """

    def __init__(self, joint_position=HOME, model=ZU7, checks_acceleration=True, jerk_limited=True, **options):
        self.model = model
        self.plant = Plant(model, joint_position, **options)
        self.plant.queue.jerk_limited = jerk_limited
        self.joints: List[tuple] = [self.plant.joint_position]
        self.events: List[PlantEvent] = []
        self.fastest = self.hardest = 0.0
        self._checks_acceleration = checks_acceleration
        self._velocity = (0.0,) * 6

    def step(self, cycles=1):
        for _ in range(cycles):
            self.plant.step()
            self._check()

    def run(self, longest_s=120.0):
        """Step until the arm is in position."""
        for _ in range(int(longest_s / CYCLE_TIME_S)):
            if self.plant.is_in_position:
                return
            self.step()
        raise AssertionError("not in position after %g s" % longest_s)

    def _check(self):
        before, after = self.joints[-1], self.plant.joint_position
        velocity = tuple((b - a) / CYCLE_TIME_S for a, b in zip(before, after))
        speed = max(abs(v) / limit for v, limit in zip(velocity, self.model.joint_max_speed))
        acceleration = max(abs(v - u) / CYCLE_TIME_S / limit for u, v, limit in
                           zip(self._velocity, velocity, self.model.joint_max_acceleration))
        self.fastest, self.hardest = max(self.fastest, speed), max(self.hardest, acceleration)
        assert speed <= 1.001, "joint speed %.3f of the limit" % speed
        assert acceleration <= 1.02 or not self._checks_acceleration, "acceleration %.3f of the limit" % acceleration
        assert all(low <= q <= high for q, (low, high) in zip(after, self.model.joint_limits))
        assert self.plant.joint_velocity == velocity
        self.joints.append(after)
        self._velocity = velocity
        self.events += self.plant.take_events()

    def tools(self) -> List[Transform]:
        """Return ``base_t_flange`` after each cycle, the start first."""
        frames = ArmFrames(self.model)
        return [frames.tool_at(joints) for joints in self.joints]

    @property
    def codes(self) -> List[int]:
        return [event.code for event in self.events]


def shift(x=0.0, y=0.0, z=0.0, rpy=NO_TURN) -> Pose:
    """Return an increment, m and rad."""
    return Pose((x, y, z), rpy)
