"""The progress along a path over time: jerk-limited by ruckig where it is installed, trapezoidal otherwise.

A profile has one coordinate, the distance along a path, which only grows. Every motion along a path uses one, so that a
change of speed, a pause or a stop during the motion never leaves the path.
"""
import importlib
import math
from typing import Any, Optional

CYCLE_TIME_S = 0.008
"""Interpolation cycle, s: docs/controller-protocol.md section 5.6.5."""
JERK_TIME_S = 0.05
"""Time, s, in which acceleration builds up or fades, with ruckig. No vendor value exists."""

try:
    RUCKIG: Any = importlib.import_module("ruckig")
except ImportError:
    RUCKIG = None

_REST_SPEED = 1e-9
"""Lowest speed of what is not at its end: at 0 it would stay where it is for ever."""
_STEEPER = 1.25
_STEEPER_TRIES = 16
"""Factor by which a brake that passes its end is made steeper, and how often: up to 35 times."""


def jerk_time(jerk_limited: bool, seconds: float = JERK_TIME_S) -> float:
    """Return the time in which acceleration builds up, s; 0 where the profile is not jerk-limited."""
    return seconds if jerk_limited and RUCKIG is not None else 0.0


class Profile:
    """The distance, speed and acceleration along a path, advanced by ``step``; in the units of the path (m or rad).

    Attributes:
        position: Distance covered so far.
        velocity: Never below 0.
        acceleration: Signed.
        jerk_time: s over which acceleration builds up on the way to a target; 0 without ruckig.
        braking_jerk_time: The same where it slows down at once.
    """

    def __init__(self, jerk_limited: bool = True, jerk_seconds: float = JERK_TIME_S) -> None:
        """Set up a profile at rest.

        jerk_limited: limit the jerk; has no effect without ruckig.
        jerk_seconds: ``jerk_time`` with ruckig.
        """
        self.position = 0.0
        self.velocity = 0.0
        self.acceleration = 0.0
        self.jerk_time = jerk_time(jerk_limited, jerk_seconds)
        self.braking_jerk_time = jerk_time(jerk_limited)
        self._target: Optional[float] = None
        self._slowed_by: Optional[float] = None
        self._max_velocity = 0.0
        self._max_acceleration = 1.0
        self._trajectory: Any = None
        self._jerk = 0.0
        self._elapsed = 0.0

    @property
    def at_rest(self) -> bool:
        return self.velocity == 0.0

    def aim(self, target: float, max_velocity: float, max_acceleration: float) -> None:
        """Move from now on to ``target`` and come to rest there. It must lie ahead, and far enough to stop before it.

        Where a lowered max_acceleration would lead beyond the target, it brakes harder than that.
        """
        if max_velocity <= 0.0:
            self.brake(max_acceleration)
            return
        self._target, self._max_velocity, self._max_acceleration = target, max_velocity, max_acceleration
        self._slowed_by = None
        remaining = target - self.position
        if remaining > 0.0:
            self._max_acceleration = max(max_acceleration, 0.5 * self.velocity * self.velocity / remaining)
        self._trajectory = None
        if self.jerk_time:
            self._plan_to(target)

    def brake(self, max_acceleration: float) -> float:
        """Slow down to rest as soon as the limits allow; return the position where that will be."""
        self._target, self._max_velocity, self._max_acceleration = None, 0.0, max_acceleration
        self._slowed_by = None
        self._trajectory = None
        if self.velocity == 0.0:
            self.acceleration = 0.0
            return self.position
        if self.braking_jerk_time:
            self._plan_brake()
        if self._trajectory is not None:
            return max(self.position, self._trajectory.at_time(self._trajectory.duration)[0][0])
        return self.position + 0.5 * self.velocity * self.velocity / max_acceleration

    def slow_down(self, max_acceleration: float, end: float) -> None:
        """Slow down to rest at this deceleration, at ``end`` at the latest. A second call changes nothing."""
        if self._slowed_by == max_acceleration:
            return
        if self.brake(max_acceleration) > end:
            self.aim(end, max(self.velocity, _REST_SPEED), max_acceleration)
        self._slowed_by = max_acceleration

    def step(self, dt: float) -> float:
        """Let dt seconds pass; return the new position."""
        if self._trajectory is not None:
            self._follow(dt)
        elif self._target is None:
            self._slow_down(dt)
        else:
            self._trapezoid(dt, self._target)
        return self.position

    def _follow(self, dt: float) -> None:
        self._elapsed += dt
        if self._elapsed >= self._trajectory.duration:
            end = self._trajectory.at_time(self._trajectory.duration)[0][0]
            self._rest_at(max(self.position, end) if self._target is None else self._target)
            return
        position, velocity, acceleration = self._trajectory.at_time(self._elapsed)
        self.position = max(self.position, position[0])
        self.velocity, self.acceleration = max(velocity[0], _REST_SPEED), acceleration[0]

    def _rest_at(self, position: float) -> None:
        self.position, self.velocity, self.acceleration = position, 0.0, 0.0
        self._trajectory = None

    def _slow_down(self, dt: float) -> None:
        if self.velocity <= self._max_acceleration * dt:
            self._rest_at(self.position + 0.5 * self.velocity * self.velocity / self._max_acceleration)
            return
        self.acceleration = -self._max_acceleration
        self.position += dt * (self.velocity - 0.5 * self._max_acceleration * dt)
        self.velocity -= self._max_acceleration * dt

    def _trapezoid(self, dt: float, target: float) -> None:
        """Run one cycle at the constant acceleration after which it is still possible to stop at the target."""
        remaining = target - self.position
        limit = self._max_acceleration * dt
        stoppable = stoppable_speed(self.velocity, remaining, self._max_acceleration, dt)
        if remaining <= 0.0 or stoppable <= 0.0:
            self._rest_at(max(target, self.position))
            return
        wanted = min(self._max_velocity, self.velocity + limit, stoppable)
        velocity = max(wanted, self.velocity - limit)
        self.acceleration = (velocity - self.velocity) / dt
        self.position += 0.5 * (self.velocity + velocity) * dt
        self.velocity = velocity
        if self.position >= target:
            self._rest_at(target)

    def _plan_to(self, target: float) -> None:
        acceleration = self._max_acceleration
        for _ in range(_STEEPER_TRIES):
            plan = self._request(acceleration, self.jerk_time)
            plan.target_position = [target]
            plan.max_velocity = [self._max_velocity]
            trajectory = self._solve(plan)
            if trajectory is None:
                return
            if trajectory.position_extrema[0].max <= target + 1e-12 + 1e-9 * abs(target):
                self._trajectory, self._elapsed, self._jerk = trajectory, 0.0, plan.max_jerk[0]
                return
            acceleration *= _STEEPER

    def _plan_brake(self) -> None:
        plan = self._request(self._max_acceleration, self.braking_jerk_time)
        plan.control_interface = RUCKIG.ControlInterface.Velocity
        plan.target_velocity = [0.0]
        self._trajectory, self._elapsed, self._jerk = self._solve(plan), 0.0, plan.max_jerk[0]

    def _request(self, acceleration: float, jerk_seconds: float) -> Any:
        plan = RUCKIG.InputParameter(1)
        plan.current_position = [self.position]
        plan.current_velocity = [self.velocity]
        plan.current_acceleration = [self.acceleration]
        plan.max_acceleration = [acceleration]
        jerk = max(acceleration, abs(self.acceleration)) / jerk_seconds
        # acceleration that has begun to fade must fade as fast as before, or the speed would exceed its limit
        plan.max_jerk = [max(jerk, self._jerk) if self.acceleration else jerk]
        return plan

    def _solve(self, plan: Any) -> Any:
        """Return the trajectory, or None where ruckig finds none; the trapezoid then takes over."""
        trajectory = RUCKIG.Trajectory(1)
        return trajectory if ruckig_solves(RUCKIG.Ruckig(1), plan, trajectory) else None


