"""Commands about tools, user frames, payload, collision sensitivity (docs/controller-protocol.md sections 5.7, 5.9)."""
from typing import Callable, List, Optional, Tuple

from jaka_ros_driver.simulation.controller.arguments import Arguments
from jaka_ros_driver.simulation.controller.command_spec import CommandSpec, Handler, Held, plain, slow_reply
from jaka_ros_driver.simulation.controller.memory import FRAME_COUNT, Memory, Payload, StoredFrames
from jaka_ros_driver.simulation.controller.replies import CommandRefused, Reply
from jaka_ros_driver.simulation.controller.state import ControllerState
from jaka_ros_driver.simulation.controller.wire_units import pose_from_wire, pose_to_wire, rounded
from jaka_ros_driver.simulation.dialect.table import EITHER
from jaka_ros_driver.units import all_m_to_mm, all_mm_to_m

MAX_COLLISION_LEVEL = 5
"""The highest collision level (docs/sdk-client.md)."""
MAX_MASS_KG = 100.0
"""Largest mass, kg: more than the heaviest arm of the line carries (models data)."""


def _set_offsets(table_of: Callable[[Memory], StoredFrames], key_of: Callable[[ControllerState, Arguments], str]
                 ) -> Handler:
    """Return the handler that stores a frame.

    The values of the active one hold at once, and are refused during a motion. Id 0, which is fixed, and ids beyond the
    table are refused.
    """
    def handle(state: ControllerState, arguments: Arguments) -> None:
        table, frame_id = table_of(state.memory), arguments.integer("id")
        if frame_id == table.active:
            state.require_standstill()
        pose = pose_from_wire(arguments.vector(key_of(state, arguments), 6))
        arguments.text("name", "")  # checked only: no query returns it
        if not 1 <= frame_id < FRAME_COUNT:
            raise CommandRefused()
        table.frames[frame_id] = pose
        if frame_id == table.active:
            state.apply_frames()
    return handle


def _user_key(state: ControllerState, arguments: Arguments) -> str:
    """Return the key of a user frame's offset.

    The maker's key is misspelt userffset; some clients send useroffset (docs/controller-protocol.md section 5.7).
    """
    key = state.dialect.user_frame_key
    return arguments.first_of("userffset", "useroffset") if key == EITHER else key


def _select(state: ControllerState, table: StoredFrames, frame_id: int) -> Optional[Held]:
    done_at, dialect = state.now + state.dialect.frame_delay, state.dialect
    state.select_frame(table, frame_id)
    return slow_reply(state, dialect.frame_reply, dialect.frame_reply_delay, lambda: state.now >= done_at)


def _offsets(table: StoredFrames) -> List[List[float]]:
    return [pose_to_wire(pose) for pose in table.frames]


def _set_load(payload_of: str) -> Handler:
    def handle(state: ControllerState, arguments: Arguments) -> None:
        mass, centroid = arguments.number("mass"), arguments.vector("centroid", 3)
        if not 0.0 <= mass <= MAX_MASS_KG:
            raise CommandRefused()
        setattr(state.memory, payload_of, Payload(mass, all_mm_to_m(centroid)))
    return handle


def _load(payload: Payload) -> Reply:
    return {"mass": payload.mass, "centroid": rounded(all_m_to_mm(payload.centroid))}


def _set_sensitivity(state: ControllerState, arguments: Arguments) -> None:
    """Set the collision sensitivity; refused while hand guiding is on (event 0x0F0055)."""
    level = arguments.integer("sensitivityVal")
    if not 0 <= level <= MAX_COLLISION_LEVEL or state.plant.is_hand_guided:
        raise CommandRefused()
    state.memory.collision_level = level


def _sensitivity(state: ControllerState) -> Reply:
    """Return the collision sensitivity, under one or both keys that clients read (docs/controller-protocol.md 5.9)."""
    key, level = state.dialect.sensitivity_key, state.memory.collision_level
    return {name: level for name in ("sensitivityLevel", "sensitivityVal") if key in (name, "both")}


FRAME_COMMANDS: Tuple[CommandSpec, ...] = (
    CommandSpec("set_tool_offsets", "5.7", _set_offsets(
        lambda memory: memory.tools, lambda state, arguments: "tooloffset")),
    CommandSpec("get_tool_offsets", "sdk-client.md 6", plain(
        lambda state: {"tool_offsets": _offsets(state.memory.tools)})),
    CommandSpec("set_tool_id", "5.7", lambda state, arguments: _select(
        state, state.memory.tools, arguments.integer("tool_id"))),
    CommandSpec("get_curr_tool_id", "5.7", plain(lambda state: {"id": state.memory.tools.active})),
    CommandSpec("set_user_offsets", "5.7", _set_offsets(lambda memory: memory.user_frames, _user_key)),
    CommandSpec("get_user_offsets", "sdk-client.md 6", plain(
        lambda state: {"user_offsets": _offsets(state.memory.user_frames)})),
    CommandSpec("set_user_id", "5.7", lambda state, arguments: _select(
        state, state.memory.user_frames, arguments.integer("user_frame_id"))),
    CommandSpec("get_curr_user_id", "5.7", plain(lambda state: {"id": state.memory.user_frames.active})),
    CommandSpec("set_payload", "5.7", _set_load("payload")),
    CommandSpec("get_payload", "5.7", plain(lambda state: _load(state.memory.payload))),
    CommandSpec("set_tool_payload", "5.7", _set_load("sensor_payload")),
    CommandSpec("get_tool_payload", "sdk-client.md 8", plain(lambda state: _load(state.memory.sensor_payload))),
    CommandSpec("set_clsn_sensitivity", "5.9", _set_sensitivity),
    CommandSpec("get_clsn_sensitivity", "5.9", plain(_sensitivity)),
)
