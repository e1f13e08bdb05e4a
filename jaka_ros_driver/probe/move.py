"""The stage that moves: one joint, within 3 deg of where it is, at 5 deg/s at most, each step confirmed by a person.

All that it sends is in ``MOVES``, and what stops the arm (``commands.whole_stop``). Each step ends with the arm at
rest; then the joint goes back to where it was.
"""
import math
import time
from typing import Dict, Optional, Sequence, Tuple

from jaka_ros_driver.commands import JogFrame, JogStop, PauseMotion, Pose, SetLinkLoss, Stop
from jaka_ros_driver.probe.ask import NOT_KNOWN, code_of
from jaka_ros_driver.probe.facts import Fact, Facts
from jaka_ros_driver.probe.fit import SampledCurve
from jaka_ros_driver.probe.motion import REST_RAD, ROOM_RAD, MotionEnded, Mover, Seen
from jaka_ros_driver.probe.moving import (
    ACCELERATION,
    AXIS,
    GENTLE,
    MEDIUM,
    MOVED_RAD,
    NEAR,
    REST_S,
    SLOW,
    MoveStep,
    Moving,
    sampled,
)
from jaka_ros_driver.probe.pendant_steps import NOT_ENABLED, PROGRAM, PROGRAM_MOVES
from jaka_ros_driver.probe.person import Person
from jaka_ros_driver.probe.servo_steps import AHEAD, frames_ahead, leave_servo, servo_off_time, starve, stop_servo
from jaka_ros_driver.probe.set_same import PrintLine, StageEnded, note_missing
from jaka_ros_driver.probe.twin import BACK, MOVE, OUT, RETURN, STOP, AskedMotion
from jaka_ros_driver.state import RobotState, unrest
from jaka_ros_driver.units import deg_to_rad, rad_to_deg

_LOSS_COMMAND, _LOSS_S = "set_network_exception_handle", 0.5
"""The command that asks a controller to stop the motion of a client that is lost; how long after that, s."""
MOVES: Dict[str, str] = {
    "joint_move": "joint 6 by 2.5 deg at most, at 3 deg/s at most, and back; to where it is, while it is not enabled",
    "jog": "joint 6 at 1.5 deg/s for two seconds at most; its stop, also that of another joint, and of all joints",
    "stop_program": "during each of these motions, and while a program runs",
    "pause_program": "during a move",
    _LOSS_COMMAND: "stop %.1f s after the loss of the client, tried in a move of 0.25 deg/s; then no stop" % _LOSS_S,
    "servo_move": "into servo mode and out of it",
    "servo_j": "joint 6 by 2.4 deg at most, at 7 deg/s at most",
    "is_in_servomove": "whether servo mode is on",
    **dict.fromkeys(PROGRAM_MOVES, "of the loaded program that --program names"),
    "clear_error": "where a servo stream without frames has become a fault, and there was none before",
}
"""All commands that this stage sends, and what for."""
_LONGEST_TURN = deg_to_rad(300.0)
"""Largest position, rad, of a joint 6 that moves toward zero: far from every model's limits."""
_LARGEST_SWING_M = 0.02
"""Largest way, m, on which the tool's tip is swung by joint 6: ``ROOM_RAD`` and ``ROOM_M`` count on it."""
_LATE_INPOS_S = 3.3
"""Time, s, for which ``inpos`` is waited for after rest: it counts as late up to 2.8 s, as never beyond."""
_LOSS_SPEED, _LOSS_WATCHED_S, _LOSS_UNSURE_S = deg_to_rad(0.25), 12.0, 0.3
"""Speed, rad/s, of the move whose client is lost, which ends by itself in the room; for how long it is watched, s; the
largest difference, s, of its time from what its way tells.
"""
_GENTLE_REST_S = 0.6
"""Time, s, at one place that is rest after a gentle move: one of a fifth of its acceleration creeps at its end."""
_JUNCTION, _AROUND, _BLEND_M = 1.25, 0.2, 0.005
"""Place of the junction of two moves, and the way around it that is looked at, deg; the first one's tolerance, m."""

ASKED = {name: AskedMotion(rad_to_deg(speed), rad_to_deg(acceleration)) for name, speed, acceleration in (
    (MOVE, SLOW, ACCELERATION), (OUT, MEDIUM, GENTLE), (BACK, MEDIUM, GENTLE), (STOP, MEDIUM, ACCELERATION),
    (RETURN, SLOW, ACCELERATION))}
"""The speeds and accelerations that were asked for in the motions whose curves are kept."""


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
    it.arm.wait(10.0, lambda: it.arm.has_rested(REST_S, began + REST_S))
    it.arm.wait(_LATE_INPOS_S)
    it.curves[MOVE] = sampled(it.arm.seen, began, it.home)
    it.facts["inpos"] = inpos_fact(it.arm.seen, began)


