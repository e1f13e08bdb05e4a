"""What procedures may use of the core; ``ArmCore`` is it."""
from typing import Optional, Protocol

from jaka_ros_driver.client.core.actions import Actions
from jaka_ros_driver.client.core.custody import Custody
from jaka_ros_driver.client.settings import ClientSettings
from jaka_ros_driver.commands import Command
from jaka_ros_driver.state import RobotState


class ArmAccess(Protocol):
    """See ``ArmCore`` for each of these."""

    settings: ClientSettings
    actions: Actions
    custody: Custody
    disturbances: int
    last_disturbance: str

    @property
    def state(self) -> Optional[RobotState]:
        """The newest state, however old."""

    def fresh_state(self, now: float) -> RobotState:
        """The newest state; ConnectionLost where it is stale."""

    def is_ready(self, now: float) -> bool:
        """Both links are up and the state is fresh."""

    def audited(self, command: Command) -> Command:
        """The command, if it keeps the model's limits."""

    def stop_own(self, now: float) -> None:
        """A stop that nobody is answered for."""

    def note_operator(self, what: str) -> None:
        """A call that ends what was begun without one."""

    def hand_guiding_was_set(self, active: bool) -> None:
        """The controller took it."""
