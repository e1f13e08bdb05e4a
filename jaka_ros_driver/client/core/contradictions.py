"""The table of contradictions: what forbids a motion to begin, and what ends one, for each kind of motion.

Start checks and the watch over a motion in custody read the same rows, so that nothing that forbids a motion goes
unnoticed once it moves. A cell that is no refusal and no stop has its reason beside it.
"""
import enum
import math
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from jaka_ros_driver.client.core.motion import MotionOwner, event_text
from jaka_ros_driver.errors import InvalidCommand, MotionInterrupted, StopCause
from jaka_ros_driver.state import PROGRAM_UNDER_WAY, RobotState

_JUMP_SLACK = 0.05
"""Change of a joint, rad, between two frames that is never a jump."""
_JUMP_FACTOR = 1.2
"""Factor of a joint's highest speed up to which its change is no jump.

With less, a joint at full speed behind a late frame would be one; with more, short jumps pass.
"""
_LATE_FRAME_S = 0.15
"""Delay, s, of a frame before the feed counts as silent (feed.SILENCE_S): the arm moved on meanwhile."""
_TOOL_SLACK = 0.02
"""Change of the tool's position, m, that is never a jump."""
_TOOL_REACH = 3.0
"""Largest way of the tool, m, for each rad of a joint's turn, tool included."""

STREAMS = (MotionOwner.SERVO, MotionOwner.TRAJECTORY, MotionOwner.VELOCITY_JOG)
"""Kinds of motion in servo mode."""
PLANNED = (MotionOwner.MOVE, MotionOwner.PATH, MotionOwner.JOG)
"""Kinds of motion that the controller plans, each from one command."""
MOTIONS = (*PLANNED, MotionOwner.PROGRAM, *STREAMS)


class ArmEvidence(NamedTuple):
    """The knowledge of the arm at one moment.

    Attributes:
        state: The newest fresh state.
        is_guided: Somebody guides the arm by hand.
        servo_mode: The controller's latest answer whether it is in servo mode; None for nothing.
        wants_servo_mode: Whether the motion needs servo mode; None while it enters or leaves it.
        jump: Which joint has jumped, in words; "" for none.
        frames: Which tool or user frame has changed since the motion began, in words; "" for none.
        is_new_event: The event in the state was not there when the motion began.
    """

    state: RobotState
    is_guided: bool
    servo_mode: Optional[bool] = None
    wants_servo_mode: Optional[bool] = None
    jump: str = ""
    frames: str = ""
    is_new_event: bool = False


class AtStart(enum.Enum):
    """The effect of a condition on a motion that is to begin."""

    REFUSES = "is refused at once"
    WAITS = "waits for its end, 2.3 s at most"
    ALLOWS = "may begin"


class Contradiction(NamedTuple):
    """One condition that contradicts motion.

    Attributes:
        name: The condition, in words.
        cause: Why a motion is stopped; None where the condition does not hold.
        at_start: What it does to a motion that is to begin.
        refusal: The text of that refusal; "%s" stands for the cause.
        except_for: Motions that it does not stop or refuse, and why.
        why_at_start: The reason where a motion may begin all the same.
    """

    name: str
    cause: Callable[[ArmEvidence], Optional[MotionInterrupted]]
    at_start: AtStart = AtStart.REFUSES
    refusal: str = "refused, the arm cannot move: %s"
    except_for: Mapping[MotionOwner, str] = {}
    why_at_start: str = ""


def _if(holds: Callable[[RobotState], bool], cause: StopCause,
        text: Callable[[RobotState], str] = lambda state: "") -> Callable[[ArmEvidence], Optional[MotionInterrupted]]:
    return lambda seen: MotionInterrupted(cause, text(seen.state)) if holds(seen.state) else None


