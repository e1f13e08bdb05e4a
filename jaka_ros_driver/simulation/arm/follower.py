"""The motion of the arm along one route; speed changes, pauses and stops stay on the route."""
import copy
from typing import Optional, Sequence

from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.frames import same_joints
from jaka_ros_driver.simulation.arm.profiles import CYCLE_TIME_S, JERK_TIME_S, Profile, stopping_way
from jaka_ros_driver.simulation.arm.routes import Route
from jaka_ros_driver.state import Vector

_OVERSPEED = 1.05  # a joint that exceeds its speed limit by this factor means that the path runs into a singularity
_FITTING = 1.5
"""Reserve of a stop before the end of the route, for the time that its jerk takes."""


class Follower:
    """One running route.

    Attributes:
        route: The route that is followed.
        joints: The arm's position on it, rad (6,).
        is_ending: True once ``end`` was called.
        fault: Set where the arm cannot go on along the path; ``joints`` then are those before that place.
    """

    def __init__(self, route: Route, max_joint_speed: Sequence[float], jerk_limited: bool,
                 braking_share: float = 1.0, jerk_seconds: float = JERK_TIME_S) -> None:
        self._braking_share = self._share = braking_share
        self.route = route
        self.joints = route.start_joints
        self.is_ending = False
        self.fault: Optional[PlantEvent] = None
        self._profile = Profile(jerk_limited, jerk_seconds)
        self._joint_limits = [speed * _OVERSPEED for speed in max_joint_speed]
        self._aimed_at = (-1.0, -1.0, -1.0)
        self._is_braking = False

    @property
    def way(self) -> float:
        """The arm's place, as the parameter of the route."""
        return self._profile.position

    @property
    def speed(self) -> float:
        """The rate of the parameter, per s."""
        return self._profile.velocity

    @property
    def is_done(self) -> bool:
        """True at the end of the route, or at rest after ``end``."""
        return self.is_at_end or (self.is_ending and self._profile.at_rest)

    @property
    def is_at_end(self) -> bool:
        return self.way >= self.route.length

    def take_limits_of(self, route: Route) -> bool:
        """Continue with the limits of ``route``.

        Returns False where it is another path or ends before the arm can stop.
        """
        braking = self._braking_share * route.stopping_acceleration(self.way, 0.0, 0.0)
        needed = stopping_way(self.speed, braking, self._profile.braking_jerk_time)
        here = route.joints_at(self.way, self.joints)
        if route.length <= self.way + needed or here is None or not same_joints(here, self.joints):
            return False
        self.route = route
        return True

    def end(self) -> Vector:
        """Slow down and stop for good; return the joints where the arm will rest, rad (6,), else the present ones."""
        self.is_ending = True
        return self.route.joints_at(self._brake(), self.joints) or self.joints

    def _brake(self) -> float:
        """Slow down along the path; return the parameter where the arm will come to rest."""
        self._is_braking = True
        self._aimed_at = (-1.0, -1.0, -1.0)
        self._share = self._share_that_fits()
        profile = copy.copy(self._profile)
        while not profile.at_rest:
            self._slow_down(profile)
            profile.step(CYCLE_TIME_S)
        return profile.position

    def _share_that_fits(self) -> float:
        """Return the share of the strongest deceleration for this stop: more than usual where the end is near."""
        if self._braking_share >= 1.0:
            return 1.0
        profile = self._profile
        strongest = self.route.stopping_acceleration(profile.position, profile.velocity, profile.braking_jerk_time)
        left = max(self.route.length - profile.position, 1e-9)
        return min(1.0, max(self._braking_share, _FITTING * profile.velocity ** 2 / (2.0 * left * strongest)))

    def _slow_down(self, profile: Profile) -> None:
        """Have the profile brake as hard as the arm can at its place.

        One deceleration for the whole way, that of its weakest place, would leave the arm too fast for the bends on the
        way there.
        """
        strongest = self.route.stopping_acceleration(profile.position, profile.velocity, profile.braking_jerk_time)
        profile.slow_down(self._share * strongest, self.route.length)

    def step(self, dt: float, rate: float) -> Vector:
        """Run one cycle of ``dt`` s at ``rate`` (0 to 1) of the programmed speed; return the joints, rad (6,).

        Rate 0 slows down to a standstill and waits there. A later rate above 0 takes effect once the arm stands.
        """
        if not self.is_ending:
            self._steer(rate)
        if self._is_braking:
            self._slow_down(self._profile)
        way = self._profile.step(dt)
        joints = self.route.joints_at(way, self.joints)
        if joints is None or not all(
                -limit <= (b - a) / dt <= limit for a, b, limit in zip(self.joints, joints, self._joint_limits)):
            self.fault = events.SINGULARITY
            return self.joints
        self.joints = joints
        return joints

    def _steer(self, rate: float) -> None:
        profile, route = self._profile, self.route
        if rate <= 0.0:
            if not self._is_braking:
                self._brake()
            return
        if self._is_braking and not profile.at_rest:
            return
        self._is_braking = False
        speed, acceleration = route.limits(profile.position, profile.velocity, profile.jerk_time)
        aim = (route.length, rate * speed, acceleration)
        if aim != self._aimed_at:
            profile.aim(*aim)
            self._aimed_at = aim
