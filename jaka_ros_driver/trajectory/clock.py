"""The clock along a path: one step each cycle, at the wanted speed, and never faster than the joints can follow.

Only the clock's speed changes, never the path: a pause, another speed, a stop or time that was lost lead the arm along
the same way.
"""
import math
from typing import NamedTuple, Optional, Tuple

from jaka_ros_driver.kinematics.arm_models import JOINT_COUNT, ArmModel
from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING, SERVO_PERIOD_S, top_joint_speeds
from jaka_ros_driver.state import Vector
from jaka_ros_driver.trajectory.audit import ACCELERATION_SLACK
from jaka_ros_driver.trajectory.path import JointState, Path

_CHANGE = JOINT_ACCELERATION_CEILING * SERVO_PERIOD_S
_STILL = 1e-9
"""Speed, rad/s, that is rounding of floats."""
_NEARLY = 1.0 - 1e-9
"""Share of a cycle's way that is taken where it would be too fast: rounding must not lead above the limit again."""
_SAME_RATE = 1e-4
"""Change of the rate with which its search ends: the limits are judged by the mean speed, which it hardly changes."""
_TRIES = 4
"""Most rounds of that search, which runs in every cycle; what is left beyond a limit is cut off afterwards."""
_SHORT_S = 1e-5
"""Stretch, s, of a path below which its slope is taken in place of a difference of positions, which rounding spoils."""
_ROOM = 0.5 * JOINT_ACCELERATION_CEILING
"""Acceleration, rad/s2, that any joint may need soon where the arm is to run faster than the path.

With the rest of its acceleration an arm at the highest speed slows by 5 % within four cycles.
"""
_CYCLES_AHEAD = 7
"""Cycles that are looked ahead: longer than the four in which an arm at the highest speed slows down."""


class _Step(NamedTuple):
    """The result of one cycle from the present one at the wanted rate; the names are those of the clock."""

    wanted: float
    time: float
    rate: float
    position: Vector
    velocity: Vector


