"""The interfaces between a server's viewers and the source that it shows to them."""
from typing import Dict, FrozenSet, Iterable, List, Mapping, Optional, Sequence, Tuple

from jaka_bag.errors import JakaBagError

from .outbox import SocketFrame
from .protocol import Channel, Parameter, PlaybackControl, Service


class Audience:
    """All viewers of a source; every method is called in the server's loop and returns at once."""

    def advertise(self, channels: Sequence[Channel]) -> None:
        """Offer further channels."""
        raise NotImplementedError

    def unadvertise(self, channels: Sequence[int]) -> None:
        """Withdraw channels, with all subscriptions to them."""
        raise NotImplementedError

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        """Deliver a channel's message; ``time`` is its log time, ns."""
        raise NotImplementedError

    def tell_time(self, time: int) -> None:
        """Send the time, ns; only where the source has the capability ``time``."""
        raise NotImplementedError

    def tell(self, frame: SocketFrame) -> None:
        """Send a frame to every viewer; it is never dropped."""
        raise NotImplementedError

    def tell_parameters(self, changed: Mapping[str, Parameter]) -> None:
        """Send changed parameters, by name, to the viewers that watch them."""
        raise NotImplementedError

    def tell_graph(self, frame: SocketFrame) -> None:
        """Send a frame to the viewers that watch the graph."""
        raise NotImplementedError

    def forget_messages(self) -> None:
        """Discard the messages that wait to be sent: they are out of date."""
        raise NotImplementedError


class Recipient:
    """One viewer, as a source sees it when it subscribes."""

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        """Deliver a channel's message to this viewer alone; do nothing where it has unsubscribed."""
        raise NotImplementedError


class ChannelSource:
    """A source of channels, services and parameters; all methods are called in the server's loop.

    Attributes:
        name: Name that viewers show.
        capabilities: Capabilities besides channels, in the protocol's words.
        encodings: Encodings of service calls.
        metadata: Further facts.
        time_range: First and last log time of a playback, ns.
        channels: Channels by number.
        services: Services by number.
        audience: Receiver of changes and messages; set before ``open``.
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
        """Open the source, so that channels and services are known."""

    async def close(self) -> None:
        """End; nothing is sent to the audience any more."""

    def want(self, channels: FrozenSet[int]) -> None:
        """Set the channels that have a subscriber now."""

    def subscribed(self, recipient: Recipient, channel: int) -> None:
        """Handle a viewer's new subscription: earlier messages may be sent to it."""

    def greeting(self) -> List[SocketFrame]:
        """Return the frames, besides channels, for a viewer that has just connected."""
        return []

    def watch(self, parameters: bool, graph: bool) -> None:
        """Set whether any viewer watches parameters, and the graph."""

    def graph(self) -> Optional[SocketFrame]:
        """Return the graph as last published, for a viewer that begins to watch it."""
        return None

    async def parameters(self, names: Iterable[str]) -> List[Parameter]:
        """Return values of parameters, all where no name is given; parameters that are not set are left out.

        Raises:
            JakaBagError: The parameters cannot be read.
        """
        return []

    async def call(self, service: Service, payload: bytes) -> bytes:
        """Call a service and return its reply.

        Raises:
            JakaBagError: The call failed.
        """
        raise JakaBagError("there are no services")

    def control(self, request: PlaybackControl) -> None:
        """Play on as a viewer wants it.

        Raises:
            JakaBagError: It wants what cannot be done.
        """
        raise JakaBagError("there is nothing to play")
