"""Rules about the frames of a stream of points: no farther than its points, smooth, and never resumed by itself."""
from typing import List, Tuple

from verdict import RuleBroken

from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING
from jaka_ros_driver.trajectory.follower import HOLD_S

SERVO_CYCLE = 0.008
ACCELERATION_SLACK = 1.02
BESIDE = 1e-3
"""Distance, rad, by which a frame may pass the points of a stream in one direction."""
TURN = 0.1
"""The same of a stream that turns back at up to 1 rad/s: braking takes 0.04 rad."""
_SAME_STREAM_S = HOLD_S - 0.01


class PointRules:
    """The judge of streams of points and of their frames."""

    def __init__(self) -> None:
        self._points: List[Tuple[float, ...]] = []
        self._came_at = -HOLD_S
        self._has_paused = True
        self._frames: Tuple[Tuple[float, ...], ...] = ()
        self.is_running = False

    def came(self, position: Tuple[float, ...], now: float) -> None:
        """Note a point that the core gets, taken or not."""
        if now - self._came_at >= _SAME_STREAM_S:
            self._has_paused = True
        self._came_at = now
        self._points.append(position)

    def disturbed(self) -> None:
        """Note a stop, a fault or a lost link: what streams now must pause before it moves the arm."""
        self._has_paused = False

    def begin(self, is_stream: bool, now: float) -> None:
        """Judge that servo mode may be entered for a stream."""
        self.is_running, self._frames = is_stream, ()
        self._points = self._points[-1:]
        if is_stream and not self._has_paused:
            raise RuleBroken("stream", now, "a stream moves the arm that goes on since before a stop or a fault")

    def sends(self, joints: Tuple[float, ...], now: float) -> None:
        """Judge a frame."""
        if not self.is_running or len(joints) != 6:
            return
        if not self._frames:
            self._points.insert(0, joints)
        self._frames = self._frames[-2:] + (joints,)
        for index, (at, values) in enumerate(zip(joints, zip(*self._points))):
            is_one_way = list(values) in (sorted(values), sorted(values, reverse=True))
            beside = max(min(values) - at, at - max(values))
            if beside > (BESIDE if is_one_way else TURN):
                raise RuleBroken("stream", now, "a stream's frame is %.4f rad beyond the points of joint %d" % (
                    beside, index + 1))
        if len(self._frames) == 3:
            for index, (a, b, c) in enumerate(zip(*self._frames)):
                acceleration = abs(c - 2.0 * b + a) / SERVO_CYCLE ** 2
                if acceleration > JOINT_ACCELERATION_CEILING * ACCELERATION_SLACK:
                    raise RuleBroken("stream", now, "a stream's frames ask %.2f rad/s2 of joint %d" % (
                        acceleration, index + 1))
