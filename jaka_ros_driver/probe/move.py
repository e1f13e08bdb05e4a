"""The stage that moves: one joint, within 3 deg of where it is, at 5 deg/s at most, each step confirmed by a person.

All that it sends is in ``MOVES``, and what stops the arm (``commands.whole_stop``). Each step ends with the arm at
rest; then the joint goes back to where it was.
"""
import math
import time
from typing import Callable, Dict, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.commands import (
    ClearError,
    Jog,
    JogFrame,
    JogStop,
    JointMove,
    PauseMotion,
    Pose,
    Query,
    ServoJoint,
    SetServoMode,
    Stop,
)
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fit import SampledCurve
from jaka_ros_driver.probe.motion import CYCLE_S, REST_RAD, ROOM_RAD, MotionEnded, Mover, Seen
from jaka_ros_driver.probe.person import Person
from jaka_ros_driver.probe.set_same import PrintLine, StageEnded
from jaka_ros_driver.probe.twin import BACK, MOVE, OUT, STOP, AskedMotion
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.state import RobotState, unrest
from jaka_ros_driver.units import deg_to_rad, rad_to_deg

MOVES: Dict[str, str] = {
    "joint_move": "joint 6 by 2.5 deg at most, at 3 deg/s at most, and back",
    "jog": "joint 6 at 1.5 deg/s for two seconds at most; its stop, also that of another joint",
    "stop_program": "during each of these motions",
    "pause_program": "during a move",
    "servo_move": "into servo mode and out of it",
    "servo_j": "joint 6 by 2.4 deg at most, at 7 deg/s at most",
    "is_in_servomove": "whether servo mode is on",
    "clear_error": "where a servo stream without frames has become a fault, and there was none before",
}
"""All commands that this stage sends, and what for."""
AXIS = 5
"""The joint that moves, 0 to 5: the flange, which turns the tool and moves nothing else."""
MOVED_RAD = 2e-4
"""Change, rad, of a joint that has begun to move."""
SLOW, MEDIUM, JOG_SPEED = deg_to_rad(2.0), deg_to_rad(3.0), deg_to_rad(1.5)
"""Speeds of moves and jogs, rad/s; 5 % of the slowest joint of any model is more."""
ACCELERATION, GENTLE = deg_to_rad(60.0), deg_to_rad(4.0)
"""Accelerations of moves, rad/s2; the second is so small that frames show how it builds up."""
LONGEST_DELAY_S = 25.0
"""Longest wait, s, for an accepted motion to begin."""
GAPS_MS = (8, 16, 40, 100)
"""Lengths, ms, of pauses of a servo stream."""
_LONGEST_TURN = deg_to_rad(300.0)
"""Largest position, rad, of a joint 6 that moves toward zero: far from every model's limits."""
_LARGEST_SWING_M = 0.02
"""Largest way, m, on which the tool's tip is swung by joint 6: ``ROOM_RAD`` and ``ROOM_M`` count on it."""
_LATE_INPOS_S = 3.3
"""Time, s, for which ``inpos`` is waited for after rest: it counts as late up to 2.8 s, as never beyond."""
_REST_S = 0.25
"""Time, s, without a change that counts as rest: longer than any pause of a motion that goes on, and two frames of 10
Hz."""
_ENTER_S = 3.0
"""Longest wait, s, until servo mode is on; after it the stage ends, and leaves the arm where it is."""
_NEAR = deg_to_rad(0.05)
_TRIES, _CLEAR_S = 3, 0.02
"""Most measurements of a short time, until its least and its greatest value differ by less than this, s."""

ASKED = {name: AskedMotion(rad_to_deg(speed), rad_to_deg(acceleration)) for name, speed, acceleration in (
    (MOVE, SLOW, ACCELERATION), (OUT, MEDIUM, GENTLE), (BACK, MEDIUM, GENTLE), (STOP, MEDIUM, ACCELERATION))}
"""The speeds and accelerations that were asked for in the motions whose curves are kept."""


class MoveStep(NamedTuple):
    """One step of the stage.

    Attributes:
        says: What it does, for the person.
        facts: The names that it settles.
        run: Carries it out.
    """

    says: str
    facts: Tuple[str, ...]
    run: Callable[["Moving"], None]


