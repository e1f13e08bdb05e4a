"""What a server shows to its viewers, and whom it tells of it."""
from typing import Dict, FrozenSet, Iterable, List, Mapping, Optional, Sequence, Tuple

from jaka_bag.errors import JakaBagError

from .outbox import Frame
from .protocol import Channel, Parameter, PlaybackControl, Service


class Audience:
    """All viewers of a source; every method is called in the server's loop and returns at once."""

    def advertise(self, channels: Sequence[Channel]) -> None:
        """There are further channels."""
        raise NotImplementedError

    def unadvertise(self, channels: Sequence[int]) -> None:
        """Channels are gone, with all subscriptions to them."""
        raise NotImplementedError

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        """A message of a channel; ``time`` is its log time, ns."""
        raise NotImplementedError

    def tell_time(self, time: int) -> None:
        """It is this time, ns; only where the source has the capability ``time``."""
        raise NotImplementedError

    def tell(self, frame: Frame) -> None:
        """A frame for everybody, which is not lost."""
        raise NotImplementedError

    def tell_parameters(self, changed: Mapping[str, Parameter]) -> None:
        """Parameters have changed, by name; those who watch them are told."""
        raise NotImplementedError

    def tell_graph(self, frame: Frame) -> None:
        """A frame for those who watch the graph."""
        raise NotImplementedError

    def forget_messages(self) -> None:
        """Messages that wait to be sent are out of date."""
        raise NotImplementedError


class Recipient:
    """One viewer, as a source sees it when it subscribes."""

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        """A message of a channel for this viewer alone; nothing happens when it has let go of the channel."""
        raise NotImplementedError


class Source:
    """What is shown; all methods are called in the server's loop.

    Attributes:
        name: What viewers show of it.
        capabilities: What it offers besides channels, in the protocol's words.
        encodings: Of service calls.
        metadata: Further facts.
        time_range: First and last log time of a playback, ns.
        channels: By number.
        services: By number.
        audience: Whom it tells; set before ``open``.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.capabilities: Tuple[str, ...] = ()
        self.encodings: Tuple[str, ...] = ()
        self.metadata: Dict[str, str] = {}
        self.time_range: Optional[Tuple[int, int]] = None
        self.channels: Dict[int, Channel] = {}
        self.services: Dict[int, Service] = {}
        self.audience = Audience()

    async def open(self) -> None:
        """Begin."""

    async def close(self) -> None:
        """End; the audience is told nothing any more."""

    def want(self, channels: FrozenSet[int]) -> None:
        """These are the channels that somebody is subscribed to now."""

    def subscribed(self, recipient: Recipient, channel: int) -> None:
        """A viewer has subscribed: it may be sent what was there before."""

    def greeting(self) -> List[Frame]:
        """What a viewer is told besides channels when it comes."""
        return []

    def watch(self, parameters: bool, graph: bool) -> None:
        """Whether anybody wants to be told of parameters and of the graph."""

    def graph(self) -> Optional[Frame]:
        """The graph as it was told last, for one who begins to watch it."""
        return None

    async def parameters(self, names: Iterable[str]) -> List[Parameter]:
        """Values of parameters, all where no name is given; what is not set is left out.

        Raises:
            JakaBagError: They cannot be read.
        """
        return []

    async def call(self, service: Service, payload: bytes) -> bytes:
        """The reply to a service call.

        Raises:
            JakaBagError: The call came to nothing.
        """
        raise JakaBagError("there are no services")

    def control(self, request: PlaybackControl) -> None:
        """Play on as a viewer wants it.

        Raises:
            JakaBagError: It wants what cannot be done.
        """
        raise JakaBagError("there is nothing to play")
