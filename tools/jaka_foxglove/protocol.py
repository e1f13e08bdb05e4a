"""The Foxglove WebSocket protocol: its messages as bytes and text, what viewers send as values; no socket, no clock.

After the specification in https://github.com/foxglove/ws-protocol (``foxglove.websocket.v1``); ``foxglove.sdk.v1`` is
the same with the control of a playback, whose layout foxglove-sdk 0.30 shows on the wire. Integers are little-endian.

``ProtocolError`` is raised where a viewer's message is not understood.
"""
import base64
import json
import math
import struct
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Union

from jaka_bag.errors import ProtocolError
from jaka_bag.json_text import load_json
from jaka_bag.messages.connection import Connection
from jaka_bag.units import NS_PER_S

OLD_SUBPROTOCOL = "foxglove.websocket.v1"
SUBPROTOCOLS = ("foxglove.sdk.v1", OLD_SUBPROTOCOL)

INFO, WARNING, ERROR = 0, 1, 2
"""Levels of a status."""

PLAYING, PAUSED, BUFFERING, ENDED = 0, 1, 2, 3
"""States of a playback."""

_MESSAGE_DATA, _TIME, _CALL_RESPONSE, _PLAYBACK_STATE = 1, 2, 3, 5
_CALL_REQUEST, _PLAYBACK_CONTROL = 2, 3
_MESSAGE_HEAD = struct.Struct("<BIQ")
_TIME_BODY = struct.Struct("<BQ")
_CALL_HEAD = struct.Struct("<BIII")
_PLAYBACK_HEAD = struct.Struct("<BBQfBI")
_CONTROL_HEAD = struct.Struct("<BBfBQI")
_MAX_ID = (1 << 32) - 1
"""Largest number of a subscription or channel, which has 32 bits."""
_LONGEST_NAME = 1000
"""Most characters of a parameter's name, which is asked of the master."""
_SCHEMAS_AS_BASE64 = ("protobuf", "flatbuffer")


class Channel(NamedTuple):
    """One topic with one type, as viewers see it.

    Attributes:
        id: Its number; an equal channel keeps it.
        topic: Topic name.
        encoding: Encoding of the messages: ``ros1``, ``cdr``, ``json``, ...
        schema_name: ``package/Type``.
        schema: Definition with those of all types in it; base64 where ``schema_encoding`` is a binary one.
        schema_encoding: ``ros1msg``, ``ros2msg``, ...; empty where the messages have no schema.
    """

    id: int
    topic: str
    encoding: str
    schema_name: str
    schema: str
    schema_encoding: str


class Service(NamedTuple):
    """One service; ``request`` and ``response`` are definitions (ros1msg) with those of all types in them."""

    id: int
    name: str
    type: str
    request: str
    response: str


class Parameter(NamedTuple):
    """One parameter: name, a value that JSON can hold (None: not set), a hint about its type where one is needed."""

    name: str
    value: Any
    type: str = ""


# What viewers send

class Subscribe(NamedTuple):
    """Request to subscribe to channels: (the viewer's number of the subscription, channel)."""

    subscriptions: Tuple[Tuple[int, int], ...]


class Unsubscribe(NamedTuple):
    """Request to end subscriptions, by the viewer's numbers."""

    subscriptions: Tuple[int, ...]


class GetParameters(NamedTuple):
    """Request for parameters, all where ``names`` is empty; ``request`` goes into the answer."""

    names: Tuple[str, ...]
    request: Optional[str]


class SetParameters(NamedTuple):
    """Request to change parameters; only their names are kept, for nothing is changed here."""

    names: Tuple[str, ...]
    request: Optional[str]


class WatchParameters(NamedTuple):
    """Request to begin (``is_wanted``) or end updates of parameters; all where ``names`` is empty."""

    names: Tuple[str, ...]
    is_wanted: bool


class WatchGraph(NamedTuple):
    """Request to begin or end updates of the graph of publishers and subscribers."""

    is_wanted: bool


class ServiceCall(NamedTuple):
    """Request to call a service; ``call`` is the viewer's number of the call."""

    service: int
    call: int
    encoding: str
    payload: bytes


class PlaybackControl(NamedTuple):
    """Request to control a playback: ``speed`` is log seconds per second, ``seek`` a log time, ns, None to stay."""

    is_playing: bool
    speed: float
    seek: Optional[int]
    request: str


class Refused(NamedTuple):
    """A request of the protocol that is not served here; ``reason`` is for the viewer."""

    reason: str


ViewerRequest = Union[Subscribe, Unsubscribe, GetParameters, SetParameters, WatchParameters, WatchGraph, ServiceCall,
                PlaybackControl, Refused]

_REFUSED = {"advertise": "viewers cannot publish here", "unadvertise": "viewers cannot publish here",
            "fetchAsset": "files are not served here"}


