"""The TLS of a connection: it begins in the door's loop and goes on in the loop that serves the connection.

The token is seen behind the handshake only, and asyncio's own TLS stays in the loop in which it began. An
``ssl.SSLObject`` belongs to no loop, and needs neither a thread nor a second socket: bytes of the peer go in, text and
bytes for the peer come out.
"""
import asyncio
import contextlib
import ssl
from typing import Any

_AT_ONCE = 64 * 1024


def tls_context(cert: str, key: str) -> ssl.SSLContext:
    """Return the context of a server with this certificate; raises OSError where a file cannot be used."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(cert, key)
    context.options |= ssl.OP_NO_RENEGOTIATION  # it costs a server more than who asks for it, and would hold up writing
    return context


class Tls:
    """The server's end of the TLS of one connection.

    Attributes:
        context: Its context.
        has_ended: True when the peer has said that nothing more comes.
    """

    def __init__(self, context: ssl.SSLContext) -> None:
        self.context = context
        self.has_ended = False
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing, server_side=True)

    def decrypt(self, data: bytes) -> bytes:
        """Take bytes of the peer; return the text that is whole with them, empty for as long as hands are shaken.

        Raises:
            ssl.SSLError: They are no TLS that can be used.
        """
        self._incoming.write(data)
        text = b""
        with contextlib.suppress(ssl.SSLWantReadError):
            while not self.has_ended:
                piece = self._tls.read(_AT_ONCE)  # the handshake is part of it
                self.has_ended = not piece
                text += piece
        return text

    def encrypt(self, text: bytes) -> None:
        """Add text to what waits for the peer."""
        rest = memoryview(text)
        while rest:
            rest = rest[self._tls.write(rest):]

    def end(self) -> None:
        """Add the word that nothing more comes."""
        with contextlib.suppress(ssl.SSLError):  # the peer's answer to it is not waited for
            self._tls.unwrap()

    def take_waiting(self) -> bytes:
        """Return the bytes that wait for the peer: answers of the handshake, and text. They wait no longer."""
        return self._outgoing.read()


class TlsTransport(asyncio.Transport):
    """A transport that encrypts what is written to another one; flow control and addresses are the other's."""

    def __init__(self, below: asyncio.Transport, tls: Tls) -> None:
        super().__init__()
        self._below, self._tls = below, tls

    def decrypted(self, data: bytes) -> bytes:
        """Return the text in bytes of the peer, and send what TLS answers; raises ssl.SSLError."""
        text = self._tls.decrypt(data)
        self._send()
        if self._tls.has_ended:
            asyncio.get_event_loop().call_soon(self.close)  # behind the text, as the end of a connection is
        return text

    def write(self, data: Any) -> None:
        """Send bytes, encrypted."""
        if not self._below.is_closing():
            self._tls.encrypt(data)
            self._send()

    def close(self) -> None:
        """Send the end of TLS behind what was written, and close."""
        if not self._below.is_closing():
            self._tls.end()
            self._send()
            self._below.close()

    def _send(self) -> None:
        waiting = self._tls.take_waiting()
        if waiting:
            self._below.write(waiting)

    def abort(self) -> None:
        """Close at once."""
        self._below.abort()

    def is_closing(self) -> bool:
        """Return whether it is closing or closed."""
        return self._below.is_closing()

    def pause_reading(self) -> None:
        """Receive nothing for now."""
        self._below.pause_reading()

    def resume_reading(self) -> None:
        """Receive again."""
        self._below.resume_reading()

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return what is known of the connection, such as ``peername``."""
        return self._tls.context if name == "sslcontext" else self._below.get_extra_info(name, default)

    @property
    def _sendfile_compatible(self) -> None:
        """Raise NotImplementedError, with which aiohttp reads a file itself: the system's sendfile encrypts nothing."""
        raise NotImplementedError