def ruckig_solves(solver: Any, plan: Any, trajectory: Any) -> bool:
    """Let ruckig compute the trajectory of the plan.

    It returns False where ruckig fails, as with numbers of very different size.
    """
    try:
        return int(solver.calculate(plan, trajectory).value) >= 0
    except (RUCKIG.RuckigError, ValueError):  # ValueError: a result that its own enumeration lacks
        return False


def speed_for_way(way: float, final_speed: float, acceleration: float, jerk_time: float) -> float:
    """Return the highest speed from which ``way`` suffices to slow to ``final_speed``.

    Braking builds up over jerk_time, s.
    """
    half = 0.5 * jerk_time
    budget = way - half * final_speed + 0.5 * final_speed * final_speed / acceleration
    root = half * half + 2.0 * budget / acceleration
    return max(final_speed, acceleration * (math.sqrt(root) - half)) if root > 0.0 else final_speed


def stoppable_speed(speed: float, room: float, acceleration: float, dt: float) -> float:
    """Return the highest speed after a cycle of ``dt`` s from which ``room`` still suffices to stop.

    It is below 0 for none.
    """
    limit = acceleration * dt
    root = limit * limit - 4.0 * (limit * speed - 2.0 * acceleration * room)
    return 0.5 * (math.sqrt(root) - limit) if root > 0.0 else -1.0


def stopping_way(speed: float, acceleration: float, jerk_time: float) -> float:
    """Return the distance from ``speed`` to rest at this deceleration; an upper bound.

    The deceleration builds up over jerk_time, s.
    """
    return 0.5 * speed * (speed / acceleration + jerk_time)
