"""Commands about programs and the status feed (docs/controller-protocol.md sections 5.13, 5.14, 6.1)."""
from typing import Tuple

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, plain
from jaka_ros_driver.simulation.controller.replies import WHOLE_FRAME, BadParameter, CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.controller.status_frame import StatusFrame, all_field_names
from jaka_ros_driver.state import ProgramState
from jaka_ros_driver.units import ms_to_s, s_to_ms

MAX_FEED_PERIOD_MS = 60000
"""Longest period of the feed, ms. No source gives a limit; with a minute no driver could tell a silent feed."""
_MAX_VARIABLES = 256
"""Most program variables. No source gives a limit; a client that adds for ever must not take all memory."""
_PORTS, _FIELDS, _DELAY = "PORTCONFIG", "ATTROPTIONALDATA", "port10000_delay_ms"


def _load(state: ControllerState, arguments: Arguments) -> None:
    """Load a stored program; of one that is not stored, no source has a real controller's reply."""
    name = arguments.text("programName")
    stem = name[:-4] if name.endswith((".ngc", ".jks")) else name
    if stem not in state.memory.programs or state.program_state is not ProgramState.IDLE:
        raise CommandRefused()
    state.memory.program_name = name


def _play(state: ControllerState, _arguments: Arguments) -> None:
    """Start the program; it runs until it is stopped, because programs have a state here but no content."""
    if not state.memory.program_name:
        raise CommandRefused()
    state.require_motion("play_program")
    state.require_standstill()
    state.program_state = ProgramState.RUNNING


def _modify_variable(state: ControllerState, arguments: Arguments) -> None:
    number, alias, value = arguments.integer("id_new"), arguments.text("alias_new", ""), arguments.raw("value_new")
    if not isinstance(value, (int, float, str)):
        raise BadParameter("value_new is neither number nor text")
    (arguments.text if isinstance(value, str) else arguments.number)("value_new")  # raises what is to be answered
    variables = state.memory.variables
    if not 0 <= number or (number not in variables and len(variables) >= _MAX_VARIABLES):
        raise CommandRefused()
    variables[number] = (alias, value)


def _variables(state: ControllerState) -> Reply:
    return {"var_list": [{"id": number, "alias": alias, "value": value}
                         for number, (alias, value) in sorted(state.memory.variables.items())]}


def _set_volatile_delay(state: ControllerState, arguments: Arguments) -> None:
    milliseconds = arguments.integer(_DELAY)
    _set_delay(state, milliseconds)
    if state.dialect.feed_period_persists:
        state.memory.feed_period_ms = milliseconds


def _set_delay(state: ControllerState, milliseconds: int) -> None:
    if not 1 <= milliseconds <= MAX_FEED_PERIOD_MS:
        raise CommandRefused()
    state.set_feed_period(ms_to_s(milliseconds))


def _whole_number(value: object) -> int:
    """Return an optional-info value as a number.

    Clients send it as a number or as text (docs/controller-protocol.md section 6.1).
    """
    try:
        if isinstance(value, (str, int)) and len(str(value)) < 10:
            return int(value)
    except ValueError:
        pass
    raise BadParameter("value is no whole number")


def _set_optional_info(state: ControllerState, arguments: Arguments) -> None:
    """Set an optional-info setting: it holds at once and survives a restart."""
    section, key, value = arguments.text("section"), arguments.text("key"), _whole_number(arguments.raw("value"))
    if (section, key) == (_PORTS, _DELAY):
        _set_delay(state, value)
        state.memory.feed_period_ms = value
    elif section == _FIELDS and key in all_field_names(state.firmware) and value in (0, 1):
        state.memory.field_switches[key] = bool(value)
    else:
        raise CommandRefused()


def _get_optional_info(state: ControllerState, arguments: Arguments) -> Reply:
    section, key = arguments.text("section"), arguments.text("key")
    if (section, key) == (_PORTS, _DELAY):
        return {"value": str(int(round(s_to_ms(state.feed_period_after_start))))}
    if section == _FIELDS and key in all_field_names(state.firmware):
        return {"value": str(int(state.memory.field_switches.get(key, True)))}
    raise CommandRefused()


PROGRAM_COMMANDS: Tuple[CommandSpec, ...] = (
    # The whole status frame; len becomes the size of the reply.
    CommandSpec(WHOLE_FRAME, "5.13", plain(lambda state: {"len": 0, **StatusFrame(state).fields()})),
    CommandSpec("load_program", "5.14", _load),
    CommandSpec("get_loaded_program", "5.14", plain(lambda state: {"programName": state.memory.program_name})),
    CommandSpec("play_program", "5.14", _play),
    CommandSpec("get_program_state", "5.14", plain(
        lambda state: {"programState": state.program_state.name.lower()})),
    CommandSpec("get_current_line", "sdk-client.md 6", plain(
        lambda state: {"current_line": int(state.program_state is not ProgramState.IDLE)})),
    CommandSpec("query_user_defined_variable", "5.14", plain(_variables)),
    CommandSpec("modify_user_defined_variable", "5.14", _modify_variable),
    CommandSpec("set_port10000_delay_ms", "6.1", _set_volatile_delay),
    CommandSpec("get_port10000_delay_ms", "6.1", plain(
        lambda state: {_DELAY: int(round(s_to_ms(state.asked_feed_period)))})),
    CommandSpec("setOptionalInfoConfig", "6.1", _set_optional_info),
    CommandSpec("getOptionalInfoConfig", "6.1", _get_optional_info),
)
