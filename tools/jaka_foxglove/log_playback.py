"""Logs as channels, played from their index: only some batches are read before they are due."""
import asyncio
import contextlib
import math
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Coroutine, Deque, Dict, FrozenSet, Iterable, List, NamedTuple, Optional, Set, Tuple

from jaka_bag.errors import BagError, JakaBagError
from jaka_bag.live.log_source import LogSource, ReadAhead, Timed

from . import protocol
from .outbox import SocketFrame
from .playback_clock import PlaybackClock
from .protocol import PlaybackControl, channel_of
from .source import ChannelSource, Recipient

_TICK_S = 1.0 / 60
"""Period, s, of the playback: that of a screen."""
_READY_POLL_S = 0.005
"""Period, s, of the looks whether the reading thread has more: it is far behind where it has not."""
_FIRST_WAIT_S = 0.5
"""Delay, s, of the playback after the first subscription: viewers subscribe one topic after the other."""
_BUFFERING_S = 0.3
"""Time, s, of waiting for data after which viewers see that the playback is buffering."""
_TIME_STEP_NS = 1000000
"""Least step, ns, of the time that viewers get: with each of thousands of messages it would be the most of the traffic.
"""
_MOST_IN_ONE_GO = 2000
"""Messages sent before other viewers and requests have their turn."""


class PlaybackOptions(NamedTuple):
    """The options of a playback: log seconds per second; begin paused; begin again at the end."""

    speed: float = 1.0
    is_paused: bool = False
    is_looping: bool = False


