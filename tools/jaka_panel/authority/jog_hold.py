"""The dead-man between a page whose button is held and the driver's velocity jog.

One message goes to the driver for each heartbeat that counts, and none without: whatever stops the heartbeats, the
page, the network or this process, stops the arm by the driver's own freshness of 0.2 s (docs/velocity_jog.md). Where
this process is alive it publishes zero before that, when no heartbeat has counted for ``MISSED_S``.

A hold, one press of a button, that has ended is dead: its later heartbeats count nothing, so that nothing resumes.
"""
import math
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

PERIOD_S = 0.05
"""Period of a page's heartbeats, s."""
MISSED_S = 0.15
"""Time without a valid heartbeat after which the hold ends, s."""
SEEN_S = 0.25
"""Greatest age, s, of the newest state that a page has shown at a heartbeat; nobody moves the arm by an older one."""
TRIP_S = 0.15
"""Longest round trip, s, of a link to jog over: heartbeats still count, and the arm rests 0.3 s after the last one."""
LATE_S = 0.1
"""Excess delay, s, over its page's quickest heartbeats from which on a heartbeat counts as held up on its way."""
OTHER_TOPIC_S = 0.75
"""Time after the last heartbeat on one jog topic during which the other carries zero velocity, s.

Joints and tool are two topics, hence two publishers to the driver: for 0.5 s after a message on one it accepts none on
the other (docs/velocity_jog.md).
"""
FRACTION = 0.1
"""Share of the driver's own jog limits with which everybody begins."""
SPACES = ("joint", "base", "tool")
_WINDOW_S = 10.0
"""Time, s, over which a page's quickest heartbeat is known: clocks drift, and ways change."""
_MOVED_RAD = 1e-4
"""Change of a joint, rad, that is a motion and no noise."""
_STEP_GAIN = 3.0
"""1/s; a step is slower the nearer it is to its end."""
_SLOWEST_SHARE = 0.02
"""Least speed of a step, as a share of the full one: with less its end is never reached."""
_STEP_DONE_SHARE = 0.02
"""Share of a step that may be missing at its end: a small step is exact to ``_STEP_DONE``."""
_STEP_DONE = {"length": 2e-5, "angle": 5e-5}
"""Distance to the end of a step, m and rad, at which the step is done."""
_LARGEST_STEP = {"length": 0.1, "angle": 0.35}
"""Largest step, m and rad: what a person sees at once, and can take back."""


class JogSpeedLimits(NamedTuple):
    """Speeds at a fraction of 1: of a joint, rad/s, of the tool, m/s, and of its turning, rad/s."""

    joint: float
    linear: float
    angular: float


class Place(NamedTuple):
    """The place of an arm: joints, rad (6,); the tool's position, m, and rotation vector, rad (3,) each, or None."""

    joints: Tuple[float, ...]
    tool: Optional[Tuple[Tuple[float, ...], Tuple[float, ...]]]


class Velocity(NamedTuple):
    """A velocity command: of the joints, rad/s, or of the tool, m/s and rad/s, in a space of ``SPACES``."""

    arm: str
    space: str
    values: Tuple[float, ...]


_Notify = Callable[[str, Dict[str, Any]], None]
"""Told what becomes of a hold: the page, and the message to it."""
Say = Callable[[Velocity], None]
"""Says a velocity to the driver, now."""


class WrongHeartbeat(ValueError):
    """A heartbeat that cannot be understood."""


class Heartbeat(NamedTuple):
    """One heartbeat, its fields checked.

    Attributes:
        arm: The arm to jog.
        hold: Number of the press of a button.
        sequence: Number of the heartbeat, which rises with each.
        clock: The page's own clock, s.
        echo: The server's clock at the newest state that the page has shown, s.
        space: One of ``SPACES``.
        share: Shares of the jog speed, -1 to 1 each (6,).
        step: Way after which the hold is over, m or rad; None: it goes on.
    """

    arm: str
    hold: int
    sequence: int
    clock: float
    echo: float
    space: str
    share: Tuple[float, ...]
    step: Optional[float]

    @property
    def axis(self) -> int:
        """The axis of a step."""
        return next(n for n, value in enumerate(self.share) if value)

    @property
    def is_turn(self) -> bool:
        """True if a step is an angle, False if it is a length."""
        return self.space == "joint" or self.axis > 2