class PathClock:
    """The clock that turns a path into one position for each cycle.

    Attributes:
        path: The path that is followed.
        time: On the path, s.
        rate: Seconds of the path for each second, in the last cycle.
        position: The last position sent, rad (6,).
        velocity: Of the last cycle, rad/s (6,).
    """

    def __init__(self, path: Path, model: ArmModel) -> None:
        """Start the clock at rest at the path's begin."""
        self.path = path
        self.time = path.begin
        self.rate = 0.0
        self.position: Vector = path.at(path.begin).position
        self.velocity: Vector = (0.0,) * JOINT_COUNT
        self._next: Optional[Tuple[float, Path]] = None
        self._ahead: Optional[_Step] = None
        self._top = top_joint_speeds(model)

    @property
    def is_at_end(self) -> bool:
        """True once the path has been followed to its end."""
        return self.time >= self._end

    @property
    def is_still(self) -> bool:
        """True where the last cycle moved nothing."""
        return max(map(abs, self.velocity)) <= _STILL

    def state(self) -> JointState:
        """Return the wanted position of the joints now, and their velocity and acceleration at the present rate."""
        return self.state_at(self.time, self.rate)

    def state_at(self, time: float, rate: float) -> JointState:
        """Return the wanted state at this time on the path, s, passed at this rate."""
        position, velocity, acceleration = self._at(time)
        return JointState(position, tuple([v * rate for v in velocity]), tuple([a * rate * rate for a in acceleration]))

    def join(self, time: float, path: Path) -> None:
        """Follow another path, from its begin on, when this one has come to ``time``, which is now or later, s."""
        self._next = time, path
        self._ahead = None

    def pass_rest(self, seconds: float) -> None:
        """Advance by ``seconds`` on a path that starts later.

        The clock goes to the path's start at most, or to where another path is joined.
        """
        until = 0.0 if self._next is None else min(0.0, self._next[0])
        self.time = max(self.time, min(self.time + seconds, until))
        self._ahead = None

    def look_ahead(self, wanted: float) -> Vector:
        """Compute the position to which ``step`` will lead, rad (6,), and keep it for ``step`` unless something
        changes.
        """
        if self._ahead is None or self._ahead.wanted != wanted:
            self._ahead = self._from_here(wanted)
        return self._ahead.position

    def step(self, wanted: float) -> Vector:
        """Advance one cycle, if possible at the rate ``wanted`` (0 and more); return the position, rad (6,)."""
        position = self.look_ahead(wanted)
        assert self._ahead is not None
        _, self.time, self.rate, _, self.velocity = self._ahead
        self.position, self._ahead = position, None
        if self._next is not None and self.time >= self._next[0]:
            (joined_at, path), self._next = self._next, None
            self.path, self.time = path, path.begin + self.time - joined_at
        return position

    def _from_here(self, asked: float) -> _Step:
        wanted = 1.0 if asked > 1.0 and not self._has_room_ahead() else asked
        rate = self.rate
        wanted = min(wanted, self._highest_rate(self.time + 0.5 * rate * SERVO_PERIOD_S))
        for _ in range(_TRIES):  # another stretch of the path: its mean speed is not quite the same
            expected, rate = rate, self._possible(wanted, rate)
            if abs(rate - expected) <= _SAME_RATE:
                break
        time = min(self.time + rate * SERVO_PERIOD_S, self._end)
        position = self._at(time).position
        excess = max([abs(new - old) / (top * SERVO_PERIOD_S) for new, old, top in zip(
            position, self.position, self._top)])
        if excess > 1.0:
            time = self.time + (time - self.time) * _NEARLY / excess
            position = self._at(time).position
        return _Step(asked, time, (time - self.time) / SERVO_PERIOD_S if time < self._end else rate, position,
                     tuple([(new - old) / SERVO_PERIOD_S for new, old in zip(position, self.position)]))

    @property
    def _end(self) -> float:
        if self._next is None:
            return self.path.end
        joined_at, path = self._next
        return joined_at + path.end - path.begin

    def _at(self, time: float) -> JointState:
        if self._next is None or time < self._next[0]:
            return self.path.at(time)
        joined_at, path = self._next
        return path.at(path.begin + time - joined_at)

    def _highest_rate(self, time: float) -> float:
        if self._next is None or time < self._next[0]:
            return self.path.highest_rate(time)
        joined_at, path = self._next
        return path.highest_rate(path.begin + time - joined_at)

    def _possible(self, wanted: float, expected: float) -> float:
        """Return the rate nearest to the wanted one that asks no joint for more speed or acceleration than it has.

        It is judged by the mean speeds over the stretch that is passed at the ``expected`` rate: a turn may begin
        within it.
        """
        speeds = self._mean_speeds(expected * SERVO_PERIOD_S)
        low, high = self._rates(speeds, _CHANGE)
        if low > 1.0 or high < 1.0:  # what the audit lets a path need above the ceiling is there to stay in its time
            loose_low, loose_high = self._rates(speeds, _CHANGE * ACCELERATION_SLACK)
            if low > 1.0:
                low = max(1.0, loose_low)
            if loose_high >= 1.0:
                high = max(1.0, high)
        for speed, top in zip(speeds, self._top):
            if abs(speed) > _STILL:
                high = min(high, top / abs(speed))
        low = min(low, max(self.rate, wanted))  # where the path itself brakes hardest, going faster is no way to brake
        return max(0.0, min(max(wanted, low), high))

    def _rates(self, speeds: Vector, change: float) -> Tuple[float, float]:
        """Return the bounds of the rate within which no speed, rad/s, changes by more than ``change`` since the last
        cycle.
        """
        low, high = 0.0, math.inf
        for speed, before in zip(speeds, self.velocity):
            if abs(speed) > _STILL:
                ends = (before - change) / speed, (before + change) / speed
                low, high = max(low, min(ends)), min(high, max(ends))
        return low, high

    def _mean_speeds(self, duration: float) -> Vector:
        until = self.time + duration
        if duration < _SHORT_S or until >= self._end:
            return self._at(self.time + 0.5 * duration).velocity
        return tuple([(new - old) / duration for new, old in zip(self._at(until).position, self.position)])

    def _has_room_ahead(self) -> bool:
        """Return whether every joint needs little of its acceleration soon.

        An arm that is early for a turn cannot slow down within it.
        """
        return all(max(map(abs, self._at(self.time + n * SERVO_PERIOD_S).acceleration)) <= _ROOM
                   for n in range(_CYCLES_AHEAD))
