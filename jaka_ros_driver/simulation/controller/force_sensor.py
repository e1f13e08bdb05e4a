"""The force and torque sensor at the flange: its load and its readings.

Its readings: docs/controller-protocol.md section 6.4.
"""
from jaka_ros_driver.state import Vector

ZEROING_TIME_S = 0.5
"""Time, s, that zeroing takes.

The SDK's function for it blocks so long (docs/controller-protocol.md section 5.15).
"""
BIAS: Vector = (1.9, -3.2, 6.4, 0.11, -0.07, 0.02)
"""Raw reading without a load, N and N m; made up. No real sensor's raw reading is 0."""
DECIMALS = 5


class ForceSensor:
    """An ideal force sensor, without noise; it does not feel the weight of the tool."""

    def __init__(self) -> None:
        self._load: Vector = (0.0,) * 6
        self._offset = BIAS

    def load(self, wrench: Vector) -> None:
        """Load the sensor with a force, N, and a torque, N m, shape (6,), from now on."""
        self._load = wrench

    def zero(self) -> None:
        """Take the present reading as no load."""
        self._offset = tuple(load + bias for load, bias in zip(self._load, BIAS))

    @property
    def raw(self) -> Vector:
        """The raw reading, N and N m, shape (6,)."""
        return tuple(round(load + bias, DECIMALS) for load, bias in zip(self._load, BIAS))

    @property
    def actual(self) -> Vector:
        """The contact force and torque: the raw reading without that of the last zeroing, shape (6,)."""
        return tuple(round(load + bias - offset, DECIMALS)
                     for load, bias, offset in zip(self._load, BIAS, self._offset))
