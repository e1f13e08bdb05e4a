"""The controller's state machine: power, drives, stops, servo mode, programs. No sockets, no clock; SI units.

Nothing here energises, enables or moves the arm by itself: each needs a command, and a stop ends it.
"""
import contextlib
import enum
import heapq
import itertools
from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent, TargetRejected
from jaka_ros_driver.simulation.arm.plant import HOME, Plant, Starvation
from jaka_ros_driver.simulation.controller import alarms
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.simulation.controller.force_sensor import ZEROING_TIME_S, ForceSensor
from jaka_ros_driver.simulation.controller.io_banks import IoBanks
from jaka_ros_driver.simulation.controller.memory import FRAME_COUNT, Memory, StoredFrames
from jaka_ros_driver.simulation.controller.replies import CommandRefused
from jaka_ros_driver.simulation.dialect.table import Dialect
from jaka_ros_driver.state import ProgramState, Vector
from jaka_ros_driver.units import ms_to_s

FORCE_PER_LEVEL_N = 25.0
"""Force, N, of a collision level: levels 1 to 5 stop at 25 N to 125 N (docs/controller-protocol.md section 5.9)."""
LATE_IN_POSITION_S = 2.0
"""Delay, s, from rest of the arm to ``inpos`` where the dialect is late."""
BRIEF_NOTE_S = 1.0
"""Life, s, of the note about disabled drives where the dialect is brief."""
DISABLE_DELAY_S = 0.3
"""Lead, s, of the event code over the flags when the drives are disabled.

Source: docs/controller-protocol.md section 4.4.
"""


class Start(enum.Enum):
    """State of the arm at the beginning."""

    OFF = "off"
    POWERED = "powered"
    ENABLED = "enabled"


class LinkLoss(enum.IntEnum):
    """The reaction of the motion to the loss of the command client (docs/sdk-client.md section 2)."""

    KEEP = 0
    PAUSE = 1
    ABORT = 2


@dataclass(frozen=True)
class Options:
    """The set-up of the simulated controller.

    Attributes:
        dialect: Choices on the points that are open; None for its firmware's default.
        start: State at the beginning.
        shortest_feed_period: Lower bound of the status feed's period, whatever a client asks for, s of simulated time.
        identity: Answer to ``get_simulator_identity``; no real controller knows that command.
        has_force_sensor: True with a force and torque sensor at the flange.
        braking_share: Deceleration of stops, as a share of the strongest that the model allows.
    """

    dialect: Optional[Dialect] = None
    start: Start = Start.OFF
    shortest_feed_period: float = 0.0
    identity: str = ""
    has_force_sensor: bool = False
    braking_share: float = 1.0


