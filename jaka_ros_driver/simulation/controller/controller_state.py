"""The controller's state machine: power, drives, stops, servo mode, programs. No sockets; time is told, SI units.

Nothing here energises, enables or moves the arm by itself: each needs a command, and a stop ends it.
"""
import enum
import heapq
import itertools
from dataclasses import dataclass
from typing import Callable, List, Optional, Tuple

from jaka_ros_driver.commands import JogFrame
from jaka_ros_driver.kinematics.arm_models import ArmModel
from jaka_ros_driver.simulation.arm import events
from jaka_ros_driver.simulation.arm.events import PlantEvent
from jaka_ros_driver.simulation.arm.plant import HOME, Plant, Starvation
from jaka_ros_driver.simulation.controller import alarms
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.simulation.controller.force_sensor import ZEROING_TIME_S, ForceSensor
from jaka_ros_driver.simulation.controller.io_banks import IoBanks
from jaka_ros_driver.simulation.controller.memory import FRAME_COUNT, FrameTable, Memory
from jaka_ros_driver.simulation.controller.replies import Refused
from jaka_ros_driver.state import ProgramState, Vector
from jaka_ros_driver.units import ms_to_s

FORCE_PER_LEVEL_N = 25.0
"""Collision levels 1 to 5 stop at 25 N to 125 N (docs/controller-protocol.md section 5.9)."""
FRAME_SWITCH_DELAY_S = 0.04
"""How long a tool or user frame takes to become active; a guess (docs/controller-protocol.md section 5.7)."""
DISABLE_DELAY_S = 0.3
"""How long the event code precedes the flags when the drives are disabled (docs/controller-protocol.md section 4.4)."""


class Start(enum.Enum):
    """State of the arm at the beginning."""

    OFF = "off"
    POWERED = "powered"
    ENABLED = "enabled"


class LinkLoss(enum.IntEnum):
    """What happens to the motion when the command client is lost (docs/sdk-client.md section 2)."""

    KEEP = 0
    PAUSE = 1
    ABORT = 2


@dataclass(frozen=True)
class Options:
    """How the simulated controller is set up.

    Attributes:
        power_delay: From ``power_on`` to energised drives, s of simulated time (docs/controller-protocol.md section
            5.1).
        enable_delay: From ``enable_robot`` to released brakes, s.
        start: State at the beginning.
        starvation: What the arm does when a servo stream has no more points.
        shortest_feed_period: Lower bound of the status feed's period, whatever a client asks for, s of simulated time.
        identity: What ``get_simulator_identity`` answers; no real controller knows that command.
        io_index_base: Index of the first terminal in commands, 0 or 1; None for that of the firmware.
        has_force_sensor: True with a force and torque sensor at the flange.
    """

    power_delay: float = 8.0
    enable_delay: float = 4.0
    start: Start = Start.OFF
    starvation: Starvation = Starvation.HOLD
    shortest_feed_period: float = 0.0
    identity: str = ""
    io_index_base: Optional[int] = None
    has_force_sensor: bool = False


