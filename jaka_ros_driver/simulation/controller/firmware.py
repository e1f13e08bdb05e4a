"""The differences between the simulated controller generations (docs/controller-protocol.md section 8)."""
from dataclasses import dataclass
from typing import Dict


@dataclass(frozen=True)
class Firmware:
    """One generation of controllers.

    Attributes:
        name: Of ``FIRMWARE_NAMES``.
        version: The answer to ``get_version``.
        is_modern: True from 1.7 on: the feed has commanded positions, executing lines and field bus blocks
            (docs/controller-protocol.md section 6.2).
        digital_count: Length of ``din`` and ``dout`` (docs/controller-protocol.md section 6.2).
        analog_count: Length of ``ain`` and ``aout``.
        tool_analog_count: Length of ``tio_ain``.
    """

    name: str
    version: str
    is_modern: bool
    digital_count: int
    analog_count: int
    tool_analog_count: int


FIRMWARES: Dict[str, Firmware] = {
    "1.5.14": Firmware("1.5.14", "1.5.14_13_X64", False, 135, 64, 2),
    "1.7.1": Firmware("1.7.1", "1.7.1_46_X64", True, 144, 66, 1),
    "1.7.2": Firmware("1.7.2", "1.7.2_16_X64", True, 144, 66, 1),
}
FIRMWARES["1.7"] = FIRMWARES["1.7.2"]
"""The generations by the name that ``--firmware`` takes."""
