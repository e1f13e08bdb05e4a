"""Rules about a motion in custody: it begins in time, and whatever contradicts it stops it.

Judged by what the driver has read and what it sends. What it has not read it cannot know.
"""
from typing import Any, Dict, Optional, Set, Tuple

from controller_room import STREAMED, ControllerRoom, Reply, is_motion
from status_feed import Frame
from verdict import RuleBroken, Verdicts

from jaka_ros_driver.state import ProgramState, RobotState, Vector

START_WINDOW = 1.0
"""Time within which an accepted motion begins, or is stopped, s."""
START_SLACK = 0.35
"""Slack over the window, s: three frames of the slowest feed (0.1 s), which show that the arm still rests, and the
judge's own look (0.04 s)."""
REACTION = 0.05
_MUST_BEGIN = ("joint_move", "moveL", "movc", "jog")
"""Requests after whose acceptance the arm itself moves; servo mode waits for targets, a program may wait for I/O."""
_BEGUN = 1e-5
_BELIEVED_S = 0.14
"""Pause, s, after which frames may count as old news (feed.SILENCE_S, 0.15 s)."""
_NEWS_OF_A_PIECE = 5
"""Frames at the end of what is read at once that count as news; those before them waited (feed.MAX_BURST)."""
_STANDS_FOR = 3
"""Frames; what one frame alone shows may be damage, unless it is a stop or a fault."""


