"""A proxy on loopback that ends TLS, as nginx or caddy before a panel: bytes in the clear go to the panel and back.

And the certificate for it, or for a panel.
"""
import asyncio
import contextlib
import ssl
import subprocess


def certificate_in(folder):
    """Make a certificate for localhost and its key in a folder; return their files."""
    cert, key = "%s/cert.pem" % folder, "%s/key.pem" % folder
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost",
                    "-keyout", key, "-out", cert, "-days", "1"], check=True, stderr=subprocess.DEVNULL)
    return cert, key


class TlsProxy:
    """The proxy, on a free port of loopback, in the loop of the pages.

    Attributes:
        port: Port on which it speaks TLS.
        target: Port of loopback to which it connects.
    """

    def __init__(self, loop, cert, key):
        self._loop = loop
        self._context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        self._context.load_cert_chain(cert, key)
        self.target = 0
        self._server = loop.run(self._listen())
        self.port = self._server.sockets[0].getsockname()[1]

    async def _listen(self):
        return await asyncio.start_server(self._serve, "127.0.0.1", 0, ssl=self._context)

    async def _serve(self, reader, writer):
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.target)
        await asyncio.gather(_pass_on(reader, far_writer), _pass_on(far_reader, writer))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        async def close():
            self._server.close()
        self._loop.run(close())


async def _pass_on(reader, writer):
    """Pass bytes on until their source ends, then end their sink."""
    with contextlib.suppress(OSError):
        while True:
            data = await reader.read(65536)
            if not data:
                break
            writer.write(data)
            await writer.drain()
    writer.close()