def heartbeat_from(message: Mapping[str, Any]) -> Heartbeat:
    """Parse a page's heartbeat message; raise WrongHeartbeat if it is invalid."""
    space, step = message.get("space"), message.get("step")
    share = message.get("v")
    if not isinstance(space, str) or space not in SPACES:
        raise WrongHeartbeat("space is one of %s" % ", ".join(SPACES))
    if not isinstance(share, list) or len(share) != 6 or not all(_is_number(value) and abs(value) <= 1.0
                                                                 for value in share):
        raise WrongHeartbeat("v is six numbers within -1 to 1")
    hold, sequence, clock, echo = (message.get(key) for key in ("hold", "seq", "clock", "echo"))
    if type(hold) is not int or type(sequence) is not int or not _is_number(clock) or not _is_number(echo):
        raise WrongHeartbeat("hold and seq are whole numbers, clock and echo numbers")
    beat = Heartbeat(str(message.get("arm")), hold, sequence, float(str(clock)) / 1000.0, float(str(echo)), space,
                     tuple(map(float, share)), None if step is None else float(step) if _is_number(step) else -1.0)
    if beat.step is not None:
        moving = [abs(value) for value in beat.share if value]
        if moving != [1.0]:
            raise WrongHeartbeat("a step goes along one axis, 1 or -1")
        largest = _LARGEST_STEP["angle" if beat.is_turn else "length"]
        if not 0.0 < beat.step <= largest:
            raise WrongHeartbeat("step is above 0, and at most %g %s" % (largest, "rad" if beat.is_turn else "m"))
    return beat


class DelayEstimate:
    """An estimate of the delay of one page's messages over its quickest ones, by the page's clock."""

    def __init__(self) -> None:
        self._ways: Deque[Tuple[float, float]] = deque()

    def of(self, clock: float, now: float) -> float:
        """Return the excess delay, s, of a message sent at ``clock``, received at ``now``; their zeros may differ."""
        way = now - clock
        while self._ways and self._ways[0][0] < now - _WINDOW_S:
            self._ways.popleft()
        while self._ways and self._ways[-1][1] >= way:
            self._ways.pop()
        self._ways.append((now, way))
        return way - self._ways[0][1]


class _Hold:
    """A button that is held."""

    def __init__(self, page: str, beat: Heartbeat, now: float) -> None:
        self.page, self.arm, self.number, self.space = page, beat.arm, beat.hold, beat.space
        self.counted_at = now
        self.begin: Optional[Place] = None
        self.moves = False
        self.late = 0


