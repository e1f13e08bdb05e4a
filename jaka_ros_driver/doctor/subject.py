"""The system that is examined: the driver's parameters as it would read them, and looks that several checks share."""
import functools
import time
from typing import Any, Mapping, NamedTuple, Optional

from jaka_ros_driver.doctor.questions import Answers, FeedSample, ask_controller, listen_to_feed
from jaka_ros_driver.errors import JakaError
from jaka_ros_driver.ros.driver_lock import holder_of
from jaka_ros_driver.ros.params import DriverConfig, config_from
from jaka_ros_driver.state import unrest


class Refusal(NamedTuple):
    """The reason why the command port was not connected."""

    reason: str
    is_driven_here: bool = False


class ExaminedSystem:
    """The computer and the controller that are examined.

    Attributes:
        values: The driver's private parameters as they are set, by name.
        source: Where they come from, for the reader.
        node: Resolved name of the driver.
        black_box: Folder of the black box; "" for none.
        is_status_only: True where the command port is not to be connected at all.
        wrong: Why the driver would refuse the parameters; "" where it takes them.
    """

    def __init__(self, values: Mapping[str, Any], source: str, node: str, black_box: str = "",
                 is_status_only: bool = False) -> None:
        self.values = dict(values)
        self.source = source
        self.node = node
        self.black_box = black_box
        self.is_status_only = is_status_only
        self.wrong = ""
        self._config: Optional[DriverConfig] = None
        try:
            self._config = config_from(self.values)
        except JakaError as error:
            self.wrong = str(error)

    @property
    def config(self) -> DriverConfig:
        """The driver's configuration; where it is wrong, the defaults with the address and ports that can be used."""
        if self._config is not None:
            return self._config
        kept = {}
        for name in ("ip", "command_port", "status_port"):
            try:
                config_from({name: self.values[name]})
                kept[name] = self.values[name]
            except (KeyError, JakaError):
                pass
        return config_from(kept)

    @property
    def has_controller(self) -> bool:
        """True where an address was given; the default is this computer, where no real controller listens."""
        return "ip" in self.values and bool(self.values["ip"])

    @functools.cached_property
    def feed(self) -> FeedSample:
        """The sample of the status port, of a second or two; nothing is sent to it."""
        return listen_to_feed(self.config.ip, self.config.status_port)

    @functools.cached_property
    def holder(self) -> str:
        """The driver on this computer that has the controller; "" for none."""
        return holder_of(self.config.ip, self.config.command_port)

    @functools.cached_property
    def refusal(self) -> Optional[Refusal]:
        """The reason to leave the command port alone, as ``unrest`` has it; None where it may be asked."""
        if self.is_status_only:
            return Refusal("--status-only was given")
        if self.holder:
            return Refusal("%s has the controller" % self.holder, is_driven_here=True)
        reason = unrest(self.feed.states, time.monotonic())
        return Refusal(reason) if reason else None

    @functools.cached_property
    def answers(self) -> Answers:
        """The controller's answers; call it only where ``refusal`` is None."""
        return ask_controller(self.config.ip, self.config.command_port)
