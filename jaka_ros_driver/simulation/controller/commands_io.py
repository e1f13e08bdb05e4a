"""Commands about inputs and outputs (docs/controller-protocol.md section 5.11)."""
from typing import Tuple

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, plain
from jaka_ros_driver.simulation.controller.replies import CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState

_DIN_STATUS_COUNT = 64
_MAX_COUNT = 256
"""Most terminals of one request: more than any bank has. No source gives a limit."""


def _first(state: ControllerState, arguments: Arguments) -> int:
    """Return the terminal that ``index`` names, from 0.

    It is below 0, which is refused, where the index is below the first.
    """
    return arguments.integer("index") - state.dialect.io_index_base


def _get(signal: str, output: bool) -> Handler:
    """Return the handler of a get command.

    ``value`` is a number; with ``len`` an array of so many, from ``index`` on (docs/sdk-client.md section 9).
    """
    def handle(state: ControllerState, arguments: Arguments) -> Reply:
        bank, first = arguments.integer("type"), _first(state, arguments)
        if not arguments.has("len"):
            return {"value": state.io.get(signal, output, bank, first)}
        count = arguments.integer("len")
        if not 1 <= count <= _MAX_COUNT:
            raise CommandRefused()
        return {"value": [state.io.get(signal, output, bank, first + i) for i in range(count)]}
    return handle


def _set(signal: str) -> Handler:
    """Return the handler of a set command.

    ``value`` is a number, or an array for the outputs from ``index`` on; all of them are set, or none.
    """
    def handle(state: ControllerState, arguments: Arguments) -> None:
        given = arguments.raw("value")
        if not isinstance(given, list):
            given = [given]
        if not 1 <= len(given) <= _MAX_COUNT:
            raise CommandRefused()
        each = [Arguments({"value": value}) for value in given]
        values = [float(one.flag("value")) if signal == "digital" else one.number("value") for one in each]
        state.io.set(signal, True, arguments.integer("type"), _first(state, arguments), *values)
    return handle


IO_COMMANDS: Tuple[CommandSpec, ...] = (
    CommandSpec("set_digital_output", "5.11", _set("digital")),
    CommandSpec("set_analog_output", "5.11", _set("analog")),
    CommandSpec("get_digital_output", "5.11", _get("digital", True)),
    CommandSpec("get_digital_input", "5.11", _get("digital", False)),
    CommandSpec("get_analog_output", "5.11", _get("analog", True)),
    CommandSpec("get_analog_input", "5.11", _get("analog", False)),
    CommandSpec("get_digital_input_status", "5.11", plain(
        lambda state: {"din_status": list(state.io.array("din")[:_DIN_STATUS_COUNT])})),
    # mode is what the SDK reads; no extension module is set up (docs/sdk-client.md section 6)
    CommandSpec("get_extio_status", "5.11", plain(
        lambda state: {"extio_status": {"version": 1, "setups": [], "mode": 0}})),
    CommandSpec("get_funcdi_status", "5.11", plain(lambda state: {"funcdi_status": [[-1, -1] for _ in range(15)]})),
)