class MotionRules:
    """The judge of one motion after the other, each from the notification that the arm moves to the one that it
    rests."""

    def __init__(self, room: ControllerRoom, verdicts: Verdicts, lateness: float) -> None:
        self._room, self._verdicts = room, verdicts
        self._reaction = REACTION + 8.0 * lateness
        self._is_under_way = False
        self._told_at = -1e9
        self._kind = ""
        self._start: Vector = ()
        self._accepted_at: Optional[float] = None
        self._has_begun = False
        self._streams = False
        self._code = 0
        self._due: Dict[str, Tuple[float, str]] = {}
        self._seen: Dict[str, int] = {}
        self._codes: Set[int] = set()
        self._is_paused = False
        self._frame: Optional[Frame] = None
        self._shown_at = -1e9
        self._lied_at = -1e9
        self._excused_until = -1e9

    # ---- what happens ----

    def tells(self, is_moving: bool, now: float) -> None:
        """Note that the driver takes custody of a motion, or gives it up."""
        self._told_at = now
        self._is_under_way = is_moving
        self._kind, self._accepted_at = "", None
        self._start = self._room.controller.state.plant.joint_position
        self._has_begun = self._streams = self._is_paused = False
        self._due, self._seen = {}, {}
        self._codes = {0, self._code}

    def sends(self, request: Dict[str, Any], now: float) -> None:
        """Note a request that goes out."""
        name = request["cmdName"]
        if name == "stop_program" or (name == "servo_move" and not request["relFlag"]):
            if self._is_under_way:
                for due, _ in self._due.values():
                    self._verdicts.uses("REACTION", now - due + self._reaction)
                if self._has_yet_to_begin():
                    due = max(self._accepted_at + START_WINDOW, self._lied_at + START_WINDOW, self._excused_until)
                    self._verdicts.uses("START_SLACK", now - due)
            self.ended()
        elif is_motion(request) and not self._kind:
            self._kind = name
        elif name == "pause_program":
            self._is_paused = True
        elif name in STREAMED:
            self._streams = True  # the driver takes servo mode for entered: from now on it must last

    def _has_yet_to_begin(self) -> bool:
        return (self._accepted_at is not None and self._kind in _MUST_BEGIN and not self._has_begun
                and not self._is_paused)

    def ended(self) -> None:
        """Stop judging a motion that is being stopped, or left, or whose link is lost: other rules apply from then
        on."""
        self._is_under_way = False
        self._due = {}

    def reads_reply(self, reply: Reply, now: float) -> None:
        """Note a reply that the driver has read."""
        request = reply.request
        if not self._is_under_way or not isinstance(request, dict):
            return
        if reply.command in STREAMED:
            if not reply.is_accepted and self._streams:
                self._contradicts("refused frame", now, "a servo frame was refused")
        elif is_motion(request) and reply.is_accepted:
            if not self._has_begun:
                self._accepted_at = now
        elif reply.command == "is_in_servomove" and self._kind == "servo_move":
            is_in = b'"in_servomove": true' in reply.text or b'"in_servomove": 1' in reply.text
            if self._streams and not is_in and reply.is_accepted:
                self._contradicts("not in servo mode", now, "the controller reports that servo mode is off")

    def reads_frame(self, frame: Frame, followers: int, now: float) -> None:
        """Note a frame before the driver takes it: joints that jump in a feed that is believed stop a motion.

        ``followers``: frames behind it that were read with it.
        """
        is_repeated = self._frame is not None and self._frame.jumps
        self._frame = frame
        if frame.is_old:  # it may show the arm under way that has yet to begin; from then on its rest is waited for
            self._lied_at = now
        is_accepted = self._accepted_at is not None and now > self._accepted_at
        if (frame.jumps and not is_repeated and self._is_under_way and is_accepted
                and now - self._shown_at < _BELIEVED_S and followers < _NEWS_OF_A_PIECE):
            self._contradicts("jump", now, "the joints were shown to jump")

    def shown(self, state: RobotState, now: float) -> None:
        """Note a frame that the driver took for new."""
        self._code, self._shown_at = state.error_code, now
        if now == self._told_at:
            self._codes.add(self._code)  # the motion began because of this frame, in spite of its code
        is_accepted = self._accepted_at is not None and now > self._accepted_at
        if not self._is_under_way or not is_accepted:
            return
        if self._frame is not None and self._frame.shows_fault:
            self._contradicts("stop", now, "an emergency or protective stop was shown")
        elif not state.is_powered or not state.is_enabled:
            self._contradicts("drives off", now, "drives were shown to be off")
        if state.error_code not in self._codes and state.has_fault and not state.has_warning:
            self._contradicts("fault", now, "fault 0x%X was shown" % state.error_code)
        is_program = self._kind in ("play_program", "resume_program")
        self._stands("hand guiding", bool(state.is_hand_guided) and not is_program, now, "hand guiding was shown")
        self._stands("program", state.program_state == ProgramState.RUNNING and not is_program, now,
                     "a program was shown that this driver does not play")

    def _stands(self, check: str, holds: bool, now: float, text: str) -> None:
        self._seen[check] = self._seen.get(check, 0) + 1 if holds else 0
        if self._seen[check] >= _STANDS_FOR:
            self._contradicts(check, now, text)

    def _contradicts(self, check: str, now: float, text: str) -> None:
        self._due.setdefault(check, (now + self._reaction, text))

    # ---- each look ----

    def look(self, now: float, excused_until: float) -> None:
        """Judge the reactions that are due; before ``excused_until`` the driver could not see, or not act."""
        self._excused_until = excused_until
        if not self._is_under_way:
            return
        for due, text in self._due.values():
            if now > max(due, excused_until):
                raise RuleBroken("against", now, "%s %.3f s ago in a motion begun by %s, and no stop was sent" % (
                    text, now - due + self._reaction, self._kind))
        if not self._has_yet_to_begin():
            return
        joints = self._room.controller.state.plant.joint_position
        if max([abs(a - b) for a, b in zip(joints, self._start)]) > _BEGUN:
            self._has_begun = True
        elif now > max(self._accepted_at + START_WINDOW, self._lied_at + START_WINDOW, excused_until) + START_SLACK:
            raise RuleBroken("late", now, "%s was accepted %.3f s ago, the arm has not begun to move, and no stop was "
                             "sent" % (self._kind, now - self._accepted_at))
