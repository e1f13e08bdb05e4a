"""Commands about inputs and outputs (docs/controller-protocol.md section 5.11)."""
from typing import Optional, Tuple

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, query
from jaka_ros_driver.simulation.controller.controller_state import ControllerState
from jaka_ros_driver.simulation.controller.replies import Refused, Reply

_DIN_STATUS_COUNT = 64


def _get(signal: str, output: bool) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> Reply:
        try:
            value = state.io.get(signal, output, arguments.integer("type"), arguments.integer("index"))
        except InvalidCommand as error:
            raise Refused() from error
        return {"value": value}
    return handle


def _set_digital(state: ControllerState, arguments: Arguments) -> Optional[Reply]:
    _set(state, arguments, "digital", float(arguments.flag("value")))
    return None


def _set_analog(state: ControllerState, arguments: Arguments) -> Optional[Reply]:
    _set(state, arguments, "analog", arguments.number("value"))
    return None


def _set(state: ControllerState, arguments: Arguments, signal: str, value: float) -> None:
    try:
        state.io.set(signal, True, arguments.integer("type"), arguments.integer("index"), value)
    except InvalidCommand as error:
        raise Refused() from error


def _din_status(state: ControllerState) -> Reply:
    return {"din_status": list(state.io.array("din")[:_DIN_STATUS_COUNT])}


def _extio_status(state: ControllerState) -> Reply:
    """``mode`` is what the SDK reads; no extension module is set up (docs/sdk-client.md section 6)."""
    return {"extio_status": {"version": 1, "setups": [], "mode": 0}}


def _funcdi_status(state: ControllerState) -> Reply:
    return {"funcdi_status": [[-1, -1] for _ in range(15)]}


IO_COMMANDS: Tuple[CommandSpec, ...] = (
    CommandSpec("set_digital_output", "5.11", _set_digital),
    CommandSpec("set_analog_output", "5.11", _set_analog),
    CommandSpec("get_digital_output", "5.11", _get("digital", True)),
    CommandSpec("get_digital_input", "5.11", _get("digital", False)),
    CommandSpec("get_analog_output", "5.11", _get("analog", True)),
    CommandSpec("get_analog_input", "5.11", _get("analog", False)),
    CommandSpec("get_digital_input_status", "5.11", query(_din_status)),
    CommandSpec("get_extio_status", "5.11", query(_extio_status)),
    CommandSpec("get_funcdi_status", "5.11", query(_funcdi_status)),
)
