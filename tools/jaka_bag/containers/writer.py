"""What the writers of both formats share: output in whole records, single messages collected into chunks."""
import os
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, List, Optional, Type, TypeVar, Union

import numpy as np

from ..errors import WriteFailed
from ..messages.batch import Array, Block
from ..messages.connection import Connection
from ..output_file import OutputFile
from ..paths import PathLike

Self = TypeVar("Self", bound="ChunkWriter")


class ChunkWriter:
    """A log being written; nothing of the final name exists before ``close``.

    Args:
        target: Final path, or an open binary file that can seek (which is neither renamed nor closed).
        chunk_size: Single messages are collected up to this many bytes before a chunk is closed.
        overwrite: Replace an existing file.
        suffix: What the working name has more than the final one.
        keep_leftover: Refuse to take over the working file of a killed program.

    Attributes:
        name: The final name, for messages.
        position: Bytes written to the file so far.
        message_count: Messages in closed chunks so far.
        pending_bytes: Bytes of payload collected for the chunk that is not closed yet.

    Raises:
        BagError: The output cannot be created.
    """

    def __init__(self, target: Union[PathLike, BinaryIO], chunk_size: int, overwrite: bool, suffix: str,
                 keep_leftover: bool) -> None:
        self._output: Union[OutputFile, BinaryIO]
        if isinstance(target, (str, os.PathLike)):
            self._output = OutputFile(target, overwrite, suffix, keep_leftover)
            self.name = str(target)
        else:
            self._output = target
            self.name = "the output"
        self.chunk_size = chunk_size
        self.position = 0
        self.message_count = 0
        self._closed = False
        self._reset_pending()

    def _reset_pending(self) -> None:
        self._payloads: List[bytes] = []
        self._channels_pending: List[int] = []
        self._log_times: List[int] = []
        self._publish_times: List[int] = []
        self._sequences: List[int] = []
        self.pending_bytes = 0

    @property
    def working_path(self) -> Optional[Path]:
        """The name of the file while it is written; None for an open file."""
        return self._output.working_path if isinstance(self._output, OutputFile) else None

    @property
    def pending_messages(self) -> int:
        """Messages collected for the chunk that is not closed yet."""
        return len(self._payloads)

    def fileno(self) -> int:
        """The descriptor, for ``fsync``."""
        return self._output.file.fileno() if isinstance(self._output, OutputFile) else self._output.fileno()

    def _write(self, *pieces: bytes) -> int:
        """Write records; give the position of the first. On failure the file is cut back to before them."""
        begin = self.position
        try:
            for piece in pieces:
                self._output.write(piece)
                self.position += len(piece)
        except OSError as error:
            self.position = begin
            if isinstance(self._output, OutputFile):
                self._output.file.truncate(begin)
                self._output.file.seek(begin)
            raise WriteFailed(self.name, error) from error
        return begin

    def _rewrite(self, at: int, data: bytes) -> None:
        """Replace bytes at a position of the file."""
        file = self._output.file if isinstance(self._output, OutputFile) else self._output
        try:
            file.seek(at)
            self._output.write(data)
            file.seek(self.position)
        except OSError as error:
            raise WriteFailed(self.name, error) from error

    def add_channel(self, connection: Connection) -> int:
        """Number of a connection in this file; an equal connection gets the same number.

        Raises:
            BagError: The format cannot hold it.
            WriteFailed: The system refused.
        """
        raise NotImplementedError

    def encode(self, block: Block, channel_ids: Array) -> Any:
        """Make a chunk of a block; changes nothing of the writer, so several threads may encode at once.

        Args:
            block: The messages.
            channel_ids: Number in this file of each of the block's connections, by their number there.

        Raises:
            BagError: A time or the size of the block does not fit into the format.
        """
        raise NotImplementedError

    def append(self, chunk: Any) -> None:
        """Write a chunk that ``encode`` made.

        Raises:
            WriteFailed: The system refused.
        """
        raise NotImplementedError

    def add_message(self, channel_id: int, log_time: int, payload: bytes, publish_time: Optional[int] = None,
                    sequence: int = 0) -> None:
        """Add one message; the chunk is closed when it has ``chunk_size`` bytes.

        Args:
            channel_id: From ``add_channel``.
            log_time: Time of recording, ns since the epoch.
            payload: The serialised message.
            publish_time: ns; None for ``log_time``. A .bag has no place for it.
            sequence: Message number, 0 where there is none. A .bag has no place for it.

        Raises:
            WriteFailed: The system refused.
        """
        self._payloads.append(payload)
        self._channels_pending.append(channel_id)
        self._log_times.append(log_time)
        self._publish_times.append(log_time if publish_time is None else publish_time)
        self._sequences.append(sequence)
        self.pending_bytes += len(payload)
        if self.pending_bytes >= self.chunk_size:
            self.flush()

    def flush(self) -> None:
        """Close the chunk of the single messages added so far and hand it to the system.

        Raises:
            WriteFailed: The system refused; the messages of this chunk are lost, the file before it is whole.
        """
        if not self._payloads:
            return
        length = np.array(list(map(len, self._payloads)), np.int64)
        channel = np.array(self._channels_pending, np.int32)
        block = Block(np.frombuffer(b"".join(self._payloads), np.uint8), np.cumsum(length) - length, length, channel,
                      np.array(self._log_times, np.uint64).view(np.int64),
                      np.array(self._publish_times, np.uint64).view(np.int64),
                      np.array(self._sequences, np.uint64).astype(np.uint32))
        self._reset_pending()
        self.append(self.encode(block, np.arange(int(channel.max()) + 1)))

    def _finish(self) -> None:
        """Write what follows the last chunk."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the last chunk, finish the file and give it its name.

        Raises:
            WriteFailed: The system refused; the working file stays, readable up to its last whole record.
            OutputExists: The final name was taken meanwhile; the working file stays.
        """
        if self._closed:
            return
        self.flush()
        self._finish()
        self._closed = True
        if isinstance(self._output, OutputFile):
            try:
                self._output.commit()
            except OSError as error:
                raise WriteFailed(self.name, error) from error

    def abort(self) -> None:
        """Give up: remove the working file."""
        self._closed = True
        if isinstance(self._output, OutputFile):
            self._output.abort()

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], value: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()
