"""Converts many files as jobs: in processes of this computer, or on the workers of a Dask cluster."""
import importlib
import multiprocessing
import os
import signal
from typing import Any, Callable, List

from ..errors import BagError, JakaBagError, MissingDependency
from .convert import Job, WriteResult, convert_file


def try_convert(job: Job) -> WriteResult:
    """As ``convert_file``, but a failure is a result: for jobs among others."""
    try:
        return convert_file(job)
    except JakaBagError as error:
        return WriteResult(job.source, job.target, error=" ".join(str(error).split()))
    except OSError as error:
        return WriteResult(job.source, job.target, error="%s: %s" % (error.filename or job.source, error.strerror))


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
    def work(cls, job: Job) -> WriteResult:
        """Do one job."""
        cls.is_at_work = True
        try:
            return try_convert(job)
        except KeyboardInterrupt:
            os._exit(1)  # jobs that wait are not begun
        finally:
            cls.is_at_work = False


def convert_many(jobs: List[Job], processes: int, on_result: Callable[[WriteResult], None]) -> None:
    """Convert files side by side in processes; results come as they are ready."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool

    with ProcessPoolExecutor(processes, initializer=_Worker.prepare) as pool:
        try:
            futures = {pool.submit(_Worker.work, job): job for job in jobs}
            for future in as_completed(futures):
                job = futures[future]
                try:
                    on_result(future.result())
                except BrokenProcessPool:
                    on_result(WriteResult(job.source, job.target, error="%s: its process was killed" % job.source))
        except KeyboardInterrupt:
            # Without its processes the pool gives up the jobs that wait; it does not bear them to be cancelled then.
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def convert_on_dask(jobs: List[Job], address: str, on_result: Callable[[WriteResult], None]) -> None:
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
                on_result(future.result())
            else:
                on_result(WriteResult(job.source, job.target, error="%s: %s" % (job.source, problem)))