def parse_text(text: str) -> ViewerRequest:
    """Parse a viewer's text message."""
    try:
        message = load_json(text, parse_int=_short_int)
    except ValueError:
        raise ProtocolError("a text message is no JSON") from None
    op = message.get("op") if isinstance(message, dict) else None
    if op == "subscribe":
        return Subscribe(tuple((_number(one, "id"), _number(one, "channelId"))
                               for one in _list(message, "subscriptions")))
    if op == "unsubscribe":
        return Unsubscribe(tuple(_as_number(one, "subscriptionIds") for one in _list(message, "subscriptionIds")))
    if op == "getParameters":
        return GetParameters(_names(message), _request(message))
    if op == "setParameters":
        named = [one.get("name") if isinstance(one, dict) else None for one in _list(message, "parameters")]
        return SetParameters(_names({"parameterNames": named}), _request(message))
    if op in ("subscribeParameterUpdates", "unsubscribeParameterUpdates"):
        return WatchParameters(_names(message), op == "subscribeParameterUpdates")
    if op in ("subscribeConnectionGraph", "unsubscribeConnectionGraph"):
        return WatchGraph(op == "subscribeConnectionGraph")
    if isinstance(op, str) and op in _REFUSED:
        return Refused("%s: %s" % (op, _REFUSED[op]))
    raise ProtocolError("a text message has no known op")


def _short_int(text: str) -> int:
    """Convert text to an integer; refuse a very long one, on which Python 3.8 would spend seconds."""
    if len(text) > 20:
        raise ValueError(text[:20])
    return int(text)


def _list(message: Dict[str, Any], key: str) -> List[Any]:
    value = message.get(key)
    if not isinstance(value, list):
        raise ProtocolError("%s is no list" % key)
    return value