class Moving:
    """The arm and the facts of one run of the stage."""

    def __init__(self, arm: Mover, facts: Facts, curves: Dict[str, SampledCurve]) -> None:
        self.arm = arm
        self.facts = facts
        self.curves = curves
        self.home = arm.start[AXIS]
        self._sign = -1.0 if self.home > 0.0 else 1.0

    def place(self, degrees: float) -> float:
        """Return the position, rad, so many degrees from home, in the direction of zero."""
        return self.home + self._sign * deg_to_rad(degrees)

    def move(self, degrees: float, speed: float, acceleration: float = ACCELERATION) -> float:
        """Begin a move to so many degrees from home; return when it was accepted, monotonic s."""
        self.arm.require(JointMove(self.arm.joints(self.place(degrees)), speed, acceleration))
        return time.monotonic()

    def jog(self) -> None:
        """Begin a jog, and wait until it has gone 0.5 deg."""
        begun = self.arm.position
        self.arm.require(Jog(JogFrame.JOINT, AXIS, self._sign * JOG_SPEED))
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
        if not self.arm.wait(_ENTER_S, self.is_in_servo):
            raise MotionEnded("servo mode was not on after %.0f s" % _ENTER_S)
        return time.monotonic() - begun

    def is_in_servo(self) -> bool:
        """Ask whether servo mode is on."""
        return bool(codec.decode(Query.SERVO_MODE, self.arm.require(Query.SERVO_MODE)))

    def back(self) -> None:
        """Move back home, and wait until the arm rests there."""
        if abs(self.arm.position - self.home) <= REST_RAD:
            return
        move = JointMove(self.arm.start, SLOW, ACCELERATION)
        if not any(self.arm.wait(0.1) or self.arm.is_taken(move) for _ in range(5)):
            raise MotionEnded("the move back was not accepted")
        begun = time.monotonic()
        if not self.arm.wait(LONGEST_DELAY_S + 5.0, lambda: abs(self.arm.position - self.home) <= _NEAR
                             and self.arm.has_rested(_REST_S, begun)):
            raise MotionEnded("the arm did not come back")


# ---- the steps ----

def _first_move(it: Moving) -> None:
    sent = time.monotonic()
    accepted = it.move(2.0, SLOW)
    it.has_gone(it.home, 0.1)
    began = next((one.at for one in it.arm.seen if one.at >= sent and abs(one.position - it.home) >= MOVED_RAD),
                 accepted)  # a reply may come later than the motion that it accepts
    lag = math.sqrt(2.0 * MOVED_RAD / ACCELERATION)
    it.facts["start_delay"] = Fact(round(max(0.0, began - accepted - lag), 3),
                                   "joint 6 was first seen to move %.3f s after the reply" % (began - accepted))
    it.arm.wait(10.0, lambda: it.arm.has_rested(_REST_S, began + _REST_S))
    it.arm.wait(_LATE_INPOS_S)
    it.curves[MOVE] = _curve(it.arm.seen, began, it.home)
    it.facts["inpos"] = inpos_fact(it.arm.seen, began)


def _profile(it: Moving) -> None:
    for name, degrees in ((OUT, 2.5), (BACK, 0.0)):
        accepted = it.move(degrees, MEDIUM, GENTLE)
        begun, target = it.arm.position, it.place(degrees)
        if not it.arm.wait(LONGEST_DELAY_S + 8.0, lambda: abs(it.arm.position - target) <= _NEAR  # noqa: B023
                           and it.arm.has_rested(_REST_S, accepted)):  # noqa: B023  (it is called before the next turn)
            raise MotionEnded("it did not arrive")
        frames = [one for one in it.arm.seen if one.at >= accepted]
        moved_at = next((one.at for one in frames if abs(one.position - begun) >= MOVED_RAD), accepted)
        it.curves[name] = _curve([one for one in frames if one.at >= moved_at - 2.0 * _REST_S], accepted, it.home)


def inpos_fact(seen: Sequence[Seen], began: float) -> Fact:
    """Return when ``inpos`` is true, by the frames of a move that began at this moment, s, and the time after it."""
    last = seen[-1].position
    rest_at = next(one.at for index, one in enumerate(seen)
                   if all(abs(later.position - last) <= REST_RAD for later in seen[index:]))
    moving = [one.is_in_position for one in seen if began + 0.1 <= one.at <= rest_at - 0.15]
    true_at = next((one.at for one in seen if one.at >= rest_at - 0.05 and one.is_in_position), None)
    if len(moving) < 3:
        return Fact(None, "%d frames showed it move" % len(moving))
    how = "true in %d of %d frames of a move" % (sum(moving), len(moving))
    if all(moving):
        return Fact("early", how)
    if any(moving):
        return Fact(None, how)
    if true_at is None:
        waited = seen[-1].at - rest_at
        return Fact("never" if waited >= _LATE_INPOS_S - 0.3 else None, "%s, nor within %.1f s of rest" % (how, waited))
    late = max(0.0, true_at - rest_at)
    return Fact("exact" if late <= 0.6 else "late" if 1.5 <= late <= 2.8 else None,
                "%s; true %.2f s after rest" % (how, late))


