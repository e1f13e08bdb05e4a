"""The status feed of the world's controller: honest frames, and those that lie, lack something or are damaged."""
import random
from collections import deque
from typing import Any, Deque, Dict, List, NamedTuple, Optional, Tuple

from virtual_clock import Clock
from wire import Cable, Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.simulation.controller.executor import Controller
from jaka_ros_driver.simulation.controller.status_frame import all_field_names
from jaka_ros_driver.simulation.server.connection import FRAME_BACKLOG_BYTES
from jaka_ros_driver.units import rad_to_deg

_NEEDED_FIELDS = frozenset((
    "drag_status", "errcode", "errmsg", "joint_actual_position", "actual_position", "interp_state", "enabled",
    "paused", "current_tool_id", "current_user_id", "on_soft_limit", "emergency_stop", "powered_on", "inpos",
    "protective_stop"))
_ESSENTIAL_FIELDS = frozenset((
    "joint_actual_position", "powered_on", "enabled", "inpos", "emergency_stop", "protective_stop"))
_SAME_MOMENT = 1e-6
_KEPT_S = 3.0
"""Time for which frames are kept, to be sent again, s."""


class Frame(NamedTuple):
    """A status frame that has arrived whole, as the driver sees it.

    Attributes:
        made_at: s.
        is_readable: It is whole and has all that a driver needs.
        shows_fault: It shows an emergency or protective stop.
        restarts: How often its controller had been restarted.
        is_old: It comes on time, and shows another moment, or one that never was.
        jumps: It shows the joints far from where they were a moment ago.
        copies: How often it stands in its bytes.
    """

    made_at: float
    is_readable: bool
    shows_fault: bool
    restarts: int
    is_old: bool = False
    jumps: bool = False
    copies: int = 1


class FeedFaults:
    """The present faults of the status feed; times are ends, s."""

    def __init__(self) -> None:
        self.shown: Dict[str, Any] = {}
        self.shown_until = 0.0
        self.shown_frames = 0
        self.dropped: Tuple[str, ...] = ()
        self.dropped_until = 0.0
        self.silent_until = 0.0
        self.mangled_frames = 0
        self.mangle = ""
        self.frozen_until = -10.0
        self.frozen: Optional[Tuple[bytes, Frame]] = None
        self.old_frames = 0
        self.old_by = 0.0
        self.jumping_frames = 0
        self.jump_by = 0.0


