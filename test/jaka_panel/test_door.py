"""The door, with TLS and without: which loop serves a connection, and how long one stays that asks nothing."""
import asyncio
import contextlib
import ssl
import threading

import pytest
from strangers import context, half_of_a_hello
from tls_proxy import certificate_in

from jaka_panel.pages import door as pages_door
from jaka_panel.pages.door import Door
from jaka_panel.pages.hub import Hub
from jaka_panel.settings import Settings

LIMIT_S = 30.0
SOON_S = 5.0
TOKEN = "a-token-of-the-test"


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    return certificate_in(tmp_path_factory.mktemp("tls"))


def run(work, *args):
    asyncio.new_event_loop().run_until_complete(asyncio.wait_for(work(*args), LIMIT_S))


@contextlib.asynccontextmanager
async def open_door(tls):
    """Yield a door that listens, and how to connect to it."""
    settings = Settings(port=0, token=TOKEN, tls=tls)
    hub = Hub(settings, None)
    hub._loop = asyncio.get_event_loop()
    door = Door(settings, hub)
    await door.start()

    async def connect():
        return await asyncio.open_connection("127.0.0.1", door.port, ssl=None if tls is None else context())
    try:
        yield door, connect
    finally:
        await door.close()


async def ask(connection, request, token=TOKEN):
    """Send a request with the token; return the head of its answer."""
    reader, writer = connection
    secure = "" if writer.get_extra_info("sslcontext") is None else "s"
    host = "127.0.0.1:%d" % writer.get_extra_info("peername")[1]
    writer.write(("%s HTTP/1.1\r\nHost: %s\r\nOrigin: http%s://%s\r\nAuthorization: Bearer %s\r\nContent-Length: 0"
                  "\r\n\r\n" % (request, host, secure, host, token)).encode())
    head = (await reader.readuntil(b"\r\n\r\n")).decode()
    await reader.readexactly(int(head.partition("Content-Length: ")[2].split()[0]))
    return head


@pytest.mark.parametrize("is_secure", [False, True], ids=["clear", "TLS"])
def test_a_door_that_stands_still_holds_up_no_connection_with_the_token(certificate, is_secure):
    async def work():
        async with open_door(certificate if is_secure else None) as (door, connect):
            connection, visitor = await connect(), await connect()
            assert (await ask(connection, "POST /api/stop")).startswith("HTTP/1.1 200")
            assert (await ask(visitor, "GET /api/info", "none")).startswith("HTTP/1.1 200")
            goes_on = threading.Event()
            door._loop.call_soon_threadsafe(goes_on.wait, LIMIT_S)
            try:
                answer = await asyncio.wait_for(ask(connection, "POST /api/stop"), SOON_S)
                assert answer.startswith("HTTP/1.1 200")
                with pytest.raises(asyncio.TimeoutError):
                    await asyncio.wait_for(ask(visitor, "GET /api/info", "none"), 0.3)
            finally:
                goes_on.set()
            for _, writer in (connection, visitor):
                writer.close()
    run(work)


@pytest.mark.parametrize("begin", [b"", b"GET / HT", b"half a hello", b"hello", b"hello and GET / HT"])
def test_a_connection_that_asks_nothing_ends_in_time(certificate, monkeypatch, begin):
    monkeypatch.setattr(pages_door, "HEAD_S", 0.3)
    is_secure = b"hello" in begin

    async def work():
        async with open_door(certificate if is_secure else None) as (door, connect):
            began = asyncio.get_event_loop().time()
            if begin.startswith(b"hello"):
                reader, writer = await connect()
                writer.write(begin[len(b"hello and "):])
            else:
                reader, writer = await asyncio.open_connection("127.0.0.1", door.port)
                writer.write(half_of_a_hello() if is_secure else begin)
            with contextlib.suppress(ConnectionError, ssl.SSLError):
                assert await asyncio.wait_for(reader.read(), SOON_S) == b""
            assert asyncio.get_event_loop().time() - began > 0.25
            while door._entering:  # its task ends a moment after the connection
                await asyncio.sleep(0.001)
            writer.close()
    run(work)
