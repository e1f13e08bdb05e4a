"""Services of a ROS graph, called without rospy; their definitions come from the generated Python modules.

After the ROS wiki pages "ROS/TCPROS" and "ROS/Master_API". A server sends type and md5, but no definition: services of
packages whose Python modules cannot be imported here are left out.
"""
import asyncio
import importlib
import struct
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Set, Tuple, Union
from urllib.parse import urlsplit

from jaka_bag.errors import ConnectionLost, JakaBagError, ProtocolError
from jaka_bag.live.graph import RemoteNode, master_uri
from jaka_bag.live.tcpros import decode_header, encode_header

from .outbox import SocketFrame
from .protocol import Service, advertise_services, unadvertise_services

_LENGTH = struct.Struct("<I")
_PERIOD_S = 2.0
"""Period, s, of the looks for new services: each asks the master, and new ones for their types."""
_CONNECT_TIMEOUT_S = 5.0
"""Longest wait, s, for a service's connection and header: a node that hangs must not keep a viewer."""
_PATIENCE_S = 0.5
"""Time, s, that new services are waited for; one that answers later is shown later."""
_LARGEST_HEADER = 1 << 20
"""Longest header, byte, of a service: with more it is no service."""
_LARGEST_REPLY = 64 << 20
"""Longest reply, byte, of a service, which is held in memory for its viewer."""

Told = Callable[[Dict[int, Service], List[SocketFrame]], None]
"""A callback for all services by number, and the frames with their changes."""


_Place = Tuple[str, str]
"""Name and address of a service."""


class _Silent(ConnectionLost):
    """A node that cannot be reached, or takes a link and says nothing; one that breaks a link may answer the next."""


class _Definition(NamedTuple):
    """A service type as the generated module has it."""

    md5sum: str
    request: str
    response: str


def _definition_of(type_name: str) -> Optional[_Definition]:
    """Return the definition of a service type; None where it is not installed here.

    A server names its type as it likes, and to import the module runs what the package has in it: nothing that goes
    wrong there says more than that there is no definition.
    """
    package, _, name = type_name.partition("/")
    try:
        generated = getattr(importlib.import_module(package + ".srv"), name)
        return _Definition(str(generated._md5sum), str(generated._request_class._full_text),
                           str(generated._response_class._full_text))
    except Exception:
        return None


async def _read_part(reader: asyncio.StreamReader, limit: int) -> bytes:
    size = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))[0]
    if size > limit:
        raise ProtocolError("%d bytes are announced: not TCPROS" % size)
    return await reader.readexactly(size)


class _ServiceLink:
    """One connection to a service's server, its header exchanged.

    Args:
        node: Global name of the calling node.
        name: Global name of the service.
        uri: ``rosrpc://host:port``.
        md5sum: MD5 sum of the service's type; ``*`` for any.
        is_probe: Only the header is wanted.

    Attributes:
        fields: The server's header.
    """

    def __init__(self, node: str, name: str, uri: str, md5sum: str, is_probe: bool = False) -> None:
        self._request = {"callerid": node, "service": name, "md5sum": md5sum}
        if is_probe:
            self._request["probe"] = "1"
        try:
            address = urlsplit(uri)
            host, port = address.hostname, address.port
        except ValueError as error:
            raise ProtocolError("%s of %s is no address: %s" % (uri, name, error)) from error
        if host is None or port is None:
            raise ProtocolError("%s of %s is no address" % (uri, name))
        self._address = host, port
        self._name = name
        self.fields: Dict[str, str] = {}

    async def __aenter__(self) -> "_ServiceLink":
        try:
            self._reader, self._writer = await asyncio.wait_for(asyncio.open_connection(*self._address),
                                                                _CONNECT_TIMEOUT_S)
        except (OSError, asyncio.TimeoutError) as error:
            raise _Silent("%s cannot be reached: %s" % (self._name, error)) from error
        except ValueError as error:  # UnicodeError: a host that cannot be asked for
            raise ProtocolError("%s:%d of %s is no address: %s" % (*self._address, self._name, error)) from error
        try:
            self._writer.write(encode_header(self._request))
            header = await asyncio.wait_for(self._read(_LARGEST_HEADER), _CONNECT_TIMEOUT_S)
            self.fields = decode_header(header)
        except asyncio.TimeoutError:
            self._writer.close()
            raise _Silent("%s does not answer" % self._name) from None
        except BaseException:
            self._writer.close()
            raise
        if "error" in self.fields:
            self._writer.close()
            raise ProtocolError("%s: %s" % (self._name, self.fields["error"]))
        return self

    async def __aexit__(self, *_: object) -> None:
        self._writer.close()

    async def _read(self, limit: int) -> bytes:
        try:
            return await _read_part(self._reader, limit)
        except (OSError, EOFError) as error:
            raise ConnectionLost("the link to %s broke: %s" % (self._name, error)) from error

    async def call(self, payload: bytes) -> bytes:
        """Send a request and return the reply, without a time limit.

        Raises:
            ConnectionLost: The link broke.
            JakaBagError: The service failed; the text has the server's own words.
        """
        self._writer.write(_LENGTH.pack(len(payload)) + payload)
        try:
            is_done = await self._reader.readexactly(1) != b"\0"
        except (OSError, EOFError) as error:
            raise ConnectionLost("the link to %s broke: %s" % (self._name, error)) from error
        reply = await self._read(_LARGEST_REPLY)
        if not is_done:
            raise JakaBagError("%s failed: %s" % (self._name, reply.decode("utf-8", "replace")))
        return reply


