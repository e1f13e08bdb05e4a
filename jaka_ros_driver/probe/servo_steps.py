"""The steps of the stage that moves which stream servo frames."""
import time
from typing import Optional, Sequence

from jaka_ros_driver.commands import ServoJoint, SetServoMode, Stop
from jaka_ros_driver.probe.facts import Fact
from jaka_ros_driver.probe.motion import CYCLE_S, REST_RAD, MotionEnded, Seen
from jaka_ros_driver.probe.moving import ENTER_S, REST_S, Moving
from jaka_ros_driver.protocol import codec
from jaka_ros_driver.protocol.framing import encode_object
from jaka_ros_driver.units import deg_to_rad, rad_to_deg

GAPS_MS = (8, 16, 40, 100)
"""Lengths, ms, of pauses of a servo stream."""
_DRY, _BEYOND = 1.1, 0.8
"""Place, deg from home, where a stream of 5 deg/s runs dry; way, deg, of an arm that goes on, at which it is stopped.

That way, and not a time, ends the wait: a busy computer looks late.
"""
_TRIES, _CLEAR_S = 3, 0.02
"""Most measurements of a short time, until its least and its greatest value differ by less than this, s."""
AHEAD, _AHEAD_CYCLES, AHEAD_RAD = 54, 12, deg_to_rad(0.02)
"""Number of frames that are sent at once, the cycles of each, and the way, rad, of every other one.

From the first to the last target they lead so little that none is faster than the others may be, whichever are ignored.
"""
_AHEAD_REST_S, _AHEAD_BEGINS_S = 0.6, 0.5
"""Time, s, at one place that is rest: longer than three of these frames; and time that the first one has to begin."""


def starve(it: Moving) -> None:
    """Stream with gaps, and end without frames: what does the arm do?"""
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
    if len(taken) == len(GAPS_MS):
        for degrees in (0.03, 0.12, 0.28, 0.5):
            it.arm.stream(it.place(degrees), 10)
        it.arm.stream(it.place(_DRY), 15)
    ended = time.monotonic()
    it.arm.wait(0.25, lambda: abs(it.arm.position - it.home) >= deg_to_rad(_DRY + _BEYOND))
    fact = starvation_fact(it.arm.seen, ended, it.place(_DRY), it.place(0.5), had_fault)
    if not had_fault and fact.value != "fault" and not it.is_in_servo():
        fact = Fact("fault", "servo mode was off after a pause without frames; the feed showed no error")
    it.facts["starvation"] = fact


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


def frames_ahead(it: Moving) -> None:
    """Send frames at once, every other of which holds: how many count?"""
    it.facts["servo_queue"] = ahead_fact(_way_of_frames(it, it.sign, True), _way_of_frames(it, -it.sign, False))


def _way_of_frames(it: Moving, sign: float, moves_first: bool) -> Optional[float]:
    """Send frames at once; return the way, in ways of one frame, or None where the arm goes on after the last.

    An arm that repeats what the last one did rests after one that holds.
    """
    it.enter_servo()
    begun = it.arm.position
    frames = [ServoJoint(it.arm.joints(begun + sign * AHEAD_RAD * ((number + 1 + moves_first) // 2)),
                         cycles=_AHEAD_CYCLES) for number in range(AHEAD)]
    sent = time.monotonic()
    it.arm.send(b"".join(encode_object(codec.encode(frame)) for frame in frames))
    rests = it.arm.wait(AHEAD * _AHEAD_CYCLES * CYCLE_S + 2.0,
                        lambda: it.arm.has_rested(_AHEAD_REST_S, sent + _AHEAD_BEGINS_S))
    way = abs(it.arm.position - begun) / AHEAD_RAD
    if it.arm.state.has_fault:
        if it.facts.get("starvation", Fact(None, "")).value != "fault":
            raise MotionEnded("a fault came, %d" % it.arm.state.error_code)
        it.clear_fault()
    it.arm.require(SetServoMode(False))
    if not it.arm.wait(ENTER_S, lambda: not it.is_in_servo() and it.arm.has_rested(REST_S)):
        raise MotionEnded("servo mode was still on, or the arm moved, after %.0f s" % ENTER_S)
    return way if rests else None


def ahead_fact(moving_first: Optional[float], holding_first: Optional[float]) -> Fact:
    """Return how many frames wait, by the ways of two lots of frames that were sent at once.

    Every other frame moves the arm by one way, the others hold. Each value is the way of a lot, in such ways, and None
    where the arm went on after its last frame.

    Args:
        moving_first: Of the lot whose first frame moves the arm.
        holding_first: Of the lot whose first frame holds.
    """
    ways = [None if way is None else int(round(way)) for way in (moving_first, holding_first)]
    how = "of %d frames of %.0f ms, of which every other one moved the arm, %%s" % (
        AHEAD, 1000.0 * _AHEAD_CYCLES * CYCLE_S)
    if any(way is not None and abs(way - round(way)) > 0.25 for way in (moving_first, holding_first)):
        return Fact(None, how % "some moved it in part: %s and %s" % (moving_first, holding_first))
    first, second = ways
    if first is not None and second is not None:
        counted = first + second if first - second in (0, 1) else 0
    else:
        counted = 2 * first if first is not None else 2 * second + 1 if second is not None else 0
    if not counted:
        return Fact(None, how % "%s and %s moved it in two tries" % (first, second))
    return Fact(counted - 1, how % ("%d counted" % counted if counted < AHEAD else "all counted: more may wait"))


def leave_servo(it: Moving) -> None:
    """Leave servo mode in the middle of a frame: does it run out?"""
    it.enter_servo()
    begun = it.arm.position
    it.arm.send(_long_frame(it))
    it.has_gone(begun, 0.4)
    it.arm.require(SetServoMode(False))
    moves = it.goes_on(0.2, 0.2)
    it.facts["stop_drops_frames"] = Fact(None if moves is None else not moves,
                                         "a servo frame of 1.2 s, after servo_move 0")


def servo_off_time(it: Moving) -> None:
    """Enter and leave servo mode: when is it off?"""
    spans = []
    for _ in range(_TRIES):
        it.enter_servo()
        it.arm.wait(0.1)
        sent = time.monotonic()
        it.arm.require(SetServoMode(False))
        accepted = last_on = asked = time.monotonic()
        while it.is_in_servo():
            if asked > accepted + ENTER_S:
                raise MotionEnded("servo mode was still on after %.0f s" % ENTER_S)
            last_on, asked = asked, time.monotonic()
        spans.append((last_on - accepted, time.monotonic() - sent))
        if spans[-1][1] - spans[-1][0] < _CLEAR_S:
            break
    least, most = min(spans, key=lambda span: span[1] - span[0])
    how = "is_in_servomove was asked again and again: %.4f to %.4f s" % (least, most)
    it.facts["servo_leave_delay"] = Fact(round(0.5 * (least + most), 4) if most - least < 2.0 * _CLEAR_S else None, how)


def stop_servo(it: Moving) -> None:
    """Send ``stop_program`` in the middle of a frame: does that end the stream?"""
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
