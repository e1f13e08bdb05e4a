"""Rules about velocity jogs: begun by a fresh wish after a message of rest, and at rest 0.3 s after the last message.

Judged by the messages as they were published, and by the frames sent; the dead-man is the judge's own.
"""
import math
from typing import Dict, Optional, Tuple

from verdict import RuleBroken

from jaka_ros_driver.kinematics.limits import JOINT_ACCELERATION_CEILING

SERVO_CYCLE = 0.008
FRESH = 0.2
"""Time for which a message counts, s, the figure in docs/velocity_jog.md."""
ALONE = 0.5
"""Time after its last message for which a publisher is still there, and excludes others, s."""
REST_AFTER = 0.3
"""Time from the last message that counted to the last frame of motion, s: the 0.2 s that it counts, and BRAKE."""
BRAKE = 0.1
"""Time from a second publisher, or a message that cannot be understood, to rest, s.

A joint brakes from the fastest jog of 1 rad/s within 0.08 s, and the driver's timer takes 0.02 s."""
MOVED = 1e-7
"""Difference of two frames, rad, up to which it is rounding, from rad to degrees and back."""
ACCELERATION_SLACK = 1.02
"""Factor over the ceiling, the same as the driver's own (build.ACCELERATION_SLACK)."""


class JogRules:
    """The judge of each message and each frame of a jog.

    Attributes:
        is_running: Servo mode was entered for a jog.
        rests_from: From then on the frames of the jog do not move.
    """

    def __init__(self, lateness: float) -> None:
        self._slack = 8.0 * lateness + SERVO_CYCLE
        self.is_running = False
        self._counts_until = -math.inf
        self.rests_from = -math.inf
        self._rest_said = False
        self._heard: Dict[str, float] = {}
        self._stamp = -math.inf
        self._frames: Tuple[Tuple[float, ...], ...] = ()

    # ---- messages ----

    def told(self, source: str, stamp: float, speed: Optional[float], now: float) -> None:
        """Note a message that was published at ``stamp``; ``speed``: None where it makes no sense."""
        if now > self._counts_until:
            self._rest_said = False
        self._heard = {name: at for name, at in self._heard.items() if now - at <= ALONE}
        self._heard[source] = now
        if len(self._heard) > 1 or speed is None:
            self.ended(now)
        elif now - stamp <= FRESH and (stamp > self._stamp or not self._rest_said):
            self._rest_said = self._rest_said or speed == 0.0
            if self._rest_said:
                self._stamp, self._counts_until = stamp, stamp + FRESH
                self.rests_from = stamp + REST_AFTER

    def ended(self, now: float) -> None:
        """End the hold: after a stop, a fault or a second publisher, rest must be published anew."""
        self._rest_said = False
        self._counts_until = min(self._counts_until, now)
        self.rests_from = min(self.rests_from, now + BRAKE)

    def may_begin(self, now: float) -> None:
        """Judge that a jog may begin: servo mode is entered for it."""
        if not self._rest_said or now > self._counts_until:
            raise RuleBroken("v", now, "a jog begins, and nobody holds it")

    # ---- frames ----

    def begin(self, is_jog: bool) -> None:
        """Note that servo mode is entered."""
        self.is_running = is_jog
        self._frames = ()

    def sends(self, joints: Tuple[float, ...], awake_since: float, now: float) -> None:
        """Judge a frame of a running jog; the time in which the process stood still does not count."""
        if not self.is_running:
            return
        self._frames = self._frames[-2:] + (joints,)
        if len(self._frames) < 2:
            return
        moved = max([abs(a - b) for a, b in zip(self._frames[-2], joints)])
        late = now - max(self.rests_from, awake_since + BRAKE)
        if moved > MOVED and late > self._slack:
            raise RuleBroken("v", now, "a jog's frame moves a joint by %.5f rad, %.3f s after it should rest" % (
                moved, late))
        if len(self._frames) == 3:
            for index, (a, b, c) in enumerate(zip(*self._frames)):
                acceleration = abs(c - 2.0 * b + a) / SERVO_CYCLE ** 2
                if acceleration > JOINT_ACCELERATION_CEILING * ACCELERATION_SLACK:
                    raise RuleBroken("v", now, "a jog's frames ask %.2f rad/s2 of joint %d" % (acceleration, index + 1))