def _profile(it: Moving) -> None:
    for name, degrees in ((OUT, 2.5), (BACK, 0.0)):
        accepted = it.move(degrees, MEDIUM, GENTLE)
        begun = it.arm.position
        if not it.arrives(it.place(degrees), accepted, 8.0, _GENTLE_REST_S):
            raise MotionEnded("it did not arrive")
        frames = [one for one in it.arm.seen if one.at >= accepted]
        moved_at = next((one.at for one in frames if abs(one.position - begun) >= MOVED_RAD), accepted)
        it.curves[name] = sampled([one for one in frames if one.at >= moved_at - 2.0 * REST_S], accepted, it.home)


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
    it.arm.wait(2.0, lambda: it.arm.has_rested(REST_S, at))
    it.curves[STOP] = sampled(it.arm.seen, at, it.home)
    facts = stop_facts(it.arm.seen, at)
    if abs(it.arm.position - it.place(2.5)) <= NEAR:
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


def _blend(it: Moving) -> None:
    """Queue two moves along one line, there with a tolerance and back without: how long are they at their junction?"""
    found = []
    for tolerance, middle, end in ((_BLEND_M, _JUNCTION, 2.0 * _JUNCTION), (0.0, _JUNCTION, 0.0)):
        accepted = it.move(middle, MEDIUM, GENTLE, tolerance)
        it.move(end, MEDIUM, GENTLE, tolerance)
        if not it.arrives(it.place(end), accepted, 10.0, _GENTLE_REST_S):
            raise MotionEnded("it did not arrive")
        found.append(dwell(sampled([one for one in it.arm.seen if one.at >= accepted], accepted, it.home)))
    it.facts["joint_blend"] = blend_fact(dwell(it.curves.get(OUT, [])), found[0], found[1])


def dwell(curve: SampledCurve) -> Optional[float]:
    """Return for how long, s, a motion was within 0.2 deg of the junction of two moves; None where it was not seen."""
    times = []
    for edge in (_JUNCTION - _AROUND, _JUNCTION + _AROUND):
        times += [t0 + (edge - abs(p0)) / (abs(p1) - abs(p0)) * (t1 - t0)
                  for (t0, p0), (t1, p1) in zip(curve, curve[1:])
                  if min(abs(p0), abs(p1)) <= edge < max(abs(p0), abs(p1))][:1]
    return abs(times[1] - times[0]) if len(times) == 2 else None


def blend_fact(passing: Optional[float], with_tolerance: Optional[float], without: Optional[float]) -> Fact:
    """Return whether the tolerance of a joint move is kept, by the times at the place of its target.

    Args:
        passing: Of one move that only passes there, s; None where it was not seen.
        with_tolerance: Of a move that ends there and has a tolerance, with another one queued, s.
        without: The same without a tolerance.
    """
    if passing is None or with_tolerance is None or without is None:
        return Fact(None, "the motions were not seen whole")
    how = "%.2f s within %.1f deg of its target with a tolerance, %.2f s without, %.2f s where nothing ends there" % (
        with_tolerance, _AROUND, without, passing)
    if without < 1.6 * passing:
        return Fact(None, how + ": no stop shows without a tolerance either")
    share = (with_tolerance - passing) / (without - passing)
    return Fact(True if share <= 0.3 else False if share >= 0.7 else None, how)


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
    _jog_stop_all(it)


def _jog_stop_all(it: Moving) -> None:
    it.back()
    it.jog()
    for axis in range(6):  # as the maker's SDK does (docs/sdk-client.md section 5)
        it.arm.is_taken(JogStop(JogFrame.JOINT, axis))
    moves = it.goes_on()
    it.facts["jog_stop_all"] = Fact(None if moves is None else not moves,
                                    "a jog of joint 6, after the requests to stop joints 1 to 6")


def _pause(it: Moving) -> None:
    it.move(2.5, SLOW)
    it.has_gone(it.home, 0.5)
    it.arm.is_taken(PauseMotion())
    moves = it.goes_on(0.3, 0.2)
    it.facts["pause_pauses_moves"] = Fact(None if moves is None else not moves,
                                          "a move of joint 6, after pause_program")


def _link_loss(it: Moving) -> None:
    """Close the command port in a move that stays in the room even where nothing stops it: when does it stop?"""
    it.arm.put_back = SetLinkLoss(0.0)
    reply = it.arm.ask(SetLinkLoss(_LOSS_S))
    code = "" if reply is None else code_of(reply)
    if code == NOT_KNOWN:
        note_missing(it.facts, _LOSS_COMMAND)
    if code != "0":
        it.arm.put_back = None if code else it.arm.put_back
        raise MotionEnded("%s is %s" % (_LOSS_COMMAND, "refused with code %s" % code if code else "not answered"))
    it.move(2.4, _LOSS_SPEED)
    it.has_gone(it.home, 0.1)
    cut = time.monotonic()
    it.arm.hang_up()
    it.arm.wait(_LOSS_WATCHED_S, lambda: it.arm.has_rested(2.0 * REST_S, cut + REST_S))
    it.facts.update(loss_facts(it.arm.seen, cut, it.place(2.4)))


