"""Converts one file as one job that can be handed to another process or machine."""
import importlib
import multiprocessing
import os
import signal
import time
from pathlib import Path
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

from ..containers.registry import create_log, open_log
from ..containers.writer import ChunkWriter
from ..errors import BagError, JakaBagError, MissingDependency
from ..messages.selection import Picker, Selection, TimeSpan
from ..pipeline import WORKERS
from .copying import OnProgress, copy_log


class Job(NamedTuple):
    """One file to convert.

    Attributes:
        source: A .bag or .mcap, by content.
        target: .bag or .mcap by suffix, or a folder for the profile ``ros2``.
        selection: Which messages, times excepted.
        span: Which times.
        compression: None for the target format's default.
        level: The codec's level; None for its default.
        profile: ``ros1``, or ``ros2`` for a rosbag2 folder.
        overwrite: Replace an existing target.
        workers: Threads.
        keep_latched: Also the newest message before the span of each latched publisher.
    """

    source: str
    target: str
    selection: Selection = Selection()
    span: TimeSpan = TimeSpan()
    compression: Optional[str] = None
    level: Optional[int] = None
    profile: str = "ros1"
    overwrite: bool = False
    workers: int = WORKERS
    keep_latched: bool = False


class Outcome(NamedTuple):
    """What became of a job.

    Attributes:
        source: Its source.
        target: Its target.
        messages: Messages written.
        bytes_read: Size of the source.
        bytes_written: Size of the target.
        seconds: Wall time, s.
        notes: What the target cannot hold.
        error: Why there is no target; empty on success.
    """

    source: str
    target: str
    messages: int = 0
    bytes_read: int = 0
    bytes_written: int = 0
    seconds: float = 0.0
    notes: Tuple[str, ...] = ()
    error: str = ""

    def document(self) -> Dict[str, Any]:
        """The outcome as JSON data."""
        return dict(self._asdict(), notes=list(self.notes), error=self.error or None)


def same_file(a: str, b: str) -> bool:
    """True where both names lead to one file."""
    try:
        return os.path.samefile(a, b)
    except OSError:
        return False


def size_of(path: str) -> int:
    """Bytes of a file, or of the files in a folder."""
    target = Path(path)
    files = target.rglob("*") if target.is_dir() else [target]
    return sum(file.stat().st_size for file in files if file.is_file())


def convert_file(job: Job, on_progress: Optional[OnProgress] = None) -> Outcome:
    """Convert one file.

    Raises:
        BagError: The source cannot be read, or the target cannot be written or hold it.
    """
    begin = time.monotonic()
    if same_file(job.source, job.target):
        raise BagError("%s is input and output" % job.source)
    with open_log(job.source) as reader:
        index = reader.index
        selection = job.span.apply(job.selection, index.start_time, index.end_time)
        writer: ChunkWriter
        with create_log(job.target, job.compression, job.level, job.overwrite, index.profile or "ros1",
                        job.profile == "ros2") as writer:
            result = copy_log(reader, writer, Picker(selection, reader.connections), on_progress, job.workers,
                              selection.start_time if job.keep_latched else None)
    return Outcome(job.source, job.target, result.messages, index.size, size_of(job.target),
                   time.monotonic() - begin, result.notes)


def try_convert(job: Job) -> Outcome:
    """As ``convert_file``, but a failure is an outcome: for jobs among others."""
    try:
        return convert_file(job)
    except JakaBagError as error:
        return Outcome(job.source, job.target, error=" ".join(str(error).split()))
    except OSError as error:
        return Outcome(job.source, job.target, error="%s: %s" % (error.filename or job.source, error.strerror))


class _Worker:
    """What a worker process does with signals: the parent gets Ctrl-C and ends its workers by SIGTERM."""

    is_at_work = False

    @classmethod
    def prepare(cls) -> None:
        """Run in each worker when it starts."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, cls._on_end)

    @classmethod
    def _on_end(cls, number: int, frame: Any) -> None:
        if cls.is_at_work:
            raise KeyboardInterrupt  # the half output is removed on the way
        os._exit(1)

    @classmethod
    def work(cls, job: Job) -> Outcome:
        """Do one job."""
        cls.is_at_work = True
        try:
            return try_convert(job)
        except KeyboardInterrupt:
            os._exit(1)  # jobs that wait are not begun
        finally:
            cls.is_at_work = False


def convert_many(jobs: List[Job], processes: int, on_outcome: Callable[[Outcome], None]) -> None:
    """Convert files side by side in processes; outcomes come as they are ready."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    with ProcessPoolExecutor(processes, initializer=_Worker.prepare) as pool:
        try:
            futures = {pool.submit(_Worker.work, job): job for job in jobs}
            for future in as_completed(futures):
                job = futures[future]
                try:
                    on_outcome(future.result())
                except BrokenProcessPool:
                    on_outcome(Outcome(job.source, job.target, error="%s: its process was killed" % job.source))
        except KeyboardInterrupt:
            # Without its processes the pool gives up the jobs that wait; it does not bear them to be cancelled then.
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def convert_on_dask(jobs: List[Job], address: str, on_outcome: Callable[[Outcome], None]) -> None:
    """Convert files on the workers of a Dask cluster, which see the same folders and have this package.

    Raises:
        BagError: The cluster cannot be reached.
        MissingDependency: ``distributed`` is not installed.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError:
        raise MissingDependency("--dask needs the Python package distributed") from None
    try:
        client = distributed.Client(address, timeout="20s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise BagError("cannot reach the Dask scheduler %s: %s" % (address, error)) from error
    with client, client.as_current():
        futures = client.map(try_convert, jobs, pure=False, retries=1)
        by_key = {future.key: job for future, job in zip(futures, jobs)}
        for future in distributed.as_completed(futures):
            job = by_key[future.key]
            problem = future.exception()
            if problem is None:
                on_outcome(future.result())
            else:
                on_outcome(Outcome(job.source, job.target, error="%s: %s" % (job.source, problem)))