class LogPlayback(ChannelSource):
    """Logs, played for all viewers alike: one position, one speed.

    It stands still while nobody is subscribed to anything.

    Args:
        name: Name that viewers show.
        source: The logs, opened for payloads.
        options: Options of the playback.
        notice: Takes a line for the user.

    Raises:
        BagError: There is nothing to show.
    """

    def __init__(self, name: str, source: LogSource, options: PlaybackOptions, notice: Callable[[str], None]) -> None:
        super().__init__(name)
        if not source.connections or not source.end:
            raise BagError("nothing to show: no topic is wanted, or there is no message")
        self.capabilities = ("playbackControl", "time")
        self.time_range = source.begin, source.end
        self._source = source
        self._options = options
        self._notice = notice
        self._clock = PlaybackClock(source.begin, source.end, options.speed, not options.is_paused)
        self._numbers: List[int] = []
        kinds: Dict[Tuple[str, ...], int] = {}
        for connection in source.connections:
            kind = (connection.topic, connection.encoding, connection.datatype, connection.schema_encoding,
                    connection.definition)
            number = kinds.setdefault(kind, len(kinds) + 1)
            self.channels.setdefault(number, channel_of(number, connection))
            self._numbers.append(number)
        topics = [channel.topic for channel in self.channels.values()]
        for topic in sorted({topic for topic in topics if topics.count(topic) > 1}):
            notice("%s has several types: some viewers show only the first" % topic)
        if all(channel.encoding == "ros1" for channel in self.channels.values()):
            self.metadata = {"ROS_DISTRO": "noetic"}  # viewers read ROS 1 out of it
        self._topics: FrozenSet[str] = frozenset()
        self._ahead: Optional[ReadAhead] = None
        self._pending: Deque[Timed] = deque()
        self._is_stale = True
        self._is_over = False
        self._has_ended = False
        self._sought: Optional[int] = None
        self._sent_to = source.begin - 1
        self._last: Dict[int, int] = {}
        self._told_time = 0
        self._is_complete = True
        self._is_buffering = False
        self._starving_since: Optional[float] = None
        self._begins_at: Optional[float] = None
        self._turn = 0
        self._is_closing = False
        self._tasks: Set[asyncio.Task[None]] = set()
        self._readers = ThreadPoolExecutor(4)

    # What the server calls

    async def open(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._event = asyncio.Event()
        self._clock.hold(self._loop.time(), True)
        self._clock.seek(self._loop.time(), self._clock.begin)
        self._player = asyncio.ensure_future(self._play())

    async def close(self) -> None:
        self._is_closing = True  # wait_for of Python before 3.12 loses a cancel that comes together with the event
        for task in [self._player, *self._tasks]:
            task.cancel()
        await asyncio.gather(self._player, *self._tasks, return_exceptions=True)
        if self._ahead is not None:
            await self._loop.run_in_executor(self._readers, self._ahead.close)
        await self._loop.run_in_executor(None, self._readers.shutdown)  # what was cancelled may still be reading
        await self._loop.run_in_executor(None, self._source.close)

    def greeting(self) -> List[SocketFrame]:
        now = self._loop.time()
        return [protocol.time_data(self._clock.position(now)),
                protocol.playback_state(self._state(), self._clock.position(now), self._clock.speed, False)]

    def want(self, channels: FrozenSet[int]) -> None:
        topics = frozenset(self.channels[number].topic for number in channels)
        if topics != self._topics:
            self._topics = topics
            self._is_stale = True
            if self._begins_at is None and topics:
                self._begins_at = self._loop.time() + _FIRST_WAIT_S
            self._event.set()

    def subscribed(self, recipient: Recipient, channel: int) -> None:
        if self._sent_to >= self._clock.begin:
            self._run(self._send_newest(recipient, channel))

    def control(self, request: PlaybackControl) -> None:
        if not math.isfinite(request.speed) or request.speed <= 0:
            raise JakaBagError("a speed of %g cannot be played" % request.speed)
        now = self._loop.time()
        seek = request.seek
        if seek is None and request.is_playing and self._has_ended:
            seek = self._clock.begin
        self._clock.set(now, request.is_playing, request.speed)
        if seek is not None:
            self._clock.seek(now, seek)
            self._sought = self._clock.position(now)
            self._has_ended = False
            self._turn += 1
            self.audience.forget_messages()
        self._tell_state(seek is not None, request.request)
        if self._sought is not None:
            self._tell_time(self._sought)
        self._event.set()

    # Telling

    def _state(self) -> int:
        if self._has_ended:
            return protocol.ENDED
        if not self._clock.is_playing:
            return protocol.PAUSED
        return protocol.BUFFERING if self._is_buffering else protocol.PLAYING

    def _tell_state(self, did_seek: bool = False, request: str = "") -> None:
        position = self._clock.position(self._loop.time()) if self._sought is None else self._sought
        self.audience.tell(protocol.playback_state(self._state(), position, self._clock.speed, did_seek, request))

    def _tell_time(self, time: int) -> None:
        self._told_time = time
        self.audience.tell_time(time)

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _newest(self, channels: Iterable[int], time: int) -> List[Timed]:
        """Return the newest message of each connection of the channels up to a log time, ns."""
        wanted = frozenset(channels)
        numbers = [i for i, channel in enumerate(self._numbers) if channel in wanted]
        try:
            return await self._loop.run_in_executor(self._readers, self._source.newest, time, numbers)
        except BagError as error:
            self._damaged(error)
            return []

    def _damaged(self, error: Exception) -> None:
        self._notice(str(error))
        self.audience.tell(protocol.status(protocol.ERROR, str(error), "log"))

    async def _send_newest(self, recipient: Recipient, channel: int) -> None:
        turn = self._turn
        for message in await self._newest([channel], self._sent_to):
            if turn == self._turn and self._last.get(channel, message.time) <= message.time:
                recipient.deliver(channel, message.time, message.frame)

    # Playing

    async def _play(self) -> None:
        while not self._is_closing:
            wait_s: Optional[float] = None
            now = self._loop.time()
            if self._begins_at is None or not self._topics or now < self._begins_at:
                self._clock.hold(now, True)
                wait_s = self._begins_at - now if self._begins_at is not None and self._topics else None
            else:
                if self._sought is not None:
                    await self._go_to(self._sought)
                wait_s = self._step(self._loop.time())
            if wait_s is not None and wait_s <= 0.0:
                await asyncio.sleep(0)
                continue
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._event.wait(), wait_s)
            self._event.clear()

    def _read_from(self, time: int) -> None:
        """Mark all messages before a log time, ns, as sent, so that reading begins there."""
        self._sent_to = time - 1
        self._is_complete = self._is_stale = True
        self._last.clear()
        self._turn += 1

    async def _go_to(self, time: int) -> None:
        """Show what was newest before a log time, ns, and go on from there."""
        self._sought = None
        self._read_from(time)
        turn = self._turn
        if time > self._clock.begin:
            channels = [number for number, channel in self.channels.items() if channel.topic in self._topics]
            for message in await self._newest(channels, time - 1):
                if turn == self._turn and self._sought is None:
                    self.audience.deliver(self._numbers[message.connection], message.time, message.frame)

    def _step(self, now: float) -> Optional[float]:
        """Send the messages that are due; return the time to wait then, s, None until something changes."""
        if self._sought is not None:
            return 0.0
        if self._is_stale and self._is_complete:
            self._open_at(self._sent_to + 1)
        clock = self._clock
        position = clock.position(now)
        self._is_complete = False
        for _ in range(_MOST_IN_ONE_GO):
            if not self._is_ready():
                return self._starve(now)
            if not self._pending or self._pending[0].time > position:
                break
            self._send(self._pending.popleft())
        else:
            return 0.0
        self._is_complete = True
        self._sent_to = max(self._sent_to, position)
        clock.hold(now, False)
        self._starving_since = None
        if self._is_buffering:
            self._is_buffering = False
            self._tell_state()
        if position - self._told_time >= _TIME_STEP_NS:
            self._tell_time(position)
        if not clock.is_playing:
            return None
        if position < clock.end:
            return _TICK_S
        return self._end(now)

    def _open_at(self, time: int) -> None:
        """Begin to read at a log time, ns, the topics that are wanted now."""
        self._is_stale = False
        if self._ahead is not None:
            self._loop.run_in_executor(self._readers, self._ahead.close)
        self._ahead = self._source.play(time, None, self._topics)
        self._pending.clear()
        self._is_over = False

    def _is_ready(self) -> bool:
        """Return whether the next step is known: a message that was read, or the end."""
        if self._pending or self._is_over:
            return True
        assert self._ahead is not None
        try:
            batch = self._ahead.poll()
        except BagError as error:
            self._damaged(error)
            batch = []
        if batch is None:
            return False
        self._pending.extend(batch)
        self._is_over = not batch
        return True

    def _starve(self, now: float) -> float:
        self._clock.hold(now, True)
        if self._starving_since is None:
            self._starving_since = now
        if now - self._starving_since > _BUFFERING_S and not self._is_buffering:
            self._is_buffering = True
            self._tell_state()
        return _READY_POLL_S

    def _send(self, message: Timed) -> None:
        if message.time - self._told_time >= _TIME_STEP_NS:
            self._tell_time(message.time)
        channel = self._numbers[message.connection]
        self._last[channel] = message.time
        self.audience.deliver(channel, message.time, message.frame)

    def _end(self, now: float) -> Optional[float]:
        if self._options.is_looping:
            self._clock.seek(now, self._clock.begin)
            self._read_from(self._clock.begin)
            self._tell_state(True)
            self._tell_time(self._clock.begin)
            return 0.0
        self._has_ended = True
        self._clock.set(now, False, self._clock.speed)
        self._tell_state()
        return None
