"""The newest messages in memory, and a file of them at each trigger.

It stands where a recording's files stand (``RollingFiles``): the writing thread hands it every message in order.
"""
import collections
import dataclasses
import time
from pathlib import Path
from typing import Deque, List, Optional, Tuple

from jaka_bag.cli.record import LogRecording
from jaka_bag.live.rolling_files import FileSettings, RollingFiles
from jaka_bag.live.stream_account import PublisherStream

_Item = Tuple[float, PublisherStream, int, int, bytes]
"""A message in memory; the first is when it came, s of a clock that nobody sets."""


class Snapshots:
    """The newest messages of a recording. ``trigger`` may be called from any thread.

    Args:
        recorder: The recording.
        newest_s: Time for which a message stays in memory, s.

    Attributes:
        finished: Finished files, oldest first.
        messages: Messages in files.
        is_large_enough: Never: snapshots are taken until the recording is ended.
    """

    is_large_enough = False

    def __init__(self, recorder: LogRecording, newest_s: float) -> None:
        self._recorder = recorder
        self._newest_s = newest_s
        self._ring: Deque[_Item] = collections.deque()
        self._ring_bytes = 0
        self._is_asked = False  # no Event: its lock is not for signal handlers
        self._is_due = False
        self._files: Optional[RollingFiles] = None
        self.finished: List[Path] = []
        self.messages = 0

    def begin(self) -> "Snapshots":
        """Return itself: the place where the recording's messages go."""
        return self

    def trigger(self) -> None:
        """Write what is in memory to a file; a signal handler may call it."""
        self._is_asked = True

    # The writing thread

    def add(self, stream: PublisherStream, log_time: int, publish_time: int, payload: bytes) -> None:
        """Take one message; times in ns."""
        self._ring.append((time.monotonic(), stream, log_time, publish_time, payload))
        self._ring_bytes += len(payload)

    def tick(self) -> None:
        """Forget what is old; write a snapshot one tick after it was asked for: all that came before is in memory then.

        Raises:
            BagError: The file cannot be written.
        """
        self._trim()
        is_due, self._is_due = self._is_due, self._is_asked
        if self._is_due:  # one that comes from here on is in the same snapshot
            self._is_asked = False
        if is_due:
            self._write()

    def lose_chunk(self) -> None:
        """Count the messages of a chunk that the system refused as unwritten."""
        if self._files is not None:
            self._files.lose_chunk()

    def close(self) -> None:
        """Write the snapshot that was asked for last; finish the one that could not be written.

        Raises:
            BagError: It cannot be written.
        """
        if self._files is None and (self._is_due or self._is_asked):
            self._write()
        elif self._files is not None:
            try:
                self._files.close()
            finally:
                self._note(self._files)

    def _trim(self) -> None:
        oldest = time.monotonic() - self._newest_s
        most = self._recorder.args.buffsize
        while self._ring and (self._ring[0][0] < oldest or (most and self._ring_bytes > most)):
            self._ring_bytes -= len(self._ring.popleft()[-1])

    def _write(self) -> None:
        self._files = files = self._recorder.open_log(self._settings())
        for _, stream, log_time, publish_time, payload in self._ring:
            files.add(stream, log_time, publish_time, payload)
        files.close()
        self._note(files)
        self._ring.clear()
        self._ring_bytes = 0
        self._recorder.console.always("snapshot of %d messages in %s" % (files.messages, files.finished[-1]))

    def _note(self, files: RollingFiles) -> None:
        self._files = None
        self.messages += files.messages
        self.finished += files.finished

    def _settings(self) -> FileSettings:
        """Return the recording's settings with a name that no file has."""
        settings = self._recorder.settings
        date = time.strftime("%Y-%m-%d-%H-%M-%S")
        stem = settings.stem.with_name("%s_snapshot_%s" % (settings.stem.name, date))
        number = 1
        while dataclasses.replace(settings, stem=stem).path(0).exists():
            number += 1
            stem = settings.stem.with_name("%s_snapshot_%s_%d" % (settings.stem.name, date, number))
        return dataclasses.replace(settings, stem=stem)
