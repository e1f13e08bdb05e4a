"""The data that a controller keeps over a restart (docs/controller-protocol.md sections 5.7, 5.9, 6.1)."""
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Tuple

from jaka_ros_driver.commands import Pose
from jaka_ros_driver.state import Vector

FRAME_COUNT = 16
"""Number of ids, 0 to 15.

The maker's manual names 1 to 10, newer firmware has 15 (docs/controller-protocol.md section 5.7).
"""

IDENTITY = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass
class StoredFrames:
    """The stored tools (in the flange) or user frames (in the base) by id, and the id of the active one.

    Id 0 is fixed.
    """

    frames: List[Pose] = field(default_factory=lambda: [IDENTITY] * FRAME_COUNT)
    active: int = 0


@dataclass
class Payload:
    """A load: mass kg, centre of mass in the flange m (3,)."""

    mass: float = 0.0
    centroid: Vector = (0.0, 0.0, 0.0)


@dataclass
class Memory:
    """Everything that survives a restart.

    Attributes:
        tools: In the flange.
        user_frames: In the base.
        payload: Load at the flange.
        sensor_payload: Load behind the torque sensor.
        collision_level: 0 off, 1 to 5.
        installation_angles: About x and z, deg.
        feed_period_ms: Period of the status feed after a start; None for the one before anything was stored.
        field_switches: Names of feed fields, False where the field is switched off.
        programs: Names of the stored programs, without suffix.
        program_name: The loaded program.
        variables: User-defined variables: (id, alias, value).
        signals: RS-485 signals by name: ``chnId``, ``sigType``, ``sigAddr``, ``frequency``.
        settings: Values of the settings of ``commands_settings``, by setter and index.
    """

    tools: StoredFrames = field(default_factory=StoredFrames)
    user_frames: StoredFrames = field(default_factory=StoredFrames)
    payload: Payload = field(default_factory=Payload)
    sensor_payload: Payload = field(default_factory=Payload)
    collision_level: int = 3
    installation_angles: Tuple[float, float] = (0.0, 0.0)
    feed_period_ms: Optional[int] = None
    field_switches: Dict[str, bool] = field(default_factory=dict)
    programs: Tuple[str, ...] = ("abc", "paint", "weld")
    program_name: str = ""
    variables: Dict[int, Tuple[str, Any]] = field(default_factory=dict)
    signals: Dict[str, Dict[str, int]] = field(default_factory=dict)
    settings: Dict[Tuple[str, int], Dict[str, Any]] = field(default_factory=dict)