def _stop_move(it: Moving) -> None:
    it.move(2.5, MEDIUM)
    it.has_gone(it.home, 0.8)
    at = time.monotonic()
    it.arm.require(Stop())
    it.arm.wait(2.0, lambda: it.arm.has_rested(_REST_S, at))
    it.curves[STOP] = _curve(it.arm.seen, at, it.home)
    facts = stop_facts(it.arm.seen, at)
    if abs(it.arm.position - it.place(2.5)) <= _NEAR:
        facts = {"stop_ends_move": Fact(False, "the move went on to its end")}
    it.facts.update(facts)


def stop_facts(seen: Sequence[Seen], at: float) -> Facts:
    """Return what the frames around a stop that was sent at this moment, s, say of it."""
    before = [one for one in seen if at - 0.25 <= one.at <= at]
    after = [one for one in seen if one.at > at]
    if len(before) < 3 or len(after) < 3:
        return {"stop_time": Fact(None, "%d frames came before it and %d after" % (len(before), len(after)))}
    speed = abs(before[-1].position - before[0].position) / (before[-1].at - before[0].at)
    last = after[-1].position
    rest = next(one for index, one in enumerate(after)
                if all(abs(later.position - last) <= REST_RAD for later in after[index:]))
    way, period = abs(last - before[-1].position), (after[-1].at - after[0].at) / (len(after) - 1)
    how = "from %.2f deg/s, frames every %.0f ms" % (rad_to_deg(speed), 1000.0 * period)
    facts = {"stop_ends_move": Fact(True, how),
             "stop_time": Fact(round(rest.at - at, 3), how),
             "stop_distance": Fact(round(rad_to_deg(way), 3), how)}
    braked = rest.at - at
    facts["stop_deceleration"] = Fact(
        None, "%s: the stop took %.0f ms, too short for these frames" % (how, 1000.0 * braked)
    ) if braked < 5.0 * period else Fact(round(rad_to_deg(speed) / braked, 1), how)
    return facts


def _curve(seen: Sequence[Seen], at: float, home: float) -> SampledCurve:
    return [(round(one.at - at, 4), round(rad_to_deg(one.position - home), 4)) for one in seen]


def _stop_jog(it: Moving) -> None:
    it.jog()
    it.arm.require(Stop())
    moves = it.goes_on()
    it.facts["stop_ends_jog"] = Fact(None if moves is None else not moves, "a jog of joint 6, after stop_program")


def _jog_stop(it: Moving) -> None:
    it.jog()
    it.arm.is_taken(JogStop(JogFrame.JOINT, 0))
    moves = it.goes_on()
    if moves is False:
        it.facts["jog_stop_ends"] = Fact("any", "a jog of joint 6 ended by the stop of joint 1")
    elif moves:
        it.arm.is_taken(JogStop(JogFrame.JOINT, AXIS))
        ended = it.goes_on() is False
        it.facts["jog_stop_ends"] = Fact(
            "its axis" if ended else None,
            "a jog of joint 6 went on after the stop of joint 1%s" % ("" if ended else ", and after its own"))
    else:
        it.facts["jog_stop_ends"] = Fact(None, "whether it moved on was not clear")


def _pause(it: Moving) -> None:
    it.move(2.5, SLOW)
    it.has_gone(it.home, 0.5)
    it.arm.is_taken(PauseMotion())
    moves = it.goes_on(0.3, 0.2)
    it.facts["pause_pauses_moves"] = Fact(None if moves is None else not moves,
                                          "a move of joint 6, after pause_program")


def _starve(it: Moving) -> None:
    had_fault = it.arm.state.has_fault
    it.facts["servo_on_time"] = Fact(round(it.enter_servo(), 4), "is_in_servomove was asked again and again")
    taken = []
    for gap in GAPS_MS:
        it.arm.stream(it.place(0.05), 5)
        it.arm.wait(gap / 1000.0)
        if not it.arm.is_taken(it.arm.frame(it.place(0.0), 10)):
            break
        taken.append(gap)
        it.arm.wait(12 * CYCLE_S)
    it.facts["servo_gaps"] = Fact(taken, "the next frame was accepted")
    for degrees in (0.03, 0.12, 0.28, 0.5):
        it.arm.stream(it.place(degrees), 10)
    it.arm.stream(it.place(1.5), 25)
    ended = time.monotonic()
    it.arm.wait(0.25)
    it.facts["starvation"] = starvation_fact(it.arm.seen, ended, it.place(1.5), it.place(0.5), had_fault)


