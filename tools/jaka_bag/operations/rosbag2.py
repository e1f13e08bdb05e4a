"""The conversion of a rosbag2 folder to a log of ROS 1 messages."""
import time
from typing import Optional

from ..containers.registry import create_log
from ..containers.rosbag2_folder import Rosbag2Folder
from ..errors import DefinitionError, UsageError
from ..messages.selection import require_match
from .convert import Job, OnProgress, WriteResult, size_of

_TOLD_EVERY = 1000


def convert_rosbag2(job: Job, on_progress: Optional[OnProgress] = None) -> WriteResult:
    """Convert a rosbag2 folder; topics whose types ROS 1 cannot have are left out, with a note.

    Raises:
        BagError: The folder cannot be read, or the target cannot be written.
        DefinitionError: No topic's type has a ROS 1 form, or a message does not fit its definition.
        UsageError: Nothing of the folder is selected.
    """
    begin = time.monotonic()
    with Rosbag2Folder(job.source) as folder:
        if folder.left_out and not folder.connections:
            raise DefinitionError("%s: %s" % (job.source, "; ".join(folder.left_out)))
        missing = require_match(job.selection, folder.connections, job.source)
        chosen = job.span.apply(job.selection, folder.start_time, folder.end_time)
        wanted = chosen.wanted(folder.connections).tolist()
        first = chosen.start_time if chosen.start_time is not None else 0
        last = chosen.end_time if chosen.end_time is not None else 1 << 63
        size = size_of(job.source)
        untold = written = 0
        with create_log(job.target, job.compression, job.level, job.overwrite) as writer:
            numbers = [writer.add_channel(connection) if is_wanted else -1
                       for connection, is_wanted in zip(folder.connections, wanted)]
            for number, log_time, raw in folder.messages():
                if wanted[number] and first <= log_time <= last:
                    writer.add_message(numbers[number], log_time, raw)
                    written += 1
                untold += 1
                if on_progress is not None and untold == _TOLD_EVERY:
                    on_progress(size * untold // max(folder.message_count, 1), untold)
                    untold = 0
            if not written and folder.message_count:
                raise UsageError("%s: no message is selected: the selected topics have none in the selected time"
                                 % job.source)
        return WriteResult(job.source, job.target, written, size, size_of(job.target), time.monotonic() - begin,
                           tuple(folder.left_out) + missing)
