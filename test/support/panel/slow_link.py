"""A network between page and panel: a TCP proxy with a delay each way, stalls that end in a burst, and losses."""
import asyncio
import contextlib
import random
import time

LOST_S = 0.25
"""Time for which a lost segment holds up all that is behind it: TCP sends it again after 0.2 s and more."""


class SlowLink:
    """A proxy to a port of loopback.

    Args:
        loop: A Loop of ``panel_page``, in which it runs.
        target: The panel's port.
        delay: Of every byte, each way, s.
        loss: Share of the pieces that are lost, and sent again.

    Attributes:
        port: Where a page connects to.
        is_stalled: Nothing passes now; what waits comes in a burst when it is False again.
        passages: For each connection, in order, when each piece to the target came, and when it went on.
    """

    def __init__(self, loop, target, delay=0.0, loss=0.0):
        self._loop, self._target, self.delay, self._loss = loop, target, delay, loss
        self.is_stalled = False
        self.passages = []
        self._chance = random.Random(1)
        self._tasks = set()
        self._server = loop.run(asyncio.start_server(self._serve, "127.0.0.1", 0))
        self.port = self._server.sockets[0].getsockname()[1]

    async def _serve(self, reader, writer):
        self._tasks.add(asyncio.current_task())
        with contextlib.suppress(OSError, asyncio.CancelledError):
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._target)
            try:
                self.passages.append([])
                await asyncio.gather(self._pump(reader, far_writer, self.passages[-1]),
                                     self._pump(far_reader, writer, []))
            finally:
                writer.close()
                far_writer.close()

    async def _pump(self, reader, writer, passages):
        pieces = asyncio.Queue()
        sending = asyncio.ensure_future(self._send(pieces, writer, passages))
        try:
            while True:
                data = await reader.read(1 << 16)
                came = time.monotonic()
                pieces.put_nowait((came, came + self.delay, data))
                if not data:
                    break
            await sending
        finally:
            sending.cancel()

    async def _send(self, pieces, writer, passages):
        while True:
            came, due, data = await pieces.get()
            await asyncio.sleep(due - time.monotonic())
            if self._chance.random() < self._loss:
                await asyncio.sleep(LOST_S)
            while self.is_stalled:
                await asyncio.sleep(0.005)
            if not data:
                writer.close()
                return
            passages.append((came, time.monotonic()))
            writer.write(data)
            await writer.drain()

    async def _close(self):
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def close(self):
        self._loop.run(self._close())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
