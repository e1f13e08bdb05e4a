"""Audit lines of message streams: one when a stream begins, one with the number of messages when it has ended.

A servo stream or a held jog is one act of one node; a line for each of its messages would bury all others.
"""
import threading
import time
from typing import Any, Callable, Dict, Hashable, List, Mapping, Tuple

QUIET_S = 1.0
"""Silence, s, after which a stream has ended."""
MOST_STREAMS = 200
"""Most streams that are followed at a time: callers with new names for ever end the oldest, and take no memory."""

_Write = Callable[[str, Mapping[str, Any]], None]


class _Stream:
    """One stream that has not ended."""

    def __init__(self, about: Mapping[str, Any], now: float) -> None:
        self.about = about
        self.began_at = self.last_at = now
        self.messages = self.refused = 0
        self.last_refusal = ""


class Streams:
    """The message streams that have not ended."""

    def __init__(self, write: _Write, clock: Callable[[], float] = time.monotonic) -> None:
        """Set up the table of streams.

        Args:
            write: Takes kind and fields of a line; it must not wait.
            clock: Monotonic time, s.
        """
        self._write = write
        self._clock = clock
        self._lock = threading.Lock()
        self._streams: Dict[Hashable, _Stream] = {}

    def note(self, key: Hashable, about: Callable[[], Mapping[str, Any]], refusal: str = "") -> None:
        """Count one message of a stream, and write a line where it begins a stream or changes whether messages are
        refused.

        Args:
            key: Equal for the messages of one stream.
            about: Returns the fields of its first line: what, who, the first message.
            refusal: Why the message moved nothing; "" where it was taken.
        """
        lines: List[Tuple[str, Mapping[str, Any]]] = []
        first = None if key in self._streams else about()
        with self._lock:
            now = self._clock()
            stream = self._streams.get(key)
            if stream is None:
                if len(self._streams) >= MOST_STREAMS:
                    lines.append(self._end(min(self._streams, key=lambda other: self._streams[other].last_at)))
                stream = self._streams[key] = _Stream(about() if first is None else first, now)
                lines.append(("stream", {"state": "begins", **stream.about, "ok": not refusal, "message": refusal}))
            elif refusal and not stream.refused:
                lines.append(("stream", {"state": "a message is refused", **_who(stream), "ok": False,
                                         "message": refusal}))
            elif not refusal and stream.messages == stream.refused:
                lines.append(("stream", {"state": "a message is taken", **_who(stream), "ok": True, "message": ""}))
            stream.last_at = now
            stream.messages += 1
            stream.refused += bool(refusal)
            stream.last_refusal = refusal or stream.last_refusal
        for kind, fields in lines:
            self._write(kind, fields)

    def end_quiet(self, quiet: float = QUIET_S) -> None:
        """End the streams without a message for ``quiet`` s."""
        with self._lock:
            now = self._clock()
            lines = [self._end(key) for key, stream in list(self._streams.items()) if now - stream.last_at >= quiet]
        for kind, fields in lines:
            self._write(kind, fields)

    def _end(self, key: Hashable) -> Tuple[str, Mapping[str, Any]]:
        stream = self._streams.pop(key)
        return "stream", {"state": "has ended", **_who(stream), "messages": stream.messages, "refused": stream.refused,
                          "last_refusal": stream.last_refusal, "seconds": round(stream.last_at - stream.began_at, 3)}


def _who(stream: _Stream) -> Dict[str, Any]:
    return {name: value for name, value in stream.about.items() if name != "arguments"}