class ControllerState:
    """The state of the controller; it owns the arm and decides which commands reach it.

    Attributes:
        dialect: What this controller does on the points that are open.
        plant: The arm.
        io: The terminals.
        force_sensor: The sensor at the flange; None without one.
        alarms: The event shown, and past ones.
        memory: What survives a restart.
        now: Simulated time since the start, s.
        is_powered: Drives energised.
        is_enabled: Brakes off, torque on.
        emergency_stop: The button is pressed.
        protective_stop: Stands until ``clear_error``.
        program_state: Of the loaded program.
        asked_feed_period: Period of the status feed as the client set it, s.
        link_loss: What happens when the present command client is lost, as that client has set it.
        link_loss_delay: How long after the loss that happens, s of simulated time.
    """

    def __init__(self, model: ArmModel, firmware: Firmware, options: Options, memory: Memory,
                 joint_position: Vector = HOME) -> None:
        self.model = model
        self.firmware = firmware
        self.options = options
        self.dialect = dialect = options.dialect or Dialect.default(firmware.name)
        self.memory = memory
        self.plant = Plant(model, joint_position, starvation=Starvation(dialect.starvation))
        self.plant.servo_leave_delay = dialect.servo_leave_delay
        self.plant.max_waiting, self.plant.drops_points = dialect.servo_queue, dialect.stop_drops_frames
        self.plant.queue.start_delay = dialect.start_delay
        self.plant.queue.blends_joint_moves = dialect.joint_blend
        self.plant.acceleration_share, self.plant.queue.jerk_seconds = dialect.move_acceleration, dialect.move_jerk_time
        self.plant.queue.braking_share = options.braking_share
        self.io = IoBanks(firmware)
        self.force_sensor = ForceSensor() if options.has_force_sensor else None
        self.alarms = alarms.Alarms()
        self.now = 0.0
        self.is_powered = options.start is not Start.OFF
        self.is_enabled = options.start is Start.ENABLED
        self.emergency_stop = False
        self.protective_stop = False
        self.program_state = ProgramState.IDLE
        self.link_loss = LinkLoss.KEEP
        self.link_loss_delay = 0.0
        self._was_enabled = self.is_enabled
        self._forced_feed_period: Optional[float] = None
        self._power_at: Optional[float] = None
        self._enable_at: Optional[float] = None
        self._disable_at: Optional[float] = None
        self._link_loss_at: Optional[float] = None
        self._jogged: Optional[Tuple[JogFrame, int]] = None
        self._push_numbers = [0] * 6
        self._lines_are_stale = False
        self._moved_at = -LATE_IN_POSITION_S
        self._timers: List[Tuple[float, int, Callable[[], object]]] = []
        self._timer_ids = itertools.count()
        self.apply_frames()
        self.set_feed_period(self.feed_period_after_start)

    # --- time -------------------------------------------------------------------------------------------------------

    def step(self, dt: float) -> None:
        """Let dt seconds of simulated time pass."""
        self.now += dt
        while self._timers and self._timers[0][0] <= self.now:
            heapq.heappop(self._timers)[2]()
        if self._link_loss_at is not None and self.now >= self._link_loss_at:
            self._link_loss_at = None
            if self.link_loss is LinkLoss.PAUSE:
                self._end_jog()  # a jog cannot be continued later: it ends
                self.pause()
            elif self.link_loss is LinkLoss.ABORT:
                self.stop()
        if self._power_at is not None and self.now >= self._power_at:
            self._power_at, self.is_powered = None, True
        if self._enable_at is not None and self.now >= self._enable_at:
            self._enable_at, self.is_enabled, self._was_enabled = None, True, True
        if self._disable_at is not None and self.now >= self._disable_at:
            self._disable_at, self.is_enabled = None, False
        self.plant.step(dt)
        if not self.plant.is_in_position:
            self._moved_at = self.now
        for event in self.plant.take_events():
            self._take_event(event)
        if not self.plant.on_soft_limit:
            self.alarms.left_soft_limit()
        if self._jogged and not self.plant.queue.is_jogging:
            self._jogged = None

    def after(self, delay: float, action: Callable[[], object]) -> None:
        """Call ``action`` after ``delay`` s of simulated time."""
        heapq.heappush(self._timers, (self.now + delay, next(self._timer_ids), action))

    def _take_event(self, event: PlantEvent) -> None:
        self.alarms.raise_event(event, self.now)
        if event == events.SINGULARITY_PROTECTIVE_STOP:
            self.protective_stop = True
            self.plant.halt_protective()

    # --- power and drives (docs/controller-protocol.md section 5.1) ---------------------------------------------------

    def power_on(self) -> None:
        """Begin to energise the drives, unless that has begun; raise Refused while the emergency stop is pressed."""
        if self.emergency_stop:
            raise CommandRefused()
        if not self.is_powered and self._power_at is None:
            self._power_at = self.now + self.dialect.power_delay

    def power_off(self) -> None:
        """Cut the drives; raise Refused while they are enabled (event 0x0F0026)."""
        if self.is_enabled or self._enable_at is not None:
            raise CommandRefused()
        self.is_powered = self._was_enabled = False
        self._power_at = None

    @property
    def is_powering(self) -> bool:
        """True from ``power_on`` until the drives have power, or something has ended that."""
        return self._power_at is not None

    @property
    def is_enabling(self) -> bool:
        """True from ``enable`` until the brakes are open, or something has ended that."""
        return self._enable_at is not None

    def enable(self) -> bool:
        """Begin to enable, given power (docs/controller-protocol.md section 5.1); return False without power.

        Raises Refused during a stop.
        """
        if self.emergency_stop or self.protective_stop:
            raise CommandRefused()
        if self._disable_at is not None:
            self._disable_at, self.is_enabled = None, False
        if self.is_powered and not self.is_enabled and self._enable_at is None:
            self.alarms.drives_enabled()
            self._enable_at = self.now + self.dialect.enable_delay
        return self.is_powered

    def disable(self) -> None:
        """Engage the brakes; the event code precedes the flags (docs/controller-protocol.md section 4.4).

        Raises Refused while the arm moves (0x0F003A) or a program runs (0x0F0027).
        """
        if self.is_enabled:
            self.require_standstill()
        if self.program_state is not ProgramState.IDLE:
            raise CommandRefused()
        self._enable_at = None
        if self.is_enabled and self._disable_at is None:
            self.plant.leave_servo()
            self.plant.stop_hand_guiding()
            self.alarms.raise_event(alarms.DISABLED_NOTE, self.now)
            if self.dialect.disabled_note == "brief":
                self.after(BRIEF_NOTE_S, self.alarms.drives_enabled)
            self._disable_at = self.now + DISABLE_DELAY_S

    @property
    def task_state(self) -> int:
        """The task state: 1 power off, 2 power on, 3 disabled, 4 enabled (docs/controller-protocol.md section 6.2)."""
        if not self.is_powered:
            return 1
        if self.is_enabled:
            return 4
        return 3 if self._was_enabled else 2

    # --- stops ------------------------------------------------------------------------------------------------------

    def press_emergency_stop(self) -> None:
        """Press the button: motion ends, the drives lose power."""
        if self.emergency_stop:
            return
        self.emergency_stop = True
        self.plant.halt_emergency()
        self.program_state = ProgramState.IDLE
        self.is_powered = self.is_enabled = self._was_enabled = False
        self._power_at = self._enable_at = self._disable_at = None
        self.alarms.raise_event(alarms.EMERGENCY_STOP, self.now)

    def release_emergency_stop(self) -> None:
        """Release the button; the event stays until ``clear_error``, the drives stay without power."""
        self.emergency_stop = False

    def hit(self, force: float, joint: Optional[int] = None) -> bool:
        """Hit the arm with ``force``, N; return True where it notices and stops. The event names ``joint``, 0..5, or
        none.
        """
        level = self.memory.collision_level
        if not self.is_enabled or level == 0 or force < level * FORCE_PER_LEVEL_N:
            return False
        event = alarms.COLLISION if joint is None else events.joint_collision(joint)
        self.alarms.raise_event(event, self.now)
        self.protective_stop = True
        self.program_state = ProgramState.IDLE
        self.plant.halt_protective()
        return True

    def clear_error(self) -> None:
        """Clear errors and protective stop; energises nothing (docs/controller-protocol.md section 5.10)."""
        self.alarms.clear(self.emergency_stop)
        self.protective_stop = False

    # --- motion -----------------------------------------------------------------------------------------------------

    def require_drives(self) -> None:
        """Raise Refused unless the drives are ready (docs/controller-protocol.md section 4.3, code 2).

        Not ready: unpowered, not enabled or being disabled, a stop, hand guiding, a program that runs.
        """
        for is_reason, sdk_code in (
                (self.emergency_stop, "-5"), (not self.is_powered, "-6"), (self.protective_stop, "-20"),
                (not self.is_enabled or self._disable_at is not None, "-7"), (self.plant.is_hand_guided, "2"),
                (self.program_state is ProgramState.RUNNING, "-10")):
            if is_reason:
                raise CommandRefused(sdk_code if self.dialect.unready_code == "sdk" else "2")

    def require_motion(self, command: str) -> None:
        """Raise Refused as ``require_drives``, and in servo mode (code -1)."""
        self.require_drives()
        if self.plant.is_servo_active:
            raise CommandRefused("-1", "%s command can not be excuted in servo move mode" % command)

    def moved(self) -> None:
        """Take note that a queued move was accepted: the line ids in the feed now belong to the present client."""
        self._lines_are_stale = False
        self.alarms.move_accepted()

    def move_refused(self, event: PlantEvent) -> None:
        """Record that a move was refused for this reason, which the feed may show."""
        if self.dialect.refused_move_event:
            self.alarms.move_refused(event, self.now)

    @property
    def in_position(self) -> bool:
        """The value of ``inpos`` in the feed and in replies, which need not be true of the arm."""
        says = self.dialect.inpos
        if says == "early":
            return self.plant.is_settled
        if says == "never" or not self.plant.is_in_position:
            return False
        return says != "late" or self.now - self._moved_at >= LATE_IN_POSITION_S

    def executing_lines(self) -> Tuple[int, int]:
        """Return ``motion_line`` and ``err_add_line`` of the feed.

        Lines of an earlier client read 0. Ids restart at 2 in every client, and a client that finds its id in the feed
        together with ``inpos`` considers its move done (docs/sdk-client.md section 1, point 7).
        """
        return (0, 0) if self._lines_are_stale else (self.plant.queue.motion_line, self.plant.add_error_line)

    def stop(self) -> None:
        """End the program, every motion and every jog, as the pendant does; never refused."""
        self.program_state = ProgramState.IDLE
        self.plant.stop()

    def stop_program(self) -> None:
        """End what the command ``stop_program`` ends; never refused."""
        if self.dialect.stop_ends_program:
            self.program_state = ProgramState.IDLE
        self.plant.stop(self.dialect.stop_ends_jog, self.dialect.stop_ends_servo)

    def pause(self) -> None:
        """Pause the program and the queued motion, as the pendant does."""
        self._pause_program()
        if self.plant.queue.length:
            self.plant.queue.pause()

    def pause_program(self) -> None:
        """Pause what the command ``pause_program`` pauses."""
        if self.dialect.pause_pauses_moves:
            self.pause()
        else:
            self._pause_program()

    def _pause_program(self) -> None:
        if self.program_state is ProgramState.RUNNING:
            self.program_state = ProgramState.PAUSED

    def resume(self) -> None:
        """Continue the program and the queued motion; raise Refused where the drives are not ready."""
        if self.program_state is ProgramState.PAUSED or self.plant.queue.is_paused:
            self.require_drives()
        if self.program_state is ProgramState.PAUSED:
            self.program_state = ProgramState.RUNNING
        if self.plant.queue.is_paused:
            self.plant.queue.resume()

    @property
    def is_paused(self) -> bool:
        """The value of the feed's field ``paused``."""
        return self.plant.queue.is_paused or self.program_state is ProgramState.PAUSED

    def jogged(self, frame: JogFrame, axis: int) -> None:
        self._jogged = (frame, axis)

    def stop_jog(self, frame: Optional[JogFrame], axis: int) -> None:
        """End the running jog, also where the request names another axis, unless the dialect says otherwise."""
        if self.dialect.jog_stop_ends == "any" or (frame, axis) == self._jogged:
            self._end_jog()

    def _end_jog(self) -> None:
        if self._jogged:
            self.plant.queue.end_jog(*self._jogged)

    def set_hand_guiding(self, active: bool) -> None:
        """Switch hand guiding (docs/controller-protocol.md section 5.8).

        Raises Refused where the drives are not ready, TargetRejected where the arm moves or stands on a soft limit.
        """
        if not active:
            self.plant.stop_hand_guiding()
        elif not self.plant.is_hand_guided:
            self.require_drives()
            self.plant.start_hand_guiding()

    def command_hand_guiding(self, active: bool) -> None:
        """Switch hand guiding as ``torque_control_enable`` does: after the dialect's delay; raise as above."""
        if self.dialect.drag_delay <= 0.0:
            self.set_hand_guiding(active)
            return
        if active and not self.plant.is_hand_guided:
            self.require_drives()
            self.plant.check_hand_guiding()

        def switch() -> None:
            with contextlib.suppress(CommandRefused, TargetRejected):  # the arm moves by now, or has no drives
                self.set_hand_guiding(active)
        self.after(self.dialect.drag_delay, switch)

    def push(self, joint: int, velocity: float, duration: float) -> bool:
        """Push joint 0..5 by hand, rad/s, for ``duration`` s of simulated time; return False without hand guiding."""
        pushed = self.plant.push_joint(joint, velocity)
        if pushed:
            number = self._push_numbers[joint] = self._push_numbers[joint] + 1

            def release() -> None:
                if self._push_numbers[joint] == number:  # else a later push of this joint lasts on
                    self.plant.push_joint(joint, 0.0)

            self.after(duration, release)
        return pushed

    def zero_force_sensor(self) -> None:
        """Zero the sensor ``ZEROING_TIME_S`` from now; without a sensor this has no effect."""
        if self.force_sensor is not None:
            self.after(ZEROING_TIME_S, self.force_sensor.zero)

    # --- frames and feed --------------------------------------------------------------------------------------------

    def select_frame(self, table: StoredFrames, frame_id: int) -> None:
        """Make a stored tool or user frame active, after the dialect's delay.

        Raises:
            Refused: There is no such id, or the arm moves.
        """
        if not 0 <= frame_id < FRAME_COUNT:
            raise CommandRefused()
        if frame_id != table.active:
            self.require_standstill()

        def switch() -> None:
            table.active = frame_id
            self.apply_frames()
        self.after(self.dialect.frame_delay, switch)

    def apply_frames(self) -> None:
        """Have the arm use the active tool and user frame as they are stored."""
        tools, user_frames = self.memory.tools, self.memory.user_frames
        self.plant.set_tool(tools.frames[tools.active])
        self.plant.set_user_frame(user_frames.frames[user_frames.active])

    def require_standstill(self) -> None:
        """Raise Refused unless nothing moves and nothing is queued."""
        if self.plant.is_moving or self.plant.queue.length or self.plant.queue.is_jogging:
            raise CommandRefused()

    def set_feed_period(self, period: float) -> None:
        """Set the feed's period, s of simulated time.

        The feed then shows each move (docs/sdk-client.md section 1, point 7).
        """
        self.asked_feed_period = period
        self.plant.settle_time = self.feed_period

    @property
    def feed_period_after_start(self) -> float:
        """The period that holds after a restart, s of simulated time."""
        stored = self.memory.feed_period_ms
        return self.dialect.feed_period if stored is None else ms_to_s(stored)

    def slow_feed(self, period: Optional[float]) -> None:
        """Use this period of the feed, s of simulated time, instead of the client's; None for the client's again."""
        self._forced_feed_period = period
        self.plant.settle_time = self.feed_period

    @property
    def feed_period(self) -> float:
        """The period of the status feed, s of simulated time."""
        return max(self._forced_feed_period or self.asked_feed_period, self.options.shortest_feed_period,
                   self.dialect.shortest_feed_period)

    # --- the command client -----------------------------------------------------------------------------------------

    def client_connected(self) -> None:
        """Begin with a new client of the command port.

        Settings of the one before, and the reaction to its loss, end.
        """
        self._lines_are_stale = True
        self.link_loss, self.link_loss_delay = LinkLoss.KEEP, 0.0
        self._link_loss_at = None

    def client_lost(self) -> None:
        """Handle the loss of the command client's connection, or of its network; further calls have no effect.

        The reaction was set by ``set_network_exception_handle``.
        """
        if self._link_loss_at is None and self.link_loss is not LinkLoss.KEEP:
            self._link_loss_at = self.now + self.dialect.link_loss_notice + self.link_loss_delay

    def client_back(self) -> None:
        """End the loss of the command client's network; effects of the loss so far stay."""
        self._link_loss_at = None
