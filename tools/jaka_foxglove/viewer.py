"""One viewer: its subscriptions, requests and the queue of frames for it; no socket."""
import time
from typing import Callable, Coroutine, Dict, FrozenSet, Mapping, Optional, Set, Tuple

from jaka_bag.errors import JakaBagError, ProtocolError

from . import protocol
from .outbox import Outbox, SocketFrame
from .protocol import Parameter, ViewerRequest
from .source import ChannelSource, Recipient

_MAX_ERRORS = 32
"""Number of invalid messages after which a viewer is disconnected."""
_MAX_PARAMETERS = 10000
"""Names of parameters that one viewer may watch, or ask for at once."""
_CALM_S = 5.0
"""Time, s, without a dropped message after which a viewer is informed that it keeps up again."""
_SLOW = "slow"
_SLOW_TEXT = "messages are left out: this viewer, or the link to it, is too slow for what it is subscribed to"


class TooMuch(Exception):
    """The viewer asks for more than it may have, and is disconnected; the text gives the reason."""


def _once(names: Tuple[str, ...]) -> Tuple[str, ...]:
    """Return each name once: a short request must not have the whole tree of parameters sent a thousand times.

    Raises:
        TooMuch: There are too many.
    """
    names = tuple(dict.fromkeys(names))
    if len(names) > _MAX_PARAMETERS:
        raise TooMuch("it asks for more than %d parameters at once" % _MAX_PARAMETERS)
    return names


