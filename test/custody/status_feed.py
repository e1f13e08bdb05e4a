"""The status feed of the world's controller: its honest frames, and those that lie, lack something or are damaged."""
import random
from typing import Any, Dict, NamedTuple, Optional, Tuple

from virtual_clock import Clock
from wire import Network

from jaka_ros_driver.client.core.actions import Port
from jaka_ros_driver.simulation.controller.controller import Controller
from jaka_ros_driver.simulation.controller.status_frame import all_field_names
from jaka_ros_driver.simulation.server.connection import FRAME_BACKLOG_BYTES

_NEEDED_FIELDS = frozenset((
    "drag_status", "errcode", "errmsg", "joint_actual_position", "actual_position", "interp_state", "enabled",
    "paused", "current_tool_id", "current_user_id", "on_soft_limit", "emergency_stop", "powered_on", "inpos",
    "protective_stop"))
_ESSENTIAL_FIELDS = frozenset((
    "joint_actual_position", "powered_on", "enabled", "inpos", "emergency_stop", "protective_stop"))
_SAME_MOMENT = 1e-6


class Frame(NamedTuple):
    """What the driver learns when a status frame has arrived whole.

    Attributes:
        made_at: s.
        is_readable: It is whole and has all that a driver needs.
        shows_fault: An emergency or protective stop stands in it.
        restarts: How often the controller that made it had been started anew.
    """

    made_at: float
    is_readable: bool
    shows_fault: bool
    restarts: int


class FeedFaults:
    """What is wrong with the status feed at present; times are ends, s."""

    def __init__(self) -> None:
        self.shown: Dict[str, Any] = {}
        self.shown_until = 0.0
        self.shown_frames = 0
        self.dropped: Tuple[str, ...] = ()
        self.dropped_until = 0.0
        self.silent_until = 0.0
        self.mangled_frames = 0
        self.mangle = ""


class StatusFeed:
    """Sends frames of one controller.

    Attributes:
        faults: What is wrong with it.
        restarts: How often the controller was started anew.
    """

    def __init__(self, clock: Clock, network: Network, chance: random.Random, controller: Controller,
                 forced_period: Optional[float], has_all_fields: bool) -> None:
        """``forced_period``: s, whatever is asked for; None: what is asked for."""
        self.faults = FeedFaults()
        self.restarts = -1
        self._clock, self._network, self._chance, self._controller = clock, network, chance, controller
        self._forced_period, self._has_all_fields = forced_period, has_all_fields
        self._next_frame = clock.now
        self._kept_text: Tuple[Any, bytes] = (None, b"")
        self.start()

    def start(self) -> None:
        """The controller has been started."""
        state = self._controller.state
        state.slow_feed(self._forced_period)
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
        text, is_readable, shows_fault = self._frame_text(now)
        frame = Frame(now, is_readable, shows_fault or state.emergency_stop or state.protective_stop, self.restarts)
        for cable in clients:
            if cable.to_driver.unsent_bytes <= FRAME_BACKLOG_BYTES:
                cable.to_driver.send(text, frame)

    def _frame_text(self, now: float) -> Tuple[bytes, bool, bool]:
        """The text, whether it is whole, and whether it shows a stop that there is not."""
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
        """The frame's text; kept while the arm rests and nothing else in it has changed, for speed."""
        state = self._controller.state
        plant, memory = state.plant, state.memory
        key = (plant.joint_position, plant.is_in_position, plant.is_hand_guided, plant.is_moving, state.is_powered,
               state.is_enabled, state.emergency_stop, state.protective_stop, state.program_state,
               state.is_paused, memory.tools.active, memory.user_frames.active, state.alarms.shown(),
               plant.queue.motion_line, plant.add_error_line, memory.tools.frames[memory.tools.active],
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
        middle = self._chance.randrange(20, len(text) - 1)  # a byte of it is wrong
        return text[:middle] + b"\xff" + text[middle + 1:]


def noise(chance: random.Random, count: int) -> bytes:
    """Bytes that are no JSON and no UTF-8."""
    return bytes([chance.randrange(0x80, 0x100) for _ in range(count)])
