"""What each service does with the arm after its request was decoded to a command."""
import threading
from dataclasses import dataclass
from typing import Any, Mapping, Sequence, Union

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.client.core.procedures import pausing, power, programs, recovery, settings
from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.ros.convert import Payload, Terminal
from jaka_ros_driver.ros.frame_table import FrameTable
from jaka_ros_driver.ros.params import DriverConfig
from jaka_ros_driver.ros.topics.motion_ends import MotionEnds
from jaka_ros_driver.state import IoBank, RobotState


@dataclass(frozen=True)
class Outcome:
    """How a call ended.

    Attributes:
        message: For the caller: what happened, or why not.
        value: The result, where the service has one; SI.
        is_success: False where it failed.
    """

    message: str
    value: Any = None
    is_success: bool = True


class ServiceHandlers:
    """Carries out the services on one arm. Every method returns an Outcome, and raises a JakaError where it fails."""

    def __init__(self, arm: ArmClient, config: DriverConfig, frames: FrameTable, ends: MotionEnds) -> None:
        self._arm = arm
        self._config = config
        self._frames = frames
        self._ends = ends
        self._settings = threading.Lock()
        """Two calls that set and read back at the same time would each see the other's value."""
        self._outputs = threading.Lock()

    def move(self, command: c.Motion) -> Outcome:
        """linear_move, joint_move: answer when the arm is there or, unless ``~blocking``, when the move is accepted."""
        if self._config.blocking:
            self._arm.move(command)
            return Outcome("completed: the arm is at the target")
        return Outcome("accepted, id %s" % self._ends.move_accepted(self._arm.queue(command)))

    def jog(self, command: c.Jog) -> Outcome:
        """jog: begin, or keep the same jog going."""
        self._arm.jog(command)
        return Outcome("jogging; stops %.3g s after the last call" % self._arm.settings.jog_timeout)

    def servo_mode(self, active: bool) -> Outcome:
        """servo_move_enable: enter or leave servo mode."""
        self._arm.set_servo_mode(active)
        return Outcome("in servo mode" if active else "servo mode left")

    def servo_target(self, command: Union[c.ServoJoint, c.ServoPose]) -> Outcome:
        """servo_j and servo_p: take one target."""
        self._arm.servo_target(command)
        return Outcome("accepted")

    def stop(self, _: None) -> Outcome:
        """stop_move: sent at once, whatever other calls are under way."""
        self._arm.stop()
        return Outcome("stopped")

    def tool_frame(self, command: c.SetToolFrame) -> Outcome:
        """set_toolframe: store the frame, read it back and, as configured, make it the active one."""
        with self._frames.changing():
            return Outcome(self._arm.run(
                lambda core: settings.set_tool_frame(core, command, self._config.activates_frames), exclusive=True))

    def user_frame(self, command: c.SetUserFrame) -> Outcome:
        """set_userframe: as ``tool_frame``."""
        with self._frames.changing():
            return Outcome(self._arm.run(
                lambda core: settings.set_user_frame(core, command, self._config.activates_frames), exclusive=True))

    def payload(self, payload: Payload) -> Outcome:
        """set_payload: select the tool, set its load, read it back."""
        return Outcome(self._arm.run(
            lambda core: settings.set_payload(core, payload.tool_id, payload.load), exclusive=True))

    def hand_guiding(self, active: bool) -> Outcome:
        """drag_mode: switch hand guiding; off is served at any time."""
        return Outcome(self._arm.run(lambda core: settings.set_hand_guiding(core, active), exclusive=active))

    def collision_level(self, level: int) -> Outcome:
        """set_collisionlevel: set it and read it back."""
        with self._settings:
            return Outcome(self._arm.run(lambda core: settings.set_collision_level(core, level)))

    def output(self, command: Union[c.SetDigitalOutput, c.SetAnalogOutput]) -> Outcome:
        """set_io: set the output and read it back."""
        set_output = (settings.set_digital_output if isinstance(command, c.SetDigitalOutput)
                      else settings.set_analog_output)
        with self._outputs:
            return Outcome(self._arm.run(lambda core: set_output(core, command)))

    def zero_force_sensor(self, _: None) -> Outcome:
        """zero_ftsensor: zero the force sensor, and see that it reads zero."""
        return Outcome(self._arm.run(settings.zero_force_sensor, exclusive=True))

    def read(self, terminal: Terminal) -> Outcome:
        """get_io: the value in the status feed; an output that the feed does not contain is asked for."""
        values = _bank_values(self._arm.fresh_state(), terminal)
        if values is not None:
            if terminal.index >= len(values):
                raise InvalidCommand("index is %d; valid: 0 to %d" % (terminal.index, len(values) - 1))
            return Outcome(str(terminal), float(values[terminal.index]))
        if not terminal.is_output:
            raise InvalidCommand("the controller does not report %s" % terminal)
        query = c.GetDigitalOutput if terminal.is_digital else c.GetAnalogOutput
        return Outcome(str(terminal), float(self._arm.execute(query(terminal.bank, terminal.index))))

    def clear_error(self, _: None) -> Outcome:
        """clear_err: clear what can be cleared, and tell what is still missing before the arm can move."""
        missing = self._arm.run(power.clear_error)
        if not missing:
            return Outcome("alarms cleared; the arm is ready")
        state = self._arm.fresh_state()
        if state.emergency_stop:
            return Outcome("the emergency stop stands; to move the arm: %s" % ", ".join(missing), is_success=False)
        return Outcome("alarms cleared; to move the arm: %s" % ", ".join(missing))

    def recover(self, _: None) -> Outcome:
        """recover: clear, power and enable what needs it; returns when the arm can be moved."""
        return Outcome(self._arm.run(recovery.recover))

    def pause(self, _: None) -> Outcome:
        """pause: hold the moves or the trajectory under way; returns when the arm rests."""
        return Outcome(self._arm.run(pausing.pause))

    def resume(self, _: None) -> Outcome:
        """resume: go on with what was paused."""
        return Outcome(self._arm.run(pausing.resume))

    def speed(self, fraction: float) -> Outcome:
        """set_speed_slider: set the controller's speed override; returns when the feed shows it."""
        return Outcome(self._arm.run(lambda core: pausing.set_speed(core, fraction)))

    def load_program(self, name: str) -> Outcome:
        """program/load: make it the loaded program, and read back which one is."""
        text = self._arm.run(lambda core: programs.load(core, name), exclusive=True)
        self._ends.program_loaded(name)
        return Outcome(text)

    def play_program(self, _: None) -> Outcome:
        """program/play: begin the loaded program; returns when it is seen running."""
        self._ends.program_began(self._arm.play_program())
        return Outcome("the program runs; it has the arm until it is over")

    def pause_program(self, _: None) -> Outcome:
        """program/pause: hold the program; returns when the arm rests."""
        return Outcome(self._arm.run(programs.pause))

    def resume_program(self, _: None) -> Outcome:
        """program/resume: go on with the paused program; returns when it is seen running."""
        self._ends.program_began(self._arm.resume_program())
        return Outcome("the program goes on")

    def stop_program(self, _: None) -> Outcome:
        """program/stop: as stop_move, and returns when no program is seen running and the arm rests."""
        self._arm.stop()
        return Outcome(self._arm.run(programs.see_stopped))

    def power(self, on: bool) -> Outcome:
        """power: switch the power of the drives; returns when the arm reports it."""
        self._arm.run(lambda core: power.set_power(core, on))
        return Outcome("power on" if on else "power off")

    def enable(self, on: bool) -> Outcome:
        """enable: release or engage the brakes; returns when the arm reports it."""
        self._arm.run(lambda core: power.set_enabled(core, on))
        return Outcome("enabled" if on else "disabled")

    def forward(self, command: c.ForwardKinematics) -> Outcome:
        """get_fk: computed by the controller, with its active tool and user frame."""
        return Outcome("pose of the active tool in the active user frame", self._arm.execute(command))

    def inverse(self, command: c.InverseKinematics) -> Outcome:
        """get_ik: computed by the controller, with its active tool and user frame."""
        return Outcome("solution nearest to the reference", self._arm.execute(command))


def _bank_values(state: RobotState, terminal: Terminal) -> Union[Sequence[float], None]:
    io = state.io
    banks: Mapping[IoBank, Sequence[float]]
    if terminal.is_digital:
        banks = io.digital_outputs if terminal.is_output else io.digital_inputs
    else:
        banks = io.analog_outputs if terminal.is_output else io.analog_inputs
    return banks.get(terminal.bank)