class JogHold:
    """One hold at a time, of the page that has control.

    Attributes:
        fraction: Share of the limits, 0 to 1; ``FRACTION`` whenever control changes hands.
    """

    def __init__(self, say: Say, tell: _Notify) -> None:
        self.fraction = FRACTION
        self._say, self._tell = say, tell
        self._hold: Optional[_Hold] = None
        self._before: Optional[Tuple[str, bool, float]] = None
        self._sequence: Dict[str, int] = {}
        self._dead: Dict[str, int] = {}

    @property
    def arm(self) -> Optional[str]:
        """The arm that is held now."""
        return self._hold.arm if self._hold is not None else None

    def heartbeat(self, page: str, beat: Heartbeat, lateness: float, place: Optional[Place], limits: JogSpeedLimits,
                  now: float) -> None:
        """Handle a heartbeat of the page that has control.

        Args:
            page: The page that sent it.
            beat: The heartbeat.
            lateness: s, by its clock, see ``Lateness``.
            place: Present place of the arm; None where its state is not fresh.
            limits: The arm's speeds.
            now: Monotonic time, s.
        """
        if beat.sequence <= self._sequence.get(page, -1) or beat.hold <= self._dead.get(page, -1):
            return
        self._sequence[page] = beat.sequence
        hold = self._hold
        if hold is not None and (hold.page, hold.number) != (page, beat.hold):
            self.end("another button")
            hold = None
        if not -SEEN_S <= now - beat.echo <= SEEN_S or lateness > LATE_S:
            if hold is not None:
                hold.late += 1
            elif now - beat.echo > SEEN_S:
                self.refuse(page, beat, "the link is too slow: what the page shows is %.2f s old" % (now - beat.echo))
            return
        if place is None:
            self.refuse(page, beat, "the arm's state is not fresh")
            return
        if hold is None:
            hold = self._hold = _Hold(page, beat, now)
            hold.begin = place
            self._say(Velocity(beat.arm, beat.space, (0.0,) * 6))
            self._tell_state("holding")
            return
        if (hold.arm, hold.space) != (beat.arm, beat.space):
            self.end("another arm or space")
            return
        if now - hold.counted_at > MISSED_S:
            self.end("missed")
            return
        hold.counted_at = now
        if self._is_other_topic_heard(hold, now):
            self._say(Velocity(hold.arm, hold.space, (0.0,) * 6))
            return
        values = self._values(hold, beat, place, limits)
        if values is None:
            self.end("step done")
            return
        self._say(Velocity(hold.arm, hold.space, values))
        if not hold.moves and hold.begin is not None and _has_moved(hold.begin, place):
            hold.moves = True
            self._tell_state("moving")

    def stop(self, page: str, number: int) -> None:
        """End the hold, as its button was released; one of another page or press changes nothing."""
        self._dead[page] = max(number, self._dead.get(page, -1))
        if self._hold is not None and (self._hold.page, self._hold.number) == (page, number):
            self.end("released")

    def tick(self, now: float) -> None:
        """Time passes: a hold whose heartbeats do not come any more ends."""
        if self._hold is not None and now - self._hold.counted_at > MISSED_S:
            self.end("late" if self._hold.late else "missed")

    def end(self, why: str, arm: Optional[str] = None) -> None:
        """End the hold, of this arm where one is named: publish zero at once; its number is dead."""
        hold = self._hold
        if hold is None or arm not in (None, hold.arm):
            return
        self._say(Velocity(hold.arm, hold.space, (0.0,) * 6))
        self._dead[hold.page] = max(hold.number, self._dead.get(hold.page, -1))
        self._tell_state("ended", why)
        self._before = hold.arm, hold.space == "joint", hold.counted_at
        self._hold = None

    def forget(self, page: str) -> None:
        """Forget a page that has gone."""
        self._sequence.pop(page, None)
        self._dead.pop(page, None)

    def _is_other_topic_heard(self, hold: _Hold, now: float) -> bool:
        """Return whether the driver may still follow the last hold, of the same arm, on its other topic."""
        if self._before is None:
            return False
        arm, was_joint, at = self._before
        return arm == hold.arm and was_joint != (hold.space == "joint") and now - at < OTHER_TOPIC_S

    def refuse(self, page: str, beat: Heartbeat, why: str) -> None:
        """Refuse the press of a heartbeat; end the hold, where there is one."""
        if self._hold is not None:
            self.end(why)
            return
        if beat.hold <= self._dead.get(page, -1):
            return
        self._dead[page] = beat.hold
        self._tell(page, {"t": "jog", "arm": beat.arm, "hold": beat.hold, "state": "ended", "why": "refused: " + why,
                          "late": 0})

    def _tell_state(self, state: str, why: str = "") -> None:
        hold = self._hold
        assert hold is not None
        self._tell(hold.page, {"t": "jog", "arm": hold.arm, "hold": hold.number, "state": state, "why": why,
                               "late": hold.late})

    def _values(self, hold: _Hold, beat: Heartbeat, place: Place,
                limits: JogSpeedLimits) -> Optional[Tuple[float, ...]]:
        """Return the velocities to publish; None if a step is done."""
        full = (limits.joint,) * 6 if beat.space == "joint" else (limits.linear,) * 3 + (limits.angular,) * 3
        speeds = [self.fraction * limit * share for limit, share in zip(full, _not_longer_than_1(beat))]
        if beat.step is None:
            return tuple(speeds)
        gone = _way(hold, beat, place)
        if gone is None:
            return None
        left = beat.step - gone
        done = max(_STEP_DONE["angle" if beat.is_turn else "length"], _STEP_DONE_SHARE * beat.step)
        if left <= done:
            return None
        full_speed = abs(speeds[beat.axis])
        speed = min(full_speed, max(_STEP_GAIN * left, _SLOWEST_SHARE * full_speed))
        return tuple(math.copysign(speed, value) if value else 0.0 for value in speeds)


def _not_longer_than_1(beat: Heartbeat) -> Sequence[float]:
    """Return the shares with the tool's two vectors cut to length 1, so that no diagonal is faster."""
    if beat.space == "joint":
        return beat.share
    parts = []
    for part in (beat.share[:3], beat.share[3:]):
        length = math.sqrt(sum(value * value for value in part))
        parts.append([value / max(1.0, length) for value in part])
    return parts[0] + parts[1]


def _has_moved(begin: Place, place: Place) -> bool:
    return max(abs(a - b) for a, b in zip(begin.joints, place.joints)) > _MOVED_RAD


def _way(hold: _Hold, beat: Heartbeat, place: Place) -> Optional[float]:
    """Return the distance along the axis of a step so far, m or rad; None if the tool's pose is not known."""
    begin, sign = hold.begin, beat.share[beat.axis]
    assert begin is not None
    if beat.space == "joint":
        return sign * (place.joints[beat.axis] - begin.joints[beat.axis])
    if begin.tool is None or place.tool is None:
        return None
    if beat.axis < 3:  # along the tool's axes, which a straight step does not turn, as along the base's
        return math.sqrt(sum((b - a) ** 2 for a, b in zip(begin.tool[0], place.tool[0])))
    return angle_between(begin.tool[1], place.tool[1])


def angle_between(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the angle, rad, 0 to pi, between two orientations, rotation vectors (3,)."""
    a, b = _quaternion(one), _quaternion(other)
    return 2.0 * math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b)))))


def _quaternion(vector: Sequence[float]) -> List[float]:
    angle = math.sqrt(sum(value * value for value in vector))
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return [math.cos(0.5 * angle)] + [scale * value for value in vector]


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value)