def starvation_fact(seen: Sequence[Seen], ended: float, target: float, before: float, had_fault: bool) -> Fact:
    """Return what an arm does without servo frames.

    Args:
        seen: Frames.
        ended: When the last servo frame was over, monotonic s.
        target: Its position, rad.
        before: A position, rad, that lies before it on the way.
        had_fault: A fault stood before.
    """
    if had_fault:
        return Fact(None, "a fault stood before")
    if any(one.has_fault for one in seen):
        return Fact("fault", "a fault came after the last frame")
    after = [one for one in seen if one.at > ended + 0.02]
    if len(after) < 2:
        return Fact(None, "%d frames came in time" % len(after))
    sign = 1.0 if target > before else -1.0
    beyond, way = sign * (after[-1].position - target), abs(after[-1].position - after[0].position)
    how = "%.3f deg beyond the last frame" % rad_to_deg(beyond)
    if way > deg_to_rad(0.2) and beyond > 0.0:
        return Fact("repeat", how + ", and it moved on")
    if way > REST_RAD or beyond < -1e-4:
        return Fact(None, how)
    return Fact("hold" if beyond < 1e-4 else "coast" if beyond > 2e-4 else None, how)


def _leave_servo(it: Moving) -> None:
    it.enter_servo()
    begun = it.arm.position
    it.arm.send(_long_frame(it))
    it.has_gone(begun, 0.4)
    it.arm.require(SetServoMode(False))
    moves = it.goes_on(0.2, 0.2)
    it.facts["stop_drops_frames"] = Fact(None if moves is None else not moves,
                                         "a servo frame of 1.2 s, after servo_move 0")


def _servo_off_time(it: Moving) -> None:
    spans = []
    for _ in range(_TRIES):
        it.enter_servo()
        it.arm.wait(0.1)
        sent = time.monotonic()
        it.arm.require(SetServoMode(False))
        accepted = last_on = asked = time.monotonic()
        while it.is_in_servo():
            if asked > accepted + _ENTER_S:
                raise MotionEnded("servo mode was still on after %.0f s" % _ENTER_S)
            last_on, asked = asked, time.monotonic()
        spans.append((last_on - accepted, time.monotonic() - sent))
        if spans[-1][1] - spans[-1][0] < _CLEAR_S:
            break
    least, most = min(spans, key=lambda span: span[1] - span[0])
    how = "is_in_servomove was asked again and again: %.4f to %.4f s" % (least, most)
    it.facts["servo_leave_delay"] = Fact(round(0.5 * (least + most), 4) if most - least < 2.0 * _CLEAR_S else None, how)


def _stop_servo(it: Moving) -> None:
    it.enter_servo()
    begun = it.arm.position
    it.arm.send(_long_frame(it))
    it.has_gone(begun, 0.4)
    it.arm.require(Stop())
    moves = it.goes_on(0.2, 0.2)
    how = "a servo frame of 1.2 s, after stop_program"
    if moves is False:
        it.facts["stop_ends_servo"] = Fact(True, how)
        return
    is_taken = it.arm.is_taken(ServoJoint((0.0,) * 6, relative=True))
    drops = it.facts.get("stop_drops_frames", Fact(None, "")).value
    if moves and is_taken and drops is not None:
        it.facts["stop_ends_servo"] = Fact(False, how + ": it went on, and frames are taken")
    elif moves and not is_taken and drops is False:
        it.facts["stop_ends_servo"] = Fact(True, how + ": it ran out, and no more are taken")
    else:
        it.facts["stop_ends_servo"] = Fact(None, how + ": it ran out")


def _long_frame(it: Moving) -> bytes:
    return encode_object(codec.encode(ServoJoint(it.arm.joints(it.place(2.4)), cycles=150)))