class ControllerState:
    """The state of the controller; it owns the arm and decides which commands reach it.

    Attributes:
        plant: The arm.
        io: The terminals.
        force_sensor: The sensor at the flange; None without one.
        io_index_base: Index of the first terminal in commands.
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
        self.io_index_base = firmware.io_index_base if options.io_index_base is None else options.io_index_base
        self.memory = memory
        self.plant = Plant(model, joint_position, starvation=options.starvation)
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
        self._timers: List[Tuple[float, int, Callable[[], object]]] = []
        self._timer_ids = itertools.count()
        self.apply_frames()
        self.set_feed_period(ms_to_s(memory.feed_period_ms))

    # --- time -------------------------------------------------------------------------------------------------------

    def step(self, dt: float) -> None:
        """Let dt seconds of simulated time pass."""
        self.now += dt
        while self._timers and self._timers[0][0] <= self.now:
            heapq.heappop(self._timers)[2]()
        if self._link_loss_at is not None and self.now >= self._link_loss_at:
            self._link_loss_at = None
            if self.link_loss is LinkLoss.PAUSE:
                self.stop_jog()  # a jog cannot be continued later: it ends
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
        """Begin to energise the drives, unless that has begun; raises Refused while the emergency stop is pressed."""
        if self.emergency_stop:
            raise Refused()
        if not self.is_powered and self._power_at is None:
            self._power_at = self.now + self.options.power_delay

    def power_off(self) -> None:
        """Cut the drives; raises Refused while they are enabled (event 0x0F0026)."""
        if self.is_enabled or self._enable_at is not None:
            raise Refused()
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
        """Begin to enable, given power (docs/controller-protocol.md section 5.1); False without power.

        Raises Refused during a stop.
        """
        if self.emergency_stop or self.protective_stop:
            raise Refused()
        if self._disable_at is not None:
            self._disable_at, self.is_enabled = None, False
        if self.is_powered and not self.is_enabled and self._enable_at is None:
            self.alarms.drives_enabled()
            self._enable_at = self.now + self.options.enable_delay
        return self.is_powered

    def disable(self) -> None:
        """Engage the brakes; the event code precedes the flags (docs/controller-protocol.md section 4.4).

        Raises Refused while the arm moves (0x0F003A) or a program runs (0x0F0027).
        """
        if self.is_enabled:
            self.require_standstill()
        if self.program_state is not ProgramState.IDLE:
            raise Refused()
        self._enable_at = None
        if self.is_enabled and self._disable_at is None:
            self.plant.leave_servo()
            self.plant.stop_hand_guiding()
            self.alarms.raise_event(alarms.DISABLED_NOTE, self.now)
            self._disable_at = self.now + DISABLE_DELAY_S

    @property
    def task_state(self) -> int:
        """1 power off, 2 power on, 3 disabled, 4 enabled (docs/controller-protocol.md section 6.2)."""
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
        """Hit the arm with ``force``, N; True where it notices and stops. The event names ``joint``, 0..5, or none."""
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
        ready = self.is_powered and self.is_enabled and self._disable_at is None
        if not ready or self.emergency_stop or self.protective_stop:
            raise Refused()
        if self.plant.is_hand_guided or self.program_state is ProgramState.RUNNING:
            raise Refused()

    def require_motion(self, command: str) -> None:
        """Raise Refused as ``require_drives``, and in servo mode (code -1)."""
        self.require_drives()
        if self.plant.is_servo_active:
            raise Refused("-1", "%s command can not be excuted in servo move mode" % command)

    def moved(self) -> None:
        """A queued move was accepted: the line ids in the feed now belong to the present client."""
        self._lines_are_stale = False

    def executing_lines(self) -> Tuple[int, int]:
        """``motion_line`` and ``err_add_line`` of the feed.

        Lines of an earlier client read 0. Ids restart at 2 in every client, and a client that finds its id in the feed
        together with ``inpos`` considers its move done (docs/sdk-client.md section 1, point 7).
        """
        return (0, 0) if self._lines_are_stale else (self.plant.queue.motion_line, self.plant.add_error_line)

    def stop(self) -> None:
        """End the program, every motion and every jog; never refused."""
        self.program_state = ProgramState.IDLE
        self.plant.stop()

    def pause(self) -> None:
        """Pause the program and the queued motion."""
        if self.program_state is ProgramState.RUNNING:
            self.program_state = ProgramState.PAUSED
        if self.plant.queue.length:
            self.plant.queue.pause()

    def resume(self) -> None:
        """Continue the program and the queued motion; raises Refused where the drives are not ready."""
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

    def stop_jog(self) -> None:
        """End the running jog, also where the request names another axis."""
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

    def push(self, joint: int, velocity: float, duration: float) -> bool:
        """Push joint 0..5 by hand, rad/s, for ``duration`` s of simulated time; False without hand guiding."""
        pushed = self.plant.push_joint(joint, velocity)
        if pushed:
            number = self._push_numbers[joint] = self._push_numbers[joint] + 1

            def let_go() -> None:
                if self._push_numbers[joint] == number:  # else a later push of this joint lasts on
                    self.plant.push_joint(joint, 0.0)

            self.after(duration, let_go)
        return pushed

    def zero_force_sensor(self) -> None:
        """Take what the sensor reads ``ZEROING_TIME_S`` from now as nothing; without a sensor this has no effect."""
        if self.force_sensor is not None:
            self.after(ZEROING_TIME_S, self.force_sensor.zero)

    # --- frames and feed --------------------------------------------------------------------------------------------

    def select_frame(self, table: FrameTable, frame_id: int) -> None:
        """Make a stored tool or user frame active, after ``FRAME_SWITCH_DELAY_S``.

        Raises Refused where there is no such id, or the arm moves.
        """
        if not 0 <= frame_id < FRAME_COUNT:
            raise Refused()
        if frame_id != table.active:
            self.require_standstill()

        def switch() -> None:
            table.active = frame_id
            self.apply_frames()
        self.after(FRAME_SWITCH_DELAY_S, switch)

    def apply_frames(self) -> None:
        """Have the arm use the active tool and user frame as they are stored."""
        tools, user_frames = self.memory.tools, self.memory.user_frames
        self.plant.set_tool(tools.frames[tools.active])
        self.plant.set_user_frame(user_frames.frames[user_frames.active])

    def require_standstill(self) -> None:
        """Raise Refused unless nothing moves and nothing is queued."""
        if self.plant.is_moving or self.plant.queue.length or self.plant.queue.is_jogging:
            raise Refused()

    def set_feed_period(self, period: float) -> None:
        """Set the feed's period, s of simulated time; each move shows in it (docs/sdk-client.md section 1, point 7)."""
        self.asked_feed_period = period
        self.plant.settle_time = self.feed_period

    def slow_feed(self, period: Optional[float]) -> None:
        """Use this period of the feed, s of simulated time, instead of the client's; None for the client's again."""
        self._forced_feed_period = period
        self.plant.settle_time = self.feed_period

    @property
    def feed_period(self) -> float:
        """Period of the status feed, s of simulated time."""
        return max(self._forced_feed_period or self.asked_feed_period, self.options.shortest_feed_period)

    # --- the command client -----------------------------------------------------------------------------------------

    def client_connected(self) -> None:
        """A new client has the command port; settings of the one before, and the reaction to its loss, end."""
        self._lines_are_stale = True
        self.link_loss, self.link_loss_delay = LinkLoss.KEEP, 0.0
        self._link_loss_at = None

    def client_lost(self) -> None:
        """The connection of the command client, or its network, is lost; further calls have no effect.

        What follows was set by ``set_network_exception_handle``.
        """
        if self._link_loss_at is None and self.link_loss is not LinkLoss.KEEP:
            self._link_loss_at = self.now + self.link_loss_delay

    def client_back(self) -> None:
        """The network of the command client works again; what its loss has caused so far stays."""
        self._link_loss_at = None
