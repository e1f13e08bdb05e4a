"""The table of all commands of the command port, put together from the modules that carry them out."""
from typing import Dict

from jaka_ros_driver.simulation.controller.command_spec import CommandSpec
from jaka_ros_driver.simulation.controller.commands_frames import FRAME_COMMANDS
from jaka_ros_driver.simulation.controller.commands_io import IO_COMMANDS
from jaka_ros_driver.simulation.controller.commands_motion import MOTION_COMMANDS
from jaka_ros_driver.simulation.controller.commands_program import PROGRAM_COMMANDS
from jaka_ros_driver.simulation.controller.commands_settings import SETTING_COMMANDS
from jaka_ros_driver.simulation.controller.commands_system import SYSTEM_COMMANDS

COMMANDS: Dict[str, CommandSpec] = {row.name: row for row in (
    *SYSTEM_COMMANDS, *MOTION_COMMANDS, *FRAME_COMMANDS, *IO_COMMANDS, *PROGRAM_COMMANDS, *SETTING_COMMANDS)}
