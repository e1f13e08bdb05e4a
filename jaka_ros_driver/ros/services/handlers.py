"""The handlers that carry services out with the arm, after a request was decoded to a command."""
import threading
from dataclasses import dataclass
from typing import Any, Callable, Dict, Optional, Tuple, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.clearance.guard import MotionGuard
from jaka_ros_driver.clearance.workspace import Workspace
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.motion import MotionOwner
from jaka_ros_driver.client.core.motion_guard.motion_check import STOP
from jaka_ros_driver.client.core.procedures import pausing, power, programs, recovery, settings, zones
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.ros.convert import Terminal, ToolPayload, settings_text
from jaka_ros_driver.ros.frame_table import FrameReader
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics.motion_ends import MotionEnds
from jaka_ros_driver.state import IoBank

_QUERIES: Dict[Tuple[bool, bool], Callable[[IoBank, int], c.Command]] = {
    (True, False): c.GetDigitalInput, (True, True): c.GetDigitalOutput, (False, False): c.GetAnalogInput,
    (False, True): c.GetAnalogOutput}
"""Questions by: is it digital, is it an output."""


@dataclass(frozen=True)
class ServiceOutcome:
    """The result of a call.

    Attributes:
        message: For the caller: what happened, or why not.
        value: The result, where the service has one; SI.
        is_success: False where it failed.
        text: The result of a service that answers with a text.
    """

    message: str
    value: Any = None
    is_success: bool = True
    text: str = ""


