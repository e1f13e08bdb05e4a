"""The cabinet's terminals, by the wire's ``type`` and index (docs/controller-protocol.md section 5.11)."""
from typing import Dict, Tuple, Union

from jaka_ros_driver.errors import InvalidCommand
from jaka_ros_driver.simulation.controller.firmware import Firmware
from jaka_ros_driver.state import Vector

BANK_NAMES = ("cabinet", "tool", "extension", "relay", "modbus", "profinet", "ethernet_ip")
"""Names of the banks in the order of the wire's ``type`` (docs/controller-protocol.md section 5.11)."""

_DIGITAL_INPUTS = ("din", "tio_din", "ext_din", "", "mb_slave_din", "pn_dev_din", "eip_adpt_din")
_DIGITAL_OUTPUTS = ("dout", "tio_dout", "ext_dout", "relay_io", "mb_slave_dout", "pn_dev_dout", "eip_adpt_dout")
_ANALOG_INPUTS = ("ain", "tio_ain", "ext_ain", "", "mb_slave_ain", "pn_dev_ain", "eip_adpt_ain")
_ANALOG_OUTPUTS = ("aout", "tio_aout", "ext_aout", "", "mb_slave_aout", "pn_dev_aout", "eip_adpt_aout")
_KEYS = {("digital", False): _DIGITAL_INPUTS, ("digital", True): _DIGITAL_OUTPUTS,
         ("analog", False): _ANALOG_INPUTS, ("analog", True): _ANALOG_OUTPUTS}

RELAYS = 2
"""Number of relays in frames.

One more is kept: SDK 2.1.14 counts from 1 also where commands count from 0 here.
"""
MAX_ANALOG = 65535.0
"""Largest analog value kept; a 16 bit register of the field bus banks."""


class IoBanks:
    """The values by feed field; each array is a tuple that is replaced when a value changes."""

    def __init__(self, firmware: Firmware) -> None:
        sizes: Dict[str, int] = {
            "din": firmware.digital_count, "dout": firmware.digital_count, "tio_din": 8, "tio_dout": 8,
            "ext_din": 64, "ext_dout": 64, "relay_io": RELAYS + 1, "mb_slave_din": 128, "mb_slave_dout": 128,
            "pn_dev_din": 64, "pn_dev_dout": 64, "eip_adpt_din": 64, "eip_adpt_dout": 64}
        analog_sizes: Dict[str, int] = {
            "ain": firmware.analog_count, "aout": firmware.analog_count, "tio_ain": firmware.tool_analog_count,
            "tio_aout": 2, "ext_ain": 64, "ext_aout": 64, "mb_slave_ain": 64, "mb_slave_aout": 64,
            "pn_dev_ain": 64, "pn_dev_aout": 64, "eip_adpt_ain": 48, "eip_adpt_aout": 48}
        self._values: Dict[str, Tuple[Union[int, float], ...]] = {key: (0,) * n for key, n in sizes.items()}
        self._values.update((key, (0.0,) * n) for key, n in analog_sizes.items())

    def array(self, key: str) -> Vector:
        """Return the array of this feed field; the same object until one of its values changes."""
        return self._values[key]

    @property
    def relays(self) -> Vector:
        """The relays in frames."""
        return self._values["relay_io"][:RELAYS]

    def get(self, signal: str, output: bool, bank: int, index: int) -> float:
        """Return the value of one terminal; raise InvalidCommand where there is no such terminal.

        signal: "digital" or "analog". bank: index into ``BANK_NAMES``. index: from 0.
        """
        return self._values[self._key(signal, output, bank, index)][index]

    def set(self, signal: str, output: bool, bank: int, index: int, *new: float) -> None:
        """Set one or more terminals from ``index`` on, parameters as ``get``; any digital value but 0 is 1.

        Raises InvalidCommand, and sets none, where there is no such terminal, or an analog value is out of range.
        """
        keys = [self._key(signal, output, bank, place) for place in range(index, index + len(new))]
        for key, value in zip(keys, new):
            if abs(value) > MAX_ANALOG:
                raise InvalidCommand("%s %d: %g is beyond %g" % (key, index, value, MAX_ANALOG))
        values = list(self._values[keys[0]])
        values[index:index + len(new)] = [
            int(value != 0) if signal == "digital" else round(float(value), 5) for value in new]
        self._values[keys[0]] = tuple(values)

    def _key(self, signal: str, output: bool, bank: int, index: int) -> str:
        keys = _KEYS.get((signal, output))
        key = keys[bank] if keys and 0 <= bank < len(keys) else ""
        if not key or not 0 <= index < len(self._values[key]):
            raise InvalidCommand("no %s %s %d in bank %d" % (signal, "output" if output else "input", index, bank))
        return key
