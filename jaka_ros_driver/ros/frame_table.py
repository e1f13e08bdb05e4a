"""The tools, user frames, load and collision level of the controller, read again whenever they may have changed."""
import contextlib
import logging
import threading
from typing import Any, Iterator, Optional, Tuple

from jaka_ros_driver import commands as c
from jaka_ros_driver.client.arm_client import ArmClient
from jaka_ros_driver.errors import InvalidCommand, JakaError
from jaka_ros_driver.kinematics.rotations import IDENTITY, Transform, transform_from_pose
from jaka_ros_driver.state import RobotState

_LOG = logging.getLogger(__name__)

_CHECK_PERIOD_S = 0.2
"""Period, s, of looks whether the link was made anew: other frames may be active then."""
_READ_PERIOD_S = 5.0
"""Longest time, s, until a frame that was changed at the controller itself is noticed."""
_RETRY_S = 1.0
"""Pause, s, after tables that could not be read."""

Frames = Tuple[Transform, ...]


class FrameReader:
    """The reader of frames, ``flange_T_tool`` and ``base_T_user`` by id, and load, with a thread of its own.

    Each is None while it is not known.
    """

    def __init__(self, arm: ArmClient) -> None:
        self._arm = arm
        self._lock = threading.Lock()
        self._tools: Optional[Frames] = None
        self._users: Optional[Frames] = None
        self._changes = 0
        """Number of beginnings and ends of changes; odd while a change is being made."""
        self._payload: Optional[c.SetPayload] = None
        self._collision_level: Optional[int] = None
        self._load_changes, self._load_changing = 0, 0
        """Numbers of beginnings and ends of changes of the load, and of those that are being made."""
        self._connections = 0
        self._wake = threading.Event()
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="frame table", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._is_closing = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    @contextlib.contextmanager
    def changing(self) -> Iterator[None]:
        """Set frames within this context: inside it no frame is known, afterwards all are read again.

        Only one thread at a time may use it.
        """
        self._forget()
        try:
            yield
        finally:
            self._forget()
            self._wake.set()

    @contextlib.contextmanager
    def changing_load(self) -> Iterator[None]:
        """Set load or collision level within this context, as ``changing`` has it; several threads may use it."""
        self._forget_load(1)
        try:
            yield
        finally:
            self._forget_load(-1)
            self._wake.set()

    @property
    def payload(self) -> Optional[c.SetPayload]:
        """The load at the active tool."""
        return self._payload

    @property
    def collision_level(self) -> Optional[int]:
        """The collision sensitivity, 0 (off) to 5."""
        return self._collision_level

    def flange_t_tool(self, state: RobotState) -> Optional[Transform]:
        """Return the active tool in the flange frame, m."""
        return frame_of(self._tools, state.tool_id)

    def base_t_user(self, state: RobotState) -> Optional[Transform]:
        """Return the active user frame in the base frame, m."""
        return frame_of(self._users, state.user_frame_id)

    def _forget(self) -> None:
        with self._lock:
            self._changes += 1
            self._tools = self._users = None
            self._arm.know_tools(None)
        self._forget_load(0)  # another tool has another load

    def _forget_load(self, more: int) -> None:
        """Forget the load, of which so many more changes are being made."""
        with self._lock:
            self._load_changing += more
            self._load_changes += 1
            self._payload = self._collision_level = None

    def _run(self) -> None:
        waited = _READ_PERIOD_S
        while not self._is_closing:
            connections = self._arm.link_health.connections
            if waited >= _READ_PERIOD_S or self._wake.is_set() or connections != self._connections:
                self._wake.clear()
                self._connections = connections
                waited = 0.0 if self._read_all() else _READ_PERIOD_S - _RETRY_S
            self._wake.wait(_CHECK_PERIOD_S)
            waited += _CHECK_PERIOD_S

    def _read_all(self) -> bool:
        """Read frames and load; return False, and forget none, where the controller holds its replies back."""
        changes, load_changes = self._changes, self._load_changes
        try:
            tools, users = self._read_frames(c.Query.TOOL_FRAMES), self._read_frames(c.Query.USER_FRAMES)
            payload, level = self._read(c.Query.PAYLOAD), self._read(c.Query.COLLISION_LEVEL)
        except InvalidCommand:
            return False
        with self._lock:
            if changes == self._changes and changes % 2 == 0:
                self._tools, self._users = tools, users
                self._arm.know_tools(tools)
            if load_changes == self._load_changes and not self._load_changing:
                self._payload, self._collision_level = payload, level
        return True

    def _read_frames(self, query: c.Query) -> Optional[Frames]:
        poses = self._read(query)
        return None if poses is None else tuple(map(transform_from_pose, poses))

    def _read(self, query: c.Query) -> Any:
        """Return the controller's answer; None where it does not tell."""
        try:
            return self._arm.execute(query)
        except InvalidCommand:
            raise
        except JakaError as error:
            _LOG.debug("%s: %s", query, error)
            return None


def frame_of(frames: Optional[Frames], index: Optional[int]) -> Optional[Transform]:
    """Return the frame of an id, m: identity for 0, and where none is active; None where the table does not have it."""
    if index is None or index == 0:
        return IDENTITY
    if frames is None or not 0 < index < len(frames):
        return None
    return frames[index]