def _new_fault(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    state = seen.state
    is_fault = seen.is_new_event and state.has_fault and not state.has_warning
    return MotionInterrupted(StopCause.FAULT, event_text(state)) if is_fault else None


def _hand_guiding(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    return MotionInterrupted(StopCause.FAULT, "hand guiding is on") if seen.is_guided else None


def _foreign_program(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    runs = seen.state.program_state in PROGRAM_UNDER_WAY
    return MotionInterrupted(StopCause.FAULT, "a program of the controller's own runs") if runs else None


def _servo_mode(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    if seen.servo_mode is None or seen.wants_servo_mode is None or seen.servo_mode is seen.wants_servo_mode:
        return None
    return MotionInterrupted(StopCause.FAULT, "the controller is in servo mode, for another client" if seen.servo_mode
                             else "the controller has left servo mode")


def _jump(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    return MotionInterrupted(StopCause.FAULT, seen.jump) if seen.jump else None


def _frames(seen: ArmEvidence) -> Optional[MotionInterrupted]:
    return MotionInterrupted(StopCause.FAULT, seen.frames) if seen.frames else None


_STANDING: Tuple[Contradiction, ...] = (
    Contradiction("emergency stop", _if(lambda s: s.emergency_stop, StopCause.EMERGENCY_STOP)),
    Contradiction("protective stop", _if(lambda s: s.protective_stop, StopCause.PROTECTIVE_STOP, event_text)),
    Contradiction("no power", _if(lambda s: not s.is_powered, StopCause.NOT_ENABLED,
                                  lambda s: "the drives have no power")),
    Contradiction("drives disabled", _if(lambda s: not s.is_enabled, StopCause.NOT_ENABLED, event_text)))

TABLE: Tuple[Contradiction, ...] = (
    *_STANDING,
    Contradiction("new fault", _new_fault, AtStart.ALLOWS,
                  why_at_start="an event that stood before the motion, without a stop, is history: controllers go on "
                  "to show it"),
    Contradiction("hand guiding", _hand_guiding,
                  refusal="refused: hand guiding owns the arm's motion; switch it off first",
                  except_for={MotionOwner.PROGRAM: "a program may ask for hand guiding itself"}),
    Contradiction("another's program", _foreign_program, AtStart.WAITS,
                  "refused: a program of the controller's own runs; stop it first",
                  except_for={MotionOwner.PROGRAM: "it is this motion"}),
    Contradiction("program not told", _if(lambda s: s.program_state is None, StopCause.FAULT,
                                          lambda s: "the controller does not tell any more whether its program runs"),
                  refusal="refused: this controller does not tell whether a program runs (interp_state)",
                  except_for=dict.fromkeys((*PLANNED, *STREAMS), "its end is seen in the joints")),
    Contradiction("servo mode", _servo_mode, AtStart.WAITS,
                  "refused: the controller is in servo mode, for another client; stop_move leaves it"),
    Contradiction("joints jump", _jump, AtStart.ALLOWS,
                  why_at_start="no frame counts until it shows the arm where the controller says it is, and then at "
                  "rest"),
    Contradiction("another frame", _frames, AtStart.ALLOWS,
                  except_for={MotionOwner.PROGRAM: "a program selects its frames itself"},
                  why_at_start="its targets mean the frames that are active when it begins"))


def standing_cause(state: RobotState) -> Optional[MotionInterrupted]:
    """Return why the arm cannot move in this state; None where nothing stands against it."""
    return _first(_STANDING, ArmEvidence(state, False))


def require_drives(state: RobotState) -> None:
    """Check that the drives are ready.

    Raises:
        InvalidCommand: Something forbids motion.
    """
    cause = standing_cause(state)
    if cause is not None:
        raise InvalidCommand("refused, the arm cannot move: %s" % cause)


def cause_of_stop(owner: MotionOwner, seen: ArmEvidence) -> Optional[MotionInterrupted]:
    """Return why a motion of this kind must be stopped; None where nothing contradicts it."""
    return _first([row for row in TABLE if owner not in row.except_for], seen)


def _first(rows: Sequence[Contradiction], seen: ArmEvidence) -> Optional[MotionInterrupted]:
    for row in rows:
        cause = row.cause(seen)
        if cause is not None:
            return cause
    return None


def require_start(owner: MotionOwner, seen: ArmEvidence) -> None:
    """Check that nothing forbids a motion of this kind to begin at once or after a wait.

    Raises:
        InvalidCommand: Something does.
    """
    _refuse(owner, seen, AtStart.REFUSES)


def require_no_wait(owner: MotionOwner, seen: ArmEvidence) -> None:
    """Check that no condition holds whose end a motion of this kind would have to wait for; errors as
    ``require_start``.
    """
    _refuse(owner, seen, AtStart.WAITS)


def _refuse(owner: MotionOwner, seen: ArmEvidence, kind: AtStart) -> None:
    for row in TABLE:
        cause = row.cause(seen) if row.at_start is kind and owner not in row.except_for else None
        if cause is not None:
            raise InvalidCommand(row.refusal % cause if "%s" in row.refusal else row.refusal)


class JumpWatch:
    """The detector of joints that change faster than the arm can move, between one fresh state and the next."""

    def __init__(self, joint_max_speed: Sequence[float]) -> None:
        """Set up without a state.

        joint_max_speed: rad/s, base first.
        """
        self._speeds = tuple(joint_max_speed)
        self._last: Optional[RobotState] = None

    def jump(self, state: RobotState) -> str:
        """Take a fresh state; return which joint has jumped since the one before, in words, "" for none."""
        last, self._last = self._last, state
        if last is None:
            return ""
        elapsed = state.received_at - last.received_at
        reach = _JUMP_FACTOR * (elapsed + _LATE_FRAME_S)
        for joint, (before, now, speed) in enumerate(zip(last.joint_position, state.joint_position, self._speeds), 1):
            if abs(now - before) > _JUMP_SLACK + reach * speed:
                return "joint %d jumps by %.3f rad within %.3f s" % (joint, now - before, elapsed)
        return ""

    def lose_sight(self) -> None:
        """Forget the last state: the next one may show anything."""
        self._last = None


class Watch:
    """The check of every fresh state of one motion, from before its first byte."""

    def __init__(self, owner: MotionOwner, before: Optional[RobotState]) -> None:
        """Remember the state before the motion.

        before: The newest state before the motion.
        """
        self._owner = owner
        self._known_event = 0 if before is None else before.error_code
        self._last = before
        self._frames: Dict[str, Optional[int]] = {"tool": None, "user frame": None}
        if before is not None:
            self._frames_changed(before)

    def cause(self, state: RobotState, jump: str = "") -> Optional[MotionInterrupted]:
        """Return why the motion must be stopped; None where this state does not contradict it.

        ``jump``: which joint has jumped to it, in words.
        """
        is_new = state.error_code != self._known_event
        if is_new:
            self._known_event = 0
        return cause_of_stop(self._owner, ArmEvidence(state, bool(state.is_hand_guided), jump=jump, is_new_event=is_new,
                                                      frames=self._frames_changed(state) or self._pose_jump(state)))

    def _frames_changed(self, state: RobotState) -> str:
        for name, shown in (("tool", state.tool_id), ("user frame", state.user_frame_id)):
            known = self._frames[name]
            if known is None:
                self._frames[name] = shown
            elif shown is not None and shown != known:
                return "the active %s changes from %d to %d" % (name, known, shown)
        return ""

    def _pose_jump(self, state: RobotState) -> str:
        """Return that the tool's pose jumps and its joints do not, in words; "" otherwise: the ids need not show
        another frame.
        """
        if state.tcp_position is None:
            return ""
        last, self._last = self._last, state
        if last is None or last.tcp_position is None:
            return ""
        turned = sum([abs(a - b) for a, b in zip(last.joint_position, state.joint_position)])
        way = math.dist(last.tcp_position, state.tcp_position)
        if way <= _TOOL_SLACK + _TOOL_REACH * turned:
            return ""
        return "the tool's pose jumps by %.3f m, and its joints do not: another tool or user frame is active" % way


def described() -> List[Dict[str, str]]:
    """Return the table as rows of text, for pages and tests: condition, start, effect on each running motion."""
    rows = []
    for row in TABLE:
        start = row.at_start.value + (": " + row.why_at_start if row.why_at_start else "")
        cells = {"condition": row.name, "start": start}
        cells.update((owner.value, row.except_for.get(owner, "stops")) for owner in MOTIONS)
        rows.append(cells)
    return rows