class ServiceHandlers:
    """The handlers of the services on one arm. Each returns its outcome, and raises a JakaError where it fails."""

    def __init__(self, arm: ArmClient, config: DriverConfig, frames: FrameReader, ends: MotionEnds,
                 show_zones: Callable[[Workspace], None]) -> None:
        """Set up the handlers; ``show_zones`` is called when other zones are kept, and must not wait."""
        self._arm = arm
        self._config = config
        self._frames = frames
        self._ends = ends
        self._show_zones = show_zones
        self._settings = threading.Lock()
        """Lock of settings that are read back.

        Two calls that set and read back at the same time would each see the other's value.
        """
        self._outputs = threading.Lock()

    def move(self, command: c.MoveCommand) -> ServiceOutcome:
        """Serve linear_move and joint_move.

        They are answered when the arm is there or, unless ``~blocking``, when the move is accepted.
        """
        if self._config.blocking:
            self._arm.move(command)
            return ServiceOutcome("completed: the arm is at the target")
        return ServiceOutcome("accepted, id %s" % self._ends.move_accepted(self._arm.queue(command)))

    def jog(self, command: c.Jog) -> ServiceOutcome:
        """Serve jog: begin, or keep the same jog going."""
        self._arm.jog(command)
        return ServiceOutcome("jogging; stops %.3g s after the last call" % self._arm.settings.jog_timeout)

    def servo_mode(self, active: bool) -> ServiceOutcome:
        """Serve servo_move_enable: enter or leave servo mode."""
        self._arm.set_servo_mode(active)
        return ServiceOutcome("in servo mode" if active else "servo mode left")

    def servo_target(self, command: Union[c.ServoJoint, c.ServoPose]) -> ServiceOutcome:
        """Serve servo_j and servo_p: add one target."""
        return _with("accepted", self._arm.servo_target(command))

    def stop(self, when_sent: Callable[[], object]) -> ServiceOutcome:
        """Serve stop_move: the stop is sent at once, whatever other calls are running."""
        self._arm.stop(when_sent)
        return ServiceOutcome("stopped")

    def tool_frame(self, command: c.SetToolFrame) -> ServiceOutcome:
        """Serve set_toolframe: store the frame, read it back and, as configured, make it the active one."""
        with self._frames.changing():
            return ServiceOutcome(self._arm.run(
                lambda core: settings.set_tool_frame(core, command, self._config.activates_frames),
                MotionOwner.SETTING))

    def user_frame(self, command: c.SetUserFrame) -> ServiceOutcome:
        """Serve set_userframe, as ``tool_frame`` serves its service."""
        with self._frames.changing():
            return ServiceOutcome(self._arm.run(
                lambda core: settings.set_user_frame(core, command, self._config.activates_frames),
                MotionOwner.SETTING))

    def payload(self, payload: ToolPayload) -> ServiceOutcome:
        """Serve set_payload: select the tool, set its load, read it back."""
        with self._frames.changing_load():
            return ServiceOutcome(self._arm.run(
                lambda core: settings.set_payload(core, payload.tool_id, payload.load), MotionOwner.SETTING))

    def hand_guiding(self, active: bool) -> ServiceOutcome:
        """Serve drag_mode: switch hand guiding; off is served at any time."""
        return ServiceOutcome(self._arm.run(lambda core: settings.set_hand_guiding(core, active),
                                             MotionOwner.SETTING if active else None))

    def collision_level(self, level: int) -> ServiceOutcome:
        """Serve set_collisionlevel: set it and read it back."""
        with self._settings, self._frames.changing_load():
            return ServiceOutcome(self._arm.run(lambda core: settings.set_collision_level(core, level)))

    def held_settings(self, _: None) -> ServiceOutcome:
        """Serve get_settings: answer with the settings that the controller holds now, as JSON; change nothing."""
        return ServiceOutcome(settings_text(self._arm.run(settings.held)))

    def output(self, command: Union[c.SetDigitalOutput, c.SetAnalogOutput]) -> ServiceOutcome:
        """Serve set_io: set the output and read it back."""
        with self._outputs:
            return ServiceOutcome(self._arm.run(
                lambda core: settings.set_digital_output(core, command) if isinstance(command, c.SetDigitalOutput)
                else settings.set_analog_output(core, command)))

    def zero_force_sensor(self, _: None) -> ServiceOutcome:
        """Serve zero_ftsensor: zero the force sensor, and check that it reads zero."""
        return ServiceOutcome(self._arm.run(settings.zero_force_sensor, MotionOwner.SENSOR))

    def read(self, terminal: Terminal) -> ServiceOutcome:
        """Serve get_io: return the value in the status feed; ask for an output that the feed does not contain.

        With ``vendor_2025`` the controller is asked in any case, as the maker's SDK 2.1.14 does: where it counts from
        0, both set and get mean the terminal after the one of this index.
        """
        if self._config.asks_for_terminals:
            return ServiceOutcome(str(terminal), float(self._arm.execute(
                _QUERIES[terminal.is_digital, terminal.is_output](terminal.bank, terminal.index))))
        values = self._arm.fresh_state().io.values(terminal.bank, terminal.is_digital, terminal.is_output)
        if values is not None:
            if terminal.index >= len(values):
                raise InvalidCommand("index is %d; valid: 0 to %d" % (terminal.index, len(values) - 1))
            return ServiceOutcome(str(terminal), float(values[terminal.index]))
        if not terminal.is_output:
            raise InvalidCommand("the controller does not report %s" % terminal)
        query = _QUERIES[terminal.is_digital, True]
        return ServiceOutcome(str(terminal), float(self._arm.execute(query(terminal.bank, terminal.index))))

    def clear_error(self, _: None) -> ServiceOutcome:
        """Serve clear_err: clear what can be cleared, and report what is still missing before the arm can move."""
        cleared, missing = self._arm.run(power.clear_error)
        if not missing:
            return ServiceOutcome("%s; the arm is ready" % cleared)
        state = self._arm.fresh_state()
        if state.emergency_stop:
            return ServiceOutcome(
                "the emergency stop stands; to move the arm: %s" % ", ".join(missing), is_success=False)
        return ServiceOutcome("%s; to move the arm: %s" % (cleared, ", ".join(missing)))

    def recover(self, _: None) -> ServiceOutcome:
        """Serve recover: clear, power and enable what needs it; return when the arm can be moved."""
        return ServiceOutcome(self._arm.run(recovery.recover))

    def pause(self, _: None) -> ServiceOutcome:
        """Serve pause: hold the running moves or trajectory; return when the arm rests."""
        return ServiceOutcome(self._arm.run(pausing.pause))

    def resume(self, _: None) -> ServiceOutcome:
        """Serve resume: continue what was paused."""
        return ServiceOutcome(self._arm.run(pausing.resume))

    def speed(self, fraction: float) -> ServiceOutcome:
        """Serve set_speed_slider: set the controller's speed override; return when the feed shows it."""
        return ServiceOutcome(self._arm.run(lambda core: pausing.set_speed(core, fraction)))

    def workspace(self, wanted: Optional[Workspace]) -> ServiceOutcome:
        """Serve set_workspace: have the motion guard keep these zones and this tool; None only reads them."""
        if wanted is None:
            kept = self._arm.run(zones.kept)
            return ServiceOutcome("nothing is changed: %s" % kept.summary(), text=kept.as_yaml())
        guard = MotionGuard(self._arm.model, wanted)  # made here, as it takes some milliseconds with many zones
        with self._settings:
            before = self._arm.run(zones.kept)
            trouble = self._arm.run(lambda core: zones.keep(core, guard), MotionOwner.ZONES)
            kept = self._arm.run(zones.kept)
            self._show_zones(kept)
        message = "%s are kept, before %s" % (kept.summary(), before.summary())
        if trouble:
            message += "; where the arm stands %s: it can move out, and no deeper" % trouble
        if self._config.guard_motion != STOP:
            message += "; ~guard_motion is %s: no motion is refused" % self._config.guard_motion
        return ServiceOutcome(message, text=kept.as_yaml())

    def load_program(self, name: str) -> ServiceOutcome:
        """Serve program/load: load the program, and read its name back."""
        text = self._arm.run(lambda core: programs.load(core, name), MotionOwner.LOADING)
        self._ends.program_loaded(name)
        return ServiceOutcome(text)

    def play_program(self, _: None) -> ServiceOutcome:
        """Serve program/play: begin the loaded program; return when it is seen running."""
        self._ends.program_began(self._arm.play_program())
        return ServiceOutcome("the program runs; it has the arm until it is over")

    def pause_program(self, _: None) -> ServiceOutcome:
        """Serve program/pause: hold the program; return when the arm rests."""
        return ServiceOutcome(self._arm.run(programs.pause))

    def resume_program(self, _: None) -> ServiceOutcome:
        """Serve program/resume: resume the paused program; return when it is seen running."""
        self._ends.program_began(self._arm.resume_program())
        return ServiceOutcome("the program goes on")

    def stop_program(self, when_sent: Callable[[], object]) -> ServiceOutcome:
        """Serve program/stop: stop as stop_move does; return when no program is seen running and the arm rests."""
        owner = self._arm.motion_owner
        self._arm.stop(when_sent)
        return _with(self._arm.run(programs.see_stopped),
                     "" if owner is None or owner is MotionOwner.PROGRAM else "%s was stopped" % owner.value)

    def power(self, on: bool) -> ServiceOutcome:
        """Serve power: switch the power of the drives; return when the arm reports it."""
        return _with("power on" if on else "power off", self._arm.run(lambda core: power.set_power(core, on)))

    def enable(self, on: bool) -> ServiceOutcome:
        """Serve enable: release or engage the brakes; return when the arm reports it."""
        return _with("enabled" if on else "disabled", self._arm.run(lambda core: power.set_enabled(core, on)))

    def forward(self, command: c.ForwardKinematics) -> ServiceOutcome:
        """Serve get_fk: the controller computes it, with its active tool and user frame."""
        return ServiceOutcome("pose of the active tool in the active user frame", self._arm.execute(command))

    def inverse(self, command: c.InverseKinematics) -> ServiceOutcome:
        """Serve get_ik: the controller computes it, with its active tool and user frame."""
        return ServiceOutcome("solution nearest to the reference", self._arm.execute(command))


def _with(text: str, besides: str) -> ServiceOutcome:
    """Return the outcome with what else was done, "" for nothing."""
    return ServiceOutcome("%s; %s" % (text, besides) if besides else text)