STEPS: Tuple[MoveStep, ...] = (
    MoveStep("moves joint 6 by 2 deg at 2 deg/s: when does it begin, when is inpos true?", ("start_delay", "inpos"),
         _first_move),
    MoveStep("moves it by 2.5 deg and back at 3 deg/s, accelerating at 4 deg/s2: how does its acceleration build up?",
             (), _profile),
    MoveStep("moves it by 2.5 deg at 3 deg/s and stops it after 0.8 deg by stop_program: how long does that take?",
         ("stop_ends_move", "stop_time", "stop_distance", "stop_deceleration"), _stop_move),
    MoveStep("jogs it at 1.5 deg/s and sends stop_program after 0.5 deg: does that end a jog?", ("stop_ends_jog",),
         _stop_jog),
    MoveStep("jogs it at 1.5 deg/s and stops the jog of joint 1, then its own: which ends it?", ("jog_stop_ends",),
         _jog_stop),
    MoveStep("moves it by 2.5 deg at 2 deg/s and sends pause_program after 0.5 deg: does it pause?",
         ("pause_pauses_moves",), _pause),
    MoveStep("streams it in servo mode by 1.5 deg at 5 deg/s, with gaps, and ends without frames: what does it do?",
         ("servo_on_time", "servo_gaps", "starvation"), _starve),
    MoveStep("streams it at 2 deg/s and leaves servo mode in the middle of a frame: does the frame run out?",
         ("stop_drops_frames",), _leave_servo),
    MoveStep("enters and leaves servo mode without a motion: when is it off?", ("servo_leave_delay",), _servo_off_time),
    MoveStep("streams it at 2 deg/s and sends stop_program in the middle of a frame: does that end the stream?",
         ("stop_ends_servo",), _stop_servo),
)
"""The steps, in their order."""


# ---- the stage ----

def why_not(states: Sequence[RobotState], tools: Optional[Sequence[Pose]]) -> str:
    """Return why the arm is not moved, after these newest states and with these tools by id; "" where it may be."""
    state = states[-1] if states else None
    if state is None or unrest(states):
        return unrest(states)
    if not state.is_powered or not state.is_enabled or state.emergency_stop or state.protective_stop or state.has_fault:
        return "the arm is not powered and enabled without a fault"
    if state.is_hand_guided:
        return "hand guiding is on"
    if state.rapid_rate is not None and state.rapid_rate < 0.999:
        return "the speed override is %.0f %%, so times would not be the controller's own" % (100.0 * state.rapid_rate)
    if abs(state.joint_position[AXIS]) > _LONGEST_TURN:
        return "joint 6 is at %.0f deg, too far from zero" % rad_to_deg(state.joint_position[AXIS])
    if tools is None:
        return "the tools are not known, so nobody knows how far they swing"
    swing = max([math.hypot(*tool.position[:2]) for tool in tools], default=0.0) * ROOM_RAD
    if swing > _LARGEST_SWING_M:
        return "a tool stands %.0f mm from the axis of joint 6, and would swing more than %.0f mm" % (
            1000.0 * swing / ROOM_RAD, 1000.0 * _LARGEST_SWING_M)
    return ""


def move(arm: Mover, facts: Facts, curves: Dict[str, SampledCurve], person: Person, tell: PrintLine) -> None:
    """Run the steps, each after the person's consent.

    Args:
        arm: The arm at rest.
        facts: Takes what is found, also where this is interrupted.
        curves: Takes the curves by name.
        person: Confirms each step.
        tell: Takes a line before each step.

    Raises:
        StageEnded: The person or the arm ended it; the arm rests.
        MotionEnded: The arm was not seen at rest.
    """
    it = Moving(arm, facts, curves)
    try:
        for number, step in enumerate(STEPS, 1):
            tell("step %d of %d %s" % (number, len(STEPS), step.says))
            if person.ask("the hand at the emergency stop, nobody near? y begins this step: ", arm.idle).lower() != "y":
                raise StageEnded("step %d was not confirmed" % number)
            why = arm.run(lambda: step.run(it))  # noqa: B023  (it is called before the next turn)
            for name in step.facts:
                facts.setdefault(name, Fact(None, why or "it was not seen"))
            if why:
                tell("ended before its time: %s" % why)
            _clear_fault(it, person, tell)
            why = arm.run(it.back)
            if why:
                raise StageEnded(why)
    finally:
        facts["room"] = Fact(round(1000.0 * arm.furthest_m, 1), "the joint was %.2f deg from its start at most" % (
            rad_to_deg(arm.furthest_rad)))


def _clear_fault(it: Moving, person: Person, tell: PrintLine) -> None:
    """Clear the fault that a starved stream may have caused."""
    it.arm.idle()
    if not it.arm.state.has_fault:
        return
    if it.facts.get("starvation", Fact(None, "")).value != "fault":
        raise StageEnded("the controller shows a fault, %d" % it.arm.state.error_code)
    tell("clear_error: the stream without frames became a fault")

    def clear() -> None:
        it.arm.require(ClearError())
        it.arm.wait(1.0, lambda: not it.arm.state.has_fault)
    why = it.arm.run(clear)
    if why or it.arm.state.has_fault:
        raise StageEnded("the fault was not cleared: %s" % (why or it.arm.state.error_code))
