"""The common part of the steps of the stage that moves: its joint and speeds, moves, jogs, servo mode, the way back."""
import time
from typing import Any, Callable, Dict, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.commands import ClearError, Jog, JogFrame, JointMove, Query, SetServoMode
from jaka_ros_driver.errors import ProtocolError
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fit import SampledCurve
from jaka_ros_driver.probe.motion import REST_RAD, MotionEnded, Mover, Seen
from jaka_ros_driver.probe.person import Person
from jaka_ros_driver.probe.set_same import PrintLine, StageEnded
from jaka_ros_driver.probe.twin import RETURN
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.units import deg_to_rad, rad_to_deg

AXIS = 5
"""The joint that moves, 0 to 5: the flange, which turns the tool and moves nothing else."""
MOVED_RAD = 2e-4
"""Change, rad, of a joint that has begun to move."""
SLOW, MEDIUM, JOG_SPEED = deg_to_rad(2.0), deg_to_rad(3.0), deg_to_rad(1.5)
"""Speeds of moves and jogs, rad/s; 5 % of the slowest joint of any model is more."""
ACCELERATION, GENTLE = deg_to_rad(60.0), deg_to_rad(1.5)
"""Accelerations of moves, rad/s2; with the second even a slow feed shows an arm that accelerates four times as fast."""
LONGEST_DELAY_S = 25.0
"""Longest wait, s, for an accepted motion to begin."""
REST_S = 0.25
"""Time, s, for which an arm at rest is seen at one place."""
ENTER_S = 3.0
"""Longest wait, s, for servo mode to be on, or off."""
NEAR = deg_to_rad(0.05)
"""Largest distance, rad, from a target that was reached."""
_LEAST_RETURN_RAD = deg_to_rad(0.4)
"""Shortest way back, rad, whose curve is kept: some frames show it."""