class StatusFeed:
    """The sender of one controller's frames.

    Attributes:
        faults: Its faults.
        restarts: How often the controller was restarted.
        frozen_joints: Where the arm was when the feed began to repeat itself, rad (6,).
    """

    def __init__(self, clock: Clock, network: Network, chance: random.Random, controller: Controller,
                 has_all_fields: bool) -> None:
        self.faults = FeedFaults()
        self.restarts = -1
        self._clock, self._network, self._chance, self._controller = clock, network, chance, controller
        self._has_all_fields = has_all_fields
        self._next_frame = clock.now
        self._kept_text: Tuple[Any, bytes] = (None, b"")
        self._sent: Deque[Tuple[bytes, Frame]] = deque()
        self.frozen_joints: Tuple[float, ...] = ()
        self.start()

    def start(self) -> None:
        """Start with the controller."""
        state = self._controller.state
        if not self._has_all_fields:
            for name in all_field_names(state.firmware):
                if name not in _NEEDED_FIELDS:
                    state.memory.field_switches[name] = False
        self.restarts += 1
        self._next_frame = self._clock.now

    def cycle(self) -> None:
        """Send a frame where one is due."""
        now = self._clock.now
        if now >= self._next_frame - _SAME_MOMENT:
            self._next_frame = max(self._next_frame + self._controller.state.feed_period, now)
            self._send_frame(now)

    def _send_frame(self, now: float) -> None:
        clients = [cable for cable in self._network.on(Port.STATUS) if cable.controller_knows]
        faults = self.faults
        if not clients or now < faults.silent_until:
            return
        state = self._controller.state
        copies = 2 if faults.mangled_frames > 0 and faults.mangle == "twice" else 1
        text, is_readable, shows_fault = self._frame_text(now)
        frame = Frame(now, is_readable, shows_fault or state.emergency_stop or state.protective_stop, self.restarts,
                      copies=copies)
        if now < faults.frozen_until:
            if faults.frozen is None:
                faults.frozen = text, frame
                self.frozen_joints = state.plant.joint_position
            text, frame = faults.frozen[0], faults.frozen[1]._replace(made_at=now, is_old=True)
        else:
            faults.frozen = None
        if faults.jumping_frames > 0:
            faults.jumping_frames -= 1
            text = self._jumped()
            frame = frame._replace(is_old=True, jumps=True, is_readable=True, shows_fault=False, copies=1)
        self._put(clients, text, frame)
        if faults.old_frames > 0:
            old = next(((text, old) for text, old in self._sent if old.made_at >= now - faults.old_by), None)
            if old is not None:
                faults.old_frames -= 1
                self._put(clients, old[0], old[1]._replace(is_old=True))
        self._sent.append((text, frame))
        while self._sent[0][1].made_at < now - _KEPT_S:
            self._sent.popleft()

    @staticmethod
    def _put(clients: List[Cable], text: bytes, frame: Frame) -> None:
        for cable in clients:
            if cable.to_driver.unsent_bytes <= FRAME_BACKLOG_BYTES:
                cable.to_driver.send(text, frame, frame.copies)

    def _jumped(self) -> bytes:
        """Return a frame whose joints are somewhere else, as from a sensor that has lost count."""
        frame, joints = self._controller.feed_frame, self._controller.state.plant.joint_position
        frame.added = {"joint_actual_position": [rad_to_deg(value + self.faults.jump_by) for value in joints]}
        text = frame.text()
        frame.added = {}
        return text

    @property
    def frame_bytes(self) -> int:
        """The size of a frame, bytes."""
        return len(self._honest_text())

    def _frame_text(self, now: float) -> Tuple[bytes, bool, bool]:
        """Return the text, whether it is readable, and whether it shows a stop that there is not."""
        faults, frame = self.faults, self._controller.feed_frame
        is_shown = now < faults.shown_until or faults.shown_frames > 0
        if faults.shown_frames > 0:
            faults.shown_frames -= 1
        is_dropped = now < faults.dropped_until
        dropped = {name for name in faults.dropped if is_dropped and not (is_shown and name in faults.shown)}
        if is_shown or is_dropped:
            frame.added = faults.shown if is_shown else {}
            frame.dropped = faults.dropped if is_dropped else ()
            text = frame.text()
            frame.added, frame.dropped = {}, ()
        else:
            text = self._honest_text()
        if faults.mangled_frames > 0:
            faults.mangled_frames -= 1
            return self._mangled(text, faults.mangle), faults.mangle in ("twice", "noise before"), False
        shows_fault = is_shown and not {"emergency_stop", "protective_stop"}.isdisjoint(faults.shown)
        return text, _ESSENTIAL_FIELDS.isdisjoint(dropped), shows_fault

    def _honest_text(self) -> bytes:
        """Return the frame's text; kept while the arm rests and nothing else in it has changed, for speed."""
        state = self._controller.state
        plant, memory = state.plant, state.memory
        key = (plant.joint_position, plant.is_in_position, plant.is_hand_guided, plant.is_moving, state.is_powered,
               state.is_enabled, state.emergency_stop, state.protective_stop, state.program_state,
               state.is_paused, memory.tools.active, memory.user_frames.active, state.alarms.shown(),
               state.in_position, plant.queue.motion_line, plant.add_error_line,
               memory.tools.frames[memory.tools.active],
               memory.user_frames.frames[memory.user_frames.active], self.restarts)
        if key != self._kept_text[0]:
            self._kept_text = key, self._controller.feed_frame.text()
        return self._kept_text[1]

    def _mangled(self, text: bytes, how: str) -> bytes:
        if how == "noise":
            return noise(self._chance, len(text) // 2)
        if how == "noise before":
            return noise(self._chance, 20) + text
        if how == "cut off":
            return text[:self._chance.randrange(1, len(text))]
        if how == "twice":
            return text + text
        middle = self._chance.randrange(20, len(text) - 1)  # the fifth kind: one wrong byte
        return text[:middle] + b"\xff" + text[middle + 1:]


def noise(chance: random.Random, count: int) -> bytes:
    """Return bytes that are neither JSON nor UTF-8."""
    return bytes([chance.randrange(0x80, 0x100) for _ in range(count)])
