"""A page without a browser: a client of the panel's WebSocket that sends what a page sends, and with chosen faults."""
import asyncio
import contextlib
import json
import os
import re
import signal
import subprocess
import threading
import time

import aiohttp
from command_places import command_of
from waiting import eventually

WAIT = 60.0
PERIOD_S = 0.05
PROGRAM = command_of("jaka_panel")


class PanelProcess:
    """The executable jaka_panel on a free port.

    Attributes:
        address: The address of its page, without the token.
        scheme: http or https.
        token: The token of its commands.
    """

    def __init__(self, *arguments, name="panel"):
        self.process = subprocess.Popen([*PROGRAM, "--port", "0", "__name:=" + name, *arguments],
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                        env=dict(os.environ, PYTHONUNBUFFERED="1"))
        self.said = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        assert eventually(lambda: self._opened() or self.process.poll() is not None, WAIT)
        assert self._opened(), "".join(self.said)
        self.address, self.token = self._opened().groups()
        self.scheme = self.address.partition(":")[0]
        self.port = int(self.address.rstrip("/").rpartition(":")[2])

    def _read(self):
        for line in self.process.stdout:
            self.said.append(line)

    def _opened(self):
        return re.search(r"open (\S+?)#token=(\S+)", "".join(self.said))

    def send(self, number):
        """Send it a signal; return the moment before."""
        moment = time.monotonic()
        self.process.send_signal(number)
        return moment

    def end(self, how=signal.SIGINT):
        """End it; return its exit code and its output."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(how)
        try:
            code = self.process.wait(WAIT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self._reader.join()
        self.process.stdout.close()
        return code, "".join(self.said)

    def cpu(self):
        """Return the processor time that it has taken, s."""
        with open("/proc/%d/stat" % self.process.pid, encoding="ascii") as file:
            words = file.read().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    def resident(self):
        """Return its memory, MB."""
        with open("/proc/%d/statm" % self.process.pid, encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()


class Loop:
    """An event loop in a thread of its own, for all pages."""

    def __init__(self):
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self._thread.start()

    def run(self, work, timeout=WAIT):
        """Return what a coroutine returns."""
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(timeout)

    def close(self):
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()


class Page:
    """One page.

    Attributes:
        messages: All that it received, oldest first; states and plots are only counted.
        states: The newest state of each arm, and how many came altogether.
        is_shown: States that come are shown: heartbeats name the newest.
        sent_at: When the newest heartbeat was sent that should count.
    """

    def __init__(self, loop, panel, token=True, origin=None, headers=None, name="page", hello=True, port=None):
        self._loop = loop
        self.address = "%s://127.0.0.1:%d" % (panel.scheme, port or panel.port)
        self.messages, self.states, self.counts = [], {}, {}
        self.plots = []
        self.is_shown = True
        self.closed = None
        self.now = 0.0
        self.sent_at = 0.0
        self._number = self._hold = self._sequence = 0
        self._held = None
        self._holding = None
        self._pinging = True
        self.is_silent = self.is_stalled = False
        self._waiting = []
        given = panel.token if token is True else token
        offered = ("jaka-panel.v1", "token.%s" % panel.token) if token is True else ("jaka-panel.v1",)
        self._loop.run(self._connect(dict({"Origin": origin or self.address}, **(headers or {})), offered))
        if hello:
            self.send(t="hello", v=1, token=given, name=name)
            self.welcome = self.wait("welcome")

    async def _connect(self, headers, protocols):
        self._session = aiohttp.ClientSession()
        try:
            self._socket = await self._session.ws_connect(self.address + "/ws", headers=headers, max_msg_size=0,
                                                             protocols=protocols, ssl=False)
        except BaseException:
            await self._session.close()
            raise
        self._reading = asyncio.ensure_future(self._read())
        self._ping = asyncio.ensure_future(self._ping_for_ever())

    async def _read(self):
        async for received in self._socket:
            message = json.loads(received.data)
            kind = message["t"]
            self.counts[kind] = self.counts.get(kind, 0) + 1
            if self.is_shown and "now" in message:
                self.now = max(self.now, message["now"])
            if kind == "state":
                self.states[message["arm"]] = dict(message, received_at=time.monotonic())
            elif kind == "plot":
                self.plots.append(message)
            elif kind != "pong":
                self.messages.append(message)
        self.closed = self._socket.close_code

    async def _ping_for_ever(self):
        with contextlib.suppress(ConnectionError, RuntimeError):
            while True:
                await asyncio.sleep(0.4)
                if self._pinging and not self.is_silent:
                    await self._send({"t": "ping", "clock": 1000.0 * time.monotonic(), "echo": self.now, "seen": 0})

    async def _send(self, message):
        if self.is_stalled:
            self._waiting.append(message)
            return
        while self._waiting:
            await self._socket.send_str(json.dumps(self._waiting.pop(0)))
        await self._socket.send_str(message if isinstance(message, str) else json.dumps(message))

    # ---- talk ----

    def own_port(self):
        """Return the port from which it has connected."""
        return self._socket.get_extra_info("sockname")[1]

    def send(self, text=None, **message):
        self._loop.run(self._send(message if text is None else text))

    def write(self, data):
        """Send bytes that need not be frames; fewer where the connection ends."""
        async def write():
            self._socket._response.connection.transport.write(data)
        self._loop.run(write())

    def flood(self, count, **message):
        """Send so many messages as fast as they go; fewer where the connection ends."""
        async def send():
            with contextlib.suppress(ConnectionError, RuntimeError):
                for _ in range(count):
                    await self._send(message)
        self._loop.run(send())

    def wait(self, kind, holds=lambda message: True, timeout=WAIT, since=0):
        """Return the first message of a kind that came after ``since`` others and for which this holds."""
        def found():
            return next((m for m in self.messages[since:] if m["t"] == kind and holds(m)), None)
        message = eventually(found, timeout)
        assert message is not None, "no %s in %s" % (kind, self.messages[-5:])
        return message

    def ask(self, kind="cmd", timeout=WAIT, **fields):
        """Send a request and return its answer."""
        self._number += 1
        number = self._number
        self.send(t=kind, id=number, **fields)
        return self.wait("history" if kind == "history" else "answer", lambda m: m["id"] == number, timeout)

    def command(self, cmd, arm, timeout=WAIT, **args):
        return self.ask(arm=arm, cmd=cmd, args=args, timeout=timeout)

    def begin_command(self, cmd, arm, **args):
        """Send a command without waiting; return a function that waits for the answer."""
        self._number += 1
        number = self._number
        self.send(t="cmd", id=number, arm=arm, cmd=cmd, args=args)
        return lambda timeout=WAIT: self.wait("answer", lambda m: m["id"] == number, timeout)

    def watch(self, *arms, plots=False, rate=30):
        self.send(t="watch", arms=list(arms), plots=plots, rate=rate)

    def take_control(self):
        answer = self.ask("take_control")
        return answer["ok"]

    # ---- jog ----

    @property
    def held(self):
        """The number of the press that is held, or was the last."""
        return self._hold

    def press(self, arm, values, space="joint", step=None):
        """Hold a button from now on; return the number of the press."""
        self._hold += 1
        self._held = {"arm": arm, "space": space, "v": list(values), "step": step, "hold": self._hold}
        if self._holding is None:
            self._loop.run(self._begin_holding())
        return self._hold

    async def _begin_holding(self):
        self._holding = asyncio.ensure_future(self._hold_for_ever())

    async def _hold_for_ever(self):
        with contextlib.suppress(ConnectionError, RuntimeError):
            while True:
                if self._held is not None and not self.is_silent:
                    await self.beat()
                await asyncio.sleep(PERIOD_S)

    async def beat(self, **changes):
        """Send one heartbeat."""
        self._sequence += 1
        if not self.is_stalled:
            self.sent_at = time.monotonic()
        await self._send(dict(self._held, t="jog", seq=self._sequence, clock=1000.0 * time.monotonic(), echo=self.now,
                              **changes))

    def release(self):
        """Release the button, and send that."""
        held, self._held = self._held, None
        if held is not None:
            self.send(t="jog_stop", hold=held["hold"])

    def let_go_silently(self):
        self._held = None

    def jog_states(self, hold):
        return [m for m in self.messages if m["t"] == "jog" and m["hold"] == hold]

    # ---- end ----

    def close(self):
        """Close the page like a browser's tab."""
        self._loop.run(self._close())

    async def _close(self):
        for task in (self._ping, self._holding):
            if task is not None:
                task.cancel()
        await self._socket.close()
        await self._session.close()

    def cut(self):
        """Close the connection without a farewell."""
        self._held = None
        self._loop.run(self._cut())

    async def _cut(self):
        for task in (self._ping, self._holding, self._reading):
            if task is not None:
                task.cancel()
        transport = self._socket._response.connection.transport
        transport.abort()
        await self._session.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.closed is None:
            with contextlib.suppress(Exception):
                self.close()


