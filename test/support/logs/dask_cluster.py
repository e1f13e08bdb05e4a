"""A Dask scheduler with workers, each a process, on free ports of this machine."""
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Dict, List, Optional

from waiting import free_port

DEADLINE_S = 120
ROOT = Path(__file__).resolve().parents[3]


class DaskCluster:
    """A context with a scheduler and workers, which ends them.

    Args:
        folder: Folder for its files.
        workers: Number of workers.
        python: An interpreter with packages of its own, in place of this one with those of the checkout.

    Attributes:
        address: The scheduler's address.
        workers: The processes of the workers that were begun, dead ones among them.
    """

    def __init__(self, folder: Path, workers: int = 2, python: Optional[Path] = None) -> None:
        self._folder = folder
        self._python = str(python or sys.executable)
        self._port = free_port()
        self.address = "tcp://127.0.0.1:%d" % self._port
        self._environment: Dict[str, str] = dict(
            os.environ, DASK_DISTRIBUTED__WORKER__DAEMON="False",
            PYTHONPATH=os.pathsep.join([str(ROOT / "tools"), str(ROOT / "test" / "support" / "live"),
                                        str(ROOT / "test" / "support" / "logs"), os.environ.get("PYTHONPATH", "")]))
        if python is not None:
            del self._environment["PYTHONPATH"]
        self._scheduler: Optional[subprocess.Popen] = None
        self.workers: List[subprocess.Popen] = []
        try:
            self.start_scheduler()
            for _ in range(workers):
                self.add_worker()
            if workers:
                self.wait_for_workers(workers)
        except BaseException:
            self.close()
            raise

    def _start(self, *words: str) -> subprocess.Popen:
        return subprocess.Popen([self._python, "-m", "distributed.cli." + words[0], *words[1:]],
                                env=self._environment, cwd=str(self._folder), stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL)

    def start_scheduler(self) -> None:
        """Start the scheduler, on the same port each time."""
        self._scheduler = self._start("dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port),
                                      "--no-dashboard")

    def kill_scheduler(self) -> None:
        """Kill the scheduler."""
        assert self._scheduler is not None
        self._scheduler.kill()
        self._scheduler.wait(DEADLINE_S)

    def add_worker(self) -> subprocess.Popen:
        """Start one more worker."""
        process = self._start("dask_worker", self.address, "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard",
                              "--no-nanny", "--death-timeout", str(DEADLINE_S))
        self.workers.append(process)
        return process

    def wait_for_workers(self, count: int) -> None:
        """Wait until so many workers have registered."""
        from distributed import Client
        end = time.monotonic() + DEADLINE_S
        while True:
            try:
                with Client(self.address, timeout=5, set_as_default=False) as client:
                    client.wait_for_workers(count, timeout=DEADLINE_S)
                return
            except OSError:
                if time.monotonic() > end:
                    raise

    def close(self) -> None:
        """End scheduler and workers."""
        processes = [process for process in [*self.workers, self._scheduler] if process is not None]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)
            process.wait(DEADLINE_S)

    def __enter__(self) -> "DaskCluster":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