class Moving:
    """The arm and the facts of one run of the stage.

    Attributes:
        home: Where the joint began, rad.
        sign: Its direction toward zero, 1 or -1.
        program: The name of a loaded program that only waits; "" for none.
    """

    def __init__(self, arm: Mover, facts: Facts, curves: Dict[str, SampledCurve], program: str = "") -> None:
        self.arm = arm
        self.facts = facts
        self.curves = curves
        self.program = program
        self.home = arm.start[AXIS]
        self.sign = -1.0 if self.home > 0.0 else 1.0

    def place(self, degrees: float) -> float:
        """Return the position, rad, so many degrees from home, in the direction of zero."""
        return self.home + self.sign * deg_to_rad(degrees)

    def move(self, degrees: float, speed: float, acceleration: float = ACCELERATION, tolerance: float = 0.0) -> float:
        """Begin, or queue, a move to so many degrees from home; return when it was accepted, monotonic s."""
        self.arm.require(JointMove(self.arm.joints(self.place(degrees)), speed, acceleration, tolerance))
        return time.monotonic()

    def arrives(self, target: float, accepted: float, lasts: float, rest: float = REST_S) -> bool:
        """Wait until the joint rests at its target; return whether it does in time.

        Args:
            target: Its position, rad.
            accepted: When the move was accepted, monotonic s.
            lasts: Longest time, s, of the motion once it has begun.
            rest: Time, s, at one place that is rest.
        """
        return self.arm.wait(LONGEST_DELAY_S + lasts, lambda: abs(self.arm.position - target) <= NEAR
                             and self.arm.has_rested(rest, accepted))

    def jog(self) -> None:
        """Begin a jog, and wait until it has gone 0.5 deg."""
        begun = self.arm.position
        self.arm.require(Jog(JogFrame.JOINT, AXIS, self.sign * JOG_SPEED))
        self.has_gone(begun, 0.5)

    def has_gone(self, begun: float, degrees: float) -> None:
        """Wait until the joint is so many degrees from there; raise MotionEnded where it does not begin to move."""
        if not self.arm.wait(LONGEST_DELAY_S, lambda: abs(self.arm.position - begun) >= deg_to_rad(degrees)):
            raise MotionEnded("it did not move within %.0f s" % LONGEST_DELAY_S)

    def goes_on(self, settle: float = 0.3, watched: float = 0.3) -> Optional[bool]:
        """Return whether the arm still moves a moment later; None where that is not clear."""
        self.arm.wait(settle)
        before = self.arm.position
        self.arm.wait(watched)
        way = abs(self.arm.position - before)
        return False if way <= deg_to_rad(0.02) else True if way >= deg_to_rad(0.1) else None

    def enter_servo(self) -> float:
        """Enter servo mode; return after how long it was on, s."""
        self.arm.require(SetServoMode(True))
        begun = time.monotonic()
        if not self.arm.wait(ENTER_S, self.is_in_servo):
            raise MotionEnded("servo mode was not on after %.0f s" % ENTER_S)
        return time.monotonic() - begun

    def is_in_servo(self) -> bool:
        """Ask whether servo mode is on."""
        return bool(self.told(Query.SERVO_MODE))

    def told(self, query: Query) -> Any:
        """Ask, and return the decoded answer; raise MotionEnded where there is none."""
        try:
            return codec.decode(query, self.arm.require(query))
        except ProtocolError as error:
            raise MotionEnded(str(error)) from error

    def clear_fault(self) -> None:
        """Clear the fault that stands."""
        self.arm.require(ClearError())
        self.arm.wait(1.0, lambda: not self.arm.state.has_fault)

    def back(self) -> None:
        """Move back home, and wait until the arm rests there."""
        if abs(self.arm.position - self.home) <= REST_RAD:
            return
        move = JointMove(self.arm.start, SLOW, ACCELERATION)
        if not any(self.arm.wait(0.1) or self.arm.is_taken(move) for _ in range(5)):
            raise MotionEnded("the move back was not accepted")
        begun = time.monotonic()
        if not self.arrives(self.home, begun, 5.0):
            raise MotionEnded("the arm did not come back")

    def keep_return(self) -> None:
        """Keep the curve of the way back that was just gone, from a rest to a rest, where it is long enough."""
        seen = self.arm.seen
        if abs(seen[-1].position - seen[0].position) < _LEAST_RETURN_RAD:
            return
        moved_at = next(one.at for one in seen if abs(one.position - seen[0].position) >= MOVED_RAD)
        number = 1 + sum(name.startswith(RETURN) for name in self.curves)
        self.curves["%s %d" % (RETURN, number)] = sampled(
            [one for one in seen if one.at >= moved_at - 2.0 * REST_S], moved_at, self.home)


def sampled(seen: Sequence[Seen], at: float, home: float) -> SampledCurve:
    """Return frames as a curve that begins at a moment, s, in degrees from home, rad."""
    return [(round(one.at - at, 4), round(rad_to_deg(one.position - home), 4)) for one in seen]


def come_back(it: Moving, person: Person, tell: PrintLine) -> None:
    """Clear the fault that a starved stream may have caused, and move back home; raise StageEnded where that fails."""
    it.arm.idle()
    if it.arm.state.has_fault:
        if it.facts.get("starvation", Fact(None, "")).value != "fault":
            raise StageEnded("the controller shows a fault, %d" % it.arm.state.error_code)
        tell("clear_error: the stream without frames became a fault")
        why = it.arm.run(it.clear_fault)
        if why or it.arm.state.has_fault:
            raise StageEnded("the fault was not cleared: %s" % (why or it.arm.state.error_code))
    why = it.arm.run(it.back)
    if why:
        raise StageEnded(why)
    it.keep_return()


class MoveStep(NamedTuple):
    """One step of the stage.

    Attributes:
        says: What it does, for the person.
        facts: The names that it settles.
        run: Carries it out.
        question: What the person is asked before it.
        prepare: Called before that.
        finish: Called when the arm rests after it; it raises StageEnded where no other step can follow.
    """

    says: str
    facts: Tuple[str, ...]
    run: Callable[[Moving], None]
    question: str = "the hand at the emergency stop, nobody near?"
    prepare: Callable[[Moving], None] = lambda it: None
    finish: Callable[[Moving, Person, PrintLine], None] = come_back