def loss_facts(seen: Sequence[Seen], cut: float, target: float) -> Facts:
    """Return what the frames of a move toward a target, rad, whose client was lost at a moment, s, say of that."""
    after = [one for one in seen if one.at > cut]
    if len(after) < 3 or abs(after[-1].position - after[-3].position) > REST_RAD:
        return {"link_loss_stops": Fact(None, "it was not seen at rest")}
    if abs(after[-1].position - target) <= NEAR:
        return {"link_loss_stops": Fact(False, "a move whose client was lost went on to its end")}
    rest = next(one for one in after if abs(one.position - after[-1].position) <= REST_RAD)
    lasted, by_way = rest.at - cut, abs(rest.position - after[0].position) / _LOSS_SPEED
    how = "a move rested %.2f s after its connection was closed, and was to do so after %.1f s" % (lasted, _LOSS_S)
    if abs(lasted - by_way) > _LOSS_UNSURE_S:
        return {"link_loss_stops": Fact(True, how), "link_loss_notice": Fact(
            None, "%s; its way tells %.2f s, so that the arm was not as fast as it was to be" % (how, by_way))}
    return {"link_loss_stops": Fact(True, how), "link_loss_notice": Fact(round(max(0.0, lasted - _LOSS_S), 2), how)}


STEPS: Tuple[MoveStep, ...] = (
    MoveStep("moves joint 6 by 2 deg at 2 deg/s: when does it begin, when is inpos true?", ("start_delay", "inpos"),
         _first_move),
    MoveStep("moves it by 2.5 deg and back at 3 deg/s, accelerating at 1.5 deg/s2: how does its acceleration build up?",
             (), _profile),
    MoveStep("moves it by 2.5 deg at 3 deg/s and stops it after 0.8 deg by stop_program: how long does that take?",
         ("stop_ends_move", "stop_time", "stop_distance", "stop_deceleration"), _stop_move),
    MoveStep("moves it by 1.25 deg and on to 2.5 deg, and back, at 3 deg/s: does it stop between the two with tol?",
             ("joint_blend",), _blend),
    MoveStep("jogs it at 1.5 deg/s and sends stop_program after 0.5 deg: does that end a jog?", ("stop_ends_jog",),
         _stop_jog),
    MoveStep("jogs it at 1.5 deg/s and stops the jog of joint 1, then its own: which ends it? Then another one, and "
             "stops those of all joints", ("jog_stop_ends", "jog_stop_all"), _jog_stop),
    MoveStep("moves it by 2.5 deg at 2 deg/s and sends pause_program after 0.5 deg: does it pause?",
         ("pause_pauses_moves",), _pause),
    MoveStep("streams it in servo mode by 1.1 deg at 5 deg/s, with gaps, and ends without frames: what does it do?",
         ("servo_on_time", "servo_gaps", "starvation"), starve),
    MoveStep("sends %d servo frames at once, twice, which lead it by 0.54 deg at most: how many of them count?" % AHEAD,
             ("servo_queue",), frames_ahead),
    MoveStep("streams it at 2 deg/s and leaves servo mode in the middle of a frame: does the frame run out?",
         ("stop_drops_frames",), leave_servo),
    MoveStep("enters and leaves servo mode without a motion: when is it off?", ("servo_leave_delay",), servo_off_time),
    MoveStep("streams it at 2 deg/s and sends stop_program in the middle of a frame: does that end the stream?",
         ("stop_ends_servo",), stop_servo),
    MoveStep("moves it by 2.4 deg at 0.25 deg/s, having asked the controller to stop the arm %.1f s after the loss of "
             "its client, and closes the connection: when does it stop?" % _LOSS_S,
             ("link_loss_stops", "link_loss_notice"), _link_loss),
    PROGRAM,
    NOT_ENABLED,
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


def move(arm: Mover, facts: Facts, curves: Dict[str, SampledCurve], person: Person, tell: PrintLine,
         program: str = "") -> None:
    """Run the steps, each after the person's consent.

    Args:
        arm: The arm at rest.
        facts: Takes what is found, also where this is interrupted.
        curves: Takes the curves by name.
        person: Confirms each step.
        tell: Takes a line before each step.
        program: The name of a loaded program that only waits; "" for none, so that it is not played.

    Raises:
        StageEnded: The person or the arm ended it; the arm rests.
        MotionEnded: The arm was not seen at rest.
    """
    it = Moving(arm, facts, curves, program)
    steps = [step for step in STEPS if program or step is not PROGRAM]
    try:
        for number, step in enumerate(steps, 1):
            tell("step %d of %d %s" % (number, len(steps), step.says))
            step.prepare(it)
            if person.ask("%s y begins this step: " % step.question, arm.idle).lower() != "y":
                raise StageEnded("step %d was not confirmed" % number)
            why = arm.run(lambda: step.run(it))  # noqa: B023  (it is called before the next turn)
            for name in step.facts:
                facts.setdefault(name, Fact(None, why or "it was not seen"))
            if why:
                tell("ended before its time: %s" % why)
            step.finish(it, person, tell)
    finally:
        facts["room"] = Fact(round(1000.0 * arm.furthest_m, 1), "the joint was %.2f deg from its start at most" % (
            rad_to_deg(arm.furthest_rad)))
