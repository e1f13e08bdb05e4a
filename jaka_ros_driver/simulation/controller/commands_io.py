"""Commands about inputs and outputs (docs/controller-protocol.md section 5.11)."""
from typing import Tuple

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, plain
from jaka_ros_driver.simulation.controller.controller_state import ControllerState
from jaka_ros_driver.simulation.controller.replies import Reply

_DIN_STATUS_COUNT = 64


def _get(signal: str, output: bool) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> Reply:
        return {"value": state.io.get(signal, output, arguments.integer("type"), arguments.integer("index"))}
    return handle


def _set(signal: str) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> None:
        value = float(arguments.flag("value")) if signal == "digital" else arguments.number("value")
        state.io.set(signal, True, arguments.integer("type"), arguments.integer("index"), value)
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