class Viewer(Recipient):
    """The server's side of one viewer: subscriptions, requests, messages to be sent.

    Args:
        name: Name for notices.
        source: Source that it is shown.
        session: Identifier of the server's start.
        limit: Bytes of messages that may wait to be sent.
        wake: Called when something waits to be sent.
        changed: Called when its subscriptions or what it watches have changed.

    Attributes:
        outbox: Queue of frames to be sent.
        watches_graph: The viewer watches the graph.
        watches_parameters: The viewer watches some parameter.
        knows_playback: The viewer is sent the playback's state. Clients of the older subprotocol report an error for
            that, unless they have controlled one.
        sending_since: Time since which a frame is being sent to it, monotonic s; None where none is.
    """

    def __init__(self, name: str, source: ChannelSource, session: str, limit: int, wake: Callable[[], None],
                 changed: Callable[[], None]) -> None:
        self.name = name
        self.outbox = Outbox(limit)
        self.watches_graph = False
        self.knows_playback = True
        self.sending_since: Optional[float] = None
        self._source = source
        self._session = session
        self._wake = wake
        self._changed = changed
        self._channels: Dict[int, int] = {}
        self._subscriptions: Dict[int, int] = {}
        self._watched: Set[str] = set()
        self._watches_all = False
        self._errors = 0
        self._dropped = 0
        self._dropped_at: Optional[float] = None

    @property
    def channels(self) -> FrozenSet[int]:
        """The channels that it is subscribed to."""
        return frozenset(self._subscriptions)

    @property
    def watches_parameters(self) -> bool:
        return self._watches_all or bool(self._watched)

    # What it is told

    def greet(self) -> None:
        """Send the server's information, channels and services."""
        source = self._source
        self.tell(protocol.server_info(source.name, source.capabilities, self._session, source.encodings,
                                       source.metadata, source.time_range))
        self.tell(protocol.advertise(source.channels.values()))
        if source.services:
            self.tell(protocol.advertise_services(source.services.values()))
        for frame in source.greeting():
            self.tell(frame)

    def tell(self, frame: SocketFrame) -> None:
        """Send what must not be lost.

        Raises:
            TooMuch: It does not read what it asked for.
        """
        if not self.knows_playback and protocol.is_playback_state(frame):
            return
        if not self.outbox.answer(frame):
            raise TooMuch("it does not read the answers to what it asks")
        self._wake()

    def deliver(self, channel: int, time: int, payload: bytes) -> None:
        subscription = self._subscriptions.get(channel)
        if subscription is None:
            return
        self.outbox.message(subscription, time, payload)
        if self.outbox.dropped != self._dropped or self._dropped_at is not None:
            self._tell_slowness()
        self._wake()

    def tell_time(self, time: int) -> None:
        """Send the time, ns."""
        self.outbox.message(None, time)
        self._wake()

    def tell_parameters(self, changed: Mapping[str, Parameter]) -> None:
        """Send the changed parameters that this viewer watches."""
        mine = [one for name, one in changed.items() if self._watches_all or name in self._watched]
        if mine:
            self.tell(protocol.parameter_values(mine, None))

    def forget_channel(self, channel: int) -> None:
        """Forget a channel and its subscription."""
        subscription = self._subscriptions.pop(channel, None)
        if subscription is not None:
            del self._channels[subscription]

    def _tell_slowness(self) -> None:
        now = time.monotonic()
        if self.outbox.dropped != self._dropped:
            self._dropped = self.outbox.dropped
            if self._dropped_at is None:
                self.tell(protocol.status(protocol.WARNING, _SLOW_TEXT, _SLOW))
            self._dropped_at = now
        elif self._dropped_at is not None and now - self._dropped_at > _CALM_S:
            self._dropped_at = None
            self.tell(protocol.remove_status([_SLOW]))

    # What it asks

    def parse(self, message: SocketFrame) -> Optional[ViewerRequest]:
        """Parse a viewer's message; return None, and send a complaint, where it is invalid.

        Raises:
            TooMuch: The viewer has sent too many invalid messages.
        """
        try:
            return protocol.parse_text(message) if isinstance(message, str) else protocol.parse_binary(message)
        except ProtocolError as error:
            self._complain("not understood: %s" % error)
            return None

    def _complain(self, text: str) -> None:
        self._errors += 1
        if self._errors > _MAX_ERRORS:
            raise TooMuch("it sends what is not understood: %s" % text)
        self.tell(protocol.status(protocol.ERROR, text))

    def serve(self, request: ViewerRequest) -> Optional[Coroutine[None, None, None]]:
        """Serve a request; return the part that takes time, to be awaited.

        Raises:
            TooMuch: The viewer asks for too much.
        """
        if isinstance(request, protocol.Subscribe):
            for subscription, channel in request.subscriptions:
                self._subscribe(subscription, channel)
            self._changed()
        elif isinstance(request, protocol.Unsubscribe):
            for subscription in request.subscriptions:
                self._unsubscribe(subscription)
            self._changed()
        elif isinstance(request, protocol.GetParameters):
            return self._answer_parameters(_once(request.names), request.request)
        elif isinstance(request, protocol.SetParameters):
            self._complain("parameters are read-only here")
            return self._answer_parameters(_once(request.names), request.request)
        elif isinstance(request, protocol.WatchParameters):
            self._watch_parameters(request)
            self._changed()
        elif isinstance(request, protocol.WatchGraph):
            self._watch_graph(request.is_wanted)
            self._changed()
        elif isinstance(request, protocol.ServiceCall):
            return self._call(request)
        elif isinstance(request, protocol.PlaybackControl):
            self.knows_playback = True
            try:
                self._source.control(request)
            except JakaBagError as error:
                self._complain(str(error))
        else:
            self._complain(request.reason)
        return None

    def _subscribe(self, subscription: int, channel: int) -> None:
        if channel not in self._source.channels:
            self._complain("there is no channel %d" % channel)
        elif subscription in self._channels:
            self._complain("the subscription %d is there already" % subscription)
        elif channel in self._subscriptions:
            self._complain("the channel %d is subscribed already" % channel)
        else:
            self._channels[subscription] = channel
            self._subscriptions[channel] = subscription
            self._source.subscribed(self, channel)

    def _unsubscribe(self, subscription: int) -> None:
        channel = self._channels.pop(subscription, None)
        if channel is None:
            return  # the channel may have gone just now
        del self._subscriptions[channel]
        self.outbox.forget_subscription(subscription)

    def _watch_parameters(self, request: protocol.WatchParameters) -> None:
        if not request.names:
            self._watches_all = request.is_wanted
            self._watched.clear()
        elif request.is_wanted:
            self._watched.update(request.names)
            if len(self._watched) > _MAX_PARAMETERS:
                raise TooMuch("it watches more than %d parameters" % _MAX_PARAMETERS)
        else:
            self._watched.difference_update(request.names)

    def _watch_graph(self, is_wanted: bool) -> None:
        if is_wanted and not self.watches_graph:
            graph = self._source.graph()
            if graph is not None:
                self.tell(graph)
        self.watches_graph = is_wanted

    async def _answer_parameters(self, names: Tuple[str, ...], request: Optional[str]) -> None:
        try:
            values = await self._source.parameters(names)
        except JakaBagError as error:
            self.tell(protocol.status(protocol.ERROR, "parameters: %s" % error))
            values = []
        self.tell(protocol.parameter_values(values, request))

    async def _call(self, request: protocol.ServiceCall) -> None:
        service = self._source.services.get(request.service)
        try:
            if service is None:
                raise JakaBagError("there is no service %d" % request.service)
            if request.encoding != "ros1":
                raise JakaBagError("requests are encoded as ros1, not as %.20r" % request.encoding)
            reply = await self._source.call(service, request.payload)
        except JakaBagError as error:
            self.tell(protocol.call_failure(request.service, request.call, str(error)))
            return
        self.tell(protocol.call_response(request.service, request.call, request.encoding, reply))