def _as_number(value: Any, what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _MAX_ID:
        raise ProtocolError("%s is no number from 0 to %d" % (what, _MAX_ID))
    return value


def _number(message: Any, key: str) -> int:
    return _as_number(message.get(key) if isinstance(message, dict) else None, key)


def _names(message: Dict[str, Any]) -> Tuple[str, ...]:
    names = _list(message, "parameterNames")
    if not all(isinstance(name, str) and len(name) <= _LONGEST_NAME for name in names):
        raise ProtocolError("a parameter's name is no text, or longer than %d characters" % _LONGEST_NAME)
    return tuple(names)


def _request(message: Dict[str, Any]) -> Optional[str]:
    value = message.get("id")
    if value is not None and not isinstance(value, str):
        raise ProtocolError("id is no text")
    return value


def parse_binary(data: bytes) -> ViewerRequest:
    """Parse a viewer's binary message."""
    try:
        if data[:1] == bytes([_CALL_REQUEST]):
            _, service, call, size = _CALL_HEAD.unpack_from(data)
            end = _CALL_HEAD.size + size
            if end > len(data):
                raise ProtocolError("a service call is cut short")
            return ServiceCall(service, call, data[_CALL_HEAD.size:end].decode(), data[end:])
        if data[:1] == bytes([_PLAYBACK_CONTROL]):
            _, command, speed, has_seek, seek, size = _CONTROL_HEAD.unpack_from(data)
            if command not in (0, 1) or len(data) != _CONTROL_HEAD.size + size:
                raise ProtocolError("a playback control is not understood")
            return PlaybackControl(command == 0, speed, seek if has_seek else None,
                                   data[_CONTROL_HEAD.size:].decode())
        if data[:1] == bytes([_MESSAGE_DATA]):
            return Refused("message data: viewers cannot publish here")
    except (struct.error, UnicodeDecodeError):
        raise ProtocolError("a binary message is cut short or no text where text belongs") from None
    raise ProtocolError("a binary message has no known opcode")


# What viewers are sent

def _text(op: str, **fields: Any) -> str:
    return json.dumps({"op": op, **{name: value for name, value in fields.items() if value is not None}},
                      separators=(",", ":"))


def server_info(name: str, capabilities: Sequence[str], session: str, encodings: Sequence[str] = (),
                metadata: Optional[Dict[str, str]] = None, time_range: Optional[Tuple[int, int]] = None) -> str:
    """Return the first message to each viewer.

    Args:
        name: Name of the source, shown by the viewer.
        capabilities: Capabilities besides channels.
        session: Differs from one start of the server to the next.
        encodings: Encodings of service calls.
        metadata: Further facts.
        time_range: First and last log time of a playback, ns.
    """
    begin, end = (None, None) if time_range is None else map(_split_time, time_range)
    return _text("serverInfo", name=name, capabilities=list(capabilities), sessionId=session,
                 supportedEncodings=list(encodings) or None, metadata=metadata or None,
                 dataStartTime=begin, dataEndTime=end)


def _split_time(time: int) -> Dict[str, int]:
    return dict(zip(("sec", "nsec"), divmod(time, NS_PER_S)))


def status(level: int, message: str, name: Optional[str] = None) -> str:
    """Return a notice for a viewer; a later one with the same ``name`` replaces it."""
    return _text("status", level=level, message=message, id=name)


def remove_status(names: Iterable[str]) -> str:
    """Return the message that withdraws the notices with these names."""
    return _text("removeStatus", statusIds=list(names))


def advertise(channels: Iterable[Channel]) -> str:
    """Return the message that offers channels."""
    return _text("advertise", channels=[
        dict({"id": c.id, "topic": c.topic, "encoding": c.encoding, "schemaName": c.schema_name, "schema": c.schema},
             **({"schemaEncoding": c.schema_encoding} if c.schema_encoding else {})) for c in channels])


def unadvertise(channels: Iterable[int]) -> str:
    """Return the message that withdraws channels."""
    return _text("unadvertise", channelIds=list(channels))


def advertise_services(services: Iterable[Service]) -> str:
    """Return the message that offers services, with ROS 1 requests and replies."""
    def half(service: Service, what: str, text: str) -> Dict[str, str]:
        return {"encoding": "ros1", "schemaName": service.type + what, "schemaEncoding": "ros1msg", "schema": text}
    return _text("advertiseServices", services=[
        {"id": s.id, "name": s.name, "type": s.type, "request": half(s, "Request", s.request),
         "response": half(s, "Response", s.response)} for s in services])


def unadvertise_services(services: Iterable[int]) -> str:
    """Return the message that withdraws services."""
    return _text("unadvertiseServices", serviceIds=list(services))


def call_failure(service: int, call: int, message: str) -> str:
    """Return the message that a service call failed."""
    return _text("serviceCallFailure", serviceId=service, callId=call, message=message)


def parameter_values(parameters: Iterable[Parameter], request: Optional[str]) -> str:
    """Return the message with values of parameters, as an answer or because they have changed."""
    return _text("parameterValues", id=request, parameters=[
        {key: value for key, value in (("name", p.name), ("value", p.value), ("type", p.type or None))
         if value is not None} for p in parameters])


def graph_update(published: Dict[str, List[str]], subscribed: Dict[str, List[str]], services: Dict[str, List[str]],
                 removed_topics: Sequence[str] = (), removed_services: Sequence[str] = ()) -> str:
    """Return the message with the changes of the graph: nodes by topic and service."""
    return _text("connectionGraphUpdate",
                 publishedTopics=[{"name": name, "publisherIds": nodes} for name, nodes in published.items()],
                 subscribedTopics=[{"name": name, "subscriberIds": nodes} for name, nodes in subscribed.items()],
                 advertisedServices=[{"name": name, "providerIds": nodes} for name, nodes in services.items()],
                 removedTopics=list(removed_topics), removedServices=list(removed_services))


def message_data(subscription: int, time: int, payload: bytes) -> bytes:
    """Return the frame with one message of a channel; ``time`` is its log time, ns."""
    return _MESSAGE_HEAD.pack(_MESSAGE_DATA, subscription, time) + payload


def time_data(time: int) -> bytes:
    """Return the frame with the time, ns, where that is not the viewer's own clock's."""
    return _TIME_BODY.pack(_TIME, time)


def call_response(service: int, call: int, encoding: str, payload: bytes) -> bytes:
    """Return the frame with a service's reply."""
    raw = encoding.encode()
    return _CALL_HEAD.pack(_CALL_RESPONSE, service, call, len(raw)) + raw + payload


def playback_state(state: int, time: int, speed: float, did_seek: bool, request: str = "") -> bytes:
    """Return the frame with a playback's state; ``time`` is ns, ``request`` that of the control to answer."""
    raw = request.encode()
    return _PLAYBACK_HEAD.pack(_PLAYBACK_STATE, state, time, speed, did_seek, len(raw)) + raw


def is_playback_state(frame: Union[str, bytes]) -> bool:
    """Return whether a frame holds a playback's state."""
    return isinstance(frame, bytes) and frame[0] == _PLAYBACK_STATE


# Values

def channel_of(number: int, connection: Connection) -> Channel:
    """Return a connection's channel; a ROS 1 definition remains text, a binary one becomes base64."""
    raw = connection.definition.encode("utf-8", "surrogateescape")
    if connection.schema_encoding in _SCHEMAS_AS_BASE64:
        schema = base64.b64encode(raw).decode()
    else:
        schema = raw.decode("utf-8", "replace")
    has_schema = bool(connection.definition or connection.datatype)
    return Channel(number, connection.topic, connection.encoding, connection.datatype, schema,
                   connection.schema_encoding if has_schema else "")


def parameters_of(name: str, value: Any) -> List[Parameter]:
    """Return the parameters below a name of the parameter server, one for each value or empty dictionary."""
    if isinstance(value, dict) and value:
        return [parameter for key in sorted(value) for parameter in
                parameters_of("%s/%s" % (name.rstrip("/"), key), value[key])]
    return [parameter_of(name, value)]


def parameter_of(name: str, value: Any) -> Parameter:
    """Return a value as parameter; where JSON cannot hold it, as its text."""
    data = getattr(value, "data", None)
    if isinstance(data, bytes):  # XMLRPC's binary
        return Parameter(name, base64.b64encode(data).decode(), "byte_array")
    if isinstance(value, float) and math.isfinite(value):
        return Parameter(name, value, "float64")
    if isinstance(value, list) and value and all(isinstance(v, float) and math.isfinite(v) for v in value):
        return Parameter(name, value, "float64_array")
    return Parameter(name, _plain(value))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (bool, int, str)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return str(value)