def refused(loop, panel, **headers):
    """Return the status with which a WebSocket is refused, with these headers instead of a page's."""
    async def connect():
        async with aiohttp.ClientSession() as session:
            with contextlib.suppress(KeyError):
                own = {"Origin": "http://127.0.0.1:%d" % panel.port}
                own.update(headers)
                headers_sent = {name: value for name, value in own.items() if value is not None}
            try:
                async with session.ws_connect("http://127.0.0.1:%d/ws" % panel.port, headers=headers_sent):
                    return None
            except aiohttp.WSServerHandshakeError as error:
                return error.status
    return loop.run(connect())


def get(loop, panel, path, method="GET", **headers):
    """Return status, headers and text of a request; the path goes out as it stands here."""
    async def fetch():
        reader, writer = await asyncio.open_connection("127.0.0.1", panel.port)
        sent = dict({"Host": "127.0.0.1:%d" % panel.port, "Connection": "close"}, **headers)
        lines = ["%s %s HTTP/1.1" % (method, path)] + ["%s: %s" % item for item in sent.items() if item[1] is not None]
        writer.write(("\r\n".join(lines) + "\r\n\r\n").encode())
        raw = await reader.read()
        writer.close()
        head, _, body = raw.partition(b"\r\n\r\n")
        rows = head.decode().split("\r\n")
        return int(rows[0].split()[1]), {row.split(":", 1)[0].lower(): row.split(":", 1)[1].strip()
                                         for row in rows[1:]}, body
    return loop.run(fetch())