class ServiceCalls:
    """The services that viewers may call.

    Args:
        node: Global name of the calling node.
        prefix: Names begin with this.
        notice: Takes a line for the user.
    """

    def __init__(self, node: str, prefix: str, notice: Callable[[str], None]) -> None:
        self._node = node
        self._prefix = prefix
        self._notice = notice
        self._known: Dict[_Place, Optional[Service]] = {}
        self._asked: Set[_Place] = set()
        self._answers: Dict[_Place, Union[Dict[str, str], Exception]] = {}
        self._md5sums: Dict[int, str] = {}
        self._shown: Dict[int, Service] = {}
        self._left_out: Set[str] = set()
        self._due = 0.0

    # In the watching thread

    def look(self, master: RemoteNode, tell: Told) -> None:
        """Ask the master for services, if it is time to, and report changes.

        Raises:
            ConnectionLost: The master does not answer.
            ProtocolError: It refuses.
        """
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + _PERIOD_S
        names = sorted(str(name) for name, _ in master.call("getSystemState")[2])
        places: List[_Place] = []
        for name in names:
            if name.startswith(self._prefix):
                try:
                    places.append((name, str(master.call("lookupService", name))))
                except (ConnectionLost, ProtocolError):
                    continue  # it has gone
        self._ask([place for place in places if place not in self._known])
        services = [self._known.get(place) for place in places]
        shown = {service.id: service for service in services if service is not None}
        new = [one for number, one in shown.items() if number not in self._shown]
        gone = [number for number in self._shown if number not in shown]
        self._shown = shown
        frames: List[SocketFrame] = []
        if gone:
            frames.append(unadvertise_services(gone))
        if new:
            frames.append(advertise_services(new))
        if frames:
            tell(dict(shown), frames)

    def _ask(self, places: Sequence[_Place]) -> None:
        """Ask services for their types, and learn what has come; none that hangs may hold up the watch of topics."""
        new = [place for place in places if place not in self._asked and place not in self._answers]
        if new:
            self._asked.update(new)
            asking = threading.Thread(target=self._ask_all, args=(new,), daemon=True)
            asking.start()
            asking.join(_PATIENCE_S)
        for place in places:
            answer = self._answers.pop(place, None)
            if isinstance(answer, Exception):
                raise answer  # what nobody foresaw
            if answer is not None:
                self._known[place] = self._learn(place[0], answer)

    def _ask_all(self, new: Sequence[_Place]) -> None:
        """Ask for all of these before any is asked again: a node that hangs would be asked by ever more threads."""
        try:
            asyncio.run(self._probe_all(new))
        finally:
            self._asked.difference_update(new)

    async def _probe_all(self, places: Sequence[_Place]) -> None:
        """Ask all nodes at the same time, each for one service after the other."""
        nodes: Dict[str, List[_Place]] = {}
        for place in places:
            nodes.setdefault(place[1], []).append(place)
        await asyncio.gather(*[self._probe_node(some) for some in nodes.values()])

    async def _probe_node(self, places: Sequence[_Place]) -> None:
        for place in places:
            try:
                async with _ServiceLink(self._node, *place, "*", True) as link:
                    self._answers[place] = link.fields
            except _Silent:
                return  # nor would its other services answer now; all are asked again the next time
            except (ConnectionLost, ProtocolError):
                continue  # asked again the next time
            except Exception as error:
                self._answers[place] = error

    def _learn(self, name: str, fields: Dict[str, str]) -> Optional[Service]:
        type_name, md5sum = fields.get("type", ""), fields.get("md5sum", "")
        definition = _definition_of(type_name)
        if definition is None or definition.md5sum != md5sum:
            if type_name not in self._left_out:
                self._left_out.add(type_name)
                self._notice("services of the type %s are left out: its definition is %s" % (
                    type_name, "not installed here" if definition is None else "another one here"))
            return None
        for number, known in ((one.id, one) for one in self._known.values() if one is not None):
            if (known.name, known.type, self._md5sums[number]) == (name, type_name, md5sum):
                return known
        number = len(self._md5sums) + 1
        self._md5sums[number] = md5sum
        return Service(number, name, type_name, definition.request, definition.response)

    # In the server's loop

    async def call(self, service: Service, payload: bytes) -> bytes:
        """Call a service and return its reply.

        Raises:
            JakaBagError: The call failed; the text has the server's own words.
        """
        uri = await asyncio.get_running_loop().run_in_executor(None, self._look_up, service.name)
        async with _ServiceLink(self._node, service.name, uri, self._md5sums[service.id]) as link:
            return await link.call(payload)

    def _look_up(self, name: str) -> str:
        with RemoteNode(master_uri(), self._node) as master:
            return str(master.call("lookupService", name))
